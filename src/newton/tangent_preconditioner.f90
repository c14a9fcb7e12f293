!> Preconditioner of the condensed system by its tangent reference:
!>
!> $$ (I + D R)^{-1} = (I - D_0 R') (I + D' R')^{-1}, $$
!>
!> D_0 the contacts that stay open, known at all harmonics alike, and D' the others, whose equations are factored
!> (`tangent_factors`). What it leaves out is what damping couples in the modes of R', and what contacts have changed since the
!> factors were made. In single precision.
module attrito_newton_tangent_preconditioner
  use attrito_core_kinds, only: sp, wp
  use attrito_newton_condensed_operator, only: condensed_operator_type
  use attrito_newton_modal_response, only: modal_response_type, new_modal_response
  use attrito_newton_preconditioner, only: preconditioner_type
  use attrito_newton_tangent_factors, only: tangent_factors_type
  use attrito_newton_tangent_reference, only: tangent_reference_type
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: tangent_preconditioner_type, new_tangent_preconditioner

  type, extends(preconditioner_type) :: tangent_preconditioner_type
    type(tangent_factors_type), pointer :: factors => null()
    !> Coefficients a row
    integer :: coefficients = 0
    !> This rank's rows that count: those without springs, then those of other active contacts. Places of the active rows among them,
    !> and of the rows of each contact of D'
    integer :: opened = 0
    integer, allocatable :: place(:)
    !> First of the rows of each contact of D' among them
    integer, allocatable :: first(:)
    !> K of the rows without springs, for all coefficients alike
    real(sp), allocatable :: springs(:)
    !> Modes of R' at these rows [n, rows] and at those of D' [n, rows], and how they respond
    real(sp), allocatable :: shapes(:, :), shapes_left(:, :)
    type(modal_response_type) :: response
  contains
    procedure :: apply_inverse
  end type tangent_preconditioner_type

contains

  !> For a system, with reference and factors at hand.
  subroutine new_tangent_preconditioner(system, reference, factors, preconditioner)
    !> Linearised system on the active contacts
    type(condensed_operator_type), target, intent(in) :: system
    !> Set to the system's frequency
    type(tangent_reference_type), intent(in) :: reference
    !> Of the contacts left over
    type(tangent_factors_type), target, intent(in) :: factors
    !> Ready to be applied
    class(preconditioner_type), allocatable, intent(out) :: preconditioner
    type(tangent_preconditioner_type), allocatable :: self
    integer, allocatable :: rows(:)
    integer :: i, row

    allocate (self)
    self%system => system
    self%factors => factors
    associate (balance => system%balance)
      self%coefficients = balance%coefficients()
      call list_rows(self, balance, reference, rows)
      self%shapes = real(reference%receptance%mode_shapes(1, reference%receptance%common_modes(), &
                                                          balance%first_row - 1 + rows), sp)
      self%response = new_modal_response(reference%receptance, balance)
      self%shapes_left = self%shapes(:, [((self%first(i) + row, row=0, rows_of(self, i) - 1), i=1, size(self%first))])
    end associate
    call self%take_border()
    call move_alloc(self, preconditioner)
  end subroutine new_tangent_preconditioner

  !> Rows that count, among this rank's.
  subroutine list_rows(self, balance, reference, rows)
    type(tangent_preconditioner_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Contacts without their springs
    type(tangent_reference_type), intent(in) :: reference
    !> This rank's, from 1
    integer, allocatable, intent(out) :: rows(:)
    logical :: counts(size(balance%law))
    integer :: first(size(balance%law)), i, number, row
    real(sp), allocatable :: springs(:)

    counts = reference%opened
    counts(balance%active%contacts) = .true.
    counts(self%factors%blocks%contact) = .true.
    number = 0
    allocate (rows(balance%rows()), springs(balance%rows()))
    call append(reference%opened)
    self%opened = number
    self%springs = springs(:number)
    call append(counts .and. .not. reference%opened)
    rows = rows(:number)
    self%place = [((first(balance%active%contacts(i)) + row, row=0, balance%active%rows(i) - 1), i=1, size(balance%active%rows))]
    self%first = first(self%factors%blocks%contact)

  contains

    !> Rows of some contacts.
    subroutine append(chosen)
      !> By contact
      logical, intent(in) :: chosen(:)
      integer :: contact, tangents

      do contact = 1, size(chosen)
        if (.not. chosen(contact)) cycle
        associate (law => balance%law(contact))
          tangents = law%tangents
          first(contact) = number + 1
          rows(number + 1:number + tangents + 1) = [(law%first_row + row, row=0, tangents)]
          springs(number + 1:number + tangents) = real(law%tangential_stiffness, sp)
          springs(number + tangents + 1) = real(law%normal_stiffness, sp)
          number = number + tangents + 1
        end associate
      end do
    end subroutine append
  end subroutine list_rows

  !> Rows of a contact of D'.
  pure integer function rows_of(self, block)
    class(tangent_preconditioner_type), intent(in) :: self
    !> Its place among these
    integer, intent(in) :: block

    rows_of = size(self%factors%blocks(block)%values, 2)/self%coefficients
  end function rows_of

  !> Approximate inverse of I + D R times a residual.
  subroutine apply_inverse(self, residual, y)
    class(tangent_preconditioner_type), intent(in) :: self
    !> Residual over contact rows
    real(wp), intent(in), contiguous :: residual(:, :)
    !> Vector that takes the product
    real(wp), intent(out), contiguous :: y(:, :)
    real(sp) :: field(self%coefficients, size(self%shapes, 2)), left(self%coefficients, size(self%shapes_left, 2))
    real(sp), allocatable :: modal(:, :)
    integer :: i

    field = 0.0_sp
    field(:, self%place) = real(residual, sp)
    call set_left(self, field, left)
    modal = self%response%to_forces(self%system%balance, self%shapes, field)
    call solve_left(self, matmul(transpose(modal), self%shapes_left), left)
    modal = modal + self%response%to_forces(self%system%balance, self%shapes_left, left)
    call add_left(self, left, field)
    field(:, :self%opened) = field(:, :self%opened) &
                             + spread(self%springs, 1, self%coefficients)*matmul(transpose(modal), self%shapes(:, :self%opened))
    do i = 1, size(self%place)
      y(:, i) = field(:, self%place(i))
    end do
  end subroutine apply_inverse

  !> Move the unknowns of D' out of a field.
  subroutine set_left(self, field, left)
    type(tangent_preconditioner_type), intent(in) :: self
    !> Of all rows that count, and of those of D'
    real(sp), intent(inout) :: field(:, :), left(:, :)
    integer :: column, i, j, own

    left = 0.0_sp
    column = 0
    do i = 1, size(self%first)
      own = rows_of(self, i)
      associate (rows => self%factors%blocks(i)%rows, k => self%coefficients)
        do j = 1, size(rows)
          associate (coefficient => modulo(rows(j) - 1, k) + 1, row => (rows(j) - 1)/k)
            left(coefficient, column + row + 1) = field(coefficient, self%first(i) + row)
            field(coefficient, self%first(i) + row) = 0.0_sp
          end associate
        end do
      end associate
      column = column + own
    end do
  end subroutine set_left

  !> Put the unknowns of D' into a field.
  subroutine add_left(self, left, field)
    type(tangent_preconditioner_type), intent(in) :: self
    !> Of the rows of D'
    real(sp), intent(in) :: left(:, :)
    !> Of all rows that count
    real(sp), intent(inout) :: field(:, :)
    integer :: column, i, own

    column = 0
    do i = 1, size(self%first)
      own = rows_of(self, i)
      associate (first => self%first(i))
        field(:, first:first + own - 1) = field(:, first:first + own - 1) + left(:, column + 1:column + own)
      end associate
      column = column + own
    end do
  end subroutine add_left

  !> z of (I + D' R') z = v - D' m, m the motion that all other forces make.
  subroutine solve_left(self, motion, left)
    type(tangent_preconditioner_type), intent(in) :: self
    !> m of the rows of D' [k, rows]
    real(sp), intent(in), contiguous, target :: motion(:, :)
    !> v, then z
    real(sp), intent(inout), contiguous, target :: left(:, :)
    real(sp), pointer :: flat_motion(:), flat_left(:)
    real(sp), allocatable :: values(:)
    integer :: count, i, start

    flat_motion(1:size(motion)) => motion
    flat_left(1:size(left)) => left
    allocate (values(sum([(size(self%factors%blocks(i)%rows), i=1, size(self%first))])))
    start = 0
    count = 0
    do i = 1, size(self%first)
      associate (block => self%factors%blocks(i))
        associate (n => size(block%rows), m => size(block%values, 2))
          values(count + 1:count + n) = flat_left(start + block%rows) - matmul(block%values, flat_motion(start + 1:start + m))
          count = count + n
          start = start + m
        end associate
      end associate
    end do
    call self%factors%solve(self%system%balance, values)
    start = 0
    count = 0
    do i = 1, size(self%first)
      associate (block => self%factors%blocks(i))
        flat_left(start + block%rows) = values(count + 1:count + size(block%rows))
        count = count + size(block%rows)
        start = start + size(block%values, 2)
      end associate
    end do
  end subroutine solve_left
end module attrito_newton_tangent_preconditioner
