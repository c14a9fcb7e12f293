!> Entries for benchmarks and tests, beside those of the C interface: processor time of the parts of a Newton iteration at the present
!> point of a session, and evaluations so far. In a library of their own, which is not installed.
module attrito_bench_kernels
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: extrema
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_disc_rules, only: new_disc_rules
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_newton_border, only: constraint_type
  use attrito_newton_linearised_step, only: solve_linearised
  use attrito_balance_stuck_response, only: linear_motion, recover_loaded
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_output_point_report, only: monitored
  use attrito_api_session, only: session_type, session_of, contact_law_type, law_of, release_laws
  implicit none
  private

contains

  !> Make the stuck system's response to the harmonic loads at a level the present point: contacts that slip there depend on no solve.
  !> Static loads are whole, sliders zero. Not 0: the stuck system is singular.
  integer(c_int) function attrito_bench_set_stuck_response(handle, omega, level) result(status) bind(c)
    type(c_ptr), value :: handle
    real(c_double), value :: omega, level
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (solver => session%solver, balance => session%solver%context%balance)
      call solver%set_loads(spread(1.0_wp, 1, size(balance%static_factors)), level)
      call solver%set_slider(0.0_wp*solver%static_slider)
      call balance%receptance%set_frequency(omega, status)
      if (status /= 0) return
      solver%motion = linear_motion(balance)
      solver%omega = omega
    end associate
  end function attrito_bench_set_stuck_response

  !> Residual and Jacobian at the present point: mean seconds of an evaluation, norm of the residual relative to that of the motion,
  !> and the rows of the Jacobian that are not zero. Collective; times of this rank.
  integer(c_int) function attrito_bench_time_residual(handle, repeats, seconds, residual, active) result(status) bind(c)
    type(c_ptr), value :: handle
    integer(c_int), value :: repeats
    real(c_double), intent(out) :: seconds, residual
    integer(c_int), intent(out) :: active
    type(session_type), pointer :: session
    real(wp) :: started
    integer :: i

    session => session_of(handle)
    associate (balance => session%solver%context%balance)
      started = clock()
      do i = 1, repeats
        call balance%evaluate(session%solver%motion, session%solver%omega, status)
        if (status /= 0) exit
      end do
      seconds = (clock() - started)/repeats
      residual = norm2(balance%residual)/max(norm2(session%solver%motion), tiny(1.0_wp))
      active = sum([(count(balance%forces(i)%active), i=1, size(balance%forces))])
    end associate
    call session%solver%context%forget()
  end function attrito_bench_time_residual

  !> One linearised step at the present point, frequency held: mean seconds of a solve, and iterations of GMRES. Collective; times of
  !> this rank.
  integer(c_int) function attrito_bench_time_newton_step(handle, repeats, seconds, iterations) result(status) bind(c)
    type(c_ptr), value :: handle
    integer(c_int), value :: repeats
    real(c_double), intent(out) :: seconds
    integer(c_int), intent(out) :: iterations
    type(session_type), pointer :: session
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step
    real(wp) :: started
    integer :: i

    session => session_of(handle)
    associate (balance => session%solver%context%balance, motion => session%solver%motion)
      call balance%evaluate(motion, session%solver%omega, status)
      if (status /= 0) return
      right = new_unknowns(shape(motion), shape(balance%slider))
      step = right
      constraint%motion = right%motion
      right%motion = motion
      started = clock()
      do i = 1, repeats
        call solve_linearised(balance, constraint, right, session%solver%context%linear, step, iterations, status)
        if (status /= 0) exit
      end do
      seconds = (clock() - started)/repeats
    end associate
    call session%solver%context%forget()
  end function attrito_bench_time_newton_step

  !> A linear frequency response that recovers every contact row, every contact stuck: mean seconds a frequency, at the harmonics that
  !> are loaded. Collective; times of this rank.
  integer(c_int) function attrito_bench_time_linear_response(handle, omega, repeats, seconds) result(status) bind(c)
    type(c_ptr), value :: handle
    real(c_double), value :: omega
    integer(c_int), value :: repeats
    real(c_double), intent(out) :: seconds
    type(session_type), pointer :: session
    real(wp), allocatable :: moving(:, :)
    real(wp) :: started
    integer :: i

    session => session_of(handle)
    associate (balance => session%solver%context%balance)
      started = clock()
      do i = 1, repeats
        call balance%receptance%set_frequency(omega*(1.0_wp + 1.0e-6_wp*i), status, balance%highest_load())
        if (status /= 0) exit
        moving = recover_loaded(balance, balance%linear_response())
      end do
      seconds = (clock() - started)/repeats
    end associate
    call session%solver%context%forget()
  end function attrito_bench_time_linear_response

  !> The linear response at a frequency, reported as a point of a sweep is: rows of all contacts recovered, coefficients of the
  !> monitors [monitors, 2 H + 1] and their amplitudes. 0, or not: it is singular there.
  integer(c_int) function attrito_bench_linear_response(handle, omega, harmonics, amplitude) result(status) bind(c)
    type(c_ptr), value :: handle
    real(c_double), value :: omega
    real(c_double), intent(out) :: harmonics(*), amplitude(*)
    type(session_type), pointer :: session
    real(wp), allocatable :: moving(:, :), coefficients(:, :)
    real(wp) :: range(2)
    integer :: m

    session => session_of(handle)
    associate (balance => session%solver%context%balance)
      call balance%receptance%set_frequency(omega, status, balance%highest_load())
      if (status /= 0) return
      balance%response = balance%linear_response()
      moving = recover_loaded(balance, balance%response)
      coefficients = monitored(balance, balance%highest_load())
    end associate
    call session%solver%context%forget()
    harmonics(:size(coefficients)) = reshape(coefficients, [size(coefficients)])
    do m = 1, size(coefficients, 2)
      range = extrema(coefficients(:, m))
      amplitude(m) = 0.5_wp*(range(2) - range(1))
    end do
  end function attrito_bench_linear_response

  !> Forces and Jacobian of one contact for coefficients [tangents + 1, coefficients]: mean seconds of an evaluation, and the fraction
  !> of the period that it does not stick; two tangents marched once as a periodic slider, or twice.
  subroutine attrito_bench_time_contact(law, coefficients, motion, periodic, repeats, seconds, moving) bind(c)
    type(contact_law_type), intent(in) :: law
    integer(c_int), value :: coefficients, periodic, repeats
    real(c_double), intent(in) :: motion(coefficients, law%tangents + 1)
    real(c_double), intent(out) :: seconds, moving
    type(contact_type) :: contact(1)
    type(quadrature_type) :: quadrature
    type(contact_forces_type) :: forces
    real(wp), parameter :: slider(2) = 0.0_wp
    real(wp) :: started
    integer :: i

    contact(1) = law_of(law)
    quadrature = quadrature_type(new_grid((coefficients - 1)/2), new_disc_rules((coefficients - 1)/2))
    allocate (forces%deviation(coefficients, law%tangents + 1))
    started = clock()
    do i = 1, repeats
      call evaluate_contact(contact(1), quadrature, motion, slider, periodic /= 0, forces)
    end do
    seconds = (clock() - started)/repeats
    moving = forces%slip + forces%open
    call release_laws(contact)
  end subroutine attrito_bench_time_contact

  !> Evaluations of the balance since the session began: what solving costs, whatever the machine.
  integer(c_int) function attrito_bench_evaluations(handle) bind(c)
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    session => session_of(handle)
    attrito_bench_evaluations = session%solver%context%balance%evaluations
  end function attrito_bench_evaluations

  !> Leave fallback strategies out from now on, bit k for the k-th; 0: none.
  subroutine attrito_bench_leave_out(handle, strategies) bind(c)
    type(c_ptr), value :: handle
    integer(c_int), value :: strategies
    type(session_type), pointer :: session

    session => session_of(handle)
    session%solver%left_out = strategies
  end subroutine attrito_bench_leave_out

  !> Of this rank's processor: other work on the machine does not count.
  real(wp) function clock()

    call cpu_time(clock)
  end function clock
end module attrito_bench_kernels
