#include <petsc/finclude/petscksp.h>
#include "petsc_compatibility.h"
!> The condensed linear system of a Newton step solved by flexible GMRES, the system applied as a product and preconditioned by the
!> tangent reference, by contacts in the mean or on two levels.
!>
!> Spread over ranks as the contacts are; unknowns are y where D is not zero, as it is zero elsewhere, and, the root's last, omega.
!> Source: Saad & Schultz 1986, doi:10.1137/0907058; Saad 1993, doi:10.1137/0914028; Balay et al., PETSc users manual, chapter KSP.
module attrito_newton_condensed_krylov
  use petscksp
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: border_type
  use attrito_newton_kept_factors, only: kept_factors_type
  use attrito_newton_condensed_operator, only: condensed_operator_type, new_condensed_operator
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_mean_preconditioner, only: new_mean_preconditioner
  use attrito_newton_preconditioner, only: preconditioner_type
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_newton_tangent_preconditioner, only: new_tangent_preconditioner
  use attrito_newton_two_level, only: new_two_level
  implicit none
  private
  public :: krylov_options_type, solve_by_krylov

  !> Iterations of GMRES on two levels from which on contacts in the mean precondition the steps: these take 30 to 90 where two levels
  !> take 300 and more
  real(wp), parameter :: too_many = 120.0_wp ! measured

  type :: krylov_options_type
    !> Residual of the linear system, relative to its right-hand side; and what a product may leave out of a mode
    real(wp) :: tolerance = 1.0e-4_wp
    !> Motions in the coarse system
    integer :: coarse_motions = 32
    integer :: max_iterations = 300
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
    class(preconditioner_type), allocatable :: preconditioner
    !> The balance's part, and sigma - p^T rho
    type(column_type) :: right
    type(krylov_options_type) :: options
  end type system_type

  !> What the solves of a system have come to
  type :: outcome_type
    type(column_type) :: step
    !> Of GMRES, in all
    integer :: iterations = 0
    logical :: converged = .false.
    !> 0, or not: singular, or PETSc has failed
    integer :: status = 0
  end type outcome_type

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

  !> Solve for y and omega; the balance holds the Jacobian of its last evaluation.
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
    !> What preconditioners are made of; made anew where it does not serve any more
    type(preconditioners_type), target, intent(inout) :: kept
    !> D delta d [2 H + 1, active rows] and step of omega
    real(wp), intent(out) :: y(:, :), omega
    !> Of GMRES
    integer, intent(out) :: iterations
    !> 0, or not: singular
    integer, intent(out) :: status
    type(system_type), target :: context
    type(outcome_type) :: outcome
    logical :: serves

    context%system = new_condensed_operator(balance, border, stiffening, options%tolerance)
    context%right = column_type(context%system%multiply_jacobian(rho), last)
    context%options = options
    allocate (outcome%step%rows, mold=context%right%rows)
    outcome%step%rows = 0.0_wp
    call kept%reference%prepare(balance, stiffening, nint(min(kept%two_level_iterations, too_many)), serves)
    if (serves) call solve_by_tangent(context, kept, outcome)
    if (serves .and. .not. is_final(outcome)) call kept%reference%forget()
    serves = .false.
    if (kept%two_level_iterations > too_many .and. .not. is_final(outcome)) then
      call solve_by_mean(context, stiffening, kept, outcome, serves)
    end if
    if (.not. (serves .or. is_final(outcome))) call solve_on_two_levels(context, stiffening, kept, outcome)
    y = outcome%step%rows
    omega = outcome%step%last
    iterations = outcome%iterations
    status = outcome%status
  end subroutine solve_by_krylov

  !> Did it converge, or fail for good? A step short of its tolerance, with factors just made, is still the best one known: Newton's
  !> line search judges it.
  pure logical function is_final(outcome)
    !> Of a solve
    type(outcome_type), intent(in) :: outcome

    is_final = outcome%converged .or. outcome%status /= 0
  end function is_final

  !> Preconditioned by the tangent reference, which has been made ready.
  subroutine solve_by_tangent(context, kept, outcome)
    !> What PETSc's callbacks see
    type(system_type), target, intent(inout) :: context
    !> What preconditioners are made of
    type(preconditioners_type), target, intent(inout) :: kept
    !> Step, iterations and how it ended
    type(outcome_type), intent(inout) :: outcome
    logical :: anew
    integer :: status

    do
      anew = .not. kept%left_over%serve(context%system%balance)
      if (anew) then
        call kept%left_over%make(context%system%balance, kept%reference, status)
        associate (balance => context%system%balance)
          balance%work = balance%work + kept%left_over%flops/balance%ranks%ranks
        end associate
        ! Two levels may do, or say that it is singular.
        if (status /= 0) return
      end if
      call new_tangent_preconditioner(context%system, kept%reference, kept%left_over, context%preconditioner)
      call run_with(kept%left_over, context, outcome)
      if (anew .or. is_final(outcome)) return
    end do
  end subroutine solve_by_tangent

  !> Preconditioned by contacts in the mean, if they are known to have lost springs.
  subroutine solve_by_mean(context, stiffening, kept, outcome, serves)
    !> What PETSc's callbacks see
    type(system_type), target, intent(inout) :: context
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> What preconditioners are made of
    type(preconditioners_type), target, intent(inout) :: kept
    !> Step, iterations and how it ended
    type(outcome_type), intent(inout) :: outcome
    !> Do they serve?
    logical, intent(out) :: serves
    logical :: is_latest

    do
      call kept%mean%serve(context%system%balance, stiffening, serves, is_latest)
      if (.not. serves) return
      associate (balance => context%system%balance)
        balance%work = balance%work + kept%mean%flops/balance%ranks%ranks
      end associate
      call new_mean_preconditioner(context%system, kept%mean, context%preconditioner)
      call run_with(kept%mean, context, outcome)
      if (is_latest .or. is_final(outcome)) return
    end do
  end subroutine solve_by_mean

  !> Preconditioned on two levels.
  subroutine solve_on_two_levels(context, stiffening, kept, outcome)
    !> What PETSc's callbacks see
    type(system_type), target, intent(inout) :: context
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> What preconditioners are made of
    type(preconditioners_type), target, intent(inout) :: kept
    !> Step, iterations and how it ended
    type(outcome_type), intent(inout) :: outcome
    integer :: count
    logical :: anew

    do
      anew = .not. kept%two_level%serve(context%system%balance, stiffening)
      if (anew) call kept%two_level%make(context%system%balance, context%options%coarse_motions, stiffening, outcome%status)
      if (outcome%status /= 0) return
      call new_two_level(context%system, kept%two_level, context%preconditioner)
      call run_with(kept%two_level, context, outcome, count)
      if (anew) kept%two_level_iterations = count
      if (anew .or. is_final(outcome)) return
    end do
  end subroutine solve_on_two_levels

  !> Solve with a preconditioner made of factors, for as long as they are worth it; those that do not serve are not used again.
  subroutine run_with(factors, context, outcome, iterations)
    !> Factors that the preconditioner is made of
    class(kept_factors_type), intent(inout) :: factors
    !> What PETSc's callbacks see
    type(system_type), target, intent(inout) :: context
    !> Step, iterations, which are added to, and how it ended
    type(outcome_type), intent(inout) :: outcome
    !> Of this solve
    integer, optional, intent(out) :: iterations
    integer :: count
    PetscErrorCode :: ierr

    call run(context, min(context%options%max_iterations, factors%patience()), outcome%step, count, outcome%converged, ierr)
    outcome%status = merge(0, 1, ierr == 0)
    outcome%iterations = outcome%iterations + count
    if (present(iterations)) iterations = count
    call factors%count(count)
    if (.not. outcome%converged) call factors%discard()
  end subroutine run_with

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
    !> Vectors that GMRES keeps: memory
    PetscInt, parameter :: longest_restart = 100 ! conventional
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
    PetscCall(KSPGMRESSetRestart(ksp, min(most, longest_restart), ierr))
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
