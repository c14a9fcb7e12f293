!> The lowest natural modes of a reduced model, whose matrices are dense.
!>
!> $$ \tilde K \phi = \lambda \tilde M \phi, \qquad \phi^T \tilde M \phi = 1 $$
!>
!> Of a small model by LAPACK, all of them. Of a large one by block Lanczos on K + s M, which is definite though the structure floats;
!> twice as many as long as the highest is not above those that are asked for, and by LAPACK where they do not converge. n^3/3
!> operations of a Cholesky factorisation, where LAPACK's n^3 reduce to a standard problem and as many again to tridiagonal form,
!> half of them bound by memory.
module attrito_reduce_reduced_modes
  use attrito_core_cholesky, only: factor_positive, solve_positive
  use attrito_core_communicator, only: own_communicator
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: subtract_product, symmetric_eigenpairs
  use attrito_reduce_block_lanczos, only: lanczos_type, new_lanczos
  use attrito_reduce_pencil, only: pencil_type
  implicit none
  private
  public :: find_reduced_modes

  !> K + s M by its Cholesky factors, and M
  type, extends(pencil_type) :: dense_pencil_type
    real(wp), allocatable :: factor(:, :), mass_matrix(:, :)
  contains
    procedure :: solve
    procedure :: mass
    procedure :: report
  end type dense_pencil_type

  !> Coordinates up to which LAPACK finds all modes
  integer, parameter :: small = 1000 ! conventional
  !> Modes sought first; vectors solved for together
  integer, parameter :: first_sought = 16, width = 8 ! conventional
  !> Residual of a mode relative to its eigenvalue
  real(wp), parameter :: tolerance = 1.0e-12_wp ! conventional
  !> s as a part of the eigenvalue up to which modes are sought, and by what it grows while rounding leaves K + s M indefinite
  real(wp), parameter :: shift_part = 1.0e-4_wp, shift_growth = 100.0_wp ! guess
  !> Steps of the power method: enough for the largest eigenvalue's order of magnitude
  integer, parameter :: power_steps = 20 ! guess

