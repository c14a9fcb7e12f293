!> What multipliers of an orbit say of it, by every engine that is asked for.
!>
!> Orbits by samples are refined until the largest multiplier is known well enough to say on which side of the unit circle it lies.
!> What the last doubling changed is given as the error: at second order three times what is left.
module attrito_stability_assess
  use attrito_core_kinds, only: wp
  use attrito_integrate_system, only: system_type
  use attrito_stability_balance_motion, only: oscillation_bounds
  use attrito_stability_event_orbit, only: event_orbit_type
  use attrito_stability_examination, only: examination_type, examine_options_type, number, by_monodromy, by_hill
  use attrito_stability_graze, only: perturbed_law, grazing_contact
  use attrito_stability_hill, only: hill_multipliers, too_large
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of, in_modes, largest_change
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_orbit_search, only: orbit_search_type, find_orbit
  use attrito_stability_verdict, only: judge, largest_multiplier, band, not_examined, indeterminate
  implicit none
  private
  public :: assess

  !> Multipliers that the two engines may differ by and still agree
  real(wp), parameter :: agreement = 1.0e-3_wp ! guess
  !> Change of multipliers by a doubling of samples that is small enough, and the same as a part of the distance from the unit circle
  real(wp), parameter :: accepted = 1.0e-3_wp, accepted_part = 0.1_wp ! guess

  !> One of those whose laws are slightly changed
  type :: perturbed_orbit_type
    class(orbit_type), allocatable :: orbit
  end type perturbed_orbit_type

contains

  !> Assess an orbit that was found.
  subroutine assess(search, options, system, orbit, self)
    !> What it was found by, and is found by on a finer resolution
    type(orbit_search_type), intent(inout) :: search
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit, which is refined if need be
    class(orbit_type), allocatable, intent(inout) :: orbit
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    integer :: modes, info

    self%reason = ''
    self%verdict = not_examined
    self%low = 0.0_wp
    self%high = -1.0_wp
    if (allocated(self%monodromy)) deallocate (self%monodromy)
    if (allocated(self%hill)) deallocate (self%hill)
    modes = size(system%eigenvalues)
    if (iand(options%methods, by_monodromy) /= 0) call refine_multipliers(search, system, orbit, modes, self)
    if (len(self%reason) == 0 .and. iand(options%methods, by_hill) /= 0) then
      select type (orbit)
       type is (event_orbit_type)
        call hill_multipliers(system, orbit%segments, orbit%period, self%hill, info)
        if (info /= 0) self%reason = 'eigenvalues were not found'
        if (info == too_large) self%reason = 'too many contacts slip or open for Hill''s problem'
      end select
    end if
    if (.not. (allocated(self%monodromy) .or. allocated(self%hill))) return
    self%verdict = verdict_of(self, .not. all(orbit%stuck))
    call look_for_graze(search, system, modes, orbit, self)
  end subroutine assess

  !> Multipliers by the monodromy matrix, of a resolution that is fine enough.
  subroutine refine_multipliers(search, system, orbit, modes, self)
    !> What the orbit is found by on a finer resolution
    type(orbit_search_type), intent(inout) :: search
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit that is refined
    class(orbit_type), allocatable, intent(inout) :: orbit
    !> Number of modes that multipliers are found in
    integer, intent(out) :: modes
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    type(multiplier_type), allocatable :: before(:)
    real(wp) :: by_modes, by_samples
    integer :: info
    logical :: found

    by_samples = merge(huge(1.0_wp), 0.0_wp, orbit%can_refine())
    do
      if (.not. orbit%periodic) then
        self%verdict = indeterminate
        self%reason = 'a slider does not come back within the periods it was followed'
        exit
      end if
      if (allocated(self%monodromy)) then
        call move_alloc(self%monodromy, before)
        call in_modes(system, modes, orbit, self%monodromy, info)
        if (info == 0) by_samples = largest_change(before, self%monodromy)
      else
        call multipliers_of(system, orbit, self%monodromy, modes, by_modes, info)
      end if
      if (info /= 0) then
        self%reason = 'eigenvalues were not found'
        exit
      end if
      self%change = by_modes + by_samples
      if (by_samples <= min(accepted, accepted_part*abs(largest_multiplier(self%monodromy) - 1.0_wp))) return
      if (.not. orbit%can_refine()) return
      call orbit%refine()
      call find_orbit(search, orbit, found)
      if (.not. found) exit
    end do
    if (allocated(self%monodromy)) deallocate (self%monodromy)
  end subroutine refine_multipliers

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
    class(orbit_type), intent(in) :: orbit
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    type(perturbed_orbit_type) :: beside(2)
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: open
    integer :: i, contact, info

    contact = 0
    do i = 1, 2
      allocate (beside(i)%orbit, source=orbit)
      call perturb(search, system, 2*i - 3, beside(i)%orbit)
      contact = max(contact, grazing_contact(orbit, beside(i)%orbit))
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
      call in_modes(system, modes, beside(i)%orbit, multipliers, info)
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
    class(orbit_type), intent(inout) :: orbit
    type(system_type) :: changed

    changed = system
    changed%law = perturbed_law(system%law, oscillation_bounds(system%law, search%balance%motion), direction)
    call orbit%apply_law(changed, search%loading)
  end subroutine perturb
end module attrito_stability_assess
