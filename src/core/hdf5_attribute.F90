!> Attributes of an HDF5 file: what describes the file, a group or a dataset. Usage: see `attrito_core_hdf5_file`.
module attrito_core_hdf5_attribute
  use, intrinsic :: iso_c_binding, only: c_char, c_loc, c_null_char, c_ptr
  use, intrinsic :: iso_fortran_env, only: int64
  use hdf5, only: hid_t, hsize_t, &
    h5oopen_f, h5oclose_f, h5acreate_f, h5awrite_f, h5aclose_f, h5aexists_f, h5adelete_f, &
    h5screate_f, h5screate_simple_f, h5sclose_f, h5tcopy_f, h5tclose_f, h5tset_cset_f, h5kind_to_type, &
    H5S_SCALAR_F, H5T_STRING, H5T_CSET_UTF8_F, H5_INTEGER_KIND, H5_REAL_KIND
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_file, only: agree_in_file, hdf5_file_type
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: write_attribute

  !> Write an attribute, replacing one of the same name. In a list of texts, trailing blanks are not stored.
  interface write_attribute
    procedure write_text_attribute
    procedure write_texts_attribute
    procedure write_integer_attribute
    procedure write_long_attribute
    procedure write_real_attribute
  end interface write_attribute

contains

  !> Write one text to an attribute of a dataset, a group or the root.
  subroutine write_text_attribute(file, object, name, value, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Dataset or group that carries it; `/` for the root
    character(*), intent(in) :: object
    !> Name of the attribute
    character(*), intent(in) :: name
    !> UTF-8
    character(*), intent(in) :: value
    !> No such object
    type(error_type), allocatable, intent(out) :: error
    character(kind=c_char, len=:), allocatable, target :: text
    type(c_ptr), target :: address(1)
    integer(hid_t) :: kind

    text = value // c_null_char
    address(1) = c_loc(text)
    kind = text_type()
    call put_attribute(file, object, name, kind, c_loc(address), -1, error)
    call release_type(kind)
  end subroutine write_text_attribute

  !> Write a list of texts to an attribute.
  subroutine write_texts_attribute(file, object, name, value, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Dataset or group that carries it
    character(*), intent(in) :: object
    !> Name of the attribute
    character(*), intent(in) :: name
    !> UTF-8
    character(*), intent(in) :: value(:)
    !> No such object
    type(error_type), allocatable, intent(out) :: error
    character(kind=c_char, len=len(value) + 1), target :: text(size(value))
    type(c_ptr), target :: address(size(value))
    integer(hid_t) :: kind
    integer :: i

    do i = 1, size(value)
      text(i) = trim(value(i)) // c_null_char
      address(i) = c_loc(text(i))
    end do
    kind = text_type()
    call put_attribute(file, object, name, kind, c_loc(address), size(value), error)
    call release_type(kind)
  end subroutine write_texts_attribute

  !> Write a whole number to an attribute.
  subroutine write_integer_attribute(file, object, name, value, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Dataset or group that carries it
    character(*), intent(in) :: object
    !> Name of the attribute
    character(*), intent(in) :: name
    !> The number
    integer, intent(in) :: value
    !> No such object
    type(error_type), allocatable, intent(out) :: error

    call write_long_attribute(file, object, name, int(value, int64), error)
  end subroutine write_integer_attribute

  !> Write a long whole number to an attribute.
  subroutine write_long_attribute(file, object, name, value, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Dataset or group that carries it
    character(*), intent(in) :: object
    !> Name of the attribute
    character(*), intent(in) :: name
    !> The number
    integer(int64), intent(in) :: value
    !> No such object
    type(error_type), allocatable, intent(out) :: error
    integer(int64), target :: copy

    copy = value
    call put_attribute(file, object, name, h5kind_to_type(int64, H5_INTEGER_KIND), c_loc(copy), -1, error)
  end subroutine write_long_attribute

  !> Write a real number to an attribute.
  subroutine write_real_attribute(file, object, name, value, error)
    !> The file
    type(hdf5_file_type), intent(in) :: file
    !> Dataset or group that carries it
    character(*), intent(in) :: object
    !> Name of the attribute
    character(*), intent(in) :: name
    !> The number
    real(wp), intent(in) :: value
    !> No such object
    type(error_type), allocatable, intent(out) :: error
    real(wp), target :: copy

    copy = value
    call put_attribute(file, object, name, h5kind_to_type(wp, H5_REAL_KIND), c_loc(copy), -1, error)
  end subroutine write_real_attribute

  !> Write an attribute, replacing one of the same name.
  subroutine put_attribute(file, object, name, kind, address, length, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Path of what has the attribute; name in the file
    character(*), intent(in) :: object, name
    !> Type in memory and in the file
    integer(hid_t), intent(in) :: kind
    !> The data
    type(c_ptr), intent(in) :: address
    !> Number of entries; negative: a scalar
    integer, intent(in) :: length
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer(hid_t) :: owner, space, attribute
    logical :: exists
    integer :: status, ierr

    call h5oopen_f(file%id, object, owner, status)
    call agree_in_file(file, status, 'is not there to carry the attribute ' // name, object, error)
    if (allocated(error)) return
    call h5aexists_f(owner, name, exists, ierr)
    if (exists) call h5adelete_f(owner, name, ierr)
    if (length < 0) then
      call h5screate_f(H5S_SCALAR_F, space, ierr)
    else
      call h5screate_simple_f(1, [int(length, hsize_t)], space, ierr)
    end if
    call h5acreate_f(owner, name, kind, space, attribute, status)
    if (status >= 0) call h5awrite_f(attribute, kind, address, status)
    if (status >= 0) call h5aclose_f(attribute, ierr)
    call h5sclose_f(space, ierr)
    call h5oclose_f(owner, ierr)
    call agree_in_file(file, status, 'cannot take the attribute ' // name, object, error)
  end subroutine put_attribute

  !> Text of any length in UTF-8, which h5py reads as `str`.
  function text_type() result(kind)
    integer(hid_t) :: kind
    integer :: ierr

    call h5tcopy_f(H5T_STRING, kind, ierr)
    call h5tset_cset_f(kind, H5T_CSET_UTF8_F, ierr)
  end function text_type

  subroutine release_type(kind)
    !> HDF5's type
    integer(hid_t), intent(in) :: kind
    integer :: ierr

    call h5tclose_f(kind, ierr)
  end subroutine release_type
end module attrito_core_hdf5_attribute
