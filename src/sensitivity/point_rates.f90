!> How a point changes with a parameter, at its frequency and at given sliders of the contacts that never slip. A change of the
!> parameter changes contact forces and loads at the point's own motion by lambda' and f', and the point by
!>
!> $$ (I + R D) \, \delta d = B \tilde Z^{-1} (f' - B^T \lambda'), \qquad
!>    \delta q = \tilde Z^{-1} (f' - B^T (\lambda' + D \, \delta d)) $$
module attrito_sensitivity_point_rates
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_newton_linearised_step, only: change_of_deviation
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_sensitivity_accurate_step, only: solve_accurately
  use attrito_sensitivity_damping_derivatives, only: damping_load
  use attrito_sensitivity_law_derivatives, only: differentiate_law, differentiate_by_sliders
  use attrito_sensitivity_parameters, only: by_parameters_type, recipe_type, law_numbers
  use attrito_sensitivity_quantities, only: quantity_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: inquiry_type, rate_type, begin_at_sliders, derivatives_of_laws, rate_of_parameter, rate_of_response

  !> What is asked for
  type :: inquiry_type
    type(quantity_type), allocatable :: quantities(:)
    !> What the laws of all contacts are made of
    type(recipe_type), allocatable :: recipes(:)
    !> Columns of contacts beyond the numbers of every law: further numbers, sliders
    integer :: numbers = 0, sliders = 0
    !> Are there derivatives by damping?
    logical :: damping = .false.
  end type inquiry_type

  !> Change of motion [2 H + 1, rows], of total contact forces' deviation there and of the response [n, 0:H]
  type :: rate_type
    real(wp), allocatable :: motion(:, :), deviation(:, :)
    complex(wp), allocatable :: response(:, :)
  end type rate_type

