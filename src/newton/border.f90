!> The scalar equation that picks a point on the branch, and what condensation makes of it.
!>
!> $$ p^T \delta d + q \, \delta\omega = \sigma, \qquad \delta d = \rho - R y - b \, \delta\omega \quad\Rightarrow\quad
!>    -(R^T p)^T y + (q - p^T b) \, \delta\omega = \sigma - p^T \rho $$
module attrito_newton_border
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_projected_rows, only: projected_rows_type
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
    !> Is there any p? Not where a frequency is held
    logical :: has_motion = .false.
    !> p in generalised coordinates, of all ranks [2 H + 1, n]; the response from which rows of R^T p are recovered [n, 0:H]
    real(wp), allocatable, private :: load(:, :)
    complex(wp), allocatable, private :: response(:, :)
    !> q - p^T b
    real(wp) :: corner = 1.0_wp
  contains
    procedure :: row_at
    procedure :: product_with
  end type border_type

contains

  !> Of a constraint at the balance's last evaluation.
  function new_border(balance, constraint) result(self)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    type(border_type) :: self
    real(wp) :: largest

    self%corner = constraint%frequency
    largest = 0.0_wp
    if (size(constraint%motion) > 0) largest = maxval(abs(constraint%motion))
    self%has_motion = balance%ranks%largest(largest) > 0.0_wp
    if (.not. self%has_motion) return
    self%load = balance%contact_rows%load_of(constraint%motion)
    call balance%ranks%sum(self%load)
    self%corner = self%corner + self%product_with(balance%response_omega)
    ! R^T of the real coefficients is R^H of the complex ones.
    allocate (self%response, mold=balance%response)
    call balance%receptance%respond_adjoint(to_complex(self%load), self%response)
    if (allocated(balance%frozen_mean)) self%response(:, 0) = 0.0_wp
  end function new_border

  !> R^T p at some rows of B.
  function row_at(self, rows) result(row)
    class(border_type), intent(in) :: self
    !> In generalised coordinates
    type(projected_rows_type), intent(in) :: rows
    real(wp), allocatable :: row(:, :)

    row = rows%motion_of(self%response)
  end function row_at

  !> p^T d of the motion d = B x that belongs to a response x [n, 0:H].
  pure real(wp) function product_with(self, response)
    class(border_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)

    product_with = 0.0_wp
    if (self%has_motion) product_with = sum(self%load*to_real(response))
  end function product_with

  !> Sum over ranks of the products of two fields on contact rows.
  real(wp) function inner_product(balance, a, b)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Field over contact rows
    real(wp), intent(in) :: a(:, :), b(:, :)

    inner_product = sum(a*b)
    call balance%ranks%sum(inner_product)
  end function inner_product
end module attrito_newton_border
