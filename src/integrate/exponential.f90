!> Modes over a step, p'' + D p' + Lambda p = F. Those that the step resolves exactly, under forces that are linear over it, from the
!> exponential of the state (p, p', F, F'), by the series of a short time squared up; the others by Newmark's method,
!>
!> $$ p_1 = p_0 + h p'_0 + h^2 ((\tfrac12 - \beta) p''_0 + \beta p''_1), \quad p'_1 = p'_0 + h ((1 - \gamma) p''_0 + \gamma p''_1), $$
!>
!> which dissipates them and lets a contact that slips move freely. A force that takes a mode's spring back, as slip does, is not
!> linear where the mode is fast: with it the exponential gives the mode tan(x)/x of its acceleration, x = sqrt(Lambda) h / 2.
!> Source: Newmark 1959.
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
    !> Angle of a mode up to which a step resolves it
    real(wp), parameter :: resolved = 1.0_wp ! guess
    integer :: r

    do r = 1, size(eigenvalues)
      if (eigenvalues(r)*h**2 <= resolved**2) then
        weights(:, :, r) = exact_weights(eigenvalues(r), damping(r), h)
      else
        weights(:, :, r) = newmark_weights(eigenvalues(r), damping(r), h)
      end if
    end do
  end function exponential_weights

  pure function newmark_weights(eigenvalue, damping, h) result(weights)
    !> Lambda and D; length of the step
    real(wp), intent(in) :: eigenvalue, damping, h
    real(wp) :: weights(4, 2)
    !> gamma - 1/2: every step leaves (1 - alpha)/(1 + alpha) of the fastest modes, and adds alpha omega h/2 to the damping ratio of
    !> a slow motion that is made of these, as that of a structure whose stiff contacts are open
    real(wp), parameter :: alpha = 0.01_wp, gamma = 0.5_wp + alpha, beta = 0.25_wp*(1.0_wp + alpha)**2 ! conventional
    real(wp) :: start(4), motion(4), rate(4), last(4)

    ! Of the state and the acceleration at the beginning; that at the end is eliminated without differences of large numbers.
    start = [-eigenvalue, -damping, 1.0_wp, 0.0_wp]
    last = [0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp]
    motion = [1.0_wp, h, 0.0_wp, 0.0_wp] + h**2*(0.5_wp - beta)*start
    rate = [0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp] + h*(1.0_wp - gamma)*start
    weights(:, 1) = motion*(1.0_wp + h*gamma*damping) + h**2*beta*(last - damping*rate)
    weights(:, 2) = rate*(1.0_wp + h**2*beta*eigenvalue) + h*gamma*(last - eigenvalue*motion)
    weights = weights/(1.0_wp + h**2*beta*eigenvalue + h*gamma*damping)
  end function newmark_weights

  pure function exact_weights(eigenvalue, damping, h) result(weights)
    !> Lambda and D; length of the step
    real(wp), intent(in) :: eigenvalue, damping, h
    real(wp) :: weights(4, 2)
    !> Halvings of the step, undone by squaring: 16 terms are exact to rounding for the modes that a step resolves, and for damping
    integer, parameter :: squarings = 10 ! derived
    real(wp) :: a(4, 4), power(4, 4), sum(4, 4)
    integer :: k

    a = 0.0_wp
    a(1, 2) = 1.0_wp
    a(2, 1:3) = [-eigenvalue, -damping, 1.0_wp]
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
    weights(1:2, :) = transpose(sum(1:2, 1:2))
    weights(4, :) = sum(1:2, 4)/h
    weights(3, :) = sum(1:2, 3) - sum(1:2, 4)/h
  end function exact_weights
end module attrito_integrate_exponential
