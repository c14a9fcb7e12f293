#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> Fixed-interface modes: the lowest vibrations of the interior with the boundary held.
!>
!> $$ K_{ii} \phi = \lambda M_{ii} \phi, \qquad \phi^T M_{ii} \phi = 1, \qquad \omega = \sqrt{\lambda} $$
!>
!> SLEPc's Krylov-Schur method, or block Lanczos, on K_ii^{-1} M_ii, with the factors that the constraint modes use too. A few modes more
!> than asked for are computed: they show where the gap is in which the count is checked, and a mode with a twin is not torn from it.
!> The residual of a mode is the norm of phi - lambda K_ii^{-1} M_ii phi in M_ii, which bounds its relative error in lambda.
module attrito_reduce_fixed_interface_modes
  use petscmat
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_block_lanczos, only: lanczos_type, new_lanczos
  use attrito_reduce_column_store, only: block_type, column_store_type, new_blocks
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_interior_pencil, only: interior_pencil_type
  use attrito_reduce_krylov_schur, only: find_by_krylov_schur, krylov_schur_type
  use attrito_reduce_progress, only: progress_type
  use attrito_reduce_rayleigh_ritz, only: rayleigh_ritz
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: fixed_interface_modes_type, eigensolver_type, compute_fixed_interface_modes, mode_blocks

  type :: fixed_interface_modes_type
    !> Natural frequencies in Hz, ascending
    real(wp), allocatable :: frequency_hz(:)
    !> Relative residuals
    real(wp), allocatable :: residual(:)
    !> An eigenvalue free of modes, above the last kept one, and the number of modes found below it
    real(wp) :: shift = 0.0_wp
    integer :: below_shift = 0
    !> Vectors that the eigensolver has solved for
    integer :: solves = 0
  contains
    procedure :: keep
    procedure :: restore
    procedure :: eigenvalue
  end type fixed_interface_modes_type

  !> How to find modes
  type :: eigensolver_type
    !> `slepc` or `block_lanczos`
    character(16) :: name = 'slepc'
    !> Relative residual to reach
    real(wp) :: tolerance = 1.0e-12_wp
    !> Vectors solved for at a time, where the solver has blocks
    integer :: width = 16
  end type eigensolver_type

  !> Modes computed beyond those asked for
  integer, parameter :: margin = 6 ! guess
  !> Relative distance of eigenvalues under which modes are twins, and over which a gap is wide enough for the shift
  real(wp), parameter :: twins = 1.0e-7_wp, gap = 1.0e-4_wp ! guess

