!> What a long reduction reports while it runs, through a procedure of the caller's: sentences, and how far a step has come.
module attrito_reduce_progress
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_f_procpointer, c_funptr, c_int, c_null_char, c_null_funptr
  implicit none
  private
  public :: progress_type, new_progress

  abstract interface
    !> A sentence where `total` is 0; else `done` of `total` parts of the step of this name.
    subroutine listener(text, done, total) bind(c)
      import :: c_char, c_int
      !> Name of the step, or a sentence
      character(kind=c_char), intent(in) :: text(*)
      !> How much is done; of how much
      integer(c_int), value :: done, total
    end subroutine listener
  end interface

  type :: progress_type
    procedure(listener), pointer, nopass :: report => null()
  contains
    procedure :: say
    procedure :: step
  end type progress_type

contains

  !> Wrap the caller's procedure; null where nobody listens, as on all ranks but one.
  function new_progress(procedure) result(self)
    !> void f(const char *text, int done, int total)
    type(c_funptr), intent(in) :: procedure
    type(progress_type) :: self

    if (c_associated(procedure)) call c_f_procpointer(procedure, self%report)
  end function new_progress

  !> Say a sentence.
  subroutine say(self, text)
    class(progress_type), intent(in) :: self
    !> One line
    character(*), intent(in) :: text

    if (associated(self%report)) call self%report(text//c_null_char, 0_c_int, 0_c_int)
  end subroutine say

  !> Report how far a step has come; 0 parts done starts it.
  subroutine step(self, name, done, total)
    class(progress_type), intent(in) :: self
    !> Name of the step
    character(*), intent(in) :: name
    !> Parts done, of how many
    integer, intent(in) :: done, total

    if (associated(self%report)) call self%report(name//c_null_char, int(done, c_int), int(max(total, 1), c_int))
  end subroutine step
end module attrito_reduce_progress
