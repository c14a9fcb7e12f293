!> A period of the contacts' displacements by equally spaced samples and their rates, between them the cubic of both (Hermite).
!>
!> Places are counted in samples, 0 ... n, and rates are by the sample.
module attrito_stability_sampled_motion
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: value_at
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: sampled_motion_type, motion_of_harmonics, at_contact_type

  type :: sampled_motion_type
    !> [0:n, rows] each
    real(wp), allocatable :: displacement(:, :), rate(:, :)
  contains
    procedure :: samples
    procedure :: at_contact
  end type sampled_motion_type

  !> A contact at an instant: tangential displacement, normal force over k_t (negative: what is missing to contact), and their rates
  type :: at_contact_type
    real(wp) :: u(2) = 0.0_wp, pressed = 0.0_wp
    real(wp) :: u_rate(2) = 0.0_wp, pressed_rate = 0.0_wp
    logical :: closed = .true.
  end type at_contact_type

contains

  pure integer function samples(self)
    class(sampled_motion_type), intent(in) :: self

    samples = ubound(self%displacement, 1)
  end function samples

  !> From Fourier coefficients.
  pure function motion_of_harmonics(motion, samples) result(self)
    !> [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Samples a period, J
    integer, intent(in) :: samples
    type(sampled_motion_type) :: self
    real(wp) :: jet(3)
    integer :: j, row

    allocate (self%displacement(0:samples, size(motion, 2)), self%rate(0:samples, size(motion, 2)))
    do row = 1, size(motion, 2)
      do j = 0, samples
        jet = value_at(motion(:, row), two_pi*modulo(j, samples)/samples)
        self%displacement(j, row) = jet(1)
        self%rate(j, row) = two_pi/samples*jet(2)
      end do
    end do
  end function motion_of_harmonics

  !> What a contact feels at an instant, in samples.
  pure function at_contact(self, law, instant) result(here)
    class(sampled_motion_type), intent(in) :: self
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Number of the sample, with parts
    real(wp), intent(in) :: instant
    type(at_contact_type) :: here
    real(wp) :: value(3), rate(3), x, weights(4), slopes(4)
    integer :: j, n

    j = min(int(instant), self%samples() - 1)
    x = instant - j
    ! Of both displacements, then of both rates.
    weights = [(1.0_wp - x)**2*(1.0_wp + 2.0_wp*x), x**2*(3.0_wp - 2.0_wp*x), x*(1.0_wp - x)**2, -x**2*(1.0_wp - x)]
    slopes = [-6.0_wp*x*(1.0_wp - x), 6.0_wp*x*(1.0_wp - x), (1.0_wp - x)*(1.0_wp - 3.0_wp*x), x*(3.0_wp*x - 2.0_wp)]
    n = law%tangents
    associate (d => self%displacement(j:j + 1, law%first_row:law%first_row + n), &
               s => self%rate(j:j + 1, law%first_row:law%first_row + n), stiffness => law%normal_stiffness/law%tangential_stiffness)
      value(:n + 1) = matmul(weights(:2), d) + matmul(weights(3:), s)
      rate(:n + 1) = matmul(slopes(:2), d) + matmul(slopes(3:), s)
      here%u(:n) = value(:n)
      here%u_rate(:n) = rate(:n)
      here%pressed = law%normal_force(value(n + 1))/law%tangential_stiffness
      here%closed = law%normal_force(value(n + 1)) >= law%touching_force(value(n + 1:n + 1))
      here%pressed_rate = stiffness*rate(n + 1)
    end associate
  end function at_contact
end module attrito_stability_sampled_motion
