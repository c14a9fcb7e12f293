!> Strategies for Newton's method from one start: few iterations; springs on the mean first; contacts that keep a part of their
!> springs in the step.
!>
!> A body that only friction holds has a nearly singular Jacobian where few contacts hold, and a singular one where all slip. With
!> springs on its mean (`attrito_solve_mean_springs`) it is regular, and where contacts hold the solution is near one
!> without springs. Where no contact holds, nothing else is tried: friction does not balance at any position of the body.
module attrito_solve_newton_strategies
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_type, newton_controls_type, newton_report_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_solve_sliders, only: none_holds
  use attrito_solve_mean_springs, only: apply_springs, remove_springs
  use attrito_solve_rigid_drift, only: repeated_means_type, alike_in_solve
  implicit none
  private
  public :: solve_briefly, solve_persistently

  !> A brief try does so many iterations more, as long as the last ones reduced the residual by this factor
  integer, parameter :: brief_iterations = 8 ! guess
  real(wp), parameter :: brief_progress = 1.0e-2_wp ! guess
  !> Steps in a row that hardly reduce the residual before it is given up
  integer, parameter :: brief_patience = 3 ! guess

  !> Factor on the iterations at most along an increment of static loads: if contacts have no gap, shorter ones are as hard
  integer, parameter :: patience = 3 ! guess

  !> Solves with springs on the mean, relaxed in between
  integer, parameter :: most_regularised = 3 ! guess
  !> Iterations without such springs that follow
  integer, parameter :: free_iterations = 3 ! guess

  !> Part of their springs that contacts keep in the step of the last tries
  real(wp), parameter :: stiffening = 0.1_wp ! guess

