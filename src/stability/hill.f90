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
module attrito_stability_hill
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: factor_complex, solve_factored_complex, eigenvalues_of, complex_singular_values
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_system, only: system_type
  use attrito_stability_contour, only: nonlinear_problem_type, ellipse_type, eigenvalues_within, polish
  use attrito_stability_leg, only: orbit_legs_type
  use attrito_stability_multipliers, only: multiplier_type, sorted_multipliers
  implicit none
  private
  public :: hill_problem_type, hill_multipliers, new_hill_problem, too_large

  !> Smallest and largest modulus of the multipliers that are looked for
  real(wp), parameter :: least = 1.0e-2_wp, greatest = 1.0e3_wp
  !> Harmonics of a perturbation, at least, and how many times as many for the last digits: what is left out falls like their cube
  integer, parameter :: fewest_harmonics = 40, finer = 3
  !> Unknowns of a dense nonlinear eigenproblem, at most
  integer, parameter :: most_unknowns = 1500
  !> How far truncation may move an exponent
  real(wp), parameter :: truncation = 1.0e-3_wp
  !> `info` where there are more
  integer, parameter :: too_large = -1

  !> A stretch in which a slider rests
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
  end type hill_problem_type

contains

  !> Multipliers of an orbit that are at least 0.01 in modulus, and those of sliders.
  subroutine hill_multipliers(system, orbit, period, multipliers, info)
    type(system_type), intent(in) :: system
    type(orbit_legs_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0, `too_large`, or another: not found
    integer, intent(out) :: info
    type(hill_problem_type) :: problem
    type(ellipse_type) :: ellipse
    complex(wp), allocatable :: exponents(:), vectors(:, :), values(:)
    real(wp) :: low, high, below
    integer :: i

    call new_hill_problem(system, orbit, two_pi/period, problem)
    values = unseen_multipliers(problem)
    info = 0
    if (problem%unknowns() > most_unknowns) info = too_large
    if (info /= 0) return
    if (problem%unknowns() > 0) then
      ! Half a strip says all: the other half is conjugate, and so is what lies beyond. The ellipse goes round the rectangle.
      low = log(least)/two_pi
      high = log(greatest)/two_pi
      below = 0.05_wp
      ellipse%centre = cmplx(0.5_wp*(low + high), 0.25_wp, wp)
      ellipse%real_axis = 0.5_wp*(high - low)*sqrt(2.0_wp)
      ellipse%imaginary_axis = (0.25_wp + below)*sqrt(2.0_wp)
      call eigenvalues_within(problem, ellipse, 6*size(system%eigenvalues) + 12, exponents, vectors, info)
      if (info /= 0) return
      call refine(system, orbit, two_pi/period, vectors, exponents)
      do i = 1, size(exponents)
        values = [values, multipliers_from(exponents, i)]
      end do
    end if
    values = pack(values, abs(values) >= least)
    multipliers = sorted_multipliers(values, size(values), count(.not. orbit%stuck), &
                                     sum(system%law%tangents, mask=orbit%stuck))
  end subroutine hill_multipliers

  !> Polish exponents with more harmonics, where those are not too many; one that does not follow stays as it was.
  subroutine refine(system, orbit, nu, vectors, exponents)
    type(system_type), intent(in) :: system
    type(orbit_legs_type), intent(in) :: orbit
    real(wp), intent(in) :: nu
    !> Of fewer harmonics, in columns
    complex(wp), intent(in) :: vectors(:, :)
    complex(wp), intent(inout) :: exponents(:)
    type(hill_problem_type) :: problem
    complex(wp), allocatable :: start(:, :)
    complex(wp) :: polished
    integer :: i, n, pad, forces
    logical :: good

    call new_hill_problem(system, orbit, nu, problem, finer)
    if (problem%unknowns() > most_unknowns) return
    forces = size(problem%row)
    n = size(vectors, 1)/forces
    pad = (problem%unknowns()/forces - n)/2
    do i = 1, size(exponents)
      if (aimag(exponents(i)) < -truncation .or. aimag(exponents(i)) > 0.5_wp + truncation) cycle
      allocate (start(-pad + 1:n + pad, forces), source=(0.0_wp, 0.0_wp))
      start(1:n, :) = reshape(vectors(:, i), [n, forces])
      call polish_from(reshape(start, [size(start)]))
      deallocate (start)
    end do

  contains

    subroutine polish_from(vector)
      complex(wp), intent(in) :: vector(:)
      complex(wp) :: x(size(vector))

      x = vector
      call polish(problem, exponents(i), x, polished, good)
      if (good) exponents(i) = polished
    end subroutine polish_from
  end subroutine refine

  !> The multipliers of an exponent of the half strip, with its conjugate; none if it is a copy from another.
  !>
  !> A negative multiplier lies on the strip's upper edge, by itself but for truncation, which knows no symmetry there; a pair
  !> close to it has its partner mirrored beyond.
  pure function multipliers_from(exponents, i) result(values)
    complex(wp), intent(in) :: exponents(:)
    integer, intent(in) :: i
    complex(wp), allocatable :: values(:)
    real(wp), parameter :: rounding = 1.0e-7_wp
    complex(wp) :: value
    logical :: others(size(exponents))
    real(wp) :: height

    value = exp(two_pi*exponents(i))
    height = aimag(exponents(i))
    others = .true.
    others(i) = .false.
    if (abs(height - 0.5_wp) <= truncation) then
      if (.not. any(abs(exponents - conjg(exponents(i)) - (0.0_wp, 1.0_wp)) <= truncation .and. others)) height = 0.0_wp
    end if
    if (abs(height) <= rounding) then
      values = [cmplx(sign(abs(value), real(value, wp)), 0.0_wp, wp)]
    else if (height > 0.0_wp .and. height < 0.5_wp) then
      values = [value, conjg(value)]
    else
      allocate (values(0))
    end if
  end function multipliers_from

  !> Multipliers of the stuck system's modes that F does not know, as no force moves them or none is moved by them: theirs stay as
  !> they are, e^{sigma T}, sigma^2 + D sigma + Lambda = 0. Of modes with one frequency, as many as the rank of what they carry
  !> from force to displacement lacks.
  function unseen_multipliers(problem) result(values)
    type(hill_problem_type), intent(in) :: problem
    complex(wp), allocatable :: values(:)
    complex(wp) :: root
    real(wp) :: half
    integer :: first, last, m, unseen

    allocate (values(0))
    if (allocated(problem%system%coupling)) then
      ! Damping couples the modes: none is unseen, unless nothing sees.
      if (size(problem%row) == 0) values = free_multipliers(problem%system, two_pi/problem%nu)
      return
    end if
    m = size(problem%system%eigenvalues)
    first = 1
    do while (first <= m)
      last = last_alike(problem%system, first)
      unseen = last - first + 1 - carried(problem, first, last)
      half = 0.5_wp*problem%system%damping(first)
      root = sqrt(cmplx(half**2 - problem%system%eigenvalues(first), 0.0_wp, wp))
      values = [values, spread(exp(two_pi/problem%nu*(-half + root)), 1, unseen), &
                spread(exp(two_pi/problem%nu*(-half - root)), 1, unseen)]
      first = last + 1
    end do
  end function unseen_multipliers

  !> The last mode that has the frequency and damping of one, but for rounding.
  pure integer function last_alike(system, first) result(last)
    type(system_type), intent(in) :: system
    integer, intent(in) :: first
    real(wp), parameter :: rounding = 1.0e-10_wp
    integer :: next

    last = first
    do next = first + 1, size(system%eigenvalues)
      if (abs(system%eigenvalues(next) - system%eigenvalues(first)) > rounding*system%eigenvalues(first)) return
      if (abs(system%damping(next) - system%damping(first)) > rounding*abs(system%damping(first))) return
      last = next
    end do
  end function last_alike

  !> Rank of what some modes carry from forces to displacements.
  integer function carried(problem, first, last)
    type(hill_problem_type), intent(in) :: problem
    integer, intent(in) :: first, last
    !> Part of the largest carrier that is none
    real(wp), parameter :: nothing = 1.0e-9_wp
    complex(wp), allocatable :: carrier(:, :), u(:, :), w(:, :)
    real(wp), allocatable :: s(:)
    integer :: info

    carried = 0
    if (size(problem%row) == 0) return
    associate (rows => problem%system%rows, all_seen => [problem%row_u, problem%row_v])
      carrier = matmul(transpose(rows(first:last, all_seen)), rows(first:last, problem%row))
      call complex_singular_values(carrier, s, u, w, info)
      carried = count(s > nothing*maxval(norm2(rows(:, all_seen), 1))*maxval(norm2(rows(:, problem%row), 1)))
    end associate
  end function carried

  !> Multipliers of the stuck system with damping that couples its modes, by its eigenvalues in first order.
  function free_multipliers(system, period) result(values)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: period
    complex(wp), allocatable :: values(:)
    real(wp) :: companion(2*size(system%eigenvalues), 2*size(system%eigenvalues))
    integer :: r, m, info

    m = size(system%eigenvalues)
    companion = 0.0_wp
    companion(m + 1:, m + 1:) = -system%coupling
    do r = 1, m
      companion(r, m + r) = 1.0_wp
      companion(m + r, r) = -system%eigenvalues(r)
      companion(m + r, m + r) = -system%damping(r)
    end do
    call eigenvalues_of(companion, values, info)
    values = exp(period*values)
  end function free_multipliers

  !> Gather what contacts that slip or open do.
  subroutine new_hill_problem(system, orbit, nu, self, times)
    type(system_type), intent(in) :: system
    type(orbit_legs_type), intent(in) :: orbit
    real(wp), intent(in) :: nu
    type(hill_problem_type), intent(out) :: self
    !> So many times as many harmonics as usual
    integer, intent(in), optional :: times
    integer :: i

    self%system = system
    self%nu = nu
    ! As many beyond the fastest mode as below it, at most three times the fewest: faster modes follow at rest.
    self%harmonics = min(max(fewest_harmonics, ceiling(2.0_wp/nu)), 3*fewest_harmonics)
    if (present(times)) self%harmonics = times*self%harmonics
    allocate (self%row(0), self%row_u(0), self%row_v(0), self%stiffness(0), self%rests(0))
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
      type(contact_type), intent(in) :: law
      integer, intent(in) :: row
      real(wp), intent(in) :: stiffness

      self%row = [self%row, row]
      self%row_u = [self%row_u, law%first_row]
      self%row_v = [self%row_v, law%first_row + 1]
      self%stiffness = [self%stiffness, stiffness]
    end subroutine add_force
  end subroutine new_hill_problem

  pure logical function any_open(orbit, contact)
    type(orbit_legs_type), intent(in) :: orbit
    integer, intent(in) :: contact
    integer :: i

    any_open = any([(orbit%legs(i)%regime(contact) == regime_open, i=1, size(orbit%legs))])
  end function any_open

  !> The rests of a contact's slider; one that begins the period began at the end of the one before.
  pure subroutine add_rests(orbit, contact, force, rests)
    type(orbit_legs_type), intent(in) :: orbit
    integer, intent(in) :: contact, force
    type(rest_type), allocatable, intent(inout) :: rests(:)
    type(rest_type) :: rest
    integer :: i, j, n

    n = size(orbit%legs)
    do i = 1, n
      if (orbit%legs(i)%regime(contact) /= regime_stick) cycle
      ! Back to the leg at which it came to rest: one that begins, or the first after slip or lift-off at the end of the period.
      j = i
      do while (.not. orbit%legs(modulo(j - 1, n) + 1)%rests(contact))
        if (j < i - n) exit
        if (orbit%legs(modulo(j - 2, n) + 1)%regime(contact) /= regime_stick) exit
        j = j - 1
      end do
      rest = rest_type(force=force, from=orbit%legs(i)%from, to=orbit%legs(i)%from + orbit%legs(i)%length)
      associate (first => orbit%legs(modulo(j - 1, n) + 1), before => orbit%legs(modulo(j - 2, n) + 1))
        rest%origin = first%from - merge(two_pi, 0.0_wp, j < 1)
        rest%by_normal = first%by_normal(contact)
      end associate
      rests = [rests, rest]
    end do
  end subroutine add_rests

  !> Fourier coefficients of what multiplies u and v in a force while its contact slips or is open.
  pure subroutine integrate_legs(self, orbit, force)
    type(hill_problem_type), intent(inout) :: self
    type(orbit_legs_type), intent(in) :: orbit
    integer, intent(in) :: force
    complex(wp) :: part
    real(wp) :: by_u, by_v
    integer :: i, k, contact

    contact = findloc(self%system%law%first_row, self%row_u(force), 1)
    associate (law => self%system%law(contact))
      do i = 1, size(orbit%legs)
        associate (leg => orbit%legs(i))
          if (leg%regime(contact) == regime_stick) cycle
          by_u = 0.0_wp
          by_v = 0.0_wp
          if (self%row(force) == self%row_u(force)) then
            by_u = -law%tangential_stiffness
            by_v = leg%side(contact)*law%friction_coefficient*law%normal_stiffness
          else if (leg%regime(contact) == regime_open) then
            by_v = -law%normal_stiffness
          end if
          do k = -2*self%harmonics, 2*self%harmonics
            part = exponential_integral(cmplx(0.0_wp, -k, wp), leg%from, leg%from + leg%length)/two_pi
            self%slip_and_open(k, force, 1) = self%slip_and_open(k, force, 1) + by_u*part
            self%slip_and_open(k, force, 2) = self%slip_and_open(k, force, 2) + by_v*part
          end do
        end associate
      end do
    end associate
  end subroutine integrate_legs

  !> Integral of e^{z theta} over [from, to].
  pure complex(wp) function exponential_integral(z, from, to) result(integral)
    complex(wp), intent(in) :: z
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
    complex(wp), intent(in) :: s
    complex(wp), allocatable :: matrix(:, :)
    complex(wp) :: by_u(-self%harmonics:self%harmonics, -self%harmonics:self%harmonics), by_v(size(by_u, 1), size(by_u, 1))
    complex(wp), allocatable :: response(:, :, :)
    integer :: i, j, l, n, harmonics

    harmonics = self%harmonics
    n = 2*harmonics + 1
    response = responses(self, s)
    allocate (matrix(self%unknowns(), self%unknowns()))
    do i = 1, size(self%row)
      call force_by_motion(self, s, i, by_u, by_v)
      do j = 1, size(self%row)
        do l = 1, n
          matrix((i - 1)*n + 1:i*n, (j - 1)*n + l) = by_u(:, l - harmonics - 1)*response(l, j, self%row_u(i)) &
                                                     + by_v(:, l)*response(l, j, self%row_v(i))
        end do
      end do
    end do
    do i = 1, size(matrix, 1)
      matrix(i, i) = matrix(i, i) + 1.0_wp
    end do
  end function hill_matrix

  !> What every row moves by a unit of each force, R(s) [2 K + 1, forces, rows].
  function responses(self, s) result(response)
    type(hill_problem_type), intent(in) :: self
    complex(wp), intent(in) :: s
    complex(wp), allocatable :: response(:, :, :)
    complex(wp) :: sigma
    complex(wp), allocatable :: flexible(:, :), matrix(:, :)
    integer, allocatable :: pivots(:)
    integer :: k, r, info

    allocate (response(2*self%harmonics + 1, size(self%row), size(self%system%springs)))
    do k = -self%harmonics, self%harmonics
      sigma = self%nu*(s + cmplx(0.0_wp, k, wp))
      flexible = cmplx(self%system%pushes(:, self%row), 0.0_wp, wp)
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
      response(k + self%harmonics + 1, :, :) = matmul(transpose(flexible), self%system%rows)
    end do
  end function responses

  !> One force's harmonics by those of its contact's u and v, G(s) [2 K + 1, 2 K + 1] each.
  pure subroutine force_by_motion(self, s, force, by_u, by_v)
    type(hill_problem_type), intent(in) :: self
    complex(wp), intent(in) :: s
    integer, intent(in) :: force
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
        do k = -self%harmonics, self%harmonics
          held(k) = -self%stiffness(force)*exp(s*rest%origin)*exponential_integral(-(s + cmplx(0.0_wp, k, wp)), rest%from, rest%to) &
                    /two_pi
        end do
        do j = -self%harmonics, self%harmonics
          turn = exp(cmplx(0.0_wp, j*rest%origin, wp))
          by_u(:, j) = by_u(:, j) + turn*held
          by_v(:, j) = by_v(:, j) + rest%by_normal*turn*held
        end do
      end associate
    end do
  end subroutine force_by_motion
end module attrito_stability_hill
