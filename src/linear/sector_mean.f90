!> What the mean of a sector sees: a structure by itself, all sectors alike, the upper boundary tied to the lower one.
!>
!> $$ K_0 = S_0^T K S_0, \qquad B_0 = (B + B_{next}) S_0 $$
!>
!> in the coordinates that move: of a node on the axis, along it.
module attrito_linear_sector_mean
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contacts_type, new_contacts
  use attrito_model_structure, only: structure_type, damping_viscous
  implicit none
  private
  public :: mean_of_sector

contains

  !> Structure and contacts at nodal diameter 0; of a structure that is no sector, themselves. Harmonic loads but their mean mean
  !> nothing there.
  subroutine mean_of_sector(structure, contacts, mean, mean_contacts)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> The same in the coordinates x that move at nodal diameter 0
    type(structure_type), intent(out) :: mean
    type(contacts_type), intent(out) :: mean_contacts
    real(wp), allocatable :: rows(:, :)
    integer, allocatable :: moving(:)

    mean = structure
    mean_contacts = contacts
    if (.not. allocated(structure%sector)) return
    deallocate (mean%sector)
    associate (sector => structure%sector)
      moving = sector%moving(0)
      mean%mass = coupled(structure%mass)
      mean%stiffness = coupled(structure%stiffness)
      if (structure%damping_kind == damping_viscous) mean%damping = coupled(structure%damping)
      mean%static_loads = folded(structure%static_loads)
      mean%harmonic_load = folded(structure%harmonic_load)
      mean%monitors = folded(structure%monitors)
      rows = sector%mean_rows(contacts%directions)
    end associate
    mean_contacts = new_contacts(contacts%law, rows(moving, :))

  contains

    !> S_0^T A S_0.
    pure function coupled(matrix)
      !> A [m, m]
      real(wp), intent(in) :: matrix(:, :)
      real(wp), allocatable :: coupled(:, :)

      coupled = real(structure%sector%couple(matrix, 0), wp)
      coupled = coupled(moving, moving)
    end function coupled

    !> S_0^T of columns.
    pure function folded(columns)
      !> [m, columns]
      real(wp), intent(in) :: columns(:, :)
      real(wp), allocatable :: folded(:, :)

      folded = real(structure%sector%project(cmplx(columns, kind=wp), 0), wp)
      folded = folded(moving, :)
    end function folded
  end subroutine mean_of_sector
end module attrito_linear_sector_mean
