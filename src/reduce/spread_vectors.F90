!> Vectors of the full model from rank 0 to all ranks, each its rows.
module attrito_reduce_spread_vectors
  use mpi, only: MPI_DOUBLE_PRECISION, MPI_GATHER, MPI_INTEGER
  use attrito_core_kinds, only: wp
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: spread_vectors

contains

  !> Give each rank its rows.
  subroutine spread_vectors(split, vectors, mine)
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> [n, vectors], looked at on rank 0 only
    real(wp), intent(in), contiguous :: vectors(:, :)
    !> This rank's rows [rows, vectors]
    real(wp), allocatable, intent(out) :: mine(:, :)
    integer :: counts(split%ranks%ranks), offsets(split%ranks%ranks), i, ierr

    call MPI_GATHER(split%rows(), 1, MPI_INTEGER, counts, 1, MPI_INTEGER, 0, split%ranks%handle, ierr)
    if (.not. split%ranks%is_root()) counts = 0
    offsets = [(sum(counts(:i - 1)), i=1, size(counts))]
    allocate (mine(split%rows(), size(vectors, 2)))
    do i = 1, size(vectors, 2)
      call MPI_Scatterv(vectors(:, i), counts, offsets, MPI_DOUBLE_PRECISION, mine(:, i), split%rows(), MPI_DOUBLE_PRECISION, &
                        0, split%ranks%handle, ierr)
    end do
  end subroutine spread_vectors
end module attrito_reduce_spread_vectors
