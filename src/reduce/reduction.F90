#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Craig-Bampton reduction of model.h5 to rom.h5.
!>
!> $$ q = T \begin{pmatrix} q_b \\ \eta \end{pmatrix}, \qquad
!>    T = \begin{pmatrix} I & 0 \\ \Psi & \Phi \end{pmatrix}, \qquad
!>    \tilde K = T^T K T, \quad \tilde M = T^T M T, \quad \tilde f = T^T f $$
!>
!> Psi: constraint modes; Phi: fixed-interface modes, then static corrections. One factorisation of K_ii serves all three.
!> T lives as one array, each rank its rows of the full model.
!> Source: Craig & Bampton, AIAA J. 6 (1968) 1313-1319, doi:10.2514/3.4741.
module attrito_reduce_reduction
  use mpi, only: MPI_WTIME
  use petscmat
  use attrito_core_communicator, only: communicator_type, new_communicator
  use attrito_core_errors, only: error_type, fault_of_input, raise
  use attrito_core_hdf5_file, only: close_file, exists_in_file, hdf5_file_type, open_file
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_petsc_session, only: raise_petsc, start_petsc
  use attrito_reduce_constraint_modes, only: compute_constraint_modes
  use attrito_reduce_definiteness, only: check_definite
  use attrito_reduce_fixed_interface_modes, only: compute_fixed_interface_modes, fixed_interface_modes_type
  use attrito_reduce_inertia_check, only: check_count, count_modes_up_to
  use attrito_reduce_interior_factor, only: interior_factor_type, new_interior_factor
  use attrito_reduce_model_matrix, only: read_model_matrix, read_sliced_matrix
  use attrito_reduce_project, only: project_matrix, project_vectors
  use attrito_reduce_report, only: reduction_options_type, reduction_report_type
  use attrito_reduce_split, only: interior_block, new_split, split_type
  use attrito_reduce_spread_vectors, only: spread_vectors
  use attrito_reduce_static_corrections, only: add_corrections, compute_static_responses
  use attrito_reduce_write_rom, only: reduced_model_type, write_rom
  implicit none
  private
  public :: reduce_model, reduction_options_type, reduction_report_type

  !> What the steps share, from the first to the last
  type :: workspace_type
    !> model.h5
    character(:), allocatable :: path
    type(split_type) :: split
    type(tMat) :: mass, stiffness, damping
    type(tMat) :: interior_mass, interior_stiffness
    logical :: has_damping = .false.
    !> Number of fixed-interface modes asked for, directly or by a frequency
    integer :: wanted = 0
    type(interior_factor_type) :: factor
    type(fixed_interface_modes_type) :: modes
    !> Loads and monitors, and static responses to them: this rank's rows
    real(wp), allocatable :: vectors(:, :), responses(:, :)
    !> T, this rank's rows; the last columns may stay unused
    real(wp), allocatable :: basis(:, :)
  contains
    procedure :: destroy
  end type workspace_type

