!> The paper's wedge: static paths, its steady state at 132 Hz, lock-up, and the linear limit.
program test_wedge
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: state_stuck, state_slipping
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use scenes, only: scene_type, wedge, wedge_preload
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  call run_in_session('wedge', [ &
                      test('a ramp of the preload ends in slip with T = mu N, in closed form', ramp), &
                      test('a path that overshoots and returns ends at the negative limit of friction', overshoot), &
                      test('the end of the path does not depend on the number of steps', steps), &
                      test('at 132 Hz and 5 N the coupled steady state is that of the paper', steady_state), &
                      test('a tiny force after the ramp shakes the slider down and responds as if stuck', linear_limit), &
                      test('on a level wall it is locked below the closed form''s force', locked), &
                      test('on a level wall it slips above the closed form''s force', unlocked), &
                      test('uncoupled, the mean stays that of the ramp', uncoupled)])

contains

  !> The wedge after its static path, ready for a harmonic force.
  subroutine prepare(scene, path, options, omega, solver, error)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: path(:)
    type(solver_options_type), intent(in) :: options
    real(wp), intent(in) :: omega
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), options, solver, fault)
    if (.not. allocated(fault)) call follow_static_path(solver, reshape(path, [1, size(path)]), 20, omega, fault)
    if (allocated(fault)) call check(error, .false., fault%message)
  end subroutine prepare

  !> Mean T and N of the one contact.
  function mean_force(solver) result(force)
    type(solver_type), intent(in) :: solver
    real(wp) :: force(2)

    associate (balance => solver%context%balance)
      force = balance%forces(1)%deviation(1, :) + solver%contacts%row_stiffness*solver%motion(1, :)
    end associate
  end function mean_force

  function static_force(degrees, path) result(force)
    real(wp), intent(in) :: degrees, path(:)
    real(wp) :: force(2)
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call prepare(wedge(degrees), path, solver_options_type(), two_pi*132.0_wp, solver, fault)
    force = huge(1.0_wp)
    if (.not. allocated(fault)) force = mean_force(solver)
    call solver%destroy()
  end function static_force

  !> T and N in slip at 45 degrees: (K + B^T [side mu kn; kn] n) q = f.
  function slip_limit(side) result(force)
    !> Sign of T
    real(wp), intent(in) :: side
    real(wp) :: force(2), system(2, 2), q(2, 1)
    type(scene_type) :: scene
    integer :: info

    scene = wedge(45.0_wp)
    associate (law => scene%contacts%law(1), t => scene%contacts%directions(:, 1), n => scene%contacts%directions(:, 2))
      system = scene%structure%stiffness + law%normal_stiffness*matmul( &
               reshape(n + side*law%friction_coefficient*t, [2, 1]), reshape(n, [1, 2]))
      q(:, 1) = [0.0_wp, wedge_preload]
      call solve_dense(system, q, info)
      force(2) = law%normal_stiffness*dot_product(n, q(:, 1))
      force(1) = side*law%friction_coefficient*force(2)
    end associate
  end function slip_limit

  subroutine ramp(error)
    type(error_type), allocatable, intent(out) :: error

    ! The solve ends at 1e-10 of displacements that are multiplied by forces of some 20.
    call check_close(error, static_force(45.0_wp, [1.0_wp]), slip_limit(1.0_wp), 1.0e-8_wp, '(T, N)')
  end subroutine ramp

  subroutine overshoot(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: force(2)

    force = static_force(45.0_wp, [0.0_wp, 2.5_wp, 1.0_wp])
    call check_close(error, force, [-11.28_wp, 22.56_wp], 0.005_wp, '(T, N) of DESIGN, to its digits')
    call check_close(error, force, slip_limit(-1.0_wp), 1.0e-8_wp, '(T, N)')
  end subroutine overshoot

  subroutine steps(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: whole(2)

    ! Proportional loading of one contact is the same in one step as in twenty.
    whole = static_force(45.0_wp, [1.0_wp])
    call check_close(error, static_force(45.0_wp, [0.1_wp, 0.3_wp, 1.0_wp]), whole, 1.0e-8_wp, '(T, N)')
  end subroutine steps

  subroutine steady_state(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp), allocatable :: q(:, :)
    real(wp), parameter :: digits = 5.0e-4_wp

    call prepare(wedge(45.0_wp), [1.0_wp], solver_options_type(samples=1024), two_pi*132.0_wp, solver, error)
    call solver%set_loads([1.0_wp], 5.0_wp)
    call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
    call solve_by_strategies(solver, two_pi*132.0_wp)
    call check(error, solver%report%converged, 'it does not converge')
    associate (balance => solver%context%balance, expected => [-6.045_wp, 23.724_wp])
      q = balance%receptance%displacements(balance%response)
      call check(error, balance%forces(1)%state == state_slipping .and. balance%forces(1)%unique, 'it does not slip')
      call check_close(error, mean_force(solver)/expected, [1.0_wp, 1.0_wp], digits, 'mean T and N, relative')
      call check_close(error, q(1, :)/[-5.332e-5_wp, 1.6515e-4_wp], [1.0_wp, 1.0_wp], digits, 'mean x and y, relative')
    end associate
    call solver%destroy()
  end subroutine steady_state

  subroutine linear_limit(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: tiny_force = 1.0e-3_wp, omega = two_pi*132.0_wp
    type(solver_type) :: solver
    type(scene_type) :: scene
    real(wp), allocatable :: stuck(:, :)

    scene = wedge(45.0_wp)
    call prepare(scene, [1.0_wp], solver_options_type(), omega, solver, error)
    call solver%set_loads([1.0_wp], tiny_force)
    call solver%set_scales(omega, omega)
    call solver%solve_at(omega)
    call check(error, solver%report%converged, 'it does not converge')
    ! Solve again from the sliders that it was shaken down to: nothing moves any more.
    call solver%solve_at(omega)
    call check(error, solver%context%balance%forces(1)%state == state_stuck, 'it is not shaken down')
    stuck = stuck_response(scene, omega)
    call check_close(error, solver%motion(2:3, :)/tiny_force, stuck, 1.0e-10_wp*maxval(abs(stuck)), 'motion per force')
    call check_close(error, solver%motion(4:, :), 0.0_wp*solver%motion(4:, :), 1.0e-10_wp*tiny_force*maxval(abs(stuck)), &
                     'higher harmonics')
    call solver%destroy()
  end subroutine linear_limit

  !> Cosine and sine of (u, v) per unit force with the contact as springs, by one real dense solve [2, 2].
  function stuck_response(scene, omega) result(response)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: omega
    real(wp) :: response(2, 2), system(4, 4), q(4, 1), elastic(2, 2)
    integer :: info

    associate (structure => scene%structure, b => scene%contacts%directions)
      elastic = structure%stiffness + 3.0e5_wp*matmul(b, transpose(b)) - omega**2*structure%mass
      system(:2, :) = reshape([elastic, omega*structure%damping], [2, 4])
      system(3:, :) = reshape([-omega*structure%damping, elastic], [2, 4])
      q(:, 1) = [structure%harmonic_load(:, 2), 0.0_wp, 0.0_wp]
      call solve_dense(system, q, info)
      response(1, :) = matmul(q(:2, 1), b)
      response(2, :) = matmul(q(3:, 1), b)
    end associate
  end function stuck_response

  !> On a level wall N stays ky's share of the preload and the stuck response peaks at F / (c sqrt(k - c^2 / 4)): the force at which
  !> kt times that reaches mu N, Fpl / F = 105.8.
  pure real(wp) function lock_up_force()
    real(wp), parameter :: c = 20.0_wp*pi, kt = 3.0e5_wp, k = (two_pi*100.0_wp)**2 + kt
    real(wp), parameter :: normal = wedge_preload*3.0e5_wp/((two_pi*250.0_wp)**2 + 3.0e5_wp)

    lock_up_force = 0.5_wp*normal*c*sqrt(k - 0.25_wp*c**2)/kt
  end function lock_up_force

  !> Sweep over the stuck resonance of the level wall: the largest share of slip in a period.
  subroutine sweep_level_wall(force, error, slip)
    real(wp), intent(in) :: force
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(out) :: slip
    type(solver_type) :: solver
    type(sweep_type) :: sweep

    slip = 0.0_wp
    call prepare(wedge(0.0_wp), [1.0_wp], solver_options_type(), two_pi*125.0_wp, solver, error)
    call solver%set_loads([1.0_wp], force)
    sweep = new_sweep(solver, two_pi*125.0_wp, two_pi*140.0_wp, 1, 300)
    do while (.not. sweep%finished)
      call sweep%advance(solver)
      call check(error, solver%report%converged, 'a point does not converge')
      slip = max(slip, solver%context%balance%forces(1)%slip)
    end do
    call check(error, sweep%reached_stop, 'the sweep does not reach its stop')
    call solver%destroy()
  end subroutine sweep_level_wall

  subroutine locked(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: slip

    call check_close(error, wedge_preload/lock_up_force(), 105.8_wp, 0.05_wp, 'Fpl / F of DESIGN, to its digits')
    call sweep_level_wall((1.0_wp - 1.0e-6_wp)*lock_up_force(), error, slip)
    call check_close(error, slip, 0.0_wp, 0.0_wp, 'share of slip')
  end subroutine locked

  subroutine unlocked(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: slip

    ! One per cent above, mu N is exceeded over a band of some 0.14 half-widths (10 rad/s): wider than the sweep's steps near it.
    call sweep_level_wall(1.01_wp*lock_up_force(), error, slip)
    call check(error, slip > 0.0_wp, 'it never slips')
  end subroutine unlocked

  subroutine uncoupled(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp) :: static(2)

    call prepare(wedge(45.0_wp), [1.0_wp], solver_options_type(uncoupled=.true.), two_pi*132.0_wp, solver, error)
    static = solver%motion(1, :)
    call solver%set_loads([1.0_wp], 5.0_wp)
    call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
    call solve_by_strategies(solver, two_pi*132.0_wp)
    call check(error, solver%report%converged, 'it does not converge')
    ! Newton ends within 1e-10 of the largest stuck response, some 1e-3.
    call check_close(error, solver%motion(1, :), static, 1.0e-13_wp, 'mean of u and v')
    call solver%destroy()
  end subroutine uncoupled
end program test_wedge
