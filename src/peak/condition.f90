!> The condition that a point is a resonance peak, linearised exactly.
!>
!> On the balance r(d, omega, p) = 0 let t be the tangent of the frequency response at fixed parameter p, normalised by a border:
!>
!> $$ r_d t + r_\omega \tau = 0, \quad c \cdot t + c_\omega \tau = 1, \qquad \psi = A'[c_t] = 0 $$
!>
!> says that the amplitude A is stationary along the response, at its folds too. psi needs first derivatives alone, so what it
!> vanishes at is a peak whatever the second derivatives are; those make Newton's method on (r, psi) quadratic. Along a direction
!> X = (x, xi, pi) of the unknowns (d, omega, p), with q the response and q_tX its second derivative at fixed t,
!>
!> $$ \psi'[X] = A''[c_t, c_X] + A'\left[ C (q_{tX} + q_z) \right], \qquad r_d z + r_\omega z_\omega = B q_{tX}, \; c \cdot z = 0. $$
module attrito_peak_condition
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: change_of_deviation, solve_linearised, stiffened
  use attrito_newton_newton_context, only: least_stiffening
  use attrito_balance_periodic_sliders, only: slider_defects
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_solve_solver, only: solver_type
  use attrito_peak_amplitude, only: amplitude_type, amplitude_of
  use attrito_peak_second_derivative, only: differentiate_twice
  implicit none
  private
  public :: problem_type, direction_type, linearisation_type, linearise, slope_along, value_of, set_value, scale_of_motion
  public :: solve, respond
  public :: parameter_level, parameter_preload

  !> What a peak is followed in: the factor on all harmonic loads, or that on all static ones
  integer, parameter :: parameter_level = 0, parameter_preload = 1

  !> Whose peak it is, and in what it is followed
  type :: problem_type
    !> Of the model's monitors, from 1; one of attrito_peak_amplitude's measures
    integer :: monitor = 1, measure = 0
    integer :: parameter = parameter_level
    !> Factors on the static loads at parameter 1 [loads]
    real(wp), allocatable :: static_factors(:)
    !> The border c that normalises the tangent
    type(constraint_type) :: border
  end type problem_type

  !> A change of the unknowns, what it makes of the forces' deviation D x, and of the response [n, 0:H]
  type :: direction_type
    type(unknowns_type) :: step
    real(wp) :: parameter = 0.0_wp
    complex(wp), allocatable :: deviation(:, :), response(:, :)
  end type direction_type

  !> The condition and its derivatives at a point
  type :: linearisation_type
    type(amplitude_type) :: amplitude
    !> Newton's step to the balance; the tangent; the way of the parameter
    type(direction_type) :: newton, along, by_parameter
    !> psi, and psi' along these three
    real(wp) :: slope = 0.0_wp, slope_newton = 0.0_wp, slope_along = 0.0_wp, slope_parameter = 0.0_wp
    !> A' along the way of the parameter: along the peaks too, where psi vanishes
    real(wp) :: by_parameter_amplitude = 0.0_wp
    !> Norm of the scaled residual
    real(wp) :: residual = 0.0_wp
  end type linearisation_type

