!> Derivative of the active contacts' forces as a Newton step takes it, contact by contact and without the rows that are zero:
!>
!> $$ D = (1 - s) \, dg/dd, $$
!>
!> s being what contacts that slip or open keep of their springs: 0 is Newton's method; more holds a motion that nothing but friction
!> holds, at the price of a linear rate. All ways to solve the condensed system take it from here.
module attrito_newton_active_jacobian
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: contact_jacobian_type, jacobian_of, unknowns_of, places_of_rows, change_with_omega

  !> D of one contact: its rows that are not zero, and these [rows, all columns]; in place of them, if so asked, the diagonal of one
  !> that is open all over the period, which is all it has [rows]
  type :: contact_jacobian_type
    integer, allocatable :: rows(:)
    real(wp), allocatable :: values(:, :), diagonal(:)
  end type contact_jacobian_type

contains

  !> Of an active contact, by its place among these.
  pure function jacobian_of(balance, contact, stiffening, is_short) result(self)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Place of the contact among the active ones
    integer, intent(in) :: contact
    !> s
    real(wp), intent(in) :: stiffening
    !> Is the diagonal to stand for an open contact?
    logical, intent(in), optional :: is_short
    type(contact_jacobian_type) :: self
    logical :: is_diagonal
    integer :: i

    associate (forces => balance%forces(balance%active%contacts(contact)))
      self%rows = pack([(i, i=1, size(forces%active))], forces%active)
      is_diagonal = .false.
      if (present(is_short)) is_diagonal = is_short .and. forces%open >= 1.0_wp
      if (is_diagonal) then
        self%diagonal = (1.0_wp - stiffening)*[(forces%jacobian(self%rows(i), self%rows(i)), i=1, size(self%rows))]
      else
        self%values = (1.0_wp - stiffening)*forces%jacobian(self%rows, :)
      end if
    end associate
  end function jacobian_of

  !> How many rows of D on this rank are not zero: its part of the condensed system.
  pure integer function unknowns_of(balance) result(unknowns)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    integer :: i

    unknowns = 0
    do i = 1, size(balance%active%contacts)
      unknowns = unknowns + count(balance%forces(balance%active%contacts(i))%active)
    end do
  end function unknowns_of

  !> Places of the active rows among the rows of all ranks.
  pure function places_of_rows(balance) result(places)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    integer :: places(balance%active%count)
    integer :: i, row

    associate (active => balance%active)
      places = [((balance%first_row - 1 + active%source(i) + row, row=0, active%rows(i) - 1), i=1, size(active%rows))]
    end associate
  end function places_of_rows

  !> Derivative of the balance's residual by omega on the active rows, b [2 H + 1, active rows].
  pure function change_with_omega(balance) result(change)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp), allocatable :: change(:, :)

    change = -balance%active%contact_rows%motion_of(balance%response_omega)
  end function change_with_omega
end module attrito_newton_active_jacobian
