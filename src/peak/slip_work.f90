!> Work against friction in one step of a quasi-static path, between two equilibria on which a contact's displacements are taken to
!> be linear,
!>
!> $$ W = \int T \cdot dw = \tfrac{1}{2} (T_* + T_1) \cdot (w_1 - w_0), \qquad |T_0 + s_* k_t \Delta u| = F_0 + s_* \Delta F, $$
!>
!> T_* being the force at the onset of slip, s_* of the way. While it sticks it does no work, and while it slips under a constant
!> normal force T does not change: the work of such a step is exact, however long it is. Where the contact opens or lands within the
!> step, only the part where it is closed counts.
module attrito_peak_slip_work
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: slip_work

contains

  !> Of all elements of a contact.
  real(wp) function slip_work(law, motion_0, motion_1, slider_0, slider_1) result(work)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Relative displacements at both ends of the step [tangents + 1]
    real(wp), intent(in) :: motion_0(:), motion_1(:)
    !> Sliders there, in pairs, one an element
    real(wp), intent(in) :: slider_0(:), slider_1(:)
    integer :: i

    work = 0.0_wp
    do i = 1, law%elements()
      associate (first => 2*i - 1, last => 2*i - 2 + law%tangents)
        if (all(abs(slider_1(first:last) - slider_0(first:last)) <= 0.0_wp)) cycle
        work = work + work_of_element(law%element(i), motion_0, motion_1, slider_0(first:last), slider_1(first:last))
      end associate
    end do
  end function slip_work

  !> Of one element, whose slider moves.
  real(wp) function work_of_element(law, motion_0, motion_1, slider_0, slider_1) result(work)
    !> The element as a contact by itself
    type(contact_type), intent(in) :: law
    !> Relative displacements at both ends of the step [tangents + 1]
    real(wp), intent(in) :: motion_0(:), motion_1(:)
    !> Sliders there [tangents]
    real(wp), intent(in) :: slider_0(:), slider_1(:)
    real(wp) :: normal(2), limit(2), slope(2), from(size(slider_0)), to(size(slider_0)), start(size(slider_0)), finish(size(slider_0))
    real(wp) :: onset(size(slider_0))

    associate (n => law%tangents, kt => law%tangential_stiffness)
      normal = law%normal_force([motion_0(n + 1), motion_1(n + 1)])
      work = 0.0_wp
      if (all(normal <= 0.0_wp)) return
      from = motion_0(:n)
      to = motion_1(:n)
      start = slider_0
      finish = slider_1
      ! An open contact carries nothing, and its slider is where the contact is.
      if (normal(1) < 0.0_wp) then
        from = motion_0(:n) + normal(1)/(normal(1) - normal(2))*(motion_1(:n) - motion_0(:n))
        start = from
      else if (normal(2) < 0.0_wp) then
        to = motion_0(:n) + normal(1)/(normal(1) - normal(2))*(motion_1(:n) - motion_0(:n))
        finish = to
      end if
      call law%slip_force(max(normal, 0.0_wp), limit, slope)
      onset = kt*(from - start)
      onset = onset + slip_onset(onset, kt*(to - from), limit)*kt*(to - from)
      work = 0.5_wp*sum((onset + kt*(to - finish))*(finish - start))
    end associate
  end function work_of_element

  !> The part of a step, 0 to 1, after which |force + s change| stays beyond the limit: the last root of a square, found without
  !> cancellation.
  pure real(wp) function slip_onset(force, change, limit) result(part)
    !> Tangential force at the start and what sticking would add [tangents]; slip force at both ends
    real(wp), intent(in) :: force(:), change(:), limit(2)
    real(wp) :: a, half_b, c, root

    a = sum(change**2) - (limit(2) - limit(1))**2
    half_b = sum(force*change) - limit(1)*(limit(2) - limit(1))
    c = min(sum(force**2) - limit(1)**2, 0.0_wp)
    root = sqrt(max(half_b**2 - a*c, 0.0_wp))
    part = 0.0_wp
    if (half_b >= 0.0_wp) then
      if (half_b + root > 0.0_wp) part = -c/(half_b + root)
    else if (abs(a) > 0.0_wp) then
      part = (root - half_b)/a
    end if
    part = min(max(part, 0.0_wp), 1.0_wp)
  end function slip_onset
end module attrito_peak_slip_work
