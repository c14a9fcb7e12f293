!> C interface of modes by quasi-static loading. All calls are collective and give every rank the same.
module attrito_api_quasi_static
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_accuracy_point_errors, only: point_errors_type, no_tolerance
  use attrito_newton_newton, only: newton_report_type
  use attrito_output_point_report, only: report_point
  use attrito_peak_quasi_static, only: begin_quasi_static
  use attrito_api_session, only: session_type, session_of
  use attrito_api_solver, only: point_type, point_of
  implicit none
  private
  public :: quasi_static_type

  type, bind(c) :: quasi_static_type
    !> Without an estimate of its error
    type(point_type) :: point
    !> Amplitude of the load; Q; damping ratio of the structure alone; area of the loop; work of all contacts, and the same from every
    !> second state; angular frequency and damping ratio by Masing's rule
    real(c_double) :: load, amplitude, structural_ratio, area, work, coarse_work, masing_omega, masing_ratio
  end type quasi_static_type

contains

  !> Load a mode's shape with unit modal mass [m] quasi-statically. The static path has been followed; the session serves nothing but
  !> such cycles from then on.
  subroutine attrito_begin_quasi_static(handle, shape, omega) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> In the model's coordinates
    real(c_double), intent(in) :: shape(*)
    !> Its angular frequency, rad/s
    real(c_double), value :: omega
    type(session_type), pointer :: session

    session => session_of(handle)
    call begin_quasi_static(session%solver, shape(:size(session%structure%mass, 1)), omega, session%quasi_static)
  end subroutine attrito_begin_quasi_static

  !> A closed cycle of an amplitude of the load, in so many steps, from the static solution.
  subroutine attrito_quasi_static_at(handle, load, steps, settling, branch, cycle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Amplitude of the load
    real(c_double), value :: load
    !> Of a cycle, a multiple of 4; cycles of few steps before, at most; number of the branch
    integer(c_int), value :: steps, settling, branch
    !> The cycle, reported as a point
    type(quasi_static_type), intent(out) :: cycle
    type(newton_report_type) :: ended
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (mode => session%quasi_static)
      call mode%cycle_at(session%solver, load, steps, settling)
      ended = session%solver%report
      ended%converged = mode%path%found
      ended%iterations = mode%path%iterations
      ended%defect = mode%defect
      call report_point(session%solver, ended, branch, point_errors_type(), no_tolerance, session%point)
      if (mode%path%found) session%point%amplitude = mode%monitored
      cycle%point = point_of(session%point)
      cycle%load = mode%load
      cycle%amplitude = mode%amplitude
      cycle%structural_ratio = mode%structural_ratio
      cycle%area = mode%area
      cycle%work = mode%work
      cycle%coarse_work = mode%coarse_work
      cycle%masing_omega = mode%masing_omega
      cycle%masing_ratio = mode%masing_ratio
    end associate
  end subroutine attrito_quasi_static_at

  !> The amplitude Q of a cycle that is not reported, from the static solution.
  subroutine attrito_try_quasi_static(handle, load, steps, settling, amplitude, closed, iterations) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Amplitude of the load
    real(c_double), value :: load
    !> Of a cycle, a multiple of 4; cycles until one closes, at most
    integer(c_int), value :: steps, settling
    !> Q, or less than zero where the contacts do not carry the load
    real(c_double), intent(out) :: amplitude
    !> 1: sliders came back; 0: they creep, and a cycle of more steps has another Q. Iterations of Newton's method
    integer(c_int), intent(out) :: closed, iterations
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (mode => session%quasi_static)
      call mode%try_cycle(session%solver, load, steps, settling)
      amplitude = merge(mode%amplitude, -1.0_wp, mode%path%found)
      closed = merge(1, 0, mode%closed)
      iterations = mode%path%iterations
    end associate
  end subroutine attrito_try_quasi_static

  !> Work of each contact in the last cycle, at the root.
  subroutine attrito_quasi_static_work(handle, work) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Of all contacts
    real(c_double), intent(out) :: work(*)
    type(session_type), pointer :: session
    real(wp), allocatable :: all(:, :)

    session => session_of(handle)
    associate (mine => session%quasi_static%contact_work)
      call session%solver%context%balance%ranks%gather_columns(reshape(mine, [1, size(mine)]), all)
    end associate
    if (session%ranks%is_root()) work(:size(all, 2)) = all(1, :)
  end subroutine attrito_quasi_static_work
end module attrito_api_quasi_static
