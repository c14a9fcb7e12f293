!> C interface of sensitivities: between `attrito_enter_family`, `attrito_describe_member` and `attrito_leave_family` the derivatives
!> of the last point's quantities. What is asked for is said first, once. Collective.
!>
!> Columns of a contact are tangential and normal stiffness, friction coefficient, gap, preload; then further numbers of its law, and
!> its sliders, as many as are asked for.
module attrito_api_sensitivity
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_api_session, only: session_type, session_of, contact_law_type
  use attrito_peak_frequency_slopes, only: frequency_slopes
  use attrito_peak_mode_slopes, only: mode_slopes_type, mode_slopes
  use attrito_sensitivity_damping_derivatives, only: damping_numbers
  use attrito_sensitivity_onsets, only: scale_friction, find_onsets
  use attrito_sensitivity_parameters, only: by_parameters_type
  use attrito_sensitivity_parameter_derivatives, only: differentiate_directly, differentiate_by_adjoint, &
                                                      differentiate_by_frequency
  implicit none
  private
  public :: rates_type

  !> What parameters change, or derivatives of quantities by it, one after another
  type, bind(c) :: rates_type
    !> How many parameters or quantities; columns of a contact; static loads; harmonics that are loaded
    integer(c_int) :: count, columns, loads, harmonics
    !> [count, contacts, columns], [count, loads], [count], [count, harmonics], [count, 4]
    type(c_ptr) :: laws, static_factors, level, harmonic_factors, damping
  end type rates_type

