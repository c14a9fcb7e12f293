!> Getting to a point by trying, in order: the point before, briefly; the same with springs on its mean that give way, after a body
!> that walked or where there is no motion in time; motion in time; force steps with such springs; the point before to the end; the
!> stuck response; the frequency in smaller steps; the force in steps; contacts that are softer at first.
!>
!> Newton's method is the hard part at the onset of gross slip. Where the balance with its mean held says that friction alone
!> cannot hold a body, and a little motion in time leads to nothing else, there is no orbit to look for; what has not settled after
!> all starts out of motion in time has come to none. The next point then begins with what was found here. Nothing is dropped in
!> silence: what fails leaves the solver where it was, with a report that says so.
module attrito_solve_strategies
  use attrito_core_kinds, only: wp
  use attrito_balance_stuck_response, only: linear_motion
  use attrito_solve_mean_regularisation, only: can_hold, let_walk
  use attrito_solve_snapshot, only: place_type, place_of, return_to
  use attrito_solve_stiffness_homotopy, only: can_soften, solve_by_stiffness
  use attrito_solve_solver, only: solver_type
  use attrito_solve_time_integration_start, only: has_time, solve_in_time
  use attrito_solve_homotopy, only: march_along, frequency_way_type, level_way_type
  implicit none
  private
  public :: solve_by_cascade, solve_by_attempt, attempt_names

  ! The attempts, in their order
  integer, parameter :: from_here_briefly = 1, held_from_here = 2, from_motion_in_time = 3, held_by_level = 4, from_here = 5, &
                        from_stuck_response = 6, by_frequency = 7, by_level = 8, by_stiffness = 9
  integer, parameter :: attempts(9) = [from_here_briefly, held_from_here, from_motion_in_time, held_by_level, from_here, &
                                       from_stuck_response, by_frequency, by_level, by_stiffness]
  character(*), parameter :: attempt_names(9) = [character(18) :: 'newton_briefly', 'held_mean', 'motion_in_time', &
                                                 'held_force_steps', 'newton', 'stuck_response', 'frequency_steps', 'force_steps', &
                                                 'stiffness_steps']

  !> Iterations after which a way of small steps is given up, and one with the mean held
  integer, parameter :: way_iterations = 200, held_iterations = 60

