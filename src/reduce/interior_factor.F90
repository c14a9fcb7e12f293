#include <petsc/finclude/petscksp.h>
#include "petsc_compatibility.h"
!> LDL^T factors of an interior matrix by MUMPS, used for every solve with it, and the signs of its pivots.
!>
!> $$ A = L D L^T, \qquad \text{number of negative pivots of } D = \text{number of negative eigenvalues of } A $$
!>
!> (Sylvester's law of inertia.) The analysis estimates what the factors will need before anything is factored: where memory is short
!> of that they go to disk, and where it is short of even that nothing is begun.
!> Source: Amestoy, Duff, L'Excellent, Koster, SIAM J. Matrix Anal. Appl. 23 (2001) 15-41, doi:10.1137/S0895479899358194.
module attrito_reduce_interior_factor
  use mpi, only: MPI_ALLREDUCE, MPI_COMM_FREE, MPI_COMM_SPLIT_TYPE, MPI_COMM_TYPE_SHARED, MPI_DOUBLE_PRECISION, MPI_IN_PLACE, &
    MPI_INFO_NULL, MPI_MAX, MPI_SUM, MPI_WTIME
  use petscksp
  use attrito_core_errors, only: error_type, failure_of_files, raise
  use attrito_core_kinds, only: wp
  use attrito_core_machine_memory, only: free_megabytes
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_dense_block, only: wrap_block
  use attrito_reduce_progress, only: progress_type
  implicit none
  private
  public :: factor_options_type, interior_factor_type, new_interior_factor
  public :: known_orderings

  !> How to factor
  type :: factor_options_type
    !> One of `known_orderings`
    character(8) :: ordering = 'scotch'
    !> Factors on disk: `yes`, `no`, or `auto` where memory is short
    character(4) :: out_of_core = 'auto'
    !> Memory that the ranks of a machine may take together in megabytes; 0: what is free
    real(wp) :: memory_megabytes = 0.0_wp
    !> Memory that this rank will need beside the factors, in megabytes
    real(wp) :: beside_megabytes = 0.0_wp
  end type factor_options_type

  type :: interior_factor_type
    !> Owns the factors
    type(tKSP) :: solver
    !> The matrix and its factors, borrowed
    type(tMat) :: matrix, factor
    !> Number of negative and of zero pivots
    integer :: negative = 0, zero = 0
    !> Memory of all ranks while factoring in megabytes, as MUMPS foresaw it: in core, and with the factors on disk
    integer :: megabytes = 0, megabytes_out_of_core = 0
    !> Did the factors go to disk?
    logical :: out_of_core = .false.
    !> Operations of the factorisation, and numbers in the factors, as foreseen
    real(wp) :: flops = 0.0_wp, entries = 0.0_wp
    !> Wall time of the analysis
    real(wp) :: analysis_seconds = 0.0_wp
    !> Who ordered the rows
    character(8) :: ordering = ''
  contains
    procedure :: solve => solve_block
    procedure :: solve_sparse
    procedure :: destroy
  end type interior_factor_type

  !> What MUMPS calls the orderings, by position from 0
  character(8), parameter :: known_orderings(0:6) = [character(8) :: 'amd', '', 'amf', 'scotch', 'pord', 'metis', 'qamd']

  !> MUMPS's numbers (users' guide 5.5): control and information by position
  character(*), parameter :: ordering_option = '-mat_mumps_icntl_7'
  integer, parameter :: icntl_root = 13, icntl_room = 14, icntl_out_of_core = 22, icntl_null_pivots = 24, &
                        icntl_block = 27
  integer, parameter :: info_in_core = 15, info_out_of_core = 17
  integer, parameter :: infog_status = 1, infog_detail = 2, infog_entries = 3, infog_ordering = 7, infog_negative = 12, &
                        infog_in_core = 17, infog_out_of_core = 27, infog_zero = 28, rinfog_flops = 1
  !> Right-hand sides that MUMPS solves at a time; room for pivoting, in percent
  integer, parameter :: solve_block_size = 128, room = 30 ! conventional
  !> Part of the free memory that is left to others
  real(wp), parameter :: margin = 0.05_wp ! guess

