!> Rigid-body drift: mean friction forces do not balance, and a body that no contact holds moves on. All tests for it are here.
!>
!> *Steps that repeat.* Friction is the same at any position of a body. What moves it once moves it again, by the same amount, while
!> the steps of a body that contacts hold shrink. With positions x_k, the last of which is x_n, it drifts if
!>
!> $$ |s_k - s_{k-1}| \le \alpha |s_n| \quad (k = n - m + 2 \dots n), \qquad |s_n| > \beta X, \qquad s_k = x_k - x_{k-1} $$
!>
!> *A branch of mean positions.* Along a branch the stepper chooses the lengths of steps: they are alike where a body is held, too.
!> The direction of a step decides instead, scaled and of unit length: nothing changes but where the body is if
!>
!> $$ \sqrt{ |t_{h > 0}|^2 + |t_0 - z|^2 + t_\omega^2 } < \gamma $$
!>
!> with the part z of its means that slides along all contacts (`attrito_linear_rigid_body_modes`). Other means are no drift: a wedge
!> that comes out of its slot presses less.
!>
!> | x_k | m | alpha | beta | X | decides after |
!> |---|---|---|---|---|---|
!> | ends of the periods of a window of motion in time | 7 or more | 0.01 | errors of a period's steps | x_n | 3 windows in a row |
!> | means of solutions with springs on them (steps times their stiffness) | 2 | 1e-3 | 1e-12 | x_n | the first time |
!> | the same within one solve, only to end it early | 2 | 0.5 | 1e-12 | x_n | the first time |
!> | steps of a branch that hardly show, by gamma: 0.5 where no contact holds, else 1e-3 | | | | | 6 in a row |
!>
!> *A branch that turns into mean positions.* On the way to such an end gamma falls like the square root of what is left of the drawn
!> curve, and no step beyond the end converges. It ends here if by steps that together hardly show on that curve, the last one at the
!> least, gamma has halved at least, to less than delta = 0.2.
!>
!> Means and branches show a drift only where the structure leaves a motion free (`attrito_linear_rigid_body_modes`).
module attrito_solve_rigid_drift
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: steps_repeat, repeated_means_type, moves_mean_alone, turns_into_mean
  public :: alike_in_time, windows_in_a_row, alike_in_mean, alike_in_solve, mean_share, branch_steps_in_a_row

  !> alpha: steps of motion in time; of relaxed means, where rounding and the tolerance left some 1e-6; of the few within one solve,
  !> which only decide whether other strategies are tried
  real(wp), parameter :: alike_in_time = 1.0e-2_wp, alike_in_mean = 1.0e-3_wp, alike_in_solve = 0.5_wp ! guess
  !> beta, for means: shorter steps are rounding
  real(wp), parameter :: least_in_mean = 1.0e-12_wp ! derived
  !> Successive windows of motion in time, and successive steps along a branch, after which a body is taken to drift
  integer, parameter :: windows_in_a_row = 3, branch_steps_in_a_row = 6 ! guess
  !> gamma. Past the end of a branch on which contacts hold, friction no longer balances over the period; in a direction with a
  !> smaller share the sign of the frequency is rounding
  real(wp), parameter :: mean_share = 1.0e-3_wp ! guess
  !> gamma if every contact comes to its limit: friction then balances at single frequencies, and rounding makes a branch of these
  real(wp), parameter :: free_share = 0.5_wp ! guess
  !> delta, and what gamma falls to by steps that hardly show on the way to an end
  real(wp), parameter :: steep_share = 0.2_wp, falling_share = 0.5_wp ! guess

  !> Means of successive solutions with springs, of which the last three count
  type :: repeated_means_type
    real(wp), allocatable, private :: mean(:)
    !> The step before the last, and the last [n, 2]
    real(wp), allocatable, private :: steps(:, :)
    integer, private :: count = 0
  contains
    procedure :: add
    procedure :: do_repeat
  end type repeated_means_type

contains

  !> Is every step as the one before, and the last one not too short?
  pure logical function steps_repeat(steps, alike, least)
    !> Steps of a body's position [n, at least 2]
    real(wp), intent(in) :: steps(:, :)
    !> alpha; and beta X, which the last step exceeds
    real(wp), intent(in) :: alike, least
    real(wp) :: last
    integer :: k

    last = norm2(steps(:, size(steps, 2)))
    steps_repeat = last > least
    do k = 2, size(steps, 2)
      steps_repeat = steps_repeat .and. norm2(steps(:, k) - steps(:, k - 1)) <= alike*last
    end do
  end function steps_repeat

  !> Add the mean of one more solution.
  pure subroutine add(self, mean, softening)
    class(repeated_means_type), intent(inout) :: self
    !> Mean position [n]
    real(wp), intent(in) :: mean(:)
    !> Factor on the stiffness of its springs: the force is the step times this; if not given, 1
    real(wp), intent(in), optional :: softening

    if (self%count == 0) then
      allocate (self%steps(size(mean), 2), source=0.0_wp)
    else
      self%steps(:, 1) = self%steps(:, 2)
      self%steps(:, 2) = mean - self%mean
      if (present(softening)) self%steps(:, 2) = softening*self%steps(:, 2)
    end if
    self%mean = mean
    self%count = self%count + 1
  end subroutine add

  !> Was the last step the same as the one before?
  pure logical function do_repeat(self, alike)
    class(repeated_means_type), intent(in) :: self
    !> alpha
    real(wp), intent(in) :: alike

    do_repeat = self%count > 2
    if (do_repeat) do_repeat = steps_repeat(self%steps, alike, least_in_mean*norm2(self%mean))
  end function do_repeat

  !> Does a step along a branch change hardly more than where a body is?
  pure logical function moves_mean_alone(share, is_free)
    !> Part of the step's direction that is anything but a slide, 0 to 1
    real(wp), intent(in) :: share
    !> Is there a body that neither its structure nor a contact holds all over the period?
    logical, intent(in) :: is_free

    moves_mean_alone = share < merge(free_share, mean_share, is_free)
  end function moves_mean_alone

  !> Has a branch turned into a slide by its last steps?
  pure logical function turns_into_mean(before, share)
    !> Part of the branch's direction that is anything but a slide, before these steps and after them, 0 to 1
    real(wp), intent(in) :: before, share

    turns_into_mean = share < min(steep_share, falling_share*before)
  end function turns_into_mean
end module attrito_solve_rigid_drift
