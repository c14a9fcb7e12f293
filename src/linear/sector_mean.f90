!> What the mean of a sector sees: a structure by itself, all sectors alike, the upper boundary tied to the lower one.
!>
!> $$ K_0 = S_0^T K S_0, \qquad B_0 = (B + B_{next}) S_0 $$
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
    !> The same in the coordinates without the upper boundary
    type(structure_type), intent(out) :: mean
    type(contacts_type), intent(out) :: mean_contacts

    mean = structure
    mean_contacts = contacts
    if (.not. allocated(structure%sector)) return
    deallocate (mean%sector)
    associate (sector => structure%sector)
      mean%mass = real(sector%couple(structure%mass, 0), wp)
      mean%stiffness = real(sector%couple(structure%stiffness, 0), wp)
      if (structure%damping_kind == damping_viscous) mean%damping = real(sector%couple(structure%damping, 0), wp)
      mean%static_loads = folded(structure%static_loads)
      mean%harmonic_load = folded(structure%harmonic_load)
      mean%monitors = folded(structure%monitors)
      mean_contacts = new_contacts(contacts%law, sector%mean_rows(contacts%directions))
    end associate

  contains

    !> S_0^T of columns.
    pure function folded(columns)
      !> [m, columns]
      real(wp), intent(in) :: columns(:, :)
      real(wp), allocatable :: folded(:, :)

      folded = real(structure%sector%project(cmplx(columns, kind=wp), 0), wp)
    end function folded
  end subroutine mean_of_sector
end module attrito_linear_sector_mean
