!> Receptance by a dense factorisation per harmonic: for any damping, and with Coriolis forces. Slower than modes, never wrong.
!>
!> $$ \tilde Z_h = \tilde K - (h \omega)^2 M + i h \omega (C + G) + i \eta K \; [h > 0] $$
!>
!> Structural damping acts on K, not on the contact springs, and not at harmonic 0. G is skew, so that Z~_h is not symmetric.
module attrito_linear_receptance_direct
  use attrito_core_kinds, only: wp
  use attrito_model_structure, only: structure_type, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_linear_harmonic_factors, only: harmonic_factors_type
  use attrito_linear_modal_stiffness, only: finite_stiffness
  use attrito_linear_opened_modes, only: find_opened_modes
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_receptance_modal, only: new_receptance_modal
  use attrito_linear_receptance_real, only: receptance_real_type
  implicit none
  private
  public :: receptance_direct_type, new_receptance_direct

  type, extends(receptance_real_type) :: receptance_direct_type
    !> K~, M and viscous C, with the skew G where there are Coriolis forces [m, m]
    real(wp), allocatable :: stuck_stiffness(:, :), mass(:, :), viscous(:, :)
    !> Modes of (K~, M) [m, m], and their motion of the contact rows [m, rows]
    real(wp), allocatable :: modes(:, :)
    real(wp), allocatable, private :: modal_directions(:, :)
    !> eta K [m, m]
    real(wp), allocatable :: structural(:, :)
    !> Stiffness, mass, damping and eta K of each mode by itself [m]
    real(wp), allocatable, private :: modal_stiffness(:), modal_mass(:), modal_damping(:), modal_loss(:)
    !> Of Z_h [m, m]
    type(harmonic_factors_type), private :: factors
  contains
    procedure :: allocate_factors
    procedure :: factor
    procedure :: solve
    procedure :: solve_adjoint
    procedure :: stiffness_rate
    procedure :: respond_beyond
    procedure :: inertia_of
    procedure :: block_between
    procedure :: mode_shapes
    procedure :: low_stiffness
    procedure :: without_springs
  end type receptance_direct_type

