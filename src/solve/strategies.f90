!> A point by the fallback strategies (`attrito_solve_strategy_table`): they are tried in their order until one converges; each starts
!> where the point before was left.
!>
!> Newton's method is hardest at the onset of gross slip. Two findings end the search: mean friction forces cannot balance (rigid-body
!> drift) and a few starts by time integration find nothing else; or motion in time has not settled after all starts, where the point
!> before had no periodic motion either. The next point then begins with what was found here. A point that fails leaves the solver as
!> it was, with a report that says so. On a long series, before a short one is tried, only strategies of little cost are.
module attrito_solve_strategies
  use attrito_core_kinds, only: wp
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  use attrito_solve_strategy_table, only: search_type, strategy_type, strategies
  implicit none
  private
  public :: solve_by_strategies, solve_by_strategy

contains

  !> Solve at an angular frequency, with the present loads. Newton's method from the point before is given up early where other starts
  !> follow, and run to its end when these have failed.
  subroutine solve_by_strategies(solver, omega, at_little_cost)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Target
    real(wp), intent(in) :: omega
    !> Only by strategies of little cost, since something else is tried if they fail? If not given, by all
    logical, intent(in), optional :: at_little_cost
    type(strategy_type), allocatable :: table(:)
    type(snapshot_type) :: before, drifted
    type(search_type) :: search
    integer :: i
    logical :: is_stuck, of_little_cost

    of_little_cost = .false.
    if (present(at_little_cost)) of_little_cost = at_little_cost
    search%omega = omega
    search%previous = solver%evidence
    solver%evidence = evidence_type()
    call solver%solve_stuck_at(omega, is_stuck)
    if (is_stuck) return
    before = snapshot_of(solver)
    table = strategies()
    do i = 1, size(table)
      if (btest(solver%left_out, i) .or. (of_little_cost .and. .not. table(i)%costs_little)) cycle
      if (.not. is_tried(table(i), solver, search)) cycle
      call table(i)%solve(solver, search)
      if (search%outcome%converged) exit
      if (search%outcome%evidence%is_drifting .and. .not. allocated(drifted%motion)) drifted = snapshot_of(solver)
      call restore(solver, before)
      if (is_enough(table(i), search)) exit
    end do
    call take_outcome(solver, search%outcome)
    if (solver%evidence%is_drifting) then
      call restore(solver, drifted)
      call remove_drift(solver, before)
      solver%omega = omega
    end if
  end subroutine solve_by_strategies

  !> Solve at an angular frequency by one strategy alone, to compare strategies; if it fails the solver is left as it was.
  subroutine solve_by_strategy(solver, strategy, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Row of the table
    type(strategy_type), intent(in) :: strategy
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    type(snapshot_type) :: before
    type(search_type) :: search

    before = snapshot_of(solver)
    search%omega = omega
    if (is_possible(strategy, solver)) call strategy%solve(solver, search)
    if (.not. search%outcome%converged) call restore(solver, before)
    call take_outcome(solver, search%outcome)
  end subroutine solve_by_strategy

  !> Is everything there that a strategy needs?
  pure logical function is_possible(strategy, solver)
    !> Row of the table
    type(strategy_type), intent(in) :: strategy
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    is_possible = .true.
    if (associated(strategy%is_possible)) is_possible = strategy%is_possible(solver)
  end function is_possible

  !> Is a strategy possible, and worth its cost at its place in the order?
  pure logical function is_tried(strategy, solver, search)
    !> Row of the table
    type(strategy_type), intent(in) :: strategy
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(in) :: search

    is_tried = is_possible(strategy, solver)
    if (is_tried .and. associated(strategy%is_worth_while)) is_tried = strategy%is_worth_while(solver, search)
  end function is_tried

  !> Has a strategy that failed shown that there is nothing to find? Fewer are needed where the point before had no orbit either.
  pure logical function is_enough(strategy, search)
    !> Row of the table
    type(strategy_type), intent(in) :: strategy
    !> What is looked for, and what was found so far
    type(search_type), intent(in) :: search

    associate (before => search%previous, now => search%outcome%evidence)
      is_enough = now%is_drifting .and. (before%is_drifting .or. strategy%drift_ends)
      is_enough = is_enough .or. (before%no_periodic_solution .and. now%no_periodic_solution .and. strategy%no_orbit_ends)
    end associate
  end function is_enough

  !> Hand the solver what was found of a point: the report of how it ended, and what the next point needs of it.
  pure subroutine take_outcome(solver, outcome)
    !> Solver of points
    type(solver_type), intent(inout) :: solver
    !> Of the strategies that were tried
    type(strategy_outcome_type), intent(in) :: outcome

    solver%evidence = evidence_type()
    if (.not. outcome%converged) then
      solver%evidence%is_drifting = outcome%evidence%is_drifting
      solver%evidence%no_periodic_solution = outcome%evidence%is_drifting .or. outcome%evidence%no_periodic_solution
    end if
    ! The last step of a homotopy that was given up may have converged, at another parameter.
    solver%report%converged = outcome%converged
    solver%report%iterations = outcome%iterations
  end subroutine take_outcome

  !> Put a body that drifts back to its position before: drift is the same at any position, and rounding grows with the distance.
  subroutine remove_drift(solver, before)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    real(wp), allocatable :: slider(:, :)

    slider = solver%context%balance%slider
    call solver%context%balance%remove_drift(before%motion(1, :), solver%motion(1, :), slider)
    ! Sliders that are unknowns stay unknowns.
    solver%context%balance%slider = slider
    call solver%context%forget()
  end subroutine remove_drift
end module attrito_solve_strategies
