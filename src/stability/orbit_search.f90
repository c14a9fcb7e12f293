!> The orbit of a balance's point: its own motion, or the periodic motion in time next to it, by shooting from there or from what
!> motion in time settles to.
module attrito_stability_orbit_search
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_solve_solver, only: solver_type
  use attrito_stability_balance_motion, only: balance_motion_type
  use attrito_stability_distance, only: trajectory_of_balance, distance_between, instants
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_shooting, only: shoot, march_until_settled
  use attrito_stability_start, only: loading_of, start_of
  implicit none
  private
  public :: orbit_search_type, new_search, find_orbit

  !> Part by which friction of contacts that hold is raised once the orbit of motion in time is known: one that was shaken down
  !> touches its limit there, where rounding decides whether it slips
  real(wp), parameter :: raised = 1.0e-6_wp ! guess

  type :: orbit_search_type
    !> Linear system in time, and with more friction on contacts that hold
    type(system_type) :: system, holding
    type(loading_type) :: loading
    type(balance_motion_type) :: balance
    !> The balance's highest harmonic, and its motion [m, instants]
    integer :: harmonics = 0
    real(wp), allocatable :: trajectory(:, :)
    !> How far an orbit of motion in time may lie from the balance's, part of its amplitude
    real(wp) :: limit = 0.0_wp
    !> Is motion in time wanted?
    logical :: in_time = .false.
    !> Of the balance's period, then of the orbit's
    type(state_type) :: start
    !> How far the orbit of motion in time lies from the balance's; negative: none was found
    real(wp) :: distance = -1.0_wp
  end type orbit_search_type

contains

  !> From a solver's point.
  function new_search(solver, system, balance, limit) result(self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance
    !> How far an orbit of motion in time may lie from the balance's, part of its amplitude
    real(wp), intent(in) :: limit
    type(orbit_search_type) :: self

    self%limit = limit
    self%system = system
    self%holding = system
    self%holding%law = held(system%law, balance%holds)
    self%loading = loading_of(solver, system)
    self%balance = balance
    self%harmonics = size(solver%context%balance%response, 2) - 1
    self%trajectory = trajectory_of_balance(solver, system, instants)
    self%start = start_of(solver, system, balance%slider)
  end function new_search

  !> Laws with a little more friction on contacts that hold: their forces are the same, and they stick beyond doubt.
  function held(law, holds) result(changed)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> [contacts]
    logical, intent(in) :: holds(:)
    type(contact_type) :: changed(size(law))

    changed = law
    where (holds) changed%friction_coefficient = (1.0_wp + raised)*law%friction_coefficient
  end function held

  !> The balance's orbit, or that of motion in time next to it.
  subroutine find_orbit(self, orbit, found)
    type(orbit_search_type), intent(inout) :: self
    type(orbit_type), intent(out) :: orbit
    !> Is there one?
    logical, intent(out) :: found

    if (self%in_time) then
      call find_in_time(self, orbit)
      found = self%distance >= 0.0_wp .and. self%distance <= self%limit
      if (found) call orbit%apply_law(self%holding, self%loading)
    else
      call orbit%take_balance(self%system, self%loading, self%balance)
      found = .true.
    end if
  end subroutine find_orbit

  !> Of two orbits of motion in time the nearer.
  subroutine find_in_time(self, orbit)
    type(orbit_search_type), intent(inout) :: self
    type(orbit_type), intent(inout) :: orbit
    type(orbit_type) :: other_orbit
    type(state_type) :: other
    real(wp) :: distance

    other = self%start
    call shoot_from(self%start, orbit, self%distance)
    if (self%distance >= 0.0_wp .and. self%distance <= self%limit) return
    call march_until_settled(self%system, self%loading, other_orbit, other)
    call shoot_from(other, other_orbit, distance)
    if (distance < 0.0_wp .or. (self%distance >= 0.0_wp .and. self%distance <= distance)) return
    self%start = other
    self%distance = distance
    orbit = other_orbit

  contains

    subroutine shoot_from(state, next, distance_of_next)
      !> Where the search starts, then where the orbit's period starts
      type(state_type), intent(inout) :: state
      !> Orbit next to it
      type(orbit_type), intent(inout) :: next
      !> How far it lies from the balance's; negative: none was found
      real(wp), intent(out) :: distance_of_next
      type(state_type) :: end
      real(wp) :: range, trajectory(size(self%trajectory, 1), size(self%trajectory, 2))
      logical :: found

      distance_of_next = -1.0_wp
      call shoot(self%system, self%loading, state, next, found)
      if (.not. found) return
      end = state
      call next%march(self%system, self%loading, end, range, found, trajectory)
      if (found) distance_of_next = distance_between(trajectory, self%trajectory, self%harmonics)
    end subroutine shoot_from
  end subroutine find_in_time
end module attrito_stability_orbit_search
