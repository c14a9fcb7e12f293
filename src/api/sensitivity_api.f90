!> C interface of sensitivities: between `attrito_enter_family`, `attrito_describe_member` and `attrito_leave_family` the derivatives
!> of the last point by one parameter after another. Collective.
module attrito_api_sensitivity
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_api_session, only: session_type, session_of
  use attrito_sensitivity_law_direction, only: direction_type
  use attrito_sensitivity_parameter_derivative, only: parameter_type, differentiate_by_parameter
  implicit none
  private

contains

  !> Derivative of the monitors by a parameter that changes the contacts' laws [contacts, 5] (tangential and normal stiffness, friction
  !> coefficient, gap, preload), the factors on the static loads [loads] and the level: their coefficients [monitors, 2 H + 1] and
  !> amplitudes [monitors]. 0, or not: the linearised equations are singular.
  integer(c_int) function attrito_differentiate_by_parameter(handle, laws, static_factors, level, monitors, amplitude) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Rates of the laws; rates of the factors on static loads
    real(c_double), intent(in) :: laws(*), static_factors(*)
    !> Rate of the level
    real(c_double), value :: level
    !> Coefficients of monitors; half of their ranges
    real(c_double), intent(out) :: monitors(*), amplitude(*)
    type(session_type), pointer :: session
    type(parameter_type) :: parameter
    real(wp), allocatable :: change(:, :), range_change(:)
    integer :: i, status

    session => session_of(handle)
    associate (contacts => size(session%contacts%law))
      parameter%laws = [(direction_type(laws(5*i + 1), laws(5*i + 2), laws(5*i + 3), laws(5*i + 4), laws(5*i + 5)), &
                         i=0, contacts - 1)]
    end associate
    parameter%static_factors = static_factors(:size(session%structure%static_loads, 2))
    parameter%level = level
    call differentiate_by_parameter(session%solver, parameter, change, range_change, status)
    attrito_differentiate_by_parameter = status
    if (status /= 0) return
    monitors(:size(change)) = reshape(change, [size(change)])
    amplitude(:size(range_change)) = range_change
  end function attrito_differentiate_by_parameter
end module attrito_api_sensitivity
