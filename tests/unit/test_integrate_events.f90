!> Event-exact integration against closed forms and against tiny steps.
program test_integrate_events
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_integrate_loading, only: new_profile
  use attrito_integrate_run, only: run_options_type, orbit_type
  use attrito_integrate_system, only: system_type
  use attrito_model_contacts, only: contact_type, new_contacts
  use attrito_model_structure, only: damping_viscous, damping_loss_factor
  use integrations, only: choices, run_from, displacement_of, velocity_of, tiny_steps
  use scenes, only: scene_type, one_sided_oscillator, rubbing_frame, damp, wedge
  use testing, only: test, run_suite, check, check_close
  implicit none

  real(wp), parameter :: at_rest(1) = 0.0_wp, no_slider(2, 1) = 0.0_wp

  if (run_suite('integrate_events', [ &
                test('damped free vibration is that of the closed form after many periods', free_vibration), &
                test('a very stiff contact that stays open costs no accuracy', flight), &
                test('at undamped resonance the motion grows as t sin', resonance), &
                test('a ramp of the load leaves the vibration of the closed form', ramp), &
                test('a bouncing oscillator follows its two half sines', bouncing), &
                test('a graze from below is no event, a touch of 1e-9 is two', grazing), &
                test('two equal contacts at one place are one of twice the stiffness', simultaneous), &
                test('contacts that rub and open agree with tiny steps', brute_force), &
                test('without friction a contact slides without force', frictionless), &
                test('at rest at the limit of friction it stays at rest', rest_at_the_limit), &
                test('a loss factor is refused', loss_factor)], quiet=.false.) > 0) error stop 1

