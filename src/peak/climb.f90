!> The peak of a frequency response, its loads held, by points of the response alone: uphill from where the solver stands until the
!> amplitude falls, then between the last two points.
!>
!> Along the response's tangent t the slope is
!>
!> $$ s = A'[c_t]/A = -\tan\varphi, $$
!>
!> lengths being relative changes of the motion and phi the angle from the peak on the circle of a single mode: a step of atan s ends
!> near the peak without any second derivative, and secants close in. A peak may be at a corner, too, at which a contact begins to
!> slip: between a point at which A rises and one at which it falls secants and halvings go on until the tangents of both leave next
!> to nothing of A to be gained; if ends differ however near, the response jumps. Planes stand across the tangent, so folds are
!> passed.
module attrito_peak_climb
  use attrito_core_kinds, only: wp
  use attrito_core_secant, only: secant_share, within
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_solve_rigid_drift, only: mean_share
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type, find_tangent, frequency_tangent, reverse
  use attrito_peak_condition, only: problem_type, direction_type, slope_along, scale_of_motion
  implicit none
  private
  public :: branch_seed_type, climb, close_in, face_uphill, look_around, take_step, first_leap, ripple

  !> What is left to be gained of A, relative
  real(wp), parameter :: accepted_gain = 1.0e-9_wp ! derived
  !> Steps, relative changes of the motion; of the frequency, parts of the band; from prediction to correction
  real(wp), parameter :: longest_step = 0.7_wp, shortest_step = 1.0e-4_wp, most_frequency = 0.05_wp, accepted_error = 0.3_wp ! guess
  integer, parameter :: most_points = 60 ! conventional
  !> Slope at a corner, tan phi, below which it counts as smooth
  real(wp), parameter :: noticeable = 1.0e-2_wp ! guess
  !> Rise and fall between two points, relative, below which they are the same
  real(wp), parameter :: ripple = 1.0e-6_wp ! guess
  !> Relative change of the frequency between a rising and a falling point below which the response jumps there
  real(wp), parameter :: shortest_arc = 1.0e-8_wp ! guess
  !> Where no step is solved: how far to leap, part of the band, doubled so often
  real(wp), parameter :: first_leap = 1.0e-3_wp ! guess
  integer, parameter :: most_leaps = 4 ! conventional

  !> A point of the response, its tangent turned the way that is followed, the slope along it
  type :: branch_seed_type
    type(snapshot_type) :: snapshot
    type(tangent_type) :: tangent
    real(wp) :: slope = 0.0_wp, amplitude = 0.0_wp
    !> Does the tangent change anything but the mean position of a body that no contact holds?
    logical :: is_held = .true.
    !> Of the tangent's scaled length per relative change of the motion
    real(wp) :: unit = 1.0_wp
  end type branch_seed_type

  !> Of an arc between a point where A rises and one where it falls: part of the way, height and slope of log A per way
  type :: arc_end_type
    real(wp) :: part = 0.0_wp, height = 0.0_wp, slope = 0.0_wp
  end type arc_end_type

