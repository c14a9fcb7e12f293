!> Modes of a sector at one nodal diameter, with springs on the contacts' rows:
!>
!> $$ \tilde K_n = S_n^H K S_n + B_n^H K_s B_n, \qquad (M_n - \mu_r \tilde K_n) x_r = 0, \qquad \omega_r^2 = 1/\mu_r $$
!>
!> Normalised by stiffness, as those of a structure by itself are (`attrito_linear_stuck_system`); by mass where the springs may leave
!> motions free. Modes of N - n are the conjugates of those of n.
module attrito_linear_diameter_modes
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: hermitian_eigenpairs
  use attrito_model_sector, only: sector_type
  use attrito_model_structure, only: structure_type, damping_ratio, damping_mass
  implicit none
  private
  public :: diameter_modes_type, new_diameter_modes

  type :: diameter_modes_type
    !> K~_n [n, n]
    complex(wp), allocatable :: stiffness(:, :)
    !> Modes [n, n] with their stiffness, mass and damping [n]; damping 0 where it couples them
    complex(wp), allocatable :: modes(:, :)
    real(wp), allocatable :: modal_stiffness(:), modal_mass(:), modal_damping(:)
    !> Angular frequencies [n], ascending
    real(wp), allocatable :: omega(:)
  end type diameter_modes_type

contains

  !> Assemble and diagonalise one nodal diameter of a sector.
  subroutine new_diameter_modes(structure, directions, springs, diameter, may_be_free, self, status)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> Rows of B on the sector itself, in columns [m, rows], and their springs [rows]
    real(wp), intent(in) :: directions(:, :), springs(:)
    !> n
    integer, intent(in) :: diameter
    !> May the springs leave motions free?
    logical, intent(in) :: may_be_free
    type(diameter_modes_type), intent(out) :: self
    !> 0, or not: stiffness or, where they may leave motions free, mass is not positive definite
    integer, intent(out) :: status
    complex(wp), allocatable :: mass(:, :), rows(:, :), vectors(:, :)
    real(wp), allocatable :: values(:)
    integer :: n

    associate (sector => structure%sector)
      n = size(sector%kept)
      mass = sector%couple(structure%mass, diameter)
      rows = sector%project_rows(directions, diameter)
      self%stiffness = sector%couple(structure%stiffness, diameter) &
                       + matmul(rows*spread(springs, 1, n), conjg(transpose(rows)))
    end associate
    if (may_be_free) then
      call hermitian_eigenpairs(self%stiffness, mass, values, vectors, status)
      if (status /= 0) return
      self%modes = vectors
      self%modal_stiffness = max(values, 0.0_wp)
      allocate (self%modal_mass(n), source=1.0_wp)
    else
      call hermitian_eigenpairs(mass, self%stiffness, values, vectors, status)
      if (status /= 0) return
      self%modes = vectors(:, n:1:-1)
      self%modal_mass = max(values(n:1:-1), tiny(1.0_wp))
      allocate (self%modal_stiffness(n), source=1.0_wp)
    end if
    self%omega = sqrt(self%modal_stiffness/self%modal_mass)
    allocate (self%modal_damping(n), source=0.0_wp)
    if (structure%damping_kind == damping_ratio) self%modal_damping = 2.0_wp*structure%damping_value &
                                                                      *sqrt(self%modal_mass*self%modal_stiffness)
    if (structure%damping_kind == damping_mass) self%modal_damping = structure%damping_value*self%modal_mass
  end subroutine new_diameter_modes
end module attrito_linear_diameter_modes
