!> Nodes on [0, 1] at which a differential equation is to hold for the polynomial through its start, x = 0, and the nodes.
!>
!> $$ p'(x_i) = \sum_{j=0}^{s} D_{ij} \, p(x_j), \qquad \int_0^1 f \, dx = \sum_{i=1}^{s} w_i \, f(x_i) $$
!>
!> Radau's right nodes end at x = 1, which damps what is stiff; Gauss's nodes leave out both ends, where there may be no derivative.
!> The last two coefficients of p in Legendre's polynomials say how well it is resolved.
!> Source: Hairer & Wanner 1996, sec. IV.5, doi:10.1007/978-3-642-05221-7; Berrut & Trefethen 2004, doi:10.1137/S0036144502417715.
module attrito_contact_panel_rule
  use attrito_core_kinds, only: wp, pi
  implicit none
  private
  public :: panel_rule_type, new_radau_rule, new_gauss_rule

  type :: panel_rule_type
    !> s
    integer :: nodes = 0
    !> The start and the nodes, and their barycentric weights [0:s]
    real(wp), allocatable :: x(:), barycentric(:)
    !> Of an integral over [0, 1] [s]
    real(wp), allocatable :: weight(:)
    !> D [s, 0:s]
    real(wp), allocatable :: derivative(:, :)
    !> What gives the last Legendre coefficient, and the one before [0:s, 2]
    real(wp), allocatable :: tail(:, :)
  contains
    procedure :: interpolate
  end type panel_rule_type

contains

  !> Radau's right nodes, the roots of P_s - P_(s-1): one between any two of Gauss's, and 1.
  pure function new_radau_rule(nodes) result(self)
    !> s
    integer, intent(in) :: nodes
    type(panel_rule_type) :: self
    real(wp) :: gauss(nodes), x(nodes), weight(nodes), low, high, middle
    integer :: i, iteration

    gauss = gauss_nodes(nodes)
    x(nodes) = 1.0_wp
    do i = 1, nodes - 1
      low = gauss(i)
      high = gauss(i + 1)
      do iteration = 1, digits(1.0_wp) + 2
        middle = 0.5_wp*(low + high)
        if ((legendre(nodes, middle) - legendre(nodes - 1, middle))*legendre(nodes - 1, low) > 0.0_wp) then
          high = middle
        else
          low = middle
        end if
      end do
      x(i) = middle
    end do
    do i = 1, nodes
      weight(i) = (1.0_wp + x(i))/(nodes*legendre(nodes - 1, x(i)))**2
    end do
    self = new_rule(x, weight)
  end function new_radau_rule

  !> Gauss's nodes.
  pure function new_gauss_rule(nodes) result(self)
    !> s
    integer, intent(in) :: nodes
    type(panel_rule_type) :: self
    real(wp) :: x(nodes), weight(nodes)
    integer :: i

    x = gauss_nodes(nodes)
    do i = 1, nodes
      weight(i) = 2.0_wp*(1.0_wp - x(i)**2)/(nodes*legendre(nodes - 1, x(i)))**2
    end do
    self = new_rule(x, weight)
  end function new_gauss_rule

  !> The roots of P_s on [-1, 1], ascending.
  pure function gauss_nodes(nodes) result(x)
    !> s
    integer, intent(in) :: nodes
    real(wp) :: x(nodes)
    real(wp) :: slope
    integer :: i, iteration

    do i = 1, nodes
      x(i) = -cos(pi*(i - 0.25_wp)/(nodes + 0.5_wp))
      do iteration = 1, 10
        slope = nodes*(x(i)*legendre(nodes, x(i)) - legendre(nodes - 1, x(i)))/(x(i)**2 - 1.0_wp)
        x(i) = x(i) - legendre(nodes, x(i))/slope
      end do
    end do
  end function gauss_nodes

  !> P_n at x.
  pure real(wp) function legendre(degree, x) result(p)
    !> n
    integer, intent(in) :: degree
    !> Where
    real(wp), intent(in) :: x
    real(wp) :: before, next
    integer :: n

    before = 0.0_wp
    p = 1.0_wp
    do n = 1, degree
      next = ((2*n - 1)*x*p - (n - 1)*before)/n
      before = p
      p = next
    end do
  end function legendre

  !> What nodes and weights of [-1, 1] make together with a start at -1.
  pure function new_rule(nodes, weight) result(self)
    !> Ascending; weights of an integral over [-1, 1]
    real(wp), intent(in) :: nodes(:), weight(:)
    type(panel_rule_type) :: self
    real(wp) :: x(0:size(nodes)), leading(2)
    integer :: i, j, n, s

    s = size(nodes)
    x = [-1.0_wp, nodes]
    self%nodes = s
    self%weight = 0.5_wp*weight
    allocate (self%x(0:s), self%barycentric(0:s), self%derivative(s, 0:s), self%tail(0:s, 2))
    self%x = 0.5_wp*(1.0_wp + x)
    do i = 0, s
      self%barycentric(i) = 1.0_wp/product(x(i) - [x(:i - 1), x(i + 1:)])
    end do
    do i = 1, s
      self%derivative(i, :) = 0.0_wp
      do j = 0, s
        if (j == i) cycle
        self%derivative(i, j) = 2.0_wp*self%barycentric(j)/(self%barycentric(i)*(x(i) - x(j)))
      end do
      self%derivative(i, i) = -sum(self%derivative(i, :))
    end do
    ! Coefficients of x^s and x^(s-1) over those of P_s and P_(s-1), of which P_s has no x^(s-1).
    leading = 1.0_wp
    do n = 1, s
      leading(2) = merge(leading(1), leading(2), n == s)
      leading(1) = leading(1)*(2*n - 1)/n
    end do
    self%tail(:, 1) = self%barycentric/leading(1)
    self%tail(:, 2) = -self%barycentric*(sum(x) - x)/leading(2)
  end function new_rule

  !> The polynomial with given values at the start and the nodes, at any x.
  pure real(wp) function interpolate(self, values, x) result(value)
    class(panel_rule_type), intent(in) :: self
    !> [0:s]
    real(wp), intent(in) :: values(0:)
    !> Where, from 0 to 1
    real(wp), intent(in) :: x
    real(wp) :: part, above, below
    integer :: i

    above = 0.0_wp
    below = 0.0_wp
    do i = 0, self%nodes
      if (abs(x - self%x(i)) <= 0.0_wp) then
        value = values(i)
        return
      end if
      part = self%barycentric(i)/(x - self%x(i))
      above = above + part*values(i)
      below = below + part
    end do
    value = above/below
  end function interpolate
end module attrito_contact_panel_rule
