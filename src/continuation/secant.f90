!> Secant of the last step along a branch: its direction in motion and frequency, scaled, of unit length,
!>
!> $$ p = (x - x_a)/\|x - x_a\|, \qquad x = (d/d_s, \, \omega/\omega_s) $$
!>
!> A step that makes nearly a straight angle with the one before, means left out, runs back along the branch.
module attrito_continuation_secant
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_newton_border, only: inner_product
  use attrito_solve_rigid_drift, only: mean_share
  use attrito_solve_snapshot, only: snapshot_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: secant_type

  !> Cosine between successive steps below which the branch is taken to run back on itself
  real(wp), parameter :: turned_back = -0.95_wp ! guess

  type :: secant_type
    !> Not allocated before the first step
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp
  contains
    procedure :: take
    procedure :: forget
    procedure :: is_known
    procedure :: is_opposed
    procedure :: set_coefficients
    procedure :: keep
  end type secant_type

contains

  !> That of the step from a snapshot to the solver's present point.
  subroutine take(self, solver, before)
    class(secant_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency at the beginning of the step
    type(snapshot_type), intent(in) :: before
    real(wp) :: length

    call difference(solver, before, self%motion, self%omega, length)
    self%motion = self%motion/length
    self%omega = self%omega/length
  end subroutine take

  pure subroutine forget(self)
    class(secant_type), intent(inout) :: self

    if (allocated(self%motion)) deallocate (self%motion)
  end subroutine forget

  pure logical function is_known(self)
    class(secant_type), intent(in) :: self

    is_known = allocated(self%motion)
  end function is_known

  !> Does the step from a snapshot to the solver's present point run back along this one?
  logical function is_opposed(self, solver, before)
    class(secant_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency at the beginning of the step
    type(snapshot_type), intent(in) :: before
    real(wp), allocatable :: motion(:, :), last(:, :)
    real(wp) :: omega, length, lengths(2)

    is_opposed = .false.
    if (.not. self%is_known()) return
    call difference(solver, before, motion, omega, length)
    last = self%motion
    motion(1, :) = 0.0_wp
    last(1, :) = 0.0_wp
    associate (balance => solver%context%balance)
      lengths = [hypot(balance%norm(motion), omega), hypot(balance%norm(last), self%omega)]
      if (any(lengths <= mean_share*[length, 1.0_wp])) return
      is_opposed = inner_product(balance, motion, last) + omega*self%omega < turned_back*product(lengths)
    end associate
  end function is_opposed

  !> The solver's present point less a snapshot, scaled, and how long that is.
  subroutine difference(solver, before, motion, omega, length)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion, sliders and frequency at the beginning of the step
    type(snapshot_type), intent(in) :: before
    !> Change of the motion [2 H + 1, rows]
    real(wp), allocatable, intent(inout) :: motion(:, :)
    !> Change of the frequency; norm of both
    real(wp), intent(out) :: omega, length

    associate (context => solver%context)
      motion = (solver%motion - before%motion)/context%motion_scale
      omega = (solver%omega - before%omega)/context%frequency_scale
      length = sqrt(inner_product(context%balance, motion, motion) + omega**2)
    end associate
  end subroutine difference

  !> Resize to so many coefficients.
  pure subroutine set_coefficients(self, coefficients)
    class(secant_type), intent(inout) :: self
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients

    if (allocated(self%motion)) self%motion = resized(self%motion, coefficients)
  end subroutine set_coefficients

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(secant_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%motion)
    call store%keep(self%omega)
  end subroutine keep
end module attrito_continuation_secant
