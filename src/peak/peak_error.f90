!> The errors of a peak by its series: of its amplitude, and of its frequency.
!>
!> A finer balance moves the response on either side of the peak as well as at it, so that its own peak is elsewhere along the
!> response. At the peak and at points of the response a length h to either side of it the finer balance is asked, in planes across
!> the response, for log A and omega. Through the three values goes a parabola, whose vertex
!>
!> $$ s_* = -a'/a'', \qquad a_* = a_0 - a'^2/(2 a''), \qquad a = \log A, $$
!>
!> is the finer peak; h is short, for contacts change their states near peaks. What the same makes of the three own points is taken
!> off. At a corner two straight lines meet instead, with the own slopes on either side; they are taken to move apart by a part of
!> what the corner moves by. The amplitude's change is no less than a part of that of the motion, as a point's is
!> (`attrito_accuracy_amplitude_change`), and the frequency's no less than what a change of phase as large as the amplitude's makes.
module attrito_peak_peak_error
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  use attrito_accuracy_amplitude_change, only: relative_change, share_of_motion
  use attrito_accuracy_error_estimate, only: error_estimate_type
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_kept_point, only: kept_point_type
  use attrito_accuracy_point_errors, only: point_errors_type, no_tolerance
  use attrito_accuracy_second_step, only: second_step_type
  use attrito_continuation_tangent, only: frequency_tangent
  use attrito_solve_snapshot, only: restore
  use attrito_solve_solver, only: solver_type
  use attrito_peak_amplitude, only: amplitude_of, amplitude_type
  use attrito_peak_climb, only: branch_seed_type, look_around, take_step
  use attrito_peak_condition, only: problem_type
  implicit none
  private
  public :: peak_errors_type, estimate_peak_errors

  !> h, a relative change of the motion: log A falls by h^2/2 on the circle of a single mode
  real(wp), parameter :: distance = 0.01_wp ! guess
  !> How far the parabola holds, and how far a peak may move, in lengths h
  real(wp), parameter :: reach = 2.0_wp, farthest = 10.0_wp ! guess
  !> From prediction to correction, relative to the motion
  real(wp), parameter :: accepted_error = 0.3_wp ! guess

  !> Relative errors of amplitude and frequency; NaN: not known
  type :: peak_errors_type
    real(wp) :: amplitude = 0.0_wp, frequency = 0.0_wp
  end type peak_errors_type

  !> The response before the peak, at it and beyond: coefficients of the monitor [k, -1:1], its amplitude, angular frequency
  type :: arc_type
    real(wp), allocatable :: monitor(:, :)
    real(wp) :: amplitude(-1:1) = 0.0_wp, omega(-1:1) = 0.0_wp
  contains
    procedure :: put
  end type arc_type

