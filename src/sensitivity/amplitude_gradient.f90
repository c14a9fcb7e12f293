!> Gradient of half the range of a periodic series by its coefficients,
!>
!> $$ a = \tfrac{1}{2} (x(\theta_2) - x(\theta_1)), \qquad
!>    \frac{\partial a}{\partial x_m} = \tfrac{1}{2} (e_m(\theta_2) - e_m(\theta_1)), $$
!>
!> theta_1, theta_2 being where the series is least and greatest: that these move changes nothing to first order.
module attrito_sensitivity_amplitude_gradient
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: basis_at, extreme_angles
  implicit none
  private
  public :: amplitude_gradient

contains

  !> [2 H + 1]; zero of a constant series.
  pure function amplitude_gradient(series) result(gradient)
    !> Coefficients [2 H + 1]
    real(wp), intent(in) :: series(:)
    real(wp) :: gradient(size(series)), angles(2)
    integer :: harmonics

    gradient = 0.0_wp
    if (.not. maxval([0.0_wp, abs(series(2:))]) > 0.0_wp) return
    harmonics = size(series)/2
    angles = extreme_angles(series)
    gradient = 0.5_wp*(basis_at(angles(2), harmonics) - basis_at(angles(1), harmonics))
  end function amplitude_gradient
end module attrito_sensitivity_amplitude_gradient
