!> What a contact does over a period of a sampled motion: where it begins to stick, to slip, to be open, located on the motion.
!>
!> With the radius r = mu N/kt of the disc that the slider w stays in, and e = (u - w)/r while it slips, which turns with u,
!>
!> $$ |u - w| = r \;\text{(slip begins)}, \qquad e \cdot u' - r' = 0 \;\text{(it ends)}, \qquad N = 0 \;\text{(open; landing)}. $$
!>
!> One tangent is the same on a line, where e does not turn. A contact that lands sticks if |u'| <= r', else it slips along u'.
!> The direction is carried from sample to sample by the step of `attrito_contact_disc_turn`, of second order; periods are marched
!> until slider and direction come back.
module attrito_stability_friction_path
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_turn, only: slip_type, turn
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_model_contacts, only: contact_type
  use attrito_stability_sampled_motion, only: sampled_motion_type, at_contact_type
  implicit none
  private
  public :: path_type, friction_type, follow_path, turn_over, unit

  !> Periods after which a slider that does not come back is given up; distance, relative to the motion, that is none
  integer, parameter :: most_periods = 500 ! conventional
  real(wp), parameter :: same = 1.0e-12_wp ! derived
  !> Switches a sample beyond which a contact chatters
  integer, parameter :: most_switches = 8 ! conventional
  !> Radius at one end of a step, part of that at the other, below which the slider stands at the displacement there
  real(wp), parameter :: no_radius = 1.0e-9_wp ! derived
  integer, parameter :: halvings = 60 ! derived

  !> A contact at an instant
  type :: friction_type
    integer :: regime = regime_stick
    !> Slider, and the direction from it to the displacement while the contact slips
    real(wp) :: slider(2) = 0.0_wp, direction(2) = 0.0_wp
  end type friction_type

  type :: path_type
    !> Where the period begins
    type(friction_type) :: start
    !> Places in samples at which a regime begins, ascending, and the regimes
    real(wp), allocatable :: instants(:)
    integer, allocatable :: regimes(:)
    !> Does the slider come back?
    logical :: periodic = .false.
  end type path_type

