!> Derivatives of a point's monitors by numbers of contact laws, factors on static loads and the level, at the point's frequency and
!> at given sliders of the contacts that never slip. A change of these changes contact forces and loads at the point's own motion by
!> lambda' and f', and the point by
!>
!> $$ (I + R D) \, \delta d = B \tilde Z^{-1} (f' - B^T \lambda'), \qquad
!>    \delta q = \tilde Z^{-1} (f' - B^T (\lambda' + D \, \delta d)), \qquad a' = c^T \delta q $$
!>
!> c being the gradient of an amplitude or a mean by the coefficients of its monitor. Directly, that is one linear system a
!> parameter. The adjoint takes one for each c and gives the derivatives by all parameters there are:
!>
!> $$ a' = \bar a^T (f' - B^T \lambda'), \qquad \bar a = \tilde Z^{-T} (c - B^T D^T \bar d), \qquad
!>    (I + R^T D^T) \, \bar d = B \tilde Z^{-T} c $$
!>
!> Z~_h is symmetric, so in cosines and sines R^T = S R S, S turning the sign of sines: time runs backwards. With S D^T S in D's
!> place the adjoint system is again one of Newton's, and is solved as these are.
module attrito_sensitivity_parameter_derivatives
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_newton_linearised_step, only: change_of_deviation
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_sensitivity_accurate_step, only: solve_accurately
  use attrito_sensitivity_amplitude_gradient, only: amplitude_gradient
  use attrito_sensitivity_law_derivatives, only: differentiate_law, law_numbers
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: by_parameters_type, differentiate_directly, differentiate_by_adjoint, by_mean, by_amplitude

  !> What is differentiated of a monitor
  integer, parameter :: by_amplitude = 1, by_mean = 2

  !> A number for each number of all contacts' laws [law_numbers, contacts], each factor on static loads and the level: what a
  !> parameter changes them by, or derivatives by them
  type :: by_parameters_type
    real(wp), allocatable :: laws(:, :), static_factors(:)
    real(wp) :: level = 0.0_wp
  end type by_parameters_type

