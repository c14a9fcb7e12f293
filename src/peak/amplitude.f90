!> The amplitude of a monitor over the period, with its first and second derivatives by the monitor's coefficients c:
!>
!> $$ A = \tfrac12 (\max_\theta x - \min_\theta x), \quad \text{or of one harmonic,} \quad A = \sqrt{c_{1c}^2 + c_{1s}^2}. $$
!>
!> Half the range: with e(theta) the functions 1, cos, sin, ..., the extremum moves so that its own shift leaves no first-order term,
!>
!> $$ \partial A = \tfrac12 (e_+ - e_-), \qquad \partial^2 A = \tfrac12 \left( -e'_+ e'^T_+ / x''_+ + e'_- e'^T_- / x''_- \right). $$
module attrito_peak_amplitude
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: basis_at, extreme_angles, value_at
  implicit none
  private
  public :: amplitude_type, amplitude_of, half_range, first_harmonic

  !> Which amplitude
  integer, parameter :: half_range = 0, first_harmonic = 1

  type :: amplitude_type
    real(wp) :: value = 0.0_wp
    !> Derivatives by the coefficients [k], [k, k]
    real(wp), allocatable :: gradient(:), curvature(:, :)
  end type amplitude_type

contains

  !> Of a monitor [a_0, a_c1, a_s1, ...].
  pure function amplitude_of(coefficients, measure) result(self)
    !> Fourier coefficients
    real(wp), intent(in) :: coefficients(:)
    !> `half_range` or `first_harmonic`
    integer, intent(in) :: measure
    type(amplitude_type) :: self

    allocate (self%gradient(size(coefficients)), self%curvature(size(coefficients), size(coefficients)), source=0.0_wp)
    if (measure == first_harmonic) then
      call measure_harmonic(coefficients, self)
    else
      call measure_range(coefficients, self)
    end if
  end function amplitude_of

  pure subroutine measure_range(coefficients, self)
    !> Fourier coefficients
    real(wp), intent(in) :: coefficients(:)
    type(amplitude_type), intent(inout) :: self
    real(wp) :: angles(2), jet(3), slope(size(coefficients)), part
    integer :: i, n

    angles = extreme_angles(coefficients)
    do i = 1, 2
      part = merge(-0.5_wp, 0.5_wp, i == 1)
      jet = value_at(coefficients, angles(i))
      self%value = self%value + part*jet(1)
      self%gradient = self%gradient + part*basis_at(angles(i), size(coefficients)/2)
      if (abs(jet(3)) <= tiny(1.0_wp)) cycle
      slope = slopes_at(angles(i), size(coefficients))
      do n = 1, size(coefficients)
        self%curvature(:, n) = self%curvature(:, n) - part*slope(n)/jet(3)*slope
      end do
    end do
  end subroutine measure_range

  !> e'(theta).
  pure function slopes_at(theta, count) result(slopes)
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    integer, intent(in) :: count
    real(wp) :: slopes(count)
    real(wp) :: basis(count)
    integer :: h

    basis = basis_at(theta, count/2)
    slopes(1) = 0.0_wp
    do h = 1, count/2
      slopes(2*h) = -h*basis(2*h + 1)
      slopes(2*h + 1) = h*basis(2*h)
    end do
  end function slopes_at

  pure subroutine measure_harmonic(coefficients, self)
    !> Fourier coefficients
    real(wp), intent(in) :: coefficients(:)
    type(amplitude_type), intent(inout) :: self
    real(wp) :: direction(2)

    self%value = norm2(coefficients(2:3))
    if (self%value <= 0.0_wp) return
    direction = coefficients(2:3)/self%value
    self%gradient(2:3) = direction
    self%curvature(2:3, 2) = [1.0_wp - direction(1)**2, -direction(1)*direction(2)]/self%value
    self%curvature(2:3, 3) = [-direction(1)*direction(2), 1.0_wp - direction(2)**2]/self%value
  end subroutine measure_harmonic
end module attrito_peak_amplitude
