#include <petsc/finclude/petscsnes.h>
#include "petsc_compatibility.h"
!> Newton's method on the bordered balance, by PETSc SNES: unknowns are the contacts' motion, periodic sliders and omega; equations are
!> the balance, w = P(w, d), and the constraint that picks the point (a frequency, or a plane across the branch).
!>
!> Unknowns are scaled by `motion_scale` and `frequency_scale`, residuals by `motion_scale`. The Jacobian is a shell, its inverse the
!> condensed system, so SNES's own linear solver only applies it. Backtracking guards the step.
!> Source: Balay et al., PETSc users manual, chapter SNES.
module attrito_newton_newton
  use petscsnes
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_newton_convergence, only: has_diverged, is_converged, worse_of
  use attrito_newton_linearised_step, only: solve_linearised, apply_linearised, stiffened
  use attrito_newton_newton_context, only: context_handle_type, newton_context_type, least_stiffening
#if PETSC_VERSION_LT(3, 23, 0)
  use attrito_newton_newton_context, only: MatCreateShell, MatShellGetContext, PCShellSetContext, PCShellGetContext
#endif
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  implicit none
  private
  public :: newton_type, newton_controls_type, newton_report_type, new_newton

  !> Relative to the scales, beyond which a step says that the Jacobian is singular
  real(wp), parameter :: longest_step = 1.0e6_wp ! guess
  !> Norm of the residual from which on it is decided which sliders rest
  real(wp), parameter :: settling_norm = 1.0e-3_wp ! guess

  !> Growth of the residual that no solve comes to
  real(wp), parameter :: never_diverged = 1.0e100_wp ! conventional

  !> Lengths of the series that objects are kept for
  integer, parameter :: most_lengths = 8 ! conventional

  !> PETSc's objects for one length of the series
  type :: objects_type
    type(tSNES) :: snes
    type(tVec) :: unknowns, residual
    type(tMat) :: jacobian
    integer :: coefficients = 0
  end type objects_type

  type :: newton_type
    type(newton_context_type), pointer :: context => null()
    !> Stays where it is while PETSc knows of it
    type(context_handle_type), pointer :: handle => null()
    !> Those at hand, those of other lengths, and the one of them that gives way next
    type(objects_type) :: now
    type(objects_type), allocatable :: others(:)
    integer :: oldest = 1
  contains
    procedure :: solve
    procedure :: take_length
    procedure :: destroy
  end type newton_type

  !> How a solve is to be done
  type :: newton_controls_type
    !> Norm of the scaled residual that counts as converged
    real(wp) :: tolerance = 1.0e-10_wp
    integer :: max_iterations = 30
    !> Part of their springs that contacts keep in the step to begin with: 0 is Newton's method, with backtracking
    real(wp) :: stiffening = 0.0_wp
  end type newton_controls_type

  !> How a solve ended
  type :: newton_report_type
    logical :: converged = .false.
    integer :: iterations = 0
    !> Of GMRES, where the linear systems are large
    integer :: linear_iterations = 0
    !> Norm of the scaled residual
    real(wp) :: residual = huge(1.0_wp)
    !> What one more period would move a slider by, relative to the motion's scale
    real(wp) :: defect = 0.0_wp
  end type newton_report_type

