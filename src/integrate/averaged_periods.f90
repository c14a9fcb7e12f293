!> A start for Newton's method by time integration: the average over some periods,
!>
!> $$ d_h = \frac{2}{P J} \sum_{j=1}^{P J} d(t_j) e^{-i h \omega t_j} \quad (h > 0), \qquad t_j = \frac{2 \pi j}{J \omega}, $$
!>
!> half of it for h = 0, and the mean of the sliders at the ends of these P periods. Where motion in time settles to no orbit of
!> the excitation's period, drifts or takes several periods, the balance mostly has a solution, and the average is near it. It only
!> has to be near: steps are coarse, and a loss factor acts as the modal damping that dissipates as much at resonance.
module attrito_integrate_averaged_periods
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: harmonics_at
  use attrito_model_contacts, only: contacts_type
  use attrito_model_structure, only: structure_type, damping_loss_factor, damping_ratio
  use attrito_solve_rigid_drift, only: steps_repeat, alike_in_time
  use attrito_solve_time_integrator, only: time_integrator_type, excitation_type, periods_type
  use attrito_integrate_loading, only: loading_type, new_loading, new_profile
  use attrito_integrate_schemes, only: scheme_type, new_scheme, start_scheme, step_scheme, scheme_exponential
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type, new_system
  implicit none
  private
  public :: averaged_periods_type, new_averaged_periods

  !> Periods in which transients fade
  integer, parameter :: periods_before = 5 ! guess
  !> Steps a period, unless harmonics ask for more
  integer, parameter :: fewest_steps = 64, steps_per_harmonic = 8 ! guess
  !> How much finer steps are taken, and how often, where a period changes the motion by more than this part of its first harmonic:
  !> it grows by the scheme, not by what moves
  integer, parameter :: most_tries = 3 ! conventional
  real(wp), parameter :: finer = 1.4_wp, largest_change = 1.0_wp ! guess

  !> Relative error of each step's equilibrium: sliders of contacts that come to rest keep it
  real(wp), parameter :: near_enough = 1.0e-13_wp ! derived

  type, extends(time_integrator_type) :: averaged_periods_type
    type(structure_type) :: structure
    type(contacts_type) :: contacts
    !> Diagonalised when it is first needed
    type(system_type), allocatable :: system
    type(state_type) :: state
  contains
    procedure :: set_state
    procedure :: average_over
  end type averaged_periods_type

