!> Multipliers of orbits on which contacts slip along two tangents or open, with the error that samples leave.
!>
!> Samples are doubled until the largest multiplier is known well enough to say on which side of the unit circle it lies. What the
!> last doubling changed is the error told: at second order three times what is left.
module attrito_stability_examine_sampled
  use attrito_core_kinds, only: wp
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_examination, only: examination_type, examine_options_type, balance_motion_type, is_near, number, part, &
                                           distance_limit, by_monodromy, balanced_orbit, exact_orbit
  use attrito_stability_distance, only: trajectory_of_balance, distance_between
  use attrito_stability_graze, only: perturbed_law, grazing_contact
  use attrito_stability_multipliers, only: multiplier_type, largest_change
  use attrito_stability_sampled_motion, only: sampled_motion_type, motion_of_harmonics
  use attrito_stability_sampled_multipliers, only: sampled_multipliers, choose_modes
  use attrito_stability_sampled_orbit, only: sampled_orbit_type, new_sampled_orbit, legs_of_orbit
  use attrito_stability_sampled_shooting, only: shoot_sampled, settle_sampled, march_samples
  use attrito_stability_start, only: loading_of, start_of
  use attrito_stability_verdict, only: judge, largest_multiplier, band, indeterminate
  implicit none
  private
  public :: examine_sampled, examine_sampled_in_time, sampled_examination_type, examine_in_time

  !> Samples a period
  integer, parameter :: fewest = 256, most = 4096 ! conventional
  !> Change of multipliers that is small enough, and the same as a part of the distance from the unit circle
  real(wp), parameter :: accepted = 1.0e-3_wp, accepted_part = 0.1_wp ! guess

  type :: sampled_examination_type
    type(multiplier_type), allocatable :: multipliers(:)
    !> By the last doubling of samples
    real(wp) :: change = 0.0_wp
    !> Modes they are found in (0: not chosen yet), and what doubling these last changed
    integer :: modes = 0
    real(wp) :: by_modes = 0.0_wp
    !> A contact that grazes, 0: none
    integer :: grazes = 0
    !> Interval of the largest modulus: what samples leave open, and both sides of a graze; high < low: nothing is known
    real(wp) :: low = 0.0_wp, high = -1.0_wp
    !> Why there are no multipliers
    character(:), allocatable :: failure
  end type sampled_examination_type

  character(*), parameter :: no_periodic_solution = 'no orbit of motion in time near that of the balance'

