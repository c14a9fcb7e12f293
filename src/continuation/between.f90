!> Points of the true curve between the ends of an arc, which the drawn curve is held against.
!>
!> One step of Newton's method from the middle of the arc, in the plane across its chord, is as near to the branch as the square of
!> its length. Where every contact sticks the response is linear, and known at any frequency.
module attrito_continuation_between
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_newton_linearised_step, only: change_of_deviation, solve_linearised
  use attrito_newton_newton_context, only: least_stiffening
  use attrito_balance_set_aside, only: evaluation_type, set_aside, take_up
  use attrito_balance_stuck_response, only: find_loaded_response
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_curve_point, only: curve_point_type, new_curve_point
  use attrito_continuation_step, only: step_type
  implicit none
  private
  public :: estimate_middle, stuck_point

contains

  !> The point of the true curve beside the middle of a step's arc, to first order. The solver's point and its evaluation stay.
  subroutine estimate_middle(solver, step, point, off, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> Point of the curve
    type(curve_point_type), intent(out) :: point
    !> Distance of its motion from the arc's, means left out, relative to the motion
    real(wp), intent(out) :: off
    !> 0, or not: the balance cannot be evaluated or linearised there
    integer, intent(out) :: status
    type(evaluation_type) :: here
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, moved
    real(wp), allocatable :: motion(:, :)
    complex(wp), allocatable :: change(:, :)
    real(wp) :: omega, squares(2)
    integer :: i, iterations

    associate (context => solver%context, balance => solver%context%balance)
      off = 0.0_wp
      call set_aside(balance, here)
      call step%constraint_at(solver, 0.5_wp, motion, omega, constraint)
      balance%periodic = step%from%periodic .or. step%to%periodic
      do i = 1, size(balance%periodic)
        balance%slider(:, i) = step%from%slider(:, i)
        if (balance%periodic(i)) balance%slider(:, i) = 0.5_wp*(step%from%slider(:, i) + step%to%slider(:, i))
      end do
      call balance%evaluate(motion, omega, status)
      if (status == 0) then
        right = new_unknowns(shape(motion), shape(balance%slider))
        moved = right
        right%motion = -balance%residual
        do i = 1, size(balance%forces)
          if (balance%forces(i)%periodic) right%slider(:, i) = balance%forces(i)%moved
        end do
        balance%stiffening = least_stiffening
        call solve_linearised(balance, constraint, right, context%linear, moved, iterations, status, context%preconditioner)
        balance%stiffening = 0.0_wp
      end if
      if (status == 0) then
        allocate (change, mold=balance%response)
        call balance%respond_to_deviation(change_of_deviation(balance, right, moved), change)
        change = balance%response + change + moved%omega*balance%response_omega
        point = new_curve_point(omega + moved%omega, balance%monitors%motion_of(change))
        squares = [sum(moved%motion(2:, :)**2), sum((motion(2:, :) + moved%motion(2:, :))**2)]
        call balance%ranks%sum(squares)
        off = sqrt(squares(1)/max(squares(2), tiny(1.0_wp)))
      end if
      call take_up(balance, here)
      call context%forget()
    end associate
  end subroutine estimate_middle

  !> A point of the linear response. Nothing changes but the receptance's frequency.
  subroutine stuck_point(solver, omega, point, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Point of the curve
    type(curve_point_type), intent(out) :: point
    !> 0, or not: the system is singular there
    integer, intent(out) :: status
    complex(wp), allocatable :: loaded(:, :), response(:, :)

    associate (balance => solver%context%balance)
      call find_loaded_response(balance, omega, loaded)
      status = merge(0, 1, allocated(loaded))
      if (status /= 0) return
      allocate (response(size(loaded, 1), 0:balance%highest_load()), source=(0.0_wp, 0.0_wp))
      response(:, balance%loaded) = loaded
      point = new_curve_point(omega, balance%monitors%motion_of(response))
    end associate
  end subroutine stuck_point
end module attrito_continuation_between
