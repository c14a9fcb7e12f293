#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> The steps that need the factors of K_ii: constraint modes, static responses, fixed-interface modes, corrections, and the error that
!> the basis leaves. Each leaves on disk what it did, and does nothing where it finds that.
!>
!> With an error to meet, modes are doubled until the indicator meets it.
module attrito_reduce_interior_steps
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_machine_memory, only: free_megabytes
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_column_store, only: block_type
  use attrito_reduce_condensed_steps, only: add_boundary_mass, reduce_vectors, take_condensation_step
  use attrito_reduce_constraint_modes, only: compute_constraint_modes
  use attrito_reduce_dense_block, only: multiply_block, multiply_transposed_block
  use attrito_reduce_error_indicator, only: examined_type, indicate_errors, quality_type
  use attrito_reduce_fixed_interface_modes, only: compute_fixed_interface_modes, eigensolver_type, fixed_interface_modes_type, mode_blocks
  use attrito_reduce_inertia_check, only: count_modes_up_to
  use attrito_reduce_project, only: project_matrices, projected_type
  use attrito_core_lapack, only: transposed_product
  use attrito_reduce_report, only: step_constraint, step_correction, step_count, step_indicator, step_modes, step_project
  use attrito_reduce_static_corrections, only: compute_static_responses, make_corrections
  use attrito_reduce_workspace, only: workspace_type
  implicit none
  private
  public :: take_interior_steps, panel_columns

  !> Modes to begin with where their number follows from an error
  integer, parameter :: first_guess = 20 ! guess

