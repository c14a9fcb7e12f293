!> Steps along a branch: prediction along the tangent, correction in the plane across it.
!>
!> $$ \hat x = x + s\, t, \qquad r(d, \omega) = 0, \qquad t \cdot (d - \hat d) + t_\omega (\omega - \hat \omega) = 0 $$
!>
!> The length s follows the distance between predicted and corrected point, a smooth measure, so that rounding (the number of ranks)
!> does not change it.
!> Source: Keller 1977; Seydel 2010, doi:10.1007/978-1-4419-1740-9.
module attrito_continuation_stepper
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_solve_sliders, only: none_holds
  use attrito_solve_snapshot, only: snapshot_type, restore
  use attrito_solve_rebalancing, only: field_type, rebalance
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type, find_tangent, frequency_tangent, reverse, share_of_harmonics
  implicit none
  private
  public :: stepper_type, first_step, smallest_step, aimed_error, accepted_error

  !> Distance of predicted from corrected point, relative to the response, that the step aims at, and that it still accepts
  real(wp), parameter :: aimed_error = 0.02_wp, accepted_error = 0.2_wp ! guess
  !> Steps as parts of the sweep
  real(wp), parameter :: first_step = 0.01_wp, smallest_step = 1.0e-6_wp, largest_step = 0.04_wp ! guess
  !> A body is taken to drift after some steps in a row in which everything but mean positions changes by less than this part: past
  !> the end of its branch friction no longer balances over the period
  real(wp), parameter :: mean_share = 1.0e-3_wp ! guess
  !> The same where every contact slips: friction then balances at single frequencies, and rounding makes a branch of these
  real(wp), parameter :: free_share = 0.5_wp ! guess
  integer, parameter :: most_drifting = 6 ! guess
  !> Cosine between successive steps below which the branch is taken to run back on itself
  real(wp), parameter :: turned_back = -0.95_wp ! guess

  type :: stepper_type
    !> Length of the next step
    real(wp) :: size = first_step
    !> Sign of the last step's change of frequency: 1 or -1
    real(wp) :: direction = 1.0_wp
    !> The last step that was accepted
    type(step_type) :: last
    !> Tangent at the present point once `look_ahead` has found it, before that at the point before; does the frequency turn between?
    type(tangent_type) :: tangent
    logical :: looked_ahead = .false., turned = .false.
    !> Last step taken, scaled, of unit length
    real(wp), allocatable, private :: secant(:, :)
    real(wp), private :: secant_omega = 0.0_wp
    !> Steps in a row in which hardly more than mean positions changed
    integer, private :: drifting = 0
  contains
    procedure :: begin
    procedure :: forget_tangent
    procedure :: look_ahead
    procedure :: take_step
    procedure :: remember
    procedure :: remember_in_frequency
    procedure :: go_on_in_frequency
    procedure :: adapt
    procedure :: is_drifting
    procedure :: tangent_backwards
    procedure :: set_coefficients
    procedure :: share_out
    procedure :: keep
  end type stepper_type

