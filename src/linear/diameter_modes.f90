!> Modes of a sector at one nodal diameter, with springs on the contacts' rows:
!>
!> $$ \tilde K_n = S_n^H K S_n + B_n^H K_s B_n, \qquad (M_n - \mu_r \tilde K_n) x_r = 0, \qquad \omega_r^2 = 1/\mu_r $$
!>
!> Normalised by stiffness, as those of a structure by itself are (`attrito_linear_stuck_system`); by mass where the springs may leave
!> motions free. Modes of N - n are the conjugates of those of n. Coordinates that do not move at a nodal diameter, of nodes on the
!> axis (`attrito_model_sector`), come last: no force and no displacement has part in them, and they answer as the fastest mode does.
module attrito_linear_diameter_modes
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: hermitian_eigenpairs
  use attrito_model_sector, only: sector_type
  use attrito_model_structure, only: structure_type, damping_ratio, damping_mass, ratios_of_modes
  implicit none
  private
  public :: diameter_modes_type, new_diameter_modes, with_those_at_rest

  type :: diameter_modes_type
    !> K~_n [n, n]
    complex(wp), allocatable :: stiffness(:, :)
    !> Modes [n, n] with their stiffness, mass and damping [n]; damping 0 where it couples them
    complex(wp), allocatable :: modes(:, :)
    real(wp), allocatable :: modal_stiffness(:), modal_mass(:), modal_damping(:)
    !> Angular frequencies [n], ascending
    real(wp), allocatable :: omega(:)
    !> How many are modes: all but the last ones, of coordinates that do not move
    integer :: count = 0
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
    integer, allocatable :: moving(:)
    integer :: n

    associate (sector => structure%sector)
      moving = sector%moving(diameter)
      n = size(sector%kept)
      mass = sector%couple(structure%mass, diameter)
      rows = sector%project_rows(directions, diameter)
      self%stiffness = sector%couple(structure%stiffness, diameter) &
                       + matmul(rows*spread(springs, 1, n), conjg(transpose(rows)))
    end associate
    if (size(moving) < n) then
      n = size(moving)
      mass = mass(moving, moving)
      self%stiffness = self%stiffness(moving, moving)
    end if
    self%count = n
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
    if (structure%damping_kind == damping_ratio) self%modal_damping = 2.0_wp*ratios_of_modes(structure, n) &
                                                                      *sqrt(self%modal_mass*self%modal_stiffness)
    if (structure%damping_kind == damping_mass) self%modal_damping = structure%damping_value*self%modal_mass
    if (n < size(structure%sector%kept)) self = with_those_at_rest(self, moving, size(structure%sector%kept))
  end subroutine new_diameter_modes

  !> The same in all coordinates, those that do not move at the end.
  pure function with_those_at_rest(modes, moving, number) result(self)
    !> In the coordinates that move
    type(diameter_modes_type), intent(in) :: modes
    !> Which move, ascending; how many there are
    integer, intent(in) :: moving(:), number
    type(diameter_modes_type) :: self
    real(wp) :: spring, fastest
    integer :: i, at_end, rest

    associate (n => modes%count)
      rest = number - n
      allocate (self%stiffness(number, number), self%modes(number, number), source=(0.0_wp, 0.0_wp))
      ! As stiff as the others: a number that is no rounding beside them, nor they beside it.
      spring = maxval([0.0_wp, (real(modes%stiffness(i, i), wp), i=1, n)])
      if (spring <= 0.0_wp) spring = 1.0_wp
      fastest = maxval([0.0_wp, modes%omega])
      if (fastest <= 0.0_wp) fastest = 1.0_wp
      self%stiffness(moving, moving) = modes%stiffness
      self%modes(moving, :n) = modes%modes
      at_end = n
      do i = 1, number
        if (any(moving == i)) cycle
        at_end = at_end + 1
        self%stiffness(i, i) = spring
        self%modes(i, at_end) = 1.0_wp/sqrt(spring)
      end do
      self%modal_stiffness = [modes%modal_stiffness, spread(1.0_wp, 1, rest)]
      self%modal_mass = [modes%modal_mass, spread(1.0_wp/fastest**2, 1, rest)]
      self%modal_damping = [modes%modal_damping, spread(0.0_wp, 1, rest)]
      self%omega = [modes%omega, spread(fastest, 1, rest)]
      self%count = n
    end associate
  end function with_those_at_rest
end module attrito_linear_diameter_modes
