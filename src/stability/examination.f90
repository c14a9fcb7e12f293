!> What an examination of stability is asked, and what it finds.
module attrito_stability_examination
  use attrito_core_kinds, only: wp
  use attrito_stability_multipliers, only: multiplier_type
  use attrito_stability_verdict, only: largest_multiplier, not_examined, indeterminate
  implicit none
  private
  public :: examination_type, examine_options_type, is_sure, is_near, number, part, farthest, astray
  public :: by_monodromy, by_hill, balanced_orbit, exact_orbit, automatic_orbit

  !> Engines, to be added
  integer, parameter :: by_monodromy = 1, by_hill = 2

  !> The balance's orbit; the event-exact one near it; or the latter only where the former is too near a change to be sure
  integer, parameter :: balanced_orbit = 0, exact_orbit = 1, automatic_orbit = 2

  !> Distance of the largest multiplier from the unit circle within which the balance's orbit is not enough: 20 harmonics leave out
  !> some 3e-3 of it with stiff contacts
  real(wp), parameter :: margin = 5.0e-2_wp

  type :: examine_options_type
    !> Sum of `by_...`
    integer :: methods = by_monodromy
    !> One of the orbits above
    integer :: orbit = automatic_orbit
    !> Let integration in time decide where multipliers do not
    logical :: decide = .true.
    !> Estimated relative error of the balance's motion by truncation
    real(wp) :: truncation = 0.0_wp
  end type examine_options_type

  !> Truncation beyond which its multipliers are not to be trusted at all: contacts that open and land in stick magnify it
  real(wp), parameter :: coarse = 1.0e-3_wp

  !> How far the event-exact orbit may lie from the balance's, part of its amplitude, to be taken for the same; and motion in time
  !> after less than a period from there, for the balance to be believed without that orbit
  real(wp), parameter :: farthest = 0.1_wp, astray = 1.0e-2_wp

  type :: examination_type
    !> One of `not_examined`, `unstable`, `stable`, `indeterminate`
    integer :: verdict = not_examined
    !> Why it was not examined or is indeterminate
    character(:), allocatable :: reason
    !> Of each engine that was asked for, at the root
    type(multiplier_type), allocatable :: monodromy(:), hill(:)
    !> How far the event-exact orbit lies from the balance's (`attrito_stability_distance`); negative: not looked for or not found
    real(wp) :: distance = -1.0_wp
    !> What doubling the modes last changed of the multipliers by the monodromy; zero if all are in
    real(wp) :: change = 0.0_wp
    !> Interval in which the largest modulus of the dynamic multipliers lies, where they do not decide; high < low: nothing is known
    real(wp) :: low = 0.0_wp, high = -1.0_wp
  end type examination_type

contains

  !> Is a verdict on the balance's orbit beyond what the balance leaves out?
  pure logical function is_sure(self, truncation)
    type(examination_type), intent(in) :: self
    real(wp), intent(in) :: truncation

    is_sure = self%verdict /= indeterminate .and. truncation <= coarse
    if (allocated(self%monodromy)) is_sure = is_sure .and. abs(largest_multiplier(self%monodromy) - 1.0_wp) > margin
    if (allocated(self%hill)) is_sure = is_sure .and. abs(largest_multiplier(self%hill) - 1.0_wp) > margin
  end function is_sure

  !> Was an orbit of motion in time found that can be taken for the balance's? Then multipliers are its.
  pure logical function is_near(self)
    type(examination_type), intent(in) :: self

    is_near = self%distance >= 0.0_wp .and. self%distance <= farthest
  end function is_near

  !> A part of the amplitude in words.
  pure function part(x) result(text)
    real(wp), intent(in) :: x
    character(:), allocatable :: text
    character(12) :: digits

    write (digits, '(f12.2)') min(x, 1.0e6_wp)
    text = trim(adjustl(digits))//' of the amplitude'
  end function part

  pure function number(i) result(text)
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(12) :: digits

    write (digits, '(i0)') i
    text = trim(digits)
  end function number
end module attrito_stability_examination
