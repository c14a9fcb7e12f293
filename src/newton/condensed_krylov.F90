#include <petsc/finclude/petscksp.h>
#include "petsc_compatibility.h"
!> The condensed linear system of a Newton step solved by flexible GMRES, the system applied as a product and preconditioned by the
!> contacts in the mean and their blocks.
!>
!> Spread over ranks as the contacts are; unknowns are y where D is not zero, as it is zero elsewhere, and, the root's last, omega.
!> Source: Saad & Schultz 1986, doi:10.1137/0907058; Saad 1993, doi:10.1137/0914028; Balay et al., PETSc users manual, chapter KSP.
module attrito_newton_condensed_krylov
  use petscksp
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: border_type
  use attrito_newton_condensed_operator, only: condensed_operator_type, new_condensed_operator
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_preconditioner, only: preconditioner_type, new_preconditioner
  use attrito_newton_preconditioners, only: preconditioners_type
  implicit none
  private
  public :: krylov_options_type, solve_by_krylov

  !> Beginning again may cost GMRES more than twice the iterations. It does only if either set of its vectors would have more numbers
  !> than these, and not before it has so many vectors
  PetscInt, parameter :: most_kept = 10000000, fewest_kept = 100 ! conventional

  type :: krylov_options_type
    !> Residual of the linear system, relative to its right-hand side; and what a product may leave out of a mode
    real(wp) :: tolerance = 1.0e-4_wp
    integer :: max_iterations = 300
    !> Unknowns of a block of the preconditioner, beyond which it has one contact alone
    integer :: largest_block = 800
  end type krylov_options_type

  !> A column of the bordered system: D delta d and the step of omega, or what the balance and the constraint ask for
  type :: column_type
    !> [2 H + 1, active rows]
    real(wp), allocatable :: rows(:, :)
    real(wp) :: last = 0.0_wp
  end type column_type

  !> The system with its right-hand side and how it is to be solved; what PETSc's callbacks see
  type :: system_type
    type(condensed_operator_type) :: system
    type(preconditioner_type) :: preconditioner
    !> The balance's part, and sigma - p^T rho
    type(column_type) :: right
    type(krylov_options_type) :: options
  end type system_type

#if PETSC_VERSION_LT(3, 23, 0)
  interface
    subroutine MatCreateShell(comm, local_rows, local_columns, rows, columns, context, matrix, ierr)
      import :: system_type, tMat
      !> MPI communicator
      integer :: comm
      !> Size of this rank's share; size over all ranks
      PetscInt :: local_rows, local_columns, rows, columns
      !> What PETSc's callbacks see
      type(system_type) :: context
      !> PETSc matrix
      type(tMat) :: matrix
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine MatCreateShell
    subroutine MatShellGetContext(matrix, context, ierr)
      import :: system_type, tMat
      !> PETSc matrix
      type(tMat) :: matrix
      !> What PETSc's callbacks see
      type(system_type), pointer :: context
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine MatShellGetContext
    subroutine PCShellSetContext(pc, context, ierr)
      import :: system_type, tPC
      !> Preconditioner
      type(tPC) :: pc
      !> What PETSc's callbacks see
      type(system_type) :: context
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine PCShellSetContext
    subroutine PCShellGetContext(pc, context, ierr)
      import :: system_type, tPC
      !> Preconditioner
      type(tPC) :: pc
      !> What PETSc's callbacks see
      type(system_type), pointer :: context
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine PCShellGetContext
  end interface
#endif

