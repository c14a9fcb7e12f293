#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> The steps of a reduction that is to give back the motion of few dofs: no constraint modes, but the boundary condensed.
!>
!> $$ \tilde K = \begin{pmatrix} \tilde K_{bb} & 0 \\ 0 & \Phi^T K \Phi \end{pmatrix}, \qquad
!>    \tilde M = \begin{pmatrix} \tilde M_{bb} & (I\ \Psi^T) M \Phi \\ \cdot & \Phi^T M \Phi \end{pmatrix} $$
!>
!> With E numbers in the factors of K_ii, nb boundary dofs of n and r dofs to recover, constraint modes take 4 E nb operations and the
!> projection of K and M on them 2 n nb^2; condensing takes four times the complex operations of an elimination, and 4 E r. The way of
!> fewer is taken; where condensing fails, as memory may be short, it is the other. An elimination that keeps the boundary takes no
!> less than one of K_ii, so small boundaries are not even analysed.
module attrito_reduce_condensed_steps
  use petscmat
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_file, only: close_file, hdf5_file_type, open_file
  use attrito_core_kinds, only: wp
  use attrito_core_machine_memory, only: free_megabytes
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_boundary_projection, only: project_on_boundary
  use attrito_reduce_column_store, only: block_type
  use attrito_reduce_complex_schur, only: complex_schur_type, new_complex_schur
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_model_matrix, only: read_lower_triangle, triangle_type
  use attrito_reduce_project, only: project_vectors
  use attrito_reduce_report, only: step_constraint
  use attrito_reduce_static_condensation, only: imaginary_step, take_apart
  use attrito_reduce_workspace, only: workspace_type
  implicit none
  private
  public :: take_condensation_step, add_boundary_mass, add_boundary_stiffness, reduce_vectors

  !> Dofs recovered at a time
  integer, parameter :: rows_together = 128 ! conventional
  !> Part of the free memory that the elimination may take
  real(wp), parameter :: memory_share = 0.8_wp ! guess

  !> Entries of a sparse matrix, those of one place to be summed
  type :: entries_type
    !> From 1
    integer, allocatable :: rows(:), columns(:)
    complex(wp), allocatable :: values(:)
  end type entries_type

