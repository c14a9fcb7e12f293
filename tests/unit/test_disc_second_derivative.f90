!> Second derivatives of forces with two tangents by events: against differences of the exact Jacobian, and each other.
program test_disc_second_derivative
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_rules, only: disc_rules_type, new_disc_rules
  use attrito_contact_forces, only: contact_forces_type, released
  use attrito_contact_second_derivative_disc, only: differentiate_twice_by_disc_events, start_slider_type
  use attrito_contact_state, only: state_shaken_down, state_slipping
  use random_discs, only: law, many, tight, motion_of, forces_of
  use testing, only: test, run_suite, check, check_close
  implicit none

  !> Of differences: where slip comes and goes events are near each other; places where sliders rest are known to 1e-9
  real(wp), parameter :: short = 2.0e-5_wp, long = 2.0e-4_wp

  if (run_suite('second derivatives of discs', [ &
                test('they are those of differences of the Jacobian, of 100 random motions', random_motions), &
                test('a slider that one or two instants hold has those of differences', resting), &
                test('they are symmetric', symmetric), &
                test('usual panels have those of fine ones wherever these find the same events', usual_panels), &
                test('a start slider that is an unknown leaves them as they are', unknown_start), &
                test('an open contact has none', open_contact)], quiet=.false.) > 0) error stop 1

