!> Preconditioner of the condensed system by its contacts as they are in the mean over the period, and how each differs from that:
!>
!> $$ I + D R = (I + D' R') (I + D_0 R), \qquad (I + D R)^{-1} \approx P = (I - D_0 R') (I + D' L')^{-1} $$
!>
!> D_0 is diagonal and the same at all harmonics, R' the receptance without what springs lose in the mean (`mean_contacts`), L' what
!> the contacts of a block feel of each other (`contact_blocks`). What is left out is how the change of one contact over the period
!> meets that of another block's. With the border,
!>
!> $$ \delta\omega = (\sigma + r^T P \rho)/(c + r^T P b), \qquad y = P \rho - P b \, \delta\omega $$
!>
!> P is applied in single precision, so that it is not quite the same linear operator at every vector: flexible GMRES does not ask for
!> that.
module attrito_newton_preconditioner
  use attrito_core_kinds, only: sp, wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_active_jacobian, only: places_of_rows
  use attrito_newton_condensed_operator, only: condensed_operator_type
  use attrito_newton_contact_blocks, only: contact_blocks_type
  use attrito_newton_mean_response, only: mean_response_type
  use attrito_newton_modal_response, only: modal_response_type, new_modal_response
  use attrito_newton_preconditioners, only: preconditioners_type
  implicit none
  private
  public :: preconditioner_type, new_preconditioner

  type :: preconditioner_type
    type(condensed_operator_type), pointer, private :: system => null()
    type(contact_blocks_type), pointer, private :: blocks => null()
    !> theta k of the active rows [rows], low modes of R' there [l, rows], and how they respond; not allocated if nothing is lost
    real(sp), allocatable, private :: lost(:), shapes(:, :)
    type(modal_response_type), private :: response
    !> Flexibility of its other modes from the active rows of all ranks to these [all, rows]; not allocated if all are low
    real(sp), allocatable, private :: rest(:, :)
    !> Does the mean respond?
    logical, private :: mean_responds = .true.
    !> Places among these of contacts with a block, what blocks solve for of them [k, left], and all of the above there
    integer, allocatable, private :: left(:)
    logical, allocatable, private :: are_unknown(:, :)
    real(sp), allocatable, private :: shapes_left(:, :), rest_left(:, :)
    !> What stands for both at harmonic 0, and places of the active rows there
    type(mean_response_type), pointer, private :: of_mean => null()
    integer, allocatable, private :: places(:)
    !> Preconditioned column of omega [k, rows], and what is left of the corner
    real(wp), allocatable, private :: column(:, :)
    real(wp), private :: corner = 1.0_wp
  contains
    procedure :: apply
  end type preconditioner_type

contains

  !> For a system, with R' set to its frequency.
  function new_preconditioner(system, kept) result(self)
    !> Linearised system on the active contacts
    type(condensed_operator_type), target, intent(in) :: system
    !> What it is made of
    type(preconditioners_type), target, intent(in) :: kept
    type(preconditioner_type) :: self

    self%system => system
    self%blocks => kept%blocks
    self%of_mean => kept%of_mean
    if (self%of_mean%is_made) self%places = self%of_mean%places_of(system%balance)
    self%left = self%blocks%rows_among(system%balance)
    self%are_unknown = self%blocks%unknowns_among(system%balance)
    if (allocated(kept%mean%receptance)) call take_mean(self, system%balance, kept)
    allocate (self%column, mold=system%column)
    call apply_inverse(self, system%column, self%column)
    self%corner = system%corner + system%product_with_row(self%column)
    if (.not. abs(self%corner) > 0.0_wp) self%corner = 1.0_wp
  end function new_preconditioner

  !> D_0 and R' on the active rows.
  subroutine take_mean(self, balance, kept)
    type(preconditioner_type), intent(inout) :: self
    !> Harmonic balance: which contacts are active
    type(balance_type), intent(in) :: balance
    !> Contacts in the mean, and its modes at rest
    type(preconditioners_type), intent(in) :: kept
    real(wp), allocatable :: lost(:)
    integer, allocatable :: rows(:)

    lost = kept%mean%lost_of(balance)
    associate (mine => places_of_rows(balance))
      self%lost = real(lost(mine - balance%first_row + 1), sp)
      self%shapes = real(kept%mean%receptance%mode_shapes(1, kept%rest%low, mine), sp)
      self%shapes_left = self%shapes(:, self%left)
      self%response = new_modal_response(kept%mean%receptance, kept%rest%low, balance)
      if (.not. allocated(kept%rest%flexibility)) return
      call balance%ranks%gather_integers(mine, rows)
      self%rest = kept%rest%flexibility(rows, mine - balance%first_row + 1)
      self%rest_left = self%rest(:, self%left)
    end associate
    self%mean_responds = kept%mean%receptance%lowest == 0 .and. .not. allocated(balance%frozen_mean)
  end subroutine take_mean

  !> Motion of some rows that forces make, through R': by modes that have answered, and by those at rest.
  function motion_of(self, modal, shapes, forces, rest) result(motion)
    type(preconditioner_type), intent(in) :: self
    !> Response of low modes [l, k], and these at the rows [l, rows]
    real(sp), intent(in) :: modal(:, :), shapes(:, :)
    !> Forces on this rank's active rows [k, mine]; flexibility of the other modes [all, rows]
    real(sp), intent(in) :: forces(:, :)
    real(sp), allocatable, intent(in) :: rest(:, :)
    real(sp) :: motion(size(forces, 1), size(shapes, 2))
    real(wp), allocatable :: together(:, :)

    motion = matmul(transpose(modal), shapes)
    if (.not. allocated(rest)) return
    if (self%system%balance%ranks%ranks > 1) then
      allocate (together(size(forces, 1), size(rest, 1)))
      call self%system%balance%ranks%gather_columns_everywhere(real(forces, wp), together)
      motion = motion + matmul(real(together, sp), rest)
    else
      motion = motion + matmul(forces, rest)
    end if
    if (.not. self%mean_responds) motion(1, :) = 0.0_sp
  end function motion_of

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

    call apply_inverse(self, residual, y)
    omega = (last + self%system%product_with_row(y))/self%corner
    y = y - self%column*omega
  end subroutine apply

  !> P times a residual.
  subroutine apply_inverse(self, residual, y)
    type(preconditioner_type), intent(in) :: self
    !> Residual over contact rows
    real(wp), intent(in) :: residual(:, :)
    !> Vector that takes the product
    real(wp), intent(out) :: y(:, :)
    real(sp), allocatable :: field(:, :), left(:, :), motion(:, :), modal(:, :), everywhere(:, :)
    real(wp), allocatable :: means(:)

    field = real(residual, sp)
    left = field(:, self%left)
    field(:, self%left) = merge(0.0_sp, left, self%are_unknown)
    allocate (motion, source=0.0_sp*left)
    if (allocated(self%lost)) then
      modal = self%response%to_forces(self%system%balance, self%shapes, field)
      motion = motion_of(self, modal, self%shapes_left, field, self%rest_left)
    end if
    if (self%of_mean%is_made) then
      means = residual(1, :)
      means(self%left) = merge(0.0_wp, means(self%left), self%are_unknown(1, :))
      means = self%of_mean%motion_of(self%system%balance%ranks, self%places, means)
      motion(1, :) = real(means(self%left), sp)
    end if
    call self%blocks%apply(self%system%balance, left, motion)
    field(:, self%left) = left
    if (self%of_mean%is_made) then
      means = residual(1, :)
      means(self%left) = merge(real(left(1, :), wp), means(self%left), self%are_unknown(1, :))
      means = self%of_mean%solve(self%system%balance%ranks, self%places, means)
    end if
    if (allocated(self%lost)) then
      modal = modal + self%response%to_forces(self%system%balance, self%shapes_left, merge(left, 0.0_sp, self%are_unknown))
      everywhere = motion_of(self, modal, self%shapes, field, self%rest)
      field = field + spread(self%lost, 1, size(modal, 2))*everywhere
    end if
    y = field
    if (self%of_mean%is_made) y(1, :) = means
  end subroutine apply_inverse
end module attrito_newton_preconditioner
