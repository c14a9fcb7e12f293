#include <petsc/finclude/petscksp.h>
#include "petsc_compatibility.h"
!> LDL^T factors of an interior matrix by MUMPS, used for every solve with it, and the signs of its pivots.
!>
!> $$ A = L D L^T, \qquad \text{number of negative pivots of } D = \text{number of negative eigenvalues of } A $$
!>
!> (Sylvester's law of inertia.) SCOTCH orders the rows where MUMPS has it.
!> Source: Amestoy, Duff, L'Excellent, Koster, SIAM J. Matrix Anal. Appl. 23 (2001) 15-41, doi:10.1137/S0895479899358194.
module attrito_reduce_interior_factor
  use petscksp
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_dense_block, only: wrap_block
  implicit none
  private
  public :: interior_factor_type, new_interior_factor

  type :: interior_factor_type
    !> Owns the factors
    type(tKSP) :: solver
    !> The matrix and its factors, borrowed
    type(tMat) :: matrix, factor
    !> Number of negative and of zero pivots
    integer :: negative = 0, zero = 0
    !> Memory of all ranks for the factors in megabytes, as MUMPS estimated it
    integer :: megabytes = 0
    !> Who ordered the rows
    character(8) :: ordering = ''
  contains
    procedure :: solve => solve_block
    procedure :: solve_sparse
    procedure :: destroy
  end type interior_factor_type

  !> MUMPS's numbers (users' guide 5.5): control and information by position
  integer, parameter :: icntl_ordering = 7, icntl_root = 13, icntl_room = 14, icntl_null_pivots = 24, icntl_block = 27
  integer, parameter :: infog_status = 1, infog_detail = 2, infog_ordering = 7, infog_negative = 12, infog_megabytes = 17, &
                        infog_zero = 28
  integer, parameter :: scotch = 3
  !> Right-hand sides that MUMPS solves at a time
  integer, parameter :: solve_block_size = 128