contains

  !> Examine a motion of all contacts: on the orbit of motion in time near the balance's, or, where that is asked for, on the
  !> balance's own. Without the former the multipliers of the latter are told, and there is no verdict.
  subroutine examine_sampled(solver, system, options, all_contacts, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Motion and forces of all contacts by the balance
    type(balance_motion_type), intent(in) :: all_contacts
    type(examination_type), intent(inout) :: self
    type(loading_type) :: loading
    type(sampled_examination_type) :: sampled
    character(:), allocatable :: reason

    if (iand(options%methods, by_monodromy) == 0) then
      self%reason = 'a contact slips along two tangents or opens, which Hill''s problem here does not know'
      return
    end if
    if (options%orbit /= balanced_orbit) call examine_sampled_in_time(solver, system, options, all_contacts, self)
    if (options%orbit == exact_orbit .or. is_near(self)) return
    reason = self%reason
    loading = loading_of(solver, system)
    call examine_harmonics(system, loading%period, all_contacts%motion, all_contacts%slider, sampled)
    call judge_sampled(sampled, self)
    if (options%orbit == balanced_orbit) return
    self%verdict = indeterminate
    self%reason = reason
    self%low = 0.0_wp
    self%high = -1.0_wp
  end subroutine examine_sampled

  !> On the orbit of motion in time near the balance's, from there or from what motion in time settles to.
  subroutine examine_sampled_in_time(solver, system, options, all_contacts, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Motion and forces of all contacts by the balance
    type(balance_motion_type), intent(in) :: all_contacts
    type(examination_type), intent(inout) :: self
    type(state_type) :: start
    type(loading_type) :: loading
    type(sampled_examination_type) :: sampled
    integer :: attempt

    if (iand(options%methods, by_monodromy) == 0) return
    loading = loading_of(solver, system)
    do attempt = 1, 2
      start = start_of(solver, system, all_contacts%slider(1, :))
      start%slider = all_contacts%slider
      if (attempt == 2) call settle_sampled(system, loading, fewest, start)
      call examine_near(solver, system, loading, start, sampled, self%distance)
      if (is_near(self)) exit
    end do
    call judge_sampled(sampled, self)
  end subroutine examine_sampled_in_time

  !> On the orbit next to a state, and how far that lies from the balance's; negative: there is none.
  subroutine examine_near(solver, system, loading, start, sampled, distance)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where the search starts, then where the orbit's period starts
    type(state_type), intent(inout) :: start
    !> What is found of the sampled orbit
    type(sampled_examination_type), intent(out) :: sampled
    !> From the balance's orbit, part of its amplitude; negative: there is none
    real(wp), intent(out) :: distance
    real(wp) :: moved

    distance = -1.0_wp
    call examine_in_time(system, loading, start, moved, sampled)
    if (len(sampled%failure) > 0) return
    distance = one_period_away(system, loading, start, trajectory_of_balance(solver, system, fewest))
    if (distance > distance_limit) sampled%failure = 'the orbit of motion in time lies '//part(distance)//' from that of the balance'
  end subroutine examine_near

  !> How far the orbit of motion in time lies from the balance's.
  real(wp) function one_period_away(system, loading, start, balance) result(distance)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where its period starts
    type(state_type), intent(in) :: start
    !> The balance's motion [m, samples]
    real(wp), intent(in) :: balance(:, :)
    type(state_type) :: state
    type(sampled_motion_type) :: motion
    real(wp) :: range, trajectory(size(balance, 1), size(balance, 2))
    logical :: converged

    state = start
    call march_samples(system, loading, size(balance, 2), state, motion, range, converged, trajectory)
    distance = huge(1.0_wp)
    if (converged) distance = distance_between(trajectory, balance)
  end function one_period_away

  !> What multipliers of a sampled orbit say.
  subroutine judge_sampled(sampled, self)
    !> What is found of the sampled orbit
    type(sampled_examination_type), intent(in) :: sampled
    type(examination_type), intent(inout) :: self

    self%verdict = indeterminate
    self%reason = sampled%failure
    self%low = 0.0_wp
    self%high = -1.0_wp
    if (len(sampled%failure) > 0) return
    self%monodromy = sampled%multipliers
    self%change = sampled%change + sampled%by_modes
    self%verdict = judge(self%monodromy, .true., self%change)
    if (self%verdict == indeterminate) self%reason = 'a multiplier is 1 in modulus, as far as samples and modes tell'
    if (sampled%grazes > 0) then
      self%verdict = indeterminate
      self%reason = 'contact '//number(sampled%grazes - 1)//' grazes'
    end if
    if (self%verdict /= indeterminate) return
    self%low = sampled%low
    self%high = sampled%high
  end subroutine judge_sampled

  !> Of a balance's motion of all rows [2 H + 1, rows], with sliders at its start [2, contacts].
  subroutine examine_harmonics(system, period, motion, slider, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> In units of the clock
    real(wp), intent(in) :: period
    !> Displacement of the coordinates; sliders, as the contacts have them
    real(wp), intent(in) :: motion(:, :), slider(:, :)
    type(sampled_examination_type), intent(out) :: self
    type(sampled_motion_type) :: sampled
    integer :: samples

    self%failure = ''
    samples = fewest
    do
      sampled = motion_of_harmonics(motion, samples)
      call add_sampled(system, period, sampled, slider, self)
      if (is_enough(self, samples)) exit
      samples = 2*samples
    end do
    call look_for_graze(system, period, sampled, slider, self)
  end subroutine examine_harmonics

  !> Of the orbit of motion in time that lies near a state.
  subroutine examine_in_time(system, loading, start, moved, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where the search starts, then where the orbit's period starts
    type(state_type), intent(inout) :: start
    !> How far the orbit lies from there, relative to the motion's half range
    real(wp), intent(out) :: moved
    type(sampled_examination_type), intent(out) :: self
    type(sampled_motion_type) :: sampled
    real(wp) :: further
    integer :: samples
    logical :: found

    self%failure = ''
    samples = fewest
    moved = 0.0_wp
    do
      call shoot_sampled(system, loading, samples, start, sampled, further, found)
      moved = max(moved, further)
      if (.not. found) then
        self%failure = no_periodic_solution
        return
      end if
      call add_sampled(system, loading%period, sampled, start%slider, self)
      if (is_enough(self, samples)) exit
      samples = 2*samples
    end do
    call look_for_graze(system, loading%period, sampled, start%slider, self)
  end subroutine examine_in_time

  !> Multipliers of a sampled motion, and what they changed of those before.
  subroutine add_sampled(system, period, motion, slider, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Length of the period, s
    real(wp), intent(in) :: period
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Sliders, as the contacts have them
    real(wp), intent(in) :: slider(:, :)
    type(sampled_examination_type), intent(inout) :: self
    type(sampled_orbit_type) :: orbit
    type(multiplier_type), allocatable :: before(:)
    integer :: info

    if (allocated(self%multipliers)) call move_alloc(self%multipliers, before)
    call new_sampled_orbit(system%law, motion, slider, orbit)
    if (.not. orbit%periodic) then
      self%failure = 'a slider does not come back within the periods it was followed'
      return
    end if
    info = 0
    if (self%modes == 0) call choose_modes(system, orbit, period, self%modes, self%by_modes, info)
    if (info == 0) call sampled_multipliers(system, self%modes, orbit, period, self%multipliers, info)
    if (info /= 0) then
      self%failure = 'eigenvalues were not found'
      return
    end if
    self%change = huge(1.0_wp)
    if (allocated(before)) self%change = largest_change(before, self%multipliers)
  end subroutine add_sampled

  pure logical function is_enough(self, samples)
    type(sampled_examination_type), intent(in) :: self
    !> Samples a period, J
    integer, intent(in) :: samples

    is_enough = len(self%failure) > 0 .or. samples >= most
    if (is_enough) return
    is_enough = self%change <= min(accepted, accepted_part*abs(largest_multiplier(self%multipliers) - 1.0_wp))
  end function is_enough

  !> A contact whose deeds change with friction and gap by hardly anything, and the interval of the largest modulus.
  subroutine look_for_graze(system, period, motion, slider, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Length of the period, s
    real(wp), intent(in) :: period
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Sliders, as the contacts have them
    real(wp), intent(in) :: slider(:, :)
    type(sampled_examination_type), intent(inout) :: self
    type(sampled_orbit_type) :: orbit, beside(2)
    type(multiplier_type), allocatable :: multipliers(:)
    integer :: i, info

    if (len(self%failure) > 0) return
    call new_sampled_orbit(system%law, motion, slider, orbit)
    do i = 1, 2
      call new_sampled_orbit(perturbed_law(system%law, oscillation_bounds(), 2*i - 3), motion, slider, beside(i))
      self%grazes = max(self%grazes, grazing_contact(legs_of_orbit(orbit), legs_of_orbit(beside(i))))
    end do
    self%low = largest_multiplier(self%multipliers)
    self%high = self%low
    do i = 1, merge(2, 0, self%grazes > 0)
      call sampled_multipliers(system, self%modes, beside(i), period, multipliers, info)
      if (info /= 0) cycle
      self%low = min(self%low, largest_multiplier(multipliers))
      self%high = max(self%high, largest_multiplier(multipliers))
    end do
    self%low = max(0.0_wp, self%low - max(self%change + self%by_modes, band(.true.)))
    self%high = self%high + max(self%change + self%by_modes, band(.true.))

  contains

    !> Size of each contact's normal displacement.
    pure function oscillation_bounds() result(oscillation_bound)
      real(wp) :: oscillation_bound(size(system%law))
      integer :: contact

      do contact = 1, size(oscillation_bound)
        associate (v => motion%displacement(:, system%law(contact)%first_row + system%law(contact)%tangents))
          oscillation_bound(contact) = 0.5_wp*(maxval(v) - minval(v))
        end associate
      end do
    end function oscillation_bounds
  end subroutine look_for_graze
end module attrito_stability_examine_sampled