contains

  !> From the solver's motion and frequency to the nearest peak uphill; the solver stands there, or where it was left.
  subroutine climb(problem, solver, iterations, found, at_corner, early_stop)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Newton's iterations of all points
    integer, intent(out) :: iterations
    !> Is there a peak? Is it a corner?
    logical, intent(out) :: found, at_corner
    !> Give the solver's frequency up after a few iterations of Newton's method? If not given, do not
    logical, intent(in), optional :: early_stop
    type(branch_seed_type) :: here, next
    real(wp) :: length
    integer :: i
    logical :: solved

    found = .false.
    at_corner = .false.
    iterations = 0
    call face_uphill(problem, solver, here, iterations, solved, early_stop)
    if (.not. solved) return
    length = here%unit*atan(here%slope*here%unit)
    do i = 1, most_points
      ! Where a body begins to drift its mean position alone moves: the response ends.
      if (.not. here%is_held) exit
      found = gain_of(here) <= accepted_gain
      if (found) exit
      call step_up(problem, solver, here, length, next, iterations, solved)
      if (.not. solved) exit
      if (next%slope < 0.0_wp) then
        call close_in(problem, solver, here, next, length, iterations, found, at_corner)
        exit
      end if
      length = next_length(here, next, length)
      here = next
    end do
  end subroutine climb

  !> The solver's point, with the tangent along which A rises.
  subroutine face_uphill(problem, solver, here, iterations, solved, early_stop)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The point
    type(branch_seed_type), intent(out) :: here
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is there such a point?
    logical, intent(out) :: solved
    !> Give it up after a few iterations of Newton's method? If not given, do not
    logical, intent(in), optional :: early_stop

    call solver%solve_at(solver%omega, early_stop)
    iterations = iterations + solver%report%iterations
    solved = solver%report%converged
    if (solved) call look_around(problem, solver, frequency_tangent(solver, 1.0_wp), here, solved)
    if (.not. solved .or. here%slope >= 0.0_wp) return
    call reverse(here%tangent)
    here%slope = -here%slope
  end subroutine face_uphill

  !> Tangent and slope where the solver stands.
  subroutine look_around(problem, solver, towards, here, looked)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Tangent of the branch
    type(tangent_type), intent(in) :: towards
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(out) :: here
    !> Could tangent and slope be found?
    logical, intent(out) :: looked
    type(direction_type) :: direction
    integer :: status

    here%snapshot = snapshot_of(solver)
    call find_tangent(solver, towards, here%tangent, status)
    looked = status == 0
    if (.not. looked) return
    here%is_held = here%tangent%share >= mean_share
    associate (context => solver%context, tangent => here%tangent)
      direction%step%motion = context%motion_scale*tangent%motion
      direction%step%omega = context%frequency_scale*tangent%omega
      call slope_along(problem, solver, direction, here%amplitude, here%slope)
      here%slope = here%slope/here%amplitude
      here%unit = scale_of_motion(solver)/max(context%balance%norm(direction%step%motion(2:, :)), tiny(1.0_wp))
    end associate
  end subroutine look_around

  !> What a mode's circle leaves to be gained of log A, -log cos phi.
  pure real(wp) function gain_of(here)
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: here

    gain_of = 0.5_wp*(here%slope*here%unit)**2
  end function gain_of

  !> A step uphill, halved until it is solved near where it was predicted and no maximum is passed.
  subroutine step_up(problem, solver, here, length, next, iterations, solved)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: here
    !> Length of the step
    real(wp), intent(inout) :: length
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(out) :: next
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is the point solved?
    logical, intent(out) :: solved
    real(wp) :: error

    length = min(length, longest_step*here%unit, most_frequency/max(abs(here%tangent%omega), tiny(1.0_wp)))
    do
      call take_step(solver, here, length, error)
      iterations = iterations + solver%report%iterations
      solved = solver%report%converged .and. error <= accepted_error
      if (solved) then
        call look_around(problem, solver, here%tangent, next, solved)
        if (.not. solved .or. .not. misses_maximum(here, next) .or. length < 2.0_wp*shortest_step*here%unit) return
      end if
      call restore(solver, here%snapshot)
      length = 0.5_wp*length
      if (length < shortest_step*here%unit) exit
    end do
    call step_over(solver, here, length, iterations, solved)
    if (solved) call look_around(problem, solver, here%tangent, next, solved)
  end subroutine step_up

  !> Does the amplitude rise at both ends of a step, and is it lower at its end? Then a maximum and a minimum are between.
  pure logical function misses_maximum(here, next)
    !> Points of the response with their tangents and slopes
    type(branch_seed_type), intent(in) :: here, next

    misses_maximum = next%slope >= 0.0_wp .and. next%amplitude < (1.0_wp - ripple)*here%amplitude
  end function misses_maximum

  !> Where no step along the tangent is solved, however short: to a frequency beyond, with all that Newton's method can do.
  subroutine step_over(solver, here, length, iterations, solved)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: here
    !> Length of the step
    real(wp), intent(out) :: length
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is the point solved?
    logical, intent(out) :: solved
    integer :: i

    length = first_leap/max(abs(here%tangent%omega), tiny(1.0_wp))
    do i = 1, most_leaps
      call solver%solve_at(here%snapshot%omega + length*solver%context%frequency_scale*here%tangent%omega)
      iterations = iterations + solver%report%iterations
      solved = solver%report%converged
      if (solved) exit
      call restore(solver, here%snapshot)
      length = 2.0_wp*length
    end do
  end subroutine step_over

  !> Along the tangent and in the plane across it. `error`: from prediction to correction, relative to the motion.
  subroutine take_step(solver, here, length, error)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: here
    !> Length of the step
    real(wp), intent(in) :: length
    !> Distance from prediction to correction, relative to the motion
    real(wp), intent(out) :: error
    type(constraint_type) :: constraint
    real(wp), allocatable :: moved(:, :)

    associate (context => solver%context, tangent => here%tangent)
      solver%motion = solver%motion + length*context%motion_scale*tangent%motion
      solver%omega = solver%omega + length*context%frequency_scale*tangent%omega
      associate (periodic => spread(here%snapshot%periodic, 1, size(tangent%slider, 1)))
        call solver%set_slider(here%snapshot%slider + length*context%motion_scale*merge(tangent%slider, 0.0_wp, periodic), &
                               here%snapshot%periodic)
      end associate
      constraint%motion = tangent%motion/context%motion_scale
      constraint%frequency = tangent%omega/context%frequency_scale
      constraint%value = inner_product(context%balance, constraint%motion, solver%motion) + constraint%frequency*solver%omega
      moved = solver%motion
      ! A step that fails is cut in half: nothing else need be tried.
      call solver%solve_with(constraint, early_stop=.true.)
      moved = solver%motion - moved
      error = context%balance%norm(moved(2:, :))/max(scale_of_motion(solver), tiny(1.0_wp))
    end associate
  end subroutine take_step

  !> To where the secant through the slopes' angles at the last two points says that the peak is.
  pure real(wp) function next_length(before, here, length)
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: before, here
    !> Between them
    real(wp), intent(in) :: length
    real(wp) :: angle, fall

    angle = atan(here%slope*here%unit)
    fall = atan(before%slope*before%unit) - angle
    next_length = 2.0_wp*length
    if (fall > 0.0_wp) next_length = min(angle/fall*length, 4.0_wp*max(here%unit*angle, length))
  end function next_length

  !> The peak between a point where A rises and one where it falls: smooth, or a corner once tangents at both ends leave next to
  !> nothing to be gained. Where no plane between them is solved, frequencies are.
  subroutine close_in(problem, solver, rising, falling, length, iterations, found, at_corner)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: rising, falling
    !> From one to the other, along the tangent of the first
    real(wp), intent(in) :: length
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is there a peak? Is it a corner?
    logical, intent(out) :: found, at_corner
    type(step_type) :: step
    type(branch_seed_type) :: at, seeds(2)
    type(arc_end_type) :: ends(2)
    real(wp) :: s
    integer :: try
    logical :: solved

    call step%take(rising%snapshot, solver, rising%tangent)
    seeds = [rising, falling]
    ends(1) = arc_end_type(0.0_wp, 0.0_wp, length*rising%slope)
    ends(2) = arc_end_type(1.0_wp, log(falling%amplitude/rising%amplitude), length*falling%slope)
    at = falling
    do try = 1, most_points
      call judge(at, ends, seeds, found, at_corner)
      if (found) exit
      s = next_part(ends, modulo(try, 2) == 0)
      call step%solve_part(solver, s, solved, early_stop=.true.)
      iterations = iterations + solver%report%iterations
      if (solved) call look_around(problem, solver, rising%tangent, at, solved)
      if (.not. solved) exit
      call replace(at, arc_end_type(s, log(at%amplitude/rising%amplitude), length*at%slope), seeds, ends)
      if (.not. is_concave(ends)) exit
    end do
    if (.not. found) then
      call close_in_frequency(problem, solver, seeds, iterations, found, at_corner)
    else
      call restore(solver, seeds(maxloc(seeds%amplitude, 1))%snapshot)
    end if
  end subroutine close_in

  !> The same by frequencies, with all that Newton's method can do, each from the rising point as along a sweep. Where the ends stay
  !> apart in height the response jumps: there the higher one is the peak.
  subroutine close_in_frequency(problem, solver, seeds, iterations, found, at_corner)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> A point where A rises, and one where it falls
    type(branch_seed_type), intent(inout) :: seeds(2)
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is there a peak? Is it a corner?
    logical, intent(out) :: found, at_corner
    type(branch_seed_type) :: at
    type(arc_end_type) :: ends(2)
    real(wp) :: first, width, reference, s
    integer :: try
    logical :: solved

    found = .false.
    at_corner = .false.
    ! Round a fold a frequency says nothing of the place along the arc.
    if (seeds(1)%tangent%omega*seeds(2)%tangent%omega <= 0.0_wp) return
    first = seeds(1)%snapshot%omega
    width = seeds(2)%snapshot%omega - first
    if (width*seeds(1)%tangent%omega <= 0.0_wp) return
    reference = seeds(1)%amplitude
    ends = [end_of(seeds(1)), end_of(seeds(2))]
    at = seeds(2)
    do try = 1, most_points
      call judge(at, ends, seeds, found, at_corner)
      if (found) exit
      if ((ends(2)%part - ends(1)%part)*abs(width) < shortest_arc*first) then
        found = .true.
        at_corner = .true.
        exit
      end if
      s = 0.5_wp*(ends(1)%part + ends(2)%part)
      if (is_concave(ends)) s = next_part(ends, modulo(try, 2) == 0)
      call restore(solver, seeds(1)%snapshot)
      call solve_by_strategies(solver, first + s*width)
      iterations = iterations + solver%report%iterations
      solved = solver%report%converged
      if (solved) call look_around(problem, solver, frequency_tangent(solver, sign(1.0_wp, width)), at, solved)
      if (.not. solved) return
      call replace(at, end_of(at), seeds, ends)
    end do
    if (found) call restore(solver, seeds(maxloc(seeds%amplitude, 1))%snapshot)

  contains

    type(arc_end_type) function end_of(seed)
      !> Point of the response with its tangent and slope
      type(branch_seed_type), intent(in) :: seed

      end_of = arc_end_type((seed%snapshot%omega - first)/width, log(seed%amplitude/reference), &
                            seed%slope*width/(seed%tangent%omega*solver%context%frequency_scale))
    end function end_of
  end subroutine close_in_frequency

  !> Is a peak enclosed well enough?
  pure subroutine judge(at, ends, seeds, found, at_corner)
    !> The last point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: at
    !> Ends of an arc: part of the way, height and slope
    type(arc_end_type), intent(in) :: ends(2)
    !> The points there, one where A rises and one where it falls
    type(branch_seed_type), intent(in) :: seeds(2)
    !> Is there a peak? Is it a corner?
    logical, intent(out) :: found, at_corner
    real(wp) :: rise

    found = gain_of(at) <= accepted_gain .and. is_concave(ends)
    at_corner = .false.
    if (found) return
    rise = ends(2)%height - ends(1)%height
    found = is_concave(ends) .and. gain_between(ends, max(ends(1)%height, ends(2)%height)) <= accepted_gain
    ! Points from unlike sliders are not of one arc to the last digit.
    found = found .or. abs(rise) + (ends(2)%part - ends(1)%part)*sum(abs(ends%slope)) <= ripple
    at_corner = found .and. maxval(abs(seeds%slope*seeds%unit)) > noticeable
  end subroutine judge

  !> A new point takes the place of the end of its sign.
  subroutine replace(at, end, seeds, ends)
    !> Point of the response with its tangent and slope; as an end of an arc
    type(branch_seed_type), intent(in) :: at
    type(arc_end_type), intent(in) :: end
    !> A point where A rises, and one where it falls; ends of the arc
    type(branch_seed_type), intent(inout) :: seeds(2)
    type(arc_end_type), intent(inout) :: ends(2)
    integer :: side

    side = merge(1, 2, end%slope > 0.0_wp)
    seeds(side) = at
    ends(side) = end
  end subroutine replace

  !> Does either end lie below the tangent at the other? Both are of one concave arc then.
  pure logical function is_concave(ends)
    !> Ends of an arc: part of the way, height and slope
    type(arc_end_type), intent(in) :: ends(2)
    real(wp) :: length, rise

    length = ends(2)%part - ends(1)%part
    rise = ends(2)%height - ends(1)%height
    is_concave = rise <= length*ends(1)%slope + accepted_gain .and. rise >= length*ends(2)%slope - accepted_gain
  end function is_concave

  !> Where the tangents at both ends meet: the corner, if the arc is two smooth ones, and about the middle of a smooth arc.
  pure real(wp) function corner_of(ends)
    !> Ends of an arc: part of the way, height and slope
    type(arc_end_type), intent(in) :: ends(2)
    real(wp) :: length

    length = ends(2)%part - ends(1)%part
    corner_of = (ends(2)%height - ends(1)%height - length*ends(2)%slope)/(ends(1)%slope - ends(2)%slope)
    corner_of = ends(1)%part + min(max(corner_of, 0.0_wp), length)
  end function corner_of

  !> What is left to be gained of log A: a concave arc lies below its tangents.
  pure real(wp) function gain_between(ends, best)
    !> Ends of an arc: part of the way, height and slope
    type(arc_end_type), intent(in) :: ends(2)
    !> The largest height so far
    real(wp), intent(in) :: best

    gain_between = ends(1)%height + ends(1)%slope*(corner_of(ends) - ends(1)%part) - best
  end function gain_between

  !> Where the slope vanishes by the secant, or where the tangents meet; off the ends, so that both close in.
  pure real(wp) function next_part(ends, by_tangents)
    !> Ends of an arc: part of the way, height and slope
    type(arc_end_type), intent(in) :: ends(2)
    !> Go by the tangents at both ends?
    logical, intent(in) :: by_tangents
    !> A guess within an arc keeps off its ends by this part
    real(wp), parameter :: off = 0.01_wp ! conventional
    real(wp) :: length, share

    length = ends(2)%part - ends(1)%part
    share = secant_share(ends%slope)
    if (by_tangents) share = (corner_of(ends) - ends(1)%part)/length
    next_part = ends(1)%part + within(share, off)*length
  end function next_part
end module attrito_peak_climb
