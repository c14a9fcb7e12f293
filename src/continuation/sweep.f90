!> A sweep over frequency along branches of solutions, which may fold: from a start to a stop, point by point.
!>
!> If no step along the branch converges, if the branch ends, closes upon itself or runs back over the start, the sweep looks for
!> another one from the static solution, at frequencies beyond those that it has reached, farther and farther away, and only at its
!> stop at any cost. What it finds is followed back to where it ends, in silence, and from there on point by point, as a branch with
!> a number of its own; points are expected where they were found on the way back. A sweep that follows a single branch ends with it,
!> one that looks for a gap at what is not solved.
module attrito_continuation_sweep
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_newton_newton, only: newton_report_type
  use attrito_continuation_closed_branch, only: closes_on_itself
  use attrito_continuation_stored_points, only: stored_points_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_continuation_predictor, only: predictor_type
  use attrito_continuation_range, only: range_type
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_step_length, only: smallest_step
  use attrito_continuation_stepper, only: stepper_type
  use attrito_continuation_stuck_branch, only: follow_stuck
  use attrito_continuation_tangent, only: tangent_type, frequency_tangent
  implicit none
  private
  public :: sweep_type, new_sweep, new_branch_sweep

  !> Part of the range to go on by once the branch is lost; twice as much after each frequency at which nothing is found
  real(wp), parameter :: jump = 0.01_wp ! guess
  !> Points of a branch that is followed back, at most; part of the motion in which one that was lost is the same
  integer, parameter :: most_back = 300 ! guess
  real(wp), parameter :: same_motion = 0.1_wp ! guess
  !> Steps after which a branch may have come back to where it was begun
  integer, parameter :: fewest_steps = 4 ! guess

  type :: sweep_type
    type(range_type) :: range
    integer :: branch = 0, points = 0, max_points = 1000
    logical :: finished = .false.
    !> Did it end at its stop? Did the branch close upon itself?
    logical :: reached_stop = .false., closed = .false.
    !> Steps along the branch
    type(stepper_type) :: stepper
    !> Is the first frequency without a solution what it looks for? That is tried at any cost, from where the branch was lost
    logical :: to_gap = .false.
    !> Does it follow one branch only, from the solver's point when it began, and end where that is lost?
    logical, private :: one_branch = .false.
    !> Is it a way back, points of which are kept beside it? Contacts stay on their ranks then
    logical, private :: in_silence = .false.
    !> Is the solver on a branch, and what is the first point of that? Steps since then
    logical, private :: on_branch = .false.
    type(stored_points_type), private :: start
    integer, private :: steps = 0
    !> The point beyond a lost branch that the present one was found by: it begins there if it is lost on the way
    type(stored_points_type), private :: found
    !> Harmonics that it began with
    integer, private :: first_harmonics = 0
    !> The extreme angular frequency that the sweep has reached
    real(wp), private :: reach = 0.0_wp
  contains
    procedure :: advance
    procedure :: look_ahead
    procedure :: look_here
    procedure :: set_harmonics
    procedure :: keep
  end type sweep_type

