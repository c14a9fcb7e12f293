!> Receptance of a sector by a dense factorisation per harmonic: for any damping, and with Coriolis forces. Slower than modes, never
!> wrong.
!>
!> $$ Z_h = \tilde K_n - (h \omega)^2 M_n + i h \omega (C_n + G_n) + i \eta K_n \; [h > 0], \qquad n = h \, EO \bmod N $$
!>
!> G_n = S_n^H G S_n is skew-Hermitian, so that i h omega G_n is Hermitian as stiffness and mass are, but changes its sign from the
!> wave of diameter n to the one that runs the other way round: conj(G_n) = G_(N - n).
module attrito_linear_receptance_cyclic_direct
  use attrito_core_kinds, only: wp
  use attrito_model_sector, only: first_alike, is_mirrored
  use attrito_model_structure, only: structure_type, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_linear_diameter_modes, only: diameter_modes_type
  use attrito_linear_harmonic_factors, only: harmonic_factors_type
  use attrito_linear_modal_stiffness, only: finite_stiffness
  use attrito_linear_receptance_cyclic, only: receptance_cyclic_type, begin_sector
  implicit none
  private
  public :: receptance_cyclic_direct_type, new_receptance_cyclic_direct

  type, extends(receptance_cyclic_type) :: receptance_cyclic_direct_type
    !> M_n, viscous C_n, with G_n where there are Coriolis forces, and eta K_n [n, n, 0:period/2]
    complex(wp), allocatable, private :: mass(:, :, :), viscous(:, :, :), structural(:, :, :)
    !> Of Z_h [n, n]
    type(harmonic_factors_type), private :: factors
  contains
    procedure :: allocate_factors
    procedure :: factor
    procedure :: solve
    procedure :: solve_adjoint
    procedure :: stiffness_rate
    procedure :: respond_beyond
    procedure :: inertia_of
  end type receptance_cyclic_direct_type

