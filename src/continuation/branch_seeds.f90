!> Starts for branches that no sweep leads to: cold, out of motion in time from a motion that is not the one sought, and by homotopy
!> in the preload, from a structure that is pressed more or less than it is,
!>
!> $$ f_0(t) = \gamma^{1 - t} f_0, \qquad t = 0 \dots 1. $$
module attrito_continuation_branch_seeds
  use attrito_core_kinds, only: wp
  use attrito_solve_strategies, only: solve_by_cascade
  use attrito_solve_solver, only: solver_type
  use attrito_solve_time_integration_start, only: has_time, solve_in_time
  use attrito_solve_homotopy, only: march_along, way_type
  implicit none
  private
  public :: start_cold, start_in_motion, start_from_preload

  !> Iterations after which a homotopy is given up
  integer, parameter :: most_iterations = 200

  !> From other static loads to those that act
  type, extends(way_type) :: preload_way_type
    real(wp), allocatable :: factors(:)
    real(wp) :: gamma = 1.0_wp, level = 1.0_wp, omega = 0.0_wp
  contains
    procedure :: solve => solve_preloaded
  end type preload_way_type

contains

  !> From rest in the present mean position, sliders where the static solution left them.
  subroutine start_cold(solver, omega, found)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    logical, intent(out) :: found

    solver%motion(2:, :) = 0.0_wp
    solver%all_stick = .false.
    call solver%set_slider(solver%static_slider)
    solver%walks = .false.
    solver%no_orbit = .false.
    call solve_by_cascade(solver, omega)
    found = solver%report%converged
  end subroutine start_cold

  !> From what motion in time comes to that begins with the harmonics of the present motion times a factor.
  subroutine start_in_motion(solver, omega, factor, found)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega, factor
    logical, intent(out) :: found
    integer :: iterations

    found = .false.
    if (.not. has_time(solver)) return
    iterations = 0
    solver%motion(2:, :) = factor*solver%motion(2:, :)
    call solve_in_time(solver, omega, .false., .false., iterations, found)
    solver%walks = .false.
    solver%no_orbit = .false.
  end subroutine start_in_motion

  !> From the solution at static loads times a factor.
  subroutine start_from_preload(solver, omega, factor, found)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega, factor
    logical, intent(out) :: found
    type(preload_way_type) :: way
    integer :: iterations

    way%factors = solver%context%balance%static_factors
    way%level = solver%context%balance%level
    way%gamma = factor
    way%omega = omega
    call solver%set_loads(factor*way%factors, way%level)
    call start_cold(solver, omega, found)
    if (found) then
      iterations = 0
      call march_along(way, solver, iterations, found, most_iterations=most_iterations)
    end if
    call solver%set_loads(way%factors, way%level)
  end subroutine start_from_preload

  subroutine solve_preloaded(self, solver, t, converged)
    class(preload_way_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: t
    logical, intent(out) :: converged

    call solver%set_loads(self%gamma**(1.0_wp - t)*self%factors, self%level)
    call solver%solve_at(self%omega)
    converged = solver%report%converged
  end subroutine solve_preloaded
end module attrito_continuation_branch_seeds
