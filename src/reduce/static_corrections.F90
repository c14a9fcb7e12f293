#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Static corrections: one coordinate for each load or monitor inside the structure, so that the static response to it is exact.
!>
!> $$ s = K_{ii}^{-1} f_i, \qquad s \leftarrow s - \Phi \Phi^T M s, \qquad s \leftarrow s / \sqrt{s^T M s} $$
!>
!> Phi are the fixed-interface modes, read from disk a block at a time, and the corrections before; a correction of which nothing is
!> left is dropped. Since Phi and s vanish on the boundary, M of the full model serves for M_ii.
!> Source: Craig & Chang, AIAA J. 14 (1976) 1633-1635, doi:10.2514/3.7264 (attachment modes).
module attrito_reduce_static_corrections
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: transposed_product
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_column_store, only: block_type, column_store_type
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: compute_static_responses, make_corrections

  !> Part of a correction's norm that must be left for it to be kept
  real(wp), parameter :: smallest_rest = 1.0e-8_wp ! guess

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

  !> What the static responses add to the modes: orthonormal in mass to them and to each other.
  subroutine make_corrections(split, mass, modes, store, responses, kept, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Mass of the full model
    type(tMat), intent(in) :: mass
    !> The modes' blocks, and where they are
    type(block_type), intent(in) :: modes(:)
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    !> Static responses [rows, vectors]; the first `kept` are corrections afterwards
    real(wp), intent(inout), contiguous :: responses(:, :)
    !> Number of corrections kept
    integer, intent(out) :: kept
    !> A product failed
    type(error_type), allocatable, intent(out) :: error
    integer :: i
    PetscErrorCode :: ierr

    kept = 0
    if (size(responses, 2) == 0) return
    do i = 1, size(responses, 2)
      call scale_to_unit(split, mass, responses(:, i:i), ierr)
      call raise_petsc(error, ierr, 'orthogonalising the static corrections')
      if (allocated(error)) return
    end do
    ! Twice is enough (Kahan and Parlett); once more for what little is left of some.
    call remove_modes(split, mass, modes, store, 2, responses, error)
    if (allocated(error)) return
    call keep_independent(split, mass, responses, kept, error)
    if (.not. allocated(error)) call remove_modes(split, mass, modes, store, 1, responses(:, :kept), error)
    do i = 1, kept
      if (allocated(error)) return
      call remove(split, mass, responses(:, :i - 1), responses(:, i:i), ierr)
      if (ierr == 0) call scale_to_unit(split, mass, responses(:, i:i), ierr)
      call raise_petsc(error, ierr, 'orthogonalising the static corrections')
    end do
  end subroutine make_corrections

  !> s <- s - Phi Phi^T M s for the modes on disk, so many times.
  subroutine remove_modes(split, mass, modes, store, passes, s, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Columns of modes that are stored together
    type(block_type), intent(in) :: modes(:)
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    !> How often
    integer, intent(in) :: passes
    !> Columns, this rank's rows
    real(wp), intent(inout), contiguous :: s(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: phi(:, :)
    integer :: i, pass
    PetscErrorCode :: ierr

    do pass = 1, passes
      do i = 1, size(modes)
        allocate (phi(split%rows(), modes(i)%columns()))
        call store%get(split, modes(i), phi, error)
        if (allocated(error)) return
        call remove(split, mass, phi, s, ierr)
        call raise_petsc(error, ierr, 'orthogonalising the static corrections')
        if (allocated(error)) return
        deallocate (phi)
      end do
    end do
  end subroutine remove_modes

  !> Those that the ones before do not span, one after another at the front.
  subroutine keep_independent(split, mass, s, kept, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Of unit norm before the modes were removed
    real(wp), intent(inout), contiguous :: s(:, :)
    !> How many are kept
    integer, intent(out) :: kept
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: rest
    integer :: i, pass
    PetscErrorCode :: ierr

    kept = 0
    do i = 1, size(s, 2)
      ierr = 0
      do pass = 1, 2
        if (ierr == 0) call remove(split, mass, s(:, :kept), s(:, i:i), ierr)
      end do
      if (ierr == 0) call norm_of(split, mass, s(:, i:i), rest, ierr)
      call raise_petsc(error, ierr, 'orthogonalising the static corrections')
      if (allocated(error)) return
      if (rest < smallest_rest) cycle
      kept = kept + 1
      s(:, kept) = s(:, i)/rest
    end do
  end subroutine keep_independent

  !> s <- s - Phi Phi^T M s.
  subroutine remove(split, mass, phi, s, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Modes, a column each
    real(wp), intent(in), contiguous :: phi(:, :)
    !> Columns, this rank's rows
    real(wp), intent(inout), contiguous :: s(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: inertia(:, :), parts(:, :)

    allocate (inertia, mold=s)
    PetscCall(multiply_block(mass, s, inertia, ierr))
    parts = transposed_product(phi, inertia)
    call split%ranks%sum(parts)
    s = s - matmul(phi, parts)
  end subroutine remove

  !> Unit norm in mass; a zero vector stays one.
  subroutine scale_to_unit(split, mass, s, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Columns, this rank's rows
    real(wp), intent(inout), contiguous :: s(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    real(wp) :: norm

    PetscCall(norm_of(split, mass, s, norm, ierr))
    if (norm > 0.0_wp) s = s/norm
  end subroutine scale_to_unit

  !> sqrt(s^T M s).
  subroutine norm_of(split, mass, s, norm, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Columns, this rank's rows
    real(wp), intent(in), contiguous :: s(:, :)
    !> Norm in the mass
    real(wp), intent(out) :: norm
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: inertia(:, :)

    allocate (inertia, mold=s)
    norm = 0.0_wp
    PetscCall(multiply_block(mass, s, inertia, ierr))
    norm = sum(s*inertia)
    call split%ranks%sum(norm)
    norm = sqrt(max(norm, 0.0_wp))
  end subroutine norm_of
end module attrito_reduce_static_corrections
