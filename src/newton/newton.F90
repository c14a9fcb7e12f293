#include <petsc/finclude/petscsnes.h>
#include "petsc_compatibility.h"
!> Newton's method on the bordered balance, by PETSc SNES: unknowns are the contacts' motion, periodic sliders and omega; equations are
!> the balance, w = P(w, d), and the constraint that picks the point (a frequency, or a plane across the branch).
!>
!> Unknowns are scaled (`attrito_newton_scaled_vectors`). The Jacobian is a shell, its inverse the condensed system
!> (`attrito_newton_snes_callbacks`), so SNES's own linear solver only applies it. Backtracking guards the step.
!> Source: Balay et al., PETSc users manual, chapter SNES.
module attrito_newton_newton
  use petscsnes
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_newton_convergence, only: has_diverged, is_converged, worse_of
  use attrito_newton_newton_context, only: context_handle_type, newton_context_type
#if PETSC_VERSION_LT(3, 23, 0)
  use attrito_newton_newton_context, only: MatCreateShell, PCShellSetContext
#endif
  use attrito_newton_scaled_vectors, only: load, store, size_on_rank
  use attrito_newton_snes_callbacks, only: evaluate, ensure_evaluated, differentiate, multiply, apply_inverse
  use attrito_balance_unknowns, only: unknowns_type
  implicit none
  private
  public :: newton_type, newton_controls_type, newton_report_type, new_newton

  !> Growth of the residual that no solve comes to
  real(wp), parameter :: never_diverged = 1.0e100_wp ! conventional

  !> Tolerance below which as many digits of the motion are wanted as there are; and its error over the residual near a peak
  real(wp), parameter :: all_digits = 1.0e-12_wp, amplification = 100.0_wp ! measured

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
    !> Steps in a row that hardly reduce the residual before it is given up
    integer :: most_stalled = huge(1)
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
      n = size_on_rank(handle%context)
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
    if (self%context%is_spent()) return
    self%context%constraint = constraint
    self%context%linear_iterations = 0
    self%context%last_norm = sqrt(huge(1.0_wp))
    self%context%first_stiffening = controls%stiffening
    self%context%stiffening = controls%stiffening
    self%context%stalled = 0
    self%context%most_stalled = controls%most_stalled
    call run(self, unknowns, controls, report, ierr)
    report%linear_iterations = self%context%linear_iterations
    if (ierr /= 0) then
      report%converged = .false.
      self%context%petsc_error = int(ierr)
    end if
  end subroutine solve

  !> Steps that do not reduce the residual are shortened, unless contacts keep springs.
  !>
  !> A residual r leaves the error J^-1 r in the motion, hundreds of times as large near a peak. Whoever asks for a residual next to
  !> rounding wants the digits of the motion: where the last step did not end far below the tolerance, there is one more.
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
    PetscInt :: iterations, most_iterations, more
    PetscReal :: norm
    real(wp) :: motion, imbalance
    PetscReal, parameter :: none = 0.0
    PetscInt, parameter :: one = 1
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
    if (controls%tolerance < all_digits .and. norm <= controls%tolerance .and. norm > controls%tolerance/amplification) then
      PetscCall(SNESLineSearchSetType(search, SNESLINESEARCHBT, ierr))
      PetscCall(SNESSetTolerances(self%now%snes, none, none, none, one, 10*one, ierr))
      PetscCall(SNESSolve(self%now%snes, PETSC_NULL_VEC, self%now%unknowns, ierr))
      PetscCall(SNESGetIterationNumber(self%now%snes, more, ierr))
      PetscCall(SNESGetFunctionNorm(self%now%snes, norm, ierr))
      iterations = iterations + more
    end if
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
