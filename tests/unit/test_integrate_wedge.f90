!> The paper's wedge, integrated event by event: its steady states, histories and balances.
program test_integrate_wedge
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_integrate_loading, only: new_profile
  use attrito_integrate_run, only: run_options_type, orbit_type
  use attrito_solve_outcomes, only: outcome_converged, outcome_not_converged
  use attrito_integrate_system, only: system_type
  use integrations, only: choices, run_from, run_from_path
  use scenes, only: scene_type, wedge, wedge_preload
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  real(wp), parameter :: no_slider(2, 1) = 0.0_wp

  call run_in_session('integrate_wedge', [ &
                test('at 132 Hz and 5 N the steady state is that of the paper', steady_state), &
                test('its period defect falls below 1e-12 of the amplitude', defect), &
                test('over a period the loads do the work that friction and damping take', energy_balance), &
                test('both histories of the preload (Fig. 13) end in one steady state', histories), &
                test('loads that are ramped (Fig. 9) end there too', ramps), &
                test('at 1 N it sticks and remembers its history', history_kept), &
                test('with lift-off it is steady, and work still balances', lift_off), &
                test('on a level wall it is locked below the closed form''s force and slips above', lock_up), &
                test('it works from event to event: four changes of the contact in a steady period', few_events), &
                test('too few cycles are told', too_few)])

