!> The outcome of a point by what is found of it: every combination ends in the one that comes first.
program test_findings
  use attrito_core_errors, only: error_type
  use attrito_output_findings, only: findings_type, not_followed
  use attrito_solve_outcomes, only: outcome_converged, outcome_unstable, outcome_indeterminate, outcome_no_period_one_orbit, &
    outcome_not_converged, outcome_above_tolerance
  use attrito_stability_verdict, only: not_examined, unstable, stable, indeterminate
  use testing, only: test, run_suite, check
  implicit none

  if (run_suite('findings', [ &
                test('a point whose error is above the tolerance is that first, whatever its stability', above), &
                test('an examined point is what its examination says', examined), &
                test('a point whose sliders drift is indeterminate and is not examined', drifting), &
                test('without a solution motion in time decides, the one that was followed before the solver''s', unsolved)], &
                quiet=.false.) > 0) then
    error stop 1
  end if

contains

  subroutine above(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: verdict

    do verdict = not_examined, indeterminate
      associate (findings => findings_type(solved=.true., within_tolerance=.false., verdict=verdict))
        call check(error, findings%outcome() == outcome_above_tolerance, 'another outcome')
        call check(error, findings%may_be_examined(), 'it is solved, and its stability can be asked for')
        call check(error, findings%stability() == merge(verdict, -1, verdict == stable .or. verdict == unstable), 'the verdict')
        call check(error, findings%period() == 1, 'the period')
      end associate
    end do
  end subroutine above

  subroutine examined(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: verdicts(4) = [not_examined, unstable, stable, indeterminate]
    integer, parameter :: outcomes(4) = [outcome_converged, outcome_unstable, outcome_converged, outcome_indeterminate]
    integer, parameter :: stability(4) = [-1, 0, 1, -1]
    integer :: i

    do i = 1, size(verdicts)
      associate (findings => findings_type(solved=.true., settled=.true., verdict=verdicts(i)))
        call check(error, findings%outcome() == outcomes(i), 'the outcome')
        call check(error, findings%stability() == stability(i), 'the stability')
      end associate
    end do
  end subroutine examined

  subroutine drifting(error)
    type(error_type), allocatable, intent(out) :: error

    associate (findings => findings_type(solved=.true., settled=.false.))
      call check(error, findings%outcome() == outcome_indeterminate, 'the outcome')
      call check(error,.not. findings%may_be_examined(), 'its stability')
    end associate
  end subroutine drifting

  subroutine unsolved(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: periods(4) = [not_followed, 0, 1, 3]
    integer, parameter :: outcomes(4) = [outcome_not_converged, outcome_no_period_one_orbit, outcome_not_converged, &
                                         outcome_no_period_one_orbit]
    integer :: i

    do i = 1, size(periods)
      associate (findings => findings_type(followed_period=periods(i)), &
                 adrift => findings_type(no_periodic_solution=.true., followed_period=periods(i)))
        call check(error, findings%outcome() == outcomes(i), 'the outcome')
        call check(error, adrift%outcome() == merge(outcome_no_period_one_orbit, outcomes(i), i == 1), 'where the solver saw none')
        call check(error, findings%period() == periods(i), 'the period')
        call check(error,.not. findings%may_be_examined(), 'there is nothing to examine')
      end associate
    end do
  end subroutine unsolved
end program test_findings
