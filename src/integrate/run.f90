!> An integration from its start to its steady state, and what is reported of it.
module attrito_integrate_run
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp, two_pi
  use attrito_integrate_flow, only: flow_one_period
  use attrito_integrate_loading, only: loading_type, new_loading, profile_type, last_knot
  use attrito_integrate_march, only: march_one_period
  use attrito_integrate_recorder, only: recorder_type, new_recorder
  use attrito_integrate_schemes, only: scheme_type, new_scheme, start_scheme, scheme_event
  use attrito_integrate_segment, only: segment_type, new_segment
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_steady, only: steady_type, new_steady, compare, is_settling, is_diverging
  use attrito_integrate_system, only: system_type
  use attrito_integrate_taylor, only: degree
  use attrito_solve_outcomes, only: outcome_converged, outcome_no_period_one_orbit, outcome_not_converged
  implicit none
  private
  public :: run_options_type, orbit_type, integrate
  public :: reason_none, reason_settling, reason_step, reason_diverged

  !> Why it has not converged: it was still settling, an implicit step was not solved, the motion grows without bound
  integer, parameter :: reason_none = 0, reason_settling = 1, reason_step = 2, reason_diverged = 3

  type :: run_options_type
    !> Angular frequency, rad/s, and level of the harmonic load
    real(wp) :: omega = two_pi, level = 1.0_wp
    !> Final factors on the static loads [loads]; profiles multiply them
    real(wp), allocatable :: static_factors(:)
    type(profile_type) :: static_profile, harmonic_profile
    !> One of `scheme_...`, and for all but the event-exact one
    integer :: scheme = scheme_event, steps_per_period = 0
    !> See `new_scheme`
    real(wp) :: dissipation = -1.0_wp
    !> Most cycles before the period that is measured; fewest, steady or not; longest period looked for
    integer :: cycles = 400, fewest = 0, multiples = 4
    real(wp) :: tolerance = 1.0e-10_wp
    !> Samples per period of the recorded history; the whole run, or its last period only
    integer :: samples = 256
    logical :: whole_run = .false.
  end type run_options_type

  !> What came of it
  type :: orbit_type
    integer :: outcome = outcome_not_converged
    !> Why it has not converged, one of `reason_...`
    integer :: reason = reason_none
    !> Multiple of the excitation's period, 0: none
    integer :: period = 0
    integer :: cycles = 0
    !> Relative change over the period; ratio of the last two changes
    real(wp) :: defect = huge(1.0_wp), contraction = huge(1.0_wp)
    !> Half range of the motion in the norm of the mass matrix
    real(wp) :: amplitude = 0.0_wp
    !> Events in the recorded period; cut short over the whole run
    integer :: events = 0, chatter = 0
    type(recorder_type) :: recorded
    !> Where it ended, and where the recorded period began
    type(state_type) :: state
  end type orbit_type

