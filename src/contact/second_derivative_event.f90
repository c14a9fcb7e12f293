!> Second derivative of the contact forces of one tangent by events: how the Jacobian D changes along a motion t, times motions x.
!>
!> The forces' derivative is (D x)_t = -k_t w_x, (D x)_n = -k_n x_v where open, with
!>
!>   w_x = x_u - s mu k_n/k_t x_v  (slip),  x_u  (open),  x_u(o) + b x_v(o)  (stick since the event at o, b its `by_normal`).
!>
!> Its Fourier integrals change along t as the ends of intervals move across a jump of the integrand, and as what a slider at rest
!> took over at o moves with o and b:
!>
!> $$ D'[t] x = \frac{1}{\pi} \left( \sum_e [\![ -k_t w_x ]\!]_e \dot\theta_e \, e(\theta_e)
!>    - k_t \sum_\text{rests} \dot w_x \int_\text{rest} e \, d\theta \right) $$
!>
!> Exact wherever events cross their thresholds at a slope; it is symmetric in t and x, being a second derivative.
module attrito_contact_second_derivative_event
  use attrito_core_kinds, only: wp, pi
  use attrito_core_trigonometric, only: basis_at, value_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_event_march, only: event_motion_type, interval_type, new_event_motion, march_events
  use attrito_contact_moments, only: moments_type, new_moments, ends_type, new_ends
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type
  implicit none
  private
  public :: differentiate_twice_by_events

