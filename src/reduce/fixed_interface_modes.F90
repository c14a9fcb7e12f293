#include <slepc/finclude/slepceps.h>
#include "petsc_compatibility.h"
!> Fixed-interface modes: the lowest vibrations of the interior with the boundary held.
!>
!> $$ K_{ii} \phi = \lambda M_{ii} \phi, \qquad \phi^T M_{ii} \phi = 1, \qquad \omega = \sqrt{\lambda} $$
!>
!> Krylov-Schur on K_ii^{-1} M_ii, with the factors that the constraint modes use too. A few modes more than asked for are
!> computed: they show where the gap is in which the count is checked, and a mode with a twin is not torn from it.
!> The residual of a mode is the norm of phi - lambda K_ii^{-1} M_ii phi in M_ii, which bounds its relative error in lambda.
!> Source: Stewart, SIAM J. Matrix Anal. Appl. 23 (2002) 601-614, doi:10.1137/S0895479800371529.
module attrito_reduce_fixed_interface_modes
  use slepceps
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_column_store, only: block_type, column_store_type, new_blocks
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: fixed_interface_modes_type, compute_fixed_interface_modes, mode_blocks

  type :: fixed_interface_modes_type
    !> Natural frequencies in Hz, ascending
    real(wp), allocatable :: frequency_hz(:)
    !> Relative residuals
    real(wp), allocatable :: residual(:)
    !> An eigenvalue free of modes, above the last kept one, and the number of modes found below it
    real(wp) :: shift = 0.0_wp
    integer :: below_shift = 0
  contains
    procedure :: keep
    procedure :: restore
  end type fixed_interface_modes_type

  !> Modes computed beyond those asked for
  integer, parameter :: margin = 6
  !> Relative distance of eigenvalues under which modes are twins, and over which a gap is wide enough for the shift
  real(wp), parameter :: twins = 1.0e-7_wp, gap = 1.0e-4_wp