contains

  !> Integrate until steady, then once more over the period with everything measured.
  subroutine integrate(system, options, motion, rate, slider, orbit, error)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> How to solve
    type(run_options_type), intent(in) :: options
    !> Start: modal displacement, its rate by the clock [m], sliders [2, contacts]
    real(wp), intent(in) :: motion(:), rate(:), slider(:, :)
    !> What came of it
    type(orbit_type), intent(out) :: orbit
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(loading_type) :: loading
    type(scheme_type) :: scheme
    type(segment_type) :: segment
    type(steady_type) :: steady
    real(wp) :: low(size(motion)), high(size(motion))
    integer :: cycle
    logical :: converged, finite

    call check_scheme(system, options%scheme, error)
    if (allocated(error)) return
    loading = loading_of(system, options)
    orbit%state = new_state(system, motion, rate, slider)
    segment = new_segment(size(motion), size(system%springs), size(system%law), merge(degree, 3, options%scheme == scheme_event))
    if (options%scheme /= scheme_event) call begin_scheme(system, options, loading, orbit%state, scheme)
    call begin_record(system, options, orbit%recorded)
    steady = new_steady(system, options%multiples, options%cycles, options%tolerance)
    ! Without cycles the one period that is measured is all that is marched.
    converged = .true.
    finite = .true.
    do cycle = 1, options%cycles
      call one_period()
      finite = is_finite(orbit%state)
      if (.not. (converged .and. finite)) exit
      if (orbit%state%cycle*loading%period < last_knot(loading)*system%clock) cycle
      call compare(steady, system, orbit%state, loading%nu, low, high, is_driven(loading))
      if (steady%period > 0 .and. cycle >= options%fewest) exit
    end do
    orbit%cycles = min(cycle, options%cycles)
    call judge(steady, converged, finite, orbit)
    if (.not. (converged .and. finite)) return
    orbit%recorded%measures = .true.
    orbit%recorded%samples = .true.
    orbit%events = orbit%state%events
    do cycle = 1, max(1, orbit%period)
      call one_period()
    end do
    orbit%events = orbit%state%events - orbit%events
    orbit%chatter = orbit%state%chatter

  contains

    subroutine one_period()
      if (options%scheme /= scheme_event) then
        call march_one_period(system, loading, scheme, orbit%state, segment, orbit%recorded, low, high, converged)
      else
        call flow_one_period(system, loading, orbit%state, segment, orbit%recorded, low, high)
        converged = .true.
      end if
    end subroutine one_period
  end subroutine integrate

  !> Fault of the input unless contacts can be marched by a scheme.
  subroutine check_scheme(system, scheme, error)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> One of `scheme_...`
    integer, intent(in) :: scheme
    !> Allocated: what is at fault
    type(error_type), allocatable, intent(out) :: error

    if (scheme /= scheme_event) return
    if (.not. all(system%law%is_proportional())) then
      call raise(error, 'scheme event: a contact law that is not proportional to the normal force has no closed form in slip:'// &
                 ' expected another scheme', fault_of_input)
    end if
  end subroutine check_scheme

  !> A scheme of constant steps, from a state.
  subroutine begin_scheme(system, options, loading, state, scheme)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> How to solve
    type(run_options_type), intent(in) :: options
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Steps in time
    type(scheme_type), intent(out) :: scheme

    call new_scheme(system, options%scheme, options%steps_per_period, loading%period, options%dissipation, scheme)
    call start_scheme(scheme, system, loading, state)
  end subroutine begin_scheme

  !> Static and harmonic loads over time.
  function loading_of(system, options) result(loading)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> How to solve
    type(run_options_type), intent(in) :: options
    type(loading_type) :: loading

    loading = new_loading(options%omega, system%clock, matmul(system%static_loads, options%static_factors), &
                          options%level*system%harmonic_load, options%static_profile, options%harmonic_profile)
  end function loading_of

  !> Room for the history that is asked for: of the whole run, or of its last period.
  subroutine begin_record(system, options, recorder)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> How to solve
    type(run_options_type), intent(in) :: options
    !> What is recorded
    type(recorder_type), intent(out) :: recorder
    integer :: room

    room = options%samples*merge(options%cycles + options%multiples, options%multiples, options%whole_run)
    recorder = new_recorder(system, options%samples, room)
    recorder%samples = options%whole_run
  end subroutine begin_record

  !> Does a harmonic load act in the end?
  pure logical function is_driven(loading)
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading

    is_driven = any(abs(loading%harmonic) > 0.0_wp) .and. &
                abs(loading%harmonic_profile%factor(size(loading%harmonic_profile%factor))) > 0.0_wp
  end function is_driven

  !> Is the state made of numbers that can go on? Those that overflow, or are none, cannot.
  pure logical function is_finite(state)
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state

    is_finite = all(abs(state%motion) <= huge(1.0_wp)) .and. all(abs(state%rate) <= huge(1.0_wp)) .and. &
                all(abs(state%slider) <= huge(1.0_wp))
  end function is_finite

  !> Name what came of it.
  pure subroutine judge(steady, converged, finite, orbit)
    !> Changes from period to period
    type(steady_type), intent(in) :: steady
    !> Was every step solved; has every number stayed finite?
    logical, intent(in) :: converged, finite
    !> What came of it
    type(orbit_type), intent(inout) :: orbit

    orbit%amplitude = steady%amplitude
    orbit%reason = reason_settling
    if (.not. converged) orbit%reason = reason_step
    if (.not. finite) then
      orbit%reason = reason_diverged
      orbit%amplitude = huge(1.0_wp)
    end if
    if (.not. (converged .and. finite) .or. steady%periods < 2) return
    orbit%period = steady%period
    orbit%defect = steady%defect(max(1, steady%period))
    if (orbit%cycles >= 2) then
      associate (last => steady%history(orbit%cycles), before => steady%history(orbit%cycles - 1))
        if (before < huge(1.0_wp) .and. before > 0.0_wp) orbit%contraction = last/before
      end associate
    end if
    if (steady%period == 1) then
      orbit%outcome = outcome_converged
    else if (steady%period > 1) then
      orbit%outcome = outcome_no_period_one_orbit
    else if (is_diverging(steady, orbit%cycles)) then
      orbit%reason = reason_diverged
    else if (.not. is_settling(steady, orbit%cycles)) then
      orbit%outcome = outcome_no_period_one_orbit
    end if
    if (orbit%outcome /= outcome_not_converged) orbit%reason = reason_none
  end subroutine judge
end module attrito_integrate_run
