!> The relative error of a point of a mode by its series, estimated as that of a forced point is.
!>
!> A finer balance, omega and xi held, moves the coordinate c(X_1) that is to be a (`attrito_accuracy_error_estimate`). Newton's step
!>
!> $$ \frac{\partial c}{\partial\omega} \delta\omega + \frac{\partial c}{\partial\xi} \delta\xi = a - c(\tilde X_1) $$
!>
!> takes it back; the motion goes with it. The error is the largest of |delta omega|/omega, |delta xi|/xi and what the monitors change
!> by, of a first step and of the second that checks it. Where the structure's damping feeds the mode xi may vanish, but not the
!> contacts' part of it: |delta xi| is measured against the larger of both.
module attrito_peak_mode_error
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  use attrito_accuracy_amplitude_change, only: relative_change
  use attrito_accuracy_error_estimate, only: error_estimate_type, own_monitors
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_accuracy_point_errors, only: point_errors_type, no_tolerance
  use attrito_accuracy_second_step, only: second_step_type
  use attrito_solve_solver, only: solver_type
  use attrito_peak_backbone_point, only: backbone_type
  use attrito_peak_condition, only: direction_type
  implicit none
  private
  public :: estimate_mode_errors

  !> Damping ratios below this are measured against it: what hardly dissipates has no relative error
  real(wp), parameter :: least_damping = 1.0e-6_wp ! conventional

contains

  !> Errors of the point of a mode at which the solver is, by harmonics; NaN where they are not known, as where
  !> sliders creep. None where every
  !> contact sticks: that is linear.
  subroutine estimate_mode_errors(estimator, solver, backbone, errors)
    !> Finer balances, from one point to the next
    type(error_estimate_type), intent(inout) :: estimator
    !> Solver of points, at the mode's last one
    type(solver_type), intent(inout) :: solver
    !> The mode
    type(backbone_type), intent(in) :: backbone
    !> By harmonics; that of the modes stays
    type(point_errors_type), intent(inout) :: errors
    type(finer_point_type) :: first
    type(second_step_type) :: second
    real(wp) :: error, again
    integer :: status

    errors%harmonics = 0.0_wp
    if (backbone%found .and. solver%all_stick) return
    error = ieee_value(error, ieee_quiet_nan)
    status = 1
    if (backbone%found .and. .not. backbone%creeps) call estimator%look_finer(solver, no_tolerance, first, second, status)
    if (status == 0) then
      error = change_of_mode(solver, backbone, first%response)
      if (allocated(second%response)) then
        again = change_of_mode(solver, backbone, second%response)
        if (again > error) error = again
      end if
    end if
    errors%harmonics = error
  end subroutine estimate_mode_errors

  !> The largest relative change of omega, xi and the monitors where a finer balance responds like this; NaN where it is not known.
  real(wp) function change_of_mode(solver, backbone, response) result(error)
    !> Solver of points, at the mode's last one
    type(solver_type), intent(inout) :: solver
    !> The mode
    type(backbone_type), intent(in) :: backbone
    !> By harmonic, omega and xi held [n, 0:K]
    complex(wp), intent(in) :: response(:, 0:)
    type(direction_type) :: ways(2*size(backbone%modes))
    complex(wp), allocatable :: moved(:, :)
    real(wp) :: change(2*size(backbone%modes)), excitation, of_structure
    integer :: i, status

    error = ieee_value(error, ieee_quiet_nan)
    call backbone%find_changes(solver, backbone%missing_in(response), ways, change, status)
    if (status /= 0) return
    associate (balance => solver%context%balance, harmonics => solver%context%balance%receptance%harmonics)
      allocate (moved(size(response, 1), 0:ubound(response, 2)), source=response)
      do i = 1, size(change)
        moved(:, :harmonics) = moved(:, :harmonics) + change(i)*ways(i)%response
      end do
      excitation = backbone%excitation + change(2)
      of_structure = 2.0_wp*backbone%structural_ratio*solver%omega
      error = max(abs(change(1))/solver%omega, &
                  abs(change(2))/max(abs(excitation), excitation - of_structure, 2.0_wp*least_damping*solver%omega), &
                  relative_change(own_monitors(solver), balance%monitors%motion_of(moved)))
    end associate
  end function change_of_mode
end module attrito_peak_mode_error
