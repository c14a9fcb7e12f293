!> The caller's procedure that receives a point, one series of the result after another.
module attrito_output_listener
  use, intrinsic :: iso_c_binding, only: c_associated, c_char, c_double, c_f_procpointer, c_funptr, c_int, c_null_char
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: listener_type, new_listener

  abstract interface
    !> An entry of a series: its path in the file; `real64` or `int32`; its sizes, slowest first; its numbers; what they are, their
    !> unit, and, where they count names, these with commas between.
    subroutine series_callback(path, kind, dimensions, extent, values, description, unit, names) bind(c)
      import :: c_char, c_double, c_int
      !> Path of the dataset; type of the numbers; what the dataset holds; unit of the dataset; names that numbers stand for
      character(kind=c_char), intent(in) :: path(*), kind(*), description(*), unit(*), names(*)
      !> Number of sizes
      integer(c_int), value :: dimensions
      !> Sizes, the slowest first
      integer(c_int), intent(in) :: extent(*)
      !> Numbers of the entry
      real(c_double), intent(in) :: values(*)
    end subroutine series_callback
  end interface

  type :: listener_type
    procedure(series_callback), pointer, nopass :: hear => null()
  contains
    procedure :: listens
    procedure :: report
  end type listener_type

contains

  !> Wrap the caller's procedure; null where nobody listens, as on all ranks but one.
  function new_listener(procedure) result(self)
    !> Procedure of the caller
    type(c_funptr), intent(in) :: procedure
    type(listener_type) :: self

    if (c_associated(procedure)) call c_f_procpointer(procedure, self%hear)
  end function new_listener

  pure logical function listens(self)
    class(listener_type), intent(in) :: self

    listens = associated(self%hear)
  end function listens

  !> Report one entry of a series.
  subroutine report(self, path, kind, extent, values, description, unit, names)
    class(listener_type), intent(in) :: self
    !> Path of the dataset; type of the numbers
    character(*), intent(in) :: path, kind
    !> Sizes of the entry, slowest first; none for a number
    integer, intent(in) :: extent(:)
    !> Fastest first, as Fortran stores them
    real(wp), intent(in) :: values(:)
    !> What the dataset holds; unit of the dataset
    character(*), intent(in) :: description, unit
    !> What whole numbers stand for
    character(*), intent(in), optional :: names(:)
    character(:), allocatable :: list
    integer :: i

    if (.not. self%listens()) return
    list = ''
    if (present(names)) then
      do i = 1, size(names)
        list = list//merge(',', ' ', i > 1)//trim(names(i))
      end do
    end if
    call self%hear(path//c_null_char, kind//c_null_char, size(extent), extent, values, description//c_null_char, &
                   unit//c_null_char, adjustl(list)//c_null_char)
  end subroutine report
end module attrito_output_listener
