!> The scalar equation that picks a point on the branch, and what condensation makes of it.
!>
!> $$ p^T \delta d + q \, \delta\omega = \sigma, \qquad \delta d = \rho - R y - b \, \delta\omega \quad\Rightarrow\quad
!>    -(R^T p)^T y + (q - p^T b) \, \delta\omega = \sigma - p^T \rho $$
module attrito_newton_border
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_receptance, only: to_complex, to_real
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
    real(wp), allocatable :: mirrored(:, :)
    real(wp) :: largest

    self%corner = constraint%frequency
    largest = 0.0_wp
    if (size(constraint%motion) > 0) largest = maxval(abs(constraint%motion))
    self%has_motion = balance%ranks%largest(largest) > 0.0_wp
    if (.not. self%has_motion) return
    self%load = matmul(constraint%motion, transpose(balance%directions))
    call balance%ranks%sum(self%load)
    self%corner = self%corner + self%product_with(balance%response_omega)
    ! R^T p = mirror R mirror p, where mirror changes the sign of sines: receptances are complex symmetric.
    mirrored = mirror(self%load)
    allocate (self%response, mold=balance%response)
    call balance%receptance%respond(to_complex(mirrored), self%response)
    if (allocated(balance%frozen_mean)) self%response(:, 0) = 0.0_wp
  end function new_border

  !> R^T p at some rows of B, given as columns [n, rows].
  function row_at(self, directions) result(row)
    class(border_type), intent(in) :: self
    !> Directions of contact rows in the coordinates
    real(wp), intent(in) :: directions(:, :)
    real(wp), allocatable :: row(:, :)

    row = mirror(matmul(to_real(self%response), directions))
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

  !> Change the sign of sines.
  pure function mirror(field) result(mirrored)
    !> Vector over the rows of contacts
    real(wp), intent(in) :: field(:, :)
    real(wp) :: mirrored(size(field, 1), size(field, 2))

    mirrored = field
    mirrored(3::2, :) = -field(3::2, :)
  end function mirror
end module attrito_newton_border
