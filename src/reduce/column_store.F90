!> Columns of the basis on disk, so that memory holds a block of them at a time, and an interrupted reduction finds what is done.
!>
!> A block of columns is a file of its own in a folder, `<name>_<first>_<last>.h5` with one dataset `/columns [columns, n]`. It gets
!> that name when it is whole: whoever finds it may use it, whatever befell the process that wrote it. So does a few numbers' file.
!> Beside each column is the sum of its bits, each number's turned by its place, by which damage since then is seen.
module attrito_reduce_column_store
  use, intrinsic :: iso_c_binding, only: c_char, c_int, c_null_char
  use, intrinsic :: iso_fortran_env, only: int64
  use mpi, only: MPI_ALLREDUCE, MPI_BARRIER, MPI_BXOR, MPI_IN_PLACE, MPI_INTEGER8
  use attrito_core_errors, only: error_type, failure_of_files, raise
  use attrito_core_hdf5_array, only: read_block, write_array, write_block
  use attrito_core_hdf5_dataset, only: array_shape, create_array
  use attrito_core_hdf5_file, only: close_file, create_file, hdf5_file_type, open_file
  use attrito_core_kinds, only: wp
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: column_store_type, block_type, new_blocks

  !> A run of columns that are stored together
  type :: block_type
    character(12) :: name = ''
    integer :: first = 1, last = 0
  contains
    procedure :: columns => columns_of
  end type block_type

  type :: column_store_type
    !> Exists, and belongs to this reduction alone
    character(:), allocatable :: folder
  contains
    procedure :: has
    procedure :: has_all
    procedure :: put
    procedure :: get
    procedure :: has_numbers
    procedure :: put_numbers
    procedure :: get_numbers
    procedure :: drop_numbers
  end type column_store_type

  interface
    integer(c_int) function c_rename(from, to) bind(c, name='rename')
      import :: c_char, c_int
      character(kind=c_char), intent(in) :: from(*), to(*)
    end function c_rename
  end interface

