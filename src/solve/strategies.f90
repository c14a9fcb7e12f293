!> Fallback strategies for a point, in order: Newton's method from the point before, briefly; the same with springs on the mean that
!> are relaxed, after a body that drifted or where there is no time integration; starts by time integration; force steps with such
!> springs; the point before once more, to the end; the stuck response; smaller frequency steps; force steps; a homotopy in the
!> stiffness of the contacts.
!>
!> Newton's method is hardest at the onset of gross slip. Where the balance with springs on its mean shows that friction cannot hold a
!> body, and a few starts by time integration find nothing else, no orbit is looked for; motion that has not settled after all such
!> starts has found none. The next point then begins with what was found here. A point that fails leaves the solver as it was, with a
!> report that says so.
module attrito_solve_strategies
  use attrito_core_kinds, only: wp
  use attrito_balance_stuck_response, only: linear_motion
  use attrito_solve_mean_regularisation, only: can_regularise, find_drift
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_stiffness_homotopy, only: can_soften, solve_by_stiffness
  use attrito_solve_solver, only: solver_type
  use attrito_solve_time_integration_start, only: has_time_integrator, solve_from_time_integration
  use attrito_solve_homotopy, only: follow_homotopy, frequency_homotopy_type, level_homotopy_type
  implicit none
  private
  public :: solve_by_cascade, solve_by_attempt, attempt_names

  ! The strategies, in their order
  integer, parameter :: from_here_briefly = 1, regularised_from_here = 2, from_time_integration = 3, regularised_by_level = 4, &
                        from_here = 5, from_stuck_response = 6, by_frequency = 7, by_level = 8, by_stiffness = 9
  integer, parameter :: order(9) = [from_here_briefly, regularised_from_here, from_time_integration, regularised_by_level, &
                                    from_here, from_stuck_response, by_frequency, by_level, by_stiffness]
  character(*), parameter :: attempt_names(9) = [character(18) :: 'newton_briefly', 'held_mean', 'motion_in_time', &
                                                 'held_force_steps', 'newton', 'stuck_response', 'frequency_steps', 'force_steps', &
                                                 'stiffness_steps']

  !> Iterations after which a homotopy is given up, and one with springs on the mean
  integer, parameter :: homotopy_iterations = 200, regularised_iterations = 60

