!> Homotopy: a parameter is changed from its present value to the one that is asked for, in steps, each from the solution of the last.
module attrito_solve_homotopy
  use attrito_core_kinds, only: wp
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: follow_homotopy, homotopy_type, frequency_homotopy_type, level_homotopy_type

  !> Smallest step
  real(wp), parameter :: smallest_step = 1.0_wp/128.0_wp ! guess

  !> A homotopy with the parameter t from 0 to 1
  type, abstract :: homotopy_type
  contains
    procedure(solve_part), deferred :: solve
  end type homotopy_type

  abstract interface
    !> Solve at t, and say whether it converged.
    subroutine solve_part(self, solver, t, converged)
      import :: homotopy_type, solver_type, wp
      class(homotopy_type), intent(in) :: self
      !> Solver of points, which this moves
      type(solver_type), intent(inout) :: solver
      !> Parameter of the homotopy, 0 to 1
      real(wp), intent(in) :: t
      !> Did the solve converge?
      logical, intent(out) :: converged
    end subroutine solve_part
  end interface

  !> From one angular frequency to another
  type, extends(homotopy_type) :: frequency_homotopy_type
    real(wp) :: from = 0.0_wp, to = 0.0_wp
  contains
    procedure :: solve => solve_frequency
  end type frequency_homotopy_type

  !> From no harmonic load to its level, at one angular frequency
  type, extends(homotopy_type) :: level_homotopy_type
    real(wp) :: omega = 0.0_wp, level = 1.0_wp
  contains
    procedure :: solve => solve_level
  end type level_homotopy_type

contains

  subroutine solve_frequency(self, solver, t, converged)
    class(frequency_homotopy_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Parameter of the homotopy, 0 to 1
    real(wp), intent(in) :: t
    !> Did the solve converge?
    logical, intent(out) :: converged

    call solver%solve_at(self%from + t*(self%to - self%from))
    converged = solver%report%converged
  end subroutine solve_frequency

  subroutine solve_level(self, solver, t, converged)
    class(level_homotopy_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Parameter of the homotopy, 0 to 1
    real(wp), intent(in) :: t
    !> Did the solve converge?
    logical, intent(out) :: converged

    call solver%set_loads(solver%context%balance%static_factors, t*self%level)
    call solver%solve_at(self%omega)
    converged = solver%report%converged
  end subroutine solve_level

  !> Follow a homotopy from 0 to 1, halving the step where it fails.
  subroutine follow_homotopy(homotopy, solver, iterations, converged, first_step, most_iterations)
    !> Homotopy to follow
    class(homotopy_type), intent(in) :: homotopy
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Counts on
    integer, intent(inout) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged
    !> A quarter unless given
    real(wp), intent(in), optional :: first_step
    !> Iterations after which it is given up; unlimited unless given
    integer, intent(in), optional :: most_iterations
    real(wp) :: reached, step, largest_step
    logical :: done
    integer :: budget

    budget = huge(1)
    if (present(most_iterations)) budget = iterations + most_iterations
    reached = 0.0_wp
    largest_step = 0.25_wp
    if (present(first_step)) largest_step = first_step
    step = largest_step
    do while (reached < 1.0_wp .and. iterations < budget)
      step = min(step, 1.0_wp - reached)
      call homotopy%solve(solver, reached + step, done)
      iterations = iterations + solver%report%iterations
      if (done) then
        reached = merge(1.0_wp, reached + step, reached + step > 1.0_wp - 1.0e-9_wp)
        step = min(2.0_wp*step, largest_step)
      else
        step = 0.5_wp*step
        if (step < min(smallest_step, 0.1_wp*largest_step)) exit
      end if
    end do
    converged = reached >= 1.0_wp
  end subroutine follow_homotopy
end module attrito_solve_homotopy
