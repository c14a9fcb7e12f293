!> One of N equal sectors of a structure with cyclic symmetry, under a travelling wave of engine order EO:
!>
!> $$ q_{j+1}(t) = q_j(t - EO \, T / N), \qquad Q_{j+1,h} = e^{-i h \theta} Q_{j,h}, \quad \theta = 2 \pi EO / N $$
!>
!> in axes that turn with the sector, so harmonic h has nodal diameter n = h EO mod N. The sector's upper boundary is the lower one of
!> the next sector:
!>
!> $$ q_h = S_n x_h, \qquad S_n = \begin{bmatrix} I \\ e^{-2 \pi i n / N} \text{ on the upper boundary} \end{bmatrix}, \qquad
!>    A_n = S_n^H A S_n, \qquad d_h = (B + e^{-2 \pi i n / N} B_{next}) S_n x_h $$
!>
!> x are the coordinates without the upper boundary. A_{N-n} is the conjugate of A_n, and that of n = 0, the mean's, is real.
!> Source: Thomas 1979, Int. J. Numer. Methods Eng. 14, 81-102.
!>
!> A node on the axis is in all sectors at once, and a sector's matrices hold a share of what belongs to it. Sector j sees its
!> displacement a as R^-j a, R being the rotation by 2 pi / N. In the wave that is exp(-2 pi i n j / N) a, so a is an eigenvector,
!>
!> $$ R a = e^{2 \pi i n / N} a: \qquad n = 0: \text{ along the axis}; \quad n = \pm 1: \; (1, \mp i) / \sqrt 2 \text{ across it};
!>    \quad \text{else } 0 $$
!>
!> In wheels of two sectors n = 1 is -1, and has both directions across; a single sector is any structure. So each coordinate of a
!> sector is one of x times a factor, here as elsewhere; what does not move at a nodal diameter has the factor 0.
module attrito_model_sector
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: to_complex, to_real
  implicit none
  private
  public :: sector_type, new_sector, first_alike, is_mirrored

  type :: sector_type
    !> N and EO; a wave of negative order runs the other way round
    integer :: sectors = 1, engine_order = 0
    !> Coordinates of the lower and of the upper boundary, in pairs, from 1
    integer, allocatable :: lower(:), upper(:)
    !> Rows of B on the next sector's coordinates, in columns [m, rows]
    real(wp), allocatable :: next(:, :)
    !> Coordinates of nodes on the axis, from 1: along it, and across it in pairs [2, pairs], the second a quarter turn ahead
    integer, allocatable :: along(:), across(:, :)
    !> Coordinates that x has, ascending [n]; where each coordinate of the sector is found among them [m], and 1 for those that are
    !> the next sector's [m]
    integer, allocatable :: kept(:), position(:), of_next(:)
  contains
    procedure :: diameter
    procedure :: period
    procedure :: phase_factor
    procedure :: moving
    procedure, private :: axis_factors
    procedure :: couple
    procedure :: project
    procedure :: expand
    procedure :: project_rows
    procedure :: mean_rows
    procedure :: next_motion
  end type sector_type

