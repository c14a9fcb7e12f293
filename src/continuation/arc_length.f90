!> A branch of solutions over frequency, followed by arc-length so that it may fold.
!>
!> $$ r(d, \omega) = 0, \qquad t \cdot (d - \hat d) + t_\omega (\omega - \hat \omega) = 0 $$
!>
!> The plane stands across the tangent t at the predicted point. The step follows the distance between predicted and corrected
!> point, a smooth measure, so that rounding (the number of ranks) does not change it.
!> Source: Keller 1977; Seydel 2010, doi:10.1007/978-1-4419-1740-9.
module attrito_continuation_arc_length
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_balance_border, only: constraint_type, inner_product
  use attrito_continuation_attempts, only: nothing_holds
  use attrito_continuation_closed_branch, only: comes_home
  use attrito_continuation_known_points, only: known_points_type
  use attrito_continuation_cascade, only: solve_by_cascade, place_type, return_to
  use attrito_continuation_rebalancing, only: field_type, rebalance
  use attrito_continuation_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type, find_tangent, frequency_tangent, turn_round
  implicit none
  private
  public :: sweep_type, new_sweep, new_branch_sweep

  !> Distance of predicted from corrected point, relative to the response, that the step aims at, and that it still accepts
  real(wp), parameter :: aimed_error = 0.02_wp, accepted_error = 0.2_wp
  !> Steps as parts of the sweep
  real(wp), parameter :: first_step = 0.01_wp, smallest_step = 1.0e-6_wp
  !> Part of the sweep to move on by where the branch was lost
  real(wp), parameter :: jump = 0.01_wp
  !> Steps after which a branch may have come back to where it was begun
  integer, parameter :: fewest_steps = 4
  !> Steps in a row of which but this part is anything but a mean position, after which a body is taken to walk away: past the end of
  !> its branch friction no longer balances over the period, and no solution repeats
  real(wp), parameter :: walking_share = 1.0e-3_wp
  !> The same where every contact slips: friction then balances at single frequencies, and rounding makes a branch of these
  real(wp), parameter :: drifting_share = 0.5_wp
  integer, parameter :: most_walking = 6
  !> Cosine between successive steps below which the branch is taken to run back on itself
  real(wp), parameter :: turned_back = -0.95_wp

  type :: sweep_type
    !> Ends, angular frequency; range that it must stay in
    real(wp) :: start = 0.0_wp, stop = 0.0_wp
    real(wp) :: largest_step = 0.04_wp
    integer :: branch = 0, points = 0, max_points = 1000
    logical :: finished = .false.
    !> Did it end at its stop? Did the branch close upon itself?
    logical :: reached_stop = .false., closed = .false.
    !> Does it follow one branch only, from where the solver stood when it began, and end where that is lost?
    logical :: one_branch = .false.
    !> Where the branch was begun
    type(known_points_type), private :: home
    integer, private :: steps = 0
    !> The farthest that the branch went, angular frequency
    real(wp), private :: farthest = 0.0_wp
    real(wp), private :: step = first_step
    !> The last step that was accepted; does the frequency turn on it, as `look_ahead` finds?
    type(step_type) :: last
    logical :: turned = .false.
    !> Tangent at the present point once it was asked for, before that at the point before
    type(tangent_type) :: tangent
    logical, private :: looked_ahead = .false.
    !> Last step taken, scaled, of unit length
    real(wp), allocatable, private :: secant(:, :)
    real(wp), private :: secant_omega = 0.0_wp
    !> Which way the last step went in frequency: 1 or -1
    real(wp), private :: way = 1.0_wp
    !> While every contact sticks: the last step's change of the response with omega [n, 0:H]
    complex(wp), allocatable, private :: slope(:, :)
    logical, private :: on_branch = .false.
    !> Steps in a row in which hardly more than mean positions changed
    integer, private :: walking = 0
  contains
    procedure :: advance
    procedure :: keep
    procedure :: set_harmonics
    procedure :: look_ahead
    procedure :: way_back
    procedure :: end_last_step_at
  end type sweep_type

