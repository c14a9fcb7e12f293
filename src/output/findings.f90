!> What is found of a point, and the outcome that follows: the one place where the outcome of a point is decided.
!>
!> Of a point with a solution, the first that applies: `above_tolerance`, where the estimated error is; what the examination of its
!> stability says (`converged`, `unstable`, `indeterminate`); `indeterminate`, where sliders still drift; `converged`. Of one
!> without: what motion in time under its loads does, if that was followed (a motion of one period exists: `not_converged`; it does
!> not: `no_period_one_orbit`), else whether the solver's own motion in time found no periodic solution to start from.
module attrito_output_findings
  use attrito_solve_outcomes, only: outcome_converged, outcome_unstable, outcome_indeterminate, outcome_no_period_one_orbit, &
    outcome_not_converged, outcome_above_tolerance
  use attrito_stability_verdict, only: not_examined, unstable, stable, indeterminate
  implicit none
  private
  public :: findings_type, not_followed

  !> Motion in time was not followed, or not until a period could be recognised
  integer, parameter :: not_followed = -1

  type :: findings_type
    !> Did the solver converge to finite numbers?
    logical :: solved = .false.
    !> Do the sliders return to where they were, period after period?
    logical :: settled = .false.
    !> Is the estimated error within the tolerance?
    logical :: within_tolerance = .true.
    !> Did motion in time that the solver started from end without a periodic solution?
    logical :: no_periodic_solution = .false.
    !> Of the examination, see `attrito_stability_verdict`
    integer :: verdict = not_examined
    !> Of motion in time from a point without a solution, in periods of the excitation; 0: none, or `not_followed`
    integer :: followed_period = not_followed
  contains
    procedure :: outcome, may_be_examined, stability, period
  end type findings_type

contains

  !> One of `outcome_...`.
  pure integer function outcome(self)
    class(findings_type), intent(in) :: self

    if (.not. self%solved) then
      outcome = merge(outcome_no_period_one_orbit, outcome_not_converged, self%no_periodic_solution)
      if (self%followed_period /= not_followed) then
        outcome = merge(outcome_not_converged, outcome_no_period_one_orbit, self%followed_period == 1)
      end if
    else if (.not. self%within_tolerance) then
      outcome = outcome_above_tolerance
    else
      select case (self%verdict)
       case (stable)
        outcome = outcome_converged
       case (unstable)
        outcome = outcome_unstable
       case (indeterminate)
        outcome = outcome_indeterminate
       case default
        outcome = merge(outcome_converged, outcome_indeterminate, self%settled)
      end select
    end if
  end function outcome

  !> Is there a solution whose stability can be asked for? Sliders that drift leave none, unless the error is the larger fault.
  pure logical function may_be_examined(self)
    class(findings_type), intent(in) :: self

    may_be_examined = self%solved .and. (self%settled .or. .not. self%within_tolerance)
  end function may_be_examined

  !> 1 stable, 0 unstable, -1 not examined or indeterminate.
  pure integer function stability(self)
    class(findings_type), intent(in) :: self

    stability = merge(self%verdict, not_examined, self%verdict == stable .or. self%verdict == unstable)
  end function stability

  !> Of the solution, in periods of the excitation; without one that of motion in time, 0: none, -1: not followed.
  pure integer function period(self)
    class(findings_type), intent(in) :: self

    period = merge(1, self%followed_period, self%solved)
  end function period
end module attrito_output_findings
