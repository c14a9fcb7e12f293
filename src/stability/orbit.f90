!> A periodic motion as its linearised flow sees it: what is asked of every kind of orbit, event-exact or by samples.
!>
!> An orbit comes from a balance's motion, or from a period of motion in time, which shooting makes periodic. Its monodromy matrix
!> says what a perturbation of motion, rate and of what contacts remember becomes in a period.
module attrito_stability_orbit
  use attrito_core_kinds, only: wp
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_balance_motion, only: balance_motion_type
  use attrito_stability_perturbation, only: memory_type
  use attrito_stability_reduced, only: reduced_type
  implicit none
  private
  public :: orbit_type

  !> Samples a period, at most
  integer, parameter :: most_samples = 4096 ! conventional

  type, abstract :: orbit_type
    !> Length of the period, units of the clock
    real(wp) :: period = 0.0_wp
    !> Samples a period; 0: events are located, there is nothing to refine
    integer :: samples = 0
    !> Contacts that stick throughout, and those that never open [contacts]
    logical, allocatable :: stuck(:), closed(:)
    !> What each contact does where the period begins [contacts], and what it remembers there
    integer, allocatable :: regime(:)
    type(memory_type), allocatable :: memory(:)
    !> Do all sliders come back?
    logical :: periodic = .true.
  contains
    procedure(take_balance), deferred :: take_balance
    procedure(march), deferred :: march
    procedure(apply_law), deferred :: apply_law
    procedure(monodromy), deferred :: monodromy
    procedure(regimes), deferred :: regimes
    procedure :: can_refine
    procedure :: refine
  end type orbit_type

  abstract interface
    !> The motion of a balance's point.
    subroutine take_balance(self, system, loading, balance)
      import :: orbit_type, system_type, loading_type, balance_motion_type
      class(orbit_type), intent(inout) :: self
      !> Linear system in time: mass, damping, stiffness, contacts
      type(system_type), intent(in) :: system
      !> Static and harmonic loads over time
      type(loading_type), intent(in) :: loading
      !> Motion and sliders of all contacts by the balance
      type(balance_motion_type), intent(in) :: balance
    end subroutine take_balance

    !> A period of motion in time from a state.
    subroutine march(self, system, loading, state, range, converged, trajectory)
      import :: orbit_type, system_type, loading_type, state_type, wp
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
    end subroutine march

    !> What contacts do on the orbit where their law is slightly changed.
    subroutine apply_law(self, system, loading)
      import :: orbit_type, system_type, loading_type
      class(orbit_type), intent(inout) :: self
      !> Linear system in time, with the changed laws
      type(system_type), intent(in) :: system
      !> Static and harmonic loads over time
      type(loading_type), intent(in) :: loading
    end subroutine apply_law

    !> What a unit change of each of (motion, rate by the clock, memory) becomes in a period, or in the first of several equal parts.
    function monodromy(self, reduced, parts, kept) result(matrix)
      import :: orbit_type, reduced_type, memory_type, wp
      class(orbit_type), intent(in) :: self
      !> Modes on which stability is examined
      type(reduced_type), intent(in) :: reduced
      !> How many parts; what is remembered at the end of the first, as at the beginning unless given
      integer, intent(in), optional :: parts
      type(memory_type), intent(in), optional :: kept(:)
      real(wp), allocatable :: matrix(:, :)
    end function monodromy

    !> What a contact does in the period, in order: 0 stick, +1 and -1 slip, 2 open.
    pure function regimes(self, contact) result(list)
      import :: orbit_type
      class(orbit_type), intent(in) :: self
      !> Number of the contact
      integer, intent(in) :: contact
      integer, allocatable :: list(:)
    end function regimes
  end interface

contains

  !> May the resolution be doubled?
  pure logical function can_refine(self)
    class(orbit_type), intent(in) :: self

    can_refine = self%samples > 0 .and. self%samples < most_samples
  end function can_refine

  !> Double the resolution of what is followed or marched next.
  pure subroutine refine(self)
    class(orbit_type), intent(inout) :: self

    self%samples = 2*self%samples
  end subroutine refine
end module attrito_stability_orbit
