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
  public :: read_model_matrix, read_sliced_matrix, read_lower_triangle, triangle_type, leading_bits

  !> Two factors of so many bits and 2^8 terms a row make sums of 52 bits: exact
  integer, parameter :: slice_bits = 22 ! derived

  !> This rank's entries of a symmetric matrix on and below the diagonal, rows and columns from 1
  type :: triangle_type
    integer, allocatable :: rows(:), columns(:)
    real(wp), allocatable :: values(:)
  end type triangle_type

  !> This rank's rows of a square CSR matrix, columns from 0
  type :: rows_type
    integer :: size = 0, count = 0
    integer, allocatable :: offsets(:)
    integer(int32), allocatable :: columns(:)
    real(wp), allocatable :: values(:)
  end type rows_type

contains

  !> Read one matrix; the caller destroys it.
  subroutine read_model_matrix(file, ranks, name, matrix, error)
    !> model.h5, open
    type(hdf5_file_type), intent(in) :: file
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> `stiffness`, `mass`, `damping` or `gyroscopic`
    character(*), intent(in) :: name
    !> Square, symmetric but for `gyroscopic`, which is skew; both triangles stored
    type(tMat), intent(out) :: matrix
    !> Missing, or not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    type(rows_type) :: rows
    PetscErrorCode :: ierr

    call read_rows(file, ranks, name, rows, error)
    if (allocated(error)) return
    if (name == 'mass' .or. name == 'gyroscopic') call drop_zeros(rows)
    call create_matrix(ranks%handle, rows, rows%values, matrix, ierr)
    if (ierr == 0 .and. name == 'gyroscopic') call MatSetOption(matrix, MAT_SYMMETRIC, PETSC_FALSE, ierr)
    call raise_petsc(error, ierr, 'storing the '//name//' matrix')
  end subroutine read_model_matrix

  !> Read one matrix as a sum of two, the first of `slice_bits` leading bits of the largest entry; the caller destroys them.
  subroutine read_sliced_matrix(file, ranks, name, slices, error)
    !> model.h5, open
    type(hdf5_file_type), intent(in) :: file
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> `stiffness`, `mass` or `damping`
    character(*), intent(in) :: name
    !> Leading bits, and the rest
    type(tMat), intent(out) :: slices(2)
    !> Missing, or not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    type(rows_type) :: rows
    real(wp), allocatable :: leading(:)
    PetscErrorCode :: ierr

    call read_rows(file, ranks, name, rows, error)
    if (allocated(error)) return
    leading = leading_bits(rows%values, ranks%largest(maxval([0.0_wp, abs(rows%values)])))
    call create_matrix(ranks%handle, rows, leading, slices(1), ierr)
    if (ierr == 0) call create_matrix(ranks%handle, rows, rows%values - leading, slices(2), ierr)
    call raise_petsc(error, ierr, 'storing the '//name//' matrix')
  end subroutine read_sliced_matrix

  !> Read one matrix as entries.
  subroutine read_lower_triangle(file, ranks, name, triangle, error)
    !> model.h5, open
    type(hdf5_file_type), intent(in) :: file
    !> The ranks that share the rows
    type(communicator_type), intent(in) :: ranks
    !> `stiffness` or `mass`
    character(*), intent(in) :: name
    !> Of the lower triangle, but zeros
    type(triangle_type), intent(out) :: triangle
    !> Missing, or not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    type(rows_type) :: rows
    integer, allocatable :: row_of(:)
    logical, allocatable :: is_below(:)
    integer :: i, first, last

    call read_rows(file, ranks, name, rows, error)
    if (allocated(error)) return
    call drop_zeros(rows)
    call ranks%share(rows%size, first, last)
    row_of = [(spread(first + i - 1, 1, rows%offsets(i + 1) - rows%offsets(i)), i=1, rows%count)]
    associate (entries => rows%offsets(rows%count + 1))
      is_below = rows%columns(:entries) < row_of
      triangle%rows = pack(row_of, is_below)
      triangle%columns = pack(rows%columns(:entries) + 1, is_below)
      triangle%values = pack(rows%values(:entries), is_below)
    end associate
  end subroutine read_lower_triangle

  !> Numbers rounded to `slice_bits` bits below the first of the largest: multiples of one power of two.
  elemental function leading_bits(x, largest) result(leading)
    !> Columns, this rank's rows; largest number of the column
    real(wp), intent(in) :: x, largest
    real(wp) :: leading
    real(wp) :: quantum

    leading = x
    if (largest <= 0.0_wp) return
    quantum = scale(1.0_wp, exponent(largest) - slice_bits)
    leading = anint(x/quantum)*quantum
  end function leading_bits

  !> This rank's rows of the CSR arrays.
  subroutine read_rows(file, ranks, name, rows, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> Name of the dataset
    character(*), intent(in) :: name
    !> This rank's rows of the matrix
    type(rows_type), intent(out) :: rows
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer(int64), allocatable :: offsets(:)
    integer, allocatable :: extent(:)
    integer :: first, last, start

    extent = array_shape(file, '/'//name//'/row_offsets', error)
    if (allocated(error)) return
    rows%size = extent(1) - 1
    call ranks%share(rows%size, first, last)
    rows%count = last - first + 1
    allocate (offsets(rows%count + 1))
    call read_block(file, '/'//name//'/row_offsets', [first - 1], offsets, error)
    if (allocated(error)) return
    start = int(offsets(1))
    rows%offsets = int(offsets - start)
    allocate (rows%columns(rows%offsets(rows%count + 1)), rows%values(rows%offsets(rows%count + 1)))
    call read_block(file, '/'//name//'/columns', [start], rows%columns, error)
    if (.not. allocated(error)) call read_block(file, '/'//name//'/values', [start], rows%values, error)
    if (allocated(error)) return
    if (ranks%largest(real(maxval([0, rows%columns]), wp)) > rows%size - 1) &
      call raise(error, file%path//': /'//name//'/columns holds a column beyond the last one', fault_of_input)
  end subroutine read_rows

  !> FE programs store the mass in the pattern of the stiffness, two entries in three zero.
  pure subroutine drop_zeros(rows)
    !> This rank's rows of the matrix
    type(rows_type), intent(inout) :: rows
    integer :: i, k, kept, first

    kept = 0
    first = 1
    do i = 1, rows%count
      do k = first, rows%offsets(i + 1)
        if (rows%values(k) == 0.0_wp) cycle
        kept = kept + 1
        rows%values(kept) = rows%values(k)
        rows%columns(kept) = rows%columns(k)
      end do
      first = rows%offsets(i + 1) + 1
      rows%offsets(i + 1) = kept
    end do
  end subroutine drop_zeros

  subroutine create_matrix(comm, rows, values, matrix, ierr)
    !> MPI communicator
    integer, intent(in) :: comm
    !> This rank's rows of the matrix
    type(rows_type), intent(in) :: rows
    !> Entries of the matrix
    PetscScalar, intent(in) :: values(:)
    !> Matrix, spread over the ranks
    type(tMat), intent(out) :: matrix
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr

    PetscCall(MatCreate(comm, matrix, ierr))
    PetscCall(MatSetSizes(matrix, rows%count, rows%count, rows%size, rows%size, ierr))
    PetscCall(MatSetType(matrix, MATAIJ, ierr))
    ! Only the one that fits the number of ranks does anything.
    PetscCall(MatSeqAIJSetPreallocationCSR(matrix, rows%offsets, rows%columns, values, ierr))
    PetscCall(MatMPIAIJSetPreallocationCSR(matrix, rows%offsets, rows%columns, values, ierr))
    PetscCall(MatSetOption(matrix, MAT_SYMMETRIC, PETSC_TRUE, ierr))
  end subroutine create_matrix
end module attrito_reduce_model_matrix
