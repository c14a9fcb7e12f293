!> Elastic Coulomb slider (Jenkins element) in one direction under a varying normal force.
!>
!> $$ T = k_t (u - w), \qquad |T| \le \mu N(t), \qquad T = 0 \text{ while } N = 0 $$
!>
!> One step clamps the slider: w <- min(max(w, u - r), u + r), r = mu N / k_t; lift-off is r = 0. Clamps compose to a clamp, so a
!> period maps w to min(max(w, low), high): one period reaches the steady loop, and low = high where the loop forgets its start.
!> The slider of a sample is where its last clamp put it, w_j = u_k + side_k r_k: its derivative needs only (k, side).
!> Source: Zucca & Firrone 2014, eqs. (4)-(8), doi:10.1016/j.jsv.2013.09.032.
module attrito_contact_friction_line
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  implicit none
  private
  public :: slide_along_line, slider_interval

contains

  !> March one period. `origin` says which sample put the slider where it is (0: the start did).
  subroutine slide_along_line(u, r, w, origin, side, slider, origins, sides, regimes)
    !> Relative displacement and slip radius mu N / k_t at the samples [J]
    real(wp), intent(in) :: u(:), r(:)
    !> Slider at the start, then at the end
    real(wp), intent(inout) :: w
    !> Sample and side that put it there, at the start, then at the end
    integer, intent(inout) :: origin, side
    !> Slider after each sample [J]
    real(wp), intent(out) :: slider(:)
    !> Sample and side of the last clamp, and regime, at each sample [J]
    integer, intent(out) :: origins(:), sides(:), regimes(:)
    integer :: j

    do j = 1, size(u)
      regimes(j) = regime_stick
      if (r(j) <= 0.0_wp) then
        call clamp_to(u(j), 0, regime_open)
      else if (w > u(j) + r(j)) then
        call clamp_to(u(j) + r(j), 1, regime_slip)
      else if (w < u(j) - r(j)) then
        call clamp_to(u(j) - r(j), -1, regime_slip)
      end if
      slider(j) = w
      origins(j) = origin
      sides(j) = side
    end do

  contains

    subroutine clamp_to(place, on_side, regime)
      real(wp), intent(in) :: place
      integer, intent(in) :: on_side, regime

      w = place
      origin = j
      side = on_side
      regimes(j) = regime
    end subroutine clamp_to
  end subroutine slide_along_line

  !> The clamp [low, high] that one period applies to the slider at its start.
  pure subroutine slider_interval(u, r, low, high)
    !> Relative displacement and slip radius at the samples [J]
    real(wp), intent(in) :: u(:), r(:)
    real(wp), intent(out) :: low, high
    integer :: j

    low = -huge(low)
    high = huge(high)
    do j = 1, size(u)
      low = min(max(low, u(j) - r(j)), u(j) + r(j))
      high = min(max(high, u(j) - r(j)), u(j) + r(j))
    end do
  end subroutine slider_interval
end module attrito_contact_friction_line
