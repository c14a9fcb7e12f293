!> A small wheel of equal sectors, and one of its sectors in a travelling wave, for tests.
module cyclic_sector
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_model_contacts, only: contact_type, contacts_type, new_contacts
  use attrito_model_sector, only: new_sector
  use scenes, only: scene_type, noise
  implicit none
  private
  public :: one_sector, whole_wheel, of_sector

  !> Coordinates of a sector: inside, lower boundary, upper boundary; without the upper boundary
  integer, parameter :: sector_size = 8, free = 6
  !> Of the coordinates without the upper boundary, those of the lower one
  integer, parameter :: lower(2) = [5, 6]

contains

  !> A sector with its boundaries: a contact to ground inside, another to the next sector, with its rows there.
  function one_sector(sectors, engine_order, damping_kind) result(scene)
    integer, intent(in) :: sectors, engine_order
    !> One of `damping_...`
    integer, intent(in) :: damping_kind
    type(scene_type) :: scene
    real(wp) :: mixed(sector_size, sector_size), next(sector_size, 5)
    type(contact_type) :: law(2)
    integer :: i

    law%tangents = [2, 1]
    law%tangential_stiffness = [0.7_wp, 0.9_wp]
    law%normal_stiffness = [1.3_wp, 1.1_wp]
    law%friction_coefficient = [0.3_wp, 0.4_wp]
    law%preload = [0.8_wp, 0.6_wp]
    scene%contacts = new_contacts(law, reshape(noise(5*sector_size, 3), [sector_size, 5]))
    next = 0.0_wp
    next(:4, 4:) = reshape(noise(8, 4), [4, 2])
    associate (structure => scene%structure)
      mixed = reshape(noise(sector_size**2, 1), [sector_size, sector_size])
      structure%mass = 0.05_wp*matmul(transpose(mixed), mixed)
      mixed = reshape(noise(sector_size**2, 2), [sector_size, sector_size])
      structure%stiffness = 0.3_wp*matmul(transpose(mixed), mixed)
      do i = 1, sector_size
        structure%mass(i, i) = structure%mass(i, i) + 1.0_wp
        structure%stiffness(i, i) = structure%stiffness(i, i) + 0.4_wp*i
      end do
      structure%damping_kind = damping_kind
      structure%damping_value = 0.05_wp
      structure%damping = 0.05_wp*structure%mass + 0.02_wp*structure%stiffness
      structure%sector = new_sector(sectors, engine_order, lower, [7, 8], next)
      structure%static_loads = reshape(0.3_wp*noise(sector_size, 5), [sector_size, 1])
      structure%harmonic_load = reshape(noise(5*sector_size, 6), [sector_size, 5])
      structure%harmonic_load(:, 1) = 0.0_wp
      structure%harmonic_load(:, 4:5) = 0.3_wp*structure%harmonic_load(:, 4:5)
      structure%monitors = reshape(noise(2*sector_size, 7), [sector_size, 2])
    end associate
  end function one_sector

  !> All sectors, coupled; loads f_j(t) = f_0(t - j EO T / N). Monitors are those of the first.
  function whole_wheel(sectors, engine_order, damping_kind) result(scene)
    integer, intent(in) :: sectors, engine_order
    !> One of `damping_...`
    integer, intent(in) :: damping_kind
    type(scene_type) :: scene, sector
    real(wp), allocatable :: rows(:, :), onto(:, :), load(:, :)
    complex(wp), allocatable :: columns(:, :)
    type(contact_type), allocatable :: law(:)
    integer :: h, j

    sector = one_sector(sectors, engine_order, damping_kind)
    associate (n => sectors*free, structure => scene%structure, one => sector%structure, contacts => size(sector%contacts%law))
      allocate (structure%mass(n, n), structure%stiffness(n, n), structure%damping(n, n), structure%static_loads(n, 1), &
                structure%harmonic_load(n, size(one%harmonic_load, 2)), source=0.0_wp)
      allocate (rows(n, 0), law(0))
      structure%damping_kind = damping_kind
      structure%damping_value = one%damping_value
      structure%monitors = matmul(of_sector(0, sectors), one%monitors)
      do j = 0, sectors - 1
        onto = of_sector(j, sectors)
        structure%mass = structure%mass + matmul(onto, matmul(one%mass, transpose(onto)))
        structure%stiffness = structure%stiffness + matmul(onto, matmul(one%stiffness, transpose(onto)))
        structure%damping = structure%damping + matmul(onto, matmul(one%damping, transpose(onto)))
        structure%static_loads = structure%static_loads + matmul(onto, one%static_loads)
        columns = to_complex(transpose(one%harmonic_load))
        do h = 0, size(columns, 2) - 1
          columns(:, h + 1) = exp(cmplx(0.0_wp, -two_pi*modulo(j*h*engine_order, sectors)/sectors, wp))*columns(:, h + 1)
        end do
        load = to_real(columns)
        structure%harmonic_load = structure%harmonic_load + matmul(onto, transpose(load))
        rows = reshape([rows, matmul(onto, sector%contacts%directions) + matmul(of_sector(j + 1, sectors), one%sector%next)], &
                       [n, size(rows, 2) + size(one%sector%next, 2)])
        law = [law, sector%contacts%law]
      end do
      scene%contacts = new_contacts(law, rows)
    end associate
  end function whole_wheel

  !> From a sector's coordinates to the wheel's, in columns [N n, m].
  pure function of_sector(sector, sectors) result(onto)
    integer, intent(in) :: sector, sectors
    real(wp) :: onto(sectors*free, sector_size)
    integer :: i

    onto = 0.0_wp
    do i = 1, free
      onto(modulo(sector, sectors)*free + i, i) = 1.0_wp
    end do
    do i = 1, size(lower)
      onto(modulo(sector + 1, sectors)*free + lower(i), free + i) = 1.0_wp
    end do
  end function of_sector
end module cyclic_sector
