!> Receptance of one sector of a cyclic structure: harmonic h has the nodal diameter h EO mod N, so coordinates and rows of its own,
!>
!> $$ q_h = S_n \Psi_n x_h, \qquad F_h = \Psi_n^H S_n^H f_h, \qquad d_h = (B + e^{-2 \pi i n / N} B_{next}) S_n \Psi_n x_h, \qquad
!>    n = h \, EO \bmod N $$
!>
!> with Psi_n the modes of that diameter, or I. What belongs to N - n is the conjugate of what belongs to n and is not kept.
module attrito_linear_receptance_cyclic
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_model_sector, only: sector_type, first_alike, is_mirrored
  use attrito_linear_diameter_modes, only: diameter_modes_type
  use attrito_linear_projected_rows, only: projected_rows_type, new_projected_rows_by_harmonic
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: receptance_cyclic_type, begin_sector

  type, abstract, extends(receptance_type) :: receptance_cyclic_type
    type(sector_type) :: sector
    !> Harmonics after which nodal diameters repeat
    integer :: period = 1
    !> Modes of the stuck system, by harmonic [0:period/2]; are they the coordinates?
    type(diameter_modes_type), allocatable :: diameters(:)
    logical :: in_modes = .false.
    !> Rows of B in generalised coordinates, in columns: P_h [n, rows, 0:period/2]
    complex(wp), allocatable :: rows(:, :, :)
  contains
    procedure :: project_load
    procedure :: project_loads
    procedure :: project_mean_loads
    procedure :: project_rows
    procedure :: contact_rows
    procedure :: recover
    procedure :: displacements
    procedure :: state_at_start
    procedure :: common_modes
    procedure :: mode_shapes
    procedure :: low_stiffness
    procedure :: block_between
    procedure :: project
    procedure :: rows_at
  end type receptance_cyclic_type

