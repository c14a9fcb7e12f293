#include <petsc/finclude/petscmat.h>
#include "petsc_compatibility.h"
!> How far the reduced model is from the full one, by what its motions leave unbalanced inside the structure.
!>
!> A motion phi = T y of the reduced model leaves forces r on the interior, orthogonal to all kept modes. The modes that were dropped
!> would answer them; with x = K_ii^{-1} r and the ratio of the first two terms of the series in lambda,
!>
!> $$ \delta = r^T (K_{ii} - \lambda M_{ii})^{-1} r \approx \frac{r^T x}{1 - \rho}, \qquad
!>    \rho = \lambda \frac{x^T M_{ii} x}{r^T x} $$
!>
!> For a natural mode of the reduced model, r = (lambda M - K) phi, delta is what its eigenvalue (with unit modal mass) is too high,
!> to second order. For its response to a load a at omega, r_a = f_a - (K - omega^2 M) T y_a, and r_b likewise for a monitor b,
!> delta_ab is what the receptance between them lacks.
module attrito_reduce_error_indicator
  use petscmat
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: two_pi, wp
  use attrito_core_lapack, only: solve_dense, subtract_product, transposed_product
  use attrito_core_petsc_session, only: raise_petsc
  use attrito_reduce_boundary_projection, only: follow_boundary
  use attrito_reduce_column_store, only: block_type, column_store_type
  use attrito_reduce_constraint_modes, only: interior_stiffness_type
  use attrito_reduce_dense_block, only: multiply_block
  use attrito_reduce_interior_factor, only: interior_factor_type
  use attrito_reduce_reduced_modes, only: find_reduced_modes
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: quality_type, examined_type, indicate_errors

  type :: quality_type
    !> Natural frequencies of the reduced model in Hz, and by what part of itself each is too high
    real(wp), allocatable :: frequency_hz(:), error(:)
    !> Frequencies in Hz, between the natural ones; receptances between all loads and monitors there, and what they lack
    real(wp), allocatable :: response_hz(:), receptance(:, :, :), receptance_error(:, :, :)
  contains
    procedure :: worst
    procedure :: clear
    procedure :: keep
    procedure :: restore
  end type quality_type

  !> The full model's matrices and the reduced ones
  type :: examined_type
    type(interior_stiffness_type) :: stiffness
    !> M_ii, and M of the full model
    type(tMat) :: interior_mass, mass
    type(interior_factor_type) :: factor
    !> Modes and corrections, in order, and where they are
    type(block_type), allocatable :: blocks(:)
    type(column_store_type) :: store
    !> Loads and monitors: this rank's rows
    real(wp), allocatable :: vectors(:, :)
    !> [m, m], and T^T f [m, vectors]
    real(wp), allocatable :: reduced_stiffness(:, :), reduced_mass(:, :), reduced_vectors(:, :)
  end type examined_type

  !> Modes and frequencies of responses that are examined, at most
  integer, parameter :: most_modes = 60, most_responses = 8 ! conventional
  !> Eigenvalues below this part of the largest one count as rigid motions, which a reduction keeps
  real(wp), parameter :: rigid = 1.0e-12_wp ! derived
  !> Least distance between natural frequencies, part of them, half way between which receptances are examined
  real(wp), parameter :: wide = 0.01_wp ! guess
  !> Largest ratio of the series that is believed
  real(wp), parameter :: largest_ratio = 0.95_wp ! guess

