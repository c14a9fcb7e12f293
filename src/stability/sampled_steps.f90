!> A period of a sampled motion in steps on which no contact changes what it does: between samples and located switches.
!>
!> In contrast to smooth segments of one-tangent contacts (`attrito_stability_smooth_segments`) the linearised forces of a contact
!> that slips along two tangents vary in time, with the direction of slip e and the radius r of its slider's disc, which are known at
!> both ends of a step.
module attrito_stability_sampled_steps
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_turn, only: slip_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_model_contacts, only: contact_type
  use attrito_stability_friction_path, only: path_type, follow_path, turn_over, unit
  use attrito_stability_sampled_motion, only: sampled_motion_type, at_contact_type
  implicit none
  private
  public :: sampled_steps_type, new_sampled_steps

  type :: sampled_steps_type
    !> Where steps begin and the last ends, in periods [0:steps]
    real(wp), allocatable :: times(:)
    !> What each contact does on a step [contacts, steps]
    integer, allocatable :: regime(:, :)
    !> While it slips: direction at the beginning of a step, and how it turns by its end [contacts, steps]
    real(wp), allocatable :: direction(:, :, :)
    type(slip_type), allocatable :: turned(:, :)
    !> Radius where a step begins [contacts, steps]
    real(wp), allocatable :: radius(:, :)
    !> u'/v' where a contact lands at the beginning of a step [2, contacts, steps]
    real(wp), allocatable :: landing_slope(:, :, :)
    !> Contacts that stick throughout, and those that never open [contacts]
    logical, allocatable :: stuck(:), closed(:)
    !> Do all sliders come back?
    logical :: periodic = .false.
  end type sampled_steps_type

contains

  !> From the contacts' motion and sliders at its start [2, contacts], which are marched until they come back.
  pure subroutine new_sampled_steps(law, motion, slider, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> Sliders, as the contacts have them
    real(wp), intent(in) :: slider(:, :)
    type(sampled_steps_type), intent(out) :: self
    type(path_type) :: paths(size(law))
    real(wp), allocatable :: places(:)
    integer :: i, steps

    allocate (places(0), self%stuck(size(law)), self%closed(size(law)))
    do i = 1, size(law)
      paths(i) = follow_path(law(i), motion, slider(:, i))
      places = [places, paths(i)%instants]
      self%closed(i) = paths(i)%start%regime /= regime_open .and. all(paths(i)%regimes /= regime_open)
      self%stuck(i) = paths(i)%start%regime == regime_stick .and. size(paths(i)%instants) == 0
    end do
    self%periodic = all(paths%periodic)
    places = merged(places, motion%samples())
    steps = size(places) - 1
    allocate (self%times(0:steps), source=places/motion%samples())
    allocate (self%regime(size(law), steps), self%turned(size(law), steps), self%direction(2, size(law), steps), &
              self%radius(size(law), steps), self%landing_slope(2, size(law), steps))
    do i = 1, size(law)
      call fill_steps(law(i), motion, paths(i), places, i, self)
    end do
  end subroutine new_sampled_steps

  !> What one contact does on every step.
  pure subroutine fill_steps(law, motion, path, places, contact, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(in) :: motion
    !> What the contact does over the period
    type(path_type), intent(in) :: path
    !> Places of samples and switches
    real(wp), intent(in) :: places(0:)
    !> Number of the contact
    integer, intent(in) :: contact
    type(sampled_steps_type), intent(inout) :: self
    type(at_contact_type) :: from, to
    real(wp) :: slider(2), direction(2)
    integer :: step, next, regime, before

    regime = path%start%regime
    slider = path%start%slider
    direction = path%start%direction
    next = 1
    to = motion%at_contact(law, places(0))
    do step = 1, size(self%times) - 1
      from = to
      to = motion%at_contact(law, places(step))
      before = regime
      do while (next <= size(path%instants))
        if (path%instants(next) > places(step - 1)) exit
        regime = path%regimes(next)
        next = next + 1
      end do
      associate (radius => law%friction_coefficient*max(from%pressed, 0.0_wp), turned => self%turned(contact, step))
        if (before == regime_slip) slider = from%u - radius*direction
        if (before == regime_open) slider = from%u
        if (before == regime_stick .and. regime == regime_slip) direction = unit(from%u - slider, direction)
        if (before == regime_open .and. regime == regime_slip) direction = unit(from%u_rate, direction)
        self%regime(contact, step) = regime
        self%direction(:, contact, step) = direction
        self%radius(contact, step) = radius
        self%landing_slope(:, contact, step) = 0.0_wp
        if (before == regime_open .and. regime == regime_stick) self%landing_slope(:, contact, step) = &
          law%normal_stiffness/law%tangential_stiffness*from%u_rate/from%pressed_rate
        if (regime /= regime_slip) cycle
        turned = turn_over(law, from, to, direction)
        direction = turned%e
      end associate
    end do
  end subroutine fill_steps

  !> All samples and switches, ascending, without repetitions.
  pure function merged(switches, samples) result(places)
    !> Does any contact slip or open?
    real(wp), intent(in) :: switches(:)
    !> Samples a period, J
    integer, intent(in) :: samples
    real(wp), allocatable :: places(:)
    real(wp) :: sorted(size(switches) + 1), all_places(size(switches) + samples + 1)
    integer :: i, j, sample, count

    sorted = [switches, samples + 1.0_wp]
    do i = 2, size(sorted)
      do j = i, 2, -1
        if (sorted(j - 1) <= sorted(j)) exit
        sorted(j - 1:j) = sorted(j:j - 1:-1)
      end do
    end do
    i = 1
    sample = 0
    count = 0
    do while (sample <= samples)
      count = count + 1
      all_places(count) = min(sorted(i), real(sample, wp))
      if (sample <= all_places(count)) sample = sample + 1
      do while (sorted(i) <= all_places(count))
        i = i + 1
      end do
    end do
    places = all_places(:count)
  end function merged
end module attrito_stability_sampled_steps
