!> A body that friction alone holds: is it held, or does it drift? Springs on its mean position are relaxed, solve by solve
!> (`attrito_solve_mean_springs`), until contacts hold the body without them, or the springs carry the same force every time.
!>
!> If few contacts hold, a step leaves 1 / (1 + s) of the way, s their stiffness by that of the springs, and eight steps may leave
!> all but a tenth of it. After three steps the springs therefore soften tenfold with each, as long as Newton's method converges.
module attrito_solve_mean_regularisation
  use attrito_core_kinds, only: wp
  use attrito_solve_sliders, only: none_holds
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: strategy_outcome_type
  use attrito_solve_mean_springs, only: apply_springs, remove_springs
  use attrito_solve_rigid_drift, only: repeated_means_type, alike_in_mean
  implicit none
  private
  public :: can_regularise, find_drift

  !> Steps at most; those with springs as stiff as the first, by which a drift shows at once
  integer, parameter :: most_steps = 10, steps_alike = 3 ! guess
  !> Factor on their stiffness after each step from then on, since steps creep where contacts hardly hold
  real(wp), parameter :: softer = 0.1_wp ! guess

contains

  !> Is the mean an unknown?
  pure logical function can_regularise(solver)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    can_regularise = .not. solver%options%uncoupled
  end function can_regularise

  !> One solve with springs between the body and its present mean position.
  subroutine solve_with_springs(solver, omega, early_stop, softening)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Give up after a few iterations of Newton's method?
    logical, intent(in) :: early_stop
    !> Factor on the springs' stiffness
    real(wp), intent(in) :: softening
    logical :: has_springs

    solver%report%converged = .false.
    call apply_springs(solver%context, solver%motion, solver%omega, has_springs, softening)
    if (.not. has_springs) return
    call solver%solve_at(omega, early_stop)
    call remove_springs(solver%context)
  end subroutine solve_with_springs

  !> From the present point relax the springs step by step: to a solution without springs; or to one with them where the body drifts,
  !> whose force each step repeats without a contact that holds; or to neither.
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
    real(wp) :: softening
    logical :: gets_softer
    integer :: i

    outcome%converged = .false.
    softening = 1.0_wp
    gets_softer = .true.
    do i = 1, most_steps
      call solve_with_springs(solver, omega, early_stop, softening)
      outcome%iterations = outcome%iterations + solver%report%iterations
      if (.not. solver%report%converged) then
        if (.not. gets_softer .or. softening >= 1.0_wp) return
        gets_softer = .false.
        softening = softening/softer
        cycle
      end if
      call means%add(real(solver%context%balance%response(:, 0), wp), softening)
      if (gets_softer .and. i >= steps_alike) softening = softer*softening
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
