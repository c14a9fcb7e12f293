!> Getting to a point by trying, in order: the point before; the stuck response; the frequency in smaller steps; the force in steps.
!>
!> Newton's method is the hard part at the onset of gross slip. Nothing is dropped in silence: what fails leaves the solver where
!> it was, with a report that says so.
module attrito_continuation_cascade
  use attrito_core_kinds, only: wp
  use attrito_continuation_solver, only: solver_type
  implicit none
  private
  public :: solve_by_cascade, march_parameter

  !> Smallest part of the way taken in one step
  real(wp), parameter :: smallest_step = 1.0_wp/128.0_wp

  abstract interface
    !> Solve at a part t of the way from 0 to 1, and say whether it converged.
    subroutine solve_part(t, converged)
      import :: wp
      real(wp), intent(in) :: t
      logical, intent(out) :: converged
    end subroutine solve_part
  end interface

contains

  !> Solve at an angular frequency, the harmonic load at its level.
  subroutine solve_by_cascade(solver, omega)
    type(solver_type), intent(inout) :: solver
    !> Target
    real(wp), intent(in) :: omega
    real(wp), allocatable :: motion(:, :), slider(:, :)
    real(wp) :: from, level
    integer :: iterations, status
    logical :: converged

    motion = solver%motion
    slider = solver%context%balance%slider
    from = solver%omega
    level = solver%context%balance%level
    iterations = 0
    call attempt_at(omega, converged)
    if (converged) return

    call solver%context%balance%receptance%set_frequency(omega, status)
    solver%motion = solver%context%balance%linear_motion()
    call attempt_at(omega, converged)
    if (converged) return

    call restore()
    call march_parameter(frequency_part, converged)
    if (converged) return

    call restore()
    solver%motion(2:, :) = 0.0_wp
    call march_parameter(level_part, converged)
    call set_level(level)
    if (converged) return
    call restore()

  contains

    subroutine attempt_at(target, done)
      real(wp), intent(in) :: target
      logical, intent(out) :: done

      call solver%solve_at(target)
      iterations = iterations + solver%report%iterations
      solver%report%iterations = iterations
      done = solver%report%converged
    end subroutine attempt_at

    subroutine frequency_part(t, done)
      real(wp), intent(in) :: t
      logical, intent(out) :: done

      call attempt_at(from + t*(omega - from), done)
    end subroutine frequency_part

    subroutine level_part(t, done)
      real(wp), intent(in) :: t
      logical, intent(out) :: done

      call set_level(t*level)
      call attempt_at(omega, done)
    end subroutine level_part

    subroutine set_level(value)
      real(wp), intent(in) :: value

      call solver%set_loads(solver%context%balance%static_factors, value)
    end subroutine set_level

    subroutine restore()
      solver%motion = motion
      solver%omega = from
      call solver%set_slider(slider)
    end subroutine restore
  end subroutine solve_by_cascade

  !> March a parameter from 0 to 1, halving the step where it fails.
  subroutine march_parameter(solve, converged, first_step)
    procedure(solve_part) :: solve
    logical, intent(out) :: converged
    !> A quarter unless given
    real(wp), intent(in), optional :: first_step
    real(wp) :: reached, step, largest_step
    logical :: done

    reached = 0.0_wp
    largest_step = 0.25_wp
    if (present(first_step)) largest_step = first_step
    step = largest_step
    do while (reached < 1.0_wp)
      step = min(step, 1.0_wp - reached)
      call solve(reached + step, done)
      if (done) then
        reached = merge(1.0_wp, reached + step, reached + step > 1.0_wp - 1.0e-9_wp)
        step = min(2.0_wp*step, largest_step)
      else
        step = 0.5_wp*step
        if (step < min(smallest_step, 0.1_wp*largest_step)) exit
      end if
    end do
    converged = reached >= 1.0_wp
  end subroutine march_parameter
end module attrito_continuation_cascade
