!> Why a curve of peaks ends before its stop.
module attrito_peak_endings
  implicit none
  private
  public :: ending_names, ending_none, ending_not_found, ending_leaves_band, ending_no_periodic_motion

  !> It does not; no peak was found, for no reason known; the response is largest at an end of the band; mean friction does not
  !> balance the mean forces at frequencies about the peak, so that a body drifts
  integer, parameter :: ending_none = 0, ending_not_found = 1, ending_leaves_band = 2, ending_no_periodic_motion = 3
  character(18), parameter :: ending_names(0:3) = [character(18) :: 'none', 'not_found', 'leaves_band', 'no_periodic_motion']
end module attrito_peak_endings
