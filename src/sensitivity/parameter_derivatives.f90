!> Derivatives of a point's quantities by numbers of contact laws, factors on loads, the level and damping, at the point's frequency
!> and at given sliders of the contacts that never slip, or by these. Directly, that is one linear system a parameter
!> (`attrito_sensitivity_point_rates`). The adjoint takes one for each quantity and gives the derivatives by all parameters there are:
!> with its weights c on monitors, l on contact forces and k on the contacts' motion (`attrito_sensitivity_quantities`),
!>
!> $$ Q' = l \cdot \lambda' + \bar a^T (f' - B^T \lambda'), \qquad \bar a = \tilde Z^{-T} (s - B^T D^T \bar d), \qquad
!>    (I + R^T D^T) \, \bar d = B \tilde Z^{-T} s, \qquad s = C^T c + B^T (k + (K_c + D)^T l) $$
!>
!> Z~_h is symmetric, so in cosines and sines R^T = S R S, S turning the sign of sines: time runs backwards. With S D^T S in D's
!> place the adjoint system is again one of Newton's, and is solved as these are.
module attrito_sensitivity_parameter_derivatives
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_newton_linearised_step, only: change_of_deviation, linear_options_type
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_sensitivity_accurate_step, only: solve_accurately
  use attrito_sensitivity_damping_derivatives, only: damping_numbers, damping_load
  use attrito_sensitivity_parameters, only: by_parameters_type
  use attrito_sensitivity_point_rates, only: inquiry_type, rate_type, begin_at_sliders, derivatives_of_laws, &
                                             rate_of_parameter, rate_of_response
  use attrito_sensitivity_quantities, only: weights_type, weights_of
  use attrito_sensitivity_spring_forces, only: spring_forces
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: differentiate_directly, differentiate_by_adjoint, differentiate_by_frequency, derivative_along


