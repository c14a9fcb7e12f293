#include <petsc/finclude/petscsys.h>
!> MPI and PETSc around a suite that needs them.
module session
  use mpi
  use petscsys, only: PETSC_COMM_WORLD
  use attrito_core_communicator, only: communicator_type, new_communicator
  use attrito_core_errors, only: error_type
  use attrito_core_petsc_session, only: start_petsc, stop_petsc
  use testing, only: test_type, run_suite
  implicit none
  private
  public :: run_in_session, everyone, only_me, petsc_keeps_its_own_world

contains

  !> Start MPI and PETSc, run the suite, and stop; a failure on any rank ends the program as a failure.
  subroutine run_in_session(suite, tests)
    character(*), intent(in) :: suite
    type(test_type), intent(in) :: tests(:)
    type(error_type), allocatable :: error
    integer :: failed, ierr, rank

    call MPI_Init(ierr)
    call MPI_Comm_rank(MPI_COMM_WORLD, rank, ierr)
    call start_petsc(MPI_COMM_WORLD, error)
    if (allocated(error)) error stop 'PETSc does not start'
    failed = run_suite(suite, tests, quiet=rank > 0)
    call MPI_Allreduce(MPI_IN_PLACE, failed, 1, MPI_INTEGER, MPI_SUM, MPI_COMM_WORLD, ierr)
    call stop_petsc()
    call MPI_Finalize(ierr)
    if (failed > 0) error stop 1
  end subroutine run_in_session

  !> All ranks.
  function everyone() result(ranks)
    type(communicator_type) :: ranks

    ranks = new_communicator(MPI_COMM_WORLD)
  end function everyone

  !> This rank by itself.
  function only_me() result(ranks)
    type(communicator_type) :: ranks

    ranks = new_communicator(MPI_COMM_SELF)
  end function only_me

  !> PETSc was started on all ranks; is its communicator another one, which lives on when its owner frees the first?
  logical function petsc_keeps_its_own_world()
    integer :: relation, ierr

    call MPI_Comm_compare(PETSC_COMM_WORLD, MPI_COMM_WORLD, relation, ierr)
    petsc_keeps_its_own_world = relation == MPI_CONGRUENT
  end function petsc_keeps_its_own_world
end module session
