!> The condensed linear system of a Newton step as a product, never formed:
!>
!>   [ I + D R_AA   D b       ] [ y            ]   [ D rho         ]
!>   [ -p^T R_A     q - p^T b ] [ delta omega  ] = [ sigma - p^T rho ]
!>
!> y = D delta d on the rows A of the contacts that slip or open, unknown where D is not zero. R_AA is applied through the generalised
!> coordinates: what crosses ranks is one block of their harmonics. Where it saves time its high modes are summed beforehand, to a
!> tolerance: the solution is then that of an inexact Newton step, whose residual remains exact.
module attrito_newton_condensed_operator
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: times_vector
  use attrito_newton_active_jacobian, only: change_with_omega, contact_jacobian_type, jacobian_of, places_of_rows
  use attrito_newton_border, only: border_type
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: condensed_operator_type, new_condensed_operator

  type :: condensed_operator_type
    type(balance_type), pointer :: balance => null()
    !> D by active contact
    type(contact_jacobian_type), allocatable :: blocks(:)
    !> Places of its rows that are not zero among those of a field on the active rows: the unknowns
    integer, allocatable :: unknowns(:)
    !> Column of omega, D b, and row of the constraint, R^T p [2 H + 1, active rows]
    real(wp), allocatable :: column(:, :), row(:, :)
    !> q - p^T b
    real(wp) :: corner = 1.0_wp
    !> That row, corner and the right-hand side of the constraint are multiplied by
    real(wp) :: weight = 1.0_wp
    !> Is the row anything but zero?
    logical :: has_row = .false.
  contains
    procedure :: apply
    procedure :: multiply_jacobian
    procedure :: product_with_row
    procedure, private :: receive
  end type condensed_operator_type

contains

  !> Of the balance's last evaluation, which the operator points to.
  function new_condensed_operator(balance, border, stiffening, tolerance) result(self)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), target, intent(inout) :: balance
    !> Row and column of the constraint
    type(border_type), intent(in) :: border
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> What products may leave out of a mode, relative to it
    real(wp), intent(in) :: tolerance
    type(condensed_operator_type) :: self

    self%balance => balance
    call balance%split%prepare(balance%receptance, balance%ranks, places_of_rows(balance), tolerance)
    call gather_jacobian(self, stiffening)
    self%column = self%multiply_jacobian(change_with_omega(balance))
    self%has_row = border%has_motion
    if (self%has_row) then
      self%row = border%row_at(balance%active%contact_rows)
    else
      self%row = 0.0_wp*self%column
    end if
    self%corner = border%corner
    call weigh_constraint(self)
  end function new_condensed_operator

  !> Give the constraint the weight of one of the forces' equations, whatever their unit: GMRES stops by the residual of all together.
  subroutine weigh_constraint(self)
    type(condensed_operator_type), intent(inout) :: self
    real(wp) :: squares(2), size_of_row

    squares = [sum(self%row**2), sum(self%column**2)]
    call self%balance%ranks%sum(squares)
    size_of_row = abs(self%corner)
    ! By what omega changes in forces, where it changes any.
    if (squares(2) > 0.0_wp) size_of_row = sqrt(squares(1) + self%corner**2/squares(2))
    if (size_of_row > 0.0_wp) self%weight = 1.0_wp/size_of_row
    self%row = self%weight*self%row
    self%corner = self%weight*self%corner
  end subroutine weigh_constraint

  !> D where it is not zero.
  subroutine gather_jacobian(self, stiffening)
    type(condensed_operator_type), intent(inout) :: self
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    integer :: i, k

    k = self%balance%coefficients()
    associate (active => self%balance%active)
      allocate (self%blocks(size(active%contacts)))
      do i = 1, size(active%contacts)
        self%blocks(i) = jacobian_of(self%balance, i, stiffening, is_short=.true.)
      end do
      self%unknowns = [(k*(active%first(i) - 1) + self%blocks(i)%rows, i=1, size(active%contacts))]
    end associate
  end subroutine gather_jacobian

  !> The system times (y, delta omega); delta omega is the same on every rank.
  subroutine apply(self, y, omega, product, last)
    class(condensed_operator_type), intent(in) :: self
    !> Vector that takes the product
    real(wp), intent(in), contiguous :: y(:, :)
    !> Change of the angular frequency
    real(wp), intent(in) :: omega
    !> Takes the product; scalar that belongs to the constraint
    real(wp), intent(out) :: product(:, :), last

    product = y + self%multiply_jacobian(self%receive(y)) + self%column*omega
    last = self%corner*omega - self%product_with_row(y)
  end subroutine apply

  !> R_AA y: what the rows receive from forces y on them, of all ranks; by the split receptance where that is in use.
  function receive(self, y) result(motion)
    class(condensed_operator_type), intent(in) :: self
    !> Vector that takes the product
    real(wp), intent(in), contiguous :: y(:, :)
    real(wp) :: motion(size(y, 1), size(y, 2))
    complex(wp), allocatable :: response(:, :)

    associate (balance => self%balance)
      if (balance%split%in_use) then
        motion = balance%split%receive(balance%ranks, y)
        if (allocated(balance%frozen_mean)) motion(1, :) = 0.0_wp
        return
      end if
      allocate (response, mold=balance%response)
      call balance%respond_to_active(y, response)
      motion = -balance%active%contact_rows%motion_of(response)
    end associate
  end function receive

  !> D d, contact by contact, D being what the balance held when this was made.
  function multiply_jacobian(self, motion) result(product)
    class(condensed_operator_type), intent(in) :: self
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in), contiguous, target :: motion(:, :)
    real(wp), target :: product(size(motion, 1), size(motion, 2))
    real(wp), pointer :: flat_motion(:), flat_product(:)
    real(wp) :: own(3*size(motion, 1))
    integer :: i, start

    product = 0.0_wp
    flat_motion(1:size(motion)) => motion
    flat_product(1:size(product)) => product
    do i = 1, size(self%blocks)
      start = size(motion, 1)*(self%balance%active%first(i) - 1)
      associate (block => self%blocks(i))
        associate (n => size(block%rows))
          if (allocated(block%diagonal)) then
            flat_product(start + block%rows) = block%diagonal*flat_motion(start + block%rows)
          else
            call times_vector(block%values, flat_motion(start + 1:start + size(block%values, 2)), own(:n))
            flat_product(start + block%rows) = own(:n)
          end if
        end associate
      end associate
    end do
  end function multiply_jacobian

  !> p^T R_A y, over all ranks.
  real(wp) function product_with_row(self, y)
    class(condensed_operator_type), intent(in) :: self
    !> Vector that takes the product
    real(wp), intent(in) :: y(:, :)

    product_with_row = 0.0_wp
    if (.not. self%has_row) return
    product_with_row = sum(self%row*y)
    call self%balance%ranks%sum(product_with_row)
  end function product_with_row
end module attrito_newton_condensed_operator
