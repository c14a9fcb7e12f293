!> A start for Newton's method out of motion in time: the mean of some periods,
!>
!> $$ d_h = \frac{2}{P J} \sum_{j=1}^{P J} d(t_j) e^{-i h \omega t_j} \quad (h > 0), \qquad t_j = \frac{2 \pi j}{J \omega}, $$
!>
!> half of it for h = 0, and the mean of the sliders at the ends of these P periods. Where motion in time comes to no orbit of the
!> excitation's period, walks or takes several periods, one that is unstable mostly exists, and the mean is near it. It only has to be
!> near: steps are coarse, and a loss factor acts as the modal damping that dissipates as much at resonance.
module attrito_integrate_averaged_periods
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: harmonics_at
  use attrito_model_contacts, only: contacts_type
  use attrito_model_structure, only: structure_type, damping_loss_factor, damping_ratio
  use attrito_continuation_motion_in_time, only: motion_in_time_type, excitation_type
  use attrito_integrate_loading, only: loading_type, new_loading, new_profile
  use attrito_integrate_schemes, only: scheme_type, new_scheme, start_scheme, step_scheme, scheme_exponential
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type, new_system
  implicit none
  private
  public :: averaged_periods_type, new_averaged_periods

  !> Periods until the start is forgotten
  integer, parameter :: periods_before = 5
  !> Steps a period, unless harmonics ask for more
  integer, parameter :: fewest_steps = 64, steps_per_harmonic = 8

  !> Relative error of each step's equilibrium
  real(wp), parameter :: near_enough = 1.0e-6_wp

  type, extends(motion_in_time_type) :: averaged_periods_type
    type(structure_type) :: structure
    type(contacts_type) :: contacts
    !> Diagonalised when it is first needed
    type(system_type), allocatable :: system
    type(state_type) :: state
  contains
    procedure :: stand
    procedure :: run_on
  end type averaged_periods_type

contains

  !> Motion in time of structure and contacts.
  function new_averaged_periods(structure, contacts) result(self)
    type(structure_type), intent(in) :: structure
    type(contacts_type), intent(in) :: contacts
    type(averaged_periods_type) :: self

    self%structure = structure
    if (structure%damping_kind == damping_loss_factor) then
      self%structure%damping_kind = damping_ratio
      self%structure%damping_value = 0.5_wp*structure%damping_value
    end if
    self%contacts = contacts
  end function new_averaged_periods

  !> Stand at a state, at the start of a period of the excitation.
  subroutine stand(self, displacement, velocity, slider, stands)
    class(averaged_periods_type), intent(inout) :: self
    real(wp), intent(in) :: displacement(:), velocity(:), slider(:, :)
    !> .false.: motions without mass, for instance; see `new_system`
    logical, intent(out) :: stands
    type(error_type), allocatable :: error

    if (.not. allocated(self%system)) then
      allocate (self%system)
      call new_system(self%structure, self%contacts, self%system, error)
      if (allocated(error)) deallocate (self%system)
    end if
    stands = allocated(self%system)
    if (.not. stands) return
    self%state = new_state(self%system, matmul(displacement, self%system%weighted), &
                           matmul(velocity, self%system%weighted)/self%system%clock, slider)
  end subroutine stand

  !> Move on for some periods until the start is forgotten, and average some more.
  subroutine run_on(self, excitation, periods, motion, slider, moved)
    class(averaged_periods_type), intent(inout) :: self
    type(excitation_type), intent(in) :: excitation
    integer, intent(in) :: periods
    real(wp), intent(out) :: motion(:, :), slider(:, :)
    logical, intent(out) :: moved
    type(loading_type) :: loading
    type(scheme_type) :: scheme
    real(wp) :: cosines(size(motion, 1)/2), sines(size(motion, 1)/2)
    integer :: period, step, h

    associate (system => self%system, state => self%state)
      loading = new_loading(excitation%omega, system%clock, matmul(system%static_loads, excitation%static_factors), &
                            excitation%level*system%harmonic_load, new_profile(reshape([real(wp) ::], [2, 0])), &
                            new_profile(reshape([real(wp) ::], [2, 0])))
      call new_scheme(system, scheme_exponential, max(fewest_steps, steps_per_harmonic*size(cosines)), loading%period, -1.0_wp, &
                      scheme)
      scheme%implicit%tolerance = near_enough
      state%cycle = 0
      call start_scheme(scheme, system, loading, state)
      motion = 0.0_wp
      slider = 0.0_wp
      do period = 1, periods_before + periods
        do step = 1, scheme%steps
          call step_scheme(scheme, system, loading, state, 0, modulo(step, scheme%steps)*scheme%h, moved)
          moved = moved .and. all(abs(state%motion) < huge(1.0_wp))
          if (.not. moved) return
          if (period <= periods_before) cycle
          call harmonics_at(two_pi*step/scheme%steps, cosines, sines)
          motion(1, :) = motion(1, :) + 0.5_wp*scheme%displacement
          do h = 1, size(cosines)
            motion(2*h, :) = motion(2*h, :) + cosines(h)*scheme%displacement
            motion(2*h + 1, :) = motion(2*h + 1, :) + sines(h)*scheme%displacement
          end do
        end do
        if (period > periods_before) slider = slider + state%slider/periods
      end do
      motion = motion*2.0_wp/(periods*scheme%steps)
    end associate
  end subroutine run_on
end module attrito_integrate_averaged_periods
