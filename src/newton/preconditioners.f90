!> What the preconditioner of GMRES is made of, kept from one linear system to the next.
module attrito_newton_preconditioners
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_contact_blocks, only: contact_blocks_type
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_mean_response, only: mean_response_type
  use attrito_newton_modal_response, only: rest_type
  implicit none
  private
  public :: preconditioners_type

  type :: preconditioners_type
    type(mean_contacts_type) :: mean
    type(rest_type) :: rest
    type(mean_response_type) :: of_mean
    type(contact_blocks_type) :: blocks
    !> Are the blocks of the present evaluation?
    logical, private :: is_fresh = .false.
  contains
    procedure :: prepare
    procedure :: count
    procedure :: discard
    procedure :: keep
  end type preconditioners_type

contains

  !> Make ready for a step at the balance's last evaluation, with what is at hand or made again.
  subroutine prepare(self, balance, stiffening, largest, is_latest, status)
    class(preconditioners_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(inout) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Unknowns beyond which a block has one contact alone
    integer, intent(in) :: largest
    !> Is all of it of this evaluation?
    logical, intent(out) :: is_latest
    !> 0, or not: singular
    integer, intent(out) :: status
    logical :: are_new, are_latest

    status = 0
    call self%mean%serve(balance, stiffening, are_new, are_latest)
    balance%work = balance%work + self%mean%flops/balance%ranks%ranks
    if (allocated(self%mean%receptance)) then
      call self%rest%prepare(self%mean%receptance, self%mean%made, balance)
      balance%work = balance%work + self%rest%flops
    end if
    self%is_fresh = are_new .or. .not. self%blocks%serve(balance, stiffening)
    if (self%is_fresh) then
      call self%of_mean%make(balance, stiffening)
      call self%blocks%make(balance, stiffening, self%mean, self%of_mean, largest, status)
      balance%work = balance%work + self%blocks%flops + self%of_mean%flops/balance%ranks%ranks
    end if
    is_latest = self%is_fresh .and. are_latest
  end subroutine prepare

  !> Take note of the iterations of a solve.
  subroutine count(self, iterations)
    class(preconditioners_type), intent(inout) :: self
    !> Of GMRES
    integer, intent(in) :: iterations

    call self%mean%count(iterations)
    call self%blocks%count(iterations)
  end subroutine count

  !> They do not serve: blocks are to be made again, and modes if these were.
  subroutine discard(self)
    class(preconditioners_type), intent(inout) :: self

    call self%blocks%discard()
    if (self%is_fresh) call self%mean%discard()
  end subroutine discard

  !> Save or load what the next point depends on. Blocks are made again by it, whether this process solves it or another.
  subroutine keep(self, store)
    class(preconditioners_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    self%blocks = contact_blocks_type()
    call self%mean%keep(store)
  end subroutine keep
end module attrito_newton_preconditioners
