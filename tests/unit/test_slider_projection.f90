!> Where sliders come to rest: against Dykstra's projections, the limit of slowly growing motions, and differences.
program test_slider_projection
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_slider_projection, only: slider_projection_type, project_slider, projection_gradient
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: samples = 24

  if (run_suite('resting place', [ &
                test('a slider that all discs hold stays', stays), &
                test('one disc pulls it to its rim along the radius', pulled), &
                test('it is the nearest place: the one of Dykstra''s projections', nearest), &
                test('where no place is in all discs there is none', none), &
                test('a motion that grows in small steps leaves it where the sweeping process does', grows), &
                test('its derivative is that of differences, held by one disc or by two', differences)], quiet=.false.) > 0) then
    error stop 1
  end if

contains

  !> A closed path and radii around one, of some size.
  subroutine path(seed, swing, u, r)
    integer, intent(in) :: seed
    real(wp), intent(in) :: swing
    real(wp), intent(out) :: u(samples, 2), r(samples)
    real(wp) :: a(10), t
    integer :: j

    a = noise(10, seed)
    do j = 1, samples
      t = two_pi*j/samples
      u(j, :) = swing*[a(1)*cos(t) + a(2)*sin(t) + a(3)*cos(2.0_wp*t), a(4)*cos(t) + a(5)*sin(t) + a(6)*sin(2.0_wp*t)]
      r(j) = 1.0_wp + 0.2_wp*a(7)*cos(t) + 0.2_wp*a(8)*sin(t)
    end do
  end subroutine path

  subroutine stays(error)
    type(error_type), allocatable, intent(out) :: error
    type(slider_projection_type) :: place
    real(wp) :: u(samples, 2), r(samples)

    call path(1, 0.3_wp, u, r)
    place = project_slider(u, r, [0.05_wp, -0.02_wp])
    call check(error, place%exists .and. place%count == 0, 'it moves')
    call check_close(error, place%slider, [0.05_wp, -0.02_wp], 0.0_wp, 'slider')
  end subroutine stays

  subroutine pulled(error)
    type(error_type), allocatable, intent(out) :: error
    type(slider_projection_type) :: place
    real(wp) :: u(samples, 2)

    u = 0.0_wp
    place = project_slider(u, spread(1.0_wp, 1, samples), [3.0_wp, 4.0_wp])
    call check(error, place%exists .and. place%count == 1, 'not held by one')
    call check_close(error, place%slider, [0.6_wp, 0.8_wp], 1.0e-15_wp, 'slider')
  end subroutine pulled

  !> Alternating projections with corrections: slow and sure.
  function dykstra(u, r, slider) result(w)
    real(wp), intent(in) :: u(:, :), r(:), slider(2)
    real(wp) :: w(2), y(2), correction(2, size(r))
    integer :: j, sweep

    w = slider
    correction = 0.0_wp
    do sweep = 1, 20000
      do j = 1, size(r)
        y = w + correction(:, j)
        w = y
        if (norm2(u(j, :) - y) > r(j)) w = u(j, :) - r(j)*(u(j, :) - y)/norm2(u(j, :) - y)
        correction(:, j) = y - w
      end do
    end do
  end function dykstra

  subroutine nearest(error)
    type(error_type), allocatable, intent(out) :: error
    type(slider_projection_type) :: place
    real(wp) :: u(samples, 2), r(samples), start(2)
    integer :: seed, held_by(0:2)

    held_by = 0
    do seed = 1, 40
      call path(seed, 0.45_wp, u, r)
      start = 2.0_wp*noise(2, 100 + seed)
      place = project_slider(u, r, start)
      if (.not. place%exists) cycle
      held_by(place%count) = held_by(place%count) + 1
      ! Dykstra's method converges but linearly: to some 1e-9 after so many sweeps.
      call check_close(error, place%slider, dykstra(u, r, start), 1.0e-8_wp, 'slider')
    end do
    call check(error, all(held_by(1:) >= 5), 'not both kinds of places: the test is void')
  end subroutine nearest

  subroutine none(error)
    type(error_type), allocatable, intent(out) :: error
    type(slider_projection_type) :: place
    real(wp) :: u(3, 2)

    ! Three discs that meet in pairs only.
    u = reshape([0.0_wp, 1.0_wp, 0.5_wp, 0.0_wp, 0.0_wp, 0.8_wp], [3, 2])
    place = project_slider(u, [0.52_wp, 0.52_wp, 0.45_wp], [0.5_wp, 0.1_wp])
    call check(error, .not. place%exists, 'there is none')
    place = project_slider(u, [0.52_wp, 0.52_wp, 0.7_wp], [0.5_wp, 0.1_wp])
    call check(error, place%exists, 'there is one')
    place = project_slider(u, [0.52_wp, 0.52_wp, -0.1_wp], [0.5_wp, 0.1_wp])
    call check(error, .not. place%exists, 'an open contact has none')
  end subroutine none

  !> Marching periods of radial return, the motion growing a little in each, ends where projections do: both are first order in the
  !> growth a step, and so is their difference.
  subroutine grows(error)
    type(error_type), allocatable, intent(out) :: error
    type(slider_projection_type) :: place
    real(wp) :: u(samples, 2), r(samples), marched(2), projected(2), part, apart(2)
    integer :: i, j, fineness, steps

    call path(2, 0.5_wp, u, r)
    do fineness = 1, 2
      steps = 400*fineness
      marched = [0.9_wp, -0.9_wp]
      projected = marched
      do i = 1, steps
        part = real(i, wp)/steps
        place = project_slider(part*u, r, projected)
        projected = place%slider
        do j = 1, samples
          if (norm2(part*u(j, :) - marched) > r(j)) then
            marched = part*u(j, :) - r(j)*(part*u(j, :) - marched)/norm2(part*u(j, :) - marched)
          end if
        end do
      end do
      apart(fineness) = norm2(marched - projected)
    end do
    call check(error, place%exists .and. norm2(projected - [0.9_wp, -0.9_wp]) > 0.1_wp, 'it hardly moves: the test is void')
    call check(error, apart(2) < 0.6_wp*apart(1) .and. apart(2) < 1.0e-3_wp, 'they do not meet')
  end subroutine grows

  subroutine differences(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: k = 5
    real(wp), parameter :: step = 1.0e-6_wp, slope = 0.3_wp
    type(slider_projection_type) :: place, moved(2)
    real(wp) :: u(samples, 2), r(samples), v(samples, 2), s(samples), start(2), gradient(2, 3*k), expected(2), basis(k, samples)
    integer :: seed, column, side, i, j, held_by(2)

    do j = 1, samples
      basis(:, j) = [1.0_wp, cos(two_pi*j/samples), sin(two_pi*j/samples), cos(2*two_pi*j/samples), sin(2*two_pi*j/samples)]
    end do
    held_by = 0
    do seed = 1, 30
      call path(seed, 0.45_wp, u, r)
      start = 2.0_wp*noise(2, 100 + seed)
      place = project_slider(u, r, start)
      if (.not. place%exists .or. place%count == 0) cycle
      held_by(place%count) = held_by(place%count) + 1
      gradient = projection_gradient(place, u, r, basis, spread(slope, 1, size(r)), start)
      do column = 1, 3*k
        i = modulo(column - 1, k) + 1
        do side = 1, 2
          v = u
          s = r
          select case ((column - 1)/k)
           case (0, 1)
            v(:, 1 + (column - 1)/k) = v(:, 1 + (column - 1)/k) + (3 - 2*side)*step*basis(i, :)
           case default
            s = s + (3 - 2*side)*step*slope*basis(i, :)
          end select
          moved(side) = project_slider(v, s, start)
        end do
        expected = (moved(1)%slider - moved(2)%slider)/(2.0_wp*step)
        ! Second derivatives are of order one over the radius and the sine of the discs' angle, some 1e2; rounding 1e-16/1e-6.
        call check_close(error, gradient(:, column), expected, 1.0e-7_wp, 'column')
      end do
    end do
    call check(error, all(held_by >= 5), 'not both kinds of places: the test is void')

  end subroutine differences
end program test_slider_projection
