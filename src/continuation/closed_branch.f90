!> Branches that close upon themselves: a step that passes the point where the branch was begun, to within what a prediction may err,
!> is solved at the frequency of that point; if it is met there, the branch is complete. It is met from anywhere if it is the only
!> motion at that frequency, and across a resonance steps pass near any small motion, so the step's own frequencies must pass it, too.
module attrito_continuation_closed_branch
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: inner_product
  use attrito_continuation_stored_points, only: stored_points_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  implicit none
  private
  public :: closes_on_itself

  !> Distance from the step's straight line, part of its length, below which closing is examined; distance in scaled motion that is
  !> none
  real(wp), parameter :: near = 0.5_wp, met = 1.0e-6_wp ! guess

contains

  !> Does a step just made pass the first point of `start`? If so the solver is left there, else at the end of the step.
  logical function closes_on_itself(start, solver, step)
    !> Points of branches that are known
    type(stored_points_type), intent(in) :: start
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Step along the branch
    type(step_type), intent(in) :: step
    type(snapshot_type) :: here
    real(wp), allocatable :: length(:, :), offset(:, :)
    real(wp) :: length_omega, offset_omega, part, square, off, bulge
    integer :: status

    associate (context => solver%context, balance => solver%context%balance, point => start%points(1))
      bulge = bulge_of(step, context%frequency_scale)
      closes_on_itself = point%omega >= min(step%from%omega, step%to%omega) - bulge .and. &
                         point%omega <= max(step%from%omega, step%to%omega) + bulge
      if (.not. closes_on_itself) return
      length = scaled(step%to%motion - step%from%motion, context%motion_scale)
      length_omega = (step%to%omega - step%from%omega)/context%frequency_scale
      offset = scaled(start%own_motion(solver, 1) - step%from%motion, &
                   context%motion_scale)
      offset_omega = (point%omega - step%from%omega)/context%frequency_scale
      square = inner_product(balance, length, length) + length_omega**2
      part = (inner_product(balance, offset, length) + offset_omega*length_omega)/max(square, tiny(1.0_wp))
      offset = offset - part*length
      offset_omega = offset_omega - part*length_omega
      off = inner_product(balance, offset, offset) + offset_omega**2
      closes_on_itself = part > 0.0_wp .and. part <= 1.0_wp .and. off < near**2*square
      if (.not. closes_on_itself) return
      here = snapshot_of(solver)
      ! At the frequency of the point it began at.
      solver%motion = step%motion_at(solver, part)
      call solver%solve_at(point%omega)
      closes_on_itself = solver%report%converged
      if (closes_on_itself) then
        offset = scaled(start%own_motion(solver, 1) - solver%motion, &
                     context%motion_scale)
        off = inner_product(balance, offset, offset)
        closes_on_itself = sqrt(off) <= met
      end if
      if (closes_on_itself) return
      call restore(solver, here)
      call balance%evaluate(solver%motion, solver%omega, status)
      call context%forget()
    end associate
  end function closes_on_itself

  !> How far the frequency of a step may go beyond those of its ends, rad/s. A step along the linear response passes what lies
  !> between, and no more; a cubic leaves its chord by 4/27 of each slope at most.
  pure real(wp) function bulge_of(step, frequency_scale)
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> Unit of the tangents' frequencies, rad/s
    real(wp), intent(in) :: frequency_scale
    !> Greatest value of s (1 - s)^2, the part of a cubic by the slope at one end
    real(wp), parameter :: most_of_slope = 4.0_wp/27.0_wp ! derived

    bulge_of = 0.0_wp
    if (step%from%all_stick .and. step%to%all_stick) return
    bulge_of = near*abs(step%to%omega - step%from%omega)
    if (.not. step%length > 0.0_wp) return
    associate (slopes => abs(step%start%omega)/step%start%share + abs(step%end%omega)/step%end%share)
      bulge_of = most_of_slope*step%length*frequency_scale*slopes
    end associate
  end function bulge_of

  !> Without means, in which members of one family differ.
  pure function scaled(motion, scale) result(harmonics)
    !> Coefficients of the motion; unit of the motion
    real(wp), intent(in) :: motion(:, :), scale
    real(wp) :: harmonics(size(motion, 1), size(motion, 2))

    harmonics = motion/scale
    harmonics(1, :) = 0.0_wp
  end function scaled
end module attrito_continuation_closed_branch
