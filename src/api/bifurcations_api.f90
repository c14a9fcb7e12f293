!> C interface of bifurcations: where a branch turns and where its multipliers cross the unit circle. Collective.
module attrito_api_bifurcations
  use, intrinsic :: iso_c_binding
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use attrito_core_kinds, only: wp, two_pi
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_continuation_turning_point, only: turning_point_type, locate_turning_point
  use attrito_output_point_report, only: report_point
  use attrito_stability_crossing, only: crossing_type, locate_crossings, crossing_flip, crossing_unit, crossing_pair, crossing_jump
  use attrito_stability_examine, only: examine_options_type
  use attrito_api_session, only: session_type, session_of, bifurcation_type
  implicit none
  private
  public :: bifurcation_report_type, fold, contact_fold, flip, neimark_sacker, branch_point, contact_crossing

  ! Kinds, listed by `attrito_describe`
  integer, parameter :: fold = 0, contact_fold = 1, flip = 2, neimark_sacker = 3, branch_point = 4, contact_crossing = 5

  type, bind(c) :: bifurcation_report_type
    integer(c_int) :: kind
    real(c_double) :: frequency_hz, uncertain_hz, re, im
  end type bifurcation_report_type

contains

  !> Find the bifurcations of the sweep's last step, in its order, and how many there are; the sweep goes on as if nothing had
  !> been asked. What stands of the last point must have been written. Crossings are those of the engines and the orbit that the
  !> last two points were examined by, if they were.
  integer(c_int) function attrito_find_bifurcations(handle, methods, orbit) result(count) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Sum of the engines, or one of them; whose orbit: see `attrito_describe`
    integer(c_int), value :: methods, orbit
    type(session_type), pointer :: session
    type(snapshot_type) :: here
    type(crossing_type), allocatable :: crossings(:)
    integer :: i

    session => session_of(handle)
    if (allocated(session%bifurcations)) deallocate (session%bifurcations)
    allocate (session%bifurcations(0))
    count = 0
    associate (solver => session%solver, sweep => session%sweep, step => session%sweep%stepper%last)
      if (.not. step%is_taken()) return
      if (step%length <= 0.0_wp) call step%end_at(solver)
      if (.not. (solver%all_stick .and. step%from%all_stick)) call sweep%look_ahead(solver)
      here = snapshot_of(solver)
      allocate (crossings(0))
      if (allocated(session%moduli(1)%value) .and. allocated(session%moduli(2)%value)) then
        call locate_crossings(solver, session%in_time, examine_options_type(methods, orbit, decide=.false.), step, &
                              session%moduli, crossings)
      end if
      do i = 1, size(crossings)
        call add_crossing(session, crossings(i))
      end do
      if (sweep%stepper%turned) call add_turning_point(session)
      call restore(solver, here)
    end associate
    count = size(session%bifurcations)
  end function attrito_find_bifurcations

  !> A crossing by the names that it has here.
  subroutine add_crossing(session, crossing)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Crossing of the unit circle
    type(crossing_type), intent(in) :: crossing
    integer :: kind

    select case (crossing%kind)
     case (crossing_flip)
      kind = flip
     case (crossing_unit)
      kind = branch_point
     case (crossing_pair)
      kind = neimark_sacker
     case default  ! crossing_jump
      kind = contact_crossing
    end select
    session%bifurcations = [session%bifurcations, bifurcation_at(session, kind, crossing%snapshot, crossing%uncertain, &
                                                                 crossing%multiplier)]
  end subroutine add_crossing

  !> Locate the step's turning point. A multiplier that passes 1 there, or jumps, is its own.
  subroutine add_turning_point(session)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    type(turning_point_type) :: turning
    type(bifurcation_type) :: point
    complex(wp) :: multiplier
    integer :: i

    associate (step => session%sweep%stepper%last)
      call restore(session%solver, step%from)
      call locate_turning_point(session%solver, step, step%across, session%sweep%stepper%tangent, turning)
    end associate
    multiplier = cmplx(ieee_value(1.0_wp, ieee_quiet_nan), ieee_value(1.0_wp, ieee_quiet_nan), wp)
    if (turning%smooth) multiplier = 1.0_wp
    point = bifurcation_at(session, merge(fold, contact_fold, turning%smooth), turning%snapshot, turning%uncertain, multiplier)
    do i = 1, size(session%bifurcations)
      if (all(session%bifurcations(i)%kind /= [branch_point, contact_crossing])) cycle
      session%bifurcations(i) = point
      return
    end do
    session%bifurcations = [session%bifurcations, point]
  end subroutine add_turning_point

  !> A bifurcation at a place, with the monitors there.
  function bifurcation_at(session, kind, snapshot, uncertain, multiplier) result(point)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Numbers of the kinds
    integer, intent(in) :: kind
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: snapshot
    !> What is left open of the frequency, Hz
    real(wp), intent(in) :: uncertain
    !> Multiplier that crosses
    complex(wp), intent(in) :: multiplier
    type(bifurcation_type) :: point
    integer :: status

    point%kind = kind
    point%uncertain_hz = uncertain/two_pi
    point%multiplier = multiplier
    call restore(session%solver, snapshot)
    call session%solver%context%balance%evaluate(snapshot%motion, snapshot%omega, status)
    call report_point(session%solver, session%solver%report, session%sweep%branch, session%accuracy%errors, &
                      session%accuracy%series%tolerance, point%point)
    call session%solver%context%forget()
  end function bifurcation_at

  !> One of those found, from 0, and the amplitudes of the monitors there.
  subroutine attrito_bifurcation(handle, i, report, amplitude) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of the bifurcation, from 0
    integer(c_int), value :: i
    !> What is found
    type(bifurcation_report_type), intent(out) :: report
    !> Amplitudes of the monitors
    real(c_double), intent(out) :: amplitude(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (bifurcation => session%bifurcations(i + 1))
      report = bifurcation_report_type(bifurcation%kind, bifurcation%point%frequency_hz, bifurcation%uncertain_hz, &
                                       real(bifurcation%multiplier, wp), aimag(bifurcation%multiplier))
      amplitude(:size(bifurcation%point%amplitude)) = bifurcation%point%amplitude
    end associate
  end subroutine attrito_bifurcation
end module attrito_api_bifurcations
