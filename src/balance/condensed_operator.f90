!> The condensed linear system of a Newton step as a product, never formed:
!>
!>   [ I + D R_AA   D b       ] [ y            ]   [ D rho         ]
!>   [ -p^T R_A     q - p^T b ] [ delta omega  ] = [ sigma - p^T rho ]
!>
!> y = D delta d on the rows A of the contacts that slip or open. Where it saves time R_AA is applied with its high modes summed
!> beforehand, to a tolerance: the solution is then that of an inexact Newton step, whose residual remains exact.
module attrito_balance_condensed_operator
  use attrito_core_kinds, only: wp
  use attrito_balance_active_rows, only: active_rows_type, new_active_rows
  use attrito_balance_border, only: border_type
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: condensed_operator_type, new_condensed_operator

  type :: condensed_operator_type
    type(balance_type), pointer :: balance => null()
    type(active_rows_type) :: active
    !> Column of omega, D b, and row of the constraint, R^T p [2 H + 1, active rows]
    real(wp), allocatable :: column(:, :), row(:, :)
    !> q - p^T b
    real(wp) :: corner = 1.0_wp
  contains
    procedure :: apply
    procedure :: product_with_row
  end type condensed_operator_type

contains

  !> Of the balance's last evaluation, which the operator points to.
  function new_condensed_operator(balance, border, tolerance) result(self)
    type(balance_type), target, intent(inout) :: balance
    type(border_type), intent(in) :: border
    !> What products may leave out of a mode, relative to it
    real(wp), intent(in) :: tolerance
    type(condensed_operator_type) :: self

    self%balance => balance
    self%active = new_active_rows(balance)
    call balance%split%prepare(balance%receptance, balance%ranks, self%active%rows_of_all(balance), tolerance)
    self%column = self%active%multiply_jacobian(balance, self%active%gather(balance%residual_omega))
    self%row = self%active%gather(border%row)
    self%corner = border%corner
  end function new_condensed_operator

  !> The system times (y, delta omega); delta omega is the same on every rank.
  subroutine apply(self, y, omega, product, last)
    class(condensed_operator_type), intent(in) :: self
    real(wp), intent(in), contiguous :: y(:, :)
    real(wp), intent(in) :: omega
    real(wp), intent(out) :: product(:, :), last

    product = y + self%active%multiply_jacobian(self%balance, self%active%receive(self%balance, y)) + self%column*omega
    last = self%corner*omega - self%product_with_row(y)
  end subroutine apply

  !> p^T R_A y, over all ranks.
  real(wp) function product_with_row(self, y)
    class(condensed_operator_type), intent(in) :: self
    real(wp), intent(in) :: y(:, :)

    product_with_row = sum(self%row*y)
    call self%balance%ranks%sum(product_with_row)
  end function product_with_row
end module attrito_balance_condensed_operator
