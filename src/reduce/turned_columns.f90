!> Columns combined in place, in strips of rows so that no second copy of a basis is held.
module attrito_reduce_turned_columns
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: turn

  !> Rows at a time
  integer, parameter :: strip = 2048 ! conventional

contains

  !> v(:, :k) <- v y, in strips of rows.
  subroutine turn(v, y)
    !> [rows, m] and [m, k], k <= m
    real(wp), intent(inout) :: v(:, :)
    !> Coefficients in the reduced coordinates
    real(wp), intent(in) :: y(:, :)
    integer :: first, last

    do first = 1, size(v, 1), strip
      last = min(first + strip - 1, size(v, 1))
      v(first:last, :size(y, 2)) = matmul(v(first:last, :), y)
    end do
  end subroutine turn
end module attrito_reduce_turned_columns
