!> The contacts of this rank that slip or open, side by side: what a Newton step has to be solved for.
!>
!> Fields on their rows are [2 H + 1, rows].
module attrito_balance_active_rows
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_linear_projected_rows, only: projected_rows_type
  implicit none
  private
  public :: active_rows_type

  type :: active_rows_type
    !> Their places among this rank's contacts; their first rows here and among this rank's rows; how many rows each has
    integer, allocatable :: contacts(:), first(:), source(:), rows(:)
    !> Rows of all of them
    integer :: count = 0
    !> Their rows of B in generalised coordinates
    type(projected_rows_type) :: contact_rows
  contains
    procedure :: find
    procedure :: gather
  end type active_rows_type

contains

  !> Those whose forces depend on the motion. Where they are those of the last time, nothing is copied.
  subroutine find(self, law, forces, contact_rows)
    class(active_rows_type), intent(inout) :: self
    !> Of this rank's contacts
    type(contact_type), intent(in) :: law(:)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(in) :: forces(:)
    !> Of all contacts of this rank
    type(projected_rows_type), intent(in) :: contact_rows
    integer, allocatable :: contacts(:)
    integer :: i, row

    contacts = pack([(i, i=1, size(law))], [(moves(forces(i)), i=1, size(law))])
    if (allocated(self%contacts)) then
      if (size(contacts) == size(self%contacts)) then
        if (all(contacts == self%contacts)) return
      end if
    end if
    call move_alloc(contacts, self%contacts)
    self%rows = law(self%contacts)%tangents + 1
    self%source = law(self%contacts)%first_row
    self%first = starts(self%rows)
    self%count = sum(self%rows)
    self%contact_rows = contact_rows%part([((self%source(i) + row, row=0, self%rows(i) - 1), i=1, size(self%contacts))])
  end subroutine find

  pure logical function moves(forces)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(in) :: forces

    moves = allocated(forces%jacobian)
    if (moves) moves = any(forces%active)
  end function moves

  !> Where each begins, one after another.
  pure function starts(rows)
    !> Rows of contacts
    integer, intent(in) :: rows(:)
    integer :: starts(size(rows)), i, next

    next = 1
    do i = 1, size(rows)
      starts(i) = next
      next = next + rows(i)
    end do
  end function starts

  !> Their part of a field on all rows of this rank.
  pure function gather(self, field) result(part)
    class(active_rows_type), intent(in) :: self
    !> Vector over the rows of contacts
    real(wp), intent(in) :: field(:, :)
    real(wp) :: part(size(field, 1), self%count)
    integer :: i

    do i = 1, size(self%contacts)
      part(:, self%first(i):self%first(i) + self%rows(i) - 1) = field(:, self%source(i):self%source(i) + self%rows(i) - 1)
    end do
  end function gather
end module attrito_balance_active_rows
