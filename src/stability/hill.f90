!> Multipliers of an orbit by Hill's problem with memory (`attrito_stability_hill_problem`): the exponents of half a strip of height
!> omega all at once, by contour integrals around it, each then refined with many more harmonics
!> (`attrito_stability_hill_refinement`); and those of modes that contacts do not see.
module attrito_stability_hill
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: eigenvalues_of, complex_singular_values
  use attrito_integrate_system, only: system_type
  use attrito_stability_contour, only: ellipse_type, eigenvalues_within
  use attrito_stability_hill_problem, only: hill_problem_type, new_hill_problem
  use attrito_stability_hill_refinement, only: refine, many_harmonics
  use attrito_stability_smooth_segments, only: orbit_segments_type
  use attrito_stability_multipliers, only: multiplier_type, sorted_multipliers
  implicit none
  private
  public :: hill_multipliers, half_strip, refined_heights, least, most_unknowns, truncation, too_large

  !> Smallest and largest modulus of the multipliers that are looked for
  real(wp), parameter :: least = 1.0e-2_wp, greatest = 1.0e3_wp ! conventional
  !> Unknowns of a dense nonlinear eigenproblem, at most
  integer, parameter :: most_unknowns = 1500 ! conventional
  !> How far truncation may move an exponent
  real(wp), parameter :: truncation = 1.0e-3_wp ! guess
  !> Exponents that are refined: those of the half strip and of its edges
  real(wp), parameter :: refined_heights(2) = [-truncation, 0.5_wp + truncation] ! derived
  !> `info` where there are more
  integer, parameter :: too_large = -1

contains

  !> Multipliers of an orbit that are at least 0.01 in modulus, and those of sliders.
  subroutine hill_multipliers(system, orbit, period, multipliers, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit as segments between its events
    type(orbit_segments_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    !> Floquet multipliers
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0, `too_large`, or another: not found
    integer, intent(out) :: info
    type(hill_problem_type) :: problem, wide
    complex(wp), allocatable :: exponents(:), vectors(:, :), values(:)
    integer :: i

    call new_hill_problem(system, orbit, two_pi/period, problem)
    values = unseen_multipliers(problem)
    info = 0
    if (problem%unknowns() > most_unknowns) info = too_large
    if (info /= 0) return
    if (problem%unknowns() > 0) then
      call eigenvalues_within(problem, half_strip(), 6*size(system%eigenvalues) + 12, exponents, vectors, info)
      if (info /= 0) return
      call new_hill_problem(system, orbit, two_pi/period, wide, many_harmonics)
      call refine(problem, wide, refined_heights, vectors, exponents)
      do i = 1, size(exponents)
        values = [values, multipliers_from(exponents, i)]
      end do
    end if
    values = pack(values, abs(values) >= least)
    multipliers = sorted_multipliers(values, size(values), count(.not. orbit%stuck), &
                                     sum(system%law%tangents, mask=orbit%stuck))
  end subroutine hill_multipliers

  !> Half a strip of exponents says all: the other half is conjugate, and so is what lies beyond. An ellipse about the rectangle.
  pure type(ellipse_type) function half_strip()
    !> Room below the real axis, and above one half
    real(wp), parameter :: below = 0.05_wp ! guess
    !> Ends of the strip
    real(wp), parameter :: low = log(least)/two_pi, high = log(greatest)/two_pi ! derived

    half_strip%centre = cmplx(0.5_wp*(low + high), 0.25_wp, wp)
    half_strip%real_axis = 0.5_wp*(high - low)*sqrt(2.0_wp)
    half_strip%imaginary_axis = (0.25_wp + below)*sqrt(2.0_wp)
  end function half_strip

  !> The multipliers of an exponent of the half strip, with its conjugate; none if it is a copy from another.
  !>
  !> A negative multiplier lies on the strip's upper edge, by itself but for truncation, which knows no symmetry there; a pair
  !> close to it has its partner mirrored beyond.
  pure function multipliers_from(exponents, i) result(values)
    !> Floquet exponents, 1/s
    complex(wp), intent(in) :: exponents(:)
    !> Number of the mode or contact
    integer, intent(in) :: i
    complex(wp), allocatable :: values(:)
    !> Part that is rounding
    real(wp), parameter :: rounding = 1.0e-7_wp ! derived
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
    !> Hill's problem with the delays of sticking sliders
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
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> First of the modes or segments
    integer, intent(in) :: first
    !> Part that is rounding
    real(wp), parameter :: rounding = 1.0e-10_wp ! derived
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
    !> Hill's problem with the delays of sticking sliders
    type(hill_problem_type), intent(in) :: problem
    !> First of the modes or segments; last of the modes
    integer, intent(in) :: first, last
    !> Part of the largest carrier that is none
    real(wp), parameter :: nothing = 1.0e-9_wp ! derived
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
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Length of the period, s
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
end module attrito_stability_hill
