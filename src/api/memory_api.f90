!> C interface of memory that is exhausted.
module attrito_api_memory
  use, intrinsic :: iso_c_binding, only: c_funptr
  use attrito_core_exhausted, only: report_exhaustion_to
  implicit none
  private

contains

  !> Have a procedure called where an allocation of the library fails, before the process ends with code 2.
  subroutine attrito_when_exhausted(procedure) bind(c)
    !> void f(int64_t bytes)
    type(c_funptr), value :: procedure

    call report_exhaustion_to(procedure)
  end subroutine attrito_when_exhausted
end module attrito_api_memory
