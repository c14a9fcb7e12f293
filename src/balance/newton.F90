#include <petsc/finclude/petscsnes.h>
#include "petsc_compatibility.h"
!> Newton's method on the bordered balance, by PETSc SNES: unknowns are the contacts' motion and omega, the last equation is the
!> constraint that picks the point (a frequency, or a plane across the branch).
!>
!> Unknowns are scaled by `motion_scale` and `frequency_scale`, residuals by `motion_scale`. The Jacobian is a shell, its inverse the
!> condensed system (exact), so the linear solver only applies it. Backtracking guards the step.
!> Source: Balay et al., PETSc users manual, chapter SNES.
module attrito_balance_newton
  use petscsnes
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_balance_condensed_system, only: constraint_type, solve_linearised, inner_product
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_newton_context, only: newton_context_type, MatCreateShell, MatShellGetContext, PCShellSetContext, &
                                            PCShellGetContext
  implicit none
  private
  public :: newton_type, newton_report_type, new_newton

  type :: newton_type
    type(newton_context_type), pointer :: context => null()
    type(tSNES) :: snes
    type(tVec) :: unknowns, residual
    type(tMat) :: jacobian
    PetscInt :: max_iterations = 30
  contains
    procedure :: solve
    procedure :: destroy
  end type newton_type

  !> How a solve ended
  type :: newton_report_type
    logical :: converged = .false.
    integer :: iterations = 0
    !> Norm of the scaled residual
    real(wp) :: residual = huge(1.0_wp)
    !> What one more period would move a slider by, relative to the motion's scale
    real(wp) :: defect = 0.0_wp
  end type newton_report_type

