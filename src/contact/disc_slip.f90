!> Slip of a contact with two tangents, panel after panel, until it sticks or to a given instant.
!>
!> Slip ends where |z| would no longer grow beyond the rim, u'.e = r'. A panel in which that happens is solved again, with its end
!> there. Lengths of panels follow their error, which goes with the power s of the length.
module attrito_contact_disc_slip
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_rules_type, disc_motion_type
  use attrito_contact_disc_record, only: disc_state_type, disc_record_type, leave_rim
  use attrito_contact_slip_gradient, only: differentiate_panel
  use attrito_contact_slip_panel, only: slip_panel_type, solve_panel, direction_at, instant_at
  use attrito_contact_state, only: regime_slip
  implicit none
  private
  public :: slip_on

  !> A panel, or what is left of it before slip ends, that is rounding
  real(wp), parameter :: shortest = 1.0e-13_wp, nothing = 1.0e-12_wp ! derived

contains

  !> Slip from an instant to another, or until the contact sticks.
  subroutine slip_on(motion, rules, to, opens, panel, state, record, theta)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(in) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> Where to stop at the latest
    real(wp), intent(in) :: to
    !> Does the contact open there?
    logical, intent(in) :: opens
    !> Room for a panel
    type(slip_panel_type), intent(inout) :: panel
    !> The contact, which slips
    type(disc_state_type), intent(inout) :: state
    !> What is kept of the march
    type(disc_record_type), intent(inout) :: record
    !> Where it begins, then where it ends
    real(wp), intent(inout) :: theta
    real(wp) :: basis(size(panel%basis, 1)), jet(6), length, speed, stop, by_phi(record%columns, size(panel%weight))
    logical :: solved, stops, lasts

    length = rules%longest
    call motion%at(theta, basis, jet)
    speed = speed_of(jet, state%phi)
    do while (theta < to)
      lasts = length >= 0.999_wp*(to - theta)
      if (lasts) then
        length = to - theta
      else
        length = min(length, 0.5_wp*(to - theta))
      end if
      call solve_panel(motion, rules, theta, length, opens .and. lasts, state%phi, panel, solved)
      if (.not. is_good()) then
        if (length > shortest) cycle
        record%failed = .true.
        return
      end if
      call find_stop(motion, rules, panel, speed, stops, stop)
      if (stops) then
        length = instant_at(panel, stop) - theta
        if (length > nothing) then
          call solve_panel(motion, rules, theta, length, .false., state%phi, panel, solved)
          if (.not. is_good()) cycle
          call keep()
          if (record%failed) return
        end if
        theta = theta + max(length, 0.0_wp)
        call motion%at(theta, basis, jet)
        call record%add_interval(theta, regime_slip, state)
        call leave_rim(motion, basis, jet, record%by_motion, state)
        return
      end if
      call keep()
      if (record%failed) return
      theta = merge(to, theta + length, lasts)
      length = min(rules%longest, length*min(2.0_wp, max(0.5_wp, wanted())))
      speed = speed_of(panel%jet(:, size(panel%weight)), state%phi)
    end do
    call record%add_interval(to, regime_slip, state)

  contains

    !> Is the panel as exact as it is to be? If not, the next one is shorter.
    logical function is_good()
      is_good = solved
      if (solved) is_good = panel%error <= rules%tolerance
      if (is_good) return
      if (solved) then
        length = length*max(0.3_wp, wanted())
      else
        length = 0.4_wp*length
      end if
    end function is_good

    !> Length that makes the error a little less than it may be, over the present one.
    real(wp) function wanted()
      wanted = 0.85_wp*(rules%tolerance/max(panel%error, tiny(1.0_wp)))**(1.0_wp/size(panel%weight))
    end function wanted

    !> Put the panel behind the others.
    subroutine keep()
      if (record%columns > 0) then
        call differentiate_panel(motion, rules, state%by_phi, record%by_motion, panel, by_phi, solved)
        record%failed = .not. solved
        if (record%failed) return
        state%by_phi = by_phi(:, size(panel%weight))
      end if
      call record%add_nodes(motion, panel, by_phi)
      state%phi = panel%phi(size(panel%weight))
    end subroutine keep
  end subroutine slip_on

  !> Speed at which |z| - r would grow in stick: slip lasts while it is positive.
  pure real(wp) function speed_of(jet, phi) result(speed)
    !> u_1, u_2, r and their derivatives; direction of slip
    real(wp), intent(in) :: jet(6), phi

    speed = jet(4)*cos(phi) + jet(5)*sin(phi) - jet(6)
  end function speed_of

  !> Does slip end in a panel, and where? Signs are looked at at the nodes, and between them where a dip comes near to zero.
  subroutine find_stop(motion, rules, panel, speed, stops, stop)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(in) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> The panel, solved
    type(slip_panel_type), intent(in) :: panel
    !> Speed at the start
    real(wp), intent(in) :: speed
    !> Does it end?
    logical, intent(out) :: stops
    !> Part of the panel
    real(wp), intent(out) :: stop
    !> Places that are looked at in a dip, and a dip's height over the largest speed that is looked into
    integer, parameter :: looks = 8 ! guess
    real(wp), parameter :: near = 0.1_wp ! guess
    real(wp) :: speeds(0:size(panel%weight)), x(0:size(panel%weight)), place, largest
    integer :: i, j, s

    s = size(panel%weight)
    x = rules%radau%x
    if (panel%opens) x = rules%gauss%x
    speeds(0) = speed
    do i = 1, s
      speeds(i) = dot_product(panel%jet(4:5, i), panel%e(:, i)) - panel%jet(6, i)
    end do
    stops = .false.
    stop = 0.0_wp
    largest = maxval(abs(speeds))
    do i = 1, s
      if (speeds(i) < 0.0_wp) then
        stops = .true.
        if (speeds(i - 1) > 0.0_wp) stop = zero_between(x(i - 1), x(i), speeds(i - 1), speeds(i))
        return
      end if
      if (i == s) return
      if (speeds(i) > min(speeds(i - 1), speeds(i + 1), near*largest)) cycle
      do j = 1, looks - 1
        place = x(i - 1) + (x(i + 1) - x(i - 1))*j/looks
        associate (there => speed_at(place))
          if (there >= 0.0_wp) cycle
          stops = .true.
          if (speeds(i - 1) > 0.0_wp) stop = zero_between(x(i - 1), place, speeds(i - 1), there)
          return
        end associate
      end do
    end do

  contains

    real(wp) function speed_at(x)
      !> Part of the panel
      real(wp), intent(in) :: x
      real(wp) :: basis(2*motion%harmonics + 1), jet(6)

      call motion%at(instant_at(panel, x), basis, jet)
      speed_at = speed_of(jet, direction_at(panel, rules, x))
    end function speed_at

    !> Where the speed vanishes between two places, by regula falsi that halves the end that stays.
    real(wp) function zero_between(left, right, at_left, at_right) result(x)
      !> Parts of the panel, and the speeds there, positive and negative
      real(wp), intent(in) :: left, right, at_left, at_right
      real(wp) :: low, high, f_low, f_high, f
      integer :: iteration, side

      low = left
      high = right
      f_low = at_left
      f_high = at_right
      side = 0
      do iteration = 1, 100
        x = (f_low*high - f_high*low)/(f_low - f_high)
        if (.not. (x > low .and. x < high) .or. iteration > 30) x = 0.5_wp*(low + high)
        f = speed_at(x)
        if (abs(f) <= 1.0e-14_wp*largest .or. high - low < 1.0e-14_wp) exit
        if (f > 0.0_wp) then
          low = x
          f_low = f
          if (side == 1) f_high = 0.5_wp*f_high
          side = 1
        else
          high = x
          f_high = f
          if (side == -1) f_low = 0.5_wp*f_low
          side = -1
        end if
      end do
    end function zero_between
  end subroutine find_stop
end module attrito_contact_disc_slip
