!> Orbits between located events, of contacts that slip along one tangent at most: along a balance's motion, or marched event-exactly.
module attrito_stability_event_orbit
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_open
  use attrito_integrate_flow, only: flow_one_period
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_recorder, only: recorder_type, new_recorder
  use attrito_integrate_segment, only: segment_type, new_segment
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_integrate_taylor, only: degree
  use attrito_stability_balance_motion, only: balance_motion_type
  use attrito_stability_smooth_segments, only: orbit_segments_type, segments_of_motion, segments_of_trace
  use attrito_stability_monodromy, only: monodromy_of_segments => monodromy
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_perturbation, only: memory_of, memory_type
  use attrito_stability_reduced, only: reduced_type
  implicit none
  private
  public :: event_orbit_type, march_freely

  !> Shorter segments are rounding where two switches fall together: a contact may stick for that long between landing and slip
  real(wp), parameter :: no_time = 1.0e-12_wp ! derived

  type, extends(orbit_type) :: event_orbit_type
    type(orbit_segments_type) :: segments
    !> What it comes from: a balance's motion, or else motion in time from a state
    type(balance_motion_type), allocatable :: balance
    type(state_type) :: start
  contains
    procedure :: take_balance
    procedure :: march
    procedure :: apply_law
    procedure :: monodromy
    procedure :: regimes
  end type event_orbit_type

contains

  subroutine take_balance(self, system, loading, balance)
    class(event_orbit_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance

    self%balance = balance
    self%period = loading%period
    call segments_of_motion(system%law, balance%grid, balance%motion, balance%slider(1, :), self%segments)
    call describe(self, system)
  end subroutine take_balance

  subroutine march(self, system, loading, state, range, converged, trajectory)
    class(event_orbit_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where the period begins, then where it ends
    type(state_type), intent(inout) :: state
    !> Half range of the motion over the period, in the norm of the mass matrix
    real(wp), intent(out) :: range
    !> Was the period marched to its end?
    logical, intent(out) :: converged
    !> Modal displacement at equal instants, from the period's beginning [m, instants]
    real(wp), intent(out), optional :: trajectory(:, :)
    type(recorder_type) :: recorder
    integer :: instants

    instants = 0
    if (present(trajectory)) instants = size(trajectory, 2)
    recorder = new_recorder(system, max(1, instants), instants)
    recorder%traces = .true.
    recorder%samples = present(trajectory)
    if (present(trajectory)) allocate (recorder%trajectory(size(state%motion), instants))
    self%start = state
    self%period = loading%period
    if (allocated(self%balance)) deallocate (self%balance)
    call flow(system, loading, state, recorder, range)
    converged = all(abs(state%motion) < huge(1.0_wp))
    if (.not. converged) return
    if (present(trajectory)) trajectory = recorder%trajectory
    call segments_of_trace(system%law, recorder%trace, loading%period, self%segments)
    call describe(self, system)
  end subroutine march

  !> Where it is of motion in time, in the period that begins where the orbit's does.
  subroutine apply_law(self, system, loading)
    class(event_orbit_type), intent(inout) :: self
    !> Linear system in time, with the changed laws
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    type(state_type) :: state
    type(balance_motion_type) :: balance
    real(wp) :: range
    logical :: converged

    if (allocated(self%balance)) then
      balance = self%balance
      call self%take_balance(system, loading, balance)
    else
      state = self%start
      call self%march(system, loading, state, range, converged)
    end if
  end subroutine apply_law

  function monodromy(self, reduced, parts, kept) result(matrix)
    class(event_orbit_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Equal parts of the period of which the first is taken; what is remembered at its end
    integer, intent(in), optional :: parts
    type(memory_type), intent(in), optional :: kept(:)
    real(wp), allocatable :: matrix(:, :)

    matrix = monodromy_of_segments(reduced, self%segments, self%period, parts, kept)
  end function monodromy

  pure function regimes(self, contact) result(list)
    class(event_orbit_type), intent(in) :: self
    !> Number of the contact
    integer, intent(in) :: contact
    integer, allocatable :: list(:)
    integer :: i

    allocate (list(0))
    do i = 1, size(self%segments%segment)
      associate (segment => self%segments%segment(i))
        if (segment%length <= no_time) cycle
        select case (segment%regime(contact))
         case (regime_stick)
          list = [list, 0]
         case (regime_open)
          list = [list, 2]
         case default
          list = [list, segment%side(contact)]
        end select
      end associate
    end do
  end function regimes

  !> What every kind of orbit says of itself.
  pure subroutine describe(self, system)
    class(event_orbit_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    integer :: i, j

    associate (segments => self%segments%segment)
      self%stuck = self%segments%stuck
      self%closed = [(all([(segments(j)%regime(i) /= regime_open, j=1, size(segments))]), i=1, size(self%stuck))]
      self%regime = segments(1)%regime
      self%memory = memory_of(system%law, self%stuck, self%regime)
    end associate
  end subroutine describe

  !> March one period from a state, and keep nothing of it.
  subroutine march_freely(system, loading, state, range)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Half range of the motion over the period, in the norm of the mass matrix
    real(wp), intent(out) :: range
    type(recorder_type) :: recorder

    recorder = new_recorder(system, 1, 0)
    call flow(system, loading, state, recorder, range)
  end subroutine march_freely

  subroutine flow(system, loading, state, recorder, range)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> History of motion and forces
    type(recorder_type), intent(inout) :: recorder
    !> Half range of the motion over the period, in the norm of the mass matrix
    real(wp), intent(out) :: range
    type(segment_type) :: segment
    real(wp) :: low(size(state%motion)), high(size(state%motion))

    segment = new_segment(size(state%motion), size(system%springs), size(system%law), degree)
    call flow_one_period(system, loading, state, segment, recorder, low, high)
    range = 0.5_wp*norm2(high - low)
  end subroutine flow
end module attrito_stability_event_orbit
