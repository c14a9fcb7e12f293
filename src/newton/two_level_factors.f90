!> What the two-level preconditioner is made of, from the state of the contacts at one linear system, and kept for the next ones:
!>
!> $$ A^{-1} = (I + D L)^{-1}, \qquad E = A^{-1} D, \qquad (I + X U^T E U)^{-1} X $$
!>
!> The blocks couple the rows and harmonics of one contact; the coarse system (`attrito_newton_coarse_space`) couples the harmonics of
!> some thirty motions and is solved on every rank. They are kept in single precision, since reading them is what applying them costs.
!> Making them costs as much as some tens of iterations of GMRES, so they are made anew only when iterations in excess of what they
!> took at first add up to a dozen, when contacts have moved to other ranks or the series' length has changed, or when more or less
!> of the springs is kept.
module attrito_newton_two_level_factors
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack, only: invert, solve_dense
  use attrito_newton_active_jacobian, only: contact_jacobian_type, jacobian_of
  use attrito_newton_coarse_space, only: coarse_space_type, new_coarse_space
  use attrito_newton_kept_factors, only: kept_factors_type
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: two_level_factors_type

  !> Contacts taken together in the coarse system, to bound its memory
  integer, parameter :: bunch = 32 ! conventional
  !> Iterations of GMRES in excess after which to make the factors anew; 30 take as long on the whole
  integer, parameter :: worth = 12 ! measured
  !> Change of the springs kept in the step that makes them void
  real(wp), parameter :: other_springs = 1.0e-3_wp ! guess

  !> Of one contact, on its rows where D is not zero: A^-1 [rows, rows] and E [rows, all columns]
  type :: block_type
    integer, allocatable :: rows(:)
    real(sp), allocatable :: inverse(:, :), stiffness(:, :)
  end type block_type

  type, extends(kept_factors_type) :: two_level_factors_type
    !> Contacts that are known, by their place among this rank's, ascending
    integer, allocatable :: contacts(:)
    !> A^-1 and E by contact
    type(block_type), allocatable :: blocks(:)
    !> Motions of the coarse system at all rows of this rank [low, rows]; its solution by what they receive [k low, k low]
    real(sp), allocatable :: shapes(:, :)
    real(sp), allocatable :: coarse(:, :)
    !> Part of the springs kept in the step they were made for
    real(wp), private :: stiffening = 0.0_wp
  contains
    procedure :: make
    procedure :: serve
    procedure :: places_of
  end type two_level_factors_type

