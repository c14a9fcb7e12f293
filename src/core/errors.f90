!> What went wrong, as text for the user. An allocated `error` is a failure; not allocated is success.
module attrito_core_errors
  implicit none
  private
  public :: error_type, raise, fault_of_input, failure_of_numerics, failure_of_files

  !> The user's input is at fault (exit code 2)
  integer, parameter :: fault_of_input = 2
  !> The numerics or a library did not deliver (exit code 1)
  integer, parameter :: failure_of_numerics = 1
  !> A file cannot be written, or not be read: no room on the disk (exit code 2, and what was finished is worth keeping)
  integer, parameter :: failure_of_files = 3

  type :: error_type
    !> One of `fault_of_input`, `failure_of_numerics`, `failure_of_files`
    integer :: status = failure_of_numerics
    !> One sentence: what, where, what to do next
    character(:), allocatable :: message
  end type error_type

contains

  !> Make `error` say `message`.
  pure subroutine raise(error, message, status)
    !> The failure to be reported
    type(error_type), allocatable, intent(out) :: error
    !> One sentence
    character(*), intent(in) :: message
    !> Whose fault: the numerics' unless said otherwise
    integer, intent(in), optional :: status

    allocate (error)
    error%message = message
    if (present(status)) error%status = status
  end subroutine raise
end module attrito_core_errors