contains

  !> Runs of at most `size` columns, `count` of them together.
  pure function new_blocks(name, count, size) result(blocks)
    !> What the columns are
    character(*), intent(in) :: name
    !> Columns that are kept together; most columns of a run
    integer, intent(in) :: count, size
    type(block_type), allocatable :: blocks(:)
    integer :: i

    blocks = [(block_type(name, i, min(i + size - 1, count)), i=1, count, size)]
  end function new_blocks

  pure integer function columns_of(self)
    class(block_type), intent(in) :: self

    columns_of = self%last - self%first + 1
  end function columns_of

  !> Is this block there?
  logical function has(self, block)
    class(column_store_type), intent(in) :: self
    !> Which columns
    type(block_type), intent(in) :: block

    inquire (file=path_of(self, block), exist=has)
  end function has

  !> Are all these blocks there?
  logical function has_all(self, blocks)
    class(column_store_type), intent(in) :: self
    !> Which columns
    type(block_type), intent(in) :: blocks(:)
    integer :: i

    has_all = .false.
    do i = 1, size(blocks)
      if (.not. self%has(blocks(i))) return
    end do
    has_all = .true.
  end function has_all

  !> Store a block.
  subroutine put(self, split, block, columns, error)
    class(column_store_type), intent(in) :: self
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> Which columns
    type(block_type), intent(in) :: block
    !> This rank's rows [rows, columns]
    real(wp), intent(in), contiguous :: columns(:, :)
    !> The disk is full
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file

    call create_file(file, split%ranks%handle, path_of(self, block)//'.partial', error, &
                     numbers=int(block%columns(), int64)*split%n)
    if (allocated(error)) return
    call create_array(file, '/columns', 'real64', [block%columns(), split%n], 'columns of the basis, one a row', &
                      'user length per coordinate', error)
    if (.not. allocated(error)) call write_block(file, '/columns', [0, split%first - 1], columns, error)
    if (.not. allocated(error)) call write_array(file, '/sums', sums_of(split, columns), 'sums of bits', '1', error)
    call close_file(file, error)
    if (.not. allocated(error)) call complete(split, path_of(self, block), error)
  end subroutine put

  !> Fetch a block, or its first columns.
  subroutine get(self, split, block, columns, error)
    class(column_store_type), intent(in) :: self
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> Which columns
    type(block_type), intent(in) :: block
    !> This rank's rows [rows, columns]
    real(wp), intent(out), contiguous :: columns(:, :)
    !> It is not there
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file

    call open_file(file, split%ranks%handle, path_of(self, block), error)
    if (allocated(error)) return
    call read_block(file, '/columns', [0, split%first - 1], columns, error)
    if (.not. allocated(error)) call check(file, path_of(self, block), sums_of(split, columns), error)
    call close_file(file)
  end subroutine get

  !> Are these numbers there?
  logical function has_numbers(self, name)
    class(column_store_type), intent(in) :: self
    !> Name of the numbers
    character(*), intent(in) :: name

    inquire (file=self%folder//'/'//name//'.h5', exist=has_numbers)
  end function has_numbers

  !> Store numbers that all ranks hold.
  subroutine put_numbers(self, split, name, numbers, error)
    class(column_store_type), intent(in) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Name of the numbers
    character(*), intent(in) :: name
    !> The same on every rank
    real(wp), intent(in), contiguous :: numbers(:)
    !> The disk is full
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file

    call create_file(file, split%ranks%handle, self%folder//'/'//name//'.h5.partial', error, numbers=size(numbers, kind=int64))
    if (allocated(error)) return
    call write_array(file, '/numbers', numbers, 'what a step has found', 'as in rom.h5', error)
    if (.not. allocated(error)) call write_array(file, '/sums', [sum_of(numbers, 1)], 'sums of bits', '1', error)
    call close_file(file, error)
    if (.not. allocated(error)) call complete(split, self%folder//'/'//name//'.h5', error)
  end subroutine put_numbers

  !> Fetch numbers.
  subroutine get_numbers(self, split, name, numbers, error)
    class(column_store_type), intent(in) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Name of the numbers
    character(*), intent(in) :: name
    !> The same on every rank
    real(wp), allocatable, intent(out) :: numbers(:)
    !> They are not there
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file
    integer, allocatable :: extent(:)

    call open_file(file, split%ranks%handle, self%folder//'/'//name//'.h5', error)
    if (allocated(error)) return
    extent = array_shape(file, '/numbers', error)
    if (.not. allocated(error)) then
      allocate (numbers(extent(1)))
      call read_block(file, '/numbers', [0], numbers, error)
      if (.not. allocated(error)) call check(file, self%folder//'/'//name//'.h5', [sum_of(numbers, 1)], error)
    end if
    call close_file(file)
  end subroutine get_numbers

  !> Remove numbers; none do no harm.
  subroutine drop_numbers(self, split, name)
    class(column_store_type), intent(in) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Name of the numbers
    character(*), intent(in) :: name
    integer :: unit, status, ierr
    logical :: there

    there = self%has_numbers(name)
    if (split%ranks%is_root() .and. there) then
      open (newunit=unit, file=self%folder//'/'//name//'.h5', iostat=status)
      if (status == 0) close (unit, status='delete', iostat=status)
    end if
    call MPI_BARRIER(split%ranks%handle, ierr)
  end subroutine drop_numbers

  !> Of each column, over all ranks.
  function sums_of(split, columns) result(sums)
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> This rank's rows [rows, columns]
    real(wp), intent(in) :: columns(:, :)
    integer(int64) :: sums(size(columns, 2))
    integer :: i, ierr

    do i = 1, size(sums)
      sums(i) = sum_of(columns(:, i), split%first)
    end do
    call MPI_ALLREDUCE(MPI_IN_PLACE, sums, size(sums), MPI_INTEGER8, MPI_BXOR, split%ranks%handle, ierr)
  end function sums_of

  !> The exclusive or of the bits of numbers, each turned by its place.
  pure integer(int64) function sum_of(numbers, first)
    real(wp), intent(in) :: numbers(:)
    !> Place of the first
    integer, intent(in) :: first
    integer :: i

    sum_of = 0_int64
    do i = 1, size(numbers)
      sum_of = ieor(sum_of, ishftc(transfer(numbers(i), sum_of), modulo(first + i, bit_size(i))))
    end do
  end function sum_of

  !> Are the sums those that were written?
  subroutine check(file, path, sums, error)
    !> The file, and its path
    type(hdf5_file_type), intent(in) :: file
    character(*), intent(in) :: path
    !> Of what was read of it, the same on every rank
    integer(int64), intent(in) :: sums(:)
    !> They are not
    type(error_type), allocatable, intent(out) :: error
    integer(int64) :: written(size(sums))

    call read_block(file, '/sums', [0], written, error)
    if (allocated(error)) return
    if (any(written /= sums)) call raise(error, path//' is damaged: what it holds is not what was written: expected to be deleted,'// &
                                         ' so that its step is taken again', failure_of_files)
  end subroutine check

  !> Give a whole file its name.
  subroutine complete(split, path, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Path of the file
    character(*), intent(in) :: path
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer :: status, ierr

    status = 0
    if (split%ranks%is_root()) status = c_rename(path//'.partial'//c_null_char, path//c_null_char)
    call split%ranks%broadcast_integer(status)
    if (status /= 0) call raise(error, path//' cannot be given its name', failure_of_files)
    call MPI_BARRIER(split%ranks%handle, ierr)
  end subroutine complete

  pure function path_of(self, block) result(path)
    class(column_store_type), intent(in) :: self
    !> Columns that are stored together
    type(block_type), intent(in) :: block
    character(:), allocatable :: path
    character(32) :: range

    write (range, '(a, i0.6, a, i0.6, a)') '_', block%first, '_', block%last, '.h5'
    path = self%folder//'/'//trim(block%name)//trim(range)
  end function path_of
end module attrito_reduce_column_store
