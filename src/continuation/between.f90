!> Points of the true curve between the ends of an arc, which the drawn curve is held against.
!>
!> A step of Newton's method from a point of the arc, in the plane across it, is as near to the branch as the square of its length,
!> where no contact begins to do something else. Steps that are not short are therefore followed by another.
module attrito_continuation_between
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_newton_linearised_step, only: change_of_deviation, solve_linearised, stiffened
  use attrito_newton_newton_context, only: least_stiffening
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_set_aside, only: evaluation_type, set_aside, take_up
  use attrito_balance_stuck_response, only: find_loaded_response
  use attrito_balance_periodic_sliders, only: slider_defects
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_curve_point, only: curve_point_type, new_curve_point
  use attrito_continuation_step, only: step_type
  use attrito_continuation_step_length, only: default_tolerance
  implicit none
  private
  public :: estimate_between, stuck_point

  !> Most steps, and length, relative to the motion, of one after which none follows, at the default tolerance of the drawn curve:
  !> what a step leaves goes with its square
  integer, parameter :: most_steps = 3 ! guess
  real(wp), parameter :: near = 0.01_wp ! guess

contains

  !> The point of the true curve beside a part of a step's arc, by a step or a few of Newton's method. The solver's point and its
  !> evaluation stay.
  subroutine estimate_between(solver, step, part, tolerance, point, off, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> Part of the arc, 0 to 1; error of the drawn curve that is accepted
    real(wp), intent(in) :: part, tolerance
    !> Point of the curve
    type(curve_point_type), intent(out) :: point
    !> Distance of its motion from the arc's, means left out, relative to the motion
    real(wp), intent(out) :: off
    !> 0, or not: the balance cannot be evaluated or linearised there
    integer, intent(out) :: status
    type(evaluation_type) :: here
    type(constraint_type) :: constraint
    type(unknowns_type) :: whole, moved
    real(wp), allocatable :: motion(:, :)
    complex(wp), allocatable :: change(:, :)
    real(wp) :: omega
    integer :: i

    associate (context => solver%context, balance => solver%context%balance)
      off = 0.0_wp
      call set_aside(balance, here)
      call step%constraint_at(solver, part, motion, omega, constraint)
      balance%periodic = step%from%periodic .or. step%to%periodic
      do i = 1, size(balance%periodic)
        balance%slider(:, i) = step%from%slider(:, i)
        if (balance%periodic(i)) balance%slider(:, i) = (1.0_wp - part)*step%from%slider(:, i) + part*step%to%slider(:, i)
      end do
      whole = new_unknowns(shape(motion), shape(balance%slider))
      do i = 1, most_steps
        call step_of_newton(solver, constraint, motion, omega, moved, change, status)
        if (status /= 0) exit
        motion = motion + moved%motion
        omega = omega + moved%omega
        where (spread(balance%periodic, 1, size(balance%slider, 1))) balance%slider = balance%slider + moved%slider
        whole%motion = whole%motion + moved%motion
        off = relative(balance, whole%motion, motion)
        if (relative(balance, moved%motion, motion) < near*sqrt(tolerance/default_tolerance)) exit
      end do
      if (status == 0) point = new_curve_point(omega, balance%monitors%motion_of(change))
      call take_up(balance, here)
      call context%forget()
    end associate
  end subroutine estimate_between

  !> One step of Newton's method in a plane that the motion lies in, and the response after it.
  subroutine step_of_newton(solver, constraint, motion, omega, moved, response, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The plane
    type(constraint_type), intent(in) :: constraint
    !> Coefficients of relative displacement, by harmonic and row; angular frequency, rad/s
    real(wp), intent(in) :: motion(:, :), omega
    !> The step
    type(unknowns_type), intent(out) :: moved
    !> Coordinates of the response, by harmonic
    complex(wp), allocatable, intent(out) :: response(:, :)
    !> 0, or not: the balance cannot be evaluated or linearised there
    integer, intent(out) :: status
    type(unknowns_type) :: right
    integer :: iterations

    associate (context => solver%context, balance => solver%context%balance)
      call balance%evaluate(motion, omega, status)
      if (status /= 0) return
      right = new_unknowns(shape(motion), shape(balance%slider))
      moved = right
      right%motion = -balance%residual
      right%slider = slider_defects(balance)
      call solve_linearised(balance, constraint, right, stiffened(context%linear, least_stiffening), moved, iterations, status, &
                            context%preconditioner)
      if (status /= 0) return
      allocate (response, mold=balance%response)
      call balance%respond_to_deviation(change_of_deviation(balance, right, moved), response)
      response = balance%response + response + moved%omega*balance%response_omega
    end associate
  end subroutine step_of_newton

  !> Norm of the harmonics of a change, relative to those of a motion.
  real(wp) function relative(balance, change, motion)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> [2 H + 1, rows]
    real(wp), intent(in) :: change(:, :), motion(:, :)

    relative = balance%norm(change(2:, :))/max(balance%norm(motion(2:, :)), tiny(1.0_wp))
  end function relative

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
