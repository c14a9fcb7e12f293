!> Schemes of fixed steps against the event-exact integration: their orders on smooth motion and on stick-slip; their equilibria; two
!> tangents.
program test_integrate_schemes
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi
  use attrito_core_lapack, only: solve_dense
  use attrito_integrate_equilibrium, only: newton_step
  use attrito_integrate_exponential, only: exponential_weights
  use attrito_integrate_run, only: run_options_type, orbit_type
  use attrito_integrate_schemes, only: scheme_event, scheme_central_difference, scheme_newmark, scheme_hht, &
                                       scheme_generalised_alpha, scheme_exponential
  use attrito_integrate_system, only: system_type
  use attrito_model_contacts, only: contact_type, new_contacts
  use attrito_model_structure, only: damping_ratio
  use integrations, only: choices, run_from_path, displacement_of
  use scenes, only: scene_type, wedge, damp, damp_as_modes_ratio
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: schemes(5) = [scheme_central_difference, scheme_newmark, scheme_hht, scheme_generalised_alpha, &
                                      scheme_exponential]
  character(*), parameter :: names(5) = [character(19) :: 'central difference', 'Newmark', 'HHT', 'generalised alpha', &
                                         'exponential']

  call run_in_session('integrate_schemes', [ &
                test('every scheme is of second order on smooth motion', smooth_order), &
                test('a contact that slips leaves its mass free, however stiff it is', slip_of_stiff_contact), &
                test('a slow mode behind an open stiff contact is hardly damped', slow_motion_of_open_contact), &
                test('every scheme is close to second order on stick-slip', stick_slip_order), &
                test('a step that eliminates contacts that slip or open alone is that of all rows', active_forces), &
                test('a second tangent that nothing moves changes nothing', idle_tangent), &
                test('with two tangents the steps converge in second order', two_tangent_order), &
                test('a damping ratio is the viscous damping of the stuck modes', ratio)])