contains

  !> What derivatives are asked for from now on.
  subroutine attrito_ask_derivatives(handle, quantities, kinds, width, factors, count, laws, sliders, damping) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> How many quantities; how many factors each has; number of contacts
    integer(c_int), value :: quantities, width, count
    !> Kind of each quantity
    integer(c_int), intent(in) :: kinds(*)
    !> On monitors, or on contacts [quantities, width]
    real(c_double), intent(in) :: factors(*)
    !> Contact laws: a kind above 0 asks for derivatives by its further numbers
    type(contact_law_type), intent(in) :: laws(count)
    !> Are derivatives by sliders asked for, and by damping?
    integer(c_int), value :: sliders, damping
    type(session_type), pointer :: session
    real(c_double), pointer :: numbers(:)
    integer :: i, j

    session => session_of(handle)
    associate (inquiry => session%inquiry)
      if (allocated(inquiry%quantities)) deallocate (inquiry%quantities, inquiry%recipes)
      allocate (inquiry%quantities(quantities), inquiry%recipes(count))
      do i = 1, quantities
        inquiry%quantities(i)%kind = kinds(i)
        inquiry%quantities(i)%factors = [(factors(width*(i - 1) + j), j=1, width)]
      end do
      inquiry%numbers = 0
      do i = 1, count
        inquiry%recipes(i)%kind = laws(i)%law
        allocate (inquiry%recipes(i)%numbers(0))
        if (laws(i)%law == 0) cycle
        call c_f_pointer(laws(i)%numbers, numbers, [laws(i)%count])
        inquiry%recipes(i)%numbers = numbers
        inquiry%numbers = max(inquiry%numbers, size(numbers))
      end do
      inquiry%sliders = merge(size(session%solver%context%balance%slider, 1), 0, sliders /= 0)
      inquiry%damping = damping /= 0
    end associate
  end subroutine attrito_ask_derivatives

  !> Friction coefficients of all contacts times a factor, until 1 gives them back: a contact at the onset of slip sticks with a
  !> little more friction, and slips with a little less.
  subroutine attrito_scale_friction(handle, factor) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> On what the contacts have
    real(c_double), value :: factor
    type(session_type), pointer :: session

    session => session_of(handle)
    call scale_friction(session%solver, factor)
  end subroutine attrito_scale_friction

  !> Contacts at the onset of slip: those that rest with friction larger by a part of it, and slip with friction smaller by as much
  !> [contacts]. 0, or not: the point cannot be evaluated.
  integer(c_int) function attrito_find_onsets(handle, margin, begins) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Part of friction
    real(c_double), value :: margin
    !> 1 of those at the onset, else 0
    real(c_double), intent(out) :: begins(*)
    type(session_type), pointer :: session
    integer :: status

    session => session_of(handle)
    call find_onsets(session%solver, margin, begins(:size(session%contacts%law)), status)
    attrito_find_onsets = status
  end function attrito_find_onsets

  !> By the frequency, rad/s: derivatives of the quantities [quantities]. 0, or not: the equations are singular.
  integer(c_int) function attrito_differentiate_by_frequency(handle, derivatives) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Derivatives
    real(c_double), intent(out) :: derivatives(*)
    type(session_type), pointer :: session
    real(wp), allocatable :: found(:)
    integer :: status

    session => session_of(handle)
    call differentiate_by_frequency(session%solver, session%inquiry, found, status)
    attrito_differentiate_by_frequency = status
    if (status == 0) derivatives(:size(found)) = found
  end function attrito_differentiate_by_frequency

  !> By parameters: derivatives of the quantities [quantities, parameters]. 0, or not: the equations are singular.
  integer(c_int) function attrito_differentiate_directly(handle, rates, derivatives) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> What parameters change
    type(rates_type), intent(in) :: rates
    !> Derivatives
    real(c_double), intent(out) :: derivatives(*)
    type(session_type), pointer :: session
    real(wp), allocatable :: found(:, :)
    integer :: status

    session => session_of(handle)
    call differentiate_directly(session%solver, session%inquiry, parameters_of(session, rates), found, status)
    attrito_differentiate_directly = status
    if (status == 0) derivatives(:size(found)) = reshape(transpose(found), [size(found)])
  end function attrito_differentiate_directly

  !> Of the quantities by everything. 0, or not: the equations are singular.
  integer(c_int) function attrito_differentiate_by_adjoint(handle, gradients) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Takes the derivatives
    type(rates_type), intent(in) :: gradients
    type(session_type), pointer :: session
    type(by_parameters_type), allocatable :: found(:)
    real(c_double), pointer :: laws(:, :, :), static_factors(:, :), level(:), harmonic_factors(:, :), damping(:, :)
    integer :: i, status

    session => session_of(handle)
    call differentiate_by_adjoint(session%solver, session%inquiry, found, status)
    attrito_differentiate_by_adjoint = status
    if (status /= 0) return
    call point_to(session, gradients, laws, static_factors, level, harmonic_factors, damping)
    do i = 1, size(found)
      laws(:, :, i) = found(i)%laws
      static_factors(:, i) = found(i)%static_factors
      level(i) = found(i)%level
      harmonic_factors(:, i) = 0.0_wp
      associate (loaded => min(size(found(i)%harmonic_factors), size(harmonic_factors, 1)))
        harmonic_factors(:loaded, i) = found(i)%harmonic_factors(:loaded)
      end associate
      damping(:, i) = found(i)%damping
    end do
  end function attrito_differentiate_by_adjoint

  !> By parameters: derivatives of the frequency, rad/s, of the peak of a monitor's half range (from 0) at which the solver stands
  !> [parameters]. 0, or not: the equations are singular.
  integer(c_int) function attrito_differentiate_peak_frequency(handle, monitor, rates, derivatives) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Monitor
    integer(c_int), value :: monitor
    !> What parameters change
    type(rates_type), intent(in) :: rates
    !> Derivatives
    real(c_double), intent(out) :: derivatives(*)
    type(session_type), pointer :: session
    real(wp), allocatable :: found(:)
    integer :: status

    session => session_of(handle)
    call frequency_slopes(session%solver, session%inquiry, monitor + 1, parameters_of(session, rates), found, status)
    attrito_differentiate_peak_frequency = status
    if (status == 0) derivatives(:size(found)) = found
  end function attrito_differentiate_peak_frequency

  !> By parameters, of a mode where it stands, its amplitude Q = |w . q_1| held: derivatives of the angular frequency, of the negative
  !> damping and of the structure's damping ratio [3, parameters], and of the quantities [quantities, parameters]. 0, or not: the
  !> equations are singular.
  integer(c_int) function attrito_differentiate_mode(handle, rates, cosine, sine, own, mode, quantities) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> What parameters change
    type(rates_type), intent(in) :: rates
    !> w = cosine - i sine, by the model's coordinates [m]
    real(c_double), intent(in) :: cosine(*), sine(*)
    !> Derivatives of Q at the motion held [parameters]
    real(c_double), intent(in) :: own(*)
    !> Derivatives of the mode, and of the quantities
    real(c_double), intent(out) :: mode(*), quantities(*)
    type(session_type), pointer :: session
    type(mode_slopes_type) :: slopes
    integer :: i, status

    session => session_of(handle)
    associate (m => size(session%structure%mass, 1))
      call mode_slopes(session%solver, session%backbone, session%inquiry, parameters_of(session, rates), &
                       cmplx(cosine(:m), -sine(:m), wp), [(own(i), i=1, rates%count)], slopes, status)
    end associate
    attrito_differentiate_mode = status
    if (status /= 0) return
    mode(:3*rates%count) = [slopes%omega, slopes%excitation, slopes%structural_ratio]
    quantities(:size(slopes%quantities)) = reshape(transpose(slopes%quantities), [size(slopes%quantities)])
  end function attrito_differentiate_mode

  !> As the numerics have them.
  function parameters_of(session, rates) result(parameters)
    !> Session behind a handle
    type(session_type), intent(in) :: session
    !> As C hands them over
    type(rates_type), intent(in) :: rates
    type(by_parameters_type) :: parameters(rates%count)
    real(c_double), pointer :: laws(:, :, :), static_factors(:, :), level(:), harmonic_factors(:, :), damping(:, :)
    integer :: i

    call point_to(session, rates, laws, static_factors, level, harmonic_factors, damping)
    do i = 1, size(parameters)
      parameters(i) = by_parameters_type(laws(:, :, i), static_factors(:, i), harmonic_factors(:, i), damping(:, i), level(i))
    end do
  end function parameters_of

  !> Arrays behind a structure.
  subroutine point_to(session, rates, laws, static_factors, level, harmonic_factors, damping)
    !> Session behind a handle
    type(session_type), intent(in) :: session
    !> As C hands them over
    type(rates_type), intent(in) :: rates
    !> [columns, contacts, count], [loads, count], [count], [harmonics, count], [4, count]
    real(c_double), pointer, intent(out) :: laws(:, :, :), static_factors(:, :), level(:), harmonic_factors(:, :), damping(:, :)

    call c_f_pointer(rates%laws, laws, [int(rates%columns), size(session%contacts%law), int(rates%count)])
    call c_f_pointer(rates%static_factors, static_factors, [rates%loads, rates%count])
    call c_f_pointer(rates%level, level, [rates%count])
    call c_f_pointer(rates%harmonic_factors, harmonic_factors, [rates%harmonics, rates%count])
    call c_f_pointer(rates%damping, damping, [damping_numbers, int(rates%count)])
  end subroutine point_to
end module attrito_api_sensitivity
