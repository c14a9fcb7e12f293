!> Iwan's model with Segalman's four parameters: Coulomb springs in parallel whose breaks phi, the displacements at which they slip,
!> have a power law's distribution and one of them at its end,
!>
!> $$ T = \int_0^\infty \rho(\phi) \, [u - w(\phi)] \, d\phi, \quad |u - w(\phi)| \le \phi, \qquad
!>    \rho(\phi) = R \phi^\chi \; [\phi < \phi_{max}] + S \, \delta(\phi - \phi_{max}) $$
!>
!> with F_S = mu N the force of macro-slip, K_T = k_t the initial tangent stiffness, and at macro-slip a jump of stiffness
!> S = K_T beta/(1 + beta):
!>
!> $$ K_T = \frac{R \phi_{max}^{\chi + 1}}{\chi + 1} (1 + \beta), \qquad
!>    \phi_{max} = \frac{F_S}{K_T} \, \frac{1 + \beta}{\beta + \frac{\chi + 1}{\chi + 2}} $$
!>
!> The breaks scale with N: x = phi/phi_max does not depend on it. n elements: n - 1 cells of x and one at x = 1, or n cells where
!> beta = 0. A cell [x_a, x_b] is one Coulomb spring with the stiffness and the slip force of all that are in it,
!>
!> $$ s = \frac{x_b^{\chi + 1} - x_a^{\chi + 1}}{1 + \beta}, \qquad
!>    f = \frac{x_b^{\chi + 2} - x_a^{\chi + 2}}{1 + \beta \frac{\chi + 2}{\chi + 1}} $$
!>
!> (parts of K_T and F_S), so F_S, K_T and S are exact, whatever n, and each break is its cell's centre of stiffness. Cells grow by a
!> constant factor alpha, since dissipation follows a power of the amplitude: they end at alpha^-(cells - 1), ..., 1/alpha, 1, and the
!> first begins at 0. With ln alpha = 1.5/sqrt(cells) more cells are both narrower and begin at smaller breaks (20: 1.7e-3,
!> 100: 3.6e-7), and the energy at any amplitude converges like ln^2 alpha, the first order in 1/n: beyond the first cell it is of
!> amplitude^(3 + chi).
!> Source: Segalman 2005, doi:10.1115/1.1989354.
module attrito_contact_law_iwan
  use attrito_core_kinds, only: wp
  use attrito_contact_law_contact_law, only: element_type
  use attrito_contact_law_coulomb_spring, only: coulomb_spring_type
  implicit none
  private
  public :: iwan_type, new_iwan

  !> ln alpha times the square root of the number of cells
  real(wp), parameter :: grading = 1.5_wp ! guess

  !> A Coulomb spring, F = mu N, that is made of several
  type, extends(coulomb_spring_type) :: iwan_type
    private
    !> By ascending breaks [n]
    type(element_type), allocatable :: parts(:)
  contains
    procedure :: elements
    procedure :: element
  end type iwan_type

contains

  !> From the numbers of a job: chi, beta and how many elements.
  pure function new_iwan(numbers) result(self)
    !> [3]
    real(wp), intent(in) :: numbers(:)
    type(iwan_type) :: self
    integer :: i, cells

    associate (chi => numbers(1), beta => numbers(2), n => nint(numbers(3)))
      cells = merge(n - 1, n, beta > 0.0_wp)
      allocate (self%parts(n))
      associate (x => [0.0_wp, (exp(-grading/sqrt(real(cells, wp))*(cells - i)), i=1, cells)], &
                 slip_force => 1.0_wp + beta*(chi + 2.0_wp)/(chi + 1.0_wp))
        do i = 1, cells
          self%parts(i) = element_type((x(i + 1)**(chi + 1.0_wp) - x(i)**(chi + 1.0_wp))/(1.0_wp + beta), &
                                       (x(i + 1)**(chi + 2.0_wp) - x(i)**(chi + 2.0_wp))/slip_force)
        end do
        if (beta > 0.0_wp) self%parts(n) = element_type(beta/(1.0_wp + beta), (slip_force - 1.0_wp)/slip_force)
      end associate
    end associate
  end function new_iwan

  pure integer function elements(self)
    class(iwan_type), intent(in) :: self

    elements = size(self%parts)
  end function elements

  pure type(element_type) function element(self, number)
    class(iwan_type), intent(in) :: self
    !> From 1
    integer, intent(in) :: number

    element = self%parts(number)
  end function element
end module attrito_contact_law_iwan
