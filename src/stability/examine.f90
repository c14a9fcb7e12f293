!> Stability of the point at which a solver stands: of the balance's orbit, or where contacts slip or open of the orbit of motion in
!> time near it; what multipliers leave open is decided by integration in time.
module attrito_stability_examine
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_model_structure, only: structure_type, damping_loss_factor, damping_viscous
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_stability_assess, only: assess, not_known_to_hill
  use attrito_stability_balance_motion, only: balance_motion_type, balance_motion_of
  use attrito_stability_examination, only: examination_type, examine_options_type, is_near, largest_distance, part, &
                                           by_monodromy, by_hill, balanced_orbit, exact_orbit, automatic_orbit
  use attrito_stability_in_time, only: decide_in_time
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_orbit_search, only: orbit_search_type, new_search, find_orbit
  use attrito_stability_verdict, only: largest_multiplier, may_fold, between_folding, stable, unstable, indeterminate
  implicit none
  private
  public :: examination_type, examine_options_type, examine, system_of, by_monodromy, by_hill
  public :: balanced_orbit, exact_orbit, automatic_orbit

contains

  !> Examine the solver's present point, at the root; the verdict is known to all.
  subroutine examine(solver, system, options, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Of `system_of`, allocated where the root is
    type(system_type), allocatable, intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> What is found of stability
    type(examination_type), intent(out) :: self
    type(balance_motion_type) :: balance
    real(wp) :: verdict

    self%reason = ''
    balance = balance_motion_of(solver)
    verdict = 0.0_wp
    associate (ranks => solver%context%balance%team)
      if (ranks%is_root()) then
        call examine_motion(solver, system, options, balance, self)
        verdict = real(self%verdict, wp)
      end if
      call ranks%sum(verdict)
    end associate
    self%verdict = nint(verdict)
  end subroutine examine

  !> The orbit of motion in time decides unless the balance's own is asked for, or is the same since all contacts stick; where there
  !> is none, the multipliers of the balance's are given, and decide nothing.
  subroutine examine_motion(solver, system, options, balance, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    type(orbit_search_type) :: search
    type(orbit_type) :: orbit
    character(:), allocatable :: reason
    logical :: found, own

    if (balance%turns .and. iand(options%methods, by_monodromy) == 0) then
      self%reason = not_known_to_hill
      return
    end if
    self%limit = largest_distance(options%estimate)
    search = new_search(solver, system, balance, self%limit)
    call find_orbit(search, orbit, found)
    own = all(orbit%stuck) .and. options%orbit /= exact_orbit
    own = own .or. options%orbit == balanced_orbit
    if (.not. own) then
      call examine_in_time(search, options, self)
      if (options%orbit == automatic_orbit .and. is_near(self)) call look_for_fold(search, options, system, orbit, self)
      if (is_near(self) .or. options%orbit == exact_orbit) return
    end if
    reason = self%reason
    search%in_time = .false.
    call assess(search, options, system, orbit, self)
    if (own) return
    self%verdict = indeterminate
    self%reason = reason
    self%low = 0.0_wp
    self%high = -1.0_wp
  end subroutine examine_motion

  !> On the orbit of motion in time near the balance's; none there, no verdict.
  subroutine examine_in_time(search, options, self)
    !> What the orbit is found by
    type(orbit_search_type), intent(inout) :: search
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    type(orbit_type) :: orbit
    logical :: found

    search%in_time = .true.
    call find_orbit(search, orbit, found)
    if (found) call assess(search, options, search%holding, orbit, self)
    self%distance = search%distance
    if (.not. is_near(self)) then
      if (allocated(self%monodromy)) deallocate (self%monodromy)
      self%verdict = indeterminate
      self%reason = 'no event-exact orbit near that of the balance'
      if (self%distance >= 0.0_wp) self%reason = 'the event-exact orbit lies '//part(self%distance)//' from that of the balance'
    else if (self%verdict == indeterminate .and. options%decide) then
      self%verdict = decide_in_time(search%holding, search%loading, search%start)
      if (self%verdict /= indeterminate) self%reason = self%reason//'; decided by integration in time'
    end if
  end subroutine examine_in_time

  !> Near a fold two orbits of motion in time lie beside the balance's. Where it may stand for either there is no verdict.
  subroutine look_for_fold(search, options, system, orbit, self)
    !> What the orbit was found by
    type(orbit_search_type), intent(inout) :: search
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> The balance's
    type(orbit_type), intent(in) :: orbit
    !> What was found in time
    type(examination_type), intent(inout) :: self
    type(examination_type) :: of_balance

    if (.not. allocated(self%monodromy) .or. all(self%verdict /= [stable, unstable]) .or. len(self%reason) > 0) return
    if (.not. may_fold(self%monodromy)) return
    search%in_time = .false.
    call assess(search, options, system, orbit, of_balance)
    if (.not. allocated(of_balance%monodromy)) return
    if (.not. between_folding(self%monodromy, of_balance%monodromy)) return
    self%reason = 'near a fold the orbit of the balance may stand for either of two orbits of motion in time'
    self%verdict = indeterminate
    self%low = min(largest_multiplier(self%monodromy), largest_multiplier(of_balance%monodromy))
    self%high = max(largest_multiplier(self%monodromy), largest_multiplier(of_balance%monodromy))
  end subroutine look_for_fold

  !> The linear system of a structure in time, at an angular frequency: where a loss factor is to be taken for the viscous damping
  !> that is equal to it there, C = eta K / omega.
  subroutine system_of(solver, equivalent_viscous, omega, system, error)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Replace a loss factor by viscous damping?
    logical, intent(in) :: equivalent_viscous
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(out) :: system
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(structure_type) :: structure

    if (.not. all(solver%contacts%law%is_proportional())) then
      call raise(error, 'stability: a contact law that is not proportional to the normal force: expected Coulomb''s', &
                 fault_of_input)
      return
    end if
    structure = solver%structure
    if (equivalent_viscous .and. structure%damping_kind == damping_loss_factor) then
      structure%damping_kind = damping_viscous
      structure%damping = structure%damping_value/omega*structure%stiffness
    end if
    call new_system(structure, solver%contacts, system, error)
  end subroutine system_of
end module attrito_stability_examine
