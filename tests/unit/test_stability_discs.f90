!> Stability of orbits whose contacts slip along two tangents, by the flow of a sampled orbit.
program test_stability_discs
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: regime_slip, regime_open
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_loading, only: loading_type, new_loading, new_profile
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type, new_system
  use attrito_model_contacts, only: contact_type
  use attrito_stability_assess, only: assess
  use attrito_stability_balance_motion, only: balance_motion_type, balance_motion_of
  use attrito_stability_event_orbit, only: event_orbit_type
  use attrito_stability_examination, only: examination_type, examine_options_type, by_monodromy
  use attrito_stability_graze, only: perturbed_law, grazing_contact
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of, in_modes, largest_change, kind_floquet, kind_slip
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_orbit_search, only: orbit_search_type, new_search, new_orbit, find_orbit
  use attrito_stability_reduced, only: reduce_to
  use attrito_stability_sampled_motion, only: motion_of_harmonics
  use attrito_stability_sampled_orbit, only: sampled_orbit_type
  use attrito_stability_shooting, only: shoot
  use attrito_stability_start, only: loading_of
  use attrito_stability_verdict, only: largest_multiplier, stable, unstable
  use disc_scenes, only: rotating_scene, spatial_wedge, stiffen, spread_out, add_high_modes
  use scenes, only: scene_type, wedge
  use session, only: run_in_session
  use testing, only: test, check, check_close
  use wedge_orbits, only: balance_scene
  implicit none

  call run_in_session('stability_discs', [ &
                      test('a contact that slips round a circle forgets its direction at the known rate', circle), &
                      test('a contact that only just slips once more in a period grazes', graze), &
                      test('contacts of one tangent have the multipliers of the event-exact flow, to second order', lines), &
                      test('a motion in a plane has the multipliers of its plane beside those across it', plane), &
                      test('the monodromy is the derivative of the flow', derivative), &
                      test('doubling the modes changes multipliers by more than is left out then', projected), &
                      test('an orbit of motion in time is left or come back to as its multipliers say', verdicts)])

