!> The best approximations to modes in a space, by its image under A = K^{-1} M, many right-hand sides a solve.
!>
!> $$ X^T M A X\, y = \theta\, X^T M X\, y, \qquad \lambda = 1/\theta, \qquad \phi = X y $$
!>
!> X y rather than A X y / theta: A would magnify what rounding leaves of the lowest modes in all others.
module attrito_reduce_rayleigh_ritz
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs, transposed_product
  use attrito_reduce_pencil, only: pencil_type
  use attrito_reduce_turned_columns, only: turn
  implicit none
  private
  public :: rayleigh_ritz

  !> Eigenvalues of A, relative to the largest one, that count as nothing
  real(wp), parameter :: nothing = 1.0e-13_wp ! derived

contains

  !> Turn a space into approximations to its modes.
  subroutine rayleigh_ritz(pencil, width, x, eigenvalues, status)
    !> K and M
    class(pencil_type), intent(in) :: pencil
    !> Vectors solved for at a time
    integer, intent(in) :: width
    !> This rank's rows of the space [rows, m]; then of the modes, fewer where the space holds no more
    real(wp), allocatable, intent(inout) :: x(:, :)
    !> Ascending
    real(wp), allocatable, intent(out) :: eigenvalues(:)
    !> Not 0: a product or a solve failed, or the space is less than its number of vectors says
    integer, intent(out) :: status
    real(wp), allocatable :: inertia(:, :), image(:, :), h(:, :), g(:, :), theta(:), y(:, :)
    integer :: first, last, kept, m

    m = size(x, 2)
    status = 0
    allocate (eigenvalues(0))
    if (m == 0) return
    allocate (h(m, m), g(m, m))
    do first = 1, m, width
      last = min(first + width - 1, m)
      allocate (inertia(size(x, 1), last - first + 1), image(size(x, 1), last - first + 1))
      call pencil%mass(x(:, first:last), inertia, status)
      if (status == 0) call pencil%solve(inertia, image, status)
      if (status /= 0) return
      g(:, first:last) = transposed_product(x, inertia)
      call pencil%mass(image, inertia, status)
      if (status /= 0) return
      h(:, first:last) = transposed_product(x, inertia)
      deallocate (inertia, image)
    end do
    call pencil%ranks%sum(h)
    call pencil%ranks%sum(g)
    call symmetric_eigenpairs(h, g, theta, y, status)
    if (status > m) call solve_within_rank(h, g, theta, y, status)
    if (status /= 0) return
    theta = theta(size(theta):1:-1)
    y = y(:, size(theta):1:-1)
    kept = count(theta > nothing*theta(1))
    eigenvalues = 1.0_wp/theta(:kept)
    call turn(x, y(:, :kept))
    if (kept < m) x = x(:, :kept)
  end subroutine rayleigh_ritz
  !> The same where the mass does not see all of the space, as that of elements with one point of integration: by what it sees,
  !> g = V s V^T, with X V s^(-1/2) in place of X.
  subroutine solve_within_rank(h, g, theta, y, status)
    !> X^T M A X and X^T M X
    real(wp), intent(in) :: h(:, :), g(:, :)
    !> Ascending; a column each
    real(wp), allocatable, intent(out) :: theta(:), y(:, :)
    !> 0, or not
    integer, intent(out) :: status
    real(wp), allocatable :: s(:), v(:, :)
    integer :: i, unseen

    call symmetric_eigenpairs(g, identity(size(g, 1)), s, v, status)
    if (status /= 0) return
    unseen = count(s <= nothing*s(size(s)))
    v = v(:, unseen + 1:)
    do i = 1, size(v, 2)
      v(:, i) = v(:, i)/sqrt(s(unseen + i))
    end do
    call symmetric_eigenpairs(matmul(transpose(v), matmul(h, v)), identity(size(v, 2)), theta, y, status)
    if (status == 0) y = matmul(v, y)
  end subroutine solve_within_rank

  pure function identity(n)
    !> Its size
    integer, intent(in) :: n
    real(wp) :: identity(n, n)
    integer :: i

    identity = 0.0_wp
    do i = 1, n
      identity(i, i) = 1.0_wp
    end do
  end function identity
end module attrito_reduce_rayleigh_ritz
