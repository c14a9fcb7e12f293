!> C interface of the linear systems that a nonlinear response is compared with.
module attrito_api_linear
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use, intrinsic :: iso_c_binding
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: extrema
  use attrito_linear_damping, only: damping_form
  use attrito_linear_diameter_references, only: modes_of_diameter
  use attrito_linear_projected_rows, only: projected_rows_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_references, only: reference_type, new_reference
  use attrito_linear_stuck_system, only: new_receptance
  use attrito_api_message, only: report_error
  use attrito_api_session, only: session_type, session_of
  implicit none
  private
  public :: attrito_linear_response, attrito_linear_modes, attrito_diameter_modes

contains

  !> Linear response of the monitors of a reference system (`attrito_describe`): amplitudes [monitors, count] at level 1, and the
  !> lowest natural frequencies [frequencies] in Hz of that system, elastic modes alone; zeros where there are fewer. `rigid`: its
  !> rigid-body modes.
  integer(c_int) function attrito_linear_response(handle, kind, count, omega, amplitude, frequencies, natural_hz, rigid, message, &
                                                  length) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Which system; number of items; how many there are; room for the message, characters
    integer(c_int), value :: kind, count, frequencies, length
    !> Angular frequency, rad/s
    real(c_double), intent(in) :: omega(count)
    !> Amplitudes of the monitors; lowest natural frequencies, Hz
    real(c_double), intent(out) :: amplitude(count, *), natural_hz(frequencies)
    !> Rigid-body modes
    integer(c_int), intent(out) :: rigid
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(reference_type) :: reference
    class(receptance_type), allocatable :: receptance
    type(projected_rows_type) :: monitors
    type(error_type), allocatable :: error
    complex(wp), allocatable :: load(:, :), response(:, :)
    real(wp), allocatable :: coefficients(:, :), own(:)
    real(wp) :: range(2)
    integer :: i, monitor, harmonics, n, resting, status

    session => session_of(handle)
    call new_reference(session%structure, session%contacts, session%solver%stuck, kind, session%solver%closed, reference, error)
    attrito_linear_response = report_error(error, message)
    if (allocated(error)) return
    call reference%natural(session%structure, own, resting)
    rigid = resting
    n = min(frequencies, size(own) - resting)
    natural_hz = 0.0_wp
    natural_hz(:n) = own(resting + 1:resting + n)/two_pi
    harmonics = (size(session%structure%harmonic_load, 2) - 1)/2
    call new_receptance(session%structure, session%contacts, reference%system, harmonics, receptance)
    ! The mean carries no harmonic load, and without friction it may have no support.
    receptance%lowest = 1
    load = receptance%project_loads(session%structure%harmonic_load)
    monitors = receptance%project_rows(session%structure%monitors)
    allocate (response, mold=load)
    do i = 1, count
      call receptance%set_frequency(omega(i), status)
      amplitude(i, :size(session%structure%monitors, 2)) = ieee_value(1.0_wp, ieee_quiet_nan)
      if (status /= 0) cycle
      call receptance%respond(load, response)
      coefficients = monitors%motion_of(response)
      coefficients(1, :) = 0.0_wp
      do monitor = 1, size(coefficients, 2)
        range = extrema(coefficients(:, monitor))
        amplitude(i, monitor) = 0.5_wp*(range(2) - range(1))
      end do
    end do
  end function attrito_linear_response

  !> The lowest modes of a reference system (`attrito_describe`), normalised by mass: natural frequencies in Hz, damping ratios by
  !> the structure's own damping (0 of rigid-body modes) [count], shapes [count, m], and how many of them, the first, are rigid-body
  !> modes.
  integer(c_int) function attrito_linear_modes(handle, kind, count, natural_hz, damping_ratio, shapes, rigid, message, length) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Which system; modes, at most as many as coordinates; room for the message, characters
    integer(c_int), value :: kind, count, length
    !> Natural frequencies, Hz; damping ratios; shapes in the coordinates
    real(c_double), intent(out) :: natural_hz(count), damping_ratio(count), shapes(*)
    !> Rigid-body modes among them
    integer(c_int), intent(out) :: rigid
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(reference_type) :: reference
    type(error_type), allocatable :: error
    real(wp), allocatable :: vectors(:, :)

    session => session_of(handle)
    call new_reference(session%structure, session%contacts, session%solver%stuck, kind, session%solver%closed, reference, error)
    attrito_linear_modes = report_error(error, message)
    if (allocated(error)) return
    rigid = min(reference%rigid, int(count))
    vectors = reference%shapes(int(count))
    shapes(:size(vectors)) = reshape(vectors, [size(vectors)])
    associate (omega => reference%system%omega(:count))
      natural_hz = omega/two_pi
      damping_ratio = 0.0_wp
      damping_ratio(rigid + 1:) = damping_form(session%structure, session%solver%stuck, vectors(:, rigid + 1:), omega(rigid + 1:)) &
                                  /(2.0_wp*omega(rigid + 1:))
    end associate
  end function attrito_linear_modes

  !> The lowest modes of a reference system (`attrito_describe`) of a sector at one nodal diameter, x^H M x = 1: natural frequencies
  !> in Hz, damping ratios by the structure's own damping (0 of rigid-body modes) [count], shapes x = cosine - i sine in the sector's
  !> coordinates [count, m], and how many of them, the first, are rigid-body modes.
  integer(c_int) function attrito_diameter_modes(handle, kind, diameter, count, natural_hz, damping_ratio, cosine, sine, rigid, &
                                                 message, length) bind(c)
    !> Session of a sector, see `session_of`
    type(c_ptr), value :: handle
    !> Which system; nodal diameter; modes, at most as many as the sector has coordinates without its upper boundary; room for the
    !> message, characters
    integer(c_int), value :: kind, diameter, count, length
    !> Natural frequencies, Hz; damping ratios; shapes in the coordinates
    real(c_double), intent(out) :: natural_hz(count), damping_ratio(count), cosine(*), sine(*)
    !> Rigid-body modes among them
    integer(c_int), intent(out) :: rigid
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error
    complex(wp), allocatable :: shapes(:, :)
    integer :: found

    session => session_of(handle)
    allocate (shapes(size(session%structure%mass, 1), count))
    call modes_of_diameter(session%structure, session%contacts, int(kind), session%solver%closed, int(diameter), natural_hz, &
                           damping_ratio, shapes, found, error)
    attrito_diameter_modes = report_error(error, message)
    if (allocated(error)) return
    natural_hz = natural_hz/two_pi
    rigid = min(found, int(count))
    cosine(:size(shapes)) = reshape(real(shapes, wp), [size(shapes)])
    sine(:size(shapes)) = reshape(-aimag(shapes), [size(shapes)])
  end function attrito_diameter_modes
end module attrito_api_linear