contains

  !> From the structure, K~ [m, m], its modes [m, m] and the rows of B in columns [m, rows].
  function new_receptance_direct(structure, stuck_stiffness, modes, directions, harmonics, modal_damping) result(self)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Stiffness with every contact stuck; modes of the stuck system, a column each; rows of B, a column each
    real(wp), intent(in) :: stuck_stiffness(:, :), modes(:, :), directions(:, :)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    !> Damping of each mode by itself where it is a ratio, which Coriolis forces leave as it is [m]
    real(wp), intent(in) :: modal_damping(:)
    type(receptance_direct_type) :: self
    integer :: i, m

    m = size(stuck_stiffness, 1)
    self%stuck_stiffness = stuck_stiffness
    self%modes = modes
    self%mass = structure%mass
    allocate (self%viscous(m, m), self%structural(m, m), self%basis(m, m), source=0.0_wp)
    if (structure%damping_kind == damping_viscous) self%viscous = structure%damping
    if (structure%damping_kind == damping_mass) self%viscous = structure%damping_value*structure%mass
    if (structure%damping_kind == damping_ratio) self%viscous = damping_by_modes(structure%mass, modes, modal_damping)
    if (allocated(structure%gyroscopic)) self%viscous = self%viscous + structure%gyroscopic
    if (structure%damping_kind == damping_loss_factor) self%structural = structure%damping_value*structure%stiffness
    do i = 1, m
      self%basis(i, i) = 1.0_wp
    end do
    self%directions = directions
    self%modal_directions = matmul(transpose(modes), directions)
    self%modal_stiffness = projected(stuck_stiffness, modes)
    self%modal_mass = projected(structure%mass, modes)
    self%modal_damping = projected(self%viscous, modes)
    self%modal_loss = projected(self%structural, modes)
    call self%set_harmonics(harmonics)
  end function new_receptance_direct

  !> x^T A x of every mode: what a matrix that couples them is to each by itself.
  pure function projected(matrix, modes) result(diagonal)
    !> Matrix that couples the modes; modes, a column each
    real(wp), intent(in) :: matrix(:, :), modes(:, :)
    real(wp) :: diagonal(size(modes, 2))

    diagonal = sum(modes*matmul(matrix, modes), 1)
  end function projected

  !> The matrix that damps each mode by itself, C = sum c_r M x_r x_r^T M / (x_r^T M x_r)^2 [m, m].
  pure function damping_by_modes(mass, modes, modal_damping) result(damping)
    !> Mass [m, m]; modes, a column each
    real(wp), intent(in) :: mass(:, :), modes(:, :)
    !> c [m]
    real(wp), intent(in) :: modal_damping(:)
    real(wp) :: damping(size(mass, 1), size(mass, 1))
    real(wp) :: inertia(size(mass, 1), size(modes, 2))

    inertia = matmul(mass, modes)
    damping = matmul(inertia*spread(modal_damping/sum(modes*inertia, 1)**2, 1, size(mass, 1)), transpose(inertia))
  end function damping_by_modes

  subroutine allocate_factors(self, harmonics)
    class(receptance_direct_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    call self%factors%resize(size(self%mass, 1), harmonics)
  end subroutine allocate_factors

  subroutine factor(self, h, omega, status)
    class(receptance_direct_type), intent(inout) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> 0, or not: Z_h is singular
    integer, intent(out) :: status
    complex(wp) :: stiffness(size(self%mass, 1), size(self%mass, 1))

    stiffness = cmplx(self%stuck_stiffness - (h*omega)**2*self%mass, h*omega*damping_of(self), wp)
    if (h > 0) stiffness = stiffness + (0.0_wp, 1.0_wp)*self%structural
    if (h == 0) stiffness = (1.0_wp + self%held)*stiffness
    if (h == 1 .and. self%is_lifted()) stiffness = stiffness + lift_of(self)
    call self%factors%factor(h, stiffness, status)
  end subroutine factor

  subroutine solve(self, h, columns)
    class(receptance_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [m, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    call self%factors%solve(h, columns)
  end subroutine solve

  subroutine solve_adjoint(self, h, columns)
    class(receptance_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Right-hand sides [m, k], then solutions
    complex(wp), intent(inout), contiguous :: columns(:, :)

    call self%factors%solve(h, columns, adjoint=.true.)
  end subroutine solve_adjoint

  function stiffness_rate(self, h, response) result(product)
    class(receptance_direct_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> x_h [m]
    complex(wp), intent(in) :: response(:)
    complex(wp) :: product(size(response))

    product = (0.0_wp, 1.0_wp)*h*matmul(damping_of(self), response) - 2.0_wp*h**2*self%omega*matmul(self%mass, response)
  end function stiffness_rate

  subroutine respond_beyond(self, first, omega, least_ratio, force, response)
    class(receptance_direct_type), intent(in) :: self
    !> Harmonic to begin at
    integer, intent(in) :: first
    !> Angular frequency, rad/s; damping ratio of modes that have no damping
    real(wp), intent(in) :: omega, least_ratio
    !> Forces on the coordinates from that harmonic on
    complex(wp), intent(in) :: force(:, :)
    !> Coordinates of the response from that harmonic on
    complex(wp), intent(out) :: response(:, :)
    integer :: i

    response = matmul(transpose(self%modes), force)
    do i = 1, size(force, 2)
      response(:, i) = response(:, i)/finite_stiffness((first + i - 1)*omega, self%modal_stiffness, self%modal_mass, &
                                                       self%modal_damping, self%modal_loss, least_ratio)
    end do
    response = matmul(self%modes, response)
  end subroutine respond_beyond

  subroutine inertia_of(self, response, product)
    class(receptance_direct_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    !> Product with the mass, by harmonic
    complex(wp), intent(out) :: product(:, 0:)

    product = matmul(self%mass, response)
  end subroutine inertia_of

  !> Viscous damping and Coriolis forces, with what is taken away [m, m].
  pure function damping_of(self) result(damping)
    class(receptance_direct_type), intent(in) :: self
    real(wp) :: damping(size(self%mass, 1), size(self%mass, 1))

    damping = self%viscous - self%excitation*self%mass
  end function damping_of

  !> The springs on the lifted modes [m, m].
  pure function lift_of(self) result(stiffness)
    class(receptance_direct_type), intent(in) :: self
    real(wp) :: stiffness(size(self%mass, 1), size(self%mass, 1))
    real(wp) :: inertia(size(self%mass, 1))
    integer :: i

    stiffness = 0.0_wp
    do i = 1, size(self%lifts)
      associate (shape => self%modes(:, self%lifted_modes(i)), m => size(inertia))
        inertia = matmul(self%mass, shape)
        inertia = inertia/dot_product(shape, inertia)
        stiffness = stiffness + self%lifts(i)*spread(inertia, 2, m)*spread(inertia, 1, m)
      end associate
    end do
  end function lift_of

  subroutine block_between(self, h, rows_a, rows_b, block)
    class(receptance_direct_type), intent(in) :: self
    !> Number of the harmonic; numbers of contact rows
    integer, intent(in) :: h, rows_a(:), rows_b(:)
    !> Block of the matrix, by harmonic
    complex(wp), intent(out) :: block(:, :)
    complex(wp) :: columns(size(self%directions, 1), size(rows_b))

    columns = self%directions(:, rows_b)
    call self%solve(h, columns)
    block = matmul(transpose(self%directions(:, rows_a)), columns)
  end subroutine block_between

  function mode_shapes(self, first, last, rows) result(shapes)
    class(receptance_direct_type), intent(in) :: self
    !> The first and the last of the modes; numbers of contact rows
    integer, intent(in) :: first, last, rows(:)
    real(wp), allocatable :: shapes(:, :)

    shapes = self%modal_directions(first:last, rows)
  end function mode_shapes

  function low_stiffness(self, h, low) result(stiffness)
    class(receptance_direct_type), intent(in) :: self
    !> Number of the harmonic; number of lowest modes
    integer, intent(in) :: h, low
    complex(wp) :: stiffness(low)
    integer :: i

    associate (frequency => h*self%omega, mass => self%modal_mass(:low))
      stiffness = cmplx(self%modal_stiffness(:low) - frequency**2*mass, &
                        frequency*(self%modal_damping(:low) - self%excitation*mass), wp)
    end associate
    if (h > 0) stiffness = stiffness + (0.0_wp, 1.0_wp)*self%modal_loss(:low)
    if (h == 0) stiffness = (1.0_wp + self%held)*stiffness
    if (h /= 1 .or. .not. self%is_lifted()) return
    do i = 1, size(self%lifts)
      if (self%lifted_modes(i) <= low) stiffness(self%lifted_modes(i)) = stiffness(self%lifted_modes(i)) + self%lifts(i)
    end do
  end function low_stiffness

  !> Structural damping counts as the viscous one that is equal at a mode's own frequency.
  subroutine without_springs(self, rows, springs, opened)
    class(receptance_direct_type), intent(in) :: self
    !> Rows of B, from 1, and their springs
    integer, intent(in) :: rows(:)
    real(wp), intent(in) :: springs(:)
    !> For as many harmonics, set to no frequency
    class(receptance_type), allocatable, intent(out) :: opened
    real(wp), allocatable :: modes(:, :), modal_mass(:), damping(:)
    integer :: i, status

    call find_opened_modes(self%stuck_stiffness, self%mass, self%directions(:, rows), springs, modes, modal_mass, status)
    if (status /= 0) return
    damping = sum(modes*matmul(self%viscous, modes), 1) + sqrt(modal_mass)*sum(modes*matmul(self%structural, modes), 1)
    opened = new_receptance_modal([(1.0_wp, i=1, size(modal_mass))], modal_mass, damping, modes, self%directions, self%harmonics)
    opened%lowest = self%lowest
  end subroutine without_springs
end module attrito_linear_receptance_direct