contains

  !> An oscillator of mass and stiffness 1 whose contact is out of reach.
  function far_away(ratio) result(scene)
    real(wp), intent(in) :: ratio
    type(scene_type) :: scene

    scene = one_sided_oscillator(3.0_wp, 1.0e3_wp, 0.0_wp, ratio)
  end function far_away

  !> Options of a march over whole periods, one more than asked for (the recorded one).
  function marching(scene, frequency_hz, level, periods) result(options)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: frequency_hz, level
    integer, intent(in) :: periods
    type(run_options_type) :: options

    options = choices(scene, frequency_hz, level)
    options%cycles = periods - 1
    options%fewest = periods - 1
    options%multiples = 1
  end function marching

  subroutine free_vibration(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: ratio = 0.01_wp, time = 40*7.0_wp, damped = sqrt(1.0_wp - ratio**2)
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit

    scene = far_away(ratio)
    call run_from(scene, marching(scene, 1.0_wp/7.0_wp, 0.0_wp, 40), [1.0_wp], [0.0_wp], no_slider, system, orbit, error)
    if (allocated(error)) return
    call check_close(error, displacement_of(system, orbit), &
                     [exp(-ratio*time)*(cos(damped*time) + ratio/damped*sin(damped*time))], 1.0e-12_wp, 'displacement')
    call check_close(error, velocity_of(system, orbit), [-exp(-ratio*time)*sin(damped*time)/damped], 1.0e-12_wp, 'velocity')
  end subroutine free_vibration

  !> The same with a contact 10^8 times as stiff, which sets the clock and is never reached: 2.8e6 units of it.
  subroutine flight(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: ratio = 0.01_wp, time = 40*7.0_wp, damped = sqrt(1.0_wp - ratio**2)
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit

    scene = one_sided_oscillator(1.0e8_wp, 1.0e3_wp, 0.0_wp, ratio)
    call run_from(scene, marching(scene, 1.0_wp/7.0_wp, 0.0_wp, 40), [1.0_wp], [0.0_wp], no_slider, system, orbit, error)
    if (allocated(error)) return
    call check_close(error, displacement_of(system, orbit), &
                     [exp(-ratio*time)*(cos(damped*time) + ratio/damped*sin(damped*time))], 1.0e-12_wp, 'displacement')
    call check_close(error, velocity_of(system, orbit), [-exp(-ratio*time)*sin(damped*time)/damped], 1.0e-12_wp, 'velocity')
  end subroutine flight

  subroutine resonance(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit

    scene = far_away(0.0_wp)
    call run_from(scene, marching(scene, 1.0_wp/two_pi, 1.0_wp, 20), at_rest, at_rest, no_slider, system, orbit, error)
    if (allocated(error)) return
    call check_close(error, displacement_of(system, orbit), at_rest, 1.0e-11_wp, 'displacement')
    call check_close(error, velocity_of(system, orbit), [0.5_wp*20*two_pi], 1.0e-11_wp, 'velocity')
  end subroutine resonance

  subroutine ramp(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: rise = 4.3_wp, time = 3*5.0_wp
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(run_options_type) :: options

    scene = far_away(0.0_wp)
    scene%structure%static_loads = 1.0_wp
    options = marching(scene, 0.2_wp, 0.0_wp, 3)
    options%static_profile = new_profile(reshape([0.0_wp, 0.0_wp, rise, 1.0_wp], [2, 2]))
    call run_from(scene, options, at_rest, at_rest, no_slider, system, orbit, error)
    if (allocated(error)) return
    call check_close(error, displacement_of(system, orbit), [1.0_wp - (sin(time) - sin(time - rise))/rise], 1.0e-13_wp, &
                     'displacement')
  end subroutine ramp

  !> From the origin upwards: half a period of stiffness 1 + kn, half of stiffness 1, without loss.
  subroutine bouncing(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: stiff = 2.0_wp, period = pi + pi/stiff
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    real(wp) :: rest

    scene = one_sided_oscillator(stiff**2 - 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp)
    call run_from(scene, marching(scene, 0.1_wp, 0.0_wp, 20), at_rest, [-1.0_wp], no_slider, system, orbit, error)
    if (allocated(error)) return
    rest = modulo(20*10.0_wp, period)
    call check(error, rest < pi, 'the test means to end in the open half')
    call check_close(error, displacement_of(system, orbit), [-sin(rest)], 1.0e-12_wp, 'displacement')
    call check_close(error, velocity_of(system, orbit), [-cos(rest)], 1.0e-12_wp, 'velocity')
    ! Forty-two full bounces and a touch: two events each.
    call check(error, orbit%state%events == 2*int(200.0_wp/period) + merge(1, 0, rest > 0.0_wp) - 1, 'number of events')
  end subroutine bouncing

  subroutine grazing(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: gaps(3) = 1.0_wp + [1.0e-9_wp, -1.0e-9_wp, -0.1_wp]
    integer, parameter :: events(3) = [0, 2, 2]
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    integer :: i

    do i = 1, size(gaps)
      scene = one_sided_oscillator(3.0_wp, gaps(i), 0.0_wp, 0.0_wp)
      call run_from(scene, marching(scene, 1.0_wp/two_pi, 0.0_wp, 2), at_rest, [1.0_wp], no_slider, system, orbit, error)
      if (allocated(error)) return
      call check(error, orbit%state%events == 2*events(i), 'number of events in two periods')
      call check(error, orbit%chatter == 0, 'it chatters')
      if (i < 3) call check_close(error, velocity_of(system, orbit), [1.0_wp], 1.0e-8_wp, 'velocity')
    end do
  end subroutine grazing

  !> The wedge, its contact split into two equal ones: all events come in pairs at one instant.
  subroutine simultaneous(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: one, two
    type(system_type) :: system, twin
    type(orbit_type) :: orbit, split
    type(contact_type) :: half

    one = wedge(45.0_wp)
    two = one
    half = one%contacts%law(1)
    half%tangential_stiffness = 0.5_wp*half%tangential_stiffness
    half%normal_stiffness = 0.5_wp*half%normal_stiffness
    two%contacts = new_contacts([half, half], reshape([one%contacts%directions, one%contacts%directions], [2, 4]))
    call run_from(one, marching(one, 110.0_wp, 30.0_wp, 12), [0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp], no_slider, system, orbit, error)
    if (allocated(error)) return
    call run_from(two, marching(two, 110.0_wp, 30.0_wp, 12), [0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp], reshape([no_slider, no_slider], &
                                                                                                  [2, 2]), twin, split, error)
    if (allocated(error)) return
    call check(error, any(orbit%recorded%time_in(2, :) > 0.0_wp) .and. orbit%state%events > 20, 'it means to slip and open')
    call check(error, split%state%events == 2*orbit%state%events, 'events do not come in pairs')
    call check(error, split%chatter == 0, 'it chatters')
    call check_close(error, displacement_of(twin, split)/maxval(abs(displacement_of(system, orbit))), &
                     displacement_of(system, orbit)/maxval(abs(displacement_of(system, orbit))), 1.0e-11_wp, 'displacement')
  end subroutine simultaneous

  !> The frame with one tangent a contact, pressed lightly.
  subroutine brute_force(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, frame
    type(system_type) :: system
    type(orbit_type) :: orbit
    real(wp) :: q(8), v(8), w(4), slider(2, 4)
    integer, parameter :: kept(8) = [1, 3, 4, 6, 6, 7, 8, 10]

    scene = rubbing_frame()
    frame = scene
    scene%contacts%law%tangents = 1
    scene%contacts%law%preload = [1.5_wp, 0.4_wp, 0.3_wp, 0.2_wp]
    scene%contacts = new_contacts(scene%contacts%law, frame%contacts%directions(:, kept))
    call damp(scene, damping_viscous, 0.02_wp)
    q = 0.0_wp
    v = 0.0_wp
    w = 0.0_wp
    slider = 0.0_wp
    call run_from(scene, marching(scene, 0.15_wp, 1.0_wp, 3), q, v, slider, system, orbit, error)
    if (allocated(error)) return
    call check(error, orbit%events > 8 .and. all(sum(orbit%recorded%time_in, 2) > 0.0_wp), 'it means to stick, slip and open')
    call tiny_steps(scene, two_pi*0.15_wp, 1.0_wp, 40000, 3, q, v, w)
    ! The clamp misses instants of lift-off by up to a step: first order there.
    call check_close(error, displacement_of(system, orbit), q, 1.0e-4_wp*maxval(abs(q)), 'displacement')
    call check_close(error, velocity_of(system, orbit), v, 1.0e-4_wp*maxval(abs(v)), 'velocity')
    call check_close(error, orbit%state%slider(1, :), w, 1.0e-4_wp*maxval(abs(w)), 'sliders')
  end subroutine brute_force

  subroutine frictionless(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    real(wp) :: q(2), v(2), w(1)

    scene = wedge(45.0_wp)
    scene%contacts%law%friction_coefficient = 0.0_wp
    q = 0.0_wp
    v = 0.0_wp
    w = 0.0_wp
    call run_from(scene, marching(scene, 110.0_wp, 30.0_wp, 4), q, v, no_slider, system, orbit, error)
    if (allocated(error)) return
    call tiny_steps(scene, two_pi*110.0_wp, 30.0_wp, 40000, 4, q, v, w)
    call check_close(error, displacement_of(system, orbit), q, 1.0e-6_wp*maxval(abs(q)), 'displacement')
    call check_close(error, orbit%recorded%force_integral(1), 0.0_wp, 0.0_wp, 'tangential force')
  end subroutine frictionless

  !> No load varies: nothing may move, whatever rounding makes of the edge between stick and slip.
  subroutine rest_at_the_limit(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(run_options_type) :: options
    real(wp) :: q(2)

    scene = wedge(45.0_wp)
    options = marching(scene, 132.0_wp, 0.0_wp, 50)
    q = limit_of_friction()
    call run_from(scene, options, q, 0.0_wp*q, reshape([(q(2) - q(1) - 0.5_wp*(q(1) + q(2)))*sqrt(0.5_wp), 0.0_wp], [2, 1]), system, &
                  orbit, error)
    if (allocated(error)) return
    call check_close(error, displacement_of(system, orbit), q, 1.0e-15_wp, 'displacement')
  end subroutine rest_at_the_limit

  !> Equilibrium of the wedge under its preload with T = mu N.
  pure function limit_of_friction() result(q)
    real(wp) :: q(2), a(2, 2)
    real(wp), parameter :: spring = 3.0e5_wp

    ! Forces of N = spring v and T = v spring / 2 with v = (x + y) / sqrt 2, along (1, 1) and (-1, 1) over sqrt 2.
    a = reshape([(two_pi*100)**2, 0.0_wp, 0.0_wp, (two_pi*250)**2], [2, 2])
    a(1, :) = a(1, :) + 0.25_wp*spring
    a(2, :) = a(2, :) + 0.75_wp*spring
    q = 420.0_wp*[-a(1, 2), a(1, 1)]/(a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1))
  end function limit_of_friction

  subroutine loss_factor(error)
    type(error_type), allocatable, intent(out) :: error
    type(error_type), allocatable :: refusal
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit

    scene = wedge(45.0_wp)
    call damp(scene, damping_loss_factor, 0.01_wp)
    call run_from(scene, marching(scene, 132.0_wp, 1.0_wp, 2), [0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp], no_slider, system, orbit, refusal)
    call check(error, allocated(refusal), 'it is accepted')
    if (allocated(refusal)) call check(error, refusal%status == 2 .and. index(refusal%message, 'loss_factor') > 0, 'message')
  end subroutine loss_factor
end program test_integrate_events