contains

  !> Begin anew at a point, where only the direction is known: 1 or -1 in frequency.
  subroutine begin(self, direction)
    class(stepper_type), intent(inout) :: self
    !> 1: towards growing frequency, -1: falling
    real(wp), intent(in) :: direction

    self%size = first_step
    self%direction = direction
    self%last = step_type()
    self%looked_ahead = .false.
    call self%forget_tangent()
  end subroutine begin

  !> Forget everything about the branch but the direction in frequency.
  subroutine forget_tangent(self)
    class(stepper_type), intent(inout) :: self

    self%tangent = tangent_type()
    if (allocated(self%secant)) deallocate (self%secant)
  end subroutine forget_tangent

  !> Find the tangent at the present point of the branch, and whether the frequency turned on the last step. The evaluation of the
  !> last point is overwritten.
  subroutine look_ahead(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(tangent_type) :: tangent
    real(wp) :: share
    integer :: status

    self%turned = .false.
    if (self%looked_ahead) return
    if (.not. allocated(self%tangent%motion)) self%tangent = frequency_tangent(solver, self%direction)
    call find_tangent(solver, self%tangent, tangent, status)
    self%looked_ahead = status == 0
    if (.not. self%looked_ahead) return
    self%tangent = tangent
    if (.not. self%last%is_taken()) return
    ! Where hardly more than mean positions change, the frequency's sign is rounding.
    share = share_of_harmonics(solver, tangent%motion, tangent%omega)
    self%turned = self%last%across%omega*tangent%omega < 0.0_wp .and. share > mean_share
  end subroutine look_ahead

  !> A step from a point along the tangent there, halved until it converges near its prediction.
  subroutine take_step(self, solver, before, error, iterations, accepted)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    !> Of the prediction, relative to the response
    real(wp), intent(out) :: error
    !> Of all tries
    integer, intent(out) :: iterations
    !> Was a step taken?
    logical, intent(out) :: accepted
    logical :: flipped

    self%looked_ahead = .false.
    self%turned = .false.
    iterations = 0
    flipped = .false.
    do
      call predict_and_correct(self, solver, error)
      iterations = iterations + solver%report%iterations
      accepted = solver%report%converged .and. (error < accepted_error .or. self%size <= smallest_step)
      if (accepted) accepted = .not. runs_back(self, solver, before)
      if (accepted) return
      if (solver%report%converged .and. error < accepted_error .and. .not. flipped) then
        ! It runs back on itself: at a kink sharper than a right angle the tangent had the wrong sign.
        flipped = .true.
        call reverse(self%tangent)
        self%size = 2.0_wp*self%size
      end if
      call restore(solver, before)
      self%size = 0.5_wp*self%size
      if (self%size < smallest_step) return
    end do
  end subroutine take_step

  !> Predict along the tangent and correct in the plane across it. `error`: how far the corrector moved, relative to the response.
  subroutine predict_and_correct(self, solver, error)
    type(stepper_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Distance from prediction to correction, relative to the response
    real(wp), intent(out) :: error
    type(constraint_type) :: constraint
    real(wp), allocatable :: predicted(:, :), moved(:, :)
    real(wp) :: predicted_omega

    associate (context => solver%context, balance => solver%context%balance)
      predicted = solver%motion + self%size*context%motion_scale*self%tangent%motion
      predicted_omega = solver%omega + self%size*context%frequency_scale*self%tangent%omega
      constraint%motion = self%tangent%motion/context%motion_scale
      constraint%frequency = self%tangent%omega/context%frequency_scale
      constraint%value = inner_product(balance, constraint%motion, predicted) + constraint%frequency*predicted_omega
      solver%motion = predicted
      solver%omega = predicted_omega
      balance%slider = balance%slider + self%size*context%motion_scale*self%tangent%slider
      call solver%solve_with(constraint)
      ! The mean may jump from point to point as sliders shake down, however small the step: it does not control the step.
      moved = solver%motion - predicted
      moved(1, :) = 0.0_wp
      error = sqrt((inner_product(balance, moved, moved) + (context%motion_scale*(solver%omega - predicted_omega) &
                                                            /context%frequency_scale)**2)/size_of_response(solver))
    end associate
  end subroutine predict_and_correct

  !> Squared norm of the harmonics of the motion.
  real(wp) function size_of_response(solver)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    size_of_response = sum(solver%motion(2:, :)**2)
    call solver%context%balance%ranks%sum(size_of_response)
    size_of_response = max(size_of_response, tiny(1.0_wp))
  end function size_of_response

  !> Does the step just made return along the one before?
  logical function runs_back(self, solver, before)
    type(stepper_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
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
  subroutine remember(self, solver, before)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    real(wp) :: length

    call self%last%take(before, solver, self%tangent)
    associate (context => solver%context, balance => solver%context%balance)
      self%secant = (solver%motion - before%motion)/context%motion_scale
      self%secant_omega = (solver%omega - before%omega)/context%frequency_scale
      length = sqrt(inner_product(balance, self%secant, self%secant) + self%secant_omega**2)
      self%secant = self%secant/length
      self%secant_omega = self%secant_omega/length
    end associate
    self%direction = sign(1.0_wp, self%secant_omega)
  end subroutine remember

  !> Keep a step made in frequency alone.
  subroutine remember_in_frequency(self, solver, before)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before

    call self%last%take(before, solver, tangent_type(omega=self%direction))
    self%looked_ahead = .false.
  end subroutine remember_in_frequency

  !> Keep a step made in frequency alone, from where the last one ended: hardly anything is copied.
  subroutine go_on_in_frequency(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    call self%last%go_on(solver, tangent_type(omega=self%direction))
    self%looked_ahead = .false.
  end subroutine go_on_in_frequency

  !> The next step aims at the same error.
  pure subroutine adapt(self, error)
    class(stepper_type), intent(inout) :: self
    !> Distance from prediction to correction, relative to the response
    real(wp), intent(in) :: error

    self%size = min(self%size*min(max(sqrt(aimed_error/max(error, 1.0e-12_wp)), 0.4_wp), 1.6_wp), largest_step)
  end subroutine adapt

  !> Does the branch go on in mean positions alone, which is its end?
  logical function is_drifting(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp) :: limit

    limit = merge(free_share, mean_share, none_holds(solver%context%balance))
    self%drifting = merge(self%drifting + 1, 0, share_of_harmonics(solver, self%secant, self%secant_omega) < limit)
    is_drifting = self%drifting >= most_drifting
    if (is_drifting) self%drifting = 0
  end function is_drifting

  !> The direction back from the present point.
  function tangent_backwards(self, solver) result(towards)
    class(stepper_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(tangent_type) :: towards

    towards = frequency_tangent(solver, -self%direction)
    if (.not. allocated(self%secant)) return
    towards%motion = -self%secant
    towards%omega = -self%secant_omega
  end function tangent_backwards

  !> Resize stored vectors to so many coefficients.
  subroutine set_coefficients(self, coefficients)
    class(stepper_type), intent(inout) :: self
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients

    if (allocated(self%tangent%motion)) self%tangent%motion = resized(self%tangent%motion, coefficients)
    if (allocated(self%secant)) self%secant = resized(self%secant, coefficients)
  end subroutine set_coefficients

  !> Share contacts out over ranks, and stored vectors with them.
  subroutine share_out(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(field_type) :: fields(3)
    integer :: changes

    changes = solver%context%balance%changes
    fields%by_contact = [.false., .true., .false.]
    call move_alloc(self%tangent%motion, fields(1)%columns)
    call move_alloc(self%tangent%slider, fields(2)%columns)
    call move_alloc(self%secant, fields(3)%columns)
    call rebalance(solver, fields)
    ! The end of the last step is stored by contacts, which other ranks have now.
    if (solver%context%balance%changes /= changes) self%last%to = snapshot_type()
    call move_alloc(fields(1)%columns, self%tangent%motion)
    call move_alloc(fields(2)%columns, self%tangent%slider)
    call move_alloc(fields(3)%columns, self%secant)
  end subroutine share_out

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(stepper_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%size)
    call store%keep(self%direction)
    call self%tangent%keep(store)
    call self%last%keep(store)
    call store%keep(self%turned)
    call store%keep(self%looked_ahead)
    call store%keep(self%secant)
    call store%keep(self%secant_omega)
    call store%keep(self%drifting)
  end subroutine keep
end module attrito_continuation_stepper
