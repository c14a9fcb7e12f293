!> The multipliers of a travelling wave by the wheel's flow over a part of the period are those of the flow over all of it, of the
!> whole wheel that was solved by itself, on the same samples: contacts slip along two tangents here.
program test_wave_monodromy
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_model_structure, only: damping_mass
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_stability_balance_motion, only: balance_motion_type, balance_motion_of
  use attrito_stability_multipliers, only: multiplier_type, in_modes, kind_floquet
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_wheel_monodromy, only: wheel_type, new_wheel, wave_multipliers
  use cyclic_sector, only: one_sector, whole_wheel
  use scenes, only: scene_type
  use session, only: run_in_session, only_me
  use testing, only: test, check
  implicit none

  ! Samples of the balance: those of a sector are to be those of the others, some later.
  integer, parameter :: harmonics = 4, samples = 120
  real(wp), parameter :: omega = 1.2_wp
  ! Both motions are solved to 1e-12; a multiplier may be double, and then feels the root of that.
  real(wp), parameter :: tolerance = 1.0e-6_wp

  call run_in_session('wave monodromy', [ &
                      test('two tangents: multipliers by a part of the period are those of the whole wheel by all of it', gate)])

contains

  subroutine gate(error)
    type(error_type), allocatable, intent(out) :: error
    ! Forward, backward, two blocks and three, all alike, many sectors
    integer, parameter :: sectors(8) = [3, 5, 4, 6, 6, 3, 8, 12], orders(8) = [1, -2, 2, -2, 3, 3, 3, 5]
    integer :: i

    do i = 1, size(sectors)
      call compare(error, sectors(i), orders(i))
      if (allocated(error)) return
    end do
  end subroutine gate

  subroutine compare(error, sectors, engine_order)
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in) :: sectors, engine_order
    type(scene_type) :: one, full
    type(solver_type) :: solver
    type(balance_motion_type) :: balance
    type(wheel_type) :: wheel
    type(multiplier_type), allocatable :: by_part(:), by_whole(:)
    type(error_type), allocatable :: fault
    character(80) :: found
    real(wp) :: largest
    integer :: info, whole_info

    one = one_sector(sectors, engine_order, damping_mass)
    call solve(one, solver)
    call check(error, solver%report%converged, 'the sector does not converge')
    if (allocated(error)) return
    balance = balance_motion_of(solver)
    call check(error, balance%turns, 'no contact slips along two tangents: the test is void')
    if (allocated(error)) return
    call new_wheel(one%structure, one%contacts, wheel, fault)
    if (allocated(fault)) error stop 'the wheel is refused'
    call wave_multipliers(wheel, balance, omega, by_part, info)
    call solver%destroy()

    full = whole_wheel(sectors, engine_order, damping_mass)
    call multipliers_of_wheel(full, by_whole, whole_info)
    call check(error, info == 0 .and. whole_info == 0, 'multipliers are not found')
    if (allocated(error)) return
    call check(error, count(by_part%kind == kind_floquet) == count(by_whole%kind == kind_floquet), 'their numbers differ')
    if (allocated(error)) return
    largest = farthest(pack(by_part%value, by_part%kind == kind_floquet), pack(by_whole%value, by_whole%kind == kind_floquet))
    write (found, '(a, i0, a, i0, a, es9.2)') 'N = ', sectors, ', EO = ', engine_order, ': multipliers differ by', largest
    call check(error, largest < tolerance, trim(found))
  end subroutine compare

  !> The motion at `omega`.
  subroutine solve(scene, solver)
    type(scene_type), intent(in) :: scene
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), &
                    solver_options_type(harmonics=harmonics, samples=samples, max_iterations=60, tolerance=1.0e-12_wp), solver, fault)
    if (allocated(fault)) error stop 'the scene is refused'
    call solver%solve_at(omega)
  end subroutine solve

  !> By the flow over the whole period.
  subroutine multipliers_of_wheel(scene, multipliers, info)
    type(scene_type), intent(in) :: scene
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0, or not: they are not found
    integer, intent(out) :: info
    type(solver_type) :: solver
    type(system_type) :: system
    type(loading_type) :: loading
    type(orbit_type) :: orbit
    type(error_type), allocatable :: fault

    call solve(scene, solver)
    call new_system(scene%structure, scene%contacts, system, fault)
    if (allocated(fault)) error stop 'the wheel is refused'
    loading%period = two_pi/omega*system%clock
    call orbit%take_balance(system, loading, balance_motion_of(solver))
    call in_modes(system, size(system%eigenvalues), orbit, multipliers, info)
    call solver%destroy()
  end subroutine multipliers_of_wheel

  !> The largest distance of partners: each in its turn takes the nearest that is left.
  pure real(wp) function farthest(one, other)
    complex(wp), intent(in) :: one(:), other(:)
    logical :: left(size(other))
    integer :: i, nearest

    left = .true.
    farthest = 0.0_wp
    do i = 1, size(one)
      nearest = minloc(abs(other - one(i)), 1, mask=left)
      farthest = max(farthest, abs(other(nearest) - one(i)))
      left(nearest) = .false.
    end do
  end function farthest
end program test_wave_monodromy
