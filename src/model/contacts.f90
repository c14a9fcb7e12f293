!> The contacts: node-to-node elements with one or two tangents, each a few rows of B.
!>
!> Rows of a contact: t1, [t2,] n. `u` and `v` are tangential and normal relative displacement, closing positive:
!>
!> $$ N = \max(N_p + k_n (v - \mathrm{gap}), 0), \qquad |T| \le \mu N, \qquad T = k_t (u - w) \text{ while sticking} $$
module attrito_model_contacts
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: contact_type, contacts_type, new_contacts, stuck_stiffness

  !> One contact's law
  type :: contact_type
    !> 1 or 2
    integer :: tangents = 1
    !> Tangential and normal stiffness, force per length
    real(wp) :: tangential_stiffness = 0.0_wp, normal_stiffness = 0.0_wp
    real(wp) :: friction_coefficient = 0.0_wp
    !> Opening to be closed before they touch, length
    real(wp) :: gap = 0.0_wp
    !> Normal force at v = gap
    real(wp) :: preload = 0.0_wp
    !> Its first row in B, from 1
    integer :: first_row = 1
  end type contact_type

  type :: contacts_type
    type(contact_type), allocatable :: law(:)
    !> Rows of B, in columns [m, rows]
    real(wp), allocatable :: directions(:, :)
    !> Stiffness of each row when stuck [rows]
    real(wp), allocatable :: row_stiffness(:)
  end type contacts_type

contains

  !> Contacts from their laws and rows; numbers the rows.
  pure function new_contacts(law, directions) result(self)
    !> Laws [contacts]; `first_row` need not be set
    type(contact_type), intent(in) :: law(:)
    !> Rows of B in columns [m, rows]
    real(wp), intent(in) :: directions(:, :)
    type(contacts_type) :: self
    integer :: i, row

    self%law = law
    self%directions = directions
    allocate (self%row_stiffness(size(directions, 2)))
    row = 1
    do i = 1, size(law)
      self%law(i)%first_row = row
      self%row_stiffness(row:row + law(i)%tangents - 1) = law(i)%tangential_stiffness
      self%row_stiffness(row + law(i)%tangents) = law(i)%normal_stiffness
      row = row + law(i)%tangents + 1
    end do
  end function new_contacts

  !> Stiffness with contacts as springs, K + B^T K_c B [m, m].
  pure function stuck_stiffness(contacts, stiffness, tangential) result(stuck)
    type(contacts_type), intent(in) :: contacts
    !> K [m, m]
    real(wp), intent(in) :: stiffness(:, :)
    !> .false.: closed without friction, only the normal springs act
    logical, intent(in) :: tangential
    real(wp) :: stuck(size(stiffness, 1), size(stiffness, 1))
    real(wp) :: springs(size(contacts%row_stiffness)), scaled(size(stiffness, 1), size(contacts%row_stiffness))
    integer :: i

    springs = contacts%row_stiffness
    if (.not. tangential) then
      do i = 1, size(contacts%law)
        associate (law => contacts%law(i))
          springs(law%first_row:law%first_row + law%tangents - 1) = 0.0_wp
        end associate
      end do
    end if
    do i = 1, size(springs)
      scaled(:, i) = springs(i)*contacts%directions(:, i)
    end do
    stuck = stiffness + matmul(scaled, transpose(contacts%directions))
  end function stuck_stiffness
end module attrito_model_contacts
