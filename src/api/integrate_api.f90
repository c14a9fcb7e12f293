!> C interface of time integration: a handle on the reduced scene, runs on it, and what each run has left.
!>
!> Arrays are C's: the last index runs fastest, so a Fortran array here has its dimensions the other way round.
module attrito_api_integrate
  use, intrinsic :: iso_c_binding
  use attrito_core_communicator, only: communicator_type, own_communicator
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_petsc_session, only: start_petsc
  use attrito_model_contacts, only: contacts_type, new_contacts
  use attrito_model_structure, only: structure_type
  use attrito_integrate_loading, only: new_profile
  use attrito_integrate_run, only: run_options_type, orbit_type, integrate
  use attrito_integrate_state, only: state_type, new_state, normal_force
  use attrito_integrate_static_path, only: start_at_end_of_path
  use attrito_integrate_system, only: system_type, new_system
  use attrito_api_message, only: report_error
  use attrito_api_session, only: contact_law_type, law_of, release_laws
  implicit none
  private
  public :: scene_type, options_type, report_type

  type :: session_type
    type(structure_type) :: structure
    type(contacts_type) :: contacts
    type(system_type) :: system
    type(orbit_type) :: orbit
    !> Start: modal displacement, its rate by the clock, sliders
    real(wp), allocatable :: motion(:), rate(:), slider(:, :)
  end type session_type

  type, bind(c) :: scene_type
    integer(c_int) :: size, contacts, rows, statics, coefficients, monitors, damping_kind
    real(c_double) :: damping_value
    !> [m, m]; damping and the matrix of Coriolis forces may be null
    type(c_ptr) :: mass, stiffness, damping, gyroscopic
    !> [m], or null: one ratio of all modes of the stuck system
    type(c_ptr) :: damping_ratios
    !> [contacts], [rows, m], [statics, m], [coefficients, m], [monitors, m]
    type(c_ptr) :: laws, directions, static_loads, harmonic_load, monitor_rows
  end type scene_type

  !> See `run_options_type`
  type, bind(c) :: options_type
    integer(c_int) :: scheme, steps_per_period, cycles, fewest, multiples, samples, whole_run, static_knots, harmonic_knots
    real(c_double) :: omega, level, dissipation, tolerance
    !> [statics], [knots, 2]
    type(c_ptr) :: static_factors, static_profile, harmonic_profile
  end type options_type

  !> See `orbit_type`
  type, bind(c) :: report_type
    integer(c_int) :: outcome, reason, period, cycles, events, chatter, samples
    real(c_double) :: defect, contraction, amplitude, work, damping, seconds
  end type report_type

