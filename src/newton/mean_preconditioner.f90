!> Preconditioner of the condensed system by its contacts as they are in the mean over the period:
!>
!> $$ (I + D R)^{-1} \approx (I + D_0 R)^{-1} = I - D_0 R' $$
!>
!> D_0 is diagonal and the same at all harmonics, R' the receptance without what springs lose in the mean (`mean_contacts`). What is
!> left out, D - D_0, are the contacts' changes over the period. In single precision.
module attrito_newton_mean_preconditioner
  use attrito_core_kinds, only: sp, wp
  use attrito_newton_active_jacobian, only: places_of_rows
  use attrito_newton_condensed_operator, only: condensed_operator_type
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_modal_response, only: modal_response_type, new_modal_response
  use attrito_newton_preconditioner, only: preconditioner_type
  implicit none
  private
  public :: mean_preconditioner_type, new_mean_preconditioner

  type, extends(preconditioner_type) :: mean_preconditioner_type
    !> theta k of the active rows [rows], modes of R' there [n, rows], and how they respond
    real(sp), allocatable :: lost(:), shapes(:, :)
    type(modal_response_type) :: response
  contains
    procedure :: apply_inverse
  end type mean_preconditioner_type

contains

  !> For a system, with R' set to its frequency.
  subroutine new_mean_preconditioner(system, contacts, preconditioner)
    !> Linearised system on the active contacts
    type(condensed_operator_type), target, intent(in) :: system
    !> In the mean
    type(mean_contacts_type), intent(in) :: contacts
    !> Ready to be applied
    class(preconditioner_type), allocatable, intent(out) :: preconditioner
    type(mean_preconditioner_type), allocatable :: self
    real(wp), allocatable :: lost(:)

    allocate (self)
    self%system => system
    associate (balance => system%balance, receptance => contacts%receptance)
      lost = contacts%lost_of(balance)
      self%lost = real(lost(places_of_rows(balance) - balance%first_row + 1), sp)
      self%shapes = real(receptance%mode_shapes(1, receptance%common_modes(), places_of_rows(balance)), sp)
      self%response = new_modal_response(receptance, balance)
    end associate
    call self%take_border()
    call move_alloc(self, preconditioner)
  end subroutine new_mean_preconditioner

  !> Approximate inverse of I + D R times a residual.
  subroutine apply_inverse(self, residual, y)
    class(mean_preconditioner_type), intent(in) :: self
    !> Residual over contact rows
    real(wp), intent(in), contiguous :: residual(:, :)
    !> Vector that takes the product
    real(wp), intent(out), contiguous :: y(:, :)
    real(sp), allocatable :: modal(:, :)

    modal = self%response%to_forces(self%system%balance, self%shapes, real(residual, sp))
    y = residual + real(spread(self%lost, 1, size(modal, 2))*matmul(transpose(modal), self%shapes), wp)
  end subroutine apply_inverse
end module attrito_newton_mean_preconditioner
