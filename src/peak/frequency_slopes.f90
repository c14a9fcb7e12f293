!> How the frequency of a peak changes with parameters. Along the frequency response A_omega = 0 at a peak, whatever the parameter:
!>
!> $$ \omega' = -A_{p \omega} / A_{\omega \omega}, \qquad
!>    A_{p \omega} = A''[a_p, a_\omega] + A' \cdot a_{p \omega} $$
!>
!> with a the monitor's coefficients. Their second derivatives take one more linear system each: with q_p, d_p the change of the point
!> by the parameter (`attrito_sensitivity_point_rates`) and q_omega, d_omega that by the frequency,
!>
!> $$ (\tilde Z + B^T D B) \, q_{p \omega} = -\tilde Z_\omega q_p - \tilde Z_p q_\omega - \tilde Z_{p \omega} q
!>    - B^T \left( (J d_\omega)' - J d_{p \omega} \right) $$
module attrito_peak_frequency_slopes
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: follow_sliders
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_peak_amplitude, only: amplitude_type, amplitude_of, half_range
  use attrito_peak_jacobian_rates, only: jacobian_rate
  use attrito_peak_second_derivative, only: differentiate_twice
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_sensitivity_damping_derivatives, only: damping_load, viscous
  use attrito_sensitivity_parameters, only: by_parameters_type
  use attrito_sensitivity_point_rates, only: inquiry_type, rate_type, derivatives_of_laws, rate_of_parameter, rate_of_response
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: frequency_slopes

contains

  !> Derivatives of the angular frequency, rad/s, at a peak where the solver stands, which was evaluated last.
  subroutine frequency_slopes(solver, inquiry, monitor, parameters, slopes, status)
    !> Solver of points
    type(solver_type), target, intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> Whose peak it is, from 1
    integer, intent(in) :: monitor
    !> What each changes
    type(by_parameters_type), intent(in) :: parameters(:)
    !> [parameters]; NaN: none
    real(wp), allocatable, intent(out) :: slopes(:)
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(balance_type), pointer :: balance
    type(preconditioners_type) :: kept
    type(rate_type) :: by_omega, rate, second
    type(amplitude_type) :: amplitude
    real(wp), allocatable :: laws(:, :, :)
    complex(wp), allocatable :: source(:, :)
    real(wp) :: curvature
    integer :: j

    balance => solver%context%balance
    laws = derivatives_of_laws(balance, inquiry)
    slopes = spread(ieee_value(1.0_wp, ieee_quiet_nan), 1, size(parameters))
    status = 0
    if (.not. has_second_derivatives(balance)) return
    amplitude = amplitude_of(balance%monitors%row_of(monitor, balance%response), half_range)
    allocate (source, mold=balance%response)
    call balance%receptance%respond_derivative(balance%response, source)
    call rate_of_response(solver, source, kept, by_omega, status)
    if (status /= 0) return
    source = source_by_omega(balance, by_omega)
    call rate_of_response(solver, source, kept, second, status)
    if (status /= 0) return
    curvature = second_of(by_omega, second)
    do j = 1, size(parameters)
      call rate_of_parameter(solver, laws, parameters(j), kept, rate, status)
      if (status /= 0) return
      source = source_by_parameter(solver, inquiry, parameters(j), by_omega, rate)
      call rate_of_response(solver, source, kept, second, status)
      if (status /= 0) return
      slopes(j) = -second_of(rate, second)/curvature
    end do

  contains

    !> A''[a_x, a_omega] + A' . a_x,omega.
    real(wp) function second_of(along, both)
      !> The change x; the second change by x and the frequency
      type(rate_type), intent(in) :: along, both

      second_of = dot_product(balance%monitors%row_of(monitor, by_omega%response), &
                              matmul(amplitude%curvature, balance%monitors%row_of(monitor, along%response))) &
                  + dot_product(amplitude%gradient, balance%monitors%row_of(monitor, both%response))
    end function second_of
  end subroutine frequency_slopes

  !> Do all contacts' Jacobians change smoothly?
  logical function has_second_derivatives(balance) result(has)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    real(wp) :: bent
    integer :: i

    bent = 0.0_wp
    do i = 1, size(balance%law)
      if (.not. allocated(balance%forces(i)%jacobian)) cycle
      if (.not. balance%law(i)%is_proportional()) bent = 1.0_wp
    end do
    has = .not. balance%ranks%largest(bent) > 0.0_wp
  end function has_second_derivatives

  !> What changes q_omega,omega by itself [n, 0:H].
  function source_by_omega(balance, by_omega) result(source)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    !> Change by the frequency
    type(rate_type), intent(in) :: by_omega
    complex(wp), allocatable :: source(:, :)
    complex(wp), allocatable :: part(:, :)
    type(unknowns_type) :: way
    real(wp) :: twice(size(by_omega%motion, 1), size(by_omega%motion, 2), 1)

    way = new_unknowns(shape(by_omega%motion), shape(balance%slider))
    way%motion = by_omega%motion
    call follow_sliders(balance, 0.0_wp*balance%slider, way)
    call differentiate_twice(balance, balance%recover(balance%response), way, [way], twice)
    allocate (source, part, mold=balance%response)
    call balance%respond_to_deviation(twice(:, :, 1), source)
    call balance%receptance%respond_derivative(by_omega%response, part)
    source = source + 2.0_wp*part
    call balance%receptance%respond_inertia(balance%response, part)
    source = source + part
  end function source_by_omega

  !> What changes q_p,omega by itself [n, 0:H].
  function source_by_parameter(solver, inquiry, parameter, by_omega, rate) result(source)
    !> Solver of points
    type(solver_type), target, intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> What the parameter changes
    type(by_parameters_type), intent(in) :: parameter
    !> Change by the frequency, and by the parameter
    type(rate_type), intent(in) :: by_omega, rate
    complex(wp), allocatable :: source(:, :)
    complex(wp), allocatable :: part(:, :)
    type(balance_type), pointer :: balance

    balance => solver%context%balance
    allocate (source, part, mold=balance%response)
    call balance%respond_to_deviation(jacobian_rate(balance, inquiry, parameter, by_omega%motion, rate%motion), source)
    call balance%receptance%respond_derivative(rate%response, part)
    source = source + part
    call balance%receptance%respond(damping_load(solver, parameter%damping, by_omega%response) &
                                    + damping_load(solver, viscous(parameter%damping), balance%response)/solver%omega, part)
    source = source + part
  end function source_by_parameter
end module attrito_peak_frequency_slopes
