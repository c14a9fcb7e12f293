!> Names for what a contact does: at an instant (regime) and over a period (state).
module attrito_contact_state
  implicit none
  private
  public :: regime_stick, regime_slip, regime_open
  public :: state_stuck, state_shaken_down, state_slipping, state_open

  integer, parameter :: regime_stick = 0, regime_slip = 1, regime_open = 2

  !> Never slips nor opens, and its slider stays where the point before left it
  integer, parameter :: state_stuck = 0
  !> As stuck, after its slider has moved once to where it no longer slips
  integer, parameter :: state_shaken_down = 1
  !> Slips, or opens and lands again, in every period
  integer, parameter :: state_slipping = 2
  !> Does not touch during the period
  integer, parameter :: state_open = 3
end module attrito_contact_state
