#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Blocks of vectors kept as plain arrays, this rank's rows of them, and what PETSc does with them.
module attrito_reduce_dense_block
  use petscmat
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: wrap_block, multiply_block, multiply_transposed_block, put_vector, take_vector

  !> Vectors that are multiplied together: PETSc has a loop of its own for so many
  integer, parameter :: most_together = 16 ! derived

contains

  !> A dense PETSc matrix on top of an array, which must outlive it; the caller destroys it.
  subroutine wrap_block(like, block, matrix, ierr)
    !> A matrix whose columns are spread over the ranks as the rows of the block
    type(tMat), intent(in) :: like
    !> This rank's rows of all vectors
    real(wp), intent(in), contiguous, target :: block(:, :)
    !> Dense [n, vectors]
    type(tMat), intent(out) :: matrix
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscInt :: n

    PetscCall(MatGetSize(like, PETSC_NULL_INTEGER, n, ierr))
    call wrap_rows(like, n, block, matrix, ierr)
  end subroutine wrap_block

  subroutine wrap_rows(like, n, block, matrix, ierr)
    !> A matrix of the same ranks
    type(tMat), intent(in) :: like
    !> Rows on all ranks together
    PetscInt, intent(in) :: n
    !> Block of the matrix, by harmonic
    real(wp), intent(in), contiguous, target :: block(:, :)
    !> Matrix, spread over the ranks
    type(tMat), intent(out) :: matrix
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscMPIInt :: comm
    PetscInt :: vectors

    vectors = size(block, 2)
    PetscCall(PetscObjectGetComm(like, comm, ierr))
    PetscCall(MatCreateDense(comm, size(block, 1), PETSC_DECIDE, n, vectors, block, matrix, ierr))
  end subroutine wrap_rows

  !> Sparse matrix times a block of vectors, some of them together: an entry of the matrix is read once for all of these, which are
  !> interlaced.
  subroutine multiply_block(matrix, block, product, ierr)
    !> Sparse
    type(tMat), intent(in) :: matrix
    !> This rank's rows, spread as the columns of the matrix
    real(wp), intent(in), contiguous :: block(:, :)
    !> This rank's rows, spread as those of the matrix
    real(wp), intent(out), contiguous :: product(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: interlaced
    type(tVec) :: x, y
    PetscScalar, pointer :: values(:)
    PetscInt :: together
    integer :: first, last

    ierr = 0
    if (size(block, 2) == 0) return
    together = min(most_together, size(block, 2))
    PetscCall(MatCreateMAIJ(matrix, together, interlaced, ierr))
    PetscCall(MatCreateVecs(interlaced, x, y, ierr))
    do first = 1, size(block, 2), together
      last = min(first + together - 1, size(block, 2))
      PetscCall(VecGetArray(x, values, ierr))
      call interlace(block(:, first:last), values)
      PetscCall(VecRestoreArray(x, values, ierr))
      PetscCall(MatMult(interlaced, x, y, ierr))
      PetscCall(VecGetArrayRead(y, values, ierr))
      call take_apart(values, product(:, first:last))
      PetscCall(VecRestoreArrayRead(y, values, ierr))
    end do
    PetscCall(VecDestroy(x, ierr))
    PetscCall(VecDestroy(y, ierr))
    PetscCall(MatDestroy(interlaced, ierr))
  end subroutine multiply_block

  !> Vectors side by side, row by row, and zeros where there is room for more.
  pure subroutine interlace(block, values)
    !> [rows, vectors]
    real(wp), intent(in), contiguous :: block(:, :)
    !> [vectors or more times rows]
    real(wp), intent(out) :: values(:)
    integer :: room, row, i

    room = size(values)/max(size(block, 1), 1)
    do row = 1, size(block, 1)
      do i = 1, size(block, 2)
        values((row - 1)*room + i) = block(row, i)
      end do
      values((row - 1)*room + size(block, 2) + 1:row*room) = 0.0_wp
    end do
  end subroutine interlace

  !> The vectors one by one.
  pure subroutine take_apart(values, block)
    !> [vectors or more times rows]
    real(wp), intent(in) :: values(:)
    !> [rows, vectors]
    real(wp), intent(out), contiguous :: block(:, :)
    integer :: room, row, i

    room = size(values)/max(size(block, 1), 1)
    do row = 1, size(block, 1)
      do i = 1, size(block, 2)
        block(row, i) = values((row - 1)*room + i)
      end do
    end do
  end subroutine take_apart

  !> Transpose of a sparse matrix times a block of vectors.
  subroutine multiply_transposed_block(matrix, block, product, ierr)
    !> Sparse
    type(tMat), intent(in) :: matrix
    !> This rank's rows, spread as those of the matrix
    real(wp), intent(in), contiguous, target :: block(:, :)
    !> This rank's rows, spread as the columns of the matrix
    real(wp), intent(out), contiguous, target :: product(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: factor, result
    PetscScalar, pointer :: values(:, :)
    PetscInt :: n

    PetscCall(MatGetSize(matrix, n, PETSC_NULL_INTEGER, ierr))
    PetscCall(wrap_rows(matrix, n, block, factor, ierr))
    PetscCall(MatTransposeMatMult(matrix, factor, MAT_INITIAL_MATRIX, PETSC_DEFAULT_REAL, result, ierr))
    PetscCall(MatDenseGetArray(result, values, ierr))
    product = values(:size(product, 1), :size(product, 2))
    PetscCall(MatDenseRestoreArray(result, values, ierr))
    PetscCall(MatDestroy(result, ierr))
    PetscCall(MatDestroy(factor, ierr))
  end subroutine multiply_transposed_block

  !> Fill a PETSc vector.
  subroutine put_vector(column, vector, ierr)
    !> This rank's rows
    real(wp), intent(in) :: column(:)
    !> PETSc vector
    type(tVec), intent(in) :: vector
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)

    PetscCall(VecGetArray(vector, values, ierr))
    values = column
    PetscCall(VecRestoreArray(vector, values, ierr))
  end subroutine put_vector

  !> Read a PETSc vector.
  subroutine take_vector(vector, column, ierr)
    !> PETSc vector
    type(tVec), intent(in) :: vector
    !> This rank's rows
    real(wp), intent(out) :: column(:)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)

    PetscCall(VecGetArrayRead(vector, values, ierr))
    column = values
    PetscCall(VecRestoreArrayRead(vector, values, ierr))
  end subroutine take_vector
end module attrito_reduce_dense_block
