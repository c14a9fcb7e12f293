!> Contact forces of two tangents by events: against samples that converge to them, finer panels, one tangent, and differences.
program test_disc_events
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi
  use attrito_core_trigonometric, only: extrema
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_motion, only: disc_motion_type, new_disc_motion
  use attrito_contact_disc_rules, only: disc_rules_type, new_disc_rules, new_rough_rules
  use attrito_contact_forces, only: contact_forces_type, released
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_quadrature_disc, only: evaluate_contact_by_disc_events
  use attrito_contact_quadrature_event, only: evaluate_contact_by_events
  use attrito_testing_sampled_contact, only: evaluate_contact_by_samples
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping, state_open
  use attrito_contact_trigonometric_roots, only: new_grid
  use random_discs, only: law, many, tight, motion_of, forces_of
  use testing, only: test, run_suite, check, check_close
  implicit none

  if (run_suite('disc events', [ &
                test('samples converge to the events, in contact and through landing', samples_converge), &
                test('usual panels have the forces of fine ones to 1e-8, of 200 random motions', usual_panels), &
                test('so they have of 1000 motions that graze, reverse, open or all but follow a line', nasty_motions), &
                test('forces beyond the motion''s own harmonics are those of fine panels', forces_beyond), &
                test('instants of a normal force are found, a close pair in one step of the grid, too', crossings), &
                test('rough rules have the forces of fine ones to three digits', rough_rules), &
                test('along a line they are those of one tangent to rounding', one_tangent), &
                test('a contact that slips has the Jacobian of differences', slipping), &
                test('a contact that opens and lands, slipping or sticking, has the Jacobian of differences', lift_off), &
                test('a contact held by one instant and by two has the Jacobian of differences', resting), &
                test('a start slider that is an unknown has the derivatives of differences', unknown_start), &
                test('a start slider outside its disc is taken to the nearest place in it', start_outside), &
                test('forces go on where a contact just opens', grazing), &
                test('the loop goes on from the last place to rest where slip begins', onset), &
                test('forces without their Jacobian are the same', without_jacobian), &
                test('a contact stuck, open or just touching has what its springs leave', states)], quiet=.false.) > 0) error stop 1

