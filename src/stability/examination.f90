!> What an examination of stability is asked, and what it finds.
module attrito_stability_examination
  use attrito_core_kinds, only: wp
  use attrito_stability_multipliers, only: multiplier_type
  use attrito_stability_verdict, only: not_examined
  implicit none
  private
  public :: examination_type, examine_options_type, is_near, largest_distance, number, part
  public :: by_monodromy, by_hill, balanced_orbit, exact_orbit, automatic_orbit

  !> Methods; their sum asks for both
  integer, parameter :: by_monodromy = 1, by_hill = 2

  !> The balance's orbit; the event-exact one near it; or the latter wherever a contact slips or opens: the orbit of the balance then
  !> leaves out what its series does, which depends on how that was chosen, and its multipliers with it
  integer, parameter :: balanced_orbit = 0, exact_orbit = 1, automatic_orbit = 2

  type :: examine_options_type
    !> Sum of `by_...`
    integer :: methods = by_monodromy
    !> One of the orbits above
    integer :: orbit = automatic_orbit
    !> Let integration in time decide where multipliers do not
    logical :: decide = .true.
    !> What the balance leaves out, part of the amplitude; as it stands: not known
    real(wp) :: estimate = huge(1.0_wp)
  end type examine_options_type

  !> How far the orbit of motion in time may lie from the balance's, part of its amplitude, to be taken for the same: so many times
  !> what the balance leaves out, but this far at least and at most. 95 of 100 orbits lie within that
  real(wp), parameter :: times_estimate = 10.0_wp, distances(2) = [0.01_wp, 0.1_wp] ! guess

  type :: examination_type
    !> One of `not_examined`, `unstable`, `stable`, `indeterminate`
    integer :: verdict = not_examined
    !> Why it was not examined or is indeterminate
    character(:), allocatable :: reason
    !> Of each engine that was asked for, at the root
    type(multiplier_type), allocatable :: monodromy(:), hill(:)
    !> How far the event-exact orbit lies from the balance's (`attrito_stability_distance`); negative: not looked for or not found
    real(wp) :: distance = -1.0_wp
    !> How far it may lie from there
    real(wp) :: limit = distances(2)
    !> What doubling the modes last changed of the multipliers by the monodromy; zero if all are in
    real(wp) :: change = 0.0_wp
    !> Interval in which the largest modulus of the dynamic multipliers lies, where they do not decide; high < low: nothing is known
    real(wp) :: low = 0.0_wp, high = -1.0_wp
  end type examination_type

contains

  !> How far an orbit of motion in time may lie from that of a balance, to be taken for the same.
  pure real(wp) function largest_distance(estimate)
    !> What the balance leaves out, part of the amplitude
    real(wp), intent(in) :: estimate

    largest_distance = min(max(times_estimate*min(estimate, 1.0_wp), distances(1)), distances(2))
  end function largest_distance

  !> Was an orbit of motion in time found that can be taken for the balance's? Then multipliers are its.
  pure logical function is_near(self)
    type(examination_type), intent(in) :: self

    is_near = self%distance >= 0.0_wp .and. self%distance <= self%limit
  end function is_near

  !> A part of the amplitude in words.
  pure function part(x) result(text)
    !> Part of the amplitude
    real(wp), intent(in) :: x
    character(:), allocatable :: text
    character(12) :: digits

    write (digits, '(f12.2)') min(x, 1.0e6_wp)
    text = trim(adjustl(digits))//' of the amplitude'
  end function part

  pure function number(i) result(text)
    !> Number of the mode or contact
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(12) :: digits

    write (digits, '(i0)') i
    text = trim(digits)
  end function number
end module attrito_stability_examination
