#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Projection of matrices on the basis, whose columns are on disk, a panel of them at a time; exactly symmetric, or skew.
!>
!> $$ \tilde A = T^T A T $$
!>
!> A panel's products A T stay in memory while all columns before it are read once and multiplied with them.
!>
!> A T of a stiffness is small beside its terms wherever T moves neighbours alike, as constraint modes of a long body do: rounding of
!> the terms would leave the lowest frequencies uncertain by some 1e-10, differently on each number of ranks. So A and T may come as
!> sums of slices of few bits, whose leading product is exact in any order of summation. Of constraint modes the interior rows of
!> A T are then a residual, small enough to be multiplied in single precision:
!>
!> $$ \tilde K = K_{bb} + K_{bi} \Psi + \Psi^T (K_{ib} + K_{ii} \Psi) $$
!>
!> Source: Ozaki, Ogita, Oishi & Rump 2012, doi:10.1007/s11075-011-9478-1.
module attrito_reduce_project
  use petscmat
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack, only: transposed_product
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_column_store, only: block_type, column_store_type
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_model_matrix, only: leading_bits
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: projected_type, project_matrices, project_vectors

  !> Part of the largest number of A T below which single precision leaves less of a residual than double of the rest
  real(wp), parameter :: light = 1.0e-10_wp ! derived

  !> A matrix of the full model and its projection
  type :: projected_type
    !> As a sum of slices; symmetric, or skew as that of Coriolis forces is
    type(tMat), allocatable :: slices(:)
    logical :: is_skew = .false.
    !> [m, m], the same on every rank
    real(wp), allocatable :: reduced(:, :)
    !> This rank's rows of A T for the columns of a panel
    real(wp), allocatable, private :: product(:, :)
    !> Interior rows of the first of these columns, where they are light
    real(sp), allocatable, private :: residual(:, :)
  end type projected_type

