!> The contacts: node-to-node elements with one or two tangents, each a few rows of B.
!>
!> Rows of a contact: t1, [t2,] n. `u` and `v` are tangential and normal relative displacement, closing positive:
!>
!> $$ N = \max(N_p + k_n (v - \mathrm{gap}), 0), \qquad |T| \le F(N), \qquad T = k_t (u - w) \text{ while sticking} $$
!>
!> The slip force F is the contact law's, mu N unless another is given (`attrito_contact_law_contact_law`). Whatever asks for N, for
!> F or whether a contact is closed asks here.
!>
!> A law may have several elements in parallel, each with a slider w_e: `elements` says how many, `element` gives one as a contact by
!> itself. Sliders of a contact are kept in pairs, one an element, the second of a pair zero with one tangent.
module attrito_model_contacts
  use attrito_core_kinds, only: wp
  use attrito_contact_law_contact_law, only: contact_law_type, element_type, limit_type
  use attrito_contact_law_coulomb_spring, only: coulomb_spring_type
  implicit none
  private
  public :: contact_type, contacts_type, new_contacts, stuck_stiffness, stuck_springs, spring_stiffness, slider_width

  !> The law of contacts that are given none
  type(coulomb_spring_type), parameter :: coulomb_spring = coulomb_spring_type()

  !> Part of the terms of a normal force that counts as rounding
  real(wp), parameter :: rounding = 1.0e-14_wp ! derived

  !> One contact: its springs and its law
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
    !> Its law, which whoever made it keeps; none: a Coulomb spring
    class(contact_law_type), pointer :: law => null()
  contains
    generic :: normal_force => normal_force_at, normal_forces_at
    procedure, private :: normal_force_at, normal_forces_at
    procedure :: normal_series
    procedure :: touching_force
    procedure :: slip_force
    procedure :: least_coefficient
    procedure :: is_proportional
    procedure :: has_direction
    procedure :: limits
    procedure :: elements
    procedure :: element
    procedure :: part
    procedure :: slider_force
  end type contact_type

  type :: contacts_type
    type(contact_type), allocatable :: law(:)
    !> Rows of B, in columns [m, rows]
    real(wp), allocatable :: directions(:, :)
    !> Stiffness of each row when stuck [rows]
    real(wp), allocatable :: row_stiffness(:)
  contains
    procedure :: relative_motion
  end type contacts_type

