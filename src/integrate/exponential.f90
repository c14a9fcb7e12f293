!> Modes exactly over a step, under forces that are linear over it: p'' + D p' + Lambda p = F, from the exponential of the state
!> (p, p', F, F'), by the series of a short time squared up.
module attrito_integrate_exponential
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: exponential_weights

contains

  !> What motion and rate at the end take from (motion, rate, force at the beginning, force at the end) of each mode [4, 2, m].
  pure function exponential_weights(eigenvalues, damping, h) result(weights)
    !> [m] each
    real(wp), intent(in) :: eigenvalues(:), damping(:)
    !> Length of the step
    real(wp), intent(in) :: h
    real(wp) :: weights(4, 2, size(eigenvalues))
    !> Halvings of the step, undone by squaring: 16 terms are exact to rounding up to 1000 over the highest angular frequency
    integer, parameter :: squarings = 10 ! derived
    real(wp) :: a(4, 4), power(4, 4), sum(4, 4)
    integer :: r, k

    do r = 1, size(eigenvalues)
      a = 0.0_wp
      a(1, 2) = 1.0_wp
      a(2, 1:3) = [-eigenvalues(r), -damping(r), 1.0_wp]
      a(3, 4) = 1.0_wp
      a = a*h/2**squarings
      power = 0.0_wp
      do k = 1, 4
        power(k, k) = 1.0_wp
      end do
      sum = power
      do k = 1, 16
        power = matmul(power, a)/k
        sum = sum + power
      end do
      do k = 1, squarings
        sum = matmul(sum, sum)
      end do
      weights(1:2, :, r) = transpose(sum(1:2, 1:2))
      weights(4, :, r) = sum(1:2, 4)/h
      weights(3, :, r) = sum(1:2, 3) - sum(1:2, 4)/h
    end do
  end function exponential_weights
end module attrito_integrate_exponential
