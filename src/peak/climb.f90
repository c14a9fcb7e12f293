!> The peak of a frequency response, its loads held, by points of the response alone: uphill from where the solver stands until the
!> amplitude falls, then between the last two points.
!>
!> Along the response's tangent t the slope is
!>
!> $$ s = A'[c_t]/A = -\tan\varphi, $$
!>
!> lengths being relative changes of the motion and phi the angle from the peak on the circle of a single mode: a step of atan s ends
!> near the peak without any second derivative, and secants close in. Of samples s jumps a little wherever one of them begins to slip,
!> and peaks are at corners too, where a contact does: between a point at which A rises and one at which it falls secants and halvings
!> go on until the tangents of both leave next to nothing of A to be gained. Planes stand across the tangent, so folds are passed.
module attrito_peak_climb
  use attrito_core_kinds, only: wp
  use attrito_core_secant, only: secant_share, within
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type, find_tangent, frequency_tangent, reverse
  use attrito_peak_condition, only: problem_type, direction_type, slope_along, scale_of_motion
  implicit none
  private
  public :: climb

  !> What is left to be gained of A, relative
  real(wp), parameter :: accepted_gain = 1.0e-9_wp ! derived
  !> Steps, relative changes of the motion; of the frequency, parts of the band; from prediction to correction
  real(wp), parameter :: longest_step = 0.7_wp, shortest_step = 1.0e-4_wp, most_frequency = 0.05_wp, accepted_error = 0.3_wp ! guess
  integer, parameter :: most_points = 60 ! conventional
  !> Where no step is solved: how far to leap, part of the band, doubled so often
  real(wp), parameter :: first_leap = 1.0e-3_wp ! guess
  integer, parameter :: most_leaps = 4 ! conventional

  !> A point of the response, its tangent turned the way that is followed, the slope along it
  type :: branch_seed_type
    type(snapshot_type) :: snapshot
    type(tangent_type) :: tangent
    real(wp) :: slope = 0.0_wp, amplitude = 0.0_wp
    !> Of the tangent's scaled length per relative change of the motion
    real(wp) :: unit = 1.0_wp
  end type branch_seed_type

  !> Of an arc between a point where A rises and one where it falls: part of the way, height and slope of log A per way
  type :: arc_end_type
    real(wp) :: part = 0.0_wp, height = 0.0_wp, slope = 0.0_wp
  end type arc_end_type

contains

  !> From the solver's motion and frequency to the nearest peak uphill; the solver stands there, or where it was left.
  subroutine climb(problem, solver, iterations, found)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Newton's iterations of all points
    integer, intent(out) :: iterations
    !> Is there a peak?
    logical, intent(out) :: found
    type(branch_seed_type) :: here, next
    real(wp) :: length
    integer :: i
    logical :: solved

    found = .false.
    call solver%solve_at(solver%omega)
    iterations = solver%report%iterations
    if (.not. solver%report%converged) return
    call look_around(problem, solver, frequency_tangent(solver, 1.0_wp), here, solved)
    if (.not. solved) return
    if (here%slope < 0.0_wp) then
      call reverse(here%tangent)
      here%slope = -here%slope
    end if
    length = here%unit*atan(here%slope*here%unit)
    do i = 1, most_points
      found = gain_of(here) <= accepted_gain
      if (found) exit
      call step_up(problem, solver, here, length, next, iterations, solved)
      if (.not. solved) exit
      if (next%slope < 0.0_wp) then
        call close_in(problem, solver, here, next, length, iterations, found)
        exit
      end if
      length = next_length(here, next, length)
      here = next
    end do
  end subroutine climb

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

  !> A step uphill, halved until it is solved near where it was predicted.
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
      if (solved) exit
      call restore(solver, here%snapshot)
      length = 0.5_wp*length
      if (length < shortest_step*here%unit) exit
    end do
    if (.not. solved) call step_over(solver, here, length, iterations, solved)
    if (solved) call look_around(problem, solver, here%tangent, next, solved)
  end subroutine step_up

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

  !> The peak between a point where A rises and one where it falls.
  subroutine close_in(problem, solver, rising, falling, length, iterations, found)
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
    !> Is there a peak?
    logical, intent(out) :: found
    type(step_type) :: step
    type(branch_seed_type) :: at
    type(arc_end_type) :: ends(2), end, best
    type(snapshot_type) :: highest
    real(wp) :: s
    integer :: try

    call step%take(rising%snapshot, solver, rising%tangent)
    ends = [arc_end_type(0.0_wp, 0.0_wp, rising%slope), arc_end_type(1.0_wp, log(falling%amplitude/rising%amplitude), falling%slope)]
    ends%slope = length*ends%slope
    best = ends(1)
    highest = rising%snapshot
    if (ends(2)%height > 0.0_wp) then
      best = ends(2)
      highest = falling%snapshot
    end if
    do try = 1, most_points
      found = gain_of(falling) <= accepted_gain .or. gain_between(ends, best) <= accepted_gain
      if (found) exit
      s = next_part(ends, modulo(try, 2) == 0)
      call step%solve_part(solver, s, found, early_stop=.true.)
      iterations = iterations + solver%report%iterations
      if (.not. found) return
      call look_around(problem, solver, rising%tangent, at, found)
      if (.not. found) return
      end = arc_end_type(s, log(at%amplitude/rising%amplitude), length*at%slope)
      if (end%height > best%height) then
        best = end
        highest = at%snapshot
      end if
      if (gain_of(at) <= accepted_gain) exit
      ends(merge(1, 2, at%slope > 0.0_wp)) = end
    end do
    if (found) call restore(solver, highest)
  end subroutine close_in

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
    type(arc_end_type), intent(in) :: ends(2), best

    gain_between = ends(1)%height + ends(1)%slope*(corner_of(ends) - ends(1)%part) - best%height
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
