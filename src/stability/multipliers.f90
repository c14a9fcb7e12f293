!> Floquet multipliers of an orbit from its monodromy, and what each of them stands for.
!>
!> A contact that neither slips nor opens keeps its slider: its row of the monodromy is that of the identity, a multiplier 1
!> (`stuck`) that says that the orbit is one of a family, not that it is about to bifurcate. A contact that slips or opens forgets
!> its slider within the period: a multiplier 0 (`slip`) for each tangent. All others (`floquet`), two a mode, decide. One more is
!> that of a contact which slips along two tangents and never opens: it forgets its slider but not from which side that came, a
!> memory that fades as the direction turns towards the motion.
!>
!> Zeros of several contacts may sit in one Jordan block, where rounding turns them into its root of that order. So they are taken
!> out first: the matrix is restricted to its range until it is regular, each time by the singular values that are not rounding.
module attrito_stability_multipliers
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: eigenvalues_of, singular_values
  use attrito_integrate_system, only: system_type
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_reduced, only: reduce_to
  implicit none
  private
  public :: multiplier_type, multipliers_of, in_modes, sorted_multipliers, largest_change
  public :: kind_floquet, kind_slip, kind_stuck, kind_names

  integer, parameter :: kind_floquet = 0, kind_slip = 1, kind_stuck = 2
  character(7), parameter :: kind_names(0:2) = [character(7) :: 'floquet', 'slip', 'stuck']

  !> Modes of which all are taken; frequency over the excitation's up to which modes are taken at first; change that counts as none
  integer, parameter :: few = 40 ! conventional
  real(wp), parameter :: nearest = 10.0_wp, accepted = 1.0e-3_wp ! guess

  type :: multiplier_type
    complex(wp) :: value = 0.0_wp
    !> One of `kind_...`
    integer :: kind = kind_floquet
    !> Of a wheel's sector, 0 ... N - 1; -1: none
    integer :: wavenumber = -1
  end type multiplier_type