contains

  !> From its boundary, the rows of contacts on the next sector, and what it has on the axis.
  pure function new_sector(sectors, engine_order, lower, upper, next, along, across) result(self)
    !> N; EO
    integer, intent(in) :: sectors, engine_order
    !> Coordinates of the lower and of the upper boundary, in pairs, from 1
    integer, intent(in) :: lower(:), upper(:)
    !> Rows of B on the next sector's coordinates, in columns [m, rows]
    real(wp), intent(in) :: next(:, :)
    !> Coordinates of nodes on the axis, from 1: along it, and across it in pairs [2, pairs], the second a quarter turn ahead
    integer, intent(in), optional :: along(:), across(:, :)
    type(sector_type) :: self
    logical :: is_kept(size(next, 1))
    integer :: i

    self%sectors = sectors
    self%engine_order = engine_order
    self%lower = lower
    self%upper = upper
    self%next = next
    allocate (self%of_next(size(next, 1)), self%position(size(next, 1)), source=0)
    self%of_next(upper) = 1
    allocate (self%along(0), self%across(2, 0))
    if (present(along)) self%along = along
    if (present(across)) self%across = across
    is_kept = self%of_next == 0
    ! One coordinate of a pair says both where the wave turns it.
    if (sectors > 2) is_kept(self%across(2, :)) = .false.
    self%kept = pack([(i, i=1, size(next, 1))], is_kept)
    self%position(self%kept) = [(i, i=1, size(self%kept))]
    self%position(upper) = self%position(lower)
    self%position(self%across(2, :)) = self%position(merge(self%across(1, :), self%across(2, :), sectors > 2))
  end function new_sector

  !> Nodal diameter of a harmonic, 0 ... N - 1.
  pure elemental integer function diameter(self, h)
    class(sector_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h

    diameter = modulo(h*self%engine_order, self%sectors)
  end function diameter

  !> Harmonics after which nodal diameters repeat, N / gcd(N, EO).
  pure integer function period(self)
    class(sector_type), intent(in) :: self

    do period = 1, self%sectors
      if (self%diameter(period) == 0) exit
    end do
  end function period

  !> The first harmonic, 0 ... half a period, with the nodal diameter of another one or its mirror image.
  pure integer function first_alike(h, period)
    !> Number of the harmonic; harmonics after which nodal diameters repeat
    integer, intent(in) :: h, period

    first_alike = modulo(h, period)
    if (is_mirrored(h, period)) first_alike = period - first_alike
  end function first_alike

  !> Is it the mirror image, N - n?
  pure logical function is_mirrored(h, period)
    !> Number of the harmonic; harmonics after which nodal diameters repeat
    integer, intent(in) :: h, period

    is_mirrored = modulo(h, period) > period/2
  end function is_mirrored

  !> exp(-2 pi i n / N), and exactly so where it is real.
  pure complex(wp) function phase_factor(self, n)
    class(sector_type), intent(in) :: self
    !> Nodal diameter
    integer, intent(in) :: n

    phase_factor = exp(cmplx(0.0_wp, -two_pi*n/self%sectors, wp))
    if (modulo(2*n, self%sectors) == 0) phase_factor = merge(1, -1, modulo(n, self%sectors) == 0)
  end function phase_factor

  !> The factor of each coordinate that says what is on the axis, 1 of the others [m].
  pure function axis_factors(self, n) result(factors)
    class(sector_type), intent(in) :: self
    !> Nodal diameter
    integer, intent(in) :: n
    complex(wp) :: factors(size(self%position))
    integer :: turns

    factors = 1.0_wp
    if (self%sectors == 1) return
    turns = modulo(n, self%sectors)
    if (turns /= 0) factors(self%along) = 0.0_wp
    if (turns /= 1 .and. turns /= self%sectors - 1) then
      factors(self%across(1, :)) = 0.0_wp
      factors(self%across(2, :)) = 0.0_wp
    else if (self%sectors > 2) then
      factors(self%across(1, :)) = sqrt(0.5_wp)
      factors(self%across(2, :)) = cmplx(0.0_wp, merge(-1, 1, turns == 1)*sqrt(0.5_wp), wp)
    end if
  end function axis_factors

  !> Of the coordinates x, those that move at a nodal diameter, ascending: all but some of nodes on the axis.
  pure function moving(self, n) result(numbers)
    class(sector_type), intent(in) :: self
    !> Nodal diameter
    integer, intent(in) :: n
    integer, allocatable :: numbers(:)
    complex(wp) :: factors(size(self%position))
    integer :: i

    factors = self%axis_factors(n)
    numbers = pack([(i, i=1, size(self%kept))], abs(factors(self%kept)) > 0.0_wp)
  end function moving

  !> S_n^H A S_n [n, n]; zero where a coordinate does not move.
  pure function couple(self, matrix, n) result(coupled)
    class(sector_type), intent(in) :: self
    !> A, of the sector's coordinates [m, m]
    real(wp), intent(in) :: matrix(:, :)
    !> Nodal diameter
    integer, intent(in) :: n
    complex(wp) :: coupled(size(self%kept), size(self%kept))
    complex(wp) :: turns(-1:1), factors(size(self%position))
    integer :: i, j

    turns = [conjg(self%phase_factor(n)), (1.0_wp, 0.0_wp), self%phase_factor(n)]
    factors = self%axis_factors(n)
    coupled = 0.0_wp
    do j = 1, size(matrix, 2)
      do i = 1, size(matrix, 1)
        associate (at => coupled(self%position(i), self%position(j)))
          at = at + turns(self%of_next(j) - self%of_next(i))*conjg(factors(i))*factors(j)*matrix(i, j)
        end associate
      end do
    end do
  end function couple

  !> S_n^H f of columns [n, columns].
  pure function project(self, columns, n) result(projected)
    class(sector_type), intent(in) :: self
    !> Loads on the sector's coordinates [m, columns]
    complex(wp), intent(in) :: columns(:, :)
    !> Nodal diameter
    integer, intent(in) :: n
    complex(wp) :: projected(size(self%kept), size(columns, 2))
    complex(wp) :: factors(size(self%position))

    factors = conjg(self%axis_factors(n))
    projected = spread(factors(self%kept), 2, size(columns, 2))*columns(self%kept, :)
    associate (at => self%position(self%lower))
      projected(at, :) = projected(at, :) + conjg(self%phase_factor(n))*columns(self%upper, :)
    end associate
    if (self%sectors <= 2) return
    associate (at => self%position(self%across(2, :)))
      projected(at, :) = projected(at, :) + spread(factors(self%across(2, :)), 2, size(columns, 2))*columns(self%across(2, :), :)
    end associate
  end function project

  !> S_n x of columns [m, columns].
  pure function expand(self, columns, n) result(displacements)
    class(sector_type), intent(in) :: self
    !> x [n, columns]
    complex(wp), intent(in) :: columns(:, :)
    !> Nodal diameter
    integer, intent(in) :: n
    complex(wp) :: displacements(size(self%position), size(columns, 2))

    displacements = spread(self%axis_factors(n), 2, size(columns, 2))*columns(self%position, :)
    displacements(self%upper, :) = self%phase_factor(n)*displacements(self%upper, :)
  end function expand

  !> ((B + e^{-2 pi i n/N} B_next) S_n)^H, in columns [n, rows].
  pure function project_rows(self, here, n) result(projected)
    class(sector_type), intent(in) :: self
    !> Rows of B on the sector itself, in columns [m, rows]
    real(wp), intent(in) :: here(:, :)
    !> Nodal diameter
    integer, intent(in) :: n
    complex(wp) :: projected(size(self%kept), size(here, 2))

    projected = self%project(here + conjg(self%phase_factor(n))*self%next, n)
  end function project_rows

  !> The same of the mean: real [n, rows].
  pure function mean_rows(self, here) result(projected)
    class(sector_type), intent(in) :: self
    !> Rows of B on the sector itself, in columns [m, rows]
    real(wp), intent(in) :: here(:, :)
    real(wp) :: projected(size(self%kept), size(here, 2))

    projected = real(self%project_rows(here, 0), wp)
  end function mean_rows

  !> What the next sector's motion adds to relative displacements at some rows, B_next q_1(t) [2 H + 1, rows].
  pure function next_motion(self, displacements, first, rows) result(motion)
    class(sector_type), intent(in) :: self
    !> Fourier coefficients of the sector's coordinates [2 H + 1, m]
    real(wp), intent(in) :: displacements(:, :)
    !> First of the rows, from 1, and how many
    integer, intent(in) :: first, rows
    real(wp) :: motion(size(displacements, 1), rows)
    complex(wp) :: columns(rows, 0:(size(displacements, 1) - 1)/2)
    integer :: h

    columns = to_complex(matmul(displacements, self%next(:, first:first + rows - 1)))
    do h = 0, ubound(columns, 2)
      columns(:, h) = self%phase_factor(self%diameter(h))*columns(:, h)
    end do
    motion = to_real(columns)
  end function next_motion
end module attrito_model_sector
