!> C interface of the solver: an opaque handle, a status (0 done, 1 the numerics, 2 the input, 3 a file) and a message.
!>
!> Arrays are C's: the last index runs fastest, so a Fortran array here has its dimensions the other way round.
module attrito_api_solver
  use, intrinsic :: iso_c_binding
  use attrito_core_communicator, only: new_communicator
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_petsc_session, only: start_petsc, stop_petsc
  use attrito_core_trigonometric, only: extrema
  use attrito_model_sector, only: new_sector
  use attrito_model_contacts, only: contact_type, contacts_type, new_contacts, slider_width
  use attrito_contact_instants, only: forces_at_instants
  use attrito_contact_given_path, only: follow_path
  use attrito_continuation_sweep, only: new_sweep
  use attrito_solve_strategies, only: solve_by_strategy
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_solve_strategy_table, only: strategy_type, strategies
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_rebalancing, only: field_type, rebalance
  use attrito_solve_solver, only: solver_options_type, new_solver
  use attrito_integrate_averaged_periods, only: new_averaged_periods
  use attrito_solve_static_path, only: follow_static_path
  use attrito_accuracy_point_errors, only: no_tolerance
  use attrito_output_point_report, only: point_report_type, report_point
  use attrito_stability_crossing, only: moduli_type
  use attrito_api_message, only: report_error, text_of
  use attrito_api_session, only: session_type, session_of, contact_law_type, law_of, release_laws
  implicit none
  private
  public :: options_type, point_type, point_of

  type, bind(c) :: options_type
    integer(c_int) :: harmonics, samples, rounds, max_iterations, reset_slider, uncoupled
    integer(c_int) :: choose_harmonics
    !> May starts come from integration in time?
    integer(c_int) :: integrate_in_time
    !> `accepted_error`: 0 where none is promised; `curve_tolerance`: error of the drawn curve, part of the largest amplitude
    real(c_double) :: tolerance, accepted_error, mode_error, curve_tolerance
  end type options_type

  type, bind(c) :: point_type
    integer(c_int) :: branch, iterations, linear_iterations, outcome, unique, finished, reached_stop
    integer(c_int) :: states(4), harmonics, samples, petsc_error
    real(c_double) :: frequency_hz, level, residual, estimate, error_harmonics, error_samples, error_modes, work
  end type point_type

  !> Rows of contacts up to which an implicit step in time, an elimination of all of them, is worth its cost
  integer, parameter :: most_rows_in_time = 400 ! guess