contains

  !> The parameter's present value.
  real(wp) function value_of(problem, solver) result(value)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    integer :: largest

    associate (balance => solver%context%balance)
      if (problem%parameter == parameter_level) then
        value = balance%level
      else
        largest = maxloc(abs(problem%static_factors), 1)
        value = balance%static_factors(largest)/problem%static_factors(largest)
      end if
    end associate
  end function value_of

  subroutine set_value(problem, solver, value)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Value of the parameter
    real(wp), intent(in) :: value

    if (problem%parameter == parameter_level) then
      ! Residuals are relative to the stuck response, which is linear in the level.
      solver%context%motion_scale = solver%context%motion_scale*value/solver%context%balance%level
      call solver%set_loads(solver%context%balance%static_factors, value)
    else
      call solver%set_loads(value*problem%static_factors, solver%context%balance%level)
    end if
  end subroutine set_value

  !> Norm of the harmonics of the motion, over all ranks.
  real(wp) function scale_of_motion(solver) result(scale)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    scale = solver%context%balance%norm(solver%motion(2:, :))
  end function scale_of_motion

  !> Evaluate at the solver's motion, frequency and parameter.
  subroutine linearise(problem, solver, self, status)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(linearisation_type), intent(out) :: self
    !> 0, or not: it cannot be evaluated, or the bordered system is singular
    integer, intent(out) :: status
    real(wp) :: second(3)

    associate (balance => solver%context%balance)
      call balance%evaluate(solver%motion, solver%omega, status)
      call solver%context%forget()
      if (status /= 0) return
      self%residual = hypot(balance%norm(balance%residual), balance%norm(slider_defects(balance)))/solver%context%motion_scale
      self%amplitude = amplitude_of(balance%monitors%row_of(problem%monitor, balance%response), problem%measure)
      call find_directions(problem, solver, self, status)
      if (status /= 0) return
      self%slope = first(self%along)
      self%by_parameter_amplitude = first(self%by_parameter)
      call differentiate_slope(problem, solver, self, second, status)
      self%slope_newton = second(1)
      self%slope_along = second(2)
      self%slope_parameter = second(3)
    end associate

  contains

    real(wp) function first(direction)
      !> Change of the unknowns and of the response
      type(direction_type), intent(in) :: direction

      first = dot_product(self%amplitude%gradient, &
                          solver%context%balance%monitors%row_of(problem%monitor, direction%response))
    end function first
  end subroutine linearise

  !> A and A'[c_X] along a change X of motion and frequency, at the balance's last evaluation.
  subroutine slope_along(problem, solver, direction, amplitude, slope)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Its responses are found here
    type(direction_type), intent(inout) :: direction
    !> Amplitude of the monitor; its derivative along the change
    real(wp), intent(out) :: amplitude, slope
    type(amplitude_type) :: measured

    associate (balance => solver%context%balance)
      call respond(balance, direction)
      measured = amplitude_of(balance%monitors%row_of(problem%monitor, balance%response), problem%measure)
      amplitude = measured%value
      slope = dot_product(measured%gradient, balance%monitors%row_of(problem%monitor, direction%response))
    end associate
  end subroutine slope_along

  !> Newton's step, the tangent, and the way of the parameter.
  subroutine find_directions(problem, solver, self, status)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(linearisation_type), intent(inout) :: self
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(unknowns_type) :: right
    complex(wp), allocatable :: loaded(:, :)

    associate (balance => solver%context%balance)
      right = new_unknowns(shape(solver%motion), shape(balance%slider))
      loaded = response_to_parameter(problem, balance)
      right%motion = -balance%residual
      right%slider = slider_defects(balance)
      call solve(problem, solver, right, self%newton%step, status)
      if (status /= 0) return
      call respond(balance, self%newton, right)
      right%motion = 0.0_wp
      right%slider = 0.0_wp
      right%omega = 1.0_wp
      call solve(problem, solver, right, self%along%step, status)
      if (status /= 0) return
      right%motion = balance%recover(loaded)
      right%omega = 0.0_wp
      call solve(problem, solver, right, self%by_parameter%step, status)
      if (status /= 0) return
      self%by_parameter%parameter = 1.0_wp
      call respond(balance, self%along)
      call respond(balance, self%by_parameter)
      self%by_parameter%response = self%by_parameter%response + loaded
    end associate
  end subroutine find_directions

  !> Response of the stuck system to a unit of the parameter [n, 0:H].
  function response_to_parameter(problem, balance) result(response)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    complex(wp), allocatable :: response(:, :)
    complex(wp), allocatable :: load(:, :)

    load = balance%harmonic_load
    if (problem%parameter == parameter_preload) then
      load = 0.0_wp
      load(:, lbound(load, 2)) = matmul(balance%static_loads, problem%static_factors)
    end if
    allocate (response, mold=balance%response)
    call balance%receptance%respond(load, response)
    if (allocated(balance%frozen_mean)) response(:, 0) = 0.0_wp
  end function response_to_parameter

  !> Solve the bordered system; a body that only friction holds keeps a little of its springs where it else were singular.
  subroutine solve(problem, solver, right, step, status)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: right
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: step
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    integer :: iterations

    associate (context => solver%context)
      step = right
      call solve_linearised(context%balance, problem%border, right, context%linear, step, iterations, status, &
                            context%preconditioner)
      if (status == 0) return
      call solve_linearised(context%balance, problem%border, right, stiffened(context%linear, least_stiffening), step, iterations, &
                            status)
    end associate
  end subroutine solve

  !> What a step makes of deviation and response, the loads as they are.
  subroutine respond(balance, direction, right)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Change of the unknowns and of the response
    type(direction_type), intent(inout) :: direction
    !> Right-hand sides that the step was solved for; none of sliders if not given
    type(unknowns_type), intent(in), optional :: right
    type(unknowns_type) :: own
    complex(wp), allocatable :: shifted(:, :)

    own = new_unknowns(shape(direction%step%motion), shape(balance%slider))
    if (present(right)) own = right
    allocate (direction%deviation, direction%response, shifted, mold=balance%response)
    call balance%respond_to_deviation(change_of_deviation(balance, own, direction%step), direction%deviation)
    call balance%receptance%respond_derivative(balance%response, shifted)
    if (allocated(balance%frozen_mean)) shifted(:, 0) = 0.0_wp
    direction%response = direction%deviation + direction%step%omega*shifted
  end subroutine respond

  !> psi' along Newton's step, the tangent and the way of the parameter.
  subroutine differentiate_slope(problem, solver, self, second, status)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(linearisation_type), intent(in) :: self
    !> Second derivatives along the three directions
    real(wp), intent(out) :: second(3)
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(direction_type) :: directions(3), follow
    complex(wp), allocatable :: bent(:, :), curved(:, :, :)
    type(unknowns_type) :: right
    integer :: i

    directions = [self%newton, self%along, self%by_parameter]
    status = 0
    second = 0.0_wp
    associate (balance => solver%context%balance)
      call bend_forces(balance, solver%motion, self%along%step, directions, curved)
      right = new_unknowns(shape(solver%motion), shape(balance%slider))
      do i = 1, size(directions)
        bent = curved(:, :, i) + second_response(balance, self%along, directions(i))
        right%motion = balance%recover(bent)
        follow = direction_type()
        call solve(problem, solver, right, follow%step, status)
        if (status /= 0) return
        call respond(balance, follow)
        second(i) = dot_product(balance%monitors%row_of(problem%monitor, self%along%response), &
                                matmul(self%amplitude%curvature, balance%monitors%row_of(problem%monitor, directions(i)%response))) &
                    + dot_product(self%amplitude%gradient, balance%monitors%row_of(problem%monitor, bent + follow%response))
      end do
    end associate
  end subroutine differentiate_slope

  !> Responses to D'[t] x [n, 0:H, ways].
  subroutine bend_forces(balance, motion, along, directions, curved)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: along
    !> Change of the unknowns and of the response
    type(direction_type), intent(in) :: directions(:)
    !> Responses to the second derivative of the forces
    complex(wp), allocatable, intent(out) :: curved(:, :, :)
    real(wp) :: deviation(size(along%motion, 1), size(along%motion, 2), size(directions))
    integer :: i

    call differentiate_twice(balance, motion, along, [(directions(i)%step, i=1, size(directions))], deviation)
    allocate (curved(size(balance%response, 1), 0:balance%receptance%harmonics, size(directions)))
    do i = 1, size(directions)
      call balance%respond_to_deviation(deviation(:, :, i), curved(:, :, i))
    end do
  end subroutine bend_forces

  !> Second derivative of the response along t and a way, forces' own second derivative left out [n, 0:H].
  function second_response(balance, along, other) result(response)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Change of the unknowns and of the response
    type(direction_type), intent(in) :: along, other
    complex(wp), allocatable :: response(:, :)
    complex(wp), allocatable :: shifted(:, :), twice(:, :), inertia(:, :)

    allocate (response, shifted, twice, inertia, mold=balance%response)
    associate (receptance => balance%receptance, tau => along%step%omega, xi => other%step%omega)
      ! Loads that grow with the parameter, too, turn with omega.
      call receptance%respond_derivative(xi*along%deviation + tau*(other%response - xi*derivative_of(balance)), shifted)
      call receptance%respond_derivative(derivative_of(balance), twice)
      call receptance%respond_inertia(balance%response, inertia)
      response = shifted + tau*xi*(2.0_wp*twice + inertia)
    end associate
    if (allocated(balance%frozen_mean)) response(:, 0) = 0.0_wp
  end function second_response

  !> dq/domega with forces as they are.
  function derivative_of(balance) result(derivative)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    complex(wp), allocatable :: derivative(:, :)

    allocate (derivative, mold=balance%response)
    call balance%receptance%respond_derivative(balance%response, derivative)
  end function derivative_of
end module attrito_peak_condition