contains

  !> A sweep of the solver's present loads from one angular frequency to another.
  function new_sweep(solver, start, stop, branch, max_points) result(self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency to begin at, rad/s; angular frequency to end at, rad/s
    real(wp), intent(in) :: start, stop
    !> Number of the branch; most points
    integer, intent(in) :: branch, max_points
    type(sweep_type) :: self

    self%range = range_type(start, stop)
    self%branch = branch
    self%max_points = max_points
    self%first_harmonics = solver%options%harmonics
    call self%stepper%begin(sign(1.0_wp, stop - start))
    call solver%set_scales(start, stop)
  end function new_sweep

  !> A sweep along the one branch through the solver's present point, in a direction, until it leaves a range, closes, or is lost.
  function new_branch_sweep(solver, start, stop, towards, branch, max_points) result(self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency to begin at, rad/s; angular frequency to end at, rad/s
    real(wp), intent(in) :: start, stop
    !> Tangent of the branch
    type(tangent_type), intent(in) :: towards
    !> Number of the branch; most points
    integer, intent(in) :: branch, max_points
    type(sweep_type) :: self

    self = new_sweep(solver, start, stop, branch, max_points)
    self%one_branch = .true.
    call self%stepper%begin(sign(1.0_wp, towards%omega))
    self%stepper%tangent = towards
  end function new_branch_sweep

  !> Save or load what the next point depends on.
  subroutine keep(self, store)
    class(sweep_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call self%range%keep(store)
    call store%keep(self%branch)
    call store%keep(self%points)
    call store%keep(self%max_points)
    call store%keep(self%finished)
    call store%keep(self%reached_stop)
    call store%keep(self%closed)
    call self%stepper%keep(store)
    call store%keep(self%to_gap)
    call store%keep(self%one_branch)
    call store%keep(self%on_branch)
    call self%start%keep(store)
    call self%found%keep(store)
    call store%keep(self%steps)
    call store%keep(self%reach)
    call store%keep(self%first_harmonics)
  end subroutine keep

  !> Solve the next point; the solver's report says how it ended.
  subroutine advance(self, solver)
    class(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    integer :: branch

    if (self%points > 0 .and. .not. self%in_silence) call self%stepper%share_out(solver)
    if (self%points == 0 .and. self%one_branch) then
      call begin_here(self, solver)
    else if (self%points == 0) then
      call begin_at(self, solver, self%range%start, .false.)
    else if (self%on_branch .and. .not. is_back_at_start(self, solver)) then
      branch = self%branch
      call follow(self, solver)
      if (self%branch == branch) call watch_closing(self, solver)
    else
      call begin_past(self, solver)
    end if
    self%points = self%points + 1
    if (self%one_branch .and. (is_back_at_start(self, solver) .or. .not. self%on_branch)) self%finished = .true.
    self%reach = merge(max(self%reach, solver%omega), min(self%reach, solver%omega), self%range%width() > 0.0_wp)
    if (self%points >= self%max_points) self%finished = .true.
    if (.not. self%stepper%looked_ahead) call self%stepper%look_here(solver)
  end subroutine advance

  !> The point of the sweep was solved again, finer: the curve goes through it.
  subroutine look_here(self, solver)
    class(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    call self%stepper%look_here(solver)
  end subroutine look_here

  !> Resize stored vectors to so many harmonics.
  subroutine set_harmonics(self, harmonics)
    class(sweep_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    call self%stepper%set_coefficients(2*harmonics + 1)
  end subroutine set_harmonics

  !> Find a point at a frequency, and the branch's tangent there; a point that is not found still moves the sweep on.
  subroutine begin_at(self, solver, omega, at_little_cost)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Only by strategies of little cost?
    logical, intent(in) :: at_little_cost
    real(wp) :: target

    target = omega
    if (self%range%passes_stop(omega + smallest_step*self%range%width())) target = self%range%stop
    call solve_by_strategies(solver, target, at_little_cost)
    solver%omega = target
    call self%stepper%begin(sign(1.0_wp, self%range%width()))
    self%reached_stop = abs(target - self%range%stop) <= 0.0_wp
    self%finished = self%reached_stop
    self%on_branch = solver%report%converged
    self%closed = .false.
    self%steps = 0
    self%reach = target
    call self%start%drop_from(1)
    call self%start%add(solver, .false.)
  end subroutine begin_at

  !> The first point of the branch: the solver's present one.
  subroutine begin_here(self, solver)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    call solver%solve_at(solver%omega)
    self%on_branch = solver%report%converged
    self%reach = solver%omega
    call self%start%drop_from(1)
    call self%start%add(solver, .false.)
  end subroutine begin_here

  !> A branch that comes back to where it was begun is complete; a sweep goes on beyond it.
  subroutine watch_closing(self, solver)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(newton_report_type) :: report

    self%steps = self%steps + 1
    if (.not. self%on_branch .or. self%finished .or. self%steps < fewest_steps) return
    report = solver%report
    self%closed = closes_on_itself(self%start, solver, self%stepper%last)
    if (.not. self%closed) then
      solver%report = report
      return
    end if
    solver%report%iterations = report%iterations + solver%report%iterations
    self%stepper%looked_ahead = .false.
    self%on_branch = .false.
    self%finished = self%one_branch
  end subroutine watch_closing

  !> The branch was lost or left the range: look for another beyond the frequencies that the sweep has reached, from the static
  !> solution and on the series that the sweep began with, and begin at its other end.
  subroutine begin_past(self, solver)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(snapshot_type) :: lost
    real(wp) :: reach, gap
    integer :: iterations

    lost = snapshot_of(solver)
    self%branch = self%branch + 1
    reach = self%reach
    gap = jump
    iterations = 0
    if (self%to_gap) then
      call begin_at(self, solver, reach + gap*self%range%width(), at_little_cost=.false.)
      return
    end if
    call solver%set_harmonics(self%first_harmonics)
    if (is_ahead(self)) then
      call begin_at_found(self, solver)
      return
    end if
    do
      call solver%rest()
      call begin_at(self, solver, reach + gap*self%range%width(), &
                    at_little_cost=.not. self%range%passes_stop(reach + gap*self%range%width()))
      iterations = iterations + solver%report%iterations
      if (self%on_branch .or. self%finished) exit
      gap = 2.0_wp*gap
    end do
    if (self%on_branch) then
      call go_back(self, solver, lost)
      self%reach = reach
    end if
    solver%report%iterations = iterations + solver%report%iterations
  end subroutine begin_past

  !> Was the last branch found at a frequency that it has not come to?
  pure logical function is_ahead(self)
    type(sweep_type), intent(in) :: self

    is_ahead = self%found%count > 0
    if (is_ahead) is_ahead = (self%found%points(1)%omega - self%reach)*self%range%width() > 0.0_wp
  end function is_ahead

  !> Begin a branch where the last one was found: members of a family that end elsewhere lead there and back, again and again.
  subroutine begin_at_found(self, solver)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    call self%found%restore_point(solver, 1)
    call self%found%drop_from(1)
    call self%stepper%begin(sign(1.0_wp, self%range%width()))
    self%closed = .false.
    self%steps = 0
    call note_end(self, solver%omega)
    call begin_here(self, solver)
  end subroutine begin_at_found

  !> Follow the branch through the solver's point back, in silence, to where it ends or meets the one that was lost, and begin there.
  subroutine go_back(self, solver, lost)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Last point of the branch that was lost
    type(snapshot_type), intent(in) :: lost
    type(sweep_type) :: back
    type(snapshot_type) :: last
    type(tangent_type) :: onward
    type(predictor_type) :: ahead
    integer :: iterations

    call self%found%drop_from(1)
    call self%found%add(solver, .false.)
    back = new_branch_sweep(solver, self%range%start, self%range%stop, frequency_tangent(solver, -self%stepper%direction), &
                            self%branch, most_back)
    back%stepper%tolerance = self%stepper%tolerance
    back%in_silence = .true.
    last = snapshot_of(solver)
    iterations = 0
    do while (.not. back%finished)
      call back%advance(solver)
      iterations = iterations + solver%report%iterations
      if (.not. solver%report%converged) exit
      if (back%points > 1) call ahead%put_ahead(last%motion, last%omega)
      call last%take(solver)
      if (back%points > 1 .and. is_same(solver, lost, back%stepper%last%from%omega)) exit
    end do
    if (back%points > 2) then
      onward = back%stepper%tangent_backwards(solver)
      call self%stepper%begin(sign(1.0_wp, onward%omega))
      self%stepper%tangent = onward
      call self%stepper%take_ahead(ahead)
      self%finished = .false.
      self%reached_stop = .false.
    end if
    call restore(solver, last)
    call begin_here(self, solver)
    solver%report%iterations = iterations + solver%report%iterations
  end subroutine go_back

  !> Is the solver at the point of a branch that was lost, or has its last step passed it?
  logical function is_same(solver, lost, omega)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Last point of the branch
    type(snapshot_type), intent(in) :: lost
    !> Angular frequency that the last step began at, rad/s
    real(wp), intent(in) :: omega

    is_same = .false.
    if ((solver%omega - lost%omega)*(omega - lost%omega) > 0.0_wp) return
    associate (balance => solver%context%balance, motion => resized(lost%motion, size(solver%motion, 1)))
      is_same = balance%norm(solver%motion(2:, :) - motion(2:, :)) <= same_motion*balance%norm(motion(2:, :))
    end associate
  end function is_same

  !> One accepted step along the branch, the sweep's last point, or, where no step converges, a point beyond.
  subroutine follow(self, solver)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(snapshot_type) :: before
    real(wp) :: error
    integer :: iterations
    logical :: accepted

    call follow_stuck(self%stepper, self%range, solver, accepted)
    if (accepted) then
      call note_end(self, solver%omega)
      return
    end if
    call before%take(solver)
    call self%stepper%look_ahead(solver)
    if (.not. self%stepper%looked_ahead) then
      call lose_branch(self, solver)
      return
    end if
    call self%stepper%take_step(solver, before, error, iterations, accepted)
    if (accepted) then
      call self%stepper%adapt(error)
      self%on_branch = .not. self%stepper%is_drifting(solver)
      solver%report%iterations = iterations
      call end_at_range(self, solver, before)
    else
      call lose_branch(self, solver)
      solver%report%iterations = iterations + solver%report%iterations
    end if
  end subroutine follow

  !> No step from here converges: the sweep looks for a point beyond; a sweep along one branch has ended.
  subroutine lose_branch(self, solver)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    if (.not. self%one_branch) then
      call begin_past(self, solver)
    else
      solver%report%converged = .false.
      solver%evidence%no_periodic_solution = .false.
      solver%omega = solver%omega + smallest_step*self%range%width()
      self%on_branch = .false.
    end if
    self%stepper%last = step_type()
    self%stepper%looked_ahead = .false.
  end subroutine lose_branch

  !> A step over an end of the range is taken back to the end itself.
  subroutine end_at_range(self, solver, before)
    type(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Before the step
    type(snapshot_type), intent(in) :: before
    real(wp) :: target
    integer :: iterations

    if (.not. self%range%is_left(solver%omega)) return
    target = self%range%clipped(solver%omega)
    call note_end(self, target)
    iterations = solver%report%iterations
    solver%motion = before%motion + (target - before%omega)/(solver%omega - before%omega)*(solver%motion - before%motion)
    solver%omega = before%omega
    call solver%set_slider(before%slider, before%periodic)
    call solve_by_strategies(solver, target)
    solver%omega = target
    if (solver%report%converged) call self%stepper%remember_in_frequency(solver, before)
    solver%report%iterations = iterations + solver%report%iterations
  end subroutine end_at_range

  !> A sweep that comes to its stop is finished.
  pure subroutine note_end(self, omega)
    type(sweep_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega

    self%reached_stop = abs(omega - self%range%stop) <= 0.0_wp
    self%finished = self%reached_stop
  end subroutine note_end

  !> Has the branch run back over where the sweep began?
  pure logical function is_back_at_start(self, solver)
    type(sweep_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    is_back_at_start = self%steps > 0 .and. abs(solver%omega - self%range%start) <= 0.0_wp
  end function is_back_at_start

  !> Whether the frequency turned on the last step, `stepper%turned`. The evaluation of the last point is overwritten.
  subroutine look_ahead(self, solver)
    class(sweep_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    if (self%on_branch) then
      call self%stepper%look_ahead(solver)
    else
      self%stepper%turned = .false.
    end if
  end subroutine look_ahead
end module attrito_continuation_sweep
