!> What the structure's own damping takes of a motion, whatever its kind:
!>
!> $$ x^T C x, \qquad C = C, \; \alpha M, \; \sum_r 2 \zeta_r \omega_r M x_r x_r^T M \; (x_r^T M x_r = 1), \; \eta K / \Omega, $$
!>
!> x_r being the modes of the stuck system. A harmonic motion Re X exp(i Omega t) loses pi Omega (X_c^T C X_c + X_s^T C X_s) in a
!> period.
module attrito_linear_damping
  use attrito_core_kinds, only: wp
  use attrito_model_structure, only: structure_type, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_linear_stuck_system, only: stuck_system_type
  implicit none
  private
  public :: damping_form, damping_of_harmonic

contains

  !> x^T C x of each column.
  function damping_form(structure, stuck, vectors, frequency) result(form)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    !> x, in the model's coordinates, in columns [m, count]
    real(wp), intent(in) :: vectors(:, :)
    !> Angular frequency of each column's motion, which a loss factor's equivalent C depends on [count]
    real(wp), intent(in) :: frequency(:)
    real(wp) :: form(size(vectors, 2))
    real(wp), allocatable :: coordinates(:, :)

    select case (structure%damping_kind)
     case (damping_viscous)
      form = sum(vectors*matmul(structure%damping, vectors), 1)
     case (damping_mass)
      form = structure%damping_value*sum(vectors*matmul(structure%mass, vectors), 1)
     case (damping_ratio)
      coordinates = matmul(transpose(stuck%modes), matmul(structure%mass, vectors))
      form = matmul(stuck%modal_damping/stuck%modal_mass**2, coordinates**2)
     case (damping_loss_factor)
      where (frequency > 0.0_wp)
        form = structure%damping_value*sum(vectors*matmul(structure%stiffness, vectors), 1)/frequency
      else where
        form = 0.0_wp
      end where
     case default
      form = 0.0_wp
    end select
  end function damping_form

  !> q^H C q of a motion Re q exp(i Omega t) at a harmonic; of a sector, in the modes of its nodal diameter.
  real(wp) function damping_of_harmonic(structure, stuck, h, displacement, frequency) result(form)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    !> Number of the harmonic
    integer, intent(in) :: h
    !> q, of the model's coordinates [m]
    complex(wp), intent(in) :: displacement(:)
    !> Omega
    real(wp), intent(in) :: frequency
    real(wp), allocatable :: stiffness(:), mass(:), damping(:)

    if (structure%damping_kind == damping_ratio) then
      call stuck%modal_at(h, stiffness, mass, damping)
      form = sum(damping*abs(stuck%coordinates_at(structure, h, displacement))**2)
    else
      form = sum(damping_form(structure, stuck, reshape([real(displacement, wp), aimag(displacement)], [size(displacement), 2]), &
                              [frequency, frequency]))
    end if
  end function damping_of_harmonic
end module attrito_linear_damping
