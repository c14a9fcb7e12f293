!> The scalar equation that picks a point on the branch, and what condensation makes of it.
!>
!> $$ p^T \delta d + q \, \delta\omega = \sigma, \qquad \delta d = \rho - R y - b \, \delta\omega \quad\Rightarrow\quad
!>    -(R^T p)^T y + (q - p^T b) \, \delta\omega = \sigma - p^T \rho $$
module attrito_balance_border
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: constraint_type, border_type, new_border, inner_product

  !> p . d + q omega = value
  type :: constraint_type
    !> p of this rank's rows [2 H + 1, rows]
    real(wp), allocatable :: motion(:, :)
    real(wp) :: frequency = 1.0_wp, value = 0.0_wp
  end type constraint_type

  type :: border_type
    !> R^T p of this rank's rows [2 H + 1, rows], and q - p^T b
    real(wp), allocatable :: row(:, :)
    real(wp) :: corner = 1.0_wp
  end type border_type

contains

  !> Of a constraint at the balance's last evaluation.
  function new_border(balance, constraint) result(self)
    type(balance_type), intent(in) :: balance
    type(constraint_type), intent(in) :: constraint
    type(border_type) :: self
    complex(wp), allocatable :: response(:, :)

    self%corner = constraint%frequency - inner_product(balance, constraint%motion, balance%residual_omega)
    ! R^T p = mirror R mirror p, where mirror changes the sign of sines: receptances are complex symmetric.
    allocate (response, mold=balance%response)
    call balance%respond_to_deviation(mirror(constraint%motion), response)
    self%row = -mirror(balance%recover(response))
  end function new_border

  !> Sum over ranks of the products of two fields on contact rows.
  real(wp) function inner_product(balance, a, b)
    type(balance_type), intent(in) :: balance
    real(wp), intent(in) :: a(:, :), b(:, :)

    inner_product = sum(a*b)
    call balance%ranks%sum(inner_product)
  end function inner_product

  !> Change the sign of sines.
  pure function mirror(field) result(mirrored)
    real(wp), intent(in) :: field(:, :)
    real(wp) :: mirrored(size(field, 1), size(field, 2))

    mirrored = field
    mirrored(3::2, :) = -field(3::2, :)
  end function mirror
end module attrito_balance_border
