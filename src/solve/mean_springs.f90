!> Springs on the mean position of a body that only friction holds, and what the mean does as they give way.
!>
!> $$ r(d, \omega) = \frac{\epsilon}{1 + \epsilon} B (\hat q_0 - q_0), \qquad \hat q_0 \leftarrow q_0 $$
!>
!> Where every contact slips or opens in every period nothing tells where the body is: residuals do not change as it is moved, the
!> Jacobian is singular, and as many equations as there are free directions are left, mean forces of friction that must balance. In
!> general they do not, and no orbit of the excitation's period is near. Springs on the mean position alone, a part epsilon of the
!> stuck system's stiffness, make the system regular. They give way: each solve begins where the one before left the body (a proximal
!> point method). Where contacts hold, such steps shrink, and end at a solution without springs. Where nothing does, each step is the
!> last one over again: springs have to lend the same force wherever the body is, and without them it walks.
!> Source: Rockafellar 1976, doi:10.1137/0314056 (proximal points).
module attrito_solve_mean_springs
  use attrito_core_kinds, only: wp
  use attrito_newton_newton_context, only: newton_context_type
  implicit none
  private
  public :: fasten, release, retreat_type

  !> Stiffness of the springs, part of the stuck system's
  real(wp), parameter :: stiffness = 1.0e-3_wp
  !> Steps relative to the mean that are none
  real(wp), parameter :: rounding = 1.0e-12_wp

  !> Where the mean went in the last solves
  type :: retreat_type
    complex(wp), allocatable, private :: place(:), step(:), before(:)
  contains
    procedure :: move_to
    procedure :: repeats
  end type retreat_type

contains

  !> Springs to where the mean is at a motion.
  subroutine fasten(context, motion, omega, fastened)
    type(newton_context_type), intent(inout) :: context
    !> Relative displacements [2 H + 1, rows], and angular frequency
    real(wp), intent(in) :: motion(:, :), omega
    !> .false.: the balance cannot be evaluated there
    logical, intent(out) :: fastened
    integer :: status

    call context%balance%evaluate(motion, omega, status)
    call context%forget()
    fastened = status == 0
    if (fastened) call context%balance%hold_mean(stiffness)
  end subroutine fasten

  !> Without springs again.
  subroutine release(context)
    type(newton_context_type), intent(inout) :: context

    call context%balance%let_go()
    call context%forget()
  end subroutine release

  !> The mean after one more solve.
  pure subroutine move_to(self, mean)
    class(retreat_type), intent(inout) :: self
    !> Of the response [n]
    complex(wp), intent(in) :: mean(:)

    if (allocated(self%step)) self%before = self%step
    if (allocated(self%place)) self%step = mean - self%place
    self%place = mean
  end subroutine move_to

  !> Is the last step the one before over again?
  pure logical function repeats(self, alike)
    class(retreat_type), intent(in) :: self
    !> Difference, relative to the step, that does not count
    real(wp), intent(in) :: alike

    repeats = .false.
    if (.not. allocated(self%before)) return
    repeats = norm2(abs(self%step - self%before)) <= alike*norm2(abs(self%step)) &
              .and. norm2(abs(self%step)) > rounding*norm2(abs(self%place))
  end function repeats
end module attrito_solve_mean_springs