contains

  !> Of the peak at which the solver is; it stays there. If every contact sticks it is linear, and errs as the point does.
  subroutine estimate_peak_errors(estimator, solver, problem, at_corner, point_errors, errors)
    !> Finer balances, from one peak to the next
    type(error_estimate_type), intent(inout) :: estimator
    !> Solver of points, at the peak
    type(solver_type), intent(inout) :: solver
    !> Whose peak it is
    type(problem_type), intent(in) :: problem
    !> Does the amplitude rise on one side and fall on the other, with a corner?
    logical, intent(in) :: at_corner
    !> Of the point
    type(point_errors_type), intent(in) :: point_errors
    type(peak_errors_type), intent(out) :: errors
    type(kept_point_type) :: kept
    type(point_errors_type) :: same
    type(arc_type) :: arcs(3)
    real(wp) :: missing
    logical :: known(-1:1)

    errors%amplitude = point_errors%all()
    if (solver%all_stick) return
    call kept%take(solver, point_errors)
    call look_along(estimator, solver, problem, arcs, missing, known)
    errors = peak_errors_type(ieee_value(missing, ieee_quiet_nan), ieee_value(missing, ieee_quiet_nan))
    if (known(0)) then
      errors = change_of_peak(arcs(1), arcs(2), problem%measure, at_corner, all(known))
      errors = larger(errors, change_of_peak(arcs(1), arcs(3), problem%measure, at_corner, all(known)))
      errors%amplitude = max(errors%amplitude, missing) + point_errors%modes
    end if
    call kept%go_back(solver, same)
  end subroutine estimate_peak_errors

  !> The response about the peak: as it is, as a finer balance has it to first order, and after a second step, where there is one.
  subroutine look_along(estimator, solver, problem, arcs, missing, known)
    !> Finer balances
    type(error_estimate_type), intent(inout) :: estimator
    !> Solver of points, at the peak; which this moves
    type(solver_type), intent(inout) :: solver
    !> Whose peak it is
    type(problem_type), intent(in) :: problem
    type(arc_type), intent(out) :: arcs(3)
    !> What answers beyond the second would add, part of the motion
    real(wp), intent(out) :: missing
    !> Which of the three points are known
    logical, intent(out) :: known(-1:1)
    type(branch_seed_type) :: here
    type(finer_point_type) :: first
    type(second_step_type) :: second
    real(wp) :: error
    integer :: side, status, turn
    integer, parameter :: sides(3) = [0, -1, 1]

    missing = 0.0_wp
    known = .false.
    call solver%context%forget()
    call look_around(problem, solver, frequency_tangent(solver, 1.0_wp), here, known(0))
    if (.not. known(0)) return
    associate (balance => solver%context%balance)
      do turn = 1, 3
        side = sides(turn)
        call restore(solver, here%snapshot)
        call take_step(solver, here, side*distance*here%unit, error)
        known(side) = solver%report%converged .and. error <= accepted_error
        if (.not. known(side)) cycle
        call estimator%look_finer(solver, no_tolerance, first, second, status)
        known(side) = status == 0
        if (.not. known(side)) cycle
        call arcs(1)%put(side, balance%monitors%row_of(problem%monitor, balance%response), solver%omega, problem%measure)
        call arcs(2)%put(side, first%monitors(:, problem%monitor), first%omega, problem%measure)
        if (allocated(second%monitors)) then
          call arcs(3)%put(side, second%monitors(:, problem%monitor), second%omega, problem%measure)
        else
          call arcs(3)%put(side, first%monitors(:, problem%monitor), first%omega, problem%measure)
        end if
        missing = max(missing, second%missing)
      end do
    end associate
  end subroutine look_along

  !> Take one of the three points.
  subroutine put(self, side, monitor, omega, measure)
    class(arc_type), intent(inout) :: self
    !> -1, 0 or 1
    integer, intent(in) :: side
    !> Coefficients [2 K + 1]; angular frequency, rad/s
    real(wp), intent(in) :: monitor(:), omega
    !> Which amplitude
    integer, intent(in) :: measure
    real(wp), allocatable :: wider(:, :)
    integer :: k

    k = size(monitor)
    if (allocated(self%monitor)) k = max(k, size(self%monitor, 1))
    allocate (wider(k, -1:1), source=0.0_wp)
    if (allocated(self%monitor)) wider(:size(self%monitor, 1), :) = self%monitor
    wider(:size(monitor), side) = monitor
    call move_alloc(wider, self%monitor)
    self%amplitude(side) = measured(monitor, measure)
    self%omega(side) = omega
  end subroutine put

  !> From the peak of one arc to that of a finer one, relative to it.
  type(peak_errors_type) function change_of_peak(own, finer, measure, at_corner, is_whole) result(change)
    !> The response about the peak, and a finer one
    type(arc_type), intent(in) :: own, finer
    !> Which amplitude
    integer, intent(in) :: measure
    !> Is it a corner? Are the points on either side of the peak known?
    logical, intent(in) :: at_corner, is_whole
    real(wp) :: weights(-1:1), place, shift, height, sweep
    real(wp), allocatable :: before(:, :), after(:, :)

    weights = [0.0_wp, 1.0_wp, 0.0_wp]
    height = log(finer%amplitude(0)/own%amplitude(0))
    sweep = 0.0_wp
    shift = 0.0_wp
    if (is_whole) then
      call move_of_peak(log(own%amplitude), log(finer%amplitude), at_corner, shift, height)
      place = merge(0.0_wp, min(max(shift, -reach), reach), at_corner)
      weights = [0.5_wp*place*(place - 1.0_wp), 1.0_wp - place**2, 0.5_wp*place*(place + 1.0_wp)]
      sweep = 0.5_wp*abs(own%omega(1) - own%omega(-1))/own%omega(0)
    end if
    allocate (before(size(own%monitor, 1), 1), after(size(finer%monitor, 1), 1))
    before(:, 1) = own%monitor(:, 0)
    after(:, 1) = matmul(finer%monitor, weights)
    change%amplitude = max(abs(1.0_wp - exp(-height)), relative_change(before, after), &
                           abs(1.0_wp - own%amplitude(0)/measured(after(:, 1), measure)))
    change%frequency = max(abs(finer%omega(0)/own%omega(0) - 1.0_wp) + abs(shift)*sweep, change%amplitude*sweep/distance)
  end function change_of_peak

  !> Where on a finer arc, in lengths h from the own peak, its peak is, and by how much higher.
  pure subroutine move_of_peak(own, finer, at_corner, place, height)
    !> log A at the three points
    real(wp), intent(in) :: own(-1:1), finer(-1:1)
    !> Do two straight lines meet there?
    logical, intent(in) :: at_corner
    real(wp), intent(out) :: place, height
    real(wp), dimension(-1:1) :: change
    real(wp) :: slopes(2), own_place, own_height

    change = finer - own
    if (at_corner) then
      slopes = [own(0) - own(-1), own(1) - own(0)]
      place = 0.0_wp
      height = change(0)
      if (slopes(1) <= slopes(2)) return
      place = (change(1) - change(-1))/(slopes(1) - slopes(2))
      height = change(-1) + slopes(1)*place
      place = max(abs(place), share_of_motion*abs(change(0))/(slopes(1) - slopes(2)))
    else
      call find_vertex(own, own_place, own_height)
      call find_vertex(finer, place, height)
      place = place - own_place
      height = height - own_height
    end if
    place = min(max(place, -farthest), farthest)
  end subroutine move_of_peak

  !> The vertex of the parabola through values at -1, 0 and 1; its height within reach.
  pure subroutine find_vertex(values, place, height)
    real(wp), intent(in) :: values(-1:1)
    real(wp), intent(out) :: place, height
    real(wp) :: slope, bend

    slope = 0.5_wp*(values(1) - values(-1))
    bend = values(1) - 2.0_wp*values(0) + values(-1)
    place = sign(farthest, slope)
    if (bend < 0.0_wp) place = -slope/bend
    associate (at => min(max(place, -reach), reach))
      height = values(0) + at*(slope + 0.5_wp*bend*at)
    end associate
  end subroutine find_vertex

  !> The larger errors of two.
  pure type(peak_errors_type) function larger(one, other)
    type(peak_errors_type), intent(in) :: one, other

    larger = peak_errors_type(max(one%amplitude, other%amplitude), max(one%frequency, other%frequency))
  end function larger

  !> An amplitude of a monitor.
  pure real(wp) function measured(coefficients, measure)
    !> Fourier coefficients
    real(wp), intent(in) :: coefficients(:)
    !> Which amplitude
    integer, intent(in) :: measure

    type(amplitude_type) :: amplitude

    amplitude = amplitude_of(coefficients, measure)
    measured = amplitude%value
  end function measured
end module attrito_peak_peak_error
