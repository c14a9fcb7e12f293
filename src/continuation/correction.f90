!> The corrector of a step along a branch: Newton's method from where a point is expected, in the plane there.
module attrito_continuation_correction
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: inner_product
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_predictor, only: prediction_type
  implicit none
  private
  public :: correct

contains

  !> Solve where a point is expected, with sliders that are unknowns moved there. `distance`: how far the corrector moved.
  subroutine correct(solver, prediction, sliders_move, early_stop, distance)
    !> Solver of points, at the beginning of the step
    type(solver_type), intent(inout) :: solver
    !> Where the point is expected
    type(prediction_type), intent(in) :: prediction
    !> What start sliders are expected to move by [width, contacts]
    real(wp), intent(in) :: sliders_move(:, :)
    !> Give up after a few iterations of Newton's method
    logical, intent(in) :: early_stop
    !> From the prediction to the point, relative to the response; means do not count: they may jump as sliders shake down, however
    !> short the step
    real(wp), intent(out) :: distance
    real(wp), allocatable :: moved(:, :)

    associate (context => solver%context, balance => solver%context%balance)
      solver%motion = prediction%motion
      solver%omega = prediction%omega
      balance%slider = balance%slider + sliders_move
      call solver%solve_with(prediction%constraint, early_stop)
      moved = solver%motion - prediction%motion
      moved(1, :) = 0.0_wp
      distance = sqrt(inner_product(balance, moved, moved)/size_of_response(solver) &
                      + ((solver%omega - prediction%omega)/context%frequency_scale)**2)
    end associate
  end subroutine correct

  !> Squared norm of the harmonics of the motion.
  real(wp) function size_of_response(solver)
    !> Solver of points, corrected
    type(solver_type), intent(in) :: solver

    size_of_response = sum(solver%motion(2:, :)**2)
    call solver%context%balance%ranks%sum(size_of_response)
    size_of_response = max(size_of_response, tiny(1.0_wp))
  end function size_of_response
end module attrito_continuation_correction
