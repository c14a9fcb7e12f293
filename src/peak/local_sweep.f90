!> The largest peak of a frequency response about a frequency, loads held, by a sweep: where no peak can be climbed to from nearby.
!>
!> The swept range becomes wider until the amplitude is largest within it, not at an end. A point of the sweep lies at every peak,
!> from which the peak is climbed to (`attrito_peak_climb`). Where the amplitude is largest beside frequencies without a periodic
!> motion, or to climb leads there, there is no peak: mean friction does not balance the mean forces there, and a body drifts.
!>
!> Where it is known to drift at the frequency of the last peak, and contacts are too many for time integration, so that a sweep is
!> dear, the same is concluded if the response rises towards that frequency from both sides.
module attrito_peak_local_sweep
  use attrito_core_kinds, only: wp
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_time_integration_start, only: has_time_integrator
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_continuation_tangent, only: frequency_tangent
  use attrito_peak_amplitude, only: amplitude_type, amplitude_of
  use attrito_peak_branch_end, only: look_beyond
  use attrito_peak_climb, only: branch_seed_type, climb, look_around
  use attrito_peak_condition, only: problem_type
  use attrito_peak_endings, only: ending_none, ending_not_found, ending_leaves_band, ending_no_periodic_motion
  implicit none
  private
  public :: sweep_for_peak

  !> Half the width of swept ranges, in turn, parts of the frequency; the whole band is swept after them
  real(wp), parameter :: half_widths(2) = [0.03_wp, 0.1_wp] ! guess
  !> Where a body drifts at the last peak's frequency: how far beside the response is looked at, in turn, parts of the frequency
  real(wp), parameter :: distances(3) = [0.01_wp, 0.03_wp, 0.1_wp] ! guess
  integer, parameter :: most_points = 300 ! conventional
  !> Newton's iterations after which a range is given up: a usual one takes 100 to 500, a frequency without a solution a thousand
  integer, parameter :: most_iterations = 2000 ! guess

  !> What a sweep has shown of a range
  type :: range_type
    !> Is the amplitude largest within it? At an end of it, all frequencies between solved? Beside frequencies that are not solved?
    logical :: inside = .false., at_end = .false., at_gap = .false.
    !> Is there no periodic motion at these?
    logical :: drifts = .false.
  end type range_type

  !> The highest point of a sweep, and how the sweep ended
  type :: highest_type
    type(snapshot_type) :: snapshot
    real(wp) :: amplitude = -1.0_wp
    !> Is it the first point, or as high as the last one that was solved?
    logical :: first = .false., last = .false.
    !> Was the stop reached without a frequency that is not solved? Is there no periodic motion where it ended?
    logical :: reached_stop = .false., drifts = .false.
  end type highest_type

