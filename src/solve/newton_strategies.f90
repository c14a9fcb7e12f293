!> Ways to apply Newton's method from one start: briefly, with springs on the mean first, with contacts that keep some of their
!> springs in the step.
!>
!> A body that only friction holds has a nearly singular Jacobian where few contacts hold, and a singular one where all slip. With
!> springs on its mean (`attrito_solve_mean_springs`) it is regular, and where contacts hold the solution is near one
!> without springs. Where none does, nothing else is tried: wherever the body is, friction does not balance.
module attrito_solve_newton_strategies
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_type, newton_report_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_solve_sliders, only: nothing_holds
  use attrito_solve_mean_springs, only: fasten, release, retreat_type
  implicit none
  private
  public :: solve_briefly, solve_persistently

  !> A brief try goes on from one stretch of iterations to the next while each brings the residual down so far
  integer, parameter :: brief_iterations = 8
  real(wp), parameter :: brief_progress = 1.0e-2_wp

  !> How often springs on the mean give way until the body is known to walk, and how much alike the last steps of a mean that does
  !> are: a guess, which only decides whether more is tried
  integer, parameter :: most_held = 3
  real(wp), parameter :: alike = 0.5_wp
  !> Iterations without such springs from where they have led
  integer, parameter :: free_iterations = 3

  !> Part of their springs that contacts keep in the step of the last tries
  real(wp), parameter :: stiffening = 0.1_wp

contains

  !> Newton's method, given up as soon as it makes little progress.
  subroutine solve_briefly(newton, unknowns, constraint, report)
    type(newton_type), intent(inout) :: newton
    type(unknowns_type), intent(inout) :: unknowns
    type(constraint_type), intent(in) :: constraint
    type(newton_report_type), intent(inout) :: report
    integer :: before, iterations, linear_iterations
    real(wp) :: goal

    before = newton%max_iterations
    iterations = 0
    linear_iterations = 0
    goal = brief_progress
    do
      newton%max_iterations = min(brief_iterations, before - iterations)
      call newton%solve(unknowns, constraint, 0.0_wp, report)
      call count_on(report, iterations, linear_iterations)
      if (report%converged .or. report%residual > goal .or. report%iterations >= before) exit
      goal = brief_progress*report%residual
    end do
    newton%max_iterations = before
  end subroutine solve_briefly

  !> One way after another from the same start.
  subroutine solve_persistently(newton, unknowns, constraint, mean_is_fixed, report)
    type(newton_type), intent(inout) :: newton
    type(unknowns_type), intent(inout) :: unknowns
    type(constraint_type), intent(in) :: constraint
    !> There is no mean to hold
    logical, intent(in) :: mean_is_fixed
    type(newton_report_type), intent(inout) :: report
    type(unknowns_type) :: start
    logical :: can_hold, walks
    integer :: iterations, linear_iterations

    can_hold = .not. (mean_is_fixed .or. allocated(newton%context%balance%held_mean))
    start = unknowns
    iterations = 0
    linear_iterations = 0
    if (can_hold) then
      call solve_briefly(newton, unknowns, constraint, report)
      call count_on(report, iterations, linear_iterations)
      if (report%converged) return
      unknowns = start
      call solve_holding(newton, unknowns, constraint, report, walks)
      call count_on(report, iterations, linear_iterations)
      if (report%converged .or. walks) return
      unknowns = start
    end if
    call newton%solve(unknowns, constraint, 0.0_wp, report)
    call count_on(report, iterations, linear_iterations)
    if (report%converged) return
    unknowns = start
    call newton%solve(unknowns, constraint, stiffening, report)
    call count_on(report, iterations, linear_iterations)
  end subroutine solve_persistently

  !> With springs on the mean, and from there without them. Where the contacts that hold stand near their limit all of them may give
  !> way in a step without springs, however near the solution: then they keep some of their own in the step.
  subroutine solve_holding(newton, unknowns, constraint, report, walks)
    type(newton_type), intent(inout) :: newton
    type(unknowns_type), intent(inout) :: unknowns
    type(constraint_type), intent(in) :: constraint
    type(newton_report_type), intent(inout) :: report
    !> Springs alone hold the body
    logical, intent(out) :: walks
    type(unknowns_type) :: held
    integer :: iterations, linear_iterations

    call hold(newton, unknowns, constraint, report, walks)
    if (walks .or. .not. report%converged) then
      report%converged = .false.
      return
    end if
    iterations = report%iterations
    linear_iterations = report%linear_iterations
    held = unknowns
    call solve_in_few(newton, unknowns, constraint, free_iterations, report)
    call count_on(report, iterations, linear_iterations)
    if (report%converged) return
    unknowns = held
    call newton%solve(unknowns, constraint, stiffening, report)
    call count_on(report, iterations, linear_iterations)
  end subroutine solve_holding

  !> With springs on the mean, which give way while nothing else holds.
  subroutine hold(newton, unknowns, constraint, report, walks)
    type(newton_type), intent(inout) :: newton
    type(unknowns_type), intent(inout) :: unknowns
    type(constraint_type), intent(in) :: constraint
    type(newton_report_type), intent(inout) :: report
    logical, intent(out) :: walks
    type(retreat_type) :: retreat
    integer :: i, iterations, linear_iterations
    logical :: fastened

    iterations = 0
    linear_iterations = 0
    walks = .false.
    report = newton_report_type()
    associate (context => newton%context)
      do i = 1, most_held
        call fasten(context, unknowns%motion, unknowns%omega, fastened)
        report%converged = .false.
        if (.not. fastened) return
        call solve_briefly(newton, unknowns, constraint, report)
        call release(context)
        call count_on(report, iterations, linear_iterations)
        if (.not. (report%converged .and. nothing_holds(context%balance))) return
        call retreat%move_to(context%balance%response(:, 0))
        walks = retreat%repeats(alike)
        if (walks) return
      end do
    end associate
  end subroutine hold

  !> Newton's method, for so many iterations at most.
  subroutine solve_in_few(newton, unknowns, constraint, most, report)
    type(newton_type), intent(inout) :: newton
    type(unknowns_type), intent(inout) :: unknowns
    type(constraint_type), intent(in) :: constraint
    integer, intent(in) :: most
    type(newton_report_type), intent(inout) :: report
    integer :: before

    before = newton%max_iterations
    newton%max_iterations = min(most, before)
    call newton%solve(unknowns, constraint, 0.0_wp, report)
    newton%max_iterations = before
  end subroutine solve_in_few

  !> Let a report tell of all tries so far.
  pure subroutine count_on(report, iterations, linear_iterations)
    type(newton_report_type), intent(inout) :: report
    integer, intent(inout) :: iterations, linear_iterations

    iterations = iterations + report%iterations
    linear_iterations = linear_iterations + report%linear_iterations
    report%iterations = iterations
    report%linear_iterations = linear_iterations
  end subroutine count_on
end module attrito_solve_newton_strategies
