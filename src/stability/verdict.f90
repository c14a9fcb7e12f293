!> What the multipliers of an orbit say: stable if all that are dynamic lie within the unit circle, unstable if one lies beyond,
!> indeterminate if the largest is too near to tell or the contacts' switches are.
module attrito_stability_verdict
  use attrito_core_kinds, only: wp
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet
  implicit none
  private
  public :: judge, largest_multiplier, may_fold, between_folding, band, not_examined, unstable, stable, indeterminate

  !> As `/points/stable` counts them, but for the last, which the outcome says
  integer, parameter :: not_examined = -1, unstable = 0, stable = 1, indeterminate = 2

  !> How near the circle is too near, of orbits on which contacts slip or open, where switching times move with what the balance
  !> leaves out, and of those on which all stick, which are linear
  real(wp), parameter :: band_switching = 1.0e-5_wp, band_linear = 1.0e-10_wp ! guess

  !> Distance of a real multiplier from 1 within which a fold may be near: two orbits then lie beside each other
  real(wp), parameter :: fold_margin = 0.2_wp ! guess
  !> Imaginary part below which a multiplier is real: rounding of a double one
  real(wp), parameter :: real_within = sqrt(epsilon(1.0_wp)) ! derived

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

  !> May there be another orbit beside this one, which it meets in a fold?
  pure logical function may_fold(multipliers)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)

    may_fold = abs(nearest_to_fold(multipliers)) < fold_margin
  end function may_fold

  !> May a balance's orbit stand for either of two that meet in a fold? Along the branch a real multiplier passes 1 there, at equal
  !> distances from it on the two orbits: the balance must be three times as near to the one that was found.
  pure logical function between_folding(found, of_balance)
    !> Floquet multipliers of the orbit that was found, and of the balance's
    type(multiplier_type), intent(in) :: found(:), of_balance(:)

    between_folding = may_fold(found) .and. may_fold(of_balance)
    if (between_folding) between_folding = nearest_to_fold(of_balance)*nearest_to_fold(found) < 0.5_wp*nearest_to_fold(found)**2
  end function between_folding

  !> The real multiplier nearest to 1, less 1.
  pure real(wp) function nearest_to_fold(multipliers) result(excess)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)
    integer :: i

    excess = huge(1.0_wp)
    do i = 1, size(multipliers)
      if (multipliers(i)%kind /= kind_floquet .or. abs(aimag(multipliers(i)%value)) > real_within) cycle
      if (abs(real(multipliers(i)%value) - 1.0_wp) < abs(excess)) excess = real(multipliers(i)%value) - 1.0_wp
    end do
  end function nearest_to_fold
end module attrito_stability_verdict
