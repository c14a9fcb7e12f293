!> Lowest modes of a pencil by the block Lanczos method: many right-hand sides a solve, which is what factors on one machine like.
!>
!> $$ K \phi = \lambda M \phi, \qquad A = K^{-1} M, \qquad
!>    A V_j = V_{j+1} R_{j+1} + \sum_{i \le j} V_i H_{ij}, \qquad V^T M V = I, \qquad H y = \theta y, \quad \theta = 1/\lambda $$
!>
!> A is self-adjoint in M, so H is symmetric. Every block is made orthogonal to all before it, twice. The residual of a pair is known
!> without the vector, |A v - theta v|_M = |R_{j+1} y_j|. When the space is full the best Ritz vectors and the block that is next
!> start it again. What of a block lies in the space already is dropped (so are motions without mass, which A does not reach).
!> Products round by a part of the largest theta: a residual as small as that says no more. Without this floor the modes of a body
!> that floats, whose rigid motions have a theta millions of times as large, never count as converged.
!> Sources: Grimes, Lewis & Simon, SIAM J. Matrix Anal. Appl. 15 (1994) 228-272, doi:10.1137/S0895479888151111; Wu & Simon, SIAM J.
!> Matrix Anal. Appl. 22 (2000) 602-616, doi:10.1137/S0895479898334605 (thick restart).
module attrito_reduce_block_lanczos
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: subtract_product, symmetric_eigenpairs, transposed_product
  use attrito_reduce_pencil, only: pencil_type
  use attrito_reduce_turned_columns, only: turn
  implicit none
  private
  public :: lanczos_type, new_lanczos

  type :: lanczos_type
    !> Eigenvalues that converged, ascending; their shapes are the first columns of `v`, of unit modal mass
    real(wp), allocatable :: eigenvalues(:)
    !> This rank's rows of the space [rows, room]
    real(wp), allocatable :: v(:, :)
    !> Vectors solved for
    integer :: solves = 0
    !> V^T M A V; its upper triangle
    real(wp), allocatable, private :: h(:, :)
    !> Vectors in the space
    integer, private :: filled = 0
  contains
    procedure, private :: expand
    procedure, private :: restart
    procedure, private :: orthonormalise
  end type lanczos_type

  !> Singular values of a block, relative to the largest eigenvalue of A, that count as nothing
  real(wp), parameter :: nothing = 1.0e-13_wp ! derived
  !> Singular values that a round resolves, relative to its largest
  real(wp), parameter :: resolved = 1.0e-4_wp ! guess
  !> Restarts at most
  integer, parameter :: most_restarts = 200 ! conventional

