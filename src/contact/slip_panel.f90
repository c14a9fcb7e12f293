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
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type, usual_nodes
  use attrito_contact_panel_rule, only: panel_rule_type
  implicit none
  private
  public :: slip_panel_type, new_slip_panel, solve_panel, invert_panel

  type :: slip_panel_type
    !> Where it begins, its length, and whether the contact opens at its end
    real(wp) :: from = 0.0_wp, length = 0.0_wp
    logical :: opens = .false.
    !> The nodes, weight of an integral over theta there, r, u_1', u_2', r' [s, 3:6], and 1, cos, sin, ... [s, e], up to the motion's
    !> harmonics where it is a series
    real(wp), allocatable :: theta(:), weight(:), jet(:, :), basis(:, :)
    !> dr/dv there [s]
    real(wp), allocatable :: slope(:)
    !> phi at the start and the nodes [0:s], d phi/dx and e at the nodes [s], [s, 2]
    real(wp), allocatable :: phi(:), turn(:), e(:, :)
    !> Of each equation: one over the size of its terms, r D, with D of order 20, and what turns the direction [s]
    real(wp), allocatable :: scale(:)
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
      allocate (self%theta(s), self%weight(s), self%slope(s), self%jet(s, 3:6), self%basis(s, coefficients))
      allocate (self%phi(0:s), self%turn(s), self%e(s, 2), self%scale(s))
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
      call solve_by_rule(motion, rules%gauss, rules%tolerance, panel, solved)
    else
      call solve_by_rule(motion, rules%radau, rules%tolerance, panel, solved)
    end if
  end subroutine solve_panel

  !> The same with the nodes' rule.
  pure subroutine solve_by_rule(motion, rule, tolerance, panel, solved)
    !> Motion of the contact; nodes
    type(disc_motion_type), intent(in) :: motion
    type(panel_rule_type), intent(in) :: rule
    !> Error that the panel may have
    real(wp), intent(in) :: tolerance
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Has Newton's method converged?
    logical, intent(out) :: solved

    panel%weight = rule%weight*panel%length
    panel%theta = panel%from + panel%length*rule%x(1:)
    call motion%at_nodes(panel%theta, panel%basis, panel%jet, panel%slope)
    panel%jet(:, 3) = max(panel%jet(:, 3), 0.0_wp)
    call iterate(rule, tolerance, panel, solved)
    if (.not. solved) return
    panel%turn = matmul(rule%derivative, panel%phi)
    panel%error = maxval([1.0_wp, 0.2_wp]*abs(matmul(panel%phi, rule%tail)))*maxval(panel%jet(:, 3))/motion%largest
  end subroutine solve_by_rule

  !> Newton's method for phi at the nodes, its last steps with the inverse before.
  pure subroutine iterate(rule, tolerance, panel, solved)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> Error that the panel may have
    real(wp), intent(in) :: tolerance
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Has it converged?
    logical, intent(out) :: solved

    panel%scale = 1.0_wp/(20.0_wp*panel%jet(:, 3) + panel%length*(abs(panel%jet(:, 4)) + abs(panel%jet(:, 5))) + tiny(1.0_wp))
    if (rule%nodes == usual_nodes) then
      call guess(usual_nodes, rule%x, panel%length, panel%jet, panel%phi, panel%e)
      call find_root(usual_nodes, rule%derivative, tolerance, panel%length, panel%jet, panel%scale, panel%phi, panel%e, solved)
    else
      call guess(rule%nodes, rule%x, panel%length, panel%jet, panel%phi, panel%e)
      call find_root(rule%nodes, rule%derivative, tolerance, panel%length, panel%jet, panel%scale, panel%phi, panel%e, solved)
    end if
  end subroutine iterate

  !> First guess: from node to node as for u' and r that stay as they are on average between them (up to the first node as they are
  !> there), a step of a Riccati equation,
  !> e <- e (1 + b conj e)/(1 + conj(b) e), b = tanh(L/2) u'/|u'|, L = |u'| d theta/r, the hyperbolic tangent as a fraction.
  pure subroutine guess(n, nodes, length, jet, phi, e)
    !> s
    integer, value :: n
    !> Start and nodes, from 0 to 1; length of the panel
    real(wp), intent(in) :: nodes(0:n), length
    !> Values and derivatives of the motion at the nodes
    real(wp), intent(in) :: jet(n, 3:6)
    !> Directions, at the start and then at all nodes; e there
    real(wp), intent(inout) :: phi(0:n), e(n, 2)
    real(wp) :: mean(n, 3:5), part(n), turn(n), c, s, along, aside, before
    integer :: i

    mean(1, :) = jet(1, :5)
    do i = 3, 5
      mean(2:, i) = 0.5_wp*(jet(:n - 1, i) + jet(2:, i))
    end do
    turn = sqrt(mean(:, 4)**2 + mean(:, 5)**2)
    part = 0.5_wp*length*(nodes(1:) - nodes(:n - 1))*turn
    part = part/max(mean(:, 3), 0.5_wp*part, tiny(1.0_wp))
    part = part*(15.0_wp + part**2)/((15.0_wp + 6.0_wp*part**2)*max(turn, tiny(1.0_wp)))
    c = cos(phi(0))
    s = sin(phi(0))
    do i = 1, n
      along = 1.0_wp + part(i)*(mean(i, 4)*c + mean(i, 5)*s)
      aside = part(i)*(mean(i, 5)*c - mean(i, 4)*s)
      turn(i) = aside/along
      aside = 2.0_wp/(1.0_wp + turn(i)**2)
      along = aside - 1.0_wp
      aside = aside*turn(i)
      before = c
      c = along*c - aside*s
      s = along*s + aside*before
      e(i, :) = [c, s]
    end do
    turn = 2.0_wp*atan(turn)
    do i = 1, n
      phi(i) = phi(i - 1) + turn(i)
    end do
  end subroutine guess

  !> The same on plain arrays, whose size is handed over by value: compilers then make code of its own for the usual one.
  pure subroutine find_root(n, derivative, tolerance, length, jet, scale, phi, e, solved)
    !> s
    integer, value :: n
    !> D; error that the panel may have; length of the panel
    real(wp), intent(in) :: derivative(n, 0:n), tolerance, length
    !> Values and derivatives of the motion at the nodes; scale of the equations
    real(wp), intent(in) :: jet(n, 3:6), scale(n)
    !> Directions, the first guess at the nodes before; e there
    real(wp), intent(inout) :: phi(0:n), e(n, 2)
    !> Has it converged?
    logical, intent(out) :: solved
    !> The longest step that is taken whole; one that leads nowhere; the last step's square over the error that a panel may have; a
    !> step so short that the factors before it serve
    real(wp), parameter :: whole = 0.7_wp, lost = 1.0e3_wp, part = 1.0e-4_wp, short = 1.0e-2_wp ! derived
    real(wp) :: step(n), turn(n), cosine(n), sine(n), u(n), v(n), r(n), inverse(n, n), largest, last
    integer :: iteration, j
    logical :: regular

    last = sqrt(part*tolerance)
    r = scale*jet(:, 3)
    u = scale*length*jet(:, 4)
    v = scale*length*jet(:, 5)
    cosine = e(:, 1)
    sine = e(:, 2)
    largest = huge(1.0_wp)
    solved = .false.
    do iteration = 1, 20
      turn = derivative(:, 0)*phi(0)
      do j = 1, n
        turn = turn + derivative(:, j)*phi(j)
      end do
      step = v*cosine - u*sine - r*turn
      if (largest > short) then
        call invert(n, derivative(:, 1:), r, u*cosine + v*sine, inverse, regular)
        if (.not. regular) return
      end if
      turn = step(1)*inverse(:, 1)
      do j = 2, n
        turn = turn + step(j)*inverse(:, j)
      end do
      step = turn
      largest = maxval(abs(step))
      if (.not. largest < lost) return
      if (largest > whole) step = step*(whole/largest)
      phi(1:) = phi(1:) + step
      call turn_by(n, step, largest, phi(1:), cosine, sine)
      solved = largest < last
      if (solved) exit
    end do
    e(:, 1) = cosine
    e(:, 2) = sine
  end subroutine find_root

  !> Directions after a step: small ones by the first terms of the series of cosine and sine, up to rounding.
  pure subroutine turn_by(n, step, largest, phi, cosine, sine)
    !> s
    integer, value :: n
    !> Steps, the largest of them, and angles after them
    real(wp), intent(in) :: step(n), largest, phi(n)
    !> Of the angles
    real(wp), intent(inout) :: cosine(n), sine(n)
    !> A step whose seventh power, over 5040, is rounding
    real(wp), parameter :: small = 0.02_wp ! derived
    real(wp) :: square(n), across(n), along(n)

    if (largest > small) then
      cosine = cos(phi)
      sine = sin(phi)
      return
    end if
    square = step**2
    across = step*(1.0_wp - square*(1.0_wp/6.0_wp - square*(1.0_wp/120.0_wp)))
    along = 1.0_wp - square*(0.5_wp - square*(1.0_wp/24.0_wp - square*(1.0_wp/720.0_wp)))
    square = cosine
    cosine = along*cosine - across*sine
    sine = along*sine + across*square
  end subroutine turn_by

  !> Inverse of a solved panel's linearised equations [s, s].
  pure subroutine invert_panel(rule, panel, inverse, regular)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> The panel
    type(slip_panel_type), intent(in) :: panel
    !> Its inverse
    real(wp), intent(out), contiguous :: inverse(:, :)
    !> Does it exist?
    logical, intent(out) :: regular
    real(wp) :: along(rule%nodes)

    along = panel%scale*panel%length*(panel%jet(:, 4)*panel%e(:, 1) + panel%jet(:, 5)*panel%e(:, 2))
    if (rule%nodes == usual_nodes) then
      call invert(usual_nodes, rule%derivative(:, 1:), panel%scale*panel%jet(:, 3), along, inverse, regular)
    else
      call invert(rule%nodes, rule%derivative(:, 1:), panel%scale*panel%jet(:, 3), along, inverse, regular)
    end if
  end subroutine invert_panel

  !> Inverse of r D + h (u'.e) without exchanging rows: D needs no exchange, and the rest is added to the diagonal.
  pure subroutine invert(n, derivative, r, diagonal, a, regular)
    !> s
    integer, value :: n
    !> D without its first column; what it is multiplied by; what is added
    real(wp), intent(in) :: derivative(n, n), r(n), diagonal(n)
    !> The inverse
    real(wp), intent(out) :: a(n, n)
    !> Does it exist?
    logical, intent(out) :: regular
    !> A pivot that is none
    real(wp), parameter :: singular = 1.0e-12_wp ! derived
    real(wp) :: column(n), reciprocal
    integer :: i, j

    do j = 1, n
      a(:, j) = r*derivative(:, j)
      a(j, j) = a(j, j) + diagonal(j)
    end do
    do j = 1, n
      regular = abs(a(j, j)) > singular
      if (.not. regular) return
      column = a(:, j)
      a(:, j) = 0.0_wp
      a(j, j) = 1.0_wp
      reciprocal = 1.0_wp/column(j)
      a(j, :) = a(j, :)*reciprocal
      column(j) = 0.0_wp
      do i = 1, n
        a(:, i) = a(:, i) - a(j, i)*column
      end do
    end do
  end subroutine invert
end module attrito_contact_slip_panel
