!> Fallback strategies for a point, tried in this order until one converges; each starts where the point before was left.
!>
!> | strategy | start and path of Newton's method |
!> |---|---|
!> | `newton_early_stop` | the point before, given up early where others follow |
!> | `mean_regularisation` | the same with springs on the mean, relaxed; after a drift, or without time integration |
!> | `time_integration` | means of periods integrated in time |
!> | `regularised_level_homotopy` | the static solution, the level of the loads in steps, with springs on the mean |
!> | `newton` | the point before, to the end |
!> | `stuck_response` | the linear response with every contact stuck |
!> | `frequency_homotopy` | the point before, the frequency in steps |
!> | `level_homotopy` | the static solution, the level of the loads in steps |
!> | `stiffness_homotopy` | contacts that are soft at first, their stiffness in steps |
!>
!> Newton's method is hardest at the onset of gross slip. Two findings end the search: mean friction forces cannot balance (rigid-body
!> drift) and a few starts by time integration find nothing else; or motion in time has not settled after all starts. The next point
!> then begins with what was found here. A point that fails leaves the solver as it was, with a report that says so.
module attrito_solve_strategies
  use attrito_core_kinds, only: wp
  use attrito_balance_stuck_response, only: linear_motion
  use attrito_solve_mean_regularisation, only: can_regularise, find_drift
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_stiffness_homotopy, only: can_soften, solve_by_stiffness
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: strategy_outcome_type
  use attrito_solve_time_integration_start, only: has_time_integrator, solve_from_time_integration
  use attrito_solve_homotopy, only: follow_homotopy, frequency_homotopy_type, level_homotopy_type
  implicit none
  private
  public :: solve_by_strategies, solve_by_strategy, strategy_names

  ! The strategies, in their order
  integer, parameter :: newton_early_stop = 1, mean_regularisation = 2, time_integration = 3, regularised_level_homotopy = 4, &
                        newton = 5, stuck_response = 6, frequency_homotopy = 7, level_homotopy = 8, stiffness_homotopy = 9
  character(*), parameter :: strategy_names(9) = [character(26) :: 'newton_early_stop', 'mean_regularisation', 'time_integration', &
                                                  'regularised_level_homotopy', 'newton', 'stuck_response', 'frequency_homotopy', &
                                                  'level_homotopy', 'stiffness_homotopy']

  !> Iterations after which a homotopy is given up, and one with springs on the mean
  integer, parameter :: homotopy_iterations = 200, regularised_iterations = 60 ! guess

