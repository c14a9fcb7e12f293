!> A series just long enough for the error that is accepted, chosen point by point.
!>
!> Harmonics left out fade as those do that are there, so the tail of the motion says how many more, or fewer, are needed for the
!> estimated error (`attrito_accuracy_error_estimate`). A longer series is solved if the estimate is too large or not sure, until two
!> series agree: their difference outweighs what the shorter one was estimated at. The point stays on that, and the part that the
!> difference was of what had been open holds for the next points of the branch.
!>
!> Along a branch harmonics stay. A change moves the branch by about its error, which may be more than a step does: the
!> point is solved again in its own plane first, and the tangent found there. More are taken when a point asks for them, fewer when
!> several points in a row ask for less than half, or, of a long series, for less than three quarters.
module attrito_accuracy_error_control
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_accuracy_amplitude_change, only: relative_change
  use attrito_accuracy_error_estimate, only: error_estimate_type, harmonics_share, own_monitors, &
                                              short_series
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_finer_solution, only: solve_finer
  use attrito_accuracy_kept_point, only: kept_point_type
  use attrito_accuracy_point_errors, only: point_errors_type
  use attrito_accuracy_series_comparison, only: caution, patience, series_comparison_type
  use attrito_accuracy_series_length, only: series_length_type, next_longer, most_harmonics, most_growth, long_series
  use attrito_continuation_range, only: range_type
  use attrito_continuation_sweep, only: sweep_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: error_control_type

  !> Part of a series that had to be lengthened until its estimate was sure that the next point begins with at least
  real(wp), parameter :: shrinking = 0.8_wp ! guess
  integer, parameter :: most_refinements = 8 ! conventional
  !> Operations that a branch may take in vain on longer series, some 15 s, before its points have earned more: of a large joint that
  !> hardly settles a point with an unknown error is worth more than none
  real(wp), parameter :: most_work = 5.0e10_wp ! guess

  type :: error_control_type
    !> What is asked of harmonics
    type(series_length_type) :: series
    !> Of the present point; `modes` is the same for all points
    type(point_errors_type) :: errors
    type(error_estimate_type), private :: estimator
    !> Of the first listed frequency, and for the point that comes next
    integer, private :: first = 0, next_harmonics = 0
    !> Points of a branch in a row that ask for so little; the most harmonics that these ask for
    integer, private :: asked = 0, most_asked = 0
    !> Operations that longer series may still take in vain: as many as the points themselves have taken, and some more
    real(wp), private :: spare = most_work
    type(series_comparison_type), private :: comparison
  contains
    procedure :: estimate
    procedure :: advance
    procedure :: solve_at
    procedure :: keep
    procedure :: destroy
  end type error_control_type

