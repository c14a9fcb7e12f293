!> The tangent of a branch,
!>
!> $$ r_d \, t + r_\omega \, t_\omega = 0, \qquad |t|^2 + t_\omega^2 = 1, $$
!>
!> in motion and frequency that are scaled; turned towards a direction by the bordered system that it solves, p . t > 0. Lengths along
!> the drawn curve leave means out, which may jump from point to point as sliders shake down: there t is divided by its share |t| of
!> anything else.
!> Source: Keller 1977.
module attrito_continuation_tangent
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_newton_linearised_step, only: solve_linearised, change_of_deviation, stiffened
  use attrito_newton_newton_context, only: least_stiffening
  use attrito_balance_stuck_response, only: recover_loaded
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_continuation_curve_point, only: curve_point_type, new_curve_point
  use attrito_solve_rigid_drift, only: mean_share
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: tangent_type, find_tangent, tangent_of_evaluation, frequency_tangent, reverse, share_of_harmonics, share_beside_slide

  type :: tangent_type
    !> Scaled motion [2 H + 1, rows], what periodic sliders do along it [2, contacts], and scaled frequency
    real(wp), allocatable :: motion(:, :), slider(:, :)
    real(wp) :: omega = 0.0_wp
    !> Part of it that is anything but mean positions
    real(wp) :: share = 1.0_wp
  contains
    procedure :: reach
    procedure :: across
    procedure :: keep
  end type tangent_type

