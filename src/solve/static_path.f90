!> Static equilibrium along a load path, followed quasi-statically: each step starts from the sliders of the step before.
!>
!> $$ K q_0 + B^T \lambda(B q_0, w) = \sum_i s_i f_i $$
!>
!> It is the harmonic balance without harmonic loads, so a step is the same solve; the path is followed in equal steps, halved
!> where one fails.
module attrito_solve_static_path
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_solve_homotopy, only: follow_homotopy, homotopy_type
  use attrito_solve_mean_regularisation, only: can_regularise, find_drift
  use attrito_solve_sliders, only: closed_contacts
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  implicit none
  private
  public :: follow_static_path, load_homotopy_type

  !> From one set of factors on the static loads to another, at one angular frequency
  type, extends(homotopy_type) :: load_homotopy_type
    real(wp), allocatable :: from(:), to(:)
    real(wp) :: omega = 0.0_wp
  contains
    procedure :: solve => solve_loads
  end type load_homotopy_type

contains

  !> Follow the path from the unloaded state; the solver is left with the loads, motion and sliders of the last point.
  subroutine follow_static_path(solver, path, steps, omega, error)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Steps from corner to corner
    integer, intent(in) :: steps
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    logical :: reset_slider

    ! What points begin at is the path's end: along it sliders go on.
    reset_slider = solver%options%reset_slider
    solver%options%reset_slider = .false.
    call follow_corners(solver, path, steps, omega, error)
    solver%options%reset_slider = reset_slider
  end subroutine follow_static_path

  !> From corner to corner, sliders going on.
  subroutine follow_corners(solver, path, steps, omega, error)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Steps from corner to corner
    integer, intent(in) :: steps
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: from(size(path, 1)), to(size(path, 1))
    integer :: corner, iterations
    logical :: converged
    character(120) :: where_it_failed

    solver%motion = 0.0_wp
    solver%omega = omega
    solver%evidence = evidence_type()
    call solver%set_slider(0.0_wp*solver%static_slider)
    from = 0.0_wp
    if (allocated(solver%context%balance%frozen_mean)) deallocate (solver%context%balance%frozen_mean)
    do corner = 1, size(path, 2)
      to = path(:, corner)
      if (corner == 1 .and. all(abs(to - from) <= 0.0_wp)) cycle
      call solver%set_loads(to, 0.0_wp)
      call solver%set_scales(omega, omega)
      iterations = 0
      call follow_homotopy(load_homotopy_type(from, to, omega), solver, iterations, converged, 1.0_wp/steps)
      if (solver%context%petsc_error /= 0) then
        write (where_it_failed, '(a,i0,a)') 'PETSc failed (error ', solver%context%petsc_error, ') while solving the static balance'
        call raise(error, trim(where_it_failed))
        return
      end if
      if (.not. converged) then
        write (where_it_failed, '(a,i0,a)') 'static load path, corner ', corner, ': no equilibrium found'
        if (drifts(solver, omega)) where_it_failed = trim(where_it_failed)//': a body drifts, no contact holds it'
        call raise(error, trim(where_it_failed)//' (do the loads open all contacts that hold a body, or exceed their friction?)')
        return
      end if
      from = to
    end do
    call keep_static_state(solver)
  end subroutine follow_corners

  !> Sliders, closed contacts and frozen mean of the static solution that the solver is at.
  subroutine keep_static_state(solver)
    !> Solver of points, at its static solution
    type(solver_type), intent(inout) :: solver

    solver%static_slider = solver%context%balance%slider
    solver%static_motion = solver%motion(:1, :)
    solver%closed = closed_contacts(solver%context%balance, size(solver%contacts%law))
    associate (response => solver%context%balance%response)
      if (solver%options%uncoupled) solver%context%balance%frozen_mean = response(:, lbound(response, 2))
    end associate
  end subroutine keep_static_state

  !> Does a body drift under the loads at which no equilibrium was found?
  logical function drifts(solver, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega
    type(strategy_outcome_type) :: outcome

    if (can_regularise(solver)) call find_drift(solver, omega, .false., outcome)
    drifts = outcome%evidence%is_drifting
  end function drifts

  subroutine solve_loads(self, solver, t, converged)
    class(load_homotopy_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Parameter of the homotopy, 0 to 1
    real(wp), intent(in) :: t
    !> Did the solve converge?
    logical, intent(out) :: converged

    call solver%set_loads(self%from + t*(self%to - self%from), 0.0_wp)
    call solver%solve_at(self%omega)
    converged = solver%report%converged
  end subroutine solve_loads
end module attrito_solve_static_path
