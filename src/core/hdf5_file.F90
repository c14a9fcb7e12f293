!> One HDF5 file opened by all ranks together, and how its failures are reported.
!>
!> Every procedure of this module, of `..._hdf5_attribute`, `..._hdf5_dataset` and `..._hdf5_array` is collective over the
!> file's communicator and leaves the same `error` on every rank. Groups appear by themselves with the first thing written
!> below them.
!>
!> ```fortran
!> type(hdf5_file_type) :: file
!> call create_file(file, comm, 'result.h5', error, numbers=count)            ! or open_file, to read
!> call write_attribute(file, '/', 'format', 'attrito result', error)         ! text, texts, integer, real
!> call write_array(file, '/points/target', t, 'target frequency', 'Hz', error)   ! replicated: rank 0 writes
!>
!> ! Each rank writes its rows, counted from 0, of a dataset [rows, n]: basis(n, my_rows), Fortran's order reversed.
!> ! A rank without a share passes an empty array; `start` that is short is completed by zeros.
!> call create_array(file, '/recovery/basis', 'real64', [rows, n], 'basis', '1', error)
!> call write_block(file, '/recovery/basis', [my_first], basis, error)
!>
!> extent = array_shape(file, '/mass/row_offsets', error)                     ! slowest first; empty if there is none
!> call read_block(file, '/mass/row_offsets', [first_row], offsets, error)    ! as many as `offsets` holds
!> call close_file(file, error)                                               ! of a file that was written; its first error stays
!> ```
module attrito_core_hdf5_file
  use, intrinsic :: iso_fortran_env, only: int64
  use hdf5, only: hid_t, &
    h5open_f, h5eset_auto_f, h5fcreate_f, h5fopen_f, h5fclose_f, h5lexists_f, &
    h5gcreate_f, h5gclose_f, h5pcreate_f, h5pclose_f, h5pset_fapl_mpio_f, H5P_FILE_ACCESS_F, H5F_ACC_TRUNC_F, H5F_ACC_RDONLY_F
  use mpi, only: MPI_ALLREDUCE, MPI_COMM_RANK, MPI_INFO_NULL, MPI_INTEGER, MPI_MIN
  use attrito_core_disk_room, only: has_room_for
  use attrito_core_errors, only: error_type, failure_of_files, fault_of_input, raise
  implicit none
  private
  public :: hdf5_file_type, create_file, open_file, close_file, create_group
  public :: exists_in_file, agree_in_file

  !> Bytes of a file beside its numbers: descriptions, tables of contents
  integer(int64), parameter :: overhead = 262144

  type :: hdf5_file_type
    !> HDF5's handle; negative while closed
    integer(hid_t) :: id = -1
    !> The ranks that opened the file
    integer :: comm = -1
    !> This rank
    integer :: rank = -1
    !> Name of the file, for messages
    character(:), allocatable :: path
  end type hdf5_file_type