contains

  !> Solve for y and omega; the balance holds the Jacobian of its last evaluation. A step short of its tolerance, with factors just
  !> made, is still the best one known: Newton's line search judges it.
  subroutine solve_by_krylov(balance, border, stiffening, rho, last, options, kept, y, omega, iterations, status)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), target, intent(inout) :: balance
    !> Row and column of the constraint
    type(border_type), intent(in) :: border
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Right-hand side of the balance [2 H + 1, active rows], and sigma - p^T rho
    real(wp), intent(in) :: rho(:, :), last
    !> How to solve
    type(krylov_options_type), intent(in) :: options
    !> What the preconditioner is made of; made again where it does not serve any more
    type(preconditioners_type), target, intent(inout) :: kept
    !> D delta d [2 H + 1, active rows] and step of omega
    real(wp), intent(out) :: y(:, :), omega
    !> Of GMRES
    integer, intent(out) :: iterations
    !> 0, or not: singular
    integer, intent(out) :: status
    type(system_type), target :: context
    type(column_type) :: step
    logical :: converged, is_latest
    integer :: count
    PetscErrorCode :: ierr

    context%system = new_condensed_operator(balance, border, stiffening, options%tolerance)
    context%right = column_type(context%system%multiply_jacobian(rho), last)
    context%options = options
    allocate (step%rows, source=0.0_wp*context%right%rows)
    iterations = 0
    do
      call kept%prepare(balance, stiffening, options%largest_block, is_latest, status)
      if (status /= 0) exit
      context%preconditioner = new_preconditioner(context%system, kept)
      call run(context, min(options%max_iterations, kept%blocks%patience()), step, count, converged, ierr)
      status = merge(0, 1, ierr == 0)
      iterations = iterations + count
      call kept%count(count)
      if (.not. converged) call kept%discard()
      if (converged .or. is_latest .or. status /= 0) exit
    end do
    y = step%rows
    omega = step%last
  end subroutine solve_by_krylov

  !> Create the solver, solve and give everything back.
  subroutine run(context, most, step, iterations, converged, ierr)
    !> What PETSc's callbacks see
    type(system_type), target, intent(inout) :: context
    !> Iterations
    integer, intent(in) :: most
    !> What it has come to
    type(column_type), intent(inout) :: step
    !> Of GMRES
    integer, intent(out) :: iterations
    !> Did the solve converge?
    logical, intent(out) :: converged
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tVec) :: x, b
    type(tMat) :: matrix
    type(tKSP) :: ksp
    type(tPC) :: pc
    PetscInt :: n, count
    PetscInt :: total
    PetscReal :: residual, size_of_right

    iterations = 0
    converged = .false.
    step%rows = 0.0_wp
    step%last = 0.0_wp
    associate (ranks => context%system%balance%ranks)
      n = size(context%system%unknowns)
      if (ranks%is_root()) n = n + 1
      PetscCall(VecCreateMPI(ranks%handle, n, PETSC_DETERMINE, x, ierr))
      PetscCall(VecDuplicate(x, b, ierr))
      PetscCall(MatCreateShell(ranks%handle, n, n, PETSC_DETERMINE, PETSC_DETERMINE, context, matrix, ierr))
      PetscCall(MatShellSetOperation(matrix, MATOP_MULT, multiply, ierr))
      PetscCall(KSPCreate(ranks%handle, ksp, ierr))
    end associate
    PetscCall(KSPSetType(ksp, KSPFGMRES, ierr))
    PetscCall(VecGetSize(x, total, ierr))
    PetscCall(KSPGMRESSetRestart(ksp, min(most, max(fewest_kept, most_kept/total)), ierr))
    PetscCall(KSPSetPCSide(ksp, PC_RIGHT, ierr))
    PetscCall(KSPSetOperators(ksp, matrix, matrix, ierr))
    PetscCall(KSPGetPC(ksp, pc, ierr))
    PetscCall(PCSetType(pc, PCSHELL, ierr))
    PetscCall(PCShellSetContext(pc, context, ierr))
    PetscCall(PCShellSetApply(pc, precondition, ierr))
    PetscCall(KSPSetTolerances(ksp, context%options%tolerance, 0.0_wp, PETSC_DEFAULT_REAL, most, ierr))
    ! The constraint's row has the weight that the system gives it.
    PetscCall(store(context, b, context%right%rows, context%system%weight*context%right%last, ierr))
    PetscCall(KSPSolve(ksp, b, x, ierr))
    PetscCall(KSPGetResidualNorm(ksp, residual, ierr))
    PetscCall(VecNorm(b, NORM_2, size_of_right, ierr))
    PetscCall(KSPGetIterationNumber(ksp, count, ierr))
    PetscCall(load(context, x, step%rows, step%last, ierr))
    PetscCall(KSPDestroy(ksp, ierr))
    PetscCall(MatDestroy(matrix, ierr))
    PetscCall(VecDestroy(x, ierr))
    PetscCall(VecDestroy(b, ierr))
    iterations = count
    converged = residual <= context%options%tolerance*size_of_right
  end subroutine run

  !> The system times a vector.
  subroutine multiply(matrix, x, product, ierr)
    !> PETSc matrix
    type(tMat) :: matrix
    !> Vector that is multiplied; takes the product
    type(tVec) :: x, product
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(system_type), pointer :: context
    real(wp), allocatable :: y(:, :), result(:, :)
    real(wp) :: omega, last

    PetscCall(MatShellGetContext(matrix, context, ierr))
    allocate (y, result, mold=context%system%column)
    PetscCall(load(context, x, y, omega, ierr))
    call context%system%apply(y, omega, result, last)
    PetscCall(store(context, product, result, last, ierr))
  end subroutine multiply

  !> The preconditioner times a vector.
  subroutine precondition(pc, x, product, ierr)
    !> Preconditioner
    type(tPC) :: pc
    !> Vector that is multiplied; takes the product
    type(tVec) :: x, product
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(system_type), pointer :: context
    real(wp), allocatable :: residual(:, :), y(:, :)
    real(wp) :: last, omega

    PetscCall(PCShellGetContext(pc, context, ierr))
    allocate (residual, y, mold=context%system%column)
    PetscCall(load(context, x, residual, last, ierr))
    call context%preconditioner%apply(residual, last, y, omega)
    PetscCall(store(context, product, y, omega, ierr))
  end subroutine precondition

  !> Field and scalar from a vector; the scalar on every rank.
  subroutine load(context, x, field, scalar, ierr)
    !> What PETSc's callbacks see
    type(system_type), intent(in) :: context
    !> Vector that is multiplied
    type(tVec) :: x
    !> Vector over the rows of contacts
    real(wp), intent(out), contiguous, target :: field(:, :)
    !> Scalar that belongs to the constraint
    real(wp), intent(out) :: scalar
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    real(wp), pointer :: flat(:)
    real(wp) :: last(1)

    PetscCall(VecGetArrayRead(x, values, ierr))
    field = 0.0_wp
    flat(1:size(field)) => field
    associate (unknowns => context%system%unknowns)
      flat(unknowns) = values(:size(unknowns))
    end associate
    last = 0.0_wp
    if (context%system%balance%ranks%is_root()) last = values(size(values))
    PetscCall(VecRestoreArrayRead(x, values, ierr))
    call context%system%balance%ranks%broadcast(last)
    scalar = last(1)
  end subroutine load

  !> A vector from field and scalar.
  subroutine store(context, x, field, scalar, ierr)
    !> What PETSc's callbacks see
    type(system_type), intent(in) :: context
    !> Vector that is multiplied
    type(tVec) :: x
    !> Vector over the rows of contacts
    real(wp), intent(in), contiguous, target :: field(:, :)
    !> Scalar that belongs to the constraint
    real(wp), intent(in) :: scalar
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    real(wp), pointer :: flat(:)

    PetscCall(VecGetArray(x, values, ierr))
    flat(1:size(field)) => field
    associate (unknowns => context%system%unknowns)
      values(:size(unknowns)) = flat(unknowns)
    end associate
    if (context%system%balance%ranks%is_root()) values(size(values)) = scalar
    PetscCall(VecRestoreArray(x, values, ierr))
  end subroutine store
end module attrito_newton_condensed_krylov
