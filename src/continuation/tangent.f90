!> The tangent of a branch,
!>
!> $$ r_d \, t + r_\omega \, t_\omega = 0, \qquad |t|^2 + t_\omega^2 = 1, $$
!>
!> in motion and frequency that are scaled; turned towards a direction by the bordered system that it solves, p . t > 0.
!> Source: Keller 1977.
module attrito_continuation_tangent
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_newton_linearised_step, only: solve_linearised
  use attrito_newton_newton_context, only: least_stiffening
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: tangent_type, find_tangent, frequency_tangent, reverse, share_of_harmonics

  type :: tangent_type
    !> Scaled motion [2 H + 1, rows], what periodic sliders do along it [2, contacts], and scaled frequency
    real(wp), allocatable :: motion(:, :), slider(:, :)
    real(wp) :: omega = 0.0_wp
  contains
    procedure :: keep
  end type tangent_type

contains

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(tangent_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%motion)
    call store%keep(self%slider)
    call store%keep(self%omega)
  end subroutine keep

  !> At the solver's present point.
  subroutine find_tangent(solver, towards, tangent, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Without motion: growing or falling frequency
    type(tangent_type), intent(in) :: towards
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> 0, or not: the bordered system is singular
    integer, intent(out) :: status
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step
    real(wp) :: length
    integer :: iterations

    associate (context => solver%context)
      right = new_unknowns(shape(solver%motion), shape(context%balance%slider))
      step = right
      if (allocated(towards%motion)) then
        constraint%motion = towards%motion/context%motion_scale
      else
        constraint%motion = 0.0_wp*solver%motion
      end if
      constraint%frequency = towards%omega/context%frequency_scale
      call context%balance%evaluate(solver%motion, solver%omega, status)
      right%omega = 1.0_wp
      context%balance%stiffening = least_stiffening
      call solve_linearised(context%balance, constraint, right, context%linear, step, iterations, status, context%preconditioner)
      context%balance%stiffening = 0.0_wp
      if (status /= 0) return
      step%motion = step%motion/context%motion_scale
      step%slider = step%slider/context%motion_scale
      step%omega = step%omega/context%frequency_scale
      length = sqrt(inner_product(context%balance, step%motion, step%motion) + step%omega**2)
      tangent%motion = step%motion/length
      tangent%slider = step%slider/length
      tangent%omega = step%omega/length
    end associate
  end subroutine find_tangent

  !> The direction of growing or falling frequency, 1 or -1, at fixed motion.
  pure function frequency_tangent(solver, way) result(tangent)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> 1: growing frequency, -1: falling
    real(wp), intent(in) :: way
    type(tangent_type) :: tangent

    allocate (tangent%motion, mold=solver%motion)
    allocate (tangent%slider, mold=solver%context%balance%slider)
    tangent%motion = 0.0_wp
    tangent%slider = 0.0_wp
    tangent%omega = way
  end function frequency_tangent

  !> The opposite direction along the branch.
  pure subroutine reverse(tangent)
    !> Tangent of the branch
    type(tangent_type), intent(inout) :: tangent

    tangent%motion = -tangent%motion
    tangent%slider = -tangent%slider
    tangent%omega = -tangent%omega
  end subroutine reverse

  !> Part of a unit direction that is anything but a mean position.
  real(wp) function share_of_harmonics(solver, motion, omega) result(share)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of relative displacement, by harmonic and row; angular frequency, rad/s
    real(wp), intent(in) :: motion(:, :), omega

    share = sum(motion(2:, :)**2)
    call solver%context%balance%ranks%sum(share)
    share = sqrt(share + omega**2)
  end function share_of_harmonics
end module attrito_continuation_tangent
