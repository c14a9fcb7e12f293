!> Sliders after a solve: which of them a further period would move, which stay, and by how much the largest move is; whether any
!> contact slips or opens, whether any holds, and which ones touch.
module attrito_solve_sliders
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_open
  implicit none
  private
  public :: end_period, found_moving, keep_sliders, largest_defect, none_moves, none_holds, closed_contacts

contains

  !> Sliders that a further period would move become periodic, from where it would move them; says whether there were any. So do those
  !> whose period was closed in each evaluation, by several marches: as unknowns they take one.
  logical function found_moving(balance, least)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Distance that counts as moving
    real(wp), intent(in) :: least
    real(wp) :: found
    integer :: i

    found_moving = .false.
    if (allocated(balance%mean_before)) return
    found = 0.0_wp
    do i = 1, size(balance%forces)
      associate (forces => balance%forces(i))
        if (balance%periodic(i)) cycle
        if (norm2(forces%moved) <= least .and. .not. forces%closed_here) cycle
        balance%periodic(i) = .true.
        balance%slider(:, i) = forces%slider + forces%moved
        found = 1.0_wp
      end associate
    end do
    found_moving = balance%ranks%largest(found) > 0.0_wp
  end function found_moving

  !> Leave sliders where the period of the last evaluation takes them, for the next to begin there.
  pure subroutine end_period(balance, moved)
    !> Harmonic balance, whose sliders this moves
    type(balance_type), intent(inout) :: balance
    !> What the period has moved them by [width, contacts]
    real(wp), intent(out) :: moved(:, :)
    integer :: i

    do i = 1, size(balance%forces)
      moved(:, i) = balance%forces(i)%moved
      balance%slider(:, i) = balance%forces(i)%slider + moved(:, i)
    end do
  end subroutine end_period

  !> Let the sliders of the last evaluation be the start of the next point; a periodic one that has come to rest was shaken down.
  subroutine keep_sliders(balance, before, least)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Sliders at the point before [width, contacts], and the distance that counts as having moved
    real(wp), intent(in) :: before(:, :), least
    integer :: i

    do i = 1, size(balance%forces)
      associate (forces => balance%forces(i))
        if (balance%periodic(i) .and. forces%state == state_stuck) then
          balance%periodic(i) = .false.
          if (norm2(forces%slider - before(:, i)) > least) forces%state = state_shaken_down
        end if
        balance%slider(:, i) = forces%slider
      end associate
    end do
  end subroutine keep_sliders

  !> The largest distance by which one more period would move a slider.
  real(wp) function largest_defect(balance)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    integer :: i

    largest_defect = 0.0_wp
    do i = 1, size(balance%forces)
      largest_defect = max(largest_defect, norm2(balance%forces(i)%moved))
    end do
    largest_defect = balance%ranks%largest(largest_defect)
  end function largest_defect

  !> Has every contact stuck all over the period?
  logical function none_moves(balance)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp) :: moving

    moving = merge(1.0_wp, 0.0_wp, any(balance%forces%state > state_shaken_down))
    none_moves = balance%ranks%largest(moving) <= 0.0_wp
  end function none_moves

  !> Is every contact at its limit of friction, or open, at some instant of the period? One that is shaken down is at its limit
  !> once a period: a body that moves on pushes its slider along, and the force stays the same.
  logical function none_holds(balance)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp) :: holds

    holds = merge(1.0_wp, 0.0_wp, any(balance%forces%state == state_stuck))
    none_holds = balance%ranks%largest(holds) <= 0.0_wp
  end function none_holds

  !> Which contacts, of all ranks, touch at some instant of the last evaluation.
  function closed_contacts(balance, count) result(closed)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Contacts of all ranks
    integer, intent(in) :: count
    logical :: closed(count)
    real(wp) :: touching(count)

    touching = 0.0_wp
    associate (first => balance%first_contact, own => size(balance%forces))
      touching(first:first + own - 1) = merge(1.0_wp, 0.0_wp, balance%forces%state /= state_open)
    end associate
    call balance%ranks%sum(touching)
    closed = touching > 0.0_wp
  end function closed_contacts
end module attrito_solve_sliders
