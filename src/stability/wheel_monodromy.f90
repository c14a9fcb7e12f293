!> Multipliers of a travelling wave by the flow of the whole wheel over a part of the period.
!>
!> With g = gcd(N, EO) and m EO = g mod N the wave after T g / N is itself, m sectors on. So
!>
!> $$ P = \text{(back by } m \text{ sectors)} \circ \text{(flow over } T g / N), \qquad P \delta = e^{s T g / N - i \psi m} \delta,
!>    \qquad e^{s T} = \lambda^{N/g} e^{i \psi m N / g} $$
!>
!> for perturbations of wavenumber psi = 2 pi kappa / N (`attrito_stability_hill_sector`). A rotation by N / g sectors leaves the wave
!> as it is and commutes with P: its eigenspaces, by kappa mod g, are taken one by one.
module attrito_stability_wheel_monodromy
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: complex_eigenvalues_of
  use attrito_core_lapack_complex, only: hermitian_eigenpairs
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_model_contacts, only: contacts_type
  use attrito_model_sector, only: sector_type
  use attrito_model_structure, only: structure_type
  use attrito_model_wheel, only: whole_wheel, coordinates_of_wheel, turned_back, wave_of
  use attrito_stability_balance_motion, only: balance_motion_type
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet, kind_slip, kind_stuck
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_perturbation, only: memory_type
  use attrito_stability_reduced, only: reduced_type, reduce_to
  implicit none
  private
  public :: wheel_type, new_wheel, wave_multipliers, modes_of_wheel, most_modes

  !> Modes of a wheel that is marched as a whole, at most: matrices of twice the order
  integer, parameter :: most_modes = 600 ! conventional

  type :: wheel_type
    type(sector_type) :: sector
    !> Contacts of one sector
    integer :: contacts = 0
    type(system_type) :: system
  end type wheel_type

