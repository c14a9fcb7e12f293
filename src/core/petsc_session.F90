#include <slepc/finclude/slepcsys.h>
#include "petsc_compatibility.h"
!> PETSc and SLEPc from first use to the end of the process.
!>
!> MPI is started and ended by the caller (mpi4py). PETSc catches no signals, so that a crash shows its own traceback, and its
!> errors return as `ierr` without a word: whoever calls PETSc turns them into an `error_type`.
module attrito_core_petsc_session
  use, intrinsic :: iso_c_binding, only: c_funloc, c_funptr, c_int, c_null_ptr, c_ptr
  use mpi, only: MPI_COMM_NULL
  use slepcsys
  use attrito_core_errors, only: error_type, raise
  implicit none
  private
  public :: start_petsc, stop_petsc, raise_petsc

  !> PETSc's world: our own duplicate of the communicator of first use, which its owner may free long before PETSc ends
  integer :: world = MPI_COMM_NULL

  interface
    integer(c_int) function push_error_handler(handler, context) bind(c, name='PetscPushErrorHandler')
      import :: c_funptr, c_int, c_ptr
      type(c_funptr), value :: handler
      type(c_ptr), value :: context
    end function push_error_handler

    subroutine return_error() bind(c, name='PetscReturnErrorHandler')
    end subroutine return_error
  end interface

contains

  !> Start PETSc and SLEPc on the ranks of `comm`; once they run, nothing happens.
  subroutine start_petsc(comm, error)
    !> All ranks that will ever use PETSc together
    integer, intent(in) :: comm
    !> PETSc does not start
    type(error_type), allocatable, intent(out) :: error
    PetscBool :: running
    PetscErrorCode :: ierr
    integer :: mpi_error

    call PetscInitialized(running, ierr)
    if (.not. running) then
      call MPI_Comm_dup(comm, world, mpi_error)
      PETSC_COMM_WORLD = world
    end if
    call SlepcInitialized(running, ierr)
    if (running) return
    call read_environment(ierr)
    if (ierr == 0) call SlepcInitializeNoArguments(ierr)
    if (ierr == 0) ierr = push_error_handler(c_funloc(return_error), c_null_ptr)
    if (ierr /= 0) call raise_petsc(error, int(ierr), 'starting')
  end subroutine start_petsc

  !> PETSC_OPTIONS of the environment, which PETSc leaves unread where it has to leave the command line alone; and that signals are
  !> not PETSc's, which the caller may have handlers for.
  subroutine read_environment(ierr)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    character(:), allocatable :: options
    integer :: length

    call get_environment_variable('PETSC_OPTIONS', length=length)
    allocate (character(length) :: options)
    call get_environment_variable('PETSC_OPTIONS', options)
    PetscCall(PetscOptionsInsertString(PETSC_NULL_OPTIONS, options//' -no_signal_handler', ierr))
  end subroutine read_environment

  !> End SLEPc, and PETSc with it; to be called before MPI ends.
  subroutine stop_petsc()
    PetscBool :: running
    PetscErrorCode :: ierr
    integer :: mpi_error

    call SlepcInitialized(running, ierr)
    if (.not. running) return
    call PetscPopErrorHandler(ierr)
    call SlepcFinalize(ierr)
    if (world /= MPI_COMM_NULL) call MPI_Comm_free(world, mpi_error)
  end subroutine stop_petsc

  !> Turn a PETSc error into ours; no error where `ierr` is zero.
  subroutine raise_petsc(error, ierr, doing)
    !> The failure
    type(error_type), allocatable, intent(out) :: error
    !> PETSc's error code
    integer, intent(in) :: ierr
    !> What was being done
    character(*), intent(in) :: doing
    character(12) :: code

    if (ierr == 0) return
    write (code, '(i0)') ierr
    call raise(error, 'PETSc failed (error ' // trim(code) // trim(merge(', out of memory', '               ', &
                      ierr == PETSC_ERR_MEM)) // ') while ' // doing)
  end subroutine raise_petsc
end module attrito_core_petsc_session