contains

  !> From the solver's sliders to the largest peak about its frequency. The solver is at the peak, or anywhere if there is none.
  subroutine sweep_for_peak(problem, solver, band, drifts, iterations, found, at_corner, ending)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequencies that the peak lies between, rad/s
    real(wp), intent(in) :: band(2)
    !> Is a body known to drift at the solver's frequency?
    logical, intent(in) :: drifts
    !> Newton's iterations of all points
    integer, intent(out) :: iterations
    !> Is there a peak? Is it a corner?
    logical, intent(out) :: found, at_corner
    !> One of `ending_...`: why there is none
    integer, intent(out) :: ending
    type(snapshot_type) :: start
    type(range_type) :: range
    real(wp) :: ends(2)
    integer :: i, used
    logical :: ends_in_drift

    iterations = 0
    found = .false.
    at_corner = .false.
    ends_in_drift = .false.
    ending = ending_not_found
    start = snapshot_of(solver)
    if (drifts .and. .not. has_time_integrator(solver)) then
      call look_beside(problem, solver, iterations, ends_in_drift)
      if (ends_in_drift) then
        ending = ending_no_periodic_motion
        return
      end if
    end if
    do i = 1, size(half_widths) + 1
      call restore(solver, start)
      ends = [minval(band), maxval(band)]
      if (i <= size(half_widths)) ends = min(max(start%omega*(1.0_wp + half_widths(i)*[-1, 1]), ends(1)), ends(2))
      if (ends(1) >= ends(2)) cycle
      call find_highest(problem, solver, ends, range, used)
      iterations = iterations + used
      call solver%set_scales(minval(band), maxval(band))
      if (range%inside .or. (range%at_gap .and. .not. range%drifts)) then
        call climb(problem, solver, used, found, at_corner)
        iterations = iterations + used
        if (.not. found) then
          call look_beyond(problem, solver, iterations, found, ends_in_drift)
          at_corner = found
        end if
        ! Uphill of the range there may be no peak in the band.
        found = found .and. solver%omega >= minval(band) .and. solver%omega <= maxval(band)
      end if
      range%drifts = range%drifts .or. ends_in_drift
      if (found .or. ends_in_drift .or. (range%at_gap .and. range%drifts)) exit
    end do
    if (found) then
      ending = ending_none
    else if (range%drifts) then
      ending = ending_no_periodic_motion
    else if (range%at_end) then
      ending = ending_leaves_band
    end if
  end subroutine sweep_for_peak

  !> Does the response rise towards the solver's frequency from both sides? The solver stays where it is.
  subroutine look_beside(problem, solver, iterations, rises)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points
    type(solver_type), intent(inout) :: solver
    !> Counts on
    integer, intent(inout) :: iterations
    !> From both?
    logical, intent(out) :: rises
    type(snapshot_type) :: start
    type(branch_seed_type) :: here
    integer :: side, i

    start = snapshot_of(solver)
    do side = -1, 1, 2
      rises = .false.
      do i = 1, size(distances)
        call restore(solver, start)
        solver%evidence = evidence_type()
        call solve_by_strategies(solver, start%omega*(1.0_wp + side*distances(i)))
        iterations = iterations + solver%report%iterations
        if (.not. solver%report%converged) cycle
        call look_around(problem, solver, frequency_tangent(solver, -real(side, wp)), here, rises)
        rises = rises .and. here%slope > 0.0_wp
        exit
      end do
      if (.not. rises) exit
    end do
    call restore(solver, start)
    solver%evidence = evidence_type()
  end subroutine look_beside

  !> To the point of a range at which the amplitude is largest: by a sweep from one end to the other or to a frequency that is not
  !> solved, and then by one from the other end, so that of frequencies without a solution but the outermost are tried.
  subroutine find_highest(problem, solver, ends, range, iterations)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Least and greatest angular frequency, rad/s
    real(wp), intent(in) :: ends(2)
    type(range_type), intent(out) :: range
    !> Newton's iterations of all points
    integer, intent(out) :: iterations
    type(snapshot_type) :: start
    type(highest_type) :: sweeps(2)
    integer :: higher

    iterations = 0
    start = snapshot_of(solver)
    call sweep_to_gap(problem, solver, ends(1), ends(2), sweeps(1), iterations)
    if (.not. sweeps(1)%reached_stop) then
      call restore(solver, start)
      call sweep_to_gap(problem, solver, ends(2), ends(1), sweeps(2), iterations)
    end if
    higher = maxloc(sweeps%amplitude, 1)
    range%drifts = any(sweeps%drifts)
    associate (highest => sweeps(higher))
      if (highest%amplitude < 0.0_wp) return
      range%inside = .not. (highest%first .or. highest%last)
      range%at_gap = highest%last .and. .not. highest%reached_stop
      range%at_end = .not. (range%inside .or. range%at_gap .or. range%drifts)
      call restore(solver, highest%snapshot)
    end associate
  end subroutine find_highest

  !> A sweep up to its stop or to the first frequency that is not solved.
  subroutine sweep_to_gap(problem, solver, from, to, highest, iterations)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequencies to begin and to end at, rad/s
    real(wp), intent(in) :: from, to
    type(highest_type), intent(out) :: highest
    !> Counts on
    integer, intent(inout) :: iterations
    !> Of amplitudes where nothing but the mean position changes any more
    real(wp), parameter :: rounding = 1.0e-6_wp ! guess
    type(sweep_type) :: sweep
    type(amplitude_type) :: amplitude
    real(wp), allocatable :: monitors(:, :)

    sweep = new_sweep(solver, from, to, 1, most_points)
    sweep%to_gap = .true.
    do while (.not. sweep%finished .and. iterations < most_iterations)
      call sweep%advance(solver)
      iterations = iterations + solver%report%iterations
      if (.not. solver%report%converged) then
        highest%drifts = solver%evidence%no_periodic_solution
        return
      end if
      monitors = solver%context%balance%monitors%motion_of(solver%context%balance%response)
      amplitude = amplitude_of(monitors(:, problem%monitor), problem%measure)
      highest%last = amplitude%value >= (1.0_wp - rounding)*highest%amplitude
      if (amplitude%value <= highest%amplitude) cycle
      highest%amplitude = amplitude%value
      highest%first = sweep%points == 1
      call highest%snapshot%take(solver)
    end do
    highest%reached_stop = sweep%reached_stop
  end subroutine sweep_to_gap
end module attrito_peak_local_sweep
