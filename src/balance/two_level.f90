!> Preconditioner of the condensed system: what the lowest modes of the stuck system carry from contact to contact, exactly, and of
!> the rest what each contact feels of itself.
!>
!> $$ R \approx R_{local} + U Z^{-1} U^T, \qquad (I + D R)^{-1} \approx A^{-1} - E U (Z + U^T E U)^{-1} U^T A^{-1}, $$
!> $$ A = I + D R_{local}, \qquad E = A^{-1} D, \qquad A^{-1} = I - E R_{local} $$
!>
!> U are the lowest modes at the contacts, Z their dynamic stiffness per harmonic (Woodbury's identity). R_local, E and the factors
!> of the coarse system are those of `two_level_factors`, which may be of an earlier Newton iteration, of a point nearby: contacts
!> that they do not know count as stuck ones, E = 0. GMRES makes up for what has changed since.
!> Source: Woodbury 1950; two-level Schwarz methods as in Toselli & Widlund 2005, doi:10.1007/b137868.
module attrito_balance_two_level
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_factored
  use attrito_balance_condensed_operator, only: condensed_operator_type
  use attrito_balance_two_level_factors, only: two_level_factors_type
  implicit none
  private
  public :: two_level_type, new_two_level

  type :: two_level_type
    type(condensed_operator_type), pointer :: system => null()
    type(two_level_factors_type), pointer :: factors => null()
    !> Place of every active contact among those that the factors know, 0 for none
    integer, allocatable :: place(:)
    !> Modes at the active rows [low, rows]
    real(wp), allocatable :: shapes(:, :)
    !> Preconditioned column of omega [k, rows], and what is left of the corner
    real(wp), allocatable :: column(:, :)
    real(wp) :: corner = 1.0_wp
  contains
    procedure :: apply
    procedure, private :: apply_inverse
  end type two_level_type

contains

  !> For a system, with factors at hand.
  subroutine new_two_level(system, factors, self)
    type(condensed_operator_type), target, intent(in) :: system
    type(two_level_factors_type), target, intent(in) :: factors
    type(two_level_type), intent(out) :: self

    self%system => system
    self%factors => factors
    associate (active => system%balance%active)
      self%place = factors%places_of(active%contacts)
      self%shapes = system%balance%receptance%low_shapes(factors%low, active%directions)
    end associate
    allocate (self%column, mold=system%column)
    call self%apply_inverse(system%column, self%column)
    self%corner = system%corner + system%product_with_row(self%column)
    if (.not. abs(self%corner) > 0.0_wp) self%corner = 1.0_wp
  end subroutine new_two_level

  !> Inverse of the approximate system times (residual, last).
  subroutine apply(self, residual, last, y, omega)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in), contiguous :: residual(:, :)
    real(wp), intent(in) :: last
    real(wp), intent(out), contiguous :: y(:, :)
    real(wp), intent(out) :: omega

    call self%apply_inverse(residual, y)
    omega = (last + self%system%product_with_row(y))/self%corner
    y = y - self%column*omega
  end subroutine apply

  !> The same without the border.
  subroutine apply_inverse(self, residual, y)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in), contiguous :: residual(:, :)
    real(wp), intent(out), contiguous :: y(:, :)
    real(wp), allocatable :: modal(:, :)

    y = residual
    call subtract_blocks(self, residual, .true., y)
    modal = matmul(y, transpose(self%shapes))
    call self%system%balance%ranks%sum(modal)
    modal = reshape(solve_factored(self%factors%coarse, self%factors%pivots, reshape(modal, [size(modal)])), shape(modal))
    ! A frozen mean does not respond.
    if (allocated(self%system%balance%frozen_mean)) modal(1, :) = 0.0_wp
    call subtract_blocks(self, matmul(modal, self%shapes), .false., y)
  end subroutine apply_inverse

  !> y less E times a field, or less E R_local times it.
  subroutine subtract_blocks(self, field, locally, y)
    class(two_level_type), intent(in) :: self
    real(wp), intent(in) :: field(:, :)
    logical, intent(in) :: locally
    real(wp), intent(inout) :: y(:, :)
    real(wp) :: felt(size(field, 1), 3), product(3*size(field, 1))
    integer :: i, j, k, n

    k = size(field, 1)
    associate (active => self%system%balance%active)
      do i = 1, size(active%contacts)
        if (self%place(i) == 0) cycle
        n = active%rows(i)
        associate (first => active%first(i), block => self%factors%blocks(self%place(i)))
          if (locally) then
            call feel_locally(self%factors%local(:n, :n, :, self%place(i)), field(:, first:first + n - 1), felt(:, :n))
          else
            felt(:, :n) = field(:, first:first + n - 1)
          end if
          call block%multiply(reshape(felt(:, :n), [k*n]), product(:size(block%rows)))
          do j = 1, size(block%rows)
            associate (row => (block%rows(j) - 1)/k, coefficient => modulo(block%rows(j) - 1, k) + 1)
              y(coefficient, first + row) = y(coefficient, first + row) - product(j)
            end associate
          end do
        end associate
      end do
    end associate
  end subroutine subtract_blocks

  !> R_local of one contact times a field on its rows.
  pure subroutine feel_locally(local, forces, motion)
    !> [rows, rows, 0:H]
    complex(wp), intent(in) :: local(:, :, 0:)
    real(wp), intent(in) :: forces(:, :)
    real(wp), intent(out) :: motion(:, :)
    integer :: from, to, h

    motion = 0.0_wp
    do from = 1, size(forces, 2)
      do to = 1, size(forces, 2)
        associate (f => forces(:, from))
          motion(1, to) = motion(1, to) + real(local(to, from, 0), wp)*f(1)
          do h = 1, ubound(local, 3)
            associate (re => real(local(to, from, h), wp), im => aimag(local(to, from, h)))
              motion(2*h, to) = motion(2*h, to) + re*f(2*h) + im*f(2*h + 1)
              motion(2*h + 1, to) = motion(2*h + 1, to) - im*f(2*h) + re*f(2*h + 1)
            end associate
          end do
        end associate
      end do
    end do
  end subroutine feel_locally
end module attrito_balance_two_level
