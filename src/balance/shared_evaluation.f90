!> Contacts' forces evaluated by several ranks together, each contact by one of them.
!>
!> All ranks hold all contacts and unknowns and do all else themselves, so that every sum is made in the same order and results are
!> those of one rank, bit for bit. A contact that stayed stuck costs less than sending it: every rank evaluates it. Others are cut
!> into contiguous runs of equal work, by the states of the evaluation before, which are the same everywhere.
module attrito_balance_shared_evaluation
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type, reading_store, writing_store
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_kept_forces, only: keep_evaluation
  use attrito_contact_state, only: state_shaken_down
  implicit none
  private
  public :: owners_of, exchange

  !> Work of a contact that rests after its slider moved, and of one that slips or opens
  integer, parameter :: work_resting = 1, work_moving = 10 ! guess

contains

  !> The rank that evaluates each contact, from 0; -1: every rank does.
  pure function owners_of(ranks, forces) result(owner)
    !> Ranks that evaluate together
    type(communicator_type), intent(in) :: ranks
    !> Of all contacts, as last evaluated
    type(contact_forces_type), intent(in) :: forces(:)
    integer :: owner(size(forces))
    integer :: work(size(forces)), before, i

    owner = -1
    if (ranks%ranks == 1) return
    work = [(work_of(forces(i)), i=1, size(forces))]
    before = 0
    do i = 1, size(forces)
      if (work(i) == 0) cycle
      owner(i) = min(int(ranks%ranks*(before + 0.5_wp*work(i))/sum(work)), ranks%ranks - 1)
      before = before + work(i)
    end do
  end function owners_of

  pure integer function work_of(forces)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(in) :: forces

    work_of = 0
    if (allocated(forces%jacobian)) work_of = merge(work_resting, work_moving, forces%state == state_shaken_down)
  end function work_of

  !> Send what this rank has evaluated, and take what the others have.
  subroutine exchange(ranks, owner, motion, omega, forces)
    !> Ranks that evaluate together
    type(communicator_type), intent(in) :: ranks
    !> The rank that has evaluated each contact
    integer, intent(in) :: owner(:)
    !> At which all have evaluated: coefficients of relative displacement, and angular frequency
    real(wp), intent(in) :: motion(:, :), omega
    !> Of all contacts
    type(contact_forces_type), intent(inout) :: forces(:)
    type(state_store_type) :: mine, everyone
    real(wp), allocatable :: numbers(:)
    integer :: i

    if (all(owner < 0)) return
    mine = writing_store()
    do i = 1, size(forces)
      if (owner(i) == ranks%rank) call keep_evaluation(forces(i), mine)
    end do
    call ranks%gather_numbers(mine%numbers(:mine%position), omega + sum(motion), numbers)
    everyone = reading_store(numbers)
    do i = 1, size(forces)
      if (owner(i) >= 0) call keep_evaluation(forces(i), everyone)
    end do
  end subroutine exchange
end module attrito_balance_shared_evaluation
