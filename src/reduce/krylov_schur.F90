#include <slepc/finclude/slepceps.h>
#include "petsc_compatibility.h"
!> Vectors near the lowest modes of a pencil by SLEPc's Krylov-Schur method, shift-and-invert at zero with factors that are there already.
!>
!> $$ A = K^{-1} M, \qquad A V = V T + v b^T, \qquad V^T M V = I $$
!>
!> One vector a solve: SLEPc has no block variant. By rounding, vectors of the highest modes hold a little of the lowest ones, which A
!> magnifies by the ratio of the eigenvalues: a Rayleigh-Ritz step (`attrito_reduce_rayleigh_ritz`) has to follow. Options of the database
!> have the prefix `modes_`.
!> Sources: Stewart, SIAM J. Matrix Anal. Appl. 23 (2002) 601-614, doi:10.1137/S0895479800371529; Hernandez, Roman & Vidal, ACM Trans.
!> Math. Softw. 31 (2005) 351-362, doi:10.1145/1089014.1089019 (SLEPc).
module attrito_reduce_krylov_schur
  use slepceps
  use attrito_core_kinds, only: wp
  use attrito_reduce_dense_block, only: put_vector, take_vector
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_progress, only: progress_type
  implicit none
  private
  public :: krylov_schur_type, find_by_krylov_schur

  !> What is sought, and what the search has found
  type :: krylov_schur_type
    !> K and M, borrowed
    type(tMat) :: stiffness, mass
    !> Factors of K, borrowed
    type(interior_factor_type) :: factor
    !> Who listens, and how many modes are wanted
    type(progress_type) :: progress
    integer :: wanted = 0
    !> Vectors solved for
    integer :: solves = 0
  end type krylov_schur_type

  !> Vectors in the space beyond those sought: a third as many, at least these
  integer, parameter :: least_room = 20 ! measured
  !> Restarts at most
  integer, parameter :: most_restarts = 200 ! conventional