contains

  !> Two equal oscillators under a rotating load, and a contact too soft to move them: u runs round a circle of radius R, the slider
  !> follows on one of radius sqrt(R^2 - r^2), across its direction, which forgets by exp(-2 pi sqrt(R^2 - r^2)/r) a period.
  subroutine circle(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: ratio = 1.2_wp
    type(scene_type) :: scene
    type(system_type) :: system
    type(sampled_orbit_type) :: orbit
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: motion(3, 3), apart(2), expected
    integer :: i, info

    scene = rotating_scene(ratio)
    call new_system(scene%structure, scene%contacts, system, error)
    if (allocated(error)) return
    ! u = (cos, sin) theta
    motion = reshape([0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [3, 3])
    expected = exp(-two_pi*sqrt(ratio**2 - 1.0_wp))
    do i = 1, 2
      orbit = orbit_along(system, two_pi/0.5_wp*system%clock, motion, reshape([0.0_wp, 0.0_wp], [2, 1]), 64*i)
      call check(error, orbit%periodic .and. all(orbit%steps%regime == regime_slip), 'it does not slip throughout')
      call in_modes(system, 2, orbit, multipliers, info)
      call check(error, info == 0, 'no eigenvalues')
      if (allocated(error)) return
      call check(error, count(multipliers%kind == kind_floquet) == 5 .and. count(multipliers%kind == kind_slip) == 1, 'kinds')
      apart(i) = minval(abs(multipliers%value - expected))
    end do
    ! Chords of angle a lie on R^2 (1 - a^2/6) in the mean, which the exponent follows; the next order is a^2 of it, some 1e-2.
    call check_close(error, apart(1)/expected, (two_pi/64)**2/12*ratio**2/(ratio**2 - 1.0_wp)*abs(log(expected)), 1.0e-3_wp, &
                     'multiplier')
    call check_close(error, log(apart(1)/apart(2))/log(2.0_wp), 2.0_wp, 0.2_wp, 'order')
  end subroutine circle

  !> u = cos + 0.6 cos 3 theta runs to and fro in two runs of 1.78 each, and back by 0.356 between them, where it slips only if the
  !> disc's radius is less than half of that.
  subroutine graze(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    real(wp) :: friction(2), middle
    integer :: i

    scene = rotating_scene(1.0_wp)
    call new_system(scene%structure, scene%contacts, system, error)
    if (allocated(error)) return
    ! The radius is twice the friction coefficient here.
    friction = [0.08_wp, 0.10_wp]
    call check(error, all([slips(system, friction(1)), slips(system, friction(2))] == [6, 4]), 'it does not slip so often')
    call check(error, all([grazes(system, friction(1)), grazes(system, friction(2))] == 0), 'it grazes where it does not')
    do i = 1, 40
      middle = 0.5_wp*sum(friction)
      friction(merge(1, 2, slips(system, middle) == 6)) = middle
    end do
    ! It is not seen to leave the disc between two of 64 samples, by h^2/8 of u'', 4.3, of what is four times the coefficient.
    call check_close(error, friction(1), 0.25_wp*0.3555555555555556_wp, 1.3e-3_wp, 'friction at the graze')
    call check(error, all([grazes(system, friction(1)), grazes(system, friction(2))] == 1), 'it does not graze')
  end subroutine graze

  !> How often the contact begins to slip in a period of that motion.
  integer function slips(system, coefficient)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: coefficient
    type(sampled_orbit_type) :: orbit
    integer, allocatable :: regimes(:)

    orbit = rubbing_orbit(system, coefficient)
    regimes = orbit%regimes(1)
    slips = count(regimes == 1 .and. cshift(regimes, -1) /= 1)
  end function slips

  !> The contact that grazes there, 0: none.
  integer function grazes(system, coefficient)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: coefficient
    type(contact_type) :: law(1)
    integer :: direction

    grazes = 0
    law = system%law
    law%friction_coefficient = coefficient
    do direction = -1, 1, 2
      law = perturbed_law(law, [0.0_wp], direction)
      grazes = max(grazes, grazing_contact(rubbing_orbit(system, coefficient), rubbing_orbit(system, law(1)%friction_coefficient)))
      law%friction_coefficient = coefficient
    end do
  end function grazes

  function rubbing_orbit(system, coefficient) result(orbit)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: coefficient
    type(sampled_orbit_type) :: orbit
    type(system_type) :: changed
    real(wp) :: motion(7, 3)

    changed = system
    changed%law%friction_coefficient = coefficient
    motion = 0.0_wp
    motion([2, 6], 1) = [1.0_wp, 0.6_wp]
    orbit = orbit_along(changed, two_pi, motion, reshape([0.0_wp, 0.0_wp], [2, 1]), 64)
  end function rubbing_orbit

  !> The orbit of a motion of harmonics, by samples.
  function orbit_along(system, period, motion, slider, samples) result(orbit)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: period, motion(:, :), slider(:, :)
    integer, intent(in) :: samples
    type(sampled_orbit_type) :: orbit
    type(loading_type) :: no_loads

    orbit%samples = samples
    orbit%period = period
    orbit%motion = motion_of_harmonics(motion, samples)
    orbit%slider = slider
    call orbit%apply_law(system, no_loads)
  end function orbit_along

  !> The wedge with stiff contacts, which slip, open and land: multipliers of the balance's orbit by both flows.
  subroutine lines(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_tangents(1, error)
  end subroutine lines

  !> The same in space, with a spring across the plane.
  subroutine plane(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_tangents(2, error)
  end subroutine plane

  subroutine compare_tangents(tangents, error)
    integer, intent(in) :: tangents
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system, flat
    type(solver_type) :: solver
    type(balance_motion_type) :: balance_motion
    type(event_orbit_type) :: events
    type(sampled_orbit_type) :: orbit
    type(multiplier_type), allocatable :: known(:), multipliers(:)
    real(wp), allocatable :: motion(:, :)
    real(wp) :: apart(2), change, slider(2, 1)
    integer :: i, j, info, modes, number

    do number = 1, 2
      scene = wedge(45.0_wp)
      if (number == 2) call stiffen(scene)
      call balance_scene(scene, merge(132.0_wp, 110.0_wp, number == 1), merge(5.0_wp, 1.0_wp, number == 1), 20, solver, error, &
                         samples=512)
      if (allocated(error)) return
      call new_system(solver%structure, solver%contacts, flat, error)
      balance_motion = balance_motion_of(solver)
      slider(:, 1) = [balance_motion%slider(1, 1), 0.0_wp]
      call events%take_balance(flat, loading_of(solver, flat), balance_motion)
      call multipliers_of(flat, events, known, modes, change, info)
      motion = solver%motion
      system = flat
      if (tangents == 2) then
        call spread_out(scene)
        call new_system(scene%structure, scene%contacts, system, error)
        motion = reshape([motion(:, 1), 0.0_wp*motion(:, 1), motion(:, 2)], [size(motion, 1), 3])
      end if
      do i = 1, 2
        orbit = orbit_along(system, two_pi/solver%omega*system%clock, motion, slider, 512*i)
        call check(error, orbit%periodic, 'the slider does not come back')
        call in_modes(system, size(system%eigenvalues), orbit, multipliers, info)
        call check(error, info == 0, 'no eigenvalues')
        if (allocated(error)) return
        apart(i) = maxval([(minval(abs(multipliers%value - known(j)%value)), j=1, size(known))])
      end do
      ! The step turns by 2 pi/512 in the excitation and by some twenty times that in the fastest mode: (0.25)^2/12 = 5e-3 of what it
      ! adds to a multiplier, which is less than a tenth of it.
      call check_close(error, apart(1), 0.0_wp, 5.0e-4_wp, 'multipliers')
      call check_close(error, log(apart(1)/apart(2))/log(2.0_wp), 2.0_wp, 0.1_wp, 'order')
      call solver%destroy()
    end do
  end subroutine compare_tangents

  !> The stiff wedge in space, also shaken across its plane: what the orbits of its balance's point are found by.
  subroutine balance_in_space(frequency_hz, search, error)
    real(wp), intent(in) :: frequency_hz
    type(orbit_search_type), intent(out) :: search
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    type(system_type) :: system

    scene = spatial_wedge(20.0_wp)
    call balance_scene(scene, frequency_hz, 1.0_wp, 20, solver, error, samples=512)
    if (allocated(error)) return
    call new_system(solver%structure, solver%contacts, system, error)
    if (allocated(error)) return
    search = new_search(solver, system, balance_motion_of(solver), 0.1_wp)
    search%in_time = .true.
    call solver%destroy()
  end subroutine balance_in_space

  !> All columns against central differences of a period of 16384 exponential steps, of the wedge in space, shaken across its plane,
  !> too; the contact slips where the period begins, and sticks and opens in it.
  subroutine derivative(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: fine = 16384, periods = 40
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start, state
    type(sampled_orbit_type) :: every, orbit
    real(wp), allocatable :: matrix(:, :), differences(:, :)
    real(wp) :: h, range, apart(2)
    integer :: cycle, regime, i, n
    logical :: converged

    call pressed_wedge(system, loading, error)
    if (allocated(error)) return
    n = size(system%eigenvalues)
    start = new_state(system, spread(0.0_wp, 1, n), spread(0.0_wp, 1, n), reshape([0.0_wp, 0.0_wp], [2, 1]))
    do cycle = 1, periods
      call march(system, loading, merge(fine, 1024, cycle > periods - 5), start)
    end do
    n = 2*n + 1
    h = 1.0e-3_wp*norm2(start%motion)
    allocate (differences(n, n))
    do i = 1, n
      differences(:, i) = (moved(system, loading, start, i, h, fine) - moved(system, loading, start, i, -h, fine))/(2.0_wp*h)
    end do
    every%samples = fine
    state = start
    call every%march(system, loading, state, range, converged)
    do i = 1, 2
      orbit = every_so_many(every, system, 512*i)
      call check(error, orbit%periodic, 'the slider does not come back')
      call check(error, all([(any(orbit%steps%regime == regime), regime=0, 2)]) .and. orbit%regime(1) == regime_slip, &
                 'it does not stick, slip and open: the test is void')
      if (allocated(error)) return
      matrix = orbit%monodromy(reduce_to(system, size(system%eigenvalues)))
      apart(i) = maxval(abs(matrix - differences))/maxval(abs(differences))
    end do
    ! The change of a thousandth leaves 1e-6 by curvature, and of the scheme's steps one in sixteen that a switch is moved by: 1e-4 of
    ! the whole where there are a dozen switches of random phase.
    call check_close(error, apart(2), 0.0_wp, 1.0e-3_wp, 'monodromy')
    call check_close(error, log(apart(1)/apart(2))/log(2.0_wp), 2.0_wp, 0.3_wp, 'order')
  end subroutine derivative

  !> With 29 modes far above that the contact moves, some ten times stiffer than it together: in 8, 16 and all 32 modes.
  subroutine projected(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: modes(3) = [8, 16, 32]
    type(scene_type) :: scene
    type(solver_type) :: solver
    type(system_type) :: system
    type(sampled_orbit_type) :: orbit
    type(multiplier_type), allocatable :: few(:), more(:), every(:)
    real(wp) :: slider(2, 1)
    integer :: info(3)

    scene = spatial_wedge(20.0_wp)
    call add_high_modes(scene, modes(3) - 3)
    call balance_scene(scene, 110.0_wp, 1.0_wp, 20, solver, error, samples=512)
    if (allocated(error)) return
    call new_system(solver%structure, solver%contacts, system, error)
    if (allocated(error)) return
    slider(:, 1) = solver%context%balance%forces(1)%slider
    orbit = orbit_along(system, two_pi/solver%omega*system%clock, solver%motion, slider, 512)
    call check(error, any(orbit%steps%regime == regime_slip) .and. any(orbit%steps%regime == regime_open), &
               'it does not slip and open')
    call in_modes(system, modes(1), orbit, few, info(1))
    call in_modes(system, modes(2), orbit, more, info(2))
    call in_modes(system, modes(3), orbit, every, info(3))
    call solver%destroy()
    call check(error, all(info == 0), 'no eigenvalues')
    if (allocated(error)) return
    call check(error, largest_change(few, more) > 1.0e-6_wp, 'the modes left out do not matter: the test is void')
    call check(error, largest_change(more, every) < largest_change(few, more), 'more is left out than the doubling changed')
    ! Modes 8 and up are at rest to 110 Hz over 3.5 kHz and more of twice their damping ratio, 0.3, times 2 pi in an exponent, of a
    ! tenth.
    call check(error, largest_change(few, every) < 1.2e-2_wp, 'modes at rest leave out too much')
  end subroutine projected

  !> Motion, rate and angle of slip times radius after a period from a state of which one of these is changed.
  function moved(system, loading, start, which, h, steps) result(end)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    type(state_type), intent(in) :: start
    integer, intent(in) :: which, steps
    real(wp), intent(in) :: h
    real(wp) :: end(2*size(start%motion) + 1), e(2), d(3)
    type(state_type) :: state
    integer :: m

    m = size(start%motion)
    state = start
    if (which <= m) state%motion(which) = state%motion(which) + h
    if (which > m .and. which <= 2*m) state%rate(which - m) = state%rate(which - m) + h
    associate (law => system%law(1), z => matmul(start%motion, system%rows(:, :2)) - start%slider(:, 1))
      e = z/norm2(z)
      d = matmul(state%motion - start%motion, system%rows)
      state%slider(:, 1) = start%slider(:, 1) + d(:2) - law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness*d(3)*e
      if (which > 2*m) state%slider(:, 1) = state%slider(:, 1) - h*[-e(2), e(1)]
    end associate
    call march(system, loading, steps, state)
    end = [state%motion, state%rate, dot_product([-e(2), e(1)], matmul(state%motion, system%rows(:, :2)) - state%slider(:, 1))]
  end function moved

  !> The stiff wedge in space, heavily damped, pressed and shaken so that it sticks, slips along both tangents and opens.
  subroutine pressed_wedge(system, loading, error)
    type(system_type), intent(out) :: system
    type(loading_type), intent(out) :: loading
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp) :: constant(2, 0)

    scene = spatial_wedge(15.0_wp)
    scene%contacts%law%friction_coefficient = 1.0_wp
    scene%structure%static_loads(2, 1) = 100.0_wp
    scene%structure%damping = 5.0_wp*scene%structure%damping
    call new_system(scene%structure, scene%contacts, system, error)
    if (allocated(error)) return
    loading = new_loading(two_pi*110.0_wp, system%clock, system%static_loads(:, 1), system%harmonic_load, new_profile(constant), &
                          new_profile(constant))
  end subroutine pressed_wedge

  !> March a period of exponential steps.
  subroutine march(system, loading, steps, state)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    integer, intent(in) :: steps
    type(state_type), intent(inout) :: state
    type(sampled_orbit_type) :: orbit
    real(wp) :: range
    logical :: converged

    orbit%samples = steps
    call orbit%march(system, loading, state, range, converged)
  end subroutine march

  !> The same motion by some of its samples.
  function every_so_many(orbit, system, samples) result(coarse)
    type(sampled_orbit_type), intent(in) :: orbit
    type(system_type), intent(in) :: system
    integer, intent(in) :: samples
    type(sampled_orbit_type) :: coarse
    type(loading_type) :: no_loads
    integer :: spacing

    spacing = orbit%samples/samples
    coarse%samples = samples
    coarse%period = orbit%period
    coarse%slider = orbit%slider
    allocate (coarse%motion%displacement(0:samples, size(system%springs)), coarse%motion%rate(0:samples, size(system%springs)))
    coarse%motion%displacement(:, :) = orbit%motion%displacement(::spacing, :)
    coarse%motion%rate(:, :) = spacing*orbit%motion%rate(::spacing, :)
    call coarse%apply_law(system, no_loads)
  end function every_so_many

  !> The orbit of motion in time, perturbed and marched, is left or come back to at the rate of its largest multiplier.
  subroutine verdicts(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps = 1024
    real(wp), parameter :: at(3) = [105.0_wp, 110.0_wp, 115.0_wp]
    type(orbit_search_type) :: search
    class(orbit_type), allocatable :: orbit
    type(sampled_orbit_type) :: other
    type(state_type) :: start, state
    type(examination_type) :: examination
    real(wp) :: range, largest, second, rate, distance(0:60)
    integer :: i, cycle, ends(2)
    logical :: found

    other%samples = steps
    do i = 1, size(at)
      call balance_in_space(at(i), search, error)
      if (allocated(error)) return
      call new_orbit(search, orbit)
      call find_orbit(search, orbit, found)
      call check(error, found, 'no orbit next to that of the balance')
      if (allocated(error)) return
      call assess(search, examine_options_type(methods=by_monodromy), search%system, orbit, examination)
      call check(error, len(examination%reason) == 0, 'it is not examined')
      if (allocated(error)) return
      largest = largest_multiplier(examination%monodromy)
      call check(error, examination%verdict == merge(stable, unstable, i == 3), 'the verdict is another')
      start = search%start
      call shoot(search%system, search%loading, start, other, found)
      call check(error, found, 'no orbit in so many steps')
      state = start
      ! Perturbations that move switches by less than a step, 5e-6 of the motion and below, see the map of the scheme, whose slope
      ! goes up and down with where in a step they fall, so that they stay that small for as long as chance has it.
      state%motion = (1.0_wp + merge(1.0e-3_wp, 1.0e-4_wp, i == 3))*state%motion
      distance(0) = norm2(state%motion - start%motion)
      do cycle = 1, 60
        call other%march(search%system, search%loading, state, range, found)
        distance(cycle) = hypot(norm2(state%motion - start%motion), norm2(state%rate - start%rate))
      end do
      if (i == 3) then
        ! What is left after ten periods is of the two largest multipliers, which are near each other; the next is 0.5 of them.
        associate (moduli => abs(examination%monodromy%value))
          second = maxval(moduli, mask=moduli < (1.0_wp - 1.0e-9_wp)*largest)
        end associate
        rate = log(distance(30)/distance(10))/20
        call check(error, rate > log(second) - 0.02_wp .and. rate < log(largest) + 0.02_wp, 'it comes back at another rate')
        call check(error, distance(60) < distance(0), 'it does not come back')
      else
        ! From 5e-4 of the motion to 5e-3, in some eight periods. Of the logarithm steps are worth 0.05 over these, all told, the next
        ! multiplier, a third of the largest, 0.35^5 after the five periods before, and the way to where it ends, at 0.2 of the
        ! motion, 0.1.
        ends = [findloc(distance > 5.0_wp*distance(0), .true.), findloc(distance > 50.0_wp*distance(0), .true.)] - 1
        call check(error, all(ends > 0) .and. distance(60) > 1.0e3_wp*distance(0), 'it does not leave')
        if (allocated(error)) return
        rate = log(distance(ends(2))/distance(ends(1)))/(ends(2) - ends(1))
        call check_close(error, rate, log(largest), 0.02_wp, 'rate')
      end if
    end do
  end subroutine verdicts

end program test_stability_discs
