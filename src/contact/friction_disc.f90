!> Elastic Coulomb slider in two directions under a varying normal force: radial return to a disc.
!>
!> $$ z = u - w, \qquad |z| > r: \quad w \leftarrow u - r z/|z|, \qquad r = \mu N / k_t, \qquad T = k_t (u - w) $$
!>
!> With e = z/|z| the slipping slider moves by
!>   dw = du - e dr - (r/|z|) (I - e e^T) (du - dw_before),
!> so what it remembers of its start shrinks across the direction of slip only by r/|z|: no finite number of periods is exact, and
!> the march repeats a fixed number of them (continuous in the motion, where a march until periodic is not).
!> Source: radial return as in Wilkins 1964; DESIGN: docs/method.md.
module attrito_contact_friction_disc
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  implicit none
  private
  public :: slide_on_disc

contains

  !> March one period and carry the slider's gradient with it.
  !>
  !> `gradient` holds d w / d p for parameters p: first those of the motion, then the two of the start slider.
  subroutine slide_on_disc(u, r, du, dr, w, gradient, slider, gradients, regimes)
    !> Relative displacement [J, 2] and slip radius [J]
    real(wp), intent(in) :: u(:, :), r(:)
    !> Gradient of one tangential displacement by its own parameters, and of the radius by the normal's [k, J]
    real(wp), intent(in) :: du(:, :), dr(:, :)
    !> Slider at the start, then at the end [2]
    real(wp), intent(inout) :: w(2)
    !> Gradient of the slider [3 k + 2, 2] by (u1, u2, normal, start slider), at the start, then at the end
    real(wp), intent(inout) :: gradient(:, :)
    !> Slider after each sample [J, 2]
    real(wp), intent(out) :: slider(:, :)
    !> Its gradient [3 k + 2, 2, J]
    real(wp), intent(out) :: gradients(:, :, :)
    !> Regime at each sample [J]
    integer, intent(out) :: regimes(:)
    ! A slider that lies on the rim since the period before is outside by rounding: that is no slip.
    real(wp), parameter :: rounding = 4.0_wp*epsilon(1.0_wp)
    real(wp) :: z(2), distance
    integer :: j, k

    k = size(du, 1)
    do j = 1, size(r)
      z = u(j, :) - w
      distance = norm2(z)
      regimes(j) = regime_stick
      if (r(j) <= 0.0_wp) then
        w = u(j, :)
        gradient = 0.0_wp
        gradient(1:k, 1) = du(:, j)
        gradient(k + 1:2*k, 2) = du(:, j)
        regimes(j) = regime_open
      else if (distance > r(j) + rounding*(sum(abs(u(j, :))) + r(j))) then
        call slip(z/distance, r(j)/distance)
        w = u(j, :) - r(j)*z/distance
        regimes(j) = regime_slip
      end if
      slider(j, :) = w
      gradients(:, :, j) = gradient
    end do

  contains

    !> dw = (I - P) du + P dw_before - e dr with P = ratio (I - e e^T) = ratio a a^T, a across e
    subroutine slip(e, ratio)
      real(wp), intent(in) :: e(2), ratio
      real(wp) :: across(2), kept(size(gradient, 1))
      integer :: i

      across = [-e(2), e(1)]
      kept = ratio*(across(1)*gradient(:, 1) + across(2)*gradient(:, 2))
      kept(1:k) = kept(1:k) - ratio*across(1)*du(:, j)
      kept(k + 1:2*k) = kept(k + 1:2*k) - ratio*across(2)*du(:, j)
      do i = 1, 2
        gradient(:, i) = across(i)*kept
        gradient((i - 1)*k + 1:i*k, i) = gradient((i - 1)*k + 1:i*k, i) + du(:, j)
        gradient(2*k + 1:3*k, i) = gradient(2*k + 1:3*k, i) - e(i)*dr(:, j)
      end do
    end subroutine slip
  end subroutine slide_on_disc
end module attrito_contact_friction_disc
