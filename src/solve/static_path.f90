!> Static equilibrium along a load path, followed quasi-statically: each increment starts from the sliders of the one before.
!>
!> $$ K q_0 + B^T \lambda(B q_0, w) = \sum_i s_i f_i $$
!>
!> It is the harmonic balance without harmonic loads, solved for the mean alone, corner after corner (`attrito_solve_load_steps`).
module attrito_solve_static_path
  use attrito_core_cholesky, only: factor_positive, solve_positive
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_solve_load_steps, only: follow_loads
  use attrito_solve_mean_regularisation, only: can_regularise, find_drift
  use attrito_solve_sliders, only: closed_contacts
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  implicit none
  private
  public :: follow_static_path

  !> Part of a displacement that rounding of the stuck system's modes may take; the part of contact forces that it may hide
  real(wp), parameter :: last_digits = 64.0_wp*epsilon(1.0_wp), most_rounding = 1.0e-4_wp ! guess

contains

  !> Follow the path from the unloaded state; the solver is left with the loads, motion and sliders of the last point.
  subroutine follow_static_path(solver, path, steps, omega, error, slider)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Increments from corner to corner at least
    integer, intent(in) :: steps
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    !> Sliders where the path begins [width, contacts of this rank]; zero unless given
    real(wp), intent(in), optional :: slider(:, :)
    logical :: reset_slider
    integer :: harmonics

    ! What points begin at is the path's end: along it sliders go on. Nothing moves but the mean.
    reset_slider = solver%options%reset_slider
    harmonics = solver%options%harmonics
    solver%options%reset_slider = .false.
    call solver%set_harmonics(0)
    call solver%set_slider(0.0_wp*solver%static_slider)
    if (present(slider)) call solver%set_slider(slider)
    call follow_corners(solver, path, steps, omega, error)
    call solver%set_harmonics(harmonics)
    call solver%set_scales(omega, omega)
    solver%options%reset_slider = reset_slider
    if (.not. allocated(error)) call keep_static_state(solver)
  end subroutine follow_static_path

  !> From corner to corner, sliders going on.
  subroutine follow_corners(solver, path, steps, omega, error)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Increments from corner to corner at least
    integer, intent(in) :: steps
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: from(size(path, 1)), to(size(path, 1))
    real(wp) :: rounding
    integer :: corner, iterations
    logical :: converged
    character(120) :: where_it_failed

    solver%motion = 0.0_wp
    solver%omega = omega
    solver%evidence = evidence_type()
    from = 0.0_wp
    if (allocated(solver%context%balance%frozen_mean)) deallocate (solver%context%balance%frozen_mean)
    do corner = 1, size(path, 2)
      to = path(:, corner)
      if (corner == 1 .and. size(path, 2) > 1 .and. all(abs(to) <= 0.0_wp)) cycle
      call solver%set_loads(to, 0.0_wp)
      call solver%set_scales(omega, omega)
      call scale_by_structure(solver, to, rounding)
      iterations = 0
      call follow_loads(solver, from, to, omega, steps, iterations, converged)
      if (converged .and. rounding > most_rounding) then
        ! If contacts hold the structure, it has not gone as far as it would alone.
        rounding = rounding*solver%context%balance%norm(solver%motion)/solver%context%motion_scale
        converged = rounding <= most_rounding
      end if
      if (solver%context%petsc_error /= 0) then
        write (where_it_failed, '(a,i0,a)') 'PETSc failed (error ', solver%context%petsc_error, ') while solving the static balance'
        call raise(error, trim(where_it_failed))
        return
      end if
      if (.not. converged) then
        write (where_it_failed, '(a,i0,a)') 'static load path, corner ', corner, ': no equilibrium found'
        if (rounding > most_rounding) then
          call raise(error, trim(where_it_failed)//too_stiff(rounding))
          return
        end if
        if (.not. solver%context%balance%free%leaves_motion) then
          call raise(error, trim(where_it_failed)//', though the structure holds itself: the iteration failed (give contacts'// &
                     ' less stiffness, interference or preload, or the path more [static] steps)')
          return
        end if
        if (drifts(solver, omega)) where_it_failed = trim(where_it_failed)//': a body drifts, no contact holds it'
        call raise(error, trim(where_it_failed)//' (do the loads open all contacts that hold a body, or exceed their friction?)')
        return
      end if
      from = to
    end do
  end subroutine follow_corners

  !> Steps are relative to how far the structure alone would go, where it is held by itself: contacts that slip or open let it. What
  !> residuals may be stays what it is relative to the stuck motion, but for rounding of displacements: beside a structure far softer
  !> than they are contacts' springs turn their last digits into forces.
  subroutine scale_by_structure(solver, factors, rounding)
    !> Solver of points, whose scale and tolerance this changes
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads
    real(wp), intent(in) :: factors(:)
    !> The part of the contacts' forces that rounding of displacements may hide
    real(wp), intent(out) :: rounding
    real(wp) :: stiffness(size(solver%structure%mass, 1), size(solver%structure%mass, 1)), motion(size(stiffness, 1), 1), share
    integer :: info

    rounding = 0.0_wp
    if (allocated(solver%structure%sector) .or. solver%context%balance%free%leaves_motion) return
    stiffness = solver%structure%stiffness
    call factor_positive(stiffness, info)
    if (info /= 0) return
    motion(:, 1) = matmul(solver%structure%static_loads, factors)
    call solve_positive(stiffness, motion)
    associate (context => solver%context)
      share = norm2(matmul(motion(:, 1), solver%contacts%directions))/context%motion_scale
      rounding = last_digits*share
      if (share <= 1.0_wp) return
      context%motion_scale = share*context%motion_scale
      context%tolerance = max(context%tolerance, min(rounding, most_rounding))/share
      call context%forget()
    end associate
  end subroutine scale_by_structure

  !> What is said where rounding leaves no equilibrium.
  function too_stiff(rounding) result(text)
    !> See `scale_by_structure`
    real(wp), intent(in) :: rounding
    character(:), allocatable :: text
    character(12) :: number

    write (number, '(es8.1)') rounding
    text = ': contacts are so much stiffer than the structure that rounding may hide '//trim(adjustl(number))//' of their forces'// &
           ' (give them less normal_stiffness and tangential_stiffness)'
  end function too_stiff

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
end module attrito_solve_static_path
