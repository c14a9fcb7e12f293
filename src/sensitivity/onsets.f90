!> Which contacts are at the onset of slip: with a little more friction there is a place where the slider can rest all over the
!> period, and with a little less there is none.
!>
!> One tangent: places to rest are what all [u - r, u + r] have in common, r = mu N / k_t. At the onset that is a point. Two tangents:
!> what all discs of radius r about (u_1, u_2) have in common.
module attrito_sensitivity_onsets
  use attrito_core_kinds, only: wp
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_state, only: state_shaken_down
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: scale_friction, find_onsets

contains

  !> Friction coefficients of all contacts times a factor, until 1 gives them back.
  subroutine scale_friction(solver, factor)
    !> Solver of points, whose contacts this changes
    type(solver_type), intent(inout) :: solver
    !> On what the contacts have
    real(wp), intent(in) :: factor
    integer :: i

    associate (balance => solver%context%balance)
      do i = 1, size(balance%law)
        balance%law(i)%friction_coefficient = factor*solver%contacts%law(balance%first_contact - 1 + i)%friction_coefficient
      end do
    end associate
  end subroutine scale_friction

  !> Contacts at the onset, at the solver's present motion, which is evaluated again at the end.
  subroutine find_onsets(solver, margin, begins, status)
    !> Solver of points, at the point
    type(solver_type), intent(inout) :: solver
    !> Part of friction that is little
    real(wp), intent(in) :: margin
    !> 1 of those at the onset, else 0, of all ranks [contacts]
    real(wp), intent(out) :: begins(:)
    !> 0, or not: it cannot be evaluated
    integer, intent(out) :: status
    logical :: rests(size(solver%context%balance%law), 2), periodic(size(solver%context%balance%law))
    integer :: side

    begins = 0.0_wp
    associate (balance => solver%context%balance)
      ! The nearest place to rest is looked for with sliders that need not be periodic.
      periodic = balance%periodic
      balance%periodic = .false.
      do side = 1, 2
        call scale_friction(solver, 1.0_wp + merge(margin, -margin, side == 1))
        call balance%evaluate(solver%motion, solver%omega, status)
        if (status /= 0) exit
        rests(:, side) = can_rest(balance%law%tangents, balance%forces)
      end do
      call scale_friction(solver, 1.0_wp)
      balance%periodic = periodic
      if (status /= 0) return
      call balance%evaluate(solver%motion, solver%omega, status)
      associate (first => balance%first_contact)
        begins(first:first + size(rests, 1) - 1) = merge(1.0_wp, 0.0_wp, rests(:, 1) .and. .not. rests(:, 2))
      end associate
      call balance%ranks%sum(begins)
    end associate
    call solver%context%forget()
  end subroutine find_onsets

  !> Is there a place where its slider never slips?
  elemental logical function can_rest(tangents, forces)
    !> Of the contact
    integer, intent(in) :: tangents
    !> Of the last evaluation
    type(contact_forces_type), intent(in) :: forces

    if (tangents == 2) then
      can_rest = forces%may_stick
    else
      can_rest = .not. forces%unique .and. forces%state <= state_shaken_down
    end if
  end function can_rest
end module attrito_sensitivity_onsets
