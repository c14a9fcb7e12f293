!> The condensed linear system of a Newton step, formed on the active rows only and solved by LU:
!>
!>   [ I + (D R)_AA     (D b)_A ] [ y            ]   [ (D rho)_A         ]
!>   [ -p^T R_A         q - p^T b ] [ delta omega ] = [ sigma - p^T rho  ]
!>
!> A are the rows where D = dg/dd is not zero: a stuck contact costs nothing, one that slips without opening its tangents only; the
!> bordered form is regular at simple folds. Ranks bring their rows; the first solves. Its factors serve further right-hand sides.
module attrito_newton_condensed_dense
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: factor_dense, solve_factored
  use attrito_newton_active_jacobian, only: change_with_omega, contact_jacobian_type, jacobian_of, places_of_rows, unknowns_of
  use attrito_newton_border, only: border_type
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: elimination_type, solve_by_elimination

  !> LU factors of a balance's linearisation under one constraint: they hold until its next evaluation
  type :: elimination_type
    logical :: is_made = .false.
    !> At the root: [n + 1, n + 1], row interchanges [n + 1], and by what the border's row and column were divided
    real(wp), allocatable, private :: matrix(:, :)
    integer, allocatable, private :: pivots(:)
    real(wp), private :: row = 1.0_wp, column = 1.0_wp
  end type elimination_type

  !> An active entry of D's rows
  type :: entry_type
    !> Row of B among all ranks', coefficient in it; place of the row among the active ones of its rank, if that is this one
    integer :: row = 0, coefficient = 0, local_row = 0
  end type entry_type

  !> Receptance at one harmonic
  type :: block_type
    !> Active entries of this harmonic, by their place among all
    integer, allocatable :: columns(:)
    !> From them to rows of this rank [rows, columns]
    complex(wp), allocatable :: values(:, :)
  end type block_type

