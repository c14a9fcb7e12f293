!> The estimated errors of a point by what causes them, and whether they keep a tolerance.
module attrito_accuracy_point_errors
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: point_errors_type, no_tolerance

  !> A tolerance that no error exceeds, one that is not known included
  real(wp), parameter :: no_tolerance = huge(1.0_wp) ! conventional

  !> Relative errors of the amplitude; by harmonics and samples NaN where the linearised step that estimates them is singular
  type :: point_errors_type
    real(wp) :: harmonics = 0.0_wp, samples = 0.0_wp, modes = 0.0_wp
  contains
    procedure :: all
    procedure :: are_known
    procedure :: are_within
  end type point_errors_type

contains

  !> All together.
  pure real(wp) function all(self)
    class(point_errors_type), intent(in) :: self

    all = self%harmonics + self%samples + self%modes
  end function all

  !> Is there an estimate?
  pure logical function are_known(self)
    class(point_errors_type), intent(in) :: self

    are_known = .not. ieee_is_nan(self%harmonics)
  end function are_known

  !> Is the tolerance kept? Errors that are not known keep none.
  pure logical function are_within(self, tolerance)
    class(point_errors_type), intent(in) :: self
    !> Relative tolerance
    real(wp), intent(in) :: tolerance

    are_within = tolerance >= no_tolerance
    if (self%are_known() .and. .not. are_within) are_within = self%all() <= tolerance
  end function are_within
end module attrito_accuracy_point_errors
