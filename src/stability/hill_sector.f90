!> Hill's problem of one sector of a wheel for all Bloch wavenumbers: what becomes of perturbations that break the travelling wave.
!>
!> $$ \delta q_j = e^{s t} p_j(t), \qquad p_{j+1}(t) = e^{-i \psi} p_j(t - EO \, T / N), \quad \psi = 2 \pi \kappa / N, \quad
!>    \kappa = 0 \ldots N - 1 $$
!>
!> Harmonic k of p has nodal diameter kappa + k EO, so only the responses R_k change (`attrito_stability_hill_problem`): contacts act
!> in the sector's own time. (s, kappa) and (s + i omega, kappa + EO) are the same perturbation; (s, kappa) and (s*, N - kappa) are
!> conjugates. So half a strip of each of the N problems says all of the wheel.
module attrito_stability_hill_sector
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: complex_eigenvalues_of, complex_singular_values
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  use attrito_model_contacts, only: contacts_type
  use attrito_model_structure, only: structure_type, damping_viscous
  use attrito_linear_diameter_modes, only: diameter_modes_type, new_diameter_modes
  use attrito_integrate_system, only: system_type
  use attrito_stability_contour, only: eigenvalues_within
  use attrito_stability_hill, only: half_strip, refined_heights, least, most_unknowns, truncation, too_large
  use attrito_stability_hill_problem, only: hill_problem_type, new_hill_problem
  use attrito_stability_hill_refinement, only: refine, many_harmonics
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet, kind_slip, kind_stuck
  use attrito_stability_smooth_segments, only: orbit_segments_type
  implicit none
  private
  public :: wheel_modes_type, new_wheel_modes, wheel_multipliers

  !> Modes of the stuck wheel at one nodal diameter, normalised by mass, in a time that the fastest mode sets
  type :: wave_modes_type
    !> Squares of frequencies, and damping [n]
    real(wp), allocatable :: eigenvalues(:), damping(:)
    !> What damping couples of the modes, with its diagonal [n, n]; not allocated if nothing
    complex(wp), allocatable :: coupling(:, :)
    !> Rows of B in columns [n, rows]
    complex(wp), allocatable :: rows(:, :)
  end type wave_modes_type

  type :: wheel_modes_type
    !> N and EO
    integer :: sectors = 1, engine_order = 0
    !> Laws, springs and clock of the sector: it has no modes in common
    type(system_type) :: contacts
    !> By nodal diameter [0:N/2]; beyond they are conjugates
    type(wave_modes_type), allocatable :: diameters(:)
  end type wheel_modes_type

  type, extends(hill_problem_type) :: hill_sector_problem_type
    type(wheel_modes_type) :: wheel
    integer :: wavenumber = 0
  contains
    procedure :: responses
  end type hill_sector_problem_type

