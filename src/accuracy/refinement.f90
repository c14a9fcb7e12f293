!> A point solved again on longer series until its error is accepted.
!>
!> Harmonics left out fade as those do that are there, so the tail of the motion says how many more, or fewer, are needed for the
!> estimated error (`attrito_accuracy_error_estimate`). A longer series is solved if the estimate is too large or not sure, until two
!> series agree: their difference outweighs what the shorter one was estimated at. The point stays on that, and the part that the
!> difference was of what had been open holds for the next points of the branch.
!>
!> Points of a branch follow one another, so what longer series take in vain is bounded by what the points themselves take.
module attrito_accuracy_refinement
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_accuracy_amplitude_change, only: relative_change
  use attrito_accuracy_error_estimate, only: error_estimate_type, harmonics_share, own_monitors
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_finer_solution, only: solve_finer
  use attrito_accuracy_kept_point, only: kept_point_type
  use attrito_accuracy_point_errors, only: point_errors_type
  use attrito_accuracy_series_comparison, only: caution, series_comparison_type
  use attrito_accuracy_series_length, only: series_length_type, next_longer, most_harmonics, most_growth, long_series
  use attrito_continuation_range, only: range_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: refinement_type, work_of

  !> Part of a series that had to be lengthened until its estimate was sure that the next point begins with at least
  real(wp), parameter :: shrinking = 0.8_wp ! guess
  integer, parameter :: most_refinements = 8 ! conventional
  !> Part of the error that a longer series leaves at most if a yet longer one may help: one by a quarter longer leaves half of it
  real(wp), parameter :: least_gain = 0.7_wp ! guess
  !> Operations that a branch may take in vain on longer series, some 15 s, before its points have earned more: of a large joint that
  !> hardly settles a point with an unknown error is worth more than none
  real(wp), parameter :: most_work = 5.0e10_wp ! guess

  !> What came of a longer series: it has no solution near; the shorter one is long enough; it is passed over, and a yet longer one
  !> begins at the shorter again; none helps; the point is on it
  integer, parameter :: not_reached = 0, shorter_suffices = 1, passed_over = 2, in_vain = 3, taken = 4

  type :: refinement_type
    !> What is asked of harmonics
    type(series_length_type) :: series
    !> Of the present point; `modes` is the same for all points
    type(point_errors_type) :: errors
    !> For the point that comes next
    integer :: next_harmonics = 0
    type(error_estimate_type), private :: estimator
    !> Operations that longer series may still take in vain: as many as the points themselves have taken, and some more
    real(wp), private :: spare = most_work
    type(series_comparison_type), private :: comparison
  contains
    procedure :: estimate
    procedure :: refine
    procedure :: is_accepted
    procedure :: trust_agreement
    procedure :: forget
    procedure :: keep_refinement
    procedure :: destroy
  end type refinement_type

