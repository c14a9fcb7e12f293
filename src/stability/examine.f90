!> Stability of the point at which a solver stands.
module attrito_stability_examine
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: state_shaken_down
  use attrito_model_contacts, only: contact_type
  use attrito_model_structure, only: structure_type, damping_loss_factor, damping_viscous
  use attrito_continuation_solver, only: solver_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_stability_graze, only: nudged, grazing_contact
  use attrito_stability_hill, only: hill_multipliers, too_large
  use attrito_stability_in_time, only: decide_in_time, settle
  use attrito_stability_leg, only: orbit_legs_type, legs_of_motion
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of
  use attrito_stability_shooting, only: shoot, march_period
  use attrito_stability_start, only: loading_of, start_of
  use attrito_stability_verdict, only: judge, largest_multiplier, band, not_examined, indeterminate
  implicit none
  private
  public :: examination_type, examine_options_type, examine, system_of, by_monodromy, by_hill
  public :: balanced_orbit, exact_orbit, automatic_orbit

  !> Engines, to be added
  integer, parameter :: by_monodromy = 1, by_hill = 2

  !> The balance's orbit; the event-exact one near it; or the latter only where the former is too near a change to be sure
  integer, parameter :: balanced_orbit = 0, exact_orbit = 1, automatic_orbit = 2

  !> Distance of the largest multiplier from the unit circle within which the balance's orbit is not enough: 20 harmonics leave out
  !> some 3e-3 of it with stiff contacts
  real(wp), parameter :: margin = 5.0e-2_wp

  type :: examine_options_type
    !> Sum of `by_...`
    integer :: methods = by_monodromy
    !> One of the orbits above
    integer :: orbit = automatic_orbit
    !> Let integration in time decide where multipliers do not
    logical :: decide = .true.
    !> Estimated relative error of the balance's motion by truncation
    real(wp) :: truncation = 0.0_wp
  end type examine_options_type

  !> Truncation beyond which its multipliers are not to be trusted at all: contacts that open and land in stick magnify it
  real(wp), parameter :: coarse = 1.0e-3_wp

  !> How far the event-exact orbit may lie from the balance's, part of the motion's half range, to be taken for the same
  real(wp), parameter :: farthest = 0.1_wp

  !> Multipliers that the two engines may differ by and still agree
  real(wp), parameter :: agreement = 1.0e-3_wp

  type :: examination_type
    !> One of `not_examined`, `unstable`, `stable`, `indeterminate`
    integer :: verdict = not_examined
    !> Why it was not examined or is indeterminate
    character(:), allocatable :: reason
    !> Of each engine that was asked for, at the root
    type(multiplier_type), allocatable :: monodromy(:), hill(:)
    !> How far the event-exact orbit lies from the balance's, part of the motion's half range; negative: not looked for
    real(wp) :: distance = -1.0_wp
    !> What doubling the modes last changed of the multipliers by the monodromy; zero if all are in
    real(wp) :: change = 0.0_wp
    !> Interval in which the largest modulus of the dynamic multipliers lies, where they do not decide; high < low: nothing is known
    real(wp) :: low = 0.0_wp, high = -1.0_wp
  end type examination_type