contains

  !> From the sector's matrices, the modes of all nodal diameters and the rows of B on the sector itself.
  function new_receptance_cyclic_direct(structure, diameters, directions, harmonics) result(self)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> Modes of the stuck system, by harmonic [0:period/2]
    type(diameter_modes_type), intent(in) :: diameters(0:)
    !> In columns [m, rows]
    real(wp), intent(in) :: directions(:, :)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    type(receptance_cyclic_direct_type) :: self
    integer :: h, n

    call begin_sector(self, structure%sector, diameters, .false., directions)
    n = size(self%sector%kept)
    allocate (self%mass(n, n, 0:self%period/2), self%viscous(n, n, 0:self%period/2), self%structural(n, n, 0:self%period/2))
    self%viscous = 0.0_wp
    self%structural = 0.0_wp
    do h = 0, self%period/2
      associate (diameter => self%sector%diameter(h))
        self%mass(:, :, h) = self%sector%couple(structure%mass, diameter)
        if (structure%damping_kind == damping_viscous) self%viscous(:, :, h) = self%sector%couple(structure%damping, diameter)
        if (structure%damping_kind == damping_mass) self%viscous(:, :, h) = structure%damping_value*self%mass(:, :, h)
        if (structure%damping_kind == damping_ratio) self%viscous(:, :, h) = damping_by_modes(self%mass(:, :, h), diameters(h))
        if (structure%damping_kind == damping_loss_factor) self%structural(:, :, h) = &
          structure%damping_value*self%sector%couple(structure%stiffness, diameter)
        if (allocated(structure%gyroscopic)) self%viscous(:, :, h) = self%viscous(:, :, h) &
                                                                     + self%sector%couple(structure%gyroscopic, diameter)
      end associate
    end do
    call self%set_harmonics(harmonics)
  end function new_receptance_cyclic_direct

  !> The matrix that damps each mode by itself, C = sum c_r M x_r x_r^H M / m_r^2 [n, n].
  pure function damping_by_modes(mass, modes) result(damping)
    !> M_n [n, n]
    complex(wp), intent(in) :: mass(:, :)
    !> With the damping of each
    type(diameter_modes_type), intent(in) :: modes
    complex(wp) :: damping(size(mass, 1), size(mass, 1))
    complex(wp) :: inertia(size(mass, 1), size(mass, 1))

    inertia = matmul(mass, modes%modes)
    damping = matmul(inertia*spread(modes%modal_damping/modes%modal_mass**2, 1, size(mass, 1)), conjg(transpose(inertia)))
  end function damping_by_modes

  subroutine allocate_factors(self, harmonics)
    class(receptance_cyclic_direct_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    call self%factors%resize(size(self%sector%kept), harmonics)
  end subroutine allocate_factors

  subroutine factor(self, h, omega, status)
    class(receptance_cyclic_direct_type), intent(inout) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> 0, or not: Z_h is singular
    integer, intent(out) :: status

    call self%factors%factor(h, stiffness_at(self, h, omega), status)
  end subroutine factor

  !> Z_h [n, n].
  pure function stiffness_at(self, h, omega) result(stiffness)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    complex(wp) :: stiffness(size(self%mass, 1), size(self%mass, 1))
    complex(wp) :: inertia(size(self%mass, 1))
    complex(wp), parameter :: i = (0.0_wp, 1.0_wp)
    integer :: lifted

    associate (at => first_alike(h, self%period))
      associate (modes => self%diameters(at), mass => self%mass(:, :, at))
        if (h == 0) then
          stiffness = (1.0_wp + self%held)*modes%stiffness
          return
        end if
        stiffness = modes%stiffness - (h*omega)**2*mass
        if (h == 1 .and. self%is_lifted()) then
          do lifted = 1, size(self%lifts)
            inertia = matmul(mass, modes%modes(:, self%lifted_modes(lifted)))
            inertia = inertia/dot_product(modes%modes(:, self%lifted_modes(lifted)), inertia)
            stiffness = stiffness + self%lifts(lifted)*spread(inertia, 2, size(inertia))*spread(conjg(inertia), 1, size(inertia))
          end do
        end if
      end associate
      if (is_mirrored(h, self%period)) stiffness = conjg(stiffness)
      stiffness = stiffness + i*(h*omega*damping_at(self, h) + of_harmonic(self, self%structural, h))
    end associate
  end function stiffness_at

  !> One of the matrices by nodal diameter, at a harmonic [n, n].
  pure function of_harmonic(self, matrices, h) result(matrix)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> By nodal diameter [n, n, 0:period/2]
    complex(wp), intent(in) :: matrices(:, :, 0:)
    !> Number of the harmonic
    integer, intent(in) :: h
    complex(wp) :: matrix(size(matrices, 1), size(matrices, 1))

    matrix = matrices(:, :, first_alike(h, self%period))
    if (is_mirrored(h, self%period)) matrix = conjg(matrix)
  end function of_harmonic

  !> Viscous damping and Coriolis forces at a harmonic, with what is taken away [n, n].
  pure function damping_at(self, h) result(damping)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    complex(wp) :: damping(size(self%mass, 1), size(self%mass, 1))

    damping = of_harmonic(self, self%viscous, h) - self%excitation*of_harmonic(self, self%mass, h)
  end function damping_at

  subroutine solve(self, h, columns)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    call self%factors%solve(h, columns)
  end subroutine solve

  subroutine solve_adjoint(self, h, columns)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [n, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    call self%factors%solve(h, columns, adjoint=.true.)
  end subroutine solve_adjoint

  function stiffness_rate(self, h, response) result(product)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> x_h [n]
    complex(wp), intent(in) :: response(:)
    complex(wp) :: product(size(response))

    product = (0.0_wp, 1.0_wp)*h*matmul(damping_at(self, h), response) &
              - 2.0_wp*h**2*self%omega*matmul(of_harmonic(self, self%mass, h), response)
  end function stiffness_rate

  !> Damping and Coriolis forces count for each mode by itself, structural damping as it is: i h omega x^H G x is real.
  subroutine respond_beyond(self, first, omega, least_ratio, force, response)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Harmonic to begin at
    integer, intent(in) :: first
    !> Angular frequency, rad/s; damping ratio of modes that have no damping
    real(wp), intent(in) :: omega, least_ratio
    !> Forces on the coordinates from that harmonic on
    complex(wp), intent(in) :: force(:, :)
    !> Coordinates of the response from that harmonic on
    complex(wp), intent(out) :: response(:, :)
    complex(wp) :: shapes(size(force, 1), size(force, 1)), viscous(size(force, 1))
    real(wp) :: loss(size(force, 1))
    integer :: i

    do i = 1, size(force, 2)
      associate (h => first + i - 1, modes => self%diameters(first_alike(first + i - 1, self%period)))
        shapes = modes%modes
        if (is_mirrored(h, self%period)) shapes = conjg(shapes)
        viscous = sum(conjg(shapes)*matmul(of_harmonic(self, self%viscous, h), shapes), 1)
        loss = real(sum(conjg(shapes)*matmul(of_harmonic(self, self%structural, h), shapes), 1), wp)
        response(:, i) = matmul(conjg(transpose(shapes)), force(:, i)) &
                         /finite_stiffness(h*omega, modes%modal_stiffness - h*omega*aimag(viscous), modes%modal_mass, &
                                           real(viscous, wp), loss, least_ratio)
        response(:, i) = matmul(shapes, response(:, i))
      end associate
    end do
  end subroutine respond_beyond

  subroutine inertia_of(self, response, product)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    !> Product with the mass, by harmonic
    complex(wp), intent(out) :: product(:, 0:)
    integer :: h

    do h = 0, ubound(response, 2)
      product(:, h) = matmul(of_harmonic(self, self%mass, h), response(:, h))
    end do
  end subroutine inertia_of
end module attrito_linear_receptance_cyclic_direct