contains

  !> Factor a symmetric matrix, which must outlive its factors.
  subroutine new_interior_factor(self, matrix, options, progress, error)
    !> The factors
    type(interior_factor_type), intent(out) :: self
    !> Symmetric, definite or not
    type(tMat), intent(in) :: matrix
    !> Ordering, and where the factors may go
    type(factor_options_type), intent(in) :: options
    !> Receives what the analysis foresees
    type(progress_type), intent(in) :: progress
    !> Memory is too short
    type(error_type), allocatable, intent(out) :: error
    PetscErrorCode :: ierr

    self%matrix = matrix
    call create(self, ierr)
    if (ierr == 0) call analyse(self, options%ordering, ierr)
    call check(self, ierr, error)
    if (.not. allocated(error)) call choose_place(self, options, progress, error)
    if (allocated(error)) return
    call KSPSetUp(self%solver, ierr)
    ! A user of the solver (SLEPc) may hand it the same matrix again; the factors stay.
    if (ierr == 0) call KSPSetReusePreconditioner(self%solver, PETSC_TRUE, ierr)
    call check(self, ierr, error)
    if (allocated(error)) return
    call MatMumpsGetInfog(self%factor, infog_negative, self%negative, ierr)
    call MatMumpsGetInfog(self%factor, infog_zero, self%zero, ierr)
  end subroutine new_interior_factor

  subroutine create(self, ierr)
    type(interior_factor_type), intent(inout) :: self
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tPC) :: preconditioner
    PetscMPIInt :: comm

    PetscCall(PetscObjectGetComm(self%matrix, comm, ierr))
    PetscCall(KSPCreate(comm, self%solver, ierr))
    PetscCall(KSPSetType(self%solver, KSPPREONLY, ierr))
    PetscCall(KSPSetOperators(self%solver, self%matrix, self%matrix, ierr))
    PetscCall(KSPGetPC(self%solver, preconditioner, ierr))
    PetscCall(PCSetType(preconditioner, PCCHOLESKY, ierr))
    PetscCall(PCFactorSetMatSolverType(preconditioner, MATSOLVERMUMPS, ierr))
    PetscCall(PCFactorSetUpMatSolverType(preconditioner, ierr))
    PetscCall(PCFactorGetMatrix(preconditioner, self%factor, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_room, room, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_block, solve_block_size, ierr))
    ! Counting pivots right needs null pivot detection, and a root front that is not left to ScaLAPACK.
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_null_pivots, 1, ierr))
    PetscCall(MatMumpsSetIcntl(self%factor, icntl_root, 1, ierr))
  end subroutine create

  !> Order the rows and foresee operations and memory; the set-up of the solver finds this done.
  subroutine analyse(self, wanted, ierr)
    type(interior_factor_type), intent(inout) :: self
    !> Who shall order the rows
    character(*), intent(in) :: wanted
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    FACTOR_INFO(info)
    PetscInt :: ordering, entries

    self%analysis_seconds = -MPI_WTIME()
    PetscCall(MatFactorInfoInitialize(info, ierr))
    PetscCall(ask_for_ordering(wanted, ierr))
    PetscCall(MatCholeskyFactorSymbolic(self%factor, self%matrix, PETSC_NULL_IS, info, ierr))
    PetscCall(PetscOptionsClearValue(PETSC_NULL_OPTIONS, ordering_option, ierr))
    self%analysis_seconds = self%analysis_seconds + MPI_WTIME()
    PetscCall(MatMumpsGetInfog(self%factor, infog_ordering, ordering, ierr))
    PetscCall(MatMumpsGetInfog(self%factor, infog_in_core, self%megabytes, ierr))
    PetscCall(MatMumpsGetInfog(self%factor, infog_out_of_core, self%megabytes_out_of_core, ierr))
    PetscCall(MatMumpsGetInfog(self%factor, infog_entries, entries, ierr))
    PetscCall(MatMumpsGetRinfog(self%factor, rinfog_flops, self%flops, ierr))
    ! Beyond what an integer holds MUMPS returns minus the millions.
    self%entries = merge(real(entries, wp), -1.0e6_wp*entries, entries >= 0)
    self%ordering = 'OTHER'
    if (ordering >= 0 .and. ordering <= ubound(known_orderings, 1)) self%ordering = upper(known_orderings(ordering))
  end subroutine analyse

  !> By the options database: PETSc 3.18 forgets an ordering that is set otherwise.
  subroutine ask_for_ordering(wanted, ierr)
    !> How many modes are to be kept
    character(*), intent(in) :: wanted
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    character(4) :: number

    write (number, '(i0)') findloc(known_orderings, wanted, 1) - 1
    PetscCall(PetscOptionsSetValue(PETSC_NULL_OPTIONS, ordering_option, number, ierr))
  end subroutine ask_for_ordering

  !> In core, on disk, or not at all, by the memory that each machine has free for its ranks.
  subroutine choose_place(self, options, progress, error)
    type(interior_factor_type), intent(inout) :: self
    !> How to factor
    type(factor_options_type), intent(in) :: options
    !> Reports progress
    type(progress_type), intent(in) :: progress
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: needs(3), short(2), free
    character(240) :: text
    PetscErrorCode :: ierr

    call machine_needs(self, options, needs, free, ierr)
    call raise_petsc(error, ierr, 'asking what the factors need')
    if (allocated(error)) return
    short = needs(:2) + needs(3) - (1.0_wp - margin)*free
    call largest_everywhere(self, short, ierr)
    self%out_of_core = options%out_of_core == 'yes' .or. (options%out_of_core == 'auto' .and. short(1) > 0.0_wp)
    write (text, '(2a, es8.1, a, 4(i0, a))') trim(self%ordering), ': factors of', self%entries, ' numbers need ', &
      self%megabytes, ' MB in core, ', self%megabytes_out_of_core, ' MB if they go to disk, beside ', nint(needs(3)), &
      ' MB for vectors; free ', nint(free), ' MB'
    call progress%say(trim(text)//trim(merge(': on disk', ': in core', self%out_of_core)))
    if (short(merge(2, 1, self%out_of_core)) > 0.0_wp .and. options%out_of_core /= 'no') then
      call raise(error, 'memory is too short for the reduction even with the factors on disk ('//trim(text)// &
                 '): use more machines, or a coarser mesh')
    end if
    if (self%out_of_core) call MatMumpsSetIcntl(self%factor, icntl_out_of_core, 1, ierr)
  end subroutine choose_place

  !> What the ranks of this machine need together: factors in core, factors on disk, and beside them; and what is free.
  subroutine machine_needs(self, options, needs, free, ierr)
    type(interior_factor_type), intent(in) :: self
    !> How to factor
    type(factor_options_type), intent(in) :: options
    real(wp), intent(out) :: needs(3), free
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscMPIInt :: comm, machine
    PetscInt :: in_core, out_of_core

    PetscCall(PetscObjectGetComm(self%matrix, comm, ierr))
    PetscCall(MatMumpsGetInfo(self%factor, info_in_core, in_core, ierr))
    PetscCall(MatMumpsGetInfo(self%factor, info_out_of_core, out_of_core, ierr))
    needs = [real(in_core, wp), real(out_of_core, wp), options%beside_megabytes]
    free = free_megabytes()
    if (options%memory_megabytes > 0.0_wp) free = min(free, options%memory_megabytes)
    call MPI_COMM_SPLIT_TYPE(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, machine, ierr)
    call MPI_ALLREDUCE(MPI_IN_PLACE, needs, size(needs), MPI_DOUBLE_PRECISION, MPI_SUM, machine, ierr)
    call MPI_COMM_FREE(machine, ierr)
  end subroutine machine_needs

  subroutine largest_everywhere(self, x, ierr)
    type(interior_factor_type), intent(in) :: self
    !> Columns, this rank's rows
    real(wp), intent(inout) :: x(:)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscMPIInt :: comm

    PetscCall(PetscObjectGetComm(self%matrix, comm, ierr))
    call MPI_ALLREDUCE(MPI_IN_PLACE, x, size(x), MPI_DOUBLE_PRECISION, MPI_MAX, comm, ierr)
  end subroutine largest_everywhere

  !> What PETSc or MUMPS found wrong.
  subroutine check(self, ierr, error)
    type(interior_factor_type), intent(in) :: self
    !> PETSc's error code
    PetscErrorCode, intent(in) :: ierr
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    PetscInt :: status, detail
    PetscErrorCode :: asked

    call raise_petsc(error, ierr, 'factoring the interior stiffness')
    if (allocated(error)) return
    call MatMumpsGetInfog(self%factor, infog_status, status, asked)
    call MatMumpsGetInfog(self%factor, infog_detail, detail, asked)
    if (status < 0) call raise_mumps(status, detail, error)
  end subroutine check

  !> What MUMPS complains of, in words.
  pure subroutine raise_mumps(status, detail, error)
    integer, intent(in) :: status, detail
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    character(40) :: code

    write (code, '(a, i0, a, i0, a)') '(MUMPS error ', status, ', ', detail, ')'
    select case (status)
     case (-13, -19)
      call raise(error, 'not enough memory for the factors of the interior stiffness ' // trim(code) // &
                 ': use more nodes, or a coarser mesh')
     case (-90)
      call raise(error, 'the factors cannot be written to disk '//trim(code)//': make room in MUMPS_OOC_TMPDIR (or /tmp)', &
                 failure_of_files)
     case (-8, -9, -11, -14)
      call raise(error, 'the factors need more room than MUMPS foresaw ' // trim(code) // ': run on other numbers of ranks')
     case default
      call raise(error, 'the interior stiffness cannot be factored ' // trim(code))
    end select
  end subroutine raise_mumps

  pure function upper(word)
    character(*), intent(in) :: word
    character(len(word)) :: upper
    integer :: i

    do i = 1, len(word)
      upper(i:i) = word(i:i)
      if (word(i:i) >= 'a' .and. word(i:i) <= 'z') upper(i:i) = achar(iachar(word(i:i)) - 32)
    end do
  end function upper

  !> Solve for a block of dense right-hand sides.
  subroutine solve_block(self, right_hand_sides, solutions, ierr)
    !> The factors
    class(interior_factor_type), intent(in) :: self
    !> This rank's interior rows
    real(wp), intent(in), contiguous, target :: right_hand_sides(:, :)
    !> This rank's interior rows
    real(wp), intent(out), contiguous, target :: solutions(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: b, x

    ierr = 0
    if (size(solutions, 2) == 0) return
    PetscCall(wrap_block(self%matrix, right_hand_sides, b, ierr))
    PetscCall(wrap_block(self%matrix, solutions, x, ierr))
    PetscCall(MatMatSolve(self%factor, b, x, ierr))
    PetscCall(MatDestroy(x, ierr))
    PetscCall(MatDestroy(b, ierr))
  end subroutine solve_block

  !> Solve for sparse right-hand sides, given as the rows of a matrix that rank 0 holds.
  subroutine solve_sparse(self, rows, solutions, ierr)
    !> The factors
    class(interior_factor_type), intent(in) :: self
    !> [right-hand sides, interior dofs], all on rank 0
    type(tMat), intent(in) :: rows
    !> This rank's interior rows of the solutions
    real(wp), intent(out), contiguous, target :: solutions(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    type(tMat) :: b, x

    PetscCall(MatCreateTranspose(rows, b, ierr))
    PetscCall(wrap_block(self%matrix, solutions, x, ierr))
    PetscCall(MatMatSolve(self%factor, b, x, ierr))
    PetscCall(MatDestroy(x, ierr))
    PetscCall(MatDestroy(b, ierr))
  end subroutine solve_sparse

  !> Release the factors; released ones, or none, do no harm.
  subroutine destroy(self)
    !> The factors
    class(interior_factor_type), intent(inout) :: self
    PetscErrorCode :: ierr

    call KSPDestroy(self%solver, ierr)
  end subroutine destroy
end module attrito_reduce_interior_factor
