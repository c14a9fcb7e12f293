!> Periods that pass, along two tangents by events: against a fine march, and differences.
program test_passing_period
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_rules, only: disc_rules_type, new_disc_rules
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_quadrature_disc, only: evaluate_contact_by_disc_events
  use fine_march, only: marched_deviation
  use random_discs, only: law, many, tight, motion_of
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1

  if (run_suite('passing period', [ &
                test('forces and the slider at the end are those of a fine march', by_march), &
                test('their derivatives are those of differences', differences), &
                test('a contact dragged at a constant rate bears friction throughout, whatever its period', dragged), &
                test('a period without a step has the loop of one that repeats', no_step)], quiet=.false.) > 0) error stop 1

contains

  function passed(rules, motion, mean_before, slider) result(forces)
    type(disc_rules_type), intent(in) :: rules
    real(wp), intent(in) :: motion(:, :), mean_before(3), slider(2)
    type(contact_forces_type) :: forces

    allocate (forces%deviation(size(motion, 1), 3))
    forces%mean_before = mean_before
    call evaluate_contact_by_disc_events(law, rules, motion, slider, .false., forces)
  end function passed

  !> Open at the start, at the end, at both, for part of the period, or never.
  subroutine by_march(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 3), step(3), slider(2), deviation(k, 3)
    integer :: seed, opens, stick, near

    opens = 0
    stick = 0
    near = 0
    do seed = 1, 16
      motion = motion_of(harmonics, seed, merge(0.4_wp, 2.0_wp, modulo(seed, 4) == 1), merge(1.6_wp, 0.3_wp, modulo(seed, 2) == 0))
      step = [0.3_wp, 0.2_wp, 0.15_wp]*noise(3, 40 + seed)
      slider = motion(1, :2) + 0.02_wp*noise(2, 70 + seed)
      forces = passed(new_disc_rules(harmonics), motion, motion(1, :) - step, slider)
      call marched_deviation(law, motion, step, 2**17, 1, slider, deviation)
      ! The march takes some that hardly slip before they open for one of its steps too long or too short.
      call check_close(error, forces%deviation, deviation, 6.0e-6_wp, 'deviation')
      call check_close(error, forces%slider + forces%moved, slider, 2.0e-7_wp, 'slider')
      if (maxval(abs(forces%deviation - deviation)) < 2.0e-9_wp) near = near + 1
      if (forces%open > 0.0_wp) opens = opens + 1
      if (forces%stick > 0.0_wp) stick = stick + 1
    end do
    call check(error, near >= 12, 'far from the march')
    call check(error, opens >= 5 .and. stick >= 5, 'hardly any opens, or sticks: the test is void')
  end subroutine by_march

  subroutine differences(error)
    type(error_type), allocatable, intent(out) :: error
    ! Second order of the step times third derivatives, and panels' 1e-13 over the step
    real(wp), parameter :: reach = 1.0e-5_wp, tolerance = 2.0e-6_wp
    type(contact_forces_type) :: at, above, below
    type(disc_rules_type) :: fine
    real(wp) :: motion(k, 3), moved(k, 3), mean_before(3), slider(2)
    integer :: a, i, seed

    fine = new_disc_rules(harmonics, many, tight)
    do seed = 1, 8
      motion = motion_of(harmonics, seed, merge(0.4_wp, 2.0_wp, modulo(seed, 4) == 1), merge(1.6_wp, 0.3_wp, modulo(seed, 2) == 0))
      mean_before = motion(1, :) - [0.3_wp, 0.2_wp, 0.15_wp]*noise(3, 40 + seed)
      slider = motion(1, :2) + 0.02_wp*noise(2, 70 + seed)
      at = passed(fine, motion, mean_before, slider)
      call check(error, all(at%active) .and. .not. at%periodic, 'no derivatives')
      do a = 1, 3
        do i = 1, k
          moved = motion
          moved(i, a) = motion(i, a) + reach
          above = passed(fine, moved, mean_before, slider)
          moved(i, a) = motion(i, a) - reach
          below = passed(fine, moved, mean_before, slider)
          call check_close(error, at%jacobian(:, (a - 1)*k + i), reshape((above%deviation - below%deviation)/(2.0_wp*reach), [3*k]), &
                           tolerance, 'column')
        end do
      end do
    end do
  end subroutine differences

  !> The slider on the rim behind it at the start, half a step before the mean: T = mu N along the step, and no harmonics of it.
  subroutine dragged(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp), parameter :: normal = 0.8_wp, along(2) = [0.6_wp, 0.8_wp], length = 2.0_wp
    real(wp) :: motion(k, 3), start(2), force(k, 3)
    integer :: i

    motion = 0.0_wp
    motion(1, :) = [0.3_wp, -0.2_wp, normal]
    start = motion(1, :2) - (0.5_wp*length + 0.4_wp*5.0_wp*normal/3.0_wp)*along
    forces = passed(new_disc_rules(harmonics), motion, motion(1, :) - [length*along, 0.0_wp], start)
    force = forces%deviation
    do i = 1, 3
      force(:, i) = force(:, i) + merge(3.0_wp, 5.0_wp, i < 3)*motion(:, i)
    end do
    call check_close(error, force(1, :), 5.0_wp*normal*[0.4_wp*along, 1.0_wp], 1.0e-12_wp, 'mean')
    call check_close(error, reshape(force(2:, :), [3*(k - 1)]), [(0.0_wp, i=1, 3*(k - 1))], 1.0e-11_wp, 'harmonics')
    call check_close(error, forces%moved, length*along, 1.0e-12_wp, 'slider')
  end subroutine dragged

  subroutine no_step(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: passing, repeating
    real(wp) :: motion(k, 3)

    motion = motion_of(harmonics, 3, 2.0_wp, 0.3_wp)
    allocate (repeating%deviation(k, 3))
    call evaluate_contact_by_disc_events(law, new_disc_rules(harmonics), motion, [0.0_wp, 0.0_wp], .false., repeating)
    passing = passed(new_disc_rules(harmonics), motion, motion(1, :), repeating%slider)
    call check_close(error, passing%deviation, repeating%deviation, 1.0e-12_wp, 'deviation')
    call check_close(error, passing%moved, [0.0_wp, 0.0_wp], 1.0e-12_wp, 'slider')
  end subroutine no_step
end program test_passing_period