contains

  !> Modes up to an eigenvalue, and some above; rigid ones, and the elastic ones up to a number.
  subroutine find_reduced_modes(stiffness, inertia, top, most, rigid, eigenvalues, shapes, largest, info)
    !> K and M [n, n]
    real(wp), intent(in), contiguous :: stiffness(:, :), inertia(:, :)
    !> Eigenvalue up to which all are sought, above 0, unless that is more elastic ones than `most`
    real(wp), intent(in) :: top
    integer, intent(in) :: most
    !> Part of the largest eigenvalue up to which modes are rigid
    real(wp), intent(in) :: rigid
    !> Ascending; shapes in columns
    real(wp), allocatable, intent(out) :: eigenvalues(:), shapes(:, :)
    !> Largest eigenvalue, of a large model its order of magnitude
    real(wp), intent(out) :: largest
    !> Not 0: the mass is not positive definite
    integer, intent(out) :: info
    type(dense_pencil_type) :: pencil
    real(wp) :: shift
    integer :: sought, n

    n = size(stiffness, 1)
    largest = 0.0_wp
    if (n <= small) then
      call find_all(stiffness, inertia, eigenvalues, shapes, largest, info)
      return
    end if
    call find_largest(stiffness, inertia, largest, info)
    if (info == 0) call new_dense_pencil(pencil, stiffness, inertia, top, largest, shift, info)
    if (info /= 0) return
    sought = first_sought
    do
      call find_lowest(pencil, shift, sought, eigenvalues, shapes, info)
      if (info /= 0) return
      if (size(eigenvalues) < sought) exit
      if (sought == n) return
      if (eigenvalues(sought) > top .or. count(eigenvalues > rigid*largest) >= most) return
      sought = min(2*sought, n)
    end do
    call find_all(stiffness, inertia, eigenvalues, shapes, largest, info)
  end subroutine find_reduced_modes

  !> All modes, by LAPACK.
  subroutine find_all(stiffness, inertia, eigenvalues, shapes, largest, info)
    !> K and M [n, n]
    real(wp), intent(in), contiguous :: stiffness(:, :), inertia(:, :)
    !> Ascending; shapes in columns
    real(wp), allocatable, intent(out) :: eigenvalues(:), shapes(:, :)
    !> The largest eigenvalue, 0 of an empty model
    real(wp), intent(out) :: largest
    !> Not 0: the mass is not positive definite
    integer, intent(out) :: info

    call symmetric_eigenpairs(stiffness, inertia, eigenvalues, shapes, info)
    largest = 0.0_wp
    if (info == 0 .and. size(eigenvalues) > 0) largest = eigenvalues(size(eigenvalues))
  end subroutine find_all

  !> The largest eigenvalue's order of magnitude, from below, by the power method.
  subroutine find_largest(stiffness, inertia, largest, info)
    !> K and M [n, n]
    real(wp), intent(in), contiguous :: stiffness(:, :), inertia(:, :)
    !> Rayleigh quotient of the last vector
    real(wp), intent(out) :: largest
    !> Not 0: the mass is not positive definite
    integer, intent(out) :: info
    real(wp), allocatable :: factor(:, :), x(:, :), force(:, :)
    integer :: step

    largest = 0.0_wp
    factor = inertia
    call factor_positive(factor, info)
    if (info /= 0) return
    x = start_block(size(stiffness, 1), 1)
    do step = 1, power_steps
      force = product_of(stiffness, x)
      largest = sum(x*force)/sum(x*product_of(inertia, x))
      call solve_positive(factor, force)
      x = force/maxval(abs(force))
    end do
  end subroutine find_largest

  !> K + s M, factored.
  subroutine new_dense_pencil(self, stiffness, inertia, top, largest, shift, info)
    !> The pencil
    type(dense_pencil_type), intent(out) :: self
    !> K and M [n, n]
    real(wp), intent(in), contiguous :: stiffness(:, :), inertia(:, :)
    !> Eigenvalue up to which modes are sought, and the largest one
    real(wp), intent(in) :: top, largest
    !> s
    real(wp), intent(out) :: shift
    !> Not 0: the stiffness is not positive
    integer, intent(out) :: info

    self%ranks = own_communicator()
    self%mass_matrix = inertia
    shift = shift_part*top
    do
      self%factor = stiffness + shift*inertia
      call factor_positive(self%factor, info)
      if (info == 0 .or. shift > largest) return
      shift = shift_growth*shift
    end do
  end subroutine new_dense_pencil

  !> So many of the lowest modes, or all there are; fewer where no more converge.
  subroutine find_lowest(pencil, shift, sought, eigenvalues, shapes, info)
    !> K + s M, and M
    type(dense_pencil_type), intent(in) :: pencil
    !> s
    real(wp), intent(in) :: shift
    !> Number of modes
    integer, intent(in) :: sought
    !> Ascending; shapes in columns
    real(wp), allocatable, intent(out) :: eigenvalues(:), shapes(:, :)
    !> Not 0: the search failed
    integer, intent(out) :: info
    type(lanczos_type) :: search

    associate (n => size(pencil%factor, 1))
      call new_lanczos(search, pencil, start_block(n, width), sought, min(n, 2*sought + 4*width), tolerance, info)
    end associate
    if (info /= 0) return
    eigenvalues = search%eigenvalues - shift
    shapes = search%v(:, :size(eigenvalues))
  end subroutine find_lowest

  !> Vectors that lie along no mode: the same on every machine.
  pure function start_block(n, columns) result(block)
    !> Rows and columns
    integer, intent(in) :: n, columns
    real(wp) :: block(n, columns)
    integer :: i, j

    do j = 1, columns
      do i = 1, n
        block(i, j) = 0.5_wp + fraction_of(i*sqrt(2.0_wp) + j*(i + 1)*sqrt(3.0_wp))
      end do
    end do
  end function start_block

  elemental real(wp) function fraction_of(x)
    !> A number
    real(wp), intent(in) :: x

    fraction_of = x - floor(x)
  end function fraction_of

  function product_of(a, x) result(y)
    !> Factors
    real(wp), intent(in), contiguous :: a(:, :), x(:, :)
    real(wp) :: y(size(a, 1), size(x, 2))

    y = 0.0_wp
    call subtract_product(a, -x, y)
  end function product_of

  !> y = (K + s M)^-1 x.
  subroutine solve(self, x, y, status)
    class(dense_pencil_type), intent(in) :: self
    !> Right-hand sides
    real(wp), intent(in), contiguous :: x(:, :)
    !> Solutions
    real(wp), intent(out), contiguous :: y(:, :)
    !> 0
    integer, intent(out) :: status

    status = 0
    y = x
    call solve_positive(self%factor, y)
  end subroutine solve

  !> y = M x.
  subroutine mass(self, x, y, status)
    class(dense_pencil_type), intent(in) :: self
    !> Factors
    real(wp), intent(in), contiguous :: x(:, :)
    !> Products
    real(wp), intent(out), contiguous :: y(:, :)
    !> 0
    integer, intent(out) :: status

    status = 0
    y = 0.0_wp
    call subtract_product(self%mass_matrix, -x, y)
  end subroutine mass

  !> Nobody listens.
  subroutine report(self, converged)
    class(dense_pencil_type), intent(in) :: self
    !> How many modes have converged
    integer, intent(in) :: converged
  end subroutine report
end module attrito_reduce_reduced_modes
