!> C interface of branches that are sought: points that are known, starts from elsewhere, sweeps along one branch. Collective.
module attrito_api_branches
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: resized
  use attrito_continuation_sweep, only: new_branch_sweep
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_continuation_branch_seeds, only: start_cold, start_in_motion, start_from_preload
  use attrito_continuation_tangent, only: tangent_type, frequency_tangent
  use attrito_stability_crossing, only: moduli_type
  use attrito_api_session, only: session_type, session_of
  implicit none
  private
  public :: cold, in_motion, from_preload

  ! Ways to look for a start, listed by `attrito_describe`
  integer, parameter :: cold = 0, in_motion = 1, from_preload = 2

contains

  !> Add the last point to those that are known; `follows`: the branch goes on from the one added before.
  subroutine attrito_keep_point(handle, follows) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Does the branch go on from the one stored last?
    integer(c_int), value :: follows
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (stepper => session%sweep%stepper)
      if (stepper%looked_ahead .and. stepper%here%is_known()) then
        call session%known%add(session%solver, follows /= 0, stepper%tangent, stepper%last%length)
      else
        call session%known%add(session%solver, follows /= 0)
      end if
    end associate
  end subroutine attrito_keep_point

  !> Remove all known points but the first so many.
  subroutine attrito_remove_points(handle, count) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of items
    integer(c_int), value :: count
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%known%drop_from(count + 1)
  end subroutine attrito_remove_points

  !> Make a known point the last one, from 0.
  subroutine attrito_start_from_point(handle, number) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of the stored point, from 0
    integer(c_int), value :: number
    type(session_type), pointer :: session

    session => session_of(handle)
    call session%known%restore_point(session%solver, number + 1)
  end subroutine attrito_start_from_point

  !> Does the last point lie on a branch of the first so many points that are known?
  integer(c_int) function attrito_lies_on_branch(handle, count) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Number of items
    integer(c_int), value :: count
    type(session_type), pointer :: session

    session => session_of(handle)
    attrito_lies_on_branch = merge(1, 0, session%known%contains_solution(session%solver, count))
  end function attrito_lies_on_branch

  !> Look for a point at an angular frequency: 1 if one was found, on which the session then stands.
  integer(c_int) function attrito_seek(handle, way, omega, factor) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Way of looking, or direction
    integer(c_int), value :: way
    !> Angular frequency, rad/s; factor on motion or loads
    real(c_double), value :: omega, factor
    type(session_type), pointer :: session
    logical :: found

    session => session_of(handle)
    select case (way)
     case (cold)
      call start_cold(session%solver, omega, found)
     case (in_motion)
      call start_in_motion(session%solver, omega, factor, found)
     case default  ! from_preload
      call start_from_preload(session%solver, omega, factor, found)
    end select
    attrito_seek = merge(1, 0, found)
  end function attrito_seek

  !> Begin a sweep along the branch on which the session stands, within a range of angular frequency: towards growing (1) or falling
  !> (-1) frequency, or (0) back from where the last sweep stands.
  subroutine attrito_begin_branch(handle, start, stop, way, branch, max_points) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> End of the range, rad/s
    real(c_double), value :: start, stop
    !> Way of looking, or direction; number of the branch; most points
    integer(c_int), value :: way, branch, max_points
    type(session_type), pointer :: session
    type(tangent_type) :: towards

    session => session_of(handle)
    towards = frequency_tangent(session%solver, real(way, wp))
    if (way == 0) towards = session%sweep%stepper%tangent_backwards(session%solver)
    session%sweep = new_branch_sweep(session%solver, start, stop, towards, branch, max_points)
    session%sweep%stepper%tolerance = session%curve_tolerance
    session%moduli = moduli_type()
  end subroutine attrito_begin_branch

  !> Stand at a motion of the model's coordinates [m, coefficients] at an angular frequency, with sliders [contacts, width], and
  !> solve there; 1 if that converges.
  integer(c_int) function attrito_start_from_motion(handle, coefficients, coordinates, slider, omega, level) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Coefficients of each row, 2 H + 1
    integer(c_int), value :: coefficients
    !> Motion of the model's coordinates; sliders at the start of the period
    real(c_double), intent(in) :: coordinates(coefficients, *), slider(*)
    !> Angular frequency, rad/s; factor on the loads
    real(c_double), value :: omega, level
    type(session_type), pointer :: session
    integer :: first, last, m, width

    session => session_of(handle)
    m = size(session%structure%mass, 1)
    associate (solver => session%solver, balance => session%solver%context%balance)
      call solver%set_loads(balance%static_factors, level)
      solver%motion = resized(solver%relative_motion(coordinates(:, :m)), size(solver%motion, 1))
      solver%omega = omega
      solver%all_stick = .false.
      width = size(balance%slider, 1)
      first = width*(balance%first_contact - 1) + 1
      last = first - 1 + size(balance%slider)
      call solver%set_slider(reshape(slider(first:last), shape(balance%slider)))
      call solve_by_strategies(solver, omega)
      attrito_start_from_motion = merge(1, 0, solver%report%converged)
    end associate
  end function attrito_start_from_motion
end module attrito_api_branches
