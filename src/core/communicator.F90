!> What the numerics need of MPI: a share of the contacts, sums over ranks, gathering at the root.
module attrito_core_communicator
  use mpi
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: communicator_type, new_communicator, own_communicator

  type :: communicator_type
    !> MPI communicator
    integer :: handle = -1
    !> This rank, from 0
    integer :: rank = 0
    !> Number of ranks
    integer :: ranks = 1
  contains
    procedure :: share
    procedure :: is_root
    procedure, private :: sum_vector
    procedure, private :: sum_matrix
    procedure, private :: sum_scalar
    generic :: sum => sum_scalar, sum_vector, sum_matrix
    procedure :: largest
    procedure :: gather_columns
    procedure :: gather_columns_everywhere
    procedure :: gather_numbers
    procedure :: gather_integers
    procedure :: broadcast
    procedure :: broadcast_integer
  end type communicator_type

contains

  !> Wrap an MPI communicator (Fortran handle).
  function new_communicator(handle) result(self)
    !> MPI communicator
    integer, intent(in) :: handle
    type(communicator_type) :: self
    integer :: ierr

    self%handle = handle
    call MPI_Comm_rank(handle, self%rank, ierr)
    call MPI_Comm_size(handle, self%ranks, ierr)
  end function new_communicator

  !> This rank alone.
  function own_communicator() result(self)
    type(communicator_type) :: self

    self%handle = MPI_COMM_SELF
  end function own_communicator

  !> Is this the rank that solves the small dense systems and writes what is not spread?
  pure logical function is_root(self)
    class(communicator_type), intent(in) :: self

    is_root = self%rank == 0
  end function is_root

  !> This rank's contiguous share first..last of `total` items, as even as whole numbers allow.
  pure subroutine share(self, total, first, last)
    class(communicator_type), intent(in) :: self
    !> Number of items over all ranks
    integer, intent(in) :: total
    !> First item of this rank, from 1
    integer, intent(out) :: first
    !> Last item of this rank; first - 1 when there is none
    integer, intent(out) :: last

    first = int(int(total, 8)*self%rank/self%ranks) + 1
    last = int(int(total, 8)*(self%rank + 1)/self%ranks)
  end subroutine share

  !> Sum over ranks, on every rank.
  subroutine sum_scalar(self, x)
    class(communicator_type), intent(in) :: self
    !> This rank's part, then the sum
    real(wp), intent(inout) :: x
    integer :: ierr

    call MPI_Allreduce(MPI_IN_PLACE, x, 1, MPI_DOUBLE_PRECISION, MPI_SUM, self%handle, ierr)
  end subroutine sum_scalar

  !> Sum over ranks, on every rank.
  subroutine sum_vector(self, x)
    class(communicator_type), intent(in) :: self
    !> This rank's part, then the sum
    real(wp), intent(inout), contiguous :: x(:)
    integer :: ierr

    call MPI_Allreduce(MPI_IN_PLACE, x, size(x), MPI_DOUBLE_PRECISION, MPI_SUM, self%handle, ierr)
  end subroutine sum_vector

  !> Sum over ranks, on every rank.
  subroutine sum_matrix(self, x)
    class(communicator_type), intent(in) :: self
    !> This rank's part, then the sum
    real(wp), intent(inout), contiguous :: x(:, :)
    integer :: ierr

    call MPI_Allreduce(MPI_IN_PLACE, x, size(x), MPI_DOUBLE_PRECISION, MPI_SUM, self%handle, ierr)
  end subroutine sum_matrix

  !> The largest value on any rank, on every rank.
  function largest(self, x) result(value)
    class(communicator_type), intent(in) :: self
    !> This rank's value
    real(wp), intent(in) :: x
    real(wp) :: value
    integer :: ierr

    call MPI_Allreduce(x, value, 1, MPI_DOUBLE_PRECISION, MPI_MAX, self%handle, ierr)
  end function largest

  !> Each rank's columns, side by side in the order of ranks, at the root (elsewhere `all` has no columns).
  subroutine gather_columns(self, mine, all)
    class(communicator_type), intent(in) :: self
    !> This rank's columns [n, mine]
    real(wp), intent(in), contiguous :: mine(:, :)
    !> Every rank's columns [n, all]
    real(wp), allocatable, intent(out) :: all(:, :)
    integer :: counts(self%ranks), offsets(self%ranks), i, ierr

    call MPI_Gather(size(mine), 1, MPI_INTEGER, counts, 1, MPI_INTEGER, 0, self%handle, ierr)
    if (.not. self%is_root()) counts = 0
    offsets = [(sum(counts(:i - 1)), i=1, self%ranks)]
    allocate (all(size(mine, 1), sum(counts)/max(size(mine, 1), 1)))
    call MPI_Gatherv(mine, size(mine), MPI_DOUBLE_PRECISION, all, counts, offsets, MPI_DOUBLE_PRECISION, 0, &
                     self%handle, ierr)
  end subroutine gather_columns

  !> Each rank's columns, side by side in the order of ranks, on every rank.
  subroutine gather_columns_everywhere(self, mine, all)
    class(communicator_type), intent(in) :: self
    !> This rank's columns [n, mine]
    real(wp), intent(in), contiguous :: mine(:, :)
    !> Every rank's columns [n, all]
    real(wp), intent(out), contiguous :: all(:, :)
    integer :: counts(self%ranks), offsets(self%ranks), i, ierr

    call MPI_Allgather(size(mine), 1, MPI_INTEGER, counts, 1, MPI_INTEGER, self%handle, ierr)
    offsets = [(sum(counts(:i - 1)), i=1, self%ranks)]
    call MPI_Allgatherv(mine, size(mine), MPI_DOUBLE_PRECISION, all, counts, offsets, MPI_DOUBLE_PRECISION, self%handle, ierr)
  end subroutine gather_columns_everywhere

  !> Each rank's numbers, one after another in the order of ranks, on every rank. They belong to a question that must be the same
  !> everywhere, of which a number is a sign: ranks on unlike processors may come to round differently, and never meet again.
  subroutine gather_numbers(self, mine, sign_of_question, all)
    class(communicator_type), intent(in) :: self
    !> This rank's numbers; the sign
    real(wp), intent(in), contiguous :: mine(:)
    real(wp), intent(in) :: sign_of_question
    !> Every rank's numbers
    real(wp), allocatable, intent(out) :: all(:)
    integer :: sent(3), got(3, self%ranks), counts(self%ranks), offsets(self%ranks), i, ierr

    sent(1) = size(mine)
    sent(2:) = transfer(sign_of_question, sent(2:))
    call MPI_Allgather(sent, 3, MPI_INTEGER, got, 3, MPI_INTEGER, self%handle, ierr)
    if (any(got(2:, :) /= spread(sent(2:), 2, self%ranks))) error stop 'ranks differ by rounding: run on processors of one kind'
    counts = got(1, :)
    offsets = [(sum(counts(:i - 1)), i=1, self%ranks)]
    allocate (all(sum(counts)))
    call MPI_Allgatherv(mine, size(mine), MPI_DOUBLE_PRECISION, all, counts, offsets, MPI_DOUBLE_PRECISION, self%handle, ierr)
  end subroutine gather_numbers

  !> Each rank's integers, one after another in the order of ranks, on every rank.
  subroutine gather_integers(self, mine, all)
    class(communicator_type), intent(in) :: self
    !> This rank's integers
    integer, intent(in), contiguous :: mine(:)
    !> Every rank's integers
    integer, allocatable, intent(out) :: all(:)
    integer :: counts(self%ranks), offsets(self%ranks), i, ierr

    call MPI_Allgather(size(mine), 1, MPI_INTEGER, counts, 1, MPI_INTEGER, self%handle, ierr)
    offsets = [(sum(counts(:i - 1)), i=1, self%ranks)]
    allocate (all(sum(counts)))
    call MPI_Allgatherv(mine, size(mine), MPI_INTEGER, all, counts, offsets, MPI_INTEGER, self%handle, ierr)
  end subroutine gather_integers

  !> The root's values on every rank.
  subroutine broadcast(self, x)
    class(communicator_type), intent(in) :: self
    !> Values
    real(wp), intent(inout), contiguous :: x(:)
    integer :: ierr

    call MPI_Bcast(x, size(x), MPI_DOUBLE_PRECISION, 0, self%handle, ierr)
  end subroutine broadcast

  !> The root's integer on every rank.
  subroutine broadcast_integer(self, i)
    class(communicator_type), intent(in) :: self
    !> Value
    integer, intent(inout) :: i
    integer :: ierr

    call MPI_Bcast(i, 1, MPI_INTEGER, 0, self%handle, ierr)
  end subroutine broadcast_integer
end module attrito_core_communicator
