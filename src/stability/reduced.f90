!> The lowest modes of the stuck system, the others following at rest: what high modes add to the contacts' displacements without
!> inertia,
!>
!> $$ d = B \Phi_l p_l - R\, g, \qquad R = \sum_{r > l} b_r \Lambda_r^{-1} b_r^T. $$
!>
!> Left out are mode r's inertia and damping, (sigma/omega_r)^2 and 2 zeta_r sigma/omega_r of its part in R at a rate sigma, and
!> that it rings after events, which dies out within a segment only if zeta_r omega_r times its length is large.
module attrito_stability_reduced
  use attrito_core_kinds, only: wp
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: reduced_type, reduce_to

  type :: reduced_type
    !> Of the modes that are kept
    type(system_type) :: system
    !> R [rows, rows]; are any modes at rest, or is it zero?
    real(wp), allocatable :: residual(:, :)
    logical :: has_rest = .false.
  end type reduced_type

contains

  !> Keep the l lowest modes.
  function reduce_to(system, l) result(self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> How many modes
    integer, intent(in) :: l
    type(reduced_type) :: self
    real(wp) :: weighted(size(system%eigenvalues) - l, size(system%springs))
    integer :: row

    self%system%clock = system%clock
    self%system%law = system%law
    self%system%springs = system%springs
    self%system%eigenvalues = system%eigenvalues(:l)
    self%system%damping = system%damping(:l)
    if (allocated(system%coupling)) self%system%coupling = system%coupling(:l, :l)
    self%system%rows = system%rows(:l, :)
    self%system%input_map = system%input_map(:l, :)
    do row = 1, size(system%springs)
      weighted(:, row) = system%input_map(l + 1:, row)/system%eigenvalues(l + 1:)
    end do
    self%has_rest = l < size(system%eigenvalues)
    self%residual = matmul(transpose(system%rows(l + 1:, :)), weighted)
  end function reduce_to
end module attrito_stability_reduced
