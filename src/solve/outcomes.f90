!> Names of how a point, or a motion in time, ends. What decides between them: `attrito_output_findings` for points,
!> `attrito_integrate_run` for motion in time.
module attrito_solve_outcomes
  implicit none
  private
  public :: outcome_names, outcome_converged, outcome_unstable, outcome_indeterminate, outcome_no_period_one_orbit, &
            outcome_not_converged, outcome_above_tolerance

  integer, parameter :: outcome_converged = 0, outcome_unstable = 1, outcome_indeterminate = 2, &
                        outcome_no_period_one_orbit = 3, outcome_not_converged = 4, outcome_above_tolerance = 5
  character(22), parameter :: outcome_names(0:5) = [character(22) :: 'converged', 'unstable', 'indeterminate', &
                                                    'no_period_one_orbit', 'not_converged', 'above_tolerance']
end module attrito_solve_outcomes