contains

  !> Find vectors that span the lowest modes, up to `sought` of them and a few more; fewer where no more converge.
  subroutine find_by_krylov_schur(self, start, sought, tolerance, shapes, ierr)
    !> K, M, factors
    type(krylov_schur_type), intent(inout) :: self
    !> This rank's rows of the first vector
    real(wp), intent(in), contiguous :: start(:)
    !> Number of modes
    integer, intent(in) :: sought
    !> Residual in A relative to the eigenvalue
    real(wp), intent(in) :: tolerance
    !> This rank's rows of the vectors, of any scale
    real(wp), allocatable, intent(out) :: shapes(:, :)
    !> SLEPc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tEPS) :: solver
    type(tVec) :: first(1)
    PetscInt :: before, after
    PetscErrorCode :: status

    call make_vector(self%mass, start, first(1), ierr)
    if (ierr == 0) call KSPGetTotalIterations(self%factor%solver, before, ierr)
    if (ierr == 0) call solve(self, first, sought, tolerance, solver, ierr)
    if (ierr == 0) call KSPGetTotalIterations(self%factor%solver, after, ierr)
    if (ierr == 0) self%solves = self%solves + after - before
    if (ierr == 0) call copy_vectors(solver, first(1), size(start), shapes, ierr)
    call VecDestroy(first(1), status)
    if (ierr == 0) call release(self%mass, solver, ierr)
  end subroutine find_by_krylov_schur

  subroutine make_vector(like, rows, vector, ierr)
    !> PETSc matrix
    type(tMat), intent(in) :: like
    !> This rank's
    real(wp), intent(in) :: rows(:)
    !> PETSc vector
    type(tVec), intent(inout) :: vector
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr

    PetscCall(MatCreateVecs(like, vector, PETSC_NULL_VEC, ierr))
    PetscCall(put_vector(rows, vector, ierr))
  end subroutine make_vector

  subroutine solve(self, first, sought, tolerance, solver, ierr)
    type(krylov_schur_type), intent(in), target :: self
    !> PETSc vector
    type(tVec), intent(in) :: first(1)
    !> How many modes are asked for
    integer, intent(in) :: sought
    !> Relative tolerance
    real(wp), intent(in) :: tolerance
    !> SLEPc's eigensolver
    type(tEPS), intent(inout) :: solver
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tST) :: transform
    PetscMPIInt :: comm
    PetscInt :: n, room

    PetscCall(PetscObjectGetComm(self%mass, comm, ierr))
    PetscCall(MatGetSize(self%mass, n, PETSC_NULL_INTEGER, ierr))
    room = min(n, sought + max(least_room, sought/3))
    PetscCall(EPSCreate(comm, solver, ierr))
    PetscCall(EPSSetOptionsPrefix(solver, 'modes_', ierr))
    PetscCall(EPSSetOperators(solver, self%stiffness, self%mass, ierr))
    PetscCall(EPSSetProblemType(solver, EPS_GHEP, ierr))
    PetscCall(EPSSetType(solver, EPSKRYLOVSCHUR, ierr))
    PetscCall(EPSSetTarget(solver, 0.0_wp, ierr))
    PetscCall(EPSSetWhichEigenpairs(solver, EPS_TARGET_MAGNITUDE, ierr))
    PetscCall(EPSSetDimensions(solver, min(sought, room), room, room, ierr))
    PetscCall(EPSSetTolerances(solver, tolerance, most_restarts, ierr))
    ! It would solve once more for each vector; the Rayleigh-Ritz step does so by blocks.
    PetscCall(EPSSetPurify(solver, PETSC_FALSE, ierr))
    PetscCall(EPSSetInitialSpace(solver, 1, first, ierr))
    PetscCall(EPSGetST(solver, transform, ierr))
    PetscCall(STSetType(transform, STSINVERT, ierr))
    PetscCall(STSetKSP(transform, self%factor%solver, ierr))
    PetscCall(EPSMonitorSet(solver, report, self, PETSC_NULL_FUNCTION, ierr))
    PetscCall(EPSSetFromOptions(solver, ierr))
    PetscCall(EPSSolve(solver, ierr))
  end subroutine solve

  !> Destroy the solver. It would empty the solver of linear systems that it holds, and the factors are to stay: it gets another.
  subroutine release(like, solver, ierr)
    !> A matrix of the same ranks
    type(tMat), intent(in) :: like
    !> SLEPc's eigensolver
    type(tEPS), intent(inout) :: solver
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tST) :: transform
    type(tKSP) :: nothing
    PetscMPIInt :: comm

    PetscCall(PetscObjectGetComm(like, comm, ierr))
    PetscCall(KSPCreate(comm, nothing, ierr))
    PetscCall(EPSGetST(solver, transform, ierr))
    PetscCall(STSetKSP(transform, nothing, ierr))
    PetscCall(KSPDestroy(nothing, ierr))
    PetscCall(EPSDestroy(solver, ierr))
  end subroutine release

  !> Called by SLEPc at each restart.
  subroutine report(solver, iteration, converged, real_parts, imaginary_parts, errors, known, self, ierr)
    !> SLEPc's eigensolver
    type(tEPS), intent(in) :: solver
    !> As SLEPc counts them; how many have converged
    PetscInt, intent(in) :: iteration, converged, known
    !> Parts of the eigenvalues
    PetscScalar, intent(in) :: real_parts(*), imaginary_parts(*)
    !> Estimated relative errors
    PetscReal, intent(in) :: errors(*)
    type(krylov_schur_type), intent(in) :: self
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr

    call self%progress%step('fixed-interface modes', min(converged, self%wanted), self%wanted)
    ierr = 0
  end subroutine report

  !> All that converged.
  subroutine copy_vectors(solver, vector, rows, shapes, ierr)
    !> SLEPc's eigensolver
    type(tEPS), intent(in) :: solver
    !> Scratch
    type(tVec), intent(in) :: vector
    !> Rows of this rank
    integer, intent(in) :: rows
    !> Shapes of the modes, a column each
    real(wp), allocatable, intent(out) :: shapes(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscInt :: converged, i

    PetscCall(EPSGetConverged(solver, converged, ierr))
    allocate (shapes(rows, converged))
    do i = 1, converged
      PetscCall(EPSGetEigenvector(solver, i - 1, vector, PETSC_NULL_VEC, ierr))
      PetscCall(take_vector(vector, shapes(:, i), ierr))
    end do
  end subroutine copy_vectors
end module attrito_reduce_krylov_schur
