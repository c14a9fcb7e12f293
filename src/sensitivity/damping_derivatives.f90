!> What a change of the structure's damping adds to the loads, at the response as it is:
!>
!> $$ f'_h = -i h \omega C' q_h, \qquad C' = M, \; K, \; \sum_r 2 \omega_r M x_r x_r^T M \; (x_r^T M x_r = 1), \; K / (h \omega) $$
!>
!> by Rayleigh's alpha and beta, a ratio of the stuck modes x_r, and a loss factor. The last is as large at all harmonics above 0.
module attrito_sensitivity_damping_derivatives
  use attrito_core_kinds, only: wp
  use attrito_linear_stuck_system, only: stuck_system_type
  use attrito_model_structure, only: structure_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: damping_numbers, by_alpha, by_beta, by_ratio, by_loss_factor, damping_load, viscous, damping_product

  !> Numbers of damping, in this order
  integer, parameter :: damping_numbers = 4
  integer, parameter :: by_alpha = 1, by_beta = 2, by_ratio = 3, by_loss_factor = 4

contains

  !> f' of a response in generalised coordinates [n, 0:H].
  function damping_load(solver, rates, response) result(load)
    !> Solver of points: structure, stuck system, and balance at its frequency
    type(solver_type), intent(in) :: solver
    !> Of the numbers of damping [damping_numbers]
    real(wp), intent(in) :: rates(:)
    !> X [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp) :: load(size(response, 1), 0:ubound(response, 2))
    integer :: h

    load = 0.0_wp
    if (.not. any(abs(rates) > 0.0_wp)) return
    associate (receptance => solver%context%balance%receptance)
      do h = 1, ubound(response, 2)
        load(:, h) = receptance%project_load(h, -(0.0_wp, 1.0_wp)*h*receptance%omega* &
                                             damping_product(solver%structure, solver%stuck, rates, &
                                                             receptance%recover(h, response(:, h)), h*receptance%omega))
      end do
    end associate
  end function damping_load

  !> Of the numbers of damping those whose load f' is in proportion to omega: all but the loss factor.
  pure function viscous(rates)
    !> [damping_numbers]
    real(wp), intent(in) :: rates(:)
    real(wp) :: viscous(size(rates))

    viscous = rates
    viscous(by_loss_factor) = 0.0_wp
  end function viscous

  !> C' q of a motion Re q exp(i Omega t) of the model's coordinates [m].
  function damping_product(structure, stuck, rates, displacement, frequency) result(product)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    !> Of the numbers of damping [damping_numbers]
    real(wp), intent(in) :: rates(:)
    !> q, of the model's coordinates [m]
    complex(wp), intent(in) :: displacement(:)
    !> Omega
    real(wp), intent(in) :: frequency
    complex(wp) :: product(size(displacement))
    real(wp) :: by_stiffness

    product = 0.0_wp
    if (abs(rates(by_alpha)) > 0.0_wp) product = product + rates(by_alpha)*matmul(structure%mass, displacement)
    by_stiffness = rates(by_beta) + rates(by_loss_factor)/frequency
    if (abs(by_stiffness) > 0.0_wp) product = product + by_stiffness*matmul(structure%stiffness, displacement)
    if (.not. abs(rates(by_ratio)) > 0.0_wp) return
    associate (coordinates => matmul(transpose(stuck%modes), matmul(structure%mass, displacement))/stuck%modal_mass, &
               damping => 2.0_wp*sqrt(stuck%modal_stiffness/stuck%modal_mass))
      product = product + rates(by_ratio)*matmul(structure%mass, matmul(stuck%modes, damping*coordinates))
    end associate
  end function damping_product
end module attrito_sensitivity_damping_derivatives
