!> What the two-level preconditioner is made of, from the state of the contacts at one linear system, and kept for the next ones:
!>
!> $$ R_{local}, \qquad E = (I + D R_{local})^{-1} D, \qquad Z + U^T E U $$
!>
!> The blocks E couple the rows and harmonics of one contact; the coarse system couples the harmonics of some ten modes and is
!> factored on every rank. Making them costs as much as a dozen iterations of GMRES, so they are made anew only when iterations in
!> excess of what they took at first have cost as much, when contacts have moved to other ranks or the series' length has changed, or
!> when much more of the springs is kept.
module attrito_balance_two_level_factors
  use attrito_core_kinds, only: sp, wp
  use attrito_core_lapack, only: solve_dense, factor
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: two_level_factors_type

  !> Contacts taken together in the coarse system, to bound its memory
  integer, parameter :: bunch = 32
  !> Iterations of GMRES that cost as much as to make the factors
  integer, parameter :: worth = 12
  !> Change of the springs kept in the step that makes them void
  real(wp), parameter :: other_springs = 1.0e-3_wp

  !> Rows of a matrix that are not zero [rows, all columns], in single precision: to read them is what applying them costs
  type :: block_type
    integer, allocatable :: rows(:)
    real(sp), allocatable :: values(:, :)
  contains
    procedure :: multiply
  end type block_type

  type :: two_level_factors_type
    !> Contacts that are known, by their place among this rank's, ascending
    integer, allocatable :: contacts(:)
    !> R_local by contact and harmonic [3, 3, 0:H, contacts]
    complex(wp), allocatable :: local(:, :, :, :)
    !> E by contact
    type(block_type), allocatable :: blocks(:)
    !> Factors of the coarse system [k low, k low], of so many modes
    integer :: low = 0
    real(wp), allocatable :: coarse(:, :)
    integer, allocatable :: pivots(:)
    !> What they were made for: contacts and series of then, springs kept
    integer, private :: changes = 0
    real(wp), private :: stiffening = 0.0_wp
    !> Iterations of GMRES with them: at first, and beyond that since
    integer, private :: usual = -1, excess = 0
  contains
    procedure :: make
    procedure :: serve
    procedure :: patience
    procedure :: count
    procedure :: discard
    procedure :: places_of
  end type two_level_factors_type

