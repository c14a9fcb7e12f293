!> The branch while every contact sticks: the linear response, solved point by point in frequency. The step follows how far the
!> response lies from a straight line through the last two points, so that a sweep shows its resonances.
module attrito_continuation_stuck_branch
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_continuation_cascade, only: place_type
  use attrito_continuation_range, only: range_type
  use attrito_continuation_solver, only: solver_type
  use attrito_continuation_stepper, only: stepper_type, first_step, smallest_step, aimed_error, accepted_error
  implicit none
  private
  public :: stuck_branch_type

  type :: stuck_branch_type
    !> The last step's change of the response with omega [n, 0:H]
    complex(wp), allocatable, private :: slope(:, :)
  contains
    procedure :: follow
    procedure :: set_harmonics
    procedure :: keep
  end type stuck_branch_type

contains

  !> Where every contact sticks the branch is the linear response: a step in frequency, its error that of a straight line through the
  !> last two points.
  subroutine follow(self, stepper, range, before, solver, accepted)
    class(stuck_branch_type), intent(inout) :: self
    type(stepper_type), intent(inout) :: stepper
    type(range_type), intent(in) :: range
    !> Where the solver stands
    type(place_type), intent(in) :: before
    type(solver_type), intent(inout) :: solver
    !> .false.: a contact would slip or open, and nothing has changed
    logical, intent(out) :: accepted
    logical :: lost
    complex(wp), allocatable :: response(:, :)
    real(wp) :: omega, target, error, size

    accepted = .false.
    if (.not. solver%all_stick) return
    response = solver%context%balance%response
    omega = solver%omega
    size = stepper%size
    if (.not. allocated(self%slope)) stepper%size = min(stepper%size, first_step)
    do
      target = range%clipped(omega + stepper%way*stepper%size*solver%context%frequency_scale)
      call solver%solve_stuck_at(target, accepted)
      if (.not. accepted) exit
      error = aimed_error
      if (allocated(self%slope)) error = error_of_line(response + (target - omega)*self%slope, solver%context%balance%response)
      if (error < accepted_error .or. stepper%size <= smallest_step) exit
      stepper%size = 0.5_wp*stepper%size
    end do
    if (.not. accepted) then
      ! Back where a longer step had been taken and found too long.
      if (abs(solver%omega - omega) > 0.0_wp) call solver%solve_stuck_at(omega, lost)
      stepper%size = size
      if (allocated(self%slope)) deallocate (self%slope)
      return
    end if
    self%slope = (solver%context%balance%response - response)/(target - omega)
    call stepper%forget_tangent()
    call stepper%remember_in_frequency(solver, before)
    call stepper%adapt(error)
  end subroutine follow

  !> Distance of a predicted response from the true one, relative to its harmonics [n, 0:H].
  pure real(wp) function error_of_line(predicted, true)
    complex(wp), intent(in) :: predicted(:, 0:), true(:, 0:)

    error_of_line = sqrt(square(predicted(:, 1:) - true(:, 1:))/max(square(true(:, 1:)), tiny(1.0_wp)))

  contains

    pure real(wp) function square(response)
      complex(wp), intent(in) :: response(:, :)

      square = sum(real(response, wp)**2 + aimag(response)**2)
    end function square
  end function error_of_line

  !> Let what is remembered have so many harmonics.
  subroutine set_harmonics(self, harmonics)
    class(stuck_branch_type), intent(inout) :: self
    integer, intent(in) :: harmonics
    complex(wp), allocatable :: slope(:, :)
    integer :: common

    if (.not. allocated(self%slope)) return
    if (size(self%slope, 2) == harmonics + 1) return
    common = min(size(self%slope, 2), harmonics + 1)
    allocate (slope(size(self%slope, 1), harmonics + 1), source=(0.0_wp, 0.0_wp))
    slope(:, :common) = self%slope(:, :common)
    call move_alloc(slope, self%slope)
  end subroutine set_harmonics

  !> Put down in a store, or taken up from it.
  subroutine keep(self, store)
    class(stuck_branch_type), intent(inout) :: self
    type(state_store_type), intent(inout) :: store

    call store%keep(self%slope)
  end subroutine keep
end module attrito_continuation_stuck_branch
