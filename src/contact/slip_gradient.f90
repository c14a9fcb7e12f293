!> How the direction of slip on a panel follows the motion and the direction at its start, by the linearised collocation,
!>
!> $$ r D \, \delta\phi + h \, (u' \cdot e) \, \delta\phi = h \, \delta u' \cdot e_\perp - (D \phi) \, \delta r $$
!>
!> with the matrix of Newton's method and a right-hand side for each parameter.
module attrito_contact_slip_gradient
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type, usual_nodes
  use attrito_contact_panel_rule, only: panel_rule_type
  use attrito_contact_slip_panel, only: slip_panel_type, invert_panel
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
    !> Of phi at the nodes [s, columns]
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
    real(wp) :: inverse(rule%nodes, rule%nodes), right(rule%nodes, 4)
    integer :: harmonics

    call invert_panel(rule, panel, inverse, regular)
    if (.not. regular) return
    right(:, 1) = -panel%scale*panel%jet(:, 3)*rule%derivative(:, 0)
    right(:, 2) = -panel%scale*panel%length*panel%e(:, 2)
    right(:, 3) = panel%scale*panel%length*panel%e(:, 1)
    right(:, 4) = -panel%scale*panel%turn*panel%slope
    harmonics = merge(motion%harmonics, -1, by_motion)
    if (rule%nodes == usual_nodes) then
      call solve(usual_nodes, size(before), harmonics, motion%passing, inverse, right, before, panel%basis, gradient)
    else
      call solve(rule%nodes, size(before), harmonics, motion%passing, inverse, right, before, panel%basis, gradient)
    end if
  end subroutine differentiate_by_rule

  !> The same on plain arrays, whose size is handed over by value: compilers then make code of its own for the usual one.
  pure subroutine solve(n, columns, harmonics, passing, inverse, right, before, basis, gradient)
    !> s; number of parameters; H, or -1 if coefficients of the motion are none of them
    integer, value :: n, columns, harmonics
    !> Change of the means' function by the angle
    real(wp), value :: passing
    !> A^-1; what the right-hand sides have of phi at the start, of u_1', u_2' and r
    real(wp), intent(in) :: inverse(n, n), right(n, 4)
    !> Of phi at the start; 1, cos, sin, ... at the nodes
    real(wp), intent(in) :: before(columns), basis(n, *)
    !> Of phi at the nodes
    real(wp), intent(out) :: gradient(n, columns)
    real(wp) :: x(n), y(n)
    integer :: c, h, i, j, k, part

    k = 2*harmonics + 1
    do c = 1, columns
      x = before(c)*right(:, 1)
      if (c <= 3*k) then
        part = (c - 1)/k + 1
        j = c - (part - 1)*k
        h = j/2
        if (part == 3) then
          x = x + right(:, 4)*basis(:, j)
        else if (j == 1) then
          x = x + passing*right(:, part + 1)
        else if (modulo(j, 2) == 0) then
          x = x - h*right(:, part + 1)*basis(:, j + 1)
        else
          x = x + h*right(:, part + 1)*basis(:, j - 1)
        end if
      end if
      y = x(1)*inverse(:, 1)
      do i = 2, n
        y = y + x(i)*inverse(:, i)
      end do
      gradient(:, c) = y
    end do
  end subroutine solve
end module attrito_contact_slip_gradient