contains

  !> The rows times a vector; sums are in double precision, so that GMRES sees one and the same linear operator.
  pure subroutine multiply(self, vector, product)
    class(block_type), intent(in) :: self
    real(wp), intent(in) :: vector(:)
    real(wp), intent(out), contiguous :: product(:)
    integer :: i

    product = 0.0_wp
    do i = 1, size(vector)
      product = product + self%values(:, i)*vector(i)
    end do
  end subroutine multiply

  !> Do they serve the balance's last evaluation?
  pure logical function serve(self, balance)
    class(two_level_factors_type), intent(in) :: self
    type(balance_type), intent(in) :: balance

    serve = allocated(self%coarse) .and. self%changes == balance%changes .and. self%excess < worth &
            .and. abs(self%stiffening - balance%stiffening) < other_springs
  end function serve

  !> Iterations after which it is better to make them anew; no limit to those just made.
  pure integer function patience(self)
    class(two_level_factors_type), intent(in) :: self

    patience = huge(patience)
    if (self%usual >= 0) patience = self%usual + worth
  end function patience

  !> Take note of the iterations of a solve.
  pure subroutine count(self, iterations)
    class(two_level_factors_type), intent(inout) :: self
    integer, intent(in) :: iterations

    if (self%usual < 0) self%usual = iterations
    self%excess = self%excess + max(iterations - self%usual, 0)
  end subroutine count

  !> Never to be used again.
  pure subroutine discard(self)
    class(two_level_factors_type), intent(inout) :: self

    self%excess = worth
  end subroutine discard

  !> Places of contacts among those that are known, 0 for none; both ascend.
  pure function places_of(self, contacts) result(places)
    class(two_level_factors_type), intent(in) :: self
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
  subroutine make(self, balance, low, status)
    class(two_level_factors_type), intent(inout) :: self
    type(balance_type), intent(in) :: balance
    !> Lowest modes in the coarse system
    integer, intent(in) :: low
    !> 0, or not: singular, and they are void
    integer, intent(out) :: status
    real(wp), allocatable :: shapes(:, :)

    self%contacts = balance%active%contacts
    self%low = min(low, size(balance%directions, 1))
    self%changes = balance%changes
    self%stiffening = balance%stiffening
    self%usual = -1
    self%excess = 0
    shapes = balance%receptance%low_shapes(self%low, balance%active%directions)
    call new_local(self, balance)
    call new_blocks(self, balance, status)
    call agree(balance, status)
    if (status == 0) call new_coarse(self, balance, shapes, status)
    if (status /= 0) call self%discard()
  end subroutine make

  !> A failure of any rank is one of all.
  subroutine agree(balance, status)
    type(balance_type), intent(in) :: balance
    integer, intent(inout) :: status

    status = nint(min(balance%ranks%largest(real(abs(status), wp)), 1.0_wp))
  end subroutine agree

  !> R_local of every active contact: its own receptance without the lowest modes.
  subroutine new_local(self, balance)
    type(two_level_factors_type), intent(inout) :: self
    type(balance_type), intent(in) :: balance
    integer :: i

    if (allocated(self%local)) deallocate (self%local)
    associate (active => balance%active)
      allocate (self%local(3, 3, 0:balance%receptance%harmonics, size(active%contacts)), source=(0.0_wp, 0.0_wp))
      do i = 1, size(active%contacts)
        associate (n => active%rows(i), directions => active%directions(:, active%first(i):active%first(i) + active%rows(i) - 1))
          call balance%receptance%remainder(self%low, directions, self%local(:n, :n, :, i))
        end associate
      end do
    end associate
    if (allocated(balance%frozen_mean)) self%local(:, :, 0, :) = 0.0_wp
  end subroutine new_local

  !> E = (I + D R_local)^-1 D, contact by contact, on the rows where D is not zero.
  subroutine new_blocks(self, balance, status)
    type(two_level_factors_type), intent(inout) :: self
    type(balance_type), intent(in) :: balance
    integer, intent(out) :: status
    real(wp), allocatable :: jacobian(:, :), product(:, :), matrix(:, :)
    integer, allocatable :: kept(:)
    integer :: i, j

    status = 0
    if (allocated(self%blocks)) deallocate (self%blocks)
    allocate (self%blocks(size(balance%active%contacts)))
    do i = 1, size(balance%active%contacts)
      associate (forces => balance%forces(balance%active%contacts(i)), block => self%blocks(i))
        kept = pack([(j, j=1, size(forces%active))], forces%active)
        jacobian = (1.0_wp - balance%stiffening)*forces%jacobian(kept, :)
        if (allocated(product)) deallocate (product)
        allocate (product(size(kept), size(forces%active)))
        call times_local(jacobian, self%local(:, :, :, i), balance%active%rows(i), product)
        matrix = product(:, kept)
        do j = 1, size(kept)
          matrix(j, j) = matrix(j, j) + 1.0_wp
        end do
        call solve_dense(matrix, jacobian, status)
        if (status /= 0) return
        block = block_type(kept, real(jacobian, sp))
      end associate
    end do
  end subroutine new_blocks

  !> D R_local of one contact: R_local couples rows, and cosine with sine, of one harmonic.
  pure subroutine times_local(jacobian, local, rows, product)
    !> Rows of it [any, k rows]
    real(wp), intent(in) :: jacobian(:, :)
    !> [3, 3, 0:H]
    complex(wp), intent(in) :: local(:, :, 0:)
    integer, intent(in) :: rows
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

  !> Z + U^T E U, coefficient running faster than mode, factored.
  subroutine new_coarse(self, balance, shapes, status)
    type(two_level_factors_type), intent(inout) :: self
    type(balance_type), intent(in) :: balance
    !> U^T [low, active rows]
    real(wp), intent(in) :: shapes(:, :)
    integer, intent(out) :: status
    real(wp), allocatable :: coarse(:, :, :, :)
    complex(wp), allocatable :: stiffness(:)
    integer :: k, h, i, first

    k = balance%coefficients()
    allocate (coarse(k, self%low, k, self%low), source=0.0_wp)
    do first = 1, size(self%contacts), bunch
      call add_bunch(self, balance, shapes, first, min(first + bunch - 1, size(self%contacts)), coarse)
    end do
    call sum_over_ranks(coarse)
    if (allocated(balance%frozen_mean)) then
      coarse(1, :, :, :) = 0.0_wp
      coarse(:, :, 1, :) = 0.0_wp
    end if
    do h = 0, balance%receptance%harmonics
      stiffness = balance%receptance%low_stiffness(h, self%low)
      do i = 1, self%low
        if (h == 0) then
          coarse(1, i, 1, i) = coarse(1, i, 1, i) + real(stiffness(i), wp)
        else
          associate (c => 2*h, s => 2*h + 1, re => real(stiffness(i), wp), im => aimag(stiffness(i)))
            coarse(c, i, c, i) = coarse(c, i, c, i) + re
            coarse(c, i, s, i) = coarse(c, i, s, i) + im
            coarse(s, i, c, i) = coarse(s, i, c, i) - im
            coarse(s, i, s, i) = coarse(s, i, s, i) + re
          end associate
        end if
      end do
    end do
    self%coarse = reshape(coarse, [k*self%low, k*self%low])
    if (allocated(self%pivots)) deallocate (self%pivots)
    allocate (self%pivots(k*self%low))
    call factor(self%coarse, self%pivots, status)

  contains

    subroutine sum_over_ranks(values)
      real(wp), intent(inout), contiguous, target :: values(:, :, :, :)
      real(wp), pointer :: flat(:)

      flat(1:size(values)) => values
      call balance%ranks%sum(flat)
    end subroutine sum_over_ranks
  end subroutine new_coarse

  !> Add U^T E U of some contacts to the coarse system [k, low, k, low].
  subroutine add_bunch(self, balance, shapes, from, to, coarse)
    type(two_level_factors_type), intent(in) :: self
    type(balance_type), intent(in) :: balance
    real(wp), intent(in) :: shapes(:, :)
    integer, intent(in) :: from, to
    real(wp), intent(inout) :: coarse(:, :, :, :)
    real(wp), allocatable :: carried(:, :), stacked(:, :, :, :), sums(:, :)
    integer :: k, low, i, j, b, row, rows, place

    k = size(coarse, 1)
    low = size(coarse, 2)
    associate (active => balance%active)
      rows = sum(active%rows(from:to))
      allocate (stacked(k, k, low, rows), source=0.0_wp)
      place = 0
      do i = from, to
        associate (n => active%rows(i), of_it => shapes(:, active%first(i):active%first(i) + active%rows(i) - 1), &
                   block => self%blocks(i))
          ! E as [(row, b), row'], b a coefficient, to [(row, b), mode], and from there to [(a, b), mode, row]
          carried = matmul(real(reshape(block%values, [size(block%rows)*k, n]), wp), transpose(of_it))
          do j = 1, low
            do b = 1, k
              do row = 1, size(block%rows)
                associate (a => modulo(block%rows(row) - 1, k) + 1, at => (block%rows(row) - 1)/k + 1)
                  stacked(a, b, j, place + at) = carried(row + (b - 1)*size(block%rows), j)
                end associate
              end do
            end do
          end do
          place = place + n
        end associate
      end do
      associate (first => active%first(from))
        sums = matmul(reshape(stacked, [k*k*low, rows]), transpose(shapes(:, first:first + rows - 1)))
      end associate
      do j = 1, low
        do b = 1, k
          do i = 1, low
            coarse(:, i, b, j) = coarse(:, i, b, j) + sums(1 + k*(b - 1) + k*k*(j - 1):k*b + k*k*(j - 1), i)
          end do
        end do
      end do
    end associate
  end subroutine add_bunch
end module attrito_balance_two_level_factors
