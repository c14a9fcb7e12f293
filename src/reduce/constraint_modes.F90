#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Constraint modes: what the interior does at rest when one boundary dof moves by one and the others are held.
!>
!> $$ K_{ii} \Psi = -K_{ib} $$
!>
!> K_ib goes to MUMPS as sparse right-hand sides, a block of columns at a time. What is left of K_ib + K_ii Psi is measured; where
!> it is more than rounding, one step of iterative refinement follows, Psi <- Psi - K_ii^{-1} (K_ib + K_ii Psi).
!> Source: Craig & Bampton, AIAA J. 6 (1968) 1313-1319, doi:10.2514/3.4741.
module attrito_reduce_constraint_modes
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_split, only: boundary_rows_on_root, split_type
  implicit none
  private
  public :: compute_constraint_modes

  !> Relative residual that is left alone
  real(wp), parameter :: rounding = 1.0e-12_wp

contains

  !> Fill the first columns of the basis, one a boundary dof.
  subroutine compute_constraint_modes(split, stiffness, factor, block_size, basis, residual, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Stiffness of the full model
    type(tMat), intent(in) :: stiffness
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> Columns at a time
    integer, intent(in) :: block_size
    !> This rank's rows of the full model [rows, boundary dofs]
    real(wp), intent(out), contiguous :: basis(:, :)
    !> Largest entry of K_ib + K_ii Psi as solved, relative to the forces on the boundary
    real(wp), intent(out) :: residual
    !> The solves failed
    type(error_type), allocatable, intent(out) :: error
    integer :: first, last, i
    PetscErrorCode :: ierr

    basis = 0.0_wp
    do i = 1, size(split%boundary_rows)
      basis(split%boundary_rows(i), split%boundary_numbers(i)) = 1.0_wp
    end do
    residual = 0.0_wp
    do first = 1, split%boundary_count, block_size
      last = min(first + block_size - 1, split%boundary_count)
      call compute_columns(split, stiffness, factor, first, last, basis, ierr)
      if (ierr == 0) call refine_columns(split, stiffness, factor, basis(:, first:last), residual, ierr)
      call raise_petsc(error, ierr, 'computing the constraint modes')
      if (allocated(error)) return
    end do
  end subroutine compute_constraint_modes

  subroutine compute_columns(split, stiffness, factor, first, last, basis, ierr)
    type(split_type), intent(in) :: split
    type(tMat), intent(in) :: stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Columns, by number of the boundary dof
    integer, intent(in) :: first, last
    real(wp), intent(inout) :: basis(:, :)
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: rows
    real(wp), allocatable :: solutions(:, :)

    allocate (solutions(size(split%interior_rows), last - first + 1))
    PetscCall(boundary_rows_on_root(split, stiffness, first, last, rows, ierr))
    PetscCall(factor%solve_sparse(rows, solutions, ierr))
    PetscCall(MatDestroy(rows, ierr))
    basis(split%interior_rows, first:last) = -solutions
  end subroutine compute_columns

  subroutine refine_columns(split, stiffness, factor, columns, residual, ierr)
    type(split_type), intent(in) :: split
    type(tMat), intent(in) :: stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Columns of the basis
    real(wp), intent(inout), contiguous :: columns(:, :)
    !> Grows to the largest relative residual
    real(wp), intent(inout) :: residual
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: force(:, :), rest(:, :), correction(:, :)
    real(wp) :: here

    allocate (force, mold=columns)
    PetscCall(multiply_block(stiffness, columns, force, ierr))
    rest = force(split%interior_rows, :)
    here = split%ranks%largest(largest_entry(rest))/split%ranks%largest(largest_entry(force))
    residual = max(residual, here)
    if (here < rounding) return
    allocate (correction, mold=rest)
    PetscCall(factor%solve(rest, correction, ierr))
    columns(split%interior_rows, :) = columns(split%interior_rows, :) - correction
  end subroutine refine_columns

  pure real(wp) function largest_entry(a)
    real(wp), intent(in) :: a(:, :)

    largest_entry = 0.0_wp
    if (size(a) > 0) largest_entry = maxval(abs(a))
  end function largest_entry
end module attrito_reduce_constraint_modes
