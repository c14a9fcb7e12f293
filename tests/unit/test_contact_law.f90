!> One contact under prescribed motion: closed forms and what must hold at every sample.
program test_contact_law
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_friction_line, only: slide_along_line, slider_interval
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_quadrature_event, only: evaluate_contact_by_events
  use attrito_testing_sampled_contact, only: contact_samples_type, evaluate_contact_by_samples, sample_contact
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping, state_open, regime_open, &
                                   regime_stick
  use attrito_contact_stuck_bound, only: is_stuck_by_bound
  use attrito_contact_trigonometric_roots, only: new_grid
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 4, k = 2*harmonics + 1
  real(wp), parameter :: kt = 3.0_wp, kn = 5.0_wp, mu = 0.4_wp

  if (run_suite('contact law', [ &
                test('a Jenkins element dissipates 4 mu N (a - mu N / kt) a cycle, to the kinks'' quadrature error', energy), &
                test('the energy converges as the number of samples squared', energy_order), &
                test('a contact that never slips has a constant deviation and no Jacobian', stuck), &
                test('a contact whose amplitudes say that it sticks does stick at every sample', amplitudes_tell), &
                test('a stuck contact keeps the slider it was given', stuck_keeps_slider), &
                test('a shaken-down slider stops at the near end of its interval', shaken_down), &
                test('friction never exceeds mu N, the wall never pulls, an open contact carries nothing', limits), &
                test('friction never gives work back: T . dw is not negative at any sample', dissipation), &
                test('the normal force is preload plus stiffness times what closes beyond the gap', gap_and_preload), &
                test('a gap acts as a preload of minus kn gap', gap_is_negative_preload), &
                test('a contact that just touches, to rounding, counts as closed, by samples as by events', just_touches), &
                test('a contact that stays open says so and forgets its history', open_contact), &
                test('a period maps the slider by a clamp, whatever its start', period_is_a_clamp), &
                test('one period reaches the steady loop, whatever the start', one_period_is_enough)], &
                quiet=.false.) > 0) error stop 1

