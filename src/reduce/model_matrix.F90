#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> A matrix of model.h5 as a PETSc matrix: each rank reads its own rows of the CSR arrays, about n / ranks of them.
module attrito_reduce_model_matrix
  use, intrinsic :: iso_fortran_env, only: int32, int64
  use petscmat
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type, fault_of_input, raise
  use attrito_core_hdf5_array, only: read_block
  use attrito_core_hdf5_dataset, only: array_shape
  use attrito_core_hdf5_file, only: hdf5_file_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: raise_petsc
  implicit none
  private
  public :: read_model_matrix

contains

  !> Read one matrix; the caller destroys it.
  subroutine read_model_matrix(file, ranks, name, matrix, error)
    !> model.h5, open
    type(hdf5_file_type), intent(in) :: file
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> `stiffness`, `mass` or `damping`
    character(*), intent(in) :: name
    !> Square, symmetric, both triangles stored
    type(tMat), intent(out) :: matrix
    !> Missing, or not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    integer(int64), allocatable :: offsets(:)
    integer(int32), allocatable :: columns(:)
    real(wp), allocatable :: values(:)
    integer, allocatable :: extent(:)
    integer :: n, first, last, start
    PetscErrorCode :: ierr

    extent = array_shape(file, '/' // name // '/row_offsets', error)
    if (allocated(error)) return
    n = extent(1) - 1
    call ranks%share(n, first, last)
    allocate (offsets(last - first + 2))
    call read_block(file, '/' // name // '/row_offsets', [first - 1], offsets, error)
    if (allocated(error)) return
    start = int(offsets(1))
    offsets = offsets - start
    allocate (columns(offsets(size(offsets))), values(offsets(size(offsets))))
    call read_block(file, '/' // name // '/columns', [start], columns, error)
    if (.not. allocated(error)) call read_block(file, '/' // name // '/values', [start], values, error)
    if (allocated(error)) return
    if (ranks%largest(real(maxval([0, columns]), wp)) > n - 1) then
      call raise(error, file%path // ': /' // name // '/columns holds a column beyond the last one', fault_of_input)
      return
    end if
    call create_matrix(ranks%handle, last - first + 1, n, int(offsets), columns, values, matrix, ierr)
    call raise_petsc(error, ierr, 'storing the ' // name // ' matrix')
  end subroutine read_model_matrix

  subroutine create_matrix(comm, rows, n, offsets, columns, values, matrix, ierr)
    integer, intent(in) :: comm
    PetscInt, intent(in) :: rows, n, offsets(:), columns(:)
    PetscScalar, intent(in) :: values(:)
    type(tMat), intent(out) :: matrix
    PetscErrorCode, intent(out) :: ierr

    PetscCall(MatCreate(comm, matrix, ierr))
    PetscCall(MatSetSizes(matrix, rows, rows, n, n, ierr))
    PetscCall(MatSetType(matrix, MATAIJ, ierr))
    ! Only the one that fits the number of ranks does anything.
    PetscCall(MatSeqAIJSetPreallocationCSR(matrix, offsets, columns, values, ierr))
    PetscCall(MatMPIAIJSetPreallocationCSR(matrix, offsets, columns, values, ierr))
    PetscCall(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE, ierr))
  end subroutine create_matrix
end module attrito_reduce_model_matrix