contains

  !> Find the lowest modes, or all that there are; fewer where no more converge.
  subroutine new_lanczos(self, pencil, start, wanted, room, tolerance, status)
    !> The space, and what was found
    type(lanczos_type), intent(out) :: self
    !> K and M
    class(pencil_type), intent(in) :: pencil
    !> This rank's rows of a first block; its width is that of all blocks
    real(wp), intent(in), contiguous :: start(:, :)
    !> Number of modes
    integer, intent(in) :: wanted
    !> Vectors in the space at most; at least `wanted` and three blocks
    integer, intent(in) :: room
    !> Residual in A relative to the eigenvalue
    real(wp), intent(in) :: tolerance
    !> Not 0: a product or a solve failed
    integer, intent(out) :: status
    real(wp), allocatable :: block(:, :), inertia(:, :), next(:, :), r(:, :), theta(:), y(:, :)
    integer :: converged, restarts

    allocate (self%v(size(start, 1), room), self%h(room, room))
    self%h = 0.0_wp
    allocate (self%eigenvalues(0))
    allocate (block, mold=start)
    allocate (inertia, mold=start)
    call pencil%mass(start, inertia, status)
    if (status == 0) call pencil%solve(inertia, block, status)
    if (status == 0) call self%orthonormalise(pencil, block, inertia, r, status)
    restarts = 0
    do while (status == 0)
      call self%expand(pencil, block, inertia, next, status)
      if (status == 0) call self%orthonormalise(pencil, next, inertia, r, status)
      if (status /= 0) return
      call ritz(self%h(:self%filled, :self%filled), theta, y)
      converged = count_converged(theta, y, r, size(block, 2), tolerance)
      call pencil%report(min(converged, wanted))
      if (self%filled + size(next, 2) > room) restarts = restarts + 1
      if (converged >= wanted .or. size(next, 2) == 0 .or. restarts > most_restarts) then
        if (size(next, 2) == 0) converged = count(theta > nothing*theta(1))
        call turn(self%v(:, :self%filled), y(:, :min(converged, wanted)))
        self%eigenvalues = 1.0_wp/theta(:min(converged, wanted))
        return
      end if
      if (self%filled + size(next, 2) > room) call self%restart(theta, y, wanted, size(start, 2))
      call move_alloc(next, block)
    end do
  end subroutine new_lanczos

  !> Take a block into the space, and give what A makes of it beyond the space.
  subroutine expand(self, pencil, block, inertia, next, status)
    class(lanczos_type), intent(inout) :: self
    !> Stiffness and mass of the eigenvalue problem
    class(pencil_type), intent(in) :: pencil
    !> Orthonormal in M to the space and in itself; and M times it
    real(wp), intent(in), contiguous :: block(:, :), inertia(:, :)
    !> A times the block, less its part in the space
    real(wp), allocatable, intent(out) :: next(:, :)
    !> 0: done, else the solver's code
    integer, intent(out) :: status
    real(wp), allocatable :: weighted(:, :), part(:, :)
    integer :: first, last, pass

    first = self%filled + 1
    last = self%filled + size(block, 2)
    self%v(:, first:last) = block
    self%filled = last
    self%solves = self%solves + size(block, 2)
    allocate (next, weighted, mold=block)
    call pencil%solve(inertia, next, status)
    self%h(:last, first:last) = 0.0_wp
    do pass = 1, 2
      if (status == 0) call pencil%mass(next, weighted, status)
      if (status /= 0) return
      part = transposed_product(self%v(:, :last), weighted)
      call pencil%ranks%sum(part)
      call subtract_product(self%v(:, :last), part, next)
      self%h(:last, first:last) = self%h(:last, first:last) + part
    end do
  end subroutine expand

  !> A block as x = q r with q orthonormal in M and to the space; what is nothing is dropped.
  !>
  !> Eigenvectors of x^T M x resolve eight digits, and make orthonormal within their square. So combinations of x that are small
  !> beside the largest wait for a round of their own, and each round is done twice.
  subroutine orthonormalise(self, pencil, x, inertia, r, status)
    class(lanczos_type), intent(in) :: self
    !> Stiffness and mass of the eigenvalue problem
    class(pencil_type), intent(in) :: pencil
    !> x, then q
    real(wp), allocatable, intent(inout) :: x(:, :)
    !> M q
    real(wp), allocatable, intent(inout) :: inertia(:, :)
    !> Coefficients of the block in q
    real(wp), allocatable, intent(out) :: r(:, :)
    !> 0: done, else the solver's code
    integer, intent(out) :: status
    real(wp), allocatable :: q(:, :), small(:, :), turned(:, :), mix(:, :), rest(:, :), part(:, :), theta(:), y(:, :)
    real(wp) :: least
    integer :: width, kept, i

    width = size(x, 2)
    least = 0.0_wp
    if (self%filled > 0) least = (nothing*maxval(abs(self%h(:self%filled, :self%filled))))**2
    allocate (q(size(x, 1), 0), r(0, width))
    rest = unit_matrix(width)
    call move_alloc(x, small)
    do while (size(small, 2) > 0)
      call gram(pencil, small, inertia, part, status)
      if (status /= 0) return
      call ritz(part, theta, y)
      ! Squares of singular values, descending.
      kept = count(theta > max(least, resolved**2*theta(1)))
      if (kept == 0 .or. theta(1) <= 0.0_wp) exit
      turned = matmul(small, y)
      mix = matmul(rest, y)
      do i = 1, kept
        turned(:, i) = turned(:, i)/sqrt(theta(i))
        mix(:, i) = mix(:, i)*sqrt(theta(i))
      end do
      call polish(self, pencil, q, turned(:, :kept), mix(:, :kept), status)
      if (status /= 0) return
      q = reshape([q, turned(:, :kept)], [size(q, 1), size(q, 2) + kept])
      r = transpose(reshape([transpose(r), mix(:, :kept)], [width, size(q, 2)]))
      small = turned(:, kept + 1:)
      rest = mix(:, kept + 1:)
      if (size(small, 2) > 0) call remove(self, pencil, q, small, status)
      if (status /= 0) return
    end do
    call move_alloc(q, x)
    if (allocated(inertia)) deallocate (inertia)
    allocate (inertia, mold=x)
    if (size(x, 2) > 0) call pencil%mass(x, inertia, status)
  end subroutine orthonormalise

  !> Once more out of the space, and among themselves; `mix` follows.
  subroutine polish(self, pencil, q, x, mix, status)
    class(lanczos_type), intent(in) :: self
    !> Stiffness and mass of the eigenvalue problem
    class(pencil_type), intent(in) :: pencil
    !> Orthonormal block, a column each
    real(wp), intent(in), contiguous :: q(:, :)
    !> Block of vectors, a column each; coefficients that follow
    real(wp), intent(inout), contiguous :: x(:, :), mix(:, :)
    !> 0: done, else the solver's code
    integer, intent(out) :: status
    real(wp), allocatable :: inertia(:, :), part(:, :), theta(:), y(:, :)
    integer :: i

    call remove(self, pencil, q, x, status)
    if (status == 0) call gram(pencil, x, inertia, part, status)
    if (status /= 0) return
    call ritz(part, theta, y)
    x = matmul(x, y)
    mix = matmul(mix, y)
    do i = 1, size(theta)
      x(:, i) = x(:, i)/sqrt(theta(i))
      mix(:, i) = mix(:, i)*sqrt(theta(i))
    end do
  end subroutine polish

  !> x less its parts in the space and in q.
  subroutine remove(self, pencil, q, x, status)
    class(lanczos_type), intent(in) :: self
    !> Stiffness and mass of the eigenvalue problem
    class(pencil_type), intent(in) :: pencil
    !> Orthonormal block, a column each
    real(wp), intent(in), contiguous :: q(:, :)
    !> Block of vectors, a column each
    real(wp), intent(inout), contiguous :: x(:, :)
    !> 0: done, else the solver's code
    integer, intent(out) :: status
    real(wp), allocatable :: inertia(:, :), part(:, :)

    allocate (inertia, mold=x)
    call pencil%mass(x, inertia, status)
    part = transposed_product(self%v(:, :self%filled), inertia)
    call pencil%ranks%sum(part)
    call subtract_product(self%v(:, :self%filled), part, x)
    part = transposed_product(q, inertia)
    call pencil%ranks%sum(part)
    call subtract_product(q, part, x)
  end subroutine remove

  !> M x and x^T M x.
  subroutine gram(pencil, x, inertia, product, status)
    !> Stiffness and mass of the eigenvalue problem
    class(pencil_type), intent(in) :: pencil
    !> Block of vectors, a column each
    real(wp), intent(in), contiguous :: x(:, :)
    !> Product with the mass; products in the mass
    real(wp), allocatable, intent(out) :: inertia(:, :), product(:, :)
    !> 0: done, else the solver's code
    integer, intent(out) :: status

    allocate (inertia, mold=x)
    call pencil%mass(x, inertia, status)
    product = transposed_product(x, inertia)
    call pencil%ranks%sum(product)
  end subroutine gram

  pure function unit_matrix(n) result(unit)
    !> Number of rows
    integer, intent(in) :: n
    real(wp) :: unit(n, n)
    integer :: i

    unit = 0.0_wp
    do i = 1, n
      unit(i, i) = 1.0_wp
    end do
  end function unit_matrix

  !> Keep the best Ritz vectors; H is theirs, and what ties them to the block that is next comes with its own products.
  subroutine restart(self, theta, y, wanted, width)
    class(lanczos_type), intent(inout) :: self
    !> Ritz values, descending; ritz vectors in the space, a column each
    real(wp), intent(in) :: theta(:), y(:, :)
    !> Modes wanted, and vectors of a full block
    integer, intent(in) :: wanted, width
    integer :: kept, i

    kept = min(wanted + width, size(self%v, 2) - 2*width)
    call turn(self%v(:, :self%filled), y(:, :kept))
    self%filled = kept
    self%h = 0.0_wp
    do i = 1, kept
      self%h(i, i) = theta(i)
    end do
  end subroutine restart

  !> Eigenpairs of a symmetric matrix given by its upper triangle, descending.
  subroutine ritz(h, theta, y)
    !> Projected matrix
    real(wp), intent(in) :: h(:, :)
    !> Ritz values, descending; ritz vectors in the space, a column each
    real(wp), allocatable, intent(out) :: theta(:), y(:, :)
    real(wp) :: whole(size(h, 1), size(h, 1))
    integer :: i, info

    whole = h
    do i = 1, size(h, 1)
      whole(i + 1:, i) = whole(i, i + 1:)
    end do
    call symmetric_eigenpairs(whole, unit_matrix(size(h, 1)), theta, y, info)
    theta = theta(size(theta):1:-1)
    y = y(:, size(theta):1:-1)
  end subroutine ritz

  !> Leading pairs whose residuals are small, or no more than rounding.
  pure integer function count_converged(theta, y, r, last, tolerance) result(converged)
    !> Ritz values, descending; ritz vectors in the space, a column each; coefficients of the block in q
    real(wp), intent(in) :: theta(:), y(:, :), r(:, :)
    !> Vectors of the last block, to which r belongs
    integer, intent(in) :: last
    !> Relative tolerance
    real(wp), intent(in) :: tolerance
    real(wp) :: rest(size(r, 1))

    do converged = 0, size(theta) - 1
      if (theta(converged + 1) <= 0.0_wp) return
      rest = matmul(r, y(size(theta) - last + 1:, converged + 1))
      if (norm2(rest) > max(tolerance*theta(converged + 1), epsilon(1.0_wp)*theta(1))) return
    end do
    converged = size(theta)
  end function count_converged
end module attrito_reduce_block_lanczos
