!> The present point solved again on another series, in its own plane.
module attrito_accuracy_finer_solution
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: resized
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_report_type
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: solve_finer

  !> Part of the frequency by which a finer series moves a point at most: beyond, it is another
  real(wp), parameter :: farthest = 0.2_wp ! guess

contains

  !> Solve the point again, finer, from where it is expected; back to what it was if that fails.
  subroutine solve_finer(solver, finer, harmonics, early_stop, iterations, better)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(in) :: finer
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    !> Give up after a few iterations of Newton's method
    logical, intent(in) :: early_stop
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is there a finer point?
    logical, intent(out) :: better
    type(snapshot_type) :: before
    type(newton_report_type) :: report
    type(constraint_type) :: constraint
    real(wp), allocatable :: slider(:, :)
    logical, allocatable :: periodic(:)
    integer :: shorter, status

    before = snapshot_of(solver)
    report = solver%report
    shorter = solver%options%harmonics
    ! Two series are compared from the same start: sliders at rest begin where the point's first solve did.
    slider = solver%context%balance%slider
    periodic = solver%context%balance%periodic
    if (allocated(solver%slider_before)) slider = merge(slider, solver%slider_before, spread(periodic, 1, size(slider, 1)))
    call solver%set_harmonics(harmonics)
    call solver%set_slider(slider, periodic)
    solver%motion = resized(finer%motion, 2*harmonics + 1)
    constraint = solver%context%constraint
    call solver%solve_with(constraint, early_stop)
    iterations = iterations + solver%report%iterations
    ! The constraint's plane meets branches far away, too.
    better = solver%report%converged .and. abs(solver%omega - before%omega) <= farthest*before%omega
    if (better) return
    call solver%set_harmonics(shorter)
    call restore(solver, before)
    call solver%context%balance%evaluate(solver%motion, solver%omega, status)
    solver%report = report
  end subroutine solve_finer
end module attrito_accuracy_finer_solution
