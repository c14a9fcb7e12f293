#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Proof that no mode was missed: the pivots of K_ii - sigma M_ii that are negative count the eigenvalues below sigma.
!>
!> $$ K_{ii} - \sigma M_{ii} = L D L^T $$
module attrito_reduce_inertia_check
  use petscmat
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_fixed_interface_modes, only: fixed_interface_modes_type
  use attrito_reduce_interior_factor, only: factor_options_type, interior_factor_type, new_interior_factor
  use attrito_reduce_progress, only: progress_type
  implicit none
  private
  public :: check_count, count_modes_up_to

contains

  !> Number of modes up to a frequency.
  subroutine count_modes_up_to(stiffness, mass, frequency_hz, options, progress, modes, error)
    !> K_ii and M_ii
    type(tMat), intent(in) :: stiffness, mass
    !> Frequency in Hz
    real(wp), intent(in) :: frequency_hz
    !> How to factor
    type(factor_options_type), intent(in) :: options
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> Modes below it
    integer, intent(out) :: modes
    !> The factorisation failed
    type(error_type), allocatable, intent(out) :: error
    type(tMat) :: shifted
    real(wp) :: shift
    integer :: zero_pivots, i
    PetscErrorCode :: ierr

    modes = 0
    shift = (two_pi*frequency_hz)**2
    do i = 1, 2
      call MatDuplicate(stiffness, MAT_COPY_VALUES, shifted, ierr)
      if (ierr == 0) call subtract(shifted, mass, shift, ierr)
      call raise_petsc(error, ierr, 'shifting the stiffness')
      if (.not. allocated(error)) call count_negative(shifted, options, progress, modes, zero_pivots, error)
      call MatDestroy(shifted, ierr)
      if (allocated(error) .or. zero_pivots == 0) return
      ! A mode lies exactly there: count it too.
      shift = shift*(1.0_wp + 1.0e-8_wp)
    end do
  end subroutine count_modes_up_to

  !> Raise an error if modes were missed. To spare memory K_ii is turned into the shifted matrix, and M_ii is released.
  subroutine check_count(stiffness, mass, modes, options, progress, counted, error)
    !> K_ii and M_ii, of no use afterwards
    type(tMat), intent(inout) :: stiffness, mass
    !> The modes found, and the shift in a gap between them
    type(fixed_interface_modes_type), intent(in) :: modes
    !> How to factor
    type(factor_options_type), intent(in) :: options
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> Modes below the shift by inertia
    integer, intent(out) :: counted
    !> Not the number that was found
    type(error_type), allocatable, intent(out) :: error
    integer :: zero_pivots
    character(120) :: text
    PetscErrorCode :: ierr

    counted = 0
    call subtract(stiffness, mass, modes%shift, ierr)
    if (ierr == 0) call MatDestroy(mass, ierr)
    call raise_petsc(error, ierr, 'shifting the stiffness')
    if (.not. allocated(error)) call count_negative(stiffness, options, progress, counted, zero_pivots, error)
    if (allocated(error) .or. counted == modes%below_shift) return
    write (text, '(a, i0, a, i0, a, es12.6, a)') 'the eigensolver found ', modes%below_shift, ' of ', counted, &
      ' fixed-interface modes below ', sqrt(modes%shift)/two_pi, ' Hz'
    call raise(error, trim(text) // ': ask for a few modes more or fewer')
  end subroutine check_count

  !> Negative pivots of a matrix, by a factorisation of its own; zero ones say that the number is not to be trusted.
  subroutine count_negative(matrix, options, progress, negative, zero, error)
    !> Matrix, spread over the ranks
    type(tMat), intent(in) :: matrix
    !> How to factor
    type(factor_options_type), intent(in) :: options
    !> Reports progress
    type(progress_type), intent(in) :: progress
    !> Number of negative pivots; number of pivots that are zero
    integer, intent(out) :: negative, zero
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(interior_factor_type) :: factor

    call new_interior_factor(factor, matrix, options, progress, error)
    negative = factor%negative
    zero = factor%zero
    call factor%destroy()
  end subroutine count_negative

  !> K <- K - shift M.
  subroutine subtract(stiffness, mass, shift, ierr)
    !> Stiffness matrix of the interior
    type(tMat), intent(inout) :: stiffness
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    real(wp), intent(in) :: shift
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr

    PetscCall(MatAXPY(stiffness, -shift, mass, DIFFERENT_NONZERO_PATTERN, ierr))
    PetscCall(MatSetOption(stiffness, MAT_SYMMETRIC, PETSC_TRUE, ierr))
  end subroutine subtract
end module attrito_reduce_inertia_check
