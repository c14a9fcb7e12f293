!> When a contact stops doing what it does, and what it does next.
!>
!> Each contact has up to two guards, polynomials on a segment that stay positive while it goes on:
!>   one tangent   stick: mu N - T and mu N + T;    slip: side u' - r' and N;   open: -(N_p + k_n (v - gap));
!>   two tangents  stick: r^2 - |u - w|^2 and N;    slip: u'.e - r' and N;      open: the same,
!> with r = mu N/k_t. The first guard to become negative ends the segment. A double root (a graze) is no event. Then
!>   stick -> slip along u - w, or open if N vanishes as well; slip -> stick when w' changes sign; slip -> open when N does;
!>   open -> with w = u, slip along u' if |u'| > r', else stick.
!> Forces are continuous through every one of these, so contacts that change at the same instant do not disturb each other and are
!> taken together or one after the other at no distance, in any order.
module attrito_integrate_events
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_polynomial, only: first_negative, value, slope, derivative, product_of, square
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_state, only: state_type, normal_force, guard_of_limit, unit
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: find_first_event, change_regime

contains

  !> Shorten the segment to its first event; `contact` is 0 if there is none.
  pure subroutine find_first_event(system, state, segment, contact, guard)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment
    !> Which contact, and which of its guards
    integer, intent(out) :: contact, guard
    real(wp) :: powers(0:ubound(segment%motion, 2)), polynomial(0:ubound(segment%motion, 2)), s, first
    integer :: i, j, k

    contact = 0
    guard = 0
    first = 1.0_wp
    powers(0) = 1.0_wp
    do k = 1, ubound(powers, 1)
      powers(k) = powers(k - 1)*segment%length
    end do
    do i = 1, size(system%law)
      do j = 1, merge(1, 2, state%regime(i) == regime_open)
        if (state%regime(i) == regime_slip .and. j == 1 .and. system%law(i)%friction_coefficient <= 0.0_wp) cycle
        call find_guard(system, state, segment, i, j, polynomial)
        polynomial = polynomial*powers
        call leave_zeros_out(polynomial, state%zeros(j, i))
        call first_negative(polynomial, segment%bernstein, s)
        if (s >= first) cycle
        first = s
        contact = i
        guard = j
      end do
    end do
    if (contact > 0) then
      if (system%law(contact)%tangents > 1 .and. guard == 1) call sharpen(system, state, segment, contact, first)
    end if
    segment%length = first*segment%length
  end subroutine find_first_event

  !> Products of series are cut off before they are known to rounding: two steps of Newton's method with the factors themselves.
  pure subroutine sharpen(system, state, segment, contact, place)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    !> Number of the contact, which sticks or slips
    integer, intent(in) :: contact
    !> Part of the segment
    real(wp), intent(inout) :: place
    !> Part of the segment that a step may be: a graze has no root to speak of
    real(wp), parameter :: longest = 1.0e-3_wp ! derived
    real(wp) :: t, z(2), du(2), e(2), radius, dr, f, df, step
    integer :: a, iteration

    if (state%regime(contact) == regime_open .or. state%zeros(1, contact) > 0) return
    associate (law => system%law(contact), first => system%law(contact)%first_row)
      do iteration = 1, 2
        t = place*segment%length
        radius = law%friction_coefficient/law%tangential_stiffness*value(segment%force(:, first + 2), t)
        dr = law%friction_coefficient/law%tangential_stiffness*slope(segment%force(:, first + 2), t)
        z = [(value(segment%displacement(:, first + a), t) - state%slider(a + 1, contact), a=0, 1)]
        du = [(slope(segment%displacement(:, first + a), t), a=0, 1)]
        if (state%regime(contact) == regime_stick) then
          e = unit(z, du)
          f = radius - dot_product(e, z)
          df = dr - dot_product(e, du)
        else
          e = [cos(value(segment%angle(:, contact), t)), sin(value(segment%angle(:, contact), t))]
          f = dot_product(e, du) - dr
          df = rate_of_slip_rate(t)
        end if
        step = -f/(df*segment%length + sign(tiny(1.0_wp), df))
        if (.not. abs(step) <= longest) return
        place = min(max(place + step, 0.0_wp), 1.0_wp)
      end do
    end associate

  contains

    pure real(wp) function rate_of_slip_rate(t)
      !> Time since the segment began
      real(wp), intent(in) :: t
      real(wp) :: polynomial(0:ubound(segment%motion, 2))

      call find_guard(system, state, segment, contact, 1, polynomial)
      rate_of_slip_rate = slope(polynomial, t)
    end function rate_of_slip_rate
  end subroutine sharpen

  !> Coefficients of one guard by powers of time.
  pure subroutine find_guard(system, state, segment, contact, guard, polynomial)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    !> Number of the contact; number of the guard
    integer, intent(in) :: contact, guard
    !> Polynomial, coefficients from degree 0
    real(wp), intent(out) :: polynomial(0:)
    integer :: normal, tangents

    tangents = system%law(contact)%tangents
    normal = system%law(contact)%first_row + tangents
    associate (law => system%law(contact), side => state%side(contact))
      select case (state%regime(contact))
       case (regime_stick)
        if (tangents == 1) then
          polynomial = law%friction_coefficient*segment%force(:, normal) + merge(-1, 1, guard == 1)*segment%force(:, normal - 1)
        else if (guard == 1) then
          polynomial = (law%friction_coefficient/law%tangential_stiffness)**2*square(segment%force(:, normal)) &
                       - (square(segment%force(:, normal - 2)) + square(segment%force(:, normal - 1)))/law%tangential_stiffness**2
        else
          polynomial = segment%force(:, normal)
        end if
       case (regime_slip)
        polynomial = segment%force(:, normal)
        if (guard == 2) return
        polynomial = -law%friction_coefficient/law%tangential_stiffness*derivative(segment%force(:, normal))
        if (tangents == 1) then
          polynomial = polynomial + side*derivative(segment%displacement(:, normal - 1))
        else
          polynomial = polynomial + product_of(derivative(segment%displacement(:, normal - 2)), segment%direction(:, 1, contact)) &
                       + product_of(derivative(segment%displacement(:, normal - 1)), segment%direction(:, 2, contact))
          ! The last coefficient of the derivatives is not known.
          polynomial(ubound(polynomial, 1)) = 0.0_wp
        end if
       case default
        polynomial = -law%normal_stiffness*segment%displacement(:, normal)
        polynomial(0) = polynomial(0) - law%normal_force(0.0_wp)
      end select
    end associate
  end subroutine find_guard

  !> Divide by the power of time that is known to be a factor.
  pure subroutine leave_zeros_out(polynomial, zeros)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(inout) :: polynomial(0:)
    !> Power of time that is a factor
    integer, intent(in) :: zeros
    integer :: n

    if (zeros == 0) return
    n = ubound(polynomial, 1)
    polynomial(:n - zeros) = polynomial(zeros:)
    polynomial(n - zeros + 1:) = 0.0_wp
  end subroutine leave_zeros_out

  !> What a contact does after its guard has become negative; the state stands at that instant.
  pure subroutine change_regime(system, state, contact, guard)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Number of the contact; number of the guard
    integer, intent(in) :: contact, guard

    associate (regime => state%regime(contact), side => state%side(contact), zeros => state%zeros(:, contact), &
               two => system%law(contact)%tangents > 1)
      select case (regime)
       case (regime_stick)
        if ((two .and. guard == 2) .or. (.not. two .and. is_leaving(system, state, contact))) then
          regime = regime_open
          zeros = [1, 0]
          return
        end if
        regime = regime_slip
        side = merge(1, -1, guard == 1)
        if (two) state%angle(contact) = angle_of_reach(system, state, contact)
        ! Was it at the rim already, only just sticking? Then w' starts from zero. And N does if it has just landed.
        zeros = [max(zeros(guard) - 1, 0), merge(zeros(2), 0, two)]
       case (regime_slip)
        if (guard == 1) then
          regime = regime_stick
          zeros = 0
          zeros(guard_of_limit(system%law(contact)%tangents, side)) = 2
        else
          regime = regime_open
          zeros = [1, 0]
        end if
       case default
        call land(system, state, contact)
      end select
    end associate
  end subroutine change_regime

  !> Along u - w, or along u' if the slider is where the contact is.
  pure real(wp) function angle_of_reach(system, state, contact) result(angle)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Number of the contact
    integer, intent(in) :: contact
    real(wp) :: e(2)

    associate (rows => system%rows(:, system%law(contact)%first_row:system%law(contact)%first_row + 1))
      e = unit(matmul(state%motion, rows) - state%slider(:, contact), matmul(state%rate, rows))
    end associate
    angle = atan2(e(2), e(1))
  end function angle_of_reach

  !> Does a contact open at this very instant? So it is where nothing moves along the tangent: stick ends at N = 0, without slip.
  pure logical function is_leaving(system, state, contact)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Number of the contact
    integer, intent(in) :: contact
    !> Time until a falling force is at zero that is rounding, in units of the clock
    real(wp), parameter :: at_once = 1.0e-12_wp ! derived
    real(wp) :: dn

    associate (law => system%law(contact))
      dn = law%normal_stiffness*dot_product(system%rows(:, law%first_row + 1), state%rate)
      is_leaving = dn < 0.0_wp .and. normal_force(system, state, contact) <= -at_once*dn
    end associate
  end function is_leaving

  !> From open to stick or slip, by the rates at the instant of contact.
  pure subroutine land(system, state, contact)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Number of the contact
    integer, intent(in) :: contact
    real(wp) :: du(2), dn
    integer :: n

    n = system%law(contact)%tangents
    du = 0.0_wp
    associate (law => system%law(contact), first => system%law(contact)%first_row)
      du(:n) = matmul(state%rate, system%rows(:, first:first + n - 1))
      dn = law%normal_stiffness*dot_product(system%rows(:, first + n), state%rate)
      state%side(contact) = merge(1, -1, n > 1 .or. du(1) >= 0.0_wp)
      if (law%tangential_stiffness*norm2(du) > law%friction_coefficient*dn .or. law%friction_coefficient <= 0.0_wp) then
        state%regime(contact) = regime_slip
        state%zeros(:, contact) = [0, 1]
        state%angle(contact) = atan2(du(2), du(1))
      else
        state%regime(contact) = regime_stick
        ! Both guards are linear at first; of two tangents the first is a difference of squares.
        state%zeros(:, contact) = [n, 1]
      end if
    end associate
  end subroutine land
end module attrito_integrate_events
