!> How large motion is between two frequencies: residuals and steps along branches are relative to that.
!>
!> $$ \max_\omega \Big( \sum_{h \ge 1} |B X_h(\omega)|^2 \Big)^{1/2}, \qquad \omega = \omega_a, \omega_b, \omega_r, $$
!>
!> X being the response with every contact stuck, omega_a and omega_b the ends, and omega_r the resonance between them at which the
!> response of the modes is largest; only there are rows of B recovered.
module attrito_solve_scales
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_stuck_response, only: linear_motion, recover_loaded
  implicit none
  private
  public :: find_scales

  !> Damping ratio
  real(wp), parameter :: least_ratio = 1.0e-4_wp ! guess

contains

  !> Norms of the harmonics and of the mean of the contacts' motion between two angular frequencies.
  subroutine find_scales(balance, resonances, low, high, scale, mean)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Angular frequencies of the stuck system
    real(wp), intent(in) :: resonances(:)
    !> Lower end; upper end
    real(wp), intent(in) :: low, high
    !> Of the harmonics, or with no excitation of the mean; with no load at all anything does, and it stays as it is
    real(wp), intent(inout) :: scale
    !> Mean over the period
    real(wp), intent(out) :: mean
    real(wp), allocatable :: looked_at(:), motion(:, :)
    real(wp) :: largest
    logical :: known
    integer :: i, status

    looked_at = off_resonance([low, pack(resonances, resonances > low .and. resonances < high), high], resonances)
    looked_at = [looked_at(1), looked_at(size(looked_at)), frequency_of_largest(balance, looked_at)]
    largest = 0.0_wp
    mean = 0.0_wp
    known = .false.
    do i = 1, size(looked_at)
      call balance%receptance%set_frequency(looked_at(i), status, balance%highest_load())
      if (status /= 0) cycle
      largest = max(largest, balance%norm(recover_loaded(balance, balance%linear_response())))
      ! The same at all frequencies.
      if (known) cycle
      motion = linear_motion(balance)
      mean = balance%norm(motion(1:1, :))
      known = .true.
    end do
    if (largest <= 0.0_wp) largest = mean
    if (largest > 0.0_wp) scale = largest
  end subroutine find_scales

  !> A stuck structure may be undamped: frequencies kept off its resonances by what a small damping ratio would.
  pure function off_resonance(omega, resonances) result(moved)
    !> Angular frequency, rad/s; angular frequencies of the stuck modes
    real(wp), intent(in) :: omega(:), resonances(:)
    real(wp) :: moved(size(omega))
    integer :: i

    moved = omega
    do i = 1, size(omega)
      associate (nearest => resonances(minloc(abs(resonances - omega(i)), 1)))
        if (abs(omega(i) - nearest) < least_ratio*nearest) moved(i) = (1.0_wp - least_ratio)*nearest
      end associate
    end do
  end function off_resonance

  !> Which of some frequencies has the largest response of the modes.
  real(wp) function frequency_of_largest(balance, omega) result(largest)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega(:)
    complex(wp), allocatable :: response(:, :)
    real(wp) :: square, highest
    integer :: i, status

    highest = 0.0_wp
    largest = omega(1)
    do i = 1, size(omega)
      call balance%receptance%set_frequency(omega(i), status, balance%highest_load())
      if (status /= 0) cycle
      response = balance%linear_response()
      square = sum(real(response(:, 2:), wp)**2 + aimag(response(:, 2:))**2)
      if (square < highest) cycle
      highest = square
      largest = omega(i)
    end do
  end function frequency_of_largest
end module attrito_solve_scales