contains

  !> A session on a structure of m coordinates.
  function attrito_create(comm, m, mass, stiffness, damping_kind, damping_value, damping) result(handle) bind(c)
    !> MPI communicator; how many there are; kind of damping: see `attrito_describe`
    integer(c_int), value :: comm, m, damping_kind
    !> Mass matrix; stiffness matrix
    real(c_double), intent(in) :: mass(m, m), stiffness(m, m)
    !> Value of the damping, by its kind
    real(c_double), value :: damping_value
    !> [m, m], or null unless the damping is viscous
    type(c_ptr), value :: damping
    type(c_ptr) :: handle
    type(session_type), pointer :: session
    real(c_double), pointer :: matrix(:, :)

    allocate (session)
    session%ranks = new_communicator(comm)
    session%structure%mass = mass
    session%structure%stiffness = stiffness
    session%structure%damping_kind = damping_kind
    session%structure%damping_value = damping_value
    if (c_associated(damping)) then
      call c_f_pointer(damping, matrix, [m, m])
      session%structure%damping = matrix
    end if
    handle = c_loc(session)
  end function attrito_create

  !> A damping ratio of each mode of the stuck system, ascending in frequency, in place of one of all.
  subroutine attrito_set_damping_ratios(handle, m, ratios) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of coordinates
    integer(c_int), value :: m
    !> zeta_r
    real(c_double), intent(in) :: ratios(m)
    type(session_type), pointer :: session

    session => session_of(handle)
    session%structure%damping_ratios = ratios
  end subroutine attrito_set_damping_ratios

  !> Coriolis forces at the speed of rotation, G [m, m], -G^T = G: a row of C's is a column here.
  subroutine attrito_set_gyroscopic(handle, m, gyroscopic) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of coordinates
    integer(c_int), value :: m
    !> Matrix of the Coriolis forces
    real(c_double), intent(in) :: gyroscopic(m, m)
    type(session_type), pointer :: session

    session => session_of(handle)
    session%structure%gyroscopic = transpose(gyroscopic)
  end subroutine attrito_set_gyroscopic

  !> Loads and monitors: static loads [static_count, m], harmonic load [coefficients, m], monitors [monitor_count, m].
  subroutine attrito_set_loads(handle, static_count, static_loads, coefficients, harmonic_load, monitor_count, monitors) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> How many there are; coefficients of each row, 2 H + 1
    integer(c_int), value :: static_count, coefficients, monitor_count
    !> Loads on the coordinates; coefficients of monitors, or monitors
    real(c_double), intent(in) :: static_loads(*), harmonic_load(*), monitors(*)
    type(session_type), pointer :: session
    integer :: m

    session => session_of(handle)
    m = size(session%structure%mass, 1)
    session%structure%static_loads = reshape(static_loads(:m*static_count), [m, static_count])
    session%structure%harmonic_load = reshape(harmonic_load(:m*coefficients), [m, coefficients])
    session%structure%monitors = reshape(monitors(:m*monitor_count), [m, monitor_count])
  end subroutine attrito_set_loads

  !> Contacts and their rows of B [rows, m], each contact's tangents before its normal.
  subroutine attrito_set_contacts(handle, count, laws, rows, directions) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of items; how many there are
    integer(c_int), value :: count, rows
    !> Contact laws
    type(contact_law_type), intent(in) :: laws(count)
    !> Directions of contact rows in the coordinates
    real(c_double), intent(in) :: directions(*)
    type(session_type), pointer :: session
    integer :: m, i

    session => session_of(handle)
    m = size(session%structure%mass, 1)
    session%contacts = new_contacts([(law_of(laws(i)), i=1, count)], reshape(directions(:m*rows), [m, rows]))
  end subroutine attrito_set_contacts

  !> The model is one of N equal sectors, q_{j+1}(t) = q_j(t - EO T / N): its boundaries, what it has on the axis, and its contacts'
  !> rows on the next sector [rows, m], after those on its own.
  subroutine attrito_set_sector(handle, sectors, engine_order, count, lower, upper, number_along, along, pairs, across, rows, &
                                next_directions) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> N; EO; coordinates of a boundary, of nodes on the axis along it, and in pairs across it; how many rows there are
    integer(c_int), value :: sectors, engine_order, count, number_along, pairs, rows
    !> Coordinates of the lower and of the upper boundary, in pairs, from 0
    integer(c_int), intent(in) :: lower(count), upper(count)
    !> Coordinates of nodes on the axis, from 0: along it, and across it in pairs, the second a quarter turn ahead
    integer(c_int), intent(in) :: along(number_along), across(2, pairs)
    !> Directions of contact rows in the next sector's coordinates
    real(c_double), intent(in) :: next_directions(*)
    type(session_type), pointer :: session
    integer :: m

    session => session_of(handle)
    m = size(session%structure%mass, 1)
    session%structure%sector = new_sector(int(sectors), int(engine_order), int(lower) + 1, int(upper) + 1, &
                                          reshape(next_directions(:m*rows), [m, rows]), int(along) + 1, int(across) + 1)
  end subroutine attrito_set_sector

  !> Make the session ready to solve.
  integer(c_int) function attrito_prepare(handle, options, message, length) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Options, as C hands them over
    type(options_type), intent(in) :: options
    !> Room for the message, characters
    integer(c_int), value :: length
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error

    session => session_of(handle)
    call start_petsc(session%ranks%handle, error)
    attrito_prepare = report_error(error, message)
    if (allocated(error)) return
    call new_solver(session%structure, session%contacts, session%ranks, solver_options_type( &
                    harmonics=options%harmonics, samples=options%samples, rounds=options%rounds, &
                    max_iterations=options%max_iterations, reset_slider=options%reset_slider /= 0, &
                    uncoupled=options%uncoupled /= 0, &
                    tolerance=options%tolerance), &
                    session%solver, error)
    attrito_prepare = report_error(error, message)
    session%accuracy%series%tolerance = merge(options%accepted_error, no_tolerance, options%accepted_error > 0.0_c_double)
    session%accuracy%series%choose_harmonics = options%choose_harmonics /= 0
    session%accuracy%series%fewest_harmonics = max((size(session%structure%harmonic_load, 2) - 1)/2, 1)
    session%accuracy%errors%modes = options%mode_error
    session%curve_tolerance = options%curve_tolerance
    if (allocated(error)) return
    ! A sector is coupled to its own motion at another time: no march follows it.
    if (options%integrate_in_time == 0 .or. allocated(session%structure%sector)) return
    if (size(session%contacts%directions, 2) > most_rows_in_time) return
    allocate (session%solver%time_integrator, source=new_averaged_periods(session%structure, session%contacts))
  end function attrito_prepare

  !> Give the contacts other laws of the same stiffnesses and directions: modes stay. The static path is to be followed next.
  subroutine attrito_change_laws(handle, count, laws) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of items
    integer(c_int), value :: count
    !> Contact laws
    type(contact_law_type), intent(in) :: laws(count)
    type(session_type), pointer :: session
    type(contacts_type) :: before
    integer :: i

    session => session_of(handle)
    before = session%contacts
    call session%solver%change_laws([(law_of(laws(i)), i=1, count)])
    session%contacts = session%solver%contacts
    ! It has the laws of before.
    if (allocated(session%in_time)) deallocate (session%in_time)
    if (allocated(session%waves)) deallocate (session%waves)
    if (allocated(session%wheel)) deallocate (session%wheel)
    if (allocated(session%solver%time_integrator)) then
      deallocate (session%solver%time_integrator)
      allocate (session%solver%time_integrator, source=new_averaged_periods(session%structure, session%contacts))
    end if
    call release_laws(before%law)
  end subroutine attrito_change_laws

  !> Follow the static load path [corners, static loads]; receptances are those of an angular frequency.
  integer(c_int) function attrito_follow_static_path(handle, loads, corners, path, steps, omega, point, message, length) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of static loads; how many there are; number of steps; room for the message, characters
    integer(c_int), value :: loads, corners, steps, length
    !> Factors on the static loads, by load and corner
    real(c_double), intent(in) :: path(loads, corners)
    !> Angular frequency, rad/s
    real(c_double), value :: omega
    !> Point, reported
    type(point_type), intent(out) :: point
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error

    session => session_of(handle)
    call follow_static_path(session%solver, path, steps, omega, error)
    call report_point(session%solver, session%solver%report, 0, session%accuracy%errors, no_tolerance, session%point)
    point = point_of(session%point)
    attrito_follow_static_path = report_error(error, message)
  end function attrito_follow_static_path

  !> Begin a sweep of the harmonic loads at a level between two angular frequencies.
  subroutine attrito_begin_sweep(handle, start, stop, level, branch, max_points) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Angular frequencies of both ends of the range, rad/s; factor on the harmonic loads
    real(c_double), value :: start, stop, level
    !> Number of the branch; most points
    integer(c_int), value :: branch, max_points
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%solver%set_loads(session%solver%context%balance%static_factors, level)
    session%sweep = new_sweep(session%solver, start, stop, branch, max_points)
    session%sweep%stepper%tolerance = session%curve_tolerance
    session%moduli = moduli_type()
  end subroutine attrito_begin_sweep

  !> Steps of the sweep that begins are parts of a wider range than its own, as of a sweep from within a band to one of its ends.
  subroutine attrito_scale_sweep(handle, low, high) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Angular frequencies of both ends of that range, rad/s
    real(c_double), value :: low, high
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%solver%set_scales(low, high)
  end subroutine attrito_scale_sweep

  !> The next point of the sweep.
  subroutine attrito_next_point(handle, point) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Point, reported
    type(point_type), intent(out) :: point
    type(session_type), pointer :: session

    session => session_of(handle)
    session%moduli(1) = session%moduli(2)
    session%moduli(2) = moduli_type()
    call session%accuracy%advance(session%sweep, session%solver)
    call report_point(session%solver, session%solver%report, session%sweep%branch, session%accuracy%errors, &
                      session%accuracy%series%tolerance, session%point)
    call session%point%take_curve(session%sweep%stepper%here, session%sweep%stepper%path)
    point = point_of(session%point)
    point%finished = merge(1, 0, session%sweep%finished)
    point%reached_stop = merge(1, 0, session%sweep%reached_stop)
  end subroutine attrito_next_point

  !> A point at an angular frequency.
  subroutine attrito_solve_at(handle, omega, branch, point) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Angular frequency, rad/s
    real(c_double), value :: omega
    !> Number of the branch
    integer(c_int), value :: branch
    !> Point, reported
    type(point_type), intent(out) :: point
    type(session_type), pointer :: session
    type(field_type) :: none(0)
    real(wp) :: before

    session => session_of(handle)
    call rebalance(session%solver, none)
    before = session%solver%omega
    call session%accuracy%solve_at(session%solver, omega)
    session%solver%omega = omega
    call report_point(session%solver, session%solver%report, branch, session%accuracy%errors, session%accuracy%series%tolerance, &
                      session%point)
    if (.not. (session%solver%report%converged .or. session%solver%evidence%is_drifting)) session%solver%omega = before
    point = point_of(session%point)
  end subroutine attrito_solve_at

  !> A point at an angular frequency by one fallback strategy alone; the session's last point stays the one before, whether that
  !> found a point or not. 0, or 1: there is no strategy of that name.
  integer(c_int) function attrito_solve_by_strategy(handle, strategy, omega, point) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> One of the strategies' names
    character(kind=c_char), intent(in) :: strategy(*)
    !> Angular frequency, rad/s
    real(c_double), value :: omega
    !> Point, reported
    type(point_type), intent(out) :: point
    type(session_type), pointer :: session
    type(snapshot_type) :: before
    type(strategy_type), allocatable :: table(:)
    type(evidence_type) :: evidence
    integer :: number

    session => session_of(handle)
    table = strategies()
    number = findloc(table%name == text_of(strategy), .true., 1)
    attrito_solve_by_strategy = merge(0, 1, number > 0)
    if (number == 0) return
    before = snapshot_of(session%solver)
    evidence = session%solver%evidence
    call solve_by_strategy(session%solver, table(number), omega)
    session%solver%omega = omega
    call report_point(session%solver, session%solver%report, 0, session%accuracy%errors, no_tolerance, session%point)
    call restore(session%solver, before)
    session%solver%evidence = evidence
    point = point_of(session%point)
  end function attrito_solve_by_strategy

  !> Coefficients of the monitors [monitors, 2 H + 1] and their amplitudes at the last point; how these change along a sweep there, 0
  !> where that is not known.
  subroutine attrito_monitors(handle, harmonics, amplitude, rate) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Coefficients of the monitors; amplitudes of the monitors, and their change by the length along the branch
    real(c_double), intent(out) :: harmonics(*), amplitude(*), rate(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    harmonics(:size(session%point%harmonics)) = reshape(session%point%harmonics, [size(session%point%harmonics)])
    amplitude(:size(session%point%amplitude)) = session%point%amplitude
    rate(:size(session%point%amplitude)) = 0.0_c_double
    if (session%point%curve%is_known()) rate(:size(session%point%amplitude)) = session%point%curve%amplitude_rate
  end subroutine attrito_monitors

  !> Which contacts the last static path has left closed: 1, or 0 [contacts].
  subroutine attrito_closed_contacts(handle, closed) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> By contact
    integer(c_int), intent(out) :: closed(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    closed(:size(session%solver%closed)) = merge(1, 0, session%solver%closed)
  end subroutine attrito_closed_contacts

  !> Start the libraries on all ranks that will ever use them together; where they run, nothing happens. Whatever solves on one rank
  !> alone before all of them do asks for it.
  integer(c_int) function attrito_start(comm, message, length) bind(c)
    !> MPI communicator; room for the message, characters
    integer(c_int), value :: comm, length
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(error_type), allocatable :: error

    call start_petsc(comm, error)
    attrito_start = report_error(error, message)
  end function attrito_start

  !> The last call of a process, before MPI ends.
  subroutine attrito_stop() bind(c)

    call stop_petsc()
  end subroutine attrito_stop

  !> Give everything back.
  subroutine attrito_destroy(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%accuracy%destroy()
    call session%finer_estimator%destroy()
    call session%solver%destroy()
    if (allocated(session%contacts%law)) call release_laws(session%contacts%law)
    deallocate (session)
  end subroutine attrito_destroy

  !> Displacement and force [tangents + 1, instants] of one contact over a period, for its coefficients [tangents + 1, coefficients]
  !> and sliders at its start [at least 2 elements].
  subroutine attrito_contact_at_instants(law, coefficients, instants, motion, slider, displacement, force) bind(c)
    !> Contact laws
    type(contact_law_type), intent(in) :: law
    !> Coefficients of each row, 2 H + 1; how many instants, equally spaced from the period's start on
    integer(c_int), value :: coefficients, instants
    !> Coefficients of relative displacement, by harmonic and row; sliders at the start of the period
    real(c_double), intent(in) :: motion(coefficients, law%tangents + 1), slider(*)
    !> Displacement or velocity of the coordinates; contact forces
    real(c_double), intent(out) :: displacement(instants, law%tangents + 1), force(instants, law%tangents + 1)
    type(contact_type) :: contact(1)

    contact(1) = law_of(law)
    call forces_at_instants(contact(1), motion, slider(:2*contact(1)%elements()), displacement, force)
    call release_laws(contact)
  end subroutine attrito_contact_at_instants

  !> Tangential force [samples] of one contact along a given path of displacement and normal force: `follow_path`.
  subroutine attrito_follow_path(law, samples, displacement, normal, passes, force) bind(c)
    !> Contact laws
    type(contact_law_type), intent(in) :: law
    !> How many there are; marches over them
    integer(c_int), value :: samples, passes
    !> Relative displacement; normal force
    real(c_double), intent(in) :: displacement(samples), normal(samples)
    !> Tangential force
    real(c_double), intent(out) :: force(samples)
    type(contact_type) :: contact(1)

    contact(1) = law_of(law)
    call follow_path(contact(1), displacement, normal, passes, force)
    call release_laws(contact)
  end subroutine attrito_follow_path

  !> How many numbers the sliders of a contact take where contacts have these laws: a pair for each element.
  integer(c_int) function attrito_slider_width(count, laws) bind(c)
    !> Number of items
    integer(c_int), value :: count
    !> Contact laws
    type(contact_law_type), intent(in) :: laws(count)
    type(contact_type) :: contacts(count)
    integer :: i

    contacts = [(law_of(laws(i)), i=1, count)]
    attrito_slider_width = slider_width(contacts)
    call release_laws(contacts)
  end function attrito_slider_width

  !> Smallest and largest value over the period of trigonometric polynomials [count, coefficients]: [count] each.
  subroutine attrito_extrema(count, coefficients, polynomials, lowest, highest) bind(c)
    !> Number of items; coefficients of each row, 2 H + 1
    integer(c_int), value :: count, coefficients
    !> Coefficients, one polynomial after the other
    real(c_double), intent(in) :: polynomials(coefficients, count)
    !> Extreme values over the period
    real(c_double), intent(out) :: lowest(count), highest(count)
    real(wp) :: range(2)
    integer :: i

    do i = 1, count
      range = extrema(polynomials(:, i))
      lowest(i) = range(1)
      highest(i) = range(2)
    end do
  end subroutine attrito_extrema

  pure function point_of(report) result(point)
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    type(point_type) :: point

    point = point_type(report%branch, report%iterations, report%linear_iterations, report%findings%outcome(), report%unique, 0, 0, &
                       report%states, report%series, report%samples, report%petsc_error, report%frequency_hz, report%level, &
                       report%residual, report%errors%all(), report%errors%harmonics, 0.0_c_double, &
                       report%errors%modes, report%work)
  end function point_of
end module attrito_api_solver
