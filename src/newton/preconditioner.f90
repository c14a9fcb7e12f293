!> Preconditioner of the condensed system, border included: an approximate inverse P of I + D R makes one of the bordered system,
!>
!> $$ \delta\omega = (\sigma + r^T P \rho)/(c + r^T P b), \qquad y = P \rho - P b \, \delta\omega $$
module attrito_newton_preconditioner
  use attrito_core_kinds, only: wp
  use attrito_newton_condensed_operator, only: condensed_operator_type
  implicit none
  private
  public :: preconditioner_type

  type, abstract :: preconditioner_type
    type(condensed_operator_type), pointer :: system => null()
    !> Preconditioned column of omega [k, rows], and what is left of the corner
    real(wp), allocatable, private :: column(:, :)
    real(wp), private :: corner = 1.0_wp
  contains
    procedure :: take_border
    procedure :: apply
    procedure(apply_inverse), deferred :: apply_inverse
  end type preconditioner_type

  abstract interface
    !> Approximate inverse of I + D R times a residual.
    subroutine apply_inverse(self, residual, y)
      import :: preconditioner_type, wp
      class(preconditioner_type), intent(in) :: self
      !> Residual over contact rows
      real(wp), intent(in), contiguous :: residual(:, :)
      !> Vector that takes the product
      real(wp), intent(out), contiguous :: y(:, :)
    end subroutine apply_inverse
  end interface

contains

  !> Ready for the border of its system: once the inverse can be applied.
  subroutine take_border(self)
    class(preconditioner_type), intent(inout) :: self

    if (allocated(self%column)) deallocate (self%column)
    allocate (self%column, mold=self%system%column)
    call self%apply_inverse(self%system%column, self%column)
    self%corner = self%system%corner + self%system%product_with_row(self%column)
    if (.not. abs(self%corner) > 0.0_wp) self%corner = 1.0_wp
  end subroutine take_border

  !> Inverse of the approximate system times (residual, last).
  subroutine apply(self, residual, last, y, omega)
    class(preconditioner_type), intent(in) :: self
    !> Residual over contact rows
    real(wp), intent(in), contiguous :: residual(:, :)
    !> Scalar that belongs to the constraint
    real(wp), intent(in) :: last
    !> Vector that takes the product
    real(wp), intent(out), contiguous :: y(:, :)
    !> Change of the angular frequency
    real(wp), intent(out) :: omega

    call self%apply_inverse(residual, y)
    omega = (last + self%system%product_with_row(y))/self%corner
    y = y - self%column*omega
  end subroutine apply
end module attrito_newton_preconditioner
