!> How long a series has to be for the error that is accepted.
!>
!> Harmonics left out fade as those do that are there: the error shrinks with the part of the motion beyond,
!>
!> $$ e_h = e_H \, \frac{|d_{> h}|}{|d_{> H}|} $$
module attrito_accuracy_series_length
  use attrito_core_kinds, only: wp
  use attrito_accuracy_error_estimate, only: harmonics_share, worst_share
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_point_errors, only: point_errors_type, no_tolerance
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: series_length_type, next_longer, most_harmonics, most_growth, long_series

  !> What a change of harmonics aims at of the part of the tolerance that they may take: the estimate may be too small by a
  !> factor, and the next point is not this one; of a long series, where a harmonic costs more than another try
  real(wp), parameter :: aimed_part = 0.3_wp, aimed_at_length = 0.9_wp ! conventional
  !> A series is cut where so few harmonics would do
  real(wp), parameter :: worth_cutting = 0.75_wp ! guess
  !> Most harmonics that are chosen
  integer, parameter :: most_harmonics = 100 ! conventional
  !> Longest series to go to at once, in units of the present one: more is not known to be needed
  integer, parameter :: most_growth = 2 ! guess
  !> Longer series are long: Newton's method costs much there, and from far away it is given up early
  integer, parameter :: long_series = 20 ! guess

  type :: series_length_type
    !> Relative error accepted in the amplitude
    real(wp) :: tolerance = no_tolerance
    !> Choose harmonics by it?
    logical :: choose_harmonics = .false.
    !> Fewest harmonics, those of the loads
    integer :: fewest_harmonics = 1
  contains
    procedure :: accepts
    procedure :: at_worst
    procedure :: needed_harmonics
  end type series_length_type

contains

  !> Length of the series that an estimate which is not sure is held against.
  pure integer function next_longer(harmonics)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    next_longer = (5*harmonics)/4 + 2
  end function next_longer

  !> Does the point meet what is asked of harmonics?
  pure logical function accepts(self, errors)
    class(series_length_type), intent(in) :: self
    !> Of the point
    type(point_errors_type), intent(in) :: errors

    accepts = .not. self%choose_harmonics .or. errors%harmonics <= harmonics_share*self%tolerance
  end function accepts

  !> The most that harmonics may take of the tolerance: their share, or at worst what modes leave.
  pure real(wp) function at_worst(self, errors)
    class(series_length_type), intent(in) :: self
    !> Of the point
    type(point_errors_type), intent(in) :: errors

    at_worst = max(harmonics_share*self%tolerance, min(worst_share*self%tolerance, self%tolerance - errors%modes))
  end function at_worst

  !> Harmonics that this point needs: the error shrinks with the part of the motion that is left out.
  integer function needed_harmonics(self, solver, errors, finer) result(needed)
    class(series_length_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Of the point
    type(point_errors_type), intent(in) :: errors
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(in) :: finer
    real(wp), allocatable :: left_out(:)
    real(wp) :: aimed
    integer :: h, now

    now = solver%options%harmonics
    needed = now
    if (.not. self%choose_harmonics) return
    needed = self%fewest_harmonics
    if (.not. allocated(finer%motion)) return
    left_out = tails(solver, finer%motion)
    do h = self%fewest_harmonics, size(left_out) - 1
      needed = h
      aimed = merge(aimed_part, aimed_at_length, h <= long_series)*harmonics_share*self%tolerance
      if (errors%harmonics*left_out(h) <= aimed*left_out(now)) exit
    end do
    if (needed > nint(worth_cutting*now) .and. self%accepts(errors)) needed = now
    needed = min(max(needed, now/2, self%fewest_harmonics), most_growth*now, most_harmonics)
  end function needed_harmonics

  !> Norm of the contacts' motion beyond each harmonic [K].
  function tails(solver, motion) result(left_out)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: left_out(size(motion, 1)/2)
    integer :: h

    left_out = 0.0_wp
    do h = size(left_out) - 1, 1, -1
      left_out(h) = left_out(h + 1) + sum(motion(2*h + 2:2*h + 3, :)**2)
    end do
    call solver%context%balance%ranks%sum(left_out)
    left_out = sqrt(left_out)
  end function tails
end module attrito_accuracy_series_length