contains

  !> Motion in time of structure and contacts.
  function new_averaged_periods(structure, contacts) result(self)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    type(averaged_periods_type) :: self

    self%structure = structure
    if (structure%damping_kind == damping_loss_factor) then
      self%structure%damping_kind = damping_ratio
      self%structure%damping_value = 0.5_wp*structure%damping_value
    end if
    self%contacts = contacts
  end function new_averaged_periods

  !> Set the state, at the start of a period of the excitation.
  subroutine set_state(self, displacement, velocity, slider, is_set)
    class(averaged_periods_type), intent(inout) :: self
    !> Displacement of the coordinates; velocity of the coordinates; sliders, as the contacts have them
    real(wp), intent(in) :: displacement(:), velocity(:), slider(:, :)
    !> .false.: motions without mass, for instance; see `new_system`
    logical, intent(out) :: is_set
    type(error_type), allocatable :: error

    if (.not. allocated(self%system)) then
      allocate (self%system)
      call new_system(self%structure, self%contacts, self%system, error)
      if (allocated(error)) deallocate (self%system)
    end if
    is_set = allocated(self%system)
    if (.not. is_set) return
    self%state = new_state(self%system, matmul(displacement, self%system%weighted), &
                           matmul(velocity, self%system%weighted)/self%system%clock, slider)
  end subroutine set_state

  !> Integrate over some periods in which transients fade, and average over some more. Steps that resonate with a stiff mode grow
  !> without bounds: then other ones are taken.
  subroutine average_over(self, excitation, harmonics, count, periods)
    class(averaged_periods_type), intent(inout) :: self
    !> Loads of the motion in time
    type(excitation_type), intent(in) :: excitation
    !> Highest harmonic, H; number of roots or periods
    integer, intent(in) :: harmonics, count
    !> Averages over periods of the motion in time
    type(periods_type), intent(out) :: periods
    type(state_type) :: start
    integer :: steps, try

    start = self%state
    steps = max(fewest_steps, steps_per_harmonic*harmonics)
    do try = 1, most_tries
      self%state = start
      call average_by(self, excitation, harmonics, steps, count, periods)
      if (periods%moved .and. periods%change <= largest_change) return
      steps = nint(steps*finer)
    end do
  end subroutine average_over

  !> The same in so many steps a period.
  subroutine average_by(self, excitation, harmonics, steps, count, periods)
    class(averaged_periods_type), intent(inout) :: self
    !> Loads of the motion in time
    type(excitation_type), intent(in) :: excitation
    !> Highest harmonic, H; steps a period; number of periods
    integer, intent(in) :: harmonics, steps, count
    !> Averages over periods of the motion in time
    type(periods_type), intent(out) :: periods
    type(loading_type) :: loading
    type(scheme_type) :: scheme
    real(wp) :: ends(size(self%system%springs), -2:count)
    integer :: period

    associate (system => self%system)
      allocate (periods%motion(2*harmonics + 1, size(system%springs)), periods%slider(2, size(system%law)), source=0.0_wp)
      loading = new_loading(excitation%omega, system%clock, matmul(system%static_loads, excitation%static_factors), &
                            excitation%level*system%harmonic_load, new_profile(reshape([real(wp) ::], [2, 0])), &
                            new_profile(reshape([real(wp) ::], [2, 0])))
      call new_scheme(system, scheme_exponential, steps, loading%period, -1.0_wp, scheme)
      scheme%implicit%tolerance = near_enough
      self%state%cycle = 0
      call start_scheme(scheme, system, loading, self%state)
      do period = 1 - periods_before, count
        call move_one_period(self, scheme, loading, period > 0, periods)
        if (.not. periods%moved) return
        if (period >= lbound(ends, 2)) ends(:, period) = scheme%displacement
        if (period > 0) periods%slider = periods%slider + self%state%slider/count
      end do
      periods%motion = periods%motion*2.0_wp/(count*scheme%steps)
      periods%force_error = periods%force_error*(count + periods_before)*scheme%steps
    end associate
    call compare_ends(ends, near_enough*steps, periods)
  end subroutine average_by

  !> One period; coefficients are added up, to be divided by half the number of steps.
  subroutine move_one_period(self, scheme, loading, adds, periods)
    class(averaged_periods_type), intent(inout) :: self
    !> Scheme of integration, its parameters and matrices
    type(scheme_type), intent(inout) :: scheme
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Are the coefficients to be added up?
    logical, intent(in) :: adds
    !> Averages over periods of the motion in time
    type(periods_type), intent(inout) :: periods
    real(wp) :: cosines(size(periods%motion, 1)/2), sines(size(periods%motion, 1)/2), elastic(size(self%system%springs))
    integer :: step, h

    do step = 1, scheme%steps
      call step_scheme(scheme, self%system, loading, self%state, 0, modulo(step, scheme%steps)*scheme%h, periods%moved)
      periods%moved = periods%moved .and. all(abs(self%state%motion) < huge(1.0_wp))
      if (.not. periods%moved) return
      if (.not. adds) cycle
      elastic = self%system%springs*scheme%displacement
      periods%force = max(periods%force, maxval([0.0_wp, abs(elastic + scheme%g)]))
      ! Displacements are solved to a part of their norm, whatever the spring at each.
      periods%force_error = max(periods%force_error, near_enough*maxval(self%system%springs)*norm2(scheme%displacement))
      call harmonics_at(two_pi*step/scheme%steps, cosines, sines)
      periods%motion(1, :) = periods%motion(1, :) + 0.5_wp*scheme%displacement
      do h = 1, size(cosines)
        periods%motion(2*h, :) = periods%motion(2*h, :) + cosines(h)*scheme%displacement
        periods%motion(2*h + 1, :) = periods%motion(2*h + 1, :) + sines(h)*scheme%displacement
      end do
    end do
  end subroutine move_one_period

  !> Change of the displacements over the last period, and whether all periods change them alike.
  pure subroutine compare_ends(ends, rounding, periods)
    !> [rows, -2:count]
    real(wp), intent(in) :: ends(:, -2:)
    !> What the errors of its steps add up to over a period at most, relative to the displacements: a shorter move is none
    real(wp), intent(in) :: rounding
    !> Averages over periods of the motion in time
    type(periods_type), intent(inout) :: periods
    real(wp) :: steps(size(ends, 1), -1:ubound(ends, 2)), first_harmonic
    integer :: period

    do period = -1, ubound(ends, 2)
      steps(:, period) = ends(:, period) - ends(:, period - 1)
    end do
    first_harmonic = max(norm2(periods%motion(2:3, :)), tiny(1.0_wp))
    periods%change = norm2(steps(:, ubound(steps, 2)))/first_harmonic
    periods%is_drifting = steps_repeat(steps, alike_in_time, rounding*norm2(ends(:, ubound(ends, 2))))
  end subroutine compare_ends
end module attrito_integrate_averaged_periods