contains

  !> March periods from a slider until it comes back.
  pure function follow_path(law, motion, slider) result(self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Sliders, as the contacts have them
    real(wp), intent(in) :: slider(2)
    type(path_type) :: self
    type(friction_type) :: state
    integer :: period
    real(wp) :: size_of_motion

    size_of_motion = maxval(abs(motion%displacement(:, law%first_row:law%first_row + law%tangents)))
    state = first_state(law, motion, slider)
    do period = 1, most_periods
      self%start = state
      call march(law, motion, state, self)
      if (.not. self%periodic) return
      self%periodic = state%regime == self%start%regime .and. &
                      maxval(abs(state%slider - self%start%slider)) <= same*size_of_motion .and. &
                      maxval(abs(state%direction - self%start%direction)) <= sqrt(same)
      if (self%periodic) return
    end do
  end function follow_path

  !> A contact with a slider that need not be within its law.
  pure function first_state(law, motion, slider) result(state)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Sliders, as the contacts have them
    real(wp), intent(in) :: slider(2)
    type(friction_type) :: state
    type(at_contact_type) :: here
    real(wp) :: radius, distance

    here = motion%at_contact(law, 0.0_wp)
    radius = law%friction_coefficient*here%pressed
    state%slider = slider
    if (.not. here%closed) then
      state%regime = regime_open
      state%slider = here%u
      return
    end if
    distance = norm2(here%u - slider)
    if (distance < radius) return
    state%direction = (here%u - slider)/distance
    state%slider = here%u - radius*state%direction
    if (slip_rate(law, here, state%direction) > 0.0_wp) state%regime = regime_slip
  end function first_state

  !> One period; `periodic`: it does not chatter.
  pure subroutine march(law, motion, state, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> State of a contact at an instant
    type(friction_type), intent(inout) :: state
    type(path_type), intent(inout) :: self
    real(wp) :: instant, reached
    integer :: before

    if (allocated(self%instants)) deallocate (self%instants, self%regimes)
    allocate (self%instants(0), self%regimes(0))
    self%periodic = .true.
    instant = 0.0_wp
    do while (instant < motion%samples())
      before = state%regime
      select case (state%regime)
       case (regime_stick)
        call stick(law, motion, instant, state, reached)
       case (regime_slip)
        call slip(law, motion, instant, state, reached)
       case default
        call fly(law, motion, instant, state, reached)
      end select
      instant = reached
      if (state%regime == before) cycle
      self%instants = [self%instants, instant]
      self%regimes = [self%regimes, state%regime]
      self%periodic = count(self%instants > instant - 1.0_wp) <= most_switches
      if (.not. self%periodic) return
    end do
  end subroutine march

  !> The sample after an instant.
  pure real(wp) function next_sample(instant)
    !> Number of the sample, with parts
    real(wp), intent(in) :: instant

    next_sample = floor(instant) + 1.0_wp
  end function next_sample

  !> Stick to the next sample, or until the displacement leaves the disc.
  pure subroutine stick(law, motion, instant, state, reached)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Number of the sample, with parts
    real(wp), intent(in) :: instant
    !> State of a contact at an instant
    type(friction_type), intent(inout) :: state
    !> Defect that is left
    real(wp), intent(out) :: reached
    type(at_contact_type) :: here
    real(wp) :: ends(2), middle
    integer :: i

    reached = next_sample(instant)
    here = motion%at_contact(law, reached)
    if (outside(here) <= 4.0_wp*epsilon(1.0_wp)*(sum(abs(here%u)) + abs(here%pressed))) return
    ends = [instant, reached]
    do i = 1, halvings
      middle = 0.5_wp*sum(ends)
      ends(merge(2, 1, outside(motion%at_contact(law, middle)) > 0.0_wp)) = middle
    end do
    reached = ends(2)
    here = motion%at_contact(law, reached)
    state%regime = regime_slip
    state%direction = unit(here%u - state%slider, state%direction)

  contains

    pure real(wp) function outside(at)
      !> Displacement, normal force and rates of a contact at an instant
      type(at_contact_type), intent(in) :: at

      outside = norm2(at%u - state%slider) - law%friction_coefficient*at%pressed
    end function outside
  end subroutine stick

  !> Slip to the next sample, or until the contact opens or the slider comes to rest.
  pure subroutine slip(law, motion, instant, state, reached)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Number of the sample, with parts
    real(wp), intent(in) :: instant
    !> State of a contact at an instant
    type(friction_type), intent(inout) :: state
    !> Defect that is left
    real(wp), intent(out) :: reached
    type(at_contact_type) :: from, here
    type(slip_type) :: turned
    real(wp) :: ends(2), middle
    integer :: i

    from = motion%at_contact(law, instant)
    reached = next_sample(instant)
    here = motion%at_contact(law, reached)
    if (.not. here%closed) then
      reached = lift_off(law, motion, instant, reached)
      state%regime = regime_open
      state%slider = here%u
      return
    end if
    turned = turn_over(law, from, here, state%direction)
    if (slip_rate(law, here, turned%e) < 0.0_wp) then
      state%regime = regime_stick
      ends = [instant, reached]
      do i = 1, halvings
        middle = 0.5_wp*sum(ends)
        here = motion%at_contact(law, middle)
        turned = turn_over(law, from, here, state%direction)
        ends(merge(2, 1, slip_rate(law, here, turned%e) < 0.0_wp)) = middle
      end do
      reached = ends(2)
    end if
    state%direction = turned%e
    state%slider = here%u - law%friction_coefficient*here%pressed*turned%e
  end subroutine slip

  !> Open to the next sample, or until the contact lands.
  pure subroutine fly(law, motion, instant, state, reached)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Number of the sample, with parts
    real(wp), intent(in) :: instant
    !> State of a contact at an instant
    type(friction_type), intent(inout) :: state
    !> Defect that is left
    real(wp), intent(out) :: reached
    type(at_contact_type) :: here

    reached = next_sample(instant)
    here = motion%at_contact(law, reached)
    if (here%closed) then
      reached = lift_off(law, motion, reached, instant)
      here = motion%at_contact(law, reached)
      state%regime = merge(regime_stick, regime_slip, norm2(here%u_rate) <= law%friction_coefficient*here%pressed_rate)
      state%direction = unit(here%u_rate, state%direction)
    end if
    state%slider = here%u
  end subroutine fly

  !> Where N vanishes, from a closed instant towards an open one.
  pure real(wp) function lift_off(law, motion, closed, open) result(instant)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Instant at which the contact is closed; instant at which it is open
    real(wp), intent(in) :: closed, open
    type(at_contact_type) :: here
    real(wp) :: ends(2)
    integer :: i

    ends = [closed, open]
    do i = 1, halvings
      instant = 0.5_wp*sum(ends)
      here = motion%at_contact(law, instant)
      ends(merge(1, 2, here%closed)) = instant
    end do
    ! The later of both: never where the step began.
    instant = maxval(ends)
  end function lift_off

  !> e . u' - r', the rate of a slider that slips.
  pure real(wp) function slip_rate(law, here, direction)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Displacement, normal force and rates of a contact at an instant
    type(at_contact_type), intent(in) :: here
    !> Direction of slip
    real(wp), intent(in) :: direction(2)

    slip_rate = dot_product(direction, here%u_rate) - law%friction_coefficient*here%pressed_rate
  end function slip_rate

  !> How the direction of slip turns between two instants, with its derivatives; `by_slider` is by the angle at the first.
  pure function turn_over(law, from, to, direction) result(turned)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Displacement, normal force and rates of a contact at an instant
    type(at_contact_type), intent(in) :: from, to
    !> Direction of slip
    real(wp), intent(in) :: direction(2)
    type(slip_type) :: turned
    real(wp) :: moved(2), radius(2)

    moved = to%u - from%u
    radius = law%friction_coefficient*[from%pressed, to%pressed]
    if (minval(radius) > no_radius*maxval(radius)) then
      call turn(direction, moved, 1.0_wp, radius(1), radius(2), turned)
      turned%by_from = -turned%by_to
    else
      ! The slider stands where the displacement is at one end: at the start it goes after it, at the end its direction has no effect.
      turned%e = unit(moved, direction)
      if (radius(2) > radius(1) .and. norm2(moved) > 0.0_wp) then
        turned%by_to = [-turned%e(2), turned%e(1)]/norm2(moved)
        turned%by_from = -turned%by_to
      end if
    end if
    turned%radius = max(radius(2), 0.0_wp)
    if (law%tangents > 1) return
    turned = slip_type(e=turned%e, radius=turned%radius)
  end function turn_over

  !> The direction of a vector, or if it has none another.
  pure function unit(vector, otherwise) result(direction)
    !> Vector to start from; direction where it has none
    real(wp), intent(in) :: vector(2), otherwise(2)
    real(wp) :: direction(2), length

    length = norm2(vector)
    direction = otherwise
    if (length > 0.0_wp) direction = vector/length
  end function unit
end module attrito_stability_friction_path
