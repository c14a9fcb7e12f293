!> A point with its errors, kept while it is solved again on another series.
module attrito_accuracy_kept_point
  use attrito_newton_newton, only: newton_report_type
  use attrito_balance_set_aside, only: evaluation_type, set_aside, take_up
  use attrito_accuracy_point_errors, only: point_errors_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: kept_point_type

  type :: kept_point_type
    !> Highest harmonic, H
    integer :: harmonics = 0
    type(point_errors_type) :: errors
    type(snapshot_type), private :: snapshot
    type(evaluation_type), private :: evaluation
    type(newton_report_type), private :: report
  contains
    procedure :: take
    procedure :: go_back
  end type kept_point_type

contains

  !> Keep the solver's point.
  subroutine take(self, solver, errors)
    class(kept_point_type), intent(inout) :: self
    !> Solver of points, at a solution
    type(solver_type), intent(in) :: solver
    !> Of that point
    type(point_errors_type), intent(in) :: errors

    self%harmonics = solver%options%harmonics
    self%errors = errors
    self%snapshot = snapshot_of(solver)
    self%report = solver%report
    call set_aside(solver%context%balance, self%evaluation)
  end subroutine take

  !> Take the solver back to it.
  subroutine go_back(self, solver, errors)
    class(kept_point_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of that point
    type(point_errors_type), intent(out) :: errors

    call solver%set_harmonics(self%harmonics)
    call restore(solver, self%snapshot)
    call take_up(solver%context%balance, self%evaluation)
    solver%report = self%report
    errors = self%errors
  end subroutine go_back
end module attrito_accuracy_kept_point
