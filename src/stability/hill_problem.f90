!> Hill's problem with memory: perturbations e^{st} times a periodic motion, s in units of the excitation's angular frequency,
!> theta its angle. A slider that rests since tau holds what it then had, so its force carries the exact factor of the time since:
!>
!> $$ \delta g_T = -k_t e^{-s(\theta - \tau)} \, [u + b v](\tau), \qquad \delta g_T = \text{side}\,\mu k_n v - k_t u, \qquad
!>    \delta g = (-k_t u, -k_n v) $$
!>
!> in stick, slip and lift-off (factors e^{s theta} left out). In harmonics k = -K ... K of the forces of contacts that slip or
!> open,
!>
!> $$ F(s)\, g = g + G(s) R(s)\, g = 0, \qquad R_k = B \Phi \, [(\nu(s + ik))^2 + \nu(s + ik) D + \Lambda]^{-1} \Phi^T B^T, $$
!>
!> with integrals in closed form; a multiplier is e^{2 pi s}. Neither the flow in time nor its monodromy enters.
module attrito_stability_hill_problem
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_system, only: system_type
  use attrito_stability_contour, only: nonlinear_problem_type
  use attrito_stability_smooth_segments, only: orbit_segments_type
  implicit none
  private
  public :: hill_problem_type, new_hill_problem, force_held

  !> Harmonics of a perturbation, at least
  integer, parameter :: fewest_harmonics = 40 ! guess

  !> An interval in which a slider rests
  type :: rest_type
    !> Force that it belongs to; angles at which it begins, ends, and at which the slider came to rest, before
    integer :: force = 0
    real(wp) :: from = 0.0_wp, to = 0.0_wp, origin = 0.0_wp
    !> dw = du + by_normal dv
    real(wp) :: by_normal = 0.0_wp
  end type rest_type

  type, extends(nonlinear_problem_type) :: hill_problem_type
    type(system_type) :: system
    !> Angular frequency of the excitation over the clock
    real(wp) :: nu = 1.0_wp
    !> Harmonics, K
    integer :: harmonics = 0
    !> Forces: their rows of B, that of their contact's u and v, and k_t
    integer, allocatable :: row(:), row_u(:), row_v(:)
    real(wp), allocatable :: stiffness(:)
    type(rest_type), allocatable :: rests(:)
    !> What slip and lift-off make of u and v: Fourier coefficients -2 K ... 2 K [orders, forces, 2]
    complex(wp), allocatable :: slip_and_open(:, :, :)
  contains
    procedure :: at => hill_matrix
    procedure :: unknowns => hill_unknowns
    procedure :: responses
  end type hill_problem_type

