!> Where periodic motion is not near: periods of motion at a mode's amplitude, one after another, their sliders creeping.
!>
!> $$ r_h(d_n, w_n) = 0, \qquad w_{n+1} = P(w_n, d_n) $$
!>
!> The contacts that hold a joint reach their limit one after another. Where the last one does, sliders with two tangents go on to
!> places at a finite distance, or for ever: Newton's method on w = P(w, d) finds no solution near the last one, however short the
!> step in amplitude. A period marched once, from given sliders, is a continuous function of the motion, and so is where it takes
!> them. Displacements go on from the mean of the period before to that of the next at a constant rate
!> (`attrito_contact_passing_period`), or else all that a joint moves by would be a jump at one instant of the period. Where
!> sliders settle Newton's method ends at motion that repeats. Where they go on by equal steps no motion repeats: the joint drifts,
!> its harmonics alone being periodic; the point is what omega and xi then come to, and its sliders' defect says so.
!>
!> Near the onset sliders take hundreds of periods. Steps s_n whose changes are each a part rho of the one before lead to equal
!> steps (none, where they settle); sliders, and the mean with them, are taken to where these begin,
!>
!> $$ s_n - s_{n-1} = \rho (s_{n-1} - s_{n-2}): \quad
!>    w + \sum_{k \ge 1} (s_{n+k} - s_\infty) = w - \left(\frac{\rho}{1 - \rho}\right)^2 (s_n - s_{n-1}). $$
module attrito_peak_slider_creep
  use attrito_core_kinds, only: wp
  use attrito_solve_sliders, only: end_period
  use attrito_solve_solver, only: solver_type
  use attrito_peak_backbone_point, only: backbone_type, base_point_type, base_point_of, start_from, correct
  implicit none
  private
  public :: creep

  !> Periods at most; relative changes of omega and xi from one to the next that count as none. Half and twice, on a rocking block by
  !> five series of harmonics and samples, change at most 5e-9 of omega, 3.3e-6 of xi and 3.2e-4 of the drift, and no outcome
  integer, parameter :: most_periods = 64 ! guess
  real(wp), parameter :: same_omega = 3.0e-7_wp, same_excitation = 3.0e-6_wp ! guess
  !> Sliders settle: largest part that a period leaves of the step before. Steps are extrapolated: largest part that a period leaves
  !> of what they change by, and by what part two such changes may differ in direction. There one hundredth more or less of the first
  !> two changes nothing, half and twice the last 3e-9 of omega, 2e-6 of xi and 5e-5 of the drift
  real(wp), parameter :: slowest_creep = 0.97_wp, slowest_change = 0.997_wp, alike = 0.2_wp ! guess

  !> By how much periods move sliders [width, contacts] and the mean [rows], this rank's; no step: not allocated
  type :: steps_type
    !> Of the last period, and of the two before
    real(wp), allocatable :: slider(:, :), slider_before(:, :), slider_earlier(:, :)
    real(wp), allocatable :: mean(:), mean_before(:)
    !> Mean from which the next is a step
    real(wp), allocatable :: base(:)
  end type steps_type

