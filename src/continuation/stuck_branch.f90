!> The branch while every contact sticks: the linear response, solved point by point in frequency. The step follows how far the
!> response lies from a straight line through the last two points, so that a sweep shows its resonances.
module attrito_continuation_stuck_branch
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_balance_stuck_response, only: find_loaded_response
  use attrito_solve_snapshot, only: snapshot_type
  use attrito_continuation_range, only: range_type
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_stepper, only: stepper_type, first_step, smallest_step, aimed_error, accepted_error
  implicit none
  private
  public :: stuck_branch_type

  type :: stuck_branch_type
    !> The last step's change of the response with omega, harmonics that are loaded [n, loaded]
    complex(wp), allocatable, private :: slope(:, :)
  contains
    procedure :: follow
    procedure :: keep
  end type stuck_branch_type

contains

  !> Where every contact sticks the branch is the linear response: a step in frequency, its error that of a straight line through the
  !> last two points.
  subroutine follow(self, stepper, range, solver, accepted)
    class(stuck_branch_type), intent(inout) :: self
    !> Chooses the steps along the branch
    type(stepper_type), intent(inout) :: stepper
    !> Frequencies of the sweep
    type(range_type), intent(in) :: range
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> .false.: a contact would slip or open, and nothing has changed
    logical, intent(out) :: accepted
    complex(wp), allocatable :: here(:, :), there(:, :)
    type(snapshot_type) :: before
    logical :: goes_on
    real(wp) :: omega, target, error, size

    accepted = .false.
    if (.not. solver%all_stick) return
    goes_on = stepper%last%ends_at(solver)
    if (.not. goes_on) call before%take(solver)
    omega = solver%omega
    size = stepper%size
    here = solver%context%balance%response(:, solver%context%balance%loaded)
    call choose_step(self, stepper, range, solver, here, there, target, error)
    if (allocated(there)) call solver%solve_stuck_at(target, accepted)
    if (.not. accepted) then
      stepper%size = size
      if (allocated(self%slope)) deallocate (self%slope)
      return
    end if
    self%slope = (1.0_wp/(target - omega))*(there - here)
    call stepper%forget_tangent()
    if (goes_on) then
      call stepper%go_on_in_frequency(solver)
    else
      call stepper%remember_in_frequency(solver, before)
    end if
    call stepper%adapt(error)
  end subroutine follow

  !> Length of the step: until the response, of the modes alone, is too far from the straight line. Whether contacts stick is not
  !> checked.
  subroutine choose_step(self, stepper, range, solver, here, there, target, error)
    type(stuck_branch_type), intent(in) :: self
    !> Chooses the steps along the branch
    type(stepper_type), intent(inout) :: stepper
    !> Frequencies of the sweep
    type(range_type), intent(in) :: range
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Harmonics of the response that are loaded, the only ones [n, loaded]; there is none where `there` is not allocated
    complex(wp), intent(in) :: here(:, :)
    !> Response at the end of the step
    complex(wp), allocatable, intent(out) :: there(:, :)
    !> Angular frequency at the end of the step, rad/s; distance from prediction to correction, relative to the response
    real(wp), intent(out) :: target, error

    error = aimed_error
    if (.not. allocated(self%slope)) stepper%size = min(stepper%size, first_step)
    do
      target = range%clipped(solver%omega + stepper%direction*stepper%size*solver%context%frequency_scale)
      call find_loaded_response(solver%context%balance, target, there)
      if (.not. allocated(there)) return
      if (allocated(self%slope)) error = error_of_line(here, target - solver%omega, self%slope, there)
      if (error < accepted_error .or. stepper%size <= smallest_step) return
      stepper%size = 0.5_wp*stepper%size
    end do
  end subroutine choose_step

  !> Distance of a response predicted along the slope from the true one, relative to that.
  pure real(wp) function error_of_line(before, step, slope, true)
    !> [n, loaded]
    complex(wp), intent(in) :: before(:, :), slope(:, :), true(:, :)
    !> Of omega
    real(wp), intent(in) :: step
    real(wp) :: off, all
    complex(wp) :: missed
    integer :: h, i

    off = 0.0_wp
    all = tiny(1.0_wp)
    do h = 1, size(true, 2)
      do i = 1, size(true, 1)
        missed = before(i, h) + step*slope(i, h) - true(i, h)
        off = off + real(missed, wp)**2 + aimag(missed)**2
        all = all + real(true(i, h), wp)**2 + aimag(true(i, h))**2
      end do
    end do
    error_of_line = sqrt(off/all)
  end function error_of_line

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(stuck_branch_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%slope)
  end subroutine keep
end module attrito_continuation_stuck_branch
