!> What asks for more memory than there is ends the process with a word: compilers do not look at all that they are given.
!>
!> The linker has the library call these procedures instead of C's (`--wrap`, cmake/stages.cmake).
module attrito_core_exhausted
  use, intrinsic :: iso_c_binding, only: c_associated, c_f_procpointer, c_funptr, c_int, c_int64_t, c_ptr, c_size_t
  implicit none
  private
  public :: report_exhaustion_to, expect_exhaustion

  !> Of a process that the input ends
  integer(c_int), parameter :: input_at_fault = 2

  abstract interface
    !> So many bytes were asked for in vain; what is called may end the process.
    subroutine exhausted_callback(bytes) bind(c)
      import :: c_int64_t
      !> That were asked for
      integer(c_int64_t), value :: bytes
    end subroutine exhausted_callback
  end interface

  interface
    type(c_ptr) function c_malloc(bytes) bind(c, name='__real_malloc')
      import :: c_ptr, c_size_t
      !> That are asked for
      integer(c_size_t), value :: bytes
    end function c_malloc
    type(c_ptr) function c_calloc(number, bytes) bind(c, name='__real_calloc')
      import :: c_ptr, c_size_t
      !> How many; of how many bytes each
      integer(c_size_t), value :: number, bytes
    end function c_calloc
    type(c_ptr) function c_realloc(old, bytes) bind(c, name='__real_realloc')
      import :: c_ptr, c_size_t
      !> What is made larger or smaller
      type(c_ptr), value :: old
      !> That are asked for
      integer(c_size_t), value :: bytes
    end function c_realloc
    subroutine c_exit(status) bind(c, name='_exit')
      import :: c_int
      !> Of the process
      integer(c_int), value :: status
    end subroutine c_exit
  end interface

  procedure(exhausted_callback), pointer :: listener => null()
  !> Does the caller look at what it is given?
  logical :: is_expected = .false.

contains

  !> Have a procedure called where memory is exhausted.
  subroutine report_exhaustion_to(procedure)
    !> void f(int64_t bytes)
    type(c_funptr), intent(in) :: procedure

    call c_f_procpointer(procedure, listener)
  end subroutine report_exhaustion_to

  !> From here on the caller looks at what it is given, or no longer.
  subroutine expect_exhaustion(expected)
    !> Does it?
    logical, intent(in) :: expected

    is_expected = expected
  end subroutine expect_exhaustion

  !> As C's.
  type(c_ptr) function wrapped_malloc(bytes) bind(c, name='__wrap_malloc')
    !> That are asked for
    integer(c_size_t), value :: bytes

    wrapped_malloc = c_malloc(bytes)
    if (.not. c_associated(wrapped_malloc) .and. bytes /= 0) call give_up(bytes)
  end function wrapped_malloc

  !> As C's.
  type(c_ptr) function wrapped_calloc(number, bytes) bind(c, name='__wrap_calloc')
    !> How many; of how many bytes each
    integer(c_size_t), value :: number, bytes

    wrapped_calloc = c_calloc(number, bytes)
    if (.not. c_associated(wrapped_calloc) .and. number /= 0 .and. bytes /= 0) call give_up(number * bytes)
  end function wrapped_calloc

  !> As C's.
  type(c_ptr) function wrapped_realloc(old, bytes) bind(c, name='__wrap_realloc')
    !> What is made larger or smaller
    type(c_ptr), value :: old
    !> That are asked for
    integer(c_size_t), value :: bytes

    wrapped_realloc = c_realloc(old, bytes)
    if (.not. c_associated(wrapped_realloc) .and. bytes /= 0) call give_up(bytes)
  end function wrapped_realloc

  !> End the process, unless the caller sees to it.
  subroutine give_up(bytes)
    !> That were asked for
    integer(c_size_t), intent(in) :: bytes

    if (is_expected) return
    if (associated(listener)) call listener(int(bytes, c_int64_t))
    call c_exit(input_at_fault)
  end subroutine give_up
end module attrito_core_exhausted
