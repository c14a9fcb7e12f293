!> A branch of solutions over frequency, followed by arc-length so that it may fold.
!>
!> $$ r(d, \omega) = 0, \qquad t \cdot (d - \hat d) + t_\omega (\omega - \hat \omega) = 0 $$
!>
!> The plane stands across the tangent t at the predicted point. The step follows the distance between predicted and corrected
!> point, a smooth measure, so that rounding (the number of ranks) does not change it.
!> Source: Keller 1977; Seydel 2010, doi:10.1007/978-1-4419-1740-9.
module attrito_continuation_arc_length
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: resized
  use attrito_balance_border, only: constraint_type, inner_product
  use attrito_balance_linearised_step, only: solve_linearised
  use attrito_balance_newton_context, only: least_stiffening
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_continuation_cascade, only: solve_by_cascade
  use attrito_continuation_rebalancing, only: field_type, rebalance
  use attrito_continuation_solver, only: solver_type
  implicit none
  private
  public :: sweep_type, new_sweep

  !> Distance of predicted from corrected point, relative to the response, that the step aims at, and that it still accepts
  real(wp), parameter :: aimed_error = 0.02_wp, accepted_error = 0.2_wp
  !> Steps as parts of the sweep
  real(wp), parameter :: first_step = 0.01_wp, smallest_step = 1.0e-6_wp
  !> Part of the sweep to move on by where the branch was lost
  real(wp), parameter :: jump = 0.01_wp
  !> Steps in a row of which but this part is anything but a mean position, after which a body is taken to walk away: past the end of
  !> its branch friction no longer balances over the period, and no solution repeats
  real(wp), parameter :: walking_share = 1.0e-3_wp
  integer, parameter :: most_walking = 20
  !> Cosine between successive steps below which the branch is taken to run back on itself
  real(wp), parameter :: turned_back = -0.95_wp

  type :: sweep_type
    !> Ends, angular frequency; range that it must stay in
    real(wp) :: start = 0.0_wp, stop = 0.0_wp
    real(wp) :: largest_step = 0.04_wp
    integer :: branch = 0, points = 0, max_points = 1000
    logical :: finished = .false.
    !> Did it end at its stop?
    logical :: reached_stop = .false.
    real(wp), private :: step = first_step
    !> Unit tangent: scaled motion [2 H + 1, rows] and frequency; what periodic sliders do along it [2, contacts]
    real(wp), allocatable, private :: tangent(:, :), tangent_slider(:, :)
    real(wp), private :: tangent_omega = 0.0_wp
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
    procedure :: set_harmonics
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

  !> Solve the next point; the solver's report says how it ended.
  subroutine advance(self, solver)
    class(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    if (self%points > 0) call share_out(self, solver)
    if (self%points == 0) then
      call begin_at(self, solver, self%start)
    else if (self%on_branch) then
      call follow(self, solver)
    else
      self%branch = self%branch + 1
      call begin_at(self, solver, solver%omega + jump*(self%stop - self%start))
    end if
    self%points = self%points + 1
    if (self%points >= self%max_points) self%finished = .true.
  end subroutine advance

  !> Let what the sweep remembers have so many harmonics.
  subroutine set_harmonics(self, harmonics)
    class(sweep_type), intent(inout) :: self
    integer, intent(in) :: harmonics
    complex(wp), allocatable :: slope(:, :)
    integer :: common

    if (allocated(self%tangent)) self%tangent = resized(self%tangent, 2*harmonics + 1)
    if (allocated(self%secant)) self%secant = resized(self%secant, 2*harmonics + 1)
    if (.not. allocated(self%slope)) return
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
    call move_alloc(self%tangent, fields(1)%columns)
    call move_alloc(self%tangent_slider, fields(2)%columns)
    call move_alloc(self%secant, fields(3)%columns)
    call rebalance(solver, fields)
    call move_alloc(fields(1)%columns, self%tangent)
    call move_alloc(fields(2)%columns, self%tangent_slider)
    call move_alloc(fields(3)%columns, self%secant)
  end subroutine share_out

  !> Find a point at a frequency, and the branch's tangent there; a point that is not found still moves the sweep on.
  subroutine begin_at(self, solver, omega)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    real(wp) :: target

    target = omega
    if (beyond_stop(self, omega)) target = self%stop
    call solve_by_cascade(solver, target)
    solver%omega = target
    self%on_branch = solver%report%converged
    self%step = first_step
    self%finished = abs(target - self%stop) <= 0.0_wp
    self%reached_stop = self%finished
    self%way = sign(1.0_wp, self%stop - self%start)
    if (allocated(self%tangent)) deallocate (self%tangent)
    if (allocated(self%secant)) deallocate (self%secant)
  end subroutine begin_at

  !> One accepted step along the branch, the sweep's last point, or the loss of the branch.
  subroutine follow(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), allocatable :: motion(:, :), slider(:, :)
    logical, allocatable :: periodic(:)
    real(wp) :: omega, error
    integer :: iterations, status
    logical :: accepted, flipped

    call follow_stuck(self, solver, accepted)
    if (accepted) return
    call find_tangent(self, solver, status)
    if (status /= 0) then
      call lose_branch(self, solver)
      return
    end if
    motion = solver%motion
    omega = solver%omega
    slider = solver%context%balance%slider
    periodic = solver%context%balance%periodic
    iterations = 0
    flipped = .false.
    do
      call predict_and_correct(self, solver, error)
      iterations = iterations + solver%report%iterations
      accepted = solver%report%converged .and. (error < accepted_error .or. self%step <= smallest_step)
      if (accepted) accepted = .not. runs_back(self, solver, motion, omega)
      if (accepted) exit
      if (solver%report%converged .and. error < accepted_error .and. .not. flipped) then
        ! It runs back on itself: at a kink sharper than a right angle the tangent was turned the wrong way.
        flipped = .true.
        self%tangent = -self%tangent
        self%tangent_slider = -self%tangent_slider
        self%tangent_omega = -self%tangent_omega
        self%step = 2.0_wp*self%step
      end if
      solver%motion = motion
      solver%omega = omega
      call solver%set_slider(slider, periodic)
      self%step = 0.5_wp*self%step
      if (self%step < smallest_step) exit
    end do
    if (accepted) then
      call remember_step(self, solver, motion, omega)
      call adapt_step(self, error)
      call watch_walking(self, solver)
    else
      call lose_branch(self, solver)
    end if
    solver%report%iterations = iterations
    if (accepted) call end_at_range(self, solver, motion, omega, slider, periodic)
  end subroutine follow

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
    if (allocated(self%tangent)) deallocate (self%tangent)
    if (allocated(self%secant)) deallocate (self%secant)
    self%reached_stop = abs(target - self%stop) <= 0.0_wp
    self%finished = self%reached_stop .or. abs(target - self%start) <= 0.0_wp
    call adapt_step(self, error)
  end subroutine follow_stuck

  !> Distance of a predicted response from the true one, relative to its harmonics [n, 0:H].
  pure real(wp) function error_of_line(predicted, true)
    complex(wp), intent(in) :: predicted(:, 0:), true(:, 0:)
    real(wp) :: missed, size_of_it
    integer :: h

    missed = 0.0_wp
    size_of_it = tiny(1.0_wp)
    do h = 1, ubound(true, 2)
      missed = missed + sum(abs(predicted(:, h) - true(:, h))**2)
      size_of_it = size_of_it + sum(abs(true(:, h))**2)
    end do
    error_of_line = sqrt(missed/size_of_it)
  end function error_of_line

  !> The next step aims at the same error.
  pure subroutine adapt_step(self, error)
    type(sweep_type), intent(inout) :: self
    real(wp), intent(in) :: error

    self%step = min(self%step*min(max(sqrt(aimed_error/max(error, 1.0e-12_wp)), 0.4_wp), 1.6_wp), self%largest_step)
  end subroutine adapt_step

  !> No step from here converges: report a point just beyond as not converged; the sweep moves on from there.
  subroutine lose_branch(self, solver)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    solver%report%converged = .false.
    solver%no_orbit_in_time = .false.
    solver%omega = solver%omega + smallest_step*(self%stop - self%start)
    self%on_branch = .false.
  end subroutine lose_branch

  !> Tangent at the present point, turned the way of the last one.
  subroutine find_tangent(self, solver, status)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    !> 0, or not: the bordered system is singular
    integer, intent(out) :: status
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step
    real(wp) :: length
    integer :: iterations

    associate (context => solver%context)
      right = new_unknowns(size(solver%motion, 1), size(solver%motion, 2), size(context%balance%law))
      step = right
      if (allocated(self%tangent)) then
        constraint%motion = self%tangent/context%motion_scale
        constraint%frequency = self%tangent_omega/context%frequency_scale
      else
        constraint%motion = right%motion
        constraint%frequency = self%way/context%frequency_scale
      end if
      call context%balance%evaluate(solver%motion, solver%omega, status)
      right%omega = 1.0_wp
      context%balance%stiffening = least_stiffening
      call solve_linearised(context%balance, constraint, right, context%linear, step, iterations, status)
      context%balance%stiffening = 0.0_wp
      if (status /= 0) return
      step%motion = step%motion/context%motion_scale
      step%slider = step%slider/context%motion_scale
      step%omega = step%omega/context%frequency_scale
      length = sqrt(inner_product(context%balance, step%motion, step%motion) + step%omega**2)
      self%tangent = step%motion/length
      self%tangent_slider = step%slider/length
      self%tangent_omega = step%omega/length
    end associate
  end subroutine find_tangent

  !> Predict along the tangent and correct in the plane across it. `error`: how far the corrector moved, relative to the response.
  subroutine predict_and_correct(self, solver, error)
    type(sweep_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(out) :: error
    type(constraint_type) :: constraint
    real(wp), allocatable :: predicted(:, :), moved(:, :)
    real(wp) :: predicted_omega

    associate (context => solver%context, balance => solver%context%balance)
      predicted = solver%motion + self%step*context%motion_scale*self%tangent
      predicted_omega = solver%omega + self%step*context%frequency_scale*self%tangent_omega
      constraint%motion = self%tangent/context%motion_scale
      constraint%frequency = self%tangent_omega/context%frequency_scale
      constraint%value = inner_product(balance, constraint%motion, predicted) + constraint%frequency*predicted_omega
      solver%motion = predicted
      solver%omega = predicted_omega
      balance%slider = balance%slider + self%step*context%motion_scale*self%tangent_slider
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
  logical function runs_back(self, solver, motion, omega)
    type(sweep_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :), omega
    real(wp), allocatable :: moved(:, :)
    real(wp) :: moved_omega, length

    runs_back = .false.
    if (.not. allocated(self%secant)) return
    associate (context => solver%context, balance => solver%context%balance)
      moved = (solver%motion - motion)/context%motion_scale
      moved_omega = (solver%omega - omega)/context%frequency_scale
      length = sqrt(inner_product(balance, moved, moved) + moved_omega**2)
      runs_back = inner_product(balance, moved, self%secant) + moved_omega*self%secant_omega < turned_back*length
    end associate
  end function runs_back

  !> Keep the direction of the step just accepted.
  subroutine remember_step(self, solver, motion, omega)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :), omega
    real(wp) :: length

    associate (context => solver%context, balance => solver%context%balance)
      self%secant = (solver%motion - motion)/context%motion_scale
      self%secant_omega = (solver%omega - omega)/context%frequency_scale
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
    real(wp) :: share

    share = sum(self%secant(2:, :)**2)
    call solver%context%balance%ranks%sum(share)
    share = sqrt(share + self%secant_omega**2)
    self%walking = merge(self%walking + 1, 0, share < walking_share)
    if (self%walking < most_walking) return
    self%on_branch = .false.
    self%walking = 0
  end subroutine watch_walking

  !> A step over an end of the range is taken back to the end itself.
  subroutine end_at_range(self, solver, motion, omega, slider, periodic)
    type(sweep_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    !> Motion, frequency and sliders of the point before the step
    real(wp), intent(in) :: motion(:, :), omega, slider(:, :)
    logical, intent(in) :: periodic(:)
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
    solver%motion = motion + (target - omega)/(solver%omega - omega)*(solver%motion - motion)
    solver%omega = omega
    call solver%set_slider(slider, periodic)
    call solve_by_cascade(solver, target)
    solver%omega = target
    solver%report%iterations = iterations + solver%report%iterations
  end subroutine end_at_range

  pure logical function beyond_stop(self, omega)
    type(sweep_type), intent(in) :: self
    real(wp), intent(in) :: omega

    beyond_stop = (omega - self%stop)*(self%stop - self%start) >= 0.0_wp
  end function beyond_stop
end module attrito_continuation_arc_length
