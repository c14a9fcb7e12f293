!> Exponents of Hill's problem with a thousand harmonics, from those of the problem with few, K.
!>
!> Forces jump where a contact changes what it does, so their harmonics fall like 1/k, and the motion by them like 1/k^3: an exponent
!> lacks some K^-3. Newton's method on g and s together,
!>
!> $$ \begin{pmatrix} F(s) & F'(s) g_0 \\ g_0^H & 0 \end{pmatrix} \begin{pmatrix} \delta g \\ \delta s \end{pmatrix}
!>    = -\begin{pmatrix} F(s) g \\ 0 \end{pmatrix}, $$
!>
!> takes its steps from generalised conjugate residuals. They are preconditioned by the factors of this matrix with K harmonics, and
!> by 1 beyond, where structures hardly move.
!> Source: Eisenstat, Elman & Schultz 1983, SIAM J. Numer. Anal. 20, doi:10.1137/0720023.
module attrito_stability_hill_refinement
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  use attrito_stability_hill_operator, only: hill_operator_type, new_hill_operator
  use attrito_stability_hill_problem, only: hill_problem_type
  implicit none
  private
  public :: refine, many_harmonics

  !> So many that what is left out moves an exponent by (K / many)^3 < 2e-3 of what the refinement did, which `truncation` bounds
  integer, parameter :: many_harmonics = 1023 ! derived
  !> Step of the central difference by s: its error and rounding are alike
  real(wp), parameter :: difference = 1.0e-5_wp ! derived
  !> Farthest that an exponent may be taken; and the step, of s and of g whose length is 1, at which Newton's method has ended: its
  !> steps shorten by `solved` and more
  real(wp), parameter :: farthest = 1.0e-2_wp, settled = 1.0e-7_wp ! guess
  !> Newton's steps, directions of a linear solve, and the part of its right-hand side at which that has ended
  integer, parameter :: most_steps = 10, most_directions = 30 ! guess
  real(wp), parameter :: solved = 1.0e-3_wp ! guess

  !> Factors of the bordered problem with few harmonics, and how its unknowns lie among those of many
  type :: preconditioner_type
    complex(wp), allocatable :: factors(:, :)
    integer, allocatable :: pivots(:), place(:)
  end type preconditioner_type

