!> C interface of a point: reported series by series, and saved so that a later process goes on from it.
module attrito_api_point
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type, writing_store, reading_store
  use attrito_output_listener, only: new_listener
  use attrito_output_point_series, only: report_point
  use attrito_api_message, only: text_of
  use attrito_api_session, only: session_type, session_of
  implicit none
  private

contains

  !> Report the last point, series by series; names of monitors, one a line. Collective.
  subroutine attrito_report_point(handle, monitors, listener) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Monitors, or their names, one a line
    character(kind=c_char), intent(in) :: monitors(*)
    !> See `listener_type`; null except at the root
    type(c_funptr), value :: listener
    type(session_type), pointer :: session

    session => session_of(handle)
    call report_point(session%solver, session%point, lines_of(text_of(monitors), size(session%structure%monitors, 2)), &
                    new_listener(listener))
  end subroutine attrito_report_point

  !> Outcome of the last point by all that has been found of it, see `attrito_output_findings`.
  integer(c_int) function attrito_outcome(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session

    session => session_of(handle)
    attrito_outcome = session%point%findings%outcome()
  end function attrito_outcome

  !> Of motion in time under the loads of the last point, which has no solution: its period in periods of the excitation, 0: none.
  subroutine attrito_set_period_in_time(handle, period) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Period in periods of the excitation, 0: none
    integer(c_int), value :: period
    type(session_type), pointer :: session

    session => session_of(handle)
    session%point%findings%followed_period = period
  end subroutine attrito_set_period_in_time

  !> Save what the last point leaves for the next on this rank; returns how many numbers that is.
  integer(c_int) function attrito_save_state(handle) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    type(session_type), pointer :: session
    type(state_store_type) :: store

    session => session_of(handle)
    store = writing_store()
    call keep(session, store)
    session%state = store%numbers(:store%position)
    attrito_save_state = store%position
  end function attrito_save_state

  !> The numbers that were saved last.
  subroutine attrito_fetch_state(handle, numbers) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Numbers of the state
    real(c_double), intent(out) :: numbers(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    numbers(:size(session%state)) = session%state
  end subroutine attrito_fetch_state

  !> Load, in place of the last point, what was saved on as many ranks; 1 if it is of this session's kind, else 0. Collective.
  integer(c_int) function attrito_load_state(handle, count, numbers) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of items
    integer(c_int), value :: count
    !> Numbers of the state
    real(c_double), intent(in) :: numbers(count)
    type(session_type), pointer :: session
    type(state_store_type) :: store
    real(wp) :: unread

    session => session_of(handle)
    store = reading_store(numbers)
    call keep(session, store)
    unread = merge(0.0_wp, 1.0_wp, store%is_read())
    attrito_load_state = merge(1, 0, session%ranks%largest(unread) <= 0.0_wp)
  end function attrito_load_state

  !> All that a session remembers from point to point.
  subroutine keep(session, store)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store
    integer :: i

    call session%solver%keep(store)
    call session%sweep%keep(store)
    call session%accuracy%keep(store)
    do i = 1, size(session%moduli)
      call session%moduli(i)%keep(store)
    end do
    if (session%backbone%is_prepared()) call session%backbone%keep(store)
  end subroutine keep

  pure function lines_of(text, count) result(lines)
    !> Text, as C hands it over
    character(*), intent(in) :: text
    !> How many there are
    integer, intent(in) :: count
    character(64) :: lines(count)
    integer :: i, first, next

    first = 1
    do i = 1, count
      next = index(text(first:)//new_line('a'), new_line('a')) + first - 1
      lines(i) = text(first:next - 1)
      first = next + 1
    end do
  end function lines_of
end module attrito_api_point
