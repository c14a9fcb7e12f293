!> Roots over the period of real trigonometric polynomials, by a grid fine enough to separate them and safeguarded Newton steps.
!>
!> A sign change between grid points brackets one root. Where there is none but the slope turns back toward zero, the extremum
!> between is found first: if it lies beyond zero it brackets a pair. A pair that only touches zero (grazing) is not needed: what is
!> monotone on both sides of it stays so.
module attrito_contact_trigonometric_roots
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: basis_at, value_at
  implicit none
  private
  public :: trigonometric_grid_type, new_grid, roots_of, roots_by_column, root_between, differentiate

  type :: trigonometric_grid_type
    !> Grid points, from 0 to 2 pi, both included [M]
    real(wp), allocatable :: theta(:)
    !> Values per unit coefficient [M, coefficients]
    real(wp), allocatable :: values(:, :)
  end type trigonometric_grid_type

contains

  !> A grid for polynomials of some degree: eight points a period of the highest harmonic, and as many beside, unless given.
  function new_grid(harmonics, density) result(self)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    !> Points a period of the highest harmonic
    integer, intent(in), optional :: density
    type(trigonometric_grid_type) :: self
    integer :: j, points

    points = 8*harmonics + 9
    if (present(density)) points = density*(harmonics + 1) + 1
    self%theta = [(two_pi*j/(points - 1), j=0, points - 1)]
    allocate (self%values(points, 2*harmonics + 1))
    do j = 1, points
      self%values(j, :) = basis_at(self%theta(j), harmonics)
    end do
  end function new_grid

  !> Coefficients of the derivative by theta.
  pure subroutine differentiate(coefficients, derivative)
    !> Coefficients of the polynomial
    real(wp), intent(in) :: coefficients(:)
    !> Coefficients of its derivative
    real(wp), intent(out) :: derivative(:)
    integer :: h

    derivative(1) = 0.0_wp
    do h = 1, (size(coefficients) - 1)/2
      derivative(2*h) = h*coefficients(2*h + 1)
      derivative(2*h + 1) = -h*coefficients(2*h)
    end do
  end subroutine differentiate

  !> Every root at which the polynomial changes sign, unordered.
  function roots_of(coefficients, grid) result(roots)
    !> [mean, cos 1, sin 1, ...]
    real(wp), intent(in) :: coefficients(:)
    !> Grid on which roots are looked for
    type(trigonometric_grid_type), intent(in) :: grid
    real(wp), allocatable :: roots(:)

    roots = roots_by_column(reshape(coefficients, [size(coefficients), 1]), grid)
  end function roots_of

  !> Every root at which one of several polynomials changes sign, unordered.
  function roots_by_column(coefficients, grid) result(roots)
    !> [coefficients, polynomials]
    real(wp), intent(in) :: coefficients(:, :)
    !> Grid on which roots are looked for
    type(trigonometric_grid_type), intent(in) :: grid
    real(wp), allocatable :: roots(:)
    real(wp) :: found(2*size(grid%theta)*size(coefficients, 2))
    real(wp) :: both(size(coefficients, 1), 2*size(coefficients, 2)), sampled(size(grid%theta), 2*size(coefficients, 2))
    integer :: i, n, count

    n = size(coefficients, 2)
    do i = 1, n
      both(:, i) = coefficients(:, i)
      call differentiate(coefficients(:, i), both(:, n + i))
    end do
    call sample(size(grid%theta), size(both, 1), 2*n, grid%values, both, sampled)
    count = 0
    do i = 1, n
      ! A root on a grid point belongs to the step before it: what counts there is the sign after it.
      where (abs(sampled(:, i)) <= 0.0_wp) sampled(:, i) = sign(tiny(1.0_wp), sampled(:, n + i))
      call collect(both(:, i), both(:, n + i), grid%theta, sampled(:, i), sampled(:, n + i), found, count)
    end do
    roots = found(:count)
  end function roots_by_column

  !> Values on the grid, on plain arrays. Two harmonics' terms at a time spare half the passes over the values.
  pure subroutine sample(points, coefficients, columns, values, series, sampled)
    !> Of the grid; of a polynomial, an odd number; polynomials
    integer, value :: points, coefficients, columns
    !> Values per unit coefficient, of which the first are one; coefficients
    real(wp), intent(in) :: values(points, coefficients), series(coefficients, columns)
    !> Values of the polynomials
    real(wp), intent(out) :: sampled(points, columns)
    integer :: i, j

    do i = 1, columns
      sampled(:, i) = series(1, i)
      do j = 2, coefficients, 2
        sampled(:, i) = (sampled(:, i) + series(j, i)*values(:, j)) + series(j + 1, i)*values(:, j + 1)
      end do
    end do
  end subroutine sample

  !> Roots of one polynomial from its values and slopes on the grid, appended to those found.
  pure subroutine collect(coefficients, derivative, theta, f, slope, found, count)
    real(wp), intent(in) :: coefficients(:), derivative(:), theta(:), f(:), slope(:)
    !> Roots so far
    real(wp), intent(inout) :: found(:)
    !> How many there are
    integer, intent(inout) :: count
    real(wp) :: step, turn, at_turn(3)
    integer :: j

    do j = 1, size(f) - 1
      if (f(j)*f(j + 1) < 0.0_wp) then
        step = theta(j + 1) - theta(j)
        count = count + 1
        found(count) = root_from(coefficients, 0.0_wp, theta(j), theta(j + 1), f(j), &
                                 theta(j) + step*cubic_root(f(j:j + 1), step*slope(j:j + 1)))
      else if (f(j)*slope(j) < 0.0_wp .and. f(j + 1)*slope(j + 1) > 0.0_wp) then
        turn = root_between(derivative, 0.0_wp, theta(j), theta(j + 1))
        at_turn = value_at(coefficients, turn)
        if (at_turn(1)*f(j) >= 0.0_wp) cycle
        found(count + 1) = root_between(coefficients, 0.0_wp, theta(j), turn)
        found(count + 2) = root_between(coefficients, 0.0_wp, turn, theta(j + 1))
        count = count + 2
      end if
    end do
  end subroutine collect

  !> Near the root in [0, 1] of the cubic with these values, of two signs, and slopes at 0 and 1.
  pure real(wp) function cubic_root(f, slope) result(x)
    !> Values of the polynomial; slopes of the polynomial
    real(wp), intent(in) :: f(2), slope(2)
    real(wp) :: a, b, rate
    integer :: i

    a = slope(1) + slope(2) - 2.0_wp*(f(2) - f(1))
    b = 3.0_wp*(f(2) - f(1)) - 2.0_wp*slope(1) - slope(2)
    x = f(1)/(f(1) - f(2))
    do i = 1, 3
      rate = (3.0_wp*a*x + 2.0_wp*b)*x + slope(1)
      if (rate*(f(2) - f(1)) <= 0.0_wp) exit
      x = min(max(x - (((a*x + b)*x + slope(1))*x + f(1))/rate, 0.0_wp), 1.0_wp)
    end do
  end function cubic_root

  !> Where the polynomial equals `level` between two points that bracket it.
  pure real(wp) function root_between(coefficients, level, left, right) result(root)
    !> Coefficients of the polynomial; value that it is to have; angle before the root; angle after the root
    real(wp), intent(in) :: coefficients(:), level, left, right
    real(wp) :: at_left(3), at_right(3)

    at_left = value_at(coefficients, left)
    at_right = value_at(coefficients, right)
    at_left(1) = at_left(1) - level
    at_right(1) = at_right(1) - level
    if (at_left(1)*at_right(1) < 0.0_wp) then
      root = cubic_root([at_left(1), at_right(1)], (right - left)*[at_left(2), at_right(2)])
      root = root_from(coefficients, level, left, right, at_left(1), left + (right - left)*root)
    else
      ! One end is the root, but for rounding.
      root = merge(left, right, abs(at_left(1)) <= abs(at_right(1)))
    end if
  end function root_between

  !> Newton steps from a first guess, halved into the bracket.
  pure real(wp) function root_from(coefficients, level, left, right, f_left, guess) result(root)
    !> Value less level at the left end
    real(wp), intent(in) :: coefficients(:), level, left, right, f_left, guess
    !> Phase that is rounding: two units in the last place of a period
    real(wp), parameter :: resolution = 2.0_wp*epsilon(1.0_wp)*two_pi ! derived
    real(wp) :: low, high, jet(3), step, newton
    logical :: inside
    integer :: iteration

    low = left
    high = right
    root = guess
    do iteration = 1, 100
      jet = value_at(coefficients, root)
      jet(1) = jet(1) - level
      if (jet(1)*f_left > 0.0_wp) then
        low = root
      else
        high = root
      end if
      newton = -jet(1)/sign(max(abs(jet(2)), tiny(newton)), jet(2))
      inside = root + newton > low .and. root + newton < high
      step = merge(newton, 0.5_wp*(low + high) - root, inside)
      root = root + step
      if (abs(step) <= resolution) exit
      ! A Newton step leaves x''/(2 x') times its square.
      if (inside .and. 0.5_wp*abs(jet(3))*step**2 <= 0.1_wp*resolution*abs(jet(2))) exit
    end do
  end function root_from
end module attrito_contact_trigonometric_roots
