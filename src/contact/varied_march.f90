!> How a march of a contact with two tangents changes to second order along two directions t and x of its motion.
!>
!> The march is gone through again in hyper-dual numbers (`attrito_core_hyperdual`): instants of events are roots that move,
!>
!> $$ r = 0 \; \text{(landing, opening)}, \quad |u - w|^2 = r^2 \; \text{(slip begins)}, \quad u' \cdot e = r' \text{(slip ends)} $$
!>
!> panels of slip lie between ends that move, with phi at their nodes by the collocation of `attrito_contact_slip_panel`. What
!> sliders and forces come to has derivatives that need no rule for jumps: those across events are in the motion of the ends.
module attrito_contact_varied_march
  use attrito_core_hyperdual, only: hyperdual_type, function_of, angle_of, cosine_of, sine_of, newton_step, multiplied, &
                                    operator(+), operator(-), operator(*)
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: basis_at
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_disc_record, only: disc_record_type
  use attrito_contact_panel_rule, only: panel_rule_type
  use attrito_contact_slip_panel, only: slip_panel_type, invert_panel
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_contact_varied_motion, only: varied_motion_type, jet_of, rate_basis
  implicit none
  private
  public :: varied_march_type, vary_march, kept_panels_type, keep_panels

  !> Steps of Newton's method: first derivatives, and the second
  integer, parameter :: steps = 2
  !> No regime: the march ends
  integer, parameter :: regime_none = -1

  type :: varied_march_type
    !> Where the slider is at the end
    type(hyperdual_type) :: slider(2)
    !> Integrals of z e_m, z = u - w, without those of the changes of u in stick [k, 2]; of N/k_n e_m over what is closed, by t and x
    !> together alone [k]
    type(hyperdual_type), allocatable :: stretch(:, :)
    real(wp), allocatable :: pressed(:)
  end type varied_march_type

  !> What all changes of a march's panels share: inverses of their linearised equations [s, s, panels], and values of the motion and
  !> of t at their nodes [21, s, panels]
  type :: kept_panels_type
    !> Is each panel's equation regular?
    logical :: regular = .true.
    real(wp), allocatable :: inverse(:, :, :), values(:, :, :)
  end type kept_panels_type

  !> Where a march is: the instant, direction of slip, slider
  type :: place_type
    type(hyperdual_type) :: theta, phi, slider(2)
    !> Panels that lie behind
    integer :: panels = 0
  end type place_type

