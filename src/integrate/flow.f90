!> Event-exact marching: segments from event to event, each as long as its series holds.
!>
!> Rule for chattering. Several events at one instant are in order (contacts that change together, a start at the rim). More than
!> 8 + 4 contacts in a row without time going on mean that rounding decides, not the law: then the guards are left aside for 1e-9
!> of a period (an error of 1e-18 in the forces), the contacts are brought onto their law as a clamp would, and the report counts it.
module attrito_integrate_flow
  use attrito_core_kinds, only: wp
  use attrito_integrate_events, only: find_first_event, change_regime
  use attrito_integrate_loading, only: loading_type, next_knot
  use attrito_integrate_recorder, only: recorder_type, record
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_state, only: state_type, settle
  use attrito_integrate_system, only: system_type
  use attrito_integrate_taylor, only: expand, step_length, move_to
  implicit none
  private
  public :: flow_one_period

  !> Part of the period that a segment may take, so that the motion's range is seen at their ends
  real(wp), parameter :: longest_segment = 0.125_wp ! guess

contains

  !> March a whole period; what passes is shown to the recorder.
  subroutine flow_one_period(system, loading, state, segment, recorder, low, high)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Of degree `degree`
    type(segment_type), intent(inout) :: segment
    !> History of motion and forces
    type(recorder_type), intent(inout) :: recorder
    !> Smallest and largest modal displacement at the ends of segments [m]
    real(wp), intent(out) :: low(:), high(:)
    real(wp) :: rest
    integer :: contact, guard, in_a_row

    in_a_row = 0
    low = state%motion
    high = state%motion
    do
      rest = loading%period - state%theta
      if (rest <= 1.0e-14_wp*loading%period) exit
      call expand(system, loading, state, segment)
      segment%length = min(step_length(system, segment), rest, longest_segment*loading%period, &
                           next_knot(loading, state%cycle, state%theta))
      if (in_a_row > 8 + 4*size(system%law)) then
        segment%length = min(segment%length, 1.0e-9_wp*loading%period)
        contact = 0
      else
        call find_first_event(system, state, segment, contact, guard)
      end if
      if (recorder%measures .or. recorder%samples .or. recorder%traces) call record(recorder, system, loading, segment)
      call move_to(system, segment, state)
      ! What has run off to infinity has no events.
      if (.not. all(abs(state%motion) < huge(1.0_wp))) exit
      low = min(low, state%motion)
      high = max(high, state%motion)
      if (in_a_row > 8 + 4*size(system%law)) then
        call settle(system, state)
        state%chatter = state%chatter + 1
        in_a_row = 0
      else if (contact == 0) then
        state%zeros = 0
        in_a_row = 0
      else
        if (segment%length > 1.0e-13_wp*loading%period) then
          state%zeros = 0
          in_a_row = 0
        end if
        in_a_row = in_a_row + 1
        call change_regime(system, state, contact, guard)
        state%events = state%events + 1
      end if
    end do
    state%cycle = state%cycle + 1
    state%theta = 0.0_wp
  end subroutine flow_one_period
end module attrito_integrate_flow
