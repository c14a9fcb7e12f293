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
  use attrito_contact_disc_motion, only: disc_rules_type, disc_motion_type, usual_nodes
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
      allocate (self%weight(s), self%jet(6, s), self%basis(coefficients, s))
      allocate (self%phi(0:s), self%turn(s), self%e(2, s), self%scale(s))
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
    integer :: i

    panel%weight = rule%weight*panel%length
    do i = 1, rule%nodes
      call motion%at(instant_at(panel, rule%x(i)), panel%basis(:, i), panel%jet(:, i))
      panel%jet(3, i) = max(panel%jet(3, i), 0.0_wp)
    end do
    call guess(rule, panel)
    call iterate(rule, tolerance, panel, solved)
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
        panel%e(:, i) = e
      end associate
    end do
  end subroutine guess

  !> Newton's method for phi at the nodes, its last steps with the factors before.
  pure subroutine iterate(rule, tolerance, panel, solved)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> Error that the panel may have
    real(wp), intent(in) :: tolerance
    !> The panel
    type(slip_panel_type), intent(inout) :: panel
    !> Has it converged?
    logical, intent(out) :: solved

    panel%scale = 1.0_wp/(20.0_wp*panel%jet(3, :) + panel%length*(abs(panel%jet(4, :)) + abs(panel%jet(5, :))) + tiny(1.0_wp))
    if (rule%nodes == usual_nodes) then
      call find_root(usual_nodes, rule%derivative, tolerance, panel%length, panel%jet, panel%scale, panel%phi, panel%e, solved)
    else
      call find_root(rule%nodes, rule%derivative, tolerance, panel%length, panel%jet, panel%scale, panel%phi, panel%e, solved)
    end if
  end subroutine iterate

  !> The same on plain arrays, whose size is handed over by value: compilers then make code of its own for the usual one.
  pure subroutine find_root(n, derivative, tolerance, length, jet, scale, phi, e, solved)
    !> s
    integer, value :: n
    !> D; error that the panel may have; length of the panel
    real(wp), intent(in) :: derivative(n, 0:n), tolerance, length
    !> Values and derivatives of the motion at the nodes; scale of the equations
    real(wp), intent(in) :: jet(6, n), scale(n)
    !> Directions, the first guess at the nodes before; e there
    real(wp), intent(inout) :: phi(0:n), e(2, n)
    !> Has it converged?
    logical, intent(out) :: solved
    !> The longest step that is taken whole; one that leads nowhere; the last step's square over the error that a panel may have; a
    !> step so short that the factors before it serve
    real(wp), parameter :: whole = 0.7_wp, lost = 1.0e3_wp, part = 1.0e-4_wp, short = 1.0e-2_wp ! derived
    real(wp) :: step(n), turn(n), cosine(n), sine(n), u(n), v(n), r(n), factors(n, n), largest, last
    integer :: iteration, j
    logical :: regular

    last = sqrt(part*tolerance)
    r = scale*jet(3, :)
    u = scale*length*jet(4, :)
    v = scale*length*jet(5, :)
    cosine = e(1, :)
    sine = e(2, :)
    largest = huge(1.0_wp)
    solved = .false.
    do iteration = 1, 20
      turn = derivative(:, 0)*phi(0)
      do j = 1, n
        turn = turn + derivative(:, j)*phi(j)
      end do
      step = v*cosine - u*sine - r*turn
      if (largest > short) then
        call factor(n, derivative(:, 1:), r, u*cosine + v*sine, factors, regular)
        if (.not. regular) return
      end if
      call back_substitute(n, factors, step)
      largest = maxval(abs(step))
      if (.not. largest < lost) return
      if (largest > whole) step = step*(whole/largest)
      phi(1:) = phi(1:) + step
      call turn_by(n, step, largest, phi(1:), cosine, sine)
      solved = largest < last
      if (solved) exit
    end do
    e(1, :) = cosine
    e(2, :) = sine
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

  !> Factors of r D + h (u'.e) without exchanging rows: D needs no exchange, and the rest is added to the diagonal.
  pure subroutine factor(n, derivative, r, diagonal, a, regular)
    !> s
    integer, value :: n
    !> D without its first column; what it is multiplied by; what is added
    real(wp), intent(in) :: derivative(n, n), r(n), diagonal(n)
    !> L below the diagonal, and U, with inverses on its own
    real(wp), intent(out) :: a(n, n)
    !> Do they exist?
    logical, intent(out) :: regular
    !> A pivot that is none
    real(wp), parameter :: singular = 1.0e-12_wp ! derived
    integer :: i, j

    do j = 1, n
      a(:, j) = r*derivative(:, j)
      a(j, j) = a(j, j) + diagonal(j)
    end do
    do j = 1, n
      regular = abs(a(j, j)) > singular
      if (.not. regular) return
      a(j, j) = 1.0_wp/a(j, j)
      a(j + 1:, j) = a(j + 1:, j)*a(j, j)
      do i = j + 1, n
        a(j + 1:, i) = a(j + 1:, i) - a(j, i)*a(j + 1:, j)
      end do
    end do
  end subroutine factor

  !> x <- A^-1 x, of factors.
  pure subroutine back_substitute(n, factors, x)
    !> s
    integer, value :: n
    !> L below the diagonal, and U
    real(wp), intent(in) :: factors(n, n)
    !> Right-hand side, then solution
    real(wp), intent(inout) :: x(n)
    integer :: j

    do j = 1, n - 1
      x(j + 1:) = x(j + 1:) - x(j)*factors(j + 1:, j)
    end do
    do j = n, 1, -1
      x(j) = x(j)*factors(j, j)
      x(:j - 1) = x(:j - 1) - x(j)*factors(:j - 1, j)
    end do
  end subroutine back_substitute

  !> Factors of a solved panel's linearised equations [s, s].
  pure subroutine factor_panel(rule, panel, factors, regular)
    !> Nodes
    type(panel_rule_type), intent(in) :: rule
    !> The panel
    type(slip_panel_type), intent(in) :: panel
    !> L below the diagonal, and U
    real(wp), intent(out) :: factors(:, :)
    !> Do they exist?
    logical, intent(out) :: regular

    call factor(rule%nodes, rule%derivative(:, 1:), panel%scale*panel%jet(3, :), &
                panel%scale*panel%length*(panel%jet(4, :)*panel%e(1, :) + panel%jet(5, :)*panel%e(2, :)), factors, regular)
  end subroutine factor_panel

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
