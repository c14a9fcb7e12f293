#include <slepc/finclude/slepceps.h>
#include "petsc_compatibility.h"
!> Lowest modes of a pencil by SLEPc's Krylov-Schur method on K^{-1} M, one vector a solve.
!> Source: Stewart, SIAM J. Matrix Anal. Appl. 23 (2002) 601-614, doi:10.1137/S0895479800371529.
module attrito_reduce_krylov_schur
  use slepceps
  use attrito_core_kinds, only: wp
  use attrito_reduce_interior_factor, only: interior_factor_type
  implicit none
  private
  public :: find_by_krylov_schur

contains

  !> Eigenvalues that converged, and their shapes.
  subroutine find_by_krylov_schur(stiffness, mass, factor, wanted, tolerance, eigenvalues, shapes, ierr)
    !> K and M
    type(tMat), intent(in) :: stiffness, mass
    !> Factors of K
    type(interior_factor_type), intent(in) :: factor
    !> Number of modes
    integer, intent(in) :: wanted
    !> Relative residual to reach
    real(wp), intent(in) :: tolerance
    !> Ascending
    real(wp), allocatable, intent(out) :: eigenvalues(:)
    !> This rank's rows [rows, modes]
    real(wp), allocatable, intent(out) :: shapes(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tEPS) :: solver
    integer :: rows

    PetscCall(find_eigenvalues(stiffness, mass, factor, wanted, tolerance, solver, eigenvalues, ierr))
    PetscCall(MatGetLocalSize(mass, rows, PETSC_NULL_INTEGER, ierr))
    allocate (shapes(rows, size(eigenvalues)))
    PetscCall(copy_shapes(solver, mass, shapes, ierr))
    PetscCall(EPSDestroy(solver, ierr))
  end subroutine find_by_krylov_schur

  subroutine find_eigenvalues(stiffness, mass, factor, wanted, tolerance, solver, eigenvalues, ierr)
    type(tMat), intent(in) :: stiffness, mass
    type(interior_factor_type), intent(in) :: factor
    integer, intent(in) :: wanted
    real(wp), intent(in) :: tolerance
    !> Holds the mode shapes; the caller destroys it
    type(tEPS), intent(out) :: solver
    real(wp), allocatable, intent(out) :: eigenvalues(:)
    PetscErrorCode, intent(out) :: ierr
    type(tST) :: transform
    PetscMPIInt :: comm
    PetscInt :: n, converged, i
    PetscScalar :: imaginary

    allocate (eigenvalues(0))
    PetscCall(PetscObjectGetComm(stiffness, comm, ierr))
    PetscCall(MatGetSize(stiffness, n, PETSC_NULL_INTEGER, ierr))
    PetscCall(EPSCreate(comm, solver, ierr))
    PetscCall(EPSSetOperators(solver, stiffness, mass, ierr))
    PetscCall(EPSSetProblemType(solver, EPS_GHEP, ierr))
    PetscCall(EPSSetTarget(solver, 0.0_wp, ierr))
    PetscCall(EPSSetWhichEigenpairs(solver, EPS_TARGET_MAGNITUDE, ierr))
    PetscCall(EPSSetDimensions(solver, min(wanted, n), PETSC_DEFAULT_INTEGER, PETSC_DEFAULT_INTEGER, ierr))
    PetscCall(EPSSetTolerances(solver, tolerance, 500, ierr))
    ! One more solve for each mode, which would blow up what rounding leaves of the lowest modes in the others.
    PetscCall(EPSSetPurify(solver, PETSC_FALSE, ierr))
    PetscCall(EPSGetST(solver, transform, ierr))
    PetscCall(STSetType(transform, STSINVERT, ierr))
    PetscCall(STSetKSP(transform, factor%solver, ierr))
    PetscCall(EPSSetFromOptions(solver, ierr))
    PetscCall(EPSSolve(solver, ierr))
    PetscCall(EPSGetConverged(solver, converged, ierr))
    deallocate (eigenvalues)
    allocate (eigenvalues(converged))
    do i = 1, converged
      PetscCall(EPSGetEigenvalue(solver, i - 1, eigenvalues(i), imaginary, ierr))
    end do
  end subroutine find_eigenvalues

  subroutine copy_shapes(solver, mass, shapes, ierr)
    type(tEPS), intent(in) :: solver
    type(tMat), intent(in) :: mass
    real(wp), intent(out) :: shapes(:, :)
    PetscErrorCode, intent(out) :: ierr
    type(tVec) :: shape
    PetscScalar, pointer :: values(:)
    integer :: i

    PetscCall(MatCreateVecs(mass, PETSC_NULL_VEC, shape, ierr))
    do i = 1, size(shapes, 2)
      PetscCall(EPSGetEigenvector(solver, i - 1, shape, PETSC_NULL_VEC, ierr))
      PetscCall(VecGetArrayRead(shape, values, ierr))
      shapes(:, i) = values
      PetscCall(VecRestoreArrayRead(shape, values, ierr))
    end do
    PetscCall(VecDestroy(shape, ierr))
  end subroutine copy_shapes
end module attrito_reduce_krylov_schur
