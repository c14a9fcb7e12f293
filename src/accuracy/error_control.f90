!> A series just long enough for the error that is accepted, chosen point by point (`attrito_accuracy_refinement`).
!>
!> Along a branch harmonics stay. A change moves the branch by about its error, which may be more than a step does: the
!> point is solved again in its own plane first, and the tangent found there. More are taken when a point asks for them, fewer when
!> several points in a row ask for less than half, or, of a long series, for less than three quarters.
module attrito_accuracy_error_control
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_accuracy_error_estimate, only: own_monitors, short_series
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_finer_solution, only: solve_finer
  use attrito_accuracy_kept_point, only: kept_point_type
  use attrito_accuracy_refinement, only: refinement_type, work_of
  use attrito_accuracy_series_comparison, only: patience
  use attrito_accuracy_series_length, only: long_series
  use attrito_continuation_range, only: range_type
  use attrito_continuation_sweep, only: sweep_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: error_control_type

  type, extends(refinement_type) :: error_control_type
    !> Harmonics of the first listed frequency
    integer, private :: first = 0
    !> Points of a branch in a row that ask for so little; the most harmonics that these ask for
    integer, private :: asked = 0, most_asked = 0
  contains
    procedure :: advance
    procedure :: solve_at
    procedure :: keep
  end type error_control_type

contains

  !> Save or load what the next point depends on.
  subroutine keep(self, store)
    class(error_control_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call self%keep_refinement(store)
    call store%keep(self%first)
    call store%keep(self%asked)
    call store%keep(self%most_asked)
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
    call self%refine(solver, sweep%range, begun)
    call coarsen(self, solver)
    call sweep%set_harmonics(solver%options%harmonics)
    if (solver%options%harmonics /= harmonics) call sweep%look_here(solver)
  end subroutine advance

  !> What the points of another branch have shown says nothing of this one.
  subroutine begin_branch(self)
    type(error_control_type), intent(inout) :: self

    call self%forget()
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
      call self%trust_agreement(solver, monitors, here%errors)
      accepted_too = self%is_accepted()
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
    call self%refine(solver, range_type(omega, omega), begun)
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
end module attrito_accuracy_error_control
