!> Displacements and forces of a contact at equally spaced instants of a period, as plots and fits of loops have them: what the march
!> by events has at each, from the steady loop that it comes to from a slider.
!>
!> $$ T = k_t (u - w) \; \text{(stick)}, \qquad k_t r e(\phi) \; \text{(slip)}, \qquad 0 \; \text{(open)} $$
!>
!> with phi the polynomial of its panel. Elements in parallel add up. A march that does not come through has no number.
module attrito_contact_instants
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: basis_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_loop, only: loop_type
  use attrito_contact_disc_motion, only: disc_motion_type, new_disc_motion
  use attrito_contact_disc_rules, only: disc_rules_type, new_disc_rules
  use attrito_contact_event_march, only: event_motion_type, interval_type, new_event_motion, march_events
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_quadrature_disc, only: follow_period
  use attrito_contact_resting_place, only: resting_place_type
  use attrito_contact_state, only: regime_stick, regime_slip
  use attrito_contact_trigonometric_roots, only: new_grid
  implicit none
  private
  public :: forces_at_instants

contains

  !> All elements together.
  subroutine forces_at_instants(law, motion, slider, displacement, force)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :)
    !> Sliders, in pairs, one an element [at least 2 elements]
    real(wp), intent(in) :: slider(:)
    !> [J, tangents + 1]
    real(wp), intent(out) :: displacement(:, :), force(:, :)
    real(wp) :: instants(size(displacement, 1))
    integer :: e, j, n

    n = law%tangents
    instants = [(two_pi*(j - 1)/size(instants), j=1, size(instants))]
    do j = 1, size(instants)
      displacement(j, :) = matmul(basis_at(instants(j), size(motion, 1)/2), motion)
    end do
    force(:, :n) = 0.0_wp
    force(:, n + 1) = max(law%normal_force(displacement(:, n + 1)), 0.0_wp)
    do e = 1, law%elements()
      if (n == 1) then
        call add_along_line(law%element(e), motion, slider(2*e - 1), instants, displacement(:, 1), force(:, 1))
      else
        call add_on_discs(law%element(e), motion, slider(2*e - 1:2*e), instants, displacement(:, :2), force(:, :2))
      end if
    end do
  end subroutine forces_at_instants

  !> One element with one tangent.
  subroutine add_along_line(law, motion, slider, instants, u, force)
    !> Contact of one element
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement; slider
    real(wp), intent(in) :: motion(:, :), slider
    !> Angles of the period, ascending; displacement there
    real(wp), intent(in) :: instants(:), u(:)
    !> What it is added to
    real(wp), intent(inout) :: force(:)
    type(event_motion_type) :: events
    type(interval_type), allocatable :: intervals(:)
    type(interval_type) :: state
    integer :: count, i, j

    events = new_event_motion(law, new_grid(size(motion, 1) - 1), motion)
    allocate (intervals(2*size(events%closed)))
    state = interval_type(slider=slider)
    call march_events(events, state)
    call march_events(events, state, intervals, count)
    i = 1
    do j = 1, size(instants)
      do while (i < count .and. instants(j) > intervals(i)%to)
        i = i + 1
      end do
      associate (kt => law%tangential_stiffness, interval => intervals(i))
        if (interval%regime == regime_stick) then
          force(j) = force(j) + kt*(u(j) - interval%slider)
        else if (interval%regime == regime_slip) then
          associate (radius => events%radius(:, interval%piece))
            force(j) = force(j) + kt*interval%side*dot_product(radius, basis_at(instants(j), size(radius)/2))
          end associate
        end if
      end associate
    end do
  end subroutine add_along_line

  !> One element with two tangents.
  subroutine add_on_discs(law, motion, slider, instants, u, force)
    !> Contact of one element
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement; slider
    real(wp), intent(in) :: motion(:, :), slider(2)
    !> Angles of the period, ascending; displacement there
    real(wp), intent(in) :: instants(:), u(:, :)
    !> What it is added to
    real(wp), intent(inout) :: force(:, :)
    type(disc_rules_type) :: rules
    type(disc_motion_type) :: disc
    type(contact_forces_type) :: forces
    type(resting_place_type) :: place
    type(loop_type) :: loop
    real(wp) :: theta, jet(6), phi
    integer :: i, j, p

    rules = new_disc_rules(size(motion, 1)/2)
    rules%lists_panels = .true.
    forces%without_jacobian = .true.
    allocate (forces%deviation(size(motion, 1), 3))
    disc = new_disc_motion(law, rules, motion)
    call follow_period(law, rules, motion, slider, disc, forces, place, loop)
    if (loop%rests) then
      force = force + law%tangential_stiffness*(u - spread(place%slider, 1, size(instants)))
      return
    end if
    if (loop%record%failed) then
      force = ieee_value(1.0_wp, ieee_quiet_nan)
      return
    end if
    associate (kt => law%tangential_stiffness, record => loop%record)
      do j = 1, size(instants)
        theta = instants(j)
        if (theta < record%ends(0)) theta = theta + two_pi
        i = min(count(record%ends(1:record%intervals) < theta) + 1, record%intervals)
        if (record%regimes(i) == regime_stick) then
          force(j, :) = force(j, :) + kt*(u(j, :) - record%sliders(:, i))
        else if (record%regimes(i) == regime_slip .and. record%listed > 0) then
          p = max(count(record%panels(:record%listed)%from <= theta), 1)
          associate (panel => record%panels(p), x => (theta - record%panels(p)%from)/record%panels(p)%length)
            if (panel%opens) then
              phi = rules%gauss%interpolate(panel%phi, x)
            else
              phi = rules%radau%interpolate(panel%phi, x)
            end if
          end associate
          jet = disc%at(theta)
          force(j, :) = force(j, :) + kt*max(jet(3), 0.0_wp)*[cos(phi), sin(phi)]
        end if
      end do
    end associate
  end subroutine add_on_discs
end module attrito_contact_instants
