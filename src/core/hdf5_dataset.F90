!> Datasets of an open HDF5 file: of fixed size, and the transfer of one block by all ranks together.
!>
!> Sizes and starts are given as h5py gives them, slowest dimension first and from 0; an array `values(nk, 3, nc)` of Fortran is
!> a block `[nc, 3, nk]` of the file. A block of fewer dimensions than its dataset counts as one entry in the dimensions
!> that it lacks, the slowest ones. Arrays of each kind of number: `attrito_core_hdf5_array`. Usage: `attrito_core_hdf5_file`.
module attrito_core_hdf5_dataset
  use, intrinsic :: iso_c_binding, only: c_ptr
  use, intrinsic :: iso_fortran_env, only: int8, int32, int64
  use hdf5, only: hid_t, hsize_t, &
    h5dcreate_f, h5dopen_f, h5dclose_f, h5dwrite_f, h5dread_f, h5dget_space_f, &
    h5pcreate_f, h5pclose_f, h5pset_chunk_f, h5pset_create_inter_group_f, h5pset_dxpl_mpio_f, &
    h5screate_simple_f, h5sclose_f, h5sselect_hyperslab_f, h5sselect_none_f, &
    h5sget_simple_extent_ndims_f, h5sget_simple_extent_dims_f, h5kind_to_type, &
    H5P_DATASET_CREATE_F, H5P_DATASET_XFER_F, H5P_LINK_CREATE_F, H5FD_MPIO_COLLECTIVE_F, H5S_SELECT_SET_F, &
    H5_INTEGER_KIND, H5_REAL_KIND
  use attrito_core_errors, only: error_type, fault_of_input
  use attrito_core_hdf5_attribute, only: write_attribute
  use attrito_core_hdf5_file, only: agree_in_file, exists_in_file, hdf5_file_type
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: create_array, array_shape, transfer_block, put_array