contains

  !> Make a new file, over an old one if there is one.
  subroutine create_file(file, comm, path, error, numbers)
    !> The file, open for writing
    type(hdf5_file_type), intent(out) :: file
    !> The ranks that write it together
    integer, intent(in) :: comm
    !> Where
    character(*), intent(in) :: path
    !> The path cannot be written, or there is no room on the disk
    type(error_type), allocatable, intent(out) :: error
    !> How many numbers of eight bytes it is to hold, if that is known
    integer(int64), intent(in), optional :: numbers
    integer(hid_t) :: access
    integer :: status, ierr

    call prepare_file(file, comm, path, access)
    status = 0
    if (present(numbers) .and. file%rank == 0) then
      if (.not. has_room_for(path, 8*numbers + overhead)) status = -1
    end if
    call agree_in_file(file, status, 'cannot be written (no room on the disk, no folder, or no permission)', '', error)
    if (allocated(error)) then
      call h5pclose_f(access, ierr)
      return
    end if
    call h5fcreate_f(path, H5F_ACC_TRUNC_F, file%id, ierr, access_prp=access)
    call agree_in_file(file, ierr, 'cannot be created', '', error)
    call h5pclose_f(access, ierr)
  end subroutine create_file

  !> Open an existing file for reading.
  subroutine open_file(file, comm, path, error)
    !> The file, open for reading
    type(hdf5_file_type), intent(out) :: file
    !> The ranks that read it together
    integer, intent(in) :: comm
    !> Where
    character(*), intent(in) :: path
    !> No such file, or not HDF5
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: access
    integer :: ierr

    call prepare_file(file, comm, path, access)
    call h5fopen_f(path, H5F_ACC_RDONLY_F, file%id, ierr, access_prp=access)
    call agree_in_file(file, ierr, 'cannot be opened (is it there, and an HDF5 file?)', '', error)
    call h5pclose_f(access, ierr)
    if (allocated(error)) error%status = fault_of_input
  end subroutine open_file

  !> HDF5 is opened once a process and never closed here: Python's h5py may share it. Its own error print is turned off.
  subroutine prepare_file(file, comm, path, access)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(inout) :: file
    !> MPI communicator
    integer, intent(in) :: comm
    !> Path of the file or dataset
    character(*), intent(in) :: path
    !> HDF5's property list of the file's access
    integer(hid_t), intent(out) :: access
    integer :: ierr

    file%comm = comm
    file%path = path
    call MPI_COMM_RANK(comm, file%rank, ierr)
    call h5open_f(ierr)
    call h5eset_auto_f(0, ierr)
    call h5pcreate_f(H5P_FILE_ACCESS_F, access, ierr)
    call h5pset_fapl_mpio_f(access, comm, MPI_INFO_NULL, ierr)
  end subroutine prepare_file

  !> Close; closing a closed file does nothing. What was written is known to be in the file only now.
  subroutine close_file(file, error)
    !> The file
    type(hdf5_file_type), intent(inout) :: file
    !> The disk is full, unless there is an error already
    type(error_type), allocatable, intent(inout), optional :: error
    type(error_type), allocatable :: late
    integer :: ierr

    if (file%id < 0) return
    call h5fclose_f(file%id, ierr)
    file%id = -1
    if (.not. present(error)) return
    call agree_in_file(file, ierr, 'cannot be written (is the disk full?)', '', late)
    if (.not. allocated(error)) call move_alloc(late, error)
  end subroutine close_file

  !> Make a group that is to carry attributes; others appear by themselves.
  subroutine create_group(file, name, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Path from the root
    character(*), intent(in) :: name
    !> There is one already
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: group
    integer :: status, ierr

    call h5gcreate_f(file%id, name, group, status)
    call agree_in_file(file, status, 'cannot be created', name, error)
    if (status >= 0) call h5gclose_f(group, ierr)
  end subroutine create_group

  !> Whether a dataset or group is in the file; every group on the way is looked up, since HDF5 fails on a missing one.
  function exists_in_file(file, name) result(exists)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Its path from the root
    character(*), intent(in) :: name
    !> There is one
    logical :: exists
    integer :: last, ierr

    exists = .true.
    do last = 2, len(name)
      if (last < len(name)) then
        if (name(last + 1:last + 1) /= '/') cycle
      end if
      call h5lexists_f(file%id, name(:last), exists, ierr)
      if (ierr < 0) exists = .false.
      if (.not. exists) return
    end do
  end function exists_in_file

  !> All ranks learn that one of them failed, and say the same.
  subroutine agree_in_file(file, status, complaint, name, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Negative: this rank's call failed
    integer, intent(in) :: status
    !> What is wrong, to follow the name of the thing
    character(*), intent(in) :: complaint
    !> Dataset or group; empty: the file itself
    character(*), intent(in) :: name
    !> The failure
    type(error_type), allocatable, intent(out) :: error
    integer :: worst, ierr

    call MPI_ALLREDUCE(status, worst, 1, MPI_INTEGER, MPI_MIN, file%comm, ierr)
    if (worst >= 0) return
    if (name == '') then
      call raise(error, file%path // ' ' // complaint, failure_of_files)
    else
      call raise(error, file%path // ': ' // name // ' ' // complaint, failure_of_files)
    end if
  end subroutine agree_in_file
end module attrito_core_hdf5_file