contains

  !> Compute the lowest modes, `wanted` of them, or one more or two where the last has a twin; store their shapes in blocks.
  subroutine compute_fixed_interface_modes(split, stiffness, mass, factor, wanted, tolerance, block_size, store, progress, self, &
                                           error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> K_ii and M_ii
    type(tMat), intent(in) :: stiffness, mass
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> Number of modes
    integer, intent(in) :: wanted
    !> Relative residual to reach
    real(wp), intent(in) :: tolerance
    !> Shapes in a block
    integer, intent(in) :: block_size
    !> Where the shapes go
    type(column_store_type), intent(in) :: store
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> The modes
    type(fixed_interface_modes_type), intent(out) :: self
    !> Fewer modes than asked for
    type(error_type), allocatable, intent(out) :: error
    type(tEPS) :: solver
    real(wp), allocatable :: eigenvalues(:)
    integer :: kept
    PetscErrorCode :: ierr

    allocate (self%frequency_hz(0), self%residual(0))
    if (wanted == 0) return
    call progress%step('fixed-interface modes', 0, wanted)
    call find_eigenvalues(stiffness, mass, factor, wanted, tolerance, solver, eigenvalues, ierr)
    call progress%step('fixed-interface modes', wanted, wanted)
    call raise_petsc(error, ierr, 'computing the fixed-interface modes')
    if (.not. allocated(error) .and. size(eigenvalues) < wanted) call raise_too_few(size(eigenvalues), wanted, error)
    if (.not. allocated(error)) then
      call place_shift(eigenvalues, wanted, kept, self%shift, self%below_shift)
      self%frequency_hz = sqrt(max(eigenvalues(:kept), 0.0_wp))/two_pi
      deallocate (self%residual)
      allocate (self%residual(kept))
      call take_modes(solver, mass, factor, split, eigenvalues(:kept), block_size, store, self, error)
    end if
    call EPSDestroy(solver, ierr)
  end subroutine compute_fixed_interface_modes

  subroutine find_eigenvalues(stiffness, mass, factor, wanted, tolerance, solver, eigenvalues, ierr)
    type(tMat), intent(in) :: stiffness, mass
    type(interior_factor_type), intent(in) :: factor
    integer, intent(in) :: wanted
    real(wp), intent(in) :: tolerance
    !> Holds the mode shapes; the caller destroys it
    type(tEPS), intent(out) :: solver
    !> Those that converged, ascending
    real(wp), allocatable, intent(out) :: eigenvalues(:)
    PetscErrorCode, intent(out) :: ierr
    type(tST) :: transform
    PetscMPIInt :: comm
    PetscInt :: n, converged, i
    PetscScalar :: imaginary

    allocate (eigenvalues(0))
    PetscCall(PetscObjectGetComm(stiffness, comm, ierr))
    PetscCall(MatGetSize(stiffness, n, PETSC_NULL_INTEGER, ierr))
    PetscCall(EPSCreate(comm, solver, ierr))
    PetscCall(EPSSetOperators(solver, stiffness, mass, ierr))
    PetscCall(EPSSetProblemType(solver, EPS_GHEP, ierr))
    PetscCall(EPSSetTarget(solver, 0.0_wp, ierr))
    PetscCall(EPSSetWhichEigenpairs(solver, EPS_TARGET_MAGNITUDE, ierr))
    PetscCall(EPSSetDimensions(solver, min(wanted + margin, n), PETSC_DEFAULT_INTEGER, PETSC_DEFAULT_INTEGER, ierr))
    PetscCall(EPSSetTolerances(solver, tolerance, 500, ierr))
    ! One more solve for each mode, which would blow up what rounding leaves of the lowest modes in the others.
    PetscCall(EPSSetPurify(solver, PETSC_FALSE, ierr))
    PetscCall(EPSGetST(solver, transform, ierr))
    PetscCall(STSetType(transform, STSINVERT, ierr))
    PetscCall(STSetKSP(transform, factor%solver, ierr))
    PetscCall(EPSSetFromOptions(solver, ierr))
    PetscCall(EPSSolve(solver, ierr))
    PetscCall(EPSGetConverged(solver, converged, ierr))
    deallocate (eigenvalues)
    allocate (eigenvalues(converged))
    do i = 1, converged
      PetscCall(EPSGetEigenvalue(solver, i - 1, eigenvalues(i), imaginary, ierr))
    end do
  end subroutine find_eigenvalues

  !> Keep twins together, and find the first wide gap at or above the last kept mode.
  pure subroutine place_shift(eigenvalues, wanted, kept, shift, below)
    !> Ascending, at least `wanted`
    real(wp), intent(in) :: eigenvalues(:)
    integer, intent(in) :: wanted
    !> Number of modes to keep
    integer, intent(out) :: kept
    !> Eigenvalue in the gap, and the number of modes below it
    real(wp), intent(out) :: shift
    integer, intent(out) :: below

    kept = wanted
    do while (kept < size(eigenvalues))
      if (eigenvalues(kept + 1) > eigenvalues(kept)*(1.0_wp + twins)) exit
      kept = kept + 1
    end do
    do below = kept, size(eigenvalues) - 1
      shift = 0.5_wp*(eigenvalues(below) + eigenvalues(below + 1))
      if (eigenvalues(below + 1) > eigenvalues(below)*(1.0_wp + gap)) return
    end do
    below = size(eigenvalues)
    shift = eigenvalues(below)*(1.0_wp + 0.5_wp*gap)
  end subroutine place_shift

  !> Keep what is not shapes for whoever takes up an interrupted reduction.
  subroutine keep(self, split, store, error)
    class(fixed_interface_modes_type), intent(in) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Where to
    type(column_store_type), intent(in) :: store
    !> The disk is full
    type(error_type), allocatable, intent(out) :: error

    call store%put_numbers(split, 'modes', [self%shift, real(self%below_shift, wp), self%frequency_hz, self%residual], error)
  end subroutine keep

  !> Take up what was kept.
  subroutine restore(self, split, store, error)
    class(fixed_interface_modes_type), intent(inout) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Where from
    type(column_store_type), intent(in) :: store
    !> It is not there
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:)
    integer :: modes

    call store%get_numbers(split, 'modes', numbers, error)
    if (allocated(error)) return
    modes = (size(numbers) - 2)/2
    self%shift = numbers(1)
    self%below_shift = nint(numbers(2))
    self%frequency_hz = numbers(3:2 + modes)
    self%residual = numbers(3 + modes:)
  end subroutine restore

  !> Runs of so many modes.
  pure function mode_blocks(modes, block_size) result(blocks)
    integer, intent(in) :: modes, block_size
    type(block_type), allocatable :: blocks(:)

    blocks = new_blocks('mode', modes, block_size)
  end function mode_blocks

  !> Shapes of unit modal mass to disk, a block at a time, and their residuals.
  subroutine take_modes(solver, mass, factor, split, eigenvalues, block_size, store, self, error)
    type(tEPS), intent(in) :: solver
    type(tMat), intent(in) :: mass
    type(interior_factor_type), intent(in) :: factor
    type(split_type), intent(in) :: split
    real(wp), intent(in) :: eigenvalues(:)
    integer, intent(in) :: block_size
    type(column_store_type), intent(in) :: store
    type(fixed_interface_modes_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    type(block_type), allocatable :: blocks(:)
    real(wp), allocatable :: shapes(:, :), columns(:, :)
    integer :: i
    PetscErrorCode :: ierr

    blocks = mode_blocks(size(eigenvalues), block_size)
    do i = 1, size(blocks)
      associate (first => blocks(i)%first, last => blocks(i)%last)
        allocate (shapes(size(split%interior_rows), blocks(i)%columns()))
        call copy_shapes(solver, mass, first, shapes, ierr)
        if (ierr == 0) call finish_shapes(split, mass, factor, eigenvalues(first:last), shapes, self%residual(first:last), ierr)
        call raise_petsc(error, ierr, 'taking the fixed-interface modes')
        if (allocated(error)) return
        allocate (columns(split%rows(), size(shapes, 2)), source=0.0_wp)
        columns(split%interior_rows, :) = shapes
        deallocate (shapes)
        call store%put(split, blocks(i), columns, error)
        if (allocated(error)) return
        deallocate (columns)
      end associate
    end do
  end subroutine take_modes

  !> Unit modal mass, and the residuals.
  subroutine finish_shapes(split, mass, factor, eigenvalues, shapes, residual, ierr)
    type(split_type), intent(in) :: split
    type(tMat), intent(in) :: mass
    type(interior_factor_type), intent(in) :: factor
    real(wp), intent(in) :: eigenvalues(:)
    real(wp), intent(inout), contiguous :: shapes(:, :)
    real(wp), intent(out) :: residual(:)
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: inertia(:, :), rest(:, :)
    integer :: i

    allocate (inertia, rest, mold=shapes)
    residual = 0.0_wp
    PetscCall(multiply_block(mass, shapes, inertia, ierr))
    call normalise(split, shapes, inertia)
    PetscCall(factor%solve(inertia, rest, ierr))
    do i = 1, size(eigenvalues)
      rest(:, i) = shapes(:, i) - eigenvalues(i)*rest(:, i)
    end do
    PetscCall(multiply_block(mass, rest, inertia, ierr))
    residual = sqrt(max(column_sums(split, rest*inertia), 0.0_wp))
  end subroutine finish_shapes

  subroutine copy_shapes(solver, mass, first, shapes, ierr)
    type(tEPS), intent(in) :: solver
    type(tMat), intent(in) :: mass
    integer, intent(in) :: first
    real(wp), intent(out) :: shapes(:, :)
    PetscErrorCode, intent(out) :: ierr
    type(tVec) :: shape
    PetscScalar, pointer :: values(:)
    integer :: i

    PetscCall(MatCreateVecs(mass, PETSC_NULL_VEC, shape, ierr))
    do i = 1, size(shapes, 2)
      PetscCall(EPSGetEigenvector(solver, first + i - 2, shape, PETSC_NULL_VEC, ierr))
      PetscCall(VecGetArrayRead(shape, values, ierr))
      shapes(:, i) = values
      PetscCall(VecRestoreArrayRead(shape, values, ierr))
    end do
    PetscCall(VecDestroy(shape, ierr))
  end subroutine copy_shapes

  !> Unit modal mass, and a sign that does not depend on the number of ranks.
  subroutine normalise(split, shapes, inertia)
    type(split_type), intent(in) :: split
    !> phi and M_ii phi
    real(wp), intent(inout) :: shapes(:, :), inertia(:, :)
    real(wp), dimension(size(shapes, 2)) :: modal_mass, sign_reference, factor
    integer :: i

    modal_mass = column_sums(split, shapes*inertia)
    sign_reference = column_sums(split, shapes*spread(cos(0.7_wp*(split%first + split%interior_rows)), 2, size(shapes, 2)))
    factor = sign(1.0_wp/sqrt(modal_mass), sign_reference)
    do i = 1, size(shapes, 2)
      shapes(:, i) = factor(i)*shapes(:, i)
      inertia(:, i) = factor(i)*inertia(:, i)
    end do
  end subroutine normalise

  !> Sums of columns over the rows of all ranks.
  function column_sums(split, terms) result(sums)
    type(split_type), intent(in) :: split
    real(wp), intent(in) :: terms(:, :)
    real(wp) :: sums(size(terms, 2))

    sums = sum(terms, 1)
    call split%ranks%sum(sums)
  end function column_sums

  pure subroutine raise_too_few(found, wanted, error)
    integer, intent(in) :: found, wanted
    type(error_type), allocatable, intent(out) :: error
    character(100) :: text

    write (text, '(a, i0, a, i0, a)') 'only ', found, ' of ', wanted, ' fixed-interface modes were found'
    call raise(error, trim(text) // ': ask for fewer, or look for dofs without mass')
  end subroutine raise_too_few
end module attrito_reduce_fixed_interface_modes
