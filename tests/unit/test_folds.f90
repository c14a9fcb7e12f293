!> Folds and branches of an oscillator with a unilateral spring, in one harmonic, where the balance has a closed form.
!>
!> With x = x_0 + a cos(omega t - phi) and the spring's force max(kn (x - g), 0) beyond the gap g, cos theta = (g - x_0)/a,
!>
!>   x_0 + N_0 = f_0,  N_0 = kn (a sin theta - (g - x_0) theta)/pi,  N_1 = kn (a (theta + sin 2 theta/2) - 2 (g - x_0) sin theta)/pi,
!>   omega^2 = s:  (k - s)^2 + (2 zeta)^2 s = (F/a)^2,  k = 1 + N_1/a,
!>
!> so that frequency is a function of amplitude, and folds are where it is largest and smallest.
program test_folds
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_continuation_closed_branch, only: closes_on_itself
  use attrito_continuation_stored_points, only: stored_points_type
  use attrito_continuation_branch_seeds, only: start_cold, start_in_motion, start_from_preload
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: frequency_tangent
  use attrito_continuation_turning_point, only: turning_point_type, locate_turning_point
  use attrito_integrate_averaged_periods, only: new_averaged_periods
  use attrito_integrate_system, only: system_type
  use attrito_stability_crossing, only: crossing_type, moduli_type, moduli_of, locate_crossings, crossing_unit
  use attrito_stability_examine, only: examination_type, examine_options_type, examine, system_of, by_monodromy, balanced_orbit
  use scenes, only: scene_type, one_sided_oscillator
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  real(wp), parameter :: ratio = 0.01_wp, level = 0.1_wp
  !> Where three motions coexist, and their largest amplitude by far
  real(wp), parameter :: between = 1.12_wp, largest_amplitude = 6.0_wp

  !> Stiffness of the unilateral spring, where it begins, static load
  type :: spring_type
    real(wp) :: stiffness = 1.0_wp, gap = 0.5_wp, static = 0.0_wp
  end type spring_type

  call run_in_session('folds', [ &
                      test('both turning points lie where the closed form has its extrema', turning_points), &
                      test('multipliers cross 1 where the branch turns', crossing_at_fold), &
                      test('a solution is known on the branch that leads through it and on no other', stored_branches), &
                      test('a step closes a branch only if it passes its first point', closing), &
                      test('other starts come to solutions and leave loads as they were', starts)])

