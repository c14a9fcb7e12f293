!> The peak that a curve of peaks begins at.
!>
!> At the linear peak's frequency the level is lowered until all contacts stick, or but a few, or it is small; the peak there is
!> followed to the level that is asked for. Where no step along that way is solved the response is swept at this level, which costs
!> less than a search at every level in between; such searches are the last resort. Many contacts, of which a sweep is dear, are first
!> asked whether they drift there.
module attrito_peak_first_peak
  use attrito_core_kinds, only: wp
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_time_integration_start, only: has_time_integrator
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_peak_condition, only: problem_type, set_value, parameter_level
  use attrito_peak_curve, only: curve_type
  use attrito_peak_endings, only: ending_not_found
  implicit none
  private
  public :: begin_curve, begin_curve_near

  !> Levels to begin at, from one to the next
  real(wp), parameter :: level_ratio = 0.25_wp ! guess
  integer, parameter :: most_levels = 7 ! conventional
  !> Part of the contacts that are not open which may slip at the level to begin at: some at the edge of contact slip at any level
  real(wp), parameter :: few = 0.1_wp ! guess

contains

  !> Find the peak of the solver's loads near an angular frequency, the linear peak's: at a level at which contacts still stick, or a
  !> small one, and then followed to the level asked for.
  subroutine begin_curve(solver, problem, omega, band, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Its parameter is set to the level here; its border is made here
    type(problem_type), intent(in) :: problem
    !> Angular frequency, rad/s; those that the peak lies between
    real(wp), intent(in) :: omega, band(2)
    type(curve_type), intent(out) :: self
    type(snapshot_type) :: start, last
    type(curve_type) :: way
    real(wp) :: target, level
    integer :: i
    logical :: begun, solved, sticks, drifts

    self%problem = problem
    self%band = band
    start = snapshot_of(solver)
    self%problem%parameter = parameter_level
    call set_border(self%problem, solver)
    target = solver%context%balance%level
    do i = 1, most_levels
      call solve_sticking(solver, omega, sticks, solved)
      if (solved .or. i == most_levels) exit
      call set_value(self%problem, solver, level_ratio*solver%context%balance%level)
    end do
    if (.not. solved) call solve_by_strategies(solver, omega)
    if (solver%report%converged) call self%find_near(solver)
    begun = self%found
    if (begun) then
      self%may_step_over = .false.
      call self%go_to(solver, target)
      self%may_step_over = .true.
      if (self%found) return
    end if
    way = self
    last = snapshot_of(solver)
    level = solver%context%balance%level
    call set_value(self%problem, solver, target)
    drifts = begun .and. .not. has_time_integrator(solver)
    if (drifts) then
      ! Before a sweep of many contacts, which is dear.
      call solve_by_strategies(solver, solver%omega)
      drifts = solver%evidence%is_drifting
    end if
    call restore(solver, start)
    solver%omega = merge(last%omega, omega, drifts)
    call self%sweep_here(solver, drifts)
    if (self%found .or. self%ending /= ending_not_found .or. .not. begun) return
    self = way
    call set_value(self%problem, solver, level)
    call restore(solver, last)
    call self%go_to(solver, target)
  end subroutine begin_curve

  !> The peak of the solver's loads near a motion, sliders as they are: by Newton's method, or climbed to.
  subroutine begin_curve_near(solver, problem, motion, omega, band, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Its border is made here
    type(problem_type), intent(in) :: problem
    !> Of this rank's rows [2 H + 1, rows]; angular frequency, rad/s; those that the peak lies between
    real(wp), intent(in) :: motion(:, :), omega, band(2)
    type(curve_type), intent(out) :: self

    self%problem = problem
    self%band = band
    call set_border(self%problem, solver)
    solver%motion = motion
    solver%omega = omega
    solver%all_stick = .false.
    call self%find_near(solver)
  end subroutine begin_curve_near

  !> Solve where all contacts stick, or but a few, once sliders that stood at their limit have moved.
  subroutine solve_sticking(solver, omega, sticks, solved)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Do all contacts stick? Is it solved, and do no more than a few of them slip?
    logical, intent(out) :: sticks, solved
    type(snapshot_type) :: before

    call solver%solve_stuck_at(omega, sticks)
    solved = sticks
    if (sticks) return
    before = snapshot_of(solver)
    call solver%solve_at(omega, early_stop=.true.)
    sticks = solver%report%converged .and. solver%all_stick
    solved = sticks
    if (solver%report%converged .and. .not. sticks) solved = share_of_slipping(solver) <= few
    if (solved) return
    call restore(solver, before)
    ! Lower loads may leave them stuck.
    solver%all_stick = .true.
  end subroutine solve_sticking

  !> Part of the contacts that are not open all over the period which slip.
  real(wp) function share_of_slipping(solver) result(share)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp) :: counts(2)

    associate (forces => solver%context%balance%forces)
      counts = [count(forces%open < 1.0_wp .and. forces%slip > 0.0_wp), count(forces%open < 1.0_wp)]
    end associate
    call solver%context%balance%ranks%sum(counts)
    share = counts(1)/max(counts(2), 1.0_wp)
  end function share_of_slipping

  !> The border that belongs to a frequency.
  subroutine set_border(problem, solver)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(inout) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    if (allocated(problem%border%motion)) deallocate (problem%border%motion)
    allocate (problem%border%motion, mold=solver%motion)
    problem%border%motion = 0.0_wp
    problem%border%frequency = 1.0_wp/solver%context%frequency_scale
  end subroutine set_border
end module attrito_peak_first_peak
