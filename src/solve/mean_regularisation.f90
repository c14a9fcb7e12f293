!> A body that friction alone holds: is it held, or does it drift? Springs on its mean position are relaxed, solve by solve
!> (`attrito_solve_mean_springs`), until contacts hold the body without them, or the mean takes the same step every time.
module attrito_solve_mean_regularisation
  use attrito_core_kinds, only: wp
  use attrito_solve_sliders, only: none_holds
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: strategy_outcome_type
  use attrito_solve_mean_springs, only: apply_springs, remove_springs
  use attrito_solve_rigid_drift, only: repeated_means_type, alike_in_mean
  implicit none
  private
  public :: can_regularise, solve_with_springs, find_drift

  !> Steps at most
  integer, parameter :: most_steps = 8 ! guess

contains

  !> Is the mean an unknown?
  pure logical function can_regularise(solver)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    can_regularise = .not. solver%options%uncoupled
  end function can_regularise

  !> One solve with springs between the body and its present mean position.
  subroutine solve_with_springs(solver, omega, early_stop)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Give up after a few iterations of Newton's method; if not given, do not
    logical, intent(in), optional :: early_stop
    logical :: has_springs

    solver%report%converged = .false.
    call apply_springs(solver%context, solver%motion, solver%omega, has_springs)
    if (.not. has_springs) return
    call solver%solve_at(omega, early_stop)
    call remove_springs(solver%context)
  end subroutine solve_with_springs

  !> From the present point relax the springs step by step: to a solution without springs; or to one with them where the body drifts,
  !> which each step repeats without a contact that holds; or to neither.
  subroutine find_drift(solver, omega, early_stop, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Give each solve with springs up after a few iterations of Newton's method?
    logical, intent(in) :: early_stop
    !> Counts iterations on; converged: to a solution without springs
    type(strategy_outcome_type), intent(inout) :: outcome
    type(repeated_means_type) :: means
    integer :: i

    outcome%converged = .false.
    do i = 1, most_steps
      call solve_with_springs(solver, omega, early_stop)
      outcome%iterations = outcome%iterations + solver%report%iterations
      if (.not. solver%report%converged) return
      call means%add(real(solver%context%balance%response(:, 0), wp))
      if (none_holds(solver%context%balance)) then
        if (.not. means%do_repeat(alike_in_mean)) cycle
        outcome%evidence%is_drifting = solver%context%balance%free%leaves_motion
        if (outcome%evidence%is_drifting) return
      end if
      call solve_free(solver, omega, outcome)
      if (outcome%converged) return
    end do
    call solve_free(solver, omega, outcome)
  end subroutine find_drift

  !> Newton's method without springs, for as long as it makes progress; nothing changes if it fails.
  subroutine solve_free(solver, omega, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Counts iterations on
    type(strategy_outcome_type), intent(inout) :: outcome

    call solver%solve_at(omega, early_stop=.true.)
    outcome%iterations = outcome%iterations + solver%report%iterations
    outcome%converged = solver%report%converged
  end subroutine solve_free
end module attrito_solve_mean_regularisation
