!> What the structure's own damping C takes of free vibration, as the damping ratio that would take as much:
!>
!> $$ \zeta = \sum_h h^2 X_h^H C X_h / (2 \omega T), \qquad T = \sum_h h^2 X_h^H M X_h. $$
!>
!> Source: Krack 2015, doi:10.1016/j.compstruc.2015.02.037.
module attrito_peak_structural_damping
  use attrito_core_kinds, only: wp
  use attrito_linear_damping, only: damping_of_harmonic
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: kinetic_sum, structural_ratio

contains

  !> T where the solver stands.
  real(wp) function kinetic_sum(solver)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    complex(wp), allocatable :: inertia(:, :)
    integer :: h

    associate (balance => solver%context%balance)
      allocate (inertia, mold=balance%response)
      call balance%receptance%inertia_of(balance%response, inertia)
      kinetic_sum = sum([(h**2*real(sum(conjg(balance%response(:, h))*inertia(:, h)), wp), h=1, ubound(inertia, 2))])
    end associate
  end function kinetic_sum

  !> zeta.
  real(wp) function structural_ratio(solver, kinetic) result(ratio)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> T
    real(wp), intent(in) :: kinetic
    real(wp), allocatable :: coordinates(:, :)
    integer :: h

    associate (balance => solver%context%balance)
      coordinates = transpose(balance%receptance%displacements(balance%response))
      ratio = 0.0_wp
      do h = 1, ubound(balance%response, 2)
        ratio = ratio + h**2*damping_of_harmonic(solver%structure, solver%stuck, h, &
                                                 cmplx(coordinates(:, 2*h), -coordinates(:, 2*h + 1), wp), h*solver%omega)
      end do
    end associate
    ratio = ratio/(2.0_wp*solver%omega*kinetic)
  end function structural_ratio
end module attrito_peak_structural_damping
