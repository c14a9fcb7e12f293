!> A linearised step at the point's own frequency and with given sliders, refined until what is left of its equations is small:
!>
!> $$ (I + R D) \, \delta d = \rho $$
!>
!> Newton's method does with a few digits of a step, and GMRES stops there; derivatives take all of them, which one solve finds in
!> fewer iterations than several that each begin again.
module attrito_sensitivity_accurate_step
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_newton_border, only: constraint_type
  use attrito_newton_linearised_step, only: linear_options_type, solve_linearised, apply_linearised
  use attrito_newton_preconditioners, only: preconditioners_type
  implicit none
  private
  public :: solve_accurately

  !> Residual relative to the right-hand side: three digits beyond those that derivatives are compared to
  real(wp), parameter :: tolerance = 1.0e-9_wp ! conventional
  !> GMRES' tolerance, in norms of its own, part of this one
  real(wp), parameter :: part = 0.3_wp ! guess
  !> Steps: the first comes there, or near it where rounding has it, and four to spare
  integer, parameter :: most_steps = 5 ! derived

contains

  !> Solve for the change of motion; the balance holds the Jacobian of its last evaluation.
  subroutine solve_accurately(balance, right, options, kept, motion, status)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> rho [2 H + 1, rows]
    real(wp), intent(in) :: right(:, :)
    !> How to solve
    type(linear_options_type), intent(in) :: options
    !> Preconditioners that serve more than one step
    type(preconditioners_type), intent(inout) :: kept
    !> delta d [2 H + 1, rows]
    real(wp), intent(out) :: motion(:, :)
    !> 0, or not: singular
    integer, intent(out) :: status
    type(constraint_type) :: constraint
    type(unknowns_type) :: left, step, sum, product
    type(linear_options_type) :: finely
    real(wp) :: size_of_left, before
    integer :: iterations, i

    finely = options
    finely%krylov%tolerance = min(options%krylov%tolerance, part*tolerance)
    constraint%motion = 0.0_wp*right
    left = unknowns_type(right, 0.0_wp*balance%slider, 0.0_wp)
    step = left
    product = left
    sum = unknowns_type(0.0_wp*right, 0.0_wp*balance%slider, 0.0_wp)
    before = huge(1.0_wp)
    do i = 1, most_steps
      call solve_linearised(balance, constraint, left, finely, step, iterations, status, kept)
      if (status /= 0) return
      sum%motion = sum%motion + step%motion
      sum%slider = sum%slider + step%slider
      motion = sum%motion
      call apply_linearised(balance, constraint, sum, product)
      left%motion = right - product%motion
      size_of_left = balance%norm(left%motion)
      if (size_of_left <= tolerance*balance%norm(right) .or. size_of_left >= 0.5_wp*before) return
      before = size_of_left
    end do
  end subroutine solve_accurately
end module attrito_sensitivity_accurate_step
