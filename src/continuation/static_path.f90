!> Static equilibrium along a load path, walked quasi-statically: each step starts from the sliders that the step before left.
!>
!> $$ K q_0 + B^T \lambda(B q_0, w) = \sum_i s_i f_i $$
!>
!> It is the harmonic balance without harmonic loads, so a step is the same solve; the path is walked in equal steps, halved where
!> one fails.
module attrito_continuation_static_path
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_continuation_cascade, only: march_parameter
  use attrito_continuation_solver, only: solver_type
  implicit none
  private
  public :: walk_static_path

contains

  !> Walk the path from the unloaded state; leaves the solver with the last point's loads, motion and sliders.
  subroutine walk_static_path(solver, path, steps, omega, error)
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Steps from corner to corner
    integer, intent(in) :: steps
    !> Angular frequency to stand at
    real(wp), intent(in) :: omega
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: from(size(path, 1)), to(size(path, 1))
    integer :: corner
    logical :: converged
    character(120) :: where_it_failed

    solver%motion = 0.0_wp
    solver%omega = omega
    call solver%set_slider(0.0_wp*solver%static_slider)
    from = 0.0_wp
    if (allocated(solver%context%balance%frozen_mean)) deallocate (solver%context%balance%frozen_mean)
    do corner = 1, size(path, 2)
      to = path(:, corner)
      if (corner == 1 .and. all(abs(to - from) <= 0.0_wp)) cycle
      call solver%set_loads(to, 0.0_wp)
      call solver%set_scales(omega, omega)
      call march_parameter(part_of_the_way, converged, 1.0_wp/steps)
      if (.not. converged) then
        write (where_it_failed, '(a,i0,a)') 'static load path, corner ', corner, ': no equilibrium found'
        call raise(error, trim(where_it_failed)//' (do the loads open all contacts that hold a body?)')
        return
      end if
      from = to
    end do
    solver%static_slider = solver%context%balance%slider
    if (solver%options%uncoupled) solver%context%balance%frozen_mean = static_mean()

  contains

    subroutine part_of_the_way(t, done)
      real(wp), intent(in) :: t
      logical, intent(out) :: done

      call solver%set_loads(from + t*(to - from), 0.0_wp)
      call solver%solve_at(omega)
      done = solver%report%converged
    end subroutine part_of_the_way

    !> Mean of the generalised coordinates of the last static solution.
    function static_mean() result(mean)
      complex(wp), allocatable :: mean(:)

      mean = solver%context%balance%response(:, lbound(solver%context%balance%response, 2))
    end function static_mean
  end subroutine walk_static_path
end module attrito_continuation_static_path
