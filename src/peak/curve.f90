!> A resonance peak followed in a parameter p, the level or the preload: where r(d, omega, p) = 0 and psi(d, omega, p) = 0.
!>
!> A step predicts along the curve's tangent, to second order once two tangents are known, and corrects by Newton's method
!> (attrito_peak_corrector). If contacts with two tangents are sampled psi has kinks: their peaks are always climbed to by points
!> of the frequency response (attrito_peak_climb).
!>
!> The parameter goes from value to value in one direction. Where the curve turns back, or no step along it is solved, at kinks where
!> contacts begin to slip or to open, the next peak is looked for at a value of the parameter a little farther on: climbed to from the
!> last one, and by a sweep about it where that fails (attrito_peak_local_sweep). The peak may jump there.
module attrito_peak_curve
  use attrito_core_kinds, only: wp
  use attrito_newton_newton, only: newton_report_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_peak_climb, only: climb, ripple
  use attrito_peak_local_sweep, only: sweep_for_peak
  use attrito_peak_condition, only: problem_type, linearisation_type, linearise, value_of, set_value
  use attrito_peak_corrector, only: plane_type, correct, relative_size
  use attrito_peak_curve_tangent, only: curve_tangent_type
  use attrito_peak_endings, only: ending_none, ending_not_found
  use attrito_peak_parameter_range, only: leads_on, look_ahead, passed
  implicit none
  private
  public :: curve_type, follow_parameter

  !> Relative changes from prediction to correction, aimed at and accepted
  real(wp), parameter :: aimed_error = 0.04_wp, accepted_error = 0.2_wp ! guess
  !> The same where peaks are climbed to, from afar too
  !> The curve has a kink where contacts that all stuck begin to slip: accepted there
  real(wp), parameter :: accepted_at_kink = 1.0_wp ! guess
  !> Steps along the curve, relative changes too
  real(wp), parameter :: first_step = 0.1_wp, smallest_step = 3.0e-3_wp, largest_step = 0.7_wp ! guess
  !> Relative changes of the parameter, in turn, to where the next peak is looked for if no step along the curve is solved
  real(wp), parameter :: leaps(3) = [0.05_wp, 0.1_wp, 0.2_wp] ! guess
  !> Where peaks farther on are climbed to one after another, the next one is looked for twice as far, up to this
  real(wp), parameter :: largest_leap = 0.4_wp ! guess
  integer, parameter :: most_steps = 400 ! conventional

  !> A peak to return to: the solver's point, the parameter's value and the scale of motions there
  type, extends(snapshot_type) :: base_point_type
    real(wp) :: parameter = 0.0_wp, motion_scale = 1.0_wp
    type(linearisation_type) :: linearisation
  end type base_point_type

  type :: curve_type
    type(problem_type) :: problem
    !> Angular frequencies that the peak lies between, rad/s
    real(wp) :: band(2) = 0.0_wp
    !> At the last peak
    type(linearisation_type) :: point
    !> Was it found? Newton's steps that it took
    logical :: found = .false.
    integer :: iterations = 0
    !> Is it a corner of the response, where the amplitude rises on one side and falls on the other?
    logical :: at_corner = .false.
    !> Is the next peak looked for farther on where no step along the curve is solved?
    logical :: may_step_over = .true.
    !> One of `ending_...`: why there is no next peak
    integer :: ending = ending_none
    real(wp), private :: step = first_step
    !> Relative change of the parameter to where the next peak is looked for first
    real(wp), private :: leap = leaps(1)
    !> Was the last peak not reached by a step along the curve?
    logical, private :: stepped_over = .false.
    type(curve_tangent_type), private :: tangent
  contains
    procedure :: advance
    procedure :: go_to
    procedure :: correct_here
    procedure :: find_near
    procedure :: sweep_here
    procedure :: curvature
  end type curve_type