contains

  !> Reduce a model, by all ranks of `comm` together.
  subroutine reduce_model(comm, model_path, rom_path, boundary, vectors, options, report, error)
    !> MPI communicator
    integer, intent(in) :: comm
    !> model.h5
    character(*), intent(in) :: model_path
    !> rom.h5, written over
    character(*), intent(in) :: rom_path
    !> Dofs to keep, from 0, ascending, the same on every rank
    integer, intent(in) :: boundary(:)
    !> Loads and monitors [n, vectors]; rank 0's are taken
    real(wp), intent(in), contiguous :: vectors(:, :)
    !> How many modes, and how
    type(reduction_options_type), intent(in) :: options
    !> What was found, and how long it took
    type(reduction_report_type), intent(out) :: report
    !> The model is at fault, or memory ran out
    type(error_type), allocatable, intent(out) :: error
    type(workspace_type) :: work

    call start_petsc(comm, error)
    if (.not. allocated(error)) call read_model(work, comm, model_path, boundary, vectors, report, error)
    if (.not. allocated(error)) call split_model(work, options, report, error)
    if (.not. allocated(error)) call factor_interior(work, report, error)
    if (.not. allocated(error)) call compute_basis(work, options, report, error)
    if (.not. allocated(error)) call project_and_write(work, rom_path, options, report, error)
    call work%destroy()
  end subroutine reduce_model

  subroutine read_model(work, comm, path, boundary, vectors, report, error)
    type(workspace_type), intent(inout) :: work
    integer, intent(in) :: comm
    character(*), intent(in) :: path
    integer, intent(in) :: boundary(:)
    real(wp), intent(in), contiguous :: vectors(:, :)
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error
    type(communicator_type) :: ranks
    type(hdf5_file_type) :: file
    PetscInt :: n
    PetscErrorCode :: ierr

    report%read_seconds = -MPI_WTIME()
    work%path = path
    ranks = new_communicator(comm)
    call open_file(file, comm, path, error)
    if (allocated(error)) return
    work%has_damping = exists_in_file(file, '/damping/row_offsets')
    call read_model_matrix(file, ranks, 'stiffness', work%stiffness, error)
    if (.not. allocated(error)) call read_model_matrix(file, ranks, 'mass', work%mass, error)
    if (.not. allocated(error) .and. work%has_damping) call read_model_matrix(file, ranks, 'damping', work%damping, error)
    call close_file(file)
    if (allocated(error)) return
    call MatGetSize(work%stiffness, n, PETSC_NULL_INTEGER, ierr)
    call check_sizes(work, n, ranks, vectors, path, error)
    if (.not. allocated(error)) call new_split(work%split, ranks, n, boundary, error)
    if (allocated(error)) return
    call spread_vectors(work%split, vectors, work%vectors)
    report%dofs = n
    report%boundary = size(boundary)
    report%read_seconds = report%read_seconds + MPI_WTIME()
  end subroutine read_model

  !> Matrices and vectors of one size.
  subroutine check_sizes(work, n, ranks, vectors, path, error)
    type(workspace_type), intent(in) :: work
    PetscInt, intent(in) :: n
    type(communicator_type), intent(in) :: ranks
    real(wp), intent(in) :: vectors(:, :)
    character(*), intent(in) :: path
    type(error_type), allocatable, intent(out) :: error
    integer :: length
    PetscInt :: others(2)
    PetscErrorCode :: ierr

    others = n
    call MatGetSize(work%mass, others(1), PETSC_NULL_INTEGER, ierr)
    if (work%has_damping) call MatGetSize(work%damping, others(2), PETSC_NULL_INTEGER, ierr)
    if (any(others /= n)) call raise(error, path // ': mass, stiffness and damping differ in size', fault_of_input)
    length = size(vectors, 1)
    call ranks%broadcast_integer(length)
    if (allocated(error) .or. size(vectors, 2) == 0 .or. length == n) return
    call raise(error, path // ': loads and monitors are of another size than the model', fault_of_input)
  end subroutine check_sizes

  !> K_ii, M_ii, and the number of modes wanted: counted first, so that never two factorisations are held at once.
  subroutine split_model(work, options, report, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error
    PetscErrorCode :: ierr

    call interior_block(work%split, work%stiffness, work%interior_stiffness, ierr)
    if (ierr == 0) call interior_block(work%split, work%mass, work%interior_mass, ierr)
    call raise_petsc(error, ierr, 'splitting boundary from interior')
    if (allocated(error)) return
    work%wanted = options%modes
    if (work%wanted >= 0) return
    report%inertia_seconds = -MPI_WTIME()
    call count_modes_up_to(work%interior_stiffness, work%interior_mass, options%max_frequency_hz, work%wanted, error)
    report%inertia_seconds = report%inertia_seconds + MPI_WTIME()
  end subroutine split_model

  !> The factors of K_ii, which must be positive definite.
  subroutine factor_interior(work, report, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error

    report%factor_seconds = -MPI_WTIME()
    call new_interior_factor(work%factor, work%interior_stiffness, error)
    if (.not. allocated(error)) call check_definite(work%split, work%interior_stiffness, work%factor, error)
    report%negative_pivots = work%factor%negative
    report%ordering = work%factor%ordering
    report%factor_megabytes = work%factor%megabytes
    report%factor_seconds = report%factor_seconds + MPI_WTIME()
  end subroutine factor_interior

  !> All columns of T: what needs the factors first, so that they are gone when the modes are counted.
  subroutine compute_basis(work, options, report, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error
    integer :: nb

    nb = work%split%boundary_count
    report%constraint_seconds = -MPI_WTIME()
    allocate (work%basis(work%split%rows(), nb))
    call compute_constraint_modes(work%split, work%stiffness, work%factor, options%block_size, work%basis, &
                                  report%constraint_residual, error)
    report%constraint_seconds = report%constraint_seconds + MPI_WTIME()
    if (.not. allocated(error)) call compute_static_responses(work%split, work%factor, work%vectors, work%responses, error)
    if (.not. allocated(error)) call compute_modes(work, options, report, error)
    if (.not. allocated(error)) call append_modes_and_corrections(work, report, error)
  end subroutine compute_basis

  !> Fixed-interface modes, and the proof that none was missed.
  subroutine compute_modes(work, options, report, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error

    report%modes_seconds = -MPI_WTIME()
    call compute_fixed_interface_modes(work%split, work%interior_stiffness, work%interior_mass, work%factor, work%wanted, &
                                       options%tolerance, work%modes, error)
    report%modes_seconds = report%modes_seconds + MPI_WTIME()
    call work%factor%destroy()
    if (allocated(error)) return
    report%modes = size(work%modes%frequency_hz)
    report%mode_residual = maxval([0.0_wp, work%modes%residual])
    if (report%modes == 0 .or. .not. options%check_inertia) return
    report%shift_hz = sqrt(work%modes%shift)/two_pi
    report%inertia_seconds = report%inertia_seconds - MPI_WTIME()
    call check_count(work%interior_stiffness, work%interior_mass, work%modes, report%modes_below_shift, error)
    report%inertia_seconds = report%inertia_seconds + MPI_WTIME()
  end subroutine compute_modes

  subroutine append_modes_and_corrections(work, report, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer :: modes

    report%correction_seconds = -MPI_WTIME()
    modes = report%modes
    allocate (columns(work%split%rows(), modes + size(work%responses, 2)), source=0.0_wp)
    columns(work%split%interior_rows, :modes) = work%modes%shapes
    call add_corrections(work%split, work%mass, work%responses, columns, modes, report%corrections, error)
    report%coordinates = report%boundary + modes + report%corrections
    call append_columns(work%basis, columns(:, :modes + report%corrections))
    report%correction_seconds = report%correction_seconds + MPI_WTIME()
  end subroutine append_modes_and_corrections

  subroutine append_columns(basis, columns)
    real(wp), allocatable, intent(inout) :: basis(:, :)
    real(wp), intent(in) :: columns(:, :)
    real(wp), allocatable :: whole(:, :)
    integer :: nb

    nb = size(basis, 2)
    allocate (whole(size(basis, 1), nb + size(columns, 2)))
    whole(:, :nb) = basis
    whole(:, nb + 1:) = columns
    call move_alloc(whole, basis)
  end subroutine append_columns

  subroutine project_and_write(work, path, options, report, error)
    type(workspace_type), intent(inout) :: work
    character(*), intent(in) :: path
    type(reduction_options_type), intent(in) :: options
    type(reduction_report_type), intent(inout) :: report
    type(error_type), allocatable, intent(out) :: error
    type(reduced_model_type) :: model

    report%project_seconds = -MPI_WTIME()
    associate (ranks => work%split%ranks, block_size => options%block_size)
      call project_matrix(ranks, [work%mass], work%basis, block_size, model%mass, error)
      if (.not. allocated(error)) call project_stiffness(work, block_size, model%stiffness, error)
      if (.not. allocated(error) .and. work%has_damping) &
        call project_matrix(ranks, [work%damping], work%basis, block_size, model%damping, error)
      if (allocated(error)) return
      call project_vectors(ranks, work%vectors, work%basis, model%reduced_vectors)
      call move_alloc(work%vectors, model%vectors)
    end associate
    report%project_seconds = report%project_seconds + MPI_WTIME()
    report%write_seconds = -MPI_WTIME()
    call write_rom(path, work%split, model, work%basis, work%modes, report, options%block_size, error)
    report%write_seconds = report%write_seconds + MPI_WTIME()
  end subroutine project_and_write

  !> The stiffness is read again, in slices that make its projection independent of rounding.
  subroutine project_stiffness(work, block_size, reduced, error)
    type(workspace_type), intent(in) :: work
    integer, intent(in) :: block_size
    real(wp), allocatable, intent(out) :: reduced(:, :)
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file
    type(tMat) :: slices(2)
    integer :: i
    PetscErrorCode :: ierr

    associate (ranks => work%split%ranks)
      call open_file(file, ranks%handle, work%path, error)
      if (allocated(error)) return
      call read_sliced_matrix(file, ranks, 'stiffness', slices, error)
      call close_file(file)
      if (.not. allocated(error)) call project_matrix(ranks, slices, work%basis, block_size, reduced, error)
      do i = 1, size(slices)
        call MatDestroy(slices(i), ierr)
      end do
    end associate
  end subroutine project_stiffness

  !> Release what PETSc holds.
  subroutine destroy(self)
    !> The workspace
    class(workspace_type), intent(inout) :: self
    PetscErrorCode :: ierr

    call self%factor%destroy()
    call MatDestroy(self%interior_mass, ierr)
    call MatDestroy(self%interior_stiffness, ierr)
    call MatDestroy(self%damping, ierr)
    call MatDestroy(self%mass, ierr)
    call MatDestroy(self%stiffness, ierr)
  end subroutine destroy
end module attrito_reduce_reduction