contains

  !> Gather what contacts that slip or open do.
  subroutine new_hill_problem(system, orbit, nu, self, harmonics)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit as segments between its events
    type(orbit_segments_type), intent(in) :: orbit
    !> Harmonic in which exponents lie
    real(wp), intent(in) :: nu
    class(hill_problem_type), intent(inout) :: self
    !> K, where it is not as usual
    integer, intent(in), optional :: harmonics
    integer :: i

    self%system = system
    self%nu = nu
    ! As many beyond the fastest mode as below it, at most three times the fewest: faster modes follow at rest.
    self%harmonics = min(max(fewest_harmonics, ceiling(2.0_wp/nu)), 3*fewest_harmonics)
    if (present(harmonics)) self%harmonics = harmonics
    self%row = [integer ::]
    self%row_u = [integer ::]
    self%row_v = [integer ::]
    self%stiffness = [real(wp) ::]
    self%rests = [rest_type ::]
    if (allocated(self%slip_and_open)) deallocate (self%slip_and_open)
    do i = 1, size(system%law)
      if (orbit%stuck(i)) cycle
      associate (law => system%law(i))
        call add_force(law, law%first_row, law%tangential_stiffness)
        call add_rests(orbit, i, size(self%row), self%rests)
        if (any_open(orbit, i)) call add_force(law, law%first_row + 1, law%normal_stiffness)
      end associate
    end do
    allocate (self%slip_and_open(-2*self%harmonics:2*self%harmonics, size(self%row), 2), source=(0.0_wp, 0.0_wp))
    do i = 1, size(self%row)
      call integrate_legs(self, orbit, i)
    end do

  contains

    subroutine add_force(law, row, stiffness)
      !> Contact: its springs and its law
      type(contact_type), intent(in) :: law
      !> Row of the force
      integer, intent(in) :: row
      !> Stiffness of the force
      real(wp), intent(in) :: stiffness

      self%row = [self%row, row]
      self%row_u = [self%row_u, law%first_row]
      self%row_v = [self%row_v, law%first_row + 1]
      self%stiffness = [self%stiffness, stiffness]
    end subroutine add_force
  end subroutine new_hill_problem

  pure logical function any_open(orbit, contact)
    !> Orbit as segments between its events
    type(orbit_segments_type), intent(in) :: orbit
    !> Number of the contact
    integer, intent(in) :: contact
    integer :: i

    any_open = any([(orbit%segment(i)%regime(contact) == regime_open, i=1, size(orbit%segment))])
  end function any_open

  !> The rests of a contact's slider; one that begins the period began at the end of the one before.
  pure subroutine add_rests(orbit, contact, force, rests)
    !> Orbit as segments between its events
    type(orbit_segments_type), intent(in) :: orbit
    !> Number of the contact; number of the force
    integer, intent(in) :: contact, force
    !> Rests of the slider
    type(rest_type), allocatable, intent(inout) :: rests(:)
    type(rest_type) :: rest
    integer :: i, j, n

    n = size(orbit%segment)
    do i = 1, n
      if (orbit%segment(i)%regime(contact) /= regime_stick) cycle
      ! Back to the segment at which it came to rest: one that begins, or the first after slip or lift-off at the end of the period.
      j = i
      do while (.not. orbit%segment(modulo(j - 1, n) + 1)%rests(contact))
        if (j < i - n) exit
        if (orbit%segment(modulo(j - 2, n) + 1)%regime(contact) /= regime_stick) exit
        j = j - 1
      end do
      rest = rest_type(force=force, from=orbit%segment(i)%from, to=orbit%segment(i)%from + orbit%segment(i)%length)
      associate (first => orbit%segment(modulo(j - 1, n) + 1), before => orbit%segment(modulo(j - 2, n) + 1))
        rest%origin = first%from - merge(two_pi, 0.0_wp, j < 1)
        rest%by_normal = first%by_normal(1, contact)
      end associate
      rests = [rests, rest]
    end do
  end subroutine add_rests

  !> Fourier coefficients of what multiplies u and v in a force while its contact slips or is open.
  pure subroutine integrate_legs(self, orbit, force)
    class(hill_problem_type), intent(inout) :: self
    !> Orbit as segments between its events
    type(orbit_segments_type), intent(in) :: orbit
    !> Number of the force
    integer, intent(in) :: force
    complex(wp) :: part
    real(wp) :: by_u, by_v
    integer :: i, k, contact

    contact = findloc(self%system%law%first_row, self%row_u(force), 1)
    associate (law => self%system%law(contact))
      do i = 1, size(orbit%segment)
        associate (segment => orbit%segment(i))
          if (segment%regime(contact) == regime_stick) cycle
          by_u = 0.0_wp
          by_v = 0.0_wp
          if (self%row(force) == self%row_u(force)) then
            by_u = -law%tangential_stiffness
            by_v = segment%side(contact)*law%friction_coefficient*law%normal_stiffness
          else if (segment%regime(contact) == regime_open) then
            by_v = -law%normal_stiffness
          end if
          do k = -2*self%harmonics, 2*self%harmonics
            part = exponential_integral(cmplx(0.0_wp, -k, wp), segment%from, segment%from + segment%length)/two_pi
            self%slip_and_open(k, force, 1) = self%slip_and_open(k, force, 1) + by_u*part
            self%slip_and_open(k, force, 2) = self%slip_and_open(k, force, 2) + by_v*part
          end do
        end associate
      end do
    end associate
  end subroutine integrate_legs

  !> Integral of e^{z theta} over [from, to].
  pure complex(wp) function exponential_integral(z, from, to) result(integral)
    !> Exponent per angle
    complex(wp), intent(in) :: z
    !> Angle at which it begins; angle at which it ends
    real(wp), intent(in) :: from, to
    complex(wp) :: x

    x = z*(to - from)
    if (abs(x) > 1.0e-2_wp) then
      integral = (exp(z*to) - exp(z*from))/z
    else
      integral = (to - from)*exp(z*from)*(1.0_wp + x/2.0_wp*(1.0_wp + x/3.0_wp*(1.0_wp + x/4.0_wp*(1.0_wp + x/5.0_wp*( &
        1.0_wp + x/6.0_wp)))))
    end if
  end function exponential_integral

  pure integer function hill_unknowns(self)
    class(hill_problem_type), intent(in) :: self

    hill_unknowns = (2*self%harmonics + 1)*size(self%row)
  end function hill_unknowns

  !> F(s), s over the angular frequency of the excitation.
  function hill_matrix(self, s) result(matrix)
    class(hill_problem_type), intent(in) :: self
    !> Exponent, 1/s, or time
    complex(wp), intent(in) :: s
    complex(wp), allocatable :: matrix(:, :)
    complex(wp) :: by_u(-self%harmonics:self%harmonics, -self%harmonics:self%harmonics), by_v(size(by_u, 1), size(by_u, 1))
    complex(wp), allocatable :: response(:, :, :)
    integer :: i, j, l, n, harmonics

    harmonics = self%harmonics
    n = 2*harmonics + 1
    response = self%responses(s, [self%row_u, self%row_v])
    allocate (matrix(self%unknowns(), self%unknowns()))
    do i = 1, size(self%row)
      call force_by_motion(self, s, i, by_u, by_v)
      do j = 1, size(self%row)
        do l = 1, n
          matrix((i - 1)*n + 1:i*n, (j - 1)*n + l) = by_u(:, l - harmonics - 1)*response(l, j, i) &
                                                     + by_v(:, l)*response(l, j, size(self%row) + i)
        end do
      end do
    end do
    do i = 1, size(matrix, 1)
      matrix(i, i) = matrix(i, i) + 1.0_wp
    end do
  end function hill_matrix

  !> What rows move by a unit of each force, R(s) [2 K + 1, forces, rows].
  function responses(self, s, rows) result(response)
    class(hill_problem_type), intent(in) :: self
    !> Exponent, 1/s, or time
    complex(wp), intent(in) :: s
    !> Rows of B
    integer, intent(in) :: rows(:)
    complex(wp), allocatable :: response(:, :, :)
    complex(wp) :: sigma
    complex(wp), allocatable :: flexible(:, :), matrix(:, :)
    integer, allocatable :: pivots(:)
    integer :: k, r, info

    allocate (response(2*self%harmonics + 1, size(self%row), size(rows)))
    do k = -self%harmonics, self%harmonics
      sigma = self%nu*(s + cmplx(0.0_wp, k, wp))
      flexible = cmplx(self%system%input_map(:, self%row), 0.0_wp, wp)
      if (allocated(self%system%coupling)) then
        matrix = sigma*self%system%coupling
        do r = 1, size(matrix, 1)
          matrix(r, r) = matrix(r, r) + sigma**2 + sigma*self%system%damping(r) + self%system%eigenvalues(r)
        end do
        allocate (pivots(size(matrix, 1)))
        call factor_complex(matrix, pivots, info)
        call solve_factored_complex(matrix, pivots, flexible)
        deallocate (pivots)
      else
        do r = 1, size(flexible, 1)
          flexible(r, :) = flexible(r, :)/(sigma**2 + sigma*self%system%damping(r) + self%system%eigenvalues(r))
        end do
      end if
      response(k + self%harmonics + 1, :, :) = matmul(transpose(flexible), self%system%rows(:, rows))
    end do
  end function responses

  !> One force's harmonics by those of its contact's u and v, G(s) [2 K + 1, 2 K + 1] each.
  pure subroutine force_by_motion(self, s, force, by_u, by_v)
    class(hill_problem_type), intent(in) :: self
    !> Exponent, 1/s, or time
    complex(wp), intent(in) :: s
    !> Number of the force
    integer, intent(in) :: force
    !> By the harmonics of u or v
    complex(wp), intent(out) :: by_u(-self%harmonics:, -self%harmonics:), by_v(-self%harmonics:, -self%harmonics:)
    complex(wp) :: held(-self%harmonics:self%harmonics), turn
    integer :: i, k, j

    do j = -self%harmonics, self%harmonics
      do k = -self%harmonics, self%harmonics
        by_u(k, j) = self%slip_and_open(k - j, force, 1)
        by_v(k, j) = self%slip_and_open(k - j, force, 2)
      end do
    end do
    do i = 1, size(self%rests)
      associate (rest => self%rests(i))
        if (rest%force /= force) cycle
        held = force_held(self, s, rest)
        do j = -self%harmonics, self%harmonics
          turn = exp(cmplx(0.0_wp, j*rest%origin, wp))
          by_u(:, j) = by_u(:, j) + turn*held
          by_v(:, j) = by_v(:, j) + rest%by_normal*turn*held
        end do
      end associate
    end do
  end subroutine force_by_motion

  !> Harmonics of the force while a slider rests, by a unit of what it then had [-K:K].
  pure function force_held(self, s, rest) result(held)
    class(hill_problem_type), intent(in) :: self
    !> Exponent over the angular frequency of the excitation
    complex(wp), intent(in) :: s
    !> In which the slider rests
    type(rest_type), intent(in) :: rest
    complex(wp) :: held(-self%harmonics:self%harmonics)
    integer :: k

    do k = -self%harmonics, self%harmonics
      held(k) = -self%stiffness(rest%force)*exp(s*rest%origin) &
                *exponential_integral(-(s + cmplx(0.0_wp, k, wp)), rest%from, rest%to)/two_pi
    end do
  end function force_held
end module attrito_stability_hill_problem
