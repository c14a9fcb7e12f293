#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> What forces do at the boundary, and how the interior follows it, by solves in the place of constraint modes.
!>
!> $$ \begin{pmatrix} I & \Psi^T \end{pmatrix} f = f_b - K_{bi} K_{ii}^{-1} f_i, \qquad \Psi q_b = -K_{ii}^{-1} K_{ib} q_b $$
!>
!> Of M times modes the first is their coupling with the boundary in the reduced mass; of a unit vector it is a row of (I; Psi).
module attrito_reduce_boundary_projection
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_constraint_modes, only: interior_stiffness_type
  use attrito_reduce_dense_block, only: multiply_block, multiply_transposed_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: project_on_boundary, follow_boundary

contains

  !> (I Psi^T) f, on every rank.
  subroutine project_on_boundary(split, stiffness, factor, vectors, projected, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Blocks of K
    type(interior_stiffness_type), intent(in) :: stiffness
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> f, this rank's rows of the full model [rows, vectors]
    real(wp), intent(in) :: vectors(:, :)
    !> [boundary dofs, vectors]
    real(wp), intent(out), contiguous :: projected(:, :)
    !> A solve or a product failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: inside(:, :), solutions(:, :), forces(:, :)
    PetscErrorCode :: ierr

    projected = 0.0_wp
    if (size(projected) == 0) return
    inside = vectors(split%interior_rows, :)
    allocate (solutions, mold=inside)
    allocate (forces(size(split%boundary_rows), size(vectors, 2)))
    call factor%solve(inside, solutions, ierr)
    if (ierr == 0) call multiply_transposed_block(stiffness%coupling, solutions, forces, ierr)
    call raise_petsc(error, ierr, 'projecting on the boundary')
    if (allocated(error)) return
    projected(split%boundary_numbers, :) = vectors(split%boundary_rows, :) - forces
    call split%ranks%sum(projected)
  end subroutine project_on_boundary

  !> Add (I; Psi) q_b.
  subroutine follow_boundary(split, stiffness, factor, q, motion, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> Blocks of K
    type(interior_stiffness_type), intent(in) :: stiffness
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> Displacements of the boundary [boundary dofs, vectors], the same on every rank
    real(wp), intent(in) :: q(:, :)
    !> This rank's rows of the full model [rows, vectors]
    real(wp), intent(inout) :: motion(:, :)
    !> A solve or a product failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: boundary(:, :), forces(:, :), inside(:, :)
    PetscErrorCode :: ierr

    if (size(q) == 0) return
    boundary = q(split%boundary_numbers, :)
    allocate (forces(size(split%interior_rows), size(q, 2)))
    allocate (inside, mold=forces)
    call multiply_block(stiffness%coupling, boundary, forces, ierr)
    if (ierr == 0) call factor%solve(forces, inside, ierr)
    call raise_petsc(error, ierr, 'letting the interior follow the boundary')
    if (allocated(error)) return
    motion(split%boundary_rows, :) = motion(split%boundary_rows, :) + boundary
    motion(split%interior_rows, :) = motion(split%interior_rows, :) - inside
  end subroutine follow_boundary
end module attrito_reduce_boundary_projection
