!> Sliders that a period is to bring back, as unknowns, w = P(w, d) (`attrito_contact_forces`).
module attrito_balance_periodic_sliders
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  implicit none
  private
  public :: slider_defects, settle_sliders

contains

  !> What the period of the last evaluation moves them by [width, contacts]; zero of others.
  function slider_defects(balance) result(defects)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp), allocatable :: defects(:, :)
    integer :: i

    allocate (defects(size(balance%slider, 1), size(balance%slider, 2)), source=0.0_wp)
    do i = 1, size(balance%forces)
      if (balance%forces(i)%periodic) defects(:, i) = balance%forces(i)%moved
    end do
  end function slider_defects

  !> One that can come to rest does so from where it is.
  pure subroutine settle_sliders(balance)
    !> Harmonic balance, which of its sliders are unknowns this changes
    type(balance_type), intent(inout) :: balance
    integer :: i

    do i = 1, size(balance%forces)
      if (balance%forces(i)%may_stick) balance%periodic(i) = .false.
    end do
  end subroutine settle_sliders
end module attrito_balance_periodic_sliders
