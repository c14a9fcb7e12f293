#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Constraint modes: what the interior does at rest when one boundary dof moves by one and the others are held.
!>
!> $$ K_{ii} \Psi = -K_{ib} $$
!>
!> A block of columns at a time, K_bi goes to MUMPS as sparse right-hand sides and Psi to disk. What is left of K_ib + K_ii Psi is
!> measured; where it is more than rounding, one step of iterative refinement follows, Psi <- Psi - K_ii^{-1} (K_ib + K_ii Psi).
!> Source: Craig & Bampton, AIAA J. 6 (1968) 1313-1319, doi:10.2514/3.4741.
module attrito_reduce_constraint_modes
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_column_store, only: block_type, column_store_type
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_split, only: some_rows_on_root, split_type
  implicit none
  private
  public :: interior_stiffness_type, compute_constraint_modes

  !> Relative residual that is left alone
  real(wp), parameter :: rounding = 1.0e-12_wp ! derived

  type :: interior_stiffness_type
    !> K_ii, K_ib, and all rows of the boundary columns, spread over the ranks; K_bi on rank 0
    type(tMat) :: interior, coupling, columns, rows
  end type interior_stiffness_type

contains

  !> Compute and store the blocks that are not there yet.
  subroutine compute_constraint_modes(split, stiffness, factor, blocks, store, progress, residual, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Its blocks
    type(interior_stiffness_type), intent(in) :: stiffness
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> Runs of boundary dofs
    type(block_type), intent(in) :: blocks(:)
    !> Where the modes go
    type(column_store_type), intent(in) :: store
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> Grows to the largest entry of K_ib + K_ii Psi as solved, relative to that of K_ib
    real(wp), intent(inout) :: residual
    !> The solves failed, or the disk is full
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer :: i
    PetscErrorCode :: ierr

    do i = 1, size(blocks)
      if (store%has(blocks(i))) cycle
      call progress%step('constraint modes', blocks(i)%first - 1, split%boundary_count)
      allocate (columns(split%rows(), blocks(i)%columns()))
      call compute_block(split, stiffness, factor, blocks(i), columns, residual, ierr)
      call raise_petsc(error, ierr, 'computing the constraint modes')
      if (.not. allocated(error)) call store%put(split, blocks(i), columns, error)
      if (allocated(error)) return
      deallocate (columns)
    end do
    call progress%step('constraint modes', split%boundary_count, split%boundary_count)
  end subroutine compute_constraint_modes

  subroutine compute_block(split, stiffness, factor, block, columns, residual, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Stiffness of the interior and its factor
    type(interior_stiffness_type), intent(in) :: stiffness
    !> Factor of the interior stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Columns that are stored together
    type(block_type), intent(in) :: block
    !> This rank's rows of the full model
    real(wp), intent(out) :: columns(:, :)
    !> Relative residuals
    real(wp), intent(inout) :: residual
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: rows
    real(wp), allocatable :: psi(:, :), unit(:, :)
    PetscReal :: coupled

    allocate (psi(size(split%interior_rows), block%columns()), source=0.0_wp)
    PetscCall(some_rows_on_root(split, stiffness%rows, block%first, block%last, rows, ierr))
    PetscCall(MatNorm(rows, NORM_FROBENIUS, coupled, ierr))
    ! Right-hand sides without an entry are none to MUMPS.
    if (coupled > 0.0_wp) then
      PetscCall(factor%solve_sparse(rows, psi, ierr))
    end if
    PetscCall(MatDestroy(rows, ierr))
    psi = -psi
    unit = unit_columns(split, block)
    call refine(split, stiffness, factor, unit, psi, residual, ierr)
    columns(split%boundary_rows, :) = unit
    columns(split%interior_rows, :) = psi
  end subroutine compute_block

  !> This rank's boundary rows of the block: one where the boundary dof is that of the column.
  pure function unit_columns(split, block) result(unit)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Columns that are stored together
    type(block_type), intent(in) :: block
    real(wp) :: unit(size(split%boundary_rows), block%columns())
    integer :: i

    unit = 0.0_wp
    do i = 1, size(unit, 1)
      associate (column => split%boundary_numbers(i) - block%first + 1)
        if (column >= 1 .and. column <= size(unit, 2)) unit(i, column) = 1.0_wp
      end associate
    end do
  end function unit_columns

  subroutine refine(split, stiffness, factor, unit, psi, residual, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Stiffness of the interior and its factor
    type(interior_stiffness_type), intent(in) :: stiffness
    !> Factor of the interior stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Columns of unit displacements
    real(wp), intent(in), contiguous :: unit(:, :)
    !> Constraint modes, a column each
    real(wp), intent(inout), contiguous :: psi(:, :)
    !> Grows to the largest relative residual
    real(wp), intent(inout) :: residual
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: force(:, :), rest(:, :)
    real(wp) :: largest, here

    allocate (force, rest, mold=psi)
    PetscCall(multiply_block(stiffness%coupling, unit, force, ierr))
    largest = split%ranks%largest(largest_entry(force))
    PetscCall(multiply_block(stiffness%interior, psi, rest, ierr))
    rest = rest + force
    ! A boundary dof that is tied to nothing inside has no force and no motion.
    if (largest <= 0.0_wp) return
    here = split%ranks%largest(largest_entry(rest))/largest
    residual = max(residual, here)
    if (here < rounding) return
    PetscCall(factor%solve(rest, force, ierr))
    psi = psi - force
  end subroutine refine

  pure real(wp) function largest_entry(a)
    !> Columns, this rank's rows
    real(wp), intent(in) :: a(:, :)

    largest_entry = 0.0_wp
    if (size(a) > 0) largest_entry = maxval(abs(a))
  end function largest_entry
end module attrito_reduce_constraint_modes
