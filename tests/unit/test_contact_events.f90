!> Contact forces by events, exact, against closed forms, differences, and samples that converge to them.
program test_contact_events
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_quadrature_event, only: evaluate_contact_by_events
  use attrito_contact_forces, only: contact_forces_type
  use attrito_testing_sampled_contact, only: evaluate_contact_by_samples
  use attrito_contact_second_derivative_event, only: differentiate_twice_by_events
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping, state_open
  use attrito_contact_trigonometric_roots, only: new_grid, roots_of
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1
  type(contact_type), parameter :: law = contact_type(tangents=1, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, &
                                                      friction_coefficient=0.4_wp)

  if (run_suite('contact events', [ &
                test('the energy per cycle is 4 mu N (a - mu N / kt) to rounding', energy), &
                test('samples converge to the events like J^-2, in contact and through landing', order), &
                test('twenty harmonics, and forces to sixty, are those of many samples', many_harmonics), &
                test('a contact in stick and slip has the Jacobian of differences', slipping), &
                test('a contact that opens and lands has the Jacobian of differences', lift_off), &
                test('a shaken-down contact has the Jacobian of differences', shaken_down), &
                test('a contact whose slider stands at its limit to rounding rests there', at_its_limit), &
                test('the second derivative is that of differences of the Jacobian, and symmetric', second_derivative), &
                test('a stuck contact has a constant deviation and no Jacobian', stuck), &
                test('an open contact has the Jacobian of minus its springs', opened), &
                test('one period reaches the steady loop, whatever the start', forgets), &
                test('roots are found where several, a close pair, or none are', roots)], quiet=.false.) > 0) error stop 1