contains

  !> Create the solver for a balance. The balance and the constraint live in `context`, which the caller owns.
  subroutine new_newton(context, max_iterations, self, error)
    type(newton_context_type), target, intent(inout) :: context
    integer, intent(in) :: max_iterations
    type(newton_type), intent(out) :: self
    type(error_type), allocatable, intent(out) :: error
    PetscErrorCode :: ierr

    self%context => context
    call create(self, max_iterations, ierr)
    if (ierr /= 0) call raise(error, 'PETSc could not create the nonlinear solver')
  end subroutine new_newton

  subroutine create(self, max_iterations, ierr)
    type(newton_type), intent(inout) :: self
    integer, intent(in) :: max_iterations
    PetscErrorCode, intent(out) :: ierr
    type(tKSP) :: ksp
    type(tPC) :: pc
    SNESLineSearch :: search
    PetscInt :: n

    associate (balance => self%context%balance)
      n = balance%coefficients()*balance%rows()
      if (balance%ranks%is_root()) n = n + 1
      self%max_iterations = max_iterations
      PetscCall(VecCreateMPI(balance%ranks%handle, n, PETSC_DETERMINE, self%unknowns, ierr))
      PetscCall(VecDuplicate(self%unknowns, self%residual, ierr))
      PetscCall(MatCreateShell(balance%ranks%handle, n, n, PETSC_DETERMINE, PETSC_DETERMINE, self%context, self%jacobian, ierr))
      PetscCall(SNESCreate(balance%ranks%handle, self%snes, ierr))
    end associate
    PetscCall(MatShellSetOperation(self%jacobian, MATOP_MULT, multiply, ierr))
    PetscCall(SNESSetType(self%snes, SNESNEWTONLS, ierr))
    PetscCall(SNESSetFunction(self%snes, self%residual, evaluate, self%context, ierr))
    PetscCall(SNESSetJacobian(self%snes, self%jacobian, self%jacobian, differentiate, self%context, ierr))
    PetscCall(SNESSetDivergenceTolerance(self%snes, -1.0_wp, ierr))
    PetscCall(SNESSetErrorIfNotConverged(self%snes, PETSC_FALSE, ierr))
    PetscCall(SNESGetLineSearch(self%snes, search, ierr))
    PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHBT, ierr))
    PetscCall(SNESGetKSP(self%snes, ksp, ierr))
    PetscCall(KSPSetType(ksp, KSPPREONLY, ierr))
    PetscCall(KSPGetPC(ksp, pc, ierr))
    PetscCall(PCSetType(pc, PCSHELL, ierr))
    PetscCall(PCShellSetContext(pc, self%context, ierr))
    PetscCall(PCShellSetApply(pc, apply_inverse, ierr))
  end subroutine create

  !> Solve from a start; the start is overwritten by the last iterate, converged or not.
  subroutine solve(self, motion, omega, constraint, report)
    class(newton_type), intent(inout) :: self
    !> Relative displacements [2 H + 1, rows]
    real(wp), intent(inout) :: motion(:, :)
    !> Angular frequency
    real(wp), intent(inout) :: omega
    !> Constraint on physical motion and omega; it is met exactly by a converged solve
    type(constraint_type), intent(in) :: constraint
    type(newton_report_type), intent(out) :: report
    PetscErrorCode :: ierr

    self%context%constraint = constraint
    call run(self, motion, omega, report, ierr)
    if (ierr /= 0) report%converged = .false.
  end subroutine solve

  subroutine run(self, motion, omega, report, ierr)
    class(newton_type), intent(inout) :: self
    real(wp), intent(inout) :: motion(:, :), omega
    type(newton_report_type), intent(inout) :: report
    PetscErrorCode, intent(out) :: ierr
    SNESConvergedReason :: reason
    PetscInt :: iterations
    PetscReal :: norm
    PetscReal, parameter :: none = 0.0
    real(wp), allocatable :: final_motion(:, :)
    real(wp) :: final_omega
    integer :: status

    PetscCall(store(self%context, self%unknowns, motion, omega, ierr))
    PetscCall(SNESSetTolerances(self%snes, self%context%tolerance, none, none, self%max_iterations, 10*self%max_iterations, ierr))
    PetscCall(SNESSolve(self%snes, PETSC_NULL_VEC, self%unknowns, ierr))
    PetscCall(SNESGetConvergedReason(self%snes, reason, ierr))
    PetscCall(SNESGetIterationNumber(self%snes, iterations, ierr))
    PetscCall(SNESGetFunctionNorm(self%snes, norm, ierr))
    allocate (final_motion, mold=motion)
    PetscCall(load(self%context, self%unknowns, final_motion, final_omega, ierr))
    motion = final_motion
    omega = final_omega
    report%converged = norm <= self%context%tolerance
    report%iterations = iterations
    report%residual = norm
    ! The balance keeps forces and Jacobian of the answer, whatever the line search tried last.
    call ensure_evaluated(self%context, motion, omega, status)
    if (status /= 0) report%converged = .false.
  end subroutine run

  !> SNES: residual of balance and constraint.
  subroutine evaluate(snes, x, f, context, ierr)
    type(tSNES) :: snes
    type(tVec) :: x, f
    type(newton_context_type) :: context
    PetscErrorCode :: ierr
    real(wp), allocatable :: motion(:, :), rest(:, :)
    real(wp) :: omega, mismatch
    integer :: status

    allocate (motion, mold=context%balance%residual)
    PetscCall(load(context, x, motion, omega, ierr))
    call ensure_evaluated(context, motion, omega, status)
    if (status /= 0) then
      PetscCall(SNESSetFunctionDomainError(snes, ierr))
      return
    end if
    associate (constraint => context%constraint)
      mismatch = inner_product(context%balance, constraint%motion, motion) + constraint%frequency*omega - constraint%value
    end associate
    rest = context%balance%residual
    PetscCall(store(context, f, rest, mismatch*context%frequency_scale, ierr))
  end subroutine evaluate

  !> Evaluate the balance unless its last evaluation was here.
  subroutine ensure_evaluated(context, motion, omega, status)
    type(newton_context_type), intent(inout) :: context
    real(wp), intent(in) :: motion(:, :), omega
    integer, intent(out) :: status
    real(wp) :: difference

    status = 0
    if (allocated(context%evaluated_motion)) then
      difference = 0.0_wp
      if (size(motion) > 0) difference = maxval(abs(motion - context%evaluated_motion))
      difference = context%balance%ranks%largest(difference)
      if (difference <= 0.0_wp .and. abs(omega - context%evaluated_omega) <= 0.0_wp) return
    end if
    if (.not. abs(omega) < huge(omega)) then
      status = 1
      return
    end if
    call context%balance%evaluate(motion, omega, status)
    context%evaluated_motion = motion
    context%evaluated_omega = omega
  end subroutine ensure_evaluated

  !> SNES: the Jacobian is that of the last evaluation; make sure that it was here.
  subroutine differentiate(snes, x, jacobian, preconditioner, context, ierr)
    type(tSNES) :: snes
    type(tVec) :: x
    type(tMat) :: jacobian, preconditioner
    type(newton_context_type) :: context
    PetscErrorCode :: ierr
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega
    integer :: status

    allocate (motion, mold=context%balance%residual)
    PetscCall(load(context, x, motion, omega, ierr))
    call ensure_evaluated(context, motion, omega, status)
    if (status /= 0) then
      PetscCall(SNESSetJacobianDomainError(snes, ierr))
    end if
    PetscCall(MatAssemblyBegin(jacobian, MAT_FINAL_ASSEMBLY, ierr))
    PetscCall(MatAssemblyEnd(jacobian, MAT_FINAL_ASSEMBLY, ierr))
  end subroutine differentiate

  !> Shell Jacobian times a vector: d + R D d + b omega; p . d + q omega.
  subroutine multiply(jacobian, x, y, ierr)
    type(tMat) :: jacobian
    type(tVec) :: x, y
    PetscErrorCode :: ierr
    type(newton_context_type), pointer :: context
    real(wp), allocatable :: motion(:, :), deviation(:, :)
    complex(wp), allocatable :: response(:, :)
    real(wp) :: omega, mismatch
    integer :: contact, k

    PetscCall(MatShellGetContext(jacobian, context, ierr))
    associate (balance => context%balance)
      allocate (motion, deviation, mold=balance%residual)
      allocate (response, mold=balance%response)
      PetscCall(load(context, x, motion, omega, ierr))
      k = balance%coefficients()
      deviation = 0.0_wp
      do contact = 1, size(balance%law)
        associate (forces => balance%forces(contact), law => balance%law(contact))
          if (.not. allocated(forces%jacobian)) cycle
          associate (columns => motion(:, law%first_row:law%first_row + law%tangents))
            deviation(:, law%first_row:law%first_row + law%tangents) = &
              reshape(matmul(forces%jacobian, reshape(columns, [size(columns)])), shape(columns))
          end associate
        end associate
      end do
      call balance%respond_to_deviation(deviation, response)
      mismatch = inner_product(balance, context%constraint%motion, motion) + context%constraint%frequency*omega
      motion = motion - balance%recover(response) + balance%residual_omega*omega
      PetscCall(store(context, y, motion, mismatch*context%frequency_scale, ierr))
    end associate
  end subroutine multiply

  !> Shell preconditioner: the condensed system, exact.
  subroutine apply_inverse(pc, x, y, ierr)
    type(tPC) :: pc
    type(tVec) :: x, y
    PetscErrorCode :: ierr
    type(newton_context_type), pointer :: context
    real(wp), allocatable :: rho(:, :), step(:, :)
    real(wp) :: sigma, step_omega
    integer :: status

    PetscCall(PCShellGetContext(pc, context, ierr))
    allocate (rho, step, mold=context%balance%residual)
    PetscCall(load(context, x, rho, sigma, ierr))
    call solve_linearised(context%balance, context%constraint, rho, sigma/context%frequency_scale, step, step_omega, status)
    if (status /= 0) then
      step = 0.0_wp
      step_omega = 0.0_wp
    end if
    PetscCall(store(context, y, step, step_omega, ierr))
  end subroutine apply_inverse

  !> Physical motion and omega from a scaled vector; omega on every rank.
  subroutine load(context, x, motion, omega, ierr)
    type(newton_context_type), intent(in) :: context
    type(tVec) :: x
    real(wp), intent(out) :: motion(:, :), omega
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    real(wp) :: last(1)

    PetscCall(VecGetArrayRead(x, values, ierr))
    motion = context%motion_scale*reshape(values(:size(motion)), shape(motion))
    last = 0.0_wp
    if (context%balance%ranks%is_root()) last = context%frequency_scale*values(size(values))
    PetscCall(VecRestoreArrayRead(x, values, ierr))
    call context%balance%ranks%broadcast(last)
    omega = last(1)
  end subroutine load

  !> A scaled vector from physical motion and omega.
  subroutine store(context, x, motion, omega, ierr)
    type(newton_context_type), intent(in) :: context
    type(tVec) :: x
    real(wp), intent(in) :: motion(:, :), omega
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)

    PetscCall(VecGetArray(x, values, ierr))
    values(:size(motion)) = reshape(motion/context%motion_scale, [size(motion)])
    if (context%balance%ranks%is_root()) values(size(values)) = omega/context%frequency_scale
    PetscCall(VecRestoreArray(x, values, ierr))
  end subroutine store

  !> Give PETSc's objects back.
  subroutine destroy(self)
    class(newton_type), intent(inout) :: self
    PetscErrorCode :: ierr

    call SNESDestroy(self%snes, ierr)
    call MatDestroy(self%jacobian, ierr)
    call VecDestroy(self%residual, ierr)
    call VecDestroy(self%unknowns, ierr)
  end subroutine destroy
end module attrito_balance_newton
