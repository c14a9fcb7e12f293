!> How the mean of the contacts' motion responds to the mean of their forces, contacts being as they are at an evaluation:
!>
!> $$ X = I + D_{00} R_0, \qquad R'_0 = R_0 X^{-1} $$
!>
!> D_00 is what mean forces change by with mean motion, contact by contact. It is softer than at the other harmonics: contacts that
!> all slip at some time of the period hardly hold the mean, and a body that only they hold nearly drifts. One D_0 for all harmonics
!> (`mean_contacts`) does not tell, so that the preconditioner takes this one at harmonic 0. It is in double precision, as X may be
!> singular but for what springs always keep.
module attrito_newton_mean_response
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: invert, times_vector
  use attrito_newton_active_jacobian, only: contact_jacobian_type, jacobian_of, places_of_rows
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: mean_response_type

  !> Rows, of all ranks, beyond which every rank would do more for harmonic 0 than for its blocks
  integer, parameter :: most_rows = 1500 ! guess

  type :: mean_response_type
    !> Is it at hand? If not, harmonic 0 is as the others are
    logical :: is_made = .false.
    !> Active rows of all ranks when it was made, ascending; X^-1 and R'_0
    integer, allocatable, private :: rows(:)
    real(wp), allocatable, private :: inverse(:, :), flexibility(:, :)
    !> Operations of making it, of each rank
    real(wp) :: flops = 0.0_wp
  contains
    procedure :: make
    procedure :: motion_of
    procedure :: solve
    procedure :: between
    procedure :: places_of
  end type mean_response_type

contains

  !> Of the balance's last evaluation. Not made where the mean is frozen or has no receptance, nor where X is singular.
  subroutine make(self, balance, stiffening)
    class(mean_response_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    real(wp), allocatable :: receptance(:, :), system(:, :)
    complex(wp), allocatable :: block(:, :)
    integer :: i, status

    self%is_made = .false.
    self%flops = 0.0_wp
    if (allocated(balance%frozen_mean) .or. balance%receptance%lowest > 0) return
    call balance%ranks%gather_integers(places_of_rows(balance), self%rows)
    associate (n => size(self%rows))
      if (n == 0 .or. n > most_rows) return
      allocate (block(n, n))
      call balance%receptance%block_between(0, self%rows, self%rows, block)
      receptance = real(block, wp)
      system = soften(balance, stiffening, self%places_of(balance), receptance)
      call balance%ranks%sum(system)
      do i = 1, n
        system(i, i) = system(i, i) + 1.0_wp
      end do
      call invert(system, status)
      self%is_made = status == 0
      if (.not. self%is_made) return
      self%inverse = system
      self%flexibility = matmul(receptance, system)
      self%flops = 4.0_wp*real(n, wp)**3 + 2.0_wp*real(n, wp)**2*size(balance%response, 1)
    end associate
  end subroutine make

  !> D_00 R_0, the rows of this rank's contacts [rows, rows].
  function soften(balance, stiffening, places, receptance) result(product)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Of this rank's active rows among those of all; R_0 between these
    integer, intent(in) :: places(:)
    real(wp), intent(in) :: receptance(:, :)
    real(wp) :: product(size(receptance, 1), size(receptance, 2))
    type(contact_jacobian_type) :: jacobian
    integer :: i, row, k

    k = balance%coefficients()
    product = 0.0_wp
    do i = 1, size(balance%active%contacts)
      jacobian = jacobian_of(balance, i, stiffening)
      associate (own => places(balance%active%first(i):balance%active%first(i) + balance%active%rows(i) - 1))
        do row = 1, size(jacobian%rows)
          if (modulo(jacobian%rows(row) - 1, k) /= 0) cycle
          product(own((jacobian%rows(row) - 1)/k + 1), :) = matmul(jacobian%values(row, ::k), receptance(own, :))
        end do
      end associate
    end do
  end function soften

  !> Where the active rows of this rank are among those it was made for; 0: nowhere.
  pure function places_of(self, balance) result(places)
    class(mean_response_type), intent(in) :: self
    !> Harmonic balance: which contacts are active
    type(balance_type), intent(in) :: balance
    integer :: places(balance%active%count)
    integer :: rows(balance%active%count), i

    rows = places_of_rows(balance)
    do i = 1, size(rows)
      places(i) = findloc(self%rows, rows(i), 1)
    end do
  end function places_of

  !> R'_0 f: motion of this rank's active rows due to forces on those of all ranks.
  function motion_of(self, ranks, places, forces) result(motion)
    class(mean_response_type), intent(in) :: self
    !> Ranks that the rows are spread over
    type(communicator_type), intent(in) :: ranks
    !> Of this rank's active rows (`places_of`)
    integer, intent(in) :: places(:)
    !> Mean forces on these [rows]
    real(wp), intent(in) :: forces(:)
    real(wp) :: motion(size(forces))

    motion = times(self%flexibility, ranks, places, forces, 0.0_wp*forces)
  end function motion_of

  !> X^-1 z; rows that it was not made for stay as they are.
  function solve(self, ranks, places, z) result(y)
    class(mean_response_type), intent(in) :: self
    !> Ranks that the rows are spread over
    type(communicator_type), intent(in) :: ranks
    !> Of this rank's active rows (`places_of`)
    integer, intent(in) :: places(:)
    !> Means there [rows]
    real(wp), intent(in) :: z(:)
    real(wp) :: y(size(z))

    y = times(self%inverse, ranks, places, z, z)
  end function solve

  !> A matrix of all rows times a vector that is spread over ranks; `elsewhere` for rows it was not made for.
  function times(matrix, ranks, places, vector, elsewhere) result(product)
    !> [rows of all ranks, rows of all ranks]
    real(wp), intent(in), contiguous :: matrix(:, :)
    !> Ranks that the rows are spread over
    type(communicator_type), intent(in) :: ranks
    !> Of this rank's active rows
    integer, intent(in) :: places(:)
    real(wp), intent(in) :: vector(:), elsewhere(:)
    real(wp) :: product(size(vector)), all(size(matrix, 1))
    real(wp) :: sums(size(matrix, 2))
    integer :: i

    sums = 0.0_wp
    do i = 1, size(places)
      if (places(i) > 0) sums(places(i)) = vector(i)
    end do
    call ranks%sum(sums)
    call times_vector(matrix, sums, all)
    product = elsewhere
    do i = 1, size(places)
      if (places(i) > 0) product(i) = all(places(i))
    end do
  end function times

  !> R'_0 between rows of B that it was made for.
  pure function between(self, rows) result(block)
    class(mean_response_type), intent(in) :: self
    !> Rows of B, of all ranks
    integer, intent(in) :: rows(:)
    real(wp) :: block(size(rows), size(rows))
    integer :: places(size(rows)), i

    do i = 1, size(rows)
      places(i) = findloc(self%rows, rows(i), 1)
    end do
    block = self%flexibility(places, places)
  end function between
end module attrito_newton_mean_response