contains

  !> How far along the tangent, means included, a step goes whose length without them is one; one where means alone change.
  pure real(wp) function reach(self)
    class(tangent_type), intent(in) :: self

    reach = merge(1.0_wp/self%share, 1.0_wp, self%share > mean_share)
  end function reach

  !> The direction that planes are across and other directions are compared with, [2 H + 1, rows]: without mean positions, which may
  !> jump from point to point as sliders shake down, unless hardly anything else changes.
  pure function across(self) result(motion)
    class(tangent_type), intent(in) :: self
    real(wp), allocatable :: motion(:, :)

    motion = self%motion
    if (self%share > mean_share) motion(1, :) = 0.0_wp
  end function across

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(tangent_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%motion)
    call store%keep(self%slider)
    call store%keep(self%omega)
    call store%keep(self%share)
  end subroutine keep

  !> At the solver's present point, where the balance is evaluated.
  subroutine find_tangent(solver, towards, tangent, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Without motion: growing or falling frequency
    type(tangent_type), intent(in) :: towards
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> 0, or not: the bordered system is singular
    integer, intent(out) :: status
    type(curve_point_type) :: point

    call solver%context%balance%evaluate(solver%motion, solver%omega, status)
    if (status == 0) call tangent_of_jacobian(solver, towards, tangent, point, status)
  end subroutine find_tangent

  !> At the solver's present point, at which the balance was evaluated last, with the point of the drawn curve. The evaluation stays.
  subroutine tangent_of_evaluation(solver, towards, tangent, point, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Without motion: growing or falling frequency
    type(tangent_type), intent(in) :: towards
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> Frequency and amplitudes with their changes along the branch
    type(curve_point_type), intent(out) :: point
    !> 0, or not: the bordered system is singular
    integer, intent(out) :: status

    if (solver%all_stick) then
      call tangent_of_stuck(solver, towards, tangent, point, status)
    else
      call tangent_of_jacobian(solver, towards, tangent, point, status)
    end if
  end subroutine tangent_of_evaluation

  !> By the Jacobian of the last evaluation.
  subroutine tangent_of_jacobian(solver, towards, tangent, point, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Without motion: growing or falling frequency
    type(tangent_type), intent(in) :: towards
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> Frequency and amplitudes with their changes along the branch
    type(curve_point_type), intent(out) :: point
    !> 0, or not: the bordered system is singular
    integer, intent(out) :: status
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step
    complex(wp), allocatable :: rate(:, :)
    integer :: iterations

    associate (context => solver%context, balance => solver%context%balance)
      right = new_unknowns(shape(solver%motion), shape(balance%slider))
      step = right
      if (allocated(towards%motion)) then
        constraint%motion = towards%across()/context%motion_scale
      else
        constraint%motion = 0.0_wp*solver%motion
      end if
      constraint%frequency = towards%omega/context%frequency_scale
      right%omega = 1.0_wp
      call solve_linearised(balance, constraint, right, stiffened(context%linear, least_stiffening), step, iterations, status, &
                            context%preconditioner)
      if (status /= 0) return
      allocate (rate, mold=balance%response)
      call balance%respond_to_deviation(change_of_deviation(balance, right, step), rate)
      rate = rate + step%omega*balance%response_omega
    end associate
    call normalise(solver, step, rate, tangent, point)
  end subroutine tangent_of_jacobian

  !> Where every contact sticks: of the linear response.
  subroutine tangent_of_stuck(solver, towards, tangent, point, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Without motion: growing or falling frequency
    type(tangent_type), intent(in) :: towards
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> Frequency and amplitudes with their changes along the branch
    type(curve_point_type), intent(out) :: point
    !> 0, or not: the system is singular
    integer, intent(out) :: status
    type(unknowns_type) :: step
    complex(wp) :: rate(size(solver%context%balance%response, 1), 0:ubound(solver%context%balance%response, 2))
    real(wp), allocatable :: moving(:, :)
    real(wp) :: along
    integer :: i

    associate (context => solver%context, balance => solver%context%balance, top => solver%context%balance%highest_load())
      call balance%receptance%set_frequency(solver%omega, status, top)
      if (status /= 0) return
      rate = 0.0_wp
      call balance%receptance%respond_derivative(balance%response(:, :top), rate(:, :top))
      step = new_unknowns(shape(solver%motion), shape(balance%slider))
      moving = recover_loaded(balance, rate)
      do i = 1, size(balance%loaded)
        step%motion(2*balance%loaded(i), :) = moving(:, 2*i - 1)
        step%motion(2*balance%loaded(i) + 1, :) = moving(:, 2*i)
      end do
      step%omega = 1.0_wp
      along = towards%omega/context%frequency_scale
      if (allocated(towards%motion)) along = along + inner_product(balance, towards%across(), step%motion)/context%motion_scale
      if (along < 0.0_wp) then
        step%motion = -step%motion
        step%omega = -1.0_wp
        rate = -rate
      end if
    end associate
    call normalise(solver, step, rate, tangent, point)
  end subroutine tangent_of_stuck

  !> A direction of unit length, and the drawn curve along it.
  subroutine normalise(solver, step, rate, tangent, point)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Direction
    type(unknowns_type), intent(inout) :: step
    !> What the response changes by along it [n, 0:H]
    complex(wp), intent(in) :: rate(:, 0:)
    !> Tangent of the branch
    type(tangent_type), intent(out) :: tangent
    !> Frequency and amplitudes with their changes along the branch
    type(curve_point_type), intent(out) :: point
    real(wp) :: length

    associate (context => solver%context, balance => solver%context%balance)
      tangent%motion = step%motion/context%motion_scale
      tangent%slider = step%slider/context%motion_scale
      tangent%omega = step%omega/context%frequency_scale
      length = sqrt(inner_product(balance, tangent%motion, tangent%motion) + tangent%omega**2)
      tangent%motion = tangent%motion/length
      tangent%slider = tangent%slider/length
      tangent%omega = tangent%omega/length
      tangent%share = share_of_harmonics(solver, tangent%motion, tangent%omega)
      length = length*max(tangent%share, tiny(1.0_wp))
      point = new_curve_point(solver%omega, balance%monitors%motion_of(balance%response), step%omega/length, &
                              balance%monitors%motion_of(rate)/length)
    end associate
  end subroutine normalise

  !> The direction of growing or falling frequency, 1 or -1, at fixed motion.
  pure function frequency_tangent(solver, direction) result(tangent)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> 1: growing frequency, -1: falling
    real(wp), intent(in) :: direction
    type(tangent_type) :: tangent

    allocate (tangent%motion, mold=solver%motion)
    allocate (tangent%slider, mold=solver%context%balance%slider)
    tangent%motion = 0.0_wp
    tangent%slider = 0.0_wp
    tangent%omega = direction
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

  !> Part of a unit direction that is anything but a slide of bodies along all contacts that close, which is what a drift consists of;
  !> a body that nothing but rounding of the structure's stiffness holds slides by all mean positions. The slide is taken in the norm
  !> of the springs and the rest measured in lengths, so that a part may be a little above 1.
  real(wp) function share_beside_slide(solver, motion, omega) result(share)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of relative displacement, by harmonic and row; angular frequency, rad/s
    real(wp), intent(in) :: motion(:, :), omega

    share = share_of_harmonics(solver, motion, omega)
    associate (balance => solver%context%balance)
      if (balance%free%count == 0) return
      share = hypot(share, balance%norm(spread(balance%beside_slide(motion(1, :)), 1, 1)))
    end associate
  end function share_beside_slide
end module attrito_continuation_tangent
