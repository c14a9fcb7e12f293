!> The estimated errors of a point by what causes them, and whether they keep a tolerance.
module attrito_accuracy_point_errors
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: point_errors_type, no_tolerance

  !> A tolerance that no error exceeds, one that is not known included
  real(wp), parameter :: no_tolerance = huge(1.0_wp) ! conventional

  !> Relative errors of the amplitude; by harmonics NaN where the linearised step that estimates them is singular
  type :: point_errors_type
    real(wp) :: harmonics = 0.0_wp, modes = 0.0_wp
    !> What a finer balance changes of the motion of all coordinates at the harmonics that the series has, relative to what alternates
    real(wp) :: of_motion = 0.0_wp
    !> Is the estimate sure? Is it not for the stiffness of contacts alone?
    logical :: is_sure = .true., is_stiff = .false.
    !> Harmonics that have not settled, up to this one
    integer :: unsettled = 0
    !> The error, if it came to all that the two steps leave open; and what further answers of harmonics beyond would add
    real(wp) :: at_most = 0.0_wp, missing = 0.0_wp
    !> What of the error counts if the estimate is not sure: if the steps do not agree, forces are not linear so far, and nothing is
    !> known but what is missing beyond
    real(wp) :: known_part = 0.0_wp
    !> What a finer balance changes of each of this rank's contacts' work a period; not allocated where none was asked for
    real(wp), allocatable :: work(:)
  contains
    procedure :: all
    procedure :: are_known
    procedure :: are_within
    procedure :: of_work
  end type point_errors_type

contains

  !> All together.
  pure real(wp) function all(self)
    class(point_errors_type), intent(in) :: self

    all = self%harmonics + self%modes
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

  !> The error of a contact's work a period: what a finer balance changes of it, and no less than the amplitude's error makes of it,
  !> in which work is of second order: the change of both may cancel by chance. NaN: not known.
  pure real(wp) function of_work(self, contact, work) result(error)
    class(point_errors_type), intent(in) :: self
    !> Number of the contact among this rank's
    integer, intent(in) :: contact
    !> Its work
    real(wp), intent(in) :: work

    error = ieee_value(error, ieee_quiet_nan)
    if (.not. allocated(self%work) .or. .not. self%are_known()) return
    error = max(self%work(contact), 2.0_wp*self%harmonics*abs(work)) + 2.0_wp*self%modes*abs(work)
  end function of_work
end module attrito_accuracy_point_errors
