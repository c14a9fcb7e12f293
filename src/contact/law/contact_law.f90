!> A contact law: what the contact's slider may carry at a normal force N.
!>
!> Under every law a contact is a normal spring that does not pull and a tangential spring in series with a slider w
!> (`attrito_model_contacts`):
!>
!> $$ T = k_t (u - w), \qquad |T| \le F(N), \qquad F(0) = 0 $$
!>
!> A law is F, a quadratic between some normal forces,
!>
!> $$ F(N) = c_0 + c_1 N + c_2 N^2, \qquad N_i \le N < N_{i+1} $$
!>
!> so that between the instants at which a trigonometric motion passes an N_i its limit is trigonometric, too. It answers for many
!> instants at a time: a choice at run time costs one call a contact, not one an instant. Laws never change once they are made, so
!> contacts may share one.
!>
!> A law may put several elements in parallel, each a spring in series with a slider of its own, with parts of the contact's
!> stiffness and slip force that do not depend on N; every element is a Coulomb spring then:
!>
!> $$ T = \sum_e T_e, \qquad T_e = s_e k_t (u - w_e), \qquad |T_e| \le f_e \mu N, \qquad \sum_e s_e = \sum_e f_e = 1 $$
module attrito_contact_law_contact_law
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: contact_law_type, element_type, limit_type

  !> One of the elements in parallel: its parts s_e and f_e of the contact's tangential stiffness and slip force
  type :: element_type
    real(wp) :: stiffness = 1.0_wp, slip_force = 1.0_wp
  end type element_type

  !> F from a normal force on: c_0, c_1, c_2
  type :: limit_type
    real(wp) :: from = -huge(1.0_wp), coefficients(0:2) = 0.0_wp
  end type limit_type

  type, abstract :: contact_law_type
  contains
    procedure :: is_proportional => with_cone
    procedure :: elements => one_element
    procedure :: element => whole_contact
    procedure(slip_force_of_law), deferred :: slip_force
    procedure(coefficient_of_law), deferred :: least_coefficient
    procedure(limits_of_law), deferred :: limits
  end type contact_law_type

  abstract interface
    !> The slip force F and its derivative by N.
    pure subroutine slip_force_of_law(self, friction_coefficient, normal, force, slope)
      import :: contact_law_type, wp
      class(contact_law_type), intent(in) :: self
      !> The contact's own
      real(wp), intent(in) :: friction_coefficient
      !> N, less than zero where the contact is open [any]
      real(wp), intent(in) :: normal(:)
      !> F, less than zero there, and dF/dN [any]
      real(wp), intent(out) :: force(:), slope(:)
    end subroutine slip_force_of_law

    !> The least F/N over all N: what bounds may count on.
    pure real(wp) function coefficient_of_law(self, friction_coefficient)
      import :: contact_law_type, wp
      class(contact_law_type), intent(in) :: self
      !> The contact's own
      real(wp), intent(in) :: friction_coefficient
    end function coefficient_of_law

    !> F by normal forces that ascend, the first less than any.
    pure function limits_of_law(self, friction_coefficient) result(limits)
      import :: contact_law_type, limit_type, wp
      class(contact_law_type), intent(in) :: self
      !> The contact's own
      real(wp), intent(in) :: friction_coefficient
      type(limit_type), allocatable :: limits(:)
    end function limits_of_law
  end interface

contains

  !> Is F = mu N with the contact's own friction coefficient, at any N? Unless a law says otherwise.
  pure logical function with_cone(self)
    class(contact_law_type), intent(in) :: self

    with_cone = .true.
  end function with_cone

  !> How many elements are in parallel: one, unless a law has more.
  pure integer function one_element(self)
    class(contact_law_type), intent(in) :: self

    one_element = 1
  end function one_element

  !> One of them.
  pure type(element_type) function whole_contact(self, number)
    class(contact_law_type), intent(in) :: self
    !> From 1
    integer, intent(in) :: number

    whole_contact = element_type()
  end function whole_contact
end module attrito_contact_law_contact_law
