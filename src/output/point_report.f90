!> What is reported of one solved point: its outcome, its monitors over the period, and how wrong they may be.
module attrito_output_point_report
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: extrema
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_accuracy_point_errors, only: point_errors_type
  use attrito_continuation_curve_point, only: curve_point_type
  use attrito_newton_newton, only: newton_report_type
  use attrito_solve_solver, only: accepted_defect, solver_type
  use attrito_contact_state, only: state_stuck, state_open
  use attrito_output_findings, only: findings_type
  implicit none
  private
  public :: point_report_type, report_point, monitored

  type :: point_report_type
    real(wp) :: frequency_hz = 0.0_wp, level = 1.0_wp
    integer :: branch = 0, iterations = 0, linear_iterations = 0
    !> What the outcome follows from
    type(findings_type) :: findings
    !> 1 yes, 0 no, -1 not examined
    integer :: unique = 0
    !> Norm of the residual relative to the stuck response
    real(wp) :: residual = 0.0_wp
    !> Estimated relative errors of the amplitude
    type(point_errors_type) :: errors
    !> Harmonics and samples of the balance
    integer :: series = 0, samples = 0
    !> PETSc's code of an error that left the session useless; 0: none
    integer :: petsc_error = 0
    !> Floating-point operations of the session so far, by formulas, over all ranks
    real(wp) :: work = 0.0_wp
    !> Coefficients of the monitors [2 H + 1, monitors]; half their range over the period, and mean
    real(wp), allocatable :: harmonics(:, :), amplitude(:), mean(:)
    !> Contacts in each state, over all ranks
    integer :: states(state_stuck:state_open) = 0
    !> Of a sweep: the point of the drawn curve, if known, and the length along it from the first point of the branch
    type(curve_point_type) :: curve
    real(wp) :: path = 0.0_wp
  contains
    procedure :: take_curve
  end type point_report_type

contains

  !> Report the solver's present point.
  subroutine report_point(solver, ended, branch, errors, tolerance, report)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> How the search for this point ended
    type(newton_report_type), intent(in) :: ended
    !> Number of the branch
    integer, intent(in) :: branch
    !> Estimated for this point
    type(point_errors_type), intent(in) :: errors
    !> Relative error of the amplitude that was promised, or `no_tolerance`
    real(wp), intent(in) :: tolerance
    !> What is reported of a point
    type(point_report_type), intent(out) :: report
    real(wp) :: range(2)
    integer :: i

    associate (balance => solver%context%balance, monitors => solver%context%balance%monitors%number())
      report%frequency_hz = solver%omega/two_pi
      report%level = balance%level
      report%branch = branch
      report%iterations = ended%iterations
      report%linear_iterations = ended%linear_iterations
      report%residual = ended%residual
      report%harmonics = monitored(balance, merge(balance%highest_load(), balance%receptance%harmonics, solver%all_stick))
      allocate (report%amplitude(monitors))
      do i = 1, monitors
        range = extrema(report%harmonics(:, i))
        report%amplitude(i) = 0.5_wp*(range(2) - range(1))
      end do
      report%mean = report%harmonics(1, :)
      call count_states(balance, report)
      report%findings%solved = ended%converged .and. is_finite(report)
      report%findings%settled = ended%defect <= accepted_defect
      report%findings%within_tolerance = errors%are_within(tolerance)
      report%findings%no_periodic_solution = solver%evidence%no_periodic_solution
      report%errors = errors
      report%series = solver%options%harmonics
      report%samples = solver%options%samples
      report%petsc_error = solver%context%petsc_error
      report%work = balance%work
      call balance%ranks%sum(report%work)
    end associate
  end subroutine report_point

  !> A point of a sweep lies on the drawn curve.
  pure subroutine take_curve(self, curve, path)
    class(point_report_type), intent(inout) :: self
    !> Point of the drawn curve, if known
    type(curve_point_type), intent(in) :: curve
    !> Length along it from the first point of the branch
    real(wp), intent(in) :: path

    self%curve = curve
    self%path = path
  end subroutine take_curve

  !> Is everything that is reported of the point a finite number?
  pure logical function is_finite(report)
    !> What is reported of a point
    type(point_report_type), intent(in) :: report

    is_finite = ieee_is_finite(report%residual) .and. all(ieee_is_finite(report%harmonics)) &
                .and. all(ieee_is_finite(report%amplitude)) .and. all(ieee_is_finite(report%mean))
  end function is_finite

  !> Coefficients of monitors [2 H + 1, monitors], those beyond a harmonic being zero.
  pure function monitored(balance, highest) result(harmonics)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Highest harmonic
    integer, intent(in) :: highest
    real(wp) :: harmonics(balance%coefficients(), balance%monitors%number())
    complex(wp) :: coefficient
    integer :: h, m

    harmonics = 0.0_wp
    do m = 1, size(harmonics, 2)
      do h = 0, highest
        coefficient = balance%monitors%row_at(m, h, balance%response(:, h))
        harmonics(max(2*h, 1), m) = real(coefficient, wp)
        if (h > 0) harmonics(2*h + 1, m) = -aimag(coefficient)
      end do
    end do
  end function monitored

  !> Contacts in each state, and whether every one of them forgets its history.
  subroutine count_states(balance, report)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> What is reported of a point
    type(point_report_type), intent(inout) :: report
    real(wp) :: counts(state_stuck:state_open + 1)
    integer :: i

    counts = 0.0_wp
    do i = 1, size(balance%forces)
      associate (forces => balance%forces(i))
        counts(forces%state) = counts(forces%state) + 1.0_wp
        if (.not. forces%unique) counts(state_open + 1) = counts(state_open + 1) + 1.0_wp
      end associate
    end do
    call balance%ranks%sum(counts)
    report%states = nint(counts(:state_open))
    report%unique = merge(1, 0, nint(counts(state_open + 1)) == 0)
    ! A frozen mean is one of many that the load path could have left.
    if (allocated(balance%frozen_mean)) report%unique = -1
  end subroutine count_states
end module attrito_output_point_report
