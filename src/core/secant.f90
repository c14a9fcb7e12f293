!> A change of sign enclosed between two abscissas, by secants and halvings:
!>
!> $$ x = x_1 + \frac{f_1}{f_1 - f_2} (x_2 - x_1), \qquad f_1 f_2 < 0 $$
!>
!> The value at the end that stays is halved, so that secants close in from both sides: with every trial, not only where an end stays
!> twice as in the Illinois algorithm, for that takes longer where the function is flat on one side. Every third trial is the middle:
!> where the function jumps, secants gain nothing. No trial lies at an end.
!> Source: Dowell & Jarratt 1971, doi:10.1007/BF01934364.
module attrito_core_secant
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: bracket_type, secant_share, within

  !> Part of what is enclosed by which a trial stays off its ends
  real(wp), parameter :: off_ends = 1.0e-3_wp ! conventional
  !> So many trials to one halving
  integer, parameter :: to_one_halving = 3

  type :: bracket_type
    !> Both ends, and the function there, halved where an end has stayed
    real(wp) :: abscissa(2) = [0.0_wp, 1.0_wp], weight(2) = 0.0_wp
  contains
    procedure :: trial
    procedure :: take
    procedure :: width
  end type bracket_type

contains

  !> Where to look next; the middle, too, where the values have one sign.
  pure real(wp) function trial(self, number)
    class(bracket_type), intent(in) :: self
    !> Number of the trial, from 1
    integer, intent(in) :: number
    real(wp) :: share

    share = 0.5_wp
    if (modulo(number, to_one_halving) /= 0 .and. self%weight(1)*self%weight(2) < 0.0_wp) then
      share = within(secant_share(self%weight), off_ends)
    end if
    trial = self%abscissa(1) + share*self%width()
  end function trial

  !> Move an end to an abscissa at which the function is known.
  pure subroutine take(self, side, abscissa, value)
    class(bracket_type), intent(inout) :: self
    !> The end: 1 or 2
    integer, intent(in) :: side
    !> The abscissa, and the function there
    real(wp), intent(in) :: abscissa, value

    self%weight(3 - side) = 0.5_wp*self%weight(3 - side)
    self%abscissa(side) = abscissa
    self%weight(side) = value
  end subroutine take

  !> Distance of the ends.
  pure real(wp) function width(self)
    class(bracket_type), intent(in) :: self

    width = self%abscissa(2) - self%abscissa(1)
  end function width

  !> Part of the way from the first end to the second at which the secant vanishes.
  pure real(wp) function secant_share(values) result(share)
    !> The function at both ends, of different signs
    real(wp), intent(in) :: values(2)

    share = values(1)/(values(1) - values(2))
  end function secant_share

  !> A part of the way that is kept off both ends.
  pure real(wp) function within(share, off)
    !> Part of the way; least part to either end
    real(wp), intent(in) :: share, off

    within = min(max(share, off), 1.0_wp - off)
  end function within
end module attrito_core_secant
