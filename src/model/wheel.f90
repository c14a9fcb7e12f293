!> The whole wheel that a sector is one of, its sectors tied at their boundaries: for evidence from outside the travelling wave.
!>
!> $$ K_{wheel} = \sum_j T_j K T_j^T, \qquad T_j: \text{ coordinates of sector } j \text{, its upper boundary being that of } j + 1 $$
!>
!> Coordinates and contacts are those of sector 0, 1, ..., each without its upper boundary and what it has on the axis. At the end
!> come those of nodes on the axis, once and along the axes of sector 0: sector j sees them as p_j = R^-j a, R turning by 2 pi / N.
module attrito_model_wheel
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_model_contacts, only: contact_type, contacts_type, new_contacts
  use attrito_model_sector, only: sector_type
  use attrito_model_structure, only: structure_type, damping_viscous
  implicit none
  private
  public :: whole_wheel, coordinates_of_wheel, turned_back, wave_of, delayed

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
    real(wp), allocatable :: static(:, :), here(:, :), beyond(:, :)
    integer, allocatable :: at(:), next(:)
    integer :: i, j, n, row

    associate (sector => structure%sector)
      n = coordinates_of_wheel(sector)
      allocate (wheel%mass(n, n), wheel%stiffness(n, n), wheel%static_loads(n, size(structure%static_loads, 2)), &
                wheel%harmonic_load(n, size(structure%harmonic_load, 2)), wheel%monitors(n, size(structure%monitors, 2)), &
                rows(n, sector%sectors*size(contacts%directions, 2)), source=0.0_wp)
      wheel%damping_kind = structure%damping_kind
      wheel%damping_value = structure%damping_value
      if (structure%damping_kind == damping_viscous) allocate (wheel%damping, source=wheel%mass)
      if (allocated(structure%gyroscopic)) allocate (wheel%gyroscopic, source=wheel%mass)
      allocate (law(0))
      do j = 0, sector%sectors - 1
        at = coordinates_of(sector, j)
        next = coordinates_of(sector, j + 1)
        call add(wheel%mass, along_first(sector, structure%mass, j), at)
        call add(wheel%stiffness, along_first(sector, structure%stiffness, j), at)
        if (allocated(wheel%damping)) call add(wheel%damping, along_first(sector, structure%damping, j), at)
        if (allocated(wheel%gyroscopic)) call add(wheel%gyroscopic, along_first(sector, structure%gyroscopic, j), at)
        static = on_axis_turned(sector, structure%static_loads, j)
        load = on_axis_turned(sector, transpose(delayed(sector, transpose(structure%harmonic_load), j)), j)
        here = on_axis_turned(sector, contacts%directions, j)
        beyond = on_axis_turned(sector, sector%next, j + 1)
        row = j*size(contacts%directions, 2)
        do i = 1, size(at)
          wheel%static_loads(at(i), :) = wheel%static_loads(at(i), :) + static(i, :)
          wheel%harmonic_load(at(i), :) = wheel%harmonic_load(at(i), :) + load(i, :)
          if (j == 0) wheel%monitors(at(i), :) = wheel%monitors(at(i), :) + structure%monitors(i, :)
          associate (own => rows(:, row + 1:row + size(contacts%directions, 2)))
            own(at(i), :) = own(at(i), :) + here(i, :)
            own(next(i), :) = own(next(i), :) + beyond(i, :)
          end associate
        end do
        law = [law, contacts%law]
      end do
    end associate
    wheel_contacts = new_contacts(law, rows)
  end subroutine whole_wheel

  !> How many coordinates the wheel has.
  pure integer function coordinates_of_wheel(sector)
    type(sector_type), intent(in) :: sector

    coordinates_of_wheel = sector%sectors*count(is_own(sector)) + size(sector%along) + size(sector%across)
  end function coordinates_of_wheel

  !> Which coordinates each sector has for itself: neither the next one's nor on the axis [m].
  pure function is_own(sector)
    type(sector_type), intent(in) :: sector
    logical :: is_own(size(sector%position))

    is_own = sector%of_next == 0
    is_own(sector%along) = .false.
    is_own(sector%across(1, :)) = .false.
    is_own(sector%across(2, :)) = .false.
  end function is_own

  !> Where a sector's coordinates are among the wheel's [m].
  pure function coordinates_of(sector, number) result(at)
    type(sector_type), intent(in) :: sector
    !> Of the sector, from 0; N is 0 again
    integer, intent(in) :: number
    integer :: at(size(sector%position))
    logical :: own(size(sector%position))
    integer :: i, n, last

    own = is_own(sector)
    n = count(own)
    last = sector%sectors*n
    at = 0
    at = unpack([(i, i=1, n)], own, at)
    at(sector%upper) = at(sector%lower)
    at = at + modulo(number + sector%of_next, sector%sectors)*n
    at(sector%along) = last + [(i, i=1, size(sector%along))]
    last = last + size(sector%along)
    at(sector%across(1, :)) = last + [(2*i - 1, i=1, size(sector%across, 2))]
    at(sector%across(2, :)) = last + [(2*i, i=1, size(sector%across, 2))]
  end function coordinates_of

  !> A sector's matrix, with what is on the axis along the first sector's axes [m, m].
  pure function along_first(sector, matrix, number) result(turned)
    type(sector_type), intent(in) :: sector
    !> [m, m]
    real(wp), intent(in) :: matrix(:, :)
    !> Of the sector
    integer, intent(in) :: number
    real(wp) :: turned(size(matrix, 1), size(matrix, 2))

    turned = transpose(on_axis_turned(sector, transpose(on_axis_turned(sector, matrix, number)), number))
  end function along_first

  !> Columns along a sector's axes, with what is on the axis along those of the first, R^j f [m, columns].
  pure function on_axis_turned(sector, columns, number) result(turned)
    type(sector_type), intent(in) :: sector
    !> [m, columns]
    real(wp), intent(in) :: columns(:, :)
    !> Of the sector
    integer, intent(in) :: number
    real(wp) :: turned(size(columns, 1), size(columns, 2))

    turned = columns
    associate (first => sector%across(1, :), second => sector%across(2, :), angle => angle_of(sector, number))
      turned(first, :) = cos(angle)*columns(first, :) - sin(angle)*columns(second, :)
      turned(second, :) = sin(angle)*columns(first, :) + cos(angle)*columns(second, :)
    end associate
  end function on_axis_turned

  !> By which a sector is turned from the first, less whole turns, rad.
  pure real(wp) function angle_of(sector, number) result(angle)
    type(sector_type), intent(in) :: sector
    !> Of the sector
    integer, intent(in) :: number

    angle = two_pi*modulo(number, sector%sectors)/sector%sectors
  end function angle_of

  !> The wheel's motion whose sector j moves as sector j + k did [n, columns].
  pure function turned_back(sector, columns, k) result(turned)
    type(sector_type), intent(in) :: sector
    !> Of the wheel's coordinates [n, columns]
    real(wp), intent(in) :: columns(:, :)
    !> Sectors
    integer, intent(in) :: k
    real(wp) :: turned(size(columns, 1), size(columns, 2))
    integer :: own, last, i

    own = count(is_own(sector))
    last = sector%sectors*own
    turned(:last, :) = cshift(columns(:last, :), modulo(k, sector%sectors)*own, 1)
    turned(last + 1:, :) = columns(last + 1:, :)
    last = last + size(sector%along)
    associate (angle => angle_of(sector, -k))
      do i = last + 1, size(columns, 1) - 1, 2
        turned(i, :) = cos(angle)*columns(i, :) - sin(angle)*columns(i + 1, :)
        turned(i + 1, :) = sin(angle)*columns(i, :) + cos(angle)*columns(i + 1, :)
      end do
    end associate
  end function turned_back

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