contains

  !> By parameters, at the solver's present point, which was evaluated last.
  subroutine differentiate_directly(solver, parameters, amplitude, mean, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> What each changes
    type(by_parameters_type), intent(in) :: parameters(:)
    !> Derivatives of the monitors' amplitudes and means [monitors, parameters]
    real(wp), allocatable, intent(out) :: amplitude(:, :), mean(:, :)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, moved
    complex(wp), allocatable :: response(:, :), by_loads(:, :)
    real(wp), allocatable :: laws(:, :, :), deviation(:, :), own(:, :), change(:, :)
    integer :: i, j

    balance => solver%context%balance
    laws = derivatives_of_laws(balance)
    allocate (amplitude(balance%monitors%number(), size(parameters)), mean(balance%monitors%number(), size(parameters)))
    allocate (response, by_loads, mold=balance%response)
    right = unknowns_type(0.0_wp*balance%residual, 0.0_wp*balance%slider, 0.0_wp)
    moved = right
    own = balance%monitors%motion_of(balance%response)
    do j = 1, size(parameters)
      deviation = force_change(balance, laws, parameters(j))
      by_loads = 0.0_wp
      associate (loads => load_change(balance, parameters(j)))
        call balance%receptance%respond(loads, by_loads(:, :size(loads, 2)))
      end associate
      call balance%respond_to_deviation(deviation, response)
      right%motion = balance%recover(response + by_loads)
      call solve_accurately(balance, right%motion, solver%context%linear, kept, moved%motion, status)
      if (status /= 0) return
      right%motion = 0.0_wp
      call balance%respond_to_deviation(deviation + change_of_deviation(balance, right, moved), response)
      change = balance%monitors%motion_of(response + by_loads)
      mean(:, j) = change(1, :)
      amplitude(:, j) = [(dot_product(amplitude_gradient(own(:, i)), change(:, i)), i=1, size(own, 2))]
    end do
  end subroutine differentiate_directly

  !> Of every monitor's amplitude and mean [monitors, 2], at the solver's present point, which was evaluated last.
  subroutine differentiate_by_adjoint(solver, contacts, gradients, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> How many there are on all ranks
    integer, intent(in) :: contacts
    !> Derivatives by everything
    type(by_parameters_type), allocatable, intent(out) :: gradients(:, :)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(contact_forces_type), allocatable :: forward(:)
    type(preconditioners_type) :: kept
    real(wp), allocatable :: laws(:, :, :), own(:, :), weight(:, :)
    complex(wp), allocatable :: adjoint(:, :)
    integer :: i, kind

    balance => solver%context%balance
    laws = derivatives_of_laws(balance)
    own = balance%monitors%motion_of(balance%response)
    allocate (gradients(size(own, 2), 2))
    allocate (weight, mold=own)
    forward = balance%forces
    call run_backwards(balance)
    do kind = by_amplitude, by_mean
      do i = 1, size(own, 2)
        weight = 0.0_wp
        if (kind == by_mean) weight(1, i) = 1.0_wp
        if (kind == by_amplitude) weight(:, i) = amplitude_gradient(own(:, i))
        call respond_backwards(solver, weight, kept, adjoint, status)
        if (status /= 0) exit
        gradients(i, kind) = gradient_of(balance, contacts, laws, adjoint)
      end do
      if (status /= 0) exit
    end do
    balance%forces = forward
    call balance%active%find(balance%law, balance%forces, balance%contact_rows)
  end subroutine differentiate_by_adjoint

  !> Derivatives of the forces of this rank's contacts by the numbers of their laws [2 H + 1, rows, law_numbers].
  function derivatives_of_laws(balance) result(laws)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(inout) :: balance
    real(wp), allocatable :: laws(:, :, :)
    real(wp), allocatable :: motion(:, :)
    integer :: i

    ! Contacts may have been held since.
    call balance%active%find(balance%law, balance%forces, balance%contact_rows)
    motion = balance%recover(balance%response)
    allocate (laws(size(motion, 1), size(motion, 2), law_numbers))
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
        call differentiate_law(balance%law(i), balance%quadrature, motion(:, first:last), balance%slider(:, i), balance%forces(i), &
                               laws(:, first:last, :))
      end associate
    end do
  end function derivatives_of_laws

  !> lambda' on this rank's rows [2 H + 1, rows].
  pure function force_change(balance, laws, parameter) result(change)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> Derivatives of forces by the numbers of the laws
    real(wp), intent(in) :: laws(:, :, :)
    !> What it changes
    type(by_parameters_type), intent(in) :: parameter
    real(wp) :: change(size(laws, 1), size(laws, 2))
    integer :: i, row

    do i = 1, size(balance%law)
      do row = balance%law(i)%first_row, balance%law(i)%first_row + balance%law(i)%tangents
        change(:, row) = matmul(laws(:, row, :), parameter%laws(:, balance%first_contact - 1 + i))
      end do
    end do
  end function force_change

  !> f' in generalised coordinates, as far as harmonics are loaded [n, 0:highest].
  pure function load_change(balance, parameter) result(loads)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> What it changes
    type(by_parameters_type), intent(in) :: parameter
    complex(wp) :: loads(size(balance%harmonic_load, 1), 0:balance%highest_load())

    loads = parameter%level*balance%harmonic_load(:, :balance%highest_load())
    loads(:, 0) = loads(:, 0) + matmul(balance%static_loads, parameter%static_factors)
  end function load_change

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
  subroutine respond_backwards(solver, weight, kept, adjoint, status)
    !> Solver of points: its balance
    type(solver_type), target, intent(inout) :: solver
    !> c [2 H + 1, monitors]
    real(wp), intent(in) :: weight(:, :)
    !> Preconditioners that serve more than one step
    type(preconditioners_type), intent(inout) :: kept
    !> Coordinates, by harmonic
    complex(wp), allocatable, intent(out) :: adjoint(:, :)
    !> 0, or not: singular
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(unknowns_type) :: right, moved
    complex(wp), allocatable :: response(:, :)

    balance => solver%context%balance
    allocate (response, mold=balance%response)
    allocate (adjoint(size(response, 1), 0:ubound(response, 2)))
    call balance%receptance%respond(to_complex(balance%monitors%load_of(spread(backwards(size(weight, 1)), 2, size(weight, 2)) &
                                                                        *weight)), adjoint)
    right = unknowns_type(balance%recover(adjoint), 0.0_wp*balance%slider, 0.0_wp)
    moved = right
    call solve_accurately(balance, right%motion, solver%context%linear, kept, moved%motion, status)
    if (status /= 0) return
    call balance%respond_to_deviation(change_of_deviation(balance, right, moved), response)
    adjoint = adjoint + response
  end subroutine respond_backwards

  !> Derivatives by everything, from the adjoint response.
  function gradient_of(balance, contacts, laws, adjoint) result(gradient)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> How many there are on all ranks
    integer, intent(in) :: contacts
    !> Derivatives of forces by the numbers of the laws
    real(wp), intent(in) :: laws(:, :, :)
    !> S a-bar
    complex(wp), intent(in) :: adjoint(:, 0:)
    type(by_parameters_type) :: gradient
    real(wp), allocatable :: motion(:, :)
    integer :: i, number

    gradient%static_factors = matmul(real(adjoint(:, 0), wp), balance%static_loads)
    associate (highest => balance%highest_load())
      gradient%level = sum(real(adjoint(:, :highest)*balance%harmonic_load(:, :highest), wp))
    end associate
    motion = balance%recover(adjoint)
    motion = spread(backwards(size(motion, 1)), 2, size(motion, 2))*motion
    allocate (gradient%laws(law_numbers, contacts), source=0.0_wp)
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
        do number = 1, law_numbers
          gradient%laws(number, balance%first_contact - 1 + i) = -sum(motion(:, first:last)*laws(:, first:last, number))
        end do
      end associate
    end do
    call balance%ranks%sum(gradient%laws)
  end function gradient_of
end module attrito_sensitivity_parameter_derivatives
