!> What multipliers of an orbit say of it, by every engine that is asked for.
module attrito_stability_assess
  use attrito_core_kinds, only: wp
  use attrito_integrate_system, only: system_type
  use attrito_stability_balance_motion, only: oscillation_bounds
  use attrito_stability_examination, only: examination_type, examine_options_type, number, by_monodromy, by_hill
  use attrito_stability_graze, only: perturbed_law, grazing_contact
  use attrito_stability_hill, only: hill_multipliers, too_large
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of, in_modes
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_orbit_search, only: orbit_search_type
  use attrito_stability_verdict, only: judge, largest_multiplier, band, not_examined, indeterminate
  implicit none
  private
  public :: assess, not_known_to_hill

  character(*), parameter :: not_known_to_hill = &
    'a contact slips along two tangents or opens, which Hill''s problem here does not know'

  !> Multipliers that the two engines may differ by and still agree
  real(wp), parameter :: agreement = 1.0e-3_wp ! guess

contains

  !> Assess an orbit that was found.
  subroutine assess(search, options, system, orbit, self)
    !> What it was found by
    type(orbit_search_type), intent(in) :: search
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit that is assessed
    type(orbit_type), intent(in) :: orbit
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    integer :: modes, info
    logical :: turns

    self%reason = ''
    self%verdict = not_examined
    self%low = 0.0_wp
    self%high = -1.0_wp
    if (allocated(self%monodromy)) deallocate (self%monodromy)
    if (allocated(self%hill)) deallocate (self%hill)
    modes = size(system%eigenvalues)
    if (iand(options%methods, by_monodromy) /= 0) call find_multipliers(system, orbit, modes, self)
    turns = any(system%law%tangents > 1 .and. .not. orbit%stuck)
    if (turns .and. iand(options%methods, by_monodromy) == 0) then
      self%verdict = indeterminate
      self%reason = not_known_to_hill
    else if (len(self%reason) == 0 .and. iand(options%methods, by_hill) /= 0 .and. .not. turns) then
      call hill_multipliers(system, orbit%segments, orbit%period, self%hill, info)
      if (info /= 0) self%reason = 'eigenvalues were not found'
      if (info == too_large) self%reason = 'too many contacts slip or open for Hill''s problem'
    end if
    if (.not. (allocated(self%monodromy) .or. allocated(self%hill))) return
    self%verdict = verdict_of(self, .not. all(orbit%stuck))
    call look_for_graze(search, system, modes, orbit, self)
  end subroutine assess

  !> Multipliers by the monodromy matrix.
  subroutine find_multipliers(system, orbit, modes, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit that is assessed
    type(orbit_type), intent(in) :: orbit
    !> Number of modes that multipliers are found in
    integer, intent(out) :: modes
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    integer :: info

    modes = size(system%eigenvalues)
    if (.not. orbit%periodic) then
      self%verdict = indeterminate
      self%reason = 'a slider does not come back within the periods it was followed'
      return
    end if
    call multipliers_of(system, orbit, self%monodromy, modes, self%change, info)
    if (info == 0) return
    self%reason = 'eigenvalues were not found'
    deallocate (self%monodromy)
  end subroutine find_multipliers

  !> By the engines that found multipliers: they must agree.
  integer function verdict_of(self, switches) result(verdict)
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    !> Does any contact slip or open?
    logical, intent(in) :: switches

    if (allocated(self%monodromy)) then
      verdict = judge(self%monodromy, switches, self%change)
    else
      verdict = judge(self%hill, switches)
    end if
    if (verdict == indeterminate) self%reason = 'a multiplier is 1 in modulus'
    if (.not. (allocated(self%monodromy) .and. allocated(self%hill))) return
    if (abs(largest_multiplier(self%monodromy) - largest_multiplier(self%hill)) <= agreement .and. &
        verdict == judge(self%hill, switches)) return
    verdict = indeterminate
    self%reason = 'monodromy and Hill''s problem differ'
  end function verdict_of

  !> A contact that changes what it does with friction and gap by hardly anything leaves the verdict open; and where it is open,
  !> the interval of the largest modulus: between those of the engines, and on both sides of the graze.
  subroutine look_for_graze(search, system, modes, orbit, self)
    !> What the orbit was found by
    type(orbit_search_type), intent(in) :: search
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Number of modes that multipliers are found in
    integer, intent(in) :: modes
    !> Orbit that is assessed
    type(orbit_type), intent(in) :: orbit
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    type(orbit_type) :: changed(2)
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: open
    integer :: i, contact, info

    contact = 0
    do i = 1, 2
      changed(i) = orbit
      call perturb(search, system, 2*i - 3, changed(i))
      contact = max(contact, grazing_contact(orbit, changed(i)))
    end do
    if (contact > 0) then
      self%verdict = indeterminate
      self%reason = 'contact '//number(contact - 1)//' grazes'
    end if
    if (self%verdict /= indeterminate) return
    self%low = huge(1.0_wp)
    if (allocated(self%monodromy)) call take_in(self%monodromy)
    if (allocated(self%hill)) call take_in(self%hill)
    do i = 1, merge(2, 0, contact > 0)
      call in_modes(system, modes, changed(i), multipliers, info)
      if (info == 0) call take_in(multipliers)
    end do
    open = max(self%change, band(.not. all(orbit%stuck)))
    self%low = max(0.0_wp, self%low - open)
    self%high = self%high + open

  contains

    subroutine take_in(found)
      !> Floquet multipliers
      type(multiplier_type), intent(in) :: found(:)

      self%low = min(self%low, largest_multiplier(found))
      self%high = max(self%high, largest_multiplier(found))
    end subroutine take_in
  end subroutine look_for_graze

  !> Change friction and gaps by hardly anything.
  subroutine perturb(search, system, direction, orbit)
    !> What the orbit was found by
    type(orbit_search_type), intent(in) :: search
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> +1 or -1
    integer, intent(in) :: direction
    !> Orbit that is assessed, then what contacts do there
    type(orbit_type), intent(inout) :: orbit
    type(system_type) :: changed

    changed = system
    changed%law = perturbed_law(system%law, oscillation_bounds(system%law, search%balance%motion), direction)
    call orbit%apply_law(changed, search%loading)
  end subroutine perturb
end module attrito_stability_assess
