!> A periodic motion between located events, as its linearised flow sees it.
!>
!> An orbit comes from a balance's motion, or from a period of motion in time, which shooting makes periodic. Its monodromy matrix
!> says what a perturbation of motion, rate and of what contacts remember becomes in a period.
module attrito_stability_orbit
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
  use attrito_stability_given_motion, only: segments_of_motion
  use attrito_stability_monodromy, only: monodromy_of_segments => monodromy
  use attrito_stability_perturbation, only: memory_of, memory_type
  use attrito_stability_reduced, only: reduced_type
  use attrito_stability_smooth_segments, only: orbit_segments_type, segments_of_trace
  implicit none
  private
  public :: orbit_type, march_freely

  !> Shorter segments are rounding where two switches fall together: a contact may stick for that long between landing and slip
  real(wp), parameter :: no_time = 1.0e-12_wp ! derived

  type :: orbit_type
    !> Length of the period, units of the clock
    real(wp) :: period = 0.0_wp
    !> Contacts that stick throughout, and those that never open [contacts]
    logical, allocatable :: stuck(:), closed(:)
    !> What each contact does where the period begins [contacts], and what it remembers there
    integer, allocatable :: regime(:)
    type(memory_type), allocatable :: memory(:)
    !> Do all sliders come back?
    logical :: periodic = .true.
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
  end type orbit_type

contains

  !> The motion of a balance's point.
  subroutine take_balance(self, system, loading, balance)
    class(orbit_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance

    self%balance = balance
    self%period = loading%period
    call segments_of_motion(system%law, balance, self%segments, self%periodic)
    call describe(self, system)
  end subroutine take_balance

  !> A period of motion in time from a state.
  subroutine march(self, system, loading, state, range, converged, trajectory)
    class(orbit_type), intent(inout) :: self
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
    call segments_of_trace(system%law, recorder%trace(:recorder%stretches), loading%period, self%segments)
    call describe(self, system)
  end subroutine march

  !> What contacts do on the orbit if their law is slightly changed; in time, in the period that begins where the orbit's does.
  subroutine apply_law(self, system, loading)
    class(orbit_type), intent(inout) :: self
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

  !> What a unit change of each of (motion, rate by the clock, memory) becomes in a period, or in the first of several equal parts.
  function monodromy(self, reduced, parts, kept) result(matrix)
    class(orbit_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> How many parts; what is remembered at the end of the first, as at the beginning unless given
    integer, intent(in), optional :: parts
    type(memory_type), intent(in), optional :: kept(:)
    real(wp), allocatable :: matrix(:, :)

    matrix = monodromy_of_segments(reduced, self%segments, self%period, parts, kept)
  end function monodromy

  !> What a contact does in the period, in order: 0 stick, +1 and -1 slip (+1 along two tangents), 2 open.
  pure function regimes(self, contact) result(list)
    class(orbit_type), intent(in) :: self
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

  !> What its segments say of every contact.
  pure subroutine describe(self, system)
    class(orbit_type), intent(inout) :: self
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
end module attrito_stability_orbit
