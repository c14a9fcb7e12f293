!> Motions of the contacts by which forces go from one to another, in generalised coordinates: what a structure gives way to most,
!> beside the springs of its contacts,
!>
!> $$ K_c^{1/2} R K_c^{1/2} v_j = \theta_j v_j, \qquad R = P^T \kappa^{-1} P, \qquad K_c^{-1/2} v_j = P^T c_j, $$
!>
!> P the rows of B in the modes of the stuck system, kappa their stiffness. Those of the largest theta vary slowly over a joint: where
!> contacts slip together, forces of this kind move all of them. Short ones die out from one contact to the next. Frequency changes
!> little of these vectors, and they are found once, by subspace iteration from the lowest modes, of the rows of all ranks, so that
!> they are the same whatever ranks hold. A modest accuracy will do: they serve a preconditioner.
!> Source: Golub & Van Loan 2013, Matrix computations, section 8.2 (orthogonal iteration).
module attrito_linear_coupling_motions
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: coupling_motions_type, orthonormal

  !> How many are found, and by how many iterations; contacts of a bolted beam of which most slip take 97 iterations of GMRES with the
  !> lowest modes themselves, 66, 53, 35, 25 and 20 after 1, 2, 4, 6 and 8 iterations
  integer, parameter :: most = 32, passes = 8 ! measured
  !> Part of the largest stiffness of a mode that one without stiffness counts with
  real(wp), parameter :: least_stiffness = 1.0e-12_wp ! conventional
  !> Squared length, by the largest, below which a direction is none
  real(wp), parameter :: rounding = 1.0e-12_wp ! derived

  type :: coupling_motions_type
    !> c_j in columns, theta falling [n, motions]
    real(wp), allocatable :: carriers(:, :)
  contains
    procedure :: prepare
  end type coupling_motions_type

contains

  !> Find them, unless they are there.
  subroutine prepare(self, receptance, ranks, springs)
    class(coupling_motions_type), intent(inout) :: self
    !> Receptance of the stuck system between contact rows
    class(receptance_type), intent(in) :: receptance
    !> Ranks that share the contacts
    type(communicator_type), intent(in) :: ranks
    !> K_c of this rank's rows [rows]
    real(wp), intent(in) :: springs(:)
    real(wp), allocatable :: rows(:, :), together(:, :), stiffness(:), motions(:, :), response(:, :), turn(:, :)
    real(wp) :: number
    integer :: i, n, pass

    if (allocated(self%carriers)) return
    n = receptance%common_modes()
    if (n == 0) allocate (self%carriers(0, 0))
    if (n == 0) return
    number = real(size(springs), wp)
    call ranks%sum(number)
    allocate (together(1, nint(number)))
    call ranks%gather_columns_everywhere(reshape(springs, [1, size(springs)]), together)
    rows = receptance%mode_shapes(1, n, [(i, i=1, size(together))])
    stiffness = receptance%static_stiffness()
    stiffness = max(stiffness, least_stiffness*maxval([0.0_wp, stiffness]))
    allocate (self%carriers(n, min(most, n)), source=0.0_wp)
    do i = 1, size(self%carriers, 2)
      self%carriers(i, i) = 1.0_wp
    end do
    do pass = 0, passes
      motions = matmul(transpose(self%carriers), rows)
      turn = orthonormal(matmul(motions*spread(together(1, :), 1, size(motions, 1)), transpose(motions)))
      motions = matmul(transpose(turn), motions)
      response = matmul(rows, transpose(motions*spread(together(1, :), 1, size(motions, 1))))
      if (pass == passes) exit
      self%carriers = response/spread(stiffness, 2, size(response, 2))
    end do
    self%carriers = matmul(self%carriers, turn)
    self%carriers = matmul(self%carriers, falling(matmul(transpose(response), response/spread(stiffness, 2, size(response, 2)))))
  end subroutine prepare

  !> Combinations T of vectors with T^T A T = 1, A their products with each other; those that are none are left out.
  function orthonormal(products) result(turn)
    !> A [m, m]
    real(wp), intent(in) :: products(:, :)
    real(wp), allocatable :: turn(:, :)
    real(wp), allocatable :: squares(:), vectors(:, :)
    integer, allocatable :: kept(:)
    integer :: i

    if (size(products) == 0) then
      allocate (turn(0, 0))
      return
    end if
    call find_eigenpairs(products, squares, vectors)
    kept = pack([(i, i=1, size(squares))], squares > rounding*maxval([0.0_wp, squares]))
    turn = vectors(:, kept)/spread(sqrt(squares(kept)), 1, size(vectors, 1))
  end function orthonormal

  !> Eigenvectors of a symmetric matrix, eigenvalues falling.
  function falling(matrix) result(vectors)
    !> [m, m]
    real(wp), intent(in) :: matrix(:, :)
    real(wp), allocatable :: vectors(:, :)
    real(wp), allocatable :: values(:)

    call find_eigenpairs(matrix, values, vectors)
    vectors = vectors(:, size(values):1:-1)
  end function falling

  !> Eigenvalues ascending; none are found of what is not finite.
  subroutine find_eigenpairs(matrix, values, vectors)
    !> [m, m]
    real(wp), intent(in) :: matrix(:, :)
    !> [found]; [m, found]
    real(wp), allocatable, intent(out) :: values(:), vectors(:, :)
    real(wp) :: unit(size(matrix, 1), size(matrix, 1))
    integer :: i, status

    unit = 0.0_wp
    do i = 1, size(matrix, 1)
      unit(i, i) = 1.0_wp
    end do
    call symmetric_eigenpairs(matrix, unit, values, vectors, status)
    if (status == 0) return
    values = [real(wp) ::]
    vectors = reshape([real(wp) ::], [size(matrix, 1), 0])
  end subroutine find_eigenpairs
end module attrito_linear_coupling_motions