contains

  !> Errors of the solver's present point, and the point on a longer series.
  subroutine estimate(self, solver, solved, finer)
    class(error_control_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Is its present point a solution? If not, there are no errors
    logical, intent(in) :: solved
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(out) :: finer

    call self%estimator%estimate(solver, solved, self%series%tolerance, self%errors, finer)
  end subroutine estimate

  !> Save or load what the next point depends on.
  subroutine keep(self, store)
    class(error_control_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%errors%harmonics)
    call store%keep(self%first)
    call store%keep(self%next_harmonics)
    call store%keep(self%asked)
    call store%keep(self%most_asked)
    call store%keep(self%spare)
    call self%comparison%keep(store)
  end subroutine keep

  !> The sweep's next point, within the accepted error if harmonics are to be chosen.
  subroutine advance(self, sweep, solver)
    class(error_control_type), intent(inout) :: self
    !> Sweep that goes on
    type(sweep_type), intent(inout) :: sweep
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    real(wp) :: begun
    integer :: harmonics, branch

    begun = work_of(solver)
    harmonics = solver%options%harmonics
    branch = merge(sweep%branch, -1, sweep%points > 0)
    call sweep%advance(solver)
    if (sweep%branch /= branch) call begin_branch(self)
    call refine(self, solver, sweep%range, begun)
    call coarsen(self, solver)
    call sweep%set_harmonics(solver%options%harmonics)
    if (solver%options%harmonics /= harmonics) call sweep%look_here(solver)
  end subroutine advance

  !> What the points of another branch have shown says nothing of this one.
  subroutine begin_branch(self)
    type(error_control_type), intent(inout) :: self

    call self%comparison%forget()
    self%spare = most_work
    self%asked = 0
    self%most_asked = 0
  end subroutine begin_branch

  !> Once several points in a row ask for so little, solve the last of them again on that, in its own plane; back to what it was
  !> if its error then is not accepted.
  subroutine coarsen(self, solver)
    class(error_control_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(kept_point_type) :: here
    type(finer_point_type) :: point
    real(wp), allocatable :: monitors(:, :)
    real(wp) :: shown
    integer :: now, wanted, iterations
    logical :: accepted_too

    now = solver%options%harmonics
    wanted = self%next_harmonics
    if (.not. solver%report%converged .or. wanted <= 0 .or. wanted > modest(now)) then
      self%asked = 0
      self%most_asked = 0
      return
    end if
    self%asked = self%asked + 1
    self%most_asked = max(self%most_asked, wanted)
    if (self%asked < patience) return
    wanted = self%most_asked
    self%asked = 0
    self%most_asked = 0
    iterations = solver%report%iterations
    if (solver%all_stick) then
      ! A linear response is the same on any series.
      call solver%set_harmonics(wanted)
      call solver%solve_stuck_at(solver%omega, accepted_too)
      solver%report%iterations = iterations
      return
    end if
    call here%take(solver, self%errors)
    monitors = own_monitors(solver)
    point%motion = solver%motion
    call solve_finer(solver, point, wanted, .true., iterations, accepted_too)
    if (accepted_too) then
      call self%estimate(solver, .true., point)
      if (may_suffice(self, self%errors) .and. here%errors%are_known()) then
        shown = relative_change(own_monitors(solver), monitors) + here%errors%harmonics
        if (shown <= harmonics_share*self%series%tolerance) call trust(self, solver, shown)
      end if
      accepted_too = is_accepted(self)
    end if
    if (.not. accepted_too) call here%go_back(solver, self%errors)
    solver%report%iterations = iterations
  end subroutine coarsen

  !> The most harmonics that a series is cut to.
  pure integer function modest(now)
    !> Harmonics of the series
    integer, intent(in) :: now

    modest = merge((3*now)/4, now/2, now > long_series)
  end function modest

  !> The same at one angular frequency.
  subroutine solve_at(self, solver, omega)
    class(error_control_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    real(wp) :: begun

    begun = work_of(solver)
    call begin_point(self, solver, omega)
    if (self%series%choose_harmonics) then
      call solve_on_some_series(self, solver, omega)
    else
      call solve_by_strategies(solver, omega)
    end if
    call refine(self, solver, range_type(omega, omega), begun)
  end subroutine solve_at

  !> A series may have no solution, and every strategy is dear on a long one: there those of little cost are tried. Then all are on a
  !> short series, then on the shortest: `refine` goes on from there. No periodic motion ends the search. A point that fails leaves
  !> the series as it was.
  subroutine solve_on_some_series(self, solver, omega)
    class(error_control_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    type(snapshot_type) :: before
    type(evidence_type) :: previous
    integer :: lengths(3), iterations, i

    before = snapshot_of(solver)
    previous = solver%evidence
    lengths = [solver%options%harmonics, max(self%series%fewest_harmonics, short_series), self%series%fewest_harmonics]
    iterations = 0
    do i = 1, size(lengths)
      if (i > 1) then
        if (lengths(i) >= solver%options%harmonics) cycle
        call solver%set_harmonics(lengths(i))
        solver%evidence = previous
      end if
      call solve_by_strategies(solver, omega, at_little_cost=lengths(i) > long_series)
      iterations = iterations + solver%report%iterations
      if (solver%report%converged .or. solver%evidence%no_periodic_solution) exit
    end do
    solver%report%iterations = iterations
    if (solver%report%converged) return
    call solver%set_harmonics(lengths(1))
    if (.not. solver%evidence%is_drifting) call restore(solver, before)
  end subroutine solve_on_some_series

  !> A listed frequency begins at the point before, on what that asked for; if sliders are reset, as the first one did: it is what it
  !> is alone. What a comparison of two series has shown holds along a branch, not from one listed frequency to the next.
  subroutine begin_point(self, solver, omega)
    class(error_control_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega

    call begin_branch(self)
    if (self%first == 0) self%first = solver%options%harmonics
    if (solver%options%reset_slider) then
      call solver%set_harmonics(self%first)
      call solver%rest()
      solver%omega = omega
      solver%evidence = evidence_type()
    else if (self%next_harmonics > 0) then
      call solver%set_harmonics(self%next_harmonics)
    end if
  end subroutine begin_point

  !> Estimate the errors of the point, and solve it again on longer series until they are accepted, or as long as it gets. A series
  !> that differs from a shorter one by what that errs by for sure, and yet may err by more, is passed over: the next longer begins at
  !> the shorter again. A point that no longer series reaches, or only out of the range, stays: with its estimate if that is sure,
  !> without if not.
  subroutine refine(self, solver, range, begun)
    type(error_control_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of frequencies
    type(range_type), intent(in) :: range
    !> Operations before the point was solved
    real(wp), intent(in) :: begun
    type(finer_point_type) :: finer, of_shorter
    type(kept_point_type) :: shorter
    real(wp), allocatable :: monitors(:, :)
    real(wp) :: own, estimated, change
    integer :: attempt, harmonics, tried, iterations
    logical :: better, was_sure, can_leap, is_worse

    was_sure = .true.
    can_leap = .true.
    iterations = solver%report%iterations
    tried = solver%options%harmonics
    self%next_harmonics = 0
    own = work_of(solver) - begun
    self%spare = max(self%spare, 0.0_wp) + own
    call self%estimate(solver, solver%report%converged, finer)
    estimated = work_of(solver)
    solver%context%most_work = estimated + min(self%spare, most_work + own)
    if (solver%report%converged .and. self%series%choose_harmonics) call rely_on_comparison(self, solver)
    do attempt = 0, most_refinements
      if (.not. (solver%report%converged .and. self%errors%are_known() .and. self%series%choose_harmonics)) exit
      harmonics = self%series%needed_harmonics(solver, self%errors, finer)
      ! A series on which estimates are not sure would be solved in vain.
      self%next_harmonics = max(harmonics, merge(0, nint(shrinking*solver%options%harmonics), was_sure))
      if (is_accepted(self) .or. attempt == most_refinements) exit
      was_sure = was_sure .and. (self%errors%is_sure .or. self%errors%is_stiff)
      harmonics = longer_than(self, solver, harmonics, tried)
      if (harmonics <= tried) exit
      monitors = own_monitors(solver)
      of_shorter = finer
      call shorter%take(solver, self%errors)
      call leap_or_step(solver, finer, harmonics, next_longer(tried), can_leap, iterations, better)
      if (better .and. (.not. range%has(solver%omega) .or. solver%options%harmonics <= tried)) then
        call shorter%go_back(solver, self%errors)
        better = .false.
      end if
      if (.not. better) then
        ! The next point had better begin with a series that has a solution.
        self%next_harmonics = solver%options%harmonics
        exit
      end if
      call self%estimate(solver, .true., finer)
      tried = solver%options%harmonics
      is_worse = .not. self%errors%are_known()
      if (.not. is_worse) then
        change = relative_change(monitors, own_monitors(solver))
        if (.not. self%errors%is_sure) call compare(self, solver, change, shorter%errors)
        if (shows_enough(self, shorter%errors, change)) then
          self%next_harmonics = solver%options%harmonics
          change = change + self%errors%harmonics
          call shorter%go_back(solver, self%errors)
          call trust(self, solver, change)
          exit
        end if
        is_worse = shorter%errors%is_sure .and. .not. self%errors%is_sure .and. &
                   self%errors%harmonics > shorter%errors%harmonics .and. change <= caution*shorter%errors%harmonics
      end if
      if (is_worse) then
        call shorter%go_back(solver, self%errors)
        finer = of_shorter
      end if
    end do
    if (.not. is_accepted(self)) self%spare = self%spare - (work_of(solver) - estimated)
    solver%context%most_work = huge(1.0_wp)
    if (self%series%choose_harmonics .and. solver%report%converged .and. .not. self%errors%is_sure) then
      self%errors%harmonics = ieee_value(self%errors%harmonics, ieee_quiet_nan)
    end if
    solver%report%iterations = iterations
  end subroutine refine

  !> Is the present point's error known, and small enough?
  pure logical function is_accepted(self)
    type(error_control_type), intent(in) :: self

    is_accepted = self%errors%are_known() .and. self%errors%is_sure
    if (is_accepted) is_accepted = self%series%accepts(self%errors)
  end function is_accepted

  !> The length of the series to solve the present point again on.
  integer function longer_than(self, solver, needed, tried) result(harmonics)
    type(error_control_type), intent(in) :: self
    !> Solver of points, at the present one
    type(solver_type), intent(in) :: solver
    !> Harmonics that its estimate asks for, and the most that were tried
    integer, intent(in) :: needed, tried

    associate (now => solver%options%harmonics)
      harmonics = max(needed, now)
      if (.not. self%errors%is_sure) then
        ! Where the error is large the estimate does not know what is missing.
        if (self%series%accepts(self%errors)) harmonics = max(harmonics, self%errors%unsettled)
        harmonics = max(min(harmonics, most_growth*now), next_longer(now))
      end if
      if (tried > now) harmonics = max(harmonics, next_longer(tried))
      harmonics = min(harmonics, most_harmonics)
    end associate
  end function longer_than

  !> Does the present point, on a longer series, show that the shorter one was long enough?
  pure logical function shows_enough(self, shorter, change)
    type(error_control_type), intent(in) :: self
    !> What the estimate on the shorter series left open
    type(point_errors_type), intent(in) :: shorter
    !> Relative change of the monitors from the shorter series
    real(wp), intent(in) :: change

    shows_enough = self%errors%is_sure .and. may_suffice(self, shorter) .and. &
                   change + self%errors%harmonics <= harmonics_share*self%series%tolerance
  end function shows_enough

  !> Operations so far, of all ranks.
  real(wp) function work_of(solver) result(work)
    !> Solver of points
    type(solver_type), intent(in) :: solver

    work = solver%context%balance%work
    call solver%context%balance%ranks%sum(work)
  end function work_of

  !> Solve the point again on the series that is asked for; if that fails, on the next longer one, and at last from the motion as it
  !> is: the first order may lead far away. A leap to a series that is long and far gives Newton's method little to start from, and
  !> much to do: it is given up early, and none is tried at this point any more.
  subroutine leap_or_step(solver, finer, harmonics, step, can_leap, iterations, better)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(in) :: finer
    !> Highest harmonic, H, that is asked for, and that of the next longer series
    integer, intent(in) :: harmonics, step
    !> Has no leap failed at this point?
    logical, intent(inout) :: can_leap
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is there a finer point?
    logical, intent(out) :: better
    type(finer_point_type) :: here
    logical :: is_leap

    is_leap = harmonics > max(step, long_series)
    better = .false.
    if (can_leap .or. .not. is_leap) call solve_finer(solver, finer, harmonics, is_leap, iterations, better)
    if (better) return
    can_leap = can_leap .and. .not. is_leap
    if (harmonics > step) then
      call solve_finer(solver, finer, step, .false., iterations, better)
      if (better) return
    end if
    here%motion = solver%motion
    call solve_finer(solver, here, min(harmonics, step), .false., iterations, better)
  end subroutine leap_or_step

  !> Take what the point differs by from the same on a shorter series for its error; that is sure once it is accepted. It says nothing
  !> of a harmonic that both lack.
  subroutine compare(self, solver, change, shorter)
    type(error_control_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Relative change of the monitors from the shorter series
    real(wp), intent(in) :: change
    !> What the estimate on that series left open
    type(point_errors_type), intent(in) :: shorter

    self%errors%harmonics = max(self%errors%known_part, change)
    self%errors%is_sure = self%series%accepts(self%errors) .and. solver%options%harmonics >= min(shorter%unsettled, most_harmonics)
  end subroutine compare

  !> A longer series has shown what the point on this one errs by: it counts, and for the points that follow.
  subroutine trust(self, solver, shown)
    type(error_control_type), intent(inout) :: self
    !> Solver of points, on the shorter series, and estimated there
    type(solver_type), intent(in) :: solver
    !> The change to the longer series, and the error of that
    real(wp), intent(in) :: shown

    self%errors%harmonics = shown
    self%errors%is_sure = .true.
    call self%comparison%take(solver%options%harmonics, shown, self%errors%at_most)
  end subroutine trust

  !> Along a branch an estimate that does not suffice counts by what the last comparison of two series found.
  subroutine rely_on_comparison(self, solver)
    type(error_control_type), intent(inout) :: self
    !> Solver of points: its harmonics
    type(solver_type), intent(in) :: solver
    real(wp) :: error
    logical :: is_known

    if (.not. may_suffice(self, self%errors)) return
    call self%comparison%bound(solver%options%harmonics, self%errors%at_most, error, is_known)
    if (.not. is_known .or. error > harmonics_share*self%series%tolerance) return
    self%errors%harmonics = error
    self%errors%is_sure = .true.
  end subroutine rely_on_comparison

  !> May a comparison with a longer series show that this one is long enough, if the estimate does not?
  pure logical function may_suffice(self, errors)
    type(error_control_type), intent(in) :: self
    !> As estimated on this series
    type(point_errors_type), intent(in) :: errors

    may_suffice = .false.
    if (.not. errors%are_known() .or. errors%is_stiff .or. errors%at_most <= 0.0_wp) return
    may_suffice = .not. (errors%is_sure .and. self%series%accepts(errors))
  end function may_suffice

  !> Give the transforms back.
  subroutine destroy(self)
    class(error_control_type), intent(inout) :: self

    call self%estimator%destroy()
  end subroutine destroy
end module attrito_accuracy_error_control
