!> The largest peak of a frequency response about a frequency, loads held, by a sweep: where no peak can be climbed to from nearby.
!>
!> The swept range becomes wider until the amplitude is largest within it, not at an end. A point of the sweep lies at every peak,
!> from which the peak is climbed to (`attrito_peak_climb`).
module attrito_peak_local_sweep
  use attrito_core_kinds, only: wp
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_peak_amplitude, only: amplitude_type, amplitude_of
  use attrito_peak_climb, only: climb
  use attrito_peak_condition, only: problem_type
  use attrito_peak_endings, only: ending_none, ending_not_found, ending_leaves_band, ending_no_periodic_motion
  implicit none
  private
  public :: sweep_for_peak

  !> Half the width of swept ranges, in turn, parts of the frequency; the whole band is swept after them
  real(wp), parameter :: half_widths(2) = [0.03_wp, 0.1_wp] ! guess
  integer, parameter :: most_points = 300 ! conventional
  !> Newton's iterations after which a range is given up: a usual one takes 100 to 500, a frequency without a solution a thousand
  integer, parameter :: most_iterations = 2000 ! guess

  !> What a sweep has shown of a range
  type :: range_type
    !> Is the amplitude largest within it? Or at an end of it, all points solved
    logical :: inside = .false., at_end = .false.
    !> Are there frequencies without periodic motion?
    logical :: drifts = .false.
  end type range_type

contains

  !> From the solver's sliders to the largest peak about its frequency. The solver is at the peak, or anywhere if there is none.
  subroutine sweep_for_peak(problem, solver, band, iterations, found, ending)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequencies that the peak lies between, rad/s
    real(wp), intent(in) :: band(2)
    !> Newton's iterations of all points
    integer, intent(out) :: iterations
    !> Is there a peak?
    logical, intent(out) :: found
    !> One of `ending_...`: why there is none, from the sweep of the whole band
    integer, intent(out) :: ending
    type(snapshot_type) :: start, highest
    type(range_type) :: range
    real(wp) :: ends(2)
    integer :: i, used

    iterations = 0
    found = .false.
    ending = ending_not_found
    start = snapshot_of(solver)
    do i = 1, size(half_widths) + 1
      call restore(solver, start)
      ends = [minval(band), maxval(band)]
      if (i <= size(half_widths)) ends = min(max(start%omega*(1.0_wp + half_widths(i)*[-1, 1]), ends(1)), ends(2))
      if (ends(1) >= ends(2)) cycle
      call find_highest(problem, solver, ends, highest, range, used)
      iterations = iterations + used
      call solver%set_scales(minval(band), maxval(band))
      if (range%inside) then
        call restore(solver, highest)
        call climb(problem, solver, used, found)
        iterations = iterations + used
        ! Uphill of the range there may be no peak in the band.
        found = found .and. solver%omega >= minval(band) .and. solver%omega <= maxval(band)
      end if
      if (found) exit
    end do
    if (found) then
      ending = ending_none
    else if (range%drifts) then
      ending = ending_no_periodic_motion
    else if (range%at_end) then
      ending = ending_leaves_band
    end if
  end subroutine sweep_for_peak

  !> The point of a sweep at which the amplitude is largest, and where that is in its range.
  subroutine find_highest(problem, solver, ends, highest, range, iterations)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequencies to begin and to end at, rad/s
    real(wp), intent(in) :: ends(2)
    !> That point
    type(snapshot_type), intent(out) :: highest
    type(range_type), intent(out) :: range
    !> Newton's iterations of all points
    integer, intent(out) :: iterations
    type(sweep_type) :: sweep
    type(amplitude_type) :: amplitude
    real(wp), allocatable :: monitors(:, :)
    real(wp) :: largest
    logical :: all_solved

    iterations = 0
    largest = -1.0_wp
    all_solved = .true.
    sweep = new_sweep(solver, ends(1), ends(2), 1, most_points)
    do while (.not. sweep%finished .and. iterations < most_iterations)
      call sweep%advance(solver)
      iterations = iterations + solver%report%iterations
      all_solved = all_solved .and. solver%report%converged
      range%drifts = range%drifts .or. solver%evidence%no_periodic_solution
      if (.not. solver%report%converged) cycle
      monitors = solver%context%balance%monitors%motion_of(solver%context%balance%response)
      amplitude = amplitude_of(monitors(:, problem%monitor), problem%measure)
      if (amplitude%value <= largest) cycle
      largest = amplitude%value
      call highest%take(solver)
      range%inside = sweep%points > 1 .and. .not. sweep%finished
    end do
    range%at_end = all_solved .and. sweep%reached_stop .and. .not. range%inside
  end subroutine find_highest
end module attrito_peak_local_sweep
