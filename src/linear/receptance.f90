!> The linear system with every contact stuck, at one frequency and all harmonics.
!>
!> $$ \tilde Z_h(\omega) x_h = F_h, \qquad \tilde Z_h = \tilde K - (h \omega)^2 M + i h \omega C, \qquad \tilde K = K + B^T K_c B $$
!>
!> in generalised coordinates x with q_h = Phi_h x_h: the modes of (K~, M) where damping leaves them uncoupled, q itself elsewhere.
!> Harmonic h is held as a complex column X_h = x_ch - i x_sh, h = 0 ... H.
!>
!> Coordinates are the receptance's own affair. It projects loads, F_h = Phi_h^H f_h, and rows, B_h Phi_h (`projected_rows_type`), and
!> recovers displacements, harmonic by harmonic: each may have its own complex Phi_h and B_h, as the sectors of a cyclic structure do.
!> `receptance_real` has one real Phi for all harmonics, `receptance_cyclic` one of each nodal diameter. How Z_h is factored is left
!> to their extensions: in modes, or by LU factors.
module attrito_linear_receptance
  use attrito_core_kinds, only: wp
  use attrito_linear_projected_rows, only: projected_rows_type
  implicit none
  private
  public :: receptance_type

  type, abstract :: receptance_type
    !> Highest harmonic
    integer :: harmonics = 0
    !> Lowest harmonic it answers for: 1 where the mean has no support
    integer :: lowest = 0
    !> Angular frequency it is set to, and the highest harmonic that it is set for
    real(wp) :: omega = -1.0_wp
    integer :: highest = 0
    !> Part of its stiffness that is added to that of the mean: see `apply_mean_springs`
    real(wp) :: held = 0.0_wp
    !> Autonomous motion: damping taken away, a part of the mass; modes that springs hold at harmonic 1, if any, and these springs in
    !> the modes' coordinates
    real(wp) :: excitation = 0.0_wp
    integer, allocatable :: lifted_modes(:)
    real(wp), allocatable :: lifts(:)
  contains
    procedure(allocate_factors), deferred :: allocate_factors
    procedure(factor), deferred :: factor
    procedure(solve), deferred :: solve
    procedure(solve), deferred :: solve_adjoint
    procedure(stiffness_rate), deferred :: stiffness_rate
    procedure(project_load), deferred :: project_load
    procedure(project_loads), deferred :: project_loads
    procedure(project_mean_loads), deferred :: project_mean_loads
    procedure(project_rows), deferred :: project_rows
    procedure(contact_rows), deferred :: contact_rows
    procedure(recover), deferred :: recover
    procedure(displacements), deferred :: displacements
    procedure(state_at_start), deferred :: state_at_start
    procedure(respond_beyond), deferred :: respond_beyond
    procedure(inertia_of), deferred :: inertia_of
    procedure(block_between), deferred :: block_between
    procedure(common_modes), deferred :: common_modes
    procedure(mode_shapes), deferred :: mode_shapes
    procedure(low_stiffness), deferred :: low_stiffness
    procedure :: set_harmonics
    procedure :: set_frequency
    procedure :: set_like
    procedure :: respond
    procedure :: respond_adjoint
    procedure :: respond_derivative
    procedure :: respond_inertia
    procedure :: respond_excitation
    procedure :: uncoupled_modes
    procedure :: without_springs
    procedure :: apply_mean_springs
    procedure :: excite
    procedure :: lift_modes
    procedure :: is_lifted
    procedure :: is_set
  end type receptance_type

  abstract interface
    !> Make room for factors of Z_0 ... Z_H.
    subroutine allocate_factors(self, harmonics)
      import :: receptance_type
      class(receptance_type), intent(inout) :: self
      !> Highest harmonic, H
      integer, intent(in) :: harmonics
    end subroutine allocate_factors

    !> Factor Z_h: where modes make it diagonal, invert it.
    subroutine factor(self, h, omega, status)
      import :: receptance_type, wp
      class(receptance_type), intent(inout) :: self
      !> Number of the harmonic
      integer, intent(in) :: h
      !> Angular frequency, rad/s
      real(wp), intent(in) :: omega
      !> 0, or not: Z_h is singular
      integer, intent(out) :: status
    end subroutine factor

    !> Solve with the factors of Z_h, or of its adjoint.
    subroutine solve(self, h, columns)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Number of the harmonic
      integer, intent(in) :: h
      !> Right-hand sides [n, k], then solutions
      complex(wp), intent(inout), contiguous :: columns(:, :)
    end subroutine solve

    !> (dZ_h/domega) x_h, dZ_h/domega = -2 h^2 omega M + i h C.
    function stiffness_rate(self, h, response) result(product)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Number of the harmonic
      integer, intent(in) :: h
      !> x_h [n]
      complex(wp), intent(in) :: response(:)
      complex(wp) :: product(size(response))
    end function stiffness_rate

    !> A load on the model's coordinates at one harmonic, Phi_h^H f_h [n].
    function project_load(self, h, load) result(projected)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Number of the harmonic
      integer, intent(in) :: h
      !> f_h [m]
      complex(wp), intent(in) :: load(:)
      complex(wp), allocatable :: projected(:)
    end function project_load

    !> Loads of all harmonics [n, 0:H].
    function project_loads(self, loads) result(projected)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Fourier coefficients of the model's coordinates [m, 2 H + 1]
      real(wp), intent(in) :: loads(:, :)
      complex(wp), allocatable :: projected(:, :)
    end function project_loads

    !> Loads that do not depend on time, Phi_0^T f [n, loads].
    function project_mean_loads(self, loads) result(projected)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> On the model's coordinates [m, loads]
      real(wp), intent(in) :: loads(:, :)
      real(wp), allocatable :: projected(:, :)
    end function project_mean_loads

    !> Rows on the model's coordinates, as of monitors.
    function project_rows(self, rows) result(projected)
      import :: receptance_type, projected_rows_type, wp
      class(receptance_type), intent(in) :: self
      !> In columns [m, rows]
      real(wp), intent(in) :: rows(:, :)
      type(projected_rows_type) :: projected
    end function project_rows

    !> Some of the contacts' rows, those of B.
    function contact_rows(self, first, last) result(projected)
      import :: receptance_type, projected_rows_type
      class(receptance_type), intent(in) :: self
      !> The first and the last, from 1
      integer, intent(in) :: first, last
      type(projected_rows_type) :: projected
    end function contact_rows

    !> Displacements of the model's coordinates at one harmonic, Phi_h x_h [m].
    function recover(self, h, response) result(displacement)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Number of the harmonic
      integer, intent(in) :: h
      !> x_h [n]
      complex(wp), intent(in) :: response(:)
      complex(wp), allocatable :: displacement(:)
    end function recover

    !> Displacements of the model's coordinates at all harmonics [2 H + 1, m].
    function displacements(self, response) result(coefficients)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Coordinates of the response, by harmonic [n, 0:H]
      complex(wp), intent(in) :: response(:, 0:)
      real(wp), allocatable :: coefficients(:, :)
    end function displacements

    !> Displacements and their rates at the start of the period.
    subroutine state_at_start(self, response, omega, displacement, rate)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Coordinates of the response, by harmonic [n, 0:H]
      complex(wp), intent(in) :: response(:, 0:)
      !> Angular frequency
      real(wp), intent(in) :: omega
      !> Of the model's coordinates [m]
      real(wp), allocatable, intent(out) :: displacement(:), rate(:)
    end subroutine state_at_start

    !> X_h at harmonics beyond those it answers for, through the modes of the stuck system, each with its own part of the damping.
    subroutine respond_beyond(self, first, omega, least_ratio, force, response)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Harmonic to begin at
      integer, intent(in) :: first
      !> Angular frequency; damping ratio of modes that have no damping, which keeps their resonances finite
      real(wp), intent(in) :: omega, least_ratio
      !> F_h from that harmonic on [n, harmonics]
      complex(wp), intent(in) :: force(:, :)
      !> X_h from that harmonic on [n, harmonics]
      complex(wp), intent(out) :: response(:, :)
    end subroutine respond_beyond

    !> M X_h.
    subroutine inertia_of(self, response, product)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> X [n, 0:H]
      complex(wp), intent(in) :: response(:, 0:)
      !> [n, 0:H]
      complex(wp), intent(out) :: product(:, 0:)
    end subroutine inertia_of

    !> Receptance between rows of B at one harmonic, B_a Z_h^-1 B_b^H.
    subroutine block_between(self, h, rows_a, rows_b, block)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Number of the harmonic
      integer, intent(in) :: h
      !> Rows of B, from 1
      integer, intent(in) :: rows_a(:), rows_b(:)
      !> [size(rows_a), size(rows_b)]
      complex(wp), intent(out) :: block(:, :)
    end subroutine block_between

    !> How many modes of the stuck system are the same at all harmonics; 0: each harmonic has its own.
    pure integer function common_modes(self)
      import :: receptance_type
      class(receptance_type), intent(in) :: self
    end function common_modes

    !> Such modes at some rows of B. The following two take the first of them as low.
    function mode_shapes(self, first, last, rows) result(shapes)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> The first and the last of the modes, ascending
      integer, intent(in) :: first, last
      !> Rows of B, from 1
      integer, intent(in) :: rows(:)
      !> [last - first + 1, rows]
      real(wp), allocatable :: shapes(:, :)
    end function mode_shapes

    !> Dynamic stiffness of the lowest modes at one harmonic, what couples them left out.
    function low_stiffness(self, h, low) result(stiffness)
      import :: receptance_type, wp
      class(receptance_type), intent(in) :: self
      !> Number of the harmonic; number of lowest modes
      integer, intent(in) :: h, low
      complex(wp) :: stiffness(low)
    end function low_stiffness
  end interface

