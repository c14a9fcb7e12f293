!> What contacts do along a motion that is given as a Fourier series, from their sliders on: integration in time of coordinates that
!> are the contacts' own displacements, with the accelerations of that series as their only load and no force by contacts.
module attrito_stability_given_motion
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: regime_stick
  use attrito_integrate_flow, only: flow_one_period
  use attrito_integrate_loading, only: loading_type, new_loading, new_profile
  use attrito_integrate_recorder, only: recorder_type, trace_type, new_recorder
  use attrito_integrate_segment, only: segment_type, new_segment
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type
  use attrito_integrate_taylor, only: degree
  use attrito_model_contacts, only: contact_type
  use attrito_stability_balance_motion, only: balance_motion_type
  use attrito_stability_smooth_segments, only: orbit_segments_type, segments_of_trace
  implicit none
  private
  public :: segments_of_motion

  !> Periods that sliders are given to come back; part of the motion that a change over a period may be
  integer, parameter :: most_periods = 64 ! conventional
  real(wp), parameter :: no_change = 1.0e-11_wp ! derived

contains

  !> Segments of a period of all contacts; those that hold stick throughout.
  subroutine segments_of_motion(law, balance, segments, periodic)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance
    type(orbit_segments_type), intent(out) :: segments
    !> Do all sliders come back?
    logical, intent(out) :: periodic
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: state
    type(segment_type) :: segment
    type(recorder_type) :: recorder
    integer, allocatable :: moving(:), rows(:)
    real(wp), allocatable :: low(:), high(:), before(:, :)
    integer :: i, a, period

    moving = pack([(i, i=1, size(law))], .not. balance%holds)
    rows = [integer ::]
    do i = 1, size(moving)
      rows = [rows, (law(moving(i))%first_row + a, a=0, law(moving(i))%tangents)]
    end do
    call follow_series(balance%motion(:, rows), law(moving), balance%slider(:, moving), system, loading, state)
    segment = new_segment(size(rows), size(rows), size(moving), degree)
    allocate (low(size(rows)), high(size(rows)))
    do period = 1, most_periods
      before = state%slider
      recorder = new_recorder(system, 1, 0)
      recorder%traces = .true.
      call flow_one_period(system, loading, state, segment, recorder, low, high)
      periodic = all(abs(state%slider - before) <= no_change*maxval([0.0_wp, high - low]))
      if (periodic) exit
    end do
    call segments_of_trace(law, [(of_all(recorder%trace(i), moving, size(law)), i=1, recorder%stretches)], two_pi, segments)
  end subroutine segments_of_motion

  !> The motion as that of a system in time, at the start of its period.
  subroutine follow_series(motion, law, slider, system, loading, state)
    !> [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Sliders, as the contacts have them
    real(wp), intent(in) :: slider(:, :)
    type(system_type), intent(out) :: system
    type(loading_type), intent(out) :: loading
    type(state_type), intent(out) :: state
    real(wp) :: acceleration(size(motion, 2), size(motion, 1)), displacement(size(motion, 2)), rate(size(motion, 2))
    real(wp) :: constant(2, 0)
    integer :: rows, i, h

    rows = size(motion, 2)
    allocate (system%eigenvalues(rows), system%damping(rows), system%springs(rows), system%input_map(rows, rows), &
              system%rows(rows, rows), system%monitors(rows, 0), source=0.0_wp)
    do i = 1, rows
      system%rows(i, i) = 1.0_wp
    end do
    system%law = law
    i = 1
    do h = 1, size(law)
      system%law(h)%first_row = i
      i = i + law(h)%tangents + 1
    end do
    acceleration = 0.0_wp
    displacement = motion(1, :)
    rate = 0.0_wp
    do h = 1, size(motion, 1)/2
      acceleration(:, 2*h:2*h + 1) = -h**2*transpose(motion(2*h:2*h + 1, :))
      displacement = displacement + motion(2*h, :)
      rate = rate + h*motion(2*h + 1, :)
    end do
    loading = new_loading(1.0_wp, 1.0_wp, 0.0_wp*displacement, acceleration, new_profile(constant), new_profile(constant))
    state = new_state(system, displacement, rate, slider)
  end subroutine follow_series

  !> A stretch of some contacts as one of all, of which the others stick.
  pure type(trace_type) function of_all(trace, moving, contacts) result(whole)
    !> Of some contacts
    type(trace_type), intent(in) :: trace
    !> Which; number of all contacts
    integer, intent(in) :: moving(:), contacts

    whole%length = trace%length
    allocate (whole%regime(contacts), source=regime_stick)
    allocate (whole%side(contacts), source=0)
    allocate (whole%landing_slope(2, contacts), whole%from(2, contacts), whole%to(2, contacts), source=0.0_wp)
    whole%regime(moving) = trace%regime
    whole%side(moving) = trace%side
    whole%landing_slope(:, moving) = trace%landing_slope
    whole%from(:, moving) = trace%from
    whole%to(:, moving) = trace%to
    whole%slips = trace%slips
    whole%slips%contact = moving(trace%slips%contact)
  end function of_all
end module attrito_stability_given_motion
