!> Slip of a contact with two tangents, panel after panel, until it sticks or to a given instant.
!>
!> Slip ends where |z| would no longer grow beyond the rim, u'.e = r'. A panel in which that happens is solved again, with its end
!> there. Lengths of panels follow their error, which goes with the power s of the length. If r all but vanishes and no panel is
!> short enough the direction stays for next to nothing of the period, twice as long each time: r dphi never grows along slip.
module attrito_contact_disc_slip
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_disc_record, only: disc_state_type, disc_record_type, leave_rim
  use attrito_contact_panel_rule, only: panel_rule_type
  use attrito_contact_slip_gradient, only: differentiate_panel
  use attrito_contact_slip_panel, only: slip_panel_type, solve_panel
  use attrito_contact_state, only: regime_slip
  implicit none
  private
  public :: slip_on

  !> A panel, or what is left of it before slip ends, that is rounding
  real(wp), parameter :: shortest = 1.0e-13_wp, nothing = 1.0e-12_wp ! derived
  !> Times that the direction stays for a while, each twice as long, before a march has failed: 1e-9 of the period in all
  integer, parameter :: most_skipped = 12 ! derived
  !> Of the first panel: how far the contact moves over the radius of its disc. The direction that slip begins with is forgotten like
  !> e^-path, which a panel resolves
  real(wp), parameter :: first_path = 2.0_wp ! derived

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
    real(wp) :: jet(6), length, speed, stop, by_phi(size(panel%weight), record%columns)
    integer :: skipped
    logical :: solved, stops, lasts

    jet = motion%at(theta)
    speed = speed_of(jet(4:), state%phi)
    skipped = 0
    length = rules%longest
    if (jet(3) > motion%negligible .and. norm2(jet(4:5))*length > first_path*jet(3)) length = first_path*jet(3)/norm2(jet(4:5))
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
        skipped = skipped + 1
        record%failed = skipped > most_skipped
        if (record%failed) return
        theta = min(theta + 2**skipped*nothing, to)
        speed = speed_at(theta)
        length = rules%longest
        cycle
      end if
      call find_stop(motion, rules, panel, speed, stops, stop)
      if (stops) then
        length = length*stop
        if (length > nothing) then
          call solve_panel(motion, rules, theta, length, .false., state%phi, panel, solved)
          if (.not. is_good()) cycle
          call keep()
          if (record%failed) return
        end if
        theta = theta + max(length, 0.0_wp)
        call record%add_interval(theta, regime_slip, state)
        call leave_rim(motion, theta, record%by_motion, .false., state)
        return
      end if
      call keep()
      if (record%failed) return
      theta = merge(to, theta + length, lasts)
      length = min(rules%longest, length*min(2.0_wp, max(0.5_wp, wanted())))
      speed = speed_of(panel%jet(size(panel%weight), 4:), state%phi)
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

    !> Speed at an instant at which the contact slips as it does now.
    real(wp) function speed_at(theta)
      !> Angle of the period
      real(wp), intent(in) :: theta
      real(wp) :: jet(6)

      jet = motion%at(theta)
      speed_at = speed_of(jet(4:), state%phi)
    end function speed_at

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
        state%by_phi = by_phi(size(panel%weight), :)
      end if
      call record%add_nodes(motion, panel, by_phi)
      state%phi = panel%phi(size(panel%weight))
    end subroutine keep
  end subroutine slip_on

  !> Speed at which |z| - r would grow in stick: slip lasts while it is positive.
  pure real(wp) function speed_of(jet, phi) result(speed)
    !> u_1', u_2', r'; direction of slip
    real(wp), intent(in) :: jet(4:6), phi

    speed = jet(4)*cos(phi) + jet(5)*sin(phi) - jet(6)
  end function speed_of

  !> Does slip end in a panel, and where? Signs are looked at at the nodes, and between them where a dip comes near to zero. The speed
  !> is the polynomial through its values at the nodes; where that vanishes the motion gives it once more.
  pure subroutine find_stop(motion, rules, panel, speed, stops, stop)
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

    if (panel%opens) then
      call find_stop_by_rule(motion, rules%gauss, panel, speed, stops, stop)
    else
      call find_stop_by_rule(motion, rules%radau, panel, speed, stops, stop)
    end if
  end subroutine find_stop

  !> The same with the nodes' rule.
  pure subroutine find_stop_by_rule(motion, rule, panel, speed, stops, stop)
    !> Motion of the contact; nodes
    type(disc_motion_type), intent(in) :: motion
    type(panel_rule_type), intent(in) :: rule
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
    real(wp) :: speeds(0:rule%nodes), place, there, largest
    integer :: i, j, s

    s = rule%nodes
    speeds(0) = speed
    speeds(1:) = panel%jet(:, 4)*panel%e(:, 1) + panel%jet(:, 5)*panel%e(:, 2) - panel%jet(:, 6)
    stops = .false.
    stop = 0.0_wp
    largest = maxval(abs(speeds))
    do i = 1, s
      if (speeds(i) < 0.0_wp) then
        stops = .true.
        if (speeds(i - 1) > 0.0_wp) stop = zero_between(rule%x(i - 1), rule%x(i), speeds(i - 1), speeds(i))
        return
      end if
      if (i == s) return
      if (speeds(i) > min(speeds(i - 1), speeds(i + 1), near*largest)) cycle
      do j = 1, looks - 1
        place = rule%x(i - 1) + (rule%x(i + 1) - rule%x(i - 1))*j/looks
        there = rule%interpolate(speeds, place)
        if (there >= 0.0_wp) cycle
        stops = .true.
        if (speeds(i - 1) > 0.0_wp) stop = zero_between(rule%x(i - 1), place, speeds(i - 1), there)
        return
      end do
    end do

  contains

    !> Where the speed vanishes between two places, by regula falsi that halves the end that stays.
    pure real(wp) function zero_between(left, right, at_left, at_right) result(x)
      !> Parts of the panel, and the speeds there, positive and negative
      real(wp), intent(in) :: left, right, at_left, at_right
      !> A speed that is none, over the largest: its square is rounding
      real(wp), parameter :: none = 1.0e-10_wp ! derived
      real(wp) :: low, high, f_low, f_high, f, rate, jet(6)
      integer :: iteration, side

      low = left
      high = right
      f_low = at_left
      f_high = at_right
      side = 0
      do iteration = 1, 100
        rate = (f_high - f_low)/(high - low)
        x = (f_low*high - f_high*low)/(f_low - f_high)
        if (.not. (x > low .and. x < high) .or. iteration > 30) x = 0.5_wp*(low + high)
        f = rule%interpolate(speeds, x)
        if (abs(f) <= none*largest .or. high - low < none) exit
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
      jet = motion%at(panel%from + panel%length*x)
      x = x - speed_of(jet(4:), rule%interpolate(panel%phi, x))/rate
      x = min(max(x, left), right)
    end function zero_between
  end subroutine find_stop_by_rule
end module attrito_contact_disc_slip
