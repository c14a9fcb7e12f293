!> Cholesky factors of dense matrices by LAPACK, a = r^T r, and solves by them.
module attrito_core_cholesky
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: factor_positive, solve_positive

  interface
    subroutine dpotrf(uplo, n, a, lda, info)
      import :: wp
      !> Which triangle: upper or lower
      character, intent(in) :: uplo
      !> Size; leading dimension
      integer, intent(in) :: n, lda
      !> Matrix A of the operation
      real(wp), intent(inout) :: a(lda, *)
      !> LAPACK's code: 0 is success
      integer, intent(out) :: info
    end subroutine dpotrf
    subroutine dpotrs(uplo, n, nrhs, a, lda, b, ldb, info)
      import :: wp
      !> Which triangle: upper or lower
      character, intent(in) :: uplo
      !> Sizes; leading dimensions
      integer, intent(in) :: n, nrhs, lda, ldb
      !> Factors
      real(wp), intent(in) :: a(lda, *)
      !> Matrix B of the operation
      real(wp), intent(inout) :: b(ldb, *)
      !> LAPACK's code: 0 is success
      integer, intent(out) :: info
    end subroutine dpotrs
  end interface

contains

  !> Factor a symmetric positive definite matrix in place.
  subroutine factor_positive(a, info)
    !> [n, n], its upper triangle; then r
    real(wp), intent(inout), contiguous :: a(:, :)
    !> 0; above 0: not positive definite
    integer, intent(out) :: info

    info = 0
    if (size(a) > 0) call dpotrf('U', size(a, 1), a, size(a, 1), info)
  end subroutine factor_positive

  !> Solve a x = b by the factors of a.
  subroutine solve_positive(r, b)
    !> [n, n] from `factor_positive`
    real(wp), intent(in), contiguous :: r(:, :)
    !> Right-hand sides [n, k], then solutions
    real(wp), intent(inout), contiguous :: b(:, :)
    integer :: info

    if (size(b) > 0) call dpotrs('U', size(r, 1), size(b, 2), r, size(r, 1), b, size(b, 1), info)
  end subroutine solve_positive
end module attrito_core_cholesky
