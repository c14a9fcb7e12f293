!> Receptance of a sector by a dense factorisation per harmonic: for any damping. Slower than modes, never wrong.
!>
!> $$ Z_h = \tilde K_n - (h \omega)^2 M_n + i h \omega C_n + i \eta K_n \; [h > 0], \qquad n = h \, EO \bmod N $$
module attrito_linear_receptance_cyclic_direct
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  use attrito_model_sector, only: first_alike, is_mirrored
  use attrito_model_structure, only: structure_type, damping_viscous, damping_mass, damping_loss_factor
  use attrito_linear_diameter_modes, only: diameter_modes_type
  use attrito_linear_receptance_cyclic, only: receptance_cyclic_type, find_rows
  implicit none
  private
  public :: receptance_cyclic_direct_type, new_receptance_cyclic_direct

  type, extends(receptance_cyclic_type) :: receptance_cyclic_direct_type
    !> M_n, viscous C_n and eta K_n [n, n, 0:period/2]
    complex(wp), allocatable, private :: mass(:, :, :), viscous(:, :, :), structural(:, :, :)
    !> Factors of Z_h [n, n, 0:H] and their row interchanges [n, 0:H]
    complex(wp), allocatable, private :: factors(:, :, :)
    integer, allocatable, private :: pivots(:, :)
  contains
    procedure :: set_harmonics
    procedure :: set_frequency
    procedure :: respond
    procedure :: respond_adjoint
    procedure :: respond_derivative
    procedure :: respond_beyond
    procedure :: inertia_of
    procedure :: block_between
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

    self%sector = structure%sector
    self%period = self%sector%period()
    allocate (self%diameters(0:self%period/2), source=diameters)
    call find_rows(self, directions)
    n = size(self%sector%kept)
    allocate (self%mass(n, n, 0:self%period/2), self%viscous(n, n, 0:self%period/2), self%structural(n, n, 0:self%period/2))
    self%viscous = 0.0_wp
    self%structural = 0.0_wp
    do h = 0, self%period/2
      associate (diameter => self%sector%diameter(h))
        self%mass(:, :, h) = self%sector%couple(structure%mass, diameter)
        if (structure%damping_kind == damping_viscous) self%viscous(:, :, h) = self%sector%couple(structure%damping, diameter)
        if (structure%damping_kind == damping_mass) self%viscous(:, :, h) = structure%damping_value*self%mass(:, :, h)
        if (structure%damping_kind == damping_loss_factor) self%structural(:, :, h) = &
          structure%damping_value*self%sector%couple(structure%stiffness, diameter)
      end associate
    end do
    call self%set_harmonics(harmonics)
  end function new_receptance_cyclic_direct

  subroutine set_harmonics(self, harmonics)
    class(receptance_cyclic_direct_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    self%harmonics = harmonics
    self%omega = -1.0_wp
    if (allocated(self%factors)) deallocate (self%factors, self%pivots)
    associate (n => size(self%sector%kept))
      allocate (self%factors(n, n, 0:harmonics), self%pivots(n, 0:harmonics))
    end associate
  end subroutine set_harmonics

  subroutine set_frequency(self, omega, status, highest)
    class(receptance_cyclic_direct_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    !> Highest harmonic
    integer, intent(in), optional :: highest
    integer :: h, first, last

    status = 0
    last = self%harmonics
    if (present(highest)) last = min(highest, last)
    if (self%is_set(omega, last)) return
    first = max(merge(0, 1, self%omega < 0.0_wp), self%lowest)
    ! Until all harmonics are factored the factors belong to no frequency.
    self%omega = -1.0_wp
    self%highest = last
    do h = first, last
      self%factors(:, :, h) = stiffness_at(self, h, omega)
      call factor_complex(self%factors(:, :, h), self%pivots(:, h), status)
      if (status /= 0) return
    end do
    self%omega = omega
  end subroutine set_frequency

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

    associate (at => first_alike(h, self%period))
      associate (modes => self%diameters(at), mass => self%mass(:, :, at))
        if (h == 0) then
          stiffness = (1.0_wp + self%held)*modes%stiffness
          return
        end if
        stiffness = modes%stiffness - (h*omega)**2*mass
        if (h == 1 .and. self%lifted_mode > 0) then
          inertia = matmul(mass, modes%modes(:, self%lifted_mode))
          inertia = inertia/dot_product(modes%modes(:, self%lifted_mode), inertia)
          stiffness = stiffness + self%lift*spread(inertia, 2, size(inertia))*spread(conjg(inertia), 1, size(inertia))
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

  !> Viscous damping at a harmonic, with what is taken away [n, n].
  pure function damping_at(self, h) result(damping)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    complex(wp) :: damping(size(self%mass, 1), size(self%mass, 1))

    damping = of_harmonic(self, self%viscous, h) - self%excitation*of_harmonic(self, self%mass, h)
  end function damping_at

  subroutine respond(self, force, response)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Forces on the coordinates, by harmonic
    complex(wp), intent(in) :: force(:, 0:)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    call solve(self, force, response, adjoint=.false.)
  end subroutine respond

  subroutine respond_adjoint(self, force, response)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Forces on the coordinates, by harmonic
    complex(wp), intent(in) :: force(:, 0:)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    call solve(self, force, response, adjoint=.true.)
  end subroutine respond_adjoint

  !> With Z_h or its adjoint.
  subroutine solve(self, force, response, adjoint)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Forces on the coordinates, by harmonic
    complex(wp), intent(in) :: force(:, 0:)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)
    !> With the adjoint?
    logical, intent(in) :: adjoint
    complex(wp) :: column(size(force, 1), 1)
    integer :: h

    if (ubound(force, 2) > self%highest) error stop 'receptance: asked beyond the harmonics that it is set for'
    response(:, :self%lowest - 1) = 0.0_wp
    do h = self%lowest, ubound(force, 2)
      column(:, 1) = force(:, h)
      call solve_factored_complex(self%factors(:, :, h), self%pivots(:, h), column, adjoint)
      response(:, h) = column(:, 1)
    end do
  end subroutine solve

  subroutine respond_derivative(self, response, derivative)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    !> Derivative by the frequency
    complex(wp), intent(out) :: derivative(:, 0:)
    complex(wp) :: force(size(response, 1), 0:ubound(response, 2))
    integer :: h

    do h = 0, ubound(response, 2)
      force(:, h) = 2.0_wp*h**2*self%omega*matmul(of_harmonic(self, self%mass, h), response(:, h)) &
                    - (0.0_wp, 1.0_wp)*h*matmul(damping_at(self, h), response(:, h))
    end do
    call self%respond(force, derivative)
  end subroutine respond_derivative

  !> Damping counts for each mode by itself, structural damping as it is.
  subroutine respond_beyond(self, omega, least_ratio, force, response)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Angular frequency, rad/s; damping ratio of modes that have no damping
    real(wp), intent(in) :: omega, least_ratio
    !> Forces on the coordinates from harmonic H + 1 on
    complex(wp), intent(in) :: force(:, :)
    !> Coordinates of the response from harmonic H + 1 on
    complex(wp), intent(out) :: response(:, :)
    complex(wp) :: shapes(size(force, 1), size(force, 1))
    real(wp), dimension(size(force, 1)) :: damping, loss
    integer :: i

    do i = 1, size(force, 2)
      associate (h => self%harmonics + i, modes => self%diameters(first_alike(self%harmonics + i, self%period)))
        shapes = modes%modes
        if (is_mirrored(h, self%period)) shapes = conjg(shapes)
        damping = real(sum(conjg(shapes)*matmul(of_harmonic(self, self%viscous, h), shapes), 1), wp)
        loss = real(sum(conjg(shapes)*matmul(of_harmonic(self, self%structural, h), shapes), 1), wp)
        where (damping + loss <= 0.0_wp) damping = 2.0_wp*least_ratio*sqrt(modes%modal_stiffness*modes%modal_mass)
        response(:, i) = matmul(conjg(transpose(shapes)), force(:, i)) &
                         /cmplx(modes%modal_stiffness - (h*omega)**2*modes%modal_mass, h*omega*damping + loss, wp)
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

  subroutine block_between(self, h, rows_a, rows_b, block)
    class(receptance_cyclic_direct_type), intent(in) :: self
    !> Number of the harmonic; numbers of contact rows
    integer, intent(in) :: h, rows_a(:), rows_b(:)
    !> Block of the matrix, by harmonic
    complex(wp), intent(out) :: block(:, :)
    complex(wp) :: columns(size(self%rows, 1), size(rows_b))

    columns = self%rows_at(h, rows_b)
    call solve_factored_complex(self%factors(:, :, h), self%pivots(:, h), columns)
    block = matmul(conjg(transpose(self%rows_at(h, rows_a))), columns)
    if (h == 0) block = real(block, wp)
  end subroutine block_between
end module attrito_linear_receptance_cyclic_direct
