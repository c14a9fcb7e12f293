!> A large dense system by factors in single precision and refinement of its solution in double,
!>
!> $$ x \leftarrow x + (L U)^{-1} (b - A x), $$
!>
!> which takes half the time of factors in double precision. Where that does not converge the factors are in double precision.
!> Source: Higham 2002, Accuracy and Stability of Numerical Algorithms, chapter 12.
module attrito_core_refined
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack, only: solve_dense, times_vector
  use attrito_core_lapack_single, only: factor_single, solve_factored_single
  implicit none
  private
  public :: solve_refined

  !> Unknowns from which it pays
  integer, parameter :: large = 200 ! guess
  !> Residual that is accepted, relative to the right-hand side, and how often it is refined
  real(wp), parameter :: accepted = 1.0e-12_wp ! guess
  integer, parameter :: most_refinements = 8 ! guess

contains

  !> Solve A x = b.
  subroutine solve_refined(matrix, values, status)
    !> A [n, n], which is destroyed
    real(wp), intent(inout), contiguous :: matrix(:, :)
    !> b, then x [n]
    real(wp), intent(inout) :: values(:)
    !> 0, or not: singular
    integer, intent(out) :: status
    real(wp), dimension(size(values)) :: solution, residual, product
    real(wp) :: columns(size(values), 1)
    real(sp), allocatable :: factors(:, :)
    real(sp) :: correction(size(values))
    integer :: pivots(size(values)), refinement

    if (size(values) >= large) then
      factors = real(matrix, sp)
      call factor_single(factors, pivots, status)
      solution = 0.0_wp
      residual = values
      do refinement = 0, most_refinements
        if (status /= 0) exit
        if (norm2(residual) <= accepted*norm2(values)) then
          values = solution
          return
        end if
        ! Scaled, since a small residual has numbers that single precision does not have.
        correction = real(residual/norm2(residual), sp)
        call solve_factored_single(factors, pivots, correction)
        solution = solution + norm2(residual)*real(correction, wp)
        call times_vector(matrix, solution, product)
        residual = values - product
      end do
    end if
    columns(:, 1) = values
    call solve_dense(matrix, columns, status)
    values = columns(:, 1)
  end subroutine solve_refined
end module attrito_core_refined
