#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> The dofs of a model, split into boundary (b) and interior (i), each rank its own rows, and the blocks of a matrix.
!>
!> $$ K = \begin{pmatrix} K_{bb} & K_{bi} \\ K_{ib} & K_{ii} \end{pmatrix} $$
module attrito_reduce_split
  use petscmat
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type, fault_of_input, raise
  implicit none
  private
  public :: split_type, new_split, interior_block, coupling_block, boundary_columns, boundary_rows_on_root, some_rows_on_root

  type :: split_type
    !> The ranks that share the rows
    type(communicator_type) :: ranks
    !> Number of dofs, and how many of them are boundary
    integer :: n = 0, boundary_count = 0
    !> First and last dof of this rank, from 1; none if last < first
    integer :: first = 1, last = 0
    !> Boundary dofs, from 0, ascending, on every rank
    integer, allocatable :: boundary(:)
    !> This rank's interior rows, from 1 for its first row
    integer, allocatable :: interior_rows(:)
    !> This rank's boundary rows, and the number of each among all boundary dofs, from 1
    integer, allocatable :: boundary_rows(:), boundary_numbers(:)
  contains
    procedure :: rows
  end type split_type

contains

  !> Split the dofs.
  subroutine new_split(self, ranks, n, boundary, error)
    !> The split
    type(split_type), intent(out) :: self
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> Number of dofs
    integer, intent(in) :: n
    !> Boundary dofs, from 0, ascending, the same on every rank
    integer, intent(in) :: boundary(:)
    !> Not dofs of the model, or not ascending
    type(error_type), allocatable, intent(out) :: error
    logical, allocatable :: is_interior(:)
    integer :: i

    if (any(boundary < 0) .or. any(boundary >= n)) then
      call raise(error, 'a boundary dof is not a dof of the model', fault_of_input)
    else if (any(boundary(2:) <= boundary(:size(boundary) - 1))) then
      call raise(error, 'boundary dofs are not ascending, or one is there twice', fault_of_input)
    else if (size(boundary) == n) then
      call raise(error, 'every dof is a boundary dof: there is nothing to reduce', fault_of_input)
    end if
    if (allocated(error)) return
    self%ranks = ranks
    self%n = n
    self%boundary = boundary
    self%boundary_count = size(boundary)
    call ranks%share(n, self%first, self%last)
    self%boundary_numbers = pack([(i, i=1, size(boundary))], boundary + 1 >= self%first .and. boundary + 1 <= self%last)
    self%boundary_rows = boundary(self%boundary_numbers) + 2 - self%first
    allocate (is_interior(self%rows()), source=.true.)
    is_interior(self%boundary_rows) = .false.
    self%interior_rows = pack([(i, i=1, self%rows())], is_interior)
  end subroutine new_split

  !> Number of this rank's rows.
  pure integer function rows(self)
    !> The split
    class(split_type), intent(in) :: self

    rows = self%last - self%first + 1
  end function rows

  !> The block of interior rows and columns, spread over the ranks; the caller destroys it.
  subroutine interior_block(self, matrix, block, ierr)
    !> The split
    type(split_type), intent(in) :: self
    !> Matrix of the full model
    type(tMat), intent(in) :: matrix
    !> Its interior block
    type(tMat), intent(out) :: block
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tIS) :: interior

    PetscCall(index_set(self, self%interior_rows, interior, ierr))
    PetscCall(MatCreateSubMatrix(matrix, interior, interior, MAT_INITIAL_MATRIX, block, ierr))
    PetscCall(ISDestroy(interior, ierr))
    PetscCall(MatSetOption(block, MAT_SYMMETRIC, PETSC_TRUE, ierr))
  end subroutine interior_block

  !> The block of interior rows and boundary columns, spread over the ranks; the caller destroys it.
  subroutine coupling_block(self, matrix, block, ierr)
    !> The split
    type(split_type), intent(in) :: self
    !> Matrix of the full model
    type(tMat), intent(in) :: matrix
    !> [interior dofs, boundary dofs]
    type(tMat), intent(out) :: block
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tIS) :: interior, boundary

    PetscCall(index_set(self, self%interior_rows, interior, ierr))
    PetscCall(index_set(self, self%boundary_rows, boundary, ierr))
    PetscCall(MatCreateSubMatrix(matrix, interior, boundary, MAT_INITIAL_MATRIX, block, ierr))
    PetscCall(ISDestroy(boundary, ierr))
    PetscCall(ISDestroy(interior, ierr))
  end subroutine coupling_block

  !> All rows of the boundary columns, spread over the ranks; the caller destroys it.
  subroutine boundary_columns(self, matrix, block, ierr)
    !> The split
    type(split_type), intent(in) :: self
    !> Matrix of the full model
    type(tMat), intent(in) :: matrix
    !> [dofs, boundary dofs]
    type(tMat), intent(out) :: block
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tIS) :: all, boundary
    integer :: i

    PetscCall(index_set(self, [(i, i=1, self%rows())], all, ierr))
    PetscCall(index_set(self, self%boundary_rows, boundary, ierr))
    PetscCall(MatCreateSubMatrix(matrix, all, boundary, MAT_INITIAL_MATRIX, block, ierr))
    PetscCall(ISDestroy(boundary, ierr))
    PetscCall(ISDestroy(all, ierr))
  end subroutine boundary_columns

  !> PETSc's form of this rank's share of some rows.
  subroutine index_set(self, rows, set, ierr)
    type(split_type), intent(in) :: self
    !> From 1 for this rank's first row
    integer, intent(in) :: rows(:)
    !> PETSc's index set
    type(tIS), intent(out) :: set
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr

    PetscCall(ISCreateGeneral(self%ranks%handle, size(rows), rows + self%first - 2, PETSC_COPY_VALUES, set, ierr))
  end subroutine index_set

  !> The boundary block K_bi, all of it on rank 0, as MUMPS wants sparse right-hand sides; the caller destroys it.
  subroutine boundary_rows_on_root(self, matrix, block, ierr)
    !> The split
    type(split_type), intent(in) :: self
    !> Matrix of the full model
    type(tMat), intent(in) :: matrix
    !> [boundary dofs, interior dofs]
    type(tMat), intent(out) :: block
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    logical, allocatable :: is_interior(:)
    integer :: i

    allocate (is_interior(0:self%n - 1), source=.true.)
    is_interior(self%boundary) = .false.
    PetscCall(take_on_root(self, matrix, self%boundary, pack([(i, i=0, self%n - 1)], is_interior), block, ierr))
  end subroutine boundary_rows_on_root

  !> Some rows of what `boundary_rows_on_root` gave; the caller destroys it.
  subroutine some_rows_on_root(self, whole, first, last, block, ierr)
    !> The split
    type(split_type), intent(in) :: self
    !> [boundary dofs, interior dofs], all on rank 0
    type(tMat), intent(in) :: whole
    !> First and last boundary dof, by number from 1
    integer, intent(in) :: first, last
    !> [last - first + 1, interior dofs]
    type(tMat), intent(out) :: block
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    integer :: i

    PetscCall(take_on_root(self, whole, [(i, i=first - 1, last - 1)], [(i, i=0, self%n - self%boundary_count - 1)], block, ierr))
  end subroutine some_rows_on_root

  subroutine take_on_root(self, matrix, rows, columns, block, ierr)
    type(split_type), intent(in) :: self
    !> Matrix, spread over the ranks
    type(tMat), intent(in) :: matrix
    !> From 0, the same on every rank
    integer, intent(in) :: rows(:), columns(:)
    !> PETSc matrix
    type(tMat), intent(out) :: block
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tIS) :: row_set, column_set
    integer :: i

    i = merge(1, 0, self%ranks%is_root())
    PetscCall(ISCreateGeneral(self%ranks%handle, i*size(rows), rows, PETSC_COPY_VALUES, row_set, ierr))
    PetscCall(ISCreateGeneral(self%ranks%handle, i*size(columns), columns, PETSC_COPY_VALUES, column_set, ierr))
    PetscCall(MatCreateSubMatrix(matrix, row_set, column_set, MAT_INITIAL_MATRIX, block, ierr))
    PetscCall(ISDestroy(column_set, ierr))
    PetscCall(ISDestroy(row_set, ierr))
  end subroutine take_on_root
end module attrito_reduce_split
