!> The wedge with stiff contacts, and orbits of wedges near their balance: what suites of stability share.
module wedge_orbits
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_shooting, only: shoot
  use attrito_stability_start, only: loading_of, start_of
  use disc_scenes, only: stiffen
  use scenes, only: scene_type, wedge
  use session, only: only_me
  use testing, only: check
  implicit none
  private
  public :: stiff_wedge, find_orbit, balance_scene

contains

  !> Stiff contacts, 20 N of preload, 60 N along x: the scene of which half the balance's orbits are unstable.
  function stiff_wedge() result(scene)
    type(scene_type) :: scene

    scene = wedge(45.0_wp)
    call stiffen(scene)
  end function stiff_wedge

  !> The event-exact orbit of a scene near that of its balance.
  subroutine find_orbit(scene, frequency_hz, level, system, loading, start, orbit, error)
    type(scene_type), intent(in) :: scene
    !> Frequency, Hz; factor on the loads
    real(wp), intent(in) :: frequency_hz, level
    !> Linear system in time, its loads, and the orbit's state at the start of the period
    type(system_type), intent(out) :: system
    type(loading_type), intent(out) :: loading
    type(state_type), intent(out) :: start
    type(orbit_type), intent(out) :: orbit
    !> Allocated: none is found
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type) :: solver
    type(state_type) :: first, end
    real(wp) :: range
    logical :: found

    call balance_scene(scene, frequency_hz, level, 20, solver, error)
    if (allocated(error)) return
    call new_system(solver%structure, solver%contacts, system, error)
    loading = loading_of(solver, system)
    first = start_of(solver, system, solver%context%balance%slider)
    start = first
    call shoot(system, loading, start, orbit, found)
    call check(error, found, 'no orbit is found')
    end = start
    call orbit%march(system, loading, end, range, found)
    ! What 20 harmonics leave out of forces with kinks.
    call check(error, norm2(start%motion - first%motion) <= 1.0e-2_wp*range, 'it is another orbit than the balance''s')
    call solver%destroy()
  end subroutine find_orbit

  !> Solve a scene by events near resonance.
  subroutine balance_scene(scene, frequency_hz, level, harmonics, solver, error, samples)
    type(scene_type), intent(in) :: scene
    !> Frequency, Hz; factor on the loads
    real(wp), intent(in) :: frequency_hz, level
    !> H
    integer, intent(in) :: harmonics
    type(solver_type), intent(out) :: solver
    !> Allocated: the balance does not converge
    type(error_type), allocatable, intent(inout) :: error
    !> J, of contacts with two tangents; those of the options unless given
    integer, intent(in), optional :: samples
    type(solver_options_type) :: options
    type(error_type), allocatable :: fault

    options = solver_options_type(harmonics=harmonics)
    if (present(samples)) options%samples = samples
    call new_solver(scene%structure, scene%contacts, only_me(), options, solver, fault)
    if (.not. allocated(fault)) call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, two_pi*frequency_hz, fault)
    if (allocated(fault)) call check(error, .false., fault%message)
    if (allocated(error)) return
    call solver%set_loads([1.0_wp], level)
    call solver%set_scales(two_pi*85.0_wp, two_pi*140.0_wp)
    call solve_by_strategies(solver, two_pi*frequency_hz)
    call check(error, solver%report%converged, 'the balance does not converge')
  end subroutine balance_scene
end module wedge_orbits
