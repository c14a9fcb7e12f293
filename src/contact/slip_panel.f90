!> Slip of a contact with two tangents over one panel of the period. The slider follows on the rim of its disc, w = u - r e(phi), and
!> against z = u - w, so the direction of slip obeys one scalar equation,
!>
!> $$ r \, \phi' = u' \cdot e_\perp(\phi), \qquad e = (\cos \phi, \sin \phi), \quad e_\perp = (-\sin \phi, \cos \phi) $$
!>
!> phi is the polynomial through the panel's start and its nodes for which this holds at the nodes. Nothing is divided by r, so a
!> panel may begin where the contact lands, r = 0. Where it opens phi has a branch, (theta_o - theta)^(|u'|/|r'|), and no derivative:
!> the last panel's nodes are Gauss's, which leave that end out; all others are Radau's.
!>
!> An error of phi shrinks while the contact slips, times r, since (r dphi)' = -(u'.e - r') dphi: so r times the last Legendre
!> coefficient of phi measures the error, however wild phi is where r vanishes.
module attrito_contact_slip_panel
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_motion, only: disc_rules_type, disc_motion_type
  use attrito_contact_panel_rule, only: panel_rule_type
  implicit none
  private
  public :: slip_panel_type, new_slip_panel, solve_panel, factor_panel, direction_at, instant_at

  type :: slip_panel_type
    !> Where it begins, its length, and whether the contact opens at its end
    real(wp) :: from = 0.0_wp, length = 0.0_wp
    logical :: opens = .false.
    !> At the nodes: weight of an integral over theta, u_1, u_2, r and their derivatives [6, s], and 1, cos, sin, ... [e, s]
    real(wp), allocatable :: weight(:), jet(:, :), basis(:, :)
    !> phi at the start and the nodes [0:s], d phi/dx and e at the nodes [s], [2, s]
    real(wp), allocatable :: phi(:), turn(:), e(:, :)
    !> Rows of the linearised equations, over their own size [s], and their factors [s, s]
    real(wp), allocatable :: scale(:), factors(:, :)
    !> Error of r phi over the largest r of the period
    real(wp) :: error = 0.0_wp
  end type slip_panel_type