contains

  !> The motion of a seed, with more or less slip, some that opens.
  function scene_of(seed) result(motion)
    integer, intent(in) :: seed
    real(wp), allocatable :: motion(:, :)

    motion = motion_of(1 + modulo(seed, 9), seed, 0.4_wp + 0.1_wp*modulo(seed, 20), 0.1_wp + 0.1_wp*modulo(seed, 10))
  end function scene_of

  !> D'[t] x, its slider found here.
  function twice(rules, motion, slider, along, x) result(product)
    type(disc_rules_type), intent(in) :: rules
    real(wp), intent(in) :: motion(:, :), slider(2), along(:, :), x(:, :)
    real(wp) :: product(size(motion))
    type(contact_forces_type) :: here
    real(wp) :: columns(size(motion), 1)
    logical :: done

    here = forces_of(rules, motion, slider, .false.)
    call differentiate_twice_by_disc_events(law, rules, motion, start_slider_type(given=slider, found=here%slider), along, &
                                            reshape(x, [size(x), 1]), columns, done)
    if (.not. done) error stop 'the march cannot be followed'
    product = columns(:, 1)
  end function twice

  !> (D(d + e t) - D(d - e t)) x/(2 e).
  function difference(rules, motion, slider, along, x, part) result(product)
    type(disc_rules_type), intent(in) :: rules
    real(wp), intent(in) :: motion(:, :), slider(2), along(:, :), x(:, :), part
    real(wp) :: product(size(motion))
    type(contact_forces_type) :: forces
    integer :: side

    product = 0.0_wp
    do side = -1, 1, 2
      forces = forces_of(rules, motion + side*part*along, slider, .false.)
      product = product + side/(2.0_wp*part)*matmul(forces%jacobian, reshape(x, [size(x)]))
    end do
  end function difference

  !> Their limit, from two steps: what is left grows with the fourth power of the step.
  function limit_of_differences(rules, motion, slider, along, x, step) result(product)
    type(disc_rules_type), intent(in) :: rules
    real(wp), intent(in) :: motion(:, :), slider(2), along(:, :), x(:, :), step
    real(wp) :: product(size(motion))

    product = (4.0_wp*difference(rules, motion, slider, along, x, step) &
               - difference(rules, motion, slider, along, x, 2.0_wp*step))/3.0_wp
  end function limit_of_differences

  subroutine random_motions(error)
    type(error_type), allocatable, intent(out) :: error
    type(disc_rules_type) :: rules
    type(contact_forces_type) :: here
    real(wp), allocatable :: expected(:)
    integer :: h, seed, slip, opens

    slip = 0
    opens = 0
    do seed = 1, 120
      h = 1 + modulo(seed, 9)
      rules = new_disc_rules(h, many, tight)
      associate (motion => scene_of(seed), along => motion_of(h, 1000 + seed, 1.0_wp, 1.0_wp), &
                 x => motion_of(h, 2000 + seed, 1.0_wp, 1.0_wp))
        here = forces_of(rules, motion, [0.0_wp, 0.0_wp], .false.)
        if (here%state /= state_slipping) cycle
        expected = limit_of_differences(rules, motion, [0.0_wp, 0.0_wp], along, x, short)
        call check_close(error, twice(rules, motion, [0.0_wp, 0.0_wp], along, x), expected, 1.0e-5_wp*maxval(abs(expected)), &
                         'change of the Jacobian')
      end associate
      slip = slip + 1
      if (here%open > 0.0_wp) opens = opens + 1
    end do
    call check(error, slip >= 100 .and. opens >= 15, 'too few slip or open: the test is void')
  end subroutine random_motions

  subroutine resting(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: slider(2) = [0.2_wp, -0.1_wp]
    type(disc_rules_type) :: rules
    type(contact_forces_type) :: here
    real(wp), allocatable :: motion(:, :), expected(:)
    integer :: seed, rests

    rests = 0
    rules = new_disc_rules(3)
    do seed = 1, 40
      motion = motion_of(3, seed, 0.1_wp*modulo(seed, 6), 0.3_wp)
      here = forces_of(rules, motion, slider, .false.)
      if (here%state /= state_shaken_down) cycle
      rests = rests + 1
      associate (along => motion_of(3, 100 + seed, 1.0_wp, 1.0_wp), x => motion_of(3, 200 + seed, 1.0_wp, 1.0_wp))
        expected = limit_of_differences(rules, motion, slider, along, x, long)
        call check_close(error, twice(rules, motion, slider, along, x), expected, 1.0e-5_wp*maxval(abs(expected)), &
                         'change of the Jacobian')
      end associate
    end do
    call check(error, rests >= 15, 'too few rest: the test is void')
  end subroutine resting

  subroutine symmetric(error)
    type(error_type), allocatable, intent(out) :: error
    type(disc_rules_type) :: rules
    real(wp), allocatable :: product(:)
    integer :: h, seed

    do seed = 1, 40
      h = 1 + modulo(seed, 9)
      rules = new_disc_rules(h)
      associate (motion => scene_of(seed), along => motion_of(h, 1000 + seed, 1.0_wp, 1.0_wp), &
                 x => motion_of(h, 2000 + seed, 1.0_wp, 1.0_wp))
        product = twice(rules, motion, [0.0_wp, 0.0_wp], along, x)
        call check_close(error, twice(rules, motion, [0.0_wp, 0.0_wp], x, along), product, 1.0e-10_wp*maxval(abs(product)), &
                         'of t and x in turn')
      end associate
    end do
  end subroutine symmetric

  subroutine usual_panels(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: usual(:), fine(:)
    integer :: h, seed, alike, tried

    alike = 0
    tried = 0
    do seed = 1, 200
      h = 1 + modulo(seed, 9)
      associate (motion => scene_of(seed), along => motion_of(h, 1000 + seed, 1.0_wp, 1.0_wp), &
                 x => motion_of(h, 2000 + seed, 1.0_wp, 1.0_wp))
        usual = twice(new_disc_rules(h), motion, [0.0_wp, 0.0_wp], along, x)
        fine = twice(new_disc_rules(h, many, tight), motion, [0.0_wp, 0.0_wp], along, x)
      end associate
      if (maxval(abs(fine)) <= 0.0_wp) cycle
      tried = tried + 1
      if (maxval(abs(usual - fine)) <= 1.0e-5_wp*maxval(abs(fine))) alike = alike + 1
    end do
    ! A stick or a slip of a hundredth of the period that long panels pass over is all but nothing in forces, not in these.
    call check(error, alike >= 0.98_wp*tried .and. tried > 150, 'usual panels are too rough')
  end subroutine usual_panels

  !> With the way along which it follows the motion, by its link.
  subroutine unknown_start(error)
    type(error_type), allocatable, intent(out) :: error
    type(disc_rules_type) :: rules
    type(start_slider_type) :: slider
    type(contact_forces_type) :: found, here
    real(wp), allocatable :: motion(:, :), along(:, :), x(:, :), product(:, :), expected(:)
    integer :: h, seed, closed
    logical :: done

    closed = 0
    do seed = 1, 40
      h = 1 + modulo(seed, 9)
      rules = new_disc_rules(h)
      motion = scene_of(seed)
      found = forces_of(rules, motion, [0.0_wp, 0.0_wp], .false.)
      if (found%state /= state_slipping .or. found%open > 0.0_wp) cycle
      closed = closed + 1
      here = forces_of(rules, motion, found%slider, .true.)
      along = motion_of(h, 1000 + seed, 1.0_wp, 1.0_wp)
      x = reshape(motion_of(h, 2000 + seed, 1.0_wp, 1.0_wp), [size(motion), 1])
      slider = start_slider_type(found=found%slider, periodic=.true.)
      slider%along = reshape(way_of(here, reshape(along, [size(along), 1])), [2])
      slider%columns = way_of(here, x)
      expected = twice(rules, motion, [0.0_wp, 0.0_wp], along, x)
      allocate (product(size(motion), 1))
      call differentiate_twice_by_disc_events(law, rules, motion, slider, along, x, product, done)
      call check(error, done, 'the march cannot be followed')
      ! The loop is closed to 1e-9 of the motion.
      call check_close(error, product(:, 1), expected, 1.0e-6_wp*maxval(abs(expected)), 'with an unknown start')
      deallocate (product)
    end do
    call check(error, closed >= 20, 'too few slip and stay closed: the test is void')
  end subroutine unknown_start

  !> How the slider follows the motion.
  function way_of(forces, columns) result(way)
    type(contact_forces_type), intent(in) :: forces
    real(wp), intent(in) :: columns(:, :)
    real(wp) :: way(2, size(columns, 2))

    way = released(forces%link%holding, matmul(forces%link%by_motion, columns))
  end function way_of

  subroutine open_contact(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: motion(7, 3)

    motion = motion_of(3, 1, 2.0_wp, 0.3_wp)
    motion(1, 3) = -10.0_wp
    call check_close(error, twice(new_disc_rules(3), motion, [0.0_wp, 0.0_wp], motion, motion), spread(0.0_wp, 1, 21), 0.0_wp, &
                     'of an open contact')
  end subroutine open_contact
end program test_disc_second_derivative
