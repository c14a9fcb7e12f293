!> Factors of the contacts that the tangent reference leaves over, I + D' R' on the rows where D' is not zero, in single precision:
!> a preconditioner's.
!>
!> They are kept from step to step until iterations of GMRES in excess of their first solve have cost as much as making them anew
!> (`attrito_newton_kept_factors`). Every rank has the rows of all.
module attrito_newton_tangent_factors
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack_single, only: factor_single, solve_factored_single
  use attrito_newton_active_jacobian, only: contact_jacobian_type
  use attrito_newton_kept_factors, only: flops_of_iteration, kept_factors_type
  use attrito_newton_tangent_reference, only: tangent_reference_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: tangent_factors_type

  !> D' of one contact of this rank
  type :: block_type
    !> Number of the contact
    integer :: contact = 0
    !> Rows that are not zero, from 1, and these [rows, k rows of the contact]
    integer, allocatable :: rows(:)
    real(sp), allocatable :: values(:, :)
  end type block_type

  type, extends(kept_factors_type) :: tangent_factors_type
    !> D' by contact, of this rank, ascending
    type(block_type), allocatable :: blocks(:)
    !> Unknowns of other ranks before this one's, and those of all
    integer :: before = 0, unknowns = 0
    !> Operations of making them
    real(wp) :: flops = 0.0_wp
    real(sp), allocatable, private :: factors(:, :)
    integer, allocatable, private :: pivots(:)
  contains
    procedure :: make
    procedure :: serve
    procedure :: solve
  end type tangent_factors_type

