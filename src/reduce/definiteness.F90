#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Does the boundary hold the structure? K_ii must be positive definite.
!>
!> Pivots that are negative or zero say no. A rigid motion that rounding has hidden in a tiny pivot shows in a solve with known
!> answer: K_ii x = K_ii y gives x far from y.
module attrito_reduce_definiteness
  use petscmat
  use attrito_core_errors, only: error_type, fault_of_input, raise
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: check_definite

  !> Relative error of the solve above which the matrix counts as singular
  real(wp), parameter :: largest_error = 1.0e-3_wp

contains

  !> Raise an error that tells the user what moves freely.
  subroutine check_definite(split, stiffness, factor, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> K_ii
    type(tMat), intent(in) :: stiffness
    !> Its factors
    type(interior_factor_type), intent(in) :: factor
    !> A motion stays free, or the stiffness is negative
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: solve_error
    character(60) :: evidence
    PetscErrorCode :: ierr

    call try_solve(split, stiffness, factor, solve_error, ierr)
    call raise_petsc(error, ierr, 'testing the factors of the interior stiffness')
    if (allocated(error)) return
    if (factor%zero > 0 .or. solve_error > largest_error) then
      write (evidence, '(a, i0, a, es7.1, a)') '(', factor%zero, ' zero pivots, error of a test solve ', solve_error, ')'
      call raise(error, 'a rigid motion or mechanism stays free with the boundary held ' // trim(evidence) // &
                 ': constrain the model or add boundary nodes', fault_of_input)
    else if (factor%negative > 0) then
      write (evidence, '(a, i0, a)') '(', factor%negative, ' negative pivots)'
      call raise(error, 'the stiffness is not positive with the boundary held ' // trim(evidence) // &
                 ': is it really a stiffness, and is the structure stable under its static load?', fault_of_input)
    end if
  end subroutine check_definite

  !> Relative error of K_ii^{-1} (K_ii y) for a y without structure.
  subroutine try_solve(split, stiffness, factor, solve_error, ierr)
    type(split_type), intent(in) :: split
    type(tMat), intent(in) :: stiffness
    type(interior_factor_type), intent(in) :: factor
    real(wp), intent(out) :: solve_error
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: y(:, :), force(:, :), x(:, :)
    real(wp) :: sums(2)

    y = cos(0.9_wp*(reshape(real(split%interior_rows, wp), [size(split%interior_rows), 1]) + split%first)**2)
    allocate (force, x, mold=y)
    solve_error = 0.0_wp
    PetscCall(multiply_block(stiffness, y, force, ierr))
    PetscCall(factor%solve(force, x, ierr))
    sums = [sum((x - y)**2), sum(y**2)]
    call split%ranks%sum(sums)
    solve_error = sqrt(sums(1)/sums(2))
    if (.not. solve_error < huge(solve_error)) solve_error = huge(solve_error)
  end subroutine try_solve
end module attrito_reduce_definiteness
