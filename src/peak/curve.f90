!> A resonance peak followed in a parameter p, the level or the preload: where r(d, omega, p) = 0 and psi(d, omega, p) = 0.
!>
!> Newton's step from a point is n + sigma t + pi d_p, its parts those of attrito_peak_condition; two unknowns are left,
!>
!> $$ \psi + \psi'[n] + \sigma \psi'[t] + \pi \psi'[d_p] = 0, \qquad l[n] + \sigma \, l[t] + \pi \, l[d_p] = \lambda - l, $$
!>
!> l = lambda being the plane across the curve of peaks, or a value of the parameter. One evaluation of the balance is one step, of
!> frequency response, peak and parameter together. Contacts with two tangents have their sliders settled by a solve in the plane
!> across the frequency response before each step.
module attrito_peak_curve
  use attrito_core_kinds, only: wp
  use attrito_balance_border, only: constraint_type, inner_product
  use attrito_balance_newton, only: newton_report_type
  use attrito_continuation_cascade, only: solve_by_cascade
  use attrito_continuation_solver, only: solver_type
  use attrito_peak_condition, only: problem_type, direction_type, linearisation_type, linearise, value_of, set_value, &
                                    scale_of_motion, parameter_level
  implicit none
  private
  public :: curve_type, begin_curve, follow_parameter

  !> Steps of the peak along the tangent, in scaled units, and of the parameter, relative, below which they have converged: the
  !> amplitude's error is of second order in the former
  real(wp), parameter :: small_step = 1.0e-7_wp, small_change = 1.0e-9_wp
  integer, parameter :: most_iterations = 10
  !> Relative changes: in one Newton step; from prediction to correction, aimed at and accepted
  real(wp), parameter :: longest_step = 1.0_wp, aimed_error = 0.04_wp, accepted_error = 0.2_wp
  !> The curve has a kink where contacts that all stuck begin to slip: accepted there
  real(wp), parameter :: accepted_at_kink = 1.0_wp
  !> Steps along the curve, relative changes too; the frequency counts this much more than the rest
  real(wp), parameter :: first_step = 0.1_wp, smallest_step = 1.0e-4_wp, largest_step = 0.7_wp, frequency_weight = 10.0_wp
  !> Search by points of the frequency response: its first step, relative, doubled until the peak lies between; points at most
  real(wp), parameter :: search_width = 1.0e-3_wp
  integer, parameter :: most_searches = 60
  !> Levels to begin at, from one to the next
  real(wp), parameter :: level_ratio = 0.25_wp
  integer, parameter :: most_levels = 7, most_steps = 400

  !> weights . (motion, omega, parameter) = value
  type :: plane_type
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp, parameter = 1.0_wp, value = 0.0_wp
  end type plane_type

  !> Where the solver stands
  type :: place_type
    real(wp), allocatable :: motion(:, :), slider(:, :)
    logical, allocatable :: periodic(:)
    real(wp) :: omega = 0.0_wp, parameter = 0.0_wp, motion_scale = 1.0_wp
  end type place_type

  type :: curve_type
    type(problem_type) :: problem
    !> At the last peak
    type(linearisation_type) :: point
    !> Was it found? Newton's steps that it took
    logical :: found = .false.
    integer :: iterations = 0
    real(wp), private :: step = first_step
    !> Unit tangent of the curve, and the way it was followed last
    type(direction_type), private :: tangent
    !> How it changes from step to step, per length, once two are known
    type(direction_type), private :: bend
  contains
    procedure :: advance
    procedure :: go_to
    procedure :: correct_here
    procedure :: turn_towards
    procedure :: curvature
  end type curve_type