contains

  !> Solve at an angular frequency, with the present loads. Newton's method from the point before is given up early where other starts
  !> follow, and run to its end when these have failed.
  subroutine solve_by_strategies(solver, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Target
    real(wp), intent(in) :: omega
    type(snapshot_type) :: before, drifted
    type(strategy_outcome_type) :: previous, outcome
    integer :: strategy
    logical :: is_stuck

    previous%is_drifting = solver%is_drifting
    previous%no_periodic_solution = solver%no_periodic_solution
    solver%is_drifting = .false.
    solver%no_periodic_solution = .false.
    call solver%solve_stuck_at(omega, is_stuck)
    if (is_stuck) return
    before = snapshot_of(solver)
    do strategy = 1, size(strategy_names)
      if (.not. (is_possible(solver, strategy) .and. is_worth_while(solver, strategy, previous))) cycle
      call try(solver, strategy, omega, before, previous, outcome)
      if (outcome%converged) exit
      ! The drift that was followed has ended: solutions beyond are looked for as at a first point.
      if (strategy == mean_regularisation .and. .not. outcome%is_drifting) previous%no_periodic_solution = .false.
      if (outcome%is_drifting .and. .not. allocated(drifted%motion)) drifted = snapshot_of(solver)
      call restore(solver, before)
      if (is_enough(strategy, previous, outcome)) exit
    end do
    call take_outcome(solver, outcome)
    if (solver%is_drifting) then
      call restore(solver, drifted)
      call remove_drift(solver, before)
      solver%omega = omega
    end if
  end subroutine solve_by_strategies

  !> Hand the solver what was found of a point: the report of how it ended, and what the next point needs of it.
  pure subroutine take_outcome(solver, outcome)
    !> Solver of points
    type(solver_type), intent(inout) :: solver
    !> Of the strategies that were tried
    type(strategy_outcome_type), intent(in) :: outcome

    solver%is_drifting = outcome%is_drifting .and. .not. outcome%converged
    solver%no_periodic_solution = solver%is_drifting .or. (outcome%no_periodic_solution .and. .not. outcome%converged)
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

  !> Is everything there that a strategy needs, and does no comparison leave it out?
  pure logical function is_possible(solver, strategy)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Strategy, see `strategy_names`
    integer, intent(in) :: strategy

    select case (strategy)
     case (mean_regularisation, regularised_level_homotopy)
      is_possible = can_regularise(solver)
     case (time_integration)
      is_possible = has_time_integrator(solver)
     case (stiffness_homotopy)
      is_possible = can_soften(solver)
     case default
      is_possible = .true.
    end select
    is_possible = is_possible .and. .not. btest(solver%left_out, strategy)
  end function is_possible

  !> Is a strategy worth its cost at its place in the order?
  pure logical function is_worth_while(solver, strategy, previous)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Strategy, see `strategy_names`
    integer, intent(in) :: strategy
    !> Of the point before: where the body drifted, that is no solution
    type(strategy_outcome_type), intent(in) :: previous

    select case (strategy)
     case (newton_early_stop)
      is_worth_while = .not. previous%is_drifting .and. (has_time_integrator(solver) .or. can_regularise(solver))
     case (mean_regularisation)
      ! Time integration finds drift by itself, and where a body is held it is faster.
      is_worth_while = previous%is_drifting .or. .not. has_time_integrator(solver)
     case default
      is_worth_while = .true.
    end select
  end function is_worth_while

  !> Has a strategy that failed shown that there is nothing to find? Fewer are needed where the point before had no orbit either.
  pure logical function is_enough(strategy, previous, outcome)
    !> Strategy, see `strategy_names`
    integer, intent(in) :: strategy
    !> Of the point before, and of this one so far
    type(strategy_outcome_type), intent(in) :: previous, outcome

    is_enough = outcome%is_drifting .and. (previous%is_drifting .or. strategy >= time_integration)
    if (previous%no_periodic_solution .and. outcome%no_periodic_solution) is_enough = is_enough .or. strategy == time_integration
  end function is_enough

  !> Solve at an angular frequency by one strategy alone, to compare strategies; if it fails the solver is left as it was.
  subroutine solve_by_strategy(solver, strategy, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Place among `strategy_names`, from 1
    integer, intent(in) :: strategy
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    type(snapshot_type) :: before
    type(strategy_outcome_type) :: outcome

    before = snapshot_of(solver)
    if (is_possible(solver, strategy)) call try(solver, strategy, omega, before, strategy_outcome_type(), outcome)
    if (.not. outcome%converged) call restore(solver, before)
    call take_outcome(solver, outcome)
  end subroutine solve_by_strategy

  !> One strategy from the solver's present point. Where the body drifts the solver is left at the drifting motion.
  subroutine try(solver, strategy, omega, before, previous, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Strategy, see `strategy_names`
    integer, intent(in) :: strategy
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    !> Of the point before
    type(strategy_outcome_type), intent(in) :: previous
    !> Of this point so far, and with this strategy
    type(strategy_outcome_type), intent(inout) :: outcome

    select case (strategy)
     case (newton_early_stop)
      call solve_here(solver, omega, .true., outcome)
     case (mean_regularisation)
      call find_drift(solver, omega, .false., outcome)
     case (regularised_level_homotopy)
      call march_level(solver, omega, .true., regularised_iterations, outcome)
      if (outcome%converged) call find_drift(solver, omega, .false., outcome)
     case (time_integration)
      call solve_from_time_integration(solver, omega, previous, outcome)
     case (newton)
      call solve_here(solver, omega, .false., outcome)
     case (stuck_response)
      call solve_from_stuck(solver, omega, outcome)
     case (frequency_homotopy)
      call follow_homotopy(frequency_homotopy_type(before%omega, omega), solver, outcome%iterations, outcome%converged, &
                           most_iterations=homotopy_iterations)
     case (stiffness_homotopy)
      call solve_by_stiffness(solver, omega, outcome%iterations, outcome%converged)
     case default  ! level_homotopy
      call march_level(solver, omega, .false., homotopy_iterations, outcome)
    end select
  end subroutine try

  !> From the present motion.
  subroutine solve_here(solver, omega, early_stop, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Give up after a few iterations of Newton's method?
    logical, intent(in) :: early_stop
    !> Counts iterations on
    type(strategy_outcome_type), intent(inout) :: outcome

    call solver%solve_at(omega, early_stop)
    outcome%iterations = outcome%iterations + solver%report%iterations
    outcome%converged = solver%report%converged
  end subroutine solve_here

  !> From the static solution by steps in force.
  subroutine march_level(solver, omega, with_springs, most_iterations, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> With springs on the mean?
    logical, intent(in) :: with_springs
    !> Most iterations
    integer, intent(in) :: most_iterations
    !> Counts iterations on
    type(strategy_outcome_type), intent(inout) :: outcome
    real(wp) :: level

    level = solver%context%balance%level
    solver%motion(2:, :) = 0.0_wp
    call follow_homotopy(level_homotopy_type(omega, level, with_springs), solver, outcome%iterations, outcome%converged, &
                         most_iterations=most_iterations)
    call solver%set_loads(solver%context%balance%static_factors, level)
  end subroutine march_level

  !> From the response with every contact stuck.
  subroutine solve_from_stuck(solver, omega, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Counts iterations on
    type(strategy_outcome_type), intent(inout) :: outcome
    integer :: status

    call solver%context%balance%receptance%set_frequency(omega, status)
    outcome%converged = .false.
    if (status /= 0) return
    solver%motion = linear_motion(solver%context%balance)
    call solve_here(solver, omega, .false., outcome)
  end subroutine solve_from_stuck
end module attrito_solve_strategies
