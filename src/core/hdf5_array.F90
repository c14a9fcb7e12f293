!> Arrays of every kind of number and of any rank to and from an open HDF5 file. Usage: see `attrito_core_hdf5_file`.
module attrito_core_hdf5_array
  use, intrinsic :: iso_c_binding, only: c_loc
  use, intrinsic :: iso_fortran_env, only: int8, int32, int64
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_dataset, only: put_array, transfer_block
  use attrito_core_hdf5_file, only: hdf5_file_type
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: write_array, write_block, read_block

  !> Make a dataset of a replicated array, or of a scalar, as rank 0 holds it.
  interface write_array
    procedure write_array_real64
    procedure write_array_int64
    procedure write_array_int32
    procedure write_array_int8
  end interface write_array

  !> Write every rank's own block of a dataset that exists; a rank with nothing to write passes an empty array.
  interface write_block
    procedure write_block_real64
    procedure write_block_int64
    procedure write_block_int32
  end interface write_block

  !> Read every rank's own block of a dataset, as much of it as `values` holds.
  interface read_block
    procedure read_block_real64
    procedure read_block_int64
    procedure read_block_int32
    procedure read_block_int8
  end interface read_block

contains

  !> gfortran 12 gives an empty constructor passed to an assumed rank the size -1.
  pure function extent_of(sizes) result(extent)
    !> Sizes of the array
    integer, intent(in) :: sizes(:)
    integer :: extent(size(sizes))

    extent = max(sizes, 0)
  end function extent_of

  !> Make a dataset of real numbers.
  subroutine write_array_real64(file, name, values, description, unit, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root; its groups are made if need be
    character(*), intent(in) :: name
    !> The numbers, the same on every rank
    real(wp), intent(in), contiguous, target :: values(..)
    !> One sentence
    character(*), intent(in) :: description
    !> `1`, `Hz`, `user length`, ...
    character(*), intent(in) :: unit
    !> There is one already, or the disk is full
    type(error_type), allocatable, intent(out) :: error

    call put_array(file, name, 'real64', extent_of(shape(values)), c_loc(values), description, unit, error)
  end subroutine write_array_real64

  !> Make a dataset of long numbers.
  subroutine write_array_int64(file, name, values, description, unit, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root; its groups are made if need be
    character(*), intent(in) :: name
    !> The numbers, the same on every rank
    integer(int64), intent(in), contiguous, target :: values(..)
    !> One sentence
    character(*), intent(in) :: description
    !> `1`, `Hz`, `user length`, ...
    character(*), intent(in) :: unit
    !> There is one already, or the disk is full
    type(error_type), allocatable, intent(out) :: error

    call put_array(file, name, 'int64', extent_of(shape(values)), c_loc(values), description, unit, error)
  end subroutine write_array_int64

  !> Make a dataset of whole numbers.
  subroutine write_array_int32(file, name, values, description, unit, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root; its groups are made if need be
    character(*), intent(in) :: name
    !> The numbers, the same on every rank
    integer(int32), intent(in), contiguous, target :: values(..)
    !> One sentence
    character(*), intent(in) :: description
    !> `1`, `Hz`, `user length`, ...
    character(*), intent(in) :: unit
    !> There is one already, or the disk is full
    type(error_type), allocatable, intent(out) :: error

    call put_array(file, name, 'int32', extent_of(shape(values)), c_loc(values), description, unit, error)
  end subroutine write_array_int32

  !> Make a dataset of short numbers.
  subroutine write_array_int8(file, name, values, description, unit, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root; its groups are made if need be
    character(*), intent(in) :: name
    !> The numbers, the same on every rank
    integer(int8), intent(in), contiguous, target :: values(..)
    !> One sentence
    character(*), intent(in) :: description
    !> `1`, `Hz`, `user length`, ...
    character(*), intent(in) :: unit
    !> There is one already, or the disk is full
    type(error_type), allocatable, intent(out) :: error

    call put_array(file, name, 'int8', extent_of(shape(values)), c_loc(values), description, unit, error)
  end subroutine write_array_int8

  !> Write a block of real numbers.
  subroutine write_block_real64(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    real(wp), intent(in), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'real64', start, extent_of(shape(values)), c_loc(values), .true., error)
  end subroutine write_block_real64

  !> Write a block of long numbers.
  subroutine write_block_int64(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    integer(int64), intent(in), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'int64', start, extent_of(shape(values)), c_loc(values), .true., error)
  end subroutine write_block_int64

  !> Write a block of whole numbers.
  subroutine write_block_int32(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    integer(int32), intent(in), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'int32', start, extent_of(shape(values)), c_loc(values), .true., error)
  end subroutine write_block_int32

  !> Read a block of real numbers.
  subroutine read_block_real64(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    real(wp), intent(inout), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'real64', start, extent_of(shape(values)), c_loc(values), .false., error)
  end subroutine read_block_real64

  !> Read a block of long numbers.
  subroutine read_block_int64(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    integer(int64), intent(inout), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'int64', start, extent_of(shape(values)), c_loc(values), .false., error)
  end subroutine read_block_int64

  !> Read a block of whole numbers.
  subroutine read_block_int32(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    integer(int32), intent(inout), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'int32', start, extent_of(shape(values)), c_loc(values), .false., error)
  end subroutine read_block_int32

  !> Read a block of short numbers.
  subroutine read_block_int8(file, name, start, values, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> First entry, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> This rank's block
    integer(int8), intent(inout), contiguous, target :: values(..)
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error

    call transfer_block(file, name, 'int8', start, extent_of(shape(values)), c_loc(values), .false., error)
  end subroutine read_block_int8
end module attrito_core_hdf5_array