contains

  !> D'[t] x of one contact for several x.
  subroutine differentiate_twice_by_events(law, grid, motion, slider, active, along, columns, product)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grid on which roots are looked for
    type(trigonometric_grid_type), intent(in) :: grid
    !> Coefficients of u, v [k, 2], and the slider at the start of the first march
    real(wp), intent(in) :: motion(:, :), slider
    !> Rows of the Jacobian that are not zero [2 k]
    logical, intent(in) :: active(:)
    !> t [k, 2] and the x [2 k, n]
    real(wp), intent(in) :: along(:, :), columns(:, :)
    !> [2 k, n]
    real(wp), intent(out) :: product(:, :)
    type(event_motion_type) :: events
    type(interval_type), allocatable :: intervals(:)
    type(interval_type) :: state
    integer :: count, i

    events = new_event_motion(law, grid, motion)
    allocate (intervals(2*size(events%closed)))
    state = interval_type(slider=slider)
    call march_events(events, state)
    call march_events(events, state, intervals, count)
    product = 0.0_wp
    do i = 2, count
      call cross_event(law, events, intervals(i - 1), intervals(i), motion, along, columns, product)
    end do
    call move_rests(law, events, intervals(:count), motion, along, columns, product)
    do i = 1, size(active)
      if (.not. active(i)) product(i, :) = 0.0_wp
    end do
  end subroutine differentiate_twice_by_events

  !> What the end between two intervals adds as it moves.
  subroutine cross_event(law, events, before, after, motion, along, columns, product)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Intervals and events of the contact's motion
    type(event_motion_type), intent(in) :: events
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: before, after
    real(wp), intent(in) :: motion(:, :), along(:, :), columns(:, :)
    !> What it makes of them, added up
    real(wp), intent(inout) :: product(:, :)
    real(wp) :: basis(size(motion, 1)), clamp(3), normal(3), speed, jump(2)
    integer :: k, n

    if (before%regime == after%regime .and. before%side == after%side) return
    ! Where slip ends the slider and its derivative go on as they were.
    if (before%regime == regime_slip .and. after%regime == regime_stick) return
    k = size(motion, 1)
    basis = basis_at(after%from, (k - 1)/2)
    if (before%regime == regime_open .or. after%regime == regime_open) then
      normal = value_at(motion(:, 2), after%from)
      if (abs(normal(2)) <= 0.0_wp) return
      speed = -dot_product(basis, along(:, 2))/normal(2)
    else
      clamp = merge(value_at(events%lower(:, 1), after%from), value_at(events%upper(:, 1), after%from), after%side > 0)
      if (abs(clamp(2)) <= 0.0_wp) return
      speed = (slider_derivative(events, before, after%from, along) &
               - slider_derivative(events, after, after%from, along))/clamp(2)
    end if
    do n = 1, size(columns, 2)
      associate (x => reshape(columns(:, n), [k, 2]))
        jump(1) = -law%tangential_stiffness*(slider_derivative(events, before, after%from, x) &
                                             - slider_derivative(events, after, after%from, x))
        jump(2) = 0.0_wp
        if (before%regime == regime_open) jump(2) = -law%normal_stiffness*dot_product(basis, x(:, 2))
        if (after%regime == regime_open) jump(2) = jump(2) + law%normal_stiffness*dot_product(basis, x(:, 2))
      end associate
      product(:k, n) = product(:k, n) + jump(1)*speed/pi*projected(basis)
      product(k + 1:, n) = product(k + 1:, n) + jump(2)*speed/pi*projected(basis)
    end do
  end subroutine cross_event

  !> Change of the slider with the motion x [k, 2], in an interval.
  real(wp) function slider_derivative(events, interval, theta, x) result(change)
    !> Intervals and events of the contact's motion
    type(event_motion_type), intent(in) :: events
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: interval
    !> Angle of the period, omega t; coefficients of the change of the motion
    real(wp), intent(in) :: theta, x(:, :)
    real(wp) :: basis(size(x, 1))

    change = 0.0_wp
    select case (interval%regime)
     case (regime_stick)
      if (.not. interval%has_origin) return
      basis = basis_at(interval%origin, (size(x, 1) - 1)/2)
      change = dot_product(basis, x(:, 1)) + interval%by_normal*dot_product(basis, x(:, 2))
     case (regime_slip)
      basis = basis_at(theta, (size(x, 1) - 1)/2)
      change = dot_product(basis, x(:, 1)) - interval%side*events%slope(1, 1)*dot_product(basis, x(:, 2))
     case default
      change = dot_product(basis_at(theta, (size(x, 1) - 1)/2), x(:, 1))
    end select
  end function slider_derivative

  !> What sliders at rest add, as the event that put them there moves.
  subroutine move_rests(law, events, intervals, motion, along, columns, product)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Intervals and events of the contact's motion
    type(event_motion_type), intent(in) :: events
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: intervals(:)
    real(wp), intent(in) :: motion(:, :), along(:, :), columns(:, :)
    !> What it makes of them, added up
    real(wp), intent(inout) :: product(:, :)
    type(ends_type) :: ends
    type(moments_type) :: resting
    real(wp) :: rest(size(motion, 1)), shift, turn, x_u(3), x_v(3)
    integer :: i, k, n

    k = size(motion, 1)
    ends = new_ends([intervals(1)%from, intervals%to], (k - 1)/2)
    do i = 1, size(intervals)
      associate (interval => intervals(i))
        if (interval%regime /= regime_stick .or. .not. interval%has_origin) cycle
        call move_origin(events, interval, motion, along, shift, turn)
        resting = new_moments((k - 1)/2)
        call resting%add(ends, i, 1.0_wp)
        rest = 0.0_wp
        call resting%add_column(-law%tangential_stiffness, rest)
        do n = 1, size(columns, 2)
          x_u = value_at(columns(:k, n), interval%origin)
          x_v = value_at(columns(k + 1:, n), interval%origin)
          product(:k, n) = product(:k, n) + (shift*(x_u(2) + interval%by_normal*x_v(2)) + turn*x_v(1))*rest
        end do
      end associate
    end do
  end subroutine move_rests

  !> How the instant that put a slider where it rests moves along t, and how its `by_normal` does.
  subroutine move_origin(events, interval, motion, along, shift, turn)
    !> Intervals and events of the contact's motion
    type(event_motion_type), intent(in) :: events
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: interval
    !> Coefficients of the motion; coefficients of the direction of the derivative
    real(wp), intent(in) :: motion(:, :), along(:, :)
    !> Change of the instant; change of `by_normal`
    real(wp), intent(out) :: shift, turn
    real(wp) :: u(3), v(3), t_u(3), t_v(3)

    u = value_at(motion(:, 1), interval%origin)
    v = value_at(motion(:, 2), interval%origin)
    t_u = value_at(along(:, 1), interval%origin)
    t_v = value_at(along(:, 2), interval%origin)
    shift = 0.0_wp
    turn = 0.0_wp
    if (abs(abs(interval%by_normal) - events%slope(1, 1)) <= 0.0_wp) then
      ! The end of slip: u' + b v' vanishes.
      associate (curvature => u(3) + interval%by_normal*v(3))
        if (abs(curvature) > 0.0_wp) shift = -(t_u(2) + interval%by_normal*t_v(2))/curvature
      end associate
    else if (abs(v(2)) > 0.0_wp) then
      ! Landing: N vanishes, b = -u'/v'.
      shift = -t_v(1)/v(2)
      turn = -(t_u(2) + u(3)*shift + interval%by_normal*(t_v(2) + v(3)*shift))/v(2)
    end if
  end subroutine move_origin

  !> Coefficients of a unit impulse, times pi: the mean has half the weight of the others.
  pure function projected(basis)
    !> Cosines and sines at the impulse
    real(wp), intent(in) :: basis(:)
    real(wp) :: projected(size(basis))

    projected = basis
    projected(1) = 0.5_wp
  end function projected
end module attrito_contact_second_derivative_event