contains

  !> Answer for so many harmonics from now on; a frequency is to be set again.
  subroutine set_harmonics(self, harmonics)
    class(receptance_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    self%harmonics = harmonics
    self%omega = -1.0_wp
    call self%allocate_factors(harmonics)
  end subroutine set_harmonics

  !> Make ready for an angular frequency, and for all harmonics unless the highest one that is needed is given.
  subroutine set_frequency(self, omega, status, highest)
    class(receptance_type), intent(inout) :: self
    !> rad per time
    real(wp), intent(in) :: omega
    !> 0, or not: the system is singular there
    integer, intent(out) :: status
    !> Highest harmonic
    integer, intent(in), optional :: highest
    integer :: h, first, last

    status = 0
    last = self%harmonics
    if (present(highest)) last = min(highest, last)
    if (self%is_set(omega, last)) return
    ! That of the mean is the same at all frequencies.
    first = merge(0, 1, self%omega < 0.0_wp)
    ! Until all harmonics are factored the factors belong to no frequency.
    self%omega = -1.0_wp
    self%highest = last
    do h = first, last
      call self%factor(h, omega, status)
      if (h < self%lowest) status = 0
      if (status /= 0) return
    end do
    self%omega = omega
  end subroutine set_frequency

  !> Make ready for the harmonics, the excitation and the frequency of another.
  subroutine set_like(self, other, status)
    class(receptance_type), intent(inout) :: self
    !> Set to a frequency
    class(receptance_type), intent(in) :: other
    !> 0, or not: the system is singular there
    integer, intent(out) :: status

    if (self%harmonics /= other%harmonics) call self%set_harmonics(other%harmonics)
    if (abs(self%excitation - other%excitation) > 0.0_wp) call self%excite(other%excitation)
    call self%set_frequency(other%omega, status)
  end subroutine set_like

  !> X_h = Z_h^-1 F_h, up to any harmonic that it is set for.
  subroutine respond(self, force, response)
    class(receptance_type), intent(in) :: self
    !> F [n, 0:h]
    complex(wp), intent(in) :: force(:, 0:)
    !> X [n, 0:h]
    complex(wp), intent(out) :: response(:, 0:)

    call solve_harmonics(self, force, response, adjoint=.false.)
  end subroutine respond

  !> X_h = Z_h^-H F_h.
  subroutine respond_adjoint(self, force, response)
    class(receptance_type), intent(in) :: self
    !> F [n, 0:h]
    complex(wp), intent(in) :: force(:, 0:)
    !> X [n, 0:h]
    complex(wp), intent(out) :: response(:, 0:)

    call solve_harmonics(self, force, response, adjoint=.true.)
  end subroutine respond_adjoint

  !> With all Z_h, or their adjoints; 0 at harmonics below those that it answers for.
  subroutine solve_harmonics(self, force, response, adjoint)
    class(receptance_type), intent(in) :: self
    !> F [n, 0:h]
    complex(wp), intent(in) :: force(:, 0:)
    !> X [n, 0:h]
    complex(wp), intent(out) :: response(:, 0:)
    !> With the adjoints?
    logical, intent(in) :: adjoint
    integer :: h

    if (ubound(force, 2) > self%highest) error stop 'receptance: asked beyond the harmonics that it is set for'
    response(:, :self%lowest - 1) = 0.0_wp
    do h = self%lowest, ubound(force, 2)
      response(:, h) = force(:, h)
      if (adjoint) then
        call self%solve_adjoint(h, response(:, h:h))
      else
        call self%solve(h, response(:, h:h))
      end if
    end do
  end subroutine solve_harmonics

  !> dX_h/domega = -Z_h^-1 (dZ_h/domega) X_h, up to any harmonic that it is set for.
  subroutine respond_derivative(self, response, derivative)
    class(receptance_type), intent(in) :: self
    !> X [n, 0:h]
    complex(wp), intent(in) :: response(:, 0:)
    !> dX/domega [n, 0:h]
    complex(wp), intent(out) :: derivative(:, 0:)
    complex(wp) :: force(size(response, 1), 0:ubound(response, 2))
    integer :: h

    do h = 0, ubound(response, 2)
      force(:, h) = -self%stiffness_rate(h, response(:, h))
    end do
    call self%respond(force, derivative)
  end subroutine respond_derivative

  !> -Z_h^-1 (d^2Z_h/domega^2) X_h = 2 h^2 Z_h^-1 M X_h.
  subroutine respond_inertia(self, response, derivative)
    class(receptance_type), intent(in) :: self
    !> X [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    !> Derivative by the frequency
    complex(wp), intent(out) :: derivative(:, 0:)
    integer :: h

    call respond_to_parts(self, [(cmplx(2*h**2, 0, wp), h=0, self%harmonics)], response, derivative)
  end subroutine respond_inertia

  !> dX_h/dxi = -Z_h^-1 (dZ_h/dxi) X_h = Z_h^-1 i h omega M X_h, xi being `excitation`.
  subroutine respond_excitation(self, response, derivative)
    class(receptance_type), intent(in) :: self
    !> X [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    !> Derivative by the frequency
    complex(wp), intent(out) :: derivative(:, 0:)
    integer :: h

    call respond_to_parts(self, [(cmplx(0.0_wp, h*self%omega, wp), h=0, self%harmonics)], response, derivative)
  end subroutine respond_excitation

  !> Z_h^-1 p_h M X_h.
  subroutine respond_to_parts(self, parts, response, derivative)
    class(receptance_type), intent(in) :: self
    !> p [0:H]
    complex(wp), intent(in) :: parts(0:)
    !> X [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    !> Derivative by the frequency
    complex(wp), intent(out) :: derivative(:, 0:)
    complex(wp) :: force(size(response, 1), 0:self%harmonics)
    integer :: h

    call self%inertia_of(response, force)
    do h = 0, self%harmonics
      force(:, h) = parts(h)*force(:, h)
    end do
    call self%respond(force, derivative)
  end subroutine respond_to_parts

  !> Stiffness, mass and damping of the modes, ascending, if they are all there is to the response; none where damping couples them.
  subroutine uncoupled_modes(self, stiffness, mass, damping)
    class(receptance_type), intent(in) :: self
    !> [n] or [0]
    real(wp), allocatable, intent(out) :: stiffness(:), mass(:), damping(:)

    allocate (stiffness(0), mass(0), damping(0))
  end subroutine uncoupled_modes

  !> The receptance of the structure without some of the contacts' springs, in modes that its damping is taken not to couple; not
  !> allocated where there is none such, as where a body is free without them.
  subroutine without_springs(self, rows, springs, opened)
    class(receptance_type), intent(in) :: self
    !> Rows of B, from 1, and their springs
    integer, intent(in) :: rows(:)
    real(wp), intent(in) :: springs(:)
    !> For as many harmonics, set to no frequency
    class(receptance_type), allocatable, intent(out) :: opened
  end subroutine without_springs

  !> Let the damping be C - excitation M from the next frequency that is set on: 0 is the structure itself.
  subroutine excite(self, excitation)
    class(receptance_type), intent(inout) :: self
    !> Factor on the mass that is taken from the damping
    real(wp), intent(in) :: excitation

    self%excitation = excitation
    self%omega = -1.0_wp
  end subroutine excite

  !> Let springs hold the coordinates of modes of the stuck system at harmonic 1, Z_1 + sum of lift M x x^T M/(x^T M x)^2, so that it
  !> has an inverse at these modes' resonance.
  subroutine lift_modes(self, modes, lifts)
    class(receptance_type), intent(inout) :: self
    !> From 1
    integer, intent(in) :: modes(:)
    !> Beside the modal stiffness x^T K~ x
    real(wp), intent(in) :: lifts(:)

    self%lifted_modes = modes
    self%lifts = lifts
    self%omega = -1.0_wp
  end subroutine lift_modes

  !> Does a spring hold a mode at harmonic 1?
  pure logical function is_lifted(self)
    class(receptance_type), intent(in) :: self

    is_lifted = allocated(self%lifted_modes)
  end function is_lifted

  !> Is it ready for an angular frequency and harmonics up to one?
  pure logical function is_set(self, omega, highest)
    class(receptance_type), intent(in) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Highest harmonic
    integer, intent(in) :: highest

    is_set = abs(omega - self%omega) <= 0.0_wp .and. highest <= self%highest
  end function is_set

  !> Let the mean's stiffness be (1 + part) K~ from the next frequency that is set on: 0 is the structure itself.
  subroutine apply_mean_springs(self, part)
    class(receptance_type), intent(inout) :: self
    !> Part of the stiffness that is added at harmonic 0
    real(wp), intent(in) :: part

    self%held = part
    self%omega = -1.0_wp
  end subroutine apply_mean_springs
end module attrito_linear_receptance
