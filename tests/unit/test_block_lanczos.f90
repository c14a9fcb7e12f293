!> A dense pencil.
module dense_pencil
  use attrito_core_cholesky, only: solve_positive
  use attrito_core_kinds, only: wp
  use attrito_reduce_pencil, only: pencil_type
  implicit none
  private
  public :: dense_type

  !> K + s M by its Cholesky factors, and M
  type, extends(pencil_type) :: dense_type
    real(wp), allocatable :: factor(:, :), inertia(:, :)
  contains
    procedure :: solve
    procedure :: mass
    procedure :: report
  end type dense_type

contains

  subroutine solve(self, x, y, status)
    class(dense_type), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(out), contiguous :: y(:, :)
    integer, intent(out) :: status

    status = 0
    y = x
    call solve_positive(self%factor, y)
  end subroutine solve

  subroutine mass(self, x, y, status)
    class(dense_type), intent(in) :: self
    real(wp), intent(in), contiguous :: x(:, :)
    real(wp), intent(out), contiguous :: y(:, :)
    integer, intent(out) :: status

    status = 0
    y = matmul(self%inertia, x)
  end subroutine mass

  subroutine report(self, converged)
    class(dense_type), intent(in) :: self
    integer, intent(in) :: converged
  end subroutine report
end module dense_pencil

!> Block Lanczos on a body that floats, beside whose rigid motion the elastic modes are small parts of the inverse.
program test_block_lanczos
  use attrito_core_cholesky, only: factor_positive
  use attrito_core_communicator, only: own_communicator
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_reduce_block_lanczos, only: lanczos_type, new_lanczos
  use dense_pencil, only: dense_type
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: n = 400, wanted = 16, width = 8

  call run_in_session('block_lanczos', [ &
                      test('modes of a body that floats converge, to what rounding leaves of them', converge)])

contains

  !> A chain whose springs differ by eight orders of magnitude, with s a part 1e-9 of the highest eigenvalue that is
  !> sought: the rigid motion's theta is so much larger that the rounding of its part hides a residual of 1e-12 of the others.
  subroutine converge(error)
    type(error_type), allocatable, intent(out) :: error
    type(dense_type) :: pencil
    type(lanczos_type) :: search
    real(wp), allocatable :: k(:, :), all(:), vectors(:, :)
    real(wp) :: start(n, width), shift
    integer :: i, j, info

    allocate (k(n, n), pencil%inertia(n, n), source=0.0_wp)
    do i = 1, n
      pencil%inertia(i, i) = 1.0_wp + 0.5_wp*sin(real(i, wp))
      if (i < n) call add_spring(k, i, i + 1, 1.0e4_wp*10.0_wp**(8.0_wp*modulo(i*0.618_wp, 1.0_wp)))
      start(i, :) = [(cos(i*sqrt(2.0_wp) + j*(i + 1)*sqrt(3.0_wp)), j=1, width)]
    end do
    call symmetric_eigenpairs(k, pencil%inertia, all, vectors, info)
    shift = 1.0e-9_wp*all(wanted)
    pencil%ranks = own_communicator()
    pencil%factor = k + shift*pencil%inertia
    call factor_positive(pencil%factor, info)
    call check(error, info == 0, 'rounding left the shifted stiffness indefinite')
    if (allocated(error)) return
    call new_lanczos(search, pencil, start, wanted, 2*wanted + 4*width, 1.0e-12_wp, info)
    call check(error, info == 0 .and. size(search%eigenvalues) == wanted, 'the search failed')
    if (allocated(error)) return
    ! Twelve blocks fill the space once; a second time is enough.
    call check(error, search%solves <= 2*(2*wanted + 4*width), 'the search went on though rounding is all that is left')
    ! LAPACK errs by rounding times the largest eigenvalue.
    call check_close(error, search%eigenvalues - shift, all(:wanted), n*epsilon(1.0_wp)*all(n), 'eigenvalues')
  end subroutine converge

  pure subroutine add_spring(k, a, b, spring)
    real(wp), intent(inout) :: k(:, :)
    integer, intent(in) :: a, b
    real(wp), intent(in) :: spring

    k(a, a) = k(a, a) + spring
    k(b, b) = k(b, b) + spring
    k(a, b) = k(a, b) - spring
    k(b, a) = k(b, a) - spring
  end subroutine add_spring
end program test_block_lanczos