contains

  !> Refine exponents between two heights; one that does not converge stays as it was.
  subroutine refine(problem, wide, heights, vectors, exponents)
    !> With few harmonics, of which exponents and vectors are, and with many
    class(hill_problem_type), intent(in) :: problem, wide
    !> Lowest and highest Im s
    real(wp), intent(in) :: heights(2)
    !> In columns [unknowns, exponents]
    complex(wp), intent(in) :: vectors(:, :)
    !> Over the angular frequency of the excitation
    complex(wp), intent(inout) :: exponents(:)
    type(hill_operator_type) :: operator
    integer :: i

    call new_hill_operator(wide, operator)
    do i = 1, size(exponents)
      if (aimag(exponents(i)) < heights(1) .or. aimag(exponents(i)) > heights(2)) cycle
      call refine_one(problem, wide, operator, vectors(:, i), exponents(i))
    end do
    call operator%destroy()
  end subroutine refine

  subroutine refine_one(problem, wide, operator, vector, exponent)
    !> With few harmonics, of which the exponent and its vector are, and with many
    class(hill_problem_type), intent(in) :: problem, wide
    !> F(s) with many
    type(hill_operator_type), intent(inout) :: operator
    !> [unknowns]
    complex(wp), intent(in) :: vector(:)
    !> Over the angular frequency of the excitation
    complex(wp), intent(inout) :: exponent
    type(preconditioner_type) :: preconditioner
    complex(wp) :: start(wide%unknowns()), slope(size(start)), g(size(start)), step(size(start) + 1), s
    integer :: i, info

    preconditioner%place = places(problem, wide)
    start = 0.0_wp
    start(preconditioner%place) = vector/sqrt(sum(abs(vector)**2))
    s = exponent
    call operator%set_exponent(wide, s + difference)
    slope = operator%multiply(wide, start)
    call operator%set_exponent(wide, s - difference)
    slope = (slope - operator%multiply(wide, start))/(2.0_wp*difference)
    call factor_bordered(problem, s, slope(preconditioner%place), start(preconditioner%place), preconditioner, info)
    if (info /= 0) return
    g = start
    do i = 1, most_steps
      call operator%set_exponent(wide, s)
      step = conjugate_residuals(wide, operator, preconditioner, slope, start, -operator%multiply(wide, g))
      g = g + step(:size(g))
      s = s + step(size(step))
      if (.not. abs(s - exponent) <= farthest) return
      if (norm(step) > settled) cycle
      exponent = s
      return
    end do
  end subroutine refine_one

  !> Where the unknowns of the problem with few harmonics are among those with many [unknowns].
  pure function places(problem, wide)
    !> With few harmonics, and with many
    class(hill_problem_type), intent(in) :: problem, wide
    integer, allocatable :: places(:)
    integer :: k, force

    places = [((wide%harmonics + 1 + k + (2*wide%harmonics + 1)*(force - 1), k=-problem%harmonics, problem%harmonics), &
               force=1, size(problem%row))]
  end function places

  !> Factors of [F, F' g_0; g_0^H, 0] with few harmonics.
  subroutine factor_bordered(problem, s, slope, start, self, info)
    !> With few harmonics
    class(hill_problem_type), intent(in) :: problem
    !> Exponent over the angular frequency of the excitation
    complex(wp), intent(in) :: s
    !> F' g_0, and g_0
    complex(wp), intent(in) :: slope(:), start(:)
    type(preconditioner_type), intent(inout) :: self
    !> 0, or LAPACK's code: it is singular
    integer, intent(out) :: info
    integer :: n

    n = size(start)
    allocate (self%factors(n + 1, n + 1), self%pivots(n + 1))
    self%factors(:n, :n) = problem%at(s)
    self%factors(:n, n + 1) = slope
    self%factors(n + 1, :n) = conjg(start)
    self%factors(n + 1, n + 1) = 0.0_wp
    call factor_complex(self%factors, self%pivots, info)
  end subroutine factor_bordered

  !> (dg, ds) of Newton's step with many harmonics.
  function conjugate_residuals(wide, operator, preconditioner, slope, start, right) result(x)
    !> With many harmonics
    class(hill_problem_type), intent(in) :: wide
    !> F(s)
    type(hill_operator_type), intent(in) :: operator
    type(preconditioner_type), intent(in) :: preconditioner
    !> F' g_0, g_0, and -F g
    complex(wp), intent(in) :: slope(:), start(:), right(:)
    complex(wp) :: x(size(right) + 1), residual(size(x))
    complex(wp) :: direction(size(x), most_directions), image(size(x), most_directions), part
    real(wp) :: length
    integer :: i, j, n

    n = size(right)
    x = 0.0_wp
    residual = [right, (0.0_wp, 0.0_wp)]
    length = norm(residual)
    do i = 1, most_directions
      direction(:, i) = preconditioned(preconditioner, residual)
      image(:n, i) = operator%multiply(wide, direction(:n, i)) + slope*direction(n + 1, i)
      image(n + 1, i) = dot_product(start, direction(:n, i))
      do j = 1, i - 1
        part = dot_product(image(:, j), image(:, i))
        image(:, i) = image(:, i) - part*image(:, j)
        direction(:, i) = direction(:, i) - part*direction(:, j)
      end do
      part = norm(image(:, i))
      if (abs(part) <= tiny(length)) return
      image(:, i) = image(:, i)/part
      direction(:, i) = direction(:, i)/part
      part = dot_product(image(:, i), residual)
      x = x + part*direction(:, i)
      residual = residual - part*image(:, i)
      if (norm(residual) <= solved*length) return
    end do
  end function conjugate_residuals

  !> The factors' answer with few harmonics, the residual itself beyond.
  function preconditioned(self, residual) result(direction)
    type(preconditioner_type), intent(in) :: self
    !> [unknowns with many harmonics + 1]
    complex(wp), intent(in) :: residual(:)
    complex(wp) :: direction(size(residual)), few(size(self%place) + 1, 1)

    direction = residual
    few(:, 1) = residual([self%place, size(residual)])
    call solve_factored_complex(self%factors, self%pivots, few)
    direction([self%place, size(residual)]) = few(:, 1)
  end function preconditioned

  pure real(wp) function norm(x)
    !> Vector
    complex(wp), intent(in) :: x(:)

    norm = sqrt(sum(abs(x)**2))
  end function norm
end module attrito_stability_hill_refinement