contains

  !> Solve at an angular frequency, the harmonic load at its level. Newton's method from the point before is given up early where
  !> other starts follow, and tried to its end when these have failed.
  subroutine solve_by_cascade(solver, omega)
    type(solver_type), intent(inout) :: solver
    !> Target
    real(wp), intent(in) :: omega
    type(place_type) :: before, walking
    integer :: iterations, i
    logical :: converged, walked, lost

    walked = solver%walks
    lost = solver%no_orbit
    solver%no_orbit = .false.
    solver%walks = .false.
    call solver%solve_stuck_at(omega, converged)
    if (converged) return
    before = place_of(solver)
    iterations = 0
    do i = 1, size(attempts)
      if (.not. (is_possible(solver, attempts(i)) .and. is_worth_while(solver, attempts(i), walked))) cycle
      call try(solver, attempts(i), omega, before, walked, lost, iterations, converged)
      if (converged) exit
      ! The walk that was followed has ended: what there is beyond is looked for as at a first point.
      if (attempts(i) == held_from_here .and. .not. solver%walks) lost = .false.
      if (solver%walks .and. .not. allocated(walking%motion)) walking = place_of(solver)
      call return_to(solver, before)
      if (is_enough(solver, attempts(i), walked, lost)) exit
    end do
    solver%walks = solver%walks .and. .not. converged
    solver%no_orbit = solver%walks .or. (solver%no_orbit .and. .not. converged)
    if (solver%walks) then
      call return_to(solver, walking)
      call slide_back(solver, before)
      solver%omega = omega
    end if
    ! The last step of a way that was given up may have converged, elsewhere.
    solver%report%converged = converged
    solver%report%iterations = iterations
  end subroutine solve_by_cascade

  !> Leave a body that walks where it was: wherever it has come to it walks alike, and rounding grows with the distance.
  subroutine slide_back(solver, before)
    type(solver_type), intent(inout) :: solver
    type(place_type), intent(in) :: before
    real(wp) :: slider(2, size(solver%context%balance%law))

    slider = solver%context%balance%slider
    call solver%context%balance%slide_back(before%motion(1, :), solver%motion(1, :), slider)
    ! Those that are found with the motion still are.
    solver%context%balance%slider = slider
    call solver%context%forget()
  end subroutine slide_back

  !> Is there what an attempt needs?
  pure logical function is_possible(solver, attempt)
    type(solver_type), intent(in) :: solver
    integer, intent(in) :: attempt

    select case (attempt)
     case (held_from_here, held_by_level)
      is_possible = can_hold(solver)
     case (from_motion_in_time)
      is_possible = has_time(solver)
     case (by_stiffness)
      is_possible = can_soften(solver)
     case default
      is_possible = .true.
    end select
  end function is_possible

  !> Is an attempt worth its while at its place in the order?
  pure logical function is_worth_while(solver, attempt, walked)
    type(solver_type), intent(in) :: solver
    integer, intent(in) :: attempt
    !> Did the point before walk? Then it stands at no solution.
    logical, intent(in) :: walked

    select case (attempt)
     case (from_here_briefly)
      is_worth_while = .not. walked .and. (has_time(solver) .or. can_hold(solver))
     case (held_from_here)
      ! Motion in time comes to it by itself, and where a body is held it gets there sooner.
      is_worth_while = walked .or. .not. has_time(solver)
     case default
      is_worth_while = .true.
    end select
  end function is_worth_while

  !> Has an attempt that failed left nothing to look for? Less is needed where the point before had no orbit either.
  pure logical function is_enough(solver, attempt, walked, lost)
    type(solver_type), intent(in) :: solver
    integer, intent(in) :: attempt
    !> Did the point before walk; had it no orbit?
    logical, intent(in) :: walked, lost

    is_enough = solver%walks .and. (walked .or. attempt >= from_motion_in_time)
    if (lost .and. solver%no_orbit) is_enough = is_enough .or. attempt == from_motion_in_time
  end function is_enough

  !> Solve at an angular frequency by one attempt alone, for methods to be compared; the solver stays where it gets to, or returns.
  subroutine solve_by_attempt(solver, attempt, omega)
    type(solver_type), intent(inout) :: solver
    !> Place among `attempt_names`, from 1
    integer, intent(in) :: attempt
    real(wp), intent(in) :: omega
    type(place_type) :: before
    integer :: iterations
    logical :: converged

    solver%no_orbit = .false.
    solver%walks = .false.
    before = place_of(solver)
    iterations = 0
    converged = .false.
    if (is_possible(solver, attempt)) call try(solver, attempt, omega, before, .false., .false., iterations, converged)
    solver%walks = solver%walks .and. .not. converged
    solver%no_orbit = solver%walks .or. (solver%no_orbit .and. .not. converged)
    if (.not. converged) call return_to(solver, before)
    solver%report%converged = converged
    solver%report%iterations = iterations
  end subroutine solve_by_attempt

  !> One attempt from a place at which the solver stands. Where a body is seen to walk the solver stands at that.
  subroutine try(solver, attempt, omega, before, walked, lost, iterations, converged)
    type(solver_type), intent(inout) :: solver
    integer, intent(in) :: attempt
    real(wp), intent(in) :: omega
    type(place_type), intent(in) :: before
    !> Did the point before walk; is hardly anything hoped for?
    logical, intent(in) :: walked, lost
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged

    select case (attempt)
     case (from_here_briefly)
      solver%brief = .true.
      call solve_here(solver, omega, iterations, converged)
      solver%brief = .false.
     case (held_from_here)
      call let_walk(solver, omega, iterations, converged)
     case (held_by_level)
      call march_level(solver, omega, .true., held_iterations, iterations, converged)
      if (converged) call let_walk(solver, omega, iterations, converged)
     case (from_motion_in_time)
      call solve_in_time(solver, omega, walked, lost, iterations, converged)
     case (from_here)
      call solve_here(solver, omega, iterations, converged)
     case (from_stuck_response)
      call solve_from_stuck(solver, omega, iterations, converged)
     case (by_frequency)
      call march_along(frequency_way_type(before%omega, omega), solver, iterations, converged, most_iterations=way_iterations)
     case (by_stiffness)
      call solve_by_stiffness(solver, omega, iterations, converged)
     case default  ! by_level
      call march_level(solver, omega, .false., way_iterations, iterations, converged)
    end select
  end subroutine try

  !> From the motion that the solver stands at.
  subroutine solve_here(solver, omega, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged

    call solver%solve_at(omega)
    iterations = iterations + solver%report%iterations
    converged = solver%report%converged
  end subroutine solve_here

  !> From the static solution by steps in force.
  subroutine march_level(solver, omega, held, most_iterations, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> With springs on the mean?
    logical, intent(in) :: held
    integer, intent(in) :: most_iterations
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    real(wp) :: level

    level = solver%context%balance%level
    solver%motion(2:, :) = 0.0_wp
    call march_along(level_way_type(omega, level, held), solver, iterations, converged, most_iterations=most_iterations)
    call solver%set_loads(solver%context%balance%static_factors, level)
  end subroutine march_level

  !> From the response with every contact stuck.
  subroutine solve_from_stuck(solver, omega, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    integer :: status

    call solver%context%balance%receptance%set_frequency(omega, status)
    converged = .false.
    if (status /= 0) return
    solver%motion = linear_motion(solver%context%balance)
    call solve_here(solver, omega, iterations, converged)
  end subroutine solve_from_stuck
end module attrito_solve_strategies
