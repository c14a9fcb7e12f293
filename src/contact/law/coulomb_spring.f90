!> Coulomb's law behind an elastic spring, a Jenkins element,
!>
!> $$ F(N) = \mu N $$
!>
!> Source: Zucca & Firrone 2014, eqs. (4)-(8), doi:10.1016/j.jsv.2013.09.032.
module attrito_contact_law_coulomb_spring
  use attrito_core_kinds, only: wp
  use attrito_contact_law_contact_law, only: contact_law_type, limit_type
  implicit none
  private
  public :: coulomb_spring_type

  type, extends(contact_law_type) :: coulomb_spring_type
  contains
    procedure :: slip_force
    procedure :: least_coefficient
    procedure :: limits
  end type coulomb_spring_type

contains

  pure subroutine slip_force(self, friction_coefficient, normal, force, slope)
    class(coulomb_spring_type), intent(in) :: self
    !> Friction coefficient, mu; normal force
    real(wp), intent(in) :: friction_coefficient, normal(:)
    !> Largest friction force; its derivative by the normal force
    real(wp), intent(out) :: force(:), slope(:)

    force = friction_coefficient*normal
    slope = friction_coefficient
  end subroutine slip_force

  pure real(wp) function least_coefficient(self, friction_coefficient)
    class(coulomb_spring_type), intent(in) :: self
    !> Friction coefficient, mu
    real(wp), intent(in) :: friction_coefficient

    least_coefficient = friction_coefficient
  end function least_coefficient

  pure function limits(self, friction_coefficient)
    class(coulomb_spring_type), intent(in) :: self
    !> Friction coefficient, mu
    real(wp), intent(in) :: friction_coefficient
    type(limit_type), allocatable :: limits(:)

    limits = [limit_type(coefficients=[0.0_wp, friction_coefficient, 0.0_wp])]
  end function limits
end module attrito_contact_law_coulomb_spring