contains

  !> Do they serve the balance's last evaluation?
  pure logical function serve(self, balance, stiffening)
    class(two_level_factors_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening

    serve = allocated(self%coarse) .and. self%pays(balance%changes) .and. abs(self%stiffening - stiffening) < other_springs
  end function serve

  !> Places of contacts among those that are known, 0 for none; both ascend.
  pure function places_of(self, contacts) result(places)
    class(two_level_factors_type), intent(in) :: self
    !> Number of contacts
    integer, intent(in) :: contacts(:)
    integer :: places(size(contacts))
    integer :: i, next

    places = 0
    next = 1
    do i = 1, size(contacts)
      do while (next <= size(self%contacts))
        if (self%contacts(next) >= contacts(i)) exit
        next = next + 1
      end do
      if (next > size(self%contacts)) return
      if (self%contacts(next) == contacts(i)) places(i) = next
    end do
  end function places_of

  !> Make them for the balance's last evaluation.
  subroutine make(self, balance, motions, stiffening, status)
    class(two_level_factors_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(inout) :: balance
    !> Motions in the coarse system at most
    integer, intent(in) :: motions
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> 0, or not: singular, and they are void
    integer, intent(out) :: status
    type(coarse_space_type) :: space
    complex(wp) :: local(3, 3, 0:balance%receptance%harmonics, size(balance%active%contacts))

    self%contacts = balance%active%contacts
    self%stiffening = stiffening
    call self%begin(balance%changes, worth)
    space = new_coarse_space(balance, motions)
    self%shapes = real(space%shapes, sp)
    call space%find_local(balance, local)
    call new_blocks(self, balance, local, status)
    call agree(balance, status)
    if (status == 0) then
      call new_coarse(self, balance, space, status)
      call agree(balance, status)
    end if
    if (status /= 0) call self%discard()
  end subroutine make

  !> A failure of any rank is one of all.
  subroutine agree(balance, status)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> 0: done; else it could not be evaluated
    integer, intent(inout) :: status

    status = nint(min(balance%ranks%largest(real(abs(status), wp)), 1.0_wp))
  end subroutine agree

  !> A^-1 and E, contact by contact, on the rows where D is not zero.
  subroutine new_blocks(self, balance, local, status)
    type(two_level_factors_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> What each contact feels of itself, beside the coarse space [3, 3, 0:H, contacts]
    complex(wp), intent(in) :: local(:, :, 0:, :)
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(contact_jacobian_type) :: jacobian
    real(wp), allocatable :: product(:, :), inverse(:, :)
    integer :: i, j

    status = 0
    if (allocated(self%blocks)) deallocate (self%blocks)
    allocate (self%blocks(size(balance%active%contacts)))
    do i = 1, size(balance%active%contacts)
      jacobian = jacobian_of(balance, i, self%stiffening)
      associate (block => self%blocks(i))
        block%rows = jacobian%rows
        if (allocated(product)) deallocate (product)
        allocate (product, mold=jacobian%values)
        call times_local(jacobian%values, local(:, :, :, i), balance%active%rows(i), product)
        inverse = product(:, block%rows)
        do j = 1, size(block%rows)
          inverse(j, j) = inverse(j, j) + 1.0_wp
        end do
        call invert(inverse, status)
        if (status /= 0) return
        block%inverse = real(inverse, sp)
        block%stiffness = real(matmul(inverse, jacobian%values), sp)
      end associate
    end do
  end subroutine new_blocks

  !> D L of one contact: L couples rows, and cosine with sine, of one harmonic.
  pure subroutine times_local(jacobian, local, rows, product)
    !> Rows of it [any, k rows]
    real(wp), intent(in) :: jacobian(:, :)
    !> [3, 3, 0:H]
    complex(wp), intent(in) :: local(:, :, 0:)
    !> Size over all ranks
    integer, intent(in) :: rows
    !> Takes the product
    real(wp), intent(out) :: product(:, :)
    integer :: from, to, h, k, c_from, c_to

    k = size(jacobian, 2)/rows
    product = 0.0_wp
    do to = 1, rows
      do from = 1, rows
        c_from = (from - 1)*k + 1
        c_to = (to - 1)*k + 1
        product(:, c_to) = product(:, c_to) + jacobian(:, c_from)*real(local(from, to, 0), wp)
        do h = 1, ubound(local, 3)
          associate (cosine => c_from + 2*h - 1, sine => c_from + 2*h, re => real(local(from, to, h), wp), &
                     im => aimag(local(from, to, h)))
            product(:, c_to + 2*h - 1) = product(:, c_to + 2*h - 1) + jacobian(:, cosine)*re - jacobian(:, sine)*im
            product(:, c_to + 2*h) = product(:, c_to + 2*h) + jacobian(:, cosine)*im + jacobian(:, sine)*re
          end associate
        end do
      end do
    end do
  end subroutine times_local

  !> (I + X U^T E U)^-1 X, coefficient running faster than motion.
  subroutine new_coarse(self, balance, space, status)
    type(two_level_factors_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> X and U
    type(coarse_space_type), intent(in) :: space
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    real(wp), allocatable, target :: felt(:, :, :, :), flexibility(:, :, :, :)
    real(wp), allocatable :: system(:, :), solution(:, :)
    real(wp), pointer :: flat(:)
    integer :: k, i, first, low

    status = 0
    low = space%number()
    k = balance%coefficients()
    if (allocated(self%coarse)) deallocate (self%coarse)
    if (low == 0) allocate (self%coarse(0, 0))
    if (low == 0) return
    allocate (felt(k, low, k, low), source=0.0_wp)
    allocate (flexibility, source=felt)
    do first = 1, size(self%contacts), bunch
      call add_bunch(self, balance, first, min(first + bunch - 1, size(self%contacts)), felt)
    end do
    flat(1:size(felt)) => felt
    call balance%ranks%sum(flat)
    call spread_over_coefficients(space%flexibility, flexibility)
    solution = reshape(flexibility, [k*low, k*low])
    system = matmul(solution, reshape(felt, [k*low, k*low]))
    do i = 1, k*low
      system(i, i) = system(i, i) + 1.0_wp
    end do
    call solve_dense(system, solution, status)
    self%coarse = real(solution, sp)
  end subroutine new_coarse

  !> X for cosine and sine: (c - i s)(re + i im).
  pure subroutine spread_over_coefficients(complex_values, values)
    !> [low, low, 0:H]
    complex(wp), intent(in) :: complex_values(:, :, 0:)
    !> [k, low, k, low], zeros to begin with
    real(wp), intent(inout) :: values(:, :, :, :)
    integer :: h

    values(1, :, 1, :) = real(complex_values(:, :, 0), wp)
    do h = 1, ubound(complex_values, 3)
      associate (c => 2*h, s => 2*h + 1)
        values(c, :, c, :) = real(complex_values(:, :, h), wp)
        values(c, :, s, :) = aimag(complex_values(:, :, h))
        values(s, :, c, :) = -aimag(complex_values(:, :, h))
        values(s, :, s, :) = real(complex_values(:, :, h), wp)
      end associate
    end do
  end subroutine spread_over_coefficients

  !> Add U^T E U of some contacts to the coarse system [k, low, k, low].
  subroutine add_bunch(self, balance, from, to, coarse)
    type(two_level_factors_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> First of the contacts; last of the contacts
    integer, intent(in) :: from, to
    !> Coarse system that is added to
    real(wp), intent(inout) :: coarse(:, :, :, :)
    real(sp), allocatable :: stacked(:, :, :, :), sums(:, :)
    integer, allocatable :: carriers(:)
    integer :: k, low, i, j, b

    k = size(coarse, 1)
    low = size(coarse, 2)
    carriers = [(balance%active%source(i) + carrying_rows(self%blocks(i), k), i=from, to)]
    allocate (stacked(k, k, low, size(carriers)), source=0.0_sp)
    j = 0
    do i = from, to
      associate (first => balance%active%source(i), last => balance%active%source(i) + balance%active%rows(i) - 1, &
                 own => carrying_rows(self%blocks(i), k))
        call stack(self%blocks(i), self%shapes(:, first:last), own, stacked(:, :, :, j + 1:j + size(own)))
        j = j + size(own)
      end associate
    end do
    sums = matmul(reshape(stacked, [k*k*low, size(carriers)]), transpose(self%shapes(:, carriers)))
    do j = 1, low
      do b = 1, k
        do i = 1, low
          coarse(:, i, b, j) = coarse(:, i, b, j) + sums(1 + k*(b - 1) + k*k*(j - 1):k*b + k*k*(j - 1), i)
        end do
      end do
    end do
  end subroutine add_bunch

  !> Rows of a contact at which E is not zero, from 0, ascending.
  pure function carrying_rows(block, coefficients) result(carriers)
    !> Inverse of the Jacobian's block of each contact
    type(block_type), intent(in) :: block
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients
    integer, allocatable :: carriers(:)
    logical :: carries(0:2)
    integer :: row

    carries = .false.
    carries((block%rows - 1)/coefficients) = .true.
    carriers = pack([(row, row=0, 2)], carries)
  end function carrying_rows

  !> E U of one contact.
  subroutine stack(block, shapes, carriers, stacked)
    !> Inverse of the Jacobian's block of each contact
    type(block_type), intent(in) :: block
    !> U^T at its rows [low, rows]
    real(sp), intent(in) :: shapes(:, :)
    !> Those of its rows, from 0, at which E is not zero
    integer, intent(in) :: carriers(:)
    !> E U by coefficient of the row, that of the mode, mode, and row [k, k, low, carriers], zeros to begin with
    real(sp), intent(inout) :: stacked(:, :, :, :)
    real(sp), allocatable :: carried(:, :)
    integer :: coefficient(size(block%rows)), position(size(block%rows)), places(0:size(shapes, 2) - 1), i, j, b, k, n, row

    k = size(stacked, 1)
    n = size(block%rows)
    places(carriers) = [(i, i=1, size(carriers))]
    coefficient = modulo(block%rows - 1, k) + 1
    position = places((block%rows - 1)/k)
    ! E as [(row, b), row'], b a coefficient, to [(row, b), mode]
    carried = matmul(reshape(block%stiffness, [n*k, size(shapes, 2)]), transpose(shapes))
    do j = 1, size(shapes, 1)
      do b = 1, k
        do row = 1, n
          stacked(coefficient(row), b, j, position(row)) = carried(row + (b - 1)*n, j)
        end do
      end do
    end do
  end subroutine stack
end module attrito_newton_two_level_factors
