!> Where no periodic motion is near: forced periods marched one by one, each from where the last has left sliders and mean.
!>
!> $$ r(d_n, w_n) = 0, \qquad w_{n+1} = P(w_n, d_n) $$
!>
!> Contacts that hold a joint reach their limit one after another, and about the last of them Newton's method on w = P(w, d) finds no
!> solution. A period from given sliders has one (`attrito_solve_slider_steps`). Where sliders settle, Newton's method ends at motion
!> that repeats. Where period after period moves them, and the mean, by equal steps, the joint drifts: there is no periodic motion.
module attrito_solve_period_march
  use attrito_core_kinds, only: wp
  use attrito_solve_slider_steps, only: slider_steps_type, begin_passing, end_passing, slowest_creep
  use attrito_solve_sliders, only: largest_defect
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: strategy_outcome_type
  implicit none
  private
  public :: can_march, solve_by_periods

  !> Periods at most; relative change of the harmonics, and of the steps, from one period to the next, of a joint that drifts
  integer, parameter :: most_periods = 64 ! guess
  real(wp), parameter :: same_motion = 1.0e-6_wp, same_steps = 1.0e-3_wp ! guess

contains

  !> Are contacts sampled, and is the mean an unknown?
  pure logical function can_march(solver)
    !> Solver of points: its contacts and options
    type(solver_type), intent(in) :: solver

    can_march = all(solver%contacts%law%tangents == 2) .and. .not. solver%options%uncoupled
  end function can_march

  !> From the solver's point: to periodic motion, to a drift, where it is left, or to neither.
  subroutine solve_by_periods(solver, omega, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Counts iterations on
    type(strategy_outcome_type), intent(inout) :: outcome
    type(slider_steps_type) :: steps
    type(snapshot_type) :: marched
    real(wp), allocatable :: before(:, :)
    integer :: period
    logical :: rests

    outcome%converged = .false.
    steps%base = solver%motion(1, :)
    do period = 1, most_periods
      before = solver%motion(2:, :)
      call begin_passing(solver, steps%base)
      call solver%solve_at(omega)
      call end_passing(solver)
      outcome%iterations = outcome%iterations + solver%report%iterations
      if (.not. solver%report%converged) return
      call steps%note(solver)
      rests = largest_defect(solver%context%balance) <= solver%options%tolerance*solver%context%motion_scale
      if (rests .or. is_time_to_repeat(period, steps%part_of_last(solver))) then
        marched = snapshot_of(solver)
        call solver%solve_at(omega, early_stop=.true.)
        outcome%iterations = outcome%iterations + solver%report%iterations
        outcome%converged = solver%report%converged
        if (outcome%converged .or. rests) return
        call restore(solver, marched)
      end if
      if (steps%change_by(solver) <= same_steps .and. change_of(solver, before) <= same_motion) then
        outcome%evidence%is_drifting = .true.
        return
      end if
      solver%motion(1, :) = solver%motion(1, :) + steps%mean
      call steps%extrapolate(solver)
    end do
  end subroutine solve_by_periods

  !> Is motion that repeats looked for after this period? After 3, 7, 15, ... while sliders settle.
  pure logical function is_time_to_repeat(period, part)
    !> From 1
    integer, intent(in) :: period
    !> Length of the last step by that of the one before
    real(wp), intent(in) :: part

    is_time_to_repeat = period > 1 .and. iand(period, period + 1) == 0 .and. part <= slowest_creep
  end function is_time_to_repeat

  !> Relative change of the harmonics above the mean.
  real(wp) function change_of(solver, before)
    !> Solver of points: its motion
    type(solver_type), intent(in) :: solver
    !> A period before [2 H, rows]
    real(wp), intent(in) :: before(:, :)

    associate (balance => solver%context%balance)
      change_of = balance%norm(solver%motion(2:, :) - before)/max(balance%norm(solver%motion(2:, :)), tiny(1.0_wp))
    end associate
  end function change_of
end module attrito_solve_period_march
