!> What becomes of small perturbations of an orbit, by event-exact integration: where multipliers do not decide, this does.
module attrito_stability_in_time
  use attrito_core_kinds, only: wp
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type
  use attrito_stability_orbit, only: march_freely
  use attrito_stability_verdict, only: stable, unstable, indeterminate
  implicit none
  private
  public :: decide_in_time

  !> Perturbations, part of the motion's half range; how many, and the periods they are followed
  real(wp), parameter :: perturbation = 1.0e-6_wp ! guess
  integer, parameter :: perturbations = 6, periods = 400 ! guess
  !> Factors by which all have shrunk in the end, by which one is gone before, by which one has grown
  real(wp), parameter :: decayed = 1.0e-1_wp, vanished = 1.0e-3_wp, grown = 1.0e3_wp ! guess
  !> Where sliders stay where a perturbation has put them, motion comes to another member of a family: change over a period, part of
  !> the perturbation, of one that has come there, and how far from the orbit that may be
  real(wp), parameter :: arrived = 1.0e-6_wp, near_orbit = 1.0e1_wp ! guess

contains

  !> One of `stable` (all perturbations die out), `unstable` (one leaves), `indeterminate`.
  integer function decide_in_time(system, loading, start) result(verdict)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where the orbit's period starts
    type(state_type), intent(in) :: start
    type(state_type) :: state, before
    real(wp) :: range, push(2*size(start%motion))
    integer :: i, m, cycle, died

    m = size(start%motion)
    state = start
    call march_freely(system, loading, state, range)
    died = 0
    verdict = unstable
    do i = 1, perturbations
      push = perturbation*range*direction(2*m, i)
      state = new_state(system, start%motion + push(:m), start%rate + push(m + 1:), start%slider)
      do cycle = 1, periods
        before = state
        call march_freely(system, loading, state, range)
        if (distance(start) > grown*perturbation*range) return
        if (distance(start) < vanished*perturbation*range .or. has_arrived()) exit
      end do
      if (distance(start) < decayed*perturbation*range .or. has_arrived()) died = died + 1
    end do
    verdict = merge(stable, indeterminate, died == perturbations)

  contains

    real(wp) function distance(other)
      !> State to compare with
      type(state_type), intent(in) :: other

      distance = hypot(norm2(state%motion - other%motion), norm2(state%rate - other%rate))
    end function distance

    !> Has the motion come to a member of the orbit's family?
    logical function has_arrived()

      has_arrived = distance(before) < arrived*perturbation*range .and. distance(start) < near_orbit*perturbation*range
    end function has_arrived
  end function decide_in_time

  !> A direction of unit length, without pattern: turns by the golden angle.
  pure function direction(n, which) result(unit)
    !> Number of coordinates; number of the direction
    integer, intent(in) :: n, which
    real(wp) :: unit(n)
    !> The golden angle, 3 - sqrt(5) half turns: directions never fall together
    real(wp), parameter :: golden = 2.399963229728653_wp ! derived
    integer :: i

    unit = [(cos(golden*(which + perturbations*i)), i=1, n)]
    unit = unit/norm2(unit)
  end function direction
end module attrito_stability_in_time