contains

  !> Largest error: of a frequency, or of a point receptance relative to its largest value.
  pure real(wp) function worst(self)
    class(quality_type), intent(in) :: self
    integer :: i

    worst = maxval([0.0_wp, self%error])
    do i = 1, size(self%receptance, 1)
      worst = max(worst, maxval([0.0_wp, abs(self%receptance_error(i, i, :))])/maxval([tiny(worst), abs(self%receptance(i, i, :))]))
    end do
  end function worst

  !> Nothing was examined.
  pure subroutine clear(self, vectors)
    class(quality_type), intent(inout) :: self
    !> Number of loads and monitors
    integer, intent(in) :: vectors

    allocate (self%frequency_hz(0), self%error(0), self%response_hz(0))
    allocate (self%receptance(vectors, vectors, 0), self%receptance_error(vectors, vectors, 0))
  end subroutine clear

  !> Keep it for whoever takes up an interrupted reduction.
  subroutine keep(self, split, store, error)
    class(quality_type), intent(in) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Where to
    type(column_store_type), intent(in) :: store
    !> The disk is full
    type(error_type), allocatable, intent(out) :: error

    call store%put_numbers(split, 'quality', [real(size(self%error), wp), real(shape(self%receptance), wp), self%frequency_hz, &
      self%error, self%response_hz, reshape(self%receptance, [size(self%receptance)]), &
      reshape(self%receptance_error, [size(self%receptance_error)])], error)
  end subroutine keep

  !> Take up what was kept.
  subroutine restore(self, split, store, error)
    class(quality_type), intent(inout) :: self
    !> The ranks
    type(split_type), intent(in) :: split
    !> Where from
    type(column_store_type), intent(in) :: store
    !> It is not there
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:)
    integer :: n, sizes(3), at

    call store%get_numbers(split, 'quality', numbers, error)
    if (allocated(error)) return
    n = nint(numbers(1))
    sizes = nint(numbers(2:4))
    self%frequency_hz = numbers(5:4 + n)
    self%error = numbers(5 + n:4 + 2*n)
    at = 4 + 2*n
    self%response_hz = numbers(at + 1:at + sizes(3))
    at = at + sizes(3)
    self%receptance = reshape(numbers(at + 1:), sizes)
    self%receptance_error = reshape(numbers(at + product(sizes) + 1:), sizes)
  end subroutine restore

  !> Examine the natural modes up to a frequency, and the responses between them.
  subroutine indicate_errors(split, examined, top_hz, quality, error)
    !> Which rows are whose
    type(split_type), intent(in) :: split
    !> Matrices and basis
    type(examined_type), intent(in) :: examined
    !> Modes up to here
    real(wp), intent(in) :: top_hz
    !> What was found
    type(quality_type), intent(out) :: quality
    !> A solve failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: eigenvalues(:), shapes(:, :)
    real(wp) :: largest
    integer :: first, last, info

    call find_modes(split, examined, top_hz, eigenvalues, shapes, largest, info)
    if (info /= 0) then
      call raise(error, 'mass: the reduced mass matrix is not positive definite: expected every dof to carry mass'// &
                 ' (elements of few points of integration, as C3D8R and C3D20R, do not give each node some)')
      return
    end if
    first = count(eigenvalues <= rigid*largest) + 1
    last = min(count(eigenvalues <= (two_pi*top_hz)**2), first + most_modes - 1)
    quality%frequency_hz = sqrt(eigenvalues(first:last))/two_pi
    call examine_modes(split, examined, eigenvalues(first:last), shapes(:, first:last), quality%error, error)
    if (.not. allocated(error)) call examine_responses(split, examined, quality, error)
  end subroutine indicate_errors

  !> Modes of the reduced model, found by the root, on every rank.
  subroutine find_modes(split, examined, top_hz, eigenvalues, shapes, largest, info)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> Modes up to here
    real(wp), intent(in) :: top_hz
    !> Eigenvalues, ascending, (rad/s)^2; shapes of the modes, a column each
    real(wp), allocatable, intent(out) :: eigenvalues(:), shapes(:, :)
    !> Largest eigenvalue's order of magnitude
    real(wp), intent(out) :: largest
    !> Not 0: the mass is not positive definite
    integer, intent(out) :: info
    real(wp) :: of_all(1)
    integer :: modes, i

    info = 0
    modes = 0
    if (split%ranks%is_root()) call find_reduced_modes(examined%reduced_stiffness, examined%reduced_mass, (two_pi*top_hz)**2, &
      most_modes, rigid, eigenvalues, shapes, largest, info)
    call split%ranks%broadcast_integer(info)
    if (info /= 0) return
    if (split%ranks%is_root()) modes = size(eigenvalues)
    call split%ranks%broadcast_integer(modes)
    if (.not. allocated(eigenvalues)) allocate (eigenvalues(modes), shapes(size(examined%reduced_mass, 1), modes))
    call split%ranks%broadcast(eigenvalues)
    do i = 1, modes
      call split%ranks%broadcast(shapes(:, i))
    end do
    of_all = largest
    call split%ranks%broadcast(of_all)
    largest = of_all(1)
  end subroutine find_modes

  subroutine examine_modes(split, examined, eigenvalues, shapes, errors, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> Eigenvalues, ascending, (rad/s)^2; shapes of the modes, a column each
    real(wp), intent(in) :: eigenvalues(:), shapes(:, :)
    !> Estimated relative errors
    real(wp), allocatable, intent(out) :: errors(:)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: forces(:, :), delta(:, :)
    integer :: first, last, i, width

    allocate (errors(size(eigenvalues)))
    width = max(1, maxval([1, examined%blocks%last - examined%blocks%first + 1]))
    do first = 1, size(eigenvalues), width
      last = min(first + width - 1, size(eigenvalues))
      allocate (forces(size(split%interior_rows), last - first + 1), source=0.0_wp)
      call unanswered(split, examined, eigenvalues(first:last), shapes(:, first:last), forces, delta, error)
      if (allocated(error)) return
      do i = first, last
        errors(i) = 0.5_wp*delta(i - first + 1, i - first + 1)/eigenvalues(i)
      end do
      deallocate (forces)
    end do
  end subroutine examine_modes

  !> Gaps between natural frequencies, the number of the mode before each. Between two close ones, as two blades have that are alike,
  !> what both do may cancel: there is nothing that an error could be a part of.
  pure function wide_gaps(frequency_hz) result(before)
    !> Ascending, Hz
    real(wp), intent(in) :: frequency_hz(:)
    integer, allocatable :: before(:)
    integer :: i

    before = pack([(i, i=1, size(frequency_hz) - 1)], &
                  [(frequency_hz(i + 1) > (1.0_wp + wide)*frequency_hz(i), i=1, size(frequency_hz) - 1)])
  end function wide_gaps

  !> Receptances half way between natural modes, where nothing is near infinite.
  subroutine examine_responses(split, examined, quality, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> Errors estimated of the reduced model
    type(quality_type), intent(inout) :: quality
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: answers(:, :, :), forces(:, :), delta(:, :)
    integer, allocatable :: before(:)
    integer :: i, k, count, vectors

    vectors = size(examined%vectors, 2)
    before = wide_gaps(quality%frequency_hz)
    count = min(most_responses, size(before))
    if (vectors == 0) count = 0
    allocate (quality%response_hz(count), quality%receptance(vectors, vectors, count), &
              quality%receptance_error(vectors, vectors, count))
    do i = 1, count
      k = before(1 + ((i - 1)*size(before))/count)
      quality%response_hz(i) = 0.5_wp*(quality%frequency_hz(k) + quality%frequency_hz(k + 1))
    end do
    call find_responses(split, examined, (two_pi*quality%response_hz)**2, answers)
    do i = 1, count
      quality%receptance(:, :, i) = transposed_product(examined%reduced_vectors, answers(:, :, i))
      forces = examined%vectors(split%interior_rows, :)
      call unanswered(split, examined, spread((two_pi*quality%response_hz(i))**2, 1, vectors), answers(:, :, i), forces, delta, error)
      if (allocated(error)) return
      quality%receptance_error(:, :, i) = delta
    end do
  end subroutine examine_responses

  !> Responses of the reduced model to all vectors, some frequencies by each rank; on every rank.
  subroutine find_responses(split, examined, lambda, answers)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> omega^2
    real(wp), intent(in) :: lambda(:)
    !> [m, vectors, frequencies]
    real(wp), allocatable, intent(out) :: answers(:, :, :)
    real(wp), allocatable :: matrix(:, :)
    integer :: i, info

    associate (vectors => examined%reduced_vectors)
      allocate (answers(size(vectors, 1), size(vectors, 2), size(lambda)), source=0.0_wp)
      do i = 1, size(lambda)
        if (mod(i, split%ranks%ranks) /= split%ranks%rank) cycle
        matrix = examined%reduced_stiffness - lambda(i)*examined%reduced_mass
        answers(:, :, i) = vectors
        call solve_dense(matrix, answers(:, :, i), info)
      end do
    end associate
    do i = 1, size(lambda)
      call split%ranks%sum(answers(:, :, i))
    end do
  end subroutine find_responses

  !> delta_ab of the forces r = f - (K - lambda M) T y that the columns y leave on the interior.
  subroutine unanswered(split, examined, lambda, y, forces, delta, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> Eigenvalues, (rad/s)^2; coefficients in the reduced coordinates
    real(wp), intent(in) :: lambda(:), y(:, :)
    !> f, then r
    real(wp), intent(inout), contiguous :: forces(:, :)
    !> Corrections that are estimated
    real(wp), allocatable, intent(out) :: delta(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: motion(:, :), x(:, :), inertia(:, :), next(:, :)
    PetscErrorCode :: ierr

    call recover(split, examined, y, motion, error)
    if (allocated(error)) return
    call subtract_balance(split, examined, lambda, motion, forces, ierr)
    deallocate (motion)
    allocate (x, inertia, mold=forces)
    if (ierr == 0) call examined%factor%solve(forces, x, ierr)
    if (ierr == 0) call multiply_block(examined%interior_mass, x, inertia, ierr)
    call raise_petsc(error, ierr, 'estimating the error of the reduced model')
    if (allocated(error)) return
    delta = transposed_product(forces, x)
    next = transposed_product(x, inertia)
    call split%ranks%sum(delta)
    call split%ranks%sum(next)
    call add_tail(lambda, next, delta)
  end subroutine unanswered

  !> r^T x + lambda x^T M x / (1 - rho): the series of the inverse, geometric beyond its second term.
  pure subroutine add_tail(lambda, next, delta)
    !> Eigenvalues, (rad/s)^2; second term of the series
    real(wp), intent(in) :: lambda(:), next(:, :)
    !> Corrections that are estimated
    real(wp), intent(inout) :: delta(:, :)
    real(wp) :: ratio(size(lambda))
    integer :: i, j

    do i = 1, size(lambda)
      ratio(i) = 0.0_wp
      if (delta(i, i) > 0.0_wp) ratio(i) = min(largest_ratio, lambda(i)*next(i, i)/delta(i, i))
    end do
    do j = 1, size(lambda)
      do i = 1, size(lambda)
        delta(i, j) = delta(i, j) + sqrt(lambda(i)*lambda(j))*next(i, j)/(1.0_wp - sqrt(ratio(i)*ratio(j)))
      end do
    end do
  end subroutine add_tail

  !> T y, this rank's rows of the full model; the boundary's part by a solve, so that no constraint modes are needed.
  subroutine recover(split, examined, y, motion, error)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> Coefficients in the reduced coordinates
    real(wp), intent(in) :: y(:, :)
    !> Displacement of the coordinates
    real(wp), allocatable, intent(out) :: motion(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer :: i, offset

    allocate (motion(split%rows(), size(y, 2)), source=0.0_wp)
    offset = split%boundary_count
    call follow_boundary(split, examined%stiffness, examined%factor, y(:offset, :), motion, error)
    if (allocated(error)) return
    do i = 1, size(examined%blocks)
      allocate (columns(split%rows(), examined%blocks(i)%columns()))
      call examined%store%get(split, examined%blocks(i), columns, error)
      if (allocated(error)) return
      call subtract_product(columns, -y(offset + 1:offset + size(columns, 2), :), motion)
      offset = offset + size(columns, 2)
      deallocate (columns)
    end do
  end subroutine recover

  !> f <- f - (K - lambda M) q on the interior.
  subroutine subtract_balance(split, examined, lambda, motion, forces, ierr)
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Matrices of the full model and of the reduced one
    type(examined_type), intent(in) :: examined
    !> Eigenvalues, (rad/s)^2
    real(wp), intent(in) :: lambda(:)
    !> Displacement of the coordinates
    real(wp), intent(in), contiguous :: motion(:, :)
    !> Forces on the interior
    real(wp), intent(inout), contiguous :: forces(:, :)
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    real(wp), allocatable :: part(:, :), inside(:, :), boundary(:, :)
    integer :: i

    allocate (part, mold=motion)
    PetscCall(multiply_block(examined%mass, motion, part, ierr))
    do i = 1, size(lambda)
      forces(:, i) = forces(:, i) + lambda(i)*part(split%interior_rows, i)
    end do
    deallocate (part)
    allocate (part, mold=forces)
    inside = motion(split%interior_rows, :)
    PetscCall(multiply_block(examined%stiffness%interior, inside, part, ierr))
    forces = forces - part
    boundary = motion(split%boundary_rows, :)
    PetscCall(multiply_block(examined%stiffness%coupling, boundary, part, ierr))
    forces = forces - part
  end subroutine subtract_balance
end module attrito_reduce_error_indicator