contains

  !> The peak near the solver's point, its parameter held: by Newton's method, or climbed to.
  subroutine find_near(self, solver)
    class(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(base_point_type) :: start

    start = base_point_of(self, solver)
    call self%correct_here(solver)
    ! Newton's method finds minima as well.
    if (self%found) self%found = self%curvature() < 0.0_wp
    if (self%found) return
    call go_back(self, solver, start)
    call climb_here(self, solver)
  end subroutine find_near

  !> Go on in another parameter from the peak where the solver stands.
  subroutine follow_parameter(self, solver, parameter)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Parameter that is followed, or its value
    integer, intent(in) :: parameter
    integer :: status

    self%problem%parameter = parameter
    self%step = first_step
    call self%tangent%forget()
    ! The peak stays where it is; at a corner Newton's method would not come back to it.
    call linearise(self%problem, solver, self%point, status)
    self%found = status == 0
    self%iterations = 0
    if (self%found) call self%tangent%find(self%problem, solver, self%point, 0.0_wp)
  end subroutine follow_parameter

  !> The peak near where the solver stands, its parameter held.
  subroutine correct_here(self, solver)
    class(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    real(wp) :: error

    call correct_from(self, solver, plane_type(value=value_of(self%problem, solver)), error)
    if (self%found) call self%tangent%find(self%problem, solver, self%point, 0.0_wp)
  end subroutine correct_here

  !> Follow to a value of the parameter, in as many steps as it takes; it was not found if the curve is lost on the way.
  subroutine go_to(self, solver, value)
    class(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Value of the parameter
    real(wp), intent(in) :: value
    integer :: i, iterations
    logical :: reached

    iterations = 0
    if (abs(value_of(self%problem, solver) - value) <= 0.0_wp) return
    do i = 1, most_steps
      call self%advance(solver, value, reached)
      iterations = iterations + self%iterations
      if (reached .or. .not. self%found) exit
    end do
    self%found = self%found .and. reached
    self%iterations = iterations
  end subroutine go_to

  !> The next peak towards a value of the parameter, or just there; the solver stays where it was if there is none.
  subroutine advance(self, solver, stop, reached)
    class(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Value of the parameter to end at
    real(wp), intent(in) :: stop
    !> Has it come to the end?
    logical, intent(out) :: reached
    type(base_point_type) :: before
    integer :: iterations

    before = base_point_of(self, solver)
    if (.not. self%tangent%is_known()) call self%tangent%find(self%problem, solver, self%point, 0.0_wp)
    call self%tangent%turn_towards(self%problem, solver, stop)
    call step_along(self, solver, before, stop, iterations, reached)
    self%stepped_over = .not. self%found
    self%ending = merge(ending_none, ending_not_found, self%found)
    if (self%found) self%leap = leaps(1)
    if (self%stepped_over .and. self%may_step_over) call step_over(self, solver, before, stop, iterations, reached)
    self%iterations = iterations
  end subroutine advance

  !> A step along the curve, halved until it is solved near its prediction and leads on towards the stop.
  subroutine step_along(self, solver, before, stop, iterations, reached)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from
    type(base_point_type), intent(in) :: before
    !> Value of the parameter to end at
    real(wp), intent(in) :: stop
    !> Newton's iterations of all tries
    integer, intent(out) :: iterations
    !> Has it come to the end?
    logical, intent(out) :: reached
    type(plane_type) :: plane
    real(wp) :: error, length, accepted
    logical :: stuck

    stuck = solver%all_stick
    accepted = merge(accepted_at_kink, accepted_error, stuck)
    iterations = 0
    do
      call solve_in_plane(self, solver, before, stop, stuck, length, plane, reached)
      self%found = .false.
      if (leads_on(before%parameter, value_of(self%problem, solver), stop)) then
        call correct_from(self, solver, plane, error, early_stop=.true.)
        iterations = iterations + self%iterations
        ! A maximum stays one.
        if (self%found) self%found = error < accepted .and. leads_on(before%parameter, value_of(self%problem, solver), stop) &
                                     .and. self%point%slope_along*before%linearisation%slope_along > 0.0_wp
      end if
      if (self%found) exit
      self%step = 0.5_wp*min(self%step, length)
      call go_back(self, solver, before)
      reached = .false.
      ! Beyond a kink steps along the curve are mostly solved again at once, or not at all.
      if (self%step < smallest_step .or. self%stepped_over) return
    end do
    if (.not. reached .and. passed(before%parameter, value_of(self%problem, solver), stop)) then
      call set_value(self%problem, solver, stop)
      call correct_from(self, solver, plane_type(value=stop), error, early_stop=.true.)
      iterations = iterations + self%iterations
      reached = self%found
      stuck = .true.
      if (.not. self%found) then
        call go_back(self, solver, before)
        return
      end if
    end if
    call self%tangent%find(self%problem, solver, self%point, merge(0.0_wp, length, stuck))
    ! A step cut short by its end says little of the next.
    if (.not. reached) self%step = min(self%step*min(max(sqrt(aimed_error/max(error, 1.0e-12_wp)), 0.4_wp), 2.0_wp), largest_step)
  end subroutine step_along

  !> The peak at a value of the parameter farther on, wherever it is.
  subroutine step_over(self, solver, before, stop, iterations, reached)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from
    type(base_point_type), intent(in) :: before
    !> Value of the parameter to end at
    real(wp), intent(in) :: stop
    !> Counts on
    integer, intent(inout) :: iterations
    !> Has it come to the end?
    logical, intent(out) :: reached
    real(wp) :: leap, value
    integer :: i
    logical :: climbed

    leap = self%leap
    climbed = .false.
    do while (leap > leaps(1) .and. .not. climbed)
      call look_ahead(before%parameter, leap, stop, value, reached)
      call climb_to(self, solver, before, value, .true., iterations)
      climbed = self%found
      if (.not. climbed) leap = max(0.5_wp*leap, leaps(1))
    end do
    if (.not. climbed) then
      do i = 1, size(leaps)
        call look_ahead(before%parameter, leaps(i), stop, value, reached)
        call search(self, solver, before, value, iterations, climbed)
        if (self%found .or. reached .or. self%ending /= ending_not_found) exit
      end do
    end if
    self%leap = merge(min(2.0_wp*leap, largest_leap), leaps(1), climbed)
    reached = reached .and. self%found
    self%step = first_step
    if (.not. self%found) then
      call go_back(self, solver, before)
      return
    end if
    call self%tangent%forget()
    call self%tangent%find(self%problem, solver, self%point, 0.0_wp)
  end subroutine step_over

  !> Predict a step, just to the end if it leads beyond, and say where to correct it: in a plane, or at the value that it has come to.
  subroutine solve_in_plane(self, solver, before, stop, stuck, length, plane, reached)
    type(curve_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from
    type(base_point_type), intent(in) :: before
    !> Value of the parameter to end at
    real(wp), intent(in) :: stop
    !> Do all contacts stick where the step begins?
    logical, intent(in) :: stuck
    !> Length of the step
    real(wp), intent(out) :: length
    !> Linear condition on motion, frequency and parameter
    type(plane_type), intent(out) :: plane
    !> Does it end at the value asked for?
    logical, intent(out) :: reached

    length = self%step
    call self%tangent%predict(self%problem, solver, before, before%parameter, length, plane)
    reached = passed(before%parameter, value_of(self%problem, solver), stop)
    if (reached) then
      length = min(length, self%tangent%length_to(before%parameter, stop))
      call self%tangent%predict(self%problem, solver, before, before%parameter, length, plane)
      call set_value(self%problem, solver, stop)
    end if
    if (stuck .or. reached) plane = plane_type(value=value_of(self%problem, solver))
  end subroutine solve_in_plane

  !> The peak at a value of the parameter, from the one before with all that there is: the strategies, climbing, and a sweep.
  subroutine search(self, solver, before, value, iterations, climbed)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from
    type(base_point_type), intent(in) :: before
    !> Value of the parameter
    real(wp), intent(in) :: value
    !> Counts on
    integer, intent(inout) :: iterations
    !> Was it found without a sweep?
    logical, intent(out) :: climbed
    logical :: drifts

    call climb_to(self, solver, before, value, .false., iterations)
    climbed = self%found
    if (climbed) return
    drifts = solver%evidence%is_drifting
    call go_back(self, solver, before)
    call set_value(self%problem, solver, value)
    call self%sweep_here(solver, drifts)
    iterations = iterations + self%iterations
  end subroutine search

  !> The peak uphill from the motion of the one before, at a value of the parameter.
  subroutine climb_to(self, solver, before, value, briefly, iterations)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from
    type(base_point_type), intent(in) :: before
    !> Value of the parameter
    real(wp), intent(in) :: value
    !> By Newton's method alone, ended early?
    logical, intent(in) :: briefly
    !> Counts on
    integer, intent(inout) :: iterations

    call go_back(self, solver, before)
    call set_value(self%problem, solver, value)
    if (briefly) then
      call solver%solve_at(solver%omega, early_stop=.true.)
    else
      call solve_by_strategies(solver, solver%omega)
    end if
    iterations = iterations + solver%report%iterations
    self%iterations = 0
    self%found = .false.
    if (solver%report%converged) call climb_here(self, solver)
    iterations = iterations + self%iterations
    if (self%found) self%ending = ending_none
  end subroutine climb_to

  !> The largest peak about the solver's frequency.
  subroutine sweep_here(self, solver, drifts)
    class(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Is there no periodic motion at its frequency? If not given, nothing is known
    logical, intent(in), optional :: drifts
    logical :: known

    known = .false.
    if (present(drifts)) known = drifts
    call sweep_for_peak(self%problem, solver, self%band, known, self%iterations, self%found, self%at_corner, self%ending)
    if (self%found) call close_up(self, solver)
  end subroutine sweep_here

  !> Correct, and tell how far the corrector went from the prediction, relative.
  subroutine correct_from(self, solver, plane, error, early_stop)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Linear condition on motion, frequency and parameter
    type(plane_type), intent(in) :: plane
    !> Distance from prediction to correction, relative to the motion
    real(wp), intent(out) :: error
    !> Give a climb up early where the prediction is not nearly a solution, since a shorter step follows? If not given, do not
    logical, intent(in), optional :: early_stop
    real(wp), allocatable :: moved(:, :)
    real(wp) :: omega, parameter

    moved = solver%motion
    omega = solver%omega
    parameter = value_of(self%problem, solver)
    self%at_corner = .false.
    call correct(self%problem, solver, plane, self%point, self%iterations, self%found)
    self%found = self%found .and. is_in_band(self, solver)
    moved = solver%motion - moved
    moved(1, :) = 0.0_wp
    error = relative_size(solver, moved, solver%omega - omega, value_of(self%problem, solver)/parameter - 1.0_wp)
  end subroutine correct_from

  !> The peak uphill from the solver's motion and frequency.
  subroutine climb_here(self, solver, early_stop)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Give the solver's frequency up after a few iterations of Newton's method? If not given, do not
    logical, intent(in), optional :: early_stop

    call climb(self%problem, solver, self%iterations, self%found, self%at_corner, early_stop)
    self%found = self%found .and. is_in_band(self, solver)
    if (self%found) call close_up(self, solver)
  end subroutine climb_here

  !> From where a climb has ended to the maximum itself. A climb leaves a part g of A to be gained, and the frequency may differ by
  !> sqrt(2 g) of half the peak's width: Newton's method closes in on that, but at a corner.
  subroutine close_up(self, solver)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(base_point_type) :: before
    type(newton_report_type) :: report
    integer :: status, iterations
    logical :: found

    call linearise(self%problem, solver, self%point, status)
    self%found = status == 0
    if (.not. self%found .or. self%at_corner) return
    before = base_point_of(self, solver)
    report = solver%report
    call correct(self%problem, solver, plane_type(value=before%parameter), self%point, iterations, found)
    self%iterations = self%iterations + iterations
    if (found) found = is_in_band(self, solver) .and. self%curvature() < 0.0_wp .and. &
                       abs(self%point%amplitude%value/before%linearisation%amplitude%value - 1.0_wp) <= ripple
    if (found) return
    call go_back(self, solver, before)
    solver%report = report
    ! The balance was evaluated elsewhere.
    call linearise(self%problem, solver, self%point, status)
    self%found = status == 0
  end subroutine close_up

  !> Does the solver's frequency lie in the band in which the peak is looked for?
  pure logical function is_in_band(self, solver)
    type(curve_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Of a frequency at an end of the band
    real(wp), parameter :: rounding = 1.0e-12_wp ! derived

    is_in_band = solver%omega >= minval(self%band)*(1.0_wp - rounding) .and. solver%omega <= maxval(self%band)*(1.0_wp + rounding)
  end function is_in_band

  !> d^2 A/d omega^2 along the frequency response: negative at a maximum.
  real(wp) function curvature(self)
    class(curve_type), intent(in) :: self

    curvature = self%point%slope_along/self%point%along%step%omega**2
  end function curvature

  function base_point_of(self, solver) result(base_point)
    type(curve_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(base_point_type) :: base_point

    base_point = base_point_type(snapshot_type=snapshot_of(solver), parameter=value_of(self%problem, solver), &
                                 motion_scale=solver%context%motion_scale, linearisation=self%point)
  end function base_point_of

  subroutine go_back(self, solver, base_point)
    type(curve_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from
    type(base_point_type), intent(in) :: base_point

    call set_value(self%problem, solver, base_point%parameter)
    solver%context%motion_scale = base_point%motion_scale
    self%point = base_point%linearisation
    call restore(solver, base_point%snapshot_type)
  end subroutine go_back
end module attrito_peak_curve