contains

  !> The steady state at 132 Hz after a path of the preload.
  subroutine shake(force, path, orbit, error, tolerance)
    real(wp), intent(in) :: force, path(:)
    type(orbit_type), intent(out) :: orbit
    type(error_type), allocatable, intent(out) :: error
    real(wp), intent(in), optional :: tolerance
    type(scene_type) :: scene
    type(system_type) :: system
    type(run_options_type) :: options

    scene = wedge(45.0_wp)
    options = choices(scene, 132.0_wp, force)
    if (present(tolerance)) options%tolerance = tolerance
    call run_from_path(scene, options, path, no_slider, system, orbit, error)
    call check(error, orbit%outcome == outcome_converged, 'it does not become steady')
  end subroutine shake

  pure function mean_force(orbit) result(force)
    type(orbit_type), intent(in) :: orbit
    real(wp) :: force(2)

    force = orbit%recorded%force_integral/orbit%recorded%time
  end function mean_force

  subroutine steady_state(error)
    type(error_type), allocatable, intent(out) :: error
    type(orbit_type) :: orbit

    call shake(5.0_wp, [1.0_wp], orbit, error)
    if (allocated(error)) return
    ! DESIGN's numbers, to their digits.
    call check_close(error, mean_force(orbit), [-6.045_wp, 23.724_wp], 5.0e-4_wp, 'mean T and N')
    call check_close(error, orbit%recorded%integral/orbit%recorded%time, [-5.332e-5_wp, 1.6515e-4_wp], 5.0e-9_wp, 'mean x and y')
    call check(error, orbit%events == 4, 'not four events a period')
  end subroutine steady_state

  subroutine defect(error)
    type(error_type), allocatable, intent(out) :: error
    type(orbit_type) :: orbit

    call shake(5.0_wp, [1.0_wp], orbit, error, tolerance=1.0e-12_wp)
    if (allocated(error)) return
    call check(error, orbit%defect <= 1.0e-12_wp, 'the defect')
  end subroutine defect

  subroutine energy_balance(error)
    type(error_type), allocatable, intent(out) :: error
    type(orbit_type) :: orbit

    call shake(5.0_wp, [1.0_wp], orbit, error, tolerance=1.0e-13_wp)
    if (allocated(error)) return
    associate (recorded => orbit%recorded)
      call check_close(error, (recorded%damping + sum(recorded%friction))/recorded%work, 1.0_wp, 1.0e-11_wp, 'energy over work')
      call check(error, recorded%friction(1) > 0.1_wp*recorded%work, 'friction takes its share')
    end associate
  end subroutine energy_balance

  subroutine histories(error)
    type(error_type), allocatable, intent(out) :: error
    type(orbit_type) :: first, second

    call shake(5.0_wp, [1.0_wp], first, error, tolerance=1.0e-12_wp)
    if (.not. allocated(error)) call shake(5.0_wp, [0.0_wp, 2.5_wp, 1.0_wp], second, error, tolerance=1.0e-12_wp)
    if (allocated(error)) return
    ! A change of 1e-12 a period, falling by a fifth each, leaves some 1e-11.
    call check_close(error, mean_force(first), mean_force(second), 1.0e-9_wp, 'mean T and N')
    call check_close(error, first%recorded%high - first%recorded%low, second%recorded%high - second%recorded%low, &
                     1.0e-10_wp*maxval(first%recorded%high - first%recorded%low), 'ranges')
  end subroutine histories

  subroutine ramps(error)
    type(error_type), allocatable, intent(out) :: error
    type(orbit_type) :: reference, orbit
    type(scene_type) :: scene
    type(system_type) :: system
    type(run_options_type) :: options

    call shake(5.0_wp, [1.0_wp], reference, error)
    if (allocated(error)) return
    scene = wedge(45.0_wp)
    options = choices(scene, 132.0_wp, 5.0_wp)
    options%static_profile = new_profile(reshape([0.0_wp, 0.0_wp, 0.1_wp, 2.5_wp, 0.2_wp, 1.0_wp], [2, 3]))
    options%harmonic_profile = new_profile(reshape([0.3_wp, 0.0_wp, 0.4_wp, 1.0_wp], [2, 2]))
    call run_from(scene, options, [0.0_wp, 0.0_wp], [0.0_wp, 0.0_wp], no_slider, system, orbit, error)
    if (allocated(error)) return
    call check(error, orbit%outcome == outcome_converged .and. orbit%cycles > 53, 'it does not wait for the loads')
    call check_close(error, mean_force(orbit), mean_force(reference), 1.0e-7_wp, 'mean T and N')
  end subroutine ramps

  subroutine history_kept(error)
    type(error_type), allocatable, intent(out) :: error
    type(orbit_type) :: first, second

    call shake(1.0_wp, [1.0_wp], first, error)
    if (.not. allocated(error)) call shake(1.0_wp, [0.0_wp, 2.5_wp, 1.0_wp], second, error)
    if (allocated(error)) return
    ! It is shaken down to the edge of slip, and still touches it within the tolerance of the steady state.
    call check(error, first%recorded%friction(1) < 1.0e-8_wp*first%recorded%work, 'it slips')
    associate (one => mean_force(first), two => mean_force(second))
      ! DESIGN: T between -9.98 and 9.27 with N between 22.85 and 27.12.
      call check_close(error, [one(1), two(1)], [9.27_wp, -9.98_wp], 0.005_wp, 'mean T')
      call check_close(error, [one(2), two(2)], [27.12_wp, 22.85_wp], 0.005_wp, 'mean N')
    end associate
  end subroutine history_kept

  subroutine lift_off(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(run_options_type) :: options

    scene = wedge(45.0_wp)
    options = choices(scene, 110.0_wp, 30.0_wp)
    options%tolerance = 1.0e-13_wp
    call run_from_path(scene, options, [1.0_wp], no_slider, system, orbit, error)
    if (allocated(error)) return
    call check(error, orbit%outcome == outcome_converged .and. orbit%recorded%time_in(2, 1) > 0.0_wp, 'it means to lift off')
    call check_close(error, (orbit%recorded%damping + sum(orbit%recorded%friction))/orbit%recorded%work, 1.0_wp, 1.0e-11_wp, &
                     'energy over work')
  end subroutine lift_off

  !> Fpl / F = 105.76: at the peak of the stuck response kt u reaches mu N.
  subroutine lock_up(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: c = 20.0_wp*pi, kt = 3.0e5_wp, k = (two_pi*100.0_wp)**2 + kt, share(2) = 1.0_wp + [-1.0e-6_wp, 1.0e-6_wp]
    real(wp), parameter :: normal = wedge_preload*kt/((two_pi*250.0_wp)**2 + kt), force = 0.5_wp*normal*c*sqrt(k - 0.25_wp*c**2)/kt
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(run_options_type) :: options
    integer :: i

    call check_close(error, wedge_preload/force, 105.76_wp, 0.005_wp, 'Fpl / F of DESIGN')
    scene = wedge(0.0_wp)
    do i = 1, 2
      options = choices(scene, sqrt(k - 0.5_wp*c**2)/two_pi, share(i)*force)
      ! The load comes on slowly, or it overshoots.
      options%harmonic_profile = new_profile(reshape([0.0_wp, 0.0_wp, 2.0_wp, 1.0_wp], [2, 2]))
      options%cycles = 600
      call run_from_path(scene, options, [1.0_wp], no_slider, system, orbit, error)
      if (allocated(error)) return
      call check(error, (orbit%events > 0) .eqv. i == 2, merge('slips below ', 'sticks above', i == 1))
    end do
  end subroutine lock_up

  subroutine few_events(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(run_options_type) :: options

    scene = wedge(45.0_wp)
    options = choices(scene, 132.0_wp, 5.0_wp)
    call run_from_path(scene, options, [1.0_wp], no_slider, system, orbit, error)
    ! It sticks and slips once each way.
    call check(error, orbit%events == 4 .and. orbit%chatter == 0, 'more or fewer events in a period')
  end subroutine few_events

  subroutine too_few(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(run_options_type) :: options

    scene = wedge(45.0_wp)
    options = choices(scene, 132.0_wp, 5.0_wp)
    options%cycles = 30
    call run_from_path(scene, options, [1.0_wp], no_slider, system, orbit, error)
    call check(error, orbit%outcome == outcome_not_converged .and. orbit%period == 0, 'it counts as steady')
  end subroutine too_few
end program test_integrate_wedge
