#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> What the steps of a reduction share: the split, the blocks of the matrices while they are needed, loads, and the steps' clock.
!>
!> Matrices come from model.h5 when a step needs them and go when it is done, so that beside the factors there is little.
module attrito_reduce_workspace
  use mpi, only: MPI_WTIME
  use petscmat
  use attrito_core_communicator, only: communicator_type, new_communicator
  use attrito_core_errors, only: error_type, fault_of_input, raise
  use attrito_core_hdf5_dataset, only: array_shape
  use attrito_core_hdf5_file, only: close_file, exists_in_file, hdf5_file_type, open_file
  use attrito_core_kinds, only: wp
  use attrito_core_machine_memory, only: peak_megabytes, reset_peak, return_memory
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_column_store, only: block_type, column_store_type, new_blocks
  use attrito_reduce_constraint_modes, only: interior_stiffness_type
  use attrito_reduce_definiteness, only: check_definite, get_diagonal
  use attrito_reduce_fixed_interface_modes, only: mode_blocks
  use attrito_reduce_interior_factor, only: factor_options_type, interior_factor_type, new_interior_factor
  use attrito_reduce_model_matrix, only: read_model_matrix
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_report, only: reduction_options_type, reduction_report_type, step_factor, step_read
  use attrito_reduce_split, only: boundary_columns, boundary_rows_on_root, coupling_block, interior_block, new_split, split_type
  use attrito_reduce_spread_vectors, only: spread_vectors
  use attrito_reduce_static_condensation, only: condensed_type
  implicit none
  private
  public :: workspace_type, new_workspace

  type :: workspace_type
    !> model.h5
    character(:), allocatable :: path
    type(split_type) :: split
    type(column_store_type) :: store
    type(progress_type) :: progress
    type(reduction_options_type) :: options
    type(reduction_report_type) :: report
    !> Beside stiffness and mass
    logical :: has_damping = .false., has_gyroscopic = .false.
    !> Columns treated at a time
    integer :: block_size = 1
    !> Loads and monitors: this rank's rows
    real(wp), allocatable :: vectors(:, :)
    !> K_ii with K_ib, and M_ii, while they are in memory
    logical :: has_stiffness = .false., has_mass = .false.
    type(interior_stiffness_type) :: stiffness
    type(tMat) :: mass
    !> Interior dofs with mass: no more modes have a frequency
    integer :: most_modes = huge(1)
    type(interior_factor_type) :: factor
    logical :: has_factor = .false.
    !> In the place of constraint modes, where the report says so
    type(condensed_type) :: condensed
  contains
    procedure :: need_stiffness
    procedure :: need_mass
    procedure :: need_factor
    procedure :: factor_options
    procedure :: read_matrix
    procedure :: boundary_blocks
    procedure :: inner_blocks
    procedure :: basis_blocks
    procedure :: begin
    procedure :: finish
    procedure :: save_report
    procedure :: forget_modes
    procedure :: release_factor
    procedure :: destroy
  end type workspace_type

  !> Numbers in a block of columns, all ranks together, at most; and columns
  integer, parameter :: block_numbers = 2**25, most_columns = 256, fewest_columns = 8 ! conventional

