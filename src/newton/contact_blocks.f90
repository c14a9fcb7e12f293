!> How contacts differ from what they are in the mean over the period, factored block by block: a part of the preconditioner of
!> Newton's steps.
!>
!> $$ z \leftarrow (I + D' L')^{-1} (z - D' m), \qquad D' = D - D_0, \qquad L' = own(R') $$
!>
!> D_0 and R' are contacts and structure in the mean (`mean_contacts`, at harmonic 0 `mean_response`), m the motion that forces
!> make which are in no block. D' couples the harmonics of one contact, own() is what the forces of a block's contacts move of
!> these: a block has as many contacts as its size allows. Factors are in single precision and kept from step to step while that pays
!> (`kept_factors`).
module attrito_newton_contact_blocks
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack, only: times_vector
  use attrito_core_lapack_single, only: factor_single, solve_factored_single
  use attrito_newton_active_jacobian, only: contact_jacobian_type, jacobian_of
  use attrito_newton_kept_factors, only: flops_of_iteration, kept_factors_type
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_mean_response, only: mean_response_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: contact_blocks_type

  !> Part of the springs by which a contact may differ from its mean and be taken for that
  real(wp), parameter :: negligible = 1.0e-6_wp ! guess
  !> Change of the springs kept in the step that makes the blocks void
  real(wp), parameter :: other_springs = 1.0e-3_wp ! guess

  !> A contact of a block: its number on this rank, its rows of B on all; rows of D' that are not zero, and these [unknowns, k rows]
  type :: member_type
    integer :: contact = 0
    integer, allocatable :: rows(:), unknowns(:)
    real(sp), allocatable :: values(:, :)
  end type member_type

  !> Its first and its last member, and factors of I + D' L'
  type :: block_type
    integer :: first = 1, last = 0
    integer, allocatable :: pivots(:)
    real(sp), allocatable :: factors(:, :)
  end type block_type

  type, extends(kept_factors_type) :: contact_blocks_type
    type(member_type), allocatable, private :: members(:)
    type(block_type), allocatable, private :: blocks(:)
    !> Part of the springs kept in the step they were made for
    real(wp), private :: stiffening = 0.0_wp
    !> Operations of making them, of this rank
    real(wp) :: flops = 0.0_wp
  contains
    procedure :: make
    procedure :: serve
    procedure :: rows_among
    procedure :: unknowns_among
    procedure :: apply
  end type contact_blocks_type

