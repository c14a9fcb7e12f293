!> Turning points of a branch: where its frequency is largest or smallest.
!>
!> The frequency's part of the tangent, t_omega, changes sign on a step. At a smooth fold it passes through zero; where a contact
!> begins to do something else it jumps, and there is no smooth extremum. Both are enclosed by secants and halvings on t_omega along
!> the step, until what the frequency can still gain, |t_omega| times what is left, is nothing.
module attrito_continuation_turning_point
  use attrito_core_kinds, only: wp
  use attrito_core_secant, only: bracket_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type, find_tangent
  implicit none
  private
  public :: turning_point_type, locate_turning_point

  !> What is left open of the frequency, relative to it, and the least part of the step that is looked at
  real(wp), parameter :: accuracy = 1.0e-8_wp, least_part = 1.0e-7_wp ! derived
  !> Part of its values on both ends of the step below which t_omega has surely come down to zero without a jump
  real(wp), parameter :: vanishing = 1.0e-2_wp ! guess
  integer, parameter :: most_tries = 60 ! conventional

  type :: turning_point_type
    !> Where the frequency is extreme, of what was solved
    type(snapshot_type) :: snapshot
    !> How much farther the frequency may go, rad/s; at most the step if a solve in between failed
    real(wp) :: uncertain = 0.0_wp
    !> Does the tangent turn without a jump?
    logical :: smooth = .false.
  end type turning_point_type

contains

  !> On a step whose ends have t_omega of different signs. The solver is left at the turning point.
  subroutine locate_turning_point(solver, step, start, end, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> Tangents at both ends
    type(tangent_type), intent(in) :: start, end
    type(turning_point_type), intent(out) :: self
    type(tangent_type) :: tangent
    type(bracket_type) :: bracket
    real(wp) :: s, slope(2), length
    integer :: side, try, status
    logical :: converged

    slope = [start%omega, end%omega]
    bracket%weight = slope
    length = abs(step_length(solver, step))
    self%snapshot = step%from
    if ((step%to%omega - step%from%omega)*start%omega > 0.0_wp) self%snapshot = step%to
    do try = 1, most_tries
      s = bracket%trial(try)
      call step%solve_part(solver, s, converged)
      if (.not. converged) exit
      call find_tangent(solver, start, tangent, status)
      if (status /= 0) exit
      if ((solver%omega - self%snapshot%omega)*start%omega > 0.0_wp) self%snapshot = snapshot_of(solver)
      side = merge(1, 2, tangent%omega*start%omega > 0.0_wp)
      call bracket%take(side, s, tangent%omega)
      slope(side) = tangent%omega
      if (is_enough()) exit
    end do
    self%uncertain = possible_gain()
    ! Where contacts begin to open or to slip the tangent goes at least like a root: what is left of its change is, too.
    self%smooth = abs(slope(2) - slope(1)) < bracket%width()**0.25_wp*abs(end%omega - start%omega)

  contains

    !> A concave arc lies below its tangents at both ends.
    pure real(wp) function possible_gain()

      possible_gain = minval(abs(slope))*bracket%width()*length*solver%context%frequency_scale
    end function possible_gain

    pure logical function is_enough()

      is_enough = possible_gain() <= accuracy*abs(solver%omega)
      if (minval(abs(slope)) > vanishing*min(abs(start%omega), abs(end%omega))) then
        is_enough = is_enough .and. bracket%width() < 10.0_wp*least_part
      end if
      is_enough = is_enough .or. bracket%width() < least_part
    end function is_enough
  end subroutine locate_turning_point

  !> Of a step in scaled motion and frequency.
  real(wp) function step_length(solver, step)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Step along the branch
    type(step_type), intent(in) :: step

    associate (context => solver%context)
      step_length = hypot(context%balance%norm(step%to%motion - step%from%motion)/context%motion_scale, &
                          (step%to%omega - step%from%omega)/context%frequency_scale)
    end associate
  end function step_length
end module attrito_continuation_turning_point
