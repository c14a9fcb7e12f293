!> Modes of the stuck wheel by nodal diameter, in a time that the fastest mode sets:
!>
!> $$ \ddot x_r + d_r \dot x_r + \lambda_r x_r = (B S_n \phi_r)^H f, \qquad n = 0 \ldots N/2, $$
!>
!> S_n taking a sector's coordinates to those that its boundaries leave at the nodal diameter n (`attrito_linear_diameter_modes`).
module attrito_stability_wheel_modes
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contacts_type
  use attrito_model_structure, only: structure_type, damping_viscous
  use attrito_linear_diameter_modes, only: diameter_modes_type, new_diameter_modes
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: wave_modes_type, wheel_modes_type, new_wheel_modes, most_of_a_diameter

  !> Modes of the stuck wheel at one nodal diameter, normalised by mass, in a time that the fastest mode sets
  type :: wave_modes_type
    !> Squares of frequencies, and damping [n]
    real(wp), allocatable :: eigenvalues(:), damping(:)
    !> What damping couples of the modes, with its diagonal [n, n]; not allocated if nothing
    complex(wp), allocatable :: coupling(:, :)
    !> Rows of B in columns [n, rows]
    complex(wp), allocatable :: rows(:, :)
  end type wave_modes_type

  type :: wheel_modes_type
    !> N and EO
    integer :: sectors = 1, engine_order = 0
    !> Laws, springs and clock of the sector: it has no modes in common
    type(system_type) :: contacts
    !> By nodal diameter [0:N/2]; beyond they are conjugates
    type(wave_modes_type), allocatable :: diameters(:)
  end type wheel_modes_type

contains

  !> Diagonalise all nodal diameters of the stuck wheel.
  subroutine new_wheel_modes(structure, contacts, self, status)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    type(wheel_modes_type), intent(out) :: self
    !> 0, or not: a nodal diameter is not held
    integer, intent(out) :: status
    type(diameter_modes_type), allocatable :: modes(:)
    integer :: n

    associate (sector => structure%sector)
      self%sectors = sector%sectors
      self%engine_order = sector%engine_order
      allocate (modes(0:self%sectors/2), self%diameters(0:self%sectors/2))
      self%contacts%clock = 0.0_wp
      do n = 0, ubound(modes, 1)
        call new_diameter_modes(structure, contacts%directions, contacts%row_stiffness, n, .false., modes(n), status)
        if (status /= 0) return
        self%contacts%clock = max(self%contacts%clock, maxval(modes(n)%omega))
      end do
      self%contacts%law = contacts%law
      self%contacts%springs = contacts%row_stiffness
      do n = 0, ubound(modes, 1)
        self%diameters(n) = wave_modes(structure, contacts, modes(n), n, self%contacts%clock)
      end do
    end associate
  end subroutine new_wheel_modes

  !> One nodal diameter in the wheel's clock.
  pure function wave_modes(structure, contacts, modes, diameter, clock) result(self)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Modes of the stuck system
    type(diameter_modes_type), intent(in) :: modes
    !> Nodal diameter
    integer, intent(in) :: diameter
    !> Units of time per second
    real(wp), intent(in) :: clock
    type(wave_modes_type) :: self
    complex(wp), allocatable :: shapes(:, :)
    integer :: r

    associate (n => modes%count, sector => structure%sector)
      self%eigenvalues = (modes%omega(:n)/clock)**2
      self%damping = modes%modal_damping(:n)/modes%modal_mass(:n)/clock
      shapes = modes%modes(:, :n)/spread(sqrt(modes%modal_mass(:n)), 1, size(modes%modes, 1))
      ! A unit of force accelerates by the clock's square less.
      self%rows = matmul(conjg(transpose(shapes)), sector%project_rows(contacts%directions, diameter))/clock
      if (structure%damping_kind == damping_viscous) self%coupling = in_shapes(structure%damping)
      if (allocated(structure%gyroscopic)) then
        if (.not. allocated(self%coupling)) then
          allocate (self%coupling(n, n), source=(0.0_wp, 0.0_wp))
          do r = 1, n
            self%coupling(r, r) = self%damping(r)
          end do
        end if
        self%coupling = self%coupling + in_shapes(structure%gyroscopic)
      end if
    end associate

  contains

    !> Phi^H S^H A S Phi in the clock's time [n, n].
    pure function in_shapes(matrix) result(coupled)
      !> A, of the sector's coordinates [m, m]
      real(wp), intent(in) :: matrix(:, :)
      complex(wp), allocatable :: coupled(:, :)

      coupled = matmul(conjg(transpose(shapes)), matmul(structure%sector%couple(matrix, diameter), shapes))/clock
    end function in_shapes
  end function wave_modes

  !> Modes of the nodal diameter that has most.
  pure integer function most_of_a_diameter(wheel) result(most)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    integer :: n

    most = maxval([(size(wheel%diameters(n)%eigenvalues), n=0, ubound(wheel%diameters, 1))])
  end function most_of_a_diameter
end module attrito_stability_wheel_modes
