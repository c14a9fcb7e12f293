!> Stability of an orbit whose contacts slip along one tangent at most: on the balance's orbit, and where that is not enough on the
!> event-exact one; what multipliers leave open is decided by integration in time.
module attrito_stability_examine_legs
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_distance, only: trajectory_of_balance, distance_between, instants
  use attrito_stability_examination, only: examination_type, examine_options_type, balance_motion_type, is_near, held, number, part, &
                                           distance_limit, by_monodromy, by_hill, balanced_orbit, exact_orbit
  use attrito_stability_examine_sampled, only: examine_sampled_in_time
  use attrito_stability_graze, only: perturbed_law, grazing_contact
  use attrito_stability_hill, only: hill_multipliers, too_large
  use attrito_stability_in_time, only: decide_in_time, settle
  use attrito_stability_leg, only: orbit_legs_type, legs_of_motion
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of
  use attrito_stability_shooting, only: shoot, march_period, march_recorded
  use attrito_stability_start, only: loading_of, start_of
  use attrito_stability_verdict, only: judge, largest_multiplier, band, not_examined, indeterminate
  implicit none
  private
  public :: examine_legs

  !> Multipliers that the two engines may differ by and still agree
  real(wp), parameter :: agreement = 1.0e-3_wp ! guess

contains

  !> Examine a motion of all contacts; those with two tangents stick.
  subroutine examine_legs(solver, system, options, all_contacts, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Motion and forces of all contacts by the balance
    type(balance_motion_type), intent(in) :: all_contacts
    type(examination_type), intent(inout) :: self
    type(orbit_legs_type) :: orbit, perturbed_orbits(2)
    type(loading_type) :: loading
    type(state_type) :: start
    logical :: two_tangents

    loading = loading_of(solver, system)
    two_tangents = any(system%law%tangents > 1)
    call balanced_legs(solver, all_contacts%motion, all_contacts%slider(1, :), orbit, perturbed_orbits)
    if (options%orbit == balanced_orbit .or. (all(orbit%stuck) .and. (two_tangents .or. options%orbit /= exact_orbit))) then
      call judge_orbit(system, options, loading%period, orbit, perturbed_orbits, self)
      return
    end if
    if (two_tangents) then
      call examine_sampled_in_time(solver, system, options, all_contacts, self)
      if (.not. is_near(self)) call judge_without_verdict(system, options, loading%period, orbit, perturbed_orbits, self)
      return
    end if
    start = start_of(solver, system, all_contacts%slider(1, :))
    call examine_exact(solver, system, options, all_contacts, start, self)
    if (is_near(self) .or. options%orbit == exact_orbit) return
    call judge_without_verdict(system, options, loading%period, orbit, perturbed_orbits, self)
  end subroutine examine_legs

  !> On the event-exact orbit near a state, which is then where its period starts; none there, no verdict.
  subroutine examine_exact(solver, system, options, all_contacts, start, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Motion and forces of all contacts by the balance
    type(balance_motion_type), intent(in) :: all_contacts
    !> Displacement, velocity and sliders at the start
    type(state_type), intent(inout) :: start
    type(examination_type), intent(inout) :: self
    type(orbit_legs_type) :: orbit, perturbed_orbits(2)
    type(loading_type) :: loading
    type(system_type) :: holding

    loading = loading_of(solver, system)
    call find_exact(system, loading, trajectory_of_balance(solver, system, instants), start, orbit, self%distance)
    if (.not. is_near(self)) then
      self%verdict = indeterminate
      self%reason = 'no event-exact orbit near that of the balance'
      if (self%distance > distance_limit) then
        self%reason = 'the event-exact orbit lies '//part(self%distance)//' from that of the balance'
      end if
      return
    end if
    holding = system
    holding%law = held(system%law, all_contacts%holds)
    call exact_legs(holding, loading, oscillation_bounds_of(system%law, all_contacts%motion), start, orbit, perturbed_orbits)
    call judge_orbit(holding, options, loading%period, orbit, perturbed_orbits, self)
    if (self%verdict /= indeterminate .or. .not. options%decide) return
    self%verdict = decide_in_time(holding, loading, start)
    if (self%verdict /= indeterminate) self%reason = self%reason//'; decided by integration in time'
  end subroutine examine_exact

  !> Multipliers of the balance's orbit where there is no event-exact one beside it: they decide nothing.
  subroutine judge_without_verdict(system, options, period, orbit, perturbed_orbits, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Length of the period, s
    real(wp), intent(in) :: period
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(in) :: orbit, perturbed_orbits(2)
    type(examination_type), intent(inout) :: self
    character(:), allocatable :: reason

    reason = self%reason
    call judge_orbit(system, options, period, orbit, perturbed_orbits, self)
    self%verdict = indeterminate
    self%reason = reason
    self%low = 0.0_wp
    self%high = -1.0_wp
  end subroutine judge_without_verdict

  !> Multipliers of an orbit and what they say.
  subroutine judge_orbit(system, options, period, orbit, perturbed_orbits, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Length of the period, s
    real(wp), intent(in) :: period
    !> Its legs, and those with contacts perturbed
    type(orbit_legs_type), intent(in) :: orbit, perturbed_orbits(2)
    type(examination_type), intent(inout) :: self
    integer :: info, contact

    self%reason = ''
    self%verdict = not_examined
    self%low = 0.0_wp
    self%high = -1.0_wp
    info = 0
    if (iand(options%methods, by_monodromy) /= 0) then
      call multipliers_of(system, orbit, period, self%monodromy, self%change, info)
    end if
    if (iand(options%methods, by_hill) /= 0 .and. info == 0) call hill_multipliers(system, orbit, period, self%hill, info)
    if (info /= 0) then
      self%reason = 'eigenvalues were not found'
      if (info == too_large) self%reason = 'too many contacts slip or open for Hill''s problem'
      if (.not. allocated(self%monodromy)) return
    end if
    self%verdict = verdict_of(self, .not. all(orbit%stuck))
    contact = max(grazing_contact(orbit, perturbed_orbits(1)), grazing_contact(orbit, perturbed_orbits(2)))
    if (contact > 0) then
      self%verdict = indeterminate
      self%reason = 'contact '//number(contact - 1)//' grazes'
    end if
    call find_interval(system, period, orbit, perturbed_orbits, contact > 0, self)
  end subroutine judge_orbit

  !> Where the largest modulus lies if that does not decide: between those of the engines, and on both sides of a graze.
  subroutine find_interval(system, period, orbit, perturbed_orbits, grazes, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Length of the period, s
    real(wp), intent(in) :: period
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(in) :: orbit, perturbed_orbits(2)
    !> Does a contact graze?
    logical, intent(in) :: grazes
    type(examination_type), intent(inout) :: self
    type(multiplier_type), allocatable :: beside(:)
    real(wp) :: change
    integer :: i, info

    if (self%verdict /= indeterminate) return
    self%low = huge(1.0_wp)
    if (allocated(self%monodromy)) call take_in(self%monodromy)
    if (allocated(self%hill)) call take_in(self%hill)
    do i = 1, merge(2, 0, grazes)
      call multipliers_of(system, perturbed_orbits(i), period, beside, change, info)
      if (info == 0) call take_in(beside)
    end do
    self%low = max(0.0_wp, self%low - max(self%change, band(.not. all(orbit%stuck))))
    self%high = self%high + max(self%change, band(.not. all(orbit%stuck)))

  contains

    subroutine take_in(multipliers)
      !> Floquet multipliers
      type(multiplier_type), intent(in) :: multipliers(:)

      self%low = min(self%low, largest_multiplier(multipliers))
      self%high = max(self%high, largest_multiplier(multipliers))
    end subroutine take_in
  end subroutine find_interval

  !> Legs of the balance's orbit, and with contacts perturbed.
  subroutine balanced_legs(solver, motion, slider, orbit, perturbed_orbits)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Displacement of the coordinates; sliders, as the contacts have them
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(out) :: orbit, perturbed_orbits(2)
    integer :: i

    associate (law => solver%contacts%law, grid => solver%context%balance%quadrature%grid)
      call legs_of_motion(law, grid, motion, slider, orbit)
      do i = 1, 2
        call legs_of_motion(perturbed_law(law, oscillation_bounds_of(law, motion), 2*i - 3), grid, motion, slider, &
                            perturbed_orbits(i))
      end do
    end associate
  end subroutine balanced_legs

  !> How far motion in time goes from the balance's in the period that begins on it.
  real(wp) function one_period_away(system, loading, start, balance) result(distance)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders at the start
    type(state_type), intent(in) :: start
    !> Its motion [m, instants]
    real(wp), intent(in) :: balance(:, :)
    type(state_type) :: state
    real(wp) :: trajectory(size(balance, 1), size(balance, 2))

    state = start
    call march_recorded(system, loading, state, trajectory)
    distance = distance_between(trajectory, balance)
  end function one_period_away

  !> Legs of the period that begins at the event-exact orbit's start, and with contacts perturbed.
  subroutine exact_legs(system, loading, oscillation_bounds, start, orbit, perturbed_orbits)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Size of each contact's normal displacement
    real(wp), intent(in) :: oscillation_bounds(:)
    !> Displacement, velocity and sliders at the start
    type(state_type), intent(in) :: start
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(out) :: orbit, perturbed_orbits(2)
    type(system_type) :: other
    type(state_type) :: state
    real(wp) :: range
    integer :: i

    state = start
    call march_period(system, loading, state, orbit, range)
    other = system
    do i = 1, 2
      other%law = perturbed_law(system%law, oscillation_bounds, 2*i - 3)
      state = start
      call march_period(other, loading, state, perturbed_orbits(i), range)
    end do
  end subroutine exact_legs

  !> The event-exact orbit nearest to the balance's, by Newton's method from there, or from what motion in time settles to.
  subroutine find_exact(system, loading, balance, start, orbit, distance)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> The balance's motion [m, instants]
    real(wp), intent(in) :: balance(:, :)
    !> Of the balance's period, then of the orbit's
    type(state_type), intent(inout) :: start
    !> Orbit as segments between its events
    type(orbit_legs_type), intent(out) :: orbit
    !> Negative: none was found
    real(wp), intent(out) :: distance
    type(state_type) :: other
    type(orbit_legs_type) :: other_orbit
    real(wp) :: range, other_distance
    logical :: settled

    other = start
    call shoot_from(start, orbit, distance)
    if (distance >= 0.0_wp .and. distance <= distance_limit) return
    call settle(system, loading, other, range, settled)
    if (.not. settled) return
    call shoot_from(other, other_orbit, other_distance)
    if (other_distance < 0.0_wp .or. (distance >= 0.0_wp .and. distance <= other_distance)) return
    start = other
    orbit = other_orbit
    distance = other_distance

  contains

    subroutine shoot_from(state, legs, away)
      !> Displacement, velocity and sliders
      type(state_type), intent(inout) :: state
      !> Orbit as segments between its events
      type(orbit_legs_type), intent(out) :: legs
      !> How far it lies from the balance's orbit
      real(wp), intent(out) :: away
      real(wp) :: moved
      logical :: found

      call shoot(system, loading, state, legs, moved, found)
      away = -1.0_wp
      if (found) away = one_period_away(system, loading, state, balance)
    end subroutine shoot_from
  end subroutine find_exact

  !> Size of each contact's normal displacement, without its mean.
  pure function oscillation_bounds_of(law, motion) result(oscillation_bound)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Displacement of the coordinates
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: oscillation_bound(size(law))
    integer :: i

    oscillation_bound = [(sum(abs(motion(2:, law(i)%first_row + 1))), i=1, size(law))]
  end function oscillation_bounds_of

  !> Of the engines that were asked for: they must agree.
  integer function verdict_of(self, switches) result(verdict)
    type(examination_type), intent(inout) :: self
    !> Does any contact slip or open?
    logical, intent(in) :: switches

    verdict = not_examined
    if (allocated(self%monodromy)) verdict = judge(self%monodromy, switches, self%change)
    if (.not. allocated(self%hill)) then
      if (verdict == indeterminate) self%reason = 'a multiplier is 1 in modulus'
      return
    end if
    if (.not. allocated(self%monodromy)) verdict = judge(self%hill, switches)
    if (verdict == indeterminate) self%reason = 'a multiplier is 1 in modulus'
    if (.not. allocated(self%monodromy)) return
    if (abs(largest_multiplier(self%monodromy) - largest_multiplier(self%hill)) <= agreement .and. &
        verdict == judge(self%hill, switches)) return
    verdict = indeterminate
    self%reason = 'monodromy and Hill''s problem differ'
  end function verdict_of
end module attrito_stability_examine_legs
