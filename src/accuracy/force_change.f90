!> What a small force beside the loads would change of a point, to first order:
!>
!> $$ (I + R D) \, \delta d + b \, \delta\omega = B \tilde Z^{-1} \phi, \qquad
!>    \delta q = \tilde Z^{-1} (\phi - B^T D \, \delta d) + \frac{\partial q}{\partial\omega} \delta\omega $$
!>
!> The equation that picked the point holds, the frequency or a plane across the branch. With phi the residual of a better model at
!> the point, delta q is the point's error.
module attrito_accuracy_force_change
  use attrito_core_kinds, only: wp
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_newton_linearised_step, only: change_of_deviation
  use attrito_accuracy_amplitude_change, only: relative_change
  use attrito_accuracy_finer_balance, only: solve_for_estimate
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: change_by_force, respond_to_force

contains

  !> The relative change of the monitors' amplitudes by a force.
  subroutine change_by_force(solver, force, change, status)
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> Fourier coefficients on the model's coordinates [m, 2 H + 1]
    real(wp), intent(in) :: force(:, :)
    !> Relative change of the amplitudes, the largest
    real(wp), intent(out) :: change
    !> 0, or not: the linearised step is singular
    integer, intent(out) :: status
    complex(wp), allocatable :: response(:, :)

    change = 0.0_wp
    call respond_to_force(solver, force, response, status)
    if (status /= 0) return
    associate (balance => solver%context%balance)
      change = relative_change(balance%monitors%motion_of(balance%response), balance%monitors%motion_of(response))
    end associate
  end subroutine change_by_force

  !> The response to a force beside the loads, with that to the loads themselves.
  subroutine respond_to_force(solver, force, response, status)
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> Fourier coefficients on the model's coordinates [m, 2 H + 1]
    real(wp), intent(in) :: force(:, :)
    !> x_h, by harmonic [n, 0:H]
    complex(wp), allocatable, intent(out) :: response(:, :)
    !> 0, or not: the linearised step is singular
    integer, intent(out) :: status
    type(unknowns_type) :: right, moved
    complex(wp), allocatable :: added(:, :), part(:, :)

    associate (balance => solver%context%balance)
      ! A stuck response is known without an evaluation.
      if (solver%all_stick) then
        call balance%evaluate(solver%motion, solver%omega, status)
        if (status /= 0) return
      end if
      allocate (added, part, mold=balance%response)
      call balance%receptance%respond(balance%receptance%project_loads(force), added)
      if (allocated(balance%frozen_mean)) added(:, 0) = 0.0_wp
      right = unknowns_type(balance%recover(added), 0.0_wp*balance%slider)
      call solve_for_estimate(solver, right, moved, status)
      if (status /= 0) return
      call balance%respond_to_deviation(change_of_deviation(balance, right, moved), part)
      added = added + part
      call balance%receptance%respond_derivative(balance%response, part)
      ! Its bounds are the balance's, of harmonics from 0 on.
      allocate (response, source=balance%response)
      response = response + added + moved%omega*part
    end associate
  end subroutine respond_to_force
end module attrito_accuracy_force_change
