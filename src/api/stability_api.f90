!> C interface of stability: examine the point at which a session stands. Collective; multipliers are at the root.
module attrito_api_stability
  use, intrinsic :: iso_c_binding
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_integrate_system, only: system_type
  use attrito_model_structure, only: damping_loss_factor
  use attrito_stability_crossing, only: moduli_of
  use attrito_stability_examine, only: examine, examine_options_type, system_of, by_monodromy, by_hill
  use attrito_stability_examine_sector, only: examine_sector
  use attrito_stability_wheel_modes, only: new_wheel_modes
  use attrito_stability_multipliers, only: multiplier_type
  use attrito_stability_verdict, only: not_examined
  use attrito_stability_wheel_monodromy, only: new_wheel, modes_of_wheel, most_modes
  use attrito_api_message, only: report_error, say
  use attrito_api_session, only: session_type, session_of
  implicit none
  private
  public :: examination_report_type

  type, bind(c) :: examination_report_type
    !> `not_examined`, `unstable`, `stable`, `indeterminate`; and how many multipliers each engine found
    integer(c_int) :: verdict, monodromy, hill
    !> See `examination_type`
    real(c_double) :: distance, change, low, high
  end type examination_report_type

contains

  !> Examine the last point on an orbit (0 the balance's, 1 the event-exact one near it, 2 where need be) by the sum of engines (1
  !> monodromy, 2 Hill's problem), note the verdict in what is going to be written of it,
  !> and say why where there is none.
  integer(c_int) function attrito_examine(handle, methods, orbit, equivalent_viscous, report, message, length) result(status) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    integer(c_int), value :: methods, orbit, equivalent_viscous, length
    !> What is found
    type(examination_report_type), intent(out) :: report
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(session_type), pointer :: session
    type(error_type), allocatable :: error
    type(examine_options_type) :: options

    session => session_of(handle)
    report = examination_report_type(not_examined, 0, 0, -1.0_c_double, 0.0_c_double, 0.0_c_double, -1.0_c_double)
    options = examine_options_type(methods, orbit)
    associate (errors => session%point%errors)
      if (errors%are_known()) options%estimate = max(errors%harmonics, errors%of_motion)
    end associate
    if (allocated(session%structure%sector)) then
      call prepare_wheel(session, int(methods), error)
      status = report_error(error, message)
      if (allocated(error)) return
      call examine_sector(session%solver, session%waves, session%wheel, options, session%examination)
      session%moduli(2)%value = [complex(wp) ::]
    else
      call prepare(session, equivalent_viscous /= 0, error)
      status = report_error(error, message)
      if (allocated(error)) return
      call examine(session%solver, session%in_time, options, session%examination)
      call moduli_of(session%solver, session%examination, session%moduli(2))
    end if
    report%verdict = session%examination%verdict
    report%distance = session%examination%distance
    report%change = session%examination%change
    report%low = session%examination%low
    report%high = session%examination%high
    if (allocated(session%examination%monodromy)) report%monodromy = size(session%examination%monodromy)
    if (allocated(session%examination%hill)) report%hill = size(session%examination%hill)
    call say(session%examination%reason, message)
    if (session%point%findings%may_be_examined()) session%point%findings%verdict = report%verdict
  end function attrito_examine

  !> The system in time: once, but where its damping depends on the frequency.
  subroutine prepare(session, equivalent_viscous, error)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Replace a loss factor by viscous damping?
    logical, intent(in) :: equivalent_viscous
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    if (allocated(session%in_time)) then
      if (session%structure%damping_kind /= damping_loss_factor) return
      deallocate (session%in_time)
    end if
    allocate (session%in_time)
    call system_of(session%solver, equivalent_viscous, session%solver%omega, session%in_time, error)
  end subroutine prepare

  !> What the engines need of a sector's wheel: once.
  subroutine prepare_wheel(session, methods, error)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Sum of the engines
    integer, intent(in) :: methods
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    character(12) :: modes, most
    integer :: status

    if (session%structure%damping_kind == damping_loss_factor) then
      call raise(error, '[damping] loss_factor: structural damping has no time-domain twin: expected ratio, rayleigh or a'// &
                 ' damping matrix', fault_of_input)
    else if (.not. all(session%contacts%law%is_proportional()) .or. any(session%contacts%law%elements() > 1)) then
      call raise(error, 'stability: a contact law that is not proportional to the normal force, or of several elements: expected'// &
                 ' Coulomb''s', fault_of_input)
    end if
    if (allocated(error)) return
    if (iand(methods, by_hill) /= 0 .and. .not. allocated(session%waves)) then
      allocate (session%waves)
      call new_wheel_modes(session%structure, session%contacts, session%waves, status)
      if (status /= 0) call raise(error, 'stiffness: with every contact stuck, a nodal diameter of the wheel is not held:'// &
                                  ' expected supports or contacts that hold every body', fault_of_input)
    end if
    if (iand(methods, by_monodromy) /= 0 .and. .not. allocated(session%wheel)) then
      write (modes, '(i0)') modes_of_wheel(session%structure)
      write (most, '(i0)') most_modes
      if (modes_of_wheel(session%structure) > most_modes) then
        call raise(error, '[stability] method: the whole wheel has '//trim(modes)//' modes: expected at most '//trim(most)// &
                   ', or method = "hill"', fault_of_input)
        return
      end if
      allocate (session%wheel)
      call new_wheel(session%structure, session%contacts, session%wheel, error)
    end if
  end subroutine prepare_wheel

  !> Multipliers of the last examination by one engine, 1 or 2: real and imaginary parts, kinds.
  subroutine attrito_multipliers(handle, method, re, im, kind) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Sum of the engines, or one of them
    integer(c_int), value :: method
    !> Real or imaginary parts
    real(c_double), intent(out) :: re(*), im(*)
    !> Numbers of the kinds
    integer(c_int), intent(out) :: kind(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    if (method == 1) then
      call copy(session%examination%monodromy, re, im, kind)
    else
      call copy(session%examination%hill, re, im, kind)
    end if
  end subroutine attrito_multipliers

  !> Wavenumbers of the same multipliers, of a sector's wheel; -1: none.
  subroutine attrito_wavenumbers(handle, method, wavenumber) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> Sum of the engines, or one of them
    integer(c_int), value :: method
    !> 0 ... N - 1
    integer(c_int), intent(out) :: wavenumber(*)
    type(session_type), pointer :: session

    session => session_of(handle)
    associate (found => session%examination)
      if (method == 1) then
        wavenumber(:size(found%monodromy)) = found%monodromy%wavenumber
      else
        wavenumber(:size(found%hill)) = found%hill%wavenumber
      end if
    end associate
  end subroutine attrito_wavenumbers

  pure subroutine copy(multipliers, re, im, kind)
    !> Floquet multipliers
    type(multiplier_type), intent(in) :: multipliers(:)
    !> Real or imaginary parts
    real(c_double), intent(inout) :: re(*), im(*)
    !> Numbers of the kinds
    integer(c_int), intent(inout) :: kind(*)
    integer :: n

    n = size(multipliers)
    re(:n) = real(multipliers%value, c_double)
    im(:n) = aimag(multipliers%value)
    kind(:n) = multipliers%kind
  end subroutine copy
end module attrito_api_stability
