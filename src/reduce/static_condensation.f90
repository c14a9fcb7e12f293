!> Stiffness and mass of the boundary by static condensation, without constraint modes.
!>
!> $$ S(\sigma) = A_{bb} - A_{bi} A_{ii}^{-1} A_{ib}, \quad A = K + \sigma M, \qquad
!>    \tilde K_{bb} = S(0), \quad \tilde M_{bb} = S'(0) = (I\ \Psi^T) M \begin{pmatrix} I \\ \Psi \end{pmatrix} $$
!>
!> One elimination at an imaginary sigma gives both: S(i h) = K_bb + i h M_bb + O(h^2). Real and imaginary part do not mix, so h may
!> be so small that h^2 is nothing to either; neither loses a digit by it.
!> Sources: Guyan, AIAA J. 3 (1965) 380, doi:10.2514/3.2874; Squire & Trapp, SIAM Rev. 40 (1998) 110-112,
!> doi:10.1137/S003614459631241X (derivatives by a complex step).
module attrito_reduce_static_condensation
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: condensed_type, imaginary_step, take_apart

  !> What a boundary of nb dofs feels of the whole structure, the interior following at rest
  type :: condensed_type
    !> [nb, nb]
    real(wp), allocatable :: stiffness(:, :), mass(:, :)
    !> (I Psi^T) f of loads and monitors [nb, vectors]
    real(wp), allocatable :: vectors(:, :)
    !> Rows of (I; Psi) that are recovered, a column each [nb, recovered]
    real(wp), allocatable :: recovered(:, :)
  contains
    procedure :: numbers
    procedure :: take_numbers
  end type condensed_type

  !> Binary exponent of the part that h M is of K: its square is below the rounding of any entry, its entries above underflow
  integer, parameter :: step_exponent = -300 ! derived

contains

  !> h, a power of two: dividing by it is exact.
  pure real(wp) function imaginary_step(stiffness, mass)
    !> Largest entries of the matrices
    real(wp), intent(in) :: stiffness, mass

    imaginary_step = scale(1.0_wp, step_exponent)
    if (stiffness > 0.0_wp .and. mass > 0.0_wp) imaginary_step = scale(1.0_wp, step_exponent + exponent(stiffness) - exponent(mass))
  end function imaginary_step

  !> Both matrices, whole, from the upper triangle of S(i h).
  pure subroutine take_apart(schur, step, stiffness, mass)
    !> [nb, nb]
    complex(wp), intent(in) :: schur(:, :)
    !> h
    real(wp), intent(in) :: step
    !> [nb, nb]
    real(wp), intent(out) :: stiffness(:, :), mass(:, :)
    integer :: i

    do i = 1, size(schur, 2)
      stiffness(:i, i) = real(schur(:i, i))
      mass(:i, i) = aimag(schur(:i, i))/step
      stiffness(i, :i) = stiffness(:i, i)
      mass(i, :i) = mass(:i, i)
    end do
  end subroutine take_apart

  !> All of it, one after another.
  pure function numbers(self)
    class(condensed_type), intent(in) :: self
    real(wp), allocatable :: numbers(:)

    numbers = [self%stiffness, self%mass, self%vectors, self%recovered]
  end function numbers

  !> The same of what `numbers` gave.
  pure subroutine take_numbers(self, boundary, vectors, recovered, numbers)
    class(condensed_type), intent(inout) :: self
    !> Boundary dofs, loads and monitors, dofs that are recovered
    integer, intent(in) :: boundary, vectors, recovered
    !> In order
    real(wp), intent(in) :: numbers(:)
    integer :: square, at

    square = boundary*boundary
    at = 2*square + boundary*vectors
    self%stiffness = reshape(numbers(:square), [boundary, boundary])
    self%mass = reshape(numbers(square + 1:2*square), [boundary, boundary])
    self%vectors = reshape(numbers(2*square + 1:at), [boundary, vectors])
    self%recovered = reshape(numbers(at + 1:), [boundary, recovered])
  end subroutine take_numbers
end module attrito_reduce_static_condensation
