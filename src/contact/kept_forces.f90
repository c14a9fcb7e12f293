!> What of a contact's last evaluation is put down after a point, or taken up in its place; and all of it, for other ranks.
module attrito_contact_kept_forces
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type, stay_stuck
  use attrito_contact_state, only: state_stuck
  implicit none
  private
  public :: keep_forces, keep_evaluation

contains

  !> Only what outlives the next evaluation: that it was stuck, and how much work it was.
  subroutine keep_forces(law, coefficients, forces, store)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store
    logical :: moves, evaluated, unique, may_stick
    integer :: i

    moves = allocated(forces%jacobian)
    evaluated = allocated(forces%active)
    call store%keep(moves)
    call store%keep(evaluated)
    call store%keep(forces%state)
    unique = forces%unique
    may_stick = forces%may_stick
    call store%keep(unique)
    call store%keep(may_stick)
    do i = 1, size(forces%slider)
      call store%keep(forces%slider(i))
    end do
    if (.not. store%reading) return
    if (evaluated .and. forces%state == state_stuck) call stay_stuck(law, (forces%slider), coefficients, forces)
    forces%unique = unique
    forces%may_stick = may_stick
    if (moves .and. .not. allocated(forces%jacobian)) allocate (forces%jacobian(0, 0))
  end subroutine keep_forces

  !> All that an evaluation leaves, to be sent.
  subroutine keep_evaluation(forces, store)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    !> Numbers that are sent, written or read in turn
    type(state_store_type), intent(inout) :: store
    real(wp), allocatable :: holding(:, :)

    call store%keep(forces%deviation)
    call store%keep(forces%jacobian)
    call store%keep(forces%active)
    call store%keep(forces%slider)
    call store%keep(forces%moved)
    call store%keep(forces%mean_before)
    call store%keep(forces%periodic)
    holding = forces%link%holding
    call store%keep(holding)
    if (store%reading) forces%link%holding = holding
    call store%keep(forces%link%by_motion)
    call store%keep(forces%link%force)
    call store%keep(forces%closed_here)
    call store%keep(forces%may_stick)
    call store%keep(forces%state)
    call store%keep(forces%stick)
    call store%keep(forces%slip)
    call store%keep(forces%open)
    call store%keep(forces%slips)
    call store%keep(forces%unique)
  end subroutine keep_evaluation
end module attrito_contact_kept_forces