contains

  !> Newton's method, ended as soon as it makes little progress.
  subroutine solve_briefly(newton, unknowns, constraint, controls, report)
    !> Newton solver of the balance
    type(newton_type), intent(inout) :: newton
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    !> How to solve
    type(newton_controls_type), intent(in) :: controls
    !> How the solve ended
    type(newton_report_type), intent(inout) :: report
    type(newton_controls_type) :: brief
    integer :: iterations, linear_iterations
    real(wp) :: goal

    brief = controls
    brief%most_stalled = brief_patience
    iterations = 0
    linear_iterations = 0
    goal = brief_progress
    do
      brief%max_iterations = min(brief_iterations, controls%max_iterations - iterations)
      call newton%solve(unknowns, constraint, brief, report)
      call count_on(report, iterations, linear_iterations)
      if (report%converged .or. report%residual > goal .or. report%iterations >= controls%max_iterations) exit
      goal = brief_progress*report%residual
    end do
  end subroutine solve_briefly

  !> All strategies in turn, each from the same start.
  subroutine solve_persistently(newton, unknowns, constraint, controls, mean_is_fixed, report)
    !> Newton solver of the balance
    type(newton_type), intent(inout) :: newton
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    !> How to solve
    type(newton_controls_type), intent(in) :: controls
    !> The mean is frozen, so that springs on it serve nothing
    logical, intent(in) :: mean_is_fixed
    !> How the solve ended
    type(newton_report_type), intent(inout) :: report
    type(newton_controls_type) :: to_the_end
    type(unknowns_type) :: start
    logical :: can_regularise, is_drifting
    integer :: iterations, linear_iterations

    can_regularise = .not. (mean_is_fixed .or. allocated(newton%context%balance%spring_anchor))
    start = unknowns
    iterations = 0
    linear_iterations = 0
    if (can_regularise) then
      call solve_briefly(newton, unknowns, constraint, controls, report)
      call count_on(report, iterations, linear_iterations)
      if (report%converged) return
      unknowns = start
      if (allocated(newton%context%balance%increment)) then
        ! If a stiff contact opens or begins to slip, the residual hardly falls before the step that follows.
        call newton%solve(unknowns, constraint, in_whole_steps(controls), report)
        call count_on(report, iterations, linear_iterations)
        if (report%converged) return
        unknowns = start
      end if
      call solve_regularised(newton, unknowns, constraint, controls, report, is_drifting)
      call count_on(report, iterations, linear_iterations)
      if (report%converged .or. is_drifting) return
      unknowns = start
    end if
    to_the_end = controls
    if (allocated(newton%context%balance%increment)) to_the_end%max_iterations = patience*controls%max_iterations
    call newton%solve(unknowns, constraint, to_the_end, report)
    call count_on(report, iterations, linear_iterations)
    ! Springs on the mean hold what contacts' springs would.
    if (report%converged .or. allocated(newton%context%balance%spring_anchor)) return
    unknowns = start
    call newton%solve(unknowns, constraint, stiffened(controls), report)
    call count_on(report, iterations, linear_iterations)
  end subroutine solve_persistently

  !> With springs on the mean, and from there without them. Where the contacts that hold are near their limit, all of them may slip in
  !> a step without springs, however near the solution is: then they keep a part of their own springs in the step.
  subroutine solve_regularised(newton, unknowns, constraint, controls, report, is_drifting)
    !> Newton solver of the balance
    type(newton_type), intent(inout) :: newton
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    !> How to solve
    type(newton_controls_type), intent(in) :: controls
    !> How the solve ended
    type(newton_report_type), intent(inout) :: report
    !> Does nothing but the springs hold the body?
    logical, intent(out) :: is_drifting
    type(newton_controls_type) :: few
    type(unknowns_type) :: with_springs
    integer :: iterations, linear_iterations

    call relax_springs(newton, unknowns, constraint, controls, report, is_drifting)
    if (is_drifting .or. .not. report%converged) then
      report%converged = .false.
      return
    end if
    iterations = report%iterations
    linear_iterations = report%linear_iterations
    with_springs = unknowns
    few = controls
    few%max_iterations = min(free_iterations, controls%max_iterations)
    call newton%solve(unknowns, constraint, few, report)
    call count_on(report, iterations, linear_iterations)
    if (report%converged) return
    unknowns = with_springs
    call newton%solve(unknowns, constraint, stiffened(controls), report)
    call count_on(report, iterations, linear_iterations)
  end subroutine solve_regularised

  !> With springs on the mean, which are relaxed as long as no contact holds.
  subroutine relax_springs(newton, unknowns, constraint, controls, report, is_drifting)
    !> Newton solver of the balance
    type(newton_type), intent(inout) :: newton
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    !> How to solve
    type(newton_controls_type), intent(in) :: controls
    !> How the solve ended
    type(newton_report_type), intent(inout) :: report
    !> Does the body drift?
    logical, intent(out) :: is_drifting
    type(repeated_means_type) :: means
    integer :: i, iterations, linear_iterations
    logical :: has_springs

    iterations = 0
    linear_iterations = 0
    is_drifting = .false.
    report = newton_report_type()
    associate (context => newton%context)
      do i = 1, most_regularised
        call apply_springs(context, unknowns%motion, unknowns%omega, has_springs)
        report%converged = .false.
        if (.not. has_springs) return
        call solve_briefly(newton, unknowns, constraint, controls, report)
        call remove_springs(context)
        call count_on(report, iterations, linear_iterations)
        if (.not. (report%converged .and. none_holds(context%balance))) return
        call means%add(real(context%balance%response(:, 0), wp))
        is_drifting = context%balance%free%leaves_motion .and. means%do_repeat(alike_in_solve)
        if (is_drifting) return
      end do
    end associate
  end subroutine relax_springs

  !> The same for steps in which contacts keep a part of their springs.
  pure type(newton_controls_type) function stiffened(controls)
    !> How to solve
    type(newton_controls_type), intent(in) :: controls

    stiffened = controls
    stiffened%stiffening = stiffening
  end function stiffened

  !> The same for steps that are never shortened.
  pure type(newton_controls_type) function in_whole_steps(controls)
    !> How to solve
    type(newton_controls_type), intent(in) :: controls

    in_whole_steps = controls
    in_whole_steps%stiffening = tiny(1.0_wp)
  end function in_whole_steps

  !> Add the iterations of all tries so far to a report.
  pure subroutine count_on(report, iterations, linear_iterations)
    !> How the solve ended
    type(newton_report_type), intent(inout) :: report
    !> Counts on
    integer, intent(inout) :: iterations, linear_iterations

    iterations = iterations + report%iterations
    linear_iterations = linear_iterations + report%linear_iterations
    report%iterations = iterations
    report%linear_iterations = linear_iterations
  end subroutine count_on
end module attrito_solve_newton_strategies