contains

  !> All columns of the basis, its mass, and its error.
  subroutine take_interior_steps(work, modes, mass, quality, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Frequencies and residuals
    type(fixed_interface_modes_type), intent(out) :: modes
    !> Reduced mass [m, m]
    real(wp), allocatable, intent(out) :: mass(:, :)
    !> How good the reduced model is
    type(quality_type), intent(out) :: quality
    !> A step failed
    type(error_type), allocatable, intent(out) :: error
    integer :: wanted
    real(wp) :: worst

    call take_condensation_step(work, error)
    if (.not. allocated(error)) call take_constraint_step(work, error)
    if (.not. allocated(error)) call take_response_step(work, error)
    if (.not. allocated(error)) call count_wanted(work, wanted, error)
    do while (.not. allocated(error))
      call take_modes_step(work, wanted, modes, error)
      if (.not. allocated(error)) call take_correction_step(work, error)
      if (.not. allocated(error)) call take_mass_step(work, mass, error)
      if (.not. allocated(error)) call take_indicator_step(work, modes, mass, quality, error)
      if (allocated(error)) return
      worst = quality%worst()
      associate (options => work%options)
        if (options%error_target <= 0.0_wp .or. worst <= options%error_target) return
        call work%need_mass(error)
        if (allocated(error)) return
        if (work%report%modes >= work%most_modes) return
      end associate
      wanted = min(2*work%report%modes, work%most_modes)
      call work%progress%say('the error of the reduced model is '//number_text(worst)//': twice as many modes')
      call work%store%put_numbers(work%split, 'count', [real(wanted, wp)], error)
      if (.not. allocated(error)) call work%forget_modes()
    end do
  end subroutine take_interior_steps

  !> Constraint modes, those of them that are not there yet.
  subroutine take_constraint_step(work, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    if (work%report%condensed == 1) return
    if (work%store%has_all(work%boundary_blocks())) return
    call work%need_factor(error)
    if (allocated(error)) return
    call work%begin(step_constraint)
    call compute_constraint_modes(work%split, work%stiffness, work%factor, work%boundary_blocks(), work%store, work%progress, &
                                  work%report%constraint_residual, error)
    call work%finish(step_constraint)
    if (.not. allocated(error)) call work%save_report(error)
  end subroutine take_constraint_step

  !> Static responses to loads and monitors.
  subroutine take_response_step(work, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: responses(:, :)
    logical :: done

    done = size(work%vectors, 2) == 0
    if (.not. done) done = work%store%has(response_block(work))
    if (done) return
    call work%need_factor(error)
    if (allocated(error)) return
    call work%begin(step_correction)
    call compute_static_responses(work%split, work%factor, work%vectors, responses, error)
    if (.not. allocated(error)) call work%store%put(work%split, response_block(work), responses, error)
    call work%finish(step_correction)
  end subroutine take_response_step

  !> Number of modes asked for: directly, by a frequency, or for an error, what doubling has come to.
  subroutine count_wanted(work, wanted, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> How many modes are to be kept
    integer, intent(out) :: wanted
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:)

    if (work%store%has_numbers('count')) then
      call work%store%get_numbers(work%split, 'count', numbers, error)
      if (.not. allocated(error)) wanted = nint(numbers(1))
      return
    end if
    wanted = work%options%modes
    if (work%options%error_target > 0.0_wp) then
      call work%need_mass(error)
      if (allocated(error)) return
      wanted = min(first_guess, work%most_modes)
    end if
    if (wanted >= 0) return
    ! Never two factorisations at once.
    call work%release_factor()
    call work%need_stiffness(error)
    if (.not. allocated(error)) call work%need_mass(error)
    if (allocated(error)) return
    call work%begin(step_count)
    call count_modes_up_to(work%stiffness%interior, work%mass, work%options%max_frequency_hz, work%factor_options(), &
                           work%progress, wanted, error)
    call work%finish(step_count)
    if (.not. allocated(error)) call work%store%put_numbers(work%split, 'count', [real(wanted, wp)], error)
  end subroutine count_wanted

  !> Fixed-interface modes.
  subroutine take_modes_step(work, wanted, modes, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Number of modes
    integer, intent(in) :: wanted
    !> Fixed-interface modes and their frequencies
    type(fixed_interface_modes_type), intent(out) :: modes
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    if (work%store%has_numbers('modes')) then
      call modes%restore(work%split, work%store, error)
      return
    end if
    call work%need_factor(error)
    if (allocated(error)) return
    call work%begin(step_modes)
    associate (how => eigensolver_type(work%options%eigensolver, work%options%tolerance, work%options%block_vectors))
      call compute_fixed_interface_modes(work%split, work%stiffness%interior, work%mass, work%factor, wanted, how, &
                                         work%block_size, work%store, work%progress, modes, error)
    end associate
    call work%finish(step_modes)
    if (allocated(error)) return
    work%report%modes = size(modes%frequency_hz)
    work%report%eigensolver = work%options%eigensolver
    work%report%mode_solves = work%report%mode_solves + modes%solves
    work%report%mode_residual = maxval([0.0_wp, modes%residual])
    call work%save_report(error)
    if (.not. allocated(error)) call modes%keep(work%split, work%store, error)
  end subroutine take_modes_step

  !> Static corrections from the static responses.
  subroutine take_correction_step(work, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: responses(:, :)
    type(tMat) :: mass
    logical :: done
    PetscErrorCode :: ierr

    done = work%store%has_numbers('correction')
    if (size(work%vectors, 2) > 0 .and. .not. done) then
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
    end if
    work%report%coordinates = work%report%boundary + work%report%modes + work%report%corrections
  end subroutine take_correction_step

  !> The mass projected on the basis.
  subroutine take_mass_step(work, mass, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Mass matrix of the interior
    real(wp), allocatable, intent(out) :: mass(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(projected_type) :: matrices(1)
    real(wp), allocatable :: numbers(:)
    PetscErrorCode :: ierr

    if (work%store%has_numbers('mass')) then
      call work%store%get_numbers(work%split, 'mass', numbers, error)
      if (.not. allocated(error)) mass = reshape(numbers, [work%report%coordinates, work%report%coordinates])
      return
    end if
    call work%begin(step_project)
    allocate (matrices(1)%slices(1))
    call work%read_matrix('mass', matrices(1)%slices(1), error)
    if (allocated(error)) return
    call project_matrices(work%split, work%basis_blocks(), work%store, panel_columns(work, 1), work%progress, matrices, error)
    if (.not. allocated(error)) call move_alloc(matrices(1)%reduced, mass)
    if (work%report%condensed == 1 .and. .not. allocated(error)) &
      call add_boundary_mass(work, work%inner_blocks(), matrices(1)%slices(1), mass, error)
    call MatDestroy(matrices(1)%slices(1), ierr)
    call work%finish(step_project)
    if (allocated(error)) return
    call work%store%put_numbers(work%split, 'mass', reshape(mass, [size(mass)]), error)
  end subroutine take_mass_step

  !> How far the reduced model is from the full one.
  subroutine take_indicator_step(work, modes, mass, quality, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Fixed-interface modes and their frequencies
    type(fixed_interface_modes_type), intent(in) :: modes
    !> Mass matrix of the interior
    real(wp), intent(in) :: mass(:, :)
    !> Errors estimated of the reduced model
    type(quality_type), intent(out) :: quality
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(examined_type) :: examined
    real(wp) :: top_hz
    PetscErrorCode :: ierr

    if (work%store%has_numbers('quality')) then
      call quality%restore(work%split, work%store, error)
      return
    end if
    top_hz = work%options%top_frequency_hz
    if (top_hz <= 0.0_wp .and. size(modes%frequency_hz) > 0) top_hz = modes%frequency_hz(size(modes%frequency_hz))/1.5_wp
    if (top_hz <= 0.0_wp) then
      call quality%clear(size(work%vectors, 2))
      return
    end if
    call work%need_factor(error)
    if (allocated(error)) return
    call work%progress%step('error indicator', 0, 1)
    call work%begin(step_indicator)
    examined%stiffness = work%stiffness
    examined%interior_mass = work%mass
    examined%factor = work%factor
    examined%blocks = work%inner_blocks()
    examined%store = work%store
    examined%vectors = work%vectors
    examined%reduced_mass = mass
    call work%read_matrix('mass', examined%mass, error)
    if (.not. allocated(error)) call reduce_stiffness(work, modes, examined%reduced_stiffness, error)
    if (.not. allocated(error)) call reduce_vectors(work, examined%reduced_vectors, error)
    if (.not. allocated(error)) call indicate_errors(work%split, examined, top_hz, quality, error)
    call MatDestroy(examined%mass, ierr)
    call work%finish(step_indicator)
    if (.not. allocated(error) .and. size(quality%error) > 0) work%report%worst_error = quality%worst()
    if (.not. allocated(error)) call work%save_report(error)
    if (.not. allocated(error)) call quality%keep(work%split, work%store, error)
    call work%progress%step('error indicator', 1, 1)
  end subroutine take_indicator_step

  !> The reduced stiffness as theory has it: K_bb + K_bi Psi, eigenvalues, corrections; good enough to find errors by.
  subroutine reduce_stiffness(work, modes, stiffness, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    !> Fixed-interface modes and their frequencies
    type(fixed_interface_modes_type), intent(in) :: modes
    !> Stiffness matrix of the interior
    real(wp), allocatable, intent(out) :: stiffness(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(block_type), allocatable :: blocks(:)
    real(wp), allocatable :: columns(:, :), forces(:, :)
    integer :: i, m
    PetscErrorCode :: ierr

    allocate (stiffness(work%report%coordinates, work%report%coordinates), source=0.0_wp)
    m = work%report%boundary
    blocks = work%boundary_blocks()
    if (work%report%condensed == 1) then
      stiffness(:m, :m) = work%condensed%stiffness
      blocks = blocks(:0)
    end if
    do i = 1, size(blocks)
      allocate (columns(work%split%rows(), blocks(i)%columns()), forces(size(work%split%boundary_rows), blocks(i)%columns()))
      call work%store%get(work%split, blocks(i), columns, error)
      if (allocated(error)) return
      call multiply_transposed_block(work%stiffness%columns, columns, forces, ierr)
      call raise_petsc(error, ierr, 'estimating the error of the reduced model')
      if (allocated(error)) return
      stiffness(work%split%boundary_numbers, blocks(i)%first:blocks(i)%last) = forces
      deallocate (columns, forces)
    end do
    if (size(blocks) > 0) call work%split%ranks%sum(stiffness)
    stiffness(:m, :m) = 0.5_wp*(stiffness(:m, :m) + transpose(stiffness(:m, :m)))
    do i = 1, size(modes%frequency_hz)
      stiffness(m + i, m + i) = modes%eigenvalue(i)
    end do
    m = m + size(modes%frequency_hz)
    if (work%report%corrections > 0) call correction_stiffness(work, stiffness(m + 1:, m + 1:), error)
  end subroutine reduce_stiffness

  subroutine correction_stiffness(work, stiffness, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    !> Stiffness matrix of the interior
    real(wp), intent(out) :: stiffness(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :), inside(:, :), forces(:, :), product(:, :)
    PetscErrorCode :: ierr

    stiffness = 0.0_wp
    allocate (columns(work%split%rows(), size(stiffness, 2)))
    call work%store%get(work%split, block_type('correction', 1, size(stiffness, 2)), columns, error)
    if (allocated(error)) return
    inside = columns(work%split%interior_rows, :)
    allocate (forces, mold=inside)
    call multiply_block(work%stiffness%interior, inside, forces, ierr)
    call raise_petsc(error, ierr, 'estimating the error of the reduced model')
    product = transposed_product(inside, forces)
    call work%split%ranks%sum(product)
    stiffness = product
  end subroutine correction_stiffness

  !> Columns of which the products of so many matrices fill a third of the free memory.
  integer function panel_columns(work, matrices) result(columns)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    integer, intent(in) :: matrices
    real(wp) :: available

    available = -free_megabytes()
    available = -work%split%ranks%largest(available)
    columns = int(min(1.0e4_wp, available/3.0_wp*2.0_wp**17/(real(matrices, wp)*work%split%n)))
  end function panel_columns

  pure function response_block(work) result(block)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    type(block_type) :: block

    block = block_type('response', 1, size(work%vectors, 2))
  end function response_block

  pure function number_text(x) result(text)
    !> Columns, this rank's rows
    real(wp), intent(in) :: x
    character(:), allocatable :: text
    character(12) :: number

    write (number, '(es8.1)') x
    text = trim(adjustl(number))
  end function number_text
end module attrito_reduce_interior_steps
