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
  use attrito_stability_contour, only: eigenvalues_within
  use attrito_stability_hill, only: half_strip, refined_heights, least, most_unknowns, truncation, too_large
  use attrito_stability_hill_problem, only: hill_problem_type, new_hill_problem
  use attrito_stability_hill_refinement, only: refine, many_harmonics
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet, kind_slip, kind_stuck
  use attrito_stability_smooth_segments, only: orbit_segments_type
  use attrito_stability_wheel_modes, only: wave_modes_type, wheel_modes_type, most_of_a_diameter
  implicit none
  private
  public :: wheel_multipliers

  !> Exponents in half the strip, of all wavenumbers
  type :: strip_type
    !> Over the angular frequency
    complex(wp), allocatable :: exponents(:)
    integer, allocatable :: wavenumbers(:)
    !> Modulus of the largest multiplier; of its perturbation's largest harmonic the nodal diameter, and the frequency over that of
    !> the excitation
    real(wp) :: largest = 0.0_wp
    integer :: breaks_into = 0
    real(wp) :: breaks_at = 0.0_wp
  end type strip_type

  type, extends(hill_problem_type) :: hill_sector_problem_type
    type(wheel_modes_type) :: wheel
    integer :: wavenumber = 0
  contains
    procedure :: responses
  end type hill_sector_problem_type

contains

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
    complex(wp), allocatable :: exponents(:), vectors(:, :)
    type(strip_type) :: strip
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
    allocate (strip%exponents(0), strip%wavenumbers(0))
    do i = 0, wheel%sectors - 1
      if (problem%unknowns() == 0) exit
      problem%wavenumber = i
      wide%wavenumber = i
      call eigenvalues_within(problem, half_strip(), 6*most_of_a_diameter(wheel) + 12, exponents, vectors, info)
      if (info /= 0) return
      call refine(problem, wide, refined_heights, vectors, exponents)
      call take_exponents(problem, exponents, vectors, strip)
    end do
    breaks_into = strip%breaks_into
    breaks_at = strip%breaks_at*omega
    found = [found, from_half_strip(wheel, strip%exponents, strip%wavenumbers)]
    found = pack(found, abs(found%value) >= least)
    multipliers = [by_size(found), &
                   spread(multiplier_type(0.0_wp, kind_slip), 1, wheel%sectors*count(.not. orbit%stuck)), &
                   spread(multiplier_type(1.0_wp, kind_stuck), 1, wheel%sectors*sum(wheel%contacts%law%tangents, mask=orbit%stuck))]
  end subroutine wheel_multipliers

  !> Exponents of one wavenumber, all of the half strip and of its edges.
  subroutine take_exponents(problem, exponents, vectors, strip)
    !> Hill's problem of the wavenumber
    type(hill_sector_problem_type), intent(in) :: problem
    !> Over the angular frequency; forces' harmonics of each [unknowns, exponents]
    complex(wp), intent(in) :: exponents(:), vectors(:, :)
    !> What was found so far
    type(strip_type), intent(inout) :: strip
    real(wp) :: height
    integer :: j

    do j = 1, size(exponents)
      height = aimag(exponents(j))
      if (height < -truncation .or. height > 0.5_wp + truncation) cycle
      strip%exponents = [strip%exponents, exponents(j)]
      strip%wavenumbers = [strip%wavenumbers, problem%wavenumber]
      if (exp(two_pi*real(exponents(j), wp)) <= strip%largest) cycle
      strip%largest = exp(two_pi*real(exponents(j), wp))
      call find_largest_harmonic(problem, exponents(j), vectors(:, j), strip%breaks_into, strip%breaks_at)
    end do
  end subroutine take_exponents

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
      partner = conjugate_of(wheel, exponents, wavenumbers, used, i)
      used(i) = .true.
      found = [found, multiplier_of(wheel, exponents(i), wavenumbers(i))]
      if (partner == 0) then
        found = [found, multiplier_of(wheel, exponents(i), wavenumbers(i))]
        associate (last => found(size(found)))
          last%value = conjg(last%value)
          last%wavenumber = modulo(-last%wavenumber, wheel%sectors)
        end associate
      else if (partner /= i) then
        used(partner) = .true.
        found = [found, multiplier_of(wheel, exponents(partner), wavenumbers(partner))]
      end if
    end do
  end function from_half_strip

  !> With the wavenumber of the exponent in the strip.
  pure type(multiplier_type) function multiplier_of(wheel, exponent, wavenumber) result(found)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    !> Over the angular frequency
    complex(wp), intent(in) :: exponent
    !> Of the problem in which it was found
    integer, intent(in) :: wavenumber
    !> How far an exponent on the edge, of a negative multiplier, is from it at most by what harmonics leave out
    real(wp), parameter :: blurred = 1.0e-4_wp ! guess

    found = multiplier_type(exp(two_pi*exponent), kind_floquet, wavenumber)
    if (aimag(exponent) > 0.5_wp + blurred) found%wavenumber = modulo(wavenumber - wheel%engine_order, wheel%sectors)
  end function multiplier_of

  !> The nearest exponent that is not used yet to a conjugate of one; 0: there is none. Problems of kappa and -kappa are each
  !> other's conjugates to rounding, those of kappa and EO - kappa but for truncation.
  pure integer function conjugate_of(wheel, exponents, wavenumbers, used, i) result(nearest)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    !> Over the angular frequency, of all wavenumbers, and these
    complex(wp), intent(in) :: exponents(:)
    integer, intent(in) :: wavenumbers(:)
    !> Which ones are taken already
    logical, intent(in) :: used(:)
    !> Number of the exponent
    integer, intent(in) :: i
    !> Part that is rounding
    real(wp), parameter :: rounding = 1.0e-7_wp ! derived
    real(wp) :: distance, least_distance
    integer :: j

    nearest = 0
    least_distance = truncation
    do j = 1, size(exponents)
      if (used(j)) cycle
      distance = huge(distance)
      associate (sum_of_both => wavenumbers(i) + wavenumbers(j), apart => exponents(j) - conjg(exponents(i)))
        if (modulo(sum_of_both, wheel%sectors) == 0 .and. abs(apart) <= rounding) distance = abs(apart)
        if (modulo(sum_of_both - wheel%engine_order, wheel%sectors) == 0) then
          distance = min(distance, abs(apart - (0.0_wp, 1.0_wp)))
        end if
      end associate
      if (distance > least_distance) cycle
      least_distance = distance
      nearest = j
    end do
  end function conjugate_of

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
