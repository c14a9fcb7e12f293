!> What an opaque handle of the solver stands for, and a contact's law as C hands it over.
module attrito_api_session
  use, intrinsic :: iso_c_binding
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_contact_law_laws, only: new_law
  use attrito_model_contacts, only: contact_type, contacts_type
  use attrito_model_structure, only: structure_type
  use attrito_accuracy_error_control, only: error_control_type
  use attrito_accuracy_error_estimate, only: error_estimate_type
  use attrito_continuation_sweep, only: sweep_type
  use attrito_continuation_stored_points, only: stored_points_type
  use attrito_family_members, only: family_type, member_type
  use attrito_sensitivity_point_rates, only: inquiry_type
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_system, only: system_type
  use attrito_peak_backbone_point, only: backbone_type
  use attrito_peak_curve, only: curve_type
  use attrito_peak_quasi_static, only: quasi_static_type
  use attrito_output_point_report, only: point_report_type
  use attrito_stability_wheel_modes, only: wheel_modes_type
  use attrito_stability_wheel_monodromy, only: wheel_type
  use attrito_stability_crossing, only: moduli_type
  use attrito_stability_examine, only: examination_type
  implicit none
  private
  public :: session_type, bifurcation_type, session_of, contact_law_type, law_of, release_laws

  !> A turning point, or where a multiplier crosses the unit circle
  type :: bifurcation_type
    !> See `attrito_api_bifurcations`
    integer :: kind = 0
    !> What is left open of its frequency
    real(wp) :: uncertain_hz = 0.0_wp
    complex(wp) :: multiplier = 0.0_wp
    type(point_report_type) :: point
  end type bifurcation_type

  type :: session_type
    type(communicator_type) :: ranks
    type(structure_type) :: structure
    type(contacts_type) :: contacts
    type(solver_type) :: solver
    type(sweep_type) :: sweep
    type(error_control_type) :: accuracy
    type(point_report_type) :: point
    !> Error of the drawn curve that sweeps accept, part of the largest amplitude
    real(wp) :: curve_tolerance = 0.01_wp
    !> What the last point leaves for the next, while it is fetched
    real(wp), allocatable :: state(:)
    !> While other members of the last point's family are visited: the point, and two of them to return to
    type(family_type) :: family
    type(member_type) :: members(0:1)
    !> What derivatives are asked for
    type(inquiry_type) :: inquiry
    !> A peak that is followed; a mode's backbone, and finer balances that estimate errors of either; a mode loaded quasi-statically
    type(curve_type) :: peak
    type(backbone_type) :: backbone
    type(error_estimate_type) :: finer_estimator
    type(quasi_static_type) :: quasi_static
    !> The linear system in time, once it is asked for, and what was found of the last point's stability
    type(system_type), allocatable :: in_time
    type(examination_type) :: examination
    !> Dynamic multipliers of the last two points, none if they were not examined; bifurcations of the step between
    !> Of a sector: modes of all nodal diameters of its wheel, and the whole wheel, once they are asked for
    type(wheel_modes_type), allocatable :: waves
    type(wheel_type), allocatable :: wheel
    type(moduli_type) :: moduli(2)
    type(bifurcation_type), allocatable :: bifurcations(:)
    !> Points of branches while others are sought
    type(stored_points_type) :: known
  end type session_type

  type, bind(c) :: contact_law_type
    integer(c_int) :: tangents, law
    real(c_double) :: tangential_stiffness, normal_stiffness, friction_coefficient, gap, preload
    integer(c_int) :: count
    type(c_ptr) :: numbers
  end type contact_law_type

contains

  !> The session behind a handle.
  function session_of(handle) result(session)
    !> Session of the solver
    type(c_ptr), intent(in) :: handle
    type(session_type), pointer :: session

    call c_f_pointer(handle, session)
  end function session_of

  !> A contact out of C's; `release_laws` gives its law back.
  function law_of(law) result(contact)
    !> Contact laws
    type(contact_law_type), intent(in) :: law
    type(contact_type) :: contact
    real(c_double), pointer :: numbers(:)

    contact%tangents = law%tangents
    contact%tangential_stiffness = law%tangential_stiffness
    contact%normal_stiffness = law%normal_stiffness
    contact%friction_coefficient = law%friction_coefficient
    contact%gap = law%gap
    contact%preload = law%preload
    if (law%law == 0) return
    call c_f_pointer(law%numbers, numbers, [law%count])
    contact%law => new_law(law%law, numbers)
  end function law_of

  !> Give the laws of contacts back; none of them is used any more.
  subroutine release_laws(contacts)
    !> Contact: its springs and its law
    type(contact_type), intent(inout) :: contacts(:)
    integer :: i

    do i = 1, size(contacts)
      if (associated(contacts(i)%law)) deallocate (contacts(i)%law)
    end do
  end subroutine release_laws
end module attrito_api_session
