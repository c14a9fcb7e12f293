!> Newton's method on a peak and a plane: r(d, omega, p) = 0, psi(d, omega, p) = 0, l(d, omega, p) = lambda.
!>
!> Newton's step from a point is n + sigma t + pi d_p, its parts those of attrito_peak_condition; two unknowns are left,
!>
!> $$ \psi + \psi'[n] + \sigma \psi'[t] + \pi \psi'[d_p] = 0, \qquad l[n] + \sigma \, l[t] + \pi \, l[d_p] = \lambda - l, $$
!>
!> l = lambda being a plane across the curve of peaks, or a value of the parameter. One evaluation of the balance is one step, of
!> frequency response, peak and parameter together.
module attrito_peak_corrector
  use attrito_core_kinds, only: wp
  use attrito_balance_periodic_sliders, only: settle_sliders
  use attrito_newton_border, only: inner_product
  use attrito_newton_newton, only: newton_report_type
  use attrito_solve_sliders, only: found_moving
  use attrito_solve_solver, only: solver_type
  use attrito_peak_condition, only: problem_type, direction_type, linearisation_type, linearise, value_of, set_value, &
                                    scale_of_motion
  implicit none
  private
  public :: plane_type, correct, combine, scaled, height, relative_size, frequency_weight

  !> Steps of the peak along the tangent, in scaled units, and of the parameter, relative, below which they have converged: the
  !> amplitude's error is of second order in the former. Points that are solved to less than usual, 1e-10, have peaks that are.
  real(wp), parameter :: small_step = 1.0e-7_wp, small_change = 1.0e-9_wp, tolerances = 1.0e3_wp ! derived
  integer, parameter :: most_iterations = 10 ! conventional
  !> Relative change in one Newton step; the frequency counts this much more than the rest
  real(wp), parameter :: longest_step = 1.0_wp, frequency_weight = 10.0_wp ! guess

  !> weights . (motion, omega, parameter) = value
  type :: plane_type
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp, parameter = 1.0_wp, value = 0.0_wp
  end type plane_type

