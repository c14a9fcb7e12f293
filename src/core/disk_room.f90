!> Is there room on the disk? Asked before HDF5 writes: where it finds out by itself, it crashes as the program ends.
module attrito_core_disk_room
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_int64_t, c_null_char
  use, intrinsic :: iso_fortran_env, only: int64
  implicit none
  private
  public :: has_room_for

  !> Read and write for the owner, read for others
  integer(c_int), parameter :: access_mode = int(o'644', c_int)

  interface
    integer(c_int) function c_creat(path, mode) bind(c, name='creat')
      import :: c_char, c_int
      !> Path of the file or dataset
      character(kind=c_char), intent(in) :: path(*)
      !> Number of the mode
      integer(c_int), value :: mode
    end function c_creat
    integer(c_int) function c_allocate(file, start, length) bind(c, name='posix_fallocate')
      import :: c_int, c_int64_t
      !> Descriptor of the file
      integer(c_int), value :: file
      !> First byte of the room; bytes of the room
      integer(c_int64_t), value :: start, length
    end function c_allocate
    integer(c_int) function c_close(file) bind(c, name='close')
      import :: c_int
      !> Descriptor of the file
      integer(c_int), value :: file
    end function c_close
    integer(c_int) function c_unlink(path) bind(c, name='unlink')
      import :: c_char, c_int
      !> Path of the file or dataset
      character(kind=c_char), intent(in) :: path(*)
    end function c_unlink
  end interface

contains

  !> Whether a new file of this size can be made, over an old one if there is one; leaves none.
  logical function has_room_for(path, bytes)
    !> Where
    character(*), intent(in) :: path
    !> Its size
    integer(int64), intent(in) :: bytes
    integer(c_int) :: file, status

    file = c_creat(path//c_null_char, access_mode)
    has_room_for = file >= 0
    if (.not. has_room_for) return
    has_room_for = c_allocate(file, 0_c_int64_t, max(bytes, 1_int64)) == 0
    status = c_close(file)
    status = c_unlink(path//c_null_char)
  end function has_room_for
end module attrito_core_disk_room