contains

  !> Solve at an angular frequency, with the present loads. Newton's method from the point before is given up early where other starts
  !> follow, and run to its end when these have failed.
  subroutine solve_by_cascade(solver, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Target
    real(wp), intent(in) :: omega
    type(snapshot_type) :: before, drifted
    integer :: iterations, i
    logical :: converged, was_drifting, lost

    was_drifting = solver%is_drifting
    lost = solver%no_periodic_solution
    solver%no_periodic_solution = .false.
    solver%is_drifting = .false.
    call solver%solve_stuck_at(omega, converged)
    if (converged) return
    before = snapshot_of(solver)
    iterations = 0
    do i = 1, size(order)
      if (.not. (is_possible(solver, order(i)) .and. is_worth_while(solver, order(i), was_drifting))) cycle
      call try(solver, order(i), omega, before, was_drifting, lost, iterations, converged)
      if (converged) exit
      ! The drift that was followed has ended: solutions beyond are looked for as at a first point.
      if (order(i) == regularised_from_here .and. .not. solver%is_drifting) lost = .false.
      if (solver%is_drifting .and. .not. allocated(drifted%motion)) drifted = snapshot_of(solver)
      call restore(solver, before)
      if (is_enough(solver, order(i), was_drifting, lost)) exit
    end do
    solver%is_drifting = solver%is_drifting .and. .not. converged
    solver%no_periodic_solution = solver%is_drifting .or. (solver%no_periodic_solution .and. .not. converged)
    if (solver%is_drifting) then
      call restore(solver, drifted)
      call remove_drift(solver, before)
      solver%omega = omega
    end if
    ! The last step of a homotopy that was given up may have converged, at another parameter.
    solver%report%converged = converged
    solver%report%iterations = iterations
  end subroutine solve_by_cascade

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

  !> Is everything there that a strategy needs?
  pure logical function is_possible(solver, attempt)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Strategy, see `attempt_names`
    integer, intent(in) :: attempt

    select case (attempt)
     case (regularised_from_here, regularised_by_level)
      is_possible = can_regularise(solver)
     case (from_time_integration)
      is_possible = has_time_integrator(solver)
     case (by_stiffness)
      is_possible = can_soften(solver)
     case default
      is_possible = .true.
    end select
  end function is_possible

  !> Is a strategy worth its cost at its place in the order?
  pure logical function is_worth_while(solver, attempt, was_drifting)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Strategy, see `attempt_names`
    integer, intent(in) :: attempt
    !> Did the body drift at the point before? Then that is no solution.
    logical, intent(in) :: was_drifting

    select case (attempt)
     case (from_here_briefly)
      is_worth_while = .not. was_drifting .and. (has_time_integrator(solver) .or. can_regularise(solver))
     case (regularised_from_here)
      ! Time integration finds drift by itself, and where a body is held it is faster.
      is_worth_while = was_drifting .or. .not. has_time_integrator(solver)
     case default
      is_worth_while = .true.
    end select
  end function is_worth_while

  !> Has a strategy that failed shown that there is nothing to find? Fewer are needed where the point before had no orbit either.
  pure logical function is_enough(solver, attempt, was_drifting, lost)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Strategy, see `attempt_names`
    integer, intent(in) :: attempt
    !> Did the body drift at the point before; had that no orbit?
    logical, intent(in) :: was_drifting, lost

    is_enough = solver%is_drifting .and. (was_drifting .or. attempt >= from_time_integration)
    if (lost .and. solver%no_periodic_solution) is_enough = is_enough .or. attempt == from_time_integration
  end function is_enough

  !> Solve at an angular frequency by one strategy alone, to compare strategies; if it fails the solver is left as it was.
  subroutine solve_by_attempt(solver, attempt, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Place among `attempt_names`, from 1
    integer, intent(in) :: attempt
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    type(snapshot_type) :: before
    integer :: iterations
    logical :: converged

    solver%no_periodic_solution = .false.
    solver%is_drifting = .false.
    before = snapshot_of(solver)
    iterations = 0
    converged = .false.
    if (is_possible(solver, attempt)) call try(solver, attempt, omega, before, .false., .false., iterations, converged)
    solver%is_drifting = solver%is_drifting .and. .not. converged
    solver%no_periodic_solution = solver%is_drifting .or. (solver%no_periodic_solution .and. .not. converged)
    if (.not. converged) call restore(solver, before)
    solver%report%converged = converged
    solver%report%iterations = iterations
  end subroutine solve_by_attempt

  !> One strategy from the solver's present point. Where the body drifts the solver is left at the drifting motion.
  subroutine try(solver, attempt, omega, before, was_drifting, lost, iterations, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Strategy, see `attempt_names`
    integer, intent(in) :: attempt
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    !> Did the body drift at the point before; had that no orbit?
    logical, intent(in) :: was_drifting, lost
    !> Counts on
    integer, intent(inout) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged

    select case (attempt)
     case (from_here_briefly)
      solver%brief = .true.
      call solve_here(solver, omega, iterations, converged)
      solver%brief = .false.
     case (regularised_from_here)
      call find_drift(solver, omega, iterations, converged)
     case (regularised_by_level)
      call march_level(solver, omega, .true., regularised_iterations, iterations, converged)
      if (converged) call find_drift(solver, omega, iterations, converged)
     case (from_time_integration)
      call solve_from_time_integration(solver, omega, was_drifting, lost, iterations, converged)
     case (from_here)
      call solve_here(solver, omega, iterations, converged)
     case (from_stuck_response)
      call solve_from_stuck(solver, omega, iterations, converged)
     case (by_frequency)
      call follow_homotopy(frequency_homotopy_type(before%omega, omega), solver, iterations, converged, &
                           most_iterations=homotopy_iterations)
     case (by_stiffness)
      call solve_by_stiffness(solver, omega, iterations, converged)
     case default  ! by_level
      call march_level(solver, omega, .false., homotopy_iterations, iterations, converged)
    end select
  end subroutine try

  !> From the present motion.
  subroutine solve_here(solver, omega, iterations, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged

    call solver%solve_at(omega)
    iterations = iterations + solver%report%iterations
    converged = solver%report%converged
  end subroutine solve_here

  !> From the static solution by steps in force.
  subroutine march_level(solver, omega, with_springs, most_iterations, iterations, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> With springs on the mean?
    logical, intent(in) :: with_springs
    !> Most iterations
    integer, intent(in) :: most_iterations
    !> Counts on
    integer, intent(inout) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged
    real(wp) :: level

    level = solver%context%balance%level
    solver%motion(2:, :) = 0.0_wp
    call follow_homotopy(level_homotopy_type(omega, level, with_springs), solver, iterations, converged, &
                         most_iterations=most_iterations)
    call solver%set_loads(solver%context%balance%static_factors, level)
  end subroutine march_level

  !> From the response with every contact stuck.
  subroutine solve_from_stuck(solver, omega, iterations, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged
    integer :: status

    call solver%context%balance%receptance%set_frequency(omega, status)
    converged = .false.
    if (status /= 0) return
    solver%motion = linear_motion(solver%context%balance)
    call solve_here(solver, omega, iterations, converged)
  end subroutine solve_from_stuck
end module attrito_solve_strategies