contains

  !> Multipliers of an orbit in as many modes as it takes: all of few; of many the lowest, twice as many again and again until
  !> those that matter no longer change.
  subroutine multipliers_of(system, orbit, multipliers, modes, change, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit that is examined
    type(orbit_type), intent(in) :: orbit
    !> Floquet multipliers
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> How many they are found in
    integer, intent(out) :: modes
    !> By the last doubling of modes; zero if all are in
    real(wp), intent(out) :: change
    !> 0, or not: eigenvalues were not found
    integer, intent(out) :: info
    type(multiplier_type), allocatable :: before(:)
    integer :: all_modes

    all_modes = size(system%eigenvalues)
    modes = first_modes(system, orbit%period)
    call in_modes(system, modes, orbit, multipliers, info)
    change = 0.0_wp
    do while (modes < all_modes .and. info == 0)
      call move_alloc(multipliers, before)
      modes = min(2*modes, all_modes)
      call in_modes(system, modes, orbit, multipliers, info)
      if (info /= 0) return
      change = largest_change(before, multipliers)
      if (change <= accepted) return
      if (modes == all_modes) change = 0.0_wp
    end do
  end subroutine multipliers_of

  !> Modes that are taken at first: all of few, or the lowest.
  pure integer function first_modes(system, period)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> In units of the clock
    real(wp), intent(in) :: period

    first_modes = min(max(few, count(system%eigenvalues <= (nearest*two_pi/period)**2)), size(system%eigenvalues))
  end function first_modes

  !> The farthest that a dynamic multiplier of at least half the largest modulus lies from all that were found before.
  pure real(wp) function largest_change(before, now)
    !> Floquet multipliers; perturbations at the present instant
    type(multiplier_type), intent(in) :: before(:), now(:)
    real(wp) :: largest
    integer :: i

    largest = maxval(abs(now%value), mask=now%kind == kind_floquet)
    largest_change = 0.0_wp
    do i = 1, size(before)
      if (before(i)%kind /= kind_floquet .or. abs(before(i)%value) < 0.5_wp*largest) cycle
      largest_change = max(largest_change, minval(abs(now%value - before(i)%value), mask=now%kind == kind_floquet))
    end do
    largest_change = max(largest_change, abs(largest - maxval(abs(before%value), mask=before%kind == kind_floquet)))
  end function largest_change

  !> Multipliers in some of the modes, the largest first within each kind.
  subroutine in_modes(system, modes, orbit, multipliers, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Number of modes
    integer, intent(in) :: modes
    !> Orbit that is examined
    type(orbit_type), intent(in) :: orbit
    !> Floquet multipliers
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0: done, else LAPACK's code
    integer, intent(out) :: info
    complex(wp), allocatable :: values(:)
    real(wp), allocatable :: regular(:, :), scale(:)
    integer :: i, turning

    regular = orbit%monodromy(reduce_to(system, modes))
    ! A unit of what a contact remembers is one that a unit of motion brings about.
    scale = [spread(1.0_wp, 1, 2*modes), (norm2(system%rows(:, system%law(orbit%memory(i)%contact)%first_row)), &
                                          i=1, size(orbit%memory))]
    where (scale <= 0.0_wp) scale = 1.0_wp
    regular = regular*spread(scale, 1, size(scale))/spread(scale, 2, size(scale))
    call restrict_to_range(regular, info)
    if (info == 0) call eigenvalues_of(regular, values, info)
    if (info /= 0) return
    associate (tangents => system%law%tangents)
      turning = count(system%law%has_direction() .and. orbit%closed .and. .not. orbit%stuck)
      multipliers = sorted_multipliers(values, 2*modes + turning, sum(tangents, mask=.not. orbit%stuck) - turning, &
                                       sum(tangents, mask=orbit%stuck))
    end associate
  end subroutine in_modes

  !> Multipliers of all kinds: the largest of some values, then zeros for the contacts that forget, then ones for those that stick.
  pure function sorted_multipliers(values, dynamic, forgetting, stuck) result(multipliers)
    !> Multipliers
    complex(wp), intent(in) :: values(:)
    !> How many of each kind: `floquet` (values that are missing are zero), `slip`, `stuck`
    integer, intent(in) :: dynamic, forgetting, stuck
    type(multiplier_type) :: multipliers(dynamic + forgetting + stuck)
    complex(wp) :: left(size(values))
    integer :: i, largest

    left = values
    multipliers%kind = kind_floquet
    do i = 1, min(dynamic, size(values))
      largest = maxloc(abs(left), 1)
      ! Conjugate pairs stay together, the upper one first.
      if (i > 1) then
        associate (before => multipliers(i - 1)%value)
          if (aimag(before) > 0.0_wp) largest = minloc(abs(left - conjg(before)), 1)
        end associate
      end if
      multipliers(i)%value = left(largest)
      if (aimag(left(largest)) < 0.0_wp .and. .not. follows_its_pair()) then
        multipliers(i)%value = conjg(left(largest))
        largest = minloc(abs(left - multipliers(i)%value), 1)
      end if
      left(largest) = 0.0_wp
    end do
    multipliers(dynamic + 1:dynamic + forgetting)%kind = kind_slip
    multipliers(dynamic + forgetting + 1:)%kind = kind_stuck
    multipliers(dynamic + forgetting + 1:)%value = 1.0_wp

  contains

    !> Is the multiplier at hand the lower one of a pair whose upper one comes before?
    pure logical function follows_its_pair()

      follows_its_pair = .false.
      if (i > 1) follows_its_pair = aimag(multipliers(i - 1)%value) > 0.0_wp
    end function follows_its_pair
  end function sorted_multipliers

  !> Leave zero eigenvalues out: A <- Q^T A Q with Q a basis of the range, until the range is everything.
  subroutine restrict_to_range(a, info)
    !> Matrix that is restricted
    real(wp), allocatable, intent(inout) :: a(:, :)
    !> 0: done, else LAPACK's code
    integer, intent(out) :: info
    real(wp), allocatable :: s(:), u(:, :)
    integer :: rank

    do
      call singular_values(a, s, u, info)
      if (info /= 0 .or. size(s) == 0) return
      rank = count(s > size(s)*epsilon(1.0_wp)*s(1))
      if (rank == size(s)) return
      a = matmul(transpose(u(:, :rank)), matmul(a, u(:, :rank)))
    end do
  end subroutine restrict_to_range
end module attrito_stability_multipliers
