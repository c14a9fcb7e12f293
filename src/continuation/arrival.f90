!> A converged end of a step that is kept while a nearer point is looked for: a point that converged is not thrown away because the
!> curve drawn to it is not near enough to the branch, if nothing nearer is found.
module attrito_continuation_arrival
  use attrito_core_kinds, only: wp
  use attrito_balance_set_aside, only: evaluation_type, set_aside, take_up
  use attrito_newton_newton, only: newton_report_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_curve_point, only: curve_point_type
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type
  implicit none
  private
  public :: arrival_type, is_worth_keeping

  !> Part of its error that a nearer point has to leave, or it is no better
  real(wp), parameter :: worth_more = 0.75_wp ! guess
  !> Error of the curve drawn to a point, relative to what is accepted, and distance of the branch in between, relative to what is
  !> another branch's, up to which it is kept; failures of nearer points after which it is taken
  real(wp), parameter :: most_error = 10.0_wp, most_off = 0.5_wp ! guess
  integer, parameter :: most_failures = 2 ! guess

  type :: arrival_type
    !> The step that ends here, the tangent and the point of the drawn curve
    type(step_type) :: step
    type(tangent_type) :: tangent
    type(curve_point_type) :: point
    !> Error of the drawn curve, relative to what is accepted
    real(wp) :: error = 0.0_wp
    logical :: is_known = .false.
    type(snapshot_type), private :: snapshot
    type(evaluation_type), private :: evaluation
    type(newton_report_type), private :: report
  contains
    procedure :: take
    procedure :: is_beaten
    procedure :: is_next
    procedure :: return_to
  end type arrival_type

contains

  !> May a point be the end of a step if nothing nearer is found?
  pure logical function is_worth_keeping(error, off)
    !> Of the curve drawn to it, relative to what is accepted
    real(wp), intent(in) :: error
    !> Distance of the branch in between from the curve, relative to what is another branch's
    real(wp), intent(in) :: off

    is_worth_keeping = error < most_error .and. off < most_off
  end function is_worth_keeping

  !> Keep the solver's present point, at which the balance was evaluated last.
  subroutine take(self, solver, step, tangent, point, error)
    class(arrival_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> The step that ends here
    type(step_type), intent(in) :: step
    !> Of the branch there
    type(tangent_type), intent(in) :: tangent
    !> The same of the drawn curve
    type(curve_point_type), intent(in) :: point
    !> Error of the drawn curve, relative to what is accepted
    real(wp), intent(in) :: error

    self%is_known = .true.
    self%step = step
    self%tangent = tangent
    self%point = point
    self%error = error
    self%snapshot = snapshot_of(solver)
    self%report = solver%report
    call set_aside(solver%context%balance, self%evaluation)
  end subroutine take

  !> Is a nearer point, with this error of the curve drawn to it, worth a step of its own?
  pure logical function is_beaten(self, error)
    class(arrival_type), intent(in) :: self
    !> Of the curve to the nearer point, relative to what is accepted
    real(wp), intent(in) :: error

    is_beaten = .not. self%is_known .or. error <= max(worth_more*self%error, 1.0_wp)
  end function is_beaten

  !> Is it taken after so many failures of nearer points?
  pure logical function is_next(self, failures)
    class(arrival_type), intent(in) :: self
    !> Of Newton's method, or points that ran back
    integer, intent(in) :: failures

    is_next = self%is_known .and. failures >= most_failures
  end function is_next

  !> Set the solver to the point that was kept.
  subroutine return_to(self, solver)
    class(arrival_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    call restore(solver, self%snapshot)
    call take_up(solver%context%balance, self%evaluation)
    call solver%context%forget()
    solver%report = self%report
  end subroutine return_to
end module attrito_continuation_arrival
