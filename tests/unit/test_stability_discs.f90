!> Stability of orbits whose contacts slip along two tangents.
program test_stability_discs
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: regime_slip
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_loading, only: loading_type, new_loading, new_profile
  use attrito_integrate_schemes, only: scheme_type, new_scheme, start_scheme, step_scheme, scheme_exponential
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type, new_system
  use attrito_model_contacts, only: contact_type
  use attrito_stability_assess, only: assess
  use attrito_stability_balance_motion, only: balance_motion_type, balance_motion_of
  use attrito_stability_examination, only: examination_type, examine_options_type, by_monodromy
  use attrito_stability_graze, only: perturbed_law, grazing_contact
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of, in_modes, largest_change, kind_floquet, kind_slip
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_orbit_search, only: orbit_search_type, new_search, find_orbit
  use attrito_stability_reduced, only: reduce_to
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
                      test('a motion in a plane has the multipliers of its plane beside those across it', plane), &
                      test('motion in time is that of ever finer exponential steps', flow), &
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
    type(orbit_type) :: orbit
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: motion(3, 3), expected
    integer :: info, i

    scene = rotating_scene(ratio)
    call new_system(scene%structure, scene%contacts, system, error)
    if (allocated(error)) return
    ! u = (cos, sin) theta
    motion = reshape([0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [3, 3])
    expected = exp(-two_pi*sqrt(ratio**2 - 1.0_wp))
    orbit = orbit_along(system, two_pi/0.5_wp*system%clock, motion, reshape([0.0_wp, 0.0_wp], [2, 1]))
    associate (segments => orbit%segments%segment)
      call check(error, orbit%periodic .and. all([(segments(i)%regime(1) == regime_slip, i=1, size(segments))]), &
                 'it does not slip throughout')
    end associate
    call in_modes(system, 2, orbit, multipliers, info)
    call check(error, info == 0, 'no eigenvalues')
    if (allocated(error)) return
    call check(error, count(multipliers%kind == kind_floquet) == 5 .and. count(multipliers%kind == kind_slip) == 1, 'kinds')
    ! Its springs are 1e-9 of the oscillators'.
    call check_close(error, minval(abs(multipliers%value - expected)), 0.0_wp, 1.0e-9_wp, 'multiplier')
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
    ! The radius is twice the coefficient, and it slips if the run is longer than the disc is wide.
    call check_close(error, friction(1), 0.25_wp*run_back(), 1.0e-9_wp, 'friction at the graze')
    call check(error, all([grazes(system, friction(1)), grazes(system, friction(2))] == 1), 'it does not graze')
  end subroutine graze

  !> How often the contact begins to slip in a period of that motion.
  integer function slips(system, coefficient)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: coefficient
    type(orbit_type) :: orbit
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
    type(orbit_type) :: orbit
    type(system_type) :: changed
    real(wp) :: motion(7, 3)

    changed = system
    changed%law%friction_coefficient = coefficient
    motion = 0.0_wp
    motion([2, 6], 1) = [1.0_wp, 0.6_wp]
    orbit = orbit_along(changed, two_pi, motion, reshape([0.0_wp, 0.0_wp], [2, 1]))
  end function rubbing_orbit

  !> What u goes back by between two extrema, where u' = -sin (1 + 1.8 (3 - 4 sin^2)) = 0.
  real(wp) function run_back()
    real(wp) :: theta

    theta = asin(sqrt((1.0_wp + 1.8_wp*3.0_wp)/(1.8_wp*4.0_wp)))
    run_back = abs(2.0_wp*(cos(theta) + 0.6_wp*cos(3.0_wp*theta)))
  end function run_back

  !> The orbit of a motion of harmonics.
  function orbit_along(system, period, motion, slider) result(orbit)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: period, motion(:, :), slider(:, :)
    type(orbit_type) :: orbit
    type(loading_type) :: loading
    type(balance_motion_type) :: balance

    loading%period = period
    balance%motion = motion
    balance%slider = slider
    balance%holds = spread(.false., 1, size(system%law))
    call orbit%take_balance(system, loading, balance)
  end function orbit_along

  !> The wedge, with soft and with stiff contacts, which slip, open and land, and the same in space with a spring across its plane.
  subroutine plane(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system, flat
    type(solver_type) :: solver
    type(balance_motion_type) :: balance
    type(orbit_type) :: orbit, in_space
    type(multiplier_type), allocatable :: known(:), multipliers(:)
    real(wp), allocatable :: motion(:, :)
    real(wp) :: change, slider(2, 1)
    integer :: j, info, modes, number

    do number = 1, 2
      scene = wedge(45.0_wp)
      if (number == 2) call stiffen(scene)
      call balance_scene(scene, merge(132.0_wp, 110.0_wp, number == 1), merge(5.0_wp, 1.0_wp, number == 1), 20, solver, error)
      if (allocated(error)) return
      call new_system(solver%structure, solver%contacts, flat, error)
      balance = balance_motion_of(solver)
      slider(:, 1) = [balance%slider(1, 1), 0.0_wp]
      call orbit%take_balance(flat, loading_of(solver, flat), balance)
      call multipliers_of(flat, orbit, known, modes, change, info)
      call spread_out(scene)
      call new_system(scene%structure, scene%contacts, system, error)
      motion = reshape([balance%motion(:, 1), 0.0_wp*balance%motion(:, 1), balance%motion(:, 2)], [size(balance%motion, 1), 3])
      in_space = orbit_along(system, two_pi/solver%omega*system%clock, motion, slider)
      call check(error, in_space%periodic, 'the slider does not come back')
      call in_modes(system, size(system%eigenvalues), in_space, multipliers, info)
      call check(error, info == 0, 'no eigenvalues')
      if (allocated(error)) return
      call check_close(error, maxval([(minval(abs(multipliers%value - known(j)%value)), j=1, size(known))]), 0.0_wp, 1.0e-9_wp, &
                       'multipliers')
      call solver%destroy()
    end do
  end subroutine plane

  !> The stiff wedge in space, also shaken across its plane: what the orbits of its balance's point are found by.
  subroutine balance_in_space(frequency_hz, search, error)
    real(wp), intent(in) :: frequency_hz
    type(orbit_search_type), intent(out) :: search
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    type(system_type) :: system

    scene = spatial_wedge(20.0_wp)
    call balance_scene(scene, frequency_hz, 1.0_wp, 20, solver, error)
    if (allocated(error)) return
    call new_system(solver%structure, solver%contacts, system, error)
    if (allocated(error)) return
    search = new_search(solver, system, balance_motion_of(solver), 0.1_wp)
    search%in_time = .true.
    call solver%destroy()
  end subroutine balance_in_space

  !> A period of the wedge in space, shaken across its plane, too: the contact sticks, slips, opens and lands. Steps of second order
  !> have errors of h^2, which extrapolation takes out but for what switches between them leave, h^3 and more.
  subroutine flow(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps(2) = [16384, 32768]
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start, exact, stepped(size(steps))
    real(wp) :: range, apart(size(steps))
    integer :: i

    call settled_wedge(system, loading, start, error)
    if (allocated(error)) return
    exact = start
    call march(system, loading, exact, range)
    do i = 1, size(steps)
      stepped(i) = start
      call step_through(system, loading, steps(i), stepped(i))
      apart(i) = hypot(norm2(stepped(i)%motion - exact%motion), norm2(stepped(i)%rate - exact%rate))/range
    end do
    call check_close(error, log(apart(1)/apart(2))/log(2.0_wp), 2.0_wp, 0.1_wp, 'order')
    call check_close(error, [4.0_wp*stepped(2)%motion - stepped(1)%motion, 4.0_wp*stepped(2)%rate - stepped(1)%rate]/(3.0_wp*range), &
                     [exact%motion, exact%rate]/range, 1.0e-8_wp, 'motion')
  end subroutine flow

  !> All columns against central differences of the flow; the contact slips where the period begins, and sticks and opens in it.
  subroutine derivative(error)
    type(error_type), allocatable, intent(out) :: error
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start, state
    type(orbit_type) :: orbit
    real(wp), allocatable :: matrix(:, :), differences(:, :, :)
    real(wp) :: h, range
    integer :: regime, i, j, k, n
    logical :: converged

    call settled_wedge(system, loading, start, error)
    if (allocated(error)) return
    n = 2*size(system%eigenvalues) + 1
    allocate (differences(n, n, 2))
    do k = 1, 2
      h = 1.0e-4_wp*k*norm2(start%motion)
      do i = 1, n
        differences(:, i, k) = (moved(system, loading, start, i, h) - moved(system, loading, start, i, -h))/(2.0_wp*h)
      end do
    end do
    state = start
    call orbit%march(system, loading, state, range, converged)
    associate (segments => orbit%segments%segment)
      call check(error, all([(any([(segments(j)%regime(1) == regime, j=1, size(segments))]), regime=0, 2)]) .and. &
                 orbit%regime(1) == regime_slip, 'it does not stick, slip and open: the test is void')
    end associate
    if (allocated(error)) return
    matrix = orbit%monodromy(reduce_to(system, size(system%eigenvalues)))
    ! The flow is smooth but for events, whose second derivatives jump: h of the curvature is left where one falls into the step.
    differences(:, :, 1) = (4.0_wp*differences(:, :, 1) - differences(:, :, 2))/3.0_wp
    call check_close(error, matrix/maxval(abs(matrix)), differences(:, :, 1)/maxval(abs(matrix)), 1.0e-6_wp, 'monodromy')
  end subroutine derivative

  !> With 29 modes far above that the contact moves, some ten times stiffer than it together: in 8, 16 and all 32 modes.
  subroutine projected(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: modes(3) = [8, 16, 32]
    type(scene_type) :: scene
    type(solver_type) :: solver
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(multiplier_type), allocatable :: few(:), more(:), every(:)
    integer :: info(3), i

    scene = spatial_wedge(20.0_wp)
    call add_high_modes(scene, modes(3) - 3)
    call balance_scene(scene, 110.0_wp, 1.0_wp, 20, solver, error)
    if (allocated(error)) return
    call new_system(solver%structure, solver%contacts, system, error)
    if (allocated(error)) return
    call orbit%take_balance(system, loading_of(solver, system), balance_motion_of(solver))
    associate (segments => orbit%segments%segment)
      call check(error, any([(segments(i)%regime(1) == regime_slip, i=1, size(segments))]) .and. .not. orbit%closed(1), &
                 'it does not slip and open')
    end associate
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
  function moved(system, loading, start, which, h) result(end)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    type(state_type), intent(in) :: start
    integer, intent(in) :: which
    real(wp), intent(in) :: h
    real(wp) :: end(2*size(start%motion) + 1), e(2), d(3), range, slider(2, 1)
    type(state_type) :: state
    integer :: m

    m = size(start%motion)
    state = start
    if (which <= m) state%motion(which) = state%motion(which) + h
    if (which > m .and. which <= 2*m) state%rate(which - m) = state%rate(which - m) + h
    associate (law => system%law(1), z => matmul(start%motion, system%rows(:, :2)) - start%slider(:, 1))
      e = z/norm2(z)
      d = matmul(state%motion - start%motion, system%rows)
      slider(:, 1) = start%slider(:, 1) + d(:2) - law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness*d(3)*e
      if (which > 2*m) slider(:, 1) = slider(:, 1) - h*[-e(2), e(1)]
      ! A little beyond the rim: the law puts it back and knows that it slips.
      slider(:, 1) = slider(:, 1) - 1.0e-10_wp*z
    end associate
    state = new_state(system, state%motion, state%rate, slider)
    call march(system, loading, state, range)
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

  !> The same in its steady motion.
  subroutine settled_wedge(system, loading, start, error)
    type(system_type), intent(out) :: system
    type(loading_type), intent(out) :: loading
    type(state_type), intent(out) :: start
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: range
    integer :: cycle, n

    call pressed_wedge(system, loading, error)
    if (allocated(error)) return
    n = size(system%eigenvalues)
    start = new_state(system, spread(0.0_wp, 1, n), spread(0.0_wp, 1, n), reshape([0.0_wp, 0.0_wp], [2, 1]))
    do cycle = 1, 40
      call march(system, loading, start, range)
    end do
  end subroutine settled_wedge

  !> March a period.
  subroutine march(system, loading, state, range)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    type(state_type), intent(inout) :: state
    real(wp), intent(out) :: range
    type(orbit_type) :: orbit
    logical :: converged

    call orbit%march(system, loading, state, range, converged)
  end subroutine march

  !> A period of exponential steps.
  subroutine step_through(system, loading, steps, state)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    integer, intent(in) :: steps
    type(state_type), intent(inout) :: state
    type(scheme_type) :: scheme
    integer :: step
    logical :: converged

    call new_scheme(system, scheme_exponential, steps, loading%period, -1.0_wp, scheme)
    call start_scheme(scheme, system, loading, state)
    do step = 1, steps
      call step_scheme(scheme, system, loading, state, step/steps, modulo(step, steps)*scheme%h, converged)
    end do
  end subroutine step_through

  !> The orbit of motion in time, perturbed and marched, is left or come back to at the rate of its largest multiplier.
  subroutine verdicts(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: at(3) = [105.0_wp, 110.0_wp, 115.0_wp]
    type(orbit_search_type) :: search
    type(orbit_type) :: orbit, other
    type(state_type) :: start, state
    type(examination_type) :: examination
    real(wp) :: range, largest, second, rate, distance(0:60)
    integer :: i, cycle, ends(2)
    logical :: found

    do i = 1, size(at)
      call balance_in_space(at(i), search, error)
      if (allocated(error)) return
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
      call check(error, found, 'no orbit is found')
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