contains

  !> Find the peak of the solver's loads near an angular frequency, the linear peak's: at a level at which contacts still stick, or a
  !> small one, and then followed to the level asked for.
  subroutine begin_curve(solver, problem, omega, self)
    type(solver_type), intent(inout) :: solver
    !> Its parameter is set to the level here; its border is made here
    type(problem_type), intent(in) :: problem
    real(wp), intent(in) :: omega
    type(curve_type), intent(out) :: self
    real(wp) :: target
    integer :: i
    logical :: sticks

    self%problem = problem
    self%problem%parameter = parameter_level
    call set_border(self%problem, solver)
    target = solver%context%balance%level
    do i = 1, most_levels
      call solve_sticking(solver, omega, sticks)
      if (sticks .or. i == most_levels) exit
      call set_value(self%problem, solver, level_ratio*solver%context%balance%level)
    end do
    if (.not. sticks) call solve_by_cascade(solver, omega)
    if (.not. solver%report%converged) return
    call self%correct_here(solver)
    if (self%found) call self%go_to(solver, target)
  end subroutine begin_curve

  !> Solve where all contacts stick, if they do once sliders that stood at their limit have moved.
  subroutine solve_sticking(solver, omega, sticks)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    logical, intent(out) :: sticks
    real(wp) :: motion(size(solver%motion, 1), size(solver%motion, 2)), slider(2, size(solver%context%balance%law)), before
    logical :: periodic(size(slider, 2))

    call solver%solve_stuck_at(omega, sticks)
    if (sticks) return
    motion = solver%motion
    before = solver%omega
    slider = solver%context%balance%slider
    periodic = solver%context%balance%periodic
    solver%brief = .true.
    call solver%solve_at(omega)
    solver%brief = .false.
    sticks = solver%report%converged .and. solver%all_stick
    if (sticks) return
    solver%motion = motion
    solver%omega = before
    solver%all_stick = .true.
    call solver%set_slider(slider, periodic)
  end subroutine solve_sticking

  !> Go on in another parameter from the peak where the solver stands.
  subroutine follow_parameter(self, solver, parameter)
    type(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    integer, intent(in) :: parameter

    self%problem%parameter = parameter
    self%step = first_step
    if (allocated(self%tangent%step%motion)) deallocate (self%tangent%step%motion)
    if (allocated(self%bend%step%motion)) deallocate (self%bend%step%motion)
    call self%correct_here(solver)
  end subroutine follow_parameter

  !> The border that belongs to a frequency.
  subroutine set_border(problem, solver)
    type(problem_type), intent(inout) :: problem
    type(solver_type), intent(in) :: solver

    if (allocated(problem%border%motion)) deallocate (problem%border%motion)
    allocate (problem%border%motion, mold=solver%motion)
    problem%border%motion = 0.0_wp
    problem%border%frequency = 1.0_wp/solver%context%frequency_scale
  end subroutine set_border

  !> The peak near where the solver stands, its parameter held.
  subroutine correct_here(self, solver)
    class(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    call correct(self, solver, plane_type(value=value_of(self%problem, solver)))
    if (self%found) call find_tangent(self, solver, 0.0_wp)
  end subroutine correct_here

  !> Follow to a value of the parameter, in as many steps as it takes; it was not found if the curve is lost on the way.
  subroutine go_to(self, solver, value)
    class(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: value
    integer :: i, iterations
    logical :: reached

    iterations = 0
    if (abs(value_of(self%problem, solver) - value) <= 0.0_wp) return
    call self%turn_towards(solver, value)
    do i = 1, most_steps
      call self%advance(solver, value, reached)
      iterations = iterations + self%iterations
      if (reached .or. .not. self%found) exit
    end do
    self%found = self%found .and. reached
    self%iterations = iterations
  end subroutine go_to

  !> Go on towards a value of the parameter: the tangent points to greater or smaller ones.
  subroutine turn_towards(self, solver, value)
    class(curve_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: value

    if (.not. allocated(self%tangent%step%motion)) call find_tangent(self, solver, 0.0_wp)
    if (self%tangent%parameter*(value - value_of(self%problem, solver)) < 0.0_wp) call turn_round(self%tangent)
  end subroutine turn_towards

  subroutine turn_round(direction)
    type(direction_type), intent(inout) :: direction

    direction%step%motion = -direction%step%motion
    direction%step%slider = -direction%step%slider
    direction%step%omega = -direction%step%omega
    direction%parameter = -direction%parameter
  end subroutine turn_round

  !> One step along the curve, or just to a value of the parameter; the solver stays where it was if no step succeeds.
  subroutine advance(self, solver, stop, reached)
    class(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: stop
    logical, intent(out) :: reached
    type(place_type) :: before
    type(linearisation_type) :: point
    type(plane_type) :: plane
    real(wp) :: error, length, accepted, value
    integer :: iterations
    logical :: stuck, kept, searched

    stuck = solver%all_stick
    accepted = merge(accepted_at_kink, accepted_error, stuck)
    before = place_of(self, solver)
    point = self%point
    iterations = 0
    do
      length = self%step
      call predict(self, solver, before, length, plane)
      reached = passed(before%parameter, value_of(self%problem, solver), stop)
      if (reached) then
        length = min(length, abs((stop - before%parameter)/self%tangent%parameter))
        call predict(self, solver, before, length, plane)
      end if
      if (reached) call set_value(self%problem, solver, stop)
      if (stuck .or. reached) plane = plane_type(value=value_of(self%problem, solver))
      value = value_of(self%problem, solver)
      call correct_from(self, solver, plane, error)
      iterations = iterations + self%iterations
      searched = .not. self%found
      if (searched) then
        call return_to(self, solver, before)
        call set_value(self%problem, solver, value)
        call search_peak(self, solver)
        iterations = iterations + self%iterations
        error = 0.5_wp*accepted
      end if
      ! A maximum stays one, but where the curve folds: there steps are as small as they get.
      kept = error < accepted .and. (searched .or. self%point%slope_along*point%slope_along > 0.0_wp)
      if (self%found .and. (kept .or. length <= smallest_step)) exit
      self%step = 0.5_wp*min(self%step, length)
      self%found = .false.
      call return_to(self, solver, before)
      self%point = point
      if (self%step < smallest_step) exit
    end do
    value = value_of(self%problem, solver)
    if (self%found .and. .not. reached .and. passed(before%parameter, value, stop)) then
      call set_value(self%problem, solver, stop)
      call correct_from(self, solver, plane_type(value=stop), error)
      iterations = iterations + self%iterations
      reached = self%found
      stuck = .true.
    end if
    self%iterations = iterations
    if (.not. self%found) return
    call find_tangent(self, solver, merge(0.0_wp, length, stuck))
    if (searched) self%step = max(self%step, 0.5_wp*first_step)
    ! A step cut short by its end says little of the next.
    if (.not. reached) self%step = min(self%step*min(max(sqrt(aimed_error/max(error, 1.0e-12_wp)), 0.4_wp), 2.0_wp), largest_step)
  end subroutine advance

  !> Where Newton's method fails, the parameter held: the peak beside the solver's point between a frequency at which the amplitude
  !> rises and one at which it falls, by points of the frequency response. It finds maxima alone, and corners too: where a contact
  !> begins to slip the slope may jump from rising to falling.
  subroutine search_peak(self, solver)
    type(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp) :: rising, falling, step, omega, next
    integer :: i, iterations
    logical :: solved

    self%found = .false.
    rising = 0.0_wp
    falling = huge(1.0_wp)
    omega = solver%omega
    step = search_width*omega
    iterations = 0
    do i = 1, most_searches
      call solve_by_cascade(solver, omega)
      iterations = iterations + solver%report%iterations
      self%iterations = iterations
      solved = solver%report%converged
      if (solved) call measure_slope(self, solver, solved)
      if (.not. solved) return
      if (self%point%slope > 0.0_wp) then
        rising = omega
      else
        falling = omega
      end if
      self%found = rising > 0.0_wp .and. falling - rising <= small_step*omega
      if (self%found) exit
      next = next_frequency(self%point, omega, rising, falling, step)
      ! Newton's steps come from one side: every other one halves what is between.
      if (modulo(i, 2) == 0 .and. rising > 0.0_wp .and. falling < huge(1.0_wp)) next = 0.5_wp*(rising + falling)
      omega = next
      step = 2.0_wp*step
    end do
  end subroutine search_peak

  !> psi at a point that was solved, sliders as it left them.
  subroutine measure_slope(self, solver, measured)
    type(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    logical, intent(out) :: measured
    integer :: status

    call linearise(self%problem, solver, self%point, status)
    measured = status == 0
  end subroutine measure_slope

  !> Newton's next frequency where it lies between, else the middle; beyond the end where the amplitude still rises or falls.
  pure real(wp) function next_frequency(point, omega, rising, falling, step) result(next)
    type(linearisation_type), intent(in) :: point
    real(wp), intent(in) :: omega, rising, falling, step
    real(wp) :: newton

    newton = omega
    if (point%slope_along < 0.0_wp) newton = omega - point%slope/point%slope_along*point%along%step%omega
    if (falling >= huge(1.0_wp)) then
      next = min(max(newton, omega + 0.01_wp*step), omega + step)
    else if (rising <= 0.0_wp) then
      next = max(min(newton, omega - 0.01_wp*step), omega - step)
    else
      next = 0.5_wp*(rising + falling)
      if (newton > rising .and. newton < falling .and. point%slope_along < 0.0_wp) next = newton
    end if
  end function next_frequency

  !> Does the way from one value to another pass a third?
  pure logical function passed(from, to, value)
    real(wp), intent(in) :: from, to, value

    passed = (value - from)*(to - value) >= 0.0_wp .and. abs(to - from) > 0.0_wp
  end function passed

  !> Go along the tangent, and as it turned over the last step; the plane across it stands there.
  subroutine predict(self, solver, before, length, plane)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    type(place_type), intent(in) :: before
    real(wp), intent(in) :: length
    type(plane_type), intent(out) :: plane
    real(wp) :: scale, parameter

    scale = scale_of_motion(solver)
    associate (step => self%tangent%step)
      solver%motion = before%motion + length*step%motion
      solver%omega = before%omega + length*step%omega
      parameter = before%parameter + length*self%tangent%parameter
      if (allocated(self%bend%step%motion)) then
        solver%motion = solver%motion + 0.5_wp*length**2*self%bend%step%motion
        solver%omega = solver%omega + 0.5_wp*length**2*self%bend%step%omega
        parameter = parameter + 0.5_wp*length**2*self%bend%parameter
      end if
      call solver%set_slider(before%slider + length*step%slider, before%periodic)
      call set_value(self%problem, solver, parameter)
      plane%motion = step%motion/scale**2
      plane%motion(1, :) = 0.0_wp
      plane%omega = step%omega*(frequency_weight/before%omega)**2
      plane%parameter = self%tangent%parameter/before%parameter**2
    end associate
    plane%value = height(self, solver, plane)
  end subroutine predict

  !> weights . (motion, omega, parameter) at the solver's point.
  real(wp) function height(self, solver, plane)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(plane_type), intent(in) :: plane

    height = plane%omega*solver%omega + plane%parameter*value_of(self%problem, solver)
    if (allocated(plane%motion)) height = height + inner_product(solver%context%balance, plane%motion, solver%motion)
  end function height

  !> Correct, and tell how far the corrector went from the prediction, relative.
  subroutine correct_from(self, solver, plane, error)
    type(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(plane_type), intent(in) :: plane
    real(wp), intent(out) :: error
    real(wp), allocatable :: moved(:, :)
    real(wp) :: omega, parameter

    moved = solver%motion
    omega = solver%omega
    parameter = value_of(self%problem, solver)
    call correct(self, solver, plane)
    moved = solver%motion - moved
    moved(1, :) = 0.0_wp
    error = relative_size(solver, moved, solver%omega - omega, value_of(self%problem, solver)/parameter - 1.0_wp)
  end subroutine correct_from

  !> Norm of a change of harmonics, frequency, and (relative) parameter.
  real(wp) function relative_size(solver, motion, omega, parameter)
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :), omega, parameter

    associate (balance => solver%context%balance)
      relative_size = sqrt(inner_product(balance, motion, motion)/max(scale_of_motion(solver), tiny(1.0_wp))**2 + &
                           (frequency_weight*omega/solver%omega)**2 + parameter**2)
    end associate
  end function relative_size

  !> Newton's method on balance, peak and plane.
  subroutine correct(self, solver, plane)
    type(curve_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(plane_type), intent(in) :: plane
    real(wp) :: slider(2, size(solver%context%balance%law)), along, change, value
    integer :: iteration, status
    logical :: settled

    self%found = .false.
    slider = solver%context%balance%slider
    value = value_of(self%problem, solver)
    do iteration = 1, most_iterations
      self%iterations = iteration
      call settle(self, solver, slider, settled)
      if (.not. settled) return
      call linearise(self%problem, solver, self%point, status)
      if (status /= 0) return
      call solve_for_two(self, solver, plane, along, change, status)
      if (status /= 0) return
      self%found = self%point%residual <= solver%context%tolerance .and. abs(along) <= small_step &
                   .and. abs(change) <= small_change*abs(value)
      if (self%found) exit
      call take_step(self, solver, along, change, status)
      if (status /= 0) return
    end do
    if (.not. self%found) return
    solver%report = newton_report_type(converged=.true., iterations=self%iterations, residual=self%point%residual, &
                                       defect=solver%report%defect)
    call solver%accept(solver%motion, solver%omega, slider)
  end subroutine correct

  !> With two tangents: solve in the plane across the frequency response, so that sliders rest or are periodic.
  subroutine settle(self, solver, slider, settled)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    !> Where the point before left them [2, contacts]
    real(wp), intent(in) :: slider(:, :)
    logical, intent(out) :: settled
    type(constraint_type) :: constraint
    integer :: i

    settled = .true.
    solver%report%defect = 0.0_wp
    if (all(solver%contacts%law%tangents == 1)) return
    constraint = self%problem%border
    constraint%value = inner_product(solver%context%balance, constraint%motion, solver%motion) + constraint%frequency*solver%omega
    call solver%solve_with(constraint)
    settled = solver%report%converged
    do i = 1, size(slider, 2)
      if (.not. solver%context%balance%periodic(i)) solver%context%balance%slider(:, i) = slider(:, i)
    end do
  end subroutine settle

  !> sigma and pi of Newton's step.
  subroutine solve_for_two(self, solver, plane, along, change, status)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(plane_type), intent(in) :: plane
    real(wp), intent(out) :: along, change
    !> 0, or not: singular
    integer, intent(out) :: status
    real(wp) :: right(2), rows(2, 2), determinant

    associate (point => self%point)
      right = [-point%slope - point%slope_newton, plane%value - height(self, solver, plane) - across(point%newton)]
      rows(1, :) = [point%slope_along, point%slope_parameter]
      rows(2, :) = [across(point%along), across(point%by_parameter)]
    end associate
    determinant = rows(1, 1)*rows(2, 2) - rows(1, 2)*rows(2, 1)
    status = merge(0, 1, abs(determinant) > 0.0_wp)
    along = 0.0_wp
    change = 0.0_wp
    if (status /= 0) return
    along = (right(1)*rows(2, 2) - rows(1, 2)*right(2))/determinant
    change = (rows(1, 1)*right(2) - right(1)*rows(2, 1))/determinant

  contains

    real(wp) function across(direction)
      type(direction_type), intent(in) :: direction

      across = plane%omega*direction%step%omega + plane%parameter*direction%parameter
      if (allocated(plane%motion)) across = across + inner_product(solver%context%balance, plane%motion, direction%step%motion)
    end function across
  end subroutine solve_for_two

  !> Take Newton's step, unless it goes too far.
  subroutine take_step(self, solver, along, change, status)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: along, change
    integer, intent(out) :: status
    type(direction_type) :: step
    real(wp) :: harmonics(size(solver%motion, 1), size(solver%motion, 2))

    step = combine(self%point, 1.0_wp, along, change)
    harmonics = step%step%motion
    harmonics(1, :) = 0.0_wp
    associate (value => value_of(self%problem, solver))
      status = merge(0, 1, relative_size(solver, harmonics, step%step%omega, change/value) <= longest_step)
      if (status /= 0) return
      solver%motion = solver%motion + step%step%motion
      solver%omega = solver%omega + step%step%omega
      associate (balance => solver%context%balance)
        balance%slider = balance%slider + merge(step%step%slider, 0.0_wp, spread(balance%periodic, 1, 2))
      end associate
      if (abs(change) > 0.0_wp) call set_value(self%problem, solver, value + change)
    end associate
  end subroutine take_step

  !> a n + sigma t + pi d_p.
  function combine(point, newton, along, change) result(direction)
    type(linearisation_type), intent(in) :: point
    real(wp), intent(in) :: newton, along, change
    type(direction_type) :: direction

    direction%step%motion = newton*point%newton%step%motion + along*point%along%step%motion + change*point%by_parameter%step%motion
    direction%step%slider = newton*point%newton%step%slider + along*point%along%step%slider + change*point%by_parameter%step%slider
    direction%step%omega = newton*point%newton%step%omega + along*point%along%step%omega + change*point%by_parameter%step%omega
    direction%parameter = change
  end function combine

  !> Tangent of the curve of peaks, psi'[t] sigma + psi'[d_p] pi = 0, the way the last one went.
  subroutine find_tangent(self, solver, length)
    type(curve_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver
    !> Of the step since the last one; 0 where there was none
    real(wp), intent(in) :: length
    type(direction_type) :: tangent
    real(wp), allocatable :: harmonics(:, :)
    real(wp) :: size_of_it

    associate (point => self%point, problem => self%problem, context => solver%context)
      tangent = combine(point, 0.0_wp, -point%slope_parameter, point%slope_along)
      harmonics = tangent%step%motion
      harmonics(1, :) = 0.0_wp
      size_of_it = relative_size(solver, harmonics, tangent%step%omega, tangent%parameter/value_of(problem, solver))
      tangent = scaled(tangent, 1.0_wp/size_of_it)
      tangent%step%slider = merge(tangent%step%slider, 0.0_wp, spread(context%balance%periodic, 1, 2))
      if (allocated(self%tangent%step%motion)) then
        if (along_last(self, solver, tangent) < 0.0_wp) call turn_round(tangent)
      end if
      if (allocated(self%bend%step%motion)) deallocate (self%bend%step%motion)
      if (length > 0.0_wp .and. allocated(self%tangent%step%motion)) then
        self%bend%step%motion = (tangent%step%motion - self%tangent%step%motion)/length
        self%bend%step%slider = 0.0_wp*tangent%step%slider
        self%bend%step%omega = (tangent%step%omega - self%tangent%step%omega)/length
        self%bend%parameter = (tangent%parameter - self%tangent%parameter)/length
      end if
      self%tangent = tangent
    end associate
  end subroutine find_tangent

  function scaled(direction, factor) result(changed)
    type(direction_type), intent(in) :: direction
    real(wp), intent(in) :: factor
    type(direction_type) :: changed

    changed%step%motion = factor*direction%step%motion
    changed%step%slider = factor*direction%step%slider
    changed%step%omega = factor*direction%step%omega
    changed%parameter = factor*direction%parameter
  end function scaled

  !> Inner product, as the size of steps is measured, of a tangent with the last one.
  real(wp) function along_last(self, solver, tangent)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(direction_type), intent(in) :: tangent

    along_last = inner_product(solver%context%balance, self%tangent%step%motion(2:, :), tangent%step%motion(2:, :)) &
                 /scale_of_motion(solver)**2 + self%tangent%step%omega*tangent%step%omega*(frequency_weight/solver%omega)**2 &
                 + self%tangent%parameter*tangent%parameter/value_of(self%problem, solver)**2
  end function along_last

  !> d^2 A/d omega^2 along the frequency response: negative at a maximum.
  real(wp) function curvature(self)
    class(curve_type), intent(in) :: self

    curvature = self%point%slope_along/self%point%along%step%omega**2
  end function curvature

  function place_of(self, solver) result(place)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(place_type) :: place

    place = place_type(solver%motion, solver%context%balance%slider, solver%context%balance%periodic, solver%omega, &
                       value_of(self%problem, solver), solver%context%motion_scale)
  end function place_of

  subroutine return_to(self, solver, place)
    type(curve_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    type(place_type), intent(in) :: place

    call set_value(self%problem, solver, place%parameter)
    solver%context%motion_scale = place%motion_scale
    solver%motion = place%motion
    solver%omega = place%omega
    call solver%set_slider(place%slider, place%periodic)
  end subroutine return_to
end module attrito_peak_curve
