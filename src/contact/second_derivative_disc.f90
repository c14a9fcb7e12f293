!> Second derivative of the contact forces of two tangents by events: how the Jacobian D changes along a motion t, times motions x,
!>
!> $$ D'[t] x = \left( k_t \int (u - w)_{tx} \, e_m \, d\theta, \; \int_{N > 0} N_{tx} \, e_m \, d\theta \right) $$
!>
!> in coefficients, from the march gone through again in hyper-dual numbers (`attrito_contact_varied_march`). A slider that a period
!> is to bring back follows the motion, to second order by
!>
!> $$ (I - P_w) \, w_x = P_x, \qquad (I - P_w) \, w_{tx} = P_{tx} + P_{tw} w_x + P_{wx} w_t + P_{ww}[w_t, w_x] $$
!>
!> and one that rests stays where its instants hold it.
module attrito_contact_second_derivative_disc
  use attrito_core_hyperdual, only: hyperdual_type
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_loop, only: holding_of
  use attrito_contact_disc_march, only: start_at, land, march_disc
  use attrito_contact_disc_motion, only: disc_motion_type, new_disc_motion
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_disc_record, only: disc_state_type, disc_record_type, new_record
  use attrito_contact_forces, only: released
  use attrito_contact_quadrature_disc, only: find_cuts
  use attrito_contact_resting_place, only: resting_place_type, find_resting_place
  use attrito_contact_slip_panel, only: slip_panel_type, new_slip_panel
  use attrito_contact_state, only: regime_open
  use attrito_contact_varied_march, only: varied_march_type, vary_march, kept_panels_type, keep_panels
  use attrito_contact_varied_motion, only: varied_motion_type, new_varied_motion
  use attrito_contact_varied_rest, only: vary_rest
  implicit none
  private
  public :: start_slider_type, differentiate_twice_by_disc_events

  !> The slider at the start of the period, of a contact that stays closed
  type :: start_slider_type
    !> As it was given, and where the last evaluation found it
    real(wp) :: given(2) = 0.0_wp, found(2) = 0.0_wp
    !> Is it an unknown? If so: how it goes along t, and along each of the x [2, n]
    logical :: periodic = .false.
    real(wp) :: along(2) = 0.0_wp
    real(wp), allocatable :: columns(:, :)
  end type start_slider_type

