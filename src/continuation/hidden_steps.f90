!> Steps that together hardly show on the drawn curve, by which a branch ends.
!>
!> With c_k the change of the drawn curve by step k, of amplitude or frequency, they are the last ones for which
!>
!> $$ \sum_k c_k < \epsilon. $$
!>
!> Within them the branch may turn into a slide along all contacts (`attrito_solve_rigid_drift`), which is its end if no longer step
!> converges. Or it creeps: one step after the other is taken only when a longer one has failed. However many such steps follow, they
!> show nothing.
module attrito_continuation_hidden_steps
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_solve_rigid_drift, only: turns_into_mean
  implicit none
  private
  public :: hidden_steps_type

  !> Steps among them that had each failed as a longer one, after which a branch creeps
  integer, parameter :: most_crept = 4 ! guess

  type :: hidden_steps_type
    !> Change of the drawn curve by them
    real(wp), private :: change = huge(1.0_wp)
    !> Part of the tangent that is anything but a slide where they began, 0 to 1
    real(wp), private :: share = 0.0_wp
    !> Steps that had failed as longer ones; has the next one?
    integer, private :: crept = 0
    logical, private :: has_failed = .false.
    !> Has the branch turned into a slide?
    logical :: turn_into_mean = .false.
  contains
    procedure :: add
    procedure :: add_failure
    procedure :: creep
    procedure :: keep
  end type hidden_steps_type

contains

  !> Take a step that was accepted.
  pure subroutine add(self, change, tolerance, before, share)
    class(hidden_steps_type), intent(inout) :: self
    !> Of the drawn curve, relative, and what of it shows
    real(wp), intent(in) :: change, tolerance
    !> Part of the tangent that is anything but a slide, where the step began and where it ended, 0 to 1
    real(wp), intent(in) :: before, share

    self%change = self%change + change
    if (self%change >= tolerance) then
      self%change = change
      self%share = before
      self%crept = 0
    end if
    if (self%has_failed) self%crept = self%crept + 1
    self%has_failed = .false.
    self%turn_into_mean = turns_into_mean(self%share, share)
  end subroutine add

  !> A try of the next step has failed.
  pure subroutine add_failure(self)
    class(hidden_steps_type), intent(inout) :: self

    self%has_failed = .true.
  end subroutine add_failure

  !> Do these steps go on without coming to anything?
  pure logical function creep(self)
    class(hidden_steps_type), intent(in) :: self

    creep = self%has_failed .and. self%crept >= most_crept
  end function creep

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(hidden_steps_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%change)
    call store%keep(self%share)
    call store%keep(self%crept)
    call store%keep(self%has_failed)
    call store%keep(self%turn_into_mean)
  end subroutine keep
end module attrito_continuation_hidden_steps
