!> The change of an amplitude from one motion to another, relative to the latter,
!>
!> $$ e = \max_m \frac{\max(|\tilde a_m - a_m|, \; c \, \rho(\delta_m))}{\tilde a_m}, \qquad a = \rho(x), \qquad
!>    \rho(x) = (\max_t x - \min_t x)/2 $$
!>
!> delta: the change of the motion, less the shift in time that comes nearest to it. rho(delta) bounds the change of the amplitude. At
!> the two instants of the extremes the parts of a change may cancel by chance, so the change is taken to be at least a part c of it.
module attrito_accuracy_amplitude_change
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: extrema, resized
  implicit none
  private
  public :: relative_change, share_of_motion

  !> Monitors below this part of the largest amplitude are measured against it: what hardly moves has no relative error
  real(wp), parameter :: least_share = 1.0e-3_wp ! conventional
  !> c, measured: with a fifth, one estimate in a hundred is less than a third of the error, with a third one in two hundred
  real(wp), parameter :: share_of_motion = 1.0_wp/3.0_wp ! measured

contains

  !> Of all monitors the largest change.
  pure real(wp) function relative_change(from, to)
    !> Coefficients of the monitors of both [k, monitors]
    real(wp), intent(in) :: from(:, :), to(:, :)
    real(wp) :: difference(max(size(from, 1), size(to, 1)), size(to, 2))
    real(wp), dimension(size(to, 2)) :: after, change

    relative_change = 0.0_wp
    if (size(to, 2) == 0) return
    difference = resized(to, size(difference, 1)) - resized(from, size(difference, 1))
    after = half_ranges(to)
    difference = without_shift(difference, resized(to, size(difference, 1)))
    change = max(abs(after - half_ranges(from)), share_of_motion*half_ranges(difference))
    if (maxval(after) > 0.0_wp) relative_change = maxval(change/max(after, least_share*maxval(after)))
  end function relative_change

  !> A change of series, columnwise, less the shift in time that comes nearest to it: that changes no amplitude.
  pure function without_shift(change, series) result(rest)
    !> [k, columns] both
    real(wp), intent(in) :: change(:, :), series(:, :)
    real(wp) :: rest(size(change, 1), size(change, 2)), rate(size(change, 1))
    integer :: h, i

    do i = 1, size(change, 2)
      rate(1) = 0.0_wp
      do h = 1, size(rate)/2
        rate(2*h:2*h + 1) = h*[series(2*h + 1, i), -series(2*h, i)]
      end do
      rest(:, i) = change(:, i) - rate*(dot_product(rate, change(:, i))/max(dot_product(rate, rate), tiny(1.0_wp)))
    end do
  end function without_shift

  !> Half the range over the period of series, columnwise.
  pure function half_ranges(series) result(ranges)
    !> Coefficients, a column each
    real(wp), intent(in) :: series(:, :)
    real(wp) :: ranges(size(series, 2)), range(2)
    integer :: i

    do i = 1, size(series, 2)
      range = extrema(series(:, i))
      ranges(i) = 0.5_wp*(range(2) - range(1))
    end do
  end function half_ranges
end module attrito_accuracy_amplitude_change
