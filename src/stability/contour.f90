!> Eigenvalues of a nonlinear problem F(s) x = 0 within an ellipse, all at once, by contour integrals: with a random V,
!>
!> $$ A_p = \frac{1}{2\pi i} \oint s^p F(s)^{-1} V \, ds, \qquad A_0 = U \Sigma W^H, \qquad
!>    U^H A_1 W \Sigma^{-1} \text{ has the eigenvalues,} $$
!>
!> the trapezoidal rule on the ellipse converging geometrically; each is then polished by inverse iteration. Poles of F do no harm.
!> (SLEPc's solvers of such problems need complex scalars for complex eigenvalues, which the real build has not.)
!> Source: Beyn 2012, Linear Algebra Appl. 436, doi:10.1016/j.laa.2011.03.030.
module attrito_stability_contour
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: complex_eigenvalues_of, complex_singular_values
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  implicit none
  private
  public :: nonlinear_problem_type, ellipse_type, eigenvalues_within, polish

  type, abstract :: nonlinear_problem_type
  contains
    procedure(matrix_at), deferred :: at
    procedure(size_of), deferred :: unknowns
  end type nonlinear_problem_type

  abstract interface
    !> F(s) [n, n]
    function matrix_at(self, s) result(matrix)
      import :: nonlinear_problem_type, wp
      class(nonlinear_problem_type), intent(in) :: self
      !> Exponent, 1/s, or time
      complex(wp), intent(in) :: s
      complex(wp), allocatable :: matrix(:, :)
    end function matrix_at

    !> n
    pure integer function size_of(self)
      import :: nonlinear_problem_type
      class(nonlinear_problem_type), intent(in) :: self
    end function size_of
  end interface

  !> Upright, with half axes along the real and the imaginary axis
  type :: ellipse_type
    complex(wp) :: centre = 0.0_wp
    real(wp) :: real_axis = 1.0_wp, imaginary_axis = 1.0_wp
  end type ellipse_type

  !> Points of the trapezoidal rule. With half as many, guesses of modes that a contact hardly moves are off by 1e-2 and more than
  !> half of them are lost
  integer, parameter :: nodes = 192 ! measured
  !> Singular values above this part of the largest belong to eigenvalues within: what is farther outside than a tenth of the axes
  !> is damped by 1.1^(-192) = 1e-8 and more, and fails to be polished
  real(wp), parameter :: significant = 1.0e-12_wp ! derived
  !> Farthest that polishing may take an eigenvalue, and the step at which it has ended
  real(wp), parameter :: farthest = 1.0e-2_wp, settled = 1.0e-10_wp ! guess

contains

  !> Every eigenvalue within (some just outside may be among them), as often as its multiplicity.
  subroutine eigenvalues_within(problem, ellipse, most, eigenvalues, vectors, info)
    !> Nonlinear eigenvalue problem
    class(nonlinear_problem_type), intent(in) :: problem
    !> Contour within which eigenvalues are sought
    type(ellipse_type), intent(in) :: ellipse
    !> More than there are, at most the unknowns
    integer, intent(in) :: most
    !> [count], and their vectors in columns [n, count]
    complex(wp), allocatable, intent(out) :: eigenvalues(:), vectors(:, :)
    !> 0, or not: there are more, or linear algebra failed
    integer, intent(out) :: info
    complex(wp), allocatable :: moments(:, :, :), u(:, :), w(:, :), reduced(:, :), found(:), combined(:, :), start(:, :)
    real(wp), allocatable :: s(:)
    complex(wp) :: polished
    integer :: rank, i
    logical :: good(size_limit(problem, most))

    call integrate(problem, ellipse, size(good), moments, info)
    if (info /= 0) return
    call complex_singular_values(moments(:, :, 0), s, u, w, info)
    if (info /= 0) return
    rank = count(s > significant*s(1))
    if (rank == size(s) .and. rank < problem%unknowns()) then
      info = 1
      return
    end if
    reduced = matmul(conjg(transpose(u(:, :rank))), matmul(moments(:, :, 1), w(:, :rank)))/spread(s(:rank), 1, rank)
    call complex_eigenvalues_of(reduced, found, combined, info)
    if (info /= 0) return
    start = matmul(u(:, :rank), combined)
    do i = 1, rank
      call polish(problem, ellipse%centre + found(i), start(:, i), polished, good(i))
      found(i) = polished
    end do
    eigenvalues = pack(found, good(:rank))
    vectors = start(:, pack([(i, i=1, rank)], good(:rank)))
  end subroutine eigenvalues_within

  pure integer function size_limit(problem, most)
    !> Nonlinear eigenvalue problem
    class(nonlinear_problem_type), intent(in) :: problem
    !> Largest number allowed
    integer, intent(in) :: most

    size_limit = min(most, problem%unknowns())
  end function size_limit

  !> Both moments about the centre [n, columns, 0:1].
  subroutine integrate(problem, ellipse, columns, moments, info)
    !> Nonlinear eigenvalue problem
    class(nonlinear_problem_type), intent(in) :: problem
    !> Contour within which eigenvalues are sought
    type(ellipse_type), intent(in) :: ellipse
    !> Number of columns
    integer, intent(in) :: columns
    !> Moments about the centre
    complex(wp), allocatable, intent(out) :: moments(:, :, :)
    !> 0: done, else LAPACK's code
    integer, intent(out) :: info
    complex(wp), allocatable :: matrix(:, :), probe(:, :), solution(:, :)
    integer, allocatable :: pivots(:)
    complex(wp) :: offset, speed
    real(wp) :: angle
    integer :: j, n

    n = problem%unknowns()
    probe = probe_of(n, columns)
    allocate (moments(n, columns, 0:1), source=(0.0_wp, 0.0_wp))
    allocate (pivots(n))
    do j = 1, nodes
      angle = two_pi*(j - 0.5_wp)/nodes
      offset = cmplx(ellipse%real_axis*cos(angle), ellipse%imaginary_axis*sin(angle), wp)
      speed = cmplx(-ellipse%real_axis*sin(angle), ellipse%imaginary_axis*cos(angle), wp)
      matrix = problem%at(ellipse%centre + offset)
      call factor_complex(matrix, pivots, info)
      if (info /= 0) return
      solution = probe
      call solve_factored_complex(matrix, pivots, solution)
      moments(:, :, 0) = moments(:, :, 0) + speed/((0.0_wp, 1.0_wp)*nodes)*solution
      moments(:, :, 1) = moments(:, :, 1) + offset*speed/((0.0_wp, 1.0_wp)*nodes)*solution
    end do
  end subroutine integrate

  !> Columns without pattern, the same everywhere (Lehmer's generator).
  pure function probe_of(n, columns) result(probe)
    !> Number of coordinates; number of columns
    integer, intent(in) :: n, columns
    complex(wp) :: probe(n, columns)
    integer(8), parameter :: modulus = 2147483647_8
    integer(8) :: state
    real(wp) :: pair(2)
    integer :: i, j, k

    state = 12345_8
    do j = 1, columns
      do i = 1, n
        do k = 1, 2
          state = modulo(48271_8*state, modulus)
          pair(k) = 2.0_wp*real(state, wp)/real(modulus, wp) - 1.0_wp
        end do
        probe(i, j) = cmplx(pair(1), pair(2), wp)
      end do
    end do
  end function probe_of

  !> Newton's method in the form of inverse iteration, F(s) y = F' x, s <- s - 1/(x^H y), F' by a central difference at the start.
  subroutine polish(problem, guess, start, s, good)
    !> Nonlinear eigenvalue problem
    class(nonlinear_problem_type), intent(in) :: problem
    !> Exponent to start from
    complex(wp), intent(in) :: guess
    !> Vector, on leaving that of the eigenvalue
    complex(wp), intent(inout) :: start(:)
    !> Exponent, 1/s, or time
    complex(wp), intent(out) :: s
    !> Has it converged?
    logical, intent(out) :: good
    !> Step of the central difference, 1/s: its error and rounding are alike
    real(wp), parameter :: difference = 1.0e-5_wp ! derived
    complex(wp), allocatable :: matrix(:, :), slope(:, :), y(:, :)
    complex(wp) :: x(size(start)), step
    integer :: pivots(size(start)), iteration, info

    s = guess
    x = start/sqrt(sum(abs(start)**2))
    good = .false.
    do iteration = 1, 20
      slope = (problem%at(s + difference) - problem%at(s - difference))/(2.0_wp*difference)
      y = reshape(matmul(slope, x), [size(x), 1])
      matrix = problem%at(s)
      call factor_complex(matrix, pivots, info)
      if (info /= 0) exit
      call solve_factored_complex(matrix, pivots, y)
      step = -1.0_wp/dot_product(x, y(:, 1))
      s = s + step
      x = y(:, 1)/sqrt(sum(abs(y(:, 1))**2))
      if (.not. abs(s - guess) <= farthest) return
      if (abs(step) <= settled) exit
    end do
    ! A matrix that is singular to the last bit has arrived, too.
    good = info /= 0 .or. abs(step) <= settled
    start = x
  end subroutine polish
end module attrito_stability_contour
