!> Between coefficients and samples, and extrema of trigonometric polynomials.
program test_fourier
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_trigonometric, only: extrema, value_at
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  ! Numbers of order one pass through sums of some hundred terms: 100 roundings of 2.2e-16.
  real(wp), parameter :: rounding = 1.0e-13_wp

  if (run_suite('fourier', [ &
                test('samples of a series give its coefficients back', round_trip), &
                test('a series of J/2 - 1 harmonics survives an even number of samples', round_trip_at_the_limit), &
                test('the synthesis matrix agrees with the transform', synthesis_agrees), &
                test('the analysis matrix agrees with the transform', analysis_agrees), &
                test('harmonics beyond those asked for do not leak into the coefficients', no_leak), &
                test('values and derivatives are those of cosine and sine', values), &
                test('the extrema of a shifted cosine are its mean plus and minus its amplitude', extrema_of_cosine), &
                test('the extrema of polynomials in closed form are found', extrema_in_closed_form), &
                test('an extremum between two nearly equal peaks is the higher one', nearly_equal_peaks), &
                test('a constant has its value as both extrema', extrema_of_constant)], quiet=.false.) > 0) error stop 1

contains

  subroutine round_trip(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: sizes(4) = [11, 12, 64, 100]
    integer :: i

    do i = 1, size(sizes)
      call there_and_back(error, harmonics=5, samples=sizes(i))
    end do
  end subroutine round_trip

  subroutine round_trip_at_the_limit(error)
    type(error_type), allocatable, intent(out) :: error

    call there_and_back(error, harmonics=31, samples=64)
  end subroutine round_trip_at_the_limit

  subroutine there_and_back(error, harmonics, samples)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: harmonics, samples
    type(fourier_type) :: fourier
    real(wp) :: given(2*harmonics + 1, 3), returned(2*harmonics + 1, 3), x(samples, 3)

    fourier = new_fourier(harmonics, samples)
    given = reshape(noise(size(given), 1), shape(given))
    call fourier%to_samples(given, x)
    call fourier%to_coefficients(x, returned)
    call fourier%destroy()
    call check_close(error, returned, given, rounding, 'coefficients')
  end subroutine there_and_back

  subroutine synthesis_agrees(error)
    type(error_type), allocatable, intent(out) :: error
    type(fourier_type) :: fourier
    real(wp) :: coefficients(15, 2), x(48, 2)

    fourier = new_fourier(7, 48)
    coefficients = reshape(noise(30, 2), [15, 2])
    call fourier%to_samples(coefficients, x)
    call check_close(error, matmul(transpose(fourier%basis), coefficients), x, rounding, 'samples')
    call fourier%destroy()
  end subroutine synthesis_agrees

  subroutine analysis_agrees(error)
    type(error_type), allocatable, intent(out) :: error
    type(fourier_type) :: fourier
    real(wp) :: coefficients(15, 2), x(48, 2)

    fourier = new_fourier(7, 48)
    x = reshape(noise(96, 3), [48, 2])
    call fourier%to_coefficients(x, coefficients)
    call check_close(error, matmul(fourier%analysis, x), coefficients, rounding, 'coefficients')
    call fourier%destroy()
  end subroutine analysis_agrees

  subroutine no_leak(error)
    type(error_type), allocatable, intent(out) :: error
    type(fourier_type) :: fourier
    real(wp) :: many(21, 1), few(7, 1), x(32, 1)

    fourier = new_fourier(3, 32)
    many = reshape(noise(21, 4), [21, 1])
    call fourier%to_samples(many, x)
    call fourier%to_coefficients(x, few)
    call check_close(error, few, many(:7, :), rounding, 'the first coefficients')
    call fourier%destroy()
  end subroutine no_leak

  subroutine values(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: theta = 0.7_wp

    call check_close(error, value_at([2.0_wp, 0.0_wp, 0.0_wp, 3.0_wp, 5.0_wp], theta), &
                     [2.0_wp + 3.0_wp*cos(2*theta) + 5.0_wp*sin(2*theta), -6.0_wp*sin(2*theta) + 10.0_wp*cos(2*theta), &
                      -12.0_wp*cos(2*theta) - 20.0_wp*sin(2*theta)], rounding, 'value, slope, curvature')
  end subroutine values

  subroutine extrema_of_cosine(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: phase
    integer :: i

    do i = 0, 9
      phase = 0.1_wp*i
      call check_close(error, extrema([1.0_wp, 2.0_wp*cos(phase), 2.0_wp*sin(phase)]), [-1.0_wp, 3.0_wp], rounding, 'extrema')
    end do
  end subroutine extrema_of_cosine

  subroutine extrema_in_closed_form(error)
    type(error_type), allocatable, intent(out) :: error

    ! cos t + cos 2 t = 2 c^2 + c - 1 with c = cos t: least at c = -1/4, most at c = 1.
    call check_close(error, extrema([0.0_wp, 1.0_wp, 0.0_wp, 1.0_wp, 0.0_wp]), [-1.125_wp, 2.0_wp], rounding, 'cosines')
    ! sin t + sin 2 t / 2 has its extrema at t = +-pi/3.
    call check_close(error, extrema([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.5_wp]), 0.75_wp*sqrt(3.0_wp)*[-1.0_wp, 1.0_wp], &
                     rounding, 'sines')
    ! sin t + sin 3 t = 4 s - 4 s^3 with s = sin t: extrema at s = +-1/sqrt(3).
    call check_close(error, extrema([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp]), &
                     8.0_wp/(3.0_wp*sqrt(3.0_wp))*[-1.0_wp, 1.0_wp], rounding, 'odd sines')
  end subroutine extrema_in_closed_form

  subroutine nearly_equal_peaks(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: shift = 0.02_wp
    real(wp) :: range(2), densest
    integer :: j
    integer, parameter :: dense = 200000

    ! cos 5 t lifted a little on one side: the dense search errs by half its curvature times half a step squared, 25 (pi/2e5)^2/2.
    range = extrema([0.0_wp, 1.0e-3_wp*cos(shift), 1.0e-3_wp*sin(shift), spread(0.0_wp, 1, 6), cos(shift), sin(shift)])
    densest = -huge(1.0_wp)
    do j = 0, dense - 1
      densest = max(densest, 1.0e-3_wp*cos(two_pi*j/dense - shift) + cos(5*two_pi*j/dense - shift))
    end do
    call check_close(error, range(2), densest, 12.6_wp*(pi/dense)**2, 'highest value')
  end subroutine nearly_equal_peaks

  subroutine extrema_of_constant(error)
    type(error_type), allocatable, intent(out) :: error

    call check_close(error, extrema([4.0_wp, 0.0_wp, 0.0_wp]), [4.0_wp, 4.0_wp], 0.0_wp, 'extrema')
    call check_close(error, extrema([4.0_wp]), [4.0_wp, 4.0_wp], 0.0_wp, 'extrema without harmonics')
  end subroutine extrema_of_constant
end program test_fourier
