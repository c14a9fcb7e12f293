!> Seeds of branches that no sweep leads to: from rest, by time integration from another motion, and by homotopy in the preload, from
!> a structure under other static loads,
!>
!> $$ f_0(t) = \gamma^{1 - t} f_0, \qquad t = 0 \dots 1. $$
module attrito_continuation_branch_seeds
  use attrito_core_kinds, only: wp
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  use attrito_solve_time_integration_start, only: has_time_integrator, solve_from_time_integration
  use attrito_solve_homotopy, only: follow_homotopy, homotopy_type
  implicit none
  private
  public :: start_cold, start_in_motion, start_from_preload

  !> Iterations after which a homotopy is given up
  integer, parameter :: most_iterations = 200 ! conventional

  !> From other static loads to those that act
  type, extends(homotopy_type) :: preload_homotopy_type
    real(wp), allocatable :: factors(:)
    real(wp) :: gamma = 1.0_wp, level = 1.0_wp, omega = 0.0_wp
  contains
    procedure :: solve => solve_preloaded
  end type preload_homotopy_type

contains

  !> From rest at the static solution.
  subroutine start_cold(solver, omega, found)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Is there such a point?
    logical, intent(out) :: found

    call solver%rest()
    solver%evidence = evidence_type()
    call solve_by_strategies(solver, omega)
    found = solver%report%converged
  end subroutine start_cold

  !> From the averages of motion in time that begins with the harmonics of the present motion times a factor.
  subroutine start_in_motion(solver, omega, factor, found)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s; factor on the harmonics or the static loads
    real(wp), intent(in) :: omega, factor
    !> Is there such a point?
    logical, intent(out) :: found
    type(strategy_outcome_type) :: outcome

    found = .false.
    if (.not. has_time_integrator(solver)) return
    solver%motion(2:, :) = factor*solver%motion(2:, :)
    outcome%evidence%is_drifting = solver%evidence%is_drifting
    call solve_from_time_integration(solver, omega, evidence_type(), outcome)
    found = outcome%converged
    solver%evidence = evidence_type()
  end subroutine start_in_motion

  !> From the solution at static loads times a factor.
  subroutine start_from_preload(solver, omega, factor, found)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s; factor on the harmonics or the static loads
    real(wp), intent(in) :: omega, factor
    !> Is there such a point?
    logical, intent(out) :: found
    type(preload_homotopy_type) :: homotopy
    integer :: iterations

    homotopy%factors = solver%context%balance%static_factors
    homotopy%level = solver%context%balance%level
    homotopy%gamma = factor
    homotopy%omega = omega
    call solver%set_loads(factor*homotopy%factors, homotopy%level)
    call start_cold(solver, omega, found)
    if (found) then
      iterations = 0
      call follow_homotopy(homotopy, solver, iterations, found, most_iterations=most_iterations)
    end if
    call solver%set_loads(homotopy%factors, homotopy%level)
  end subroutine start_from_preload

  subroutine solve_preloaded(self, solver, t, converged)
    class(preload_homotopy_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Parameter of the homotopy, 0 to 1
    real(wp), intent(in) :: t
    !> Did the solve converge?
    logical, intent(out) :: converged

    call solver%set_loads(self%gamma**(1.0_wp - t)*self%factors, self%level)
    call solver%solve_at(self%omega)
    converged = solver%report%converged
  end subroutine solve_preloaded
end module attrito_continuation_branch_seeds