contains

  !> Solve for y and omega; the balance holds the Jacobian of its last evaluation.
  subroutine solve_by_elimination(balance, border, stiffening, rho, last, factors, y, omega, status)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Row and column of the constraint
    type(border_type), intent(in) :: border
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Right-hand side of the balance [2 H + 1, active rows], and sigma - p^T rho
    real(wp), intent(in) :: rho(:, :), last
    !> Of this linearisation and border if they are made, else they are made
    type(elimination_type), intent(inout) :: factors
    !> D delta d [2 H + 1, active rows] and step of omega
    real(wp), intent(out) :: y(:, :), omega
    !> 0, or not: singular
    integer, intent(out) :: status
    type(entry_type), allocatable :: mine(:), all(:)
    real(wp), allocatable :: solution(:, :), right(:, :)
    integer :: i

    call list_active(balance, mine, all)
    call balance%ranks%gather_columns(reshape(right_side(balance, stiffening, rho, size(mine)), [1, size(mine)]), right)
    status = 0
    if (.not. factors%is_made) call make_factors(balance, border, stiffening, mine, all, factors, status)
    y = 0.0_wp
    omega = 0.0_wp
    if (status /= 0) return
    allocate (solution(size(all) + 1, 1), source=0.0_wp)
    if (balance%ranks%is_root()) then
      solution(:, 1) = [right, last/factors%row]
      call solve_factored(factors%matrix, factors%pivots, solution)
      solution(size(solution), 1) = solution(size(solution), 1)/factors%column
    end if
    call balance%ranks%broadcast(solution(:, 1))
    i = offset_of_rank(mine, all)
    call scatter(mine, solution(i + 1:i + size(mine), 1), y)
    omega = solution(size(solution), 1)
  end subroutine solve_by_elimination

  !> Form the system and factor it, with the border, whose units are its own, of the size of the rest: pivots do not depend on the
  !> units of length and time.
  subroutine make_factors(balance, border, stiffening, mine, all, factors, status)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Row and column of the constraint
    type(border_type), intent(in) :: border
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Active entries of this rank; active entries of all ranks
    type(entry_type), intent(in) :: mine(:), all(:)
    type(elimination_type), intent(inout) :: factors
    !> 0, or not: singular
    integer, intent(out) :: status
    real(wp), allocatable :: transposed_rows(:, :), everyone(:, :), bottom(:, :), row(:, :)
    integer :: i, n

    n = size(all)
    call assemble_rows(balance, stiffening, mine, all, transposed_rows)
    call balance%ranks%gather_columns(transposed_rows, everyone)
    allocate (row(balance%coefficients(), balance%active%count), source=0.0_wp)
    if (border%has_motion) row = border%row_at(balance%active%contact_rows)
    call balance%ranks%gather_columns( &
      reshape([(row(mine(i)%coefficient, mine(i)%local_row), i=1, size(mine))], [1, size(mine)]), bottom)
    status = 0
    if (balance%ranks%is_root()) then
      if (allocated(factors%matrix)) deallocate (factors%matrix)
      allocate (factors%matrix(n + 1, n + 1))
      associate (system => factors%matrix)
        system(:n, :) = transpose(everyone)
        system(n + 1, :) = [-bottom, border%corner]
        factors%column = largest_or_one(system(:n, n + 1))
        system(:, n + 1) = system(:, n + 1)/factors%column
        factors%row = largest_or_one(system(n + 1, :))
        system(n + 1, :) = system(n + 1, :)/factors%row
      end associate
      call factor_dense(factors%matrix, factors%pivots, status)
    end if
    call balance%ranks%broadcast_integer(status)
    factors%is_made = status == 0
  end subroutine make_factors

  !> Largest size of any number, or 1 if there is none above zero.
  pure real(wp) function largest_or_one(numbers) result(largest)
    !> Numbers to compare
    real(wp), intent(in) :: numbers(:)

    largest = maxval([0.0_wp, abs(numbers)])
    if (.not. largest > 0.0_wp) largest = 1.0_wp
  end function largest_or_one

  !> Active entries of this rank and of all, in the order of ranks.
  subroutine list_active(balance, mine, all)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Active entries of this rank; active entries of all ranks
    type(entry_type), allocatable, intent(out) :: mine(:), all(:)
    integer, allocatable :: unpacked(:)
    integer :: packed(balance%active%count*balance%coefficients())
    integer :: contact, count, i, k

    k = balance%coefficients()
    allocate (mine(unknowns_of(balance)))
    count = 0
    associate (rows => balance%active)
      do contact = 1, size(rows%contacts)
        associate (active => balance%forces(rows%contacts(contact))%active, above => balance%first_row + rows%source(contact) - 1)
          do i = 1, size(active)
            if (.not. active(i)) cycle
            count = count + 1
            mine(count) = entry_type(above + (i - 1)/k, modulo(i - 1, k) + 1, rows%first(contact) + (i - 1)/k)
            packed(count) = (mine(count)%row - 1)*k + mine(count)%coefficient
          end do
        end associate
      end do
    end associate
    call balance%ranks%gather_integers(packed(:count), unpacked)
    allocate (all(size(unpacked)))
    do i = 1, size(all)
      all(i) = entry_type((unpacked(i) - 1)/k + 1, modulo(unpacked(i) - 1, k) + 1)
    end do
  end subroutine list_active

  !> This rank's part of D rho [mine].
  function right_side(balance, stiffening, rho, mine) result(right)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Right-hand side over contact rows
    real(wp), intent(in) :: rho(:, :)
    !> Number of active entries of this rank
    integer, intent(in) :: mine
    real(wp) :: right(mine)
    type(contact_jacobian_type) :: jacobian
    integer :: contact, above

    above = 0
    do contact = 1, size(balance%active%contacts)
      jacobian = jacobian_of(balance, contact, stiffening)
      associate (first => balance%active%first(contact), own => balance%active%rows(contact), count => size(jacobian%rows))
        right(above + 1:above + count) = matmul(jacobian%values, reshape(rho(:, first:first + own - 1), [size(rho, 1)*own]))
        above = above + count
      end associate
    end do
  end function right_side

  !> This rank's rows of the dense system, as columns: [n + 1, mine], the last one being D b.
  subroutine assemble_rows(balance, stiffening, mine, all, transposed_rows)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Active entries of this rank; active entries of all ranks
    type(entry_type), intent(in) :: mine(:), all(:)
    !> Rows of this rank, as columns
    real(wp), allocatable, intent(out) :: transposed_rows(:, :)
    type(block_type), allocatable :: blocks(:)
    type(contact_jacobian_type) :: jacobian
    real(wp), allocatable :: receptance(:, :), rows(:, :), by_omega(:, :)
    integer :: contact, column, i, k, n, offset

    n = size(all)
    k = balance%coefficients()
    allocate (transposed_rows(n + 1, size(mine)))
    call receptance_blocks(balance, all, blocks)
    by_omega = change_with_omega(balance)
    column = 0
    offset = offset_of_rank(mine, all)
    do contact = 1, size(balance%active%contacts)
      jacobian = jacobian_of(balance, contact, stiffening)
      associate (first => balance%active%first(contact), own => balance%active%rows(contact), count => size(jacobian%rows))
        call receptance_to(blocks, all, first - 1, own, k, receptance)
        receptance(:, n + 1) = reshape(by_omega(:, first:first + own - 1), [k*own])
        rows = matmul(jacobian%values, receptance)
        do i = 1, count
          rows(i, offset + column + i) = rows(i, offset + column + i) + 1.0_wp
        end do
        transposed_rows(:, column + 1:column + count) = transpose(rows)
        column = column + count
      end associate
    end do
  end subroutine assemble_rows

  !> Receptances from the active entries of each harmonic to all rows of this rank's contacts that have any.
  subroutine receptance_blocks(balance, all, blocks)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Active entries of all ranks
    type(entry_type), intent(in) :: all(:)
    !> Inverse of the Jacobian's block of each contact
    type(block_type), allocatable, intent(out) :: blocks(:)
    integer :: h, i
    integer :: rows(balance%active%count)

    rows = places_of_rows(balance)
    allocate (blocks(0:balance%receptance%harmonics))
    do h = 0, balance%receptance%harmonics
      blocks(h)%columns = pack([(i, i=1, size(all))], all%coefficient/2 == h)
      allocate (blocks(h)%values(size(rows), size(blocks(h)%columns)), source=(0.0_wp, 0.0_wp))
      if (h == 0 .and. allocated(balance%frozen_mean)) cycle
      call balance%receptance%block_between(h, rows, all(blocks(h)%columns)%row, blocks(h)%values)
    end do
  end subroutine receptance_blocks

  !> Where this rank's active entries begin among all.
  pure integer function offset_of_rank(mine, all)
    !> Active entries of this rank; active entries of all ranks
    type(entry_type), intent(in) :: mine(:), all(:)

    offset_of_rank = 0
    if (size(mine) == 0) return
    do offset_of_rank = 0, size(all) - 1
      associate (entry => all(offset_of_rank + 1))
        if (entry%row == mine(1)%row .and. entry%coefficient == mine(1)%coefficient) return
      end associate
    end do
  end function offset_of_rank

  !> Real receptance from the active entries to all coefficients of a contact's rows [k rows, n + 1]; the last column is free.
  pure subroutine receptance_to(blocks, all, above, rows, k, receptance)
    !> Inverse of the Jacobian's block of each contact
    type(block_type), intent(in) :: blocks(0:)
    !> Active entries of all ranks
    type(entry_type), intent(in) :: all(:)
    !> Rows in the blocks before the contact's, its rows, and coefficients a row
    integer, intent(in) :: above, rows, k
    !> Receptance from active entries to the contact's rows
    real(wp), allocatable, intent(out) :: receptance(:, :)
    integer :: h, i, row, mean_or_cosine, sine

    allocate (receptance(k*rows, size(all) + 1), source=0.0_wp)
    do h = 0, ubound(blocks, 1)
      do i = 1, size(blocks(h)%columns)
        associate (column => blocks(h)%columns(i))
          do row = 1, rows
            mean_or_cosine = (row - 1)*k + max(2*h, 1)
            sine = (row - 1)*k + 2*h + 1
            associate (value => blocks(h)%values(above + row, i))
              if (modulo(all(column)%coefficient, 2) == 0 .or. h == 0) then
                receptance(mean_or_cosine, column) = real(value, wp)
                if (h > 0) receptance(sine, column) = -aimag(value)
              else
                receptance(mean_or_cosine, column) = aimag(value)
                receptance(sine, column) = real(value, wp)
              end if
            end associate
          end do
        end associate
      end do
    end do
  end subroutine receptance_to

  !> Put the solution of this rank's entries into the field of its active rows.
  pure subroutine scatter(mine, solution, field)
    !> Active entries of this rank
    type(entry_type), intent(in) :: mine(:)
    !> Solution of this rank's entries
    real(wp), intent(in) :: solution(:)
    !> Vector over the rows of contacts
    real(wp), intent(inout) :: field(:, :)
    integer :: i

    do i = 1, size(mine)
      field(mine(i)%coefficient, mine(i)%local_row) = solution(i)
    end do
  end subroutine scatter
end module attrito_newton_condensed_dense
