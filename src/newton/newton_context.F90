#include <petsc/finclude/petscksp.h>
!> What PETSc's callbacks of the Newton solver see, and the interfaces that hand it through.
module attrito_newton_newton_context
  use petscksp
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: constraint_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: linear_options_type
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_balance_unknowns, only: unknowns_type
  implicit none
  private
  public :: newton_context_type, context_handle_type, least_stiffening
#if PETSC_VERSION_LT(3, 23, 0)
  public :: MatCreateShell, MatShellGetContext, PCShellSetContext, PCShellGetContext
#endif

  !> Part of their springs that contacts keep in a step that else were singular: where all of them slip and nothing else holds a body,
  !> its mean position is free, and stays where it was.
  real(wp), parameter :: least_stiffening = 1.0e-7_wp ! guess

  type :: newton_context_type
    type(balance_type) :: balance
    !> The equation that picks the point
    type(constraint_type) :: constraint
    !> Length and angular frequency that make unknowns and residual of order one
    real(wp) :: motion_scale = 1.0_wp, frequency_scale = 1.0_wp
    !> Norm of the scaled residual that counts as converged in this range of frequency
    real(wp) :: tolerance = 1.0e-10_wp
    type(linear_options_type) :: linear
    !> Of GMRES, from one step to the next
    type(preconditioners_type) :: preconditioner
    !> PETSc's code of an error in a solve that it could not carry out; 0: none so far
    integer :: petsc_error = 0
    !> Iterations of GMRES since the solve began
    integer :: linear_iterations = 0
    !> Part of their springs that contacts keep at first, and now; norm of the residual at the last Jacobian
    real(wp) :: first_stiffening = 0.0_wp, stiffening = 0.0_wp, last_norm = 0.0_wp
    !> Steps in a row that hardly reduced the residual, and those that end a solve
    integer :: stalled = 0, most_stalled = huge(1)
    !> Operations of all ranks beyond which no further step is made
    real(wp) :: most_work = huge(1.0_wp)
    !> The last step that was solved for, and the right-hand side that it answers
    type(unknowns_type) :: step, right
    !> Where the balance was last evaluated
    type(unknowns_type) :: evaluated
    logical :: is_evaluated = .false.
  contains
    procedure :: forget
    procedure :: gives_up
    procedure :: is_spent
  end type newton_context_type

  !> What PETSc is given and hands back: it takes no type that has procedures of its own
  type :: context_handle_type
    type(newton_context_type), pointer :: context => null()
  end type context_handle_type

#if PETSC_VERSION_LT(3, 23, 0)
  interface
    subroutine MatCreateShell(comm, local_rows, local_columns, rows, columns, context, matrix, ierr)
      import :: context_handle_type, tMat
      !> MPI communicator
      integer :: comm
      !> Size of this rank's share; size over all ranks
      PetscInt :: local_rows, local_columns, rows, columns
      !> Handle of the context, as PETSc hands it back
      type(context_handle_type) :: context
      !> PETSc matrix
      type(tMat) :: matrix
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine MatCreateShell
    subroutine MatShellGetContext(matrix, context, ierr)
      import :: context_handle_type, tMat
      !> PETSc matrix
      type(tMat) :: matrix
      !> Handle of the context, as PETSc hands it back
      type(context_handle_type), pointer :: context
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine MatShellGetContext
    subroutine PCShellSetContext(pc, context, ierr)
      import :: context_handle_type, tPC
      !> Preconditioner
      type(tPC) :: pc
      !> Handle of the context, as PETSc hands it back
      type(context_handle_type) :: context
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine PCShellSetContext
    subroutine PCShellGetContext(pc, context, ierr)
      import :: context_handle_type, tPC
      !> Preconditioner
      type(tPC) :: pc
      !> Handle of the context, as PETSc hands it back
      type(context_handle_type), pointer :: context
      !> PETSc's error code
      PetscErrorCode :: ierr
    end subroutine PCShellGetContext
  end interface
#endif

contains

  !> Loads, sliders or scales have changed: what was evaluated no longer holds.
  pure subroutine forget(self)
    class(newton_context_type), intent(inout) :: self

    self%is_evaluated = .false.
  end subroutine forget

  !> Is a solve to end without an answer?
  logical function gives_up(self)
    class(newton_context_type), intent(in) :: self

    gives_up = self%stalled >= self%most_stalled
    if (.not. gives_up) gives_up = self%is_spent()
  end function gives_up

  !> Have solves taken the operations that they were given?
  logical function is_spent(self)
    class(newton_context_type), intent(in) :: self
    real(wp) :: work

    is_spent = .false.
    if (.not. self%most_work < huge(1.0_wp)) return
    work = self%balance%work
    call self%balance%ranks%sum(work)
    is_spent = work > self%most_work
  end function is_spent
end module attrito_newton_newton_context
