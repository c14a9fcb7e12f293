!> Springs on the mean position of a body that only friction holds.
!>
!> $$ r(d, \omega) = \frac{\epsilon}{1 + \epsilon} B (\hat q_0 - q_0), \qquad \hat q_0 \leftarrow q_0 $$
!>
!> Where every contact slips or opens in every period the mean position of the body is undetermined: residuals do not change as it is
!> moved, the Jacobian is singular, and one equation remains for each free direction: mean forces of friction must balance. In general
!> they do not, and no orbit of the excitation's period is near. Springs on the mean position alone, a part epsilon of the stuck
!> system's stiffness, make the system regular. They are relaxed: each solve begins where the one before left the body (a proximal
!> point method). Where contacts hold, such steps shrink and end at a solution without springs. Where none holds, each step repeats
!> the last one: the springs need the same force at any position of the body, and without them it drifts
!> (`attrito_solve_rigid_drift`).
!> Source: Rockafellar 1976, doi:10.1137/0314056 (proximal points).
module attrito_solve_mean_springs
  use attrito_core_kinds, only: wp
  use attrito_newton_newton_context, only: newton_context_type
  implicit none
  private
  public :: apply_springs, remove_springs

  !> Stiffness of the springs, part of the stuck system's
  real(wp), parameter :: stiffness = 1.0e-3_wp ! guess

contains

  !> Attach springs at the mean position of a motion.
  subroutine apply_springs(context, motion, omega, has_springs, softening)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context
    !> Relative displacements [2 H + 1, rows], and angular frequency
    real(wp), intent(in) :: motion(:, :), omega
    !> .false.: the balance cannot be evaluated there
    logical, intent(out) :: has_springs
    !> Factor on their stiffness, at most 1; if not given, 1
    real(wp), intent(in), optional :: softening
    real(wp) :: part
    integer :: status

    part = stiffness
    if (present(softening)) part = softening*stiffness
    call context%balance%evaluate(motion, omega, status)
    call context%forget()
    has_springs = status == 0
    if (has_springs) call context%balance%apply_mean_springs(part)
  end subroutine apply_springs

  !> Without springs again.
  subroutine remove_springs(context)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context

    call context%balance%remove_mean_springs()
    call context%forget()
  end subroutine remove_springs
end module attrito_solve_mean_springs
