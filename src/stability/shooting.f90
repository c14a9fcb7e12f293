!> The event-exact periodic orbit near a balance's: Newton's method on the period map, its derivative the monodromy,
!>
!> $$ z \leftarrow z - (M(z) - 1)^{-1} (P(z) - z), \qquad z = (p, p', w). $$
!>
!> M is that of the first period, made anew only where a step does not shrink to a part of the one before. Unstable orbits are found
!> like stable ones. Sliders of contacts that stick throughout stay where they are; those of contacts
!> that slip or are open where the period begins follow the motion.
module attrito_stability_shooting
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: regime_slip
  use attrito_integrate_flow, only: flow_one_period
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_recorder, only: recorder_type, new_recorder
  use attrito_integrate_segment, only: segment_type, new_segment
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type
  use attrito_integrate_taylor, only: degree
  use attrito_stability_leg, only: orbit_legs_type, legs_of_trace
  use attrito_stability_monodromy, only: monodromy, free_sliders
  use attrito_stability_reduced, only: reduce_to
  implicit none
  private
  public :: shoot, march_period, march_unrecorded, march_recorded

  !> Most Newton steps, and the change that counts as none, relative to the state
  integer, parameter :: most_steps = 20 ! conventional
  !> Modes in the monodromy that Newton's method takes, at most
  integer, parameter :: most_modes = 100 ! conventional
  real(wp), parameter :: settled = 1.0e-12_wp ! derived
  !> Part to which a step shrinks while the monodromy is not made anew
  real(wp), parameter :: shrinks = 0.1_wp ! guess

contains

  !> Find the orbit from a state near it.
  subroutine shoot(system, loading, start, orbit, moved, found)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where the search starts, then where the orbit's period starts
    type(state_type), intent(inout) :: start
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(out) :: orbit
    !> How far from where it started, relative to the motion's half range over the period
    real(wp), intent(out) :: moved
    !> Is there an orbit?
    logical, intent(out) :: found
    type(state_type) :: first, end
    real(wp), allocatable :: inverse(:, :), step(:), full(:)
    integer, allocatable :: rows(:)
    real(wp) :: range, change, before
    integer :: iteration, m, modes, info

    m = size(start%motion)
    modes = min(m, most_modes)
    first = start
    found = .false.
    before = 0.0_wp
    change = huge(1.0_wp)
    do iteration = 1, most_steps
      end = start
      call march_period(system, loading, end, orbit, range)
      if (.not. (allocated(inverse) .and. change <= shrinks*before) .or. other_sliders()) then
        call invert(system, orbit, loading%period, modes, rows, inverse, info)
        if (info /= 0) exit
      end if
      before = change
      full = [end%motion - start%motion, end%rate - start%rate, end%slider(1, :) - start%slider(1, :)]
      step = -matmul(inverse, full(rows))
      ! Modes that are left out go where the period leaves them; sliders that are not free follow.
      full(2*m + 1:) = 0.0_wp
      full(rows) = step
      change = norm2(full(:2*m))
      if (.not. change <= 1.0e3_wp*range) exit
      call move(system, full, start)
      found = change <= settled*range
      if (found) exit
    end do
    moved = norm2(start%motion - first%motion)/range

  contains

    !> Are other sliders free than when the monodromy was made?
    logical function other_sliders()

      other_sliders = .not. allocated(rows)
      if (.not. other_sliders) other_sliders = size(rows) /= 2*modes + size(free_sliders(orbit))
      if (.not. other_sliders) other_sliders = any(rows(2*modes + 1:) /= 2*m + free_sliders(orbit))
    end function other_sliders
  end subroutine shoot

  !> (M - 1)^{-1} of a period in the lowest modes, and the components of the state that it takes.
  subroutine invert(system, orbit, period, modes, rows, inverse, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(in) :: orbit
    !> Length of the period, s
    real(wp), intent(in) :: period
    !> Number of modes
    integer, intent(in) :: modes
    !> Components of the state that it takes
    integer, allocatable, intent(out) :: rows(:)
    !> Inverse in the lowest modes
    real(wp), allocatable, intent(out) :: inverse(:, :)
    !> 0, or not: singular
    integer, intent(out) :: info
    real(wp), allocatable :: matrix(:, :)
    integer :: i, m

    m = size(system%eigenvalues)
    matrix = monodromy(reduce_to(system, modes), orbit, period)
    rows = [(i, i=1, modes), (m + i, i=1, modes), 2*m + free_sliders(orbit)]
    allocate (inverse(size(rows), size(rows)), source=0.0_wp)
    do i = 1, size(rows)
      matrix(i, i) = matrix(i, i) - 1.0_wp
      inverse(i, i) = 1.0_wp
    end do
    call solve_dense(matrix, inverse, info)
  end subroutine invert

  !> March one period from a state, and say what happened as legs.
  subroutine march_period(system, loading, state, orbit, range)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(out) :: orbit
    !> Half range of the motion over the period, in the norm of the mass matrix
    real(wp), intent(out) :: range
    type(recorder_type) :: recorder

    recorder = new_recorder(system, 1, 0)
    recorder%traces = .true.
    call march(system, loading, state, recorder, range)
    call legs_of_trace(system%law, recorder%trace, loading%period, orbit)
  end subroutine march_period

  !> March one period from a state.
  subroutine march_unrecorded(system, loading, state, range)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> As above
    real(wp), intent(out) :: range
    type(recorder_type) :: recorder

    recorder = new_recorder(system, 1, 0)
    call march(system, loading, state, recorder, range)
  end subroutine march_unrecorded

  !> March one period from a state, and sample the motion of the modes at equal instants [m, instants].
  subroutine march_recorded(system, loading, state, trajectory)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Motion of the modes at equal instants
    real(wp), intent(out) :: trajectory(:, :)
    type(recorder_type) :: recorder
    real(wp) :: range

    recorder = new_recorder(system, size(trajectory, 2), size(trajectory, 2))
    recorder%samples = .true.
    allocate (recorder%trajectory(size(trajectory, 1), size(trajectory, 2)))
    call march(system, loading, state, recorder, range)
    trajectory = recorder%trajectory
  end subroutine march_recorded

  subroutine march(system, loading, state, recorder, range)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> History of motion and forces
    type(recorder_type), intent(inout) :: recorder
    !> Half range of the motion
    real(wp), intent(out) :: range
    type(segment_type) :: segment
    real(wp) :: low(size(state%motion)), high(size(state%motion))

    segment = new_segment(size(state%motion), size(system%springs), size(system%law), degree)
    call flow_one_period(system, loading, state, segment, recorder, low, high)
    range = 0.5_wp*norm2(high - low)
  end subroutine march

  !> The state moved by a step, brought onto the law: contacts that slip go on slipping.
  subroutine move(system, full, state)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Of (motion, rate, sliders)
    real(wp), intent(in) :: full(:)
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    real(wp) :: slider(2, size(state%regime)), u
    integer :: i, m

    m = size(state%motion)
    slider = state%slider
    slider(1, :) = slider(1, :) + full(2*m + 1:)
    do i = 1, size(state%regime)
      if (state%regime(i) /= regime_slip) cycle
      ! Beyond the rim: it is put back onto it, on the side that it slips to.
      u = dot_product(system%rows(:, system%law(i)%first_row), state%motion + full(:m))
      slider(1, i) = u - 1.0e3_wp*(abs(u) + abs(state%slider(1, i) - u))*state%side(i)
    end do
    state = new_state(system, state%motion + full(:m), state%rate + full(m + 1:2*m), slider)
  end subroutine move
end module attrito_stability_shooting
