#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> K_ii by its factors and M_ii, as the eigensolver sees them.
module attrito_reduce_interior_pencil
  use petscmat
  use attrito_core_kinds, only: wp
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_pencil, only: pencil_type
  use attrito_reduce_progress, only: progress_type
  implicit none
  private
  public :: interior_pencil_type

  type, extends(pencil_type) :: interior_pencil_type
    !> M_ii, borrowed
    type(tMat) :: mass_matrix
    !> Factors of K_ii, borrowed
    type(interior_factor_type) :: factor
    !> Who listens, and how many modes are wanted
    type(progress_type) :: progress
    integer :: wanted = 0
  contains
    procedure :: solve
    procedure :: mass
    procedure :: report
  end type interior_pencil_type

contains

  !> y = K^-1 x.
  subroutine solve(self, x, y, status)
    class(interior_pencil_type), intent(in) :: self
    !> This rank's rows
    real(wp), intent(in), contiguous :: x(:, :)
    !> Coefficients in the reduced coordinates
    real(wp), intent(out), contiguous :: y(:, :)
    !> PETSc's error code
    integer, intent(out) :: status

    call self%factor%solve(x, y, status)
  end subroutine solve

  !> y = M x.
  subroutine mass(self, x, y, status)
    class(interior_pencil_type), intent(in) :: self
    !> This rank's rows
    real(wp), intent(in), contiguous :: x(:, :)
    !> Coefficients in the reduced coordinates
    real(wp), intent(out), contiguous :: y(:, :)
    !> PETSc's error code
    integer, intent(out) :: status

    call multiply_block(self%mass_matrix, x, y, status)
  end subroutine mass

  !> Tell how many modes have converged.
  subroutine report(self, converged)
    class(interior_pencil_type), intent(in) :: self
    !> How many have converged
    integer, intent(in) :: converged

    call self%progress%step('fixed-interface modes', min(converged, self%wanted), self%wanted)
  end subroutine report
end module attrito_reduce_interior_pencil
