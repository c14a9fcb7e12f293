!> Where a slider with two tangents comes to rest: the point nearest to where it was in the discs of all instants of the period,
!>
!> $$ w = \mathrm{proj}_C (w_0), \qquad C = \bigcap_\theta \{ w : |u(\theta) - w| \le r(\theta) \} $$
!>
!> Discs are taken in one at a time, each at the instant at which the point so far lies farthest out of its disc, a maximum of
!> |u - w| - r that is found on the grid and refined. At most two hold the answer (`attrito_contact_slider_projection`).
!>
!> Two discs hold it by e_i.(dw - du_i) = -dr_i, their instants being stationary. If one holds it, w_0 moved by l along e, its
!> instant moves with the motion too, and so does w across e. With p = u'.e_perp, and s = u''.e + p^2/r - r'' < 0 of |u - w| - r,
!>
!> $$ e \cdot dw = e \cdot du - dr, \qquad
!>    e_\perp \cdot dw = \frac{l}{r} \, \frac{\kappa \, e_\perp \cdot du - (p/s)(e \cdot du' - dr')}{1 + \kappa l/r}, \qquad
!>    \kappa = 1 - \frac{p^2}{r s} $$
module attrito_contact_resting_place
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_slider_projection, only: slider_projection_type, project_slider
  implicit none
  private
  public :: resting_place_type, find_resting_place, resting_gradient, parallel

  type :: resting_place_type
    !> Is there any?
    logical :: exists = .false.
    !> The point, and where the slider was
    real(wp) :: slider(2) = 0.0_wp, before(2) = 0.0_wp
    !> How many instants hold it there (0: it stays), and these
    integer :: count = 0
    real(wp) :: instants(2) = 0.0_wp
  end type resting_place_type

  !> Discs that are taken in at most
  integer, parameter :: most_discs = 64 ! guess
  !> Distance from a kink of the radius that is none
  real(wp), parameter :: near = 1.0e-7_wp ! derived
  !> Sine of the angle between two discs' normals below which one of them holds it alone
  real(wp), parameter :: parallel = 1.0e-6_wp ! derived