contains

  !> Create the solver for a balance. The balance and the constraint live in `context`, which the caller owns, and which has the
  !> error where PETSc fails: nothing is solved from then on.
  subroutine new_newton(context, self)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), target, intent(inout) :: context
    type(newton_type), intent(out) :: self
    PetscErrorCode :: ierr

    self%context => context
    allocate (self%handle)
    self%handle%context => context
    allocate (self%others(0))
    call create(self%handle, self%now, ierr)
    if (ierr /= 0) context%petsc_error = int(ierr)
  end subroutine new_newton

  !> The balance's series has another length, its contacts are the same: objects of lengths that come again are kept. Where PETSc fails,
  !> the context has its error.
  subroutine take_length(self)
    class(newton_type), intent(inout) :: self
    type(objects_type) :: before
    PetscErrorCode :: ierr
    integer :: i

    before = self%now
    if (before%coefficients == self%context%balance%coefficients()) return
    do i = 1, size(self%others)
      if (self%others(i)%coefficients /= self%context%balance%coefficients()) cycle
      self%now = self%others(i)
      self%others(i) = before
      return
    end do
    if (size(self%others) < most_lengths) then
      self%others = [self%others, before]
    else
      call destroy_objects(self%others(self%oldest))
      self%others(self%oldest) = before
      self%oldest = modulo(self%oldest, most_lengths) + 1
    end if
    self%now = objects_type()
    call create(self%handle, self%now, ierr)
    if (ierr /= 0) self%context%petsc_error = int(ierr)
  end subroutine take_length

  subroutine create(handle, self, ierr)
    !> Handle of the context, as PETSc hands it back
    type(context_handle_type), pointer, intent(in) :: handle
    type(objects_type), intent(inout) :: self
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tKSP) :: ksp
    type(tPC) :: pc
    PetscInt :: n

    associate (balance => handle%context%balance)
      self%coefficients = balance%coefficients()
      n = self%coefficients*balance%rows() + size(balance%slider)
      if (balance%ranks%is_root()) n = n + 1
      PetscCall(VecCreateMPI(balance%ranks%handle, n, PETSC_DETERMINE, self%unknowns, ierr))
      PetscCall(VecDuplicate(self%unknowns, self%residual, ierr))
      PetscCall(MatCreateShell(balance%ranks%handle, n, n, PETSC_DETERMINE, PETSC_DETERMINE, handle, self%jacobian, ierr))
      PetscCall(SNESCreate(balance%ranks%handle, self%snes, ierr))
    end associate
    PetscCall(MatShellSetOperation(self%jacobian, MATOP_MULT, multiply, ierr))
    PetscCall(SNESSetType(self%snes, SNESNEWTONLS, ierr))
    PetscCall(SNESSetFunction(self%snes, self%residual, evaluate, handle, ierr))
    PetscCall(SNESSetJacobian(self%snes, self%jacobian, self%jacobian, differentiate, handle, ierr))
    PetscCall(SNESSetDivergenceTolerance(self%snes, never_diverged, ierr))
    PetscCall(SNESSetErrorIfNotConverged(self%snes, PETSC_FALSE, ierr))
    PetscCall(SNESGetKSP(self%snes, ksp, ierr))
    PetscCall(KSPSetType(ksp, KSPPREONLY, ierr))
    PetscCall(KSPGetPC(ksp, pc, ierr))
    PetscCall(PCSetType(pc, PCSHELL, ierr))
    PetscCall(PCShellSetContext(pc, handle, ierr))
    PetscCall(PCShellSetApply(pc, apply_inverse, ierr))
  end subroutine create

  !> Solve from a start; the start is overwritten by the last iterate, converged or not. Where PETSc itself fails, the context has its
  !> error: that is no answer on convergence. Where it has failed before, its objects may be broken, and are not used again.
  subroutine solve(self, unknowns, constraint, controls, report)
    class(newton_type), intent(inout) :: self
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> Constraint on physical motion and omega; it is met exactly by a converged solve
    type(constraint_type), intent(in) :: constraint
    !> How to solve
    type(newton_controls_type), intent(in) :: controls
    !> How the solve ended
    type(newton_report_type), intent(out) :: report
    PetscErrorCode :: ierr

    if (self%context%petsc_error /= 0) return
    self%context%constraint = constraint
    self%context%linear_iterations = 0
    self%context%last_norm = sqrt(huge(1.0_wp))
    self%context%first_stiffening = controls%stiffening
    self%context%stiffening = controls%stiffening
    call run(self, unknowns, controls, report, ierr)
    report%linear_iterations = self%context%linear_iterations
    if (ierr /= 0) then
      report%converged = .false.
      self%context%petsc_error = int(ierr)
    end if
  end subroutine solve

  !> Steps that do not reduce the residual are shortened, unless contacts keep springs.
  subroutine run(self, unknowns, controls, report, ierr)
    class(newton_type), intent(inout) :: self
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> How to solve
    type(newton_controls_type), intent(in) :: controls
    !> How the solve ended
    type(newton_report_type), intent(inout) :: report
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscInt :: iterations, most_iterations
    PetscReal :: norm
    real(wp) :: motion, imbalance
    PetscReal, parameter :: none = 0.0
    SNESLineSearch :: search
    integer :: status

    PetscCall(store(self%context, self%now%unknowns, unknowns, ierr))
    PetscCall(SNESGetLineSearch(self%now%snes, search, ierr))
    if (controls%stiffening <= 0.0_wp) then
      PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHBT, ierr))
    else
      PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHNONE, ierr))
    end if
    most_iterations = controls%max_iterations
    PetscCall(SNESSetTolerances(self%now%snes, controls%tolerance, none, none, most_iterations, 10*most_iterations, ierr))
    PetscCall(SNESSolve(self%now%snes, PETSC_NULL_VEC, self%now%unknowns, ierr))
    PetscCall(SNESGetIterationNumber(self%now%snes, iterations, ierr))
    PetscCall(SNESGetFunctionNorm(self%now%snes, norm, ierr))
    PetscCall(load(self%context, self%now%unknowns, unknowns, ierr))
    motion = sum((unknowns%motion(2:, :)/self%context%motion_scale)**2)
    call self%context%balance%ranks%sum(motion)
    motion = sqrt(motion)
    report%iterations = iterations
    ! The balance keeps forces and Jacobian of the answer, whatever the line search tried last.
    call ensure_evaluated(self%context, unknowns, status)
    ! A body that rounding of the structure's stiffness holds, far enough away, is no answer either.
    imbalance = 0.0_wp
    if (status == 0) imbalance = self%context%balance%imbalance(unknowns%motion(1, :))/self%context%motion_scale
    report%residual = worse_of(real(norm, wp), imbalance)
    report%converged = status == 0 .and. is_converged(report%residual, motion, controls%tolerance)
    if (has_diverged(motion)) report%residual = huge(norm)
  end subroutine run

  !> Unknowns of the balance's size.
  function room(context) result(unknowns)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    type(unknowns_type) :: unknowns

    associate (balance => context%balance)
      unknowns = new_unknowns([balance%coefficients(), balance%rows()], shape(balance%slider))
    end associate
  end function room

  !> SNES: residual of balance, sliders and constraint.
  subroutine evaluate(snes, x, f, handle, ierr)
    !> PETSc's nonlinear solver
    type(tSNES) :: snes
    !> Vector that is multiplied; PETSc vector
    type(tVec) :: x, f
    !> Handle of the context, as PETSc hands it back
    type(context_handle_type) :: handle
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: at, rest
    integer :: i, status

    context => handle%context
    at = room(context)
    rest = room(context)
    PetscCall(load(context, x, at, ierr))
    call ensure_evaluated(context, at, status)
    if (status /= 0) then
      PetscCall(SNESSetFunctionDomainError(snes, ierr))
      return
    end if
    associate (constraint => context%constraint, balance => context%balance)
      rest%motion = balance%residual
      do i = 1, size(balance%forces)
        if (balance%forces(i)%periodic) rest%slider(:, i) = -balance%forces(i)%moved
      end do
      rest%omega = context%frequency_scale &
                   *(inner_product(balance, constraint%motion, at%motion) + constraint%frequency*at%omega - constraint%value)
    end associate
    PetscCall(store(context, f, rest, ierr))
  end subroutine evaluate

  !> Evaluate the balance unless its last evaluation was here.
  subroutine ensure_evaluated(context, at, status)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: at
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    real(wp) :: difference
    integer :: i

    status = 0
    if (context%is_evaluated) then
      difference = 0.0_wp
      if (size(at%motion) > 0) difference = max(maxval(abs(at%motion - context%evaluated%motion)), &
                                                maxval(abs(at%slider - context%evaluated%slider)))
      difference = context%balance%ranks%largest(difference)
      if (difference <= 0.0_wp .and. abs(at%omega - context%evaluated%omega) <= 0.0_wp) return
    end if
    if (.not. abs(at%omega) < huge(at%omega)) then
      status = 1
      return
    end if
    do i = 1, size(at%slider, 2)
      if (context%balance%periodic(i)) context%balance%slider(:, i) = at%slider(:, i)
    end do
    call context%balance%evaluate(at%motion, at%omega, status)
    context%evaluated = at
    context%is_evaluated = status == 0
  end subroutine ensure_evaluated

  !> SNES: the Jacobian is that of the last evaluation; make sure that it was here.
  subroutine differentiate(snes, x, jacobian, preconditioner, handle, ierr)
    !> PETSc's nonlinear solver
    type(tSNES) :: snes
    !> Vector that is multiplied
    type(tVec) :: x
    !> Jacobian, applied without being formed; PETSc matrix
    type(tMat) :: jacobian, preconditioner
    !> Handle of the context, as PETSc hands it back
    type(context_handle_type) :: handle
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: at
    PetscReal :: norm
    integer :: status

    context => handle%context
    at = room(context)
    PetscCall(load(context, x, at, ierr))
    call ensure_evaluated(context, at, status)
    if (status /= 0) then
      PetscCall(SNESSetJacobianDomainError(snes, ierr))
    end if
    PetscCall(SNESGetFunctionNorm(snes, norm, ierr))
    call adapt_stiffening(context, real(norm, wp))
    if (norm <= settling_norm) call settle_sliders(context)
    PetscCall(MatAssemblyBegin(jacobian, MAT_FINAL_ASSEMBLY, ierr))
    PetscCall(MatAssemblyEnd(jacobian, MAT_FINAL_ASSEMBLY, ierr))
  end subroutine differentiate

  !> A periodic slider that can come to rest does so from where it is.
  pure subroutine settle_sliders(context)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context
    integer :: i

    associate (balance => context%balance)
      do i = 1, size(balance%forces)
        if (balance%forces(i)%may_stick) balance%periodic(i) = .false.
      end do
    end associate
  end subroutine settle_sliders

  !> Springs that contacts keep in the step hold what nothing else does. Where the residual stalls they hinder: all contacts give way
  !> together until one of them sticks again, which fewer springs reach sooner. Where it grows that went too far.
  pure subroutine adapt_stiffening(context, norm)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context
    !> Of the residual
    real(wp), intent(in) :: norm
    !> Residual relative to the last from which on its fall counts as stalled, and as growth
    real(wp), parameter :: stalls = 0.5_wp, grows = 1.5_wp ! guess

    if (norm > grows*context%last_norm) then
      context%stiffening = context%first_stiffening
    else if (norm > stalls*context%last_norm) then
      context%stiffening = 0.1_wp*context%stiffening
    end if
    context%last_norm = norm
  end subroutine adapt_stiffening

  !> Shell Jacobian times a vector.
  subroutine multiply(jacobian, x, y, ierr)
    !> Jacobian, applied without being formed
    type(tMat) :: jacobian
    !> Vector that is multiplied; vector that takes the product
    type(tVec) :: x, y
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(context_handle_type), pointer :: handle
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: step, product

    PetscCall(MatShellGetContext(jacobian, handle, ierr))
    context => handle%context
    step = room(context)
    PetscCall(load(context, x, step, ierr))
    if (is_last_step(context, step)) then
      ! The line search asks for this product to learn how steep the descent is: it is known, to the tolerance of the linear solve.
      product = context%right
    else
      product = room(context)
      call apply_linearised(context%balance, context%constraint, step, product)
    end if
    product%omega = context%frequency_scale*product%omega
    PetscCall(store(context, y, product, ierr))
  end subroutine multiply

  !> Is a step the one last solved for? To rounding, since it was scaled in between.
  logical function is_last_step(context, step)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: step
    real(wp) :: differs

    is_last_step = allocated(context%step%motion)
    if (.not. is_last_step) return
    associate (last => context%step)
      differs = merge(0.0_wp, 1.0_wp, close_to(reshape(step%motion, [size(step%motion)]), &
                                               reshape(last%motion, [size(last%motion)])) &
                      .and. close_to(reshape(step%slider, [size(step%slider)]), reshape(last%slider, [size(last%slider)])) &
                      .and. close_to([step%omega], [last%omega]))
    end associate
    is_last_step = context%balance%ranks%largest(differs) <= 0.0_wp
  end function is_last_step

  pure logical function close_to(a, b)
    !> Numbers to compare
    real(wp), intent(in) :: a(:), b(:)

    close_to = size(a) == size(b)
    if (close_to) close_to = all(abs(a - b) <= 4.0_wp*epsilon(1.0_wp)*abs(b))
  end function close_to

  !> Shell preconditioner: the inverse.
  subroutine apply_inverse(pc, x, y, ierr)
    !> Preconditioner
    type(tPC) :: pc
    !> Vector that is multiplied; vector that takes the product
    type(tVec) :: x, y
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(context_handle_type), pointer :: handle
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: right, step
    PetscReal :: longest
    PetscScalar, parameter :: zero = 0.0
    integer :: attempt, iterations, status

    PetscCall(PCShellGetContext(pc, handle, ierr))
    context => handle%context
    right = room(context)
    step = room(context)
    PetscCall(load(context, x, right, ierr))
    right%omega = right%omega/context%frequency_scale
    do attempt = 1, 2
      call solve_linearised(context%balance, context%constraint, right, stiffened(context%linear, context%stiffening), step, &
                            iterations, status, context%preconditioner)
      context%linear_iterations = context%linear_iterations + iterations
      if (status /= 0) step = room(context)
      PetscCall(store(context, y, step, ierr))
      PetscCall(VecNorm(y, NORM_INFINITY, longest, ierr))
      context%step = step
      context%right = right
      if (status == 0 .and. longest <= longest_step) exit
      ! Nearly singular. If nothing helps, no part of this step leads anywhere, and none at all ends the line search at once.
      PetscCall(VecSet(y, zero, ierr))
      deallocate (context%step%motion)
      if (context%stiffening >= least_stiffening) exit
      context%stiffening = least_stiffening
    end do
  end subroutine apply_inverse

  !> Physical unknowns from a scaled vector; omega on every rank.
  subroutine load(context, x, unknowns, ierr)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Vector that is multiplied
    type(tVec) :: x
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    real(wp) :: last(1)
    integer :: i, k, n, width

    PetscCall(VecGetArrayRead(x, values, ierr))
    k = size(unknowns%motion, 1)
    n = size(unknowns%motion)
    width = size(unknowns%slider, 1)
    do i = 1, size(unknowns%motion, 2)
      unknowns%motion(:, i) = context%motion_scale*values((i - 1)*k + 1:i*k)
    end do
    do i = 1, size(unknowns%slider, 2)
      unknowns%slider(:, i) = context%motion_scale*values(n + width*(i - 1) + 1:n + width*i)
    end do
    last = 0.0_wp
    if (context%balance%ranks%is_root()) last = context%frequency_scale*values(size(values))
    PetscCall(VecRestoreArrayRead(x, values, ierr))
    call context%balance%ranks%broadcast(last)
    unknowns%omega = last(1)
  end subroutine load

  !> A scaled vector from physical unknowns.
  subroutine store(context, x, unknowns, ierr)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Vector that is multiplied
    type(tVec) :: x
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: unknowns
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    integer :: i, k, n, width

    PetscCall(VecGetArray(x, values, ierr))
    k = size(unknowns%motion, 1)
    n = size(unknowns%motion)
    width = size(unknowns%slider, 1)
    do i = 1, size(unknowns%motion, 2)
      values((i - 1)*k + 1:i*k) = unknowns%motion(:, i)/context%motion_scale
    end do
    do i = 1, size(unknowns%slider, 2)
      values(n + width*(i - 1) + 1:n + width*i) = unknowns%slider(:, i)/context%motion_scale
    end do
    if (context%balance%ranks%is_root()) values(size(values)) = unknowns%omega/context%frequency_scale
    PetscCall(VecRestoreArray(x, values, ierr))
  end subroutine store

  !> Give PETSc's objects back.
  subroutine destroy(self)
    class(newton_type), intent(inout) :: self
    integer :: i

    call destroy_objects(self%now)
    do i = 1, size(self%others)
      call destroy_objects(self%others(i))
    end do
    deallocate (self%others)
    if (associated(self%handle)) deallocate (self%handle)
  end subroutine destroy

  subroutine destroy_objects(self)
    type(objects_type), intent(inout) :: self
    PetscErrorCode :: ierr

    call SNESDestroy(self%snes, ierr)
    call MatDestroy(self%jacobian, ierr)
    call VecDestroy(self%residual, ierr)
    call VecDestroy(self%unknowns, ierr)
  end subroutine destroy_objects
end module attrito_newton_newton
