!> Contact forces of a trigonometric motion with one tangent, exact: the deviation g = lambda - K_c d is trigonometric or constant
!> between events, so its Fourier coefficients are closed form,
!>
!> $$ \hat g_m = \frac{1}{\pi} \sum_\text{intervals} \int e_m(\theta) \, g(\theta) \, d\theta, \qquad
!>    \int e_m e_n \, d\theta \text{ from } \int \cos p\theta \, d\theta, \; \int \sin p\theta \, d\theta $$
!>
!> and so is the Jacobian: g is continuous across events, so their motion leaves no term but that of landing.
module attrito_contact_quadrature_event
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: basis_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type, hold_slider, stay_stuck
  use attrito_contact_moments, only: moments_type, new_moments, ends_type, new_ends
  use attrito_contact_event_march, only: event_motion_type, interval_type, new_event_motion, march_events
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open, state_stuck, state_shaken_down, state_slipping, &
                                   state_open
  use attrito_contact_stuck_bound, only: is_stuck_by_bound
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type
  implicit none
  private
  public :: evaluate_contact_by_events

  !> Of the ends of a clamp, whose coefficients are sums of some terms
  real(wp), parameter :: rounding = 1.0e-13_wp ! derived

contains

  !> Forces and Jacobian of one contact with one tangent.
  subroutine evaluate_contact_by_events(law, grid, motion, slider, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grid on which roots are looked for
    type(trigonometric_grid_type), intent(in) :: grid
    !> Coefficients of relative displacement u, v [k, 2]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start of the first march
    real(wp), intent(in) :: slider
    !> Forces; `deviation` is allocated by the caller, for as many coefficients as it wants
    type(contact_forces_type), intent(inout) :: forces
    type(event_motion_type) :: events
    type(interval_type), allocatable :: intervals(:)
    type(interval_type) :: state, lowest, highest
    integer :: count

    if (is_stuck_by_bound(law, motion, [slider])) then
      call stay_stuck(law, [slider, 0.0_wp], size(motion, 1), forces)
      return
    end if
    events = new_event_motion(law, grid, motion)
    allocate (intervals(2*size(events%closed)))
    state = interval_type(slider=slider)
    lowest = interval_type(slider=-huge(1.0_wp))
    highest = interval_type(slider=huge(1.0_wp))
    call march_events(events, state)
    call march_events(events, lowest)
    call march_events(events, highest)
    forces%slider = [state%slider, 0.0_wp]
    forces%moved = [0.0_wp, 0.0_wp]
    forces%unique = lowest%slider >= highest%slider .or. .not. differ(lowest%slider, highest%slider)
    call march_events(events, state, intervals, count)
    call integrate(law, events, intervals(:count), motion, forces)
    call classify(events, intervals(:count), differ(forces%slider(1), slider), forces)
    if (.not. forces%without_jacobian) call differentiate(forces, size(motion, 1))
    if (forces%state == state_stuck) call hold_slider(law, (forces%slider), forces)
  end subroutine evaluate_contact_by_events

  !> Do two sliders differ by more than rounding? One that stands at an end of its clamp is not moved by that: the contact rests, and
  !> does not follow what the end does.
  elemental logical function differ(one, other)
    !> Sliders
    real(wp), intent(in) :: one, other

    differ = abs(one - other) > rounding*(abs(one) + abs(other))
  end function differ

  !> Coefficients of the deviation and its Jacobian, from the moments of where the slider moves and where the contact is open.
  subroutine integrate(law, events, intervals, motion, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Intervals and events of the contact's motion
    type(event_motion_type), intent(in) :: events
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: intervals(:)
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    !> Where the slider goes with u; where with the radius, less where against it; and where open
    type(moments_type) :: moving, along, opened, weighted
    type(ends_type) :: ends
    real(wp) :: closed_normal
    real(wp) :: by_normal(size(motion, 1), size(motion, 1))
    integer :: i, k, order, p

    k = size(motion, 1)
    if (all(intervals%regime == regime_open)) then
      call let_go(law, motion, forces)
      return
    end if
    order = (size(forces%deviation, 1) + size(events%radius, 1))/2 - 1
    ends = new_ends([intervals(1)%from, intervals%to], order)
    moving = new_moments(order)
    opened = new_moments(order)
    do i = 1, size(intervals)
      if (intervals(i)%regime /= regime_stick) call moving%add(ends, i, 1.0_wp)
      if (intervals(i)%regime == regime_open) call opened%add(ends, i, 1.0_wp)
    end do
    call moving%complete()
    call opened%complete()
    closed_normal = law%normal_force(0.0_wp)
    forces%deviation = 0.0_wp
    forces%deviation(1, 2) = closed_normal
    if (allocated(forces%jacobian)) deallocate (forces%jacobian)
    associate (g_t => forces%deviation(:, 1), g_n => forces%deviation(:, 2), kt => law%tangential_stiffness, &
               kn => law%normal_stiffness)
      ! w = u - r along the tangent, u + r against it
      call moving%add_product(motion(:, 1), -kt, g_t)
      call opened%add_column(-closed_normal, g_n)
      call opened%add_product(motion(:, 2), -kn, g_n)
      if (.not. forces%without_jacobian) then
        allocate (forces%jacobian(2*k, 2*k))
        call moving%write_matrix(-kt, forces%jacobian(:k, :k))
        forces%jacobian(:k, k + 1:) = 0.0_wp
        forces%jacobian(k + 1:, :k) = 0.0_wp
        call opened%write_matrix(-kn, forces%jacobian(k + 1:, k + 1:))
      end if
      do p = 1, size(events%radius, 2)
        if (.not. any(intervals%regime == regime_slip .and. intervals%piece == p)) cycle
        along = new_moments(order)
        do i = 1, size(intervals)
          if (intervals(i)%regime == regime_slip .and. intervals(i)%piece == p) call along%add(ends, i, real(intervals(i)%side, wp))
        end do
        call along%complete()
        call along%add_product(events%radius(:, p), kt, g_t)
        if (forces%without_jacobian) cycle
        if (size(events%slope) == 1) then
          call along%write_matrix(kt*events%slope(1, 1), forces%jacobian(:k, k + 1:))
        else
          weighted = along%weighted(events%slope(:, p), k - 1)
          call weighted%write_matrix(kt, by_normal)
          forces%jacobian(:k, k + 1:) = forces%jacobian(:k, k + 1:) + by_normal
        end if
      end do
    end associate
    call integrate_rest(law, intervals, ends, k, forces)
  end subroutine integrate

  !> A contact that is open all the time has exactly no force: g = -K_c d, in which the gap does not occur, however large it is.
  pure subroutine let_go(law, motion, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    integer :: i, k, least

    k = size(motion, 1)
    least = min(k, size(forces%deviation, 1))
    forces%deviation = 0.0_wp
    forces%deviation(:least, 1) = -law%tangential_stiffness*motion(:least, 1)
    forces%deviation(:least, 2) = -law%normal_stiffness*motion(:least, 2)
    if (allocated(forces%jacobian)) deallocate (forces%jacobian)
    if (forces%without_jacobian) return
    allocate (forces%jacobian(2*k, 2*k), source=0.0_wp)
    do i = 1, k
      forces%jacobian(i, i) = -law%tangential_stiffness
      forces%jacobian(k + i, k + i) = -law%normal_stiffness
    end do
  end subroutine let_go

  !> What sliders at rest add: a constant, which follows the motion at the instant that put it there.
  subroutine integrate_rest(law, intervals, ends, k, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: intervals(:)
    !> Antiderivatives at the ends of intervals
    type(ends_type), intent(in) :: ends
    !> Coefficients a row
    integer, intent(in) :: k
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    type(moments_type) :: resting
    real(wp) :: force(size(forces%deviation, 1)), basis(k)
    integer :: i, n

    resting = new_moments(size(ends%c, 1) - 1)
    do i = 1, size(intervals)
      if (intervals(i)%regime /= regime_stick) cycle
      call resting%add(ends, i, 1.0_wp)
      if (goes_on(i)) cycle
      force = 0.0_wp
      call resting%add_column(-law%tangential_stiffness, force)
      resting%c = 0.0_wp
      resting%s = 0.0_wp
      forces%deviation(:, 1) = forces%deviation(:, 1) + intervals(i)%slider*force
      if (forces%without_jacobian .or. .not. intervals(i)%has_origin) cycle
      basis = basis_at(intervals(i)%origin, (k - 1)/2)
      do n = 1, k
        forces%jacobian(:k, n) = forces%jacobian(:k, n) + basis(n)*force(:k)
        forces%jacobian(:k, k + n) = forces%jacobian(:k, k + n) + (intervals(i)%by_normal*basis(n))*force(:k)
      end do
    end do

  contains

    !> Does the same rest go on in the next interval?
    pure logical function goes_on(i)
      !> Number of the interval
      integer, intent(in) :: i

      goes_on = .false.
      if (i == size(intervals)) return
      associate (here => intervals(i), next => intervals(i + 1))
        goes_on = next%regime == regime_stick .and. (next%has_origin .eqv. here%has_origin) &
                  .and. abs(next%origin - here%origin) <= 0.0_wp
      end associate
    end function goes_on
  end subroutine integrate_rest

  !> State and fractions.
  pure subroutine classify(events, intervals, moved, forces)
    !> Intervals and events of the contact's motion
    type(event_motion_type), intent(in) :: events
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: intervals(:)
    !> Did the first march move the slider?
    logical, intent(in) :: moved
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    real(wp) :: length(regime_stick:regime_open)
    integer :: i

    length = 0.0_wp
    do i = 1, size(intervals)
      associate (interval => intervals(i))
        length(interval%regime) = length(interval%regime) + (interval%to - interval%from)
      end associate
    end do
    forces%stick = length(regime_stick)/two_pi
    forces%slip = length(regime_slip)/two_pi
    forces%open = length(regime_open)/two_pi
    if (forces%lists_slip) then
      associate (slips => intervals%regime == regime_slip)
        forces%slips = transpose(reshape([pack(intervals%from, slips), pack(intervals%to, slips)], [count(slips), 2]))
      end associate
    end if
    if (all(.not. events%closed)) then
      forces%state = state_open
    else if (length(regime_slip) + length(regime_open) > 0.0_wp) then
      forces%state = state_slipping
    else
      forces%state = merge(state_shaken_down, state_stuck, moved)
    end if
  end subroutine classify

  !> Keep of the Jacobian what the state leaves: nothing when stuck, the mean's row of T when shaken down, no row of N while closed.
  pure subroutine differentiate(forces, k)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    !> Coefficients a row
    integer, intent(in) :: k
    integer :: row

    select case (forces%state)
     case (state_stuck)
      forces%active = spread(.false., 1, 2*k)
      deallocate (forces%jacobian)
      return
     case (state_shaken_down)
      forces%active = [(row == 1, row=1, 2*k)]
     case default
      forces%active = [(row <= k .or. forces%open > 0.0_wp, row=1, 2*k)]
    end select
    do row = 1, 2*k
      if (.not. forces%active(row)) forces%jacobian(row, :) = 0.0_wp
    end do
  end subroutine differentiate
end module attrito_contact_quadrature_event