contains

  !> A sweep of the solver's present loads from one angular frequency to another.
  function new_sweep(solver, start, stop, branch, max_points) result(self)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: start, stop
    integer, intent(in) :: branch, max_points
    type(sweep_type) :: self

    self%start = start
    self%stop = stop
    self%branch = branch
    self%max_points = max_points
    self%way = sign(1.0_wp, stop - start)
    call solver%set_scales(start, stop)
  end function new_sweep

  !> A sweep along the one branch that the solver stands on, from there in a direction until it leaves a range, closes, or is lost.
  function new_branch_sweep(solver, start, stop, towards, branch, max_points) result(self)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: start, stop
    type(tangent_type), intent(in) :: towards
    integer, intent(in) :: branch, max_points
    type(sweep_type) :: self

    self = new_sweep(solver, start, stop, branch, max_points)
    self%one_branch = .true.
    self%tangent = towards
    self%way = sign(1.0_wp, towards%omega)
  end function new_branch_sweep

  !> The direction back from the present point.
  function way_back(self, solver) result(towards)
    class(sweep_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(tangent_type) :: towards

    towards = frequency_tangent(solver, -self%way)
    if (.not. allocated(self%secant)) return
    towards%motion = -self%secant
    towards%omega = -self%secant_omega
  end function way_back

  !> What a point leaves for the next: put down after it, or taken up in its place.
  subroutine keep(self, store)
    class(sweep_type), intent(inout) :: self
    type(state_store_type), intent(inout) :: store

    call store%keep(self%start)
    call store%keep(self%stop)
    call store%keep(self%branch)
    call store%keep(self%points)
    call store%keep(self%max_points)
    call store%keep(self%finished)
    call store%keep(self%reached_stop)
    call store%keep(self%closed)
    call store%keep(self%one_branch)
    call self%home%keep(store)
    call store%keep(self%steps)
    call store%keep(self%farthest)
    call store%keep(self%step)
    call self%last%keep(store)
    call store%keep(self%turned)
    call self%tangent%keep(store)
    call store%keep(self%looked_ahead)
    call store%keep(self%secant)
    call store%keep(self%secant_omega)
    call store%keep(self%way)
    call store%keep(self%slope)
    call store%keep(self%on_branch)
    call store%keep(self%walking)
  end subroutine keep

  !> Solve the next point; the solver's report says how it ended.
  subroutine advance(self, solver)
    class(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    if (self%points > 0) call share_out(self, solver)
    if (self%points == 0 .and. self%one_branch) then
      call begin_here(self, solver)
    else if (self%points == 0) then
      call begin_at(self, solver, self%start)
    else if (self%on_branch) then
      call follow(self, solver)
      call watch_closing(self, solver)
    else
      call begin_beyond(self, solver)
    end if
    self%points = self%points + 1
    if (self%one_branch .and. .not. self%on_branch) self%finished = .true.
    self%farthest = merge(max(self%farthest, solver%omega), min(self%farthest, solver%omega), self%stop > self%start)
    if (self%points >= self%max_points) self%finished = .true.
  end subroutine advance

  !> Let the last step end where the solver stands, which may be more finely solved than the step was.
  subroutine end_last_step_at(self, solver)
    class(sweep_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver

    if (.not. self%last%is_taken()) return
    call self%last%to%mark(solver)
    self%last%from%motion = resized(self%last%from%motion, size(solver%motion, 1))
    associate (across => self%last%across)
      if (allocated(across%motion)) across%motion = resized(across%motion, size(solver%motion, 1))
    end associate
  end subroutine end_last_step_at

  !> Let what the sweep remembers have so many harmonics.
  subroutine set_harmonics(self, harmonics)
    class(sweep_type), intent(inout) :: self
    integer, intent(in) :: harmonics
    complex(wp), allocatable :: slope(:, :)
    integer :: common

    if (allocated(self%tangent%motion)) self%tangent%motion = resized(self%tangent%motion, 2*harmonics + 1)
    if (allocated(self%secant)) self%secant = resized(self%secant, 2*harmonics + 1)
    if (.not. allocated(self%slope)) return
    if (size(self%slope, 2) == harmonics + 1) return
    common = min(size(self%slope, 2), harmonics + 1)
    allocate (slope(size(self%slope, 1), harmonics + 1), source=(0.0_wp, 0.0_wp))
    slope(:, :common) = self%slope(:, :common)
    call move_alloc(slope, self%slope)
  end subroutine set_harmonics

  !> Share contacts out over ranks; what the sweep remembers of them follows.
  subroutine share_out(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(field_type) :: fields(3)

    fields%by_contact = [.false., .true., .false.]
    call move_alloc(self%tangent%motion, fields(1)%columns)
    call move_alloc(self%tangent%slider, fields(2)%columns)
    call move_alloc(self%secant, fields(3)%columns)
    call rebalance(solver, fields)
    call move_alloc(fields(1)%columns, self%tangent%motion)
    call move_alloc(fields(2)%columns, self%tangent%slider)
    call move_alloc(fields(3)%columns, self%secant)
  end subroutine share_out

  !> Find a point at a frequency, and the branch's tangent there; a point that is not found still moves the sweep on.
  subroutine begin_at(self, solver, omega)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    real(wp) :: target

    target = omega
    if (beyond_stop(self, omega + smallest_step*(self%stop - self%start))) target = self%stop
    call solve_by_cascade(solver, target)
    solver%omega = target
    self%on_branch = solver%report%converged
    self%step = first_step
    self%finished = abs(target - self%stop) <= 0.0_wp
    self%reached_stop = self%finished
    self%way = sign(1.0_wp, self%stop - self%start)
    self%tangent = tangent_type()
    self%last = step_type()
    self%looked_ahead = .false.
    self%closed = .false.
    self%steps = 0
    self%farthest = target
    call self%home%drop_from(1)
    call self%home%add(solver, .false.)
    if (allocated(self%secant)) deallocate (self%secant)
  end subroutine begin_at

  !> The first point of the branch that the solver stands on.
  subroutine begin_here(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    call solver%solve_at(solver%omega)
    self%on_branch = solver%report%converged
    self%farthest = solver%omega
    call self%home%add(solver, .false.)
  end subroutine begin_here

  !> A branch that comes back to where it was begun is complete; a sweep goes on beyond it.
  subroutine watch_closing(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    integer :: iterations

    self%steps = self%steps + 1
    if (.not. self%on_branch .or. self%finished .or. self%steps < fewest_steps) return
    iterations = solver%report%iterations
    self%closed = comes_home(self%home, solver, self%last)
    if (.not. self%closed) return
    solver%report%iterations = iterations + solver%report%iterations
    self%on_branch = .false.
    self%finished = self%one_branch
  end subroutine watch_closing

  !> Where the branch was lost: a place beyond all that the sweep has come to, and the branch there.
  subroutine begin_beyond(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    self%branch = self%branch + 1
    call begin_at(self, solver, self%farthest + jump*(self%stop - self%start))
  end subroutine begin_beyond

  !> One accepted step along the branch, the sweep's last point, or, where no step converges, a place beyond.
  subroutine follow(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(place_type) :: before
    real(wp) :: error
    integer :: iterations
    logical :: accepted

    call before%mark(solver)
    call follow_stuck(self, solver, accepted)
    if (accepted) then
      call self%last%take(before, solver, tangent_type(omega=self%way))
      self%looked_ahead = .false.
      return
    end if
    if (.not. self%looked_ahead) call look_ahead(self, solver)
    if (.not. self%looked_ahead) then
      call lose_branch(self, solver)
      return
    end if
    self%looked_ahead = .false.
    self%turned = .false.
    call take_step(self, solver, before, error, iterations, accepted)
    if (accepted) then
      call remember_step(self, solver, before)
      call adapt_step(self, error)
      call watch_walking(self, solver)
      solver%report%iterations = iterations
      call end_at_range(self, solver, before)
    else
      call lose_branch(self, solver)
      solver%report%iterations = iterations + solver%report%iterations
    end if
  end subroutine follow

  !> A step from a place along the tangent there, as long as converges not too far from where it was predicted.
  subroutine take_step(self, solver, before, error, iterations, accepted)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(place_type), intent(in) :: before
    !> Of the prediction, relative to the response
    real(wp), intent(out) :: error
    !> Of all tries
    integer, intent(out) :: iterations
    logical, intent(out) :: accepted
    logical :: flipped

    iterations = 0
    flipped = .false.
    do
      call predict_and_correct(self, solver, error)
      iterations = iterations + solver%report%iterations
      accepted = solver%report%converged .and. (error < accepted_error .or. self%step <= smallest_step)
      if (accepted) accepted = .not. runs_back(self, solver, before)
      if (accepted) return
      if (solver%report%converged .and. error < accepted_error .and. .not. flipped) then
        ! It runs back on itself: at a kink sharper than a right angle the tangent was turned the wrong way.
        flipped = .true.
        call turn_round(self%tangent)
        self%step = 2.0_wp*self%step
      end if
      call return_to(solver, before)
      self%step = 0.5_wp*self%step
      if (self%step < smallest_step) return
    end do
  end subroutine take_step

  !> Find the tangent at the present point of the branch, and whether the frequency turned on the last step; what the last point's
  !> evaluation left is lost.
  subroutine look_ahead(self, solver)
    class(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(tangent_type) :: tangent
    real(wp) :: share
    integer :: status

    self%turned = .false.
    if (.not. self%on_branch .or. self%looked_ahead) return
    if (.not. allocated(self%tangent%motion)) self%tangent = frequency_tangent(solver, self%way)
    call find_tangent(solver, self%tangent, tangent, status)
    self%looked_ahead = status == 0
    if (.not. self%looked_ahead) return
    self%tangent = tangent
    if (.not. self%last%is_taken()) return
    ! Where hardly more than mean positions change, the frequency's sign is rounding.
    share = share_of_harmonics(solver, tangent%motion, tangent%omega)
    self%turned = self%last%across%omega*tangent%omega < 0.0_wp .and. share > walking_share
  end subroutine look_ahead

  !> Where every contact sticks the branch is the linear response: a step in frequency, its error that of a straight line through the
  !> last two points.
  subroutine follow_stuck(self, solver, accepted)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    !> .false.: a contact would slip or open, and nothing has changed
    logical, intent(out) :: accepted
    logical :: lost
    complex(wp), allocatable :: response(:, :)
    real(wp) :: omega, target, error, step

    accepted = .false.
    if (.not. solver%all_stick) return
    response = solver%context%balance%response
    omega = solver%omega
    step = self%step
    if (.not. allocated(self%slope)) self%step = min(self%step, first_step)
    do
      target = omega + self%way*self%step*solver%context%frequency_scale
      if (beyond_stop(self, target)) target = self%stop
      if ((target - self%start)*(self%stop - self%start) < 0.0_wp) target = self%start
      call solver%solve_stuck_at(target, accepted)
      if (.not. accepted) exit
      error = aimed_error
      if (allocated(self%slope)) error = error_of_line(response + (target - omega)*self%slope, solver%context%balance%response)
      if (error < accepted_error .or. self%step <= smallest_step) exit
      self%step = 0.5_wp*self%step
    end do
    if (.not. accepted) then
      ! Back where a longer step had been taken and found too long.
      if (abs(solver%omega - omega) > 0.0_wp) call solver%solve_stuck_at(omega, lost)
      self%step = step
      if (allocated(self%slope)) deallocate (self%slope)
      return
    end if
    self%slope = (solver%context%balance%response - response)/(target - omega)
    self%tangent = tangent_type()
    if (allocated(self%secant)) deallocate (self%secant)
    self%reached_stop = abs(target - self%stop) <= 0.0_wp
    self%finished = self%reached_stop .or. abs(target - self%start) <= 0.0_wp
    call adapt_step(self, error)
  end subroutine follow_stuck

  !> Distance of a predicted response from the true one, relative to its harmonics [n, 0:H].
  pure real(wp) function error_of_line(predicted, true)
    complex(wp), intent(in) :: predicted(:, 0:), true(:, 0:)

    error_of_line = sqrt(square(predicted(:, 1:) - true(:, 1:))/max(square(true(:, 1:)), tiny(1.0_wp)))

  contains

    pure real(wp) function square(response)
      complex(wp), intent(in) :: response(:, :)

      square = sum(real(response, wp)**2 + aimag(response)**2)
    end function square
  end function error_of_line

  !> The next step aims at the same error.
  pure subroutine adapt_step(self, error)
    type(sweep_type), intent(inout) :: self
    real(wp), intent(in) :: error

    self%step = min(self%step*min(max(sqrt(aimed_error/max(error, 1.0e-12_wp)), 0.4_wp), 1.6_wp), self%largest_step)
  end subroutine adapt_step

  !> No step from here converges: the sweep looks for a place beyond; where one branch alone is asked for it has ended.
  subroutine lose_branch(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    if (.not. self%one_branch) then
      call begin_beyond(self, solver)
    else
      solver%report%converged = .false.
      solver%no_orbit = .false.
      solver%omega = solver%omega + smallest_step*(self%stop - self%start)
      self%on_branch = .false.
    end if
    self%last = step_type()
  end subroutine lose_branch

  !> Predict along the tangent and correct in the plane across it. `error`: how far the corrector moved, relative to the response.
  subroutine predict_and_correct(self, solver, error)
    type(sweep_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(out) :: error
    type(constraint_type) :: constraint
    real(wp), allocatable :: predicted(:, :), moved(:, :)
    real(wp) :: predicted_omega

    associate (context => solver%context, balance => solver%context%balance)
      predicted = solver%motion + self%step*context%motion_scale*self%tangent%motion
      predicted_omega = solver%omega + self%step*context%frequency_scale*self%tangent%omega
      constraint%motion = self%tangent%motion/context%motion_scale
      constraint%frequency = self%tangent%omega/context%frequency_scale
      constraint%value = inner_product(balance, constraint%motion, predicted) + constraint%frequency*predicted_omega
      solver%motion = predicted
      solver%omega = predicted_omega
      balance%slider = balance%slider + self%step*context%motion_scale*self%tangent%slider
      call solver%solve_with(constraint)
      ! The mean may jump from point to point as sliders shake down, however small the step: it does not steer it.
      moved = solver%motion - predicted
      moved(1, :) = 0.0_wp
      error = sqrt((inner_product(balance, moved, moved) + (context%motion_scale*(solver%omega - predicted_omega) &
                                                            /context%frequency_scale)**2)/size_of_response(solver))
    end associate
  end subroutine predict_and_correct

  !> Squared norm of the harmonics of the motion.
  real(wp) function size_of_response(solver)
    type(solver_type), intent(in) :: solver

    size_of_response = sum(solver%motion(2:, :)**2)
    call solver%context%balance%ranks%sum(size_of_response)
    size_of_response = max(size_of_response, tiny(1.0_wp))
  end function size_of_response

  !> Does the step just made return along the one before?
  logical function runs_back(self, solver, before)
    type(sweep_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(place_type), intent(in) :: before
    real(wp), allocatable :: moved(:, :)
    real(wp) :: moved_omega, length

    runs_back = .false.
    if (.not. allocated(self%secant)) return
    associate (context => solver%context, balance => solver%context%balance)
      moved = (solver%motion - before%motion)/context%motion_scale
      moved_omega = (solver%omega - before%omega)/context%frequency_scale
      length = sqrt(inner_product(balance, moved, moved) + moved_omega**2)
      runs_back = inner_product(balance, moved, self%secant) + moved_omega*self%secant_omega < turned_back*length
    end associate
  end function runs_back

  !> Keep the step just accepted, and its direction.
  subroutine remember_step(self, solver, before)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver
    type(place_type), intent(in) :: before
    real(wp) :: length

    call self%last%take(before, solver, self%tangent)

    associate (context => solver%context, balance => solver%context%balance)
      self%secant = (solver%motion - before%motion)/context%motion_scale
      self%secant_omega = (solver%omega - before%omega)/context%frequency_scale
      length = sqrt(inner_product(balance, self%secant, self%secant) + self%secant_omega**2)
      self%secant = self%secant/length
      self%secant_omega = self%secant_omega/length
    end associate
    self%way = sign(1.0_wp, self%secant_omega)
  end subroutine remember_step

  !> A branch that goes on in mean positions alone has ended.
  subroutine watch_walking(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver
    real(wp) :: limit
    limit = merge(drifting_share, walking_share, nothing_holds(solver%context%balance))
    self%walking = merge(self%walking + 1, 0, share_of_harmonics(solver, self%secant, self%secant_omega) < limit)
    if (self%walking < most_walking) return
    self%on_branch = .false.
    self%walking = 0
  end subroutine watch_walking

  !> Part of a unit direction that is anything but a mean position.
  real(wp) function share_of_harmonics(solver, motion, omega) result(share)
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :), omega

    share = sum(motion(2:, :)**2)
    call solver%context%balance%ranks%sum(share)
    share = sqrt(share + omega**2)
  end function share_of_harmonics

  !> A step over an end of the range is taken back to the end itself.
  subroutine end_at_range(self, solver, before)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    !> Before the step
    type(place_type), intent(in) :: before
    real(wp) :: target
    integer :: iterations

    if (beyond_stop(self, solver%omega)) then
      target = self%stop
    else if ((solver%omega - self%start)*(self%stop - self%start) < 0.0_wp) then
      target = self%start
    else
      return
    end if
    self%finished = .true.
    self%reached_stop = abs(target - self%stop) <= 0.0_wp
    iterations = solver%report%iterations
    solver%motion = before%motion + (target - before%omega)/(solver%omega - before%omega)*(solver%motion - before%motion)
    solver%omega = before%omega
    call solver%set_slider(before%slider, before%periodic)
    call solve_by_cascade(solver, target)
    solver%omega = target
    if (solver%report%converged) call self%last%take(before, solver, tangent_type(omega=self%way))
    solver%report%iterations = iterations + solver%report%iterations
  end subroutine end_at_range

  pure logical function beyond_stop(self, omega)
    type(sweep_type), intent(in) :: self
    real(wp), intent(in) :: omega

    beyond_stop = (omega - self%stop)*(self%stop - self%start) >= 0.0_wp
  end function beyond_stop
end module attrito_continuation_arc_length