contains

  function solver_of(scene, harmonics, error) result(solver)
    type(scene_type), intent(in) :: scene
    integer, intent(in) :: harmonics
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), solver_options_type(harmonics=harmonics), solver, &
                    fault)
    if (.not. allocated(fault)) call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, 0.8_wp, fault)
    call check(error, .not. allocated(fault), 'no static equilibrium')
    allocate (solver%time_integrator, source=new_averaged_periods(scene%structure, scene%contacts))
    call solver%set_loads([1.0_wp], level)
    call solver%set_scales(0.8_wp, 1.6_wp)
  end function solver_of

  !> The mean and k + the spring's share at an amplitude.
  subroutine effective(spring, a, mean, stiffness)
    type(spring_type), intent(in) :: spring
    real(wp), intent(in) :: a
    real(wp), intent(out) :: mean, stiffness
    real(wp) :: low, high, theta
    integer :: i

    low = -2.0_wp*(a + 1.0_wp)
    high = -low
    do i = 1, 200
      mean = 0.5_wp*(low + high)
      theta = acos(min(max((spring%gap - mean)/a, -1.0_wp), 1.0_wp))
      if (mean + spring%stiffness/pi*(a*sin(theta) - (spring%gap - mean)*theta) > spring%static) then
        high = mean
      else
        low = mean
      end if
    end do
    stiffness = 1.0_wp + spring%stiffness/pi*(theta + 0.5_wp*sin(2.0_wp*theta) - 2.0_wp*(spring%gap - mean)/a*sin(theta))
  end subroutine effective

  !> Angular frequency at an amplitude, beyond resonance (way 1) or before it (-1); zero if there is none.
  real(wp) function frequency(spring, a, way)
    type(spring_type), intent(in) :: spring
    real(wp), intent(in) :: a
    integer, intent(in) :: way
    real(wp) :: mean, k, middle, square

    call effective(spring, a, mean, k)
    middle = k - 2.0_wp*ratio**2
    square = middle**2 - k**2 + (level/a)**2
    frequency = 0.0_wp
    if (square >= 0.0_wp) frequency = sqrt(max(middle + way*sqrt(square), 0.0_wp))
  end function frequency

  !> The largest (way 1) or smallest (-1) frequency beyond resonance within a range of amplitudes, by golden sections.
  real(wp) function extremum(way, from, to)
    integer, intent(in) :: way
    real(wp), intent(in) :: from, to
    real(wp), parameter :: golden = 0.6180339887498949_wp
    type(spring_type) :: spring
    real(wp) :: a, b, x(2), f(2)
    integer :: i

    a = from
    b = to
    do i = 1, 80
      x = [b - golden*(b - a), a + golden*(b - a)]
      f = [frequency(spring, x(1), 1), frequency(spring, x(2), 1)]
      if (way*f(1) > way*f(2)) then
        b = x(2)
      else
        a = x(1)
      end if
    end do
    extremum = frequency(spring, 0.5_wp*(a + b), 1)
  end function extremum

  !> The largest amplitude that there is, where both frequencies meet.
  real(wp) function highest_peak()
    type(spring_type) :: spring
    real(wp) :: low, high
    integer :: i

    low = 1.0_wp
    high = largest_amplitude
    do i = 1, 100
      highest_peak = 0.5_wp*(low + high)
      if (frequency(spring, highest_peak, 1) > 0.0_wp) then
        low = highest_peak
      else
        high = highest_peak
      end if
    end do
    highest_peak = low
  end function highest_peak

  subroutine turning_points(error)
    type(error_type), allocatable, intent(out) :: error
    type(turning_point_type) :: found(2)
    type(step_type) :: steps(2)
    type(stored_points_type) :: known
    real(wp) :: expected(2)
    integer :: i

    call sweep_past_folds(1, found, steps, known, error)
    if (allocated(error)) return
    expected = [extremum(1, 1.0_wp, highest_peak()), extremum(-1, 0.3_wp, 1.0_wp)]
    do i = 1, 2
      call check(error, found(i)%smooth, 'a smooth fold is taken for one of contact')
      ! Located to 1e-8 of the frequency, from points that are solved to 1e-10 of the response.
      call check_close(error, found(i)%snapshot%omega, expected(i), 2.0e-8_wp*expected(i), 'fold')
      call check(error, found(i)%uncertain <= 1.0e-8_wp*expected(i), 'it is not located as it should be')
    end do
  end subroutine turning_points

  !> Sweep up; the first two turning points, their steps, and all points.
  subroutine sweep_past_folds(harmonics, found, steps, known, error)
    integer, intent(in) :: harmonics
    type(turning_point_type), intent(out) :: found(2)
    type(step_type), intent(out) :: steps(2)
    type(stored_points_type), intent(inout) :: known
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    type(snapshot_type) :: here
    integer :: count

    solver = solver_of(one_sided_oscillator(1.0_wp, 0.5_wp, 0.0_wp, ratio), harmonics, error)
    if (allocated(error)) return
    sweep = new_sweep(solver, 0.8_wp, 1.6_wp, 1, 600)
    count = 0
    do while (.not. sweep%finished .and. count < 2)
      call sweep%advance(solver)
      call check(error, solver%report%converged, 'a point does not converge')
      if (allocated(error)) return
      call known%add(solver, known%count > 0)
      if (.not. sweep%stepper%last%is_taken() .or. solver%all_stick) cycle
      call sweep%look_ahead(solver)
      if (.not. sweep%stepper%turned) cycle
      count = count + 1
      here = snapshot_of(solver)
      steps(count) = sweep%stepper%last
      call restore(solver, steps(count)%from)
      call locate_turning_point(solver, steps(count), steps(count)%across, sweep%stepper%tangent, found(count))
      call restore(solver, here)
    end do
    call check(error, count == 2, 'the branch does not turn twice')
    call solver%destroy()
  end subroutine sweep_past_folds

  !> With 20 harmonics, so that the balance's orbit is one of motion in time but for harmonics that are not there.
  subroutine crossing_at_fold(error)
    type(error_type), allocatable, intent(out) :: error
    type(turning_point_type) :: found(2)
    type(step_type) :: steps(2)
    type(stored_points_type) :: known
    type(solver_type) :: solver
    type(system_type), allocatable :: system
    type(examine_options_type) :: options
    type(examination_type) :: examination
    type(moduli_type) :: moduli(2)
    type(crossing_type), allocatable :: crossings(:)
    integer :: i, end
    logical :: converged

    call sweep_past_folds(20, found, steps, known, error)
    solver = solver_of(one_sided_oscillator(1.0_wp, 0.5_wp, 0.0_wp, ratio), 20, error)
    if (allocated(error)) return
    options = examine_options_type(methods=by_monodromy, orbit=balanced_orbit)
    allocate (system)
    call system_of(solver, .false., 1.0_wp, system, error)
    if (allocated(error)) return
    do i = 1, 2
      do end = 1, 2
        call steps(i)%solve_part(solver, real(end - 1, wp), converged)
        call check(error, converged, 'an end of the step does not converge')
        call examine(solver, system, options, examination)
        call moduli_of(solver, examination, moduli(end))
      end do
      call locate_crossings(solver, system, options, steps(i), moduli, crossings)
      call check(error, size(crossings) == 1, 'there is not one crossing')
      if (allocated(error)) return
      call check(error, crossings(1)%kind == crossing_unit .and. (crossings(1)%loses .eqv. i == 1), 'it is another crossing')
      ! It is brought to 1 within 1e-3 at least (beyond, it would be a jump), for near a fold it goes like the root of the distance.
      call check_close(error, abs(crossings(1)%multiplier - 1.0_wp), 0.0_wp, 1.0e-3_wp, 'multiplier')
      ! On the balance's own orbit both are one place, located to 1e-8 and 1e-9 of the frequency.
      call check_close(error, crossings(1)%snapshot%omega, found(i)%snapshot%omega, 2.0e-8_wp, 'crossing at the fold')
    end do
    call solver%destroy()
  end subroutine crossing_at_fold

  !> Stand at the three motions of one frequency, by closed form: amplitudes ascending.
  subroutine start_from(solver, number, error)
    type(solver_type), intent(inout) :: solver
    integer, intent(in) :: number
    type(error_type), allocatable, intent(inout) :: error
    real(wp), parameter :: step = 1.0e-3_wp
    type(spring_type) :: spring
    real(wp) :: a, low, high, mean, k
    integer :: i, j, way, count

    count = 0
    do way = 1, -1, -2
      do i = 1, int(highest_peak()/step) - 1
        low = i*step
        high = low + step
        if (min(frequency(spring, low, way), frequency(spring, high, way)) <= 0.0_wp) cycle
        if ((frequency(spring, low, way) - between)*(frequency(spring, high, way) - between) > 0.0_wp) cycle
        count = count + 1
        if (count == number) exit
      end do
      if (count == number) exit
    end do
    call check(error, count == number, 'there are not so many motions')
    if (allocated(error)) return
    do j = 1, 60
      a = 0.5_wp*(low + high)
      if ((frequency(spring, a, way) - between)*(frequency(spring, low, way) - between) > 0.0_wp) then
        low = a
      else
        high = a
      end if
    end do
    call effective(spring, a, mean, k)
    solver%motion = 0.0_wp
    solver%motion(:, 2) = [mean, (k - between**2)*a**2/level, 2.0_wp*ratio*between*a**2/level]
    solver%all_stick = .false.
    call solver%solve_at(between)
    call check(error, solver%report%converged, 'the closed form is no solution')
    ! Solved to 1e-10 of the largest stuck response, which is level/(2 zeta) = 5.
    call check_close(error, norm2(solver%motion(2:, 2)), a, 1.0e-8_wp, 'amplitude')
  end subroutine start_from

  subroutine stored_branches(error)
    type(error_type), allocatable, intent(out) :: error
    type(turning_point_type) :: found(2)
    type(step_type) :: steps(2)
    type(stored_points_type) :: known
    type(solver_type) :: solver
    real(wp), allocatable :: motion(:, :)
    integer :: number, first_fold

    call sweep_past_folds(1, found, steps, known, error)
    solver = solver_of(one_sided_oscillator(1.0_wp, 0.5_wp, 0.0_wp, ratio), 1, error)
    if (allocated(error)) return
    first_fold = maxloc(known%points(:known%count)%omega, 1)
    call check(error, known%count > first_fold + 2, 'the branch does not come back: the test is void')
    do number = 1, 3
      call start_from(solver, number, error)
      if (allocated(error)) return
      motion = solver%motion
      ! The largest amplitude lies before the first fold, the middle one beyond it, the smallest beyond the second, not swept yet.
      call check(error, known%contains_solution(solver, first_fold) .eqv. number == 3, 'before the first fold')
      ! The last point is the end of the step that turns.
      call check(error, known%contains_solution(solver, known%count - 1) .eqv. number > 1, 'before the second fold')
      call check_close(error, solver%motion, motion, 0.0_wp, 'where it stands afterwards')
    end do
    call solver%destroy()
  end subroutine stored_branches

  subroutine closing(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: aside = 0.002_wp
    type(stored_points_type) :: home
    type(solver_type) :: solver
    type(step_type) :: step
    type(snapshot_type) :: from, here
    integer :: number

    solver = solver_of(one_sided_oscillator(1.0_wp, 0.5_wp, 0.0_wp, ratio), 1, error)
    if (allocated(error)) return
    call start_from(solver, 3, error)
    call home%add(solver, .false.)
    do number = 3, 1, -2
      call start_from(solver, number, error)
      call solver%solve_at(between - aside)
      from = snapshot_of(solver)
      call solver%solve_at(between - 0.5_wp*aside)
      here = snapshot_of(solver)
      call step%take(from, solver, frequency_tangent(solver, 1.0_wp))
      call check(error, .not. closes_on_itself(home, solver, step), 'a step that ends before the point closes the branch')
      call check_close(error, solver%omega, here%omega, 0.0_wp, 'where it stands')
      call solver%solve_at(between + aside)
      here = snapshot_of(solver)
      call step%take(from, solver, frequency_tangent(solver, 1.0_wp))
      call check(error, closes_on_itself(home, solver, step) .eqv. number == 3, 'a step past the point')
      call check_close(error, solver%omega, merge(between, here%omega, number == 3), 0.0_wp, 'where it stands afterwards')
    end do
    call solver%destroy()
  end subroutine closing

  !> Pressed upon its spring, with which it opens at large amplitudes.
  subroutine starts(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: omega = 1.1_wp, preload = 0.5_wp
    type(spring_type) :: spring
    type(solver_type) :: solver
    logical :: found
    real(wp) :: a, expected
    integer :: way

    solver = solver_of(one_sided_oscillator(1.0_wp, 0.0_wp, preload, ratio), 1, error)
    if (allocated(error)) return
    spring = spring_type(gap=-preload, static=preload)
    do way = 1, 4
      select case (way)
       case (1)
        call start_cold(solver, omega, found)
       case (2)
        call start_in_motion(solver, omega, 2.0_wp, found)
       case default
        call start_from_preload(solver, omega, merge(4.0_wp, 0.25_wp, way == 3), found)
      end select
      call check(error, found, 'a start comes to nothing')
      call check_close(error, solver%context%balance%static_factors, [1.0_wp], 0.0_wp, 'factors of the static loads')
      call check_close(error, solver%context%balance%level, level, 0.0_wp, 'level')
      if (allocated(error)) return
      a = norm2(solver%motion(2:, 2))
      expected = frequency(spring, a, 1)
      if (abs(frequency(spring, a, -1) - omega) < abs(expected - omega)) expected = frequency(spring, a, -1)
      ! Solved to 1e-10 of the response; the frequency changes by some a quarter of a relative change of the amplitude.
      call check_close(error, expected, omega, 1.0e-8_wp, 'frequency at the amplitude found')
    end do
    call solver%destroy()
  end subroutine starts
end program test_folds
