!> A real trigonometric polynomial, x(theta) = a_0 + sum_h (a_ch cos h theta + a_sh sin h theta): values and located extrema.
module attrito_core_trigonometric
  use attrito_core_kinds, only: wp, pi, two_pi
  implicit none
  private
  public :: harmonics_at, basis_at, value_at, product_of, extrema, extreme_angles, resized, to_complex, to_real, work_per_period

  !> Harmonics that are carried on at a time, each of which waits for none of the others
  integer, parameter :: stride = 4 ! conventional

contains

  !> Series columnwise, cut off or filled up with zeros to so many coefficients.
  pure function resized(series, coefficients) result(other)
    !> Series, a column each
    real(wp), intent(in) :: series(:, :)
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients
    real(wp) :: other(coefficients, size(series, 2))
    integer :: common

    common = min(coefficients, size(series, 1))
    other(:common, :) = series(:common, :)
    other(common + 1:, :) = 0.0_wp
  end function resized

  !> Real coefficients [2 H + 1, n] as complex columns [n, 0:H].
  pure function to_complex(coefficients) result(columns)
    !> Fourier coefficients
    real(wp), intent(in) :: coefficients(:, :)
    complex(wp) :: columns(size(coefficients, 2), 0:(size(coefficients, 1) - 1)/2)
    integer :: h

    columns(:, 0) = coefficients(1, :)
    do h = 1, ubound(columns, 2)
      columns(:, h) = cmplx(coefficients(2*h, :), -coefficients(2*h + 1, :), wp)
    end do
  end function to_complex

  !> Complex columns [n, 0:H] as real coefficients [2 H + 1, n].
  pure function to_real(columns) result(coefficients)
    !> Columns by harmonic
    complex(wp), intent(in) :: columns(:, 0:)
    real(wp) :: coefficients(2*ubound(columns, 2) + 1, size(columns, 1))
    integer :: h

    coefficients(1, :) = real(columns(:, 0), wp)
    do h = 1, ubound(columns, 2)
      coefficients(2*h, :) = real(columns(:, h), wp)
      coefficients(2*h + 1, :) = -aimag(columns(:, h))
    end do
  end function to_real

  !> Coefficients of the product of two series, by X_h e^(i h theta): X_h = (a_ch - i a_sh)/2 [size of both, less one].
  pure function product_of(one, other) result(product)
    !> Coefficients
    real(wp), intent(in) :: one(:), other(:)
    real(wp) :: product(size(one) + size(other) - 1)
    complex(wp) :: sum(0:size(product)/2)
    integer :: h, g

    sum = (0.0_wp, 0.0_wp)
    associate (x => two_sided(one), y => two_sided(other), last => size(other)/2)
      do h = 0, ubound(sum, 1)
        do g = max(h - last, -(size(one)/2)), min(h + last, size(one)/2)
          sum(h) = sum(h) + x(size(one)/2 + 1 + g)*y(last + 1 + h - g)
        end do
      end do
    end associate
    product(1) = real(sum(0), wp)
    product(2::2) = 2.0_wp*real(sum(1:), wp)
    product(3::2) = -2.0_wp*aimag(sum(1:))
  end function product_of

  !> X_h, h = -H ... H.
  pure function two_sided(series) result(x)
    !> Coefficients
    real(wp), intent(in) :: series(:)
    complex(wp) :: x(size(series))
    integer :: h, middle

    middle = size(series)/2 + 1
    x(middle) = series(1)
    do h = 1, middle - 1
      x(middle + h) = 0.5_wp*cmplx(series(2*h), -series(2*h + 1), wp)
      x(middle - h) = conjg(x(middle + h))
    end do
  end function two_sided

  !> cos h theta and sin h theta, h = 1 ... H.
  pure subroutine harmonics_at(theta, cosines, sines)
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> [H]
    real(wp), intent(out), contiguous :: cosines(:), sines(:)
    real(wp) :: c(stride), s(stride), turn(2)
    integer :: h, count

    call first_harmonics(theta, c, s, turn)
    do h = 0, size(cosines) - 1, stride
      count = min(stride, size(cosines) - h)
      cosines(h + 1:h + count) = c(:count)
      sines(h + 1:h + count) = s(:count)
      call next_harmonics(turn, c, s)
    end do
  end subroutine harmonics_at

  !> The functions 1, cos, sin, cos 2, sin 2, ... at theta.
  pure function basis_at(theta, harmonics) result(basis)
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    real(wp) :: basis(2*harmonics + 1)
    real(wp) :: c(stride), s(stride), turn(2)
    integer :: h, i

    basis(1) = 1.0_wp
    call first_harmonics(theta, c, s, turn)
    do h = 0, harmonics - 1, stride
      do i = 1, min(stride, harmonics - h)
        basis(2*(h + i)) = c(i)
        basis(2*(h + i) + 1) = s(i)
      end do
      call next_harmonics(turn, c, s)
    end do
  end function basis_at

  !> Value and its first two derivatives by theta.
  pure function value_at(coefficients, theta) result(jet)
    !> [a_0, a_c1, a_s1, ...]
    real(wp), intent(in) :: coefficients(:)
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> [x, x', x'']
    real(wp) :: jet(3)
    real(wp) :: c(stride), s(stride), turn(2), along, across
    integer :: h, i

    jet = [coefficients(1), 0.0_wp, 0.0_wp]
    call first_harmonics(theta, c, s, turn)
    do h = 0, size(coefficients)/2 - 1, stride
      do i = 1, min(stride, size(coefficients)/2 - h)
        associate (cosine => coefficients(2*(h + i)), sine => coefficients(2*(h + i) + 1))
          along = cosine*c(i) + sine*s(i)
          across = sine*c(i) - cosine*s(i)
        end associate
        jet(1) = jet(1) + along
        jet(2) = jet(2) + (h + i)*across
        jet(3) = jet(3) - (h + i)**2*along
      end do
      call next_harmonics(turn, c, s)
    end do
  end function value_at

  !> cos h theta and sin h theta of the first harmonics, and what carries them on to the next ones.
  pure subroutine first_harmonics(theta, c, s, turn)
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> Cosines; sines; cosine and sine of one angle step
    real(wp), intent(out) :: c(stride), s(stride), turn(2)
    integer :: h

    c(1) = cos(theta)
    s(1) = sin(theta)
    do h = 2, stride
      c(h) = c(h - 1)*c(1) - s(h - 1)*s(1)
      s(h) = s(h - 1)*c(1) + c(h - 1)*s(1)
    end do
    turn = [c(stride), s(stride)]
  end subroutine first_harmonics

  !> From harmonics h to h + `stride`, by the sums of angles.
  pure subroutine next_harmonics(turn, c, s)
    !> Cosine and sine of one angle step
    real(wp), intent(in) :: turn(2)
    !> Cosines; sines
    real(wp), intent(inout) :: c(stride), s(stride)
    real(wp) :: before(stride)

    before = c
    c = before*turn(1) - s*turn(2)
    s = s*turn(1) + before*turn(2)
  end subroutine next_harmonics

  !> Smallest and largest value over the period.
  pure function extrema(coefficients) result(range)
    !> [a_0, a_c1, a_s1, ...]
    real(wp), intent(in) :: coefficients(:)
    !> [lowest, highest]
    real(wp) :: range(2)
    real(wp) :: jet(3), angles(2)
    integer :: i, used

    ! Harmonics that are zero, as most are where every contact sticks, are left out.
    used = 1 + 2*(findloc(abs(coefficients) > 0.0_wp, .true., 1, back=.true.)/2)
    if (used <= 3) then
      range = coefficients(1) + norm2(coefficients(2:used))*[-1.0_wp, 1.0_wp]
      return
    end if
    angles = extreme_angles(coefficients(:used))
    do i = 1, 2
      jet = value_at(coefficients(:used), angles(i))
      range(i) = jet(1)
    end do
  end function extrema

  !> Where the smallest and the largest value over the period are: those of a grid, each polished by Newton's method on x' = 0 where
  !> it is the least or greatest of its neighbours (two that are nearly equal may change places).
  pure function extreme_angles(coefficients) result(angles)
    !> [a_0, a_c1, a_s1, ...]
    real(wp), intent(in) :: coefficients(:)
    !> Angles of [lowest, highest]
    real(wp) :: angles(2)
    real(wp) :: grid(16*size(coefficients)), range(2)
    integer :: j

    call sample(coefficients, grid)
    angles = [theta_of(minloc(grid, 1)), theta_of(maxloc(grid, 1))]
    range = [minval(grid), maxval(grid)]
    do j = 1, size(grid)
      associate (before => grid(modulo(j - 2, size(grid)) + 1), after => grid(modulo(j, size(grid)) + 1))
        if (grid(j) <= min(before, after)) call keep_better(j, -1.0_wp, range(1), angles(1))
        if (grid(j) >= max(before, after)) call keep_better(j, 1.0_wp, range(2), angles(2))
      end associate
    end do

  contains

    pure real(wp) function theta_of(sample)
      !> Number of the grid point
      integer, intent(in) :: sample

      theta_of = two_pi*(sample - 1)/size(grid)
    end function theta_of

    !> Take the extremum beside a grid point if it goes farther than what there is.
    pure subroutine keep_better(sample, side, value, angle)
      !> Number of the grid point
      integer, intent(in) :: sample
      !> -1: smallest, 1: largest
      real(wp), intent(in) :: side
      !> Extreme value so far; angle at which it is
      real(wp), intent(inout) :: value, angle
      real(wp) :: theta, local(3), step
      integer :: iteration

      theta = theta_of(sample)
      do iteration = 1, 8
        local = value_at(coefficients, theta)
        if (abs(local(3)) <= tiny(1.0_wp)) exit
        step = -local(2)/local(3)
        if (abs(step) > two_pi/size(grid)) exit
        theta = theta + step
        if (abs(step) <= epsilon(step)) exit
      end do
      local = value_at(coefficients, theta)
      if (side*(local(1) - value) < 0.0_wp) return
      value = local(1)
      angle = theta
    end subroutine keep_better
  end function extreme_angles

  !> Values at equally spaced angles, an even number of them from 0: half a period on odd harmonics have changed their sign.
  pure subroutine sample(coefficients, values)
    !> [a_0, a_c1, a_s1, ...]
    real(wp), intent(in) :: coefficients(:)
    !> Values at the angles
    real(wp), intent(out) :: values(:)
    real(wp) :: cosines(size(coefficients)/2), sines(size(coefficients)/2), parts(0:1)
    integer :: h, j, half

    half = size(values)/2
    do j = 1, half
      call harmonics_at(two_pi*(j - 1)/size(values), cosines, sines)
      parts = [coefficients(1), 0.0_wp]
      do h = 1, size(cosines)
        parts(modulo(h, 2)) = parts(modulo(h, 2)) + coefficients(2*h)*cosines(h) + coefficients(2*h + 1)*sines(h)
      end do
      values(j) = parts(0) + parts(1)
      values(half + j) = parts(0) - parts(1)
    end do
  end subroutine sample

  !> Work of a force on a displacement over a period, pi sum_h h (F_c u_s - F_s u_c), of as many harmonics as both have.
  pure real(wp) function work_per_period(force, displacement)
    !> Coefficients of the force; coefficients of the displacement
    real(wp), intent(in) :: force(:), displacement(:)
    integer :: h

    work_per_period = 0.0_wp
    do h = 1, (min(size(force), size(displacement)) - 1)/2
      work_per_period = work_per_period + pi*h*(force(2*h)*displacement(2*h + 1) - force(2*h + 1)*displacement(2*h))
    end do
  end function work_per_period
end module attrito_core_trigonometric
