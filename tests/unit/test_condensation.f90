!> The condensed balance against the uncondensed one: the same solution for every kind of damping and every state of contact.
program test_condensation
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_model_structure, only: damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_contact_state, only: state_stuck, state_shaken_down
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use scenes, only: scene_type, rubbing_frame, damp
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  use uncondensed, only: residual_of, solve_uncondensed
  implicit none

  integer, parameter :: harmonics = 3
  real(wp), parameter :: omega = 1.2_wp
  ! Both are solved to 1e-12 in forces of order one; the stiffness of the contacts closed on average is above 0.01.
  real(wp), parameter :: tolerance = 1.0e-10_wp

  call run_in_session('condensation', [ &
                      test('without damping the condensed balance is the uncondensed one', undamped), &
                      test('under a viscous matrix that couples all modes it is the uncondensed one', viscous), &
                      test('under Rayleigh damping it is the uncondensed one', rayleigh), &
                      test('under mass-proportional damping it is the uncondensed one', mass_damped), &
                      test('under a damping ratio of the stuck modes it is the uncondensed one', ratio), &
                      test('under a loss factor of K it is the uncondensed one', loss_factor), &
                      test('with every contact stuck it is the uncondensed one', all_stuck), &
                      test('with every contact open it is the structure alone', all_open), &
                      test('with sliders shaken down by a small vibration it is the uncondensed one', shaken_down), &
                      test('without harmonic loads it is the static equilibrium', static), &
                      test('uncoupled, the mean stays where the static solution left it', frozen_mean)])

contains

  function solver_of(scene, uncoupled) result(solver)
    type(scene_type), intent(in) :: scene
    logical, intent(in) :: uncoupled
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), &
                    solver_options_type(harmonics=harmonics, max_iterations=60, tolerance=1.0e-12_wp, uncoupled=uncoupled), &
                    solver, fault)
    if (allocated(fault)) error stop 'the scene is refused'
  end function solver_of

  !> Coordinates of the model [2 H + 1, m] at the solver's last evaluation.
  function coordinates(solver) result(q)
    type(solver_type), intent(in) :: solver
    real(wp), allocatable :: q(:, :)

    associate (balance => solver%context%balance)
      q = balance%receptance%displacements(balance%response)
    end associate
  end function coordinates

  !> Solve both and compare.
  subroutine compare(error, scene, lively)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    !> Must contacts slip, open and stay stuck all at once?
    logical, intent(in) :: lively
    type(solver_type) :: solver
    real(wp), allocatable :: q(:, :), oracle(:, :)
    logical :: converged

    solver = solver_of(scene, uncoupled=.false.)
    call solver%solve_at(omega)
    call check(error, solver%report%converged, 'the condensed balance does not converge')
    call check_close(error, solver%report%defect, 0.0_wp, 1.0e-12_wp, 'sliders that still move')
    if (lively) call check_lively(error, solver)
    q = coordinates(solver)
    call check_close(error, residual_of(scene, q, omega, 1.0_wp), 0.0_wp*q, tolerance, 'uncondensed residual')
    allocate (oracle, source=0.0_wp*q)
    call solve_uncondensed(scene, omega, 4, oracle, converged)
    call check(error, converged, 'the oracle does not converge')
    call check_close(error, q, oracle, tolerance, 'solution')
    call solver%destroy()
  end subroutine compare

  subroutine check_lively(error, solver)
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type), intent(in) :: solver

    associate (forces => solver%context%balance%forces)
      call check(error, count(forces%slip > 0.1_wp) >= 2, 'fewer than two contacts slip: the test is void')
      call check(error, any(forces%open > 0.05_wp .and. forces%open < 0.95_wp), 'no contact opens and lands: the test is void')
      call check(error, any(forces%state == state_stuck), 'no contact stays stuck: the test is void')
    end associate
  end subroutine check_lively

  subroutine compare_damped(error, kind, value)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: kind
    real(wp), intent(in) :: value
    type(scene_type) :: scene

    scene = rubbing_frame()
    call damp(scene, kind, value)
    call compare(error, scene, lively=.true.)
  end subroutine compare_damped

  subroutine undamped(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_damped(error, damping_none, 0.0_wp)
  end subroutine undamped

  subroutine viscous(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_damped(error, damping_viscous, 0.05_wp)
  end subroutine viscous

  subroutine rayleigh(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame()
    scene%structure%damping_kind = damping_viscous
    scene%structure%damping = 0.05_wp*scene%structure%mass + 0.03_wp*scene%structure%stiffness
    call compare(error, scene, lively=.true.)
  end subroutine rayleigh

  subroutine mass_damped(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_damped(error, damping_mass, 0.1_wp)
  end subroutine mass_damped

  subroutine ratio(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_damped(error, damping_ratio, 0.04_wp)
  end subroutine ratio

  subroutine loss_factor(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_damped(error, damping_loss_factor, 0.1_wp)
  end subroutine loss_factor

  subroutine all_stuck(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    scene%contacts%law%preload = 100.0_wp
    call compare(error, scene, lively=.false.)
  end subroutine all_stuck

  subroutine all_open(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame()
    call damp(scene, damping_loss_factor, 0.1_wp)
    scene%contacts%law%preload = -100.0_wp
    call compare(error, scene, lively=.false.)
  end subroutine all_open

  subroutine shaken_down(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    scene%structure%static_loads = -2.5_wp*scene%structure%static_loads
    scene%structure%harmonic_load = 0.02_wp*scene%structure%harmonic_load
    solver = solver_of(scene, uncoupled=.false.)
    call solver%solve_at(omega)
    call check(error, count(solver%context%balance%forces%state == state_shaken_down) == 3, &
               'not all sliders but one move once: the test is void')
    call solver%destroy()
    call compare(error, scene, lively=.false.)
  end subroutine shaken_down

  subroutine static(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame()
    scene%structure%static_loads = 5.0_wp*scene%structure%static_loads
    scene%structure%harmonic_load = 0.0_wp
    call compare(error, scene, lively=.false.)
  end subroutine static

  subroutine frozen_mean(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    type(error_type), allocatable :: fault
    real(wp), allocatable :: q(:, :), q_static(:, :), residual(:, :)

    scene = rubbing_frame()
    call damp(scene, damping_viscous, 0.05_wp)
    solver = solver_of(scene, uncoupled=.true.)
    call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 1, omega, fault)
    call check(error, .not. allocated(fault), 'no static equilibrium')
    q_static = coordinates(solver)
    call solver%set_loads([1.0_wp], 1.0_wp)
    call solver%set_scales(omega, omega)
    call solver%solve_at(omega)
    call check(error, solver%report%converged, 'the uncoupled balance does not converge')
    call check_lively(error, solver)
    q = coordinates(solver)
    call check_close(error, q(1, :), q_static(1, :), 1.0e-14_wp, 'mean')
    residual = residual_of(scene, q, omega, 1.0_wp)
    call check_close(error, residual(2:, :), 0.0_wp*q(2:, :), tolerance, 'uncondensed residual of the harmonics')
    call check(error, norm2(residual(1, :)) > 1.0e-3_wp, 'the mean is in balance all the same: the test is void')
    call solver%destroy()
  end subroutine frozen_mean
end program test_condensation
