!> Undamped modes of a system with Coriolis forces, in axes that turn:
!>
!> $$ (K - \omega^2 M + i \omega G) x = 0, \qquad G^H = -G, \qquad x^H M x = 1 $$
!>
!> i G is Hermitian, so all omega are real where K is positive definite; those below zero belong to the conjugate motion, of a wheel
!> to the wave that runs the other way round. Two Hermitian pencils of twice the order have these omega, the first for K that holds
!> every motion, accurate in the lowest of them,
!>
!> $$ \begin{bmatrix} -i G & M \\ M & 0 \end{bmatrix} \begin{bmatrix} x \\ \omega x \end{bmatrix}
!>    = \frac{1}{\omega} \begin{bmatrix} K & 0 \\ 0 & M \end{bmatrix} \begin{bmatrix} x \\ \omega x \end{bmatrix}, \qquad
!>    \begin{bmatrix} i G & F^H \\ F & 0 \end{bmatrix} \begin{bmatrix} \omega x \\ F x \end{bmatrix}
!>    = \omega \begin{bmatrix} M & 0 \\ 0 & I \end{bmatrix} \begin{bmatrix} \omega x \\ F x \end{bmatrix}, \quad F^H F = K, $$
!>
!> the second for K that leaves motions free. Such a motion need not be at rest: a free mass moves round circles at 2 Omega.
module attrito_linear_gyroscopic_modes
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: hermitian_eigenpairs
  use attrito_model_structure, only: structure_type
  implicit none
  private
  public :: gyroscopic_modes, gyroscopic_modes_of_diameter, gyroscopic_form

  complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
  !> Part of the highest frequency below which one is none but for rounding, of the second pencil
  real(wp), parameter :: at_rest = 1.0e-12_wp ! derived