contains

  !> The point of the start's amplitude, which the solver is at where it is found.
  subroutine creep(self, solver, start)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Where the first period begins
    type(base_point_type), intent(in) :: start
    type(base_point_type) :: before
    type(steps_type) :: steps
    real(wp) :: part
    integer :: period, iterations
    logical :: repeats, tried, crept_before

    crept_before = self%creeps
    self%creeps = .false.
    tried = .false.
    iterations = 0
    call start_from(self, solver, start)
    steps%base = solver%motion(1, :)
    do period = 1, most_periods
      call march_period(self, solver, steps%base)
      iterations = iterations + self%iterations
      if (.not. self%found) exit
      call note_step(solver, steps)
      part = part_of_last(solver, steps)
      repeats = part < huge(part) .and. is_alike(self, solver, before)
      before = base_point_of(self, solver)
      if (is_time_to_correct(period, part, crept_before) .or. (repeats .and. part <= slowest_creep .and. .not. tried)) then
        tried = repeats
        call correct(self, solver, before)
        iterations = iterations + self%iterations
        if (self%found) exit
        call start_from(self, solver, before)
      end if
      solver%motion(1, :) = solver%motion(1, :) + steps%mean
      if (repeats .and. (part > slowest_creep .or. period == most_periods)) then
        call march_period(self, solver, steps%base)
        iterations = iterations + self%iterations
        self%creeps = self%found
        exit
      end if
      self%found = .false.
      call extrapolate(solver, steps)
    end do
    self%iterations = iterations
  end subroutine creep

  !> Leave sliders where the period takes them, and note by how much it moved them and the mean.
  subroutine note_step(solver, steps)
    !> Solver of points, whose sliders this moves
    type(solver_type), intent(inout) :: solver
    !> Those of the periods before, to which this is added
    type(steps_type), intent(inout) :: steps

    call move_alloc(steps%slider_before, steps%slider_earlier)
    call move_alloc(steps%slider, steps%slider_before)
    call move_alloc(steps%mean, steps%mean_before)
    allocate (steps%slider, mold=solver%context%balance%slider)
    call end_period(solver%context%balance, steps%slider)
    steps%mean = solver%motion(1, :) - steps%base
    steps%base = solver%motion(1, :)
  end subroutine note_step

  !> Length of the last step by that of the one before; huge where none was before.
  real(wp) function part_of_last(solver, steps) result(part)
    !> Solver of points: its ranks
    type(solver_type), intent(in) :: solver
    !> Of the last periods
    type(steps_type), intent(in) :: steps
    real(wp) :: squares(2)

    part = huge(part)
    if (.not. allocated(steps%slider_before)) return
    squares = [sum(steps%slider**2), sum(steps%slider_before**2)]
    call solver%context%balance%ranks%sum(squares)
    part = sqrt(squares(1)/max(squares(2), tiny(1.0_wp)))
  end function part_of_last

  !> Are omega and xi what they were a period before?
  pure logical function is_alike(self, solver, before)
    type(backbone_type), intent(in) :: self
    !> Solver of points: its angular frequency
    type(solver_type), intent(in) :: solver
    !> A period before
    type(base_point_type), intent(in) :: before

    is_alike = abs(solver%omega - before%omega) <= same_omega*solver%omega &
               .and. abs(self%excitation - before%excitation) <= same_excitation*abs(self%excitation)
  end function is_alike

  !> Is motion that repeats looked for after this period? After 1, 3, 7, ... unless sliders go on by equal steps.
  pure logical function is_time_to_correct(period, part, crept_before)
    !> From 1
    integer, intent(in) :: period
    !> See `part_of_last`
    real(wp), intent(in) :: part
    !> Did sliders creep at the point before?
    logical, intent(in) :: crept_before

    is_time_to_correct = iand(period, period + 1) == 0 .and. .not. (crept_before .and. period == 1)
    if (part < huge(part)) is_time_to_correct = is_time_to_correct .and. part <= slowest_creep
  end function is_time_to_correct

  !> Take sliders and mean to where steps lead whose changes are each the same part of the one before.
  subroutine extrapolate(solver, steps)
    !> Solver of points, whose sliders and mean this moves
    type(solver_type), intent(inout) :: solver
    !> Of the last periods; those before where these led are forgotten
    type(steps_type), intent(inout) :: steps
    real(wp), allocatable :: change(:, :), change_before(:, :)
    real(wp) :: products(3), ratio, factor

    if (.not. (allocated(steps%slider_earlier) .and. allocated(steps%mean_before))) return
    change = steps%slider - steps%slider_before
    change_before = steps%slider_before - steps%slider_earlier
    products = [sum(change**2), sum(change*change_before), sum(change_before**2)]
    call solver%context%balance%ranks%sum(products)
    if (products(1) <= 0.0_wp .or. products(3) <= 0.0_wp) return
    ratio = products(2)/products(3)
    if (ratio <= 0.0_wp .or. ratio > slowest_change) return
    ! |c - ratio b|^2 = |c|^2 - ratio c.b
    if (products(1) - ratio*products(2) > alike**2*products(1)) return
    factor = -(ratio/(1.0_wp - ratio))**2
    associate (slider => solver%context%balance%slider, mean_change => steps%mean - steps%mean_before)
      slider = slider + factor*change
      solver%motion(1, :) = solver%motion(1, :) + factor*mean_change
      steps%base = steps%base + factor*mean_change
    end associate
    deallocate (steps%slider, steps%slider_before, steps%slider_earlier, steps%mean, steps%mean_before)
  end subroutine extrapolate

  !> One period of motion at the amplitude, from the sliders as they are, which need not come back, and from a mean.
  subroutine march_period(self, solver, mean)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of the period before [rows]
    real(wp), intent(in) :: mean(:)

    solver%context%balance%mean_before = mean
    call solver%context%forget()
    call correct(self, solver, base_point_of(self, solver))
    deallocate (solver%context%balance%mean_before)
    call solver%context%forget()
  end subroutine march_period
end module attrito_peak_slider_creep