contains

  !> D'[t] x of one contact for several x. `done` is false where the march cannot be followed: then differences have to serve.
  subroutine differentiate_twice_by_disc_events(law, rules, motion, slider, along, columns, product, done)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids and rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> Coefficients of u_1, u_2, v [k, 3]
    real(wp), intent(in) :: motion(:, :)
    !> The slider
    type(start_slider_type), intent(in) :: slider
    !> t [k, 3] and the x [3 k, n]
    real(wp), intent(in) :: along(:, :), columns(:, :)
    !> [3 k, n]
    real(wp), intent(out) :: product(:, :)
    !> Is it known?
    logical, intent(out) :: done
    type(disc_motion_type) :: disc
    type(disc_record_type) :: record
    type(resting_place_type) :: place
    type(hyperdual_type) :: rest(2)
    real(wp), allocatable :: cuts(:)
    integer :: a, n

    product = 0.0_wp
    done = .true.
    associate (k => size(motion, 1))
      disc = new_disc_motion(law, rules, motion)
      call disc%sample_slopes(rules)
      call find_cuts(law, rules, disc, motion, cuts)
      ! Open all over the period, or not pressed: the slider goes with the motion.
      if (size(cuts) == 0 .and. disc%largest <= -law%touching_force(motion(:, 3))*disc%slope/law%normal_stiffness) return
      if (size(cuts) == 0 .and. .not. slider%periodic) then
        place = find_resting_place(disc, slider%given)
        if (place%exists) then
          do n = 1, size(columns, 2)
            rest = vary_rest(new_varied_motion(disc, along, reshape(columns(:, n), [k, 3])), disc, place)
            do a = 1, 2
              product((a - 1)*k + 1, n) = -law%tangential_stiffness*rest(a)%tx
            end do
          end do
          return
        end if
      end if
      record = march_again(disc, rules, cuts, slider%found)
      done = .not. record%failed
      if (done) call vary(law, rules, disc, record, size(cuts) > 0, slider, along, columns, product, done)
    end associate
  end subroutine differentiate_twice_by_disc_events

  !> The march, its panels listed.
  function march_again(motion, rules, cuts, slider) result(record)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(inout) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> Landings and openings in turn; slider at the start if there are none
    real(wp), intent(in) :: cuts(:), slider(2)
    type(disc_record_type) :: record
    type(disc_state_type) :: state
    type(slip_panel_type) :: panel
    type(disc_rules_type) :: listing
    real(wp) :: first, next, none(0, 2)
    integer :: i
    logical :: entered

    listing = rules
    listing%lists_panels = .true.
    first = 0.0_wp
    if (size(cuts) > 0) first = cuts(1)
    record = new_record(first, size(motion%series, 2), 1, 0, .false., .true., listing)
    panel = new_slip_panel(rules, size(motion%series, 2))
    if (size(cuts) == 0) then
      call start_at(motion, 0.0_wp, slider, none, record, state, entered)
      call march_disc(motion, rules, 0.0_wp, two_pi, .false., panel, state, record)
      return
    end if
    do i = 1, size(cuts), 2
      call land(motion, cuts(i), record, state)
      call march_disc(motion, rules, cuts(i), cuts(i + 1), .true., panel, state, record)
      if (record%failed) return
      next = first + two_pi
      if (i + 1 < size(cuts)) next = cuts(i + 2)
      call record%add_interval(next, regime_open, state)
    end do
  end function march_again

  !> D'[t] x of a march.
  subroutine vary(law, rules, motion, record, opens, slider, along, columns, product, done)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> The march, its panels listed
    type(disc_record_type), intent(in) :: record
    !> Does the contact open? If not: the slider
    logical, intent(in) :: opens
    type(start_slider_type), intent(in) :: slider
    !> t and the x
    real(wp), intent(in) :: along(:, :), columns(:, :)
    !> What it makes of them
    real(wp), intent(inout) :: product(:, :)
    !> Is it known?
    logical, intent(out) :: done
    type(varied_motion_type) :: varied
    type(varied_march_type) :: by_start, march
    type(hyperdual_type) :: start(2)
    type(kept_panels_type) :: kept
    real(wp) :: holding(2, 2), second(2), ways(2, 2)
    integer :: a, n, k

    k = size(along, 1)
    kept = keep_panels(new_varied_motion(motion, along, along), rules, record)
    done = kept%regular
    if (.not. done) return
    start%value = slider%found
    if (.not. opens) then
      ! Along t and x both coordinates of the start slider.
      start(1)%t = 1.0_wp
      start(2)%x = 1.0_wp
      varied = new_varied_motion(motion, 0.0_wp*along, 0.0_wp*along)
      by_start = vary_march(varied, motion, rules, record, keep_panels(varied, rules, record), .false., start)
      holding = holding_of(transpose(reshape([by_start%slider%t, by_start%slider%x], [2, 2])))
    end if
    do n = 1, size(columns, 2)
      varied = new_varied_motion(motion, along, reshape(columns(:, n), [k, 3]))
      start = [(hyperdual_type(slider%found(a)), a=1, 2)]
      if (slider%periodic) then
        ways = reshape([slider%along, slider%columns(:, n)], [2, 2])
      else if (.not. opens) then
        march = vary_march(varied, motion, rules, record, kept, .false., start)
        ways = released(holding, reshape([march%slider%t, march%slider%x], [2, 2]))
      end if
      if (.not. opens) then
        start%t = ways(:, 1)
        start%x = ways(:, 2)
      end if
      march = vary_march(varied, motion, rules, record, kept, opens, start)
      if (.not. opens) then
        second = reshape(released(holding, reshape(march%slider%tx, [2, 1])), [2])
        march%stretch%tx = march%stretch%tx + second(1)*by_start%stretch%t + second(2)*by_start%stretch%x
      end if
      do a = 1, 2
        product((a - 1)*k + 1:a*k, n) = law%tangential_stiffness*coefficients(march%stretch(:, a)%tx)
      end do
      product(2*k + 1:, n) = law%normal_stiffness/motion%slope*coefficients(march%pressed)
    end do
  end subroutine vary

  !> Fourier coefficients from integrals over a period.
  pure function coefficients(integrals) result(series)
    !> Of the products with 1, cos, sin, ...
    real(wp), intent(in) :: integrals(:)
    real(wp) :: series(size(integrals))

    series = integrals/pi
    series(1) = 0.5_wp*series(1)
  end function coefficients
end module attrito_contact_second_derivative_disc