contains

  !> By parameters, at the solver's present point, which was evaluated last.
  subroutine differentiate_directly(solver, inquiry, parameters, derivatives, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> What each changes
    type(by_parameters_type), intent(in) :: parameters(:)
    !> Of the quantities [quantities, parameters]
    real(wp), allocatable, intent(out) :: derivatives(:, :)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(preconditioners_type) :: kept
    type(weights_type) :: weights(size(inquiry%quantities))
    type(rate_type) :: rate
    real(wp), allocatable :: laws(:, :, :)
    integer :: i, j

    call begin_at_sliders(solver, inquiry, status)
    if (status /= 0) return
    associate (balance => solver%context%balance)
      laws = derivatives_of_laws(balance, inquiry)
      weights = [(weights_of(inquiry%quantities(i), balance), i=1, size(weights))]
      allocate (derivatives(size(weights), size(parameters)))
      status = 0
      do j = 1, size(parameters)
        call rate_of_parameter(solver, laws, parameters(j), kept, rate, status)
        if (status /= 0) return
        derivatives(:, j) = [(derivative_along(balance, weights(i), rate), i=1, size(weights))]
      end do
    end associate
  end subroutine differentiate_directly

  !> By the angular frequency, at the solver's present point, which was evaluated last.
  subroutine differentiate_by_frequency(solver, inquiry, derivatives, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> Of the quantities [quantities]
    real(wp), allocatable, intent(out) :: derivatives(:)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(preconditioners_type) :: kept
    type(rate_type) :: rate
    complex(wp), allocatable :: source(:, :)
    integer :: i

    associate (balance => solver%context%balance)
      ! Contacts may have been held since.
      call balance%active%find(balance%law, balance%forces, balance%contact_rows)
      allocate (source, mold=balance%response)
      call balance%receptance%respond_derivative(balance%response, source)
      call rate_of_response(solver, source, kept, rate, status)
      if (status /= 0) return
      derivatives = [(derivative_along(balance, weights_of(inquiry%quantities(i), balance), rate), i=1, size(inquiry%quantities))]
    end associate
  end subroutine differentiate_by_frequency

  !> c . delta a + l . delta lambda + k . delta d.
  real(wp) function derivative_along(balance, weights, rate) result(derivative)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> Of a quantity
    type(weights_type), intent(in) :: weights
    !> How the point changes
    type(rate_type), intent(in) :: rate

    derivative = sum(weights%motion*rate%motion + weights%forces*(rate%deviation + spring_forces(balance, rate%motion)))
    call balance%ranks%sum(derivative)
    derivative = derivative + sum(weights%monitors*balance%monitors%motion_of(rate%response))
  end function derivative_along

  !> By everything, of all quantities, at the solver's present point, which was evaluated last.
  subroutine differentiate_by_adjoint(solver, inquiry, gradients, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> Derivatives by everything [quantities]
    type(by_parameters_type), allocatable, intent(out) :: gradients(:)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(contact_forces_type), allocatable :: forward(:)
    type(preconditioners_type) :: kept
    type(weights_type) :: weights(size(inquiry%quantities))
    real(wp), allocatable :: laws(:, :, :)
    complex(wp), allocatable :: adjoint(:, :), damped(:, :, :)
    integer :: i

    call begin_at_sliders(solver, inquiry, status)
    if (status /= 0) return
    balance => solver%context%balance
    laws = derivatives_of_laws(balance, inquiry)
    weights = [(weights_of(inquiry%quantities(i), balance), i=1, size(weights))]
    damped = damping_loads(solver, inquiry)
    allocate (gradients(size(weights)))
    forward = balance%forces
    call run_backwards(balance)
    status = 0
    do i = 1, size(weights)
      call respond_backwards(solver, weights(i), kept, adjoint, status)
      if (status /= 0) exit
      gradients(i) = gradient_of(balance, size(inquiry%recipes), laws, damped, weights(i), adjoint)
    end do
    balance%forces = forward
    call balance%active%find(balance%law, balance%forces, balance%contact_rows)
  end subroutine differentiate_by_adjoint

  !> Loads f' by each number of damping [n, 0:H, numbers]; none where they are not asked for.
  function damping_loads(solver, inquiry) result(loads)
    !> Solver of points, at the point
    type(solver_type), intent(in) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    complex(wp), allocatable :: loads(:, :, :)
    real(wp) :: unit(damping_numbers)
    integer :: i

    associate (balance => solver%context%balance)
      allocate (loads(size(balance%response, 1), 0:ubound(balance%response, 2), merge(damping_numbers, 0, inquiry%damping)))
      do i = 1, size(loads, 3)
        unit = 0.0_wp
        unit(i) = 1.0_wp
        loads(:, :, i) = damping_load(solver, unit, balance%response)
      end do
    end associate
  end function damping_loads

  !> Put S D^T S in the place of D.
  subroutine run_backwards(balance)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(inout) :: balance
    real(wp), allocatable :: signs(:)
    integer :: i, j

    do i = 1, size(balance%law)
      associate (forces => balance%forces(i))
        if (.not. allocated(forces%jacobian)) cycle
        signs = [(backwards(balance%coefficients()), j=0, balance%law(i)%tangents)]
        forces%jacobian = transpose(forces%jacobian)
        do j = 1, size(signs)
          forces%jacobian(:, j) = signs*forces%jacobian(:, j)*signs(j)
        end do
        forces%active = any(abs(forces%jacobian) > 0.0_wp, 2)
      end associate
    end do
  end subroutine run_backwards

  !> S: 1 of the mean and cosines, -1 of sines [coefficients].
  pure function backwards(coefficients) result(signs)
    !> 2 H + 1
    integer, intent(in) :: coefficients
    real(wp) :: signs(coefficients)

    signs = 1.0_wp
    signs(3::2) = -1.0_wp
  end function backwards

  !> The adjoint response S a-bar, the balance running backwards [n, 0:H].
  subroutine respond_backwards(solver, weights, kept, adjoint, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> Of a quantity
    type(weights_type), intent(in) :: weights
    !> Preconditioners that serve more than one step
    type(preconditioners_type), intent(inout) :: kept
    !> Coordinates, by harmonic
    complex(wp), allocatable, intent(out) :: adjoint(:, :)
    !> 0, or not: singular
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(unknowns_type) :: right, moved
    type(linear_options_type) :: options
    complex(wp), allocatable :: response(:, :)
    real(wp), allocatable :: load(:, :)

    balance => solver%context%balance
    options = solver%context%linear
    allocate (adjoint, response, mold=balance%response)
    right = new_unknowns([balance%coefficients(), balance%rows()], shape(balance%slider))
    moved = right
    moved%motion = turned(weights%forces)
    load = balance%contact_rows%load_of(turned(weights%motion) + spring_forces(balance, moved%motion) &
                                        + change_of_deviation(balance, right, moved))
    call balance%ranks%sum(load)
    call balance%receptance%respond(to_complex(load + balance%monitors%load_of(turned(weights%monitors))), adjoint)
    right%motion = balance%recover(adjoint)
    call solve_accurately(balance, right%motion, options, kept, moved%motion, status)
    if (status /= 0) return
    call balance%respond_to_deviation(change_of_deviation(balance, right, moved), response)
    adjoint = adjoint + response
  end subroutine respond_backwards

  !> S times a field [2 H + 1, any].
  pure function turned(field)
    !> Coefficients
    real(wp), intent(in) :: field(:, :)
    real(wp) :: turned(size(field, 1), size(field, 2))

    turned = spread(backwards(size(field, 1)), 2, size(field, 2))*field
  end function turned

  !> Derivatives by everything, from the adjoint response.
  function gradient_of(balance, contacts, laws, damped, weights, adjoint) result(gradient)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> How many there are on all ranks
    integer, intent(in) :: contacts
    !> Derivatives of forces by the columns of contacts
    real(wp), intent(in) :: laws(:, :, :)
    !> Loads by numbers of damping [n, 0:H, numbers or 0]
    complex(wp), intent(in) :: damped(:, 0:, :)
    !> Of the quantity
    type(weights_type), intent(in) :: weights
    !> S a-bar
    complex(wp), intent(in) :: adjoint(:, 0:)
    type(by_parameters_type) :: gradient
    real(wp), allocatable :: felt(:, :)
    integer :: h, i, column

    gradient%static_factors = matmul(real(adjoint(:, 0), wp), balance%static_loads)
    associate (highest => balance%highest_load())
      gradient%harmonic_factors = [(sum(real(adjoint(:, h)*balance%harmonic_load(:, h), wp)), h=1, highest)]
      gradient%level = sum(gradient%harmonic_factors) + sum(real(adjoint(:, 0)*balance%harmonic_load(:, 0), wp))
      gradient%harmonic_factors = balance%level*gradient%harmonic_factors
    end associate
    gradient%damping = [(0.0_wp, i=1, damping_numbers)]
    do i = 1, size(damped, 3)
      gradient%damping(i) = sum(real(adjoint*damped(:, :, i), wp))
    end do
    felt = weights%forces - turned(balance%recover(adjoint))
    allocate (gradient%laws(size(laws, 3), contacts), source=0.0_wp)
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
        do column = 1, size(laws, 3)
          gradient%laws(column, balance%first_contact - 1 + i) = sum(felt(:, first:last)*laws(:, first:last, column))
        end do
      end associate
    end do
    call balance%ranks%sum(gradient%laws)
  end function gradient_of
end module attrito_sensitivity_parameter_derivatives
