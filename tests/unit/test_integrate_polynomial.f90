!> Roots of polynomials on [0, 1], none skipped.
program test_integrate_polynomial
  use, intrinsic :: ieee_arithmetic, only: ieee_negative_inf, ieee_positive_inf, ieee_value
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_integrate_polynomial, only: bernstein_matrix, first_negative, sign_changes, product_integral
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: n = 24

  if (run_suite('integrate_polynomial', [ &
                test('the first of several roots is found', first_of_several), &
                test('a pair of roots 1e-6 apart is not skipped', close_pair), &
                test('a double root is no crossing', double_root), &
                test('a polynomial that starts at zero and falls is negative at once', falls_at_once), &
                test('a polynomial that is not finite has no root, and the search for one ends', not_finite), &
                test('all roots of a Chebyshev polynomial are found', chebyshev), &
                test('products are integrated exactly', products)], quiet=.false.) > 0) error stop 1

contains

  !> Product of (s - root), as coefficients of degree n.
  pure function from_roots(roots, factor) result(a)
    real(wp), intent(in) :: roots(:), factor
    real(wp) :: a(0:n)
    integer :: i

    a = 0.0_wp
    a(0) = factor
    do i = 1, size(roots)
      a = eoshift(a, -1) - roots(i)*a
    end do
  end function from_roots

  subroutine first_of_several(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: s

    call first_negative(from_roots([0.3_wp, 0.31_wp, 0.7_wp], -1.0_wp), bernstein_matrix(n), s)
    call check_close(error, s, 0.3_wp, 1.0e-13_wp, 'first root')
    call first_negative(from_roots([1.5_wp, -0.5_wp], -1.0_wp), bernstein_matrix(n), s)
    call check(error, s > 1.0_wp, 'a root is found where there is none')
  end subroutine first_of_several

  subroutine close_pair(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: s

    call first_negative(from_roots([0.61_wp, 0.61_wp + 1.0e-6_wp], 1.0_wp), bernstein_matrix(n), s)
    ! A value of 1e-12 / 4 is far above rounding; the root moves by rounding over the slope of 1e-6.
    call check_close(error, s, 0.61_wp, 1.0e-9_wp, 'first of the pair')
  end subroutine close_pair

  subroutine double_root(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: s

    call first_negative(from_roots([0.5_wp, 0.5_wp], 1.0_wp), bernstein_matrix(n), s)
    call check(error, s > 1.0_wp, 'a double root counts as a crossing')
  end subroutine double_root

  subroutine falls_at_once(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: s

    call first_negative(from_roots([0.0_wp], -1.0_wp), bernstein_matrix(n), s)
    call check_close(error, s, 0.0_wp, 0.0_wp, 'root')
  end subroutine falls_at_once

  !> Its Bernstein coefficients are no numbers, so that no half of [0, 1] can ever be left out: 2^48 of them.
  subroutine not_finite(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: a(0:n), roots(n), s
    integer :: count

    a = from_roots([0.5_wp], 1.0_wp)
    a(0) = 1.0_wp
    a(n - 1) = ieee_value(1.0_wp, ieee_negative_inf)
    a(n) = ieee_value(1.0_wp, ieee_positive_inf)
    call first_negative(a, bernstein_matrix(n), s)
    call check(error, s > 1.0_wp, 'a first root is found')
    call sign_changes(a, bernstein_matrix(n), roots, count)
    call check(error, count == 0, 'changes of sign are found')
  end subroutine not_finite

  subroutine chebyshev(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: roots(n), expected(8)
    integer :: count, i

    expected = [(0.5_wp - 0.5_wp*cos((i - 0.5_wp)*acos(-1.0_wp)/8), i=1, 8)]
    call sign_changes(from_roots(expected, 1.0_wp), bernstein_matrix(n), roots, count)
    call check(error, count == 8, 'not eight roots')
    if (.not. allocated(error)) call check_close(error, roots(:8), expected, 1.0e-9_wp, 'roots')
  end subroutine chebyshev

  subroutine products(error)
    type(error_type), allocatable, intent(out) :: error

    ! (1 + 2 s) 3 s^2 over [0, 2]: 8 + 24
    call check_close(error, product_integral([1.0_wp, 2.0_wp], [0.0_wp, 0.0_wp, 3.0_wp], 2.0_wp), 32.0_wp, 1.0e-13_wp, 'integral')
  end subroutine products
end program test_integrate_polynomial
