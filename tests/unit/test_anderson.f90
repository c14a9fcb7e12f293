!> Anderson's method: fixed points of linear maps that plain iteration runs away from, and of one that is not linear.
program test_anderson
  use attrito_core_anderson, only: anderson_type
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use session, only: only_me, run_in_session
  use testing, only: test, check
  implicit none

  integer, parameter :: n = 4

  call run_in_session('anderson', [ &
                      test('a linear map of four unknowns is solved by seven answers, though it grows threefold', linear), &
                      test('a map that bends is met as closely as it is asked for', bent), &
                      test('at the fixed point it stays', at_rest)])

contains

  !> G(x) = A x + 1 with eigenvalues 3, -2, 0.5, 0.9: x_i = 1/(1 - a_i) in the axes of A, which a rotation turns.
  subroutine linear(error)
    type(error_type), allocatable, intent(out) :: error
    type(anderson_type) :: mixing
    type(communicator_type) :: ranks
    real(wp), parameter :: a(n) = [3.0_wp, -2.0_wp, 0.5_wp, 0.9_wp]
    real(wp) :: x(n), turned(n), answer(n), mixed(n + 1)
    integer :: i

    ranks = only_me()
    x = 0.0_wp
    do i = 1, n + 3
      answer = to_axes(a*to_axes(x) + 1.0_wp)
      mixed = mixing%next(ranks, answer - x, [answer, sum(answer)])
      x = mixed(:n)
    end do
    turned = to_axes(x)
    ! Rounding of the normal equations is left after five, their condition being the square of the map's; two more remove it.
    call check(error, maxval(abs(turned - 1.0_wp/(1.0_wp - a))) < 1.0e-8_wp, 'the fixed point is missed')
    call check(error, abs(mixed(n + 1) - sum(x)) < 1.0e-12_wp, 'what follows from the answers is not mixed as they are')
  end subroutine linear

  !> Householder's reflection: its own inverse.
  pure function to_axes(x) result(turned)
    real(wp), intent(in) :: x(n)
    real(wp) :: turned(n)
    real(wp), parameter :: mirror(n) = [1.0_wp, 2.0_wp, -1.0_wp, 0.5_wp]

    turned = x - mirror*(2.0_wp*dot_product(mirror, x)/dot_product(mirror, mirror))
  end function to_axes

  !> x = -1.5 sin x + 1 in every unknown, from different starts: plain iteration does not settle, its slope being beyond -1.
  subroutine bent(error)
    type(error_type), allocatable, intent(out) :: error
    type(anderson_type) :: mixing
    type(communicator_type) :: ranks
    real(wp) :: x(n)
    integer :: i

    ranks = only_me()
    x = [0.1_wp, 0.3_wp, 0.5_wp, 0.7_wp]
    do i = 1, 20
      x = mixing%next(ranks, 1.0_wp - 1.5_wp*sin(x) - x, 1.0_wp - 1.5_wp*sin(x))
    end do
    call check(error, maxval(abs(x + 1.5_wp*sin(x) - 1.0_wp)) < 1.0e-9_wp, 'the fixed point is missed')
  end subroutine bent

  subroutine at_rest(error)
    type(error_type), allocatable, intent(out) :: error
    type(anderson_type) :: mixing
    type(communicator_type) :: ranks
    real(wp) :: x(n)
    integer :: i

    ranks = only_me()
    x = 2.0_wp
    do i = 1, 3
      x = mixing%next(ranks, 1.0_wp - 0.5_wp*x, 0.5_wp*x + 1.0_wp)
    end do
    call check(error, maxval(abs(x - 2.0_wp)) <= 0.0_wp, 'it leaves the fixed point')
  end subroutine at_rest
end program test_anderson
