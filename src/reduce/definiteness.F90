#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Does the boundary hold the structure? K_ii must be positive definite.
!>
!> Pivots that are negative or zero say no. A rigid motion that rounding hides in a tiny pivot shows in the smallest eigenvalue
!> of K_ii scaled by its diagonal D, by inverse iteration: some 1e-16 where a motion is free, 1e-7 for a sound blade.
!>
!> $$ z \leftarrow K_{ii}^{-1} D z, \qquad \lambda = \frac{z^T K_{ii} z}{z^T D z} $$
module attrito_reduce_definiteness
  use petscmat
  use attrito_core_errors, only: error_type, fault_of_input, raise
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: check_definite, get_diagonal

  !> Smallest eigenvalue below which the matrix counts as singular
  real(wp), parameter :: rounding = 1.0e-13_wp ! derived
  integer, parameter :: iterations = 4 ! conventional

contains

  !> Raise an error that says what moves freely.
  subroutine check_definite(split, stiffness, factor, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> K_ii
    type(tMat), intent(in) :: stiffness
    !> Its factors
    type(interior_factor_type), intent(in) :: factor
    !> A motion stays free, or the stiffness is negative
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: smallest
    character(60) :: evidence
    PetscErrorCode :: ierr

    call find_smallest(split, stiffness, factor, smallest, ierr)
    call raise_petsc(error, ierr, 'testing the factors of the interior stiffness')
    if (allocated(error)) return
    if (factor%zero > 0 .or. abs(smallest) < rounding) then
      write (evidence, '(a, i0, a, es7.1, a)') '(', factor%zero, ' zero pivots, smallest eigenvalue ', abs(smallest), ')'
      call raise(error, 'stiffness: a rigid motion or mechanism stays free with the boundary held ' // trim(evidence) // &
                 ': expected a constrained model, or more nodes in [reduction] boundary', fault_of_input)
    else if (factor%negative > 0) then
      write (evidence, '(a, i0, a)') '(', factor%negative, ' negative pivots)'
      call raise(error, 'stiffness: not positive with the boundary held ' // trim(evidence) // &
                 ': expected that of a structure which is stable under its static load', fault_of_input)
    end if
  end subroutine check_definite

  !> Smallest eigenvalue of K_ii z = lambda D z, D its diagonal.
  subroutine find_smallest(split, stiffness, factor, smallest, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Stiffness matrix of the interior
    type(tMat), intent(in) :: stiffness
    !> Factor of the interior stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Smallest eigenvalue
    real(wp), intent(out) :: smallest
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    real(wp), dimension(size(split%interior_rows)) :: diagonal
    real(wp), dimension(size(split%interior_rows), 1) :: y, z
    real(wp) :: sums(2)
    integer :: i

    smallest = 0.0_wp
    PetscCall(get_diagonal(stiffness, diagonal, ierr))
    z(:, 1) = cos(0.9_wp*real(split%first + split%interior_rows, wp)**2)
    do i = 1, iterations
      y(:, 1) = diagonal*z(:, 1)
      PetscCall(factor%solve(y, z, ierr))
      sums = [sum(z*y), sum(diagonal*z(:, 1)**2)]
      call split%ranks%sum(sums)
      ! A zero pivot can leave what is no number; the smallest eigenvalue stays zero then.
      if (.not. sums(2) < huge(sums) .or. sums(2) <= 0.0_wp) return
      z = z/sqrt(sums(2))
    end do
    smallest = sums(1)/sums(2)
  end subroutine find_smallest

  !> The diagonal of a matrix.
  subroutine get_diagonal(matrix, diagonal, ierr)
    !> Matrix, spread over the ranks
    type(tMat), intent(in) :: matrix
    !> Diagonal, this rank's rows
    real(wp), intent(out) :: diagonal(:)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tVec) :: vector
    PetscScalar, pointer :: values(:)

    PetscCall(MatCreateVecs(matrix, PETSC_NULL_VEC, vector, ierr))
    PetscCall(MatGetDiagonal(matrix, vector, ierr))
    PetscCall(VecGetArrayRead(vector, values, ierr))
    diagonal = values
    PetscCall(VecRestoreArrayRead(vector, values, ierr))
    PetscCall(VecDestroy(vector, ierr))
  end subroutine get_diagonal
end module attrito_reduce_definiteness
