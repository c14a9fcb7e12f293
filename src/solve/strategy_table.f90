!> The fallback strategies for a point, in their order, as one table: what each does, where it is worth its cost, and what it needs.
!> The rows are what `attrito_solve_strategies` tries; docs/explanation/strategies.md shows their words.
module attrito_solve_strategy_table
  use attrito_core_kinds, only: wp
  use attrito_balance_stuck_response, only: linear_motion
  use attrito_solve_homotopy, only: follow_homotopy, frequency_homotopy_type, level_homotopy_type
  use attrito_solve_mean_regularisation, only: can_regularise, find_drift
  use attrito_solve_period_march, only: can_march, solve_by_periods
  use attrito_solve_solver, only: solver_type
  use attrito_solve_stiffness_homotopy, only: can_soften, solve_by_stiffness
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  use attrito_solve_time_integration_start, only: has_time_integrator, solve_from_time_integration
  implicit none
  private
  public :: search_type, strategy_type, strategies

  !> Iterations after which a homotopy is given up
  integer, parameter :: homotopy_iterations = 200 ! guess

  !> The search for a point
  type :: search_type
    !> Target, rad/s
    real(wp) :: omega = 0.0_wp
    !> Of the point before
    type(evidence_type) :: previous
    !> Of all strategies so far
    type(strategy_outcome_type) :: outcome
  end type search_type

  type :: strategy_type
    !> Its name in files and messages
    character(26) :: name = ''
    !> Start and path of Newton's method; where it is tried; what it costs at most
    character(112) :: path = '', condition = '', cost = ''
    !> If it fails: is a drift that was found up to then the last word, and is motion in time without a periodic solution?
    logical :: drift_ends = .true., no_orbit_ends = .false.
    !> Does it cost so little that it is tried where something else follows: on a long series, where all are tried on a short one
    !> then, and for branches beyond one that was lost?
    logical :: costs_little = .false.
    !> Is everything there that it needs? Not associated: it needs nothing
    procedure(is_possible_at), pointer, nopass :: is_possible => null()
    !> Is it worth its cost at its place in the order? Not associated: always
    procedure(is_worth_while_after), pointer, nopass :: is_worth_while => null()
    !> Solve by it
    procedure(solve_by_one), pointer, nopass :: solve => null()
  end type strategy_type

  abstract interface
    pure logical function is_possible_at(solver)
      import :: solver_type
      !> Solver of points: its motion, sliders, angular frequency and balance
      type(solver_type), intent(in) :: solver
    end function is_possible_at

    pure logical function is_worth_while_after(solver, search)
      import :: solver_type, search_type
      !> Solver of points: its motion, sliders, angular frequency and balance
      type(solver_type), intent(in) :: solver
      !> Of the point before, where the body may have drifted: that is no solution; and of this one so far
      type(search_type), intent(in) :: search
    end function is_worth_while_after

    !> From the solver's present point. Where it fails the solver is left anywhere; where the body drifts, at the drifting motion.
    subroutine solve_by_one(solver, search)
      import :: solver_type, search_type
      !> Solver of points, which this moves
      type(solver_type), intent(inout) :: solver
      !> What is looked for, and what was found so far
      type(search_type), intent(inout) :: search
    end subroutine solve_by_one
  end interface

