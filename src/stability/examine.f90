!> Stability of the point at which a solver stands.
module attrito_stability_examine
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_structure, only: structure_type, damping_loss_factor, damping_viscous
  use attrito_continuation_solver, only: solver_type
  use attrito_integrate_system, only: system_type, new_system
  use attrito_stability_graze, only: grazing_contact
  use attrito_stability_hill, only: hill_multipliers
  use attrito_stability_leg, only: orbit_legs_type, legs_of_motion
  use attrito_stability_monodromy, only: monodromy
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of
  use attrito_stability_verdict, only: judge, largest_multiplier, not_examined, indeterminate
  implicit none
  private
  public :: examination_type, examine, system_of, by_monodromy, by_hill

  !> Engines, to be added
  integer, parameter :: by_monodromy = 1, by_hill = 2

  !> Multipliers that the two engines may differ by and still agree
  real(wp), parameter :: agreement = 1.0e-3_wp

  type :: examination_type
    !> One of `not_examined`, `unstable`, `stable`, `indeterminate`
    integer :: verdict = not_examined
    !> Why it was not examined or is indeterminate
    character(:), allocatable :: reason
    !> Of each engine that was asked for, at the root
    type(multiplier_type), allocatable :: monodromy(:), hill(:)
  end type examination_type

contains

  !> Examine the solver's present point, at the root; the verdict is known to all.
  subroutine examine(solver, system, methods, self)
    type(solver_type), intent(in) :: solver
    !> Of `system_of`, allocated where the root is
    type(system_type), allocatable, intent(in) :: system
    !> Sum of `by_...`
    integer, intent(in) :: methods
    type(examination_type), intent(out) :: self
    real(wp), allocatable :: motion(:, :), slider(:, :)
    real(wp) :: verdict
    integer :: i

    self%reason = ''
    if (any(solver%contacts%law%tangents > 1)) then
      self%reason = 'contacts with two tangents'
      return
    end if
    associate (balance => solver%context%balance)
      allocate (motion(balance%coefficients(), size(solver%contacts%row_stiffness)), slider(2, size(solver%contacts%law)), &
                source=0.0_wp)
      motion(:, balance%first_row:balance%first_row + balance%rows() - 1) = solver%motion
      do i = 1, size(balance%law)
        slider(:, balance%first_contact - 1 + i) = balance%forces(i)%slider
      end do
      call balance%ranks%sum(motion)
      call balance%ranks%sum(slider)
      verdict = 0.0_wp
      if (balance%ranks%is_root()) then
        call examine_orbit(solver, system, methods, motion, slider(1, :), self)
        verdict = real(self%verdict, wp)
      end if
      call balance%ranks%sum(verdict)
    end associate
    self%verdict = nint(verdict)
  end subroutine examine

  !> Examine a motion of all contacts [2 H + 1, rows] with sliders [contacts].
  subroutine examine_orbit(solver, system, methods, motion, slider, self)
    type(solver_type), intent(in) :: solver
    type(system_type), intent(in) :: system
    integer, intent(in) :: methods
    real(wp), intent(in) :: motion(:, :), slider(:)
    type(examination_type), intent(inout) :: self
    type(orbit_legs_type) :: orbit
    real(wp) :: period
    integer :: info, contact

    info = 0
    period = two_pi*system%clock/solver%omega
    associate (grid => solver%context%balance%grid, law => solver%contacts%law)
      call legs_of_motion(law, grid, motion, slider, orbit)
      if (iand(methods, by_monodromy) /= 0) &
        call multipliers_of(system, orbit, monodromy(system, orbit, period), self%monodromy, info)
      if (iand(methods, by_hill) /= 0 .and. info == 0) call hill_multipliers(system, orbit, period, self%hill, info)
      if (info /= 0) then
        self%reason = 'eigenvalues were not found'
        return
      end if
      self%verdict = verdict_of(self, .not. all(orbit%stuck))
      call grazing_contact(law, grid, motion, slider, orbit, contact)
    end associate
    if (contact > 0) then
      self%verdict = indeterminate
      self%reason = 'contact '//number(contact - 1)//' grazes'
    end if
  end subroutine examine_orbit

  !> Of the engines that were asked for: they must agree.
  integer function verdict_of(self, switches) result(verdict)
    type(examination_type), intent(inout) :: self
    logical, intent(in) :: switches

    verdict = not_examined
    if (allocated(self%monodromy)) verdict = judge(self%monodromy, switches)
    if (.not. allocated(self%hill)) then
      if (verdict == indeterminate) self%reason = 'a multiplier is 1 in modulus'
      return
    end if
    if (.not. allocated(self%monodromy)) verdict = judge(self%hill, switches)
    if (verdict == indeterminate) self%reason = 'a multiplier is 1 in modulus'
    if (.not. allocated(self%monodromy)) return
    if (abs(largest_multiplier(self%monodromy) - largest_multiplier(self%hill)) <= agreement .and. &
        verdict == judge(self%hill, switches)) return
    verdict = indeterminate
    self%reason = 'monodromy and Hill''s problem differ'
  end function verdict_of

  !> The linear system of a structure in time, at an angular frequency: where a loss factor is to be taken for the viscous damping that
  !> is equal to it there, C = eta K / omega.
  subroutine system_of(solver, equivalent_viscous, omega, system, error)
    type(solver_type), intent(in) :: solver
    logical, intent(in) :: equivalent_viscous
    real(wp), intent(in) :: omega
    type(system_type), intent(out) :: system
    type(error_type), allocatable, intent(out) :: error
    type(structure_type) :: structure

    structure = solver%structure
    if (equivalent_viscous .and. structure%damping_kind == damping_loss_factor) then
      structure%damping_kind = damping_viscous
      structure%damping = structure%damping_value/omega*structure%stiffness
    end if
    call new_system(structure, solver%contacts, system, error)
  end subroutine system_of

  pure function number(i) result(text)
    integer, intent(in) :: i
    character(:), allocatable :: text
    character(12) :: digits

    write (digits, '(i0)') i
    text = trim(digits)
  end function number
end module attrito_stability_examine