contains

  !> All modes with omega >= 0, ascending; those at rest come first.
  subroutine gyroscopic_modes(stiffness, mass, gyroscopic, free, omega, shapes, resting, status)
    !> K, M and G [n, n]
    complex(wp), intent(in) :: stiffness(:, :), mass(:, :), gyroscopic(:, :)
    !> Motions that K leaves free
    integer, intent(in) :: free
    !> [n]
    real(wp), allocatable, intent(out) :: omega(:)
    !> In columns [n, n]
    complex(wp), allocatable, intent(out) :: shapes(:, :)
    !> How many are at rest, omega = 0
    integer, intent(out) :: resting
    !> 0, or not: K, if it leaves no motion free, or M is not positive definite
    integer, intent(out) :: status

    if (free == 0) then
      resting = 0
      call modes_by_stiffness(stiffness, mass, gyroscopic, omega, shapes, status)
    else
      call modes_by_mass(stiffness, mass, gyroscopic, free, omega, shapes, resting, status)
    end if
    if (status == 0) shapes = shapes/spread(sqrt(real(sum(conjg(shapes)*matmul(mass, shapes), 1), wp)), 1, size(shapes, 1))
  end subroutine gyroscopic_modes

  !> The same of a sector at a nodal diameter, in the coordinates that move there.
  subroutine gyroscopic_modes_of_diameter(structure, stiffness, diameter, free, omega, shapes, resting, status)
    !> The sector: mass and Coriolis forces
    type(structure_type), intent(in) :: structure
    !> Stiffness with springs on its contacts, K~_n [n, n]
    complex(wp), intent(in) :: stiffness(:, :)
    !> n; motions that the stiffness leaves free
    integer, intent(in) :: diameter, free
    !> [moving]
    real(wp), allocatable, intent(out) :: omega(:)
    !> In all coordinates [n, moving]
    complex(wp), allocatable, intent(out) :: shapes(:, :)
    !> How many are at rest
    integer, intent(out) :: resting
    !> 0, or not: stiffness or mass is not positive definite
    integer, intent(out) :: status
    complex(wp), allocatable :: mass(:, :), gyroscopic(:, :), own(:, :)

    associate (sector => structure%sector, moving => structure%sector%moving(diameter))
      mass = sector%couple(structure%mass, diameter)
      gyroscopic = sector%couple(structure%gyroscopic, diameter)
      call gyroscopic_modes(stiffness(moving, moving), mass(moving, moving), gyroscopic(moving, moving), free, omega, own, resting, &
                            status)
      if (status /= 0) return
      allocate (shapes(size(mass, 1), size(moving)), source=(0.0_wp, 0.0_wp))
      shapes(moving, :) = own
    end associate
  end subroutine gyroscopic_modes_of_diameter

  !> By the first pencil: as many eigenvalues are above zero as below.
  subroutine modes_by_stiffness(stiffness, mass, gyroscopic, omega, shapes, status)
    !> K, M and G [n, n]
    complex(wp), intent(in) :: stiffness(:, :), mass(:, :), gyroscopic(:, :)
    !> [n]
    real(wp), allocatable, intent(out) :: omega(:)
    !> In columns [n, n]
    complex(wp), allocatable, intent(out) :: shapes(:, :)
    !> 0, or not
    integer, intent(out) :: status
    complex(wp), allocatable :: vectors(:, :)
    real(wp), allocatable :: values(:)
    integer :: n

    n = size(mass, 1)
    call hermitian_eigenpairs(in_blocks(-i*gyroscopic, mass, 0.0_wp*mass), in_blocks(stiffness, 0.0_wp*mass, mass), &
                              values, vectors, status)
    if (status /= 0) return
    omega = 1.0_wp/max(values(2*n:n + 1:-1), tiny(1.0_wp))
    shapes = vectors(:n, 2*n:n + 1:-1)
  end subroutine modes_by_stiffness

  !> By the second pencil; shapes of modes at rest are motions that K leaves free.
  subroutine modes_by_mass(stiffness, mass, gyroscopic, free, omega, shapes, resting, status)
    !> K, M and G [n, n]
    complex(wp), intent(in) :: stiffness(:, :), mass(:, :), gyroscopic(:, :)
    !> Motions that K leaves free: the square of their frequency is rounding
    integer, intent(in) :: free
    !> [n]
    real(wp), allocatable, intent(out) :: omega(:)
    !> In columns [n, n]
    complex(wp), allocatable, intent(out) :: shapes(:, :)
    !> How many are at rest
    integer, intent(out) :: resting
    !> 0, or not
    integer, intent(out) :: status
    complex(wp), allocatable :: vectors(:, :), own(:, :), root(:, :), unit(:, :)
    real(wp), allocatable :: values(:), squares(:)
    integer :: n, k

    n = size(mass, 1)
    call hermitian_eigenpairs(stiffness, mass, squares, own, status)
    if (status /= 0) return
    squares(:free) = 0.0_wp
    ! With all x_r of (K, M), K = M X diag(omega_r^2) X^H M.
    root = matmul(spread(sqrt(max(squares, 0.0_wp)), 2, n)*conjg(transpose(own)), mass)
    allocate (unit(n, n), source=(0.0_wp, 0.0_wp))
    do k = 1, n
      unit(k, k) = 1.0_wp
    end do
    call hermitian_eigenpairs(in_blocks(i*gyroscopic, conjg(transpose(root)), 0.0_wp*mass), in_blocks(mass, 0.0_wp*mass, unit), &
                              values, vectors, status)
    if (status /= 0) return
    resting = n - count(values(n + 1:) > at_rest*maxval(abs(values)))
    allocate (omega(n), source=0.0_wp)
    omega(resting + 1:) = values(n + resting + 1:)
    shapes = vectors(:n, n + 1:)
    shapes(:, :resting) = own(:, :resting)
  end subroutine modes_by_mass

  !> [A, B^H; B, D] of Hermitian A and D [2 n, 2 n].
  pure function in_blocks(a, b, d) result(matrix)
    !> A, B^H and D [n, n]
    complex(wp), intent(in) :: a(:, :), b(:, :), d(:, :)
    complex(wp) :: matrix(2*size(a, 1), 2*size(a, 1))

    associate (n => size(a, 1))
      matrix(:n, :n) = a
      matrix(:n, n + 1:) = b
      matrix(n + 1:, :n) = conjg(transpose(b))
      matrix(n + 1:, n + 1:) = d
    end associate
  end function in_blocks

  !> i x^H G x of each column: what Coriolis forces do to a mode by itself [count].
  pure function gyroscopic_form(gyroscopic, vectors) result(form)
    !> G [n, n]; x in columns [n, count]
    complex(wp), intent(in) :: gyroscopic(:, :), vectors(:, :)
    real(wp) :: form(size(vectors, 2))

    form = -aimag(sum(conjg(vectors)*matmul(gyroscopic, vectors), 1))
  end function gyroscopic_form
end module attrito_linear_gyroscopic_modes
