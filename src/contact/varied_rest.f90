!> How the place where a slider comes to rest changes to second order along two directions of the motion: at most two instants hold it
!> there (`attrito_contact_resting_place`), each the one at which it lies farthest out of its disc,
!>
!> $$ |u(\theta_i) - w| = r(\theta_i), \qquad \frac{d}{d\theta} \left( |u - w| - r \right) (\theta_i) = 0 $$
!>
!> of one alone w = u - r (u - w_0)/|u - w_0|, w_0 the slider before it moved, which lies farthest out then, too.
module attrito_contact_varied_rest
  use attrito_core_hyperdual, only: hyperdual_type, function_of, angle_of, cosine_of, sine_of, &
                                    operator(+), operator(-), operator(*)
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_resting_place, only: resting_place_type, parallel
  use attrito_contact_varied_motion, only: varied_motion_type
  implicit none
  private
  public :: vary_rest

  !> Steps of Newton's method: two for what the place is known to less than instants that hold it should be, which its distance from
  !> their discs hardly shows; then first derivatives, and the second
  integer, parameter :: steps = 4
  !> Curvature over the size of its terms that is rounding: an instant does not move then
  real(wp), parameter :: flat = 1.0e-12_wp ! derived

contains

  !> The place, as it moves.
  function vary_rest(varied, motion, place) result(slider)
    !> Motion of the contact, with its changes and without
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    !> Where it rests
    type(resting_place_type), intent(in) :: place
    type(hyperdual_type) :: slider(2)
    real(wp) :: jet(6), e(2, 2), determinant
    integer :: i

    slider%value = place%slider
    if (place%count == 0) return
    do i = 1, place%count
      jet = motion%at(place%instants(i))
      e(:, i) = (jet(1:2) - place%slider)/norm2(jet(1:2) - place%slider)
    end do
    determinant = 0.0_wp
    if (place%count == 2) determinant = e(1, 1)*e(2, 2) - e(2, 1)*e(1, 2)
    if (abs(determinant) > parallel) then
      call follow_two(varied, motion, place, e, slider)
    else
      call follow_one(varied, motion, place%before, place%instants(place%count), slider)
    end if
  end function vary_rest

  !> Two discs hold it: by w first, which feels no change of the instants at first order, then by these.
  subroutine follow_two(varied, motion, place, e, slider)
    !> Motion of the contact, with its changes and without
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    !> Where it rests
    type(resting_place_type), intent(in) :: place
    !> Directions from there to the centres
    real(wp), intent(in) :: e(2, 2)
    !> The place
    type(hyperdual_type), intent(inout) :: slider(2)
    type(hyperdual_type) :: theta(2), jet(6, 2), z(2), step(2)
    real(wp) :: inverse(2, 2), second(3), rate
    integer :: i, round

    inverse = reshape([e(2, 2), -e(1, 2), -e(2, 1), e(1, 1)], [2, 2])/(e(1, 1)*e(2, 2) - e(2, 1)*e(1, 2))
    theta%value = place%instants
    do round = 1, steps
      do i = 1, 2
        jet(:, i) = varied%at(theta(i))
        z = jet(1:2, i) - slider
        step(i) = (0.5_wp/jet(3, i)%value)*(z(1)*z(1) + z(2)*z(2) - jet(3, i)*jet(3, i))
      end do
      do i = 1, 2
        slider(i) = slider(i) + inverse(i, 1)*step(1) + inverse(i, 2)*step(2)
      end do
      do i = 1, 2
        z = jet(1:2, i) - slider
        second = motion%second_at(theta(i)%value)
        rate = rate_of(jet(:, i)%value, second, z%value, jet(3, i)%value)
        if (rate < 0.0_wp) theta(i) = theta(i) + (-1.0_wp/rate)*(z(1)*jet(4, i) + z(2)*jet(5, i) - jet(3, i)*jet(6, i))
      end do
    end do
  end subroutine follow_two

  !> One disc holds it.
  subroutine follow_one(varied, motion, before, instant, slider)
    !> Motion of the contact, with its changes and without
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    !> Where the slider was; the instant that holds it
    real(wp), intent(in) :: before(2), instant
    !> The place
    type(hyperdual_type), intent(inout) :: slider(2)
    type(hyperdual_type) :: theta, jet(6), z(2), square, distance, phi
    real(wp) :: second(3), rate
    integer :: round

    theta%value = instant
    do round = 0, steps
      jet = varied%at(theta)
      z = jet(1:2)
      z%value = z%value - before
      square = z(1)*z(1) + z(2)*z(2)
      associate (root => sqrt(square%value))
        distance = function_of(square, root, 0.5_wp/root, -0.25_wp/root**3)
      end associate
      if (round == steps) exit
      second = motion%second_at(theta%value)
      rate = rate_of(jet%value, second, z%value, distance%value)
      if (rate < 0.0_wp) theta = theta + (-1.0_wp/rate)*(z(1)*jet(4) + z(2)*jet(5) - jet(6)*distance)
    end do
    phi = angle_of(z(1), z(2))
    slider = jet(1:2) - jet(3)*[cosine_of(phi), sine_of(phi)]
  end subroutine follow_one

  !> Of z.u' - r' |z| along the motion; zero where that is rounding.
  pure real(wp) function rate_of(jet, second, z, distance) result(rate)
    !> u_1, u_2, r and their first derivatives, and second ones; u - w and its length
    real(wp), intent(in) :: jet(6), second(3), z(2), distance
    real(wp) :: terms(4)

    terms = [dot_product(jet(4:5), jet(4:5)), dot_product(z, second(1:2)), -second(3)*distance, &
             -jet(6)*dot_product(z, jet(4:5))/distance]
    rate = sum(terms)
    if (abs(rate) <= flat*sum(abs(terms))) rate = 0.0_wp
  end function rate_of
end module attrito_contact_varied_rest
