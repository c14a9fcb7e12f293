!> Where a frequency response ends that rises, as climbing to its peak does not get any farther (`attrito_peak_climb`).
!>
!> What follows a little farther on, by all strategies, says why. If it is lower, and falls, the response jumps there, and its end
!> counts as the peak, a corner. If there is no motion of the loads' period, or nothing but mean positions moves at the end, a body
!> drifts.
module attrito_peak_branch_end
  use attrito_core_kinds, only: wp
  use attrito_solve_snapshot, only: restore
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_continuation_tangent, only: frequency_tangent
  use attrito_peak_climb, only: branch_seed_type, face_uphill, look_around, first_leap, ripple
  use attrito_peak_condition, only: problem_type
  implicit none
  private
  public :: look_beyond

  !> Times that the way beyond the last point is halved
  integer, parameter :: most_halvings = 60 ! conventional

contains

  !> From the last point of a response that was climbed to its end, where the solver is left.
  subroutine look_beyond(problem, solver, iterations, found, drifts)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is its end a peak?
    logical, intent(out) :: found
    !> Is there no motion of the loads' period beyond?
    logical, intent(out) :: drifts
    type(branch_seed_type) :: here, next
    real(wp) :: beyond
    logical :: solved

    found = .false.
    drifts = .false.
    call face_uphill(problem, solver, here, iterations, solved)
    if (.not. solved) return
    ! Beyond the last such point nothing but a mean position moves.
    drifts = .not. here%is_held
    if (drifts) return
    call go_to_end(problem, solver, here, beyond, iterations)
    call restore(solver, here%snapshot)
    call solve_by_strategies(solver, beyond)
    iterations = iterations + solver%report%iterations
    solved = solver%report%converged
    drifts = .not. solved .and. solver%evidence%no_periodic_solution
    if (solved) call look_around(problem, solver, frequency_tangent(solver, beyond - here%snapshot%omega), next, solved)
    if (solved) found = next%amplitude < (1.0_wp - ripple)*here%amplitude .and. next%slope < 0.0_wp
    call restore(solver, here%snapshot)
  end subroutine look_beyond

  !> To the end of a response that rises, by frequencies that Newton's method solves from the last point.
  subroutine go_to_end(problem, solver, here, beyond, iterations)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> A point where A rises, beyond which no step is solved; then the last one
    type(branch_seed_type), intent(inout) :: here
    !> Angular frequency a little farther on, rad/s
    real(wp), intent(out) :: beyond
    !> Counts on
    integer, intent(inout) :: iterations
    type(branch_seed_type) :: next
    real(wp) :: left
    integer :: i
    logical :: solved

    left = sign(first_leap, here%tangent%omega)*solver%context%frequency_scale
    do i = 1, most_halvings
      left = 0.5_wp*left
      if (here%slope*abs(left/(here%tangent%omega*solver%context%frequency_scale)) <= ripple) exit
      call restore(solver, here%snapshot)
      call solver%solve_at(here%snapshot%omega + left, early_stop=.true.)
      iterations = iterations + solver%report%iterations
      if (.not. solver%report%converged) cycle
      call look_around(problem, solver, here%tangent, next, solved)
      if (solved .and. next%slope > 0.0_wp .and. next%amplitude > here%amplitude) here = next
    end do
    beyond = here%snapshot%omega + 2.0_wp*left
  end subroutine go_to_end
end module attrito_peak_branch_end
