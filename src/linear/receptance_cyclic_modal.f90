!> Receptance of a sector in the modes of each nodal diameter: diagonal, exact for damping that leaves these modes uncoupled.
!>
!> $$ X_{hr} = F_{hr} / (k_{nr} - (h \omega)^2 m_{nr} + i h \omega c_{nr}), \qquad n = h \, EO \bmod N $$
module attrito_linear_receptance_cyclic_modal
  use attrito_core_kinds, only: wp
  use attrito_model_sector, only: sector_type, first_alike
  use attrito_linear_diameter_modes, only: diameter_modes_type
  use attrito_linear_receptance_cyclic, only: receptance_cyclic_type, find_rows
  implicit none
  private
  public :: receptance_cyclic_modal_type, new_receptance_cyclic_modal

  type, extends(receptance_cyclic_type) :: receptance_cyclic_modal_type
    !> Dynamic flexibility at this frequency [n, 0:H]
    complex(wp), allocatable, private :: flexibility(:, :)
  contains
    procedure :: set_harmonics
    procedure :: set_frequency
    procedure :: respond
    procedure :: respond_adjoint
    procedure :: respond_derivative
    procedure :: respond_beyond
    procedure :: inertia_of
    procedure :: block_between
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

    self%sector = sector
    self%period = sector%period()
    allocate (self%diameters(0:self%period/2), source=diameters)
    self%in_modes = .true.
    call find_rows(self, directions)
    call self%set_harmonics(harmonics)
  end function new_receptance_cyclic_modal

  subroutine set_harmonics(self, harmonics)
    class(receptance_cyclic_modal_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    self%harmonics = harmonics
    self%omega = -1.0_wp
    if (allocated(self%flexibility)) deallocate (self%flexibility)
    allocate (self%flexibility(size(self%sector%kept), 0:harmonics))
  end subroutine set_harmonics

  subroutine set_frequency(self, omega, status, highest)
    class(receptance_cyclic_modal_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    !> Highest harmonic
    integer, intent(in), optional :: highest
    complex(wp) :: stiffness(size(self%sector%kept))
    integer :: h, last

    status = 0
    last = self%harmonics
    if (present(highest)) last = min(highest, last)
    if (self%is_set(omega, last)) return
    self%highest = last
    do h = 0, last
      stiffness = stiffness_at(self, h, omega)
      if (any(abs(stiffness) <= 0.0_wp)) then
        if (h >= self%lowest) status = 1
        stiffness = 1.0_wp
      end if
      self%flexibility(:, h) = 1.0_wp/stiffness
    end do
    ! Refused as often as it is asked for.
    self%omega = merge(omega, -1.0_wp, status == 0)
  end subroutine set_frequency

  !> Dynamic stiffness of the modes at a harmonic, with what excitation and springs make of it [n].
  pure function stiffness_at(self, h, omega) result(stiffness)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    complex(wp) :: stiffness(size(self%sector%kept))

    associate (modes => self%diameters(first_alike(h, self%period)))
      stiffness = cmplx(modes%modal_stiffness - (h*omega)**2*modes%modal_mass, h*omega*damping_at(self, h), wp)
    end associate
    if (h == 0) stiffness = (1.0_wp + self%held)*stiffness
    if (h == 1 .and. self%lifted_mode > 0) stiffness(self%lifted_mode) = stiffness(self%lifted_mode) + self%lift
  end function stiffness_at

  !> What the modes at a harmonic are damped by, with what is taken away [n].
  pure function damping_at(self, h) result(damping)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    real(wp) :: damping(size(self%sector%kept))

    associate (modes => self%diameters(first_alike(h, self%period)))
      damping = modes%modal_damping - self%excitation*modes%modal_mass
    end associate
  end function damping_at

  subroutine respond(self, force, response)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Forces on the coordinates, by harmonic
    complex(wp), intent(in) :: force(:, 0:)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    if (ubound(force, 2) > self%highest) error stop 'receptance: asked beyond the harmonics that it is set for'
    response(:, :self%lowest - 1) = 0.0_wp
    associate (low => self%lowest, high => ubound(force, 2))
      response(:, low:) = force(:, low:)*self%flexibility(:, low:high)
    end associate
  end subroutine respond

  subroutine respond_adjoint(self, force, response)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Forces on the coordinates, by harmonic
    complex(wp), intent(in) :: force(:, 0:)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    response(:, :self%lowest - 1) = 0.0_wp
    associate (low => self%lowest, high => ubound(force, 2))
      response(:, low:) = force(:, low:)*conjg(self%flexibility(:, low:high))
    end associate
  end subroutine respond_adjoint

  subroutine respond_derivative(self, response, derivative)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    !> Derivative by the frequency
    complex(wp), intent(out) :: derivative(:, 0:)
    complex(wp) :: force(size(response, 1), 0:ubound(response, 2))
    integer :: h

    do h = 0, ubound(response, 2)
      associate (modes => self%diameters(first_alike(h, self%period)))
        force(:, h) = cmplx(2.0_wp*h**2*self%omega*modes%modal_mass, -h*damping_at(self, h), wp)*response(:, h)
      end associate
    end do
    call self%respond(force, derivative)
  end subroutine respond_derivative

  subroutine respond_beyond(self, omega, least_ratio, force, response)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Angular frequency, rad/s; damping ratio of modes that have no damping
    real(wp), intent(in) :: omega, least_ratio
    !> Forces on the coordinates from harmonic H + 1 on
    complex(wp), intent(in) :: force(:, :)
    !> Coordinates of the response from harmonic H + 1 on
    complex(wp), intent(out) :: response(:, :)
    real(wp) :: damping(size(force, 1))
    integer :: i

    do i = 1, size(force, 2)
      associate (h => self%harmonics + i, modes => self%diameters(first_alike(self%harmonics + i, self%period)))
        damping = modes%modal_damping
        where (damping <= 0.0_wp) damping = 2.0_wp*least_ratio*sqrt(modes%modal_stiffness*modes%modal_mass)
        response(:, i) = force(:, i)/cmplx(modes%modal_stiffness - (h*omega)**2*modes%modal_mass, h*omega*damping, wp)
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

  subroutine block_between(self, h, rows_a, rows_b, block)
    class(receptance_cyclic_modal_type), intent(in) :: self
    !> Number of the harmonic; numbers of contact rows
    integer, intent(in) :: h, rows_a(:), rows_b(:)
    !> Block of the matrix, by harmonic
    complex(wp), intent(out) :: block(:, :)

    block = matmul(conjg(transpose(self%rows_at(h, rows_a))), &
                   spread(self%flexibility(:, h), 2, size(rows_b))*self%rows_at(h, rows_b))
    if (h == 0) block = real(block, wp)
  end subroutine block_between
end module attrito_linear_receptance_cyclic_modal
