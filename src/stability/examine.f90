!> Stability of the point at which a solver stands.
module attrito_stability_examine
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: state_shaken_down
  use attrito_model_structure, only: structure_type, damping_loss_factor, damping_viscous
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_stability_examination, only: examination_type, examine_options_type, by_monodromy, by_hill, balanced_orbit, &
                                           exact_orbit, automatic_orbit, balance_motion_type
  use attrito_stability_examine_legs, only: examine_legs
  use attrito_stability_examine_sampled, only: examine_sampled
  implicit none
  private
  public :: examination_type, examine_options_type, examine, system_of, by_monodromy, by_hill
  public :: balanced_orbit, exact_orbit, automatic_orbit

contains

  !> Examine the solver's present point, at the root; the verdict is known to all.
  subroutine examine(solver, system, options, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Of `system_of`, allocated where the root is
    type(system_type), allocatable, intent(in) :: system
    !> Engines, and the orbit that they examine
    type(examine_options_type), intent(in) :: options
    type(examination_type), intent(out) :: self
    type(balance_motion_type) :: all
    real(wp) :: verdict, turning, holds(size(solver%contacts%law))
    integer :: i

    self%reason = ''
    associate (balance => solver%context%balance)
      turning = count(balance%law%tangents > 1 .and. balance%forces%state > state_shaken_down)
      call balance%ranks%sum(turning)
      allocate (all%motion(balance%coefficients(), size(solver%contacts%row_stiffness)), &
                all%slider(size(balance%slider, 1), size(holds)), source=0.0_wp)
      holds = 0.0_wp
      all%motion(:, balance%first_row:balance%first_row + balance%rows() - 1) = solver%motion
      do i = 1, size(balance%law)
        all%slider(:, balance%first_contact - 1 + i) = balance%forces(i)%slider
        if (balance%forces(i)%state <= state_shaken_down) holds(balance%first_contact - 1 + i) = 1.0_wp
      end do
      call balance%ranks%sum(all%motion)
      call balance%ranks%sum(all%slider)
      call balance%ranks%sum(holds)
      all%holds = holds > 0.0_wp
      verdict = 0.0_wp
      if (balance%ranks%is_root()) then
        if (turning > 0.0_wp) then
          call examine_sampled(solver, system, options, all, self)
        else
          call examine_legs(solver, system, options, all, self)
        end if
        verdict = real(self%verdict, wp)
      end if
      call balance%ranks%sum(verdict)
    end associate
    self%verdict = nint(verdict)
  end subroutine examine

  !> The linear system of a structure in time, at an angular frequency: where a loss factor is to be taken for the viscous damping
  !> that is equal to it there, C = eta K / omega.
  subroutine system_of(solver, equivalent_viscous, omega, system, error)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Replace a loss factor by viscous damping?
    logical, intent(in) :: equivalent_viscous
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(out) :: system
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(structure_type) :: structure

    if (.not. all(solver%contacts%law%has_events())) then
      call raise(error, 'stability: a contact law that is not proportional to the normal force: expected Coulomb''s', &
                 fault_of_input)
      return
    end if
    structure = solver%structure
    if (equivalent_viscous .and. structure%damping_kind == damping_loss_factor) then
      structure%damping_kind = damping_viscous
      structure%damping = structure%damping_value/omega*structure%stiffness
    end if
    call new_system(structure, solver%contacts, system, error)
  end subroutine system_of
end module attrito_stability_examine
