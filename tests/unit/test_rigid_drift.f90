!> Steps of a body that drifts repeat, those of one that is held shrink; a branch that goes on in mean positions alone has ended.
program test_rigid_drift
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_continuation_hidden_steps, only: hidden_steps_type
  use attrito_solve_rigid_drift, only: steps_repeat, repeated_means_type, moves_mean_alone, turns_into_mean, alike_in_mean, &
                                         mean_share
  use testing, only: test, run_suite, check
  implicit none

  !> Amount by which the body moves on
  real(wp), parameter :: move(2) = [3.0_wp, 4.0_wp]

  if (run_suite('rigid_drift', [ &
                test('steps that differ by the part that is allowed repeat, by more they do not', allowed), &
                test('every pair of steps is compared, the first ones too', every_pair), &
                test('steps no longer than the least one are no drift, nor is a body at rest', too_short), &
                test('two means are no evidence, three with the same step between are', three_means), &
                test('means that come nearer to a limit are of a body that is held', held), &
                test('only the last steps of the mean count', last_steps), &
                test('rounding of a body that is far away is no drift', far_away), &
                test('along a branch less has to change where a contact holds', along_branch), &
                test('a branch turns into the mean by a step, not by being soft all along', into_mean), &
                test('a branch creeps by steps that show nothing and failed as longer ones', creeping)], quiet=.false.) > 0) then
    error stop 1
  end if

contains

  subroutine allowed(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: across(2) = [-4.0_wp, 3.0_wp]

    call check(error, steps_repeat(reshape([move, move], [2, 2]), 0.0_wp, 0.0_wp), 'equal steps')
    call check(error, steps_repeat(reshape([move + 0.099_wp*across, move], [2, 2]), 0.1_wp, 0.0_wp), 'less than is allowed')
    call check(error,.not. steps_repeat(reshape([move + 0.101_wp*across, move], [2, 2]), 0.1_wp, 0.0_wp), 'more than is allowed')
    call check(error,.not. steps_repeat(reshape([-move, move], [2, 2]), 0.1_wp, 0.0_wp), 'to and fro')
  end subroutine allowed

  subroutine every_pair(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: steps(2, 7)
    integer :: other

    do other = 1, size(steps, 2)
      steps = spread(move, 2, size(steps, 2))
      call check(error, steps_repeat(steps, 0.01_wp, 0.0_wp), 'all alike')
      steps(:, other) = 1.1_wp*move
      call check(error,.not. steps_repeat(steps, 0.01_wp, 0.0_wp), 'one that differs')
    end do
  end subroutine every_pair

  subroutine too_short(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, steps_repeat(reshape([move, move], [2, 2]), 0.0_wp, 4.99_wp), 'longer than the least')
    call check(error,.not. steps_repeat(reshape([move, move], [2, 2]), 0.0_wp, 5.01_wp), 'shorter than the least')
    call check(error,.not. steps_repeat(reshape([0.0_wp*move, 0.0_wp*move], [2, 2]), 0.0_wp, 0.0_wp), 'at rest')
  end subroutine too_short

  subroutine three_means(error)
    type(error_type), allocatable, intent(out) :: error
    type(repeated_means_type) :: means
    integer :: i

    call check(error,.not. means%do_repeat(1.0_wp), 'no mean')
    do i = 1, 4
      call means%add([1.0_wp, -2.0_wp] + i*move)
      call check(error, means%do_repeat(1.0e-12_wp) .eqv. i > 2, 'means with equal steps between')
    end do
  end subroutine three_means

  subroutine held(error)
    type(error_type), allocatable, intent(out) :: error
    type(repeated_means_type) :: means
    integer :: i

    do i = 1, 8
      call means%add(move*(1.0_wp - 0.9_wp**i))
      call check(error,.not. means%do_repeat(alike_in_mean), 'steps that shrink by a tenth')
    end do
  end subroutine held

  subroutine last_steps(error)
    type(error_type), allocatable, intent(out) :: error
    type(repeated_means_type) :: means
    real(wp), parameter :: along(5) = [0.0_wp, 7.0_wp, 8.0_wp, 9.0_wp, 11.0_wp]
    integer :: i

    do i = 1, size(along)
      call means%add(along(i)*move)
      call check(error, means%do_repeat(alike_in_mean) .eqv. i == 4, 'the last two steps are alike')
    end do
  end subroutine last_steps

  subroutine far_away(error)
    type(error_type), allocatable, intent(out) :: error
    type(repeated_means_type) :: far, near
    integer :: i

    do i = 1, 3
      call far%add([1.0e6_wp, 0.0_wp] + i*[0.0_wp, 0.9e-6_wp])
      call near%add([1.0e6_wp, 0.0_wp] + i*[0.0_wp, 1.1e-6_wp])
    end do
    call check(error,.not. far%do_repeat(alike_in_mean), 'steps of 0.9e-12 of the mean')
    call check(error, near%do_repeat(alike_in_mean), 'steps of 1.1e-12 of the mean')
  end subroutine far_away

  subroutine along_branch(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, moves_mean_alone(0.1_wp, is_free=.true.), 'no contact holds')
    call check(error,.not. moves_mean_alone(0.1_wp, is_free=.false.), 'one holds')
    call check(error, moves_mean_alone(0.9_wp*mean_share, is_free=.false.), 'one holds, the mean alone changes')
    call check(error,.not. moves_mean_alone(0.9_wp, is_free=.true.), 'no contact holds, the motion changes')
  end subroutine along_branch

  subroutine into_mean(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, turns_into_mean(0.9_wp, 0.199_wp), 'from harmonics to the mean')
    call check(error,.not. turns_into_mean(0.9_wp, 0.201_wp), 'a fifth is harmonics')
    call check(error, turns_into_mean(0.04_wp, 0.019_wp), 'half of what it was')
    call check(error,.not. turns_into_mean(0.04_wp, 0.021_wp), 'more than half')
    call check(error,.not. turns_into_mean(0.02_wp, 0.05_wp), 'out of the mean')
  end subroutine into_mean

  subroutine creeping(error)
    type(error_type), allocatable, intent(out) :: error
    type(hidden_steps_type) :: after_failures, mixed, shown
    integer :: i

    do i = 1, 4
      call check(error,.not. after_failures%creep(), 'too few of them')
      call after_failures%add_failure()
      call after_failures%add(0.1_wp, 1.0_wp, 0.9_wp, 0.9_wp)
      if (modulo(i, 2) == 0) call mixed%add_failure()
      call mixed%add(0.1_wp, 1.0_wp, 0.9_wp, 0.9_wp)
      call shown%add_failure()
      call shown%add(merge(1.0_wp, 0.1_wp, i == 3), 1.0_wp, 0.9_wp, 0.9_wp)
    end do
    call check(error,.not. after_failures%creep(), 'the next step has not failed')
    call after_failures%add_failure()
    call mixed%add_failure()
    call shown%add_failure()
    call check(error, after_failures%creep(), 'four steps, and the next one has failed')
    call check(error,.not. mixed%creep(), 'half of the steps at once')
    call check(error,.not. shown%creep(), 'one of the four shows')
    call check(error,.not. after_failures%turn_into_mean, 'all along as much of it harmonics')
  end subroutine creeping
end program test_rigid_drift
