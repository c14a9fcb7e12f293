!> A body that friction alone holds, with springs that hold its mean: is it held without them, or does it walk?
!>
!> $$ r(d, \omega) = \frac{\epsilon}{1 + \epsilon} B (\hat q_0 - q_0), \qquad \hat q_0 \leftarrow q_0 $$
!>
!> Where every contact slips or opens in every period nothing tells where the body is: residuals do not change as it is moved, the
!> Jacobian is singular, and as many equations as there are free directions are left, mean forces of friction that must balance. In
!> general they do not, and no orbit of the excitation's period is near. Springs on the mean position alone, a part epsilon of the
!> stuck system's stiffness, make the system regular. They give way: each solve begins where the one before left the body (a proximal
!> point method). Where contacts hold, such steps end at a solution without springs. Where nothing does, each step is the last one
!> over again: springs have to lend the same force wherever the body is, and without them it walks.
!> Source: Rockafellar 1976, doi:10.1137/0314056 (proximal points).
module attrito_continuation_held_mean
  use attrito_core_kinds, only: wp
  use attrito_continuation_attempts, only: nothing_holds, holding_stiffness
  use attrito_continuation_solver, only: solver_type
  implicit none
  private
  public :: can_hold, solve_held, let_walk, held_solved, held_walks, held_failed

  !> How it ended: at a solution without springs; each step like the last one, without any contact that holds; neither
  integer, parameter :: held_solved = 0, held_walks = 1, held_failed = 2

  !> Steps at most, and how much alike they are in the end: rounding and the tolerance leave some 1e-6 of those seen
  integer, parameter :: most_steps = 8
  real(wp), parameter :: alike = 1.0e-3_wp
  !> Steps relative to the mean that are none
  real(wp), parameter :: rounding = 1.0e-12_wp

contains

  !> Is there a mean to hold?
  pure logical function can_hold(solver)
    type(solver_type), intent(in) :: solver

    can_hold = .not. solver%options%uncoupled
  end function can_hold

  !> One solve with springs to where the mean is now.
  subroutine solve_held(solver, omega)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    integer :: status

    associate (balance => solver%context%balance)
      call balance%evaluate(solver%motion, solver%omega, status)
      solver%report%converged = .false.
      if (status /= 0) return
      call balance%hold_mean(holding_stiffness)
      call solver%context%forget()
      call solver%solve_at(omega)
      call balance%let_go()
      call solver%context%forget()
    end associate
  end subroutine solve_held

  !> From where the solver stands let the springs give way, step by step.
  subroutine let_walk(solver, omega, iterations, outcome)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    !> One of `held_...`; the solver stands at a solution without springs, at one with them, or where it has come to
    integer, intent(out) :: outcome
    complex(wp), allocatable :: place(:), step(:), before(:)
    logical :: repeats
    integer :: i

    outcome = held_failed
    do i = 1, most_steps
      call solve_held(solver, omega)
      iterations = iterations + solver%report%iterations
      if (.not. solver%report%converged) return
      associate (mean => solver%context%balance%response(:, 0))
        if (allocated(place)) step = mean - place
        place = mean
      end associate
      if (nothing_holds(solver%context%balance)) then
        repeats = allocated(before)
        if (repeats) repeats = norm2(abs(step - before)) <= alike*norm2(abs(step)) .and. &
                               norm2(abs(step)) > rounding*norm2(abs(place))
        if (repeats) outcome = held_walks
      else
        call solve_free(solver, omega, iterations)
        if (solver%report%converged) outcome = held_solved
      end if
      if (outcome /= held_failed) return
      if (allocated(step)) before = step
    end do
    call solve_free(solver, omega, iterations)
    if (solver%report%converged) outcome = held_solved
  end subroutine let_walk

  !> Newton's method without springs, for as long as it makes progress; nothing changes if it fails.
  subroutine solve_free(solver, omega, iterations)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations

    solver%brief = .true.
    call solver%solve_at(omega)
    solver%brief = .false.
    iterations = iterations + solver%report%iterations
  end subroutine solve_free
end module attrito_continuation_held_mean