contains

  !> The strategies, in their order.
  function strategies() result(table)
    type(strategy_type) :: table(9)

    table = [ &
            strategy_type('newton_early_stop', &
                          path='the point before; given up after eight iterations that gain less than a hundredfold', &
                          condition='unless the body drifted at the point before', &
                          cost='30 iterations', &
                          drift_ends=.false., costs_little=.true., is_worth_while=another_follows, solve=solve_early_stop), &
            strategy_type('mean_regularisation', &
                          path='the point before, with springs on the mean that are relaxed', &
                          condition='coupled; after a drift, or where there is no time integration', &
                          cost='ten solves with springs, eleven without', &
                          drift_ends=.false., costs_little=.true., is_possible=can_regularise, &
                          is_worth_while=drift_is_likely, solve=relax_springs), &
            strategy_type('time_integration', &
                          path='means of periods integrated in time; every third start with springs on the mean', &
                          condition='coupled; up to 400 rows of contacts; no parallel elements', &
                          cost='16 windows of 10 to 25 periods, a solve from each', &
                          no_orbit_ends=.true., is_possible=has_time_integrator, solve=solve_from_means_in_time), &
            strategy_type('period_march', &
                          path='the point before; periods one by one, each from where the last has left sliders and mean', &
                          condition='coupled; all contacts with two tangents; no drift found, no time integration', &
                          cost='64 periods, a solve of each', &
                          is_possible=can_march, is_worth_while=marches_alone, solve=solve_by_march), &
            strategy_type('newton', &
                          path='the point before; to the end', &
                          condition='always', &
                          cost='30 iterations; as many with springs on the mean, and with stiffened steps', &
                          solve=solve_here), &
            strategy_type('stuck_response', &
                          path='the linear response with every contact stuck', &
                          condition='always', &
                          cost='as `newton`', &
                          solve=solve_from_stuck), &
            strategy_type('frequency_homotopy', &
                          path='the point before; the frequency in steps', &
                          condition='always', &
                          cost='some 200 iterations', &
                          solve=solve_by_frequency), &
            strategy_type('level_homotopy', &
                          path='the static solution; the level of the loads in steps', &
                          condition='always', &
                          cost='some 200 iterations', &
                          solve=solve_by_level), &
            strategy_type('stiffness_homotopy', &
                          path='contacts a hundred or 10^4 times softer, then stiffer by half decades', &
                          condition='coupled; up to 300 coordinates', &
                          cost='200 iterations from each of six starts; each stiffness has its own stuck system', &
                          is_possible=can_soften, solve=solve_by_softer_contacts)]
  end function strategies

  !> Is there a strategy for which this one is given up early? From a motion that drifts it leads nowhere.
  pure logical function another_follows(solver, search)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(in) :: search

    another_follows = .not. search%previous%is_drifting .and. (has_time_integrator(solver) .or. can_regularise(solver))
  end function another_follows

  !> Time integration finds drift by itself, and where a body is held it is faster.
  pure logical function drift_is_likely(solver, search)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(in) :: search

    drift_is_likely = search%previous%is_drifting .or. .not. has_time_integrator(solver)
  end function drift_is_likely

  subroutine solve_early_stop(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call solver%solve_at(search%omega, early_stop=.true.)
    call count_on(solver, search%outcome)
  end subroutine solve_early_stop

  subroutine solve_here(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call solver%solve_at(search%omega)
    call count_on(solver, search%outcome)
  end subroutine solve_here

  subroutine relax_springs(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call find_drift(solver, search%omega, .false., search%outcome)
    ! The drift that was followed has ended: solutions beyond are looked for as at a first point.
    if (.not. search%outcome%evidence%is_drifting) search%previous%no_periodic_solution = .false.
  end subroutine relax_springs

  subroutine solve_from_means_in_time(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call solve_from_time_integration(solver, search%omega, search%previous, search%outcome)
  end subroutine solve_from_means_in_time

  !> Time integration shows a drift, too, for all contacts; and one that is known needs no periods.
  pure logical function marches_alone(solver, search)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(in) :: search

    marches_alone = .not. (has_time_integrator(solver) .or. search%outcome%evidence%is_drifting)
  end function marches_alone

  subroutine solve_by_march(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call solve_by_periods(solver, search%omega, search%outcome)
  end subroutine solve_by_march

  subroutine solve_from_stuck(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search
    integer :: status

    call solver%context%balance%receptance%set_frequency(search%omega, status)
    search%outcome%converged = .false.
    if (status /= 0) return
    solver%motion = linear_motion(solver%context%balance)
    call solve_here(solver, search)
  end subroutine solve_from_stuck

  subroutine solve_by_frequency(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call follow_homotopy(frequency_homotopy_type(solver%omega, search%omega), solver, search%outcome%iterations, &
                         search%outcome%converged, most_iterations=homotopy_iterations)
  end subroutine solve_by_frequency

  subroutine solve_by_level(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search
    real(wp) :: level

    level = solver%context%balance%level
    solver%motion(2:, :) = 0.0_wp
    call follow_homotopy(level_homotopy_type(search%omega, level), solver, search%outcome%iterations, search%outcome%converged, &
                         most_iterations=homotopy_iterations)
    call solver%set_loads(solver%context%balance%static_factors, level)
  end subroutine solve_by_level

  subroutine solve_by_softer_contacts(solver, search)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is looked for, and what was found so far
    type(search_type), intent(inout) :: search

    call solve_by_stiffness(solver, search%omega, search%outcome%iterations, search%outcome%converged)
  end subroutine solve_by_softer_contacts

  !> What the last solve came to.
  pure subroutine count_on(solver, outcome)
    !> Solver of points: the report of its last solve
    type(solver_type), intent(in) :: solver
    !> Counts iterations on
    type(strategy_outcome_type), intent(inout) :: outcome

    outcome%iterations = outcome%iterations + solver%report%iterations
    outcome%converged = solver%report%converged
  end subroutine count_on
end module attrito_solve_strategy_table