contains

  !> Condense the boundary where that is possible and takes fewer operations than constraint modes.
  subroutine take_condensation_step(work, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> A step failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:)

    work%report%condensed = 0
    if (.not. may_be_condensed(work)) return
    if (work%store%has_numbers('condensed')) then
      call work%store%get_numbers(work%split, 'condensed', numbers, error)
      if (allocated(error)) return
      call work%condensed%take_numbers(work%split%boundary_count, size(work%vectors, 2), size(work%options%recovered), numbers)
      work%report%condensed = 1
      return
    end if
    if (work%store%has_all(work%boundary_blocks())) return
    call work%need_factor(error)
    if (allocated(error)) return
    if (.not. is_worth_analysing(work)) return
    call work%progress%step('condensation', 0, 1)
    call work%begin(step_constraint)
    call try_condensing(work, error)
    if (.not. allocated(error) .and. work%report%condensed == 1) call project(work, error)
    call work%finish(step_constraint)
    if (.not. allocated(error)) call work%save_report(error)
    if (.not. allocated(error) .and. work%report%condensed == 1) &
      call work%store%put_numbers(work%split, 'condensed', work%condensed%numbers(), error)
    call work%progress%step('condensation', 1, 1)
  end subroutine take_condensation_step

  !> Condense the boundary if that is cheaper, or asked for. Where that fails and was not asked for, constraint modes are the way.
  subroutine try_condensing(work, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> The model cannot be read, or condensing was asked for and has failed
    type(error_type), allocatable, intent(out) :: error
    type(complex_schur_type) :: schur
    type(entries_type) :: entries
    type(error_type), allocatable :: failed
    real(wp) :: step

    call read_entries(work, entries, step, error)
    if (allocated(error)) return
    call new_complex_schur(schur, work%split%ranks, work%split%n, work%split%boundary + 1, entries%rows, entries%columns, &
                           entries%values, failed)
    entries = entries_type()
    if (.not. allocated(failed)) then
      if (is_cheaper(work, schur)) call condense(work, schur, step, failed)
    end if
    call schur%destroy()
    if (.not. allocated(failed)) return
    if (work%options%condense == 'yes') then
      call move_alloc(failed, error)
    else
      call work%progress%say(failed%message//': constraint modes')
    end if
  end subroutine try_condensing

  !> Other matrices need the constraint modes, and so does the motion of all dofs.
  pure logical function may_be_condensed(work)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work

    may_be_condensed = allocated(work%options%recovered) .and. work%split%boundary_count > 0 .and. &
                       .not. (work%has_damping .or. work%has_gyroscopic) .and. work%options%condense /= 'no'
  end function may_be_condensed

  !> Operations of constraint modes and of the projection on them.
  pure real(wp) function operations_of_modes(work)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    real(wp) :: boundary

    boundary = work%split%boundary_count
    operations_of_modes = 4*work%factor%entries*boundary + 2*work%split%n*boundary**2
  end function operations_of_modes

  !> Can condensing take fewer operations?
  pure logical function is_worth_analysing(work)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work

    is_worth_analysing = work%options%condense == 'yes' .or. &
                         4*(work%factor%flops + work%factor%entries*size(work%options%recovered)) < operations_of_modes(work)
  end function is_worth_analysing

  !> Does it, and is there memory for it?
  logical function is_cheaper(work, schur)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    !> Analysed
    type(complex_schur_type), intent(in) :: schur
    real(wp) :: operations, available
    character(160) :: text

    operations = 4*(schur%operations + work%factor%entries*size(work%options%recovered))
    available = -free_megabytes()
    available = -work%split%ranks%largest(available)
    if (work%options%memory_megabytes > 0.0_wp) available = min(available, work%options%memory_megabytes)
    is_cheaper = work%options%condense == 'yes' .or. &
                 (operations < operations_of_modes(work) .and. schur%megabytes < memory_share*available)
    write (text, '(a, es8.1, a, es8.1, a, i0, a, i0, a)') 'condensing the boundary takes', operations, &
      ' operations, constraint modes and projection', operations_of_modes(work), '; memory ', nint(schur%megabytes), &
      ' MB, free ', nint(min(available, 1.0e9_wp)), ' MB'
    call work%progress%say(trim(text)//trim(merge(': condensed       ', ': constraint modes', is_cheaper)))
  end function is_cheaper

  !> This rank's entries of K + i h M, on and below the diagonal.
  subroutine read_entries(work, entries, step, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    !> What the matrix is made of
    type(entries_type), intent(out) :: entries
    !> h
    real(wp), intent(out) :: step
    !> The model cannot be read
    type(error_type), allocatable, intent(out) :: error
    type(triangle_type) :: stiffness, mass
    type(hdf5_file_type) :: file

    step = 0.0_wp
    associate (ranks => work%split%ranks)
      call open_file(file, ranks%handle, work%path, error)
      if (allocated(error)) return
      call read_lower_triangle(file, ranks, 'stiffness', stiffness, error)
      if (.not. allocated(error)) call read_lower_triangle(file, ranks, 'mass', mass, error)
      call close_file(file)
      if (allocated(error)) return
      step = imaginary_step(ranks%largest(maxval([0.0_wp, abs(stiffness%values)])), ranks%largest(maxval([0.0_wp, abs(mass%values)])))
    end associate
    entries%rows = [stiffness%rows, mass%rows]
    entries%columns = [stiffness%columns, mass%columns]
    entries%values = [cmplx(stiffness%values, 0.0_wp, wp), cmplx(0.0_wp, step*mass%values, wp)]
  end subroutine read_entries

  !> Eliminate the interior; both matrices on every rank.
  subroutine condense(work, schur, step, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Analysed
    type(complex_schur_type), intent(inout) :: schur
    !> h
    real(wp), intent(in) :: step
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    complex(wp), allocatable :: complement(:, :)
    integer :: i

    call schur%complement(complement, error)
    if (allocated(error)) return
    associate (condensed => work%condensed, m => work%split%boundary_count)
      allocate (condensed%stiffness(m, m), condensed%mass(m, m))
      if (work%split%ranks%is_root()) call take_apart(complement, step, condensed%stiffness, condensed%mass)
      do i = 1, m
        call work%split%ranks%broadcast(condensed%stiffness(:, i))
        call work%split%ranks%broadcast(condensed%mass(:, i))
      end do
    end associate
    work%report%condensed = 1
  end subroutine condense

  !> Loads and monitors, and the rows that are recovered.
  subroutine project(work, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(inout) :: work
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: units(:, :)
    integer :: first, last, i

    associate (condensed => work%condensed, split => work%split, m => work%split%boundary_count, dofs => work%options%recovered)
      allocate (condensed%vectors(m, size(work%vectors, 2)), condensed%recovered(m, size(dofs)))
      call project_on_boundary(split, work%stiffness, work%factor, work%vectors, condensed%vectors, error)
      do first = 1, size(dofs), rows_together
        if (allocated(error)) return
        last = min(first + rows_together - 1, size(dofs))
        allocate (units(split%rows(), last - first + 1), source=0.0_wp)
        do i = first, last
          associate (row => dofs(i) + 2 - split%first)
            if (row >= 1 .and. row <= split%rows()) units(row, i - first + 1) = 1.0_wp
          end associate
        end do
        call project_on_boundary(split, work%stiffness, work%factor, units, condensed%recovered(:, first:last), error)
        deallocate (units)
      end do
    end associate
  end subroutine project

  !> The whole reduced mass from that of modes and corrections.
  subroutine add_boundary_mass(work, blocks, full, mass, error)
    !> With the boundary condensed; the factors are needed
    type(workspace_type), intent(inout) :: work
    !> Modes and corrections
    type(block_type), intent(in) :: blocks(:)
    !> Mass of the full model
    type(tMat), intent(in) :: full
    !> [k, k] of modes and corrections, then [m, m]
    real(wp), allocatable, intent(inout) :: mass(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: whole(:, :), columns(:, :), inertia(:, :)
    integer :: i, m, offset
    PetscErrorCode :: ierr

    call work%need_factor(error)
    if (allocated(error)) return
    m = work%split%boundary_count
    offset = m
    call join(work%condensed%mass, mass, whole)
    do i = 1, size(blocks)
      allocate (columns(work%split%rows(), blocks(i)%columns()))
      call work%store%get(work%split, blocks(i), columns, error)
      if (allocated(error)) return
      allocate (inertia, mold=columns)
      call multiply_block(full, columns, inertia, ierr)
      call raise_petsc(error, ierr, 'projecting the mass on the boundary')
      if (allocated(error)) return
      call project_on_boundary(work%split, work%stiffness, work%factor, inertia, &
                               whole(:m, offset + 1:offset + size(columns, 2)), error)
      if (allocated(error)) return
      offset = offset + size(columns, 2)
      deallocate (columns, inertia)
    end do
    whole(m + 1:, :m) = transpose(whole(:m, m + 1:))
    call move_alloc(whole, mass)
  end subroutine add_boundary_mass

  !> The whole reduced stiffness from that of modes and corrections.
  pure subroutine add_boundary_stiffness(work, stiffness)
    !> With the boundary condensed
    type(workspace_type), intent(in) :: work
    !> [k, k] of modes and corrections, then [m, m]
    real(wp), allocatable, intent(inout) :: stiffness(:, :)
    real(wp), allocatable :: whole(:, :)

    call join(work%condensed%stiffness, stiffness, whole)
    call move_alloc(whole, stiffness)
  end subroutine add_boundary_stiffness

  !> T^T f of loads and monitors, whether the boundary was condensed or not.
  subroutine reduce_vectors(work, reduced, error)
    !> Store of columns, memory and steps of the reduction
    type(workspace_type), intent(in) :: work
    !> [m, vectors], the same on every rank
    real(wp), allocatable, intent(out) :: reduced(:, :)
    !> Columns are gone
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: inner(:, :)
    integer :: m

    call project_vectors(work%split, work%basis_blocks(), work%store, work%vectors, inner, error)
    if (work%report%condensed == 0 .or. allocated(error)) then
      call move_alloc(inner, reduced)
      return
    end if
    m = work%split%boundary_count
    allocate (reduced(m + size(inner, 1), size(inner, 2)))
    reduced(:m, :) = work%condensed%vectors
    reduced(m + 1:, :) = inner
  end subroutine reduce_vectors

  !> Two blocks on a diagonal.
  pure subroutine join(first, second, whole)
    !> Square
    real(wp), intent(in) :: first(:, :), second(:, :)
    !> Both, and zeros
    real(wp), allocatable, intent(out) :: whole(:, :)
    integer :: m

    m = size(first, 1)
    allocate (whole(m + size(second, 1), m + size(second, 1)), source=0.0_wp)
    whole(:m, :m) = first
    whole(m + 1:, m + 1:) = second
  end subroutine join
end module attrito_reduce_condensed_steps
