!> Receptance in the modes of the stuck system: diagonal, exact for damping that leaves these modes uncoupled.
!>
!> $$ X_{hr} = F_{hr} / (k_r - (h \omega)^2 m_r + i h \omega c_r), \qquad c_r = 2 \zeta \omega_r m_r \text{ or } \alpha m_r $$
module attrito_linear_receptance_modal
  use attrito_core_kinds, only: wp
  use attrito_linear_modal_stiffness, only: modal_stiffness, modal_stiffness_rate, finite_stiffness
  use attrito_linear_opened_modes, only: find_opened_modes
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_receptance_real, only: receptance_real_type
  implicit none
  private
  public :: receptance_modal_type, new_receptance_modal

  type, extends(receptance_real_type) :: receptance_modal_type
    !> Modal stiffness, mass and damping [n], however the modes are normalised
    real(wp), allocatable :: modal_stiffness(:), modal_mass(:), modal_damping(:)
    !> Dynamic flexibility at this frequency [n, 0:H]
    complex(wp), allocatable, private :: flexibility(:, :)
  contains
    procedure :: allocate_factors
    procedure :: factor
    procedure :: solve
    procedure :: stiffness_rate
    procedure :: respond_beyond
    procedure :: inertia_of
    procedure :: block_between
    procedure :: mode_shapes
    procedure :: low_stiffness
    procedure :: uncoupled_modes
    procedure :: without_springs
  end type receptance_modal_type

