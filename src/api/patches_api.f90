!> C interface of a scene whose contacts are merged into patches: a static state that is known, all contacts at a motion that is
!> given, and what a force would change of a point. Collective; see docs/method.md, Fewer contacts.
module attrito_api_patches
  use, intrinsic :: iso_c_binding
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_accuracy_force_change, only: change_by_force
  use attrito_accuracy_point_errors, only: no_tolerance
  use attrito_solve_given_motion, only: evaluate_motion
  use attrito_solve_static_path, only: take_static_state
  use attrito_output_point_report, only: report_point
  use attrito_api_message, only: report_error
  use attrito_api_session, only: session_type, session_of
  use attrito_api_solver, only: point_type, point_of
  implicit none
  private

contains

  !> Be at a static state that is known: displacements of the coordinates [m], sliders [contacts, width]; static loads act in full.
  integer(c_int) function attrito_take_static_state(handle, displacements, slider, omega, point, message, length) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Displacements of the coordinates; sliders
    real(c_double), intent(in) :: displacements(*), slider(*)
    !> Angular frequency, rad/s
    real(c_double), value :: omega
    !> Point, reported
    type(point_type), intent(out) :: point
    !> Room for the message, characters
    integer(c_int), value :: length
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error

    session => session_of(handle)
    call take_static_state(session%solver, displacements(:size(session%structure%mass, 1)), own_sliders(session, slider), omega, &
                           error)
    call report_point(session%solver, session%solver%report, 0, session%accuracy%errors, no_tolerance, session%point)
    point = point_of(session%point)
    attrito_take_static_state = report_error(error, message)
  end function attrito_take_static_state

  !> Evaluate all contacts at a motion of the coordinates [m, coefficients], with so many samples, from sliders [contacts, width]; the
  !> session's point is this motion, solved for or not.
  subroutine attrito_evaluate_motion(handle, coefficients, samples, coordinates, slider, omega, level, branch, point) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Coefficients of each row, 2 H + 1; samples a period, J
    integer(c_int), value :: coefficients, samples
    !> Motion of the model's coordinates; sliders at the start of the period
    real(c_double), intent(in) :: coordinates(coefficients, *), slider(*)
    !> Angular frequency, rad/s; factor on the loads
    real(c_double), value :: omega, level
    !> Number of the branch
    integer(c_int), value :: branch
    !> Point, reported
    type(point_type), intent(out) :: point
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (solver => session%solver)
      call solver%set_resolution((coefficients - 1)/2, int(samples))
      call solver%set_loads(solver%context%balance%static_factors, level)
      call evaluate_motion(solver, coordinates(:, :size(session%structure%mass, 1)), own_sliders(session, slider), omega)
      call report_point(solver, solver%report, int(branch), session%accuracy%errors, no_tolerance, session%point)
    end associate
    point = point_of(session%point)
  end subroutine attrito_evaluate_motion

  !> The relative change of the monitors' amplitudes, to first order, by a force on the coordinates [coefficients, m] at the present
  !> point; 0, or not: the linearised step is singular.
  integer(c_int) function attrito_change_by_force(handle, coefficients, force, change) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Coefficients of each row, 2 H + 1: those of the present point
    integer(c_int), value :: coefficients
    !> Fourier coefficients on the model's coordinates
    real(c_double), intent(in) :: force(*)
    !> Relative change of the amplitudes
    real(c_double), intent(out) :: change
    type(session_type), pointer :: session
    integer :: m, status

    session => session_of(handle)
    m = size(session%structure%mass, 1)
    call change_by_force(session%solver, reshape(force(:m*coefficients), [m, int(coefficients)]), change, status)
    attrito_change_by_force = status
  end function attrito_change_by_force

  !> Length of the sweep's next step; another, if that is greater than zero.
  real(c_double) function attrito_step_size(handle, size) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Length of the step in the sweep's own scale
    real(c_double), value :: size
    type(session_type), pointer :: session

    session => session_of(handle)
    if (size > 0.0_c_double) session%sweep%stepper%size = size
    attrito_step_size = session%sweep%stepper%size
  end function attrito_step_size

  !> Sliders of this rank's contacts, of those of all [width, contacts].
  function own_sliders(session, slider) result(own)
    !> Session, as the handle stands for
    type(session_type), intent(in) :: session
    !> Of all contacts [contacts, width]
    real(c_double), intent(in) :: slider(*)
    real(wp), allocatable :: own(:, :)
    integer :: first

    associate (balance => session%solver%context%balance)
      first = size(balance%slider, 1)*(balance%first_contact - 1)
      own = reshape(slider(first + 1:first + size(balance%slider)), shape(balance%slider))
    end associate
  end function own_sliders
end module attrito_api_patches
