!> Floquet multipliers of an orbit out of its monodromy, and what each of them stands for.
!>
!> A contact that neither slips nor opens keeps its slider: its row of the monodromy is that of the identity, a multiplier 1 (`stuck`)
!> that says that the orbit is one of a family, not that it is about to bifurcate. A contact that slips or opens forgets its slider
!> within the period: a multiplier 0 (`slip`). All others (`floquet`), two a mode, decide.
!>
!> Zeros of several contacts may sit in one Jordan block, where rounding turns them into its root of that order. So they are taken
!> out first: the matrix is restricted to its range until it is regular, each time by the singular values that are not rounding.
module attrito_stability_multipliers
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: eigenvalues_of, singular_values
  use attrito_contact_state, only: regime_stick
  use attrito_integrate_system, only: system_type
  use attrito_stability_leg, only: orbit_legs_type
  implicit none
  private
  public :: multiplier_type, multipliers_of, sorted_multipliers, kind_floquet, kind_slip, kind_stuck, kind_names

  integer, parameter :: kind_floquet = 0, kind_slip = 1, kind_stuck = 2
  character(7), parameter :: kind_names(0:2) = [character(7) :: 'floquet', 'slip', 'stuck']

  type :: multiplier_type
    complex(wp) :: value = 0.0_wp
    !> One of `kind_...`
    integer :: kind = kind_floquet
  end type multiplier_type

contains

  !> Multipliers of a monodromy, the largest first within each kind.
  subroutine multipliers_of(system, orbit, matrix, multipliers, info)
    type(system_type), intent(in) :: system
    type(orbit_legs_type), intent(in) :: orbit
    !> Of `monodromy` [2 m + nc, 2 m + nc]
    real(wp), intent(in) :: matrix(:, :)
    !> [2 m + nc]
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0, or not: eigenvalues were not found
    integer, intent(out) :: info
    complex(wp), allocatable :: values(:)
    real(wp), allocatable :: regular(:, :)
    logical :: kept(size(matrix, 1))
    integer, allocatable :: rows(:)
    real(wp) :: scale(size(matrix, 1))
    integer :: i, m, contacts, forgetting

    m = size(system%eigenvalues)
    contacts = size(orbit%stuck)
    kept = .true.
    ! A unit of slider is one that a unit of motion brings about.
    scale = 1.0_wp
    do i = 1, contacts
      kept(2*m + i) = .not. orbit%stuck(i) .and. orbit%legs(1)%regime(i) == regime_stick
      scale(2*m + i) = norm2(system%rows(:, system%law(i)%first_row))
    end do
    where (scale <= 0.0_wp) scale = 1.0_wp
    rows = pack([(i, i=1, size(kept))], kept)
    regular = matrix(rows, rows)*spread(scale(rows), 1, size(rows))/spread(scale(rows), 2, size(rows))
    call restrict_to_range(regular, info)
    if (info == 0) call eigenvalues_of(regular, values, info)
    if (info /= 0) return
    forgetting = count(.not. orbit%stuck)
    multipliers = sorted_multipliers(values, 2*m, forgetting, count(orbit%stuck))
  end subroutine multipliers_of

  !> Multipliers of all kinds: the largest of some values, then zeros for the contacts that forget, then ones for those that stick.
  pure function sorted_multipliers(values, dynamic, forgetting, stuck) result(multipliers)
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
    real(wp), allocatable, intent(inout) :: a(:, :)
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