contains

  !> Compute the lowest modes, `wanted` of them, or one more or two where the last has a twin; store their shapes in blocks.
  subroutine compute_fixed_interface_modes(split, stiffness, mass, factor, wanted, eigensolver, block_size, store, progress, &
                                           self, error)
    !> Boundary and interior
    type(split_type), intent(in) :: split
    !> K_ii and M_ii
    type(tMat), intent(in) :: stiffness, mass
    !> Factors of K_ii
    type(interior_factor_type), intent(in) :: factor
    !> Number of modes
    integer, intent(in) :: wanted
    !> Which one, and how
    type(eigensolver_type), intent(in) :: eigensolver
    !> Shapes stored in a block
    integer, intent(in) :: block_size
    !> Where the shapes go
    type(column_store_type), intent(in) :: store
    !> Who listens
    type(progress_type), intent(in) :: progress
    !> The modes
    type(fixed_interface_modes_type), intent(out) :: self
    !> Fewer modes than asked for
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: eigenvalues(:), shapes(:, :)
    integer :: kept, sought
    PetscErrorCode :: ierr

    allocate (self%frequency_hz(0), self%residual(0))
    if (wanted == 0) return
    call progress%step('fixed-interface modes', 0, wanted)
    sought = min(wanted + margin, split%n - split%boundary_count)
    associate (pencil => interior_pencil_type(split%ranks, mass, factor, progress, wanted))
      if (eigensolver%name == 'block_lanczos') then
        call find_by_lanczos(split, pencil, sought, eigensolver, eigenvalues, shapes, self%solves, ierr)
      else
        call find_by_slepc(split, stiffness, pencil, sought, eigensolver, eigenvalues, shapes, self%solves, ierr)
      end if
    end associate
    call progress%step('fixed-interface modes', wanted, wanted)
    call raise_petsc(error, ierr, 'computing the fixed-interface modes')
    if (.not. allocated(error) .and. size(eigenvalues) < wanted) call raise_too_few(size(eigenvalues), wanted, error)
    if (.not. allocated(error)) then
      call place_shift(eigenvalues, wanted, kept, self%shift, self%below_shift)
      self%frequency_hz = sqrt(max(eigenvalues(:kept), 0.0_wp))/two_pi
      deallocate (self%residual)
      allocate (self%residual(kept))
      call take_modes(shapes, mass, factor, split, eigenvalues(:kept), block_size, store, self, error)
    end if
  end subroutine compute_fixed_interface_modes

  !> Krylov-Schur by SLEPc, and one Rayleigh-Ritz step.
  subroutine find_by_slepc(split, stiffness, pencil, sought, eigensolver, eigenvalues, shapes, solves, status)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Stiffness matrix of the interior
    type(tMat), intent(in) :: stiffness
    !> Stiffness and mass of the interior
    type(interior_pencil_type), intent(in) :: pencil
    !> How many modes are asked for
    integer, intent(in) :: sought
    !> How to find modes
    type(eigensolver_type), intent(in) :: eigensolver
    !> Eigenvalues, ascending, (rad/s)^2; shapes of the modes, a column each
    real(wp), allocatable, intent(out) :: eigenvalues(:), shapes(:, :)
    !> How many systems were solved; 0: done, else the solver's code
    integer, intent(out) :: solves, status
    type(krylov_schur_type) :: search
    real(wp), allocatable :: start(:, :)

    call make_start(split, 1, start)
    search = krylov_schur_type(stiffness, pencil%mass_matrix, pencil%factor, pencil%progress, pencil%wanted)
    call find_by_krylov_schur(search, start(:, 1), sought, eigensolver%tolerance, shapes, status)
    if (status == 0) call rayleigh_ritz(pencil, eigensolver%width, shapes, eigenvalues, status)
    solves = search%solves
    if (status == 0) solves = solves + size(shapes, 2)
  end subroutine find_by_slepc

  !> Block Lanczos.
  subroutine find_by_lanczos(split, pencil, sought, eigensolver, eigenvalues, shapes, solves, status)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Stiffness and mass of the interior
    type(interior_pencil_type), intent(in) :: pencil
    !> How many modes are asked for
    integer, intent(in) :: sought
    !> How to find modes
    type(eigensolver_type), intent(in) :: eigensolver
    !> Eigenvalues, ascending, (rad/s)^2; shapes of the modes, a column each
    real(wp), allocatable, intent(out) :: eigenvalues(:), shapes(:, :)
    !> How many systems were solved; 0: done, else the solver's code
    integer, intent(out) :: solves, status
    type(lanczos_type) :: lanczos
    real(wp), allocatable :: start(:, :)
    integer :: n

    n = split%n - split%boundary_count
    associate (width => eigensolver%width)
      call make_start(split, min(width, n), start)
      call new_lanczos(lanczos, pencil, start, sought, min(max(2*sought, sought + 6*width), n + width), eigensolver%tolerance, status)
    end associate
    solves = lanczos%solves
    call move_alloc(lanczos%eigenvalues, eigenvalues)
    call move_alloc(lanczos%v, shapes)
  end subroutine find_by_lanczos

  !> Vectors to start from that do not depend on the number of ranks.
  pure subroutine make_start(split, width, start)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Columns of the block
    integer, intent(in) :: width
    !> This rank's rows [interior rows, width]
    real(wp), allocatable, intent(out) :: start(:, :)
    integer :: i

    allocate (start(size(split%interior_rows), width))
    do i = 1, width
      start(:, i) = cos(real(i, wp)*0.9_wp*real(split%first + split%interior_rows, wp)**2)
    end do
  end subroutine make_start

  !> Keep twins together, and find the first wide gap at or above the last kept mode.
  pure subroutine place_shift(eigenvalues, wanted, kept, shift, below)
    !> Ascending, at least `wanted`
    real(wp), intent(in) :: eigenvalues(:)
    !> How many modes are to be kept
    integer, intent(in) :: wanted
    !> Number of modes to keep
    integer, intent(out) :: kept
    !> Eigenvalue in the gap, and the number of modes below it
    real(wp), intent(out) :: shift
    !> How many modes lie below the shift
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

  !> omega^2 of a mode.
  pure real(wp) function eigenvalue(self, mode)
    class(fixed_interface_modes_type), intent(in) :: self
    !> Number of the mode
    integer, intent(in) :: mode

    eigenvalue = (two_pi*self%frequency_hz(mode))**2
  end function eigenvalue

  !> Runs of so many modes.
  pure function mode_blocks(modes, block_size) result(blocks)
    !> Number of modes; columns of a block
    integer, intent(in) :: modes, block_size
    type(block_type), allocatable :: blocks(:)

    blocks = new_blocks('mode', modes, block_size)
  end function mode_blocks

  !> Shapes of unit modal mass to disk, a block at a time, and their residuals.
  subroutine take_modes(found, mass, factor, split, eigenvalues, block_size, store, self, error)
    !> Shapes, of any scale [interior rows, modes or more]
    real(wp), intent(in) :: found(:, :)
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Factor of the interior stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Eigenvalues, ascending, (rad/s)^2
    real(wp), intent(in) :: eigenvalues(:)
    !> Columns of a block
    integer, intent(in) :: block_size
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    type(fixed_interface_modes_type), intent(inout) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(block_type), allocatable :: blocks(:)
    real(wp), allocatable :: shapes(:, :), columns(:, :)
    integer :: i
    PetscErrorCode :: ierr

    blocks = mode_blocks(size(eigenvalues), block_size)
    do i = 1, size(blocks)
      associate (first => blocks(i)%first, last => blocks(i)%last)
        shapes = found(:, first:last)
        call finish_shapes(split, mass, factor, eigenvalues(first:last), shapes, self%residual(first:last), ierr)
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
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Mass matrix of the interior
    type(tMat), intent(in) :: mass
    !> Factor of the interior stiffness
    type(interior_factor_type), intent(in) :: factor
    !> Eigenvalues, ascending, (rad/s)^2
    real(wp), intent(in) :: eigenvalues(:)
    !> Shapes of the modes, a column each
    real(wp), intent(inout), contiguous :: shapes(:, :)
    !> Relative residuals
    real(wp), intent(out) :: residual(:)
    !> PETSc's error code
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

  !> Unit modal mass, and a sign that does not depend on the number of ranks.
  subroutine normalise(split, shapes, inertia)
    !> Interior and boundary dofs, and this rank's share of them
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
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Terms of the sums, this rank's rows
    real(wp), intent(in) :: terms(:, :)
    real(wp) :: sums(size(terms, 2))

    sums = sum(terms, 1)
    call split%ranks%sum(sums)
  end function column_sums

  pure subroutine raise_too_few(found, wanted, error)
    !> How many modes were found; how many modes are to be kept
    integer, intent(in) :: found, wanted
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    character(100) :: text

    write (text, '(a, i0, a, i0, a)') 'only ', found, ' of ', wanted, ' fixed-interface modes were found'
    call raise(error, trim(text) // ': ask for fewer, or look for dofs without mass')
  end subroutine raise_too_few
end module attrito_reduce_fixed_interface_modes