contains

  !> Do they serve the balance's last evaluation?
  pure logical function serve(self, balance)
    class(tangent_factors_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance

    serve = allocated(self%factors) .and. self%pays(balance%changes)
  end function serve

  !> Make them for the balance's last evaluation.
  subroutine make(self, balance, reference, status)
    class(tangent_factors_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Set to the frequency of that evaluation
    type(tangent_reference_type), intent(in) :: reference
    !> 0, or not: singular, and they are void
    integer, intent(out) :: status
    real(sp), allocatable :: columns(:, :)
    real(wp), allocatable :: everyone(:, :)
    integer, allocatable :: rows(:), entries(:), mine(:)

    call take_blocks(self, balance, reference, rows, mine)
    call balance%ranks%gather_integers(mine, entries)
    self%unknowns = size(entries)
    self%before = 0
    if (size(mine) > 0) self%before = findloc(entries, mine(1), 1) - 1
    call assemble(self, balance, reference%receptance, rows, entries, columns)
    allocate (everyone(size(entries), size(entries)))
    call balance%ranks%gather_columns_everywhere(real(columns, wp), everyone)
    self%factors = real(transpose(everyone), sp)
    if (allocated(self%pivots)) deallocate (self%pivots)
    allocate (self%pivots(size(entries)))
    call factor_single(self%factors, self%pivots, status)
    associate (n => real(self%unknowns, wp), coordinates => size(balance%response, 1))
      self%flops = 2.0_wp/3.0_wp*n**3 + 4.0_wp*n**2*coordinates/balance%coefficients()
    end associate
    call self%begin(balance%changes, worth_of(self, balance))
    if (status /= 0) call self%discard()
  end subroutine make

  !> D' of this rank's contacts, all rows of B of these, and the unknowns: numbers of rows and coefficients in one.
  subroutine take_blocks(self, balance, reference, rows, mine)
    type(tangent_factors_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Contacts without their springs
    type(tangent_reference_type), intent(in) :: reference
    !> Of B; coefficient + (row - 1) k
    integer, allocatable, intent(out) :: rows(:), mine(:)
    type(contact_jacobian_type) :: left(size(balance%law))
    integer :: contact, i, row
    integer, allocatable :: contacts(:)

    do i = 1, size(left)
      left(i) = reference%jacobian_left(balance, i)
    end do
    contacts = pack([(i, i=1, size(left))], [(size(left(i)%rows) > 0, i=1, size(left))])
    if (allocated(self%blocks)) deallocate (self%blocks)
    allocate (self%blocks(size(contacts)))
    rows = [integer ::]
    mine = [integer ::]
    do i = 1, size(contacts)
      contact = contacts(i)
      associate (law => balance%law(contact), first => balance%first_row - 1 + balance%law(contact)%first_row)
        self%blocks(i) = block_type(contact, left(contact)%rows, real(left(contact)%values, sp))
        rows = [rows, [(first + row, row=0, law%tangents)]]
        mine = [mine, balance%coefficients()*(first - 1) + left(contact)%rows]
      end associate
    end do
  end subroutine take_blocks

  !> This rank's rows of I + D' R', as columns [unknowns, mine].
  subroutine assemble(self, balance, receptance, rows, entries, columns)
    type(tangent_factors_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> R'
    class(receptance_type), intent(in) :: receptance
    !> Rows of B of this rank's contacts; unknowns of all ranks, ascending
    integer, intent(in) :: rows(:), entries(:)
    !> Rows of the system
    real(sp), allocatable, intent(out) :: columns(:, :)
    complex(wp), allocatable :: values(:, :, :)
    real(sp), allocatable :: received(:, :), product(:, :)
    integer :: carriers(size(entries)), place(size(entries))
    integer :: above, column, h, i, j, k, number

    k = balance%coefficients()
    number = 0
    do i = 1, size(entries)
      if (number > 0) then
        if (carriers(number) == (entries(i) - 1)/k + 1) then
          place(i) = number
          cycle
        end if
      end if
      number = number + 1
      carriers(number) = (entries(i) - 1)/k + 1
      place(i) = number
    end do
    allocate (values(size(rows), number, 0:receptance%harmonics), source=(0.0_wp, 0.0_wp))
    do h = merge(1, receptance%lowest, allocated(balance%frozen_mean)), receptance%harmonics
      call receptance%block_between(h, rows, carriers(:number), values(:, :, h))
    end do
    allocate (columns(size(entries), sum([(size(self%blocks(i)%rows), i=1, size(self%blocks))])))
    above = 0
    column = 0
    do i = 1, size(self%blocks)
      associate (block => self%blocks(i), own => size(self%blocks(i)%values, 2)/k)
        received = real_coefficients(values(above + 1:above + own, :, :), place, modulo(entries - 1, k) + 1)
        product = matmul(block%values, received)
        do j = 1, size(block%rows)
          product(j, self%before + column + j) = product(j, self%before + column + j) + 1.0_sp
        end do
        columns(:, column + 1:column + size(block%rows)) = transpose(product)
        above = above + own
        column = column + size(block%rows)
      end associate
    end do
  end subroutine assemble

  !> Real receptance from unknowns to all coefficients of a contact's rows [k rows, unknowns].
  pure function real_coefficients(values, place, coefficient) result(received)
    !> Between rows, by harmonic [rows, carriers, 0:H]
    complex(wp), intent(in) :: values(:, :, 0:)
    !> Unknowns' rows among the carriers, and their coefficients
    integer, intent(in) :: place(:), coefficient(:)
    real(sp) :: received((2*ubound(values, 3) + 1)*size(values, 1), size(place))
    integer :: h, i, k, row

    k = 2*ubound(values, 3) + 1
    received = 0.0_sp
    do i = 1, size(place)
      h = coefficient(i)/2
      do row = 1, size(values, 1)
        associate (value => values(row, place(i), h), cosine => (row - 1)*k + 2*h, sine => (row - 1)*k + 2*h + 1)
          if (h == 0) then
            received((row - 1)*k + 1, i) = real(value, sp)
          else if (modulo(coefficient(i), 2) == 0) then
            received(cosine, i) = real(value, sp)
            received(sine, i) = real(-aimag(value), sp)
          else
            received(cosine, i) = real(aimag(value), sp)
            received(sine, i) = real(value, sp)
          end if
        end associate
      end do
    end do
  end function real_coefficients

  !> Iterations that cost as much as making the factors, at least one.
  integer function worth_of(self, balance) result(worth)
    type(tangent_factors_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp) :: rows

    rows = balance%active%count
    call balance%ranks%sum(rows)
    worth = max(1, nint(self%flops/(flops_of_iteration*max(rows, 1.0_wp)*balance%coefficients()*size(balance%response, 1))))
  end function worth_of

  !> Solve with the factors for this rank's unknowns.
  subroutine solve(self, balance, values)
    class(tangent_factors_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Right-hand side of this rank, then the solution
    real(sp), intent(inout) :: values(:)
    real(wp) :: everyone(1, self%unknowns)
    real(sp) :: together(self%unknowns)

    if (self%unknowns == 0) return
    call balance%ranks%gather_columns_everywhere(reshape(real(values, wp), [1, size(values)]), everyone)
    together = real(everyone(1, :), sp)
    call solve_factored_single(self%factors, self%pivots, together)
    values = together(self%before + 1:self%before + size(values))
  end subroutine solve
end module attrito_newton_tangent_factors
