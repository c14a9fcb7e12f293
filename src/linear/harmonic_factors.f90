!> LU factors of a dense matrix at each harmonic, Z_h = P_h L_h U_h, h = 0 ... H.
module attrito_linear_harmonic_factors
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  implicit none
  private
  public :: harmonic_factors_type

  type :: harmonic_factors_type
    !> L_h and U_h [n, n, 0:H], and row interchanges [n, 0:H]
    complex(wp), allocatable, private :: factors(:, :, :)
    integer, allocatable, private :: pivots(:, :)
  contains
    procedure :: resize
    procedure :: factor
    procedure :: solve
  end type harmonic_factors_type

contains

  !> Make room; what was factored is lost.
  pure subroutine resize(self, n, harmonics)
    class(harmonic_factors_type), intent(inout) :: self
    !> Order of the matrices; highest harmonic, H
    integer, intent(in) :: n, harmonics

    if (allocated(self%factors)) deallocate (self%factors, self%pivots)
    allocate (self%factors(n, n, 0:harmonics), self%pivots(n, 0:harmonics))
  end subroutine resize

  subroutine factor(self, h, matrix, status)
    class(harmonic_factors_type), intent(inout) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Z_h [n, n]
    complex(wp), intent(in) :: matrix(:, :)
    !> 0, or not: it is singular
    integer, intent(out) :: status

    self%factors(:, :, h) = matrix
    call factor_complex(self%factors(:, :, h), self%pivots(:, h), status)
  end subroutine factor

  !> Z_h^-1 or, with the adjoint, Z_h^-H times columns.
  subroutine solve(self, h, columns, adjoint)
    class(harmonic_factors_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)
    !> With the adjoint instead?
    logical, intent(in), optional :: adjoint

    call solve_factored_complex(self%factors(:, :, h), self%pivots(:, h), columns, adjoint)
  end subroutine solve
end module attrito_linear_harmonic_factors
