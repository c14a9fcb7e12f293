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
  use attrito_reduce_interior_factor, only: interior_factor_type, new_interior_factor
  implicit none
  private
  public :: check_count, count_modes_up_to

contains

  !> Number of modes up to a frequency.
  subroutine count_modes_up_to(stiffness, mass, frequency_hz, modes, error)
    !> K_ii and M_ii
    type(tMat), intent(in) :: stiffness, mass
    !> Frequency in Hz
    real(wp), intent(in) :: frequency_hz
    !> Modes below it
    integer, intent(out) :: modes
    !> The factorisation failed
    type(error_type), allocatable, intent(out) :: error
    integer :: zero_pivots

    call count_modes_below(stiffness, mass, (two_pi*frequency_hz)**2, modes, zero_pivots, error)
    if (allocated(error) .or. zero_pivots == 0) return
    ! A mode lies exactly there: count it too.
    call count_modes_below(stiffness, mass, (two_pi*frequency_hz)**2*(1.0_wp + 1.0e-8_wp), modes, zero_pivots, error)
  end subroutine count_modes_up_to

  !> Raise an error if modes were missed.
  subroutine check_count(stiffness, mass, modes, counted, error)
    !> K_ii and M_ii
    type(tMat), intent(in) :: stiffness, mass
    !> The modes found, and the shift in a gap between them
    type(fixed_interface_modes_type), intent(in) :: modes
    !> Modes below the shift by inertia
    integer, intent(out) :: counted
    !> Not the number that was found
    type(error_type), allocatable, intent(out) :: error
    integer :: zero_pivots
    character(120) :: text

    call count_modes_below(stiffness, mass, modes%shift, counted, zero_pivots, error)
    if (allocated(error) .or. counted == modes%below_shift) return
    write (text, '(a, i0, a, i0, a, es12.6, a)') 'the eigensolver found ', modes%below_shift, ' of ', counted, &
      ' fixed-interface modes below ', sqrt(modes%shift)/two_pi, ' Hz'
    call raise(error, trim(text) // ': ask for a few modes more or fewer')
  end subroutine check_count

  !> Number of eigenvalues below a shift, by a factorisation of its own.
  subroutine count_modes_below(stiffness, mass, shift, modes, zero_pivots, error)
    !> K_ii and M_ii
    type(tMat), intent(in) :: stiffness, mass
    !> sigma
    real(wp), intent(in) :: shift
    !> Number of negative pivots
    integer, intent(out) :: modes
    !> Not zero: the shift hits an eigenvalue, and the number is not to be trusted
    integer, intent(out) :: zero_pivots
    !> The factorisation failed
    type(error_type), allocatable, intent(out) :: error
    type(interior_factor_type) :: factor
    type(tMat) :: shifted
    PetscErrorCode :: ierr

    modes = 0
    zero_pivots = 0
    call subtract(stiffness, mass, shift, shifted, ierr)
    call raise_petsc(error, ierr, 'shifting the stiffness')
    if (allocated(error)) return
    call new_interior_factor(factor, shifted, error)
    modes = factor%negative
    zero_pivots = factor%zero
    call factor%destroy()
    call MatDestroy(shifted, ierr)
  end subroutine count_modes_below

  subroutine subtract(stiffness, mass, shift, shifted, ierr)
    type(tMat), intent(in) :: stiffness, mass
    real(wp), intent(in) :: shift
    type(tMat), intent(out) :: shifted
    PetscErrorCode, intent(out) :: ierr

    PetscCall(MatDuplicate(stiffness, MAT_COPY_VALUES, shifted, ierr))
    PetscCall(MatAXPY(shifted, -shift, mass, DIFFERENT_NONZERO_PATTERN, ierr))
    PetscCall(MatSetOption(shifted, MAT_SYMMETRIC, PETSC_TRUE, ierr))
  end subroutine subtract
end module attrito_reduce_inertia_check