contains

  !> Examine the solver's present point, at the root; the verdict is known to all.
  subroutine examine(solver, system, options, self)
    type(solver_type), intent(in) :: solver
    !> Of `system_of`, allocated where the root is
    type(system_type), allocatable, intent(in) :: system
    type(examine_options_type), intent(in) :: options
    type(examination_type), intent(out) :: self
    real(wp), allocatable :: motion(:, :), slider(:, :)
    real(wp) :: verdict, turning
    integer :: i

    self%reason = ''
    associate (balance => solver%context%balance)
      turning = count(balance%law%tangents > 1 .and. balance%forces%state > state_shaken_down)
      call balance%ranks%sum(turning)
      if (turning > 0.0_wp) then
        self%reason = 'a contact with two tangents slips or opens'
        return
      end if
      allocate (motion(balance%coefficients(), size(solver%contacts%row_stiffness)), slider(2, size(solver%contacts%law)), &
                source=0.0_wp)
      motion(:, balance%first_row:balance%first_row + balance%rows() - 1) = solver%motion
      do i = 1, size(balance%law)
        slider(:, balance%first_contact - 1 + i) = balance%forces(i)%slider
      end do
      call balance%ranks%sum(motion)
      call balance%ranks%sum(slider)
      verdict = 0.0_wp
      if (balance%ranks%is_root()) then
        call examine_orbit(solver, system, options, motion, slider(1, :), self)
        verdict = real(self%verdict, wp)
      end if
      call balance%ranks%sum(verdict)
    end associate
    self%verdict = nint(verdict)
  end subroutine examine

  !> Examine a motion of all contacts [2 H + 1, rows] with sliders [contacts].
  subroutine examine_orbit(solver, system, options, motion, slider, self)
    type(solver_type), intent(in) :: solver
    type(system_type), intent(in) :: system
    type(examine_options_type), intent(in) :: options
    real(wp), intent(in) :: motion(:, :), slider(:)
    type(examination_type), intent(inout) :: self
    type(orbit_legs_type) :: orbit, nudges(2)
    type(loading_type) :: loading
    type(state_type) :: start

    loading = loading_of(solver, system)
    if (options%orbit /= exact_orbit .or. any(system%law%tangents > 1)) then
      call balanced_legs(solver, motion, slider, orbit, nudges)
      call judge_orbit(system, options, loading%period, orbit, nudges, self)
      if (options%orbit == balanced_orbit .or. all(orbit%stuck)) return
      if (self%verdict == not_examined .or. is_sure(self, options%truncation) .or. any(system%law%tangents > 1)) return
    end if
    start = start_of(solver, system, slider)
    call exact_legs(system, loading, swings_of(system%law, motion), start, orbit, nudges, self)
    if (self%distance < 0.0_wp) return
    call judge_orbit(system, options, loading%period, orbit, nudges, self)
    if (self%verdict /= indeterminate .or. .not. options%decide) return
    self%verdict = decide_in_time(system, loading, start)
    if (self%verdict /= indeterminate) self%reason = self%reason//'; decided by integration in time'
  end subroutine examine_orbit

  !> Is a verdict on the balance's orbit beyond what the balance leaves out?
  pure logical function is_sure(self, truncation)
    type(examination_type), intent(in) :: self
    real(wp), intent(in) :: truncation

    is_sure = self%verdict /= indeterminate .and. truncation <= coarse
    if (allocated(self%monodromy)) is_sure = is_sure .and. abs(largest_multiplier(self%monodromy) - 1.0_wp) > margin
    if (allocated(self%hill)) is_sure = is_sure .and. abs(largest_multiplier(self%hill) - 1.0_wp) > margin
  end function is_sure

  !> Multipliers of an orbit and what they say.
  subroutine judge_orbit(system, options, period, orbit, nudges, self)
    type(system_type), intent(in) :: system
    type(examine_options_type), intent(in) :: options
    real(wp), intent(in) :: period
    !> Its legs, and those with contacts nudged
    type(orbit_legs_type), intent(in) :: orbit, nudges(2)
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
    contact = max(grazing_contact(orbit, nudges(1)), grazing_contact(orbit, nudges(2)))
    if (contact > 0) then
      self%verdict = indeterminate
      self%reason = 'contact '//number(contact - 1)//' grazes'
    end if
    call find_interval(system, period, orbit, nudges, contact > 0, self)
  end subroutine judge_orbit

  !> Where the largest modulus lies if that does not decide: between those of the engines, and on both sides of a graze.
  subroutine find_interval(system, period, orbit, nudges, grazes, self)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: period
    type(orbit_legs_type), intent(in) :: orbit, nudges(2)
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
      call multipliers_of(system, nudges(i), period, beside, change, info)
      if (info == 0) call take_in(beside)
    end do
    self%low = max(0.0_wp, self%low - band(.not. all(orbit%stuck)))
    self%high = self%high + band(.not. all(orbit%stuck))

  contains

    subroutine take_in(multipliers)
      type(multiplier_type), intent(in) :: multipliers(:)

      self%low = min(self%low, largest_multiplier(multipliers))
      self%high = max(self%high, largest_multiplier(multipliers))
    end subroutine take_in
  end subroutine find_interval

  !> Legs of the balance's orbit, and with contacts nudged.
  subroutine balanced_legs(solver, motion, slider, orbit, nudges)
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :), slider(:)
    type(orbit_legs_type), intent(out) :: orbit, nudges(2)
    integer :: i

    associate (law => solver%contacts%law, grid => solver%context%balance%grid)
      call legs_of_motion(law, grid, motion, slider, orbit)
      do i = 1, 2
        call legs_of_motion(nudged(law, swings_of(law, motion), 2*i - 3), grid, motion, slider, nudges(i))
      end do
    end associate
  end subroutine balanced_legs

  !> Legs of the event-exact orbit, and of a period with contacts nudged; indeterminate if there is none near the balance's.
  subroutine exact_legs(system, loading, swings, start, orbit, nudges, self)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    !> Size of each contact's normal displacement
    real(wp), intent(in) :: swings(:)
    !> Of the balance's period, then of the orbit's
    type(state_type), intent(inout) :: start
    type(orbit_legs_type), intent(out) :: orbit, nudges(2)
    type(examination_type), intent(inout) :: self
    type(system_type) :: other
    type(state_type) :: state
    real(wp) :: range, moved
    logical :: found
    integer :: i

    call find_exact(system, loading, start, orbit, moved, found)
    if (.not. found) then
      self%verdict = indeterminate
      self%reason = 'no event-exact orbit near that of the balance'
      self%low = 0.0_wp
      self%high = -1.0_wp
      return
    end if
    self%distance = moved
    other = system
    do i = 1, 2
      other%law = nudged(system%law, swings, 2*i - 3)
      state = start
      call march_period(other, loading, state, nudges(i), range)
    end do
  end subroutine exact_legs

  !> The event-exact orbit near the balance's, by Newton's method from there, or from what motion in time settles to.
  subroutine find_exact(system, loading, start, orbit, moved, found)
    type(system_type), intent(in) :: system
    type(loading_type), intent(in) :: loading
    !> Of the balance's period, then of the orbit's
    type(state_type), intent(inout) :: start
    type(orbit_legs_type), intent(out) :: orbit
    !> Distance, part of the motion's half range
    real(wp), intent(out) :: moved
    logical, intent(out) :: found
    type(state_type) :: origin
    real(wp) :: range

    origin = start
    call shoot(system, loading, start, orbit, moved, found)
    found = found .and. moved <= farthest
    if (found) return
    start = origin
    call settle(system, loading, start, range, found)
    if (.not. found) return
    call shoot(system, loading, start, orbit, moved, found)
    moved = norm2(start%motion - origin%motion)/range
    found = found .and. moved <= farthest
  end subroutine find_exact

  !> Size of each contact's normal displacement, without its mean.
  pure function swings_of(law, motion) result(swing)
    type(contact_type), intent(in) :: law(:)
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: swing(size(law))
    integer :: i

    swing = [(sum(abs(motion(2:, law(i)%first_row + 1))), i=1, size(law))]
  end function swings_of

  !> Of the engines that were asked for: they must agree.
  integer function verdict_of(self, switches) result(verdict)
    type(examination_type), intent(inout) :: self
    logical, intent(in) :: switches

    verdict = not_examined
    if (allocated(self%monodromy)) verdict = judge(self%monodromy, switches)
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

  !> The linear system of a structure in time, at an angular frequency: where a loss factor is to be taken for the viscous damping
  !> that is equal to it there, C = eta K / omega.
  subroutine system_of(solver, equivalent_viscous, omega, system, error)
    type(solver_type), intent(in) :: solver
    logical, intent(in) :: equivalent_viscous
    real(wp), intent(in) :: omega
    type(system_type), intent(out) :: system
    type(error_type), allocatable, intent(out) :: error
    type(structure_type) :: structure

    structure = solver%structure
    if (equivalent_viscous .and. structure%damping_kind == damping_loss_factor) then
      structure%damping_kind = damping_viscous
      structure%damping = structure%damping_value/omega*structure%stiffness
    end if
    call new_system(structure, solver%contacts, system, error)
  end subroutine system_of

  pure function number(i) result(text)
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(12) :: digits

    write (digits, '(i0)') i
    text = trim(digits)
  end function number
end module attrito_stability_examine