contains

  !> What all changes share, of a motion and one t.
  function keep_panels(varied, rules, record) result(self)
    !> Motion of the contact with its changes
    type(varied_motion_type), intent(in) :: varied
    !> Rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> The march, its panels listed
    type(disc_record_type), intent(in) :: record
    type(kept_panels_type) :: self
    integer :: i, k

    k = size(varied%shared, 2)
    associate (s => rules%radau%nodes, n => record%listed)
      allocate (self%inverse(s, s, n), self%values(size(varied%shared, 1), s, n))
      do i = 1, n
        associate (panel => record%panels(i))
          if (panel%opens) then
            call invert_panel(rules%gauss, panel, self%inverse(:, :, i), self%regular)
          else
            call invert_panel(rules%radau, panel, self%inverse(:, :, i), self%regular)
          end if
          if (.not. self%regular) return
          self%values(:, :, i) = matmul(varied%shared, transpose(panel%basis(:, :k)))
        end associate
      end do
    end associate
  end function keep_panels

  !> The march of a record from a start slider, or from where the contact lands.
  function vary_march(varied, motion, rules, record, kept, lands, start) result(march)
    !> Motion of the contact, with its changes and without; rules of panels
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> The march, its panels listed, and what changes of them share
    type(disc_record_type), intent(in) :: record
    type(kept_panels_type), intent(in) :: kept
    !> Does it begin where the contact lands?
    logical, intent(in) :: lands
    !> If not: the slider there
    type(hyperdual_type), intent(in) :: start(2)
    type(varied_march_type) :: march
    type(place_type) :: place
    type(hyperdual_type) :: to
    integer :: after, i, k

    k = size(varied%shared, 2)
    allocate (march%stretch(k, 2), march%pressed(k))
    march%pressed = 0.0_wp
    place%theta = hyperdual_type(record%ends(0))
    if (lands) then
      place%theta = root_of_radius(varied, record%ends(0))
      call land(varied, record%regimes(1), place)
    else
      call begin(varied, motion, record%regimes(1), start, place)
    end if
    do i = 1, record%intervals
      after = regime_none
      if (i < record%intervals) after = record%regimes(i + 1)
      to = hyperdual_type(record%ends(i))
      select case (record%regimes(i))
       case (regime_stick)
        if (after == regime_slip) to = root_of_excess(varied, motion, place%slider, record%ends(i))
        if (after == regime_open) to = root_of_radius(varied, record%ends(i))
        call add_stick(varied, place, to, march)
        if (after == regime_slip) place%phi = direction_of(varied%at(to), place%slider)
       case (regime_slip)
        if (after == regime_open) to = root_of_radius(varied, record%ends(i))
        call slip(varied, motion, rules, record, kept, record%ends(i), after == regime_stick, to, place, march)
        if (after /= regime_slip) place%slider = slider_of(varied%at(to), place%phi)
       case default
        to = root_of_radius(varied, record%ends(i))
        call add_open(varied, place%theta, to, march)
        if (after /= regime_none) then
          place%theta = to
          call land(varied, after, place)
        end if
      end select
      place%theta = to
    end do
    march%slider = place%slider
  end function vary_march

  !> The contact lands.
  pure subroutine land(varied, regime, place)
    !> Motion of the contact
    type(varied_motion_type), intent(in) :: varied
    !> What it does next
    integer, intent(in) :: regime
    !> Where the march is
    type(place_type), intent(inout) :: place
    type(hyperdual_type) :: jet(6)

    jet = varied%at(place%theta)
    place%slider = jet(1:2)
    if (regime == regime_slip) place%phi = angle_of(jet(4), jet(5))
  end subroutine land

  !> The period begins: a slider on the rim, or beyond, is at the nearest place of its disc.
  pure subroutine begin(varied, motion, regime, start, place)
    !> Motion of the contact, with its changes and without
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    !> What it does next
    integer, intent(in) :: regime
    !> The slider
    type(hyperdual_type), intent(in) :: start(2)
    !> Where the march is
    type(place_type), intent(inout) :: place
    type(hyperdual_type) :: jet(6)

    jet = varied%at(place%theta)
    place%slider = start
    if (regime /= regime_slip .and. norm2(jet(1:2)%value - start%value) < jet(3)%value - motion%negligible) return
    place%phi = direction_of(jet, start)
    if (regime /= regime_slip) place%slider = slider_of(jet, place%phi)
  end subroutine begin

  !> The instant at which the contact lands or opens.
  pure function root_of_radius(varied, theta) result(root)
    !> Motion of the contact
    type(varied_motion_type), intent(in) :: varied
    !> Where it is
    real(wp), intent(in) :: theta
    type(hyperdual_type) :: root
    type(hyperdual_type) :: jet(6)
    integer :: i

    root = hyperdual_type(theta)
    do i = 1, steps
      jet = varied%at(root)
      root = root + newton_step(jet(3), jet(6)%value)
    end do
  end function root_of_radius

  !> The instant at which slip begins.
  pure function root_of_excess(varied, motion, slider, theta) result(root)
    !> Motion of the contact, with its changes and without
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    !> Of the stick before
    type(hyperdual_type), intent(in) :: slider(2)
    !> Where it is
    real(wp), intent(in) :: theta
    type(hyperdual_type) :: root
    type(hyperdual_type) :: jet(6), z(2)
    real(wp) :: excess(2)
    integer :: i

    root = hyperdual_type(theta)
    excess = motion%excess(theta, slider%value)
    do i = 1, steps
      jet = varied%at(root)
      z = jet(1:2) - slider
      root = root + newton_step(z(1)*z(1) + z(2)*z(2) - jet(3)*jet(3), excess(2))
    end do
  end function root_of_excess

  !> Direction of u - w.
  pure function direction_of(jet, slider) result(phi)
    !> Motion of the contact; slider
    type(hyperdual_type), intent(in) :: jet(6), slider(2)
    type(hyperdual_type) :: phi
    type(hyperdual_type) :: z(2)

    z = jet(1:2) - slider
    phi = angle_of(z(1), z(2))
  end function direction_of

  !> u - r e(phi).
  pure function slider_of(jet, phi) result(slider)
    !> Motion of the contact; direction of slip
    type(hyperdual_type), intent(in) :: jet(6), phi
    type(hyperdual_type) :: slider(2)

    slider = jet(1:2) - jet(3)*[cosine_of(phi), sine_of(phi)]
  end function slider_of

  !> Slip over an interval, panel after panel.
  subroutine slip(varied, motion, rules, record, kept, ends, stops, to, place, march)
    !> Motion of the contact, with its changes and without; rules of panels
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> The march, and what changes of its panels share
    type(disc_record_type), intent(in) :: record
    type(kept_panels_type), intent(in) :: kept
    !> Where the interval ends
    real(wp), intent(in) :: ends
    !> Does slip end there, in stick?
    logical, intent(in) :: stops
    !> Its end: as it is known, then as it moves
    type(hyperdual_type), intent(inout) :: to
    !> Where the march is
    type(place_type), intent(inout) :: place
    !> What it comes to
    type(varied_march_type), intent(inout) :: march
    type(hyperdual_type) :: length, from
    logical :: lasts

    from = place%theta
    do while (place%panels < record%listed)
      associate (panel => record%panels(place%panels + 1))
        if (panel%from + 0.5_wp*panel%length > ends) exit
        lasts = place%panels + 1 == record%listed
        if (.not. lasts) lasts = record%panels(place%panels + 2)%from + 0.5_wp*record%panels(place%panels + 2)%length > ends
        length = hyperdual_type(panel%from + panel%length) - from
        if (lasts .and. .not. stops) length = to - from
        length%value = panel%length
        if (panel%opens) then
          call follow_panel(varied, motion, rules%gauss, panel, kept, place%panels + 1, .false., from, length, place%phi, march)
        else
          call follow_panel(varied, motion, rules%radau, panel, kept, place%panels + 1, lasts .and. stops, from, length, place%phi, &
                            march)
        end if
        from = from + length
      end associate
      place%panels = place%panels + 1
    end do
    if (stops) to = from
  end subroutine slip

  !> One panel of slip.
  subroutine follow_panel(varied, motion, rule, panel, kept, number, stops, from, length, phi, march)
    !> Motion of the contact, with its changes and without; nodes
    type(varied_motion_type), intent(in) :: varied
    type(disc_motion_type), intent(in) :: motion
    type(panel_rule_type), intent(in) :: rule
    !> The panel, solved; what changes of all panels share, and its number among them
    type(slip_panel_type), intent(in) :: panel
    type(kept_panels_type), intent(in) :: kept
    integer, intent(in) :: number
    !> Does slip end at its end?
    logical, intent(in) :: stops
    !> Where it begins, and its length, which follows the end of slip
    type(hyperdual_type), intent(in) :: from
    type(hyperdual_type), intent(inout) :: length
    !> Direction at its start, then at its end
    type(hyperdual_type), intent(inout) :: phi
    !> What the march comes to
    type(varied_march_type), intent(inout) :: march
    type(hyperdual_type) :: angles(0:rule%nodes), jets(6, rule%nodes), theta(rule%nodes), rate(rule%nodes), part(rule%nodes, 2)
    type(hyperdual_type) :: c(rule%nodes), s(rule%nodes)
    real(wp) :: own(size(varied%own, 1), rule%nodes)
    integer :: i, k, n, round

    n = rule%nodes
    k = size(varied%shared, 2)
    own = matmul(varied%own, transpose(panel%basis(:, :k)))
    angles%value = panel%phi
    angles(0)%t = phi%t
    angles(0)%x = phi%x
    angles(0)%tx = phi%tx
    call turn_to(angles(1:))
    do round = 1, merge(steps + 1, 1, stops)
      theta = from + rule%x(1:)*length
      do i = 1, n
        jets(:, i) = jet_of(kept%values(:, i, number), own(:, i), theta(i))
      end do
      do i = 1, steps
        rate = multiplied(rule%derivative, angles)
        rate = panel%scale*(length*(jets(5, :)*c - jets(4, :)*s) - jets(3, :)*rate)
        rate%value = 0.0_wp
        angles(1:) = angles(1:) + multiplied(kept%inverse(:, :, number), rate)
        call turn_to(angles(1:))
      end do
      if (stops .and. round <= steps) length = length + newton_step(jets(4, n)*c(n) + jets(5, n)*s(n) - jets(6, n), speed_rate())
    end do
    phi = angles(n)
    part(:, 1) = rule%weight*(length*(jets(3, :)*c))
    part(:, 2) = rule%weight*(length*(jets(3, :)*s))
    call add_nodes(panel%basis(:, :k), theta, part, march%stretch)

  contains

    !> e at the nodes.
    subroutine turn_to(phi)
      !> Directions
      type(hyperdual_type), intent(in) :: phi(:)

      c = function_of(phi, panel%e(:, 1), -panel%e(:, 2), -panel%e(:, 1))
      s = function_of(phi, panel%e(:, 2), panel%e(:, 1), -panel%e(:, 2))
    end subroutine turn_to

    !> Of u'.e - r' at the last node, along the motion.
    real(wp) function speed_rate()
      real(wp) :: second(3), across

      second = motion%second_at(panel%from + panel%length)
      across = panel%jet(n, 5)*panel%e(n, 1) - panel%jet(n, 4)*panel%e(n, 2)
      speed_rate = dot_product(second(1:2), panel%e(n, :)) + across**2/panel%jet(n, 3) - second(3)
    end function speed_rate
  end subroutine follow_panel

  !> Integrals over a panel: sums over its nodes, which may move.
  pure subroutine add_nodes(basis, theta, part, stretch)
    !> 1, cos, sin, ... at the nodes [s, k]
    real(wp), intent(in) :: basis(:, :)
    !> Where they are; weights times what is integrated [s, 2]
    type(hyperdual_type), intent(in) :: theta(:), part(:, :)
    !> Integrals [k, 2]
    type(hyperdual_type), intent(inout) :: stretch(:, :)
    real(wp) :: factors(size(theta), 7), sums(7, size(basis, 2))
    integer :: a, h, k

    k = size(basis, 2)
    do a = 1, 2
      associate (p => part(:, a))
        factors = reshape([p%t, p%x, p%tx, p%value*theta%t, p%value*theta%x, &
                           p%t*theta%x + p%x*theta%t + p%value*theta%tx, p%value*theta%t*theta%x], shape(factors))
      end associate
      sums = matmul(transpose(factors), basis)
      stretch(:, a)%t = stretch(:, a)%t + sums(1, :)
      stretch(:, a)%x = stretch(:, a)%x + sums(2, :)
      stretch(:, a)%tx = stretch(:, a)%tx + sums(3, :)
      do h = 1, k/2
        associate (even => stretch(2*h, a), odd => stretch(2*h + 1, a))
          even%t = even%t - h*sums(4, 2*h + 1)
          odd%t = odd%t + h*sums(4, 2*h)
          even%x = even%x - h*sums(5, 2*h + 1)
          odd%x = odd%x + h*sums(5, 2*h)
          even%tx = even%tx - h*sums(6, 2*h + 1) - h**2*sums(7, 2*h)
          odd%tx = odd%tx + h*sums(6, 2*h) - h**2*sums(7, 2*h + 1)
        end associate
      end do
    end do
  end subroutine add_nodes

  !> An interval of stick: u - w between ends that move.
  subroutine add_stick(varied, place, to, march)
    !> Motion of the contact
    type(varied_motion_type), intent(in) :: varied
    !> Where it begins, and its slider
    type(place_type), intent(in) :: place
    !> Its end
    type(hyperdual_type), intent(in) :: to
    !> What the march comes to
    type(varied_march_type), intent(inout) :: march
    real(wp) :: lengths(size(march%stretch, 1))
    integer :: a

    lengths = antiderivatives(to%value, size(lengths)) - antiderivatives(place%theta%value, size(lengths))
    do a = 1, 2
      march%stretch(:, a)%t = march%stretch(:, a)%t - place%slider(a)%t*lengths
      march%stretch(:, a)%x = march%stretch(:, a)%x - place%slider(a)%x*lengths
      march%stretch(:, a)%tx = march%stretch(:, a)%tx - place%slider(a)%tx*lengths
    end do
    call add_end(varied, place%theta, place%slider, -1, march)
    call add_end(varied, to, place%slider, 1, march)
  end subroutine add_stick

  !> What an end of stick adds as it moves: of the integral up to it of f e_m, f = u - w, f_t and f_x its changes at an instant that
  !> stays, f e_m theta_tx + (f e_m)' theta_t theta_x + (f_t theta_x + f_x theta_t) e_m.
  subroutine add_end(varied, theta, slider, side, march)
    !> Motion of the contact
    type(varied_motion_type), intent(in) :: varied
    !> The end; slider
    type(hyperdual_type), intent(in) :: theta, slider(2)
    !> 1: at the end, -1: at the start
    integer, intent(in) :: side
    !> What the march comes to
    type(varied_march_type), intent(inout) :: march
    real(wp) :: basis(size(march%stretch, 1)), rates(size(march%stretch, 1))
    type(hyperdual_type) :: here(6), f
    integer :: a

    basis = side*basis_at(theta%value, varied%harmonics)
    rates = rate_basis(basis)
    here = varied%at(hyperdual_type(theta%value))
    do a = 1, 2
      f = here(a) - slider(a)
      march%stretch(:, a)%t = march%stretch(:, a)%t + (f%value*theta%t)*basis
      march%stretch(:, a)%x = march%stretch(:, a)%x + (f%value*theta%x)*basis
      march%stretch(:, a)%tx = march%stretch(:, a)%tx + (f%value*theta%t*theta%x)*rates &
                               + (f%value*theta%tx + here(a + 3)%value*theta%t*theta%x + f%t*theta%x + f%x*theta%t)*basis
    end do
  end subroutine add_end

  !> While the contact is open nothing is pressed: f = r vanishes at both ends, and r_t = -r' theta_t there.
  subroutine add_open(varied, from, to, march)
    !> Motion of the contact
    type(varied_motion_type), intent(in) :: varied
    !> Ends of the interval
    type(hyperdual_type), intent(in) :: from, to
    !> What the march comes to
    type(varied_march_type), intent(inout) :: march
    type(hyperdual_type) :: opening(6), landing(6)

    opening = varied%at(hyperdual_type(from%value))
    landing = varied%at(hyperdual_type(to%value))
    march%pressed = march%pressed - opening(6)%value*from%t*from%x*basis_at(from%value, varied%harmonics) &
                    + landing(6)%value*to%t*to%x*basis_at(to%value, varied%harmonics)
  end subroutine add_open

  !> Of 1, cos, sin, cos 2, ...
  pure function antiderivatives(theta, count) result(values)
    !> Angle of the period
    real(wp), intent(in) :: theta
    !> How many
    integer, intent(in) :: count
    real(wp) :: values(count), basis(count)
    integer :: h

    basis = basis_at(theta, count/2)
    values(1) = theta
    do h = 1, count/2
      values(2*h) = basis(2*h + 1)/h
      values(2*h + 1) = -basis(2*h)/h
    end do
  end function antiderivatives
end module attrito_contact_varied_march
