!> When an iterate of Newton's method is an answer.
!>
!> Residuals r and harmonics of the motion x are scaled by the stuck response:
!>
!> $$ |r| \le \max(\mathrm{tolerance}, 16 \epsilon |x|), \qquad |x| \le 10^8 $$
!>
!> Where contacts are far stiffer than what they hold, motion may exceed the stuck response so far that rounding hides more than the
!> tolerance. Mean positions do not count in x: a body that drifts may be anywhere, and would converge by being far enough away. A
!> diverged iterate is rejected, even if its residual is below the tolerance.
module attrito_newton_convergence
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: is_converged, has_diverged, worse_of

  !> Residual relative to the motion that is rounding
  real(wp), parameter :: rounding = 16.0_wp*epsilon(1.0_wp) ! derived
  !> Size of the scaled motion beyond which no residual means anything
  real(wp), parameter :: divergence_limit = 1.0e8_wp ! conventional

contains

  pure logical function is_converged(residual, motion, tolerance)
    !> Norms, and the residual asked for
    real(wp), intent(in) :: residual, motion, tolerance

    is_converged = .false.
    if (has_diverged(motion) .or. .not. ieee_is_finite(residual)) return
    is_converged = residual <= max(tolerance, rounding*motion)
  end function is_converged

  !> The larger of two residuals. A number that is not finite is worse than any: `max` would pass over a NaN.
  pure real(wp) function worse_of(a, b)
    !> Residual to compare
    real(wp), intent(in) :: a, b

    worse_of = huge(a)
    if (ieee_is_finite(a) .and. ieee_is_finite(b)) worse_of = max(a, b)
  end function worse_of

  !> Is a motion, by its norm, too far away for any residual to mean something?
  pure logical function has_diverged(motion)
    !> Size of the motion
    real(wp), intent(in) :: motion

    has_diverged = .true.
    if (ieee_is_finite(motion)) has_diverged = motion > divergence_limit
  end function has_diverged
end module attrito_newton_convergence
