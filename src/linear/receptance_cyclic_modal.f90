!> Receptance of a sector in the modes of each nodal diameter: diagonal, exact for damping that leaves these modes uncoupled.
!>
!> $$ X_{hr} = F_{hr} / (k_{nr} - (h \omega)^2 m_{nr} + i h \omega c_{nr}), \qquad n = h \, EO \bmod N $$
module attrito_linear_receptance_cyclic_modal
  use attrito_core_kinds, only: wp
  use attrito_model_sector, only: sector_type, first_alike
  use attrito_linear_diameter_modes, only: diameter_modes_type
  use attrito_linear_modal_stiffness, only: modal_stiffness, modal_stiffness_rate, finite_stiffness
  use attrito_linear_receptance_cyclic, only: receptance_cyclic_type, begin_sector
  implicit none
  private
  public :: receptance_cyclic_modal_type, new_receptance_cyclic_modal

  type, extends(receptance_cyclic_type) :: receptance_cyclic_modal_type
    !> Dynamic flexibility at this frequency [n, 0:H]
    complex(wp), allocatable, private :: flexibility(:, :)
  contains
    procedure :: allocate_factors
    procedure :: factor
    procedure :: solve
    procedure :: solve_adjoint
    procedure :: stiffness_rate
    procedure :: respond_beyond
    procedure :: inertia_of
  end type receptance_cyclic_modal_type

contains

  !> From the modes of all nodal diameters and the rows of B on the sector itself.
  function new_receptance_cyclic_modal(sector, diameters, directions, harmonics) result(self)
    !> How sectors hang together
    type(sector_type), intent(in) :: sector
    !> Modes of the stuck system, by harmonic [0:period/2]
    type(diameter_modes_type), intent(in) :: diameters(0:)
    !> In columns [m, rows]
    real(wp), intent(in) :: directions(:, :)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    type(receptance_cyclic_modal_type) :: self

    call begin_sector(self, sector, diameters, .true., directions)
    call self%set_harmonics(harmonics)
  end function new_receptance_cyclic_modal

  subroutine allocate_factors(self, harmonics)
    class(receptance_cyclic_modal_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    if (allocated(self%flexibility)) deallocate (self%flexibility)
    allocate (self%flexibility(size(self%sector%kept), 0:harmonics))
  end subroutine allocate_factors

  subroutine factor(self, h, omega, status)
    class(receptance_cyclic_modal_type), intent(inout) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> 0, or not: a mode resonates undamped
    integer, intent(out) :: status
    complex(wp) :: stiffness(size(self%sector%kept))

    associate (modes => self%diameters(first_alike(h, self%period)))
      call modal_stiffness(self, h, omega, modes%modal_stiffness, modes%modal_mass, modes%modal_damping, stiffness, status)
    end associate
    self%flexibility(:, h) = 1.0_wp/stiffness
  end subroutine factor

  subroutine solve(self, h, columns)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    columns = spread(self%flexibility(:, h), 2, size(columns, 2))*columns
  end subroutine solve

  subroutine solve_adjoint(self, h, columns)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    columns = spread(conjg(self%flexibility(:, h)), 2, size(columns, 2))*columns
  end subroutine solve_adjoint

  function stiffness_rate(self, h, response) result(product)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> x_h [n]
    complex(wp), intent(in) :: response(:)
    complex(wp) :: product(size(response))

    associate (modes => self%diameters(first_alike(h, self%period)))
      product = modal_stiffness_rate(self, h, modes%modal_mass, modes%modal_damping)*response
    end associate
  end function stiffness_rate

  subroutine respond_beyond(self, first, omega, least_ratio, force, response)
    class(receptance_cyclic_modal_type), intent(in) :: self
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
      associate (h => first + i - 1, modes => self%diameters(first_alike(first + i - 1, self%period)))
        response(:, i) = force(:, i)/finite_stiffness(h*omega, modes%modal_stiffness, modes%modal_mass, modes%modal_damping, &
                                                      0.0_wp, least_ratio)
      end associate
    end do
  end subroutine respond_beyond

  subroutine inertia_of(self, response, product)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    !> Product with the mass, by harmonic
    complex(wp), intent(out) :: product(:, 0:)
    integer :: h

    do h = 0, ubound(response, 2)
      product(:, h) = self%diameters(first_alike(h, self%period))%modal_mass*response(:, h)
    end do
  end subroutine inertia_of
end module attrito_linear_receptance_cyclic_modal
