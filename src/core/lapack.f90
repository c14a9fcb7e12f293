!> The few LAPACK routines that attrito calls, with their interfaces, behind names that say what they do.
module attrito_core_lapack
  use attrito_core_kinds, only: sp, wp
  implicit none
  private
  public :: multiply_by_transpose, add_transposed_product, transposed_product, product_with_few, subtract_product, times_vector
  public :: solve_dense, factor_dense, solve_factored, invert, symmetric_eigenpairs
  public :: eigenvalues_of, complex_eigenvalues_of, singular_values, complex_singular_values, null_space

  interface
    subroutine dgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: wp
      !> Transposed or not
      character, intent(in) :: transa, transb
      !> Rows, columns, or inner dimension; leading dimension of a; leading dimension of b; leading dimension of c
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      !> Factor on the product; factor on what is there before; matrix A of the operation; matrix B, or right-hand sides
      real(wp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      !> Matrix C of the operation
      real(wp), intent(inout) :: c(ldc, *)
    end subroutine dgemm
    subroutine sgemm(transa, transb, m, n, k, alpha, a, lda, b, ldb, beta, c, ldc)
      import :: sp
      !> Transposed or not
      character, intent(in) :: transa, transb
      !> Rows, columns, or inner dimension; leading dimension of a; leading dimension of b; leading dimension of c
      integer, intent(in) :: m, n, k, lda, ldb, ldc
      !> Factor on the product; factor on what is there before; matrix A of the operation; matrix B, or right-hand sides
      real(sp), intent(in) :: alpha, beta, a(lda, *), b(ldb, *)
      !> Matrix C of the operation
      real(sp), intent(inout) :: c(ldc, *)
    end subroutine sgemm
    subroutine dgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
      import :: wp
      !> Transposed or not
      character, intent(in) :: trans
      !> Rows, columns, or inner dimension; leading dimension of a; distance of its elements
      integer, intent(in) :: m, n, lda, incx, incy
      !> Factor on the product; matrix A of the operation; vector that is multiplied; factor on what is there before
      real(wp), intent(in) :: alpha, a(lda, *), x(*), beta
      !> Vector that takes the product
      real(wp), intent(inout) :: y(*)
    end subroutine dgemv
    subroutine sgemv(trans, m, n, alpha, a, lda, x, incx, beta, y, incy)
      import :: sp
      !> Transposed or not
      character, intent(in) :: trans
      !> Rows, columns, or inner dimension; leading dimension of a; distance of its elements
      integer, intent(in) :: m, n, lda, incx, incy
      !> Factor on the product; matrix A of the operation; vector that is multiplied; factor on what is there before
      real(sp), intent(in) :: alpha, a(lda, *), x(*), beta
      !> Vector that takes the product
      real(sp), intent(inout) :: y(*)
    end subroutine sgemv
    subroutine dgesv(n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      !> Rows, columns, or inner dimension; number of right-hand sides; leading dimension of a; leading dimension of b
      integer, intent(in) :: n, nrhs, lda, ldb
      !> Matrix A of the operation; matrix B, or right-hand sides
      real(wp), intent(inout) :: a(lda, *), b(ldb, *)
      !> Row interchanges; 0: done; else LAPACK's code
      integer, intent(out) :: ipiv(*), info
    end subroutine dgesv
    subroutine dgetrf(m, n, a, lda, ipiv, info)
      import :: wp
      !> Rows, columns, or inner dimension; leading dimension of a
      integer, intent(in) :: m, n, lda
      !> Matrix A of the operation
      real(wp), intent(inout) :: a(lda, *)
      !> Row interchanges; 0: done; else LAPACK's code
      integer, intent(out) :: ipiv(*), info
    end subroutine dgetrf
    subroutine dgetrs(trans, n, nrhs, a, lda, ipiv, b, ldb, info)
      import :: wp
      !> Transposed or not
      character, intent(in) :: trans
      !> Rows; number of right-hand sides; leading dimension of a; row interchanges; leading dimension of b
      integer, intent(in) :: n, nrhs, lda, ipiv(*), ldb
      !> Factors of dgetrf
      real(wp), intent(in) :: a(lda, *)
      !> Right-hand sides
      real(wp), intent(inout) :: b(ldb, *)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine dgetrs
    subroutine dgetri(n, a, lda, ipiv, work, lwork, info)
      import :: wp
      !> Rows, columns, or inner dimension; leading dimension of a; row interchanges; size of the workspace, -1: ask for it
      integer, intent(in) :: n, lda, ipiv(*), lwork
      !> Matrix A of the operation
      real(wp), intent(inout) :: a(lda, *)
      !> Workspace
      real(wp), intent(out) :: work(*)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine dgetri
    subroutine dsygvd(itype, jobz, uplo, n, a, lda, b, ldb, w, work, lwork, iwork, liwork, info)
      import :: wp
      !> What is asked for, see LAPACK; which triangle is given
      character, intent(in) :: jobz, uplo
      integer, intent(in) :: itype, n, lda, ldb, lwork, liwork
      !> Matrix A of the operation; matrix B, or right-hand sides; workspace
      real(wp), intent(inout) :: a(lda, *), b(ldb, *), work(*)
      !> Eigenvalues or singular values
      real(wp), intent(out) :: w(*)
      !> Workspace
      integer, intent(inout) :: iwork(*)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine dsygvd
    subroutine dpstrf(uplo, n, a, lda, piv, rank, tol, work, info)
      import :: wp
      !> Which triangle is given
      character, intent(in) :: uplo
      !> Rows, columns, or inner dimension; leading dimension of a
      integer, intent(in) :: n, lda
      !> Matrix A of the operation; workspace
      real(wp), intent(inout) :: a(lda, *), work(*)
      !> See LAPACK
      real(wp), intent(in) :: tol
      !> See LAPACK; 0: done; else LAPACK's code
      integer, intent(out) :: piv(*), rank, info
    end subroutine dpstrf
    subroutine dtrtrs(uplo, trans, diag, n, nrhs, a, lda, b, ldb, info)
      import :: wp
      !> Which triangle is given; transposed or not; what is asked for, see LAPACK
      character, intent(in) :: uplo, trans, diag
      !> Rows, columns, or inner dimension; number of right-hand sides; leading dimension of a; leading dimension of b
      integer, intent(in) :: n, nrhs, lda, ldb
      !> Matrix A of the operation
      real(wp), intent(in) :: a(lda, *)
      !> Matrix B, or right-hand sides
      real(wp), intent(inout) :: b(ldb, *)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine dtrtrs
    subroutine dgeev(jobvl, jobvr, n, a, lda, wr, wi, vl, ldvl, vr, ldvr, work, lwork, info)
      import :: wp
      !> What is asked for, see LAPACK
      character, intent(in) :: jobvl, jobvr
      !> Rows, columns, or inner dimension; leading dimension of a; leading dimension; size of the workspace, -1: ask for it
      integer, intent(in) :: n, lda, ldvl, ldvr, lwork
      !> Matrix A of the operation; workspace
      real(wp), intent(inout) :: a(lda, *), work(*)
      !> See LAPACK; vectors
      real(wp), intent(out) :: wr(*), wi(*), vl(ldvl, *), vr(ldvr, *)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine dgeev
    subroutine zgeev(jobvl, jobvr, n, a, lda, w, vl, ldvl, vr, ldvr, work, lwork, rwork, info)
      import :: wp
      !> What is asked for, see LAPACK
      character, intent(in) :: jobvl, jobvr
      !> Rows, columns, or inner dimension; leading dimension of a; leading dimension; size of the workspace, -1: ask for it
      integer, intent(in) :: n, lda, ldvl, ldvr, lwork
      !> Matrix A of the operation; workspace
      complex(wp), intent(inout) :: a(lda, *), work(*)
      !> Eigenvalues or singular values; vectors
      complex(wp), intent(out) :: w(*), vl(ldvl, *), vr(ldvr, *)
      !> Workspace
      real(wp), intent(out) :: rwork(*)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine zgeev
    subroutine dgesvd(jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, info)
      import :: wp
      !> What is asked for, see LAPACK
      character, intent(in) :: jobu, jobvt
      !> Rows, columns, or inner dimension; leading dimension of a; leading dimension; size of the workspace, -1: ask for it
      integer, intent(in) :: m, n, lda, ldu, ldvt, lwork
      !> Matrix A of the operation; workspace
      real(wp), intent(inout) :: a(lda, *), work(*)
      !> Eigenvalues or singular values; vectors
      real(wp), intent(out) :: s(*), u(ldu, *), vt(ldvt, *)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine dgesvd
    subroutine zgesvd(jobu, jobvt, m, n, a, lda, s, u, ldu, vt, ldvt, work, lwork, rwork, info)
      import :: wp
      !> What is asked for, see LAPACK
      character, intent(in) :: jobu, jobvt
      !> Rows, columns, or inner dimension; leading dimension of a; leading dimension; size of the workspace, -1: ask for it
      integer, intent(in) :: m, n, lda, ldu, ldvt, lwork
      !> Matrix A of the operation; workspace
      complex(wp), intent(inout) :: a(lda, *), work(*)
      !> Eigenvalues or singular values; workspace
      real(wp), intent(out) :: s(*), rwork(*)
      !> Vectors
      complex(wp), intent(out) :: u(ldu, *), vt(ldvt, *)
      !> 0: done; else LAPACK's code
      integer, intent(out) :: info
    end subroutine zgesvd
  end interface

  !> a^T b, which matmul of a transpose is slower than
  interface transposed_product
    module procedure transposed_product_single
    module procedure transposed_product_double
  end interface transposed_product

  !> y = a x
  interface times_vector
    module procedure times_vector_single
    module procedure times_vector_double
  end interface times_vector

contains

  !> c = a b^T, of arrays whose leading dimensions may be several at once.
  subroutine multiply_by_transpose(m, n, k, a, b, c)
    !> Rows, columns, or inner dimension
    integer, intent(in) :: m, n, k
    !> [m, k], [n, k] and [m, n]
    real(wp), intent(in) :: a(m, k), b(n, k)
    !> Matrix C of the operation
    real(wp), intent(out) :: c(m, n)

    call dgemm('N', 'T', m, n, k, 1.0_wp, a, m, b, n, 0.0_wp, c, m)
  end subroutine multiply_by_transpose

  !> c <- c + a^T b, of the first rows of both.
  subroutine add_transposed_product(m, n, k, a, rows_a, b, rows_b, c)
    !> Rows, columns, or inner dimension; rows that a and b have
    integer, intent(in) :: m, n, k, rows_a, rows_b
    !> [k of rows_a, m], [k of rows_b, n] and [m, n]
    real(wp), intent(in) :: a(rows_a, m), b(rows_b, n)
    !> Matrix C of the operation
    real(wp), intent(inout) :: c(m, n)

    call dgemm('T', 'N', m, n, k, 1.0_wp, a, rows_a, b, rows_b, 1.0_wp, c, m)
  end subroutine add_transposed_product

  function transposed_product_single(a, b) result(c)
    !> [n, p]
    real(sp), intent(in), contiguous :: a(:, :)
    !> [n, q]
    real(sp), intent(in), contiguous :: b(:, :)
    real(sp) :: c(size(a, 2), size(b, 2))

    c = 0.0_sp
    if (size(c) == 0 .or. size(a, 1) == 0) return
    call sgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_sp, a, size(a, 1), b, size(b, 1), 0.0_sp, c, size(a, 2))
  end function transposed_product_single

  function transposed_product_double(a, b) result(c)
    !> [n, p]
    real(wp), intent(in), contiguous :: a(:, :)
    !> [n, q]
    real(wp), intent(in), contiguous :: b(:, :)
    real(wp) :: c(size(a, 2), size(b, 2))

    c = 0.0_wp
    if (size(c) == 0 .or. size(a, 1) == 0) return
    call dgemm('T', 'N', size(a, 2), size(b, 2), size(a, 1), 1.0_wp, a, size(a, 1), b, size(b, 1), 0.0_wp, c, size(a, 2))
  end function transposed_product_double

  !> a^T b for few columns of b, one by one: faster than a product of matrices while they are fewer than some eight.
  function product_with_few(a, b) result(c)
    !> [n, q]
    real(wp), intent(in), contiguous :: a(:, :)
    !> [n, few]
    real(wp), intent(in), contiguous :: b(:, :)
    real(wp) :: c(size(a, 2), size(b, 2))
    integer :: i

    if (size(a, 1) == 0) c = 0.0_wp
    if (size(c) == 0 .or. size(a, 1) == 0) return
    do i = 1, size(b, 2)
      call dgemv('T', size(a, 1), size(a, 2), 1.0_wp, a, size(a, 1), b(:, i), 1, 0.0_wp, c(:, i), 1)
    end do
  end function product_with_few

  subroutine times_vector_single(a, x, y)
    !> [m, n], [n] and [m]
    real(sp), intent(in), contiguous :: a(:, :), x(:)
    !> Vector that takes the product
    real(sp), intent(out), contiguous :: y(:)

    if (size(a) == 0) y = 0.0_sp
    if (size(a) == 0) return
    call sgemv('N', size(a, 1), size(a, 2), 1.0_sp, a, size(a, 1), x, 1, 0.0_sp, y, 1)
  end subroutine times_vector_single

  subroutine times_vector_double(a, x, y)
    !> [m, n], [n] and [m]
    real(wp), intent(in), contiguous :: a(:, :), x(:)
    !> Vector that takes the product
    real(wp), intent(out), contiguous :: y(:)

    if (size(a) == 0) y = 0.0_wp
    if (size(a) == 0) return
    call dgemv('N', size(a, 1), size(a, 2), 1.0_wp, a, size(a, 1), x, 1, 0.0_wp, y, 1)
  end subroutine times_vector_double

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

  !> LU factors of a matrix, in place, for one right-hand side after another.
  subroutine factor_dense(a, pivots, info)
    !> Matrix [n, n], then its factors
    real(wp), intent(inout), contiguous :: a(:, :)
    !> Row interchanges [n]
    integer, allocatable, intent(out) :: pivots(:)
    !> 0, or the number of the zero pivot
    integer, intent(out) :: info

    info = 0
    allocate (pivots(size(a, 1)))
    if (size(a, 1) > 0) call dgetrf(size(a, 1), size(a, 1), a, size(a, 1), pivots, info)
  end subroutine factor_dense

  !> Solve with the factors of `factor_dense`.
  subroutine solve_factored(a, pivots, b)
    !> Factors [n, n]
    real(wp), intent(in), contiguous :: a(:, :)
    !> Row interchanges [n]
    integer, intent(in) :: pivots(:)
    !> Right-hand sides [n, k], then solutions
    real(wp), intent(inout), contiguous :: b(:, :)
    integer :: info

    if (size(a, 1) > 0) call dgetrs('N', size(a, 1), size(b, 2), a, size(a, 1), pivots, b, size(b, 1), info)
  end subroutine solve_factored

  !> Inverse of a matrix, in place: to be applied so often that its making, three times that of its factors, does not count.
  subroutine invert(a, info)
    !> Matrix [n, n], then its inverse
    real(wp), intent(inout), contiguous :: a(:, :)
    !> 0, or the number of the zero pivot
    integer, intent(out) :: info
    !> Block size of dgetri's workspace
    integer, parameter :: columns_together = 64 ! conventional
    real(wp), allocatable :: work(:)
    integer, allocatable :: pivots(:)

    info = 0
    if (size(a, 1) == 0) return
    allocate (pivots(size(a, 1)), work(columns_together*size(a, 1)))
    call dgetrf(size(a, 1), size(a, 1), a, size(a, 1), pivots, info)
    if (info == 0) call dgetri(size(a, 1), a, size(a, 1), pivots, work, size(work), info)
  end subroutine invert

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

  !> Vectors in columns that a symmetric matrix makes nothing of. Pivoted Cholesky factors P^T a P = r^T r go as far as pivots are
  !> positive; n = P [-r_11^-1 r_12; 1] spans what is left, and n^T a n is the rest of the matrix, small, whose own null space it is.
  !> The last pivot is 1 / (a^-1)_jj, j where the vector of the least eigenvalue is largest: up to n times that eigenvalue.
  subroutine null_space(a, tolerance, vectors)
    !> [n, n], its diagonal of order one
    real(wp), intent(in) :: a(:, :)
    !> Eigenvalues up to which are none
    real(wp), intent(in) :: tolerance
    !> [n, nullity]
    real(wp), allocatable, intent(out) :: vectors(:, :)
    real(wp), allocatable :: factors(:, :), work(:), permuted(:, :), eigenvalues(:), turned(:, :)
    integer, allocatable :: pivots(:)
    integer :: n, rank, left, i, info

    n = size(a, 1)
    factors = 0.5_wp*(a + transpose(a))
    allocate (pivots(n), work(2*n))
    call dpstrf('U', n, factors, n, pivots, rank, n*tolerance, work, info)
    left = n - rank
    allocate (permuted(n, left), vectors(n, left), source=0.0_wp)
    if (left == 0) return
    permuted(:rank, :) = -factors(:rank, rank + 1:)
    if (rank > 0) call dtrtrs('U', 'N', 'N', rank, left, factors, n, permuted, n, info)
    do i = 1, left
      permuted(rank + i, i) = 1.0_wp
    end do
    vectors(pivots, :) = permuted
    call symmetric_eigenpairs(matmul(transpose(vectors), matmul(a, vectors)), matmul(transpose(vectors), vectors), &
                              eigenvalues, turned, info)
    vectors = matmul(vectors, turned(:, pack([(i, i=1, left)], abs(eigenvalues) <= tolerance)))
  end subroutine null_space

  !> Eigenvalues of a real matrix.
  subroutine eigenvalues_of(matrix, eigenvalues, info)
    !> [n, n]
    real(wp), intent(in) :: matrix(:, :)
    !> [n]
    complex(wp), allocatable, intent(out) :: eigenvalues(:)
    !> 0, or not: no convergence
    integer, intent(out) :: info
    real(wp), allocatable :: a(:, :), re(:), im(:), work(:)
    real(wp) :: none(1, 1)
    integer :: n

    n = size(matrix, 1)
    a = matrix
    allocate (re(n), im(n), work(34*n + 1))
    info = 0
    if (n > 0) call dgeev('N', 'N', n, a, n, re, im, none, 1, none, 1, work, size(work), info)
    eigenvalues = cmplx(re, im, wp)
  end subroutine eigenvalues_of

  !> Eigenvalues of a complex matrix, and its right eigenvectors in columns.
  subroutine complex_eigenvalues_of(matrix, eigenvalues, vectors, info)
    !> [n, n]
    complex(wp), intent(in) :: matrix(:, :)
    !> [n], [n, n]
    complex(wp), allocatable, intent(out) :: eigenvalues(:), vectors(:, :)
    !> 0, or not: no convergence
    integer, intent(out) :: info
    complex(wp), allocatable :: a(:, :), work(:)
    complex(wp) :: none(1, 1)
    real(wp), allocatable :: room(:)
    integer :: n

    n = size(matrix, 1)
    a = matrix
    allocate (eigenvalues(n), vectors(n, n), work(34*n + 1), room(2*n))
    info = 0
    if (n > 0) call zgeev('N', 'V', n, a, n, eigenvalues, none, 1, vectors, n, work, size(work), room, info)
  end subroutine complex_eigenvalues_of

  !> Singular values, descending, with left singular vectors in columns: a = u diag(s) v^T.
  subroutine singular_values(matrix, s, u, info)
    !> [n, n]
    real(wp), intent(in) :: matrix(:, :)
    !> [n], [n, n]
    real(wp), allocatable, intent(out) :: s(:), u(:, :)
    !> 0, or not: no convergence
    integer, intent(out) :: info
    real(wp), allocatable :: a(:, :), work(:)
    real(wp) :: none(1, 1)
    integer :: n

    n = size(matrix, 1)
    a = matrix
    allocate (s(n), u(n, n), work(66*n + 1))
    info = 0
    if (n > 0) call dgesvd('A', 'N', n, n, a, n, s, u, n, none, 1, work, size(work), info)
  end subroutine singular_values

  !> Singular values, descending, of a complex matrix with no more columns than rows: a = u diag(s) v^H.
  subroutine complex_singular_values(matrix, s, u, v, info)
    !> [m, n]
    complex(wp), intent(in) :: matrix(:, :)
    !> Eigenvalues or singular values
    real(wp), allocatable, intent(out) :: s(:)
    !> [m, n], [n, n]
    complex(wp), allocatable, intent(out) :: u(:, :), v(:, :)
    !> 0, or not: no convergence
    integer, intent(out) :: info
    complex(wp), allocatable :: a(:, :), work(:)
    real(wp), allocatable :: room(:)
    integer :: m, n

    m = size(matrix, 1)
    n = size(matrix, 2)
    a = matrix
    allocate (s(n), u(m, n), v(n, n), work(34*(m + n) + 1), room(5*n + 1))
    call zgesvd('S', 'S', m, n, a, m, s, u, m, v, n, work, size(work), room, info)
    v = conjg(transpose(v))
  end subroutine complex_singular_values
end module attrito_core_lapack
