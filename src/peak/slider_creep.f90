!> Where periodic motion is not near: periods of motion at a mode's amplitude, one after another, their sliders creeping.
!>
!> $$ r_h(d_n, w_n) = 0, \qquad w_{n+1} = P(w_n, d_n) $$
!>
!> The contacts that hold a joint reach their limit one after another. Where the last one does, sliders with two tangents go on to
!> places at a finite distance, or for ever: Newton's method on w = P(w, d) finds no solution near the last one, however short the
!> step in amplitude. A period marched once, from given sliders, is a continuous function of the motion, and so is where it takes
!> them. Where they settle Newton's method ends at motion that repeats. Where they go on by equal steps no motion repeats: the joint
!> drifts; the point is what omega and xi then come to, and its sliders' defect says so. Where they settle so slowly that omega and
!> xi feel no more of it, it counts as settled. Sliders that creep by a constant part rho of the period before are taken to where
!> that leads, w + rho/(1 - rho) delta w, as under quasi-static loading (`attrito_peak_quasi_static`).
module attrito_peak_slider_creep
  use attrito_core_kinds, only: wp
  use attrito_solve_sliders, only: end_period
  use attrito_solve_solver, only: solver_type
  use attrito_peak_backbone_point, only: backbone_type, base_point_type, base_point_of, start_from, correct
  implicit none
  private
  public :: creep

  !> Periods at most; relative changes of omega and xi from one to the next that count as none
  integer, parameter :: most_periods = 64 ! guess
  real(wp), parameter :: same_omega = 3.0e-7_wp, same_excitation = 3.0e-6_wp ! guess
  !> Creep that settles: largest part that a period leaves; by what part two steps may differ in direction to be extrapolated
  real(wp), parameter :: slowest_creep = 0.97_wp, alike = 0.2_wp ! guess

contains

  !> The point of the start's amplitude, which the solver is at where it is found.
  subroutine creep(self, solver, start)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Where the first period begins
    type(base_point_type), intent(in) :: start
    type(base_point_type) :: before
    real(wp), allocatable :: moved(:, :), last(:, :)
    real(wp) :: change
    integer :: period, iterations
    logical :: repeats, settles, crept_before

    crept_before = self%creeps
    self%creeps = .false.
    iterations = 0
    allocate (moved, mold=start%slider)
    call start_from(self, solver, start)
    do period = 1, most_periods
      call march_period(self, solver)
      iterations = iterations + self%iterations
      if (.not. self%found) exit
      change = huge(1.0_wp)
      if (period > 1) change = abs(solver%omega/before%omega - 1.0_wp)
      repeats = change <= same_omega
      if (repeats) repeats = abs(self%excitation - before%excitation) <= same_excitation*abs(self%excitation)
      call end_period(solver%context%balance, moved)
      before = base_point_of(self, solver)
      settles = .true.
      if (allocated(last)) settles = norm2(moved) <= slowest_creep*norm2(last)
      if (settles .and. (repeats .or. iand(period, period + 1) == 0) .and. .not. (crept_before .and. period == 1)) then
        call correct(self, solver, before)
        iterations = iterations + self%iterations
        if (self%found) exit
        call start_from(self, solver, before)
      end if
      if (repeats) then
        call march_period(self, solver)
        iterations = iterations + self%iterations
        self%creeps = self%found
        if (settles) solver%report%defect = min(solver%report%defect, change)
        exit
      end if
      self%found = .false.
      call extrapolate(solver, moved, last)
    end do
    self%iterations = iterations
  end subroutine creep

  !> Take sliders to where steps lead of which each is the same part of the one before; else note the last step.
  subroutine extrapolate(solver, moved, last)
    !> Solver of points, whose sliders this moves
    type(solver_type), intent(inout) :: solver
    !> What the last period has moved them by [width, contacts]
    real(wp), intent(in) :: moved(:, :)
    !> The same of the period before, if that counts
    real(wp), allocatable, intent(inout) :: last(:, :)
    real(wp) :: ratio

    if (allocated(last)) then
      ratio = sum(moved*last)/max(sum(last**2), tiny(1.0_wp))
      if (ratio > 0.0_wp .and. ratio <= slowest_creep .and. norm2(moved - ratio*last) <= alike*norm2(moved)) then
        associate (slider => solver%context%balance%slider)
          slider = slider + ratio/(1.0_wp - ratio)*moved
        end associate
        deallocate (last)
        return
      end if
    end if
    last = moved
  end subroutine extrapolate

  !> One period of motion at the amplitude, from the sliders as they are, which need not come back.
  subroutine march_period(self, solver)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    solver%context%balance%marches = .true.
    call solver%context%forget()
    call correct(self, solver, base_point_of(self, solver))
    solver%context%balance%marches = .false.
    call solver%context%forget()
  end subroutine march_period
end module attrito_peak_slider_creep
