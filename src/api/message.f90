!> Text and failures across the C interface.
module attrito_api_message
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use attrito_core_errors, only: error_type
  implicit none
  private
  public :: report_error, say, text_of

contains

  !> Status of an error, its message copied out: 0 and nothing where there is none.
  function report_error(error, message) result(status)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(in) :: error
    !> Ends with a null character
    character(kind=c_char), intent(out) :: message(:)
    integer(c_int) :: status

    message = c_null_char
    status = 0
    if (.not. allocated(error)) return
    status = error%status
    call say(error%message, message)
  end function report_error

  !> Copy a text out.
  pure subroutine say(text, message)
    !> Text, as C hands it over
    character(*), intent(in) :: text
    !> Ends with a null character
    character(kind=c_char), intent(out) :: message(:)
    integer :: i

    message = c_null_char
    do i = 1, min(len(text), size(message) - 1)
      message(i) = text(i:i)
    end do
  end subroutine say

  !> Fortran's text of a C string.
  pure function text_of(string) result(text)
    !> Text of C
    character(kind=c_char), intent(in) :: string(*)
    character(:), allocatable :: text
    integer :: i, length

    length = 0
    do while (string(length + 1) /= c_null_char)
      length = length + 1
    end do
    allocate (character(length) :: text)
    do i = 1, length
      text(i:i) = string(i)
    end do
  end function text_of
end module attrito_api_message