contains

  function forces_of(motion, slider) result(forces)
    real(wp), intent(in) :: motion(:, :), slider
    type(contact_forces_type) :: forces

    allocate (forces%deviation(size(motion, 1), 2))
    call evaluate_contact_by_events(law, new_grid((size(motion, 1) - 1)/2), motion, slider, forces)
  end function forces_of

  !> Motion with a mean closing: 1 stays closed, 0.1 opens.
  function motion_of(seed, closing) result(motion)
    integer, intent(in) :: seed
    real(wp), intent(in) :: closing
    real(wp) :: motion(k, 2)

    motion = 0.5_wp*reshape(noise(2*k, seed), [k, 2])
    motion(:, 2) = 0.4_wp*motion(:, 2)
    motion(1, 2) = closing
  end function motion_of

  subroutine energy(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: a = 2.0_wp, normal = 5.0_wp*0.5_wp, limit = 0.4_wp*normal
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 2)

    motion = 0.0_wp
    motion(2, 1) = a
    motion(1, 2) = 0.5_wp
    forces = forces_of(motion, 0.3_wp)
    ! Work of T on u over the period, pi (T_c u_s - T_s u_c); the spring's own part does none.
    call check_close(error, [-pi*forces%deviation(3, 1)*a], [4.0_wp*limit*(a - limit/3.0_wp)], 1.0e-13_wp, 'energy')
    call check(error, forces%unique .and. forces%state == state_slipping, 'it slips and forgets')
  end subroutine energy

  subroutine order(error)
    type(error_type), allocatable, intent(out) :: error
    type(fourier_type) :: fourier
    type(contact_forces_type) :: exact, sampled
    real(wp) :: distance(2), motion(k, 2)
    integer :: i, seed

    do seed = 1, 6
      motion = motion_of(seed, merge(0.1_wp, 1.0_wp, seed > 3))
      exact = forces_of(motion, 0.0_wp)
      do i = 1, 2
        fourier = new_fourier(harmonics, 1024*16**(i - 1))
        if (allocated(sampled%deviation)) deallocate (sampled%deviation)
        allocate (sampled%deviation(k, 2))
        call evaluate_contact_by_samples(law, fourier, motion, [0.0_wp, 0.0_wp], .false., sampled)
        distance(i) = maxval(abs(sampled%deviation - exact%deviation))
        call fourier%destroy()
      end do
      ! 16 times the samples: 256 times closer, up to where switches fall between samples, which moves it a few times.
      call check(error, distance(2) < distance(1)/30.0_wp, 'the order')
    end do
  end subroutine order

  function deviation_of(motion) result(deviation)
    real(wp), intent(in) :: motion(:, :)
    real(wp), allocatable :: deviation(:, :)
    type(contact_forces_type) :: forces

    forces = forces_of(motion, 0.0_wp)
    deviation = forces%deviation
  end function deviation_of

  subroutine many_harmonics(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: many = 20, extended = 60
    type(fourier_type) :: fourier
    type(contact_forces_type) :: exact, sampled
    real(wp), parameter :: step = 1.0e-6_wp
    real(wp) :: motion(2*many + 1, 2), way(2*many + 1, 2)
    integer :: seed, h

    fourier = new_fourier(many, 65536)
    way = 0.1_wp*reshape(noise(size(way), 7), shape(way))
    do seed = 1, 4
      motion = reshape(noise(2*(2*many + 1), seed), shape(motion))
      do h = 1, many
        motion(2*h:2*h + 1, :) = motion(2*h:2*h + 1, :)/h**2
      end do
      motion(:, 2) = 0.3_wp*motion(:, 2)
      motion(1, 2) = merge(0.1_wp, 1.0_wp, seed > 2)
      if (allocated(exact%deviation)) deallocate (exact%deviation, sampled%deviation)
      allocate (exact%deviation(2*extended + 1, 2), sampled%deviation(2*extended + 1, 2))
      call evaluate_contact_by_events(law, new_grid(many), motion, 0.0_wp, exact)
      call evaluate_contact_by_samples(law, fourier, motion, [0.0_wp, 0.0_wp], .false., sampled)
      call check(error, (exact%open > 0.1_wp) .eqv. (seed > 2), 'it opens, or it should: the test is void')
      ! Kinks of slope 10 leave 10/12 (2 pi/J)^2 each.
      call check_close(error, exact%deviation, sampled%deviation, 1.0e-7_wp, 'deviation')
      call check_close(error, matmul(exact%jacobian, reshape(way, [size(way)])), reshape( &
                       (deviation_of(motion + step*way) - deviation_of(motion - step*way))/(2.0_wp*step), [size(way)]), 1.0e-6_wp, &
                       'Jacobian along a way')
    end do
    call fourier%destroy()
  end subroutine many_harmonics

  !> Within a pattern of events the forces are smooth with derivatives of order 10: central differences are exact to step^2 times
  !> third derivatives, 1e-5^2 * 1e2, and rounding, 1e-16/1e-5: both below 1e-7.
  subroutine check_jacobian(error, motion, slider, state)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: motion(:, :), slider
    integer, intent(in) :: state
    real(wp), parameter :: step = 1.0e-5_wp
    type(contact_forces_type) :: forces, above, below
    real(wp) :: moved(k, 2), difference(2*k)
    integer :: i, row

    forces = forces_of(motion, slider)
    call check(error, forces%state == state, 'the state meant')
    do i = 1, 2*k
      row = (i - 1)/k + 1
      moved = motion
      moved(i - (row - 1)*k, row) = moved(i - (row - 1)*k, row) + step
      above = forces_of(moved, slider)
      moved(i - (row - 1)*k, row) = moved(i - (row - 1)*k, row) - 2.0_wp*step
      below = forces_of(moved, slider)
      difference = reshape(above%deviation - below%deviation, [2*k])/(2.0_wp*step)
      call check_close(error, forces%jacobian(:, i), difference, 1.0e-7_wp, 'column of the Jacobian')
    end do
  end subroutine check_jacobian

  subroutine slipping(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed

    do seed = 1, 5
      call check_jacobian(error, motion_of(seed, 1.0_wp), 0.1_wp, state_slipping)
    end do
  end subroutine slipping

  subroutine lift_off(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed

    do seed = 1, 5
      call check_jacobian(error, motion_of(seed, 0.1_wp), 0.1_wp, state_slipping)
    end do
  end subroutine lift_off

  subroutine shaken_down(error)
    type(error_type), allocatable, intent(out) :: error

    call check_jacobian(error, 0.1_wp*motion_of(1, 10.0_wp), 5.0_wp, state_shaken_down)
  end subroutine shaken_down

  !> Beyond its limit by units in the last place, far within what counts as rounding, 1e-13, it is not moved; by 1e-9 it is.
  subroutine at_its_limit(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 2), limit

    motion = 0.1_wp*motion_of(1, 10.0_wp)
    forces = forces_of(motion, 5.0_wp)
    limit = forces%slider(1)
    call check(error, forces%state == state_shaken_down .and. limit > 0.0_wp .and. limit < 5.0_wp, 'pushed to its limit')
    forces = forces_of(motion, limit*(1.0_wp + 4.0_wp*epsilon(1.0_wp)))
    call check(error, forces%state == state_stuck .and. .not. allocated(forces%jacobian), 'rests there')
    call check_close(error, forces%slider(1), limit, 1.0e-15_wp*limit, 'the slider')
    forces = forces_of(motion, limit*(1.0_wp + 1.0e-9_wp))
    call check(error, forces%state == state_shaken_down .and. allocated(forces%jacobian), 'moved')
  end subroutine at_its_limit

  subroutine second_derivative(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: step = 1.0e-5_wp
    type(contact_forces_type) :: here, ahead, behind
    real(wp) :: motion(k, 2), along(k, 2), x(2*k, 2), product(2*k, 2), swapped(2*k, 1)
    integer :: seed, slip

    slip = 0
    do seed = 1, 12
      motion = motion_of(seed, merge(0.1_wp, 1.0_wp, seed <= 6))
      if (seed > 10) motion = 0.1_wp*motion_of(seed, 10.0_wp)
      along = reshape(noise(2*k, 100 + seed), [k, 2])
      x = reshape(noise(4*k, 200 + seed), [2*k, 2])
      here = forces_of(motion, 5.0_wp)
      ahead = forces_of(motion + step*along, 5.0_wp)
      behind = forces_of(motion - step*along, 5.0_wp)
      call differentiate_twice_by_events(law, new_grid(harmonics), motion, 5.0_wp, here%active, along, x, product)
      if (here%state == state_slipping) slip = slip + 1
      ! Differences are wrong by step^2 (1e-10) times a third derivative, which grows like the inverse squared slopes of crossings.
      if (.not. (allocated(ahead%jacobian) .and. allocated(behind%jacobian))) cycle
      call check_close(error, product, matmul(ahead%jacobian - behind%jacobian, x)/(2.0_wp*step), &
                       1.0e-6_wp*max(1.0_wp, maxval(abs(product))), 'change of the Jacobian')
      call differentiate_twice_by_events(law, new_grid(harmonics), motion, 5.0_wp, here%active, reshape(x(:, 1), [k, 2]), &
                                         reshape(along, [2*k, 1]), swapped)
      call check_close(error, swapped(:, 1), product(:, 1), 1.0e-10_wp*max(1.0_wp, maxval(abs(product))), 'symmetry')
    end do
    call check(error, slip >= 8, 'most slip: else the test is void')
  end subroutine second_derivative

  subroutine stuck(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: expected(k, 2)

    forces = forces_of(0.1_wp*motion_of(1, 10.0_wp), 0.02_wp)
    expected = 0.0_wp
    expected(1, 1) = -3.0_wp*0.02_wp
    call check(error, forces%state == state_stuck .and. .not. allocated(forces%jacobian) .and. .not. any(forces%active), 'stuck')
    call check(error, .not. forces%unique, 'a stuck contact remembers its slider')
    call check_close(error, reshape(forces%deviation, [2*k]), reshape(expected, [2*k]), 1.0e-15_wp, 'deviation')
  end subroutine stuck

  subroutine opened(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 2)

    motion = motion_of(1, -10.0_wp)
    forces = forces_of(motion, 0.0_wp)
    call check(error, forces%state == state_open .and. forces%unique, 'open')
    call check_close(error, forces%deviation(:, 1), -3.0_wp*motion(:, 1), 1.0e-14_wp, 'tangential')
    call check_close(error, forces%deviation(:, 2), -5.0_wp*motion(:, 2), 1.0e-13_wp, 'normal')
    call check_jacobian(error, motion, 0.0_wp, state_open)
  end subroutine opened

  subroutine forgets(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: one, other

    one = forces_of(motion_of(2, 1.0_wp), -7.0_wp)
    other = forces_of(motion_of(2, 1.0_wp), 9.0_wp)
    call check(error, one%unique .and. other%unique, 'it forgets')
    call check_close(error, reshape(one%deviation, [2*k]), reshape(other%deviation, [2*k]), 1.0e-14_wp, 'deviation')
  end subroutine forgets

  subroutine roots(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: close = 1.0e-6_wp

    call check(error, size(roots_of([2.0_wp, 1.0_wp, 0.0_wp], new_grid(1))) == 0, 'none')
    call check(error, size(roots_of([0.1_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], new_grid(3))) == 6, 'six')
    ! 1 - close + cos theta: a pair around pi, apart by 2 sqrt(2 close), far less than a step of the grid.
    call check_close(error, roots_of([1.0_wp - close, 1.0_wp, 0.0_wp], new_grid(1)) - pi, &
                     [-1.0_wp, 1.0_wp]*acos(1.0_wp - close), 1.0e-12_wp/sqrt(close), 'a close pair')
    call check(error, size(roots_of([1.0_wp + close, 1.0_wp, 0.0_wp], new_grid(1))) == 0, 'a pair that just misses')
  end subroutine roots
end program test_contact_events
