!> Peaks followed without sweeps: derivatives of the amplitude and of the condition, against differences.
program test_peak
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: extrema
  use attrito_contact_state, only: state_slipping
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_peak_amplitude, only: amplitude_type, amplitude_of, half_range, first_harmonic
  use attrito_peak_condition, only: problem_type, direction_type, linearisation_type, linearise, value_of, set_value, &
                                    parameter_level, parameter_preload
  use attrito_peak_curve, only: curve_type
  use attrito_peak_first_peak, only: begin_curve
  use scenes, only: scene_type, wedge, rubbing_frame, damp, noise
  use attrito_model_structure, only: damping_ratio, damping_viscous
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  call run_in_session('peak', [ &
                      test('the amplitude is half the range, its derivatives those of differences', amplitude), &
                      test('the condition''s derivatives are those of differences, by events, in level and preload', by_events), &
                      test('the condition''s derivatives are those of differences, by samples and with two tangents', by_samples), &
                      test('a peak of the wedge is a maximum between its neighbours', neighbours)])

contains

  subroutine amplitude(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: step = 1.0e-5_wp
    type(amplitude_type) :: here, ahead, behind
    real(wp) :: c(9), way(9), range(2)
    integer :: seed, measure

    do seed = 1, 6
      do measure = half_range, first_harmonic
        c = noise(9, seed)
        way = noise(9, 50 + seed)
        here = amplitude_of(c, measure)
        ahead = amplitude_of(c + step*way, measure)
        behind = amplitude_of(c - step*way, measure)
        range = extrema(c)
        call check_close(error, here%value, merge(0.5_wp*(range(2) - range(1)), norm2(c(2:3)), measure == half_range), 1.0e-14_wp, &
                         'value')
        ! Differences are wrong by step^2 times derivatives that grow with the inverse curvature at an extremum.
        call check_close(error, dot_product(here%gradient, way), (ahead%value - behind%value)/(2.0_wp*step), 1.0e-7_wp, 'gradient')
        call check_close(error, matmul(here%curvature, way), (ahead%gradient - behind%gradient)/(2.0_wp*step), 1.0e-6_wp, 'curvature')
      end do
    end do
  end subroutine amplitude

  !> Prepare a scene with a monitor, at a level and a frequency, off any solution.
  subroutine prepare(scene, options, level, omega, solver)
    type(scene_type), intent(in) :: scene
    type(solver_options_type), intent(in) :: options
    real(wp), intent(in) :: level, omega
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), options, solver, fault)
    call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 4, omega, fault)
    call solver%set_loads([1.0_wp], level)
    call solver%set_scales(0.9_wp*omega, 1.1_wp*omega)
    call solver%solve_at(omega)
  end subroutine prepare

  !> psi' along the three directions against differences of psi.
  subroutine check_condition(error, solver, parameter, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type), intent(inout) :: solver
    integer, intent(in) :: parameter
    real(wp), intent(in) :: tolerance
    character(*), intent(in) :: what
    type(problem_type) :: problem
    type(linearisation_type) :: here
    type(direction_type) :: way
    real(wp) :: given(2), slopes(2), scale
    integer :: i, status

    problem%parameter = parameter
    problem%static_factors = [1.0_wp]
    allocate (problem%border%motion, mold=solver%motion)
    problem%border%motion = 0.1_wp*reshape(noise(size(solver%motion), 9), shape(solver%motion))/norm2(solver%motion)
    problem%border%frequency = 1.0_wp/solver%omega
    call linearise(problem, solver, here, status)
    call check(error, status == 0, what//': it can be linearised')
    if (status /= 0) return
    do i = 1, 2
      way = here%along
      if (i == 2) way = here%by_parameter
      slopes(i) = merge(here%slope_along, here%slope_parameter, i == 1)
      given(i) = difference(solver, problem, way)
    end do
    scale = maxval(abs(slopes))
    call check_close(error, slopes/scale, given/scale, tolerance, what)
  end subroutine check_condition

  !> Central difference of psi along a direction of the unknowns.
  real(wp) function difference(solver, problem, way)
    type(solver_type), intent(inout) :: solver
    type(problem_type), intent(in) :: problem
    type(direction_type), intent(in) :: way
    type(linearisation_type) :: moved
    real(wp), allocatable :: motion(:, :), slider(:, :)
    real(wp) :: omega, value, step
    integer :: side, status

    motion = solver%motion
    slider = solver%context%balance%slider
    omega = solver%omega
    value = value_of(problem, solver)
    step = 1.0e-5_wp/(norm2(way%step%motion)/norm2(motion) + abs(way%step%omega)/omega + abs(way%parameter)/value)
    difference = 0.0_wp
    do side = -1, 1, 2
      solver%motion = motion + side*step*way%step%motion
      solver%omega = omega + side*step*way%step%omega
      solver%context%balance%slider = slider + side*step*merge(way%step%slider, 0.0_wp, spread(solver%context%balance%periodic, 1, 2))
      if (abs(way%parameter) > 0.0_wp) call set_value(problem, solver, value + side*step*way%parameter)
      call linearise(problem, solver, moved, status)
      difference = difference + side*moved%slope/(2.0_wp*step)
    end do
    solver%motion = motion
    solver%omega = omega
    solver%context%balance%slider = slider
    call set_value(problem, solver, value)
  end function difference

  subroutine by_events(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp), parameter :: levels(3) = [9.0_wp, 20.0_wp, 40.0_wp]
    integer :: i, parameter

    do i = 1, size(levels)
      call prepare(wedge(45.0_wp), solver_options_type(), levels(i), two_pi*125.0_wp, solver)
      call check(error, solver%report%converged .and. solver%context%balance%forces(1)%state == state_slipping, 'it slips')
      do parameter = parameter_level, parameter_preload
        ! Differences of first derivatives: wrong by 1e-10 times a third derivative, relative, that switches make large.
        call check_condition(error, solver, parameter, 1.0e-6_wp, 'wedge')
      end do
      call solver%destroy()
    end do
  end subroutine by_events

  subroutine by_samples(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(scene_type) :: scene

    scene = rubbing_frame()
    deallocate (scene%structure%monitors)
    scene%structure%monitors = reshape(noise(8, 11), [8, 1])
    call damp(scene, damping_viscous, 0.02_wp)
    call prepare(scene, solver_options_type(samples=512), 2.0_wp, 1.1_wp, solver)
    call check(error, solver%report%converged, 'solved')
    ! Of samples psi is smooth but for switches that pass from one to the next: its kinks leave a part of 1/samples each.
    call check_condition(error, solver, parameter_level, 2.0e-2_wp, 'frame, damped by a matrix')
    call solver%destroy()
    call damp(scene, damping_ratio, 0.02_wp)
    call prepare(scene, solver_options_type(samples=512), 2.0_wp, 1.1_wp, solver)
    call check_condition(error, solver, parameter_level, 2.0e-2_wp, 'frame, damped by a ratio')
    call solver%destroy()
  end subroutine by_samples

  subroutine neighbours(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(curve_type) :: curve
    type(linearisation_type) :: here
    real(wp) :: peak, omega
    integer :: side, status

    call prepare(wedge(45.0_wp), solver_options_type(), 8.0_wp, two_pi*132.473_wp, solver)
    call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 4, two_pi*132.0_wp, error)
    if (allocated(error)) return
    call solver%set_loads([1.0_wp], 8.0_wp)
    call solver%set_scales(two_pi*150.0_wp, two_pi*85.0_wp)
    call begin_curve(solver, problem_type(static_factors=[1.0_wp]), two_pi*132.473_wp, two_pi*[85.0_wp, 150.0_wp], curve)
    call check(error, curve%found .and. curve%curvature() < 0.0_wp, 'a maximum')
    peak = curve%point%amplitude%value
    omega = solver%omega
    do side = -1, 1, 2
      call solver%solve_at(omega*(1.0_wp + 1.0e-4_wp*side))
      call linearise(curve%problem, solver, here, status)
      call check(error, here%amplitude%value < peak, 'lower beside')
      ! Second order: half the curvature times the step squared; the third derivative adds a part of some 1e-4/bandwidth (0.05).
      call check_close(error, (here%amplitude%value - peak)/(0.5_wp*curve%curvature()*(1.0e-4_wp*omega)**2), 1.0_wp, 2.0e-2_wp, &
                       'by its curvature')
    end do
    call solver%destroy()
  end subroutine neighbours
end program test_peak
