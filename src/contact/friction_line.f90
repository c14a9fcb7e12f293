!> Elastic Coulomb slider (Jenkins element) in one direction under a varying normal force.
!>
!> $$ T = k_t (u - w), \qquad |T| \le \mu N(t), \qquad T = 0 \text{ while } N = 0 $$
!>
!> One step clamps the slider: w <- min(max(w, u - r), u + r), r = mu N / k_t. Lift-off is r = 0, and so is the instant of landing
!> between two samples, with u and N linear in between: exact for the polygon through the samples. Clamps compose to a clamp, so
!> a period maps w to min(max(w, low), high): one period reaches the steady loop, and low = high where the loop forgets its start.
!> The slider of a sample is where its last clamp put it, w_j = u_k + side_k r_k, or where it landed: its derivative needs only
!> (k, side).
!> Source: Zucca & Firrone 2014, eqs. (4)-(8), doi:10.1016/j.jsv.2013.09.032.
module attrito_contact_friction_line
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  implicit none
  private
  public :: slide_along_line, slider_interval, side_landed

  !> Put there by landing between the sample before and this one
  integer, parameter :: side_landed = 2

contains

  !> March one period. `origin` says which sample put the slider where it is (0: the start did).
  subroutine slide_along_line(u, r, w, origin, side, slider, origins, sides, regimes)
    !> Relative displacement and slip radius mu N / k_t at the samples, where open less than zero by what is missing [J]
    real(wp), intent(in) :: u(:), r(:)
    !> Slider at the start, then at the end
    real(wp), intent(inout) :: w
    !> Sample and side that put it there, at the start, then at the end
    integer, intent(inout) :: origin, side
    !> Slider after each sample [J]
    real(wp), intent(out) :: slider(:)
    !> Sample and side of the last clamp, and regime, at each sample [J]
    integer, intent(out) :: origins(:), sides(:), regimes(:)
    integer :: before, j

    before = size(u)
    do j = 1, size(u)
      regimes(j) = regime_stick
      if (r(j) <= 0.0_wp) then
        call clamp_to(u(j), 0, regime_open)
      else
        if (r(before) <= 0.0_wp) call clamp_to(landing(u(before), u(j), r(before), r(j)), side_landed, regime_stick)
        if (w > u(j) + r(j)) then
          call clamp_to(u(j) + r(j), 1, regime_slip)
        else if (w < u(j) - r(j)) then
          call clamp_to(u(j) - r(j), -1, regime_slip)
        end if
      end if
      slider(j) = w
      origins(j) = origin
      sides(j) = side
      before = j
    end do

  contains

    subroutine clamp_to(position, on_side, regime)
      !> End of the clamp
      real(wp), intent(in) :: position
      !> Which end of the clamp it is; regime: stick, slip or open
      integer, intent(in) :: on_side, regime

      w = position
      origin = j
      side = on_side
      regimes(j) = regime
    end subroutine clamp_to
  end subroutine slide_along_line

  !> The clamp [low, high] that one period applies to the slider at its start.
  pure subroutine slider_interval(u, r, low, high)
    !> Relative displacement and slip radius at the samples, where open less than zero by what is missing [J]
    real(wp), intent(in) :: u(:), r(:)
    !> Lower end; upper end
    real(wp), intent(out) :: low, high
    real(wp) :: position, radius
    integer :: before, j

    low = -huge(low)
    high = huge(high)
    before = size(u)
    do j = 1, size(u)
      if (r(before) <= 0.0_wp .and. r(j) > 0.0_wp) then
        position = landing(u(before), u(j), r(before), r(j))
        low = position
        high = position
      end if
      radius = max(r(j), 0.0_wp)
      low = min(max(low, u(j) - radius), u(j) + radius)
      high = min(max(high, u(j) - radius), u(j) + radius)
      before = j
    end do
  end subroutine slider_interval

  !> Displacement where the radius, linear between r_a <= 0 and r_b > 0, is zero.
  pure real(wp) function landing(u_a, u_b, r_a, r_b)
    real(wp), intent(in) :: u_a, u_b, r_a, r_b

    landing = u_a - (r_a/(r_b - r_a))*(u_b - u_a)
  end function landing
end module attrito_contact_friction_line