contains

  !> A session on a scene at rest, unloaded.
  integer(c_int) function attrito_integrator_create(scene, handle, message, length) result(status) bind(c)
    !> Reduced scene, as C hands it over
    type(scene_type), intent(in) :: scene
    !> Session of the integrator
    type(c_ptr), intent(out) :: handle
    !> Room for the message, characters
    integer(c_int), value :: length
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(contact_law_type), pointer :: laws(:)
    real(c_double), pointer :: ratios(:)
    type(error_type), allocatable :: error
    integer :: i

    allocate (session)
    handle = c_loc(session)
    associate (structure => session%structure, m => scene%size)
      structure%mass = matrix(scene%mass, m, m)
      structure%stiffness = matrix(scene%stiffness, m, m)
      structure%damping_kind = scene%damping_kind
      structure%damping_value = scene%damping_value
      if (c_associated(scene%damping)) structure%damping = matrix(scene%damping, m, m)
      if (c_associated(scene%damping_ratios)) then
        call c_f_pointer(scene%damping_ratios, ratios, [m])
        structure%damping_ratios = ratios
      end if
      ! A row of C's is a column here.
      if (c_associated(scene%gyroscopic)) structure%gyroscopic = transpose(matrix(scene%gyroscopic, m, m))
      structure%static_loads = matrix(scene%static_loads, m, scene%statics)
      structure%harmonic_load = matrix(scene%harmonic_load, m, scene%coefficients)
      structure%monitors = matrix(scene%monitor_rows, m, scene%monitors)
      call c_f_pointer(scene%laws, laws, [scene%contacts])
      session%contacts = new_contacts([(law_of(laws(i)), i=1, scene%contacts)], matrix(scene%directions, m, scene%rows))
    end associate
    call new_system(session%structure, session%contacts, session%system, error)
    status = report_error(error, message)
    if (allocated(error)) return
    allocate (session%motion(scene%size), session%rate(scene%size), session%slider(2, scene%contacts), source=0.0_wp)
  end function attrito_integrator_create

  !> Start from the end of a static load path [corners, statics], followed from rest with given sliders [contacts, 2] (or null: 0).
  integer(c_int) function attrito_integrator_start_static(handle, statics, corners, path, steps, slider, message, length) &
    result(status) bind(c)
    !> Session, see `session_of`; sliders at the start of the period
    type(c_ptr), value :: handle, slider
    !> Number of static loads; how many there are; number of steps; room for the message, characters
    integer(c_int), value :: statics, corners, steps, length
    !> Factors on the static loads, by load and corner
    real(c_double), intent(in) :: path(statics, corners)
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error
    type(communicator_type) :: own

    own = own_communicator()
    call c_f_pointer(handle, session)
    session%slider = 0.0_wp
    if (c_associated(slider)) session%slider = matrix(slider, 2, size(session%contacts%law))
    session%rate = 0.0_wp
    call start_petsc(own%handle, error)
    if (.not. allocated(error)) call start_at_end_of_path(session%structure, session%contacts, session%system, path, steps, &
                                                          session%motion, session%slider, error)
    status = report_error(error, message)
  end function attrito_integrator_start_static

  !> Start from a state in the scene's coordinates: displacement [m], velocity [m], sliders [contacts, 2].
  subroutine attrito_integrator_start(handle, size_of_scene, displacement, velocity, slider) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of coordinates
    integer(c_int), value :: size_of_scene
    !> Displacement or velocity of the coordinates; sliders at the start of the period
    real(c_double), intent(in) :: displacement(size_of_scene), velocity(size_of_scene), slider(2, *)
    type(session_type), pointer :: session

    call c_f_pointer(handle, session)
    session%motion = matmul(displacement, session%system%weighted)
    session%rate = matmul(velocity, session%system%weighted)/session%system%clock
    session%slider = slider(:, :size(session%contacts%law))
  end subroutine attrito_integrator_start

  !> The state as it stands, after the start or the last run.
  subroutine attrito_integrator_state(handle, size_of_scene, displacement, velocity, slider) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of coordinates
    integer(c_int), value :: size_of_scene
    !> Displacement or velocity of the coordinates; sliders at the start of the period
    real(c_double), intent(out) :: displacement(size_of_scene), velocity(size_of_scene), slider(2, *)
    type(session_type), pointer :: session

    call c_f_pointer(handle, session)
    displacement = matmul(session%system%modes, session%motion)
    velocity = matmul(session%system%modes, session%rate)*session%system%clock
    slider(:, :size(session%contacts%law)) = session%slider
  end subroutine attrito_integrator_state

  !> How many contacts carry a normal force as it stands.
  integer(c_int) function attrito_integrator_touching(handle) result(touching) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session
    type(state_type) :: state
    integer :: i

    call c_f_pointer(handle, session)
    state = new_state(session%system, session%motion, session%rate, session%slider)
    touching = count([(normal_force(session%system, state, i) > 0.0_wp, i=1, size(session%contacts%law))])
  end function attrito_integrator_touching

  !> Integrate until steady; the session then stands at the end of the run.
  integer(c_int) function attrito_integrator_run(handle, options, report, message, length) result(status) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Options, as C hands them over
    type(options_type), intent(in) :: options
    !> What is found
    type(report_type), intent(out) :: report
    !> Room for the message, characters
    integer(c_int), value :: length
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error
    integer(c_int64_t) :: from, to, ticks

    call c_f_pointer(handle, session)
    call system_clock(from, ticks)
    call integrate(session%system, options_of(options, size(session%structure%static_loads, 2)), session%motion, session%rate, &
                   session%slider, session%orbit, error)
    call system_clock(to)
    status = report_error(error, message)
    if (allocated(error)) return
    associate (orbit => session%orbit)
      session%motion = orbit%state%motion
      session%rate = orbit%state%rate
      session%slider = orbit%state%slider
      report = report_type(orbit%outcome, orbit%reason, orbit%period, orbit%cycles, orbit%events, orbit%chatter, &
                           orbit%recorded%taken, orbit%defect, orbit%contraction, orbit%amplitude, orbit%recorded%work, &
                           orbit%recorded%damping, real(to - from, wp)/real(ticks, wp))
    end associate
  end function attrito_integrator_run

  !> Measures of the recorded period: monitors [monitors, 3] mean, lowest, highest; mean force of rows [rows]; contacts
  !> [contacts, 5] shares of stick, slip, open, smallest normal force, energy dissipated a period of the excitation.
  subroutine attrito_integrator_measures(handle, monitors, forces, contacts) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Coefficients of monitors, or monitors; results, in the order of the comment
    real(c_double), intent(out) :: monitors(3, *), forces(*), contacts(5, *)
    type(session_type), pointer :: session
    integer :: i

    call c_f_pointer(handle, session)
    associate (recorded => session%orbit%recorded)
      do i = 1, size(recorded%low)
        monitors(:, i) = [recorded%integral(i)/recorded%time, recorded%low(i), recorded%high(i)]
      end do
      forces(:size(recorded%force_integral)) = recorded%force_integral/recorded%time
      do i = 1, size(recorded%friction)
        contacts(:3, i) = recorded%time_in(:, i)/recorded%time
        contacts(4:, i) = [recorded%lowest_normal(i), recorded%friction(i)/max(1, session%orbit%period)]
      end do
    end associate
  end subroutine attrito_integrator_measures

  !> Samples: seconds [samples], monitors [samples, monitors], displacement and force of rows [samples, rows], regimes
  !> [samples, contacts].
  subroutine attrito_integrator_samples(handle, time, monitors, displacement, force, regime) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    real(c_double), intent(out) :: time(*), monitors(*), displacement(*), force(*)
    !> Regime: stick, slip or open
    integer(c_int), intent(out) :: regime(*)
    type(session_type), pointer :: session
    integer :: n

    call c_f_pointer(handle, session)
    associate (recorded => session%orbit%recorded)
      n = recorded%taken
      time(:n) = recorded%time_of(:n)
      monitors(:n*size(recorded%monitor, 1)) = reshape(recorded%monitor(:, :n), [n*size(recorded%monitor, 1)])
      displacement(:n*size(recorded%force, 1)) = reshape(recorded%displacement(:, :n), [n*size(recorded%force, 1)])
      force(:n*size(recorded%force, 1)) = reshape(recorded%force(:, :n), [n*size(recorded%force, 1)])
      regime(:n*size(recorded%regime, 1)) = reshape(recorded%regime(:, :n), [n*size(recorded%regime, 1)])
    end associate
  end subroutine attrito_integrator_samples

  !> Give everything back.
  subroutine attrito_integrator_destroy(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    call c_f_pointer(handle, session)
    call release_laws(session%contacts%law)
    deallocate (session)
  end subroutine attrito_integrator_destroy

  function options_of(given, statics) result(options)
    !> Options, as C hands them over
    type(options_type), intent(in) :: given
    !> Number of static loads
    integer, intent(in) :: statics
    type(run_options_type) :: options

    options%omega = given%omega
    options%level = given%level
    options%static_factors = reshape(matrix(given%static_factors, statics, 1), [statics])
    options%static_profile = new_profile(matrix(given%static_profile, 2, given%static_knots))
    options%harmonic_profile = new_profile(matrix(given%harmonic_profile, 2, given%harmonic_knots))
    options%scheme = given%scheme
    options%steps_per_period = given%steps_per_period
    options%dissipation = given%dissipation
    options%cycles = given%cycles
    options%fewest = given%fewest
    options%multiples = given%multiples
    options%tolerance = given%tolerance
    options%samples = given%samples
    options%whole_run = given%whole_run /= 0
  end function options_of

  !> A copy of a C array [columns, rows].
  function matrix(address, rows, columns) result(copy)
    !> Address of the array in C
    type(c_ptr), intent(in) :: address
    !> How many there are
    integer, intent(in) :: rows, columns
    real(wp) :: copy(rows, columns)
    real(c_double), pointer :: there(:, :)

    if (size(copy) == 0) return
    call c_f_pointer(address, there, [rows, columns])
    copy = there
  end function matrix
end module attrito_api_integrate