contains

  !> Modes of the wheel of a sector.
  pure integer function modes_of_wheel(structure)
    !> The sector
    type(structure_type), intent(in) :: structure

    modes_of_wheel = coordinates_of_wheel(structure%sector)
  end function modes_of_wheel

  !> Assemble and diagonalise the wheel.
  subroutine new_wheel(structure, contacts, self, error)
    !> The sector: mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts of the sector
    type(contacts_type), intent(in) :: contacts
    type(wheel_type), intent(out) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(structure_type) :: wheel
    type(contacts_type) :: wheel_contacts

    call whole_wheel(structure, contacts, wheel, wheel_contacts)
    self%sector = structure%sector
    self%contacts = size(contacts%law)
    call new_system(wheel, wheel_contacts, self%system, error)
  end subroutine new_wheel

  !> All multipliers of the wave, the largest first within each kind.
  subroutine wave_multipliers(self, balance, omega, multipliers, info)
    type(wheel_type), intent(in) :: self
    !> Motion and sliders of the sector's contacts
    type(balance_motion_type), intent(in) :: balance
    !> Angular frequency of the excitation
    real(wp), intent(in) :: omega
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0, or not: no convergence; -1: a slider does not come back
    integer, intent(out) :: info
    type(orbit_type) :: orbit
    complex(wp), allocatable :: values(:)
    type(multiplier_type), allocatable :: found(:)
    real(wp), allocatable :: matrix(:, :)
    integer :: m, g, block, turning, i

    call find_steps(self%sector, m, g)
    call find_orbit(self, balance, omega, orbit)
    info = merge(0, -1, orbit%periodic)
    if (info /= 0) return
    matrix = flow_and_back(self, orbit, m, self%sector%sectors/g)
    allocate (found(0))
    do block = 0, g - 1
      call eigenvalues_of_block(self, orbit%memory, matrix, g, block, values, info)
      if (info /= 0) return
      found = [found, (of_period(self%sector, values(i), m, g, block), i=1, size(values))]
    end do
    associate (law => self%system%law)
      turning = count(law%has_direction() .and. orbit%closed .and. .not. orbit%stuck)
      multipliers = [largest_of(found, min(size(found), 2*size(self%system%eigenvalues) + turning)), &
                     spread(multiplier_type(0.0_wp, kind_slip), 1, sum(law%tangents, mask=.not. orbit%stuck) - turning), &
                     spread(multiplier_type(1.0_wp, kind_stuck), 1, sum(law%tangents, mask=orbit%stuck))]
    end associate
  end subroutine wave_multipliers

  !> g = gcd(N, EO), and m with m EO = g mod N.
  pure subroutine find_steps(sector, m, g)
    type(sector_type), intent(in) :: sector
    !> Sectors by which the wave goes on, and in how many parts of the period of N
    integer, intent(out) :: m, g

    g = sector%sectors/sector%period()
    do m = 0, sector%sectors - 1
      if (modulo(m*sector%engine_order - g, sector%sectors) == 0) exit
    end do
  end subroutine find_steps

  !> The balance's own orbit, put round the wheel.
  subroutine find_orbit(self, balance, omega, orbit)
    type(wheel_type), intent(in) :: self
    !> Motion and sliders of the sector's contacts
    type(balance_motion_type), intent(in) :: balance
    !> Angular frequency of the excitation
    real(wp), intent(in) :: omega
    type(orbit_type), intent(out) :: orbit
    type(balance_motion_type) :: wave
    type(loading_type) :: loading
    integer :: i

    wave = balance
    wave%motion = wave_of(self%sector, balance%motion)
    wave%slider = reshape([(balance%slider, i=1, self%sector%sectors)], [size(balance%slider, 1), size(self%system%law)])
    wave%holds = [(balance%holds, i=1, self%sector%sectors)]
    loading%period = two_pi/omega*self%system%clock
    call orbit%take_balance(self%system, loading, wave)
  end subroutine find_orbit

  !> P [2 modes + memory, 2 modes + memory].
  function flow_and_back(self, orbit, m, parts) result(matrix)
    type(wheel_type), intent(in) :: self
    !> Of the wave
    type(orbit_type), intent(in) :: orbit
    !> Sectors to go back by; parts of the period, the first of which is flown
    integer, intent(in) :: m, parts
    real(wp), allocatable :: matrix(:, :)
    real(wp), allocatable :: back(:, :), scale(:)
    type(memory_type) :: kept(size(orbit%memory))
    type(reduced_type) :: reduced
    integer :: n, i

    n = size(self%system%eigenvalues)
    kept = moved(self, orbit%memory, m)
    reduced = reduce_to(self%system, n)
    matrix = orbit%monodromy(reduced, parts, kept)
    back = rotation(self, m)
    matrix(:n, :) = matmul(back, matrix(:n, :))
    matrix(n + 1:2*n, :) = matmul(back, matrix(n + 1:2*n, :))
    ! A unit of what a contact remembers is one that a unit of motion brings about.
    scale = [spread(1.0_wp, 1, 2*n), (norm2(self%system%rows(:, self%system%law(orbit%memory(i)%contact)%first_row)), &
                                      i=1, size(orbit%memory))]
    where (scale <= 0.0_wp) scale = 1.0_wp
    matrix = matrix*spread(scale, 1, size(scale))/spread(scale, 2, size(scale))
  end function flow_and_back

  !> What is remembered, by contacts so many sectors on.
  pure function moved(self, memory, sectors) result(on)
    type(wheel_type), intent(in) :: self
    !> Numbers that contacts remember
    type(memory_type), intent(in) :: memory(:)
    !> How many
    integer, intent(in) :: sectors
    type(memory_type) :: on(size(memory))

    on = memory
    on%contact = modulo(memory%contact - 1 + sectors*self%contacts, size(self%system%law)) + 1
  end function moved

  !> In modes, the motion whose sector j moves as sector j + k did [modes, modes].
  pure function rotation(self, k)
    type(wheel_type), intent(in) :: self
    !> Sectors
    integer, intent(in) :: k
    real(wp), allocatable :: rotation(:, :)

    rotation = matmul(transpose(self%system%weighted), turned_back(self%sector, self%system%modes, k))
  end function rotation

  !> Eigenvalues of P on the perturbations of kappa = block mod g.
  subroutine eigenvalues_of_block(self, memory, matrix, g, block, values, info)
    type(wheel_type), intent(in) :: self
    !> Numbers that contacts remember
    type(memory_type), intent(in) :: memory(:)
    !> P
    real(wp), intent(in) :: matrix(:, :)
    !> Number of blocks; this one
    integer, intent(in) :: g, block
    complex(wp), allocatable, intent(out) :: values(:)
    !> 0, or not: no convergence
    integer, intent(out) :: info
    complex(wp), allocatable :: projector(:, :), basis(:, :), vectors(:, :), unit(:, :), restricted(:, :)
    real(wp), allocatable :: parts(:)
    integer :: i, l

    if (g == 1) then
      restricted = cmplx(matrix, kind=wp)
    else
      allocate (projector(size(matrix, 1), size(matrix, 1)), unit(size(matrix, 1), size(matrix, 1)), source=(0.0_wp, 0.0_wp))
      do i = 1, size(unit, 1)
        unit(i, i) = 1.0_wp
      end do
      do l = 0, g - 1
        projector = projector + exp(cmplx(0.0_wp, two_pi*modulo(l*block, g)/g, wp))/g &
                    *pure_rotation(self, memory, l*(self%sector%sectors/g))
      end do
      call hermitian_eigenpairs(projector, unit, parts, basis, info)
      if (info /= 0) return
      basis = basis(:, pack([(i, i=1, size(parts))], parts > 0.5_wp))
      restricted = matmul(conjg(transpose(basis)), matmul(cmplx(matrix, kind=wp), basis))
    end if
    call complex_eigenvalues_of(restricted, values, vectors, info)
  end subroutine eigenvalues_of_block

  !> The rotation by some sectors of motion, rate and memory: state j becomes that of j + k.
  pure function pure_rotation(self, memory, k) result(matrix)
    type(wheel_type), intent(in) :: self
    !> Numbers that contacts remember
    type(memory_type), intent(in) :: memory(:)
    !> Sectors
    integer, intent(in) :: k
    real(wp), allocatable :: matrix(:, :)
    type(memory_type) :: on(size(memory))
    integer :: i, j, n

    n = size(self%system%eigenvalues)
    allocate (matrix(2*n + size(memory), 2*n + size(memory)), source=0.0_wp)
    matrix(:n, :n) = rotation(self, k)
    matrix(n + 1:2*n, n + 1:2*n) = matrix(:n, :n)
    on = moved(self, memory, k)
    do i = 1, size(memory)
      do j = 1, size(memory)
        if (on(i)%contact == memory(j)%contact .and. on(i)%component == memory(j)%component) matrix(2*n + i, 2*n + j) = 1.0_wp
      end do
    end do
  end function pure_rotation

  !> The multiplier of a whole period, with its wavenumber.
  pure type(multiplier_type) function of_period(sector, value, m, g, block) result(multiplier)
    type(sector_type), intent(in) :: sector
    !> Eigenvalue of P
    complex(wp), intent(in) :: value
    !> See `find_steps`; kappa mod g
    integer, intent(in) :: m, g, block
    complex(wp) :: exponent
    integer :: kappa, turns

    multiplier%kind = kind_floquet
    multiplier%wavenumber = block
    if (abs(value) <= tiny(1.0_wp)**0.25_wp) return
    associate (n => sector%sectors)
      ! The argument is taken by itself: a high power would be lost in rounding or underflow.
      exponent = log(value)*(n/g) + cmplx(0.0_wp, two_pi*modulo(block*m, g)/g, wp)
      multiplier%value = exp(exponent)
      exponent = log(multiplier%value)
      ! Im s T in (-pi, pi]
      if (aimag(exponent) < -0.5_wp*two_pi*(1.0_wp - 1.0e-9_wp)) exponent = conjg(exponent)
      ! psi m = Im s T g / N - arg(value), and so kappa m
      turns = nint((aimag(exponent)*g/n - aimag(log(value)))*n/two_pi)
      do kappa = block, n - 1, g
        if (modulo(kappa*m - turns, n) == 0) exit
      end do
      multiplier%wavenumber = kappa
    end associate
  end function of_period

  !> So many of the largest, in their order.
  pure function largest_of(multipliers, number) result(sorted)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)
    !> How many
    integer, intent(in) :: number
    type(multiplier_type) :: sorted(number)
    logical :: left(size(multipliers))
    integer :: i, largest

    left = .true.
    do i = 1, number
      largest = maxloc(abs(multipliers%value), 1, mask=left)
      sorted(i) = multipliers(largest)
      left(largest) = .false.
    end do
  end function largest_of
end module attrito_stability_wheel_monodromy