contains

  !> Errors of the solver's present point, and the point on a longer series.
  subroutine estimate(self, solver, solved, finer)
    class(refinement_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Is its present point a solution? If not, there are no errors
    logical, intent(in) :: solved
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(out) :: finer

    call self%estimator%estimate(solver, solved, self%series%tolerance, self%errors, finer)
  end subroutine estimate

  !> Estimate the errors of the point, and solve it again on longer series until they are accepted, or as long as it gets. A point
  !> that no longer series reaches, or only out of the range, stays: with its estimate if that is sure, without if not.
  subroutine refine(self, solver, range, begun)
    class(refinement_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of frequencies
    type(range_type), intent(in) :: range
    !> Operations before the point was solved
    real(wp), intent(in) :: begun
    type(finer_point_type) :: finer
    real(wp) :: own, estimated
    integer :: attempt, harmonics, tried, iterations, came_to
    logical :: was_sure, can_leap

    was_sure = .true.
    can_leap = .true.
    came_to = taken
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
      if (self%is_accepted() .or. attempt == most_refinements) exit
      was_sure = was_sure .and. (self%errors%is_sure .or. self%errors%is_stiff)
      harmonics = longer_than(self, solver, harmonics, tried)
      if (harmonics <= tried) exit
      call try_longer(self, solver, range, harmonics, finer, tried, can_leap, iterations, came_to)
      ! The next point had better begin with a series that has a solution.
      if (came_to == not_reached .or. came_to == shorter_suffices) self%next_harmonics = solver%options%harmonics
      if (came_to == not_reached .or. came_to == shorter_suffices .or. came_to == in_vain) exit
    end do
    if (.not. self%is_accepted()) self%spare = self%spare - (work_of(solver) - estimated)
    solver%context%most_work = huge(1.0_wp)
    if (self%series%choose_harmonics .and. solver%report%converged .and. .not. self%errors%is_sure) then
      self%errors%harmonics = ieee_value(self%errors%harmonics, ieee_quiet_nan)
    end if
    solver%report%iterations = iterations
  end subroutine refine

  !> Solve the point again on a longer series, unless that shows nothing better than the shorter one: a series that differs from a
  !> shorter one by what that errs by for sure, and yet may err by more, is passed over. Along a branch a long one that gains little
  !> is left again: every point that follows would cost as much.
  subroutine try_longer(self, solver, range, harmonics, finer, tried, can_leap, iterations, came_to)
    class(refinement_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of frequencies
    type(range_type), intent(in) :: range
    !> Highest harmonic, H, that is asked for
    integer, intent(in) :: harmonics
    !> The point by the finer balance, to first order
    type(finer_point_type), intent(inout) :: finer
    !> Longest series so far
    integer, intent(inout) :: tried
    !> Has no leap failed at this point?
    logical, intent(inout) :: can_leap
    !> Counts on
    integer, intent(inout) :: iterations
    !> One of the above
    integer, intent(out) :: came_to
    type(kept_point_type) :: shorter
    type(finer_point_type) :: of_shorter
    real(wp), allocatable :: monitors(:, :)
    real(wp) :: shown
    logical :: better

    monitors = own_monitors(solver)
    of_shorter = finer
    call shorter%take(solver, self%errors)
    call leap_or_step(solver, finer, harmonics, next_longer(tried), can_leap, iterations, better)
    came_to = not_reached
    if (.not. better) return
    if (range%has(solver%omega) .and. solver%options%harmonics > tried) then
      call self%estimate(solver, .true., finer)
      tried = solver%options%harmonics
      call judge(self, solver, relative_change(monitors, own_monitors(solver)), shorter, shown, came_to)
      if (came_to /= shorter_suffices .and. tried > long_series .and. abs(range%width()) > 0.0_wp) then
        if (.not. (self%is_accepted() .or. has_gained(self, shorter%errors))) came_to = in_vain
      end if
    end if
    if (came_to == taken) return
    call shorter%go_back(solver, self%errors)
    finer = of_shorter
    if (came_to == shorter_suffices) call trust(self, solver, shown)
  end subroutine try_longer

  !> What a point that was solved and estimated on a longer series says of the shorter one, and of itself.
  subroutine judge(self, solver, change, shorter, shown, came_to)
    class(refinement_type), intent(inout) :: self
    !> Solver of points, on the longer series
    type(solver_type), intent(in) :: solver
    !> Relative change of the monitors from the shorter series
    real(wp), intent(in) :: change
    !> The point on that
    type(kept_point_type), intent(in) :: shorter
    !> Error of the shorter series
    real(wp), intent(out) :: shown
    !> One of the above
    integer, intent(out) :: came_to

    shown = huge(shown)
    came_to = passed_over
    if (.not. self%errors%are_known()) return
    came_to = taken
    if (self%errors%is_sure) then
      shown = change + self%errors%harmonics
    else
      shown = change + max(self%errors%known_part, beyond(change, solver%options%harmonics, shorter%harmonics))
      call compare(self, solver, change, shorter%errors)
    end if
    if (shows_enough(self, solver%options%harmonics, shorter%errors, shown)) then
      came_to = shorter_suffices
    else if (shorter%errors%is_sure .and. .not. self%errors%is_sure) then
      if (self%errors%harmonics > shorter%errors%harmonics .and. change <= caution*shorter%errors%harmonics) came_to = passed_over
    end if
  end subroutine judge

  !> Is the present point's error known, and small enough?
  pure logical function is_accepted(self)
    class(refinement_type), intent(in) :: self

    is_accepted = self%errors%are_known() .and. self%errors%is_sure
    if (is_accepted) is_accepted = self%series%accepts(self%errors)
  end function is_accepted

  !> Is the present point's error sure, and so much smaller than on a shorter series that a longer one may be accepted?
  pure logical function has_gained(self, shorter)
    class(refinement_type), intent(in) :: self
    !> Errors on the shorter series
    type(point_errors_type), intent(in) :: shorter

    has_gained = self%errors%is_sure .and. (.not. shorter%is_sure .or. self%errors%harmonics <= least_gain*shorter%harmonics)
  end function has_gained

  !> The length of the series to solve the present point again on.
  integer function longer_than(self, solver, needed, tried) result(harmonics)
    class(refinement_type), intent(in) :: self
    !> Solver of points, at the present one
    type(solver_type), intent(in) :: solver
    !> Harmonics that its estimate asks for, and the most that were tried
    integer, intent(in) :: needed, tried

    associate (now => solver%options%harmonics)
      harmonics = max(needed, now)
      if (.not. self%errors%is_sure) then
        ! If the error is large the estimate does not know what is missing.
        if (self%series%accepts(self%errors)) harmonics = max(harmonics, self%errors%unsettled)
        harmonics = max(min(harmonics, most_growth*now), next_longer(now))
      end if
      if (tried > now) harmonics = max(harmonics, next_longer(tried))
      harmonics = min(harmonics, most_harmonics)
    end associate
  end function longer_than

  !> Does the present point, on a longer series, show that the shorter one was long enough? A solved series says more than an
  !> estimate, so that harmonics may take as much as they may at worst, rather than that points that follow are solved on a long one.
  pure logical function shows_enough(self, longer, shorter, shown)
    class(refinement_type), intent(in) :: self
    !> Highest harmonic of the longer series
    integer, intent(in) :: longer
    !> What the estimate on the shorter series left open
    type(point_errors_type), intent(in) :: shorter
    !> Error of the shorter series
    real(wp), intent(in) :: shown
    real(wp) :: most

    most = merge(self%series%at_worst(shorter), harmonics_share*self%series%tolerance, longer > long_series)
    shows_enough = self%errors%is_sure .and. may_suffice(self, shorter) .and. shown <= most
  end function shows_enough

  !> What the longer of two series leaves out, by how the monitors differ. What is beyond H falls like H^-3: forces fade like h^-2,
  !> motion like h^-4.
  pure real(wp) function beyond(change, longer, shorter)
    !> Relative change of the monitors from the shorter to the longer series
    real(wp), intent(in) :: change
    !> Highest harmonics, H
    integer, intent(in) :: longer, shorter

    beyond = change/((real(longer, wp)/shorter)**3 - 1.0_wp)
  end function beyond

  !> Take what the point differs by from the same on a shorter series for its error; that is sure once it is accepted. It says nothing
  !> of a harmonic that both lack.
  subroutine compare(self, solver, change, shorter)
    class(refinement_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Relative change of the monitors from the shorter series
    real(wp), intent(in) :: change
    !> What the estimate on that series left open
    type(point_errors_type), intent(in) :: shorter

    self%errors%harmonics = max(self%errors%known_part, change)
    self%errors%is_sure = self%series%accepts(self%errors) .and. solver%options%harmonics >= min(shorter%unsettled, most_harmonics)
  end subroutine compare

  !> A point that was solved on a longer series before, and is on a shorter one now: what both agree to counts if it is sure.
  subroutine trust_agreement(self, solver, monitors, longer)
    class(refinement_type), intent(inout) :: self
    !> Solver of points, on the shorter series, and estimated there
    type(solver_type), intent(in) :: solver
    !> Coefficients of the monitors on the longer series [2 H + 1, monitors]
    real(wp), intent(in) :: monitors(:, :)
    !> Errors there
    type(point_errors_type), intent(in) :: longer
    real(wp) :: shown

    if (.not. (may_suffice(self, self%errors) .and. longer%are_known())) return
    shown = relative_change(own_monitors(solver), monitors) + longer%harmonics
    if (shown <= harmonics_share*self%series%tolerance) call trust(self, solver, shown)
  end subroutine trust_agreement

  !> A longer series has shown what the point on this one errs by: it counts, and for the points that follow.
  subroutine trust(self, solver, shown)
    class(refinement_type), intent(inout) :: self
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
    class(refinement_type), intent(inout) :: self
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
    class(refinement_type), intent(in) :: self
    !> As estimated on this series
    type(point_errors_type), intent(in) :: errors

    may_suffice = .false.
    if (.not. errors%are_known() .or. errors%is_stiff .or. errors%at_most <= 0.0_wp) return
    may_suffice = .not. (errors%is_sure .and. self%series%accepts(errors))
  end function may_suffice

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

  !> Operations so far, of all ranks.
  real(wp) function work_of(solver) result(work)
    !> Solver of points
    type(solver_type), intent(in) :: solver

    work = solver%context%balance%work
    call solver%context%balance%ranks%sum(work)
  end function work_of

  !> What comparisons and points have shown says nothing of what comes now.
  subroutine forget(self)
    class(refinement_type), intent(inout) :: self

    call self%comparison%forget()
    self%spare = most_work
  end subroutine forget

  !> Save or load what the next point depends on.
  subroutine keep_refinement(self, store)
    class(refinement_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%errors%harmonics)
    call store%keep(self%next_harmonics)
    call store%keep(self%spare)
    call self%comparison%keep(store)
  end subroutine keep_refinement

  !> Give the transforms back.
  subroutine destroy(self)
    class(refinement_type), intent(inout) :: self

    call self%estimator%destroy()
  end subroutine destroy
end module attrito_accuracy_refinement