contains

  pure function plain_law(tangents) result(law)
    integer, intent(in) :: tangents
    type(contact_type) :: law

    law = contact_type(tangents=tangents, tangential_stiffness=kt, normal_stiffness=kn, friction_coefficient=mu)
  end function plain_law

  !> Forces of a motion [2 H + 1, rows]
  function forces_of(law, motion, samples, slider) result(forces)
    type(contact_type), intent(in) :: law
    real(wp), intent(in) :: motion(:, :)
    integer, intent(in) :: samples
    real(wp), intent(in) :: slider(2)
    type(contact_forces_type) :: forces
    type(fourier_type) :: fourier

    fourier = new_fourier((size(motion, 1) - 1)/2, samples)
    allocate (forces%deviation(size(motion, 1), size(motion, 2)))
    call evaluate_contact_by_samples(law, fourier, motion, slider, .false., forces)
    call fourier%destroy()
  end function forces_of

  !> Energy per cycle of u = a cos(theta) under constant N, less the closed form.
  real(wp) function energy_error(samples)
    integer, intent(in) :: samples
    real(wp), parameter :: a = 2.0_wp, n = 3.0_wp
    type(contact_type) :: law
    type(contact_forces_type) :: forces

    law = plain_law(1)
    law%preload = n
    forces = forces_of(law, reshape([0.0_wp, a, 0.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [3, 2]), samples, [0.0_wp, 0.0_wp])
    ! The work of T over du = -a sin(theta) d theta takes T's sine, and g differs from T by kt u, which has none.
    energy_error = -pi*a*forces%deviation(3, 1) - 4.0_wp*mu*n*(a - mu*n/kt)
  end function energy_error

  subroutine energy(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: a = 2.0_wp, n = 3.0_wp
    real(wp) :: slope_jump
    integer :: samples

    ! With even J the turning points are samples and T is exact at each of them; what is left is the trapezoidal rule's error at the
    ! two onsets of slip per cycle, where the slope of T u' jumps by kt u'^2: at most jump h^2 / 12 each (a tenth for higher orders).
    slope_jump = kt*(a**2 - (a - 2.0_wp*mu*n/kt)**2)
    do samples = 64, 1024, 30
      call check_close(error, energy_error(samples), 0.0_wp, 1.1_wp*2.0_wp*slope_jump*(two_pi/samples)**2/12.0_wp, 'energy')
    end do
  end subroutine energy

  subroutine energy_order(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: coarse = 128
    real(wp) :: of_coarse, of_fine
    integer :: j

    ! The place of the onset between samples scatters single errors: compare their quadratic means over an octave.
    of_coarse = norm2([(energy_error(j), j=coarse, 2*coarse - 2, 2)])/sqrt(0.5_wp*coarse)
    of_fine = norm2([(energy_error(j), j=8*coarse, 16*coarse - 2, 16)])/sqrt(0.5_wp*coarse)
    call check_close(error, log(of_coarse/of_fine)/log(8.0_wp), 2.0_wp, 0.15_wp, 'order')
  end subroutine energy_order

  subroutine stuck(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 3)
    integer :: tangents

    do tangents = 1, 2
      ! u of order 0.05 within mu N / kt of 0.7
      motion = reshape(0.01_wp*noise(3*k, 1), [k, 3])
      motion(1, tangents + 1) = 1.0_wp
      forces = forces_of(plain_law(tangents), motion(:, :tangents + 1), 64, [0.0_wp, 0.0_wp])
      call check(error, forces%state == state_stuck, 'it is not stuck')
      call check(error, .not. any(forces%active), 'rows of the Jacobian are active')
      call check(error, .not. allocated(forces%jacobian), 'it has a Jacobian')
      call check_close(error, forces%deviation, 0.0_wp*motion(:, :tangents + 1), 1.0e-14_wp, 'deviation')
    end do
  end subroutine stuck

  subroutine amplitudes_tell(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(contact_samples_type) :: samples
    type(fourier_type) :: fourier
    real(wp) :: motion(k, 3), slider(2)
    integer :: seed, tangents, told, sticking

    fourier = new_fourier(harmonics, 64)
    told = 0
    sticking = 0
    do seed = 1, 200
      tangents = 1 + modulo(seed, 2)
      law = plain_law(tangents)
      motion = 0.02_wp*reshape(noise(3*k, seed), [k, 3])
      motion(1, tangents + 1) = 0.005_wp*seed
      slider = 0.1_wp*noise(2, seed + 500)
      if (allocated(samples%displacement)) deallocate (samples%displacement, samples%slider, samples%regimes)
      if (allocated(samples%gradients)) deallocate (samples%gradients)
      if (allocated(samples%origins)) deallocate (samples%origins, samples%sides)
      samples%moved = .false.
      call sample_contact(law, fourier, motion(:, :tangents + 1), slider, 2, samples)
      if (.not. samples%moved) sticking = sticking + 1
      if (.not. is_stuck_by_bound(law, motion(:, :tangents + 1), slider)) cycle
      told = told + 1
      call check(error, .not. samples%moved .and. all(samples%regimes == regime_stick), 'it is said to stick, and slips')
    end do
    call check(error, told > 50 .and. sticking > told .and. sticking < 190, 'all or none stick: the test is void')
    call fourier%destroy()
  end subroutine amplitudes_tell

  subroutine stuck_keeps_slider(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp), parameter :: w = 0.1_wp
    real(wp) :: motion(k, 2), expected(k, 2)

    motion = reshape(0.01_wp*noise(2*k, 1), [k, 2])
    motion(1, 2) = 1.0_wp
    forces = forces_of(plain_law(1), motion, 64, [w, 0.0_wp])
    expected = 0.0_wp
    expected(1, 1) = -kt*w
    call check(error, forces%state == state_stuck .and. .not. forces%unique, 'it is not stuck')
    call check_close(error, forces%deviation, expected, 1.0e-14_wp, 'deviation')
    call check_close(error, forces%slider(1), w, 0.0_wp, 'slider')
  end subroutine stuck_keeps_slider

  subroutine shaken_down(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp), parameter :: a = 0.2_wp, radius = mu*1.0_wp*kn/kt
    real(wp) :: motion(3, 2), expected(3, 2), side
    integer :: i

    ! u = a cos, N constant: the interval of w is [a - r, r - a].
    motion = reshape([0.0_wp, a, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp], [3, 2])
    do i = -1, 1, 2
      side = real(i, wp)
      forces = forces_of(plain_law(1), motion, 64, [side*10.0_wp, 0.0_wp])
      expected = 0.0_wp
      expected(1, 1) = -kt*side*(radius - a)
      call check(error, forces%state == state_shaken_down, 'it has not shaken down')
      call check_close(error, forces%deviation, expected, 1.0e-14_wp, 'deviation')
      call check(error, all(forces%active .eqv. [.true., spread(.false., 1, 5)]), 'more than the mean of T is active')
    end do
  end subroutine shaken_down

  !> Samples of motions that stick, slip and open, both kinds of contact; `seed` picks one.
  subroutine lively_samples(seed, law, samples)
    integer, intent(in) :: seed
    type(contact_type), intent(out) :: law
    type(contact_samples_type), intent(out) :: samples
    type(fourier_type) :: fourier
    real(wp) :: motion(k, 3)

    law = plain_law(1 + modulo(seed, 2))
    law%gap = 0.1_wp
    law%preload = 1.0_wp
    motion = reshape(noise(3*k, seed), [k, 3])
    fourier = new_fourier(harmonics, 64)
    call sample_contact(law, fourier, motion(:, 3 - law%tangents:), noise(2, seed), 40, samples)
    call fourier%destroy()
  end subroutine lively_samples

  subroutine limits(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(contact_samples_type) :: samples
    integer :: seed, j, opened

    opened = 0
    do seed = 1, 40
      call lively_samples(seed, law, samples)
      associate (force => samples%force, n => law%tangents + 1)
        do j = 1, size(force, 1)
          call check(error, force(j, n) >= 0.0_wp, 'the wall pulls')
          ! T = kt (u - w) of numbers of order 5: some 10 roundings of 3 times 5.
          call check(error, norm2(force(j, :n - 1)) <= mu*force(j, n) + 3.0e-14_wp, 'friction exceeds mu N')
          if (force(j, n) > 0.0_wp) cycle
          opened = opened + 1
          call check(error, all(abs(force(j, :n - 1)) <= 0.0_wp), 'friction without contact')
          call check(error, samples%regimes(j) == regime_open, 'no contact, and not said to be open')
        end do
      end associate
    end do
    call check(error, opened > 100, 'the motions hardly open the contact: the test is void')
  end subroutine limits

  subroutine dissipation(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(contact_samples_type) :: samples
    real(wp) :: before(2), power, total
    integer :: seed, j

    do seed = 1, 40
      call lively_samples(seed, law, samples)
      before = samples%start
      total = 0.0_wp
      do j = 1, size(samples%force, 1)
        power = dot_product(samples%force(j, :law%tangents), samples%slider(j, :law%tangents) - before(:law%tangents))
        call check(error, power >= -1.0e-14_wp, 'friction gives work back')
        total = total + power
        before = samples%slider(j, :)
      end do
      call check(error, total > 0.1_wp, 'the motion hardly dissipates: the test is void')
    end do
  end subroutine dissipation

  subroutine gap_and_preload(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(contact_forces_type) :: forces
    real(wp), parameter :: closings(4) = [-1.0_wp, 0.0_wp, 0.3_wp, 2.0_wp]
    integer :: i

    law = plain_law(1)
    law%gap = 0.5_wp
    law%preload = 2.0_wp
    do i = 1, size(closings)
      forces = forces_of(law, reshape([0.0_wp, 0.0_wp, 0.0_wp, closings(i), 0.0_wp, 0.0_wp], [3, 2]), 16, [0.0_wp, 0.0_wp])
      ! N = g_n + kn v, and nothing but a mean.
      call check_close(error, forces%deviation(:, 2) + kn*[closings(i), 0.0_wp, 0.0_wp], &
                       [max(2.0_wp + kn*(closings(i) - 0.5_wp), 0.0_wp), 0.0_wp, 0.0_wp], 1.0e-14_wp, 'normal force')
    end do
  end subroutine gap_and_preload

  subroutine gap_is_negative_preload(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: with_gap, with_preload
    type(contact_forces_type) :: a, b
    real(wp) :: motion(k, 3)

    with_gap = plain_law(2)
    with_gap%gap = 0.3_wp
    with_preload = plain_law(2)
    with_preload%preload = -kn*0.3_wp
    motion = reshape(noise(3*k, 9), [k, 3])
    a = forces_of(with_gap, motion, 64, [0.0_wp, 0.0_wp])
    b = forces_of(with_preload, motion, 64, [0.0_wp, 0.0_wp])
    call check_close(error, a%deviation, b%deviation, 1.0e-13_wp, 'deviation')
  end subroutine gap_is_negative_preload

  !> N = N_p - kn gap + kn v cancels to a few units of rounding, of either sign; a thousand times that much is lift-off.
  subroutine just_touches(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: gap = 0.3_wp, unit = spacing(kn*gap)
    type(contact_type) :: law
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 2)
    integer :: i, missing

    motion = reshape(0.1_wp*noise(2*k, 3), [k, 2])
    motion(:, 2) = 0.0_wp
    law = plain_law(1)
    law%gap = gap
    do i = -2, 3
      missing = merge(1000, i, i == 3)
      law%preload = kn*gap - missing*unit
      forces = forces_of(law, motion, 64, [0.0_wp, 0.0_wp])
      call check(error, (forces%state == state_open) .eqv. i == 3, 'by samples')
      call evaluate_contact_by_events(law, new_grid(harmonics), motion, 0.0_wp, forces)
      call check(error, (forces%state == state_open) .eqv. i == 3, 'by events')
    end do
  end subroutine just_touches

  subroutine open_contact(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 2)

    motion = reshape(0.1_wp*noise(2*k, 2), [k, 2])
    motion(1, 2) = -2.0_wp
    forces = forces_of(plain_law(1), motion, 64, [7.0_wp, 0.0_wp])
    call check(error, forces%state == state_open .and. forces%open >= 1.0_wp .and. forces%unique, 'it is not said to be open')
    ! lambda = K_c d + g must vanish.
    call check_close(error, forces%deviation, -motion*spread([kt, kn], 1, k), 1.0e-13_wp, 'deviation')
  end subroutine open_contact

  subroutine period_is_a_clamp(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: u(48), r(48), low, high, w, start
    integer :: seed, i, wide

    wide = 0
    do seed = 1, 20
      u = 0.2_wp*noise(48, seed)
      ! Negative where it is open
      r = merge(0.15_wp, 0.05_wp, modulo(seed, 3) > 0) + 0.1_wp*noise(48, seed + 100)
      if (modulo(seed, 2) == 0) r = r + 0.3_wp
      call slider_interval(u, r, low, high)
      if (high > low) wide = wide + 1
      do i = -10, 10
        start = 0.1_wp*i
        call after_a_period(u, r, start, w)
        ! Both ways choose among the same numbers: equal to the last bit.
        call check_close(error, w, min(max(start, low), high), 0.0_wp, 'slider after a period')
      end do
    end do
    call check(error, wide > 2 .and. wide < 18, 'not both kinds of motion: the test is void')
  end subroutine period_is_a_clamp

  subroutine after_a_period(u, r, start, w)
    real(wp), intent(in) :: u(:), r(:), start
    real(wp), intent(out) :: w
    real(wp) :: slider(size(u))
    integer :: origin, side, origins(size(u)), sides(size(u)), regimes(size(u))

    w = start
    origin = 0
    side = 0
    call slide_along_line(u, r, w, origin, side, slider, origins, sides, regimes)
  end subroutine after_a_period

  subroutine one_period_is_enough(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: a, b
    real(wp) :: motion(k, 2)
    integer :: seed

    do seed = 1, 10
      motion = reshape(noise(2*k, seed), [k, 2])
      motion(1, 2) = 1.0_wp
      a = forces_of(plain_law(1), motion, 64, [-5.0_wp, 0.0_wp])
      b = forces_of(plain_law(1), motion, 64, [5.0_wp, 0.0_wp])
      call check(error, a%state == state_slipping .and. a%unique, 'the motion does not slip: the test is void')
      call check_close(error, a%deviation, b%deviation, 0.0_wp, 'deviation')
      call check_close(error, a%jacobian, b%jacobian, 0.0_wp, 'Jacobian')
    end do
  end subroutine one_period_is_enough
end program test_contact_law
