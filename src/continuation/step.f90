!> A step along a branch, to be solved anywhere between its ends: in the plane across a direction p,
!>
!> $$ p \cdot (x - x_a - s (x_b - x_a)) = 0, \qquad 0 \le s \le 1, $$
!>
!> x being scaled motion and frequency. It is solved from the point of the straight line between both ends, or, where the tangents at
!> both are known, of the cubic through both (`attrito_continuation_arc`), across that. Where it hardly moves on, at a cusp, the plane
!> is across the straight line.
module attrito_continuation_step
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_solve_rigid_drift, only: mean_share
  use attrito_solve_snapshot, only: snapshot_type
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_arc, only: arc_length, hermite, hermite_slope
  use attrito_continuation_tangent, only: tangent_type, share_of_harmonics
  implicit none
  private
  public :: step_type

  type :: step_type
    type(snapshot_type) :: from, to
    !> Across which the planes are where there is no arc; without motion: of constant frequency
    type(tangent_type) :: across
    !> Tangents at both ends, and the length of the arc between; 0: not known
    type(tangent_type) :: start, end
    real(wp) :: length = 0.0_wp
  contains
    procedure :: take
    procedure :: chord
    procedure :: draw
    procedure :: constraint_at
    procedure :: motion_at
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
    self%length = 0.0_wp
  end subroutine take

  !> The straight way of the step as a direction, without its mean, and the part of it that is not mean.
  type(tangent_type) function chord(self, solver)
    class(step_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp) :: length, whole

    associate (context => solver%context)
      chord%motion = (self%to%motion - resized(self%from%motion, size(self%to%motion, 1)))/context%motion_scale
      chord%omega = (self%to%omega - self%from%omega)/context%frequency_scale
      whole = sqrt(inner_product(context%balance, chord%motion, chord%motion) + chord%omega**2)
      chord%motion(1, :) = 0.0_wp
      length = share_of_harmonics(solver, chord%motion, chord%omega)
    end associate
    chord%share = length/max(whole, tiny(1.0_wp))
    if (length <= 0.0_wp) return
    chord%motion = chord%motion/length
    chord%omega = chord%omega/length
  end function chord

  !> The arc of the step, with tangents at both ends: its length, and 0 where hardly more than mean positions change.
  subroutine draw(self, solver, start, end)
    class(step_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> At both ends, along the branch
    type(tangent_type), intent(in) :: start, end
    real(wp), allocatable :: motion(:, :), along(:, :)
    real(wp) :: omega, chord, cosine

    self%length = 0.0_wp
    if (min(start%share, end%share) < mean_share) return
    if (.not. (allocated(start%motion) .and. allocated(end%motion))) return
    self%start = start
    self%end = end
    self%start%motion = resized(start%motion, size(self%to%motion, 1))
    self%from%motion = resized(self%from%motion, size(self%to%motion, 1))
    associate (context => solver%context)
      motion = (self%to%motion - self%from%motion)/context%motion_scale
      omega = (self%to%omega - self%from%omega)/context%frequency_scale
      chord = share_of_harmonics(solver, motion, omega)
      along = self%start%motion
      along(1, :) = 0.0_wp
      cosine = (inner_product(context%balance, along, end%motion) + start%omega*end%omega)/(start%share*end%share)
    end associate
    self%length = arc_length(chord, cosine)
  end subroutine draw

  !> Motion at a part of the step, of the arc where there is one.
  function motion_at(self, solver, s) result(motion)
    class(step_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Part of the step, 0 to 1
    real(wp), intent(in) :: s
    real(wp), allocatable :: motion(:, :)
    real(wp) :: weights(4)

    associate (a => self%from, b => self%to)
      if (self%length > 0.0_wp) then
        weights = hermite(s)
        weights([2, 4]) = self%length*weights([2, 4])/[self%start%share, self%end%share]
        motion = weights(1)*a%motion + weights(3)*b%motion &
                 + solver%context%motion_scale*(weights(2)*self%start%motion + weights(4)*self%end%motion)
      else
        motion = a%motion + s*(b%motion - a%motion)
      end if
    end associate
  end function motion_at

  !> Motion and frequency at a part of the arc, and the plane across it there. Not of a step without an arc.
  subroutine constraint_at(self, solver, s, motion, omega, constraint)
    class(step_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Part of the step, 0 to 1
    real(wp), intent(in) :: s
    !> Of the cubic there
    real(wp), allocatable, intent(out) :: motion(:, :)
    real(wp), intent(out) :: omega
    !> Linear condition on motion and frequency
    type(constraint_type), intent(out) :: constraint
    !> Part of its mean speed below which the cubic hardly moves on
    real(wp), parameter :: slow = 0.2_wp ! guess
    real(wp) :: weights(4), length

    associate (context => solver%context, a => self%from, b => self%to)
      weights = hermite(s)
      weights([2, 4]) = self%length*weights([2, 4])/[self%start%share, self%end%share]
      motion = self%motion_at(solver, s)
      omega = weights(1)*a%omega + weights(3)*b%omega + context%frequency_scale*(weights(2)*self%start%omega &
                                                                                 + weights(4)*self%end%omega)
      constraint%motion = (b%motion - a%motion)/context%motion_scale
      constraint%frequency = (b%omega - a%omega)/context%frequency_scale
      weights = hermite_slope(s)
      weights([2, 4]) = self%length*weights([2, 4])/[self%start%share, self%end%share]
      ! Slopes by both values are opposite, so that only their difference counts.
      associate (motion_slope => weights(3)*constraint%motion + weights(2)*self%start%motion + weights(4)*self%end%motion, &
                 omega_slope => weights(3)*constraint%frequency + weights(2)*self%start%omega + weights(4)*self%end%omega)
        if (share_of_harmonics(solver, motion_slope, omega_slope) > slow*self%length) then
          constraint%motion = motion_slope
          constraint%frequency = omega_slope
        end if
      end associate
      constraint%motion(1, :) = 0.0_wp
      length = share_of_harmonics(solver, constraint%motion, constraint%frequency)
      constraint%motion = constraint%motion/(length*context%motion_scale)
      constraint%frequency = constraint%frequency/(length*context%frequency_scale)
      constraint%value = inner_product(context%balance, constraint%motion, motion) + constraint%frequency*omega
    end associate
  end subroutine constraint_at

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
    self%length = 0.0_wp
  end subroutine end_at

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(step_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call self%from%keep(store)
    call self%to%keep(store)
    call self%across%keep(store)
    call self%start%keep(store)
    call self%end%keep(store)
    call store%keep(self%length)
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
    real(wp), allocatable :: slider(:, :), motion(:, :)
    real(wp) :: omega
    logical :: periodic(size(self%from%periodic))

    associate (context => solver%context, a => self%from, b => self%to)
      periodic = a%periodic .or. b%periodic
      slider = a%slider
      where (spread(periodic, 1, size(slider, 1))) slider = a%slider + s*(b%slider - a%slider)
      call solver%set_slider(slider, periodic)
      if (self%length > 0.0_wp) then
        call self%constraint_at(solver, s, motion, omega, constraint)
        solver%motion = motion
        solver%omega = omega
      else
        solver%motion = a%motion + s*(b%motion - a%motion)
        solver%omega = a%omega + s*(b%omega - a%omega)
        if (allocated(self%across%motion)) then
          constraint%motion = self%across%motion/context%motion_scale
        else
          constraint%motion = 0.0_wp*solver%motion
        end if
        constraint%frequency = self%across%omega/context%frequency_scale
        constraint%value = inner_product(context%balance, constraint%motion, solver%motion) + constraint%frequency*solver%omega
      end if
      call solver%solve_with(constraint, early_stop)
      converged = solver%report%converged
      ! The plane meets branches far away, too.
      if (converged .and. self%length > 0.0_wp) converged = abs(solver%omega - omega) <= self%length*context%frequency_scale
    end associate
  end subroutine solve_part
end module attrito_continuation_step
