!> What the strategies that were tried at a point have come to so far, and the evidence that there is no periodic motion near it.
module attrito_solve_strategy_outcome
  implicit none
  private
  public :: strategy_outcome_type, evidence_type

  !> Why no periodic motion of the excitation's period may be near: by the balance with springs on its mean, or by time integration
  type :: evidence_type
    !> The body drifts, no contact holds it; nor has motion in time such a period
    logical :: is_drifting = .false., no_periodic_solution = .false.
  end type evidence_type

  type :: strategy_outcome_type
    !> Did the last one converge?
    logical :: converged = .false.
    !> Of Newton's method, of all of them
    integer :: iterations = 0
    !> Found by any of them
    type(evidence_type) :: evidence
  end type strategy_outcome_type
end module attrito_solve_strategy_outcome
