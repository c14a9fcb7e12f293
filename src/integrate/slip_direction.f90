!> The direction of slip along two tangents, e = (cos phi, sin phi), as a Taylor series in time, coefficient by coefficient:
!>
!> $$ r \phi' = u' \cdot e_\perp, \qquad e' = \phi' e_\perp, \qquad e_\perp = (-\sin \phi, \cos \phi) $$
!>
!> Its equation of order k - 1 gives phi_k, for the last of its terms is k r_0 phi_k. If the contact lands, r_0 = 0, and e begins
!> along u': the equation of order k gives phi_k, since e_perp depends on it: (k r_1 + u_1.e_0) phi_k = ... So it does, with r = 0,
!> for a disc so small that the slider follows u' at once: just before a contact opens, or with next to no friction.
module attrito_integrate_slip_direction
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: has_just_landed, follows_at_once, extend_direction

  !> Time over which a direction turns to u', r/|u'|, that counts as none, in units of the clock; and what that may change of the
  !> slider, as a part of |u'|: friction jumps by it, and so does the linearised flow
  real(wp), parameter :: at_once = 1.0e-4_wp, no_jump = 1.0e-8_wp ! derived
  !> Time since N = 0, or until then, that counts as none
  real(wp), parameter :: no_time = 1.0e-11_wp ! derived

contains

  !> Does the contact land here, as far as can be known?
  pure logical function has_just_landed(radius, growth, rate)
    !> r, r', u'
    real(wp), intent(in) :: radius, growth, rate(2)

    has_just_landed = growth > 0.0_wp .and. radius <= no_time*(growth + norm2(rate))
  end function has_just_landed

  !> Does the slider follow along u' at once, now and for some time?
  pure logical function follows_at_once(radius, growth, rate, angle)
    !> r, r', u', phi
    real(wp), intent(in) :: radius, growth, rate(2), angle
    real(wp) :: aside

    aside = radius*abs(rate(2)*cos(angle) - rate(1)*sin(angle))
    follows_at_once = (max(radius, growth) < at_once*norm2(rate) .and. aside <= no_jump*dot_product(rate, rate)) &
                      .or. radius < -no_time*growth
  end function follows_at_once

  !> Coefficient k of the direction; those before are known, the first is given as an angle.
  pure subroutine extend_direction(k, lands, u, radius, angle, direction)
    !> Order
    integer, intent(in) :: k
    !> Does the series begin along u', with r = 0?
    logical, intent(in) :: lands
    !> Coefficients of u [0:k + 1, 2] and r [0:k]
    real(wp), intent(in) :: u(0:, :), radius(0:)
    !> Coefficients of phi and e, up to k [0:n], [0:n, 2]
    real(wp), intent(inout) :: angle(0:), direction(0:, :)
    real(wp) :: right, rest(2), pivot
    integer :: order, j, l

    if (k == 0) then
      direction(0, :) = [cos(angle(0)), sin(angle(0))]
      return
    end if
    ! e_k without phi_k.
    rest = 0.0_wp
    do j = 0, k - 2
      l = k - 1 - j
      rest = rest + (j + 1)*angle(j + 1)*[-direction(l, 2), direction(l, 1)]
    end do
    direction(k, :) = rest/k
    order = merge(k, k - 1, lands)
    right = 0.0_wp
    do j = 0, order
      l = order - j
      right = right + (j + 1)*(u(j + 1, 2)*direction(l, 1) - u(j + 1, 1)*direction(l, 2))
    end do
    do j = 0, k - 2
      right = right - radius(order - j)*(j + 1)*angle(j + 1)
    end do
    if (lands) then
      pivot = k*radius(1) + u(1, 1)*direction(0, 1) + u(1, 2)*direction(0, 2)
    else
      pivot = k*radius(0)
    end if
    angle(k) = 0.0_wp
    if (pivot > 0.0_wp) angle(k) = right/pivot
    direction(k, :) = direction(k, :) + angle(k)*[-direction(0, 2), direction(0, 1)]
  end subroutine extend_direction
end module attrito_integrate_slip_direction
