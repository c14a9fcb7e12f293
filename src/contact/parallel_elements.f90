!> Forces of several elements in parallel under one motion: what their tangential springs carry adds up, the normal spring is theirs
!> together,
!>
!> $$ g_t = \sum_e g_{t,e}, \qquad g_n = g_{n,1} = g_{n,2} = \ldots $$
!>
!> and so do the Jacobians. The contact slips while any of its elements does; it is stuck where all of them are, and its loop is the
!> same whatever the start sliders where that of every element is.
module attrito_contact_parallel_elements
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type, hold_slider
  use attrito_contact_state, only: state_stuck
  implicit none
  private
  public :: begin_sum, add_element, complete_sum, union_length

contains

  !> No element yet.
  pure subroutine begin_sum(law, coefficients, sum)
    !> The contact
    type(contact_type), intent(in) :: law
    !> Of motion a row
    integer, intent(in) :: coefficients
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: sum

    sum%deviation = 0.0_wp
    sum%slider = spread(0.0_wp, 1, 2*law%elements())
    sum%moved = sum%slider
    sum%active = spread(.false., 1, coefficients*(law%tangents + 1))
    if (allocated(sum%jacobian)) deallocate (sum%jacobian)
    sum%slips = reshape([real(wp) ::], [2, 0])
    sum%state = state_stuck
    sum%unique = .true.
    sum%may_stick = .true.
    sum%periodic = .false.
  end subroutine begin_sum

  !> One more element.
  pure subroutine add_element(law, number, own, sum)
    !> The contact
    type(contact_type), intent(in) :: law
    !> Of the element, from 1
    integer, intent(in) :: number
    !> What the element does, its intervals of slip listed
    type(contact_forces_type), intent(in) :: own
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: sum
    integer :: tangential

    associate (n => law%tangents)
      sum%deviation(:, :n) = sum%deviation(:, :n) + own%deviation(:, :n)
      sum%deviation(:, n + 1) = own%deviation(:, n + 1)
    end associate
    sum%slider(2*number - 1:2*number) = own%slider
    sum%moved(2*number - 1:2*number) = own%moved
    sum%unique = sum%unique .and. own%unique
    sum%may_stick = sum%may_stick .and. own%may_stick
    sum%open = own%open
    ! All elements are open together.
    sum%state = max(sum%state, own%state)
    sum%slips = reshape([sum%slips, own%slips], [2, size(sum%slips, 2) + size(own%slips, 2)])
    if (.not. allocated(own%jacobian)) return
    tangential = law%tangents*size(own%active)/(law%tangents + 1)
    sum%active = sum%active .or. own%active
    if (.not. allocated(sum%jacobian)) then
      allocate (sum%jacobian, mold=own%jacobian)
      sum%jacobian = 0.0_wp
    end if
    sum%jacobian(:tangential, :) = sum%jacobian(:tangential, :) + own%jacobian(:tangential, :)
    sum%jacobian(tangential + 1:, :) = own%jacobian(tangential + 1:, :)
  end subroutine add_element

  !> Fractions of the period, once all elements are in.
  pure subroutine complete_sum(law, sum)
    !> The contact
    type(contact_type), intent(in) :: law
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: sum

    if (sum%state == state_stuck .and. .not. allocated(sum%mean_before)) then
      call hold_slider(law, (sum%slider), sum)
    else
      sum%slip = union_length(sum%slips)/two_pi
      sum%stick = max(1.0_wp - sum%slip - sum%open, 0.0_wp)
    end if
  end subroutine complete_sum

  !> Length of what some intervals cover together.
  pure real(wp) function union_length(intervals) result(length)
    !> From and to [2, intervals]
    real(wp), intent(in) :: intervals(:, :)
    real(wp) :: reached
    logical :: left(size(intervals, 2))
    integer :: i, next

    length = 0.0_wp
    reached = -huge(1.0_wp)
    left = .true.
    do i = 1, size(left)
      next = minloc(intervals(1, :), 1, left)
      left(next) = .false.
      length = length + max(intervals(2, next) - max(intervals(1, next), reached), 0.0_wp)
      reached = max(reached, intervals(2, next))
    end do
  end function union_length
end module attrito_contact_parallel_elements
