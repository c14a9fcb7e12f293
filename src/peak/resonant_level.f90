!> Level of the loads that keep up a motion of free vibration, and the damping that takes their work.
!>
!> Negative damping -xi M q' feeds as much work into a period as loads F_1 in quadrature with the motion do at the level
!>
!> $$ L = \xi \omega T / |X_1^H F_1|, \qquad T = \sum_h h^2 X_h^H M X_h $$
!>
!> The structure's own damping C takes of it what a damping ratio does,
!>
!> $$ \zeta = \sum_h h^2 X_h^H C X_h / (2 \omega T). $$
!>
!> Source: Krack 2015, doi:10.1016/j.compstruc.2015.02.037.
module attrito_peak_resonant_level
  use attrito_core_kinds, only: wp
  use attrito_linear_damping, only: damping_of_harmonic
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: kinetic_sum, resonant_level, structural_ratio

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

  !> L; 0 where the loads do no work.
  real(wp) function resonant_level(solver, excitation, kinetic, force) result(level)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> xi; T
    real(wp), intent(in) :: excitation, kinetic
    !> F_1 in generalised coordinates [n]
    complex(wp), intent(in) :: force(:)
    real(wp) :: work

    work = abs(sum(conjg(solver%context%balance%response(:, 1))*force))
    level = 0.0_wp
    if (work > 0.0_wp) level = excitation*solver%omega*kinetic/work
  end function resonant_level

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
end module attrito_peak_resonant_level
