!> Stability of orbits: multipliers of the paper's wedge and of closed forms, by both engines.
program test_stability
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_continuation_cascade, only: solve_by_cascade
  use attrito_continuation_solver, only: solver_type, solver_options_type, new_solver
  use attrito_continuation_static_path, only: walk_static_path
  use attrito_integrate_system, only: system_type, new_system
  use attrito_stability_examine, only: by_monodromy, by_hill
  use attrito_stability_hill, only: hill_multipliers
  use attrito_stability_leg, only: orbit_legs_type, legs_of_motion
  use attrito_stability_monodromy, only: monodromy
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of
  use scenes, only: scene_type, wedge
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  !> Of the wedge at 45 degrees, 132 Hz, 5 N, excited along x and along the contact's tangent, to four digits
  complex(wp), parameter :: along_x(5) = [(0.7899_wp, 0.0_wp), (0.6728_wp, 0.0402_wp), (0.6728_wp, -0.0402_wp), &
                                          (0.3453_wp, 0.0_wp), (0.0_wp, 0.0_wp)]
  complex(wp), parameter :: along_tangent(5) = [(0.7873_wp, 0.0_wp), (0.7643_wp, 0.0_wp), (0.7510_wp, 0.0_wp), &
                                                (0.2385_wp, 0.0_wp), (0.0_wp, 0.0_wp)]

  call run_in_session('stability', [ &
                      test('multipliers of the wedge by the monodromy are those that are known', by_flow), &
                      test('multipliers of the wedge by Hill''s problem are those that are known', by_harmonics)])

contains

  !> The wedge at 45 degrees, balanced at 132 Hz and 5 N.
  subroutine balance_wedge(x, harmonics, solver, error)
    !> Excite along x rather than along the tangent
    logical, intent(in) :: x
    integer, intent(in) :: harmonics
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: fault
    type(scene_type) :: scene

    scene = wedge(45.0_wp)
    if (x) scene%structure%harmonic_load(:, 2) = [1.0_wp, 0.0_wp]
    call new_solver(scene%structure, scene%contacts, only_me(), solver_options_type(harmonics=harmonics, by_events=.true.), &
                    solver, fault)
    if (.not. allocated(fault)) call walk_static_path(solver, reshape([1.0_wp], [1, 1]), 20, two_pi*132.0_wp, fault)
    if (allocated(fault)) call check(error, .false., fault%message)
    if (allocated(error)) return
    call solver%set_loads([1.0_wp], 5.0_wp)
    call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
    call solve_by_cascade(solver, two_pi*132.0_wp)
    call check(error, solver%report%converged, 'the balance does not converge')
  end subroutine balance_wedge

  subroutine by_flow(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_wedge(by_monodromy, error)
  end subroutine by_flow

  subroutine by_harmonics(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_wedge(by_hill, error)
  end subroutine by_harmonics

  subroutine compare_wedge(method, error)
    integer, intent(in) :: method
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type) :: solver
    type(system_type) :: system
    type(orbit_legs_type) :: orbit
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: period
    integer :: info, i

    do i = 1, 2
      call balance_wedge(i == 1, 40, solver, error)
      if (allocated(error)) return
      call new_system(solver%structure, solver%contacts, system, error)
      call legs_of_motion(solver%contacts%law, new_grid(40), solver%motion, solver%context%balance%slider(1, :), orbit)
      period = two_pi*system%clock/solver%omega
      if (method == by_monodromy) then
        call multipliers_of(system, orbit, monodromy(system, orbit, period), multipliers, info)
      else
        call hill_multipliers(system, orbit, period, multipliers, info)
      end if
      call check(error, info == 0, 'no eigenvalues')
      call check_close(error, reshape(multipliers%value, [5, 1]), reshape(merge(along_x, along_tangent, i == 1), [5, 1]), &
                       1.0e-4_wp, 'multipliers')
      call solver%destroy()
    end do
  end subroutine compare_wedge
end program test_stability
