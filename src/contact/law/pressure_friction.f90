!> Friction that depends on the contact pressure,
!>
!> $$ F(N) = \mu(p) N, \qquad p = N/A, \qquad
!>    \frac{dF}{dN} = \mu(p) + p \, \mu'(p) $$
!>
!> with A the contact's area and mu(p) given at some pressures: between them a straight line, beyond them constant.
module attrito_contact_law_pressure_friction
  use attrito_core_kinds, only: wp
  use attrito_contact_law_contact_law, only: contact_law_type, limit_type
  implicit none
  private
  public :: pressure_friction_type, new_pressure_friction

  type, extends(contact_law_type) :: pressure_friction_type
    private
    !> A
    real(wp) :: area = 1.0_wp
    !> Normal forces A p, ascending, and the friction coefficients there [points]
    real(wp), allocatable :: normal(:), coefficient(:)
  contains
    procedure :: slip_force
    procedure :: least_coefficient
    procedure :: limits
    procedure :: is_proportional
  end type pressure_friction_type

contains

  !> From the numbers of a job: area, then pressure and friction coefficient by turns, pressures ascending.
  pure function new_pressure_friction(numbers) result(self)
    !> [1 + 2 points]
    real(wp), intent(in) :: numbers(:)
    type(pressure_friction_type) :: self

    self%area = numbers(1)
    self%normal = self%area*numbers(2::2)
    self%coefficient = numbers(3::2)
  end function new_pressure_friction

  !> mu(p) N and its derivative by N; where the contact is open, mu at the least pressure.
  pure subroutine slip_force(self, friction_coefficient, normal, force, slope)
    class(pressure_friction_type), intent(in) :: self
    !> Not asked for: the law has its own
    real(wp), intent(in) :: friction_coefficient
    !> Normal force
    real(wp), intent(in) :: normal(:)
    !> Largest friction force; its derivative by the normal force
    real(wp), intent(out) :: force(:), slope(:)
    real(wp) :: coefficient, rate
    integer :: i, j, last

    last = size(self%normal)
    do j = 1, size(normal)
      i = count(self%normal <= normal(j))
      if (i == 0 .or. i == last) then
        coefficient = self%coefficient(max(i, 1))
        rate = 0.0_wp
      else
        rate = (self%coefficient(i + 1) - self%coefficient(i))/(self%normal(i + 1) - self%normal(i))
        coefficient = self%coefficient(i) + rate*(normal(j) - self%normal(i))
      end if
      force(j) = coefficient*normal(j)
      slope(j) = coefficient + rate*normal(j)
    end do
  end subroutine slip_force

  !> The least of those given.
  pure real(wp) function least_coefficient(self, friction_coefficient)
    class(pressure_friction_type), intent(in) :: self
    !> Not asked for
    real(wp), intent(in) :: friction_coefficient

    least_coefficient = minval(self%coefficient)
  end function least_coefficient

  !> Between two pressures mu = mu_i + s (N - N_i), F = (mu_i - s N_i) N + s N^2.
  pure function limits(self, friction_coefficient)
    class(pressure_friction_type), intent(in) :: self
    !> Not asked for
    real(wp), intent(in) :: friction_coefficient
    type(limit_type), allocatable :: limits(:)
    real(wp) :: rate
    integer :: i, last

    last = size(self%normal)
    allocate (limits(0:last))
    limits(0)%coefficients(1) = self%coefficient(1)
    do i = 1, last
      rate = 0.0_wp
      if (i < last) rate = (self%coefficient(i + 1) - self%coefficient(i))/(self%normal(i + 1) - self%normal(i))
      limits(i) = limit_type(self%normal(i), [0.0_wp, self%coefficient(i) - rate*self%normal(i), rate])
    end do
  end function limits

  !> Not: F is no multiple of N.
  pure logical function is_proportional(self)
    class(pressure_friction_type), intent(in) :: self

    is_proportional = .false.
  end function is_proportional
end module attrito_contact_law_pressure_friction
