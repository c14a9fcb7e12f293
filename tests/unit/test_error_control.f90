!> The estimated error of a point, where it can be estimated and where it cannot.
program test_error_control
  use attrito_accuracy_error_control, only: error_control_type
  use attrito_accuracy_finer_balance, only: finer_balance_type, finer_point_type
  use attrito_accuracy_second_step, only: second_step_type, step_again
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use scenes, only: scene_type, wedge
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  call run_in_session('error_control', [ &
                      test('the estimate is what three times the harmonics change', finer), &
                      test('a second step comes nearer to the finer balance than the first', second_step), &
                      test('further answers settle on the same motion, contacts stuck or as in the mean', settled), &
                      test('where the linearised step is singular no error is given, and the point stays', singular), &
                      test('a solve that has no operations left does not iterate', spent)])

contains

  !> The wedge in three harmonics, in full slip and lifting off: held against nine.
  subroutine finer(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(error_control_type) :: control
    type(finer_point_type) :: point
    real(wp) :: amplitude(2)
    integer :: i

    do i = 1, 2
      call solve_wedge(merge(3, 9, i == 1), solver, error)
      if (allocated(error)) return
      amplitude(i) = norm2(solver%motion(2:3, 1))
      if (i == 1) call control%estimate(solver, solver%report%converged, point)
      call solver%destroy()
    end do
    call check(error, control%errors%are_known(), 'no error is given')
    if (allocated(error)) return
    call check(error, abs(norm2(point%motion(2:3, 1))/amplitude(1) - 1.0_wp) > 1.0e-5_wp, 'three harmonics do: the test is void')
    ! To first order: what is left is the square of the change.
    call check_close(error, norm2(point%motion(2:3, 1)), amplitude(2), 0.5_wp*abs(amplitude(2) - amplitude(1)), 'amplitude')
    call control%destroy()
  end subroutine finer

  !> The wedge in one harmonic: held against three, as far as both steps look.
  subroutine second_step(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(finer_balance_type) :: finer
    type(finer_point_type) :: first
    type(second_step_type) :: second
    real(wp) :: truth, before, once, twice
    integer :: status

    call solve_wedge(3, solver, error)
    if (allocated(error)) return
    solver%context%balance%monitors = solver%context%balance%contact_rows%part([1])
    truth = norm2(solver%motion(2:3, 1))
    call solver%destroy()
    call solve_wedge(1, solver, error)
    if (allocated(error)) return
    solver%context%balance%monitors = solver%context%balance%contact_rows%part([1])
    before = norm2(solver%motion(2:3, 1))
    call finer%set(3, solver%context%balance%quadrature)
    call finer%correct(solver, first, status)
    call step_again(finer, solver, first, 1.0e-3_wp, 0, second)
    call check(error, status == 0 .and. allocated(second%monitors), 'a step is singular')
    if (allocated(error)) return
    once = norm2(first%monitors(2:3, 1))
    twice = norm2(second%monitors(2:3, 1))
    call check(error, abs(once - truth) > 1.0e-3_wp*truth .and. abs(once - truth) < abs(before - truth), 'the test is void')
    call check(error, abs(twice - truth) < 0.5_wp*abs(once - truth), 'the second step does not come nearer')
    call finer%destroy()
    call solver%destroy()
  end subroutine second_step

  !> The wedge in one harmonic: answers beyond are those to the forces that the motion makes, whatever they are iterated with.
  subroutine settled(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(finer_balance_type) :: finer
    type(finer_point_type) :: first
    type(second_step_type) :: second(0:2)
    logical :: is_new
    integer :: i, status

    call solve_wedge(1, solver, error)
    if (allocated(error)) return
    solver%context%balance%monitors = solver%context%balance%contact_rows%part([1, 2])
    call finer%set(7, solver%context%balance%quadrature)
    call finer%correct(solver, first, status)
    call step_again(finer, solver, first, 0.0_wp, 0, second(0))
    call step_again(finer, solver, first, 0.0_wp, 30, second(1))
    call solver%context%preconditioner%mean%take(solver%context%balance, 0.0_wp, is_new)
    call check(error, is_new, 'no contact is open or slips: the test is void')
    if (allocated(error)) return
    call step_again(finer, solver, first, 0.0_wp, 30, second(2))
    associate (scale => norm2(second(1)%monitors(4:, :)))
      call check(error, norm2(second(0)%monitors(4:, :) - second(1)%monitors(4:, :)) > 1.0e-3_wp*scale, 'two answers do: void')
      call check_close(error, norm2(second(2)%monitors(4:, :) - second(1)%monitors(4:, :)), 0.0_wp, 1.0e-6_wp*scale, 'motion')
    end associate
    do i = 0, 2
      call check(error, allocated(second(i)%monitors), 'a step is singular')
    end do
    call solver%context%preconditioner%mean%take(solver%context%balance, 0.0_wp, is_new)
    call check(error, .not. is_new, 'the same contacts are taken twice')
    call finer%destroy()
    call solver%destroy()
  end subroutine settled

  !> An equation that picks no point, 0 . d + 0 omega = 0, leaves the bordered system with a row of zeros.
  subroutine singular(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(error_control_type) :: control
    type(finer_point_type) :: point
    real(wp), allocatable :: motion(:, :)

    call solve_wedge(3, solver, error)
    if (allocated(error)) return
    motion = solver%motion
    solver%context%constraint%motion = 0.0_wp*solver%motion
    solver%context%constraint%frequency = 0.0_wp
    call control%estimate(solver, solver%report%converged, point)
    call check(error, .not. control%errors%are_known(), 'an error is given')
    call check(error, .not. allocated(point%monitors), 'monitors of a finer balance are given')
    call check(error, all(abs(solver%motion - motion) <= 0.0_wp) .and. solver%report%converged, 'the point does not stay')
    call control%destroy()
    call solver%destroy()
  end subroutine singular

  !> Whatever strategies would follow: each of their iterations on a long series may take as much as the points of a branch.
  subroutine spent(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp), allocatable :: motion(:, :)

    call solve_wedge(3, solver, error)
    if (allocated(error)) return
    motion = solver%motion
    solver%context%most_work = 0.5_wp*solver%context%balance%work
    call solver%solve_at(1.02_wp*solver%omega)
    call check(error, .not. solver%report%converged .and. solver%report%iterations == 0, 'a point is solved')
    call check(error, all(abs(solver%motion - motion) <= 0.0_wp), 'the point does not stay')
    call solver%destroy()
  end subroutine spent

  !> At 132 Hz and 14 N along the contact.
  subroutine solve_wedge(harmonics, solver, error)
    integer, intent(in) :: harmonics
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: fault
    type(scene_type) :: scene

    scene = wedge(45.0_wp)
    call new_solver(scene%structure, scene%contacts, only_me(), solver_options_type(harmonics=harmonics), solver, &
                    fault)
    if (.not. allocated(fault)) call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, two_pi*132.0_wp, fault)
    call check(error, .not. allocated(fault), 'no static equilibrium')
    if (allocated(error)) return
    call solver%set_loads([1.0_wp], 14.0_wp)
    call solver%set_scales(two_pi*85.0_wp, two_pi*140.0_wp)
    call solve_by_strategies(solver, two_pi*132.0_wp)
    call check(error, solver%report%converged, 'the balance does not converge')
  end subroutine solve_wedge
end program test_error_control
