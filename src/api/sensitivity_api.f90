!> C interface of sensitivities: between `attrito_enter_family`, `attrito_describe_member` and `attrito_leave_family` the derivatives
!> of the last point's amplitudes and means. Collective.
!>
!> Numbers of laws are in the order of tangential and normal stiffness, friction coefficient, gap, preload.
module attrito_api_sensitivity
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_api_session, only: session_type, session_of
  use attrito_sensitivity_law_derivatives, only: law_numbers
  use attrito_sensitivity_parameter_derivatives, only: by_parameters_type, differentiate_directly, &
                                                       differentiate_by_adjoint
  implicit none
  private

contains

  !> By parameters that each change the contacts' laws [parameters, contacts, 5], the factors on static loads [parameters, loads] and
  !> the level [parameters]: derivatives of amplitudes and means [parameters, monitors]. 0, or not: the equations are singular.
  integer(c_int) function attrito_differentiate_directly(handle, parameters, laws, static_factors, level, amplitude, mean) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> How many
    integer(c_int), value :: parameters
    !> Rates of the laws' numbers, of the factors on static loads, of the level
    real(c_double), intent(in) :: laws(*), static_factors(*), level(*)
    !> Derivatives of half the range, and of the mean
    real(c_double), intent(out) :: amplitude(*), mean(*)
    type(session_type), pointer :: session
    type(by_parameters_type) :: parameter(parameters)
    real(wp), allocatable :: by_parameter(:, :), mean_by_parameter(:, :)
    integer :: i, j, contacts, loads, status

    session => session_of(handle)
    contacts = size(session%contacts%law)
    loads = size(session%structure%static_loads, 2)
    do i = 1, parameters
      associate (first => law_numbers*contacts*(i - 1))
        parameter(i)%laws = reshape(laws(first + 1:first + law_numbers*contacts), [law_numbers, contacts])
      end associate
      parameter(i)%static_factors = [(static_factors(loads*(i - 1) + j), j=1, loads)]
      parameter(i)%level = level(i)
    end do
    call differentiate_directly(session%solver, parameter, by_parameter, mean_by_parameter, status)
    attrito_differentiate_directly = status
    if (status /= 0) return
    amplitude(:size(by_parameter)) = reshape(by_parameter, [size(by_parameter)])
    mean(:size(mean_by_parameter)) = reshape(mean_by_parameter, [size(mean_by_parameter)])
  end function attrito_differentiate_directly

  !> Of amplitudes, then of means, by all numbers of laws [2, monitors, contacts, 5], factors on static loads [2, monitors, loads] and
  !> the level [2, monitors]. 0, or not: the equations are singular.
  integer(c_int) function attrito_differentiate_by_adjoint(handle, laws, static_factors, level) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Derivatives by the laws' numbers, by the factors on static loads, by the level
    real(c_double), intent(out) :: laws(*), static_factors(*), level(*)
    type(session_type), pointer :: session
    type(by_parameters_type), allocatable :: gradients(:, :)
    integer :: contacts, i, kind, next, status

    session => session_of(handle)
    contacts = size(session%contacts%law)
    call differentiate_by_adjoint(session%solver, contacts, gradients, status)
    attrito_differentiate_by_adjoint = status
    if (status /= 0) return
    next = 0
    do kind = 1, 2
      do i = 1, size(gradients, 1)
        associate (gradient => gradients(i, kind), loads => size(gradients(i, kind)%static_factors))
          laws(law_numbers*contacts*next + 1:law_numbers*contacts*(next + 1)) = reshape(gradient%laws, [law_numbers*contacts])
          static_factors(loads*next + 1:loads*(next + 1)) = gradient%static_factors
          next = next + 1
          level(next) = gradient%level
        end associate
      end do
    end do
  end function attrito_differentiate_by_adjoint
end module attrito_api_sensitivity
