!> The end of a static load path as the start of a time integration: the path is that of the balance (`attrito_solve_static_path`).
module attrito_integrate_static_path
  use attrito_core_communicator, only: own_communicator
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_integrate_system, only: system_type
  use attrito_model_contacts, only: contacts_type
  use attrito_model_structure, only: structure_type
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  implicit none
  private
  public :: start_at_end_of_path

contains

  !> Follow the path from the unloaded state over its corners; PETSc has to run.
  subroutine start_at_end_of_path(structure, contacts, system, path, steps, motion, slider, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> The same in time
    type(system_type), intent(in) :: system
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Increments from corner to corner at least
    integer, intent(in) :: steps
    !> Modal displacement [m] at the end
    real(wp), intent(out) :: motion(:)
    !> Sliders where the path begins, then where it ends [2, contacts]
    real(wp), intent(inout) :: slider(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp), allocatable :: displacement(:, :)

    call new_solver(structure, contacts, own_communicator(), solver_options_type(harmonics=0, samples=4), solver, error)
    if (.not. allocated(error)) call follow_static_path(solver, path, steps, 0.5_wp*minval(solver%stuck%omega), error, slider)
    if (.not. allocated(error)) then
      associate (balance => solver%context%balance)
        displacement = balance%receptance%displacements(balance%response(:, 0:0))
        motion = matmul(displacement(1, :), system%weighted)
        slider = balance%slider
      end associate
    end if
    call solver%destroy()
  end subroutine start_at_end_of_path
end module attrito_integrate_static_path
