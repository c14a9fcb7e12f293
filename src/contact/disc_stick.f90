!> Stick of a contact with two tangents, until its slider would lie outside its disc or to a given instant: the first root of
!>
!> $$ g(\theta) = |u - w|^2 - r^2 $$
!>
!> A slider that slip has just left on the rim has g = g' = 0: that root is not an onset, so the first step is looked at from a little
!> behind it. Where g turns between two points of the grid its maximum is found first, unless its tangents show that it stays
!> below zero. What lies above zero by next to nothing is no slip: a slider that was pushed to the last place that
!> holds it rests there.
module attrito_contact_disc_stick
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_record, only: disc_state_type, disc_record_type, enter_rim
  use attrito_contact_state, only: regime_stick
  implicit none
  private
  public :: stick_on

contains

  !> Stick from an instant to another, or until slip begins.
  subroutine stick_on(motion, to, state, record, theta)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where to stop at the latest
    real(wp), intent(in) :: to
    !> The contact, which sticks
    type(disc_state_type), intent(inout) :: state
    !> What is kept of the march
    type(disc_record_type), intent(inout) :: record
    !> Where it begins, then where it ends
    real(wp), intent(inout) :: theta
    real(wp) :: onset
    logical :: slips

    call find_onset(motion, state%slider, theta, to, state%on_rim, slips, onset)
    theta = merge(onset, to, slips)
    call record%add_interval(theta, regime_stick, state)
    state%on_rim = .false.
    if (slips) call enter_rim(motion, theta, record%by_motion, state)
  end subroutine stick_on

  !> The first instant at which a slider would leave its disc.
  subroutine find_onset(motion, w, from, to, on_rim, found, onset)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Slider; interval
    real(wp), intent(in) :: w(2), from, to
    !> Is it on the rim at the start, and not to slip there?
    logical, intent(in) :: on_rim
    !> Is there one?
    logical, intent(out) :: found
    !> Where
    real(wp), intent(out) :: onset
    !> Part of the first step behind a slider on the rim: a shorter stick is none
    real(wp), parameter :: behind = 1.0e-4_wp ! guess
    real(wp) :: left, right, at_left(2), at_right(2), near(2), negligible
    integer :: cell, points
    logical :: first

    points = size(motion%sampled, 1) - 1
    found = .true.
    negligible = 2.0_wp*motion%largest*motion%negligible
    left = from
    at_left = motion%excess(from, w)
    first = on_rim .or. at_left(1) >= 0.0_wp
    cell = floor(from/motion%step + 1.0e-9_wp)
    do
      cell = cell + 1
      right = min(cell*motion%step, to)
      if (right < to) then
        at_right = motion%excess_on_grid(modulo(cell, points) + 1, w)
      else
        at_right = motion%excess(to, w)
      end if
      if (first) then
        near = motion%excess(left + behind*(right - left), w)
        left = left + behind*(right - left)
        ! Not the start itself: where it has landed there is no direction.
        onset = left
        if (at_right(1) > negligible .and. near(1) >= 0.0_wp) return
        at_left = near
        first = .false.
      end if
      if (at_right(1) > negligible) then
        onset = root_of(motion, w, left, right, at_left(1), at_right(1))
        return
      end if
      if (at_left(2) > 0.0_wp .and. at_right(2) < 0.0_wp) then
        call climb(motion, w, left, right, at_left, at_right, negligible, found, onset)
        if (found) return
        found = .true.
      end if
      if (right >= to) exit
      left = right
      at_left = at_right
    end do
    found = .false.
  end subroutine find_onset

  !> Does g become positive between two places at which it is not, but has a maximum between? If so, where first.
  subroutine climb(motion, w, from, to, at_from, at_to, negligible, found, onset)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Slider; two places, and g and g' there
    real(wp), intent(in) :: w(2), from, to, at_from(2), at_to(2)
    !> Of g
    real(wp), intent(in) :: negligible
    !> Does it?
    logical, intent(out) :: found
    !> Where
    real(wp), intent(out) :: onset
    !> Length in which a maximum counts as found
    real(wp), parameter :: found_in = 1.0e-9_wp ! derived
    real(wp) :: left, right, slope_left, slope_right, x, here(2)
    integer :: iteration

    found = .false.
    onset = to
    left = from
    right = to
    slope_left = at_from(2)
    slope_right = at_to(2)
    do iteration = 1, 60
      x = (slope_left*right - slope_right*left)/(slope_left - slope_right)
      if (iteration > 20 .or. .not. (x > left .and. x < right)) x = 0.5_wp*(left + right)
      here = motion%excess(x, w)
      found = here(1) > negligible
      if (found) exit
      if (here(1) + abs(here(2))*(right - left) < negligible) return
      if (here(2) > 0.0_wp) then
        left = x
        slope_left = here(2)
      else
        right = x
        slope_right = here(2)
      end if
      if (right - left < found_in) return
    end do
    if (found) onset = root_of(motion, w, from, x, at_from(1), here(1))
  end subroutine climb

  !> The root of g between two places where it has other signs, by Newton's method kept between them. Steps s of that fall like their
  !> squares, so the next one would be s_n^3/s_(n-1)^2.
  real(wp) function root_of(motion, w, from, to, at_from, at_to) result(root)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Slider; two places, and g there
    real(wp), intent(in) :: w(2), from, to, at_from, at_to
    !> Two units in the last place of a period
    real(wp), parameter :: resolution = 2.0_wp*epsilon(1.0_wp)*two_pi ! derived
    real(wp) :: low, high, here(2), step, before, newton
    integer :: iteration
    logical :: inside

    low = from
    high = to
    before = 0.0_wp
    root = from + (to - from)*min(max(at_from/(at_from - at_to), 0.0_wp), 1.0_wp)
    do iteration = 1, 100
      here = motion%excess(root, w)
      if (here(1) > 0.0_wp) then
        high = root
      else
        low = root
      end if
      newton = -here(1)/sign(max(abs(here(2)), tiny(newton)), here(2))
      inside = root + newton > low .and. root + newton < high
      step = merge(newton, 0.5_wp*(low + high) - root, inside)
      root = root + step
      if (abs(step) <= resolution .or. (inside .and. abs(step)**3 <= resolution*before**2)) exit
      before = merge(abs(step), 0.0_wp, inside)
    end do
  end function root_of
end module attrito_contact_disc_stick
