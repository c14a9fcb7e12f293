!> Contact forces of a trigonometric motion with one tangent, exact: the deviation g = lambda - K_c d is trigonometric or constant
!> between events, so its Fourier coefficients are closed form,
!>
!> $$ \hat g_m = \frac{1}{\pi} \sum_\text{intervals} \int e_m(\theta) \, g(\theta) \, d\theta, \qquad
!>    \int e_m e_n \, d\theta \text{ from } \int \cos p\theta \, d\theta, \; \int \sin p\theta \, d\theta $$
!>
!> and so is the Jacobian: g is continuous across events, so their motion leaves no term but that of landing.
module attrito_contact_quadrature_event
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_event_march, only: event_motion_type, interval_type, new_event_motion, march_events
  use attrito_contact_quadrature_sampled, only: contact_forces_type, stay_stuck
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open, state_stuck, state_shaken_down, state_slipping, &
                                   state_open
  use attrito_contact_stuck, only: surely_stuck
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, basis_at
  implicit none
  private
  public :: evaluate_contact_by_events

contains

  !> Forces and Jacobian of one contact with one tangent.
  subroutine evaluate_contact_by_events(law, grid, motion, slider, forces)
    type(contact_type), intent(in) :: law
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

    if (surely_stuck(law, motion, [slider])) then
      call stay_stuck(law, [slider, 0.0_wp], size(motion, 1), forces)
      return
    end if
    events = new_event_motion(law, grid, motion)
    allocate (intervals(2*size(events%closed)))
    state = interval_type(slider=slider)
    call march_events(events, state, intervals, count)
    forces%slider = [state%slider, 0.0_wp]
    call march_events(events, state, intervals, count)
    lowest = interval_type(slider=-huge(1.0_wp))
    highest = interval_type(slider=huge(1.0_wp))
    call integrate(law, events, intervals(:count), motion, forces)
    call classify(events, intervals(:count), abs(forces%slider(1) - slider) > 0.0_wp, forces)
    call march_events(events, lowest, intervals, count)
    call march_events(events, highest, intervals, count)
    forces%unique = lowest%slider >= highest%slider - 1.0e-13_wp*(abs(lowest%slider) + abs(highest%slider))
    call differentiate(forces, size(motion, 1))
  end subroutine evaluate_contact_by_events

  !> Coefficients of the deviation and its Jacobian, interval by interval.
  subroutine integrate(law, events, intervals, motion, forces)
    type(contact_type), intent(in) :: law
    type(event_motion_type), intent(in) :: events
    type(interval_type), intent(in) :: intervals(:)
    real(wp), intent(in) :: motion(:, :)
    type(contact_forces_type), intent(inout) :: forces
    real(wp), allocatable :: products(:, :), moved(:, :)
    real(wp) :: closed_normal
    integer :: i, k

    k = size(motion, 1)
    closed_normal = law%preload - law%normal_stiffness*law%gap
    if (allocated(forces%jacobian)) deallocate (forces%jacobian)
    allocate (forces%jacobian(2*k, 2*k), source=0.0_wp)
    forces%deviation = 0.0_wp
    associate (g_t => forces%deviation(:, 1), g_n => forces%deviation(:, 2), kt => law%tangential_stiffness, &
               tt => forces%jacobian(:k, :k), tn => forces%jacobian(:k, k + 1:), nn => forces%jacobian(k + 1:, k + 1:))
      do i = 1, size(intervals)
        associate (interval => intervals(i))
          products = basis_products(interval%from, interval%to, size(forces%deviation, 1), k)
          select case (interval%regime)
           case (regime_open)
            g_t = g_t - kt*matmul(products, motion(:, 1))
            g_n = g_n - law%normal_stiffness*matmul(products, motion(:, 2))
            tt = tt - kt*products(:k, :)
            nn = nn - law%normal_stiffness*products(:k, :)
            cycle
           case (regime_slip)
            g_t = g_t - kt*matmul(products, merge(events%lower, events%upper, interval%side > 0))
            tt = tt - kt*products(:k, :)
            tn = tn + interval%side*kt*events%slope*products(:k, :)
           case default
            g_t = g_t - kt*interval%slider*products(:, 1)
            if (interval%has_origin) then
              moved = kt*outer(products(:k, 1), basis_at(interval%origin, (k - 1)/2))
              tt = tt - moved
              tn = tn - interval%by_normal*moved
            end if
          end select
          g_n = g_n + closed_normal*products(:, 1)
        end associate
      end do
    end associate
  end subroutine integrate

  !> Integrals of e_m e_n over an interval, scaled so that they turn a series into its coefficients [e, k].
  pure function basis_products(from, to, rows, columns) result(products)
    real(wp), intent(in) :: from, to
    integer, intent(in) :: rows, columns
    real(wp) :: products(rows, columns)
    real(wp) :: c(-(columns/2):(rows + columns)/2), s(-(columns/2):(rows + columns)/2)
    integer :: p, m, n

    c(0) = to - from
    s(0) = 0.0_wp
    do p = 1, ubound(c, 1)
      c(p) = (sin(p*to) - sin(p*from))/p
      s(p) = (cos(p*from) - cos(p*to))/p
    end do
    do p = 1, -lbound(c, 1)
      c(-p) = c(p)
      s(-p) = -s(p)
    end do
    products(1, 1) = c(0)
    do n = 1, (columns - 1)/2
      products(1, 2*n:2*n + 1) = [c(n), s(n)]
    end do
    do m = 1, (rows - 1)/2
      products(2*m:2*m + 1, 1) = [c(m), s(m)]
      do n = 1, (columns - 1)/2
        products(2*m, 2*n) = 0.5_wp*(c(m - n) + c(m + n))
        products(2*m + 1, 2*n + 1) = 0.5_wp*(c(m - n) - c(m + n))
        products(2*m, 2*n + 1) = 0.5_wp*(s(m + n) - s(m - n))
        products(2*m + 1, 2*n) = 0.5_wp*(s(m + n) + s(m - n))
      end do
    end do
    products(1, :) = products(1, :)/two_pi
    products(2:, :) = products(2:, :)/pi
  end function basis_products

  pure function outer(a, b)
    real(wp), intent(in) :: a(:), b(:)
    real(wp) :: outer(size(a), size(b))

    outer = spread(a, 2, size(b))*spread(b, 1, size(a))
  end function outer

  !> State and fractions.
  pure subroutine classify(events, intervals, moved, forces)
    type(event_motion_type), intent(in) :: events
    type(interval_type), intent(in) :: intervals(:)
    !> Did the first march move the slider?
    logical, intent(in) :: moved
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
