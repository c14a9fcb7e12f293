!> Marching one period with a scheme of fixed steps; the recorder sees each step as a cubic (Hermite) of the motion and forces
!> that are linear, so that extrema are located between steps, to the scheme's own order or better.
module attrito_integrate_march
  use attrito_core_kinds, only: wp
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_recorder, only: recorder_type, record
  use attrito_integrate_schemes, only: scheme_type, step_scheme
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: march_one_period

contains

  !> March a whole period; `events` of the state counts changes of regime.
  subroutine march_one_period(system, loading, scheme, state, segment, recorder, low, high, converged)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Scheme of integration, its parameters and matrices
    type(scheme_type), intent(inout) :: scheme
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Of degree 3
    type(segment_type), intent(inout) :: segment
    !> History of motion and forces
    type(recorder_type), intent(inout) :: recorder
    !> Smallest and largest modal displacement [m]
    real(wp), intent(out) :: low(:), high(:)
    !> .false.: an implicit step found no solution; the march ends there
    logical, intent(out) :: converged
    integer :: step, cycle, regime(size(state%regime))
    real(wp) :: theta

    low = state%motion
    high = state%motion
    converged = .true.
    do step = 1, scheme%steps
      cycle = state%cycle + step/scheme%steps
      theta = modulo(step, scheme%steps)*scheme%h
      regime = state%regime
      if (recorder%measures .or. recorder%samples) call begin(system, scheme, state, segment)
      call step_scheme(scheme, system, loading, state, cycle, theta, converged)
      if (.not. (converged .and. all(abs(state%motion) < huge(1.0_wp)))) then
        converged = .false.
        return
      end if
      if (recorder%measures .or. recorder%samples) then
        segment%cycle = state%cycle
        segment%theta = (step - 1)*scheme%h
        call finish(system, scheme, state, segment)
        call record(recorder, system, loading, segment)
      end if
      state%events = state%events + count(state%regime /= regime)
      low = min(low, state%motion)
      high = max(high, state%motion)
    end do
    state%cycle = state%cycle + 1
    state%theta = 0.0_wp
  end subroutine march_one_period

  !> What is known of a step before it is made.
  pure subroutine begin(system, scheme, state, segment)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Scheme of integration, its parameters and matrices
    type(scheme_type), intent(in) :: scheme
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment

    segment%length = scheme%h
    segment%regime = state%regime
    segment%motion(:, 0) = state%motion
    segment%motion(:, 1) = state%rate
    segment%load(:, 0) = scheme%load
    segment%force(0, :) = scheme%g + system%springs*scheme%displacement
  end subroutine begin

  !> The rest, once it is made.
  pure subroutine finish(system, scheme, state, segment)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Scheme of integration, its parameters and matrices
    type(scheme_type), intent(in) :: scheme
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment
    real(wp) :: change(size(state%motion)), h

    h = scheme%h
    change = (state%motion - segment%motion(:, 0))/h
    segment%motion(:, 2) = (3.0_wp*change - 2.0_wp*segment%motion(:, 1) - state%rate)/h
    segment%motion(:, 3) = (segment%motion(:, 1) + state%rate - 2.0_wp*change)/h**2
    segment%displacement = matmul(transpose(segment%motion), system%rows)
    segment%load(:, 1) = (scheme%load - segment%load(:, 0))/h
    segment%force(1, :) = (scheme%g + system%springs*scheme%displacement - segment%force(0, :))/h
  end subroutine finish
end module attrito_integrate_march
