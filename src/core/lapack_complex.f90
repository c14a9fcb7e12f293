!> LAPACK's routines for complex matrices, as `attrito_core_lapack` has those for real ones.
module attrito_core_lapack_complex
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: factor_complex, solve_factored_complex, hermitian_eigenpairs

  interface
    subroutine zgetrf(m, n, a, lda, ipiv, info)
      import :: wp
      !> Rows, columns, or inner dimension; leading dimension of a
      integer, intent(in) :: m, n, lda
      !> Matrix A of the operation
      complex(wp), intent(inout) :: a(lda, *)
      !> Row interchanges; 0: done; else LAPACK's code
      integer, intent(out) :: ipiv(*), info
    end subroutine zgetrf
    subroutine zgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      !> Transposed or not
      character, intent(in) :: trans
      integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
      !> Matrix A of the operation
      complex(wp), intent(in) :: a(lda, *)
      !> Matrix B, or right-hand sides
      complex(wp), intent(inout) :: b(ldb, *)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine zgetrs
    subroutine zhegvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, rwork, lrwork, iwork, liwork, info)
      import :: wp
      !> Kind of problem; order; leading dimension of a; leading dimension of b; sizes of the workspaces
      integer, intent(in) :: itype, n, lda, ldb, lwork, lrwork, liwork
      !> Eigenvectors or not; upper or lower triangle
      character, intent(in) :: jobz, uplo
      !> Matrix A, then eigenvectors; matrix B, then its factors
      complex(wp), intent(inout) :: a(lda, *), b(ldb, *)
      !> Eigenvalues; workspace
      real(wp), intent(out) :: w(*), rwork(*)
      !> Workspace
      complex(wp), intent(out) :: work(*)
      !> Workspace
      integer, intent(out) :: iwork(*)
      !> 0, or what has failed
      integer, intent(out) :: info
    end subroutine zhegvd
  end interface

contains

  !> LU factors of a complex matrix, in place.
  subroutine factor_complex(a, pivots, info)
    !> Matrix [n, n], then its factors
    complex(wp), intent(inout), contiguous :: a(:, :)
    !> Row interchanges [n]
    integer, intent(out), contiguous :: pivots(:)
    !> 0, or the number of the zero pivot
    integer, intent(out) :: info

    call zgetrf(size(a, 1), size(a, 1), a, size(a, 1), pivots, info)
  end subroutine factor_complex

  !> Solve with the factors of `factor_complex`.
  subroutine solve_factored_complex(factors, pivots, b, adjoint)
    !> Factors [n, n]
    complex(wp), intent(in), contiguous :: factors(:, :)
    !> Row interchanges [n]
    integer, intent(in), contiguous :: pivots(:)
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: b(:, :)
    !> Solve with the adjoint of the matrix instead?
    logical, intent(in), optional :: adjoint
    character :: form
    integer :: info

    form = 'N'
    if (present(adjoint)) form = merge('C', 'N', adjoint)
    call zgetrs(form, size(factors, 1), size(b, 2), factors, size(factors, 1), pivots, b, size(b, 1), info)
  end subroutine solve_factored_complex

  !> All eigenpairs of the Hermitian pair k x = lambda m x, with x^H m x = 1, ascending.
  subroutine hermitian_eigenpairs(k, m, eigenvalues, eigenvectors, info)
    !> Hermitian matrix [n, n]
    complex(wp), intent(in) :: k(:, :)
    !> Hermitian positive definite matrix [n, n]
    complex(wp), intent(in) :: m(:, :)
    !> Eigenvalues [n]
    real(wp), allocatable, intent(out) :: eigenvalues(:)
    !> Eigenvectors in columns [n, n]
    complex(wp), allocatable, intent(out) :: eigenvectors(:, :)
    !> 0; above n: m is not positive definite
    integer, intent(out) :: info
    complex(wp), allocatable :: b(:, :), work(:)
    real(wp), allocatable :: rwork(:)
    integer, allocatable :: iwork(:)
    integer :: n

    n = size(k, 1)
    allocate (eigenvalues(n), work(2*n + n*n), rwork(1 + 5*n + 2*n*n), iwork(3 + 5*n))
    eigenvectors = 0.5_wp*(k + conjg(transpose(k)))
    b = 0.5_wp*(m + conjg(transpose(m)))
    call zhegvd(1, 'V', 'U', n, eigenvectors, n, b, n, eigenvalues, work, size(work), rwork, size(rwork), iwork, size(iwork), info)
  end subroutine hermitian_eigenpairs
end module attrito_core_lapack_complex
