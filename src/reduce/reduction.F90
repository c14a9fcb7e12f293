#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Craig-Bampton reduction of model.h5 to rom.h5.
!>
!> $$ q = T \begin{pmatrix} q_b \\ \eta \end{pmatrix}, \qquad
!>    T = \begin{pmatrix} I & 0 \\ \Psi & \Phi \end{pmatrix}, \qquad
!>    \tilde K = T^T K T, \quad \tilde M = T^T M T, \quad \tilde f = T^T f $$
!>
!> Psi: constraint modes; Phi: fixed-interface modes, then static corrections. One factorisation of K_ii serves all three. Where the
!> motion of few dofs is asked for, the boundary is condensed without Psi (`attrito_reduce_condensed_steps`). T lives on disk, in
!> blocks of columns; each step leaves there what it did, and a reduction that was interrupted goes on from that.
!> Source: Craig & Bampton, AIAA J. 6 (1968) 1313-1319, doi:10.2514/3.4741.
module attrito_reduce_reduction
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_file, only: close_file, hdf5_file_type, open_file
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_petsc_session, only: start_petsc
  use attrito_reduce_condensed_steps, only: add_boundary_stiffness, reduce_vectors
  use attrito_reduce_error_indicator, only: quality_type
  use attrito_reduce_fixed_interface_modes, only: fixed_interface_modes_type
  use attrito_reduce_inertia_check, only: check_count
  use attrito_reduce_interior_steps, only: panel_columns, take_interior_steps
  use attrito_reduce_model_matrix, only: read_sliced_matrix
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_project, only: project_matrices, projected_type
  use attrito_reduce_report, only: reduction_options_type, reduction_report_type, step_inertia, step_project, step_write
  use attrito_reduce_workspace, only: new_workspace, workspace_type
  use attrito_reduce_write_rom, only: reduced_model_type, write_rom
  implicit none
  private
  public :: reduce_model, reduction_options_type, reduction_report_type

