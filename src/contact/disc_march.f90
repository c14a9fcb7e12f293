!> March of a contact with two tangents from event to event while it is closed: stick, slip, stick, ..., from a start slider or from
!> where the contact lands, to a given instant or until it opens.
!>
!> At landing r = 0 and z = 0. A contact that moves faster than its disc grows, |u'| > r', slips at once, along u' and with
!>
!> $$ \phi' = \frac{u'' \cdot e_\perp}{r' + |u'|}, \qquad d\phi = \frac{du' \cdot e_\perp - \phi' dr}{|u'|} $$
!>
!> the one solution of the equation of slip that stays bounded there. A slower one sticks where it lands, w = u, and of all events
!> this one alone leaves a term of its instant: dw = du - (u'/r') dr.
module attrito_contact_disc_march
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_disc_record, only: disc_state_type, disc_record_type, leave_rim, enter_rim
  use attrito_contact_disc_slip, only: slip_on
  use attrito_contact_disc_stick, only: stick_on
  use attrito_contact_slip_panel, only: slip_panel_type
  use attrito_contact_state, only: regime_slip
  implicit none
  private
  public :: start_at, land, march_disc, slider_at

contains

  !> A slider at the start of a period: one outside its disc is taken to the nearest place in it; one on the rim slips or sticks.
  subroutine start_at(motion, theta, slider, by_slider, record, state, entered)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Angle of the period
    real(wp), intent(in) :: theta
    !> Slider, and its derivative [columns, 2]
    real(wp), intent(in) :: slider(2), by_slider(:, :)
    !> What is kept of the march
    type(disc_record_type), intent(in) :: record
    !> The contact
    type(disc_state_type), intent(out) :: state
    !> Was the slider outside its disc?
    logical, intent(out) :: entered
    real(wp) :: jet(6), distance

    jet = motion%at(theta)
    state%slider = slider
    state%by_slider = by_slider
    allocate (state%by_phi(record%columns), source=0.0_wp)
    distance = norm2(jet(1:2) - slider)
    entered = distance > jet(3) + motion%negligible
    if (distance < jet(3) - motion%negligible) return
    call enter_rim(motion, theta, record%by_motion, state)
    if (dot_product(jet(4:5), jet(1:2) - slider) <= jet(6)*distance) call leave_rim(motion, theta, record%by_motion, .false., state)
  end subroutine start_at

  !> A contact that lands.
  subroutine land(motion, theta, record, state)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where r vanishes and grows
    real(wp), intent(in) :: theta
    !> What is kept of the march
    type(disc_record_type), intent(in) :: record
    !> The contact
    type(disc_state_type), intent(out) :: state
    real(wp) :: basis(2*motion%harmonics + 1), jet(6), second(3), speed, e(2), turn, derivative
    integer :: h, k

    jet = motion%at(theta)
    basis = motion%basis_at(theta)
    allocate (state%by_phi(record%columns), state%by_slider(record%columns, 2), source=0.0_wp)
    k = 2*motion%harmonics + 1
    speed = norm2(jet(4:5))
    state%slips = speed > jet(6)
    if (.not. state%slips) then
      state%on_rim = .true.
      state%slider = jet(1:2)
      if (.not. record%by_motion) return
      state%by_slider(:k, 1) = basis
      state%by_slider(k + 1:2*k, 2) = basis
      state%by_slider(2*k + 1:3*k, :) = spread(-motion%slope*basis, 2, 2)*spread(jet(4:5)/jet(6), 1, k)
      return
    end if
    state%phi = atan2(jet(5), jet(4))
    if (.not. record%by_motion) return
    e = jet(4:5)/speed
    second = motion%second_at(theta)
    turn = (second(2)*e(1) - second(1)*e(2))/(jet(6) + speed)
    do h = 1, motion%harmonics
      derivative = -h*basis(2*h + 1)/speed
      state%by_phi(2*h) = -e(2)*derivative
      state%by_phi(k + 2*h) = e(1)*derivative
      derivative = h*basis(2*h)/speed
      state%by_phi(2*h + 1) = -e(2)*derivative
      state%by_phi(k + 2*h + 1) = e(1)*derivative
    end do
    state%by_phi(2*k + 1:3*k) = -(turn*motion%slope/speed)*basis
    state%by_phi(1) = -e(2)*motion%passing/speed
    state%by_phi(k + 1) = e(1)*motion%passing/speed
  end subroutine land

  !> March a closed contact from an instant to another, from kink to kink of its radius.
  subroutine march_disc(motion, rules, from, to, opens, panel, state, record)
    !> Motion of the contact, whose piece of the law this changes
    type(disc_motion_type), intent(inout) :: motion
    !> Rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> Angles of the period
    real(wp), intent(in) :: from, to
    !> Does the contact open at the end?
    logical, intent(in) :: opens
    !> Room for a panel
    type(slip_panel_type), intent(inout) :: panel
    !> The contact, at the start, then at the end
    type(disc_state_type), intent(inout) :: state
    !> What is kept of the march
    type(disc_record_type), intent(inout) :: record
    !> Changes between stick and slip in a row that lead nowhere; an interval that is rounding
    integer, parameter :: most_changes = 1000 ! guess
    real(wp), parameter :: nothing = 1.0e-14_wp ! derived
    !> A disc that holds nothing, over the rounding of u
    real(wp), parameter :: no_disc = 4.0_wp ! derived
    real(wp) :: theta, next, jet(6)
    integer :: change

    if (motion%largest <= no_disc*motion%rounding) then
      ! Without panels there is no force; the slider goes with the motion.
      state%slips = .true.
      call record%add_interval(to, regime_slip, state)
      return
    end if
    theta = from
    call motion%segment(theta, to, next)
    do change = 1, most_changes
      if (theta >= next - nothing) then
        if (theta >= to - nothing) exit
        call motion%segment(theta, to, next)
        jet = motion%at(theta)
        if (state%slips .and. jet(4)*cos(state%phi) + jet(5)*sin(state%phi) <= jet(6)) then
          call leave_rim(motion, theta, record%by_motion, .true., state)
        end if
      end if
      if (state%slips) then
        call slip_on(motion, rules, next, opens .and. next >= to, panel, state, record, theta)
      else
        call stick_on(motion, next, state, record, theta)
      end if
      if (record%failed) exit
    end do
    record%failed = record%failed .or. change > most_changes
    motion%piece = 0
  end subroutine march_disc

  !> The slider at an instant, and its derivative, of a contact that slips or sticks there.
  subroutine slider_at(motion, theta, record, state, slider, by_slider)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Angle of the period
    real(wp), intent(in) :: theta
    !> What is kept of the march
    type(disc_record_type), intent(in) :: record
    !> The contact
    type(disc_state_type), intent(in) :: state
    !> Slider, and its derivative [columns, 2]
    real(wp), intent(out) :: slider(2), by_slider(:, :)
    type(disc_state_type) :: there

    there = state
    if (state%slips) call leave_rim(motion, theta, record%by_motion, .false., there)
    slider = there%slider
    by_slider = there%by_slider
  end subroutine slider_at
end module attrito_contact_disc_march
