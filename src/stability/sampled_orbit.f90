!> Orbits by samples, of contacts that slip along one tangent or two: along a balance's motion, or marched in exponential steps.
module attrito_stability_sampled_orbit
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_schemes, only: scheme_type, new_scheme, start_scheme, step_scheme, scheme_exponential
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_balance_motion, only: balance_motion_type
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_perturbation, only: memory_of, memory_type
  use attrito_stability_reduced, only: reduced_type
  use attrito_stability_sampled_monodromy, only: sampled_monodromy
  use attrito_stability_sampled_motion, only: sampled_motion_type, motion_of_harmonics
  use attrito_stability_sampled_steps, only: sampled_steps_type, new_sampled_steps
  implicit none
  private
  public :: sampled_orbit_type

  type, extends(orbit_type) :: sampled_orbit_type
    !> Of the contacts, with their sliders at its beginning [2, contacts], and what they do on it
    type(sampled_motion_type) :: motion
    real(wp), allocatable :: slider(:, :)
    type(sampled_steps_type) :: steps
  contains
    procedure :: take_balance
    procedure :: march
    procedure :: apply_law
    procedure :: monodromy
    procedure :: regimes
  end type sampled_orbit_type

contains

  subroutine take_balance(self, system, loading, balance)
    class(sampled_orbit_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance

    self%period = loading%period
    self%motion = motion_of_harmonics(balance%motion, self%samples)
    self%slider = balance%slider
    call self%apply_law(system, loading)
  end subroutine take_balance

  !> In as many exponential steps as there are samples.
  subroutine march(self, system, loading, state, range, converged, trajectory)
    class(sampled_orbit_type), intent(inout) :: self
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
    !> Modal displacement at equal instants, from the period's beginning [m, a divisor of the samples]
    real(wp), intent(out), optional :: trajectory(:, :)
    type(scheme_type) :: scheme
    type(sampled_motion_type) :: motion
    real(wp) :: low(size(state%motion)), high(size(state%motion))
    integer :: step, spacing

    if (present(trajectory)) spacing = self%samples/size(trajectory, 2)
    call new_scheme(system, scheme_exponential, self%samples, loading%period, -1.0_wp, scheme)
    call start_scheme(scheme, system, loading, state)
    allocate (motion%displacement(0:self%samples, size(system%springs)), motion%rate(0:self%samples, size(system%springs)))
    low = state%motion
    high = state%motion
    do step = 0, self%samples
      if (step > 0) call step_scheme(scheme, system, loading, state, step/self%samples, modulo(step, self%samples)*scheme%h, &
                                     converged)
      converged = all(abs(state%motion) < huge(1.0_wp)) .and. (step == 0 .or. converged)
      if (.not. converged) return
      motion%displacement(step, :) = matmul(state%motion, system%rows)
      motion%rate(step, :) = matmul(state%rate, system%rows)*scheme%h
      low = min(low, state%motion)
      high = max(high, state%motion)
      if (.not. present(trajectory)) cycle
      if (step < self%samples .and. modulo(step, spacing) == 0) trajectory(:, step/spacing + 1) = state%motion
    end do
    range = 0.5_wp*norm2(high - low)
    self%period = loading%period
    self%motion = motion
    self%slider = state%slider
    call self%apply_law(system, loading)
  end subroutine march

  !> Along the motion that is known.
  subroutine apply_law(self, system, loading)
    class(sampled_orbit_type), intent(inout) :: self
    !> Linear system in time, with the changed laws
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading

    call new_sampled_steps(system%law, self%motion, self%slider, self%steps)
    self%stuck = self%steps%stuck
    self%closed = self%steps%closed
    self%regime = self%steps%regime(:, 1)
    self%memory = memory_of(system%law, self%stuck, self%regime)
    self%periodic = self%steps%periodic
  end subroutine apply_law

  function monodromy(self, reduced, parts, kept) result(matrix)
    class(sampled_orbit_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Equal parts of the period of which the first is taken; what is remembered at its end
    integer, intent(in), optional :: parts
    type(memory_type), intent(in), optional :: kept(:)
    real(wp), allocatable :: matrix(:, :)

    matrix = sampled_monodromy(reduced, self%steps, self%period, parts, kept)
  end function monodromy

  pure function regimes(self, contact) result(list)
    class(sampled_orbit_type), intent(in) :: self
    !> Number of the contact
    integer, intent(in) :: contact
    integer, allocatable :: list(:)

    list = merge(2, merge(1, 0, self%steps%regime(contact, :) == regime_slip), self%steps%regime(contact, :) == regime_open)
  end function regimes
end module attrito_stability_sampled_orbit