contains

  !> Sizes, split and loads; what an interrupted reduction has reported is kept.
  subroutine new_workspace(self, comm, path, folder, boundary, vectors, error)
    type(workspace_type), intent(inout) :: self
    !> MPI communicator
    integer, intent(in) :: comm
    !> model.h5
    character(*), intent(in) :: path
    !> Where the steps leave what they did
    character(*), intent(in) :: folder
    !> Dofs to keep, from 0, ascending
    integer, intent(in) :: boundary(:)
    !> Loads and monitors [n, vectors] on rank 0
    real(wp), intent(in), contiguous :: vectors(:, :)
    !> The model is at fault
    type(error_type), allocatable, intent(out) :: error
    type(communicator_type) :: ranks
    integer :: n

    self%path = path
    self%store%folder = folder
    ranks = new_communicator(comm)
    call read_size(self, ranks, vectors, n, error)
    if (.not. allocated(error)) call new_split(self%split, ranks, n, boundary, error)
    if (.not. allocated(error)) call restore_report(self, error)
    if (allocated(error)) return
    call spread_vectors(self%split, vectors, self%vectors)
    self%block_size = self%options%block_size
    if (self%block_size == 0) self%block_size = max(fewest_columns, min(most_columns, block_numbers/n))
    self%report%dofs = n
    self%report%boundary = size(boundary)
  end subroutine new_workspace

  !> Number of dofs; matrices and vectors of one size.
  subroutine read_size(self, ranks, vectors, n, error)
    type(workspace_type), intent(inout) :: self
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> Vectors of the full model
    real(wp), intent(in) :: vectors(:, :)
    !> Number of dofs
    integer, intent(out) :: n
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file
    integer :: sizes(4), extent(1), length, i
    logical :: there(4)
    character(10), parameter :: names(4) = [character(10) :: 'stiffness', 'mass', 'damping', 'gyroscopic']

    n = 0
    call open_file(file, ranks%handle, self%path, error)
    if (allocated(error)) return
    self%has_damping = exists_in_file(file, '/damping/row_offsets')
    self%has_gyroscopic = exists_in_file(file, '/gyroscopic/row_offsets')
    there = [.true., .true., self%has_damping, self%has_gyroscopic]
    do i = 1, size(names)
      if (.not. there(i)) cycle
      extent = array_shape(file, '/'//trim(names(i))//'/row_offsets', error)
      if (allocated(error)) exit
      sizes(i) = extent(1) - 1
    end do
    call close_file(file)
    if (allocated(error)) return
    n = sizes(1)
    if (any(there .and. sizes /= n)) call raise(error, self%path//': mass, stiffness, damping or gyroscopic differ in size', &
                                                fault_of_input)
    length = size(vectors, 1)
    call ranks%broadcast_integer(length)
    if (allocated(error) .or. size(vectors, 2) == 0 .or. length == n) return
    call raise(error, self%path//': loads and monitors are of another size than the model', fault_of_input)
  end subroutine read_size

  !> Read a matrix of the full model; the caller destroys it.
  subroutine read_matrix(self, name, matrix, error)
    class(workspace_type), intent(in) :: self
    !> `stiffness`, `mass`, `damping` or `gyroscopic`
    character(*), intent(in) :: name
    !> Matrix, spread over the ranks
    type(tMat), intent(out) :: matrix
    !> Not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file

    call open_file(file, self%split%ranks%handle, self%path, error)
    if (allocated(error)) return
    call read_model_matrix(file, self%split%ranks, name, matrix, error)
    call close_file(file)
  end subroutine read_matrix

  !> K_ii, K_ib and K_bi, unless they are there.
  subroutine need_stiffness(self, error)
    class(workspace_type), intent(inout) :: self
    !> Not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    type(tMat) :: full
    PetscErrorCode :: ierr

    if (self%has_stiffness) return
    call self%read_matrix('stiffness', full, error)
    if (allocated(error)) return
    call interior_block(self%split, full, self%stiffness%interior, ierr)
    if (ierr == 0) call coupling_block(self%split, full, self%stiffness%coupling, ierr)
    if (ierr == 0) call boundary_columns(self%split, full, self%stiffness%columns, ierr)
    if (ierr == 0) call boundary_rows_on_root(self%split, full, self%stiffness%rows, ierr)
    if (ierr == 0) call MatDestroy(full, ierr)
    self%has_stiffness = .true.
    call raise_petsc(error, ierr, 'splitting boundary from interior')
  end subroutine need_stiffness

  !> M_ii, unless it is there.
  subroutine need_mass(self, error)
    class(workspace_type), intent(inout) :: self
    !> Not a CSR matrix
    type(error_type), allocatable, intent(out) :: error
    type(tMat) :: full
    real(wp), allocatable :: diagonal(:)
    real(wp) :: heavy
    PetscInt :: rows, columns
    PetscErrorCode :: ierr

    if (self%has_mass) return
    call self%read_matrix('mass', full, error)
    if (allocated(error)) return
    call interior_block(self%split, full, self%mass, ierr)
    if (ierr == 0) call MatDestroy(full, ierr)
    if (ierr == 0) call MatGetLocalSize(self%mass, rows, columns, ierr)
    if (ierr == 0) then
      allocate (diagonal(rows))
      call get_diagonal(self%mass, diagonal, ierr)
    end if
    if (ierr == 0) then
      heavy = count(diagonal > 0.0_wp)
      call self%split%ranks%sum(heavy)
      self%most_modes = nint(heavy)
    end if
    self%has_mass = .true.
    call raise_petsc(error, ierr, 'splitting boundary from interior')
  end subroutine need_mass

  !> The factors of K_ii, which must be positive definite, unless they are there.
  subroutine need_factor(self, error)
    class(workspace_type), intent(inout) :: self
    !> A motion stays free, or memory is too short
    type(error_type), allocatable, intent(out) :: error

    if (self%has_factor) return
    call self%begin(step_read)
    call self%need_stiffness(error)
    ! Beside the factors there is little room to split a matrix.
    if (.not. allocated(error)) call self%need_mass(error)
    call self%finish(step_read)
    if (allocated(error)) return
    call self%begin(step_factor)
    call new_interior_factor(self%factor, self%stiffness%interior, self%factor_options(), self%progress, error)
    self%has_factor = .true.
    if (.not. allocated(error)) call check_definite(self%split, self%stiffness%interior, self%factor, error)
    call self%finish(step_factor)
    associate (report => self%report, factor => self%factor)
      report%negative_pivots = factor%negative
      report%ordering = factor%ordering
      report%factor_megabytes = factor%megabytes
      report%factor_megabytes_out_of_core = factor%megabytes_out_of_core
      report%out_of_core = merge(1, 0, factor%out_of_core)
      report%factor_flops = factor%flops
      report%analysis_seconds = factor%analysis_seconds
    end associate
  end subroutine need_factor

  !> How to factor, and what this rank will hold beside the factors: the eigensolver's vectors, or a few blocks of columns.
  pure function factor_options(self) result(how)
    class(workspace_type), intent(in) :: self
    type(factor_options_type) :: how
    !> Blocks of columns that are held at once
    integer, parameter :: blocks_at_once = 6 ! conventional
    integer :: vectors

    ! The space of the eigensolver and, of SLEPc's, a copy of what converged (`attrito_reduce_krylov_schur`).
    vectors = max(blocks_at_once*self%block_size, (5*max(self%options%modes, 100))/2)
    how = factor_options_type(self%options%ordering, self%options%out_of_core, self%options%memory_megabytes, &
                              self%split%rows()*real(vectors, wp)/2.0_wp**17)
  end function factor_options

  !> Runs of boundary dofs.
  pure function boundary_blocks(self) result(blocks)
    class(workspace_type), intent(in) :: self
    type(block_type), allocatable :: blocks(:)

    blocks = new_blocks('constraint', self%split%boundary_count, self%block_size)
  end function boundary_blocks

  !> Modes and corrections.
  pure function inner_blocks(self) result(blocks)
    class(workspace_type), intent(in) :: self
    type(block_type), allocatable :: blocks(:)

    blocks = mode_blocks(self%report%modes, self%block_size)
    if (self%report%corrections > 0) blocks = [blocks, block_type('correction', 1, self%report%corrections)]
  end function inner_blocks

  !> All columns of the basis that are computed, in order: no constraint modes where the boundary is condensed.
  pure function basis_blocks(self) result(blocks)
    class(workspace_type), intent(in) :: self
    type(block_type), allocatable :: blocks(:)

    blocks = self%inner_blocks()
    if (self%report%condensed == 0) blocks = [self%boundary_blocks(), blocks]
  end function basis_blocks

  !> Start a step's clock.
  subroutine begin(self, step)
    class(workspace_type), intent(inout) :: self
    !> Number of the step of the reduction
    integer, intent(in) :: step

    call return_memory()
    call reset_peak()
    self%report%seconds(step) = self%report%seconds(step) - MPI_WTIME()
  end subroutine begin

  !> Stop it, and note the memory that was held meanwhile.
  subroutine finish(self, step)
    class(workspace_type), intent(inout) :: self
    !> Number of the step of the reduction
    integer, intent(in) :: step
    real(wp) :: peak

    peak = peak_megabytes()
    call self%split%ranks%sum(peak)
    self%report%seconds(step) = self%report%seconds(step) + MPI_WTIME()
    self%report%megabytes(step) = max(self%report%megabytes(step), peak)
  end subroutine finish

  !> Keep the report for whoever takes up an interrupted reduction.
  subroutine save_report(self, error)
    class(workspace_type), intent(in) :: self
    !> The disk is full
    type(error_type), allocatable, intent(out) :: error

    call self%store%put_numbers(self%split, 'report', transfer(self%report, [0.0_wp]), error)
  end subroutine save_report

  subroutine restore_report(self, error)
    type(workspace_type), intent(inout) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:)

    if (.not. self%store%has_numbers('report')) return
    call self%store%get_numbers(self%split, 'report', numbers, error)
    if (.not. allocated(error)) self%report = transfer(numbers, self%report)
  end subroutine restore_report

  !> Modes are to be computed again, and what follows from them.
  subroutine forget_modes(self)
    class(workspace_type), intent(in) :: self

    call self%store%drop_numbers(self%split, 'quality')
    call self%store%drop_numbers(self%split, 'mass')
    call self%store%drop_numbers(self%split, 'correction')
    call self%store%drop_numbers(self%split, 'modes')
  end subroutine forget_modes

  !> The factors go; released ones, or none, do no harm.
  subroutine release_factor(self)
    class(workspace_type), intent(inout) :: self

    if (self%has_factor) call self%factor%destroy()
    self%has_factor = .false.
  end subroutine release_factor

  !> Release what PETSc holds.
  subroutine destroy(self)
    class(workspace_type), intent(inout) :: self
    PetscErrorCode :: ierr

    call self%release_factor()
    if (self%has_mass) call MatDestroy(self%mass, ierr)
    if (self%has_stiffness) then
      call MatDestroy(self%stiffness%interior, ierr)
      call MatDestroy(self%stiffness%coupling, ierr)
      call MatDestroy(self%stiffness%columns, ierr)
      call MatDestroy(self%stiffness%rows, ierr)
    end if
    self%has_mass = .false.
    self%has_stiffness = .false.
  end subroutine destroy
end module attrito_reduce_workspace