contains

  !> Correct the solver's motion, frequency and parameter.
  subroutine correct(problem, solver, plane, point, iterations, found)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Linear condition on motion, frequency and parameter
    type(plane_type), intent(in) :: plane
    !> At the peak, or where the last step began
    type(linearisation_type), intent(out) :: point
    !> Newton iterations
    integer, intent(out) :: iterations
    !> Is there a peak?
    logical, intent(out) :: found
    real(wp), allocatable :: slider(:, :)
    real(wp) :: along, change, value
    integer :: iteration, status

    found = .false.
    slider = solver%context%balance%slider
    value = value_of(problem, solver)
    do iteration = 1, most_iterations
      iterations = iteration
      call linearise(problem, solver, point, status)
      if (status /= 0) return
      call solve_for_two(problem, solver, point, plane, along, change, status)
      if (status /= 0) return
      found = point%residual <= solver%context%tolerance .and. abs(change) <= small_change*abs(value) &
              .and. abs(along) <= min(small_step, tolerances*solver%context%tolerance)
      if (found) exit
      call take_step(problem, solver, point, along, change, status)
      if (status /= 0) return
    end do
    if (.not. found) return
    solver%report = newton_report_type(converged=.true., iterations=iterations, residual=point%residual)
    call solver%accept(solver%motion, solver%omega, slider)
    ! What took several marches takes one from here on, as an unknown.
    if (solver%options%reset_slider) return
    if (found_moving(solver%context%balance, solver%context%tolerance*solver%context%motion_scale)) call solver%context%forget()
  end subroutine correct

  !> sigma and pi of Newton's step.
  subroutine solve_for_two(problem, solver, point, plane, along, change, status)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Condition of a peak and its derivatives
    type(linearisation_type), intent(in) :: point
    !> Linear condition on motion, frequency and parameter
    type(plane_type), intent(in) :: plane
    !> Share of the tangent; change of the parameter
    real(wp), intent(out) :: along, change
    !> 0, or not: singular
    integer, intent(out) :: status
    real(wp) :: right(2), rows(2, 2), determinant

    right = [-point%slope - point%slope_newton, plane%value - height(problem, solver, plane) - across(point%newton)]
    rows(1, :) = [point%slope_along, point%slope_parameter]
    rows(2, :) = [across(point%along), across(point%by_parameter)]
    determinant = rows(1, 1)*rows(2, 2) - rows(1, 2)*rows(2, 1)
    status = merge(0, 1, abs(determinant) > 0.0_wp)
    along = 0.0_wp
    change = 0.0_wp
    if (status /= 0) return
    along = (right(1)*rows(2, 2) - rows(1, 2)*right(2))/determinant
    change = (rows(1, 1)*right(2) - right(1)*rows(2, 1))/determinant

  contains

    real(wp) function across(direction)
      !> Change of the unknowns and of the response
      type(direction_type), intent(in) :: direction

      across = plane%omega*direction%step%omega + plane%parameter*direction%parameter
      if (allocated(plane%motion)) across = across + inner_product(solver%context%balance, plane%motion, direction%step%motion)
    end function across
  end subroutine solve_for_two

  !> Take Newton's step, unless it goes too far.
  subroutine take_step(problem, solver, point, along, change, status)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Condition of a peak and its derivatives
    type(linearisation_type), intent(in) :: point
    !> Share of the tangent; change of the parameter
    real(wp), intent(in) :: along, change
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(direction_type) :: step
    real(wp) :: harmonics(size(solver%motion, 1), size(solver%motion, 2))

    step = combine(point, 1.0_wp, along, change)
    harmonics = step%step%motion
    harmonics(1, :) = 0.0_wp
    associate (value => value_of(problem, solver))
      status = merge(0, 1, relative_size(solver, harmonics, step%step%omega, change/value) <= longest_step)
      ! A factor on loads stays above zero.
      if (change <= -value) status = 1
      if (status /= 0) return
      solver%motion = solver%motion + step%step%motion
      solver%omega = solver%omega + step%step%omega
      associate (balance => solver%context%balance)
        balance%slider = balance%slider + merge(step%step%slider, 0.0_wp, spread(balance%periodic, 1, size(balance%slider, 1)))
        call settle_sliders(balance)
      end associate
      if (abs(change) > 0.0_wp) call set_value(problem, solver, value + change)
    end associate
  end subroutine take_step

  !> a n + sigma t + pi d_p.
  function combine(point, newton, along, change) result(direction)
    !> Condition of a peak and its derivatives
    type(linearisation_type), intent(in) :: point
    !> Share of Newton's step; share of the tangent; change of the parameter
    real(wp), intent(in) :: newton, along, change
    type(direction_type) :: direction

    direction%step%motion = newton*point%newton%step%motion + along*point%along%step%motion + change*point%by_parameter%step%motion
    direction%step%slider = newton*point%newton%step%slider + along*point%along%step%slider + change*point%by_parameter%step%slider
    direction%step%omega = newton*point%newton%step%omega + along*point%along%step%omega + change*point%by_parameter%step%omega
    direction%parameter = change
  end function combine

  function scaled(direction, factor) result(changed)
    !> Change of the unknowns and of the response
    type(direction_type), intent(in) :: direction
    !> Factor on the direction
    real(wp), intent(in) :: factor
    type(direction_type) :: changed

    changed%step%motion = factor*direction%step%motion
    changed%step%slider = factor*direction%step%slider
    changed%step%omega = factor*direction%step%omega
    changed%parameter = factor*direction%parameter
  end function scaled

  !> weights . (motion, omega, parameter) at the solver's point.
  real(wp) function height(problem, solver, plane)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear condition on motion, frequency and parameter
    type(plane_type), intent(in) :: plane

    height = plane%omega*solver%omega + plane%parameter*value_of(problem, solver)
    if (allocated(plane%motion)) height = height + inner_product(solver%context%balance, plane%motion, solver%motion)
  end function height

  !> Norm of a change of harmonics, frequency, and (relative) parameter.
  real(wp) function relative_size(solver, motion, omega, parameter)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :), omega, parameter

    associate (balance => solver%context%balance)
      relative_size = sqrt(inner_product(balance, motion, motion)/max(scale_of_motion(solver), tiny(1.0_wp))**2 + &
                           (frequency_weight*omega/solver%omega)**2 + parameter**2)
    end associate
  end function relative_size
end module attrito_peak_corrector