contains

  !> Room for a panel.
  pure function new_slip_panel(rules, coefficients) result(self)
    !> Rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> Of the basis at the nodes
    integer, intent(in) :: coefficients
    type(slip_panel_type) :: self

    associate (s => rules%radau%nodes)
      allocate (self%weight(s), self%jet(6, s), self%basis(coefficients, s))
      allocate (self%phi(0:s), self%turn(s), self%e(2, s), self%scale(s), self%factors(s, s))
    end associate
  end function new_slip_panel

  !> The direction of slip on a panel.
  pure subroutine solve_panel(motion, rules, from, length, opens, phi, panel, solved)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(in) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> Where the panel begins, and its length
    real(wp), intent(in) :: from, length
    !> Does the contact open at its end?
    logical, intent(in) :: opens
    !> Direction at the start
    real(wp), intent(in) :: phi
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Has Newton's method converged?
    logical, intent(out) :: solved

    panel%from = from
    panel%length = length
    panel%opens = opens
    panel%phi(0) = phi
    if (opens) then
      call solve_by_rule(motion, rules%gauss, panel, solved)
    else
      call solve_by_rule(motion, rules%radau, panel, solved)
    end if
  end subroutine solve_panel

  !> The same with the nodes' rule.
  pure subroutine solve_by_rule(motion, rule, panel, solved)
    !> Motion of the contact; nodes
    type(disc_motion_type), intent(in) :: motion
    type(panel_rule_type), intent(in) :: rule
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Has Newton's method converged?
    logical, intent(out) :: solved
    integer :: i

    panel%weight = rule%weight*panel%length
    do i = 1, rule%nodes
      call motion%at(instant_at(panel, rule%x(i)), panel%basis(:, i), panel%jet(:, i))
      panel%jet(3, i) = max(panel%jet(3, i), 0.0_wp)
    end do
    call guess(rule, panel)
    call iterate(rule, panel, solved)
    if (.not. solved) return
    panel%turn = matmul(rule%derivative, panel%phi)
    panel%error = maxval([1.0_wp, 0.2_wp]*abs(matmul(panel%phi, rule%tail)))*maxval(panel%jet(3, :))/motion%largest
  end subroutine solve_by_rule

  !> First guess: from node to node as for u' and r that stay as at the next one, a step of a Riccati equation,
  !> e <- e (1 + b conj e)/(1 + conj(b) e), b = tanh(L/2) u'/|u'|, L = |u'| d theta/r, the hyperbolic tangent as a fraction.
  pure subroutine guess(rule, panel)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    real(wp) :: x, speed, part, along, aside, e(2), turned
    integer :: i

    e = [cos(panel%phi(0)), sin(panel%phi(0))]
    do i = 1, rule%nodes
      associate (du => panel%jet(4:5, i), r => panel%jet(3, i))
        speed = sqrt(du(1)**2 + du(2)**2)
        x = 0.5_wp*speed*panel%length*(rule%x(i) - rule%x(i - 1))
        part = 0.0_wp
        if (x >= 2.0_wp*r) then
          if (speed > 0.0_wp) part = 0.999_wp/speed
        else
          x = x/r
          if (speed > 0.0_wp) part = min(x*(15.0_wp + x**2)/(15.0_wp + 6.0_wp*x**2), 0.999_wp)/speed
        end if
        along = 1.0_wp + part*(du(1)*e(1) + du(2)*e(2))
        aside = part*(du(2)*e(1) - du(1)*e(2))
        turned = 2.0_wp*atan(aside/along)
        panel%phi(i) = panel%phi(i - 1) + turned
        e = [e(1)*along - e(2)*aside, e(2)*along + e(1)*aside]
        e = [(e(1)*along - e(2)*aside), (e(2)*along + e(1)*aside)]/(along**2 + aside**2)
      end associate
    end do
  end subroutine guess

  !> Newton's method for phi at the nodes.
  pure subroutine iterate(rule, panel, solved)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Has it converged?
    logical, intent(out) :: solved
    !> The last step, whose square is rounding; the longest that is taken whole; one that leads nowhere
    real(wp), parameter :: last = 3.0e-7_wp, whole = 0.7_wp, lost = 1.0e3_wp ! derived
    real(wp) :: step(rule%nodes, 1), largest
    integer :: i, iteration
    logical :: regular

    solved = .false.
    call scale_rows(panel)
    do iteration = 1, 15
      do i = 1, rule%nodes
        panel%e(:, i) = [cos(panel%phi(i)), sin(panel%phi(i))]
        associate (du => panel%jet(4:5, i), e => panel%e(:, i))
          step(i, 1) = panel%scale(i)*(panel%length*(du(2)*e(1) - du(1)*e(2)) &
                                       - panel%jet(3, i)*dot_product(rule%derivative(i, :), panel%phi))
        end associate
      end do
      call factor_panel(rule, panel, regular)
      if (.not. regular) return
      call back_substitute(panel%factors, step(:, 1))
      largest = maxval(abs(step))
      if (.not. largest < lost) return
      if (largest > whole) step = step*(whole/largest)
      panel%phi(1:) = panel%phi(1:) + step(:, 1)
      if (largest < last) exit
    end do
    solved = largest < last
    if (.not. solved) return
    do i = 1, rule%nodes
      panel%e(:, i) = panel%e(:, i) + step(i, 1)*[-panel%e(2, i), panel%e(1, i)]
    end do
  end subroutine iterate

  !> Of the size of each equation's terms: r D, with D of order 20, and what turns the direction.
  pure subroutine scale_rows(panel)
    !> The panel
    type(slip_panel_type), intent(inout) :: panel

    panel%scale = 1.0_wp/(20.0_wp*panel%jet(3, :) + panel%length*(abs(panel%jet(4, :)) + abs(panel%jet(5, :))) + tiny(1.0_wp))
  end subroutine scale_rows

  !> Factors of r D + h (u'.e), h the panel's length, without exchanging rows: D needs no exchange, and the rest is
  !> added to the diagonal.
  pure subroutine factor_panel(rule, panel, regular)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Do they exist?
    logical, intent(out) :: regular
    real(wp), parameter :: singular = 1.0e-12_wp ! derived
    integer :: i, j, n

    n = rule%nodes
    associate (a => panel%factors)
      do j = 1, n
        a(:, j) = panel%scale*panel%jet(3, :)*rule%derivative(:, j)
      end do
      do i = 1, n
        a(i, i) = a(i, i) + panel%scale(i)*panel%length*dot_product(panel%jet(4:5, i), panel%e(:, i))
      end do
      do j = 1, n
        regular = abs(a(j, j)) > singular
        if (.not. regular) return
        a(j + 1:, j) = a(j + 1:, j)/a(j, j)
        do i = j + 1, n
          a(j + 1:, i) = a(j + 1:, i) - a(j, i)*a(j + 1:, j)
        end do
      end do
    end associate
  end subroutine factor_panel

  !> x <- A^-1 x, of factors.
  pure subroutine back_substitute(factors, x)
    !> L below the diagonal, and U
    real(wp), intent(in), contiguous :: factors(:, :)
    !> Right-hand side, then solution
    real(wp), intent(inout), contiguous :: x(:)
    integer :: j

    do j = 1, size(x) - 1
      x(j + 1:) = x(j + 1:) - x(j)*factors(j + 1:, j)
    end do
    do j = size(x), 1, -1
      x(j) = x(j)/factors(j, j)
      x(:j - 1) = x(:j - 1) - x(j)*factors(:j - 1, j)
    end do
  end subroutine back_substitute

  !> phi at some part of the panel.
  pure real(wp) function direction_at(panel, rules, x) result(phi)
    !> The panel, solved
    type(slip_panel_type), intent(in) :: panel
    !> Rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> From 0 to 1
    real(wp), intent(in) :: x

    if (panel%opens) then
      phi = rules%gauss%interpolate(panel%phi, x)
    else
      phi = rules%radau%interpolate(panel%phi, x)
    end if
  end function direction_at

  !> Angle of the period at some part of the panel.
  pure real(wp) function instant_at(panel, x) result(theta)
    !> The panel
    type(slip_panel_type), intent(in) :: panel
    !> From 0 to 1
    real(wp), intent(in) :: x

    theta = panel%from + panel%length*x
  end function instant_at
end module attrito_contact_slip_panel
