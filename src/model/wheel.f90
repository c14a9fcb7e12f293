!> The whole wheel that a sector is one of, its sectors tied at their boundaries: for evidence from outside the travelling wave.
!>
!> $$ K_{wheel} = \sum_j T_j K T_j^T, \qquad T_j: \text{ coordinates of sector } j \text{, its upper boundary being that of } j + 1 $$
!>
!> Coordinates and contacts are those of sector 0, 1, ..., each without its upper boundary.
module attrito_model_wheel
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_model_contacts, only: contact_type, contacts_type, new_contacts
  use attrito_model_sector, only: sector_type
  use attrito_model_structure, only: structure_type, damping_viscous
  implicit none
  private
  public :: whole_wheel, wave_of, delayed

contains

  !> All sectors; loads are f_j(t) = f_0(t - j EO T / N), monitors those of the first.
  subroutine whole_wheel(structure, contacts, wheel, wheel_contacts)
    !> The sector: mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts of the sector
    type(contacts_type), intent(in) :: contacts
    type(structure_type), intent(out) :: wheel
    type(contacts_type), intent(out) :: wheel_contacts
    type(contact_type), allocatable :: law(:)
    real(wp), allocatable :: rows(:, :), load(:, :)
    integer, allocatable :: at(:), next(:)
    integer :: i, j, n, row

    associate (sector => structure%sector)
      n = sector%sectors*size(sector%kept)
      allocate (wheel%mass(n, n), wheel%stiffness(n, n), wheel%static_loads(n, size(structure%static_loads, 2)), &
                wheel%harmonic_load(n, size(structure%harmonic_load, 2)), wheel%monitors(n, size(structure%monitors, 2)), &
                rows(n, sector%sectors*size(contacts%directions, 2)), source=0.0_wp)
      wheel%damping_kind = structure%damping_kind
      wheel%damping_value = structure%damping_value
      if (structure%damping_kind == damping_viscous) allocate (wheel%damping, source=wheel%mass)
      allocate (law(0))
      do j = 0, sector%sectors - 1
        at = coordinates_of(sector, j)
        next = coordinates_of(sector, j + 1)
        call add(wheel%mass, structure%mass, at)
        call add(wheel%stiffness, structure%stiffness, at)
        if (allocated(wheel%damping)) call add(wheel%damping, structure%damping, at)
        load = transpose(delayed(sector, transpose(structure%harmonic_load), j))
        row = j*size(contacts%directions, 2)
        do i = 1, size(at)
          wheel%static_loads(at(i), :) = wheel%static_loads(at(i), :) + structure%static_loads(i, :)
          wheel%harmonic_load(at(i), :) = wheel%harmonic_load(at(i), :) + load(i, :)
          if (j == 0) wheel%monitors(at(i), :) = wheel%monitors(at(i), :) + structure%monitors(i, :)
          associate (own => rows(:, row + 1:row + size(contacts%directions, 2)))
            own(at(i), :) = own(at(i), :) + contacts%directions(i, :)
            own(next(i), :) = own(next(i), :) + sector%next(i, :)
          end associate
        end do
        law = [law, contacts%law]
      end do
    end associate
    wheel_contacts = new_contacts(law, rows)
  end subroutine whole_wheel

  !> Where a sector's coordinates are among the wheel's [m].
  pure function coordinates_of(sector, number) result(at)
    type(sector_type), intent(in) :: sector
    !> Of the sector, from 0; N is 0 again
    integer, intent(in) :: number
    integer :: at(size(sector%position))

    at = modulo(number + sector%of_next, sector%sectors)*size(sector%kept) + sector%position
  end function coordinates_of

  !> Add a sector's matrix.
  pure subroutine add(matrix, part, at)
    !> Of the wheel
    real(wp), intent(inout) :: matrix(:, :)
    !> Of the sector
    real(wp), intent(in) :: part(:, :)
    !> Where its coordinates are
    integer, intent(in) :: at(:)
    integer :: i, j

    do j = 1, size(at)
      do i = 1, size(at)
        matrix(at(i), at(j)) = matrix(at(i), at(j)) + part(i, j)
      end do
    end do
  end subroutine add

  !> Series x(t - j EO T / N) [2 H + 1, columns].
  pure function delayed(sector, series, number) result(turned)
    type(sector_type), intent(in) :: sector
    !> Coefficients [2 H + 1, columns]
    real(wp), intent(in) :: series(:, :)
    !> j
    integer, intent(in) :: number
    real(wp) :: turned(size(series, 1), size(series, 2))
    complex(wp) :: columns(size(series, 2), 0:(size(series, 1) - 1)/2)
    integer :: h

    columns = to_complex(series)
    do h = 1, ubound(columns, 2)
      columns(:, h) = sector%phase_factor(modulo(number*sector%diameter(h), sector%sectors))*columns(:, h)
    end do
    turned = to_real(columns)
  end function delayed

  !> Series of all sectors in the wave, sector by sector [2 H + 1, N columns].
  pure function wave_of(sector, series) result(all)
    type(sector_type), intent(in) :: sector
    !> Of the first sector [2 H + 1, columns]
    real(wp), intent(in) :: series(:, :)
    real(wp) :: all(size(series, 1), sector%sectors*size(series, 2))
    integer :: j

    do j = 0, sector%sectors - 1
      all(:, j*size(series, 2) + 1:(j + 1)*size(series, 2)) = delayed(sector, series, j)
    end do
  end function wave_of
end module attrito_model_wheel
