!> A body that friction alone holds: is it held, or does it walk? Springs on its mean position give way, solve by solve
!> (`attrito_solve_mean_springs`), until contacts hold the body without them, or the mean takes the same step every time.
module attrito_solve_mean_regularisation
  use attrito_core_kinds, only: wp
  use attrito_solve_sliders, only: nothing_holds
  use attrito_solve_solver, only: solver_type
  use attrito_solve_mean_springs, only: fasten, release, retreat_type
  implicit none
  private
  public :: can_hold, solve_held, let_walk

  !> Steps at most, and how much alike they are in the end: rounding and the tolerance leave some 1e-6 of those seen
  integer, parameter :: most_steps = 8
  real(wp), parameter :: alike = 1.0e-3_wp

contains

  !> Is there a mean to hold?
  pure logical function can_hold(solver)
    type(solver_type), intent(in) :: solver

    can_hold = .not. solver%options%uncoupled
  end function can_hold

  !> One solve with springs to where the mean is now.
  subroutine solve_held(solver, omega)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    logical :: fastened

    solver%report%converged = .false.
    call fasten(solver%context, solver%motion, solver%omega, fastened)
    if (.not. fastened) return
    call solver%solve_at(omega)
    call release(solver%context)
  end subroutine solve_held

  !> From where the solver stands let the springs give way, step by step: to a solution without springs, or to one with them where a
  !> body is seen to walk (`solver%walks`), each step being the last one over again without any contact that holds; or to neither.
  subroutine let_walk(solver, omega, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    !> To a solution without springs
    logical, intent(out) :: converged
    type(retreat_type) :: retreat
    integer :: i

    converged = .false.
    do i = 1, most_steps
      call solve_held(solver, omega)
      iterations = iterations + solver%report%iterations
      if (.not. solver%report%converged) return
      call retreat%move_to(solver%context%balance%response(:, 0))
      if (nothing_holds(solver%context%balance)) then
        if (.not. retreat%repeats(alike)) cycle
        solver%walks = .true.
        return
      end if
      call solve_free(solver, omega, iterations, converged)
      if (converged) return
    end do
    call solve_free(solver, omega, iterations, converged)
  end subroutine let_walk

  !> Newton's method without springs, for as long as it makes progress; nothing changes if it fails.
  subroutine solve_free(solver, omega, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    logical :: brief

    brief = solver%brief
    solver%brief = .true.
    call solver%solve_at(omega)
    solver%brief = brief
    iterations = iterations + solver%report%iterations
    converged = solver%report%converged
  end subroutine solve_free
end module attrito_solve_mean_regularisation
