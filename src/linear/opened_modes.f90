!> Modes of a structure when some of the springs that its stiffness holds are taken out of it:
!>
!> $$ (M - \mu_r K') x_r = 0, \qquad K' = \tilde K - P \, \mathrm{diag}(k) \, P^T, \qquad x_r^T K' x_s = \delta_{rs} $$
module attrito_linear_opened_modes
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  implicit none
  private
  public :: find_opened_modes, flops_of_modes

  !> Cost of the modes in flops of GMRES's products, times the cube of their number: 868 take as long as 5e9
  real(wp), parameter :: flops_of_modes = 8.0_wp ! measured

contains

  !> Modes, lowest frequency first, of modal stiffness 1, and their modal mass.
  subroutine find_opened_modes(stiffness, mass, columns, springs, modes, modal_mass, status)
    !> K~ and M [n, n]
    real(wp), intent(in) :: stiffness(:, :), mass(:, :)
    !> P, rows of B in columns [n, rows], and their springs [rows]
    real(wp), intent(in) :: columns(:, :), springs(:)
    !> [n, n] and [n]
    real(wp), allocatable, intent(out) :: modes(:, :), modal_mass(:)
    !> 0, or not: K' is not positive definite, since some body is free without these springs
    integer, intent(out) :: status
    real(wp), allocatable :: eigenvalues(:), vectors(:, :)
    integer :: n

    n = size(mass, 1)
    call symmetric_eigenpairs(mass, stiffness - matmul(columns*spread(springs, 1, n), transpose(columns)), eigenvalues, vectors, &
                              status)
    if (status /= 0) return
    modes = vectors(:, n:1:-1)
    modal_mass = max(eigenvalues(n:1:-1), tiny(1.0_wp))
  end subroutine find_opened_modes
end module attrito_linear_opened_modes
