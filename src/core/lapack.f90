!> The few LAPACK routines that attrito calls, with their interfaces, behind names that say what they do.
module attrito_core_lapack
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: multiply_by_transpose, transposed_product, subtract_product
  public :: solve_dense, factor, solve_factored, factor_complex, solve_factored_complex, symmetric_eigenpairs

  interface
    subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: wp
      character, intent(in) :: transa, transb
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      real(wp), intent(inout) :: c(ldc, *)
    end subroutine dgemm
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      integer, intent(in) :: n, nrhs, lda, ldb
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv
    subroutine dgetrf(m, n, a, lda, ipiv, info)
      import :: wp
      integer, intent(in) :: m, n, lda
      real(wp), intent(inout) :: a(lda, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine dgetrf
    subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      character, intent(in) :: trans
      integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
      real(wp), intent(in) :: a(lda, *)
      real(wp), intent(inout) :: b(ldb, *)
      integer, intent(out) :: info
    end subroutine dgetrs
    subroutine zgetrf(m, n, a, lda, ipiv, info)
      import :: wp
      integer, intent(in) :: m, n, lda
      complex(wp), intent(inout) :: a(lda, *)
      integer, intent(out) :: ipiv(*), info
    end subroutine zgetrf
    subroutine zgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      character, intent(in) :: trans
      integer, intent(in) :: n, nrhs, lda, ldb, ipiv(*)
      complex(wp), intent(in) :: a(lda, *)
      complex(wp), intent(inout) :: b(ldb, *)
      integer, intent(out) :: info
    end subroutine zgetrs
    subroutine dsygvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, iwork, liwork, info)
      import :: wp
      character, intent(in) :: jobz, uplo
      integer, intent(in) :: itype, n, lda, ldb, lwork, liwork
      real(wp), intent(inout) :: a(lda, *), b(ldb, *), work(*)
      real(wp), intent(out) :: w(*)
      integer, intent(inout) :: iwork(*)
      integer, intent(out) :: info
    end subroutine dsygvd
  end interface

contains

  !> c = a b^T, of arrays whose leading dimensions may be several at once.
  subroutine multiply_by_transpose(m, n, k, a, b, c)
    integer, intent(in) :: m, n, k
    !> [m, k], [n, k] and [m, n]
    real(wp), intent(in) :: a(m, k), b(n, k)
    real(wp), intent(out) :: c(m, n)

    call dgemm('N', 'T', m, n, k, 1.0_wp, a, m, b, n, 0.0_wp, c, m)
  end subroutine multiply_by_transpose

  !> a^T b, which matmul of a transpose is slower than.
  function transposed_product(a, b) result(c)
    !> [n, p]
    real(wp), intent(in), contiguous :: a(:, :)
    !> [n, q]
    real(wp), intent(in), contiguous :: b(:, :)
    real(wp) :: c(size(a, 2), size(b, 2))

    c = 0.0_wp
    if (size(c) == 0 .or. size(a, 1) == 0) return
    call dgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_wp, a, size(a, 1), b, size(b, 1), 0.0_wp, c, size(a, 2))
  end function transposed_product

  !> c <- c - a b.
  subroutine subtract_product(a, b, c)
    !> [n, p]
    real(wp), intent(in), contiguous :: a(:, :)
    !> [p, q]
    real(wp), intent(in), contiguous :: b(:, :)
    !> [n, q]
    real(wp), intent(inout), contiguous :: c(:, :)

    if (size(c) == 0 .or. size(a, 2) == 0) return
    call dgemm('N', 'N', size(c, 1), size(c, 2), size(a, 2), -1.0_wp, a, size(a, 1), b, size(b, 1), 1.0_wp, c, size(c, 1))
  end subroutine subtract_product

  !> Solve a x = b by LU with partial pivoting; `a` and `b` are overwritten, `b` by x.
  subroutine solve_dense(a, b, info)
    !> Matrix [n, n], destroyed
    real(wp), intent(inout), contiguous :: a(:, :)
    !> Right-hand sides [n, k], then solutions
    real(wp), intent(inout), contiguous :: b(:, :)
    !> 0, or the number of the zero pivot
    integer, intent(out) :: info
    integer, allocatable :: pivots(:)

    info = 0
    if (size(a, 1) == 0) return
    allocate (pivots(size(a, 1)))
    call dgesv(size(a, 1), size(b, 2), a, size(a, 1), pivots, b, size(b, 1), info)
  end subroutine solve_dense

  !> LU factors of a matrix, in place.
  subroutine factor(a, pivots, info)
    !> Matrix [n, n], then its factors
    real(wp), intent(inout), contiguous :: a(:, :)
    !> Row interchanges [n]
    integer, intent(out), contiguous :: pivots(:)
    !> 0, or the number of the zero pivot
    integer, intent(out) :: info

    call dgetrf(size(a, 1), size(a, 1), a, size(a, 1), pivots, info)
  end subroutine factor

  !> Solution with the factors of `factor`, of one right-hand side [n].
  function solve_factored(factors, pivots, b) result(x)
    !> Factors [n, n]
    real(wp), intent(in), contiguous :: factors(:, :)
    !> Row interchanges [n]
    integer, intent(in), contiguous :: pivots(:)
    real(wp), intent(in) :: b(:)
    real(wp) :: x(size(b))
    integer :: info

    x = b
    call dgetrs('N', size(b), 1, factors, size(factors, 1), pivots, x, size(b), info)
  end function solve_factored

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
  subroutine solve_factored_complex(factors, pivots, b)
    !> Factors [n, n]
    complex(wp), intent(in), contiguous :: factors(:, :)
    !> Row interchanges [n]
    integer, intent(in), contiguous :: pivots(:)
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: b(:, :)
    integer :: info

    call zgetrs('N', size(factors, 1), size(b, 2), factors, size(factors, 1), pivots, b, size(b, 1), info)
  end subroutine solve_factored_complex

  !> All eigenpairs of the symmetric pair k x = lambda m x, with x^T m x = 1, ascending.
  subroutine symmetric_eigenpairs(k, m, eigenvalues, eigenvectors, info)
    !> Symmetric matrix [n, n]
    real(wp), intent(in) :: k(:, :)
    !> Symmetric positive definite matrix [n, n]
    real(wp), intent(in) :: m(:, :)
    !> Eigenvalues [n]
    real(wp), allocatable, intent(out) :: eigenvalues(:)
    !> Eigenvectors in columns [n, n]
    real(wp), allocatable, intent(out) :: eigenvectors(:, :)
    !> 0; above n: m is not positive definite
    integer, intent(out) :: info
    real(wp), allocatable :: b(:, :), work(:)
    integer, allocatable :: iwork(:)
    integer :: n

    n = size(k, 1)
    allocate (eigenvalues(n), work(1 + 6*n + 2*n*n), iwork(3 + 5*n))
    eigenvectors = 0.5_wp*(k + transpose(k))
    b = 0.5_wp*(m + transpose(m))
    call dsygvd(1, 'V', 'U', n, eigenvectors, n, b, n, eigenvalues, work, size(work), iwork, size(iwork), info)
  end subroutine symmetric_eigenpairs
end module attrito_core_lapack