contains

  !> Create a dataset of fixed size, to be filled by `write_block`.
  subroutine create_array(file, name, kind, extent, description, unit, error, chunk)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root; its groups are made if need be
    character(*), intent(in) :: name
    !> `real64`, `int64`, `int32` or `int8`
    character(*), intent(in) :: kind
    !> Sizes, slowest first; none for a scalar
    integer, intent(in) :: extent(:)
    !> One sentence
    character(*), intent(in) :: description
    !> `1`, `Hz`, `user length`, ...
    character(*), intent(in) :: unit
    !> There is one already, or the disk is full
    type(error_type), allocatable, intent(out) :: error
    !> Sizes of a chunk, slowest first; absent: stored in one piece
    integer, intent(in), optional :: chunk(:)
    integer(hid_t) :: space, creation
    integer :: ierr

    call h5screate_simple_f(size(extent), reversed(extent), space, ierr)
    call h5pcreate_f(H5P_DATASET_CREATE_F, creation, ierr)
    if (present(chunk)) call h5pset_chunk_f(creation, size(chunk), reversed(max(chunk, 1)), ierr)
    call create_dataset(file, name, kind, space, creation, description, unit, error)
  end subroutine create_array

  !> Create the dataset and release what describes it.
  subroutine create_dataset(file, name, kind, space, creation, description, unit, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Name in the file; HDF5's type
    character(*), intent(in) :: name, kind
    !> Sizes; released here
    integer(hid_t), intent(in) :: space
    !> Layout; released here
    integer(hid_t), intent(in) :: creation
    !> What the dataset holds; unit of the dataset
    character(*), intent(in) :: description, unit
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: links, dataset
    integer :: status, ierr

    call h5pcreate_f(H5P_LINK_CREATE_F, links, ierr)
    call h5pset_create_inter_group_f(links, 1, ierr)
    call h5dcreate_f(file%id, name, type_of(kind), space, dataset, status, creation, links)
    if (status >= 0) call h5dclose_f(dataset, ierr)
    call h5pclose_f(links, ierr)
    call h5pclose_f(creation, ierr)
    call h5sclose_f(space, ierr)
    call agree_in_file(file, status, 'cannot be created', name, error)
    if (.not. allocated(error)) call write_attribute(file, name, 'description', description, error)
    if (.not. allocated(error)) call write_attribute(file, name, 'unit', unit, error)
  end subroutine create_dataset

  !> Sizes of a dataset, slowest first.
  function array_shape(file, name, error) result(extent)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> No such dataset
    type(error_type), allocatable, intent(out) :: error
    !> Sizes; empty on failure and for a scalar
    integer, allocatable :: extent(:)
    integer(hsize_t), allocatable :: sizes(:), most(:)
    integer(hid_t) :: dataset, space
    integer :: dimensions, status, ierr

    allocate (extent(0))
    status = -1
    if (exists_in_file(file, name)) call h5dopen_f(file%id, name, dataset, status)
    call agree_in_file(file, status, 'is not in the file', name, error)
    if (allocated(error)) then
      error%status = fault_of_input
      return
    end if
    call h5dget_space_f(dataset, space, ierr)
    call h5sget_simple_extent_ndims_f(space, dimensions, ierr)
    allocate (sizes(dimensions), most(dimensions))
    call h5sget_simple_extent_dims_f(space, sizes, most, ierr)
    call h5sclose_f(space, ierr)
    call h5dclose_f(dataset, ierr)
    extent = int(sizes(dimensions:1:-1))
  end function array_shape

  !> Move one block, by all ranks together, to the file or from it.
  subroutine transfer_block(file, name, kind, start, extent, address, writing, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> Kind of number in memory
    character(*), intent(in) :: kind
    !> First entry of the block, slowest dimension first, from 0; completed by zeros
    integer, intent(in) :: start(:)
    !> Shape of the array in memory, fastest first
    integer, intent(in) :: extent(:)
    !> The array
    type(c_ptr), intent(in) :: address
    !> To the file, or from it
    logical, intent(in) :: writing
    !> No such dataset, or of another shape
    type(error_type), allocatable, intent(out) :: error
    integer, allocatable :: whole(:), first(:)
    integer(hsize_t), allocatable :: counts(:)
    integer(hid_t) :: dataset, space, memory, transfer
    type(c_ptr) :: values
    integer :: i, status, ierr

    whole = array_shape(file, name, error)
    if (allocated(error)) return
    first = [start, [(0, i=size(start) + 1, size(whole))]]
    counts = [int(extent, hsize_t), [(1_hsize_t, i=size(extent) + 1, size(whole))]]
    call h5dopen_f(file%id, name, dataset, ierr)
    call h5dget_space_f(dataset, space, ierr)
    call h5screate_simple_f(size(counts), max(counts, 1_hsize_t), memory, ierr)
    values = address
    status = 0
    if (any(counts == 0)) then
      call h5sselect_none_f(space, ierr)
      call h5sselect_none_f(memory, ierr)
    else if (size(first) /= size(whole) .or. size(counts) /= size(whole)) then
      status = -1
    else if (any(first + counts(size(counts):1:-1) > whole)) then
      status = -1
    else if (size(whole) > 0) then
      call h5sselect_hyperslab_f(space, H5S_SELECT_SET_F, reversed(first), counts, status)
    end if
    call agree_in_file(file, status, 'has no such block', name, error)
    call h5pcreate_f(H5P_DATASET_XFER_F, transfer, ierr)
    call h5pset_dxpl_mpio_f(transfer, H5FD_MPIO_COLLECTIVE_F, ierr)
    if (.not. allocated(error)) then
      if (writing) then
        call h5dwrite_f(dataset, type_of(kind), address, status, memory, space, transfer)
      else
        call h5dread_f(dataset, type_of(kind), values, status, memory, space, transfer)
      end if
      call agree_in_file(file, status, merge('cannot be written', 'cannot be read   ', writing), name, error)
    end if
    call h5pclose_f(transfer, ierr)
    call h5sclose_f(memory, ierr)
    call h5sclose_f(space, ierr)
    call h5dclose_f(dataset, ierr)
  end subroutine transfer_block

  !> Create a dataset of the array's shape and let rank 0 write it.
  subroutine put_array(file, name, kind, extent, address, description, unit, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> Kind of number in memory and in the file
    character(*), intent(in) :: kind
    !> Shape of the array in memory, fastest first
    integer, intent(in) :: extent(:)
    !> The array
    type(c_ptr), intent(in) :: address
    !> One sentence
    character(*), intent(in) :: description
    !> `1`, `Hz`, `user length`, ...
    character(*), intent(in) :: unit
    !> There is one already, or the disk is full
    type(error_type), allocatable, intent(out) :: error

    call create_array(file, name, kind, extent(size(extent):1:-1), description, unit, error)
    if (allocated(error) .or. any(extent == 0)) return
    call transfer_block(file, name, kind, [integer ::], merge(extent, 0, file%rank == 0), address, .true., error)
  end subroutine put_array

  pure function reversed(sizes)
    !> Sizes of the array
    integer, intent(in) :: sizes(:)
    integer(hsize_t) :: reversed(size(sizes))

    reversed = sizes(size(sizes):1:-1)
  end function reversed

  function type_of(kind) result(handle)
    !> HDF5's type
    character(*), intent(in) :: kind
    integer(hid_t) :: handle

    select case (kind)
     case ('int8'); handle = h5kind_to_type(int8, H5_INTEGER_KIND)
     case ('int32'); handle = h5kind_to_type(int32, H5_INTEGER_KIND)
     case ('int64'); handle = h5kind_to_type(int64, H5_INTEGER_KIND)
     case default; handle = h5kind_to_type(wp, H5_REAL_KIND)
    end select
  end function type_of

end module attrito_core_hdf5_dataset
