!> The drawn curve: its cubic, its length, its distance from points, and the changes of amplitudes that it is made of.
program test_curve
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_continuation_arc, only: arc_type, arc_length, hermite, hermite_slope
  use attrito_continuation_between, only: estimate_between
  use attrito_continuation_curve_point, only: curve_point_type, new_curve_point
  use attrito_continuation_predictor, only: predictor_type, prediction_type
  use attrito_continuation_step_length, only: next_length
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_continuation_tangent, only: tangent_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use scenes, only: scene_type, wedge
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  call run_in_session('curve', [ &
                      test('weights take values and changes of both ends, and are exact for cubics', cubics), &
                      test('an arc of a circle is met by the length of its chord and tangents', circles), &
                      test('a point off the arc has its distance across it, in every monitor', distances), &
                      test('a maximum between the ends is found where it is, and nowhere else', peaks), &
                      test('the amplitude of a series changes as its difference quotient', rates), &
                      test('tangents of a sweep are difference quotients of solved points', tangents), &
                      test('the estimate of a point between is what is solved there', middles), &
                      test('a step has the length that is asked for where means move further than anything else', lengths), &
                      test('the length of steps follows the error, and rounding of the error does not change it', rounded), &
                      test('a finer curve has more points', finer)])

contains

  subroutine cubics(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: t
    integer :: i

    do i = 0, 8
      t = i/8.0_wp
      ! y = 2 - 3 s + 5 s^2 - 7 s^3 on 0 ... 1
      call check_close(error, dot_product(hermite(t), [2.0_wp, -3.0_wp, -3.0_wp, -14.0_wp]), &
                       2.0_wp - 3.0_wp*t + 5.0_wp*t**2 - 7.0_wp*t**3, 1.0e-14_wp, 'value')
      call check_close(error, dot_product(hermite_slope(t), [2.0_wp, -3.0_wp, -3.0_wp, -14.0_wp]), &
                       -3.0_wp + 10.0_wp*t - 21.0_wp*t**2, 1.0e-13_wp, 'slope')
    end do
  end subroutine cubics

  !> The radius of the cubic through a quarter of the unit circle is wrong by 2.8e-4 at most, as is known of Bezier's.
  subroutine circles(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: angle = 0.5_wp*pi
    real(wp) :: length, x, y, worst
    integer :: i

    length = arc_length(2.0_wp*sin(0.5_wp*angle), cos(angle))
    ! Three times the handle of Bezier's cubic, 4/3 tan(angle/4).
    call check_close(error, length, 4.0_wp*tan(0.25_wp*angle), 1.0e-14_wp, 'length')
    worst = 0.0_wp
    do i = 0, 100
      associate (weights => hermite(0.01_wp*i))
        x = dot_product(weights, [1.0_wp, 0.0_wp, cos(angle), -length*sin(angle)])
        y = dot_product(weights, [0.0_wp, length, sin(angle), length*cos(angle)])
      end associate
      worst = max(worst, abs(norm2([x, y]) - 1.0_wp))
    end do
    call check(error, worst < 3.0e-4_wp, 'the circle is not met')
    call check(error, worst > 1.0e-5_wp, 'it cannot be met so well: the test is void')
    call check_close(error, arc_length(3.0_wp, 1.0_wp), 3.0_wp, 0.0_wp, 'a straight line')
  end subroutine circles

  !> A straight line in two monitors: at equal frequency the vertical distance counts, as long as the line is not steep.
  subroutine distances(error)
    type(error_type), allocatable, intent(out) :: error
    type(arc_type) :: arc
    type(curve_point_type) :: point

    arc = arc_type(curve_point_type(100.0_wp, 10.0_wp, [1.0_wp, 2.0_wp], [1.0_wp, 0.0_wp]), &
                   curve_point_type(110.0_wp, 10.0_wp, [2.0_wp, 2.0_wp], [1.0_wp, 0.0_wp]), 1.0_wp)
    point = curve_point_type(105.0_wp, 0.0_wp, [1.5_wp, 2.0_wp])
    call check_close(error, arc%distance_of(point, [2.0_wp, 2.0_wp]), 0.0_wp, 1.0e-12_wp, 'on the line')
    point%amplitude = [1.5_wp, 2.03_wp]
    call check_close(error, arc%distance_of(point, [2.0_wp, 2.0_wp]), 0.015_wp, 1.0e-12_wp, 'off the level line')
    ! Across the other: a tenth of an amplitude a unit, frequencies in thousandths of themselves, 0.105.
    point%amplitude = [1.52_wp, 2.0_wp]
    call check_close(error, arc%distance_of(point, [2.0_wp, 2.0_wp]), 0.01_wp/sqrt(1.0_wp + (0.05_wp*0.105_wp)**2), 1.0e-12_wp, &
                     'off the slanting line')
    call check_close(error, arc%distance_of(point, [4.0_wp, 2.0_wp]), 0.005_wp, 1.0e-6_wp, 'of a larger amplitude')
    call check_close(error, arc%distance_of(point, [0.0_wp, 0.0_wp]), 0.0_wp, 0.0_wp, 'of monitors that do not move')
  end subroutine distances

  !> The parabola 1 + s - s^2 has its maximum in the middle of 0 ... 1.
  subroutine peaks(error)
    type(error_type), allocatable, intent(out) :: error
    type(arc_type) :: arc

    arc = arc_type(curve_point_type(1.0_wp, 1.0_wp, [1.0_wp], [1.0_wp]), curve_point_type(2.0_wp, 1.0_wp, [1.0_wp], [-1.0_wp]), &
                   1.0_wp)
    call check_close(error, arc%highest([1.0_wp], 0.01_wp), 0.5_wp, 1.0e-12_wp, 'where it is')
    call check(error, arc%highest([1.0_wp], 0.26_wp) < 0.0_wp, 'it gains less than is asked')
    arc%to%amplitude_rate = 1.0_wp
    call check(error, arc%highest([1.0_wp], 0.0_wp) < 0.0_wp, 'what still rises has no maximum')
  end subroutine peaks

  subroutine rates(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: step = 1.0e-6_wp
    real(wp), parameter :: series(7) = [0.3_wp, 1.0_wp, -0.5_wp, 0.2_wp, 0.1_wp, 0.0_wp, 0.3_wp]
    real(wp), parameter :: change(7) = [9.0_wp, 0.7_wp, 0.4_wp, -0.3_wp, 0.6_wp, 0.2_wp, -0.1_wp]
    type(curve_point_type) :: here, after, before
    integer :: count

    do count = 3, 7, 2
      here = new_curve_point(1.0_wp, column(series(:count)), 1.0_wp, column(change(:count)))
      after = new_curve_point(1.0_wp, column(series(:count) + step*change(:count)))
      before = new_curve_point(1.0_wp, column(series(:count) - step*change(:count)))
      ! Central differences: step^2 of the third derivative, and rounding over the step.
      call check_close(error, here%amplitude_rate(1), (after%amplitude(1) - before%amplitude(1))/(2.0_wp*step), 1.0e-8_wp, 'rate')
    end do
    here = new_curve_point(1.0_wp, column(0.0_wp*series))
    call check_close(error, here%amplitude(1), 0.0_wp, 0.0_wp, 'nothing moves')
  end subroutine rates

  pure function column(values)
    real(wp), intent(in) :: values(:)
    real(wp) :: column(size(values), 1)

    column(:, 1) = values
  end function column

  !> A wedge that slips, at the beginning of a sweep upwards.
  subroutine begin_sweep(solver, sweep, error)
    type(solver_type), intent(out) :: solver
    type(sweep_type), intent(out) :: sweep
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: fault
    type(scene_type) :: scene

    scene = wedge(45.0_wp)
    call new_solver(scene%structure, scene%contacts, only_me(), solver_options_type(), solver, fault)
    if (.not. allocated(fault)) call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 20, two_pi*100.0_wp, fault)
    call check(error, .not. allocated(fault), 'no static equilibrium')
    call solver%set_loads([1.0_wp], 5.0_wp)
    sweep = new_sweep(solver, two_pi*100.0_wp, two_pi*140.0_wp, 1, 600)
  end subroutine begin_sweep

  subroutine tangents(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: step = 1.0e-5_wp
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    type(snapshot_type) :: here
    real(wp) :: amplitude(2, 2)
    integer :: i, side, compared
    logical :: unique

    call begin_sweep(solver, sweep, error)
    compared = 0
    do i = 1, 40
      if (allocated(error) .or. sweep%finished) exit
      call sweep%advance(solver)
      unique = solver%context%balance%forces(1)%unique
      here = snapshot_of(solver)
      if (.not. unique) cycle
      do side = 1, 2
        call restore(solver, here)
        call solver%solve_at(here%omega*(1.0_wp + (2*side - 3)*step))
        amplitude(:, side) = amplitudes_of(solver)
      end do
      ! Central differences of what is solved to 1e-10: 1e-5 of the quotient, and the square of the step in a peak's width, 1e-2.
      call check_close(error, sweep%stepper%here%amplitude_rate/sweep%stepper%here%omega_rate, &
                       (amplitude(:, 2) - amplitude(:, 1))/(2.0_wp*step*here%omega), &
                       2.0e-4_wp*maxval(abs(sweep%stepper%here%amplitude_rate/sweep%stepper%here%omega_rate)), 'slope')
      compared = compared + 1
      call restore(solver, here)
    end do
    call check(error, compared > 3, 'hardly a point slips: the test is void')
    call solver%destroy()
  end subroutine tangents

  function amplitudes_of(solver) result(amplitudes)
    type(solver_type), intent(in) :: solver
    real(wp) :: amplitudes(2)
    type(curve_point_type) :: point

    associate (balance => solver%context%balance)
      point = new_curve_point(solver%omega, balance%monitors%motion_of(balance%response))
    end associate
    amplitudes = point%amplitude(:2)
  end function amplitudes_of

  subroutine middles(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    type(snapshot_type) :: here
    type(curve_point_type) :: estimated
    real(wp) :: off
    integer :: i, status, compared
    logical :: converged

    call begin_sweep(solver, sweep, error)
    compared = 0
    do i = 1, 40
      if (allocated(error) .or. sweep%finished) exit
      call sweep%advance(solver)
      associate (step => sweep%stepper%last)
        if (step%length <= 0.0_wp .or. (step%from%all_stick .and. step%to%all_stick)) cycle
        here = snapshot_of(solver)
        call estimate_between(solver, step, 0.5_wp, 0.01_wp, estimated, off, status)
        call check(error, status == 0, 'there is no estimate')
        call check_close(error, solver%motion, here%motion, 0.0_wp, 'the point stays')
        if (allocated(error)) exit
        call step%solve_part(solver, 0.5_wp, converged)
        call check(error, converged, 'the middle is not found')
        ! A step of Newton's method from off the arc leaves its square.
        call check_close(error, estimated%amplitude(:2), amplitudes_of(solver), &
                         (0.02_wp + 10.0_wp*off)*off*maxval(estimated%amplitude) + 1.0e-12_wp, 'amplitudes')
        call check_close(error, estimated%omega, solver%omega, (0.02_wp + 10.0_wp*off)*off*solver%omega + 1.0e-9_wp, 'frequency')
        compared = compared + 1
        call restore(solver, here)
      end associate
    end do
    call check(error, compared > 3, 'hardly a step slips: the test is void')
    call solver%destroy()
  end subroutine middles

  !> Steps are as long as the drawn curve asks for, whose length leaves means out. A tangent of unit length, nine tenths of it means.
  subroutine lengths(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: asked = 0.01_wp, harmonics = sqrt(0.19_wp)
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    type(tangent_type) :: tangent
    type(predictor_type) :: predictor
    type(prediction_type) :: ahead
    real(wp), allocatable :: moved(:, :)

    call begin_sweep(solver, sweep, error)
    call sweep%advance(solver)
    allocate (tangent%motion, tangent%slider, mold=solver%motion)
    tangent%motion = 0.0_wp
    tangent%motion(1, 1) = 0.9_wp
    tangent%motion(2, 1) = 0.8_wp*harmonics
    tangent%omega = 0.6_wp*harmonics
    tangent%share = harmonics
    call predictor%predict(solver, tangent, asked, .true., ahead)
    associate (context => solver%context)
      moved = (ahead%motion - solver%motion)/context%motion_scale
      call check_close(error, hypot(norm2(moved(2:, :)), (ahead%omega - solver%omega)/context%frequency_scale), asked, &
                       1.0e-12_wp*asked, 'length without means')
      call check_close(error, moved(1, 1), 0.9_wp/harmonics*asked, 1.0e-12_wp, 'mean')
    end associate
    call solver%destroy()
  end subroutine lengths

  !> Errors in whose middle the changes 2^(k/8) lie: a thousandth of the error is 2e-3 of the way to the next of these.
  subroutine rounded(error)
    type(error_type), allocatable, intent(out) :: error
    !> The error, relative to what is accepted, at which the length stays
    real(wp), parameter :: aimed = 0.3_wp
    real(wp) :: change
    integer :: k

    do k = -8, 8
      change = 2.0_wp**(k/8.0_wp)
      call check_close(error, next_length(1.0_wp, aimed/change**4), change, 1.0e-14_wp*change, 'change of the length')
      call check_close(error, next_length(1.0_wp, 1.001_wp*aimed/change**4), change, 1.0e-14_wp*change, 'with another error')
    end do
    do k = -40, 40
      change = min(max(2.0_wp**(0.013_wp*k), 0.5_wp), 2.0_wp)
      call check_close(error, next_length(3.0_wp, aimed/change**4), 3.0_wp*change, 3.0_wp*change*(2.0_wp**0.0625_wp - 1.0_wp), &
                       'of any error')
    end do
  end subroutine rounded

  subroutine finer(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    integer :: points(2), i

    do i = 1, 2
      call begin_sweep(solver, sweep, error)
      sweep%stepper%tolerance = 10.0_wp**(-2*i)
      do while (.not. (sweep%finished .or. allocated(error)))
        call sweep%advance(solver)
        call check(error, solver%report%converged, 'a point does not converge')
      end do
      call check(error, sweep%reached_stop, 'the sweep does not reach its stop')
      points(i) = sweep%points
      call solver%destroy()
    end do
    ! The error goes with the fourth power of the step's length, hence sqrt(10) times as many; with less where friction begins.
    call check(error, points(2) > 3*points(1)/2, 'a finer curve has no more points')
    call check(error, points(2) < 10*points(1), 'a finer curve has far too many points')
  end subroutine finer
end program test_curve
