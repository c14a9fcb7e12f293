#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Craig-Bampton reduction of model.h5 to rom.h5.
!>
!> $$ q = T \begin{pmatrix} q_b \\ \eta \end{pmatrix}, \qquad
!>    T = \begin{pmatrix} I & 0 \\ \Psi & \Phi \end{pmatrix}, \qquad
!>    \tilde K = T^T K T, \quad \tilde M = T^T M T, \quad \tilde f = T^T f $$
!>
!> Psi: constraint modes; Phi: fixed-interface modes, then static corrections. One factorisation of K_ii serves all three. T lives on
!> disk, in blocks of columns; each step leaves there what it did, and a reduction that was interrupted goes on from that.
!> Source: Craig & Bampton, AIAA J. 6 (1968) 1313-1319, doi:10.2514/3.4741.
module attrito_reduce_reduction
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_file, only: close_file, hdf5_file_type, open_file
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_machine_memory, only: free_megabytes
  use attrito_core_petsc_session, only: start_petsc
  use attrito_reduce_column_store, only: block_type
  use attrito_reduce_constraint_modes, only: compute_constraint_modes
  use attrito_reduce_definiteness, only: check_definite
  use attrito_reduce_fixed_interface_modes, only: compute_fixed_interface_modes, fixed_interface_modes_type, mode_blocks
  use attrito_reduce_inertia_check, only: check_count, count_modes_up_to
  use attrito_reduce_interior_factor, only: factor_options_type, new_interior_factor
  use attrito_reduce_model_matrix, only: read_sliced_matrix
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_project, only: project_matrices, project_vectors, projected_type
  use attrito_reduce_report, only: reduction_options_type, reduction_report_type, step_constraint, step_correction, step_count, &
    step_factor, step_inertia, step_modes, step_project, step_read, step_write
  use attrito_reduce_static_corrections, only: compute_static_responses, make_corrections
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

    work%progress = progress
    call start_petsc(comm, error)
    if (.not. allocated(error)) call new_workspace(work, comm, model_path, folder, boundary, vectors, options%block_size, error)
    if (.not. allocated(error)) call take_constraint_step(work, options, error)
    if (.not. allocated(error)) call take_response_step(work, options, error)
    if (.not. allocated(error)) call take_modes_step(work, options, modes, error)
    call work%release_factor()
    if (.not. allocated(error)) call take_inertia_step(work, options, modes, error)
    call work%destroy()
    if (.not. allocated(error)) call take_correction_step(work, error)
    if (.not. allocated(error)) call project_and_write(work, rom_path, modes, error)
    report = work%report
  end subroutine reduce_model

  !> Constraint modes, those of them that are not there yet.
  subroutine take_constraint_step(work, options, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    type(block_type), allocatable :: blocks(:)

    blocks = work%boundary_blocks()
    if (work%store%has_all(blocks)) return
    call need_factor(work, options, error)
    if (allocated(error)) return
    call work%begin(step_constraint)
    call compute_constraint_modes(work%split, work%stiffness, work%factor, blocks, work%store, work%progress, &
                                  work%report%constraint_residual, error)
    call work%finish(step_constraint)
    if (.not. allocated(error)) call work%save_report(error)
  end subroutine take_constraint_step

  !> Static responses to loads and monitors.
  subroutine take_response_step(work, options, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: responses(:, :)

    if (size(work%vectors, 2) == 0 .or. work%store%has(response_block(work))) return
    call need_factor(work, options, error)
    if (allocated(error)) return
    call work%begin(step_correction)
    call compute_static_responses(work%split, work%factor, work%vectors, responses, error)
    if (.not. allocated(error)) call work%store%put(work%split, response_block(work), responses, error)
    call work%finish(step_correction)
  end subroutine take_response_step

  !> Fixed-interface modes.
  subroutine take_modes_step(work, options, modes, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(fixed_interface_modes_type), intent(out) :: modes
    type(error_type), allocatable, intent(out) :: error
    integer :: wanted

    if (work%store%has_numbers('modes')) then
      call modes%restore(work%split, work%store, error)
      return
    end if
    call count_wanted(work, options, wanted, error)
    if (.not. allocated(error)) call need_factor(work, options, error)
    if (.not. allocated(error)) call work%need_mass(error)
    if (allocated(error)) return
    call work%begin(step_modes)
    call compute_fixed_interface_modes(work%split, work%stiffness%interior, work%mass, work%factor, wanted, options%tolerance, &
                                       work%block_size, work%store, work%progress, modes, error)
    call work%finish(step_modes)
    if (allocated(error)) return
    work%report%modes = size(modes%frequency_hz)
    work%report%mode_residual = maxval([0.0_wp, modes%residual])
    call work%save_report(error)
    if (.not. allocated(error)) call modes%keep(work%split, work%store, error)
  end subroutine take_modes_step

  !> Number of modes asked for, directly or by a frequency.
  subroutine count_wanted(work, options, wanted, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    integer, intent(out) :: wanted
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:)

    wanted = options%modes
    if (wanted >= 0) return
    if (.not. work%store%has_numbers('count')) then
      ! Never two factorisations at once.
      call work%release_factor()
      call work%need_stiffness(error)
      if (.not. allocated(error)) call work%need_mass(error)
      if (allocated(error)) return
      call work%begin(step_count)
      call count_modes_up_to(work%stiffness%interior, work%mass, options%max_frequency_hz, factor_options(work, options), &
                             work%progress, wanted, error)
      call work%finish(step_count)
      if (.not. allocated(error)) call work%store%put_numbers(work%split, 'count', [real(wanted, wp)], error)
      return
    end if
    call work%store%get_numbers(work%split, 'count', numbers, error)
    if (.not. allocated(error)) wanted = nint(numbers(1))
  end subroutine count_wanted

  !> The proof that no mode was missed; the matrices are gone afterwards.
  subroutine take_inertia_step(work, options, modes, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(fixed_interface_modes_type), intent(in) :: modes
    type(error_type), allocatable, intent(out) :: error

    if (work%report%modes == 0 .or. .not. options%check_inertia .or. work%report%modes_below_shift >= 0) return
    work%report%shift_hz = sqrt(modes%shift)/two_pi
    call work%need_stiffness(error)
    if (.not. allocated(error)) call work%need_mass(error)
    if (allocated(error)) return
    call work%progress%say('counting the modes below '//frequency_text(work%report%shift_hz)//' by a second factorisation')
    call work%begin(step_inertia)
    call check_count(work%stiffness%interior, work%mass, modes, factor_options(work, options), work%progress, &
                     work%report%modes_below_shift, error)
    call work%finish(step_inertia)
    if (.not. allocated(error)) call work%save_report(error)
  end subroutine take_inertia_step

  !> Static corrections from the static responses.
  subroutine take_correction_step(work, error)
    type(workspace_type), intent(inout) :: work
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: responses(:, :), numbers(:)
    type(tMat) :: mass
    PetscErrorCode :: ierr

    work%report%coordinates = work%report%boundary + work%report%modes
    if (size(work%vectors, 2) == 0) return
    if (.not. work%store%has_numbers('correction')) then
      call work%begin(step_correction)
      call work%read_matrix('mass', mass, error)
      if (allocated(error)) return
      allocate (responses(work%split%rows(), size(work%vectors, 2)))
      call work%store%get(work%split, response_block(work), responses, error)
      if (.not. allocated(error)) &
        call make_corrections(work%split, mass, mode_blocks(work%report%modes, work%block_size), work%store, responses, &
                              work%report%corrections, error)
      call MatDestroy(mass, ierr)
      if (.not. allocated(error) .and. work%report%corrections > 0) &
        call work%store%put(work%split, block_type('correction', 1, work%report%corrections), &
                            responses(:, :work%report%corrections), error)
      call work%finish(step_correction)
      if (.not. allocated(error)) call work%save_report(error)
      if (.not. allocated(error)) &
        call work%store%put_numbers(work%split, 'correction', [real(work%report%corrections, wp)], error)
      if (allocated(error)) return
    end if
    call work%store%get_numbers(work%split, 'correction', numbers, error)
    if (.not. allocated(error)) work%report%corrections = nint(numbers(1))
    work%report%coordinates = work%report%coordinates + work%report%corrections
  end subroutine take_correction_step

  subroutine project_and_write(work, path, modes, error)
    type(workspace_type), intent(inout) :: work
    character(*), intent(in) :: path
    type(fixed_interface_modes_type), intent(in) :: modes
    type(error_type), allocatable, intent(out) :: error
    type(reduced_model_type) :: model
    type(block_type), allocatable :: blocks(:)

    blocks = [work%boundary_blocks(), mode_blocks(work%report%modes, work%block_size)]
    if (work%report%corrections > 0) blocks = [blocks, block_type('correction', 1, work%report%corrections)]
    call work%begin(step_project)
    call project(work, blocks, model, error)
    if (.not. allocated(error)) &
      call project_vectors(work%split, blocks, work%store, work%vectors, model%reduced_vectors, error)
    call work%finish(step_project)
    if (allocated(error)) return
    call move_alloc(work%vectors, model%vectors)
    call work%begin(step_write)
    call write_rom(path, work%split, model, blocks, work%store, modes, work%report, error)
    call work%finish(step_write)
  end subroutine project_and_write

  !> Mass, stiffness in slices that make its projection independent of rounding, damping.
  subroutine project(work, blocks, model, error)
    type(workspace_type), intent(inout) :: work
    type(block_type), intent(in) :: blocks(:)
    type(reduced_model_type), intent(inout) :: model
    type(error_type), allocatable, intent(out) :: error
    type(projected_type) :: matrices(merge(3, 2, work%has_damping))
    type(hdf5_file_type) :: file
    integer :: i, k
    PetscErrorCode :: ierr

    allocate (matrices(1)%slices(2))
    call open_file(file, work%split%ranks%handle, work%path, error)
    if (allocated(error)) return
    call read_sliced_matrix(file, work%split%ranks, 'stiffness', matrices(1)%slices, error)
    call close_file(file)
    do i = 2, size(matrices)
      if (allocated(error)) return
      allocate (matrices(i)%slices(1))
      call work%read_matrix(trim(merge('mass   ', 'damping', i == 2)), matrices(i)%slices(1), error)
    end do
    if (.not. allocated(error)) &
      call project_matrices(work%split, blocks, work%store, panel_columns(work, size(matrices)), work%progress, matrices, error)
    do i = 1, size(matrices)
      do k = 1, size(matrices(i)%slices)
        call MatDestroy(matrices(i)%slices(k), ierr)
      end do
    end do
    if (allocated(error)) return
    call move_alloc(matrices(1)%reduced, model%stiffness)
    call move_alloc(matrices(2)%reduced, model%mass)
    if (work%has_damping) call move_alloc(matrices(3)%reduced, model%damping)
  end subroutine project

  !> Columns of which the products of so many matrices fill a third of the free memory.
  integer function panel_columns(work, matrices) result(columns)
    type(workspace_type), intent(in) :: work
    integer, intent(in) :: matrices
    real(wp) :: available

    available = -free_megabytes()
    available = -work%split%ranks%largest(available)
    columns = int(min(1.0e4_wp, available/3.0_wp*2.0_wp**17/(real(matrices, wp)*work%split%n)))
  end function panel_columns

  !> The factors of K_ii, which must be positive definite, unless they are there.
  subroutine need_factor(work, options, error)
    type(workspace_type), intent(inout) :: work
    type(reduction_options_type), intent(in) :: options
    type(error_type), allocatable, intent(out) :: error

    if (work%has_factor) return
    call work%begin(step_read)
    call work%need_stiffness(error)
    ! Beside the factors there is little room to split a matrix.
    if (.not. allocated(error)) call work%need_mass(error)
    call work%finish(step_read)
    if (allocated(error)) return
    call work%begin(step_factor)
    call new_interior_factor(work%factor, work%stiffness%interior, factor_options(work, options), work%progress, error)
    work%has_factor = .true.
    if (.not. allocated(error)) call check_definite(work%split, work%stiffness%interior, work%factor, error)
    call work%finish(step_factor)
    associate (report => work%report, factor => work%factor)
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
  pure function factor_options(work, options) result(how)
    type(workspace_type), intent(in) :: work
    type(reduction_options_type), intent(in) :: options
    type(factor_options_type) :: how
    integer, parameter :: blocks_at_once = 6
    integer :: vectors

    vectors = max(blocks_at_once*work%block_size, 2*max(options%modes, 100))
    how = factor_options_type(options%ordering, options%out_of_core, options%low_rank, work%split%rows()*real(vectors, wp)/2.0_wp**17)
  end function factor_options

  pure function response_block(work) result(block)
    type(workspace_type), intent(in) :: work
    type(block_type) :: block

    block = block_type('response', 1, size(work%vectors, 2))
  end function response_block

  pure function frequency_text(frequency_hz) result(text)
    real(wp), intent(in) :: frequency_hz
    character(:), allocatable :: text
    character(20) :: number

    write (number, '(g0.6)') frequency_hz
    text = trim(number)//' Hz'
  end function frequency_text
end module attrito_reduce_reduction
