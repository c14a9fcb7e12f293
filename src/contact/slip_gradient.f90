!> How the direction of slip on a panel follows the motion and the direction at its start, by the linearised collocation,
!>
!> $$ r D \, \delta\phi + h \, (u' \cdot e) \, \delta\phi = h \, \delta u' \cdot e_\perp - (D \phi) \, \delta r $$
!>
!> with the matrix of Newton's method and a right-hand side for each parameter.
module attrito_contact_slip_gradient
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_rules_type, disc_motion_type
  use attrito_contact_panel_rule, only: panel_rule_type
  use attrito_contact_slip_panel, only: slip_panel_type, factor_panel
  implicit none
  private
  public :: differentiate_panel

contains

  !> How phi at the nodes follows some parameters: r D dphi + h (u'.e) dphi = h du'.e_perp - D phi dr.
  pure subroutine differentiate_panel(motion, rules, before, by_motion, panel, gradient, regular)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(in) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> Of phi at the start [columns]
    real(wp), intent(in), contiguous :: before(:)
    !> Are coefficients of the motion the first 3 k of the parameters?
    logical, intent(in) :: by_motion
    !> The panel, solved
    type(slip_panel_type), intent(in) :: panel
    !> Of phi at the nodes [columns, s]
    real(wp), intent(out), contiguous :: gradient(:, :)
    !> Does it exist?
    logical, intent(out) :: regular

    if (panel%opens) then
      call differentiate_by_rule(motion, rules%gauss, before, by_motion, panel, gradient, regular)
    else
      call differentiate_by_rule(motion, rules%radau, before, by_motion, panel, gradient, regular)
    end if
  end subroutine differentiate_panel

  !> The same with the nodes' rule.
  pure subroutine differentiate_by_rule(motion, rule, before, by_motion, panel, gradient, regular)
    !> Motion of the contact; nodes
    type(disc_motion_type), intent(in) :: motion
    type(panel_rule_type), intent(in) :: rule
    !> Of phi at the start
    real(wp), intent(in), contiguous :: before(:)
    !> Are coefficients of the motion the first 3 k of the parameters?
    logical, intent(in) :: by_motion
    !> The panel, solved
    type(slip_panel_type), intent(in) :: panel
    !> Of phi at the nodes
    real(wp), intent(out), contiguous :: gradient(:, :)
    !> Does it exist?
    logical, intent(out) :: regular
    real(wp) :: factors(rule%nodes, rule%nodes), by_u(2), by_r
    integer :: h, i, k

    call factor_panel(rule, panel, factors, regular)
    if (.not. regular) return
    k = 2*motion%harmonics + 1
    do i = 1, rule%nodes
      gradient(:, i) = -panel%scale(i)*panel%jet(3, i)*rule%derivative(i, 0)*before
      if (.not. by_motion) cycle
      by_u = panel%scale(i)*panel%length*[-panel%e(2, i), panel%e(1, i)]
      by_r = -panel%scale(i)*panel%turn(i)*motion%slope
      associate (g => gradient(:, i), basis => panel%basis(:, i))
        do h = 1, motion%harmonics
          g(2*h) = g(2*h) - h*by_u(1)*basis(2*h + 1)
          g(2*h + 1) = g(2*h + 1) + h*by_u(1)*basis(2*h)
          g(k + 2*h) = g(k + 2*h) - h*by_u(2)*basis(2*h + 1)
          g(k + 2*h + 1) = g(k + 2*h + 1) + h*by_u(2)*basis(2*h)
        end do
        g(2*k + 1:3*k) = g(2*k + 1:3*k) + by_r*basis(:k)
      end associate
    end do
    call back_substitute(size(gradient, 1), rule%nodes, factors, gradient)
  end subroutine differentiate_by_rule

  !> x <- x A^-T, of factors.
  pure subroutine back_substitute(columns, n, factors, x)
    !> Number of parameters; s
    integer, intent(in) :: columns, n
    !> L below the diagonal, and U, with inverses on its own
    real(wp), intent(in) :: factors(n, n)
    !> Right-hand sides, then solutions
    real(wp), intent(inout) :: x(columns, n)
    integer :: i

    do i = 2, n
      call subtract(columns, i - 1, factors(i, :i - 1), x(:, :i - 1), x(:, i))
    end do
    do i = n, 1, -1
      call subtract(columns, n - i, factors(i, i + 1:), x(:, i + 1:), x(:, i))
      x(:, i) = x(:, i)*factors(i, i)
    end do
  end subroutine back_substitute

  !> y <- y - x f, two columns of x at a time.
  pure subroutine subtract(rows, columns, f, x, y)
    !> Of x
    integer, intent(in) :: rows, columns
    !> Factors; matrix
    real(wp), intent(in) :: f(columns), x(rows, columns)
    !> What it is subtracted from
    real(wp), intent(inout) :: y(rows)
    integer :: i, j

    do j = 1, columns - 1, 2
      do i = 1, rows
        y(i) = y(i) - (f(j)*x(i, j) + f(j + 1)*x(i, j + 1))
      end do
    end do
    if (modulo(columns, 2) == 1) y = y - f(columns)*x(:, columns)
  end subroutine subtract
end module attrito_contact_slip_gradient
