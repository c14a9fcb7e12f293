!> The motion of a contact with two tangents and how it changes along two directions t and x, at instants that may move, too:
!>
!> $$ f(\theta) = \sum_m (\hat f + \epsilon_1 \hat t + \epsilon_2 \hat x)_m \, e_m(\theta), \qquad
!>    \theta = \theta_0 + \theta_t \epsilon_1 + \theta_x \epsilon_2 + \theta_{tx} \epsilon_1 \epsilon_2 $$
!>
!> in hyper-dual numbers (`attrito_core_hyperdual`), f one of u_1, u_2 and r.
module attrito_contact_varied_motion
  use attrito_core_hyperdual, only: hyperdual_type
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: basis_at
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_trigonometric_roots, only: differentiate
  implicit none
  private
  public :: varied_motion_type, new_varied_motion, jet_of, rate_basis

  !> Rows of f and t in the series, and of x in its own, those of u_1, u_2, r and their derivatives one after another
  integer, parameter :: derivatives = 3, of_motion = 0, of_t = 12, of_x = 21, all_rows = 30

  type :: varied_motion_type
    !> Highest harmonic
    integer :: harmonics = 0
    !> Coefficients of f and t, which several x share [21, k], and of x [9, k]
    real(wp), allocatable :: shared(:, :), own(:, :)
  contains
    procedure :: at
  end type varied_motion_type

contains

  !> A motion and two changes of it.
  function new_varied_motion(motion, along, other) result(self)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> t and x, coefficients of u_1, u_2, v [k, 3]
    real(wp), intent(in) :: along(:, :), other(:, :)
    type(varied_motion_type) :: self
    real(wp) :: columns(size(along, 1), all_rows)

    self%harmonics = motion%harmonics
    columns(:, of_motion + 1:of_motion + 3) = transpose(motion%series(1:3, :))
    columns(:, of_t + 1:of_t + 3) = along
    columns(:, of_x + 1:of_x + 3) = other
    columns(:, [of_t + 3, of_x + 3]) = motion%slope*columns(:, [of_t + 3, of_x + 3])
    call fill(of_motion, derivatives)
    call fill(of_t, derivatives - 1)
    call fill(of_x, derivatives - 1)
    self%shared = transpose(columns(:, :of_x))
    self%own = transpose(columns(:, of_x + 1:))

  contains

    !> Derivatives up to an order.
    subroutine fill(first, order)
      !> Rows before those of the function; highest order
      integer, intent(in) :: first, order
      integer :: i

      do i = first + 1, first + 3*order
        call differentiate(columns(:, i), columns(:, i + 3))
      end do
    end subroutine fill
  end function new_varied_motion

  !> u_1, u_2, r and their first derivatives at an instant.
  pure function at(self, theta) result(jet)
    class(varied_motion_type), intent(in) :: self
    !> Angle of the period
    type(hyperdual_type), intent(in) :: theta
    type(hyperdual_type) :: jet(6)

    associate (basis => basis_at(theta%value, self%harmonics))
      jet = jet_of(matmul(self%shared, basis), matmul(self%own, basis), theta)
    end associate
  end function at

  !> The same of the values of all rows there.
  pure function jet_of(shared, own, theta) result(jet)
    !> Of f and t [21], and of x [9]
    real(wp), intent(in) :: shared(:), own(:)
    !> Angle of the period
    type(hyperdual_type), intent(in) :: theta
    type(hyperdual_type) :: jet(6)

    jet%value = shared(of_motion + 1:of_motion + 6)
    jet%t = shared(of_motion + 4:of_motion + 9)*theta%t + shared(of_t + 1:of_t + 6)
    jet%x = shared(of_motion + 4:of_motion + 9)*theta%x + own(:6)
    jet%tx = shared(of_motion + 4:of_motion + 9)*theta%tx + shared(of_motion + 7:of_motion + 12)*(theta%t*theta%x) &
             + shared(of_t + 4:of_t + 9)*theta%x + own(4:9)*theta%t
  end function jet_of

  !> Derivatives of the functions 1, cos, sin, cos 2, ... from their values, as sums with such functions as factors have them.
  pure function rate_basis(basis) result(rates)
    !> Values
    real(wp), intent(in) :: basis(:)
    real(wp) :: rates(size(basis))
    integer :: h

    rates(1) = 0.0_wp
    do h = 1, size(basis)/2
      rates(2*h) = -h*basis(2*h + 1)
      rates(2*h + 1) = h*basis(2*h)
    end do
  end function rate_basis
end module attrito_contact_varied_motion
