!> Derivative of a point's monitors by a parameter, at the point's frequency and at given sliders of the contacts that never slip:
!>
!> $$ (I + R D) \, \delta d = B \tilde Z^{-1} (f' - B^T \lambda'), \qquad
!>    \delta q = \tilde Z^{-1} (f' - B^T (\lambda' + D \, \delta d)) $$
!>
!> lambda' and f' are what the parameter changes of contact forces and loads at the point's own motion
!> (`attrito_sensitivity_law_direction`); one linearised step, the last one of Newton's method, gives the rest: the implicit function
!> theorem. The step is the direct one, so the cost is one solve a parameter and none a monitor.
module attrito_sensitivity_parameter_derivative
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: extrema
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_newton_border, only: constraint_type
  use attrito_newton_linearised_step, only: solve_linearised, change_of_deviation
  use attrito_sensitivity_law_direction, only: direction_type, force_change
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: parameter_type, differentiate_by_parameter

  !> Part of a monitor's motion that its change is scaled to, for the difference of its located extrema: see `amplitude_change`
  real(wp), parameter :: step = 1.0e-5_wp ! derived

  !> What a parameter changes: rates of all contacts' laws, of the factors on static loads and of the level
  type :: parameter_type
    type(direction_type), allocatable :: laws(:)
    real(wp), allocatable :: static_factors(:)
    real(wp) :: level = 0.0_wp
  end type parameter_type

contains

  !> At the solver's present point, which was evaluated last.
  subroutine differentiate_by_parameter(solver, parameter, monitors, amplitude, status)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(inout) :: solver
    !> What it changes
    type(parameter_type), intent(in) :: parameter
    !> Change of the coefficients of the monitors [2 H + 1, monitors], and of half their ranges [monitors]
    real(wp), allocatable, intent(out) :: monitors(:, :), amplitude(:)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(unknowns_type) :: right, moved
    type(constraint_type) :: constraint
    complex(wp), allocatable :: response(:, :), by_loads(:, :)
    real(wp), allocatable :: deviation(:, :), own(:, :)
    integer :: i, iterations

    associate (balance => solver%context%balance)
      allocate (deviation, constraint%motion, mold=balance%residual)
      constraint%motion = 0.0_wp
      right = unknowns_type(0.0_wp*balance%residual, 0.0_wp*balance%slider, 0.0_wp)
      own = balance%recover(balance%response)
      do i = 1, size(balance%law)
        associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
          call force_change(parameter%laws(balance%first_contact - 1 + i), balance%law(i), balance%quadrature, &
                            own(:, first:last), balance%slider(:, i), balance%forces(i), deviation(:, first:last), &
                            right%slider(:, i))
        end associate
      end do
      allocate (response, by_loads, mold=balance%response)
      call respond_to_loads(solver, parameter, by_loads)
      call balance%respond_to_deviation(deviation, response)
      right%motion = balance%recover(response + by_loads)
      moved = right
      call solve_linearised(balance, constraint, right, solver%context%linear, moved, iterations, status)
      if (status /= 0) return
      call balance%respond_to_deviation(deviation + change_of_deviation(balance, right, moved), response)
      monitors = balance%monitors%motion_of(response + by_loads)
      own = balance%monitors%motion_of(balance%response)
    end associate
    amplitude = [(amplitude_change(own(:, i), monitors(:, i)), i=1, size(own, 2))]
  end subroutine differentiate_by_parameter

  !> Response of the stuck system to the change of the loads [n, 0:H].
  subroutine respond_to_loads(solver, parameter, response)
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver
    !> What a parameter changes
    type(parameter_type), intent(in) :: parameter
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    response = 0.0_wp
    associate (balance => solver%context%balance)
      associate (highest => balance%highest_load())
        call balance%receptance%respond(loads(highest), response(:, :highest))
      end associate
    end associate

  contains

    function loads(highest)
      !> Highest harmonic that is loaded
      integer, intent(in) :: highest
      complex(wp) :: loads(size(response, 1), 0:highest)

      associate (balance => solver%context%balance)
        loads = parameter%level*balance%harmonic_load(:, :highest)
        loads(:, 0) = loads(:, 0) + matmul(balance%static_loads, parameter%static_factors)
      end associate
    end function loads
  end subroutine respond_to_loads

  !> Change of half the range of a series, along a change of it: the central difference between two series so near that their extrema
  !> are those of this one, moved. Where two extrema are equal it is the mean of both one-sided derivatives.
  pure real(wp) function amplitude_change(series, change)
    !> Coefficients, and their change [k]
    real(wp), intent(in) :: series(:), change(:)
    real(wp) :: far, before(2), after(2)

    amplitude_change = 0.0_wp
    if (maxval(abs(change)) <= 0.0_wp .or. maxval(abs(series)) <= 0.0_wp) return
    far = step*maxval(abs(series))/maxval(abs(change))
    before = extrema(series - far*change)
    after = extrema(series + far*change)
    amplitude_change = 0.25_wp*((after(2) - after(1)) - (before(2) - before(1)))/far
  end function amplitude_change
end module attrito_sensitivity_parameter_derivative