contains

  !> Where derivatives by sliders are asked for, points begin at those of the static solution: a contact that these are no place to
  !> rest for takes its slider along with the motion. Elsewhere the point's own sliders are given.
  subroutine begin_at_sliders(solver, inquiry, status)
    !> Solver of points, at the point
    type(solver_type), intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> 0, or not: it cannot be evaluated
    integer, intent(out) :: status

    status = 0
    if (inquiry%sliders == 0) return
    associate (balance => solver%context%balance)
      balance%slider = merge(balance%slider, solver%static_slider, spread(balance%periodic, 1, size(balance%slider, 1)))
      call balance%evaluate(solver%motion, solver%omega, status)
    end associate
  end subroutine begin_at_sliders

  !> Derivatives of the forces of this rank's contacts by their columns [2 H + 1, rows, columns].
  function derivatives_of_laws(balance, inquiry) result(laws)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(inout) :: balance
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    real(wp), allocatable :: laws(:, :, :)
    real(wp), allocatable :: motion(:, :)
    integer :: i

    ! Contacts may have been held since.
    call balance%active%find(balance%law, balance%forces, balance%contact_rows)
    motion = balance%recover(balance%response)
    allocate (laws(size(motion, 1), size(motion, 2), law_numbers + inquiry%numbers + inquiry%sliders), source=0.0_wp)
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents, &
                 recipe => inquiry%recipes(balance%first_contact - 1 + i))
        call differentiate_law(balance%law(i), recipe, balance%quadrature, motion(:, first:last), balance%slider(:, i), &
                               balance%forces(i), laws(:, first:last, :law_numbers + size(recipe%numbers)))
        if (inquiry%sliders > 0) then
          call differentiate_by_sliders(balance%law(i), balance%quadrature, motion(:, first:last), balance%slider(:, i), &
                                        balance%forces(i), laws(:, first:last, law_numbers + inquiry%numbers + 1:))
        end if
      end associate
    end do
  end function derivatives_of_laws

  !> Of a parameter; 0, or not: the linearised equations are singular there.
  subroutine rate_of_parameter(solver, laws, parameter, kept, rate, status)
    !> Solver of points, at the point
    type(solver_type), target, intent(inout) :: solver
    !> Derivatives of forces by the columns of contacts
    real(wp), intent(in) :: laws(:, :, :)
    !> What it changes
    type(by_parameters_type), intent(in) :: parameter
    !> Preconditioners that serve more than one step
    type(preconditioners_type), intent(inout) :: kept
    !> How the point changes
    type(rate_type), intent(out) :: rate
    !> 0, or not
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    complex(wp), allocatable :: source(:, :), by_loads(:, :)
    real(wp), allocatable :: own(:, :)

    balance => solver%context%balance
    own = force_change(balance, laws, parameter)
    allocate (source, by_loads, mold=balance%response)
    call balance%receptance%respond(load_change(solver, parameter), by_loads)
    call balance%respond_to_deviation(own, source)
    call rate_of_response(solver, source + by_loads, kept, rate, status)
    if (status == 0) rate%deviation = rate%deviation + own
  end subroutine rate_of_parameter

  !> Of what changes the response by itself, forces' deviations held [n, 0:H].
  subroutine rate_of_response(solver, source, kept, rate, status)
    !> Solver of points, at the point
    type(solver_type), target, intent(inout) :: solver
    !> Change of the response
    complex(wp), intent(in) :: source(:, 0:)
    !> Preconditioners that serve more than one step
    type(preconditioners_type), intent(inout) :: kept
    !> How the point changes
    type(rate_type), intent(out) :: rate
    !> 0, or not
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(unknowns_type) :: moved

    balance => solver%context%balance
    moved = new_unknowns([balance%coefficients(), balance%rows()], shape(balance%slider))
    call solve_accurately(balance, balance%recover(source), solver%context%linear, kept, moved%motion, status)
    if (status /= 0) return
    rate%deviation = change_of_deviation(balance, new_unknowns(shape(moved%motion), shape(balance%slider)), moved)
    allocate (rate%response, mold=balance%response)
    call balance%respond_to_deviation(rate%deviation, rate%response)
    rate%response = rate%response + source
    call move_alloc(moved%motion, rate%motion)
  end subroutine rate_of_response

  !> lambda' on this rank's rows [2 H + 1, rows].
  pure function force_change(balance, laws, parameter) result(change)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> Derivatives of forces by the columns of contacts
    real(wp), intent(in) :: laws(:, :, :)
    !> What it changes
    type(by_parameters_type), intent(in) :: parameter
    real(wp) :: change(size(laws, 1), size(laws, 2))
    integer :: i, column

    change = 0.0_wp
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents, &
                 own => parameter%laws(:, balance%first_contact - 1 + i))
        do column = 1, size(own)
          if (abs(own(column)) > 0.0_wp) change(:, first:last) = change(:, first:last) + own(column)*laws(:, first:last, column)
        end do
      end associate
    end do
  end function force_change

  !> f' in generalised coordinates [n, 0:H].
  function load_change(solver, parameter) result(loads)
    !> Solver of points, at the point
    type(solver_type), target, intent(in) :: solver
    !> What it changes
    type(by_parameters_type), intent(in) :: parameter
    complex(wp), allocatable :: loads(:, :)
    type(balance_type), pointer :: balance
    real(wp) :: factor
    integer :: h

    balance => solver%context%balance
    allocate (loads, mold=balance%response)
    loads = damping_load(solver, parameter%damping, balance%response)
    do h = 0, balance%highest_load()
      factor = parameter%level
      if (h >= 1 .and. h <= size(parameter%harmonic_factors)) factor = factor + balance%level*parameter%harmonic_factors(h)
      loads(:, h) = loads(:, h) + factor*balance%harmonic_load(:, h)
    end do
    loads(:, 0) = loads(:, 0) + matmul(balance%static_loads, parameter%static_factors)
  end function load_change
end module attrito_sensitivity_point_rates
