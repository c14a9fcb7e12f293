!> Preconditioner of the condensed system by its contacts as they are in the mean over the period:
!>
!> $$ (I + D R)^{-1} \approx (I + D_0 R)^{-1} = I - D_0 R' $$
!>
!> D_0 is diagonal and the same at all harmonics, R' the receptance without what springs lose in the mean (`mean_contacts`). What is
!> left out, D - D_0, are the contacts' changes over the period. In single precision.
module attrito_newton_mean_preconditioner
  use attrito_core_kinds, only: sp, wp
  use attrito_newton_condensed_operator, only: condensed_operator_type
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_preconditioner, only: preconditioner_type
  implicit none
  private
  public :: mean_preconditioner_type, new_mean_preconditioner

  type, extends(preconditioner_type) :: mean_preconditioner_type
    !> theta k of the active rows [rows], modes of R' there [n, rows], and their flexibility [n, 0:H]
    real(sp), allocatable :: lost(:), shapes(:, :), real_part(:, :), imaginary_part(:, :)
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
    complex(wp), allocatable :: flexibility(:)
    integer :: h, i, row

    allocate (self)
    self%system => system
    associate (balance => system%balance, receptance => contacts%receptance)
      associate (rows => [((balance%active%source(i) + row, row=0, balance%active%rows(i) - 1), i=1, size(balance%active%rows))])
        lost = contacts%lost_of(balance)
        self%lost = real(lost(rows), sp)
        self%shapes = real(receptance%mode_shapes(1, receptance%common_modes(), balance%first_row - 1 + rows), sp)
      end associate
      allocate (self%real_part(size(self%shapes, 1), 0:receptance%harmonics), source=0.0_sp)
      self%imaginary_part = self%real_part
      ! A frozen mean does not respond.
      do h = merge(1, receptance%lowest, allocated(balance%frozen_mean)), receptance%harmonics
        flexibility = 1.0_wp/receptance%low_stiffness(h, size(self%shapes, 1))
        self%real_part(:, h) = real(flexibility, sp)
        self%imaginary_part(:, h) = real(aimag(flexibility), sp)
      end do
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
    real(wp), allocatable :: together(:, :)
    real(sp), allocatable :: modal(:, :)
    real(sp) :: cosine(size(self%shapes, 1))
    integer :: h

    modal = matmul(self%shapes, transpose(real(residual, sp)))
    together = real(modal, wp)
    call self%system%balance%ranks%sum(together)
    modal = real(together, sp)
    modal(:, 1) = self%real_part(:, 0)*modal(:, 1)
    do h = 1, ubound(self%real_part, 2)
      associate (c => modal(:, 2*h), s => modal(:, 2*h + 1), re => self%real_part(:, h), im => self%imaginary_part(:, h))
        ! (c - i s)(re + i im)
        cosine = re*c + im*s
        s = re*s - im*c
        c = cosine
      end associate
    end do
    y = residual + real(spread(self%lost, 1, size(modal, 2))*matmul(transpose(modal), self%shapes), wp)
  end subroutine apply_inverse
end module attrito_newton_mean_preconditioner