contains

  !> Deviation by so many samples, the start slider being one that returns.
  function sampled_deviation(motion, samples) result(deviation)
    real(wp), intent(in) :: motion(:, :)
    integer, intent(in) :: samples
    real(wp), allocatable :: deviation(:, :)
    type(fourier_type) :: fourier
    type(contact_forces_type) :: forces
    real(wp) :: slider(2)
    integer :: i

    fourier = new_fourier((size(motion, 1) - 1)/2, samples)
    allocate (forces%deviation(size(motion, 1), 3))
    slider = 0.0_wp
    do i = 1, 8
      call evaluate_contact_by_samples(law, fourier, motion, slider, .true., forces)
      if (norm2(forces%moved) < 1.0e-13_wp) exit
      slider = slider + reshape(released(forces%link%holding, reshape(forces%moved, [2, 1])), [2])
    end do
    deviation = forces%deviation
    call fourier%destroy()
  end function sampled_deviation

  subroutine samples_converge(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: exact
    real(wp), allocatable :: coarse(:, :), fine(:, :), motion(:, :)
    integer :: seed, opens

    opens = 0
    do seed = 1, 16
      motion = motion_of(2 + modulo(seed, 4), seed, 2.0_wp, merge(1.6_wp, 0.3_wp, modulo(seed, 2) == 0))
      exact = forces_of(new_disc_rules(2 + modulo(seed, 4)), motion, [0.0_wp, 0.0_wp], .false.)
      call check(error, exact%state == state_slipping, 'it does not slip: the test is void')
      if (exact%open > 0.0_wp) opens = opens + 1
      coarse = sampled_deviation(motion, 4096)
      fine = sampled_deviation(motion, 8192)
      ! Switches fall anywhere between samples, which leaves about (2 pi/J)^2/12 = 5e-8 of the jumps in slope, of order 1.
      call check_close(error, exact%deviation, (4.0_wp*fine - coarse)/3.0_wp, 5.0e-7_wp, 'deviation')
    end do
    call check(error, opens >= 5, 'hardly any opens: the test is void')
  end subroutine samples_converge

  subroutine usual_panels(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: usual, fine
    real(wp), allocatable :: motion(:, :)
    integer :: seed, h, slip, opens

    slip = 0
    opens = 0
    do seed = 1, 200
      h = 1 + modulo(seed, 15)
      motion = motion_of(h, seed, 0.4_wp + 0.1_wp*modulo(seed, 20), 0.1_wp + 0.1_wp*modulo(seed, 10))
      usual = forces_of(new_disc_rules(h), motion, [0.0_wp, 0.0_wp], .false.)
      fine = forces_of(new_disc_rules(h, many, tight), motion, [0.0_wp, 0.0_wp], .false.)
      call check(error, usual%state == fine%state, 'states differ')
      call check_close(error, usual%deviation, fine%deviation, 1.0e-8_wp*maxval(abs(fine%deviation)), 'deviation')
      if (fine%state == state_slipping .and. .not. allocated(error)) then
        call check_close(error, usual%jacobian, fine%jacobian, 1.0e-6_wp*maxval(abs(fine%jacobian)), 'Jacobian')
      end if
      if (fine%state == state_slipping) slip = slip + 1
      if (fine%open > 0.0_wp) opens = opens + 1
    end do
    call check(error, slip > 150 .and. opens > 20, 'too few slip or open: the test is void')
  end subroutine usual_panels

  !> Families of motions in turn: any; N that comes to within 1e-1 to 1e-8 of opening, on either side; all but along a line, by 1e-1
  !> to 1e-10; N that hardly varies, so that the slider is near the end of where it can rest; several openings.
  subroutine nasty_motions(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: usual, fine
    real(wp), allocatable :: motion(:, :)
    real(wp) :: lowest(2), off
    integer :: seed, h, near, slip, opens

    slip = 0
    opens = 0
    near = 0
    do seed = 1, 1000
      h = 1 + modulo(seed, 20)
      motion = motion_of(h, seed, 0.4_wp + 0.1_wp*modulo(seed, 20), 0.1_wp + 0.1_wp*modulo(seed, 10))
      select case (modulo(seed, 5))
       case (1)
        lowest = extrema(motion(:, 3))
        off = 10.0_wp**(-modulo(seed/5, 8) - 1)*(lowest(2) - lowest(1))
        motion(1, 3) = motion(1, 3) - lowest(1) + merge(off, -off, modulo(seed, 2) == 0)
       case (2)
        motion(:, 2) = motion(:, 1) + 10.0_wp**(-modulo(seed/5, 10) - 1)*motion(:, 2)
       case (3)
        motion(:, 3) = 0.01_wp*motion(:, 3)
        motion(1, 3) = 0.3_wp
        motion(:, :2) = motion(:, :2)*2.0_wp
       case (4)
        motion(:, 3) = 3.0_wp*motion(:, 3)
        motion(2*h:, 3) = motion(2*h:, 3) + 0.3_wp
        motion(1, 3) = 0.2_wp
       case default
        ! Any
      end select
      usual = forces_of(new_disc_rules(h), motion, [0.0_wp, 0.0_wp], .false.)
      fine = forces_of(new_disc_rules(h, many, 1.0e-14_wp), motion, [0.0_wp, 0.0_wp], .false.)
      call check(error, usual%state == fine%state, 'states differ')
      off = maxval(abs(usual%deviation - fine%deviation))
      call check(error, off <= 1.0e-8_wp*maxval(abs(fine%deviation)), 'deviation')
      if (off <= 1.0e-9_wp*maxval(abs(fine%deviation))) near = near + 1
      if (fine%state == state_slipping) slip = slip + 1
      if (fine%open > 0.0_wp) opens = opens + 1
    end do
    call check(error, near > 900, 'few are as near as they mostly are')
    call check(error, slip > 600 .and. opens > 200, 'too few slip or open: the test is void')
  end subroutine nasty_motions

  subroutine forces_beyond(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: h = 5, extended = 3*h
    type(contact_forces_type) :: usual, fine
    integer :: seed
    do seed = 1, 20
      if (allocated(usual%deviation)) deallocate (usual%deviation, fine%deviation)
      allocate (usual%deviation(2*extended + 1, 3), fine%deviation(2*extended + 1, 3))
      associate (motion => motion_of(h, seed, 2.0_wp, 0.8_wp))
        call evaluate_contact_by_disc_events(law, new_disc_rules(h), motion, [0.0_wp, 0.0_wp], .false., usual)
        call evaluate_contact_by_disc_events(law, new_disc_rules(h, many, tight), motion, [0.0_wp, 0.0_wp], .false., fine)
      end associate
      call check_close(error, usual%deviation, fine%deviation, 1.0e-5_wp*maxval(abs(fine%deviation)), 'deviation')
    end do
  end subroutine forces_beyond

  !> A cosine from the middle of a step of the grid, so that its maximum is between two points.
  subroutine crossings(error)
    type(error_type), allocatable, intent(out) :: error
    type(disc_rules_type) :: rules(2)
    type(disc_motion_type) :: disc
    real(wp) :: motion(3, 3), middle, angle, tolerance
    real(wp), allocatable :: found(:)
    integer :: i, n

    rules = [new_disc_rules(1), new_rough_rules(1)]
    do n = 1, 2
      motion = 0.0_wp
      disc = new_disc_motion(law, rules(n), motion)
      middle = 0.5_wp*disc%step
      motion(2:3, 3) = [cos(middle), sin(middle)]
      disc = new_disc_motion(law, rules(n), motion)
      call disc%sample_slopes(rules(n))
      do i = 1, 30
        ! The last pairs lie in one step.
        angle = 0.44_wp*disc%step*1.1_wp**(30 - i)
        found = modulo(disc%crossings(rules(n), disc%slope*cos(angle)) - middle + pi, 2.0_wp*pi) - pi
        call check(error, size(found) == 2, 'two roots')
        if (allocated(error)) return
        ! Cubics err by step^4/384, roots by that over the slope.
        tolerance = merge(1.0e-14_wp, disc%step**4/384.0_wp, n == 1)/sin(angle)
        call check_close(error, [minval(found), maxval(found)], [-angle, angle], tolerance, 'roots')
      end do
      call check(error, size(disc%crossings(rules(n), 1.001_wp*disc%slope)) == 0, 'a pair that just misses')
    end do
    call rules(2)%destroy()
  end subroutine crossings

  !> Harmonics of the motion beyond h come to 1e-7 of it, so that they are left out.
  subroutine rough_rules(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: rough, fine
    real(wp), allocatable :: motion(:, :)
    integer :: h, k, seed, slip

    slip = 0
    do seed = 1, 60
      h = 1 + modulo(seed, 7)
      k = 6*h + 1
      allocate (motion(k, 3), source=1.0e-9_wp/k)
      motion(:2*h + 1, :) = motion_of(h, seed, 0.4_wp + 0.1_wp*modulo(seed, 20), 0.1_wp + 0.1_wp*modulo(seed, 10))
      fine = forces_of(new_disc_rules(3*h, many, tight), motion, [0.0_wp, 0.0_wp], .false.)
      rough = contact_forces_type(without_jacobian=.true.)
      allocate (rough%deviation(k, 3))
      call evaluate_contact_by_disc_events(law, new_rough_rules(3*h), motion, [0.0_wp, 0.0_wp], .false., rough)
      call check(error, rough%state == fine%state, 'states differ')
      call check_close(error, rough%deviation, fine%deviation, 1.0e-3_wp*maxval(abs(fine%deviation)), 'deviation')
      if (fine%state == state_slipping) slip = slip + 1
      deallocate (motion)
    end do
    call check(error, slip > 40, 'too few slip: the test is void')
  end subroutine rough_rules

  subroutine one_tangent(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: line
    type(contact_forces_type) :: disc, usual, clamp
    real(wp), allocatable :: motion(:, :)
    integer :: seed, h, opens

    line = law
    line%tangents = 1
    opens = 0
    do seed = 1, 30
      h = 1 + modulo(seed, 7)
      motion = motion_of(h, seed, 2.0_wp, 0.2_wp*modulo(seed, 10))
      motion(:, 2) = 0.0_wp
      disc = forces_of(new_disc_rules(h, many, tight), motion, [0.0_wp, 0.0_wp], .false.)
      usual = forces_of(new_disc_rules(h), motion, [0.0_wp, 0.0_wp], .false.)
      if (allocated(clamp%deviation)) deallocate (clamp%deviation)
      allocate (clamp%deviation(size(motion, 1), 2))
      call evaluate_contact_by_events(line, new_grid(h), motion(:, [1, 3]), 0.0_wp, clamp)
      call check(error, disc%state == clamp%state, 'states differ')
      call check_close(error, disc%deviation(:, [1, 3]), clamp%deviation, 1.0e-12_wp, 'deviation')
      ! Panels of four periods of the highest harmonic over 2 pi leave 1e-9 of products of two such harmonics.
      call check_close(error, usual%deviation(:, [1, 3]), clamp%deviation, 5.0e-9_wp, 'deviation by usual panels')
      call check_close(error, disc%deviation(:, 2), spread(0.0_wp, 1, size(motion, 1)), 1.0e-13_wp, 'across')
      call check_close(error, [disc%stick, disc%slip, disc%open], [clamp%stick, clamp%slip, clamp%open], 1.0e-12_wp, 'fractions')
      if (disc%open > 0.0_wp) opens = opens + 1
    end do
    call check(error, opens > 5, 'hardly any opens: the test is void')
  end subroutine one_tangent

  !> The whole Jacobian against central differences, of fine panels: within a list of events forces are smooth, with third derivatives
  !> of order 10^3, so that these are exact to 1e-5^2 * 1e3 and rounding, 1e-14/1e-5; the place of rest turns more sharply, with third
  !> derivatives of 10^5. Usual panels' own Jacobian is close to it.
  subroutine check_jacobian(error, motion, slider, state, usual, step)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: motion(:, :), slider(2)
    integer, intent(in) :: state
    !> Allowed of usual panels
    real(wp), intent(in) :: usual
    !> Of differences
    real(wp), intent(in) :: step
    type(disc_rules_type) :: rules
    type(contact_forces_type) :: forces, above, below, coarse
    real(wp) :: moved(size(motion, 1), 3), difference(size(motion))
    integer :: i, k, row

    k = size(motion, 1)
    rules = new_disc_rules((k - 1)/2, many, tight)
    forces = forces_of(rules, motion, slider, .false.)
    coarse = forces_of(new_disc_rules((k - 1)/2), motion, slider, .false.)
    call check(error, forces%state == state, 'not the state meant')
    if (allocated(error)) return
    do i = 1, size(motion)
      row = (i - 1)/k + 1
      moved = motion
      moved(i - (row - 1)*k, row) = moved(i - (row - 1)*k, row) + step
      above = forces_of(rules, moved, slider, .false.)
      moved(i - (row - 1)*k, row) = moved(i - (row - 1)*k, row) - 2.0_wp*step
      below = forces_of(rules, moved, slider, .false.)
      difference = reshape(above%deviation - below%deviation, [size(motion)])/(2.0_wp*step)
      call check_close(error, forces%jacobian(:, i), difference, 1.0e-6_wp, 'column of the Jacobian')
      call check_close(error, coarse%jacobian(:, i), forces%jacobian(:, i), usual, 'column of usual panels'' Jacobian')
    end do
  end subroutine check_jacobian

  subroutine slipping(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed

    do seed = 1, 8
      call check_jacobian(error, motion_of(3, seed, 1.0_wp + 0.2_wp*seed, 0.3_wp), [0.1_wp, 0.2_wp], state_slipping, &
                          1.0e-6_wp, 1.0e-5_wp)
    end do
  end subroutine slipping

  subroutine lift_off(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed

    do seed = 1, 8
      ! One that moves little along its tangents sticks where it lands.
      call check_jacobian(error, motion_of(3, seed, merge(0.2_wp, 2.0_wp, modulo(seed, 2) == 0), 1.5_wp), [0.1_wp, 0.2_wp], &
                          state_slipping, 1.0e-6_wp, 1.0e-5_wp)
    end do
  end subroutine lift_off

  subroutine resting(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp), allocatable :: motion(:, :)
    real(wp) :: slider(2)
    integer :: i, seed

    do seed = 1, 6
      motion = motion_of(3, seed, 0.2_wp, 0.2_wp)
      call check_jacobian(error, motion, [0.3_wp, -0.2_wp], state_shaken_down, 1.0e-10_wp, 1.0e-6_wp)
      forces = forces_of(new_disc_rules(3), motion, [0.3_wp, -0.2_wp], .false.)
      ! It stays where it has come to.
      forces = forces_of(new_disc_rules(3), motion, forces%slider, .false.)
      call check(error, forces%state == state_stuck .and. forces%may_stick, 'it does not rest')
      forces = forces_of(new_disc_rules(3), motion, forces%slider, .true.)
      call check(error, forces%state == state_stuck .and. .not. forces%follows(), 'it does not rest as an unknown')
      ! Marched there from afar, it rests as soon: each period takes it on along its discs' rims.
      slider = [0.3_wp, -0.2_wp]
      do i = 1, 200
        forces = forces_of(new_disc_rules(3), motion, slider, .true.)
        slider = forces%slider + forces%moved
        if (forces%state == state_stuck) exit
      end do
      call check(error, forces%state == state_stuck, 'it does not come to rest')
    end do
  end subroutine resting

  subroutine unknown_start(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: step = 1.0e-5_wp, start(2) = [0.04_wp, -0.03_wp]
    type(disc_rules_type) :: rules
    type(contact_forces_type) :: forces, above, below
    real(wp) :: motion(7, 3), moved(7, 3), slider(2), fixed(21, 21), difference(21)
    integer :: i, row, seed

    rules = new_disc_rules(3, many, tight)
    do seed = 1, 8
      motion = motion_of(3, seed, 2.0_wp, merge(0.3_wp, 1.5_wp, seed < 6))
      forces = forces_of(rules, motion, start, .true.)
      call check(error, forces%follows(), 'the slider does not follow')
      if (allocated(error)) return
      fixed = forces%jacobian
      fixed(:14, :) = fixed(:14, :) - matmul(forces%link%force, released(forces%link%holding, forces%link%by_motion))
      do i = 1, 21
        row = (i - 1)/7 + 1
        moved = motion
        moved(i - (row - 1)*7, row) = moved(i - (row - 1)*7, row) + step
        above = forces_of(rules, moved, start, .true.)
        moved(i - (row - 1)*7, row) = moved(i - (row - 1)*7, row) - 2.0_wp*step
        below = forces_of(rules, moved, start, .true.)
        difference = reshape(above%deviation - below%deviation, [21])/(2.0_wp*step)
        call check_close(error, fixed(:, i), difference, 1.0e-6_wp, 'by the motion')
        call check_close(error, forces%link%by_motion(:, i), (above%moved - below%moved)/(2.0_wp*step), 1.0e-6_wp, &
                         'end slider by the motion')
      end do
      do i = 1, 2
        slider = start
        slider(i) = start(i) + step
        above = forces_of(rules, motion, slider, .true.)
        slider(i) = start(i) - step
        below = forces_of(rules, motion, slider, .true.)
        difference = reshape(above%deviation - below%deviation, [21])/(2.0_wp*step)
        call check_close(error, forces%link%force(:, i), difference(:14), 1.0e-6_wp, 'by the slider')
        call check_close(error, -forces%link%holding(:, i), (above%moved - below%moved)/(2.0_wp*step), 1.0e-6_wp, &
                         'end slider by the slider')
      end do
    end do
  end subroutine unknown_start

  subroutine start_outside(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: far, near
    real(wp) :: motion(7, 3), u(2), z(2), r
    integer :: seed

    do seed = 1, 6
      motion = motion_of(3, seed, 1.0_wp, 0.3_wp)
      u = motion(1, :2) + motion(2, :2) + motion(4, :2) + motion(6, :2)
      r = law%friction_coefficient*law%normal_force(motion(1, 3) + motion(2, 3) + motion(4, 3) + motion(6, 3)) &
          /law%tangential_stiffness
      z = [cos(1.0_wp*seed), sin(1.0_wp*seed)]
      far = forces_of(new_disc_rules(3), motion, u - 3.0_wp*r*z, .true.)
      near = forces_of(new_disc_rules(3), motion, u - r*z, .true.)
      call check(error, far%state == state_slipping .and. norm2(far%moved) > 1.0_wp*r, 'it is not taken in')
      call check_close(error, far%deviation, near%deviation, 1.0e-10_wp, 'deviation')
      call check_close(error, far%slider + far%moved, near%slider + near%moved, 1.0e-10_wp, 'end slider')
    end do
  end subroutine start_outside

  subroutine grazing(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: opens, closed, fine
    type(disc_rules_type) :: rules
    real(wp) :: motion(7, 3), low, d
    integer :: i, seed

    rules = new_disc_rules(3)
    do seed = 1, 6
      motion = motion_of(3, seed, 2.0_wp, 1.0_wp)
      do i = 1, 4
        d = 10.0_wp**(-2*i)
        low = minval(matmul(rules%grids(1)%values, motion(:, 3)))
        motion(1, 3) = motion(1, 3) - low
        opens = forces_of(rules, pressed(motion, -d), [0.0_wp, 0.0_wp], .false.)
        closed = forces_of(rules, pressed(motion, d), [0.0_wp, 0.0_wp], .false.)
        fine = forces_of(new_disc_rules(3, many, tight), pressed(motion, d), [0.0_wp, 0.0_wp], .false.)
        call check_close(error, closed%deviation, fine%deviation, 1.0e-8_wp, 'just closed')
        call check_close(error, closed%deviation, opens%deviation, 20.0_wp*d, 'opening')
      end do
    end do
  end subroutine grazing

  !> A little more motion than lets the slider rest: it slips all around the place that was left, to the square root of the excess.
  subroutine onset(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: rests, slips, fine
    type(disc_rules_type) :: rules
    real(wp) :: low, high, middle
    integer :: i, seed

    rules = new_disc_rules(3)
    do seed = 1, 6
      low = 0.1_wp
      high = 3.0_wp
      do i = 1, 35
        middle = 0.5_wp*(low + high)
        rests = forces_of(rules, motion_of(3, seed, middle, 0.3_wp), [0.0_wp, 0.0_wp], .false.)
        if (rests%may_stick) then
          low = middle
        else
          high = middle
        end if
      end do
      rests = forces_of(rules, motion_of(3, seed, low, 0.3_wp), [0.0_wp, 0.0_wp], .false.)
      call check(error, rests%state == state_shaken_down, 'it does not rest')
      do i = 1, 3
        slips = forces_of(rules, motion_of(3, seed, high*(1.0_wp + 10.0_wp**(-2*i)), 0.3_wp), [0.0_wp, 0.0_wp], .false.)
        fine = forces_of(new_disc_rules(3, many, tight), motion_of(3, seed, high*(1.0_wp + 10.0_wp**(-2*i)), 0.3_wp), &
                         [0.0_wp, 0.0_wp], .false.)
        call check(error, slips%state == state_slipping .and. slips%slip > 0.0_wp, 'it does not slip')
        call check_close(error, slips%deviation, fine%deviation, 1.0e-8_wp, 'deviation')
        call check_close(error, slips%deviation, rests%deviation, 3.0_wp*10.0_wp**(-i), 'last rest')
      end do
    end do
  end subroutine onset

  !> A motion with its mean of v changed.
  function pressed(motion, by) result(other)
    real(wp), intent(in) :: motion(:, :), by
    real(wp) :: other(size(motion, 1), 3)

    other = motion
    other(1, 3) = other(1, 3) + by
  end function pressed

  subroutine without_jacobian(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: full, bare
    integer :: i, seed

    do seed = 1, 12
      associate (motion => motion_of(3, seed, 2.0_wp, merge(0.3_wp, 1.5_wp, seed < 6)))
        do i = 1, 2
          full = forces_of(new_disc_rules(3), motion, [0.1_wp, 0.0_wp], i == 1)
          if (allocated(bare%deviation)) deallocate (bare%deviation)
          allocate (bare%deviation(7, 3))
          bare%without_jacobian = .true.
          call evaluate_contact_by_disc_events(law, new_disc_rules(3), motion, [0.1_wp, 0.0_wp], i == 1, bare)
          call check_close(error, bare%deviation, full%deviation, 0.0_wp, 'deviation')
          call check(error, .not. allocated(bare%jacobian) .and. bare%state == full%state, 'state')
          call check_close(error, [bare%slider, bare%moved], [full%slider, full%moved], 0.0_wp, 'sliders')
        end do
      end associate
    end do
  end subroutine without_jacobian

  subroutine states(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: other
    type(contact_forces_type) :: forces
    real(wp) :: motion(7, 3), expected(7, 3), jacobian(21, 21)
    integer :: i, j

    motion = motion_of(3, 1, 2.0_wp, 0.3_wp)
    expected = 0.0_wp
    motion(1, 3) = 10.0_wp
    forces = forces_of(new_disc_rules(3), motion, [0.02_wp, 0.0_wp], .false.)
    expected(1, 1) = -3.0_wp*0.02_wp
    call check(error, forces%state == state_stuck .and. .not. allocated(forces%jacobian), 'stuck')
    call check_close(error, forces%deviation, expected, 1.0e-15_wp, 'deviation of stuck')
    motion(1, 3) = -10.0_wp
    do i = 1, 2
      forces = forces_of(new_disc_rules(3), motion, [0.0_wp, 0.0_wp], i == 1)
      call check(error, forces%state == state_open .and. forces%unique, 'open')
      expected = -3.0_wp*motion
      expected(:, 3) = -5.0_wp*motion(:, 3)
      call check_close(error, forces%deviation, expected, 1.0e-13_wp, 'deviation of open')
      jacobian = 0.0_wp
      do j = 1, 21
        jacobian(j, j) = merge(-3.0_wp, -5.0_wp, j <= 14)
      end do
      call check_close(error, forces%jacobian, jacobian, 1.0e-13_wp, 'Jacobian of open')
    end do
    ! N is zero throughout.
    other = law
    motion(:, 3) = 0.0_wp
    deallocate (forces%deviation)
    allocate (forces%deviation(7, 3))
    call evaluate_contact_by_disc_events(other, new_disc_rules(3), motion, [0.0_wp, 0.0_wp], .false., forces)
    call check(error, forces%state == state_slipping .and. .not. any(forces%active(15:)), 'touching')
    expected(:, 3) = 0.0_wp
    call check_close(error, forces%deviation, expected, 1.0e-13_wp, 'deviation of touching')
  end subroutine states
end program test_disc_events
