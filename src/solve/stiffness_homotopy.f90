!> Homotopy in the stiffness of the contacts, for points that no start leads to because contacts are stiff: they touch for so small a
!> part of the period that Newton's method converges only from very near,
!>
!> $$ k_n(t) = \epsilon^{1 - t} k_n, \qquad k_t(t) = \epsilon^{1 - t} k_t, \qquad t = 0 \dots 1. $$
!>
!> Every stiffness has a stuck system of its own; the motion is handed on from one to the next. Motion in time of the contacts as they
!> are may lead to a solution with softer ones.
module attrito_solve_stiffness_homotopy
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contacts_type, new_contacts
  use attrito_newton_newton, only: newton_report_type
  use attrito_balance_stuck_response, only: linear_motion
  use attrito_solve_solver, only: solver_type, new_solver
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  use attrito_solve_time_integration_start, only: has_time_integrator, solve_from_time_integration
  use attrito_solve_homotopy, only: follow_homotopy, homotopy_type
  implicit none
  private
  public :: can_soften, solve_by_stiffness

  !> Of the softest contacts: the first that a start leads to a solution of
  real(wp), parameter :: softest(2) = [1.0e-2_wp, 1.0e-4_wp] ! guess
  !> Steps over a hundredth, iterations after which it is given up, and coordinates beyond which it is not begun: each step
  !> diagonalises a stuck system
  integer, parameter :: steps = 4, most_iterations = 200, most_coordinates = 300 ! guess
  !> Starts of the softest contacts: the solver's motion, their stuck response, the motion in time of the contacts as they are
  integer, parameter :: from_here = 1, from_stuck_response = 2, from_time_integration = 3

  type, extends(homotopy_type) :: stiffness_homotopy_type
    real(wp) :: omega = 0.0_wp, softest = 1.0_wp
  contains
    procedure :: solve => solve_softened
  end type stiffness_homotopy_type

contains

  !> Is the structure small enough? A mean that is frozen belongs to one stiffness.
  pure logical function can_soften(solver)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    can_soften = .not. solver%options%uncoupled .and. size(solver%structure%mass, 1) <= most_coordinates
  end function can_soften

  !> From soft contacts to the contacts as they are.
  subroutine solve_by_stiffness(solver, omega, iterations, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged
    real(wp), allocatable :: motion(:, :)
    integer :: i, start

    motion = solver%motion
    do i = 1, size(softest)
      do start = from_here, merge(from_time_integration, from_stuck_response, has_time_integrator(solver))
        solver%motion = motion
        call solve_at_part(solver, omega, softest(i), start, converged)
        iterations = iterations + solver%report%iterations
        if (.not. converged) cycle
        call follow_homotopy(stiffness_homotopy_type(omega, softest(i)), solver, iterations, converged, 1.0_wp/(i*steps), &
                             most_iterations)
        if (converged) return
      end do
    end do
  end subroutine solve_by_stiffness

  subroutine solve_softened(self, solver, t, converged)
    class(stiffness_homotopy_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Parameter of the homotopy, 0 to 1
    real(wp), intent(in) :: t
    !> Did the solve converge?
    logical, intent(out) :: converged

    if (t < 1.0_wp) then
      call solve_at_part(solver, self%omega, self%softest**(1.0_wp - t), from_here, converged)
    else
      call solver%solve_at(self%omega)
      converged = solver%report%converged
    end if
  end subroutine solve_softened

  !> Solve with softer contacts; the solver takes the motion, its sliders do not change.
  subroutine solve_at_part(solver, omega, factor, start, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s; part of the contact stiffness
    real(wp), intent(in) :: omega, factor
    !> One of `from_...`
    integer, intent(in) :: start
    !> Did the solve converge?
    logical, intent(out) :: converged
    type(solver_type) :: softer
    type(strategy_outcome_type) :: outcome
    integer :: status

    solver%report = newton_report_type()
    call soften(solver, factor, softer, converged)
    if (converged) call softer%context%balance%receptance%set_frequency(omega, status)
    if (converged) converged = status == 0
    if (converged) then
      call softer%set_scales(omega, omega)
      if (start == from_stuck_response) softer%motion = linear_motion(softer%context%balance)
      if (start == from_time_integration) then
        allocate (softer%time_integrator, source=solver%time_integrator)
        call solve_from_time_integration(softer, omega, evidence_type(), outcome)
        converged = outcome%converged
        solver%report%iterations = outcome%iterations
      else
        call softer%solve_at(omega)
        converged = softer%report%converged
        solver%report%iterations = softer%report%iterations
      end if
      if (converged) solver%motion = softer%motion
    end if
    if (associated(softer%context)) then
      if (softer%context%petsc_error /= 0) solver%context%petsc_error = softer%context%petsc_error
    end if
    call softer%destroy()
  end subroutine solve_at_part

  !> The same solver with softer contacts, at the same motion, sliders and loads.
  subroutine soften(solver, factor, softer, done)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Part of the contact stiffness
    real(wp), intent(in) :: factor
    !> Solver of points, which this moves
    type(solver_type), intent(out) :: softer
    !> Was it set up?
    logical, intent(out) :: done
    type(contacts_type) :: contacts
    type(error_type), allocatable :: error

    contacts = solver%contacts
    contacts%law%normal_stiffness = factor*contacts%law%normal_stiffness
    contacts%law%tangential_stiffness = factor*contacts%law%tangential_stiffness
    contacts = new_contacts(contacts%law, contacts%directions)
    associate (balance => solver%context%balance)
      call new_solver(solver%structure, contacts, balance%team, solver%options, softer, error)
      done = .not. allocated(error)
      if (.not. done) return
      call softer%hold_contacts(balance%first_contact, balance%first_contact + size(balance%law) - 1)
      call softer%set_loads(balance%static_factors, balance%level)
      softer%motion = solver%motion
      softer%static_slider = solver%static_slider
      softer%omega = solver%omega
      call softer%set_slider(balance%slider, balance%periodic)
    end associate
  end subroutine soften
end module attrito_solve_stiffness_homotopy