contains

  !> Displacement after some periods from the static state.
  function after(scene, frequency_hz, level, scheme, steps, periods) result(q)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: frequency_hz, level
    integer, intent(in) :: scheme, steps, periods
    real(wp), allocatable :: q(:)
    type(run_options_type) :: options
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(error_type), allocatable :: error
    real(wp) :: slider(2, size(scene%contacts%law))

    options = choices(scene, frequency_hz, level)
    options%cycles = periods - 1
    options%fewest = options%cycles
    options%multiples = 1
    options%scheme = scheme
    options%steps_per_period = steps
    slider = 0.0_wp
    call run_from_path(scene, options, [1.0_wp], slider, system, orbit, error)
    allocate (q(size(scene%structure%mass, 1)), source=0.0_wp)
    if (.not. allocated(error)) q = displacement_of(system, orbit)
  end function after

  !> A force f + Lambda p, which takes the mode's spring back, leaves p'' = f: motion and rate at the end of a step in closed form.
  subroutine slip_of_stiff_contact(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: h = 0.3_wp, motion = 0.7_wp, rate = -0.4_wp, f = 1.9_wp, eigenvalues(3) = [2.0e1_wp, 3.0e4_wp, 5.0e6_wp]
    real(wp) :: weights(4, 2, size(eigenvalues)), moved, reached, state(4)
    integer :: r

    weights = exponential_weights(eigenvalues, 0.0_wp*eigenvalues, h)
    moved = motion + h*rate + 0.5_wp*h**2*f
    do r = 1, size(eigenvalues)
      state = [motion, rate, f + eigenvalues(r)*motion, f]
      ! The force at the end holds the displacement at the end.
      reached = dot_product(weights(:, 1, r), state)/(1.0_wp - eigenvalues(r)*weights(4, 1, r))
      call check_close(error, reached, moved, 1.0e-7_wp*moved, 'displacement')
      if (allocated(error)) return
      state(4) = f + eigenvalues(r)*moved
      call check_close(error, dot_product(weights(:, 2, r), state), rate + h*f, 1.0e-6_wp, 'rate')
      if (allocated(error)) return
    end do
  end subroutine slip_of_stiff_contact

  !> A force (Lambda - 1) p leaves p'' + p = 0 of a fast mode: by the determinant of its step, exp(-2 zeta h), it is damped by no more
  !> than 0.01 h/2, and does not grow.
  subroutine slow_motion_of_open_contact(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: h = 2.0_wp*pi/64.0_wp, eigenvalues(3) = [1.0e4_wp, 1.0e6_wp, 1.0e8_wp]
    real(wp) :: weights(4, 2, size(eigenvalues)), step(2, 2), state(4), damping
    integer :: r, i

    weights = exponential_weights(eigenvalues, 0.0_wp*eigenvalues, h)
    do r = 1, size(eigenvalues)
      associate (taken => eigenvalues(r) - 1.0_wp)
        do i = 1, 2
          state = [merge(1.0_wp, 0.0_wp, i == 1), merge(1.0_wp, 0.0_wp, i == 2), merge(taken, 0.0_wp, i == 1), 0.0_wp]
          step(1, i) = dot_product(weights(:3, 1, r), state(:3))/(1.0_wp - taken*weights(4, 1, r))
          state(4) = taken*step(1, i)
          step(2, i) = dot_product(weights(:, 2, r), state)
        end do
      end associate
      damping = -0.5_wp*log(step(1, 1)*step(2, 2) - step(1, 2)*step(2, 1))/h
      call check(error, damping >= -1.0e-9_wp .and. damping <= 1.01_wp*0.005_wp*h, 'damping of a slow mode')
      if (allocated(error)) return
    end do
  end subroutine slow_motion_of_open_contact

  !> Errors at 200, 400, ... steps a period, and the order of their fall over the whole.
  subroutine measure_order(scene, level, scheme, coarsest, order, finest)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: level
    integer, intent(in) :: scheme, coarsest
    real(wp), intent(out) :: order, finest
    real(wp), allocatable :: exact(:)
    real(wp) :: errors(2)
    integer, parameter :: finer = 16

    exact = after(scene, 132.0_wp, level, scheme_event, 0, 4)
    errors(1) = norm2(after(scene, 132.0_wp, level, scheme, coarsest, 4) - exact)
    errors(2) = norm2(after(scene, 132.0_wp, level, scheme, finer*coarsest, 4) - exact)
    order = log(errors(1)/errors(2))/log(real(finer, wp))
    finest = errors(2)/norm2(exact)
  end subroutine measure_order

  subroutine smooth_order(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: order, finest
    type(scene_type) :: scene
    integer :: i

    scene = wedge(45.0_wp)
    ! Pressed so that it stays stuck.
    scene%contacts%law%preload = 1.0e3_wp
    do i = 1, size(schemes)
      call measure_order(scene, 5.0_wp, schemes(i), 100, order, finest)
      print '(7x,a,a,f6.2,a,es9.2)', names(i), ': order', order, ', error at 1600 steps', finest
      call check_close(error, order, 2.0_wp, 0.1_wp, trim(names(i))//': order')
    end do
  end subroutine smooth_order

  subroutine stick_slip_order(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: order, finest
    integer :: i

    do i = 1, size(schemes)
      call measure_order(wedge(45.0_wp), 15.0_wp, schemes(i), 200, order, finest)
      print '(7x,a,a,f6.2,a,es9.2)', names(i), ': order', order, ', error at 3200 steps', finest
      call check(error, order > 1.8_wp .and. finest < 1.0e-5_wp, trim(names(i))//' does not converge')
    end do
  end subroutine stick_slip_order

  !> Three contacts, one tangent, two and one: the first slips, the second does or opens, the last sticks. Rounding of two
  !> eliminations of seven rows whose matrices have condition numbers of order one: some 1e-15 of the step.
  subroutine active_forces(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 7
    type(system_type) :: system
    real(wp) :: compliance(n, n), stiffness(3, n), residual(n), step(n), derivative(n, n), whole(n, n), right(n, 1)
    integer :: i, j, open, info

    system%law = [contact_type(tangents=1, first_row=1), contact_type(tangents=2, first_row=3), &
                  contact_type(tangents=1, first_row=6)]
    do i = 1, n
      residual(i) = sin(3.0_wp*i)
      do j = 1, n
        compliance(i, j) = 0.3_wp/(1.0_wp + abs(i - j))
      end do
    end do
    do open = 0, 1
      stiffness = 0.0_wp
      stiffness(:2, 1) = [-0.9_wp, 0.4_wp]
      stiffness(:, 3) = merge([-1.0_wp, 0.0_wp, 0.0_wp], [-0.7_wp, 0.2_wp, 0.3_wp], open == 1)
      stiffness(:, 4) = merge([0.0_wp, -1.0_wp, 0.0_wp], [0.2_wp, -0.8_wp, -0.1_wp], open == 1)
      stiffness(:, 5) = merge([0.0_wp, 0.0_wp, -1.2_wp], [0.0_wp, 0.0_wp, 0.0_wp], open == 1)
      call newton_step(system, compliance, stiffness, residual, step, info)
      derivative = 0.0_wp
      derivative(1:2, 1:2) = transpose(stiffness(:2, 1:2))
      derivative(3:5, 3:5) = transpose(stiffness(:, 3:5))
      whole = matmul(compliance, derivative)
      do i = 1, n
        whole(i, i) = whole(i, i) + 1.0_wp
      end do
      right(:, 1) = -residual
      call solve_dense(whole, right, j)
      call check(error, info == 0 .and. j == 0, 'singular')
      call check_close(error, step, right(:, 1), 1.0e-14_wp*norm2(step), 'step')
    end do
    call newton_step(system, compliance, 0.0_wp*stiffness, residual, step, info)
    call check_close(error, step, -residual, 0.0_wp, 'step where all stick')
  end subroutine active_forces

  !> The wedge as it is, and with a third coordinate along a second tangent.
  subroutine idle_tangent(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: flat, deep
    real(wp), allocatable :: two(:), three(:)

    flat = wedge(45.0_wp)
    deep = with_depth()
    two = after(flat, 132.0_wp, 15.0_wp, scheme_exponential, 400, 4)
    three = after(deep, 132.0_wp, 15.0_wp, scheme_exponential, 400, 4)
    call check_close(error, three(:2), two, 1.0e-13_wp*maxval(abs(two)), 'displacement')
    call check_close(error, three(3), 0.0_wp, 0.0_wp, 'depth')
  end subroutine idle_tangent

  !> The wedge with a third coordinate, along a second tangent of its contact.
  function with_depth() result(deep)
    type(scene_type) :: deep
    type(contact_type) :: law
    real(wp) :: eye(3, 3), rows(3, 3)

    deep = wedge(45.0_wp)
    law = deep%contacts%law(1)
    law%tangents = 2
    eye = reshape([1, 0, 0, 0, 1, 0, 0, 0, 1]*1.0_wp, [3, 3])
    rows = 0.0_wp
    rows(:2, [1, 3]) = deep%contacts%directions
    rows(3, 2) = 1.0_wp
    deep%contacts = new_contacts([law], rows)
    associate (s => deep%structure)
      s%stiffness = reshape([s%stiffness(:, 1), 0.0_wp, s%stiffness(:, 2), 0.0_wp, 0.0_wp, 0.0_wp, 6.0e5_wp], [3, 3])
      s%mass = eye
      s%damping = 20.0_wp*pi*eye
      s%static_loads = reshape([s%static_loads, 0.0_wp], [3, 1])
      s%harmonic_load = reshape([s%harmonic_load(:, 1), 0.0_wp, s%harmonic_load(:, 2), 0.0_wp, s%harmonic_load(:, 3), 0.0_wp], [3, 3])
      s%monitors = eye
    end associate
  end function with_depth

  subroutine two_tangent_order(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), allocatable :: exact(:)
    real(wp) :: errors(2), order

    scene = with_depth()
    ! A load that turns in the plane of contact, so that slip changes its direction.
    scene%structure%harmonic_load(3, 3) = 1.0_wp
    exact = after(scene, 132.0_wp, 15.0_wp, scheme_event, 0, 4)
    errors(1) = norm2(after(scene, 132.0_wp, 15.0_wp, scheme_exponential, 100, 4) - exact)
    errors(2) = norm2(after(scene, 132.0_wp, 15.0_wp, scheme_exponential, 1600, 4) - exact)
    order = log(errors(1)/errors(2))/log(16.0_wp)
    print '(7x,a,f6.2,a,es9.2)', 'two tangents: order', order, ', error at 1600 steps', errors(2)/norm2(exact)
    call check(error, abs(order - 2.0_wp) < 0.2_wp .and. errors(2) < 1.0e-5_wp*norm2(exact), 'it does not converge')
  end subroutine two_tangent_order

  subroutine ratio(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, viscous
    real(wp), allocatable :: q(:)

    scene = wedge(45.0_wp)
    scene%contacts%law%tangential_stiffness = 2.0e5_wp
    viscous = scene
    call damp(scene, damping_ratio, 0.05_wp)
    viscous%structure%damping = damp_as_modes_ratio(viscous, 0.05_wp)
    q = after(scene, 132.0_wp, 30.0_wp, scheme_event, 0, 4)
    call check_close(error, after(viscous, 132.0_wp, 30.0_wp, scheme_event, 0, 4), q, 1.0e-12_wp*maxval(abs(q)), 'displacement')
  end subroutine ratio
end program test_integrate_schemes
