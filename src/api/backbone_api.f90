!> C interface of nonlinear modes by periodic motion. All calls are collective and give every rank the same.
module attrito_api_backbone
  use, intrinsic :: iso_c_binding
  use attrito_accuracy_point_errors, only: point_errors_type, no_tolerance
  use attrito_core_kinds, only: wp
  use attrito_newton_newton, only: newton_report_type
  use attrito_output_point_report, only: report_point
  use attrito_peak_backbone, only: begin_mode, go_to, prepare_mode
  use attrito_peak_mode_error, only: estimate_mode_errors
  use attrito_api_session, only: session_type, session_of
  use attrito_api_solver, only: point_type, point_of
  implicit none
  private
  public :: backbone_type

  type, bind(c) :: backbone_type
    !> Without an estimate of its error
    type(point_type) :: point
    !> The mode's coordinate; the negative damping, a part of the mass; sum_h h^2 X_h^H M X_h; damping ratio of the structure alone;
    !> by how much a period moves a slider, the most
    real(c_double) :: modal_amplitude, excitation, kinetic, structural_ratio, drift
    !> Does the curve fold between the point before and this one?
    integer(c_int) :: folded
  end type backbone_type

contains

  !> A mode from a shape with unit modal mass, cosine - i sine, and an angular frequency, at an amplitude of the shape; other shapes
  !> of that frequency follow the first, [m, shapes] all together. The static path has been followed; the session serves nothing but
  !> this mode from then on.
  subroutine attrito_begin_mode(handle, shapes, cosine, sine, omega, amplitude, branch, backbone) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> How many
    integer(c_int), value :: shapes
    !> In the model's coordinates
    real(c_double), intent(in) :: cosine(*), sine(*)
    !> Angular frequency, rad/s; amplitude of the shape
    real(c_double), value :: omega, amplitude
    !> Number of the branch
    integer(c_int), value :: branch
    !> Point of the mode, reported
    type(backbone_type), intent(out) :: backbone
    type(session_type), pointer :: session

    session => session_of(handle)
    call begin_mode(session%solver, shapes_of(session, shapes, cosine, sine), omega, amplitude, session%backbone)
    call describe(session, branch, backbone)
  end subroutine attrito_begin_mode

  !> Ready for a mode, as `attrito_begin_mode` begins one, to go on from a state that was saved.
  subroutine attrito_prepare_mode(handle, shapes, cosine, sine, omega) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> How many
    integer(c_int), value :: shapes
    !> In the model's coordinates
    real(c_double), intent(in) :: cosine(*), sine(*)
    !> Angular frequency, rad/s
    real(c_double), value :: omega
    type(session_type), pointer :: session

    session => session_of(handle)
    call prepare_mode(session%solver, shapes_of(session, shapes, cosine, sine), omega, session%backbone)
  end subroutine attrito_prepare_mode

  !> Of the model's coordinates [m, shapes].
  function shapes_of(session, count, cosine, sine) result(shapes)
    !> Session behind a handle
    type(session_type), intent(in) :: session
    !> Of shapes
    integer, intent(in) :: count
    !> Real part; imaginary part, less its sign
    real(c_double), intent(in) :: cosine(*), sine(*)
    complex(wp), allocatable :: shapes(:, :)

    associate (m => size(session%structure%mass, 1))
      shapes = reshape(cmplx(cosine(:m*count), -sine(:m*count), wp), [m, count])
    end associate
  end function shapes_of

  !> Followed to another amplitude.
  subroutine attrito_backbone_at(handle, amplitude, branch, backbone) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> The mode's coordinate
    real(c_double), value :: amplitude
    !> Number of the branch
    integer(c_int), value :: branch
    !> Point of the backbone, reported
    type(backbone_type), intent(out) :: backbone
    type(session_type), pointer :: session

    session => session_of(handle)
    call go_to(session%backbone, session%solver, amplitude)
    call describe(session, branch, backbone)
  end subroutine attrito_backbone_at

  !> Relative error of the last point by harmonics, of frequency, negative damping or monitors, whichever is the largest; NaN if it
  !> is not known.
  subroutine attrito_mode_errors(handle, harmonics) bind(c)
    !> Session, see `session_of`
    type(c_ptr), value :: handle
    !> By harmonics
    real(c_double), intent(out) :: harmonics
    type(session_type), pointer :: session
    type(point_errors_type) :: errors

    session => session_of(handle)
    call estimate_mode_errors(session%finer_estimator, session%solver, session%backbone, errors)
    harmonics = errors%harmonics
  end subroutine attrito_mode_errors

  subroutine describe(session, branch, backbone)
    !> Session behind a handle
    type(session_type), intent(inout) :: session
    !> Number of the branch
    integer, intent(in) :: branch
    !> Point of the backbone, reported
    type(backbone_type), intent(out) :: backbone
    type(newton_report_type) :: ended

    ended = session%solver%report
    ended%converged = session%backbone%found
    ended%iterations = session%backbone%iterations
    call report_point(session%solver, ended, branch, point_errors_type(), no_tolerance, session%point)
    backbone%point = point_of(session%point)
    backbone%modal_amplitude = session%backbone%amplitude
    backbone%excitation = session%backbone%excitation
    backbone%kinetic = session%backbone%kinetic
    backbone%structural_ratio = session%backbone%structural_ratio
    backbone%drift = ended%defect*session%solver%context%motion_scale
    backbone%folded = merge(1, 0, session%backbone%folded)
  end subroutine describe
end module attrito_api_backbone
