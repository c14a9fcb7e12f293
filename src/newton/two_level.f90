!> Preconditioner of the condensed system: what a few motions of the contacts carry from one to another, exactly, and of the rest what
!> each contact feels of itself.
!>
!> $$ R \approx L + U X U^T, \qquad (I + D R)^{-1} \approx A^{-1} - E U (I + X U^T E U)^{-1} X U^T A^{-1}, $$
!> $$ A = I + D L, \qquad E = A^{-1} D $$
!>
!> U are the motions of `attrito_newton_coarse_space`, X their flexibility per harmonic (Woodbury's identity). A^-1, E and the
!> solution of the coarse system are those of `two_level_factors`, which may be of an earlier Newton iteration, of a point nearby:
!> contacts and rows that they do not know count as stuck ones, E = 0. GMRES makes up for what has changed since. All is in single
!> precision, so that it is not quite the same linear operator at every vector: flexible GMRES does not ask for that.
!> Source: Woodbury 1950; two-level Schwarz methods as in Toselli & Widlund 2005, doi:10.1007/b137868.
module attrito_newton_two_level
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack, only: times_vector
  use attrito_newton_active_jacobian, only: places_of_rows
  use attrito_newton_condensed_operator, only: condensed_operator_type
  use attrito_newton_preconditioner, only: preconditioner_type
  use attrito_newton_two_level_factors, only: two_level_factors_type
  implicit none
  private
  public :: two_level_type, new_two_level

  type, extends(preconditioner_type) :: two_level_type
    type(two_level_factors_type), pointer :: factors => null()
    !> Coefficients a row
    integer :: coefficients = 0
    !> Place of every active contact among those that the factors know, 0 for none
    integer, allocatable :: block_of(:)
    !> U^T at the active rows [low, rows]
    real(sp), allocatable :: shapes(:, :)
  contains
    procedure :: apply_inverse
  end type two_level_type

contains

  !> For a system, with factors at hand.
  subroutine new_two_level(system, factors, preconditioner)
    !> Linearised system on the active contacts
    type(condensed_operator_type), target, intent(in) :: system
    !> Factors of this frequency
    type(two_level_factors_type), target, intent(in) :: factors
    !> Ready to be applied
    class(preconditioner_type), allocatable, intent(out) :: preconditioner
    type(two_level_type), allocatable :: self

    allocate (self)
    self%system => system
    self%factors => factors
    self%coefficients = system%balance%coefficients()
    associate (active => system%balance%active)
      self%block_of = factors%places_of(active%contacts)
      self%shapes = factors%shapes(:, places_of_rows(system%balance) - system%balance%first_row + 1)
    end associate
    call self%take_border()
    call move_alloc(self, preconditioner)
  end subroutine new_two_level

  !> Approximate inverse of I + D R times a residual.
  subroutine apply_inverse(self, residual, y)
    class(two_level_type), intent(in) :: self
    !> Residual over contact rows
    real(wp), intent(in), contiguous :: residual(:, :)
    !> Vector that takes the product
    real(wp), intent(out), contiguous :: y(:, :)
    real(sp), allocatable, target :: field(:, :), answer(:, :), modal(:, :)
    real(sp), pointer :: flat_field(:), flat_answer(:), flat_modal(:)
    real(wp), allocatable :: together(:, :)

    field = real(residual, sp)
    flat_field(1:size(field)) => field
    call apply_blocks(self, flat_field)
    together = matmul(field, transpose(self%shapes))
    call self%system%balance%ranks%sum(together)
    modal = real(together, sp)
    flat_modal(1:size(modal)) => modal
    allocate (answer, mold=modal)
    flat_answer(1:size(answer)) => answer
    call times_vector(self%factors%coarse, flat_modal, flat_answer)
    modal = matmul(answer, self%shapes)
    flat_modal(1:size(modal)) => modal
    call subtract_stiffness(self, flat_modal, flat_field)
    y = field
  end subroutine apply_inverse

  !> A^-1 times a field, coefficient running faster than row, in its place.
  subroutine apply_blocks(self, field)
    class(two_level_type), intent(in) :: self
    !> Vector over the rows of contacts
    real(sp), intent(inout), contiguous :: field(:)
    real(sp) :: product(3*self%coefficients)
    integer :: i, start

    do i = 1, size(self%block_of)
      if (self%block_of(i) == 0) cycle
      start = self%coefficients*(self%system%balance%active%first(i) - 1)
      associate (block => self%factors%blocks(self%block_of(i)))
        associate (n => size(block%rows))
          call times_vector(block%inverse, field(start + block%rows), product(:n))
          field(start + block%rows) = product(:n)
        end associate
      end associate
    end do
  end subroutine apply_blocks

  !> y less E times a field.
  subroutine subtract_stiffness(self, field, y)
    class(two_level_type), intent(in) :: self
    !> Vector over the rows of contacts
    real(sp), intent(in), contiguous :: field(:)
    !> Vector that takes the product
    real(sp), intent(inout), contiguous :: y(:)
    real(sp) :: product(3*self%coefficients)
    integer :: i, start

    do i = 1, size(self%block_of)
      if (self%block_of(i) == 0) cycle
      start = self%coefficients*(self%system%balance%active%first(i) - 1)
      associate (block => self%factors%blocks(self%block_of(i)))
        associate (n => size(block%rows))
          call times_vector(block%stiffness, field(start + 1:start + size(block%stiffness, 2)), product(:n))
          y(start + block%rows) = y(start + block%rows) - product(:n)
        end associate
      end associate
    end do
  end subroutine subtract_stiffness
end module attrito_newton_two_level
