#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Static corrections: one coordinate for each load or monitor inside the structure, so that the static response to it is exact.
!>
!> $$ s = K_{ii}^{-1} f_i, \qquad s \leftarrow s - \Phi \Phi^T M s, \qquad s \leftarrow s / \sqrt{s^T M s} $$
!>
!> Phi are the fixed-interface modes and the corrections before; a correction of which nothing is left is dropped. Since Phi and s
!> vanish on the boundary, M of the full model serves for M_ii.
!> Source: Craig & Chang, AIAA J. 14 (1976) 1633-1635, doi:10.2514/3.7264 (attachment modes).
module attrito_reduce_static_corrections
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: compute_static_responses, add_corrections

  !> Part of a correction's norm that must be left for it to be kept
  real(wp), parameter :: smallest_rest = 1.0e-8_wp

contains

  !> Static responses with the boundary held.
  subroutine compute_static_responses(split, factor, vectors, responses, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> Loads and monitors, this rank's rows of the full model
    real(wp), intent(in) :: vectors(:, :)
    !> This rank's rows of the full model, zero on the boundary, one a vector
    real(wp), allocatable, intent(out) :: responses(:, :)
    !> The solves failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: forces(:, :), solutions(:, :)
    PetscErrorCode :: ierr

    forces = vectors(split%interior_rows, :)
    allocate (solutions, mold=forces)
    call factor%solve(forces, solutions, ierr)
    call raise_petsc(error, ierr, 'computing the static corrections')
    allocate (responses(split%rows(), size(vectors, 2)), source=0.0_wp)
    responses(split%interior_rows, :) = solutions
  end subroutine compute_static_responses

  !> Append to the modes what each static response adds to them.
  subroutine add_corrections(split, mass, responses, basis, modes, kept, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Mass of the full model
    type(tMat), intent(in) :: mass
    !> Static responses [rows, vectors]
    real(wp), intent(in) :: responses(:, :)
    !> Columns of the basis from the first mode on, room for all corrections behind [rows, modes + vectors]
    real(wp), intent(inout) :: basis(:, :)
    !> Number of modes
    integer, intent(in) :: modes
    !> Number of corrections kept
    integer, intent(out) :: kept
    !> A product failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: s(:, :)
    real(wp) :: whole, rest
    integer :: i, pass
    PetscErrorCode :: ierr

    kept = 0
    ierr = 0
    do i = 1, size(responses, 2)
      s = responses(:, i:i)
      call norm_of(split, mass, s, whole, ierr)
      if (whole <= 0.0_wp) cycle
      s = s/whole
      do pass = 1, 2
        if (ierr == 0) call remove(split, mass, basis(:, :modes + kept), s, ierr)
      end do
      if (ierr == 0) call norm_of(split, mass, s, rest, ierr)
      call raise_petsc(error, ierr, 'orthogonalising the static corrections')
      if (allocated(error)) return
      if (rest < smallest_rest) cycle
      kept = kept + 1
      basis(:, modes + kept) = s(:, 1)/rest
    end do
  end subroutine add_corrections

  !> s <- s - Phi Phi^T M s.
  subroutine remove(split, mass, phi, s, ierr)
    type(split_type), intent(in) :: split
    type(tMat), intent(in) :: mass
    real(wp), intent(in) :: phi(:, :)
    real(wp), intent(inout), contiguous :: s(:, :)
    PetscErrorCode, intent(out) :: ierr
    real(wp) :: inertia(size(s, 1), 1), parts(size(phi, 2))

    PetscCall(multiply_block(mass, s, inertia, ierr))
    parts = matmul(inertia(:, 1), phi)
    call split%ranks%sum(parts)
    s(:, 1) = s(:, 1) - matmul(phi, parts)
  end subroutine remove

  !> sqrt(s^T M s).
  subroutine norm_of(split, mass, s, norm, ierr)
    type(split_type), intent(in) :: split
    type(tMat), intent(in) :: mass
    real(wp), intent(in), contiguous :: s(:, :)
    real(wp), intent(out) :: norm
    PetscErrorCode, intent(out) :: ierr
    real(wp) :: inertia(size(s, 1), 1)

    norm = 0.0_wp
    PetscCall(multiply_block(mass, s, inertia, ierr))
    norm = sum(s*inertia)
    call split%ranks%sum(norm)
    norm = sqrt(max(norm, 0.0_wp))
  end subroutine norm_of
end module attrito_reduce_static_corrections