contains

  !> N_p + k_n (v - gap): the normal force, or less than zero by what is missing to contact.
  pure real(wp) function normal_force_at(self, closing)
    class(contact_type), intent(in) :: self
    !> v
    real(wp), intent(in) :: closing

    normal_force_at = self%preload + self%normal_stiffness*(closing - self%gap)
  end function normal_force_at

  !> The same at many instants.
  pure function normal_forces_at(self, closing) result(force)
    class(contact_type), intent(in) :: self
    !> v
    real(wp), intent(in) :: closing(:)
    real(wp) :: force(size(closing))

    force = self%preload + self%normal_stiffness*(closing - self%gap)
  end function normal_forces_at

  !> The same as coefficients of a period [k].
  pure function normal_series(self, closing) result(force)
    class(contact_type), intent(in) :: self
    !> Coefficients of v [k]
    real(wp), intent(in) :: closing(:)
    real(wp) :: force(size(closing))

    force = self%normal_stiffness*closing
    force(1) = force(1) + self%preload - self%normal_stiffness*self%gap
  end function normal_series

  !> A contact is closed where its normal force is at least this: zero, less the rounding of the terms that the force is the sum of.
  !> One that just touches counts as closed, so unloaded bodies that only contacts hold have a regular Jacobian.
  pure real(wp) function touching_force(self, closing)
    class(contact_type), intent(in) :: self
    !> v, or its coefficients [any]
    real(wp), intent(in) :: closing(:)

    touching_force = -rounding*(abs(self%preload) + self%normal_stiffness*(sum(abs(closing)) + abs(self%gap)))
  end function touching_force

  !> The slip force F and its derivative by N.
  pure subroutine slip_force(self, normal, force, slope)
    class(contact_type), intent(in) :: self
    !> N, less than zero where the contact is open [any]
    real(wp), intent(in) :: normal(:)
    !> F, less than zero there, and dF/dN [any]
    real(wp), intent(out) :: force(:), slope(:)

    if (associated(self%law)) then
      call self%law%slip_force(self%friction_coefficient, normal, force, slope)
    else
      call coulomb_spring%slip_force(self%friction_coefficient, normal, force, slope)
    end if
  end subroutine slip_force

  !> The least F/N over all N.
  pure real(wp) function least_coefficient(self)
    class(contact_type), intent(in) :: self

    if (associated(self%law)) then
      least_coefficient = self%law%least_coefficient(self%friction_coefficient)
    else
      least_coefficient = coulomb_spring%least_coefficient(self%friction_coefficient)
    end if
  end function least_coefficient

  !> Does friction turn with slip: along two tangents, and not without friction?
  elemental logical function has_direction(self)
    class(contact_type), intent(in) :: self

    has_direction = self%tangents > 1 .and. self%friction_coefficient > 0.0_wp
  end function has_direction

  !> Is F = mu N with the contact's own coefficient?
  elemental logical function is_proportional(self)
    class(contact_type), intent(in) :: self

    is_proportional = .true.
    if (associated(self%law)) is_proportional = self%law%is_proportional()
  end function is_proportional

  !> F by normal forces that ascend.
  pure function limits(self)
    class(contact_type), intent(in) :: self
    type(limit_type), allocatable :: limits(:)

    if (associated(self%law)) then
      limits = self%law%limits(self%friction_coefficient)
    else
      limits = coulomb_spring%limits(self%friction_coefficient)
    end if
  end function limits

  !> How many elements its law has in parallel.
  elemental integer function elements(self)
    class(contact_type), intent(in) :: self

    elements = 1
    if (associated(self%law)) elements = self%law%elements()
  end function elements

  !> One element's parts of the tangential stiffness and the slip force.
  pure type(element_type) function part(self, number)
    class(contact_type), intent(in) :: self
    !> From 1
    integer, intent(in) :: number

    part = element_type()
    if (associated(self%law)) part = self%law%element(number)
  end function part

  !> One of several elements as a contact by itself: a Coulomb spring under the whole normal force.
  type(contact_type) function element(self, number)
    class(contact_type), intent(in) :: self
    !> From 1
    integer, intent(in) :: number

    element = self
    if (self%elements() == 1) return
    element%law => null()
    associate (part => self%part(number))
      element%tangential_stiffness = part%stiffness*self%tangential_stiffness
      element%friction_coefficient = part%slip_force*self%friction_coefficient
    end associate
  end function element

  !> What sliders add to the force of the tangential spring along a tangent, the sum of -k_t w over elements.
  pure real(wp) function slider_force(self, tangent, slider) result(force)
    class(contact_type), intent(in) :: self
    !> From 1
    integer, intent(in) :: tangent
    !> In pairs, one an element [at least 2 elements]
    real(wp), intent(in) :: slider(:)
    integer :: i

    force = -self%tangential_stiffness*slider(tangent)
    if (self%elements() == 1) return
    force = 0.0_wp
    do i = 1, self%elements()
      associate (part => self%part(i))
        force = force - part%stiffness*self%tangential_stiffness*slider(2*i - 2 + tangent)
      end associate
    end do
  end function slider_force

  !> Numbers that hold the sliders of any of these contacts.
  pure integer function slider_width(law)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)

    slider_width = 2*max(1, maxval(law%elements()))
  end function slider_width

  !> Contacts from their laws and rows; numbers the rows.
  function new_contacts(law, directions) result(self)
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

  !> Relative displacements B q at some rows [2 H + 1, rows].
  pure function relative_motion(self, displacements, first, rows) result(motion)
    class(contacts_type), intent(in) :: self
    !> Fourier coefficients of the model's coordinates [2 H + 1, m]
    real(wp), intent(in) :: displacements(:, :)
    !> First of the rows, from 1, and how many
    integer, intent(in) :: first, rows
    real(wp) :: motion(size(displacements, 1), rows)

    motion = matmul(displacements, self%directions(:, first:first + rows - 1))
  end function relative_motion

  !> Stiffness with contacts as springs, K + B^T K_c B [m, m].
  pure function stuck_stiffness(contacts, stiffness, tangential) result(stuck)
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> K [m, m]
    real(wp), intent(in) :: stiffness(:, :)
    !> .false.: closed without friction, only the normal springs act
    logical, intent(in) :: tangential
    real(wp) :: stuck(size(stiffness, 1), size(stiffness, 1))

    stuck = spring_stiffness(contacts, stiffness, stuck_springs(contacts, tangential))
  end function stuck_stiffness

  !> Spring of each row of contacts that are closed [rows].
  pure function stuck_springs(contacts, tangential) result(springs)
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> .false.: without friction, only the normal springs act
    logical, intent(in) :: tangential
    real(wp) :: springs(size(contacts%row_stiffness))
    integer :: i

    springs = contacts%row_stiffness
    if (tangential) return
    do i = 1, size(contacts%law)
      associate (law => contacts%law(i))
        springs(law%first_row:law%first_row + law%tangents - 1) = 0.0_wp
      end associate
    end do
  end function stuck_springs

  !> Stiffness with a spring on each row, K + B^T K_s B [m, m].
  pure function spring_stiffness(contacts, stiffness, springs) result(sum)
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> K [m, m]
    real(wp), intent(in) :: stiffness(:, :)
    !> [rows]
    real(wp), intent(in) :: springs(:)
    real(wp) :: sum(size(stiffness, 1), size(stiffness, 1))
    real(wp) :: scaled(size(stiffness, 1), size(springs))
    integer :: i

    do i = 1, size(springs)
      scaled(:, i) = springs(i)*contacts%directions(:, i)
    end do
    sum = stiffness + matmul(scaled, transpose(contacts%directions))
  end function spring_stiffness
end module attrito_model_contacts
