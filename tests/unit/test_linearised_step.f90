!> The condensed bordered step against a dense solve with a differenced Jacobian, and Newton's quadratic convergence.
program test_linearised_step
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_model_structure, only: damping_viscous
  use attrito_balance_condensed_system, only: constraint_type, solve_linearised
  use attrito_balance_harmonic_balance, only: balance_type, new_balance
  use attrito_balance_receptance, only: receptance_type
  use attrito_balance_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use attrito_contact_state, only: state_stuck
  use scenes, only: scene_type, rubbing_frame, damp, noise
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: harmonics = 2, k = 2*harmonics + 1, rows = 10
  real(wp), parameter :: omega = 1.3_wp
  ! A difference over 1e-6 of residuals of order one: rounding 1e-10, curvature of two-tangent slip times the step squared below that;
  ! the condition of the system, some 1e2, is between this and the step.
  real(wp), parameter :: increment = 1.0e-6_wp, tolerance = 1.0e-7_wp

  call run_in_session('linearised step', [ &
                      test('the bordered step is that of a dense solve, contacts slipping and opening', lively), &
                      test('the bordered step is that of a dense solve, the mean frozen', frozen), &
                      test('with every contact stuck the step is the residual itself', all_stuck), &
                      test('a constraint on omega alone keeps omega', fixed_frequency), &
                      test('the residual''s derivative by omega is that of differences', by_omega)])

contains

  !> A balance evaluated at a random motion.
  subroutine prepare(preload, balance, motion)
    !> Added to every contact
    real(wp), intent(in) :: preload
    type(balance_type), intent(out) :: balance
    real(wp), intent(out) :: motion(k, rows)
    type(scene_type) :: scene
    type(stuck_system_type) :: stuck
    class(receptance_type), allocatable :: receptance
    type(error_type), allocatable :: fault
    integer :: status

    scene = rubbing_frame()
    scene%contacts%law%preload = scene%contacts%law%preload + preload
    call damp(scene, damping_viscous, 0.05_wp)
    call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
    call new_receptance(scene%structure, scene%contacts, stuck, harmonics, receptance)
    call new_balance(scene%structure, scene%contacts, receptance, only_me(), 64, 3, balance)
    motion = 0.7_wp*reshape(noise(k*rows, 11), [k, rows])
    call balance%evaluate(motion, omega, status)
  end subroutine prepare

  pure function random_constraint() result(constraint)
    type(constraint_type) :: constraint

    constraint%motion = reshape(noise(k*rows, 12), [k, rows])
    constraint%frequency = 0.8_wp
  end function random_constraint

  subroutine compare(error, balance, motion)
    type(error_type), allocatable, intent(inout) :: error
    type(balance_type), intent(inout) :: balance
    real(wp), intent(in) :: motion(k, rows)
    integer, parameter :: n = k*rows
    type(constraint_type) :: constraint
    real(wp) :: rho(k, rows), step(k, rows), sigma, step_omega, dense(n + 1, n + 1), solution(n + 1, 1)
    integer :: status

    constraint = random_constraint()
    rho = reshape(noise(n, 13), [k, rows])
    sigma = 0.4_wp
    call solve_linearised(balance, constraint, rho, sigma, step, step_omega, status)
    call check(error, status == 0, 'the condensed system is singular')
    call difference(balance, motion, dense(:n, :))
    dense(n + 1, :) = [constraint%motion, constraint%frequency]
    solution(:, 1) = [rho, sigma]
    call solve_dense(dense, solution, status)
    call check_close(error, [step, step_omega], solution(:, 1), tolerance*maxval(abs(solution)), 'step')
  end subroutine compare

  !> The residual's Jacobian by motion and, last, omega.
  subroutine difference(balance, motion, jacobian)
    type(balance_type), intent(inout) :: balance
    real(wp), intent(in) :: motion(k, rows)
    real(wp), intent(out) :: jacobian(:, :)
    real(wp) :: moved(k*rows + 1), sides(k*rows, 2), shift
    integer :: i, side, status

    do i = 1, k*rows + 1
      do side = 1, 2
        shift = (3 - 2*side)*increment
        moved = [motion, omega]
        moved(i) = moved(i) + shift
        call balance%evaluate(reshape(moved, [k, rows]), moved(k*rows + 1), status)
        sides(:, side) = reshape(balance%residual, [k*rows])
      end do
      jacobian(:, i) = (sides(:, 1) - sides(:, 2))/(2.0_wp*increment)
    end do
  end subroutine difference

  subroutine lively(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows)

    call prepare(0.0_wp, balance, motion)
    call check(error, count(balance%forces%slip > 0.1_wp) >= 2 .and. any(balance%forces%open > 0.1_wp) .and. &
               any(balance%forces%state == state_stuck), 'not all kinds of contact: the test is void')
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine lively

  subroutine frozen(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows)
    integer :: status

    call prepare(0.0_wp, balance, motion)
    balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
    call balance%evaluate(motion, omega, status)
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine frozen

  subroutine all_stuck(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(constraint_type) :: constraint
    real(wp) :: motion(k, rows), rho(k, rows), step(k, rows), step_omega
    integer :: status

    call prepare(100.0_wp, balance, motion)
    call check(error, all(balance%forces%state == state_stuck), 'a contact moves: the test is void')
    constraint = random_constraint()
    constraint%motion = 0.0_wp
    rho = reshape(noise(k*rows, 13), [k, rows])
    call solve_linearised(balance, constraint, rho, 0.0_wp, step, step_omega, status)
    call check_close(error, step, rho, 0.0_wp, 'step')
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine all_stuck

  subroutine fixed_frequency(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(constraint_type) :: constraint
    real(wp) :: motion(k, rows), step(k, rows), step_omega
    integer :: status

    call prepare(0.0_wp, balance, motion)
    constraint = random_constraint()
    constraint%motion = 0.0_wp
    call solve_linearised(balance, constraint, reshape(noise(k*rows, 13), [k, rows]), 0.0_wp, step, step_omega, status)
    call check_close(error, step_omega, 0.0_wp, 0.0_wp, 'step of omega')
    call balance%destroy()
  end subroutine fixed_frequency

  subroutine by_omega(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows), expected(k, rows), jacobian(k*rows, k*rows + 1)

    call prepare(0.0_wp, balance, motion)
    expected = balance%residual_omega
    call difference(balance, motion, jacobian)
    call check_close(error, expected, reshape(jacobian(:, k*rows + 1), [k, rows]), tolerance, 'derivative')
    call balance%destroy()
  end subroutine by_omega
end program test_linearised_step
