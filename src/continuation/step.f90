!> A step along a branch, to be solved anywhere between its ends: in the plane across a direction p,
!>
!> $$ p \cdot (x - x_a - s (x_b - x_a)) = 0, \qquad 0 \le s \le 1, $$
!>
!> x being scaled motion and frequency, from the point of the straight line between both ends.
module attrito_continuation_step
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_solve_snapshot, only: snapshot_type
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_tangent, only: tangent_type
  implicit none
  private
  public :: step_type

  type :: step_type
    type(snapshot_type) :: from, to
    !> Across which the planes are; without motion: of constant frequency
    type(tangent_type) :: across
  contains
    procedure :: take
    procedure :: go_on
    procedure :: ends_at
    procedure :: is_taken
    procedure :: end_at
    procedure :: solve_part
    procedure :: keep
  end type step_type

contains

  !> Take the step from a snapshot to the solver's present point.
  subroutine take(self, from, solver, across)
    class(step_type), intent(inout) :: self
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: from
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Tangent of the branch
    type(tangent_type), intent(in) :: across

    self%from = from
    call self%to%take(solver)
    self%across = across
  end subroutine take

  !> Take the step from the end of this one to the solver's present point.
  subroutine go_on(self, solver, across)
    class(step_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Tangent of the branch
    type(tangent_type), intent(in) :: across

    call self%from%exchange(self%to)
    call self%to%take(solver)
    self%across = across
  end subroutine go_on

  !> Does it end at the solver's present point, where every contact sticks, with the same sliders?
  pure logical function ends_at(self, solver)
    class(step_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    ends_at = allocated(self%to%motion)
    if (ends_at) ends_at = self%to%all_stick .and. solver%all_stick .and. abs(self%to%omega - solver%omega) <= 0.0_wp &
                           .and. size(self%to%motion, 1) == size(solver%motion, 1) &
                           .and. size(self%to%motion, 2) == size(solver%motion, 2)
    if (ends_at) ends_at = all(abs(self%to%slider - solver%context%balance%slider) <= 0.0_wp)
  end function ends_at

  !> Is there one?
  pure logical function is_taken(self)
    class(step_type), intent(in) :: self

    is_taken = allocated(self%from%motion) .and. allocated(self%to%motion)
  end function is_taken

  !> End it at the solver's present point, which may be on a longer series than the step.
  subroutine end_at(self, solver)
    class(step_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    call self%to%take(solver)
    self%from%motion = resized(self%from%motion, size(solver%motion, 1))
    associate (across => self%across)
      if (allocated(across%motion)) across%motion = resized(across%motion, size(solver%motion, 1))
    end associate
  end subroutine end_at

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(step_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call self%from%keep(store)
    call self%to%keep(store)
    call self%across%keep(store)
  end subroutine keep

  !> Solve at a part s of the step. Sliders start as at its beginning, periodic ones between both ends.
  subroutine solve_part(self, solver, s, converged, early_stop)
    class(step_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Part of the step, 0 to 1
    real(wp), intent(in) :: s
    !> Did the solve converge?
    logical, intent(out) :: converged
    !> Give up after a few iterations of Newton's method; if not given, do not
    logical, intent(in), optional :: early_stop
    type(constraint_type) :: constraint
    real(wp), allocatable :: slider(:, :)
    logical :: periodic(size(self%from%periodic))

    associate (context => solver%context, a => self%from, b => self%to)
      solver%motion = a%motion + s*(b%motion - a%motion)
      solver%omega = a%omega + s*(b%omega - a%omega)
      periodic = a%periodic .or. b%periodic
      slider = a%slider
      where (spread(periodic, 1, size(slider, 1))) slider = a%slider + s*(b%slider - a%slider)
      call solver%set_slider(slider, periodic)
      if (allocated(self%across%motion)) then
        constraint%motion = self%across%motion/context%motion_scale
      else
        constraint%motion = 0.0_wp*solver%motion
      end if
      constraint%frequency = self%across%omega/context%frequency_scale
      constraint%value = inner_product(context%balance, constraint%motion, solver%motion) + constraint%frequency*solver%omega
      call solver%solve_with(constraint, early_stop)
      converged = solver%report%converged
    end associate
  end subroutine solve_part
end module attrito_continuation_step
