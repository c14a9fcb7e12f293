!> The safeguarded secant: smooth functions, kinks and jumps are enclosed, and no trial lies at an end.
program test_secant
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_secant, only: bracket_type, secant_share, within
  use testing, only: test, run_suite, check, check_close
  implicit none

  real(wp), parameter :: root = 0.3_wp
  integer, parameter :: smooth = 1, one_sided = 2, jump = 3

  if (run_suite('secant', [ &
                test('a line is met by the first secant', line), &
                test('of a smooth function 14 trials leave 1e-8 open, its least value times the distance of the ends', close_in), &
                test('a function that is flat on one side is enclosed from both sides', flat), &
                test('a jump is halved at every third trial at least', jumps), &
                test('values of one sign have the middle tried', one_sign), &
                test('no trial lies at an end', off_ends)], quiet=.false.) > 0) error stop 1

contains

  pure real(wp) function value(kind, x)
    integer, intent(in) :: kind
    real(wp), intent(in) :: x

    select case (kind)
     case (smooth)
      value = exp(2.0_wp*(x - root)) - 1.0_wp
     case (one_sided)
      value = merge(x - root, (x - root)**3, x > root)
     case default
      value = merge(1.0_wp, -1.0e-3_wp, x > root)
    end select
  end function value

  !> The function enclosed by so many trials.
  function enclosed(kind, trials) result(bracket)
    integer, intent(in) :: kind, trials
    type(bracket_type) :: bracket
    real(wp) :: x
    integer :: i

    bracket%weight = [value(kind, 0.0_wp), value(kind, 1.0_wp)]
    do i = 1, trials
      x = bracket%trial(i)
      call bracket%take(merge(2, 1, value(kind, x) > 0.0_wp), x, value(kind, x))
    end do
  end function enclosed

  subroutine line(error)
    type(error_type), allocatable, intent(out) :: error
    type(bracket_type) :: bracket

    bracket = bracket_type(abscissa=[2.0_wp, 6.0_wp], weight=[-1.0_wp, 3.0_wp])
    call check_close(error, bracket%trial(1), 3.0_wp, 1.0e-15_wp, 'trial')
    call check_close(error, secant_share([-1.0_wp, 3.0_wp]), 0.25_wp, 0.0_wp, 'share')
  end subroutine line

  subroutine close_in(error)
    type(error_type), allocatable, intent(out) :: error
    type(bracket_type) :: bracket

    bracket = enclosed(smooth, 14)
    call check(error, bracket%abscissa(1) <= root .and. bracket%abscissa(2) >= root, 'the zero is lost')
    call check(error, min(-value(smooth, bracket%abscissa(1)), value(smooth, bracket%abscissa(2)))*bracket%width() < 1.0e-8_wp, &
               'more is left open')
  end subroutine close_in

  subroutine flat(error)
    type(error_type), allocatable, intent(out) :: error
    type(bracket_type) :: bracket

    bracket = enclosed(one_sided, 40)
    call check(error, bracket%abscissa(1) <= root .and. bracket%abscissa(2) >= root, 'the zero is lost')
    call check(error, bracket%width() < 1.0e-3_wp, 'an end stays where it is')
  end subroutine flat

  subroutine jumps(error)
    type(error_type), allocatable, intent(out) :: error
    type(bracket_type) :: bracket

    bracket = enclosed(jump, 30)
    call check(error, bracket%abscissa(1) <= root .and. bracket%abscissa(2) >= root, 'the jump is lost')
    call check(error, bracket%width() <= 0.5_wp**10, 'the jump is not halved')
  end subroutine jumps

  subroutine one_sign(error)
    type(error_type), allocatable, intent(out) :: error
    type(bracket_type) :: bracket

    bracket = bracket_type(weight=[1.0_wp, 3.0_wp])
    call check_close(error, bracket%trial(1), 0.5_wp, 0.0_wp, 'trial')
  end subroutine one_sign

  subroutine off_ends(error)
    type(error_type), allocatable, intent(out) :: error
    type(bracket_type) :: bracket

    bracket = bracket_type(weight=[-1.0e-12_wp, 1.0_wp])
    call check(error, bracket%trial(1) > 0.0_wp, 'a trial lies at the first end')
    bracket = bracket_type(weight=[-1.0_wp, 1.0e-12_wp])
    call check(error, bracket%trial(1) < 1.0_wp, 'a trial lies at the second end')
    call check_close(error, [within(-1.0_wp, 0.1_wp), within(0.4_wp, 0.1_wp), within(2.0_wp, 0.1_wp)], &
                     [0.1_wp, 0.4_wp, 0.9_wp], 1.0e-15_wp, 'parts')
  end subroutine off_ends
end program test_secant
