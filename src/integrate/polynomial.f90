!> Where a polynomial on [0, 1] first becomes negative, and all its changes of sign: found for certain, by Bernstein coefficients.
!>
!> $$ a(s) = \sum_k a_k s^k = \sum_j b_j \binom{n}{j} s^j (1-s)^{n-j}, \quad b_j = \sum_{i \le j} \binom{j}{i} a_i / \binom{n}{i} $$
!>
!> The polynomial lies in the hull of its b_j: all b_j >= 0 means no root, one change of sign among them exactly one root (Descartes).
!> Otherwise the interval is halved (de Casteljau), so that no pair of roots is skipped, however close.
!> Source: Lane & Riesenfeld 1981, BIT 21, doi:10.1007/BF01934076.
module attrito_integrate_polynomial
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: bernstein_matrix, first_negative, sign_changes, value, slope, derivative, product_of, square, product_integral

  !> Halvings before what is left of an interval counts as one point
  integer, parameter :: deepest = 48 ! derived

contains

  !> From powers to Bernstein coefficients of a degree; transposed: [0:degree power, 0:degree].
  pure function bernstein_matrix(degree) result(matrix)
    !> Degree of the polynomial
    integer, intent(in) :: degree
    real(wp) :: matrix(0:degree, 0:degree)
    integer :: i, j

    matrix = 0.0_wp
    do j = 0, degree
      matrix(0, j) = 1.0_wp
      do i = 1, j
        matrix(i, j) = matrix(i - 1, j)*real(j - i + 1, wp)/real(degree - i + 1, wp)
      end do
    end do
  end function bernstein_matrix

  !> Value at s by Horner's rule.
  pure real(wp) function value(a, s)
    !> Polynomial, coefficients from degree 0; exponent, 1/s, or time
    real(wp), intent(in) :: a(0:), s
    integer :: k

    value = a(ubound(a, 1))
    do k = ubound(a, 1) - 1, 0, -1
      value = value*s + a(k)
    end do
  end function value

  !> First derivative at s.
  pure real(wp) function slope(a, s)
    !> Polynomial, coefficients from degree 0; exponent, 1/s, or time
    real(wp), intent(in) :: a(0:), s
    integer :: k

    slope = 0.0_wp
    do k = ubound(a, 1), 1, -1
      slope = slope*s + k*a(k)
    end do
  end function slope

  !> Coefficients of the derivative, the last one zero.
  pure function derivative(a) result(b)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(in) :: a(0:)
    real(wp) :: b(0:ubound(a, 1))
    integer :: k

    do k = 0, ubound(a, 1) - 1
      b(k) = (k + 1)*a(k + 1)
    end do
    b(ubound(a, 1)) = 0.0_wp
  end function derivative

  !> The first coefficients of a product, as many as its factors have.
  pure function product_of(a, b) result(c)
    !> Polynomials, coefficients from degree 0
    real(wp), intent(in) :: a(0:), b(0:)
    real(wp) :: c(0:ubound(a, 1))
    integer :: k

    do k = 0, ubound(a, 1)
      c(k) = dot_product(a(:k), b(k:0:-1))
    end do
  end function product_of

  pure function square(a) result(c)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(in) :: a(0:)
    real(wp) :: c(0:ubound(a, 1))

    c = product_of(a, a)
  end function square

  !> Integral of the product of two polynomials over [0, s].
  pure real(wp) function product_integral(a, b, s)
    !> Polynomial, coefficients from degree 0; bernstein coefficients; exponent, 1/s, or time
    real(wp), intent(in) :: a(0:), b(0:), s
    real(wp) :: c(0:ubound(a, 1) + ubound(b, 1) + 1)
    integer :: i

    c = 0.0_wp
    do i = 0, ubound(b, 1)
      c(i + 1:i + 1 + ubound(a, 1)) = c(i + 1:i + 1 + ubound(a, 1)) + b(i)*a
    end do
    do i = 1, ubound(c, 1)
      c(i) = c(i)/i
    end do
    product_integral = value(c, s)
  end function product_integral

  !> The first s in [0, 1] from which the polynomial is negative; above 1 if there is none. A double root is none, and a polynomial
  !> that is not finite has none: nothing would end the search.
  pure subroutine first_negative(a, bernstein, s)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(in) :: a(0:)
    !> Of `bernstein_matrix`
    real(wp), intent(in) :: bernstein(0:, 0:)
    !> Exponent, 1/s, or time
    real(wp), intent(out) :: s
    real(wp) :: b(0:ubound(a, 1))
    logical :: found

    s = 2.0_wp
    if (a(0) < 0.0_wp) then
      s = 0.0_wp
      return
    end if
    if (a(0) + sum(min(a(1:), 0.0_wp)) > 0.0_wp) return
    if (.not. is_finite(a)) return
    b = to_bernstein(a, bernstein)
    call search(a, b, 0.0_wp, 1.0_wp, 0, s, found)
    if (.not. found) s = 2.0_wp
  end subroutine first_negative

  !> All changes of sign in (0, 1), ascending.
  pure subroutine sign_changes(a, bernstein, roots, count)
    !> Polynomial, coefficients from degree 0; from powers to Bernstein coefficients
    real(wp), intent(in) :: a(0:), bernstein(0:, 0:)
    !> Room for them [degree]
    real(wp), intent(out) :: roots(:)
    !> Number of roots or periods
    integer, intent(out) :: count

    count = 0
    if (.not. is_finite(a)) return
    call collect(a, to_bernstein(a, bernstein), 0.0_wp, 1.0_wp, 0, roots, count)
  end subroutine sign_changes

  pure logical function is_finite(a)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(in) :: a(:)

    is_finite = all(abs(a) <= huge(1.0_wp))
  end function is_finite

  pure function to_bernstein(a, bernstein) result(b)
    !> Polynomial, coefficients from degree 0; from powers to Bernstein coefficients
    real(wp), intent(in) :: a(0:), bernstein(0:, 0:)
    real(wp) :: b(0:ubound(a, 1))
    integer :: j

    do j = 0, ubound(a, 1)
      b(j) = dot_product(bernstein(0:j, j), a(0:j))
    end do
  end function to_bernstein

  pure recursive subroutine search(a, b, low, high, depth, s, found)
    !> The polynomial over [0, 1], and its Bernstein coefficients over [low, high]
    real(wp), intent(in) :: a(0:), b(0:), low, high
    !> How often the interval has been halved
    integer, intent(in) :: depth
    !> Exponent, 1/s, or time
    real(wp), intent(inout) :: s
    !> Is there a root?
    logical, intent(out) :: found
    real(wp) :: left(0:ubound(b, 1)), right(0:ubound(b, 1)), middle

    found = .false.
    if (all(b >= 0.0_wp)) return
    if (b(0) < 0.0_wp .or. all(b <= 0.0_wp)) then
      s = low
      found = .true.
    else if (depth == deepest) then
      found = b(ubound(b, 1)) < 0.0_wp
      if (found) s = low
    else if (changes_of_sign(b) == 1) then
      s = bracketed_root(a, low, high)
      found = .true.
    else
      middle = 0.5_wp*(low + high)
      call halve(b, left, right)
      call search(a, left, low, middle, depth + 1, s, found)
      if (.not. found) call search(a, right, middle, high, depth + 1, s, found)
    end if
  end subroutine search

  pure recursive subroutine collect(a, b, low, high, depth, roots, count)
    !> Polynomial, coefficients from degree 0; bernstein coefficients; lower end; upper end
    real(wp), intent(in) :: a(0:), b(0:), low, high
    !> How often the interval has been halved
    integer, intent(in) :: depth
    !> Roots so far, ascending
    real(wp), intent(inout) :: roots(:)
    !> Number of roots or periods
    integer, intent(inout) :: count
    real(wp) :: left(0:ubound(b, 1)), right(0:ubound(b, 1)), middle
    integer :: changes

    changes = changes_of_sign(b)
    if (changes == 0 .or. depth == deepest .or. count == size(roots)) return
    if (changes == 1) then
      count = count + 1
      roots(count) = bracketed_root(a, low, high)
      return
    end if
    middle = 0.5_wp*(low + high)
    call halve(b, left, right)
    call collect(a, left, low, middle, depth + 1, roots, count)
    call collect(a, right, middle, high, depth + 1, roots, count)
  end subroutine collect

  pure integer function changes_of_sign(b)
    !> Bernstein coefficients
    real(wp), intent(in) :: b(:)
    real(wp) :: last
    integer :: j

    changes_of_sign = 0
    last = 0.0_wp
    do j = 1, size(b)
      if (abs(b(j)) <= 0.0_wp) cycle
      if (last*b(j) < 0.0_wp) changes_of_sign = changes_of_sign + 1
      last = sign(1.0_wp, b(j))
    end do
  end function changes_of_sign

  !> De Casteljau at the middle.
  pure subroutine halve(b, left, right)
    !> Bernstein coefficients
    real(wp), intent(in) :: b(0:)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(out) :: left(0:), right(0:)
    integer :: n, k

    n = ubound(b, 1)
    right = b
    do k = 0, n
      left(k) = right(0)
      right(0:n - k - 1) = 0.5_wp*(right(0:n - k - 1) + right(1:n - k))
    end do
  end subroutine halve

  !> The root between two places of different sign: Newton's method, kept inside the bracket by bisection.
  pure real(wp) function bracketed_root(a, low, high) result(s)
    !> Polynomial, coefficients from degree 0; lower end; upper end
    real(wp), intent(in) :: a(0:), low, high
    real(wp) :: left, right, f, step, sign_left
    integer :: iteration

    left = low
    right = high
    sign_left = sign(1.0_wp, value(a, low))
    if (abs(value(a, low)) <= 0.0_wp) sign_left = -sign(1.0_wp, value(a, high))
    s = 0.5_wp*(left + right)
    do iteration = 1, 100
      f = value(a, s)
      if (f*sign_left > 0.0_wp) then
        left = s
      else
        right = s
      end if
      step = -f/(slope(a, s) + sign(tiny(1.0_wp), slope(a, s)))
      if (.not. (s + step > left .and. s + step < right)) step = 0.5_wp*(left + right) - s
      s = s + step
      if (abs(step) <= epsilon(1.0_wp)*s .or. right - left <= epsilon(1.0_wp)*right) exit
    end do
  end function bracketed_root
end module attrito_integrate_polynomial
