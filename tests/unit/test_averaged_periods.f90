!> Starts out of motion in time: on an orbit they are the orbit, and where Newton's method fails from the static solution they lead
!> on.
program test_averaged_periods
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_model_contacts, only: contact_type, new_contacts
  use attrito_model_structure, only: damping_loss_factor, damping_ratio
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_solve_time_integrator, only: excitation_type, periods_type
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_integrate_averaged_periods, only: averaged_periods_type, new_averaged_periods
  use scenes, only: scene_type, wedge, wedge_preload, rubbing_frame, damp
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  use uncondensed, only: residual_of
  implicit none

  call run_in_session('averaged_periods', [ &
                      test('where every contact sticks they are the linear response to a load of straight pieces', stuck), &
                      test('on an orbit that slips they near it as the square of the step', slipping), &
                      test('a loss factor has a twin in time', lossy), &
                      test('no stiffness of an open contact makes them grow without bounds', resonating), &
                      test('a stiff wedge is solved at every frequency, from the static solution and from the point before', stiff), &
                      test('a block that friction cannot hold is said to drift', drifting), &
                      test('one that drifts in space is left with the sliders that follow it', drifting_in_space)])

contains

  function solver_of(scene, options, level) result(solver)
    type(scene_type), intent(in) :: scene
    type(solver_options_type), intent(in) :: options
    real(wp), intent(in) :: level
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), options, solver, fault)
    if (allocated(fault)) error stop 'the scene is refused'
    call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, two_pi, fault)
    if (allocated(fault)) error stop 'no static equilibrium'
    call solver%set_loads([1.0_wp], level)
  end function solver_of

  !> Stand where the solver does, and move on.
  subroutine move_on(solver, scene, motion, moved)
    type(solver_type), intent(in) :: solver
    type(scene_type), intent(in) :: scene
    real(wp), intent(out) :: motion(:, :)
    logical, intent(out) :: moved
    type(averaged_periods_type) :: in_time
    type(periods_type) :: periods
    real(wp), allocatable :: q(:, :)
    real(wp) :: rate(size(scene%structure%mass, 1))
    integer :: h

    associate (balance => solver%context%balance)
      q = balance%receptance%displacements(balance%response)
      rate = 0.0_wp
      do h = 1, size(q, 1)/2
        rate = rate + h*solver%omega*q(2*h + 1, :)
      end do
      in_time = new_averaged_periods(scene%structure, scene%contacts)
      call in_time%set_state(q(1, :) + sum(q(2::2, :), 1), rate, balance%slider, moved)
      if (.not. moved) return
      call in_time%average_over(excitation_type(solver%omega, balance%static_factors, balance%level), size(motion, 1)/2, 5, periods)
      moved = periods%moved .and. .not. periods%is_drifting
      motion = periods%motion
    end associate
  end subroutine move_on

  !> Between samples the load is linear: its first harmonic acts as (sin x / x)^2, x = pi / J, of itself.
  subroutine stuck(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps = 64
    type(scene_type) :: scene
    type(solver_type) :: solver
    real(wp) :: motion(11, 2), share
    logical :: moved

    scene = wedge(45.0_wp)
    solver = solver_of(scene, solver_options_type(), 0.1_wp)
    call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
    call solver%solve_at(two_pi*120.0_wp)
    call check(error, solver%report%converged .and. solver%all_stick, 'it does not stick')
    call move_on(solver, scene, motion, moved)
    call check(error, moved, 'it does not move')
    share = (sin(pi/steps)/(pi/steps))**2
    ! The transient of starting with the whole response, 1 - share = 8e-4 of it, dies by exp(-2 pi zeta) a period: zeta is near 0.04,
    ! and it averages out over periods but for a fifth.
    call check_close(error, motion(2:3, :), share*solver%motion(2:3, :), &
                     0.2_wp*(1.0_wp - share)*maxval(abs(solver%motion(2:3, :))), 'first harmonic')
    call check_close(error, motion(1, :), solver%motion(1, :), 0.2_wp*(1.0_wp - share)*maxval(abs(solver%motion(2:3, :))), 'mean')
    call solver%destroy()
  end subroutine stuck

  subroutine slipping(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: harmonics(3) = [16, 32, 64]
    type(scene_type) :: scene
    type(solver_type) :: solver
    real(wp), allocatable :: motion(:, :)
    real(wp) :: off(3)
    logical :: moved
    integer :: i

    scene = wedge(45.0_wp)
    do i = 1, 3
      solver = solver_of(scene, solver_options_type(harmonics=harmonics(i), samples=1024), 5.0_wp)
      call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
      call solve_by_strategies(solver, two_pi*132.0_wp)
      call check(error, solver%report%converged .and. .not. solver%all_stick, 'it does not slip')
      if (allocated(motion)) deallocate (motion)
      allocate (motion, mold=solver%motion)
      call move_on(solver, scene, motion, moved)
      call check(error, moved, 'it does not move')
      off(i) = maxval(abs(motion(:7, :) - solver%motion(:7, :)))/maxval(abs(solver%motion(2:, :)))
      call solver%destroy()
    end do
    ! Eight steps a harmonic: each time twice as many.
    call check(error, off(1) < 5.0e-3_wp, 'far from the orbit')
    call check(error, all(off(:2)/off(2:) > 3.0_wp), 'not of second order')
  end subroutine slipping

  subroutine lossy(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    real(wp) :: motion(11, 10)
    logical :: moved

    scene = rubbing_frame()
    call damp(scene, damping_loss_factor, 0.05_wp)
    solver = solver_of(scene, solver_options_type(), 0.3_wp)
    call solver%set_scales(1.0_wp, 1.2_wp)
    call solve_by_strategies(solver, 1.1_wp)
    call check(error, solver%report%converged, 'it is not solved')
    call move_on(solver, scene, motion, moved)
    call check(error, moved, 'it does not move')
    call solver%destroy()
  end subroutine lossy

  !> A mass on a spring beside a contact that stays open: steps of the scheme are exact for the contact closed, and the force that
  !> opens it is straight within each. Where the closed natural frequency times the step is near a multiple of pi that is unstable.
  subroutine resonating(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps = 64
    real(wp), parameter :: spring = 4.0_wp
    type(scene_type) :: scene
    type(averaged_periods_type) :: in_time
    type(periods_type) :: periods
    real(wp) :: closed
    logical :: moved
    integer :: i

    associate (structure => scene%structure)
      structure%mass = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
      structure%stiffness = spring*structure%mass
      allocate (structure%static_loads(2, 1), structure%harmonic_load(2, 3), source=0.0_wp)
      structure%harmonic_load(2, 2) = 1.0_wp
      allocate (structure%monitors(2, 0))
    end associate
    do i = 1, 19
      ! At excitation 1: 0.9 pi to 1.1 pi a step.
      closed = 0.5_wp*steps*(0.89_wp + 0.01_wp*i)
      scene%contacts = new_contacts([contact_type(tangents=1, tangential_stiffness=1.0_wp, normal_stiffness=closed**2 - spring, &
                                                  friction_coefficient=0.3_wp, gap=100.0_wp)], scene%structure%mass)
      call damp(scene, damping_ratio, 0.001_wp)
      in_time = new_averaged_periods(scene%structure, scene%contacts)
      call in_time%set_state([0.0_wp, 1.0_wp/3.0_wp], [0.0_wp, 0.0_wp], reshape([0.0_wp, 0.0_wp], [2, 1]), moved)
      call check(error, moved, 'it is not set')
      call in_time%average_over(excitation_type(1.0_wp, [1.0_wp], 1.0_wp), 5, 5, periods)
      call check(error, periods%moved, 'it does not move')
      ! Straight pieces of a force, closed^2 times the motion, are up to (2 pi/steps)^2/12 of it off: 1 of the free spring's 3.
      call check(error, maxval(abs(periods%motion(2:, :))) < 0.5_wp, 'it grows')
    end do
  end subroutine resonating

  !> kn = kt = 3e6, 20 N of preload, 60 N along x: half of these orbits are unstable, and no point before leads to some.
  subroutine stiff(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: points = 23
    type(scene_type) :: scene
    type(contact_type), allocatable :: law(:)
    integer :: without, with

    scene = wedge(45.0_wp)
    law = scene%contacts%law
    law%tangential_stiffness = 3.0e6_wp
    law%normal_stiffness = 3.0e6_wp
    scene%contacts = new_contacts(law, scene%contacts%directions)
    scene%structure%static_loads = 20.0_wp/wedge_preload*scene%structure%static_loads
    scene%structure%harmonic_load = reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp], [2, 3])
    call count_solved(error, scene, points, .true., .true., with)
    call check(error, with == points, 'a point is missed from the static solution')
    call count_solved(error, scene, points, .false., .true., without)
    call check(error, without < points, 'Newton''s method solves them all by itself: the test is void')
    call count_solved(error, scene, points, .true., .false., with)
    call check(error, with == points, 'a point is missed from the point before')
  end subroutine stiff

  !> A mass on a contact that is pressed as it goes one way, and nothing else along it: friction does not balance over a period.
  function drifting_mass(tangents) result(scene)
    integer, intent(in) :: tangents
    type(scene_type) :: scene
    real(wp) :: eye(tangents + 1, tangents + 1)
    integer :: i

    eye = 0.0_wp
    do i = 1, tangents + 1
      eye(i, i) = 1.0_wp
    end do
    scene%contacts = new_contacts([contact_type(tangents=tangents, tangential_stiffness=10.0_wp, normal_stiffness=10.0_wp, &
                                                friction_coefficient=0.3_wp)], eye)
    associate (structure => scene%structure)
      structure%mass = eye
      structure%stiffness = 0.0_wp*eye
      structure%static_loads = eye(:, tangents + 1:)
      ! Along it is shaken by sin t, which moves it as -sin t, and pressed more, by cos t, as it goes back.
      allocate (structure%harmonic_load(tangents + 1, 3), source=0.0_wp)
      structure%harmonic_load(tangents + 1, 2) = 0.5_wp
      structure%harmonic_load(1, 3) = 1.0_wp
      allocate (structure%monitors(tangents + 1, 0))
    end associate
    call damp(scene, damping_ratio, 0.02_wp)
  end function drifting_mass

  subroutine drifting_in_space(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver

    scene = drifting_mass(2)
    ! Round and round, and so little that the slider takes several periods to where it goes on from as it does.
    scene%structure%harmonic_load(2, 2) = 0.6_wp
    solver = solver_of(scene, solver_options_type(samples=64), 0.3_wp)
    allocate (solver%time_integrator, source=new_averaged_periods(scene%structure, scene%contacts))
    call solver%set_scales(0.9_wp, 1.1_wp)
    call solve_by_strategies(solver, 1.0_wp)
    call check(error, solver%evidence%is_drifting, 'it is held: the test is void')
    call check(error, all(solver%context%balance%periodic), 'its slider no longer follows it')
    call solver%destroy()
  end subroutine drifting_in_space

  subroutine drifting(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    real(wp) :: force

    scene = drifting_mass(1)
    solver = solver_of(scene, solver_options_type(), 1.0_wp)
    allocate (solver%time_integrator, source=new_averaged_periods(scene%structure, scene%contacts))
    call solver%set_scales(0.9_wp, 1.1_wp)
    call solve_by_strategies(solver, 1.0_wp)
    call check(error, .not. solver%report%converged, 'it is held')
    call check(error, solver%evidence%is_drifting .and. solver%evidence%no_periodic_solution, 'it is not said to drift')
    call check(error, solver%report%iterations < 200, 'what is not there is looked for too long')
    force = mean_friction(solver)
    call check(error, abs(force) > 1.0e-2_wp*scene%contacts%law(1)%friction_coefficient, 'friction balances after all')
    solver%motion(1, 1) = solver%motion(1, 1) + 0.1_wp
    ! Its march loses digits of the motion's size, ten at most, not of the shift.
    call check_close(error, mean_friction(solver), force, 1.0e-12_wp, 'mean friction somewhere else')
    call solve_by_strategies(solver, 1.02_wp)
    call check(error, solver%evidence%is_drifting, 'a little beyond it is not said to drift')
    call check(error, solver%report%iterations <= 20, 'a little beyond it is looked for as long')
    solver%evidence = evidence_type()
    sweep = new_sweep(solver, 0.9_wp, 1.1_wp, 0, 300)
    do while (.not. sweep%finished)
      call sweep%advance(solver)
      call check(error, solver%evidence%is_drifting .and. .not. solver%report%converged, 'it does not drift all along a sweep')
    end do
    call check(error, sweep%reached_stop, 'the sweep does not reach its stop')
    call solver%destroy()
  end subroutine drifting

  !> Mean tangential force on the first contact, where the solver stands.
  real(wp) function mean_friction(solver)
    type(solver_type), intent(inout) :: solver
    integer :: status

    associate (balance => solver%context%balance)
      call balance%evaluate(solver%motion, solver%omega, status)
      call solver%context%forget()
      mean_friction = balance%law(1)%tangential_stiffness*solver%motion(1, 1) + balance%forces(1)%deviation(1, 1)
    end associate
  end function mean_friction

  !> How many of the frequencies 85, 87.5, ... are solved; each solution is one by the uncondensed residual.
  subroutine count_solved(error, scene, points, in_time, alone, solved)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: points
    !> With starts out of motion in time, or Newton's method alone; each point from the static solution
    logical, intent(in) :: in_time, alone
    integer, intent(out) :: solved
    type(solver_options_type), parameter :: options = solver_options_type(harmonics=10, samples=512)
    real(wp), parameter :: level = 60.0_wp
    type(solver_type) :: solver
    real(wp), allocatable :: q(:, :)
    real(wp) :: scale
    integer :: i

    solved = 0
    do i = 1, points
      if (alone .or. i == 1) then
        solver = solver_of(scene, options, level)
        if (in_time) allocate (solver%time_integrator, source=new_averaged_periods(scene%structure, scene%contacts))
        call solver%set_scales(two_pi*85.0_wp, two_pi*140.0_wp)
      end if
      if (in_time) then
        call solve_by_strategies(solver, two_pi*(85.0_wp + 2.5_wp*(i - 1)))
      else
        call solver%solve_at(two_pi*(85.0_wp + 2.5_wp*(i - 1)))
      end if
      if (solver%report%converged) then
        solved = solved + 1
        associate (balance => solver%context%balance)
          q = balance%receptance%displacements(balance%response)
          scale = solver%context%motion_scale*maxval(abs(solver%stuck%stiffness)) &
                  *(1.0_wp + (options%harmonics*solver%omega)**2/minval(solver%stuck%omega)**2)
          if (balance%forces(1)%unique) call check_close(error, residual_of(scene, q, solver%omega, level), &
                                                         0.0_wp*q, 1.0e-9_wp*scale, 'uncondensed residual')
        end associate
      end if
      if (alone .or. i == points) call solver%destroy()
    end do
  end subroutine count_solved
end program test_averaged_periods
