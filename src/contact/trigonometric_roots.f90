!> Roots over the period of a real trigonometric polynomial, by a grid fine enough to separate them and safeguarded Newton steps.
!>
!> A sign change between grid points brackets one root. Where there is none but the slope turns back toward zero, the extremum
!> between is found first: if it lies beyond zero it brackets a pair. A pair that only touches zero (grazing) is not needed: what is
!> monotone on both sides of it stays so.
module attrito_contact_trigonometric_roots
  use attrito_core_kinds, only: wp, two_pi
  implicit none
  private
  public :: trigonometric_grid_type, new_grid, roots_of, basis_at, slope_at, root_between, differentiated

  type :: trigonometric_grid_type
    !> Grid points, from 0 to 2 pi, both included [M]
    real(wp), allocatable :: theta(:)
    !> Values and slopes per unit coefficient [M, coefficients]
    real(wp), allocatable :: values(:, :), slopes(:, :)
  end type trigonometric_grid_type

contains

  !> A grid for polynomials of some degree: eight points a period of the highest harmonic.
  function new_grid(harmonics) result(self)
    integer, intent(in) :: harmonics
    type(trigonometric_grid_type) :: self
    integer :: j, points

    points = 8*harmonics + 9
    self%theta = [(two_pi*j/(points - 1), j=0, points - 1)]
    allocate (self%values(points, 2*harmonics + 1), self%slopes(points, 2*harmonics + 1))
    do j = 1, points
      self%values(j, :) = basis_at(self%theta(j), harmonics)
      self%slopes(j, :) = slope_at(self%theta(j), harmonics)
    end do
  end function new_grid

  !> The functions 1, cos, sin, cos 2, sin 2, ... at theta.
  pure function basis_at(theta, harmonics) result(basis)
    real(wp), intent(in) :: theta
    integer, intent(in) :: harmonics
    real(wp) :: basis(2*harmonics + 1)
    complex(wp) :: rotation, power
    integer :: h

    rotation = cmplx(cos(theta), sin(theta), wp)
    power = 1.0_wp
    basis(1) = 1.0_wp
    do h = 1, harmonics
      power = power*rotation
      basis(2*h) = real(power, wp)
      basis(2*h + 1) = aimag(power)
    end do
  end function basis_at

  !> Their derivatives by theta.
  pure function slope_at(theta, harmonics) result(slope)
    real(wp), intent(in) :: theta
    integer, intent(in) :: harmonics
    real(wp) :: slope(2*harmonics + 1)
    integer :: h

    slope = basis_at(theta, harmonics)
    slope(1) = 0.0_wp
    do h = 1, harmonics
      slope(2*h:2*h + 1) = h*[-slope(2*h + 1), slope(2*h)]
    end do
  end function slope_at

  !> Coefficients of the derivative by theta.
  pure function differentiated(coefficients) result(derivative)
    real(wp), intent(in) :: coefficients(:)
    real(wp) :: derivative(size(coefficients))
    integer :: h

    derivative(1) = 0.0_wp
    do h = 1, (size(coefficients) - 1)/2
      derivative(2*h:2*h + 1) = h*[coefficients(2*h + 1), -coefficients(2*h)]
    end do
  end function differentiated

  !> Every root at which the polynomial changes sign, unordered.
  function roots_of(coefficients, grid) result(roots)
    !> [mean, cos 1, sin 1, ...]
    real(wp), intent(in) :: coefficients(:)
    type(trigonometric_grid_type), intent(in) :: grid
    real(wp), allocatable :: roots(:)
    real(wp) :: f(size(grid%theta)), slope(size(grid%theta)), found(2*size(grid%theta)), turn, at_turn
    integer :: j, count

    f = matmul(grid%values, coefficients)
    slope = matmul(grid%slopes, coefficients)
    ! A root on a grid point belongs to the step before it: what counts there is the sign after it.
    where (abs(f) <= 0.0_wp) f = sign(tiny(1.0_wp), slope)
    count = 0
    do j = 1, size(f) - 1
      if (f(j)*f(j + 1) < 0.0_wp) then
        call add(root_between(coefficients, 0.0_wp, grid%theta(j), grid%theta(j + 1)))
      else if (f(j)*slope(j) < 0.0_wp .and. f(j + 1)*slope(j + 1) > 0.0_wp) then
        turn = root_between(differentiated(coefficients), 0.0_wp, grid%theta(j), grid%theta(j + 1))
        at_turn = dot_product(coefficients, basis_at(turn, (size(coefficients) - 1)/2))
        if (at_turn*f(j) < 0.0_wp) then
          call add(root_between(coefficients, 0.0_wp, grid%theta(j), turn))
          call add(root_between(coefficients, 0.0_wp, turn, grid%theta(j + 1)))
        end if
      end if
    end do
    roots = found(:count)

  contains

    subroutine add(root)
      real(wp), intent(in) :: root

      count = count + 1
      found(count) = root
    end subroutine add
  end function roots_of

  !> Where the polynomial equals `level` between two points that bracket it: Newton steps, halved into the bracket.
  pure function root_between(coefficients, level, left, right) result(root)
    real(wp), intent(in) :: coefficients(:), level, left, right
    real(wp) :: root
    real(wp) :: basis(size(coefficients)), slopes(size(coefficients))
    real(wp) :: low, high, f, f_low, f_high, step, newton
    integer :: iteration, harmonics

    harmonics = (size(coefficients) - 1)/2
    slopes = differentiated(coefficients)
    low = left
    high = right
    f_low = dot_product(coefficients, basis_at(low, harmonics)) - level
    f_high = dot_product(coefficients, basis_at(high, harmonics)) - level
    root = 0.5_wp*(low + high)
    if (f_low*f_high < 0.0_wp) root = low + (high - low)*f_low/(f_low - f_high)
    do iteration = 1, 100
      basis = basis_at(root, harmonics)
      f = dot_product(coefficients, basis) - level
      if (f*f_low > 0.0_wp) then
        low = root
      else
        high = root
      end if
      step = 0.5_wp*(low + high) - root
      newton = -f/sign(max(abs(dot_product(slopes, basis)), tiny(f)), dot_product(slopes, basis))
      if (root + newton > low .and. root + newton < high) step = newton
      root = root + step
      if (abs(step) <= 2.0_wp*epsilon(1.0_wp)*two_pi) exit
    end do
  end function root_between
end module attrito_contact_trigonometric_roots
