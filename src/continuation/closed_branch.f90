!> Branches that close upon themselves: a step that passes the point where the branch was begun, to within what a prediction may err,
!> is solved in the plane through that point; if it is met there, the branch is complete.
module attrito_continuation_closed_branch
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: inner_product
  use attrito_continuation_stored_points, only: known_points_type
  use attrito_solve_snapshot, only: place_type, place_of, return_to
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  implicit none
  private
  public :: comes_home

  !> Distance from the step's straight line, part of its length, that is worth a look; distance in scaled motion that is none
  real(wp), parameter :: near = 0.5_wp, met = 1.0e-6_wp

contains

  !> Does a step just made pass the first point of `home`? If so the solver stands there, else where the step ended.
  logical function comes_home(home, solver, step)
    type(known_points_type), intent(in) :: home
    type(solver_type), intent(inout) :: solver
    type(step_type), intent(in) :: step
    type(place_type) :: here
    real(wp), allocatable :: length(:, :), way(:, :)
    real(wp) :: length_omega, way_omega, part, square, off
    integer :: status

    associate (context => solver%context, balance => solver%context%balance, point => home%points(1))
      ! A step along the linear response passes what lies between its frequencies, and no more.
      comes_home = .not. (step%from%all_stick .and. step%to%all_stick) &
                   .or. (point%omega - step%from%omega)*(point%omega - step%to%omega) <= 0.0_wp
      if (.not. comes_home) return
      length = scaled(step%to%motion - step%from%motion, context%motion_scale)
      length_omega = (step%to%omega - step%from%omega)/context%frequency_scale
      way = scaled(home%own_motion(solver, 1) - step%from%motion, &
                   context%motion_scale)
      way_omega = (point%omega - step%from%omega)/context%frequency_scale
      square = inner_product(balance, length, length) + length_omega**2
      part = (inner_product(balance, way, length) + way_omega*length_omega)/max(square, tiny(1.0_wp))
      way = way - part*length
      way_omega = way_omega - part*length_omega
      off = inner_product(balance, way, way) + way_omega**2
      comes_home = part > 0.0_wp .and. part <= 1.0_wp .and. off < near**2*square
      if (.not. comes_home) return
      here = place_of(solver)
      ! At the frequency of the point it began at.
      solver%motion = step%from%motion + part*(step%to%motion - step%from%motion)
      call solver%solve_at(point%omega)
      comes_home = solver%report%converged
      if (comes_home) then
        way = scaled(home%own_motion(solver, 1) - solver%motion, &
                     context%motion_scale)
        off = inner_product(balance, way, way)
        comes_home = sqrt(off) <= met
      end if
      if (comes_home) return
      call return_to(solver, here)
      call balance%evaluate(solver%motion, solver%omega, status)
      call context%forget()
    end associate
  end function comes_home

  !> Without means, in which members of one family differ.
  pure function scaled(motion, scale) result(harmonics)
    real(wp), intent(in) :: motion(:, :), scale
    real(wp) :: harmonics(size(motion, 1), size(motion, 2))

    harmonics = motion/scale
    harmonics(1, :) = 0.0_wp
  end function scaled
end module attrito_continuation_closed_branch