contains

  !> The nearest point to a slider that the discs of a closed contact hold.
  function find_resting_place(motion, slider) result(place)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where it was
    real(wp), intent(in) :: slider(2)
    type(resting_place_type) :: place
    type(slider_projection_type) :: nearest
    real(wp) :: instants(most_discs), u(most_discs, 2), r(most_discs), jet(6), beyond
    integer :: i, n

    place%before = slider
    place%slider = slider
    do n = 1, most_discs
      call most_violated(motion, place%slider, instants(n), beyond)
      place%exists = beyond <= motion%rounding
      if (place%exists .and. place%count == 1) call settle(motion, place)
      if (place%exists .and. place%count == 2) call settle_instants(motion, place)
      if (place%exists) return
      jet = motion%at(instants(n))
      u(n, :) = jet(1:2)
      r(n) = jet(3)
      nearest = project_slider(u(:n, :), r(:n), slider)
      if (.not. nearest%exists) then
        ! Discs that all but meet hold it: it would not slip there.
        place%exists = beyond <= motion%negligible .and. place%count > 0
        return
      end if
      place%slider = nearest%slider
      place%count = nearest%count
      place%instants = [(instants(max(nearest%holds(i), 1)), i=1, 2)]
    end do
  end function find_resting_place

  !> The instant at which a slider lies farthest out of its disc, and by how much.
  subroutine most_violated(motion, w, instant, beyond)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Slider
    real(wp), intent(in) :: w(2)
    !> Angle of the period
    real(wp), intent(out) :: instant
    !> |u - w| - r there
    real(wp), intent(out) :: beyond
    real(wp) :: out_of(0:size(motion%sampled, 1)), trial, value
    integer :: j, points

    points = size(motion%sampled, 1) - 1
    associate (s => motion%sampled)
      out_of(1:points) = sqrt((s(:points, 1) - w(1))**2 + (s(:points, 2) - w(2))**2) - motion%radii(:points)
    end associate
    out_of(0) = out_of(points)
    out_of(points + 1) = out_of(1)
    j = maxloc(out_of(1:points), 1)
    instant = (j - 1)*motion%step
    beyond = out_of(j)
    do j = 1, points
      if (out_of(j) < max(out_of(j - 1), out_of(j + 1))) cycle
      ! A maximum lies above the largest of the grid by less than it does above the lower of its neighbours.
      if (2.0_wp*out_of(j) - min(out_of(j - 1), out_of(j + 1)) < beyond) cycle
      call refine(motion, w, (j - 2)*motion%step, j*motion%step, trial, value)
      if (value <= beyond) cycle
      instant = trial
      beyond = value
    end do
  end subroutine most_violated

  !> One disc that holds the place lies farthest out for the slider before it moved, too, as the move is along e: its instant is then
  !> known better than the place shows, which hardly feels it.
  subroutine settle(motion, place)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where it rests
    type(resting_place_type), intent(inout) :: place
    real(wp) :: jet(6), instant, beyond

    call refine(motion, place%before, place%instants(1) - motion%step, place%instants(1) + motion%step, instant, beyond)
    jet = motion%at(instant)
    associate (z => jet(1:2) - place%before)
      if (.not. norm2(z - (1.0_wp - jet(3)/norm2(z))*z - (jet(1:2) - place%slider)) < 1.0e-5_wp*motion%largest) return
      place%instants(1) = instant
      place%slider = jet(1:2) - (jet(3)/norm2(z))*z
    end associate
  end subroutine settle

  !> Two discs that hold the place lie farthest out for it: by as little as they do it hardly shows when.
  subroutine settle_instants(motion, place)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where it rests
    type(resting_place_type), intent(inout) :: place
    real(wp) :: instant, beyond
    integer :: i

    do i = 1, 2
      call refine(motion, place%slider, place%instants(i) - motion%step, place%instants(i) + motion%step, instant, beyond)
      if (abs(beyond) <= motion%negligible) place%instants(i) = instant
    end do
  end subroutine settle_instants

  !> The maximum between two instants on either side of it, by regula falsi for its slope that halves the end that stays.
  subroutine refine(motion, w, from, to, instant, value)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Slider; angles of the period
    real(wp), intent(in) :: w(2), from, to
    !> Where it is, and what it is
    real(wp), intent(out) :: instant, value
    !> Length in which it counts as found: its square is rounding
    real(wp), parameter :: found_in = 1.0e-9_wp ! derived
    real(wp) :: low, high, f_low, f_high, f, before
    integer :: iteration, side

    low = from
    high = to
    call slope_at(motion, w, low, f_low, value)
    call slope_at(motion, w, high, f_high, value)
    instant = 0.5_wp*(low + high)
    side = 0
    do iteration = 1, 60
      before = instant
      instant = low
      if (f_low > f_high) instant = (f_low*high - f_high*low)/(f_low - f_high)
      if (.not. (instant > low .and. instant < high) .or. iteration > 25) instant = 0.5_wp*(low + high)
      call slope_at(motion, w, instant, f, value)
      if (abs(instant - before) < found_in .or. high - low < found_in) exit
      if (f > 0.0_wp) then
        low = instant
        f_low = f
        if (side == 1) f_high = 0.5_wp*f_high
        side = 1
      else
        high = instant
        f_high = f
        if (side == -1) f_low = 0.5_wp*f_low
        side = -1
      end if
    end do
    ! A maximum at a kink is no less than what is found next to it.
    do iteration = 1, size(motion%kinks)
      before = instant + distance_to(motion%kinks(iteration), instant)
      if (abs(before - instant) > near) cycle
      call slope_at(motion, w, before, f, f_low)
      if (f_low < value) cycle
      instant = before
      value = f_low
    end do
  end subroutine refine

  !> From an instant to another one of the period, the shorter way.
  elemental real(wp) function distance_to(other, instant) result(distance)
    !> Angles of the period
    real(wp), intent(in) :: other, instant

    distance = modulo(other - instant + pi, two_pi) - pi
  end function distance_to

  !> |u - w| - r and its slope.
  subroutine slope_at(motion, w, theta, slope, value)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Slider; angle of the period
    real(wp), intent(in) :: w(2), theta
    !> Slope, and value
    real(wp), intent(out) :: slope, value
    real(wp) :: jet(6), distance

    jet = motion%at(theta)
    distance = norm2(jet(1:2) - w)
    value = distance - jet(3)
    slope = dot_product(jet(1:2) - w, jet(4:5))/max(distance, tiny(1.0_wp)) - jet(6)
  end subroutine slope_at

  !> Derivative of the place by the coefficients of (u_1, u_2, v) [3 k, 2].
  function resting_gradient(motion, place) result(gradient)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where it rests
    type(resting_place_type), intent(in) :: place
    real(wp) :: gradient(3*size(motion%series, 2), 2)
    real(wp) :: basis(size(motion%series, 2), 2), jet(6, 2), e(2, 2), row(3*size(motion%series, 2), 2), determinant
    !> dr/dv and its derivative by the angle; of an instant at which r' jumps its derivative by v there
    real(wp) :: slope(2), turning(2), by_instant(2), by_v(2)
    logical :: at_kink(2)
    integer :: i, k

    k = size(motion%series, 2)
    gradient = 0.0_wp
    if (place%count == 0) return
    do i = 1, place%count
      jet(:, i) = motion%at(place%instants(i))
      basis(:, i) = motion%basis_at(place%instants(i))
      e(:, i) = jet(1:2, i) - place%slider
      e(:, i) = e(:, i)/norm2(e(:, i))
      call find_kink(motion, place%instants(i), jet(:, i), e(:, i), at_kink(i), by_instant(i))
      by_v = motion%slope_at(place%instants(i))
      slope(i) = by_v(1)
      turning(i) = by_v(2)
      if (at_kink(i)) slope(i) = -dot_product(jet(4:5, i), e(:, i))*by_instant(i)
      row(:, i) = [e(1, i)*basis(:, i), e(2, i)*basis(:, i), -slope(i)*basis(:, i)]
    end do
    determinant = 0.0_wp
    if (place%count == 2) determinant = e(1, 1)*e(2, 2) - e(2, 1)*e(1, 2)
    if (abs(determinant) > parallel) then
      gradient(:, 1) = (e(2, 2)*row(:, 1) - e(2, 1)*row(:, 2))/determinant
      gradient(:, 2) = (e(1, 1)*row(:, 2) - e(1, 2)*row(:, 1))/determinant
    else
      call follow_one(place%count)
    end if

  contains

    !> One disc holds it alone.
    subroutine follow_one(i)
      !> Which of them
      integer, intent(in) :: i
      !> Curvature over the size of its terms that is rounding: the instant does not move then
      real(wp), parameter :: flat = 1.0e-12_wp ! derived
      real(wp) :: second(3), aside(2), across(3*k), p, s, kappa, shift, part
      integer :: h

      second = motion%second_at(place%instants(i))
      aside = [-e(2, i), e(1, i)]
      part = norm2(place%slider - place%before)/jet(3, i)
      p = dot_product(jet(4:5, i), aside)
      s = dot_product(second(1:2), e(:, i)) + p**2/jet(3, i) - second(3)
      kappa = 1.0_wp
      shift = 0.0_wp
      if (s < -flat*(norm2(second) + p**2/jet(3, i)) .and. .not. at_kink(i)) then
        kappa = 1.0_wp - p**2/(jet(3, i)*s)
        shift = p/s
      end if
      across = 0.0_wp
      across(2*k + 1:) = turning(i)*shift*basis(:, i)
      across(:2*k) = [aside(1)*basis(:, i), aside(2)*basis(:, i)]*kappa
      do h = 1, motion%harmonics
        associate (rates => [e(1, i), e(2, i), -slope(i)]*h*shift)
          across(2*h::k) = across(2*h::k) + rates*basis(2*h + 1, i)
          across(2*h + 1::k) = across(2*h + 1::k) - rates*basis(2*h, i)
        end associate
      end do
      if (at_kink(i)) across(2*k + 1:) = p*by_instant(i)*basis(:, i)
      across = across*(part/(1.0_wp + kappa*part))
      gradient(:, 1) = e(1, i)*row(:, i) + aside(1)*across
      gradient(:, 2) = e(2, i)*row(:, i) + aside(2)*across
    end subroutine follow_one
  end function resting_gradient

  !> Does r' jump at an instant that holds a slider, so that this is held where N is, d theta = -dv/v'?
  pure subroutine find_kink(motion, instant, jet, e, at_kink, by_v)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Angle of the period
    real(wp), intent(in) :: instant
    !> u_1, u_2, r and their derivatives there; direction from the slider to the centre
    real(wp), intent(in) :: jet(6), e(2)
    !> Does it? Derivative of the instant by v
    logical, intent(out) :: at_kink
    real(wp), intent(out) :: by_v
    !> Slope of |u - w| - r at a maximum that is found, over the size of its terms
    real(wp), parameter :: flat = 1.0e-5_wp ! derived
    real(wp) :: pressing(2)

    by_v = 0.0_wp
    at_kink = any(abs(distance_to(motion%kinks, instant)) < near)
    if (at_kink) at_kink = abs(dot_product(jet(4:5), e) - jet(6)) > flat*(norm2(jet(4:5)) + abs(jet(6)))
    if (.not. at_kink) return
    pressing = motion%pressing_at(instant)
    by_v = -motion%pressing/pressing(2)
  end subroutine find_kink
end module attrito_contact_resting_place
