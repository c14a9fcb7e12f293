!> C interface of peaks followed in a parameter. All calls are collective and give every rank the same.
module attrito_api_peak
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: resized
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_point_errors, only: point_errors_type
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_report_type
  use attrito_output_point_report, only: report_point
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_peak_condition, only: problem_type, value_of
  use attrito_peak_curve, only: follow_parameter
  use attrito_peak_endings, only: ending_none, ending_not_found
  use attrito_peak_peak_error, only: estimate_peak_errors, peak_errors_type
  use attrito_peak_first_peak, only: begin_curve, begin_curve_near
  use attrito_api_session, only: session_type, session_of
  use attrito_api_solver, only: point_type, point_of
  implicit none
  private
  public :: peak_type

  type, bind(c) :: peak_type
    type(point_type) :: point
    !> Value of the parameter; amplitude of the monitor, how it changes with the parameter along the peaks, and with omega twice
    real(c_double) :: parameter, amplitude, slope, curvature
    !> Estimated relative errors of its amplitude and of its frequency; NaN: not known
    real(c_double) :: amplitude_error, frequency_error
    !> Evaluations of the balance since the session began; why there is no peak, as endings are counted; is it a corner?
    integer(c_int) :: evaluations, ending, at_corner
  end type peak_type

contains

  !> Find the peak of a monitor (from 0) at a level, near an angular frequency; sweeps go from start to stop. The static path has been
  !> followed. `static_factors` [loads] are those at preload 1.
  subroutine attrito_begin_peak(handle, monitor, measure, loads, static_factors, omega, start, stop, level, branch, peak) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Monitor, from 0; which amplitude, as names are counted; number of static loads; number of the branch
    integer(c_int), value :: monitor, measure, loads, branch
    !> Factors on the static loads
    real(c_double), intent(in) :: static_factors(loads)
    !> Angular frequency, rad/s; end of the range, rad/s; factor on the loads
    real(c_double), value :: omega, start, stop, level
    !> Peak, reported
    type(peak_type), intent(out) :: peak
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%solver%set_loads(session%solver%context%balance%static_factors, level)
    call session%solver%set_scales(start, stop)
    call begin_curve(session%solver, problem_type(monitor=monitor + 1, measure=measure, static_factors=static_factors), omega, &
                     [start, stop], session%peak)
    call describe(session, branch, peak)
  end subroutine attrito_begin_peak

  !> The same near a motion of the model's coordinates [m, coefficients], at a level and a preload, sliders where they are.
  subroutine attrito_begin_peak_near(handle, monitor, measure, loads, static_factors, omega, start, stop, level, preload, &
                                     coefficients, coordinates, branch, peak) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    integer(c_int), value :: monitor, measure, loads, coefficients, branch
    !> Factors on the static loads; motion of the model's coordinates
    real(c_double), intent(in) :: static_factors(loads), coordinates(coefficients, *)
    !> Angular frequency, rad/s; end of the range, rad/s; factor on the loads
    real(c_double), value :: omega, start, stop, level, preload
    !> Peak, reported
    type(peak_type), intent(out) :: peak
    type(session_type), pointer :: session
    real(wp), allocatable :: motion(:, :)

    session => session_of(handle)
    associate (solver => session%solver, balance => session%solver%context%balance)
      call solver%set_loads(preload*static_factors, level)
      call solver%set_scales(start, stop)
      motion = solver%relative_motion(coordinates(:, :size(session%structure%mass, 1)))
      call begin_curve_near(solver, problem_type(monitor=monitor + 1, measure=measure, static_factors=static_factors), &
                            resized(motion, size(solver%motion, 1)), omega, [start, stop], session%peak)
    end associate
    call describe(session, branch, peak)
  end subroutine attrito_begin_peak_near

  !> Motion of the model's coordinates at the last point [m, coefficients].
  subroutine attrito_coordinates(handle, coefficients, coordinates) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Coefficients of each row, 2 H + 1
    integer(c_int), value :: coefficients
    !> Motion of the model's coordinates
    real(c_double), intent(out) :: coordinates(coefficients, *)
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (balance => session%solver%context%balance)
      coordinates(:, :size(session%structure%mass, 1)) = balance%receptance%displacements(balance%response)
    end associate
  end subroutine attrito_coordinates

  !> Follow it in the level (0) or the preload (1) from here on.
  subroutine attrito_follow_peak_in(handle, parameter, branch, peak) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Parameter that is followed, or its value; number of the branch
    integer(c_int), value :: parameter, branch
    !> Peak, reported
    type(peak_type), intent(out) :: peak
    type(session_type), pointer :: session

    session => session_of(handle)
    call follow_parameter(session%peak, session%solver, parameter)
    call describe(session, branch, peak)
  end subroutine attrito_follow_peak_in

  !> One step along the curve of peaks, or just to a value of the parameter, where it has finished.
  subroutine attrito_next_peak(handle, stop, branch, peak) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> End of the range, rad/s
    real(c_double), value :: stop
    !> Number of the branch
    integer(c_int), value :: branch
    !> Peak, reported
    type(peak_type), intent(out) :: peak
    type(session_type), pointer :: session
    logical :: reached

    session => session_of(handle)
    call session%peak%advance(session%solver, stop, reached)
    call describe(session, branch, peak)
    peak%point%finished = merge(1, 0, reached .or. .not. session%peak%found)
    peak%point%reached_stop = merge(1, 0, reached .and. session%peak%found)
  end subroutine attrito_next_peak

  !> The peak at a value of the parameter, by as many steps as it takes.
  subroutine attrito_peak_at(handle, value, branch, peak) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Value of the parameter
    real(c_double), value :: value
    !> Number of the branch
    integer(c_int), value :: branch
    !> Peak, reported
    type(peak_type), intent(out) :: peak
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%peak%go_to(session%solver, value)
    call describe(session, branch, peak)
  end subroutine attrito_peak_at

  subroutine describe(session, branch, peak)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Number of the branch
    integer, intent(in) :: branch
    !> Peak, reported
    type(peak_type), intent(out) :: peak
    type(newton_report_type) :: ended
    type(finer_point_type) :: finer
    type(peak_errors_type) :: errors

    ! Why there is no peak is its ending, and no property of the point where the solver was left.
    if (.not. session%peak%found) session%solver%evidence = evidence_type()
    ended = session%solver%report
    ended%converged = session%peak%found
    ended%iterations = session%peak%iterations
    ! At the peak's frequency, whatever was held when it was found.
    session%solver%context%constraint = constraint_type(0.0_wp*session%solver%motion)
    call session%accuracy%estimate(session%solver, ended%converged, finer)
    call report_point(session%solver, ended, branch, session%accuracy%errors, session%accuracy%series%tolerance, session%point)
    ! Evaluations are those that peaks take, not their errors.
    peak%evaluations = session%solver%context%balance%evaluations
    if (ended%converged) call judge(session, errors)
    session%solver%context%balance%evaluations = peak%evaluations
    peak%point = point_of(session%point)
    peak%ending = session%peak%ending
    if (.not. session%peak%found .and. peak%ending == ending_none) peak%ending = ending_not_found
    peak%at_corner = merge(1, 0, session%peak%found .and. session%peak%at_corner)
    peak%parameter = value_of(session%peak%problem, session%solver)
    peak%amplitude = 0.0_wp
    peak%slope = 0.0_wp
    peak%curvature = 0.0_wp
    peak%amplitude_error = 0.0_wp
    peak%frequency_error = 0.0_wp
    if (.not. session%peak%found) return
    peak%amplitude_error = errors%amplitude
    peak%frequency_error = errors%frequency
    peak%amplitude = session%peak%point%amplitude%value
    peak%slope = session%peak%point%by_parameter_amplitude
    peak%curvature = session%peak%curvature()
  end subroutine describe

  !> The errors of the peak itself, which keep the tolerance as well as those of its point do, or not.
  subroutine judge(session, errors)
    !> Session behind a handle, at a peak
    type(session_type), intent(inout) :: session
    type(peak_errors_type), intent(out) :: errors
    type(point_errors_type) :: of_peak

    associate (findings => session%point%findings, tolerance => session%accuracy%series%tolerance)
      call estimate_peak_errors(session%finer_estimator, session%solver, session%peak%problem, session%peak%at_corner, &
                                session%accuracy%errors, errors)
      of_peak%harmonics = errors%amplitude
      findings%within_tolerance = findings%within_tolerance .and. of_peak%are_within(tolerance)
    end associate
  end subroutine judge
end module attrito_api_peak
