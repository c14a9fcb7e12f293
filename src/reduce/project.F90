#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Projection of a matrix on the basis, one block of columns at a time, exactly symmetric.
!>
!> $$ \tilde A = T^T A T $$
!>
!> A T of a stiffness is small beside its terms wherever T moves neighbours alike, as constraint modes of a long body do: rounding of the
!> terms would leave the lowest frequencies uncertain by some 1e-10, differently on each number of ranks. So A and T may come as sums of
!> slices of few bits, whose leading product is exact in any order of summation.
!> Source: Ozaki, Ogita, Oishi & Rump 2012, doi:10.1007/s11075-011-9478-1.
module attrito_reduce_project
  use petscmat
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_model_matrix, only: leading_bits
  implicit none
  private
  public :: project_matrix, project_vectors

contains

  !> Project a matrix; only the upper triangle is computed, the lower one is its image.
  subroutine project_matrix(ranks, slices, basis, block_size, reduced, error)
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> Symmetric matrix of the full model, as a sum of slices
    type(tMat), intent(in) :: slices(:)
    !> T: this rank's rows [rows, m]
    real(wp), intent(in), contiguous :: basis(:, :)
    !> Columns at a time
    integer, intent(in) :: block_size
    !> [m, m], the same on every rank
    real(wp), allocatable, intent(out) :: reduced(:, :)
    !> A product failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: product(:, :)
    integer :: m, first, last, i
    PetscErrorCode :: ierr

    m = size(basis, 2)
    allocate (reduced(m, m), source=0.0_wp)
    do first = 1, m, block_size
      last = min(first + block_size - 1, m)
      allocate (product(size(basis, 1), last - first + 1))
      call multiply_slices(ranks, slices, basis(:, first:last), product, ierr)
      call raise_petsc(error, ierr, 'projecting a matrix on the basis')
      if (allocated(error)) return
      reduced(:last, first:last) = transposed_product(basis(:, :last), product)
      deallocate (product)
    end do
    call ranks%sum(reduced)
    do i = 1, m
      reduced(i + 1:, i) = reduced(i, i + 1:)
    end do
  end subroutine project_matrix

  !> A T, the products of smaller slices first.
  subroutine multiply_slices(ranks, slices, block, product, ierr)
    type(communicator_type), intent(in) :: ranks
    type(tMat), intent(in) :: slices(:)
    real(wp), intent(in), contiguous :: block(:, :)
    real(wp), intent(out), contiguous :: product(:, :)
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: leading(:, :), part(:, :)
    integer :: i

    if (size(slices) == 1) then
      call multiply_block(slices(1), block, product, ierr)
      return
    end if
    allocate (leading, part, mold=block)
    do i = 1, size(block, 2)
      leading(:, i) = leading_bits(block(:, i), ranks%largest(maxval([0.0_wp, abs(block(:, i))])))
    end do
    product = 0.0_wp
    do i = size(slices), 1, -1
      call multiply_block(slices(i), block - leading, part, ierr)
      if (ierr /= 0) return
      product = product + part
    end do
    do i = size(slices), 1, -1
      call multiply_block(slices(i), leading, part, ierr)
      if (ierr /= 0) return
      product = product + part
    end do
  end subroutine multiply_slices

  !> Project loads and monitors: T^T f.
  subroutine project_vectors(ranks, vectors, basis, reduced)
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> This rank's rows [rows, vectors]
    real(wp), intent(in), contiguous :: vectors(:, :)
    !> T: this rank's rows [rows, m]
    real(wp), intent(in), contiguous :: basis(:, :)
    !> [m, vectors], the same on every rank
    real(wp), allocatable, intent(out) :: reduced(:, :)

    reduced = transposed_product(basis, vectors)
    call ranks%sum(reduced)
  end subroutine project_vectors

  !> a^T b by BLAS, which matmul of a transpose is slower than.
  function transposed_product(a, b) result(c)
    real(wp), intent(in), contiguous :: a(:, :), b(:, :)
    real(wp) :: c(size(a, 2), size(b, 2))
    interface
      subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
        import :: wp
        character, intent(in) :: transa, transb
        integer, intent(in) :: m, n, k, lda, ldb, ldc
        real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
        real(wp), intent(inout) :: c(ldc, *)
      end subroutine dgemm
    end interface

    c = 0.0_wp
    if (size(c) == 0 .or. size(a, 1) == 0) return
    call dgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_wp, a, size(a, 1), b, size(b, 1), 0.0_wp, c, size(a, 2))
  end function transposed_product
end module attrito_reduce_project
