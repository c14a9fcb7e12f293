!> The state of an object as one list of numbers, to be put down and taken up again bit for bit.
!>
!> A type names what it must remember once, in a procedure `keep(self, store)` that hands each component to `store%keep`. Writing, the
!> store appends it to its numbers; reading, it gives the component what was appended. So the two cannot differ.
module attrito_core_state_store
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: state_store_type, writing_store, reading_store

  type :: state_store_type
    !> What was put down
    real(wp), allocatable :: numbers(:)
    !> Numbers in use, or already read
    integer :: position = 0
    logical :: reading = .false.
    !> Reading: more was asked for than there is, or what is there is no size of an array
    logical :: broken = .false.
  contains
    procedure, private :: keep_real
    procedure, private :: keep_integer
    procedure, private :: keep_logical
    procedure, private :: keep_logicals
    procedure, private :: keep_vector
    procedure, private :: keep_matrix
    procedure, private :: keep_complex_vector
    procedure, private :: keep_complex_matrix
    generic :: keep => keep_real, keep_integer, keep_logical, keep_logicals, keep_vector, keep_matrix, keep_complex_vector, &
      keep_complex_matrix
    procedure :: is_read
    procedure, private :: keep_shape
    procedure, private :: keep_numbers
  end type state_store_type

contains

  !> An empty store, to write to.
  pure function writing_store() result(self)
    type(state_store_type) :: self

    allocate (self%numbers(64))
  end function writing_store

  !> A store to read from.
  pure function reading_store(numbers) result(self)
    !> Numbers of the store
    real(wp), intent(in) :: numbers(:)
    type(state_store_type) :: self

    self%numbers = numbers
    self%reading = .true.
  end function reading_store

  !> Was everything read, and no more?
  pure logical function is_read(self)
    class(state_store_type), intent(in) :: self

    is_read = self%reading .and. .not. self%broken .and. self%position == size(self%numbers)
  end function is_read

  subroutine keep_real(self, value)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    real(wp), intent(inout) :: value
    real(wp) :: values(1)

    values = value
    call self%keep_numbers(values)
    value = values(1)
  end subroutine keep_real

  subroutine keep_integer(self, value)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    integer, intent(inout) :: value
    real(wp) :: number

    number = real(value, wp)
    call self%keep(number)
    if (self%reading .and. abs(number) <= huge(value)) value = nint(number)
  end subroutine keep_integer

  subroutine keep_logical(self, value)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    logical, intent(inout) :: value
    real(wp) :: number

    number = merge(1.0_wp, 0.0_wp, value)
    call self%keep(number)
    value = number > 0.5_wp
  end subroutine keep_logical

  subroutine keep_logicals(self, values)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    logical, allocatable, intent(inout) :: values(:)
    real(wp), allocatable :: numbers(:)

    if (allocated(values)) numbers = merge(1.0_wp, 0.0_wp, values)
    call self%keep(numbers)
    if (.not. self%reading) return
    if (allocated(values)) deallocate (values)
    if (allocated(numbers)) values = numbers > 0.5_wp
  end subroutine keep_logicals

  subroutine keep_vector(self, values)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    real(wp), allocatable, intent(inout) :: values(:)
    integer :: extent(1)

    extent = -1
    if (allocated(values)) extent = shape(values)
    call self%keep_shape(extent)
    if (self%reading) then
      if (allocated(values)) deallocate (values)
      if (extent(1) >= 0) allocate (values(extent(1)))
    end if
    if (extent(1) >= 0) call self%keep_numbers(values)
  end subroutine keep_vector

  subroutine keep_matrix(self, values)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    real(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: column(:)
    integer :: extent(2)

    extent = -1
    if (allocated(values)) extent = shape(values)
    call self%keep_shape(extent)
    if (allocated(values)) column = reshape(values, [size(values)])
    call self%keep(column)
    if (.not. self%reading) return
    if (allocated(values)) deallocate (values)
    if (allocated(column)) values = reshape(column, extent)
  end subroutine keep_matrix

  subroutine keep_complex_vector(self, values)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    complex(wp), allocatable, intent(inout) :: values(:)
    complex(wp), allocatable :: columns(:, :)

    if (allocated(values)) columns = reshape(values, [size(values), 1])
    call self%keep(columns)
    if (.not. self%reading) return
    if (allocated(values)) deallocate (values)
    if (allocated(columns)) values = columns(:, lbound(columns, 2))
  end subroutine keep_complex_vector

  subroutine keep_complex_matrix(self, values)
    class(state_store_type), intent(inout) :: self
    !> Columns may be counted from 0
    complex(wp), allocatable, intent(inout) :: values(:, :)
    real(wp), allocatable :: real_part(:, :), imaginary_part(:, :)
    integer :: first

    first = 1
    if (allocated(values)) first = lbound(values, 2)
    call self%keep(first)
    if (allocated(values)) then
      real_part = real(values, wp)
      imaginary_part = aimag(values)
    end if
    call self%keep(real_part)
    call self%keep(imaginary_part)
    if (.not. self%reading) return
    if (allocated(values)) deallocate (values)
    if (allocated(real_part)) then
      allocate (values(size(real_part, 1), first:first + size(real_part, 2) - 1))
      values(:, :) = cmplx(real_part, imaginary_part, wp)
    end if
  end subroutine keep_complex_matrix

  !> Sizes of an array; -1 where it is not allocated.
  subroutine keep_shape(self, extent)
    class(state_store_type), intent(inout) :: self
    !> Sizes of the array
    integer, intent(inout) :: extent(:)
    integer :: i

    do i = 1, size(extent)
      call self%keep(extent(i))
    end do
    if (.not. self%reading) return
    if (any(extent < -1) .or. product(real(max(extent, 0), wp)) > size(self%numbers) - self%position) self%broken = .true.
    if (self%broken) extent = -1
  end subroutine keep_shape

  subroutine keep_numbers(self, values)
    class(state_store_type), intent(inout) :: self
    !> Kept when the store is written, else taken from it
    real(wp), intent(inout) :: values(:)
    integer :: last

    last = self%position + size(values)
    if (self%reading) then
      if (last > size(self%numbers)) self%broken = .true.
      if (self%broken) return
      values = self%numbers(self%position + 1:last)
    else
      if (last > size(self%numbers)) self%numbers = [self%numbers, spread(0.0_wp, 1, max(last, size(self%numbers)))]
      self%numbers(self%position + 1:last) = values
    end if
    self%position = last
  end subroutine keep_numbers
end module attrito_core_state_store