contains

  !> Diagonalise all nodal diameters of the stuck wheel.
  subroutine new_wheel_modes(structure, contacts, self, status)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    type(wheel_modes_type), intent(out) :: self
    !> 0, or not: a nodal diameter is not held
    integer, intent(out) :: status
    type(diameter_modes_type), allocatable :: modes(:)
    integer :: n

    associate (sector => structure%sector)
      self%sectors = sector%sectors
      self%engine_order = sector%engine_order
      allocate (modes(0:self%sectors/2), self%diameters(0:self%sectors/2))
      self%contacts%clock = 0.0_wp
      do n = 0, ubound(modes, 1)
        call new_diameter_modes(structure, contacts%directions, contacts%row_stiffness, n, .false., modes(n), status)
        if (status /= 0) return
        self%contacts%clock = max(self%contacts%clock, maxval(modes(n)%omega))
      end do
      self%contacts%law = contacts%law
      self%contacts%springs = contacts%row_stiffness
      do n = 0, ubound(modes, 1)
        self%diameters(n) = wave_modes(structure, contacts, modes(n), n, self%contacts%clock)
      end do
    end associate
  end subroutine new_wheel_modes

  !> One nodal diameter in the wheel's clock.
  pure function wave_modes(structure, contacts, modes, diameter, clock) result(self)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Modes of the stuck system
    type(diameter_modes_type), intent(in) :: modes
    !> Nodal diameter
    integer, intent(in) :: diameter
    !> Units of time per second
    real(wp), intent(in) :: clock
    type(wave_modes_type) :: self
    complex(wp), allocatable :: shapes(:, :)
    integer :: r

    associate (n => modes%count, sector => structure%sector)
      self%eigenvalues = (modes%omega(:n)/clock)**2
      self%damping = modes%modal_damping(:n)/modes%modal_mass(:n)/clock
      shapes = modes%modes(:, :n)/spread(sqrt(modes%modal_mass(:n)), 1, size(modes%modes, 1))
      ! A unit of force accelerates by the clock's square less.
      self%rows = matmul(conjg(transpose(shapes)), sector%project_rows(contacts%directions, diameter))/clock
      if (structure%damping_kind == damping_viscous) self%coupling = in_shapes(structure%damping)
      if (allocated(structure%gyroscopic)) then
        if (.not. allocated(self%coupling)) then
          allocate (self%coupling(n, n), source=(0.0_wp, 0.0_wp))
          do r = 1, n
            self%coupling(r, r) = self%damping(r)
          end do
        end if
        self%coupling = self%coupling + in_shapes(structure%gyroscopic)
      end if
    end associate

  contains

    !> Phi^H S^H A S Phi in the clock's time [n, n].
    pure function in_shapes(matrix) result(coupled)
      !> A, of the sector's coordinates [m, m]
      real(wp), intent(in) :: matrix(:, :)
      complex(wp), allocatable :: coupled(:, :)

      coupled = matmul(conjg(transpose(shapes)), matmul(structure%sector%couple(matrix, diameter), shapes))/clock
    end function in_shapes
  end function wave_modes

  !> What rows move by a unit of each force, R(s) [2 K + 1, forces, rows].
  function responses(self, s, rows) result(response)
    class(hill_sector_problem_type), intent(in) :: self
    !> Exponent over the angular frequency
    complex(wp), intent(in) :: s
    !> Rows of B
    integer, intent(in) :: rows(:)
    complex(wp), allocatable :: response(:, :, :)
    complex(wp), allocatable :: flexible(:, :), matrix(:, :)
    complex(wp) :: sigma
    logical :: mirrored
    integer, allocatable :: pivots(:)
    integer :: k, n, r, info

    allocate (response(2*self%harmonics + 1, size(self%row), size(rows)))
    do k = -self%harmonics, self%harmonics
      n = modulo(self%wavenumber + k*self%wheel%engine_order, self%wheel%sectors)
      mirrored = 2*n > self%wheel%sectors
      if (mirrored) n = self%wheel%sectors - n
      associate (modes => self%wheel%diameters(n))
        ! A mirror image answers sigma as its twin does the conjugate, conjugate.
        sigma = self%nu*(s + cmplx(0.0_wp, k, wp))
        if (mirrored) sigma = conjg(sigma)
        flexible = modes%rows(:, self%row)
        if (allocated(modes%coupling)) then
          matrix = sigma*modes%coupling
          do r = 1, size(matrix, 1)
            matrix(r, r) = matrix(r, r) + sigma**2 + modes%eigenvalues(r)
          end do
          if (allocated(pivots)) deallocate (pivots)
          allocate (pivots(size(matrix, 1)))
          call factor_complex(matrix, pivots, info)
          call solve_factored_complex(matrix, pivots, flexible)
        else
          do r = 1, size(flexible, 1)
            flexible(r, :) = flexible(r, :)/(sigma**2 + sigma*modes%damping(r) + modes%eigenvalues(r))
          end do
        end if
        flexible = matmul(conjg(transpose(modes%rows(:, rows))), flexible)
        if (mirrored) flexible = conjg(flexible)
        response(k + self%harmonics + 1, :, :) = transpose(flexible)
      end associate
    end do
  end function responses

  !> Multipliers of the whole wheel that are at least 0.01 in modulus, each with its wavenumber, and those of sliders.
  subroutine wheel_multipliers(wheel, orbit, omega, multipliers, breaks_into, breaks_at, info)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    !> What the sector's contacts do over the period
    type(orbit_segments_type), intent(in) :: orbit
    !> Angular frequency of the excitation
    real(wp), intent(in) :: omega
    !> The largest first
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> Of the perturbation with the largest multiplier, its largest harmonic's nodal diameter; and this harmonic's angular frequency
    integer, intent(out) :: breaks_into
    real(wp), intent(out) :: breaks_at
    !> 0, `too_large`, or another: not found
    integer, intent(out) :: info
    type(hill_sector_problem_type) :: problem, wide
    type(multiplier_type), allocatable :: found(:)
    complex(wp), allocatable :: exponents(:), vectors(:, :), strip(:)
    integer, allocatable :: wavenumbers(:)
    real(wp) :: largest
    integer :: i

    breaks_into = 0
    breaks_at = 0.0_wp
    info = 0
    problem%wheel = wheel
    wide%wheel = wheel
    call new_hill_problem(wheel%contacts, orbit, omega/wheel%contacts%clock, problem)
    call new_hill_problem(wheel%contacts, orbit, omega/wheel%contacts%clock, wide, many_harmonics)
    found = unseen_multipliers(problem, omega)
    if (problem%unknowns() > most_unknowns) info = too_large
    if (info /= 0) return
    largest = 0.0_wp
    allocate (strip(0), wavenumbers(0))
    do i = 0, wheel%sectors - 1
      if (problem%unknowns() == 0) exit
      problem%wavenumber = i
      wide%wavenumber = i
      call eigenvalues_within(problem, half_strip(), 6*most_of_a_diameter(wheel) + 12, exponents, vectors, info)
      if (info /= 0) return
      call refine(problem, wide, refined_heights, vectors, exponents)
      call take()
    end do
    found = [found, from_half_strip(wheel, strip, wavenumbers)]
    found = pack(found, abs(found%value) >= least)
    multipliers = [by_size(found), &
                   spread(multiplier_type(0.0_wp, kind_slip), 1, wheel%sectors*count(.not. orbit%stuck)), &
                   spread(multiplier_type(1.0_wp, kind_stuck), 1, wheel%sectors*sum(wheel%contacts%law%tangents, mask=orbit%stuck))]

  contains

    !> Exponents of one wavenumber, all of the half strip and of its edges.
    subroutine take()
      real(wp) :: height
      integer :: j

      do j = 1, size(exponents)
        height = aimag(exponents(j))
        if (height < -truncation .or. height > 0.5_wp + truncation) cycle
        strip = [strip, exponents(j)]
        wavenumbers = [wavenumbers, i]
        if (exp(two_pi*real(exponents(j), wp)) <= largest) cycle
        largest = exp(two_pi*real(exponents(j), wp))
        call find_largest_harmonic(problem, exponents(j), vectors(:, j), breaks_into, breaks_at)
        breaks_at = breaks_at*omega
      end do
    end subroutine take
  end subroutine wheel_multipliers

  !> Multipliers of all exponents with Im s in (-omega/2, omega/2], from those of half the strip, each with its conjugate.
  !>
  !> (s, kappa) has the conjugates (s*, -kappa) and (s* + i, EO - kappa), s over omega. On the strip's edges one of these is in the
  !> half strip, too, and was found by itself, in its own problem: it is known by its place. It may be the perturbation itself.
  pure function from_half_strip(wheel, exponents, wavenumbers) result(found)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    !> Over the angular frequency, of all wavenumbers, and these
    complex(wp), intent(in) :: exponents(:)
    integer, intent(in) :: wavenumbers(:)
    type(multiplier_type), allocatable :: found(:)
    logical :: used(size(exponents))
    integer :: i, partner

    allocate (found(0))
    used = .false.
    do i = 1, size(exponents)
      if (used(i)) cycle
      partner = conjugate_of(i)
      used(i) = .true.
      found = [found, multiplier_of(i)]
      if (partner == 0) then
        found = [found, multiplier_of(i)]
        associate (last => found(size(found)))
          last%value = conjg(last%value)
          last%wavenumber = modulo(-last%wavenumber, wheel%sectors)
        end associate
      else if (partner /= i) then
        used(partner) = .true.
        found = [found, multiplier_of(partner)]
      end if
    end do

  contains

    !> With the wavenumber of the exponent in the strip.
    pure type(multiplier_type) function multiplier_of(i)
      !> Number of the exponent
      integer, intent(in) :: i
      !> How far an exponent on the edge, of a negative multiplier, is from it at most by what harmonics leave out
      real(wp), parameter :: blurred = 1.0e-4_wp ! guess

      multiplier_of = multiplier_type(exp(two_pi*exponents(i)), kind_floquet, wavenumbers(i))
      if (aimag(exponents(i)) > 0.5_wp + blurred) then
        multiplier_of%wavenumber = modulo(wavenumbers(i) - wheel%engine_order, wheel%sectors)
      end if
    end function multiplier_of

    !> The nearest exponent that is not used yet to a conjugate of one; 0: there is none. Problems of kappa and -kappa are each
    !> other's conjugates to rounding, those of kappa and EO - kappa but for truncation.
    pure integer function conjugate_of(i)
      !> Number of the exponent
      integer, intent(in) :: i
      !> Part that is rounding
      real(wp), parameter :: rounding = 1.0e-7_wp ! derived
      real(wp) :: distance, nearest
      integer :: j

      conjugate_of = 0
      nearest = truncation
      do j = 1, size(exponents)
        if (used(j)) cycle
        distance = huge(distance)
        associate (sum_of_both => wavenumbers(i) + wavenumbers(j), apart => exponents(j) - conjg(exponents(i)))
          if (modulo(sum_of_both, wheel%sectors) == 0 .and. abs(apart) <= rounding) distance = abs(apart)
          if (modulo(sum_of_both - wheel%engine_order, wheel%sectors) == 0) then
            distance = min(distance, abs(apart - (0.0_wp, 1.0_wp)))
          end if
        end associate
        if (distance > nearest) cycle
        nearest = distance
        conjugate_of = j
      end do
    end function conjugate_of
  end function from_half_strip

  !> Modes of the nodal diameter that has most.
  pure integer function most_of_a_diameter(wheel) result(most)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    integer :: n

    most = maxval([(size(wheel%diameters(n)%eigenvalues), n=0, ubound(wheel%diameters, 1))])
  end function most_of_a_diameter

  !> Of a perturbation, the nodal diameter of the harmonic by which contacts move most, and its frequency.
  subroutine find_largest_harmonic(problem, s, vector, diameter, frequency)
    !> Hill's problem of a wavenumber
    type(hill_sector_problem_type), intent(in) :: problem
    !> Exponent over the angular frequency
    complex(wp), intent(in) :: s
    !> Forces' harmonics, force by force
    complex(wp), intent(in) :: vector(:)
    integer, intent(out) :: diameter
    !> Over the angular frequency of the excitation
    real(wp), intent(out) :: frequency
    complex(wp), allocatable :: response(:, :, :), forces(:, :)
    real(wp) :: size_of(2*problem%harmonics + 1)
    integer :: k

    response = problem%responses(s, [(k, k=1, size(problem%system%springs))])
    forces = reshape(vector, [2*problem%harmonics + 1, size(problem%row)])
    do k = 1, size(size_of)
      size_of(k) = norm2(abs(matmul(forces(k, :), response(k, :, :))))
    end do
    k = maxloc(size_of, 1) - problem%harmonics - 1
    diameter = modulo(problem%wavenumber + k*problem%wheel%engine_order, problem%wheel%sectors)
    frequency = abs(aimag(s) + k)
  end subroutine find_largest_harmonic

  !> Exponents of one nodal diameter while all contacts stick, s^2 + D s + Lambda singular, by its eigenvalues in first order; none
  !> where they are not found.
  function free_exponents(modes) result(exponents)
    !> In modes that damping or Coriolis forces couple
    type(wave_modes_type), intent(in) :: modes
    complex(wp), allocatable :: exponents(:), vectors(:, :)
    complex(wp) :: companion(2*size(modes%eigenvalues), 2*size(modes%eigenvalues))
    integer :: m, r, info

    m = size(modes%eigenvalues)
    companion = 0.0_wp
    companion(m + 1:, m + 1:) = -modes%coupling
    do r = 1, m
      companion(r, m + r) = 1.0_wp
      companion(m + r, r) = -modes%eigenvalues(r)
    end do
    call complex_eigenvalues_of(companion, exponents, vectors, info)
    if (info /= 0) exponents = exponents(:0)
  end function free_exponents

  !> Multipliers of modes that no contact moves or is moved by: theirs stay as they are, with the wavenumber of the exponent in the
  !> strip. Damping and Coriolis forces that couple modes leave none unseen, unless nothing sees.
  function unseen_multipliers(problem, omega) result(values)
    !> Hill's problem, of any wavenumber
    type(hill_sector_problem_type), intent(in) :: problem
    !> Angular frequency of the excitation
    real(wp), intent(in) :: omega
    type(multiplier_type), allocatable :: values(:)
    complex(wp), allocatable :: exponents(:)
    complex(wp) :: root
    real(wp) :: half
    integer :: n, r, sign

    allocate (values(0))
    do n = 0, ubound(problem%wheel%diameters, 1)
      associate (modes => problem%wheel%diameters(n))
        if (allocated(modes%coupling)) then
          if (size(problem%row) > 0) cycle
          exponents = free_exponents(modes)
          do r = 1, size(exponents)
            call add(exponents(r), n)
            if (modulo(2*n, problem%wheel%sectors) /= 0) call add(conjg(exponents(r)), -n)
          end do
          cycle
        end if
        do r = 1, size(modes%eigenvalues)
          if (is_seen(problem, n, r)) cycle
          half = 0.5_wp*modes%damping(r)
          root = sqrt(cmplx(half**2 - modes%eigenvalues(r), 0.0_wp, wp))
          do sign = -1, 1, 2
            call add(-half + sign*root, n)
            if (modulo(2*n, problem%wheel%sectors) /= 0) call add(-half + sign*root, -n)
          end do
        end do
      end associate
    end do

  contains

    subroutine add(exponent, diameter)
      !> By the clock
      complex(wp), intent(in) :: exponent
      !> Nodal diameter
      integer, intent(in) :: diameter
      complex(wp) :: s
      integer :: k

      s = exponent*problem%wheel%contacts%clock/omega
      k = nint(aimag(s))
      s = s - cmplx(0.0_wp, k, wp)
      values = [values, multiplier_type(exp(two_pi*s), kind_floquet, &
                                        modulo(diameter - k*problem%wheel%engine_order, problem%wheel%sectors))]
    end subroutine add
  end function unseen_multipliers

  !> Does any force of the problem move a mode that moves a contact of it? Of several modes with one frequency all count as seen.
  pure logical function is_seen(problem, diameter, mode)
    !> Hill's problem, of any wavenumber
    type(hill_sector_problem_type), intent(in) :: problem
    !> Nodal diameter; number of the mode
    integer, intent(in) :: diameter, mode
    !> Part of the largest that is none
    real(wp), parameter :: nothing = 1.0e-9_wp ! derived

    is_seen = .false.
    if (size(problem%row) == 0) return
    associate (rows => problem%wheel%diameters(diameter)%rows, all_seen => [problem%row_u, problem%row_v])
      is_seen = maxval(abs(rows(mode, problem%row))) > nothing*maxval(abs(rows(:, problem%row))) .and. &
                maxval(abs(rows(mode, all_seen))) > nothing*maxval(abs(rows(:, all_seen)))
    end associate
  end function is_seen

  !> The largest first.
  pure function by_size(multipliers) result(sorted)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)
    type(multiplier_type) :: sorted(size(multipliers))
    logical :: left(size(multipliers))
    integer :: i, largest

    left = .true.
    do i = 1, size(multipliers)
      largest = maxloc(abs(multipliers%value), 1, mask=left)
      sorted(i) = multipliers(largest)
      left(largest) = .false.
    end do
  end function by_size
end module attrito_stability_hill_sector
