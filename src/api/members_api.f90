!> C interface of the members of a family: between `attrito_enter_family` and `attrito_leave_family` the session stands at one after
!> another. All calls are collective and give every rank the same.
module attrito_api_members
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_family_members, only: description_type, take_sliders, enter_family, leave_family, keep_member, return_to_member, &
                                          solve_member, solve_member_at, describe_member, differentiate_member, work_of_visits
  use attrito_api_session, only: session_type, session_of
  implicit none
  private

contains

  !> Leave the contacts as they are at the point that was loaded, from its sliders [contacts, width] at the start of the period.
  subroutine attrito_take_sliders(handle, slider) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Sliders at the start of the period
    real(c_double), intent(in) :: slider(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    call take_sliders(session%solver, sliders_of(session, slider))
  end subroutine attrito_take_sliders

  !> Begin at the last point.
  subroutine attrito_enter_family(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    session => session_of(handle)
    call enter_family(session%solver, session%family)
  end subroutine attrito_enter_family

  !> Leave the session as it was.
  subroutine attrito_leave_family(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    session => session_of(handle)
    call leave_family(session%solver, session%family)
  end subroutine attrito_leave_family

  !> Floating-point operations since the family was entered.
  real(c_double) function attrito_family_work(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    session => session_of(handle)
    attrito_family_work = work_of_visits(session%solver, session%family)
  end function attrito_family_work

  !> Remember the present member in a slot, 0 or 1.
  subroutine attrito_keep_member(handle, slot) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Place of the member, 0 or 1
    integer(c_int), value :: slot
    type(session_type), pointer :: session

    session => session_of(handle)
    call keep_member(session%solver, session%members(slot))
  end subroutine attrito_keep_member

  !> Go back to the one remembered there.
  subroutine attrito_return_to_member(handle, slot) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Place of the member, 0 or 1
    integer(c_int), value :: slot
    type(session_type), pointer :: session

    session => session_of(handle)
    call return_to_member(session%solver, session%members(slot))
  end subroutine attrito_return_to_member

  !> Move the sliders [contacts, width]; 1 if that gave a member, else 0 and nothing has changed. It is given up after so many
  !> operations.
  integer(c_int) function attrito_solve_member(handle, slider, most_work) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Sliders at the start of the period
    real(c_double), intent(in) :: slider(*)
    !> Of all ranks
    real(c_double), value :: most_work
    type(session_type), pointer :: session
    logical :: found

    session => session_of(handle)
    call solve_member(session%solver, sliders_of(session, slider), most_work, found)
    attrito_solve_member = merge(1, 0, found)
  end function attrito_solve_member

  !> Go to an angular frequency, rad/s, from the present motion and sliders; 1 if that gave a point, else 0 and nothing has changed.
  integer(c_int) function attrito_solve_member_at(handle, omega) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Angular frequency, rad/s
    real(c_double), value :: omega
    type(session_type), pointer :: session
    logical :: found

    session => session_of(handle)
    call solve_member_at(session%solver, omega, found)
    attrito_solve_member_at = merge(1, 0, found)
  end function attrito_solve_member_at

  !> The present member: forces [contacts, 3, 2 H + 1], monitors [monitors, 2 H + 1] with amplitudes, sliders [contacts, width] and
  !> whether they are free (1.0 or 0.0). 0, or not: it cannot be evaluated.
  integer(c_int) function attrito_describe_member(handle, force, monitors, amplitude, slider, free) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    real(c_double), intent(out) :: force(*), monitors(*), amplitude(*), slider(*), free(*)
    type(session_type), pointer :: session
    type(description_type) :: member
    integer :: status

    session => session_of(handle)
    call describe_member(session%solver, session%family, member, status)
    attrito_describe_member = status
    if (status /= 0) return
    call copy(member, force, monitors)
    amplitude(:size(member%amplitude)) = member%amplitude
    slider(:size(member%slider)) = reshape(member%slider, [size(member%slider)])
    free(:size(member%free)) = member%free
  end function attrito_describe_member

  !> Change of the member described last with component `tangent` (from 0) of -k_t w of a contact (from 0); 0, or not: singular.
  integer(c_int) function attrito_differentiate_member(handle, contact, tangent, force, monitors) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of the contact; number of the tangent, from 0
    integer(c_int), value :: contact, tangent
    !> Contact forces; coefficients of monitors, or monitors
    real(c_double), intent(out) :: force(*), monitors(*)
    type(session_type), pointer :: session
    type(description_type) :: change
    integer :: status

    session => session_of(handle)
    call differentiate_member(session%solver, session%family, contact + 1, tangent + 1, change, status)
    attrito_differentiate_member = status
    if (status == 0) call copy(change, force, monitors)
  end function attrito_differentiate_member

  !> Sliders as C hands them over [width, contacts].
  pure function sliders_of(session, slider) result(sliders)
    !> Session behind a handle
    type(session_type), intent(in) :: session
    !> Of all contacts [contacts, width]
    real(wp), intent(in) :: slider(*)
    real(wp), allocatable :: sliders(:, :)
    integer :: contacts, width

    contacts = size(session%contacts%law)
    width = size(session%solver%static_slider, 1)
    sliders = reshape(slider(:width*contacts), [width, contacts])
  end function sliders_of

  pure subroutine copy(member, force, monitors)
    !> Member, as it is described
    type(description_type), intent(in) :: member
    !> Contact forces; coefficients of monitors, or monitors
    real(wp), intent(inout) :: force(*), monitors(*)

    force(:size(member%force)) = reshape(member%force, [size(member%force)])
    monitors(:size(member%monitors)) = reshape(member%monitors, [size(member%monitors)])
  end subroutine copy
end module attrito_api_members
