!> Length of steps along a branch: the next one aims at a part e_a of the error of the drawn curve that is accepted. The error e of
!> the last step goes with the fourth power of its length,
!>
!> $$ s_{n+1} = s_n \, (e_a/e)^{1/4}, \qquad 1/2 \le s_{n+1}/s_n \le 2 $$
!>
!> The change of the length is the nearest of a few. The error is a small difference, so that rounding, which differs between
!> numbers of ranks and between processors, would grow tenfold from step to step and move the points of a long sweep.
!> Where Newton's method hardly found the point from its prediction steps do not grow either. The first step, and what a step may have
!> of the frequencies, are parts of the sweep that go with the fourth root of the accepted error, too.
!> Source: Seydel 2010, doi:10.1007/978-1-4419-1740-9.
module attrito_continuation_step_length
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: default_tolerance, smallest_step, given_up
  public :: first_length, largest_part, next_length, limited_in_frequency, is_near, with_effort

  !> Error of the drawn curve, relative to the largest amplitude
  real(wp), parameter :: default_tolerance = 0.01_wp ! conventional
  !> As parts of the sweep: lengths along the branch, the one at which a branch is given up, and the largest in frequency; the first
  !> and the last at the default tolerance
  real(wp), parameter :: first_step = 0.01_wp, smallest_step = 1.0e-6_wp, given_up = 1.0e-9_wp, largest_in_frequency = 0.05_wp ! guess
  !> Part of the accepted error that steps aim at
  real(wp), parameter :: aimed_part = 0.3_wp ! guess
  !> Change of the length from step to step, at the least and at the most
  real(wp), parameter :: least_change = 0.5_wp, most_change = 2.0_wp ! guess
  !> Changes that there are from one length to its double: one of them is off by 4 %, which costs no point
  integer, parameter :: changes = 8 ! conventional
  !> Distance of predicted from corrected point, relative to the response, that is accepted, and from which on steps do not grow
  real(wp), parameter :: accepted_distance = 0.5_wp, large_distance = 0.2_wp ! guess
  !> Iterations of Newton's method from which on steps do not grow
  integer, parameter :: many_iterations = 10 ! guess

contains

  !> s_{n+1}.
  pure real(wp) function next_length(length, error)
    !> s_n; error of the drawn curve, relative to what is accepted
    real(wp), intent(in) :: length, error

    real(wp) :: change

    change = min(max((aimed_part/max(error, 1.0e-12_wp))**0.25_wp, least_change), most_change)
    next_length = length*2.0_wp**(anint(changes*log(change)/log(2.0_wp))/changes)
  end function next_length

  !> Of the first step.
  pure real(wp) function first_length(tolerance)
    !> Error of the drawn curve that is accepted
    real(wp), intent(in) :: tolerance

    first_length = first_step*(tolerance/default_tolerance)**0.25_wp
  end function first_length

  !> The largest change of the frequency, part of the sweep.
  pure real(wp) function largest_part(tolerance)
    !> Error of the drawn curve that is accepted
    real(wp), intent(in) :: tolerance

    largest_part = largest_in_frequency*(tolerance/default_tolerance)**0.25_wp
  end function largest_part

  !> A length along a tangent that changes the frequency by no more than is allowed.
  pure real(wp) function limited_in_frequency(length, slope, tolerance)
    !> Along the branch; change of the frequency, part of the sweep, by a unit of it; error of the drawn curve that is accepted
    real(wp), intent(in) :: length, slope, tolerance

    limited_in_frequency = min(length, largest_part(tolerance)/max(slope, tiny(1.0_wp)))
  end function limited_in_frequency

  !> Is a corrected point near enough to where it was predicted?
  pure logical function is_near(distance)
    !> Between both, relative to the response
    real(wp), intent(in) :: distance

    is_near = distance < accepted_distance
  end function is_near

  !> The error that decides on the next length: where the corrector had to work hard, at least the one at which steps do not grow.
  pure real(wp) function with_effort(error, iterations, distance)
    !> Of the drawn curve, relative to what is accepted
    real(wp), intent(in) :: error
    !> Of Newton's method, of all tries
    integer, intent(in) :: iterations
    !> Between predicted and corrected point, relative to the response
    real(wp), intent(in) :: distance

    with_effort = error
    if (iterations > many_iterations .or. distance > large_distance) with_effort = max(error, aimed_part)
  end function with_effort
end module attrito_continuation_step_length