contains

  !> The sector, its modes, and rows of the contacts at all nodal diameters.
  subroutine begin_sector(self, sector, diameters, in_modes, directions)
    class(receptance_cyclic_type), intent(inout) :: self
    !> How sectors hang together
    type(sector_type), intent(in) :: sector
    !> Modes of the stuck system, by harmonic [0:period/2]
    type(diameter_modes_type), intent(in) :: diameters(0:)
    !> Are modes the coordinates?
    logical, intent(in) :: in_modes
    !> Rows of B on the sector itself, in columns [m, rows]
    real(wp), intent(in) :: directions(:, :)
    integer :: h

    self%sector = sector
    self%period = sector%period()
    allocate (self%diameters(0:self%period/2), source=diameters)
    self%in_modes = in_modes
    allocate (self%rows(size(sector%kept), size(directions, 2), 0:self%period/2))
    do h = 0, self%period/2
      self%rows(:, :, h) = sector%project_rows(directions, sector%diameter(h))
      if (in_modes) self%rows(:, :, h) = matmul(conjg(transpose(self%diameters(h)%modes)), self%rows(:, :, h))
    end do
  end subroutine begin_sector

  !> Psi_n^H S_n^H of columns [n, columns].
  pure function project(self, h, columns) result(projected)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> On the sector's coordinates [m, columns]
    complex(wp), intent(in) :: columns(:, :)
    complex(wp) :: projected(size(self%sector%kept), size(columns, 2))

    projected = self%sector%project(columns, self%sector%diameter(h))
    if (self%in_modes) projected = matmul(transpose(conjg(modes_at(self, h))), projected)
  end function project

  !> Psi_n [n, n].
  pure function modes_at(self, h) result(modes)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    complex(wp) :: modes(size(self%sector%kept), size(self%sector%kept))

    modes = self%diameters(first_alike(h, self%period))%modes
    if (is_mirrored(h, self%period)) modes = conjg(modes)
  end function modes_at

  !> Some rows of B at a harmonic, P_h [n, numbers].
  pure function rows_at(self, h, numbers) result(rows)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic; numbers of the rows, from 1
    integer, intent(in) :: h, numbers(:)
    complex(wp) :: rows(size(self%rows, 1), size(numbers))

    rows = self%rows(:, numbers, first_alike(h, self%period))
    if (is_mirrored(h, self%period)) rows = conjg(rows)
  end function rows_at

  function project_load(self, h, load) result(projected)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> f_h [m]
    complex(wp), intent(in) :: load(:)
    complex(wp), allocatable :: projected(:)

    projected = reshape(self%project(h, reshape(load, [size(load), 1])), [size(self%sector%kept)])
  end function project_load

  function project_loads(self, loads) result(projected)
    class(receptance_cyclic_type), intent(in) :: self
    !> Fourier coefficients of the model's coordinates [m, 2 H + 1]
    real(wp), intent(in) :: loads(:, :)
    complex(wp), allocatable :: projected(:, :)
    complex(wp) :: columns(size(loads, 1), 0:(size(loads, 2) - 1)/2)
    integer :: h

    columns = to_complex(transpose(loads))
    allocate (projected(size(self%sector%kept), 0:ubound(columns, 2)))
    do h = 0, ubound(columns, 2)
      projected(:, h:h) = self%project(h, columns(:, h:h))
    end do
  end function project_loads

  function project_mean_loads(self, loads) result(projected)
    class(receptance_cyclic_type), intent(in) :: self
    !> On the model's coordinates [m, loads]
    real(wp), intent(in) :: loads(:, :)
    real(wp), allocatable :: projected(:, :)

    projected = real(self%project(0, cmplx(loads, kind=wp)), wp)
  end function project_mean_loads

  function project_rows(self, rows) result(projected)
    class(receptance_cyclic_type), intent(in) :: self
    !> In columns [m, rows]
    real(wp), intent(in) :: rows(:, :)
    type(projected_rows_type) :: projected
    complex(wp) :: columns(size(self%sector%kept), size(rows, 2), 0:self%period/2)
    integer :: h

    do h = 0, self%period/2
      columns(:, :, h) = self%project(h, cmplx(rows, kind=wp))
    end do
    projected = new_projected_rows_by_harmonic(columns, self%period)
  end function project_rows

  function contact_rows(self, first, last) result(projected)
    class(receptance_cyclic_type), intent(in) :: self
    !> The first and the last, from 1
    integer, intent(in) :: first, last
    type(projected_rows_type) :: projected

    projected = new_projected_rows_by_harmonic(self%rows(:, first:last, :), self%period)
  end function contact_rows

  function recover(self, h, response) result(displacement)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> x_h [n]
    complex(wp), intent(in) :: response(:)
    complex(wp), allocatable :: displacement(:)
    complex(wp) :: column(size(response), 1)

    column(:, 1) = response
    if (self%in_modes) column = matmul(modes_at(self, h), column)
    displacement = reshape(self%sector%expand(column, self%sector%diameter(h)), [size(self%sector%position)])
  end function recover

  function displacements(self, response) result(coefficients)
    class(receptance_cyclic_type), intent(in) :: self
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: coefficients(:, :)

    coefficients = to_real(all_harmonics(self, response))
  end function displacements

  !> Displacements of all harmonics [m, 0:H].
  function all_harmonics(self, response) result(columns)
    class(receptance_cyclic_type), intent(in) :: self
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp) :: columns(size(self%sector%position), 0:ubound(response, 2))
    integer :: h

    do h = 0, ubound(response, 2)
      columns(:, h) = self%recover(h, response(:, h))
    end do
  end function all_harmonics

  subroutine state_at_start(self, response, omega, displacement, rate)
    class(receptance_cyclic_type), intent(in) :: self
    !> Coordinates of the response, by harmonic [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    !> Angular frequency
    real(wp), intent(in) :: omega
    !> Of the model's coordinates [m]
    real(wp), allocatable, intent(out) :: displacement(:), rate(:)
    complex(wp) :: columns(size(self%sector%position), 0:ubound(response, 2))
    integer :: h

    columns = all_harmonics(self, response)
    displacement = real(sum(columns, 2), wp)
    rate = 0.0_wp*displacement
    do h = 1, ubound(response, 2)
      rate = rate - h*omega*aimag(columns(:, h))
    end do
  end subroutine state_at_start

  pure integer function common_modes(self)
    class(receptance_cyclic_type), intent(in) :: self

    common_modes = 0*self%period
  end function common_modes

  function mode_shapes(self, first, last, rows) result(shapes)
    class(receptance_cyclic_type), intent(in) :: self
    !> The first and the last of the common modes, of which there are none; numbers of contact rows
    integer, intent(in) :: first, last, rows(:)
    real(wp), allocatable :: shapes(:, :)

    if (last > min(first - 1, self%common_modes())) error stop 'receptance: nodal diameters have no modes in common'
    allocate (shapes(0, size(rows)))
  end function mode_shapes

  function low_stiffness(self, h, low) result(stiffness)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic; number of lowest common modes, of which there are none
    integer, intent(in) :: h, low
    complex(wp) :: stiffness(low)

    if (low > self%common_modes()) error stop 'receptance: nodal diameters have no modes in common'
    stiffness = h
  end function low_stiffness

  subroutine block_between(self, h, rows_a, rows_b, block)
    class(receptance_cyclic_type), intent(in) :: self
    !> Number of the harmonic; numbers of contact rows
    integer, intent(in) :: h, rows_a(:), rows_b(:)
    !> Block of the matrix, by harmonic
    complex(wp), intent(out) :: block(:, :)
    complex(wp) :: columns(size(self%rows, 1), size(rows_b))

    columns = self%rows_at(h, rows_b)
    call self%solve(h, columns)
    block = matmul(conjg(transpose(self%rows_at(h, rows_a))), columns)
    if (h == 0) block = real(block, wp)
  end subroutine block_between
end module attrito_linear_receptance_cyclic
