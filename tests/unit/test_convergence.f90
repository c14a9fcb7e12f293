!> Which iterates of Newton's method are answers.
program test_convergence
  use, intrinsic :: ieee_arithmetic, only: ieee_positive_inf, ieee_quiet_nan, ieee_value
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_newton_convergence, only: has_diverged, is_converged, worse_of
  use testing, only: test, run_suite, check
  implicit none

  real(wp), parameter :: tolerance = 1.0e-10_wp

  if (run_suite('convergence', [ &
                test('a residual within the tolerance is one, a greater one is not', within), &
                test('what rounding of a great motion hides does not count', hidden), &
                test('what has run off is none, with any residual', run_off), &
                test('what is not a number is none, whatever stands beside it', not_a_number)], quiet=.false.) > 0) then
    error stop 1
  end if

contains

  subroutine within(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, is_converged(tolerance, 1.0_wp, tolerance), 'the tolerance itself')
    call check(error,.not. is_converged(1.01_wp*tolerance, 1.0_wp, tolerance), 'more than the tolerance')
  end subroutine within

  subroutine hidden(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: motion = 1.0e7_wp

    call check(error, is_converged(15.0_wp*epsilon(1.0_wp)*motion, motion, tolerance), 'less than rounding')
    call check(error,.not. is_converged(17.0_wp*epsilon(1.0_wp)*motion, motion, tolerance), 'more than rounding')
  end subroutine hidden

  subroutine run_off(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: far(3)
    integer :: i

    far = [1.1e8_wp, 1.0e248_wp, ieee_value(1.0_wp, ieee_positive_inf)]
    do i = 1, size(far)
      call check(error, has_diverged(far(i)), 'has run off')
      call check(error,.not. is_converged(0.0_wp, far(i), tolerance), 'run off, no residual')
      call check(error,.not. is_converged(huge(1.0_wp), far(i), tolerance), 'run off, any residual')
    end do
    call check(error,.not. has_diverged(0.99e8_wp), 'great, but not run off')
  end subroutine run_off

  subroutine not_a_number(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: nan, beside(2)
    integer :: i

    nan = ieee_value(1.0_wp, ieee_quiet_nan)
    call check(error,.not. is_converged(0.0_wp, nan, tolerance), 'motion')
    call check(error,.not. is_converged(nan, 1.0_wp, tolerance), 'residual')
    beside = [0.0_wp, 1.0_wp]
    do i = 1, size(beside)
      call check(error,.not. is_converged(worse_of(nan, beside(i)), 1.0_wp, tolerance), 'first of two residuals')
      call check(error,.not. is_converged(worse_of(beside(i), nan), 1.0_wp, tolerance), 'second of two residuals')
    end do
    call check(error, abs(worse_of(0.25_wp, 0.5_wp) - 0.5_wp) <= 0.0_wp, 'the larger of two numbers')
  end subroutine not_a_number
end program test_convergence