contains

  !> Do they serve the balance's last evaluation?
  pure logical function serve(self, balance, stiffening)
    class(contact_blocks_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening

    serve = allocated(self%blocks) .and. self%pays(balance%changes) .and. abs(self%stiffening - stiffening) < other_springs
  end function serve

  !> Make them for the balance's last evaluation.
  subroutine make(self, balance, stiffening, mean, of_mean, largest, status)
    class(contact_blocks_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Set to the frequency of that evaluation
    type(mean_contacts_type), intent(in) :: mean
    !> What stands for that at harmonic 0, if it is made
    type(mean_response_type), intent(in) :: of_mean
    !> Unknowns beyond which a block has one contact alone
    integer, intent(in) :: largest
    !> 0, or not: singular, and they are void
    integer, intent(out) :: status
    real(wp) :: sums(2)
    integer :: i

    self%stiffening = stiffening
    call find_members(balance, stiffening, mean, of_mean%is_made, self%members)
    call share_out(self%members, largest, self%blocks)
    status = 0
    self%flops = 0.0_wp
    do i = 1, size(self%blocks)
      associate (block => self%blocks(i), own => self%members(self%blocks(i)%first:self%blocks(i)%last))
        if (allocated(mean%receptance)) then
          call factor_block(balance, mean%receptance, of_mean, own, block, status)
        else
          call factor_block(balance, balance%receptance, of_mean, own, block, status)
        end if
        if (status /= 0) exit
        associate (n => real(size(block%pivots), wp), coordinates => size(balance%response, 1))
          self%flops = self%flops + 2.0_wp/3.0_wp*n**3 + 2.0_wp*n**2*coordinates/balance%coefficients()
        end associate
      end associate
    end do
    status = nint(min(balance%ranks%largest(real(abs(status), wp)), 1.0_wp))
    sums = [self%flops, real(balance%active%count, wp)]
    call balance%ranks%sum(sums)
    associate (iteration => flops_of_iteration*max(sums(2), 1.0_wp)*balance%coefficients()*size(balance%response, 1))
      call self%begin(balance%changes, max(1, nint(sums(1)/iteration)))
    end associate
    if (status /= 0) call self%discard()
  end subroutine make

  !> Active contacts of this rank that differ from their mean.
  subroutine find_members(balance, stiffening, mean, is_mean_apart, members)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> What springs have lost
    type(mean_contacts_type), intent(in) :: mean
    !> Has harmonic 0 a D_0 of its own, which is all that D has there?
    logical, intent(in) :: is_mean_apart
    !> In order
    type(member_type), allocatable, intent(out) :: members(:)
    type(member_type) :: all(size(balance%active%contacts))
    type(contact_jacobian_type) :: left
    real(wp) :: lost(balance%rows())
    integer :: i, row

    lost = mean%lost_of(balance)
    do i = 1, size(all)
      associate (first => balance%active%source(i), rows => balance%active%rows(i))
        left = jacobian_left(balance, i, stiffening, lost(first:first + rows - 1), is_mean_apart)
        all(i) = member_type(balance%active%contacts(i), [(balance%first_row - 1 + first + row, row=0, rows - 1)], left%rows, &
                             real(left%values, sp))
      end associate
    end do
    members = pack(all, [(size(all(i)%unknowns) > 0, i=1, size(all))])
  end subroutine find_members

  !> D' of an active contact: its rows that are not zero.
  pure function jacobian_left(balance, place, stiffening, lost, is_mean_apart) result(left)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Its place among these
    integer, intent(in) :: place
    !> Part of their springs that contacts keep; what springs of its rows have lost in the mean [rows]
    real(wp), intent(in) :: stiffening, lost(:)
    !> Has harmonic 0 a D_0 of its own?
    logical, intent(in) :: is_mean_apart
    type(contact_jacobian_type) :: left
    type(contact_jacobian_type) :: jacobian
    real(wp), allocatable :: values(:, :)
    integer :: i, k

    k = balance%coefficients()
    jacobian = jacobian_of(balance, place, stiffening)
    allocate (values(k*size(lost), k*size(lost)), source=0.0_wp)
    values(jacobian%rows, :) = jacobian%values
    do i = 1, size(values, 1)
      values(i, i) = values(i, i) + lost((i - 1)/k + 1)
    end do
    if (is_mean_apart) values(::k, ::k) = 0.0_wp
    associate (law => balance%law(balance%active%contacts(place)))
      left%rows = pack([(i, i=1, size(values, 1))], &
                       maxval(abs(values), 2) > negligible*max(law%tangential_stiffness, law%normal_stiffness))
    end associate
    left%values = values(left%rows, :)
  end function jacobian_left

  !> Which members each block has.
  pure subroutine share_out(members, largest, blocks)
    !> In order
    type(member_type), intent(in) :: members(:)
    !> Unknowns
    integer, intent(in) :: largest
    !> Without factors
    type(block_type), allocatable, intent(out) :: blocks(:)
    integer :: i, unknowns

    allocate (blocks(0))
    unknowns = 0
    do i = 1, size(members)
      associate (own => size(members(i)%unknowns))
        if (i == 1 .or. unknowns + own > largest) then
          blocks = [blocks, block_type(first=i)]
          unknowns = 0
        end if
        blocks(size(blocks))%last = i
        unknowns = unknowns + own
      end associate
    end do
  end subroutine share_out

  !> I + D' L' of a block.
  subroutine factor_block(balance, receptance, of_mean, members, block, status)
    !> Harmonic balance: is its mean frozen?
    type(balance_type), intent(in) :: balance
    !> R'
    class(receptance_type), intent(in) :: receptance
    !> R' at harmonic 0, if it is made
    type(mean_response_type), intent(in) :: of_mean
    !> Its contacts
    type(member_type), intent(in) :: members(:)
    !> Takes the factors
    type(block_type), intent(inout) :: block
    !> 0, or not: singular
    integer, intent(out) :: status
    complex(wp), allocatable :: flexibility(:, :, :)
    real(sp), allocatable :: received(:, :)
    integer, allocatable :: rows(:), carriers(:), coefficients(:)
    integer :: above, before, h, i, j, k

    k = balance%coefficients()
    rows = [(members(i)%rows, i=1, size(members))]
    allocate (carriers(0), coefficients(0))
    above = 0
    do i = 1, size(members)
      associate (own => members(i)%unknowns)
        coefficients = [coefficients, modulo(own - 1, k) + 1]
        carriers = [carriers, above + (own - 1)/k + 1]
      end associate
      above = above + size(members(i)%rows)
    end do
    allocate (flexibility(size(rows), size(rows), 0:receptance%harmonics), source=(0.0_wp, 0.0_wp))
    do h = merge(1, receptance%lowest, allocated(balance%frozen_mean)), receptance%harmonics
      call receptance%block_between(h, rows, rows, flexibility(:, :, h))
    end do
    if (of_mean%is_made) flexibility(:, :, 0) = of_mean%between(rows)
    allocate (block%factors(size(carriers), size(carriers)), block%pivots(size(carriers)))
    above = 0
    before = 0
    do i = 1, size(members)
      associate (own => size(members(i)%rows), unknowns => size(members(i)%unknowns))
        received = real_coefficients(flexibility(above + 1:above + own, :, :), carriers, coefficients)
        block%factors(before + 1:before + unknowns, :) = matmul(members(i)%values, received)
        above = above + own
        before = before + unknowns
      end associate
    end do
    do j = 1, size(carriers)
      block%factors(j, j) = block%factors(j, j) + 1.0_sp
    end do
    call factor_single(block%factors, block%pivots, status)
  end subroutine factor_block

  !> Real receptance from unknowns to all coefficients of a contact's rows [k rows, unknowns].
  pure function real_coefficients(values, carriers, coefficient) result(received)
    !> Between rows, by harmonic [rows, carriers, 0:H]
    complex(wp), intent(in) :: values(:, :, 0:)
    !> Unknowns' rows among the carriers, and their coefficients
    integer, intent(in) :: carriers(:), coefficient(:)
    real(sp) :: received((2*ubound(values, 3) + 1)*size(values, 1), size(carriers))
    integer :: h, i, k, row

    k = 2*ubound(values, 3) + 1
    received = 0.0_sp
    do i = 1, size(carriers)
      h = coefficient(i)/2
      do row = 1, size(values, 1)
        associate (value => values(row, carriers(i), h), cosine => (row - 1)*k + 2*h, sine => (row - 1)*k + 2*h + 1)
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

  !> Rows of contacts with a block, as far as these are active now: places among the active rows.
  pure function rows_among(self, balance) result(places)
    class(contact_blocks_type), intent(in) :: self
    !> Harmonic balance: which contacts are active
    type(balance_type), intent(in) :: balance
    integer, allocatable :: places(:)
    integer :: first(size(balance%law)), i, row

    first = 0
    first(balance%active%contacts) = balance%active%first
    allocate (places(0))
    do i = 1, size(self%members)
      associate (own => first(self%members(i)%contact))
        if (own > 0) places = [places, (own + row, row=0, size(self%members(i)%rows) - 1)]
      end associate
    end do
  end function rows_among

  !> Which coefficients of the rows above blocks solve for [k, rows].
  pure function unknowns_among(self, balance) result(are_unknown)
    class(contact_blocks_type), intent(in) :: self
    !> Harmonic balance: which contacts are active
    type(balance_type), intent(in) :: balance
    logical, allocatable :: are_unknown(:, :)
    logical :: is_active(size(balance%law))
    integer :: above, i, j, k

    k = balance%coefficients()
    is_active = .false.
    is_active(balance%active%contacts) = .true.
    allocate (are_unknown(k, size(self%rows_among(balance))), source=.false.)
    above = 0
    do i = 1, size(self%members)
      associate (member => self%members(i))
        if (.not. is_active(member%contact)) cycle
        do j = 1, size(member%unknowns)
          are_unknown(modulo(member%unknowns(j) - 1, k) + 1, above + (member%unknowns(j) - 1)/k + 1) = .true.
        end do
        above = above + size(member%rows)
      end associate
    end do
  end function unknowns_among

  !> z from z and m on the rows above.
  subroutine apply(self, balance, z, motion)
    class(contact_blocks_type), intent(in) :: self
    !> Harmonic balance: which contacts are active
    type(balance_type), intent(in) :: balance
    !> z and m [k, rows]
    real(sp), intent(inout), contiguous, target :: z(:, :)
    real(sp), intent(in), contiguous, target :: motion(:, :)
    real(sp), pointer :: flat_z(:), flat_motion(:)
    real(sp), allocatable :: own(:)
    real(sp) :: product(3*size(z, 1))
    logical :: is_active(size(balance%law))
    integer :: start(size(self%members)), i, j, next, unknowns

    is_active = .false.
    is_active(balance%active%contacts) = .true.
    next = 0
    do j = 1, size(self%members)
      start(j) = merge(next, -1, is_active(self%members(j)%contact))
      if (start(j) >= 0) next = next + size(z, 1)*size(self%members(j)%rows)
    end do
    flat_z(1:size(z)) => z
    flat_motion(1:size(motion)) => motion
    do i = 1, size(self%blocks)
      associate (block => self%blocks(i))
        allocate (own(size(block%pivots)), source=0.0_sp)
        unknowns = 0
        do j = block%first, block%last
          associate (member => self%members(j), n => size(self%members(j)%unknowns))
            if (start(j) >= 0) then
              call times_vector(member%values, flat_motion(start(j) + 1:start(j) + size(member%values, 2)), product(:n))
              own(unknowns + 1:unknowns + n) = flat_z(start(j) + member%unknowns) - product(:n)
            end if
            unknowns = unknowns + n
          end associate
        end do
        call solve_factored_single(block%factors, block%pivots, own)
        unknowns = 0
        do j = block%first, block%last
          associate (places => self%members(j)%unknowns)
            if (start(j) >= 0) flat_z(start(j) + places) = own(unknowns + 1:unknowns + size(places))
            unknowns = unknowns + size(places)
          end associate
        end do
        deallocate (own)
      end associate
    end do
  end subroutine apply
end module attrito_newton_contact_blocks
