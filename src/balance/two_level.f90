!> Preconditioner of the condensed system, from the present state of the contacts: what the lowest modes of the stuck system carry
!> from contact to contact, exactly, and of the rest what each contact feels of itself.
!>
!> $$ R \approx R_{local} + U Z^{-1} U^T, \qquad (I + D R)^{-1} \approx A^{-1} - E U (Z + U^T E U)^{-1} U^T A^{-1}, $$
!> $$ A = I + D R_{local}, \qquad E = A^{-1} D, \qquad A^{-1} = I - E R_{local} $$
!>
!> U are the lowest modes at the contacts, Z their dynamic stiffness per harmonic (Woodbury's identity). The blocks of A couple the
!> rows and harmonics of one contact; the coarse system couples the harmonics of some ten modes and is solved on every rank.
!> Source: Woodbury 1950; two-level Schwarz methods as in Toselli & Widlund 2005, doi:10.1007/b137868.
module attrito_balance_two_level
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense, factor, solve_factored
  use attrito_balance_condensed_operator, only: condensed_operator_type
  implicit none
  private
  public :: two_level_type, new_two_level

  !> Contacts taken together in the coarse system, to bound its memory
  integer, parameter :: bunch = 32

  type :: two_level_type
    type(condensed_operator_type), pointer :: system => null()
    !> Modes at the active rows [low, rows]
    real(wp), allocatable :: shapes(:, :)
    !> R_local by contact and harmonic [3, 3, 0:H, contacts]
    complex(wp), allocatable :: local(:, :, :, :)
    !> E by contact [3 k, 3 k, contacts]
    real(wp), allocatable :: blocks(:, :, :)
    !> Factors of the coarse system [k low, k low]
    real(wp), allocatable :: coarse(:, :)
    integer, allocatable :: pivots(:)
    !> Preconditioned column of omega [k, rows], and what is left of the corner
    real(wp), allocatable :: column(:, :)
    real(wp) :: corner = 1.0_wp
  contains
    procedure :: apply
    procedure, private :: apply_inverse
  end type two_level_type

contains

  !> For the system at the balance's last evaluation.
  subroutine new_two_level(system, low, self, status)
    type(condensed_operator_type), target, intent(in) :: system
    !> Lowest modes in the coarse system
    integer, intent(in) :: low
    type(two_level_type), intent(out) :: self
    !> 0, or not: singular
    integer, intent(out) :: status

    self%system => system
    self%shapes = system%balance%receptance%low_shapes(min(low, size(system%active%directions, 1)), system%active%directions)
    call new_local(self)
    call new_blocks(self, status)
    call agree(self, status)
    if (status /= 0) return
    call new_coarse(self, status)
    if (status /= 0) return
    allocate (self%column, mold=system%column)
    call self%apply_inverse(system%column, self%column)
    self%corner = system%corner + system%product_with_row(self%column)
    if (.not. abs(self%corner) > 0.0_wp) self%corner = 1.0_wp
  end subroutine new_two_level

  !> A failure of any rank is one of all.
  subroutine agree(self, status)
    type(two_level_type), intent(in) :: self
    integer, intent(inout) :: status
    real(wp) :: worst

    worst = self%system%balance%ranks%largest(real(abs(status), wp))
    status = nint(min(worst, 1.0_wp))
  end subroutine agree

  !> Inverse of the approximate system times (residual, last).
  subroutine apply(self, residual, last, y, omega)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in) :: residual(:, :), last
    real(wp), intent(out) :: y(:, :), omega

    call self%apply_inverse(residual, y)
    omega = (last + self%system%product_with_row(y))/self%corner
    y = y - self%column*omega
  end subroutine apply

  !> The same without the border.
  subroutine apply_inverse(self, residual, y)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in), contiguous :: residual(:, :)
    real(wp), intent(out), contiguous :: y(:, :)
    real(wp) :: modal(size(residual, 1), size(self%shapes, 1)), feels(size(residual, 1), size(residual, 2))
    integer :: k

    k = size(residual, 1)
    call feel_locally(self, residual, feels)
    call multiply_blocks(self, feels, y)
    y = residual - y
    modal = matmul(y, transpose(self%shapes))
    call self%system%balance%ranks%sum(modal)
    modal = reshape(solve_factored(self%coarse, self%pivots, reshape(modal, [size(modal)])), shape(modal))
    call hold_frozen_mean(self, modal)
    feels = matmul(modal, self%shapes)
    call subtract_blocks()

  contains

    subroutine subtract_blocks()
      real(wp) :: carried(k, size(residual, 2))

      call multiply_blocks(self, feels, carried)
      y = y - carried
    end subroutine subtract_blocks
  end subroutine apply_inverse

  !> A frozen mean does not respond.
  pure subroutine hold_frozen_mean(self, modal)
    class(two_level_type), intent(in) :: self
    real(wp), intent(inout) :: modal(:, :)

    if (allocated(self%system%balance%frozen_mean)) modal(1, :) = 0.0_wp
  end subroutine hold_frozen_mean

  !> R_local of every active contact: its own receptance without the lowest modes.
  subroutine new_local(self)
    type(two_level_type), intent(inout) :: self
    integer :: i

    associate (active => self%system%active, balance => self%system%balance)
      allocate (self%local(3, 3, 0:balance%receptance%harmonics, size(active%contacts)), source=(0.0_wp, 0.0_wp))
      do i = 1, size(active%contacts)
        associate (n => active%rows(i), directions => active%directions(:, active%first(i):active%first(i) + active%rows(i) - 1))
          call balance%receptance%remainder(size(self%shapes, 1), directions, self%local(:n, :n, :, i))
        end associate
      end do
      if (allocated(balance%frozen_mean)) self%local(:, :, 0, :) = 0.0_wp
    end associate
  end subroutine new_local

  !> E = (I + D R_local)^-1 D, contact by contact, on the rows where D is not zero.
  subroutine new_blocks(self, status)
    type(two_level_type), intent(inout) :: self
    integer, intent(out) :: status
    real(wp), allocatable :: jacobian(:, :), product(:, :), matrix(:, :), rows(:, :)
    integer, allocatable :: kept(:)
    integer :: i, j, k, m

    status = 0
    associate (active => self%system%active, balance => self%system%balance)
      k = balance%coefficients()
      allocate (self%blocks(3*k, 3*k, size(active%contacts)), source=0.0_wp)
      do i = 1, size(active%contacts)
        m = k*active%rows(i)
        jacobian = (1.0_wp - balance%stiffening)*balance%forces(active%contacts(i))%jacobian
        if (allocated(product)) deallocate (product)
        allocate (product(m, m))
        call times_local(jacobian, self%local(:, :, :, i), active%rows(i), product)
        kept = pack([(j, j=1, m)], balance%forces(active%contacts(i))%active)
        matrix = product(kept, kept)
        rows = jacobian(kept, :)
        do j = 1, size(kept)
          matrix(j, j) = matrix(j, j) + 1.0_wp
        end do
        call solve_dense(matrix, rows, status)
        if (status /= 0) return
        self%blocks(kept, :m, i) = rows
      end do
    end associate
  end subroutine new_blocks

  !> D R_local of one contact: R_local couples rows, and cosine with sine, of one harmonic.
  pure subroutine times_local(jacobian, local, rows, product)
    !> [k rows, k rows]
    real(wp), intent(in) :: jacobian(:, :)
    !> [3, 3, 0:H]
    complex(wp), intent(in) :: local(:, :, 0:)
    integer, intent(in) :: rows
    real(wp), intent(out) :: product(:, :)
    integer :: from, to, h, k, c_from, c_to

    k = size(jacobian, 1)/rows
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

  !> R_local times a field.
  pure subroutine feel_locally(self, forces, motion)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in) :: forces(:, :)
    real(wp), intent(out) :: motion(:, :)
    integer :: i, from, to, h

    motion = 0.0_wp
    do i = 1, size(self%system%active%contacts)
      do from = 1, self%system%active%rows(i)
        do to = 1, self%system%active%rows(i)
          associate (f => forces(:, self%system%active%first(i) + from - 1), first => self%system%active%first(i) + to - 1, &
                     local => self%local(to, from, :, i))
            motion(1, first) = motion(1, first) + real(local(1), wp)*f(1)
            do h = 1, size(local) - 1
              associate (re => real(local(h + 1), wp), im => aimag(local(h + 1)))
                motion(2*h, first) = motion(2*h, first) + re*f(2*h) + im*f(2*h + 1)
                motion(2*h + 1, first) = motion(2*h + 1, first) - im*f(2*h) + re*f(2*h + 1)
              end associate
            end do
          end associate
        end do
      end do
    end do
  end subroutine feel_locally

  !> E times a field.
  subroutine multiply_blocks(self, field, product)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in), contiguous :: field(:, :)
    real(wp), intent(out), contiguous :: product(:, :)
    integer :: i, k, m

    k = size(field, 1)
    do i = 1, size(self%system%active%contacts)
      associate (first => self%system%active%first(i), last => self%system%active%first(i) + self%system%active%rows(i) - 1)
        m = k*self%system%active%rows(i)
        product(:, first:last) = reshape(matmul(self%blocks(:m, :m, i), reshape(field(:, first:last), [m])), &
                                         [k, self%system%active%rows(i)])
      end associate
    end do
  end subroutine multiply_blocks

  !> Z + U^T E U, coefficient running faster than mode, factored.
  subroutine new_coarse(self, status)
    type(two_level_type), intent(inout) :: self
    integer, intent(out) :: status
    real(wp), allocatable :: coarse(:, :, :, :)
    complex(wp), allocatable :: stiffness(:)
    integer :: k, low, h, i, first

    associate (active => self%system%active, balance => self%system%balance)
      k = balance%coefficients()
      low = size(self%shapes, 1)
      allocate (coarse(k, low, k, low), source=0.0_wp)
      do first = 1, size(active%contacts), bunch
        call add_bunch(self, first, min(first + bunch - 1, size(active%contacts)), coarse)
      end do
      call sum_over_ranks(coarse)
      if (allocated(balance%frozen_mean)) then
        coarse(1, :, :, :) = 0.0_wp
        coarse(:, :, 1, :) = 0.0_wp
      end if
      do h = 0, balance%receptance%harmonics
        stiffness = balance%receptance%low_stiffness(h, low)
        do i = 1, low
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
      self%coarse = reshape(coarse, [k*low, k*low])
      allocate (self%pivots(k*low))
      call factor(self%coarse, self%pivots, status)
    end associate

  contains

    subroutine sum_over_ranks(values)
      real(wp), intent(inout), contiguous, target :: values(:, :, :, :)
      real(wp), pointer :: flat(:)

      flat(1:size(values)) => values
      call self%system%balance%ranks%sum(flat)
    end subroutine sum_over_ranks
  end subroutine new_coarse

  !> Add U^T E U of some contacts to the coarse system [k, low, k, low].
  subroutine add_bunch(self, from, to, coarse)
    type(two_level_type), intent(in) :: self
    integer, intent(in) :: from, to
    real(wp), intent(inout) :: coarse(:, :, :, :)
    real(wp), allocatable :: carried(:, :), stacked(:, :, :, :), sums(:, :)
    integer :: k, low, i, j, b, row, rows, place

    k = size(coarse, 1)
    low = size(coarse, 2)
    associate (active => self%system%active)
      rows = sum(active%rows(from:to))
      allocate (stacked(k, k, low, rows))
      place = 0
      do i = from, to
        associate (n => active%rows(i), shapes => self%shapes(:, active%first(i):active%first(i) + active%rows(i) - 1))
          ! E as [(a, row, b), row'], a and b coefficients, to [(a, b), mode, row]
          carried = matmul(reshape(self%blocks(:k*n, :k*n, i), [k*n*k, n]), transpose(shapes))
          do row = 1, n
            do j = 1, low
              do b = 1, k
                stacked(:, b, j, place + row) = carried(1 + k*(row - 1) + k*n*(b - 1):k*row + k*n*(b - 1), j)
              end do
            end do
          end do
          place = place + n
        end associate
      end do
      associate (first => active%first(from))
        sums = matmul(reshape(stacked, [k*k*low, rows]), transpose(self%shapes(:, first:first + rows - 1)))
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
end module attrito_balance_two_level