contains

  !> Project matrices; only the upper triangles are computed, the lower ones are their images.
  subroutine project_matrices(split, blocks, store, panel, progress, matrices, error)
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> All columns of T, in order
    type(block_type), intent(in) :: blocks(:)
    !> Where they are
    type(column_store_type), intent(in) :: store
    !> Columns in a panel, at least
    integer, intent(in) :: panel
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> With their slices; the projections are added
    type(projected_type), intent(inout) :: matrices(:)
    !> A product failed, or columns are gone
    type(error_type), allocatable, intent(out) :: error
    integer :: offsets(size(blocks) + 1), i, first, last

    offsets = [0, (sum(blocks(:i)%last - blocks(:i)%first + 1), i=1, size(blocks))]
    do i = 1, size(matrices)
      allocate (matrices(i)%reduced(offsets(size(offsets)), offsets(size(offsets))), source=0.0_wp)
    end do
    first = 1
    do while (first <= size(blocks))
      last = first
      do while (last < size(blocks))
        if (offsets(last + 1) - offsets(first) >= panel) exit
        last = last + 1
      end do
      call progress%step('projection', offsets(first), offsets(size(offsets)))
      call multiply_panel(split, blocks, store, offsets, first, last, matrices, error)
      if (.not. allocated(error)) call project_panel(split, blocks, store, offsets, first, last, matrices, error)
      if (allocated(error)) return
      first = last + 1
    end do
    do i = 1, size(matrices)
      call complete(split%ranks, matrices(i)%reduced, merge(-1.0_wp, 1.0_wp, matrices(i)%is_skew))
    end do
    call progress%step('projection', offsets(size(offsets)), offsets(size(offsets)))
  end subroutine project_matrices

  !> Sums over ranks, and the lower triangle, A^T = sign A.
  subroutine complete(ranks, reduced, sign)
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> Matrix of the reduced model
    real(wp), intent(inout), contiguous :: reduced(:, :)
    !> 1, or -1 of a skew matrix
    real(wp), intent(in) :: sign
    integer :: i

    call ranks%sum(reduced)
    do i = 1, size(reduced, 1)
      reduced(i + 1:, i) = sign*reduced(i, i + 1:)
      if (sign < 0.0_wp) reduced(i, i) = 0.0_wp
    end do
  end subroutine complete

  !> A T for the columns of a panel.
  subroutine multiply_panel(split, blocks, store, offsets, first, last, matrices, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Columns that are stored together
    type(block_type), intent(in) :: blocks(:)
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    !> Where the columns of each block begin; first of the columns; last of the columns
    integer, intent(in) :: offsets(:), first, last
    !> Matrices and their projections
    type(projected_type), intent(inout) :: matrices(:)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer :: i, k
    PetscErrorCode :: ierr

    do k = 1, size(matrices)
      if (allocated(matrices(k)%product)) deallocate (matrices(k)%product)
      allocate (matrices(k)%product(split%rows(), offsets(last + 1) - offsets(first)))
    end do
    do i = first, last
      allocate (columns(split%rows(), blocks(i)%columns()))
      call store%get(split, blocks(i), columns, error)
      if (allocated(error)) return
      do k = 1, size(matrices)
        call multiply_slices(split%ranks, matrices(k)%slices, columns, &
                             matrices(k)%product(:, offsets(i) - offsets(first) + 1:offsets(i + 1) - offsets(first)), ierr)
        call raise_petsc(error, ierr, 'projecting a matrix on the basis')
        if (allocated(error)) return
      end do
      deallocate (columns)
    end do
    do k = 1, size(matrices)
      call set_residual(split, offsets(first:last + 1) - offsets(first), matrices(k))
    end do
  end subroutine multiply_panel

  !> Interior rows of the first blocks of a panel in which they are light.
  subroutine set_residual(split, offsets, matrix)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Where the columns of each block begin in the panel, and where the last ends
    integer, intent(in) :: offsets(:)
    !> With its product
    type(projected_type), intent(inout) :: matrix
    real(wp) :: largest
    integer :: i, columns

    columns = 0
    do i = 1, size(offsets) - 1
      associate (block => matrix%product(:, offsets(i) + 1:offsets(i + 1)))
        largest = split%ranks%largest(maxval([0.0_wp, maxval(abs(block))]))
        if (split%ranks%largest(maxval([0.0_wp, maxval(abs(block(split%interior_rows, :)))])) > light*largest) exit
      end associate
      columns = offsets(i + 1)
    end do
    matrix%residual = real(matrix%product(split%interior_rows, :columns), sp)
  end subroutine set_residual

  !> T^T (A T) for the columns of a panel and all columns up to its end.
  subroutine project_panel(split, blocks, store, offsets, first, last, matrices, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Columns that are stored together
    type(block_type), intent(in) :: blocks(:)
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    !> Where the columns of each block begin; first of the columns; last of the columns
    integer, intent(in) :: offsets(:), first, last
    !> Matrices and their projections
    type(projected_type), intent(inout) :: matrices(:)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer :: i, k, skipped

    do i = 1, last
      allocate (columns(split%rows(), blocks(i)%columns()))
      call store%get(split, blocks(i), columns, error)
      if (allocated(error)) return
      skipped = offsets(max(first, i)) - offsets(first)
      do k = 1, size(matrices)
        call project_columns(split, columns, matrices(k), skipped, &
                             matrices(k)%reduced(offsets(i) + 1:offsets(i + 1), offsets(first) + 1:offsets(last + 1)))
      end do
      deallocate (columns)
    end do
  end subroutine project_panel

  !> Some columns of T, transposed, times those of A T in a panel but the first few.
  subroutine project_columns(split, columns, matrix, skipped, reduced)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Of T, this rank's rows
    real(wp), intent(in), contiguous :: columns(:, :)
    !> With its product
    type(projected_type), intent(in) :: matrix
    !> Columns of the panel that are left out
    integer, intent(in) :: skipped
    !> Of the projection, all columns of the panel
    real(wp), intent(inout) :: reduced(:, :)
    integer :: heavy

    heavy = max(skipped, size(matrix%residual, 2))
    reduced(:, heavy + 1:) = transposed_product(columns, matrix%product(:, heavy + 1:))
    if (heavy == skipped) return
    reduced(:, skipped + 1:heavy) = transposed_product(columns(split%boundary_rows, :), &
                                                       matrix%product(split%boundary_rows, skipped + 1:heavy))
    reduced(:, skipped + 1:heavy) = reduced(:, skipped + 1:heavy) &
                                    + transposed_product(real(columns(split%interior_rows, :), sp), &
                                                         matrix%residual(:, skipped + 1:heavy))
  end subroutine project_columns

  !> A T, the products of smaller slices first.
  subroutine multiply_slices(ranks, slices, block, product, ierr)
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> PETSc matrix
    type(tMat), intent(in) :: slices(:)
    !> Block of the matrix, by harmonic
    real(wp), intent(in), contiguous :: block(:, :)
    !> Product, this rank's rows
    real(wp), intent(out), contiguous :: product(:, :)
    !> PETSc's error code
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
    do i = size(slices), 2, -1
      call multiply_block(slices(i), block, part, ierr)
      if (ierr /= 0) return
      product = product + part
    end do
    call multiply_block(slices(1), block - leading, part, ierr)
    if (ierr /= 0) return
    product = product + part
    call multiply_block(slices(1), leading, part, ierr)
    product = product + part
  end subroutine multiply_slices

  !> Project loads and monitors: T^T f.
  subroutine project_vectors(split, blocks, store, vectors, reduced, error)
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> All columns of T, in order
    type(block_type), intent(in) :: blocks(:)
    !> Where they are
    type(column_store_type), intent(in) :: store
    !> This rank's rows [rows, vectors]
    real(wp), intent(in), contiguous :: vectors(:, :)
    !> [m, vectors], the same on every rank
    real(wp), allocatable, intent(out) :: reduced(:, :)
    !> Columns are gone
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer :: i, offset

    allocate (reduced(sum(blocks%last - blocks%first + 1), size(vectors, 2)), source=0.0_wp)
    offset = 0
    do i = 1, size(blocks)
      if (size(vectors, 2) == 0) return
      allocate (columns(split%rows(), blocks(i)%columns()))
      call store%get(split, blocks(i), columns, error)
      if (allocated(error)) return
      reduced(offset + 1:offset + blocks(i)%columns(), :) = transposed_product(columns, vectors)
      offset = offset + blocks(i)%columns()
      deallocate (columns)
    end do
    call split%ranks%sum(reduced)
  end subroutine project_vectors
end module attrito_reduce_project
