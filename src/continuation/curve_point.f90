!> A point of the drawn curve: the frequency and the monitors' amplitudes, and how they change along the branch,
!>
!> $$ A = \tfrac12 (x(\theta_+) - x(\theta_-)), \qquad A' = \tfrac12 (x'(\theta_+) - x'(\theta_-)), $$
!>
!> x being a monitor, x' its change along the branch, and theta_+- the instants of its extremes, whose own shift changes nothing.
module attrito_continuation_curve_point
  use attrito_core_kinds, only: wp, pi
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: extreme_angles, value_at
  implicit none
  private
  public :: curve_point_type, new_curve_point

  type :: curve_point_type
    !> Angular frequency, and its change along the branch
    real(wp) :: omega = 0.0_wp, omega_rate = 0.0_wp
    !> Of the monitors; not allocated: not known
    real(wp), allocatable :: amplitude(:), amplitude_rate(:)
  contains
    procedure :: is_known
    procedure :: keep
  end type curve_point_type

contains

  !> Of monitors by their Fourier coefficients.
  pure function new_curve_point(omega, monitors, omega_rate, monitors_rate) result(self)
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Coefficients [2 H + 1, monitors]
    real(wp), intent(in) :: monitors(:, :)
    !> Change of the angular frequency and of the coefficients along the branch
    real(wp), intent(in), optional :: omega_rate, monitors_rate(:, :)
    type(curve_point_type) :: self
    real(wp) :: angles(2)
    integer :: m

    self%omega = omega
    allocate (self%amplitude(size(monitors, 2)), self%amplitude_rate(size(monitors, 2)), source=0.0_wp)
    if (present(omega_rate)) self%omega_rate = omega_rate
    do m = 1, size(monitors, 2)
      angles = angles_of(monitors(:, m))
      self%amplitude(m) = half_difference(monitors(:, m), angles)
      if (present(monitors_rate)) self%amplitude_rate(m) = half_difference(monitors_rate(:, m), angles)
    end do
  end function new_curve_point

  !> Angles of the least and the largest value; in closed form where only the first harmonic is there.
  pure function angles_of(coefficients) result(angles)
    !> [a_0, a_c1, a_s1, ...]
    real(wp), intent(in) :: coefficients(:)
    real(wp) :: angles(2)
    integer :: last

    last = findloc(abs(coefficients) > 0.0_wp, .true., 1, back=.true.)
    if (last <= 1) then
      angles = 0.0_wp
    else if (last <= 3) then
      angles(2) = atan2(coefficients(3), coefficients(2))
      angles(1) = angles(2) + pi
    else
      angles = extreme_angles(coefficients(:last + modulo(last + 1, 2)))
    end if
  end function angles_of

  !> Half of what a series changes by between two angles.
  pure real(wp) function half_difference(coefficients, angles)
    !> [a_0, a_c1, a_s1, ...]
    real(wp), intent(in) :: coefficients(:)
    !> Angles
    real(wp), intent(in) :: angles(2)
    real(wp) :: low(3), high(3)

    low = value_at(coefficients, angles(1))
    high = value_at(coefficients, angles(2))
    half_difference = 0.5_wp*(high(1) - low(1))
  end function half_difference

  !> Is there a point?
  pure logical function is_known(self)
    class(curve_point_type), intent(in) :: self

    is_known = allocated(self%amplitude)
  end function is_known

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(curve_point_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%omega)
    call store%keep(self%omega_rate)
    call store%keep(self%amplitude)
    call store%keep(self%amplitude_rate)
  end subroutine keep
end module attrito_continuation_curve_point
