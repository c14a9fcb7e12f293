!> Where periodic motion is not near: periods of motion at a mode's amplitude, one after another, their sliders creeping.
!>
!> $$ r_h(d_n, w_n) = 0, \qquad w_{n+1} = P(w_n, d_n) $$
!>
!> The contacts that hold a joint reach their limit one after another. Where the last one does, sliders with two tangents go on to
!> places at a finite distance, or for ever: Newton's method on w = P(w, d) finds no solution near the last one, however short the
!> step in amplitude. Periods are marched one after another instead (`attrito_solve_slider_steps`). Where sliders settle Newton's
!> method ends at motion that repeats. Where they go on by equal steps no motion repeats: the joint drifts, its harmonics alone being
!> periodic; the point is what omega and xi then come to, and its sliders' defect says so.
!>
!> Near the onset sliders take hundreds of periods, most of which are extrapolated.
module attrito_peak_slider_creep
  use attrito_core_kinds, only: wp
  use attrito_solve_slider_steps, only: slider_steps_type, begin_passing, end_passing, slowest_creep
  use attrito_solve_solver, only: solver_type
  use attrito_peak_backbone_point, only: backbone_type, base_point_type, base_point_of, start_from, correct
  implicit none
  private
  public :: creep

  !> Periods at most; relative changes of omega and xi from one to the next that count as none. Half and twice, on a rocking block by
  !> five series of harmonics and samples, change at most 5e-9 of omega, 3.3e-6 of xi and 3.2e-4 of the drift, and no outcome
  integer, parameter :: most_periods = 64 ! guess
  real(wp), parameter :: same_omega = 3.0e-7_wp, same_excitation = 3.0e-6_wp ! guess

contains

  !> The point of the start's amplitude, which the solver is at where it is found.
  subroutine creep(self, solver, start)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Where the first period begins
    type(base_point_type), intent(in) :: start
    type(base_point_type) :: before
    type(slider_steps_type) :: steps
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
      call steps%note(solver)
      part = steps%part_of_last(solver)
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
      call steps%extrapolate(solver)
    end do
    self%iterations = iterations
  end subroutine creep

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

  !> One period of motion at the amplitude, from the sliders as they are, which need not come back, and from a mean.
  subroutine march_period(self, solver, mean)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of the period before [rows]
    real(wp), intent(in) :: mean(:)

    call begin_passing(solver, mean)
    call correct(self, solver, base_point_of(self, solver))
    call end_passing(solver)
  end subroutine march_period
end module attrito_peak_slider_creep
