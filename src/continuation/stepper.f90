!> Steps along a branch: prediction along the last arc or the tangent, correction in the plane across the way there.
!>
!> $$ \hat x = x + \Delta, \qquad r(d, \omega) = 0, \qquad p \cdot (d - \hat d) + p_\omega (\omega - \hat \omega) = 0 $$
!>
!> The length of steps (`attrito_continuation_step_length`) follows the error of the drawn curve, the cubic between neighbouring
!> points and their tangents (`attrito_continuation_arc`): its distance from a point of the branch between them is at most a part of
!> the largest amplitude so far. Where it is more, the middle of the arc is solved and comes first; the end of the step comes after
!> it. So does the place where an amplitude is largest, so that points show every peak. All these are smooth measures, so that
!> rounding (the number of ranks) does not change the points.
!> Source: Keller 1977; Seydel 2010, doi:10.1007/978-1-4419-1740-9.
module attrito_continuation_stepper
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_solve_rigid_drift, only: moves_mean_alone, mean_share, branch_steps_in_a_row
  use attrito_solve_sliders, only: none_holds
  use attrito_solve_snapshot, only: snapshot_type, restore
  use attrito_solve_rebalancing, only: field_type, rebalance
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_arc, only: arc_type
  use attrito_continuation_arc_error, only: arc_error_type, error_of_arc
  use attrito_continuation_arrival, only: arrival_type, is_worth_keeping
  use attrito_continuation_correction, only: correct
  use attrito_continuation_curve_point, only: curve_point_type
  use attrito_continuation_hidden_steps, only: hidden_steps_type
  use attrito_continuation_predictor, only: predictor_type, prediction_type, middle_of
  use attrito_continuation_secant, only: secant_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_step_length, only: default_tolerance, first_length, smallest_step, given_up, next_length, &
                                              limited_in_frequency, is_near, with_effort
  use attrito_continuation_tangent, only: tangent_type, find_tangent, tangent_of_evaluation, frequency_tangent, reverse, &
                                          share_of_harmonics, share_beside_slide
  implicit none
  private
  public :: stepper_type

  !> Part of it that points at a peak may miss the largest amplitude by
  real(wp), parameter :: peak_part = 0.1_wp ! guess
  !> What the curve may be off by elsewhere on the arc, in terms of what it is there: near a kink between
  real(wp), parameter :: elsewhere = 1.5_wp ! guess
  !> Tries of a step in which Newton's method is given up early: shorter steps mostly need no more
  integer, parameter :: most_brief = 4 ! guess
  !> Places within one arc that are looked for
  integer, parameter :: most_peaks = 3 ! guess

  type :: stepper_type
    !> Error of the drawn curve that is accepted
    real(wp) :: tolerance = default_tolerance
    !> Length of the next step, means left out
    real(wp) :: size = 0.0_wp
    !> Sign of the last step's change of frequency: 1 or -1
    real(wp) :: direction = 1.0_wp
    !> The last step that was accepted
    type(step_type) :: last
    !> The last steps, which together hardly show on the drawn curve
    type(hidden_steps_type), private :: hidden
    !> Tangent at the present point once it is looked at, before that at the point before; does the frequency turn between?
    type(tangent_type) :: tangent
    logical :: looked_ahead = .false., turned = .false.
    !> The present point of the drawn curve; its length from the first point of the branch to here and to the point before
    type(curve_point_type) :: here
    real(wp) :: path = 0.0_wp
    real(wp), private :: path_before = 0.0_wp
    !> Largest amplitude of each monitor so far
    real(wp), allocatable, private :: largest(:)
    type(predictor_type), private :: predictor
    !> Of the last step taken
    type(secant_type), private :: secant
    !> Steps in a row that hardly did more than slide bodies along all contacts, and what the last step changed of the drawn curve
    integer, private :: drifting = 0
    real(wp), private :: change = 0.0_wp
    !> Of the step that was examined last: distance of the branch from the arc, relative to what is another branch's
    real(wp), private :: off = 0.0_wp
  contains
    procedure :: begin
    procedure :: look_here
    procedure :: look_ahead
    procedure :: take_step
    procedure :: examine_step
    procedure :: accept_step
    procedure :: place_within
    procedure :: omega_within
    procedure :: remember_in_frequency
    procedure :: adapt
    procedure :: is_drifting
    procedure :: take_ahead
    procedure :: tangent_backwards
    procedure :: set_coefficients
    procedure :: share_out
    procedure :: keep
  end type stepper_type

  !> What the tries of a step have come to
  type :: tries_type
    !> How many have failed; how many looked for maxima within
    integer :: failures = 0, peaks = 0
    !> Has the tangent been turned round? Is the next prediction along the last arc, or along the tangent?
    logical :: flipped = .false., by_arc = .true.
    !> Is the next point sought at a frequency? Where a contact begins to slip, the branch may turn by more than a right angle:
    !> a plane across it meets neither side of the corner, while the frequency goes on
    logical :: in_frequency = .false.
    !> The shortest arc whose drawn curve erred too much
    real(wp) :: shortest = huge(1.0_wp)
  end type tries_type

