!> Homotopies that fail on purpose. The solver's frequency stands for the parameter at which one succeeded last.
module failing_homotopies
  use attrito_core_kinds, only: wp
  use attrito_solve_homotopy, only: homotopy_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: small_steps_type, walled_type

  !> Succeeds only if a sixteenth or less ahead
  type, extends(homotopy_type) :: small_steps_type
  contains
    procedure :: solve => by_small_steps
  end type small_steps_type

  !> Succeeds nowhere beyond a half
  type, extends(homotopy_type) :: walled_type
  contains
    procedure :: solve => not_beyond_half
  end type walled_type

contains

  subroutine by_small_steps(self, solver, t, converged)
    class(small_steps_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: t
    logical, intent(out) :: converged

    converged = t - solver%omega <= 1.0_wp/16.0_wp + 1.0e-12_wp
    if (converged) solver%omega = t
  end subroutine by_small_steps

  subroutine not_beyond_half(self, solver, t, converged)
    class(walled_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: t
    logical, intent(out) :: converged

    converged = t <= 0.5_wp
    if (converged) solver%omega = t
  end subroutine not_beyond_half
end module failing_homotopies

!> Branches over frequency: every point solved, folds passed, the same points whichever way they are reached.
program test_branches
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_structure, only: damping_none
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_controls_type, newton_report_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_solve_homotopy, only: follow_homotopy
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use scenes, only: scene_type, wedge, one_sided_oscillator
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  use uncondensed, only: residual_of
  use failing_homotopies, only: small_steps_type, walled_type
  implicit none

  !> A point of a branch
  type :: point_type
    real(wp) :: omega = 0.0_wp
    real(wp), allocatable :: motion(:, :)
    logical :: unique = .false.
  end type point_type

  !> How far the march of a parameter has come, for the steps that it is given

  call run_in_session('branches', [ &
                      test('a sweep of the wedge reaches its stop with every point solved', wedge_sweep), &
                      test('sweeps up and down the wedge pass through the same points', up_and_down), &
                      test('a branch that a stop bends to the right passes both folds', hardening), &
                      test('a branch that lift-off bends to the left passes both folds', softening), &
                      test('without any damping but friction a converged point is a solution', undamped_wedge), &
                      test('a march of a parameter halves its step where it fails and gives up where it must', march), &
                      test('steps that keep springs of the contacts end in the same solution', with_springs), &
                      test('a solve that PETSc refuses is distinguished from one that does not converge', refused)])

contains

  function solver_of(scene, options) result(solver)
    type(scene_type), intent(in) :: scene
    type(solver_options_type), intent(in) :: options
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), options, solver, fault)
    if (allocated(fault)) error stop 'the scene is refused'
  end function solver_of

  !> All points of a sweep, each checked to be converged and, by the uncondensed residual, to be a solution.
  subroutine follow(error, scene, options, level, start, stop, points)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    type(solver_options_type), intent(in) :: options
    real(wp), intent(in) :: level, start, stop
    type(point_type), allocatable, intent(out) :: points(:)
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    type(error_type), allocatable :: fault
    real(wp), allocatable :: q(:, :)
    real(wp) :: scale

    solver = solver_of(scene, options)
    call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, start, fault)
    call check(error, .not. allocated(fault), 'no static equilibrium')
    call solver%set_loads([1.0_wp], level)
    sweep = new_sweep(solver, start, stop, 1, 600)
    ! Many points: the curve that is drawn through them needs fewer.
    sweep%stepper%tolerance = 1.0e-4_wp
    allocate (points(0))
    do while (.not. (sweep%finished .or. allocated(error)))
      call sweep%advance(solver)
      associate (balance => solver%context%balance)
        call check(error, solver%report%converged, 'a point does not converge')
        points = [points, point_type(solver%omega, solver%motion, balance%forces(1)%unique)]
        if (.not. balance%forces(1)%unique) cycle
        ! Converged is 1e-10 of the largest response, times the largest dynamic stiffness at (H omega)^2.
        q = balance%receptance%displacements(balance%response)
        scale = solver%context%motion_scale*maxval(abs(solver%stuck%stiffness)) &
                *(1.0_wp + (options%harmonics*solver%omega)**2/minval(solver%stuck%omega)**2)
        call check_close(error, residual_of(scene, q, solver%omega, level), 0.0_wp*q, 1.0e-9_wp*scale, &
                         'uncondensed residual')
      end associate
    end do
    call check(error, sweep%reached_stop, 'the sweep does not reach its stop')
    call solver%destroy()
  end subroutine follow

  subroutine wedge_sweep(error)
    type(error_type), allocatable, intent(out) :: error
    type(point_type), allocatable :: points(:)

    call follow(error, wedge(45.0_wp), solver_options_type(), 5.0_wp, two_pi*140.0_wp, two_pi*100.0_wp, points)
    call check_close(error, points(1)%omega, two_pi*140.0_wp, 0.0_wp, 'first frequency')
    call check_close(error, points(size(points))%omega, two_pi*100.0_wp, 0.0_wp, 'last frequency')
    call check(error, count(points%unique) > 10, 'it hardly slips: the test is void')
  end subroutine wedge_sweep

  subroutine up_and_down(error)
    type(error_type), allocatable, intent(out) :: error
    type(point_type), allocatable :: up(:), down(:)
    type(solver_type) :: solver
    integer :: i, near, compared

    call follow(error, wedge(45.0_wp), solver_options_type(), 5.0_wp, two_pi*100.0_wp, two_pi*140.0_wp, up)
    call follow(error, wedge(45.0_wp), solver_options_type(), 5.0_wp, two_pi*140.0_wp, two_pi*100.0_wp, down)
    solver = solver_of(wedge(45.0_wp), solver_options_type())
    call solver%set_loads([1.0_wp], 5.0_wp)
    call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
    compared = 0
    do i = 1, size(up)
      near = minloc(abs(down%omega - up(i)%omega), 1)
      if (.not. (up(i)%unique .and. down(near)%unique)) cycle
      ! From the nearest point of the way down, the frequency of the way up.
      solver%motion = down(near)%motion
      call solver%solve_at(up(i)%omega)
      call check(error, solver%report%converged, 'a point of the way up is not found from the way down')
      ! Both within 1e-10 of the largest stuck response; the Jacobian's condition lies between.
      call check_close(error, solver%motion, up(i)%motion, 1.0e-8_wp*solver%context%motion_scale, 'motion')
      compared = compared + 1
    end do
    call check(error, compared > 10, 'hardly a point to compare: the test is void')
    call solver%destroy()
  end subroutine up_and_down

  !> Signs that omega's steps change along a branch.
  integer function turns(points)
    type(point_type), intent(in) :: points(:)
    real(wp), allocatable :: steps(:)
    integer :: n

    n = size(points)
    steps = points(2:)%omega - points(:n - 1)%omega
    turns = count(steps(2:)*steps(:n - 2) < 0.0_wp)
  end function turns

  subroutine hardening(error)
    type(error_type), allocatable, intent(out) :: error
    type(point_type), allocatable :: points(:)

    ! A stop as stiff as the spring, reached at a tenth of the resonant amplitude F / (2 zeta).
    call follow(error, one_sided_oscillator(1.0_wp, 0.5_wp, 0.0_wp, 0.01_wp), &
                solver_options_type(harmonics=7), 0.1_wp, 0.8_wp, 1.6_wp, points)
    call check(error, turns(points) == 2, 'omega does not turn twice')
  end subroutine hardening

  subroutine softening(error)
    type(error_type), allocatable, intent(out) :: error
    type(point_type), allocatable :: points(:)

    call follow(error, one_sided_oscillator(1.0_wp, 0.0_wp, 0.5_wp, 0.01_wp), &
                solver_options_type(harmonics=7), 0.1_wp, 1.6_wp, 0.8_wp, points)
    call check(error, turns(points) == 2, 'omega does not turn twice')
  end subroutine softening

  subroutine undamped_wedge(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(point_type), allocatable :: points(:)
    integer :: i

    scene = wedge(45.0_wp)
    scene%structure%damping_kind = damping_none
    ! The stuck resonance, at 132.6 Hz, is infinite: nothing may be measured by it.
    call follow(error, scene, solver_options_type(), 5.0_wp, two_pi*140.0_wp, two_pi*125.0_wp, points)
    call check(error, count(points%unique) > 10, 'it hardly slips: the test is void')
    do i = 1, size(points)
      ! Around the resonance the motion is that of N of some 20 over k = 3e5, 1e-4: not nothing, not without bound.
      call check(error, norm2(points(i)%motion(2:, :)) > 1.0e-5_wp .and. norm2(points(i)%motion(2:, :)) < 1.0e-3_wp, &
                 'the amplitude is not one that friction holds')
    end do
  end subroutine undamped_wedge

  subroutine march(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: nobody
    integer :: iterations
    logical :: converged

    nobody%omega = 0.0_wp
    iterations = 0
    call follow_homotopy(small_steps_type(), nobody, iterations, converged)
    call check(error, converged, 'it does not arrive by small steps')
    call check_close(error, nobody%omega, 1.0_wp, 1.0e-9_wp, 'the end')
    nobody%omega = 0.0_wp
    call follow_homotopy(walled_type(), nobody, iterations, converged)
    call check(error, .not. converged, 'it claims to have passed a wall')
    call check_close(error, nobody%omega, 0.5_wp, 1.0e-12_wp, 'where it ends before the wall')
  end subroutine march

  !> The wedge at 132 Hz and 5 N, slipping: backtracked steps and full ones that keep springs.
  subroutine with_springs(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(unknowns_type) :: unknowns(2)
    type(newton_report_type) :: report
    real(wp), parameter :: stiffening(2) = [0.0_wp, 0.1_wp]
    integer :: i

    call press_wedge(solver, error)
    do i = 1, 2
      unknowns(i) = unknowns_type(solver%motion, solver%context%balance%slider, two_pi*132.0_wp)
      call solver%newton%solve(unknowns(i), at_frequency(solver), newton_controls_type(stiffening=stiffening(i)), report)
      call check(error, report%converged .and. report%iterations > 1, 'it does not converge')
      call check(error, solver%context%petsc_error == 0, 'PETSc refuses it')
    end do
    ! Each is within 1e-10 of the scale in its residual, which a well-conditioned balance of two coordinates enlarges little.
    call check_close(error, unknowns(2)%motion, unknowns(1)%motion, 1.0e-8_wp*solver%context%motion_scale, 'motion')
    call solver%destroy()
  end subroutine with_springs

  !> No number of iterations can be so small.
  subroutine refused(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(unknowns_type) :: unknowns
    type(newton_report_type) :: report

    call press_wedge(solver, error)
    unknowns = unknowns_type(solver%motion, solver%context%balance%slider, two_pi*132.0_wp)
    call solver%newton%solve(unknowns, at_frequency(solver), newton_controls_type(max_iterations=-100), report)
    call check(error, .not. report%converged .and. solver%context%petsc_error /= 0, 'nothing is reported')
    call solver%destroy()
  end subroutine refused

  !> The wedge under its preload, 5 N to come.
  subroutine press_wedge(solver, error)
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: fault

    solver = solver_of(wedge(45.0_wp), solver_options_type(harmonics=5, samples=128))
    call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, two_pi*132.0_wp, fault)
    call check(error, .not. allocated(fault), 'no static equilibrium')
    call solver%set_loads([1.0_wp], 5.0_wp)
    call solver%set_scales(two_pi*100.0_wp, two_pi*140.0_wp)
  end subroutine press_wedge

  function at_frequency(solver) result(constraint)
    type(solver_type), intent(in) :: solver
    type(constraint_type) :: constraint

    constraint%motion = 0.0_wp*solver%motion
    constraint%value = two_pi*132.0_wp
  end function at_frequency
end program test_branches
