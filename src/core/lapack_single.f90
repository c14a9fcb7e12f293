!> LU factors in single precision, for what only preconditions.
module attrito_core_lapack_single
  use attrito_core_kinds, only: sp
  implicit none
  private
  public :: factor_single, solve_factored_single

  interface
    subroutine sgetrf(m, n, a, lda, ipiv, info)
      import :: sp
      !> Rows; columns; leading dimension of a
      integer, intent(in) :: m, n, lda
      !> Matrix A of the operation
      real(sp), intent(inout) :: a(lda, *)
      !> Row interchanges; 0, or what is at fault
      integer, intent(out) :: ipiv(*), info
    end subroutine sgetrf
    subroutine sgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: sp
      !> Transposed or not
      character, intent(in) :: trans
      !> Rows; right-hand sides; leading dimension of a; row interchanges; leading dimension of b
      integer, intent(in) :: n, nrhs, lda, ipiv(*), ldb
      !> Matrix A of the operation
      real(sp), intent(in) :: a(lda, *)
      !> Right-hand sides, then solutions
      real(sp), intent(inout) :: b(ldb, *)
      !> 0, or what is at fault
      integer, intent(out) :: info
    end subroutine sgetrs
  end interface

contains

  !> LU factors of a matrix, in place.
  subroutine factor_single(a, pivots, info)
    !> Matrix [n, n], then its factors
    real(sp), intent(inout), contiguous :: a(:, :)
    !> Row interchanges [n]
    integer, intent(out), contiguous :: pivots(:)
    !> 0, or the number of the zero pivot
    integer, intent(out) :: info

    info = 0
    if (size(a, 1) > 0) call sgetrf(size(a, 1), size(a, 1), a, size(a, 1), pivots, info)
  end subroutine factor_single

  !> Solve with the factors of `factor_single`.
  subroutine solve_factored_single(factors, pivots, b)
    !> Factors [n, n]
    real(sp), intent(in), contiguous :: factors(:, :)
    !> Row interchanges [n]
    integer, intent(in), contiguous :: pivots(:)
    !> Right-hand side [n], then the solution
    real(sp), intent(inout), contiguous :: b(:)
    integer :: info

    if (size(b) > 0) call sgetrs('N', size(factors, 1), 1, factors, size(factors, 1), pivots, b, size(b), info)
  end subroutine solve_factored_single
end module attrito_core_lapack_single