contains

  !> Begin again at a point, where only the direction is known: 1 or -1 in frequency.
  subroutine begin(self, direction)
    class(stepper_type), intent(inout) :: self
    !> 1: towards growing frequency, -1: falling
    real(wp), intent(in) :: direction

    self%size = first_length(self%tolerance)
    self%direction = direction
    self%last = step_type()
    self%looked_ahead = .false.
    self%turned = .false.
    self%here = curve_point_type()
    self%path = 0.0_wp
    self%tangent = tangent_type()
    call self%predictor%forget()
    call self%secant%forget()
    self%hidden = hidden_steps_type()
  end subroutine begin

  !> The tangent and the point of the drawn curve at the solver's present point, where the balance was evaluated last: of a point that
  !> is not the end of a step that was examined, or was solved again since.
  subroutine look_here(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(tangent_type) :: tangent, start
    type(curve_point_type) :: point
    integer :: status

    self%looked_ahead = .false.
    self%turned = .false.
    self%here = curve_point_type()
    call self%predictor%take_arc(step_type())
    if (.not. solver%report%converged) return
    if (.not. allocated(self%tangent%motion)) self%tangent = frequency_tangent(solver, self%direction)
    call tangent_of_evaluation(solver, self%tangent, tangent, point, status)
    if (status /= 0) return
    if (self%last%is_taken()) then
      start = self%last%start
      call self%last%end_at(solver)
      call self%last%draw(solver, start, tangent)
      self%path = self%path_before + self%last%length
      call self%predictor%take_arc(self%last)
    end if
    call stand_at(self, tangent, point)
  end subroutine look_here

  !> Take a tangent and a point of the drawn curve as those of the present point.
  subroutine stand_at(self, tangent, point)
    type(stepper_type), intent(inout) :: self
    !> Tangent of the branch
    type(tangent_type), intent(in) :: tangent
    !> Point of the drawn curve
    type(curve_point_type), intent(in) :: point

    ! Where hardly more than mean positions change, the frequency's sign is rounding.
    self%turned = .false.
    if (self%last%is_taken()) self%turned = self%last%across%omega*tangent%omega < 0.0_wp .and. tangent%share > mean_share
    self%tangent = tangent
    self%here = point
    self%looked_ahead = .true.
    if (.not. allocated(self%largest)) self%largest = point%amplitude
    self%largest = max(self%largest, point%amplitude)
  end subroutine stand_at

  !> Find the tangent at the present point of the branch if it is not known. The evaluation of the last point is overwritten then.
  subroutine look_ahead(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(tangent_type) :: tangent
    integer :: status

    if (self%looked_ahead) return
    if (.not. allocated(self%tangent%motion)) self%tangent = frequency_tangent(solver, self%direction)
    call find_tangent(solver, self%tangent, tangent, status)
    self%looked_ahead = status == 0
    if (self%looked_ahead) self%tangent = tangent
  end subroutine look_ahead

  !> A step from a point: halved until it converges near its prediction, and until the drawn curve is near enough to the branch.
  subroutine take_step(self, solver, before, error, iterations, accepted)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    !> Of the drawn curve, relative to what is accepted
    real(wp), intent(out) :: error
    !> Of all tries
    integer, intent(out) :: iterations
    !> Was a step taken?
    logical, intent(out) :: accepted
    type(prediction_type) :: prediction
    type(tangent_type) :: tangent
    type(curve_point_type) :: point
    type(tries_type) :: tries
    type(arrival_type) :: kept
    real(wp) :: distance, part

    iterations = 0
    call self%predictor%next_ahead(solver, prediction)
    if (allocated(prediction%motion)) self%size = max(prediction%length, smallest_step)
    do
      if (.not. allocated(prediction%motion)) then
        self%size = limited_in_frequency(self%size, self%tangent%reach()*abs(self%tangent%omega), self%tolerance)
        call self%predictor%predict(solver, self%tangent, self%size, tries%by_arc, prediction)
        if (tries%in_frequency) call prediction%go_to_frequency(solver)
      end if
      call correct(solver, prediction, self%size*self%tangent%reach()*solver%context%motion_scale*self%tangent%slider, &
                   tries%failures < most_brief .and. .not. tries%in_frequency, distance)
      deallocate (prediction%motion)
      iterations = iterations + solver%report%iterations
      if (tries%in_frequency) then
        accepted = solver%report%converged .and. distance <= self%tolerance .and. &
                   (solver%omega - before%omega)*self%tangent%omega > 0.0_wp
      else
        accepted = solver%report%converged .and. (is_near(distance) .or. self%size <= smallest_step)
      end if
      if (accepted) accepted = .not. self%secant%is_opposed(solver, before)
      if (accepted) then
        call self%examine_step(solver, before, tries%in_frequency, tangent, point, error)
        if (.not. kept%is_beaten(error)) exit
        part = part_to_solve(self, point, error, tries)
        if (part < 0.0_wp) then
          error = with_effort(error, iterations, distance)
          call self%accept_step(solver, before, tangent, point)
          return
        end if
        if (is_worth_keeping(error, self%off)) call kept%take(solver, self%last, tangent, point, error)
        call self%predictor%put_ahead(solver%motion, solver%omega)
        prediction = middle_of(solver, self%last, part)
        ! Not longer than this try: where the branch ends, short steps may lead far away, again and again.
        self%size = max(min(part*self%last%length, self%size), smallest_step)
        call restore(solver, before)
      else
        if (kept%is_next(tries%failures)) exit
        if (.not. kept%is_known) then
          call self%hidden%add_failure()
          if (self%hidden%creep() .and. .not. tries%in_frequency) then
            tries%in_frequency = .true.
            tries%by_arc = .false.
            call self%predictor%drop_ahead()
            call restore(solver, before)
            cycle
          end if
          if (ends_here(self, solver)) then
            call restore(solver, before)
            solver%report%converged = .false.
            return
          end if
        end if
        call shorten(self, solver%report%converged .and. is_near(distance), tries)
        call restore(solver, before)
        if (self%size < given_up .and. kept%is_known) exit
        if (self%size < given_up) return
      end if
    end do
    call kept%return_to(solver)
    self%last = kept%step
    error = with_effort(kept%error, iterations, 0.0_wp)
    accepted = .true.
    call self%predictor%drop_ahead()
    call self%accept_step(solver, before, kept%tangent, kept%point)
  end subroutine take_step

  !> Part of the arc of a step at which a point is solved before its end is accepted: its middle, where the drawn curve errs too much,
  !> or a maximum within. Negative: the step is accepted.
  real(wp) function part_to_solve(self, point, error, tries) result(part)
    class(stepper_type), intent(in) :: self
    !> Point of the drawn curve at the end of the step
    type(curve_point_type), intent(in) :: point
    !> Of the drawn curve, relative to what is accepted
    real(wp), intent(in) :: error
    !> What the tries of the step have come to
    type(tries_type), intent(inout) :: tries

    part = -1.0_wp
    if (.not. min(self%size, self%last%length) > smallest_step) return
    if (error > 1.0_wp) then
      ! Halving is of no use if the branch is in pieces: the arc becomes no shorter.
      if (self%last%length < tries%shortest) part = 0.5_wp
      tries%shortest = self%last%length
    else if (tries%peaks < most_peaks) then
      part = self%place_within(point)
      tries%peaks = tries%peaks + 1
    end if
  end function part_to_solve

  !> Does the branch end at the present point, a step from there having failed? It does if it creeps; or if it turns into mean
  !> positions, and if the drawn curve would not show what that step could find.
  logical function ends_here(self, solver)
    class(stepper_type), intent(in) :: self
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver

    ends_here = self%hidden%creep()
    if (ends_here .or. self%tangent%share < mean_share .or. .not. self%here%is_known()) return
    associate (shown => self%here%amplitude_rate/max(self%largest, tiny(1.0_wp)))
      ends_here = solver%context%balance%free%leaves_motion .and. self%hidden%turn_into_mean .and. &
                  self%size*max(maxval(abs(shown)), abs(self%tangent%omega)/self%tangent%share) < self%tolerance
    end associate
  end function ends_here

  !> A try has failed: halve the step.
  subroutine shorten(self, runs_back, tries)
    class(stepper_type), intent(inout) :: self
    !> Has it found a point near the prediction, behind the one that it began at?
    logical, intent(in) :: runs_back
    !> What the tries of the step have come to
    type(tries_type), intent(inout) :: tries

    if (runs_back .and. .not. tries%flipped) then
      ! At a kink sharper than a right angle the tangent had the wrong sign: once more, as long, the other way.
      tries%flipped = .true.
      call reverse(self%tangent)
      self%size = 2.0_wp*self%size
    end if
    call self%predictor%drop_ahead()
    tries%by_arc = .false.
    tries%failures = tries%failures + 1
    self%size = 0.5_wp*self%size
  end subroutine shorten

  !> What a step to the solver's present point leads to, `last` being this step afterwards: tangent, point of the drawn curve, and its
  !> error, relative to what is accepted.
  subroutine examine_step(self, solver, before, in_frequency, tangent, point, error)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Motion, sliders and frequency at the beginning of the step
    type(snapshot_type), intent(in) :: before
    !> Does the branch go on as the frequency does? If not, as the chord of the step does
    logical, intent(in) :: in_frequency
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> Point of the drawn curve
    type(curve_point_type), intent(out) :: point
    !> Of the drawn curve, relative to what is accepted
    real(wp), intent(out) :: error
    type(tangent_type) :: towards
    type(arc_error_type) :: found
    integer :: status

    error = 0.0_wp
    self%off = 0.0_wp
    call self%last%take(before, solver, self%tangent)
    towards = self%last%chord(solver)
    if (towards%share < mean_share) towards = self%tangent
    if (in_frequency) towards = tangent_type(omega=sign(1.0_wp, towards%omega))
    call tangent_of_evaluation(solver, towards, tangent, point, status)
    if (status /= 0) return
    call self%last%draw(solver, self%tangent, tangent)
    if (self%last%length <= 0.0_wp .or. .not. self%here%is_known()) return
    found = error_of_arc(solver, self%last, arc_type(self%here, point, self%last%length), max(self%largest, point%amplitude), &
                         self%tolerance)
    error = elsewhere*max(found%distance/self%tolerance, found%off)
    self%off = found%off
  end subroutine examine_step

  !> Part of the step just examined at which an amplitude has a peak or the frequency turns that neither end shows, or the frequency
  !> goes back between two turning points; negative: there is none.
  pure real(wp) function place_within(self, point) result(part)
    class(stepper_type), intent(in) :: self
    !> End of the arc
    type(curve_point_type), intent(in) :: point
    type(arc_type) :: arc

    part = -1.0_wp
    if (self%last%length <= 0.0_wp .or. .not. self%here%is_known()) return
    arc = arc_type(self%here, point, self%last%length)
    part = arc%reversal()
    if (part < 0.0_wp) part = arc%turning(peak_part*self%tolerance)
    if (part < 0.0_wp) part = arc%highest(max(self%largest, point%amplitude), peak_part*self%tolerance)
  end function place_within

  !> Angular frequency at a part of the step just examined.
  pure real(wp) function omega_within(self, point, part)
    class(stepper_type), intent(in) :: self
    !> End of the arc
    type(curve_point_type), intent(in) :: point
    !> 0 to 1
    real(wp), intent(in) :: part
    type(arc_type) :: arc

    arc = arc_type(self%here, point, self%last%length)
    omega_within = arc%omega_at(part)
  end function omega_within

  !> Go on from the end of the step that was examined last.
  subroutine accept_step(self, solver, before, tangent, point)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency at the beginning of the step
    type(snapshot_type), intent(in) :: before
    !> Tangent of the branch
    type(tangent_type), intent(in) :: tangent
    !> Point of the drawn curve
    type(curve_point_type), intent(in) :: point

    call self%secant%take(solver, before)
    self%direction = sign(1.0_wp, self%secant%omega)
    self%looked_ahead = .false.
    self%turned = .false.
    call self%predictor%take_arc(self%last)
    ! A linear response is followed in frequency, past any point that was solved ahead.
    if (solver%all_stick) call self%predictor%drop_ahead()
    self%path_before = self%path
    self%path = self%path + self%last%length
    self%hidden%turn_into_mean = .false.
    self%change = 0.0_wp
    if (point%is_known()) then
      self%change = change_to(self, solver, point)
      if (self%last%is_taken()) then
        associate (across => self%last%across)
          call self%hidden%add(self%change, self%tolerance, share_beside_slide(solver, across%motion, across%omega), &
                               share_beside_slide(solver, tangent%motion, tangent%omega))
        end associate
      end if
      call stand_at(self, tangent, point)
    end if
    self%here = point
  end subroutine accept_step

  !> Change of the drawn curve by the step to a point, of amplitude or frequency, relative.
  pure real(wp) function change_to(self, solver, point) result(change)
    class(stepper_type), intent(in) :: self
    !> Solver of points: its scale of frequencies
    type(solver_type), intent(in) :: solver
    !> Point of the drawn curve at the end of the step
    type(curve_point_type), intent(in) :: point

    change = self%tolerance
    if (.not. self%here%is_known()) return
    change = max(maxval(abs(point%amplitude - self%here%amplitude)/max(self%largest, tiny(1.0_wp))), &
                 abs(point%omega - self%here%omega)/solver%context%frequency_scale)
  end function change_to

  !> Keep a step made in frequency alone.
  subroutine remember_in_frequency(self, solver, before)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: before
    type(tangent_type) :: start

    start = self%last%start
    call self%last%take(before, solver, tangent_type(omega=self%direction))
    self%last%start = start
    self%looked_ahead = .false.
  end subroutine remember_in_frequency

  !> The length of the next step, by the error of the last one.
  pure subroutine adapt(self, error)
    class(stepper_type), intent(inout) :: self
    !> Of the drawn curve, relative to what is accepted
    real(wp), intent(in) :: error

    if (self%last%length > 0.0_wp) self%size = self%last%length
    self%size = next_length(self%size, error)
  end subroutine adapt

  !> Does the branch go on in a slide along all contacts alone, which is its end? Steps that the drawn curve shows lead on, however
  !> far bodies slide by them.
  logical function is_drifting(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp) :: share
    logical :: is_free

    share = share_beside_slide(solver, self%secant%motion, self%secant%omega)
    is_free = solver%context%balance%free%leaves_motion .and. none_holds(solver%context%balance)
    self%drifting = merge(self%drifting + 1, 0, moves_mean_alone(share, is_free) .and. self%change < self%tolerance)
    is_drifting = self%drifting >= branch_steps_in_a_row
    if (is_drifting) self%drifting = 0
  end function is_drifting

  !> Points of the branch that lie ahead are known: the next ones are expected there.
  pure subroutine take_ahead(self, predictor)
    class(stepper_type), intent(inout) :: self
    !> It has them
    type(predictor_type), intent(in) :: predictor

    self%predictor = predictor
  end subroutine take_ahead

  !> The direction back from the present point.
  function tangent_backwards(self, solver) result(towards)
    class(stepper_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(tangent_type) :: towards

    towards = frequency_tangent(solver, -self%direction)
    if (.not. self%secant%is_known()) return
    towards%motion = -self%secant%motion
    towards%omega = -self%secant%omega
    towards%share = share_of_harmonics(solver, towards%motion, towards%omega)
  end function tangent_backwards

  !> Resize stored vectors to so many coefficients.
  subroutine set_coefficients(self, coefficients)
    class(stepper_type), intent(inout) :: self
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients

    if (allocated(self%tangent%motion)) self%tangent%motion = resized(self%tangent%motion, coefficients)
    call self%secant%set_coefficients(coefficients)
    call self%predictor%set_coefficients(coefficients)
  end subroutine set_coefficients

  !> Share contacts out over ranks, and stored vectors with them.
  subroutine share_out(self, solver)
    class(stepper_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(field_type) :: own(3)
    type(field_type), allocatable :: others(:), fields(:)
    integer :: changes

    changes = solver%context%balance%changes
    call move_alloc(self%tangent%motion, own(1)%columns)
    call move_alloc(self%tangent%slider, own(2)%columns)
    call move_alloc(self%secant%motion, own(3)%columns)
    own(2)%by_contact = .true.
    call self%predictor%give_fields(others)
    fields = [own, others]
    call rebalance(solver, fields)
    ! The end of the last step is stored by contacts, which other ranks have now.
    if (solver%context%balance%changes /= changes) self%last%to = snapshot_type()
    call move_alloc(fields(1)%columns, self%tangent%motion)
    call move_alloc(fields(2)%columns, self%tangent%slider)
    call move_alloc(fields(3)%columns, self%secant%motion)
    call self%predictor%take_fields(fields(4:))
  end subroutine share_out

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(stepper_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%tolerance)
    call store%keep(self%size)
    call store%keep(self%direction)
    call self%tangent%keep(store)
    call self%last%keep(store)
    call store%keep(self%turned)
    call store%keep(self%looked_ahead)
    call self%here%keep(store)
    call store%keep(self%path)
    call store%keep(self%path_before)
    call store%keep(self%largest)
    call self%predictor%keep(store)
    call self%secant%keep(store)
    call store%keep(self%drifting)
    call self%hidden%keep(store)
  end subroutine keep
end module attrito_continuation_stepper
