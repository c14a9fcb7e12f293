!> What the strategies that were tried at a point have come to so far.
module attrito_solve_strategy_outcome
  implicit none
  private
  public :: strategy_outcome_type

  type :: strategy_outcome_type
    !> Did the last one converge?
    logical :: converged = .false.
    !> Of Newton's method, of all of them
    integer :: iterations = 0
    !> The body drifts, no contact holds it; no periodic motion is near
    logical :: is_drifting = .false., no_periodic_solution = .false.
  end type strategy_outcome_type
end module attrito_solve_strategy_outcome