contains

  !> From the modes of (K~, M) [m, n], what they carry [n], and the rows of B in columns [m, rows].
  function new_receptance_modal(modal_stiffness, modal_mass, modal_damping, modes, directions, harmonics) result(self)
    real(wp), intent(in) :: modal_stiffness(:), modal_mass(:), modal_damping(:), modes(:, :), directions(:, :)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    type(receptance_modal_type) :: self

    self%modal_stiffness = modal_stiffness
    self%modal_mass = modal_mass
    self%modal_damping = modal_damping
    self%basis = modes
    self%directions = matmul(transpose(modes), directions)
    call self%set_harmonics(harmonics)
  end function new_receptance_modal

  subroutine allocate_factors(self, harmonics)
    class(receptance_modal_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    if (allocated(self%flexibility)) deallocate (self%flexibility)
    allocate (self%flexibility(size(self%modal_mass), 0:harmonics))
  end subroutine allocate_factors

  subroutine factor(self, h, omega, status)
    class(receptance_modal_type), intent(inout) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> 0, or not: a mode resonates undamped
    integer, intent(out) :: status
    complex(wp) :: stiffness(size(self%modal_mass))
    real(wp) :: square(size(self%modal_mass))

    call modal_stiffness(self, h, omega, self%modal_stiffness, self%modal_mass, self%modal_damping, stiffness, status)
    ! Not by a division of complex numbers, whose care for overflow is not needed and takes several times as long.
    square = real(stiffness, wp)**2 + aimag(stiffness)**2
    self%flexibility(:, h) = cmplx(real(stiffness, wp)/square, -aimag(stiffness)/square, wp)
  end subroutine factor

  subroutine solve(self, h, columns)
    class(receptance_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)
    integer :: i

    do i = 1, size(columns, 2)
      columns(:, i) = columns(:, i)*self%flexibility(:, h)
    end do
  end subroutine solve

  function stiffness_rate(self, h, response) result(product)
    class(receptance_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> x_h [n]
    complex(wp), intent(in) :: response(:)
    complex(wp) :: product(size(response))

    product = modal_stiffness_rate(self, h, self%modal_mass, self%modal_damping)*response
  end function stiffness_rate

  subroutine respond_beyond(self, first, omega, least_ratio, force, response)
    class(receptance_modal_type), intent(in) :: self
    !> Harmonic to begin at
    integer, intent(in) :: first
    !> Angular frequency, rad/s; damping ratio of modes that have no damping
    real(wp), intent(in) :: omega, least_ratio
    !> Forces on the coordinates from that harmonic on
    complex(wp), intent(in) :: force(:, :)
    !> Coordinates of the response from that harmonic on
    complex(wp), intent(out) :: response(:, :)
    integer :: i

    do i = 1, size(force, 2)
      response(:, i) = force(:, i)/finite_stiffness((first + i - 1)*omega, self%modal_stiffness, self%modal_mass, &
                                                    self%modal_damping, 0.0_wp, least_ratio)
    end do
  end subroutine respond_beyond

  subroutine inertia_of(self, response, product)
    class(receptance_modal_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    !> Product with the mass, by harmonic
    complex(wp), intent(out) :: product(:, 0:)

    product = spread(self%modal_mass, 2, size(response, 2))*response
  end subroutine inertia_of

  subroutine block_between(self, h, rows_a, rows_b, block)
    class(receptance_modal_type), intent(in) :: self
    !> Number of the harmonic; numbers of contact rows
    integer, intent(in) :: h, rows_a(:), rows_b(:)
    !> Block of the matrix, by harmonic
    complex(wp), intent(out) :: block(:, :)
    complex(wp) :: flexibility(size(self%modal_mass))
    real(wp) :: a(size(rows_a), size(self%modal_mass)), b(size(self%modal_mass), size(rows_b))
    real(wp) :: re(size(rows_a), size(rows_b)), im(size(rows_a), size(rows_b))

    flexibility = self%flexibility(:, h)
    a = transpose(self%directions(:, rows_a))
    b = self%directions(:, rows_b)
    re = matmul(a, spread(real(flexibility, wp), 2, size(rows_b))*b)
    if (h == 0) then
      im = 0.0_wp
    else
      im = matmul(a, spread(aimag(flexibility), 2, size(rows_b))*b)
    end if
    block = cmplx(re, im, wp)
  end subroutine block_between

  function mode_shapes(self, first, last, rows) result(shapes)
    class(receptance_modal_type), intent(in) :: self
    !> The first and the last of the modes; numbers of contact rows
    integer, intent(in) :: first, last, rows(:)
    real(wp), allocatable :: shapes(:, :)

    shapes = self%directions(first:last, rows)
  end function mode_shapes

  function low_stiffness(self, h, low) result(stiffness)
    class(receptance_modal_type), intent(in) :: self
    !> Number of the harmonic; number of lowest modes
    integer, intent(in) :: h, low
    complex(wp) :: stiffness(low)

    stiffness = 1.0_wp/self%flexibility(:low, h)
  end function low_stiffness

  subroutine uncoupled_modes(self, stiffness, mass, damping)
    class(receptance_modal_type), intent(in) :: self
    !> Stiffness, of each mode or as a matrix; mass, of each mode or as a matrix; damping of each mode
    real(wp), allocatable, intent(out) :: stiffness(:), mass(:), damping(:)

    if (self%is_lifted()) then
      ! Not alike at all harmonics.
      allocate (stiffness(0), mass(0), damping(0))
      return
    end if
    stiffness = self%modal_stiffness
    mass = self%modal_mass
    damping = self%modal_damping - self%excitation*self%modal_mass
  end subroutine uncoupled_modes

  subroutine without_springs(self, rows, springs, opened)
    class(receptance_modal_type), intent(in) :: self
    !> Rows of B, from 1, and their springs
    integer, intent(in) :: rows(:)
    real(wp), intent(in) :: springs(:)
    !> For as many harmonics, set to no frequency
    class(receptance_type), allocatable, intent(out) :: opened
    real(wp), allocatable :: modes(:, :), modal_mass(:)
    integer :: i, status

    call find_opened_modes(diagonal(self%modal_stiffness), diagonal(self%modal_mass), self%directions(:, rows), springs, modes, &
                           modal_mass, status)
    if (status /= 0) return
    opened = new_receptance_modal([(1.0_wp, i=1, size(modal_mass))], modal_mass, matmul(self%modal_damping, modes**2), modes, &
                                  self%directions, self%harmonics)
    opened%lowest = self%lowest
  end subroutine without_springs

  !> A diagonal matrix.
  pure function diagonal(values) result(matrix)
    !> What stands on it [n]
    real(wp), intent(in) :: values(:)
    real(wp) :: matrix(size(values), size(values))
    integer :: i

    matrix = 0.0_wp
    do i = 1, size(values)
      matrix(i, i) = values(i)
    end do
  end function diagonal
end module attrito_linear_receptance_modal
