!> A small wheel of equal sectors, and a receptance of one of its sectors in a travelling wave: coordinates, directions and stiffness
!> of their own at each harmonic.
!>
!> $$ q_h = S_h x_h, \quad S_h = [I; e^{-i h \theta}], \qquad Z_h = S_h^H (K - (h \omega)^2 M + i h \omega C + B_h^H K_c B_h) S_h,
!>    \qquad B_h = B + e^{-i h \theta} B_{next}, \quad \theta = 2 \pi EO / N $$
!>
!> The upper boundary follows the lower one of the next sector, q_{j+1,h} = exp(-i h theta) q_{j,h}. It serves tests: that what uses a
!> receptance asks nothing of it but its answers at each harmonic.
module cyclic_sector
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: factor_complex, solve_factored_complex
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_linear_projected_rows, only: projected_rows_type, new_projected_rows_by_harmonic
  use attrito_linear_receptance, only: receptance_type
  use attrito_model_contacts, only: contact_type, contacts_type, new_contacts
  use attrito_model_structure, only: structure_type, damping_viscous
  use scenes, only: scene_type, noise
  implicit none
  private
  public :: one_sector, whole_wheel, of_sector, sector_receptance_type, new_sector_receptance

  integer, parameter :: sectors = 3, engine_order = 1
  !> Coordinates of a sector: inside, lower boundary, upper boundary; without the upper boundary
  integer, parameter :: sector_size = 8, free = 6
  !> Of the coordinates without the upper boundary, those of the lower one
  integer, parameter :: lower(2) = [5, 6]

  type, extends(receptance_type) :: sector_receptance_type
    !> K, M and C of the sector [m, m]
    real(wp), allocatable :: stiffness(:, :), mass(:, :), damping(:, :)
    !> Rows of B on this sector and on the next, in columns [m, rows], and their springs [rows]
    real(wp), allocatable :: here(:, :), next(:, :), springs(:)
    !> Factors of Z_h [n, n, 0:H] and their row interchanges [n, 0:H], and of Z_h^H
    complex(wp), allocatable :: factors(:, :, :), adjoint_factors(:, :, :)
    integer, allocatable :: pivots(:, :), adjoint_pivots(:, :)
  contains
    procedure :: set_harmonics
    procedure :: set_frequency
    procedure :: project_load
    procedure :: project_loads
    procedure :: project_mean_loads
    procedure :: project_rows
    procedure :: contact_rows
    procedure :: recover
    procedure :: displacements
    procedure :: state_at_start
    procedure :: respond
    procedure :: respond_adjoint
    procedure :: respond_derivative
    procedure :: inertia_of
    procedure :: block_between
    procedure :: common_modes
    procedure :: mode_shapes
    procedure :: low_stiffness
    procedure :: remainder
  end type sector_receptance_type

