!> What the multipliers of an orbit say: stable if all that are dynamic lie within the unit circle, unstable if one lies beyond,
!> indeterminate if the largest is too near to tell or the contacts' switches are.
module attrito_stability_verdict
  use attrito_core_kinds, only: wp
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet
  implicit none
  private
  public :: judge, largest_multiplier, band, not_examined, unstable, stable, indeterminate

  !> As `/points/stable` counts them, but for the last, which the outcome says
  integer, parameter :: not_examined = -1, unstable = 0, stable = 1, indeterminate = 2

  !> How near the circle is too near, of orbits on which contacts slip or open, where switching times move with what the balance
  !> leaves out, and of those on which all stick, which are linear
  real(wp), parameter :: band_switching = 1.0e-5_wp, band_linear = 1.0e-10_wp ! guess

contains

  !> One of `unstable`, `stable`, `indeterminate`.
  pure integer function judge(multipliers, switches, uncertain)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)
    !> Does any contact slip or open?
    logical, intent(in) :: switches
    !> How well the multipliers are known; beyond doubt unless given
    real(wp), intent(in), optional :: uncertain
    real(wp) :: excess, open

    excess = largest_multiplier(multipliers) - 1.0_wp
    open = band(switches)
    if (present(uncertain)) open = max(open, uncertain)
    judge = indeterminate
    if (abs(excess) > open) judge = merge(unstable, stable, excess > 0.0_wp)
  end function judge

  !> What is left open of a modulus.
  pure real(wp) function band(switches)
    !> Does any contact slip or open?
    logical, intent(in) :: switches

    band = merge(band_switching, band_linear, switches)
  end function band

  !> Largest modulus of those that decide.
  pure real(wp) function largest_multiplier(multipliers)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)

    largest_multiplier = maxval(abs(multipliers%value), mask=multipliers%kind == kind_floquet)
  end function largest_multiplier
end module attrito_stability_verdict