contains

  !> Factor a symmetric matrix, which must outlive its factors.
  subroutine new_interior_factor(self, matrix, error)
    !> The factors
    type(interior_factor_type), intent(out) :: self
    !> Symmetric, definite or not
    type(tMat), intent(in) :: matrix
    !> MUMPS ran out of memory
    type(error_type), allocatable, intent(out) :: error
    PetscInt :: status, detail, ordering
    PetscErrorCode :: ierr

    self%matrix = matrix
    call create(self, ierr)
    if (ierr == 0) call MatMumpsGetInfog(self%factor, infog_status, status, ierr)
    if (ierr == 0) call MatMumpsGetInfog(self%factor, infog_detail, detail, ierr)
    if (ierr /= 0) then
      call raise_petsc(error, ierr, 'factoring the interior stiffness')
    else if (status < 0) then
      call raise_mumps(status, detail, error)
    else
      call MatMumpsGetInfog(self%factor, infog_negative, self%negative, ierr)
      call MatMumpsGetInfog(self%factor, infog_zero, self%zero, ierr)
      call MatMumpsGetInfog(self%factor, infog_megabytes, self%megabytes, ierr)
      call MatMumpsGetInfog(self%factor, infog_ordering, ordering, ierr)
      self%ordering = name_of(ordering)
    end if
  end subroutine new_interior_factor

  subroutine create(self, ierr)
    type(interior_factor_type), intent(inout) :: self
    PetscErrorCode, intent(out) :: ierr
    type(tPC) :: preconditioner
    PetscMPIInt :: comm

    PetscCall(PetscObjectGetComm(self%matrix, comm, ierr))
    PetscCall(KSPCreate(comm, self%solver, ierr))
    PetscCall(KSPSetType(self%solver, KSPPREONLY, ierr))
    PetscCall(KSPSetOperators(self%solver, self%matrix, self%matrix, ierr))
    PetscCall(KSPGetPC(self%solver, preconditioner, ierr))
    PetscCall(PCSetType(preconditioner, PCCHOLESKY, ierr))
    PetscCall(PCFactorSetMatSolverType(preconditioner, MATSOLVERMUMPS, ierr))
    PetscCall(PCFactorSetUpMatSolverType(preconditioner, ierr))
    PetscCall(PCFactorGetMatrix(preconditioner, self%factor, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_ordering, scotch, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_room, 40, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_block, solve_block_size, ierr))
    ! Counting pivots right needs null pivot detection, and a root front that is not left to ScaLAPACK.
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_null_pivots, 1, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_root, 1, ierr))
    PetscCall(KSPSetUp(self%solver, ierr))
    ! A user of the solver (SLEPc) may hand it the same matrix anew; the factors stay.
    PetscCall(KSPSetReusePreconditioner(self%solver, PETSC_TRUE, ierr))
  end subroutine create

  !> What MUMPS complains of, in words.
  pure subroutine raise_mumps(status, detail, error)
    integer, intent(in) :: status, detail
    type(error_type), allocatable, intent(out) :: error
    character(40) :: code

    write (code, '(a, i0, a, i0, a)') '(MUMPS error ', status, ', ', detail, ')'
    select case (status)
     case (-13, -19)
      call raise(error, 'not enough memory for the factors of the interior stiffness ' // trim(code) // &
                 ': use more nodes, or a coarser mesh')
     case (-8, -9, -11, -14)
      call raise(error, 'the factors need more room than MUMPS foresaw ' // trim(code) // ': run on other numbers of ranks')
     case default
      call raise(error, 'the interior stiffness cannot be factored ' // trim(code))
    end select
  end subroutine raise_mumps

  pure function name_of(ordering) result(name)
    integer, intent(in) :: ordering
    character(8) :: name

    select case (ordering)
     case (0); name = 'AMD'
     case (2); name = 'AMF'
     case (3); name = 'SCOTCH'
     case (4); name = 'PORD'
     case (5); name = 'METIS'
     case (6); name = 'QAMD'
     case default; name = 'other'
    end select
  end function name_of

  !> Solve for a block of dense right-hand sides.
  subroutine solve_block(self, right_hand_sides, solutions, ierr)
    !> The factors
    class(interior_factor_type), intent(in) :: self
    !> This rank's interior rows
    real(wp), intent(in), contiguous, target :: right_hand_sides(:, :)
    !> This rank's interior rows
    real(wp), intent(out), contiguous, target :: solutions(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: b, x

    ierr = 0
    if (size(solutions, 2) == 0) return
    PetscCall(wrap_block(self%matrix, right_hand_sides, b, ierr))
    PetscCall(wrap_block(self%matrix, solutions, x, ierr))
    PetscCall(MatMatSolve(self%factor, b, x, ierr))
    PetscCall(MatDestroy(x, ierr))
    PetscCall(MatDestroy(b, ierr))
  end subroutine solve_block

  !> Solve for sparse right-hand sides, told as the rows of a matrix that rank 0 holds.
  subroutine solve_sparse(self, rows, solutions, ierr)
    !> The factors
    class(interior_factor_type), intent(in) :: self
    !> [right-hand sides, interior dofs], all on rank 0
    type(tMat), intent(in) :: rows
    !> This rank's interior rows of the solutions
    real(wp), intent(out), contiguous, target :: solutions(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: b, x

    PetscCall(MatCreateTranspose(rows, b, ierr))
    PetscCall(wrap_block(self%matrix, solutions, x, ierr))
    PetscCall(MatMatSolve(self%factor, b, x, ierr))
    PetscCall(MatDestroy(x, ierr))
    PetscCall(MatDestroy(b, ierr))
  end subroutine solve_sparse

  !> Release the factors; released ones, or none, do no harm.
  subroutine destroy(self)
    !> The factors
    class(interior_factor_type), intent(inout) :: self
    PetscErrorCode :: ierr

    call KSPDestroy(self%solver, ierr)
  end subroutine destroy
end module attrito_reduce_interior_factor