contains

  !> A sector with its boundaries, not yet coupled: a contact to ground inside, another to the next sector, with its rows there.
  subroutine one_sector(scene, next)
    type(scene_type), intent(out) :: scene
    !> [m, rows]
    real(wp), allocatable, intent(out) :: next(:, :)
    real(wp) :: mixed(sector_size, sector_size)
    type(contact_type) :: law(2)
    integer :: i

    law%tangents = [2, 1]
    law%tangential_stiffness = [0.7_wp, 0.9_wp]
    law%normal_stiffness = [1.3_wp, 1.1_wp]
    law%friction_coefficient = [0.3_wp, 0.4_wp]
    law%preload = [0.8_wp, 0.6_wp]
    scene%contacts = new_contacts(law, reshape(noise(5*sector_size, 3), [sector_size, 5]))
    scene%contacts%directions(7:, :) = 0.0_wp
    allocate (next(sector_size, 5), source=0.0_wp)
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
      structure%damping_kind = damping_viscous
      structure%damping = 0.05_wp*structure%mass + 0.02_wp*structure%stiffness
      structure%static_loads = reshape(0.3_wp*noise(sector_size, 5), [sector_size, 1])
      structure%harmonic_load = reshape(noise(5*sector_size, 6), [sector_size, 5])
      structure%harmonic_load(:, 1) = 0.0_wp
      structure%harmonic_load(:, 4:5) = 0.3_wp*structure%harmonic_load(:, 4:5)
      structure%monitors = reshape(noise(2*sector_size, 7), [sector_size, 2])
    end associate
  end subroutine one_sector

  !> All sectors, coupled; loads f_j(t) = f_0(t - j EO T / N). Monitors are those of the first.
  function whole_wheel() result(scene)
    type(scene_type) :: scene, sector
    real(wp), allocatable :: next(:, :), rows(:, :), onto(:, :), load(:, :)
    complex(wp), allocatable :: columns(:, :)
    type(contact_type), allocatable :: law(:)
    integer :: h, j

    call one_sector(sector, next)
    associate (n => sectors*free, structure => scene%structure, one => sector%structure, contacts => size(sector%contacts%law))
      allocate (structure%mass(n, n), structure%stiffness(n, n), structure%damping(n, n), structure%static_loads(n, 1), &
                structure%harmonic_load(n, size(one%harmonic_load, 2)), source=0.0_wp)
      allocate (rows(n, 0), law(0))
      structure%damping_kind = damping_viscous
      structure%monitors = matmul(of_sector(0), one%monitors)
      do j = 0, sectors - 1
        onto = of_sector(j)
        structure%mass = structure%mass + matmul(onto, matmul(one%mass, transpose(onto)))
        structure%stiffness = structure%stiffness + matmul(onto, matmul(one%stiffness, transpose(onto)))
        structure%damping = structure%damping + matmul(onto, matmul(one%damping, transpose(onto)))
        structure%static_loads = structure%static_loads + matmul(onto, one%static_loads)
        columns = to_complex(transpose(one%harmonic_load))
        do h = 0, size(columns, 2) - 1
          columns(:, h + 1) = turned(j*h)*columns(:, h + 1)
        end do
        load = to_real(columns)
        structure%harmonic_load = structure%harmonic_load + matmul(onto, transpose(load))
        rows = reshape([rows, matmul(onto, sector%contacts%directions) + matmul(of_sector(j + 1), next)], &
                       [n, size(rows, 2) + size(next, 2)])
        law = [law, sector%contacts%law]
      end do
      scene%contacts = new_contacts(law, rows)
    end associate
  end function whole_wheel

  !> From a sector's coordinates to the wheel's, in columns [N n, m].
  pure function of_sector(sector) result(onto)
    integer, intent(in) :: sector
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

  !> exp(-i h theta).
  pure complex(wp) function turned(h)
    integer, intent(in) :: h

    turned = exp(cmplx(0.0_wp, -two_pi*h*engine_order/sectors, wp))
    if (modulo(h, sectors) == 0) turned = 1.0_wp
  end function turned

  !> S_h [m, n].
  pure function coupling(h) result(s)
    integer, intent(in) :: h
    complex(wp) :: s(sector_size, free)
    integer :: i

    s = 0.0_wp
    do i = 1, free
      s(i, i) = 1.0_wp
    end do
    do i = 1, size(lower)
      s(free + i, lower(i)) = turned(h)
    end do
  end function coupling

  !> Of a sector, its contacts' rows on the next one given.
  function new_sector_receptance(structure, contacts, next, harmonics) result(self)
    type(structure_type), intent(in) :: structure
    type(contacts_type), intent(in) :: contacts
    !> [m, rows]
    real(wp), intent(in) :: next(:, :)
    integer, intent(in) :: harmonics
    type(sector_receptance_type) :: self

    self%stiffness = structure%stiffness
    self%mass = structure%mass
    self%damping = structure%damping
    self%here = contacts%directions
    self%next = next
    self%springs = contacts%row_stiffness
    call self%set_harmonics(harmonics)
  end function new_sector_receptance

  subroutine set_harmonics(self, harmonics)
    class(sector_receptance_type), intent(inout) :: self
    integer, intent(in) :: harmonics

    self%harmonics = harmonics
    self%omega = -1.0_wp
    if (allocated(self%factors)) deallocate (self%factors, self%pivots, self%adjoint_factors, self%adjoint_pivots)
    allocate (self%factors(free, free, 0:harmonics), self%pivots(free, 0:harmonics))
    allocate (self%adjoint_factors, source=self%factors)
    allocate (self%adjoint_pivots, source=self%pivots)
  end subroutine set_harmonics

  subroutine set_frequency(self, omega, status, highest)
    class(sector_receptance_type), intent(inout) :: self
    real(wp), intent(in) :: omega
    integer, intent(out) :: status
    integer, intent(in), optional :: highest
    complex(wp) :: b(free, size(self%springs))
    integer :: h

    status = 0
    self%highest = self%harmonics
    do h = 0, self%harmonics
      b = columns_at(self, h)
      self%factors(:, :, h) = reduced(cmplx(self%stiffness - (h*omega)**2*self%mass, h*omega*self%damping, wp), h) &
                              + matmul(b*spread(self%springs, 1, free), conjg(transpose(b)))
      self%adjoint_factors(:, :, h) = conjg(transpose(self%factors(:, :, h)))
      call factor_complex(self%factors(:, :, h), self%pivots(:, h), status)
      if (status == 0) call factor_complex(self%adjoint_factors(:, :, h), self%adjoint_pivots(:, h), status)
      if (status /= 0) return
    end do
    self%omega = omega
  end subroutine set_frequency

  !> S_h^H A S_h.
  pure function reduced(matrix, h)
    complex(wp), intent(in) :: matrix(:, :)
    integer, intent(in) :: h
    complex(wp) :: reduced(free, free)

    reduced = matmul(conjg(transpose(coupling(h))), matmul(matrix, coupling(h)))
  end function reduced

  !> (B_h S_h)^H [n, rows].
  pure function columns_at(self, h) result(columns)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: h
    complex(wp) :: columns(free, size(self%springs))

    columns = matmul(conjg(transpose(coupling(h))), self%here + conjg(turned(h))*self%next)
  end function columns_at

  function project_load(self, h, load) result(projected)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: h
    complex(wp), intent(in) :: load(:)
    complex(wp), allocatable :: projected(:)

    projected = matmul(conjg(transpose(coupling(h))), load)
  end function project_load

  function project_loads(self, loads) result(projected)
    class(sector_receptance_type), intent(in) :: self
    real(wp), intent(in) :: loads(:, :)
    complex(wp), allocatable :: projected(:, :)
    complex(wp), allocatable :: columns(:, :)
    integer :: h

    columns = to_complex(transpose(loads))
    allocate (projected(free, 0:size(columns, 2) - 1))
    do h = 0, ubound(projected, 2)
      projected(:, h) = self%project_load(h, columns(:, h + 1))
    end do
  end function project_loads

  function project_mean_loads(self, loads) result(projected)
    class(sector_receptance_type), intent(in) :: self
    real(wp), intent(in) :: loads(:, :)
    real(wp), allocatable :: projected(:, :)

    projected = matmul(transpose(real(coupling(0), wp)), loads)
  end function project_mean_loads

  function project_rows(self, rows) result(projected)
    class(sector_receptance_type), intent(in) :: self
    real(wp), intent(in) :: rows(:, :)
    type(projected_rows_type) :: projected
    complex(wp) :: columns(free, size(rows, 2), 0:sectors - 1)
    integer :: h

    do h = 0, sectors - 1
      columns(:, :, h) = matmul(conjg(transpose(coupling(h))), rows)
    end do
    projected = new_projected_rows_by_harmonic(columns)
  end function project_rows

  function contact_rows(self, first, last) result(projected)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: first, last
    type(projected_rows_type) :: projected
    complex(wp) :: columns(free, size(self%springs), 0:sectors - 1)
    integer :: h

    do h = 0, sectors - 1
      columns(:, :, h) = columns_at(self, h)
    end do
    projected = new_projected_rows_by_harmonic(columns(:, first:last, :))
  end function contact_rows

  function recover(self, h, response) result(displacement)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: h
    complex(wp), intent(in) :: response(:)
    complex(wp), allocatable :: displacement(:)

    displacement = matmul(coupling(h), response)
  end function recover

  function displacements(self, response) result(coefficients)
    class(sector_receptance_type), intent(in) :: self
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: coefficients(:, :)
    complex(wp) :: columns(sector_size, 0:ubound(response, 2))
    integer :: h

    do h = 0, ubound(response, 2)
      columns(:, h) = self%recover(h, response(:, h))
    end do
    coefficients = to_real(columns)
  end function displacements

  subroutine state_at_start(self, response, omega, displacement, rate)
    class(sector_receptance_type), intent(in) :: self
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), intent(in) :: omega
    real(wp), allocatable, intent(out) :: displacement(:), rate(:)
    complex(wp) :: column(sector_size)
    integer :: h

    allocate (displacement(sector_size), rate(sector_size), source=0.0_wp)
    do h = 0, ubound(response, 2)
      column = self%recover(h, response(:, h))
      displacement = displacement + real(column, wp)
      rate = rate - h*omega*aimag(column)
    end do
  end subroutine state_at_start

  subroutine respond(self, force, response)
    class(sector_receptance_type), intent(in) :: self
    complex(wp), intent(in) :: force(:, 0:)
    complex(wp), intent(out) :: response(:, 0:)
    complex(wp) :: column(free, 1)
    integer :: h

    do h = 0, ubound(force, 2)
      column(:, 1) = force(:, h)
      call solve_factored_complex(self%factors(:, :, h), self%pivots(:, h), column)
      response(:, h) = column(:, 1)
    end do
  end subroutine respond

  subroutine respond_adjoint(self, force, response)
    class(sector_receptance_type), intent(in) :: self
    complex(wp), intent(in) :: force(:, 0:)
    complex(wp), intent(out) :: response(:, 0:)
    complex(wp) :: column(free, 1)
    integer :: h

    do h = 0, ubound(force, 2)
      column(:, 1) = force(:, h)
      call solve_factored_complex(self%adjoint_factors(:, :, h), self%adjoint_pivots(:, h), column)
      response(:, h) = column(:, 1)
    end do
  end subroutine respond_adjoint

  subroutine respond_derivative(self, response, derivative)
    class(sector_receptance_type), intent(in) :: self
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp), intent(out) :: derivative(:, 0:)
    complex(wp) :: force(free, 0:ubound(response, 2))
    integer :: h

    do h = 0, ubound(response, 2)
      force(:, h) = matmul(reduced(cmplx(2.0_wp*h**2*self%omega*self%mass, -h*self%damping, wp), h), response(:, h))
    end do
    call self%respond(force, derivative)
  end subroutine respond_derivative

  subroutine inertia_of(self, response, product)
    class(sector_receptance_type), intent(in) :: self
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp), intent(out) :: product(:, 0:)
    integer :: h

    do h = 0, ubound(response, 2)
      product(:, h) = matmul(reduced(cmplx(self%mass, kind=wp), h), response(:, h))
    end do
  end subroutine inertia_of

  subroutine block_between(self, h, rows_a, rows_b, block)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: h, rows_a(:), rows_b(:)
    complex(wp), intent(out) :: block(:, :)
    complex(wp) :: all(free, size(self%springs)), columns(free, size(rows_b))

    all = columns_at(self, h)
    columns = all(:, rows_b)
    call solve_factored_complex(self%factors(:, :, h), self%pivots(:, h), columns)
    block = matmul(conjg(transpose(all(:, rows_a))), columns)
  end subroutine block_between

  pure integer function common_modes(self)
    class(sector_receptance_type), intent(in) :: self

    common_modes = 0
  end function common_modes

  function mode_shapes(self, first, last, rows) result(shapes)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: first, last, rows(:)
    real(wp), allocatable :: shapes(:, :)

    if (last >= first) error stop 'a mode is asked for'
    allocate (shapes(0, size(rows)))
  end function mode_shapes

  function low_stiffness(self, h, low) result(stiffness)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: h, low
    complex(wp) :: stiffness(low)

    if (low > 0) error stop 'a mode is asked for'
    stiffness = 0.0_wp
  end function low_stiffness

  subroutine remainder(self, low, rows, blocks)
    class(sector_receptance_type), intent(in) :: self
    integer, intent(in) :: low, rows(:)
    complex(wp), intent(out) :: blocks(:, :, 0:)
    integer :: h

    do h = 0, self%harmonics
      call self%block_between(h, rows, rows, blocks(:, :, h))
    end do
  end subroutine remainder
end module cyclic_sector