contains

  !> Reduce a model, by all ranks of `comm` together.
  subroutine reduce_model(comm, model_path, rom_path, folder, boundary, vectors, options, progress, report, error)
    !> MPI communicator
    integer, intent(in) :: comm
    !> model.h5
    character(*), intent(in) :: model_path
    !> rom.h5, written over
    character(*), intent(in) :: rom_path
    !> Where the steps leave what they did; it holds that of the same reduction, or nothing
    character(*), intent(in) :: folder
    !> Dofs to keep, from 0, ascending, the same on every rank
    integer, intent(in) :: boundary(:)
    !> Loads and monitors [n, vectors]; rank 0's are taken
    real(wp), intent(in), contiguous :: vectors(:, :)
    !> How many modes, and how
    type(reduction_options_type), intent(in) :: options
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> What was found, and how long it took
    type(reduction_report_type), intent(out) :: report
    !> The model is at fault, or memory ran out
    type(error_type), allocatable, intent(out) :: error
    type(workspace_type) :: work
    type(fixed_interface_modes_type) :: modes
    type(quality_type) :: quality
    type(reduced_model_type) :: model

    work%progress = progress
    work%options = options
    call start_petsc(comm, error)
    if (.not. allocated(error)) call new_workspace(work, comm, model_path, folder, boundary, vectors, error)
    if (.not. allocated(error)) call take_interior_steps(work, modes, model%mass, quality, error)
    call work%release_factor()
    if (.not. allocated(error)) call take_inertia_step(work, modes, error)
    call work%destroy()
    if (.not. allocated(error)) call take_projection_step(work, model, error)
    if (.not. allocated(error)) call take_writing_step(work, rom_path, model, modes, quality, error)
    report = work%report
  end subroutine reduce_model

  !> The proof that no mode was missed; the matrices are gone afterwards.
  subroutine take_inertia_step(work, modes, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Fixed-interface modes and their frequencies
    type(fixed_interface_modes_type), intent(in) :: modes
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    if (work%report%modes == 0 .or. .not. work%options%check_inertia .or. work%report%modes_below_shift >= 0) return
    work%report%shift_hz = sqrt(modes%shift)/two_pi
    call work%need_stiffness(error)
    if (.not. allocated(error)) call work%need_mass(error)
    if (allocated(error)) return
    call work%progress%say('counting the modes below '//frequency_text(work%report%shift_hz)//' by a second factorisation')
    call work%begin(step_inertia)
    call check_count(work%stiffness%interior, work%mass, modes, work%factor_options(), work%progress, &
                     work%report%modes_below_shift, error)
    call work%finish(step_inertia)
    if (.not. allocated(error)) call work%save_report(error)
  end subroutine take_inertia_step

  !> Stiffness in slices that make its projection independent of rounding, damping, Coriolis forces, loads and monitors.
  subroutine take_projection_step(work, model, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Reduced model to write
    type(reduced_model_type), intent(inout) :: model
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(projected_type) :: matrices(1 + count([work%has_damping, work%has_gyroscopic]))
    integer :: i, k, last
    PetscErrorCode :: ierr

    ! By a variable: gfortran 12 moves nothing out of matrices(size(matrices)).
    last = size(matrices)
    call work%begin(step_project)
    call read_slices(work, matrices(1), error)
    if (work%has_damping .and. .not. allocated(error)) then
      allocate (matrices(2)%slices(1))
      call work%read_matrix('damping', matrices(2)%slices(1), error)
    end if
    if (work%has_gyroscopic .and. .not. allocated(error)) then
      allocate (matrices(last)%slices(1))
      matrices(last)%is_skew = .true.
      call work%read_matrix('gyroscopic', matrices(last)%slices(1), error)
    end if
    if (allocated(error)) return
    call project_matrices(work%split, work%basis_blocks(), work%store, panel_columns(work, size(matrices)), work%progress, &
                          matrices, error)
    do i = 1, size(matrices)
      do k = 1, size(matrices(i)%slices)
        call MatDestroy(matrices(i)%slices(k), ierr)
      end do
    end do
    if (.not. allocated(error)) call reduce_vectors(work, model%reduced_vectors, error)
    call work%finish(step_project)
    if (allocated(error)) return
    call move_alloc(matrices(1)%reduced, model%stiffness)
    if (work%report%condensed == 1) call add_boundary_stiffness(work, model%stiffness)
    if (work%report%condensed == 1) call move_alloc(work%condensed%recovered, model%boundary_rows)
    if (work%has_damping) call move_alloc(matrices(2)%reduced, model%damping)
    if (work%has_gyroscopic) call move_alloc(matrices(last)%reduced, model%gyroscopic)
    call move_alloc(work%vectors, model%vectors)
  end subroutine take_projection_step

  subroutine read_slices(work, stiffness, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    !> Matrices and their projections
    type(projected_type), intent(inout) :: stiffness
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file

    allocate (stiffness%slices(2))
    call open_file(file, work%split%ranks%handle, work%path, error)
    if (allocated(error)) return
    call read_sliced_matrix(file, work%split%ranks, 'stiffness', stiffness%slices, error)
    call close_file(file)
  end subroutine read_slices

  subroutine take_writing_step(work, path, model, modes, quality, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Path of the file
    character(*), intent(in) :: path
    !> Reduced model to write
    type(reduced_model_type), intent(in) :: model
    !> Fixed-interface modes and their frequencies
    type(fixed_interface_modes_type), intent(in) :: modes
    !> Errors estimated of the reduced model
    type(quality_type), intent(in) :: quality
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    call work%begin(step_write)
    call write_rom(path, work%split, model, work%basis_blocks(), work%store, modes, quality, work%report, &
                   work%options%recovered, error)
    call work%finish(step_write)
  end subroutine take_writing_step

  pure function frequency_text(frequency_hz) result(text)
    !> Frequency, Hz
    real(wp), intent(in) :: frequency_hz
    character(:), allocatable :: text
    character(20) :: number

    write (number, '(g0.6)') frequency_hz
    text = trim(number)//' Hz'
  end function frequency_text
end module attrito_reduce_reduction
