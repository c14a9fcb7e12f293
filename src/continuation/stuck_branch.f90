!> The branch while every contact sticks: the linear response, solved point by point in frequency, by the same error of the drawn
!> curve as elsewhere. That is held against the linear response at several frequencies, and at the resonances between, so that a sweep
!> shows them.
module attrito_continuation_stuck_branch
  use attrito_core_kinds, only: wp
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_continuation_curve_point, only: curve_point_type
  use attrito_continuation_range, only: range_type
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step_length, only: smallest_step, largest_part
  use attrito_continuation_stepper, only: stepper_type
  use attrito_continuation_tangent, only: tangent_type
  implicit none
  private
  public :: follow_stuck

contains

  !> A step in frequency from a point where every contact sticks.
  subroutine follow_stuck(stepper, range, solver, accepted)
    !> Chooses the steps along the branch
    type(stepper_type), intent(inout) :: stepper
    !> Frequencies of the sweep
    type(range_type), intent(in) :: range
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> .false.: a contact would slip or open, and nothing has changed
    logical, intent(out) :: accepted
    !> Parts that a step is shortened to, at least and at most
    real(wp), parameter :: shortest = 0.1_wp, longest = 0.7_wp ! guess
    type(snapshot_type) :: before
    type(tangent_type) :: tangent
    type(curve_point_type) :: point
    real(wp) :: part, error, whole, place

    accepted = .false.
    if (.not. (solver%all_stick .and. stepper%looked_ahead)) return
    before = snapshot_of(solver)
    whole = min(stepper%size*abs(stepper%tangent%omega), largest_part(stepper%tolerance))
    whole = whole*solver%context%frequency_scale*stepper%direction
    part = 1.0_wp
    do
      call solver%solve_stuck_at(range%clipped(before%omega + part*whole), accepted)
      if (.not. accepted) return
      call stepper%examine_step(solver, before, .false., tangent, point, error)
      if (abs(solver%omega - before%omega) <= smallest_step*solver%context%frequency_scale) exit
      if (error > 1.0_wp) then
        part = part*min(max(error**(-0.25_wp), shortest), longest)
      else
        place = stepper%place_within(point)
        if (place <= 0.0_wp) exit
        whole = solver%omega - before%omega
        part = (stepper%omega_within(point, place) - before%omega)/whole
        ! The drawn frequency may go beyond either end, where it is no place to end at.
        if (part <= 0.0_wp .or. part >= 1.0_wp) part = longest
      end if
      call restore(solver, before)
    end do
    call stepper%accept_step(solver, before, tangent, point)
    call stepper%adapt(error)
  end subroutine follow_stuck
end module attrito_continuation_stuck_branch
