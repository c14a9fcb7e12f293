!> Values of the parameter that peaks are followed in: from one to another, in one direction.
module attrito_peak_parameter_range
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: leads_on, look_ahead, passed

contains

  !> The value of the parameter that is so far ahead, or the last one.
  pure subroutine look_ahead(from, leap, stop, value, reached)
    !> Value to go on from; relative change; value to end at
    real(wp), intent(in) :: from, leap, stop
    !> Where to look
    real(wp), intent(out) :: value
    !> Is that the end?
    logical, intent(out) :: reached

    value = from*(1.0_wp + leap)**sign(1.0_wp, stop - from)
    reached = passed(from, value, stop)
    if (reached) value = stop
  end subroutine look_ahead

  !> Is a value beyond another on the way to a third?
  pure logical function leads_on(from, to, stop)
    !> Value that the way begins at; the value; value of the parameter to end at
    real(wp), intent(in) :: from, to, stop

    leads_on = (to - from)*(stop - from) > 0.0_wp
  end function leads_on

  !> Does the way from one value to another pass a third?
  pure logical function passed(from, to, value)
    !> Value that the way begins at; value that the way ends at; value of the parameter
    real(wp), intent(in) :: from, to, value

    passed = (value - from)*(to - value) >= 0.0_wp .and. abs(to - from) > 0.0_wp
  end function passed
end module attrito_peak_parameter_range
