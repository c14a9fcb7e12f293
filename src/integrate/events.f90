!> When a contact stops doing what it does, and what it does next (one tangent).
!>
!> Each contact has up to two guards, polynomials on a segment that stay positive while it goes on:
!>   stick: mu N - T and mu N + T;   slip: side w' = side u' - mu N'/k_t and N;   open: -(N_p + k_n (v - gap)).
!> The first guard to become negative ends the segment. A double root (a graze) is no event. Then
!>   stick -> slip to that side, or open if N vanishes as well; slip -> stick when w' changes sign; slip -> open when N does;
!>   open -> with w = u, slip to the side of u' if k_t |u'| > mu N', else stick.
!> Forces are continuous through every one of these, so contacts that change at the same instant do not disturb each other and are
!> taken together or one after the other at no distance, in any order.
module attrito_integrate_events
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_polynomial, only: first_negative
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_state, only: state_type, normal_force
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
    segment%length = first*segment%length
  end subroutine find_first_event

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
    integer :: k, n

    n = ubound(polynomial, 1)
    associate (law => system%law(contact), side => state%side(contact), t => segment%force(:, system%law(contact)%first_row), &
               normal => segment%force(:, system%law(contact)%first_row + 1), &
               u => segment%displacement(:, system%law(contact)%first_row), &
               v => segment%displacement(:, system%law(contact)%first_row + 1))
      select case (state%regime(contact))
       case (regime_stick)
        polynomial = law%friction_coefficient*normal + merge(-1, 1, guard == 1)*t
       case (regime_slip)
        polynomial = normal
        if (guard == 2) return
        do k = 0, n - 1
          polynomial(k) = (k + 1)*(side*u(k + 2) - law%friction_coefficient*normal(k + 2)/law%tangential_stiffness)
        end do
        polynomial(n) = 0.0_wp
       case default
        polynomial = -law%normal_stiffness*v
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

    associate (regime => state%regime(contact), side => state%side(contact), zeros => state%zeros(:, contact))
      select case (regime)
       case (regime_stick)
        if (is_leaving(system, state, contact)) then
          regime = regime_open
          zeros = [1, 0]
          return
        end if
        regime = regime_slip
        side = merge(1, -1, guard == 1)
        ! Was it at the rim already, only just sticking? Then w' starts from zero.
        zeros = [max(zeros(guard) - 1, 0), 0]
       case (regime_slip)
        if (guard == 1) then
          regime = regime_stick
          zeros = 0
          zeros(merge(1, 2, side > 0)) = 2
        else
          regime = regime_open
          zeros = [1, 0]
        end if
       case default
        call land(system, state, contact)
      end select
    end associate
  end subroutine change_regime

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
    real(wp) :: du, dn

    associate (law => system%law(contact))
      du = dot_product(system%rows(:, law%first_row), state%rate)
      dn = law%normal_stiffness*dot_product(system%rows(:, law%first_row + 1), state%rate)
      state%side(contact) = merge(1, -1, du >= 0.0_wp)
      if (law%tangential_stiffness*abs(du) > law%friction_coefficient*dn .or. law%friction_coefficient <= 0.0_wp) then
        state%regime(contact) = regime_slip
        state%zeros(:, contact) = [0, 1]
      else
        state%regime(contact) = regime_stick
        state%zeros(:, contact) = 1
      end if
    end associate
  end subroutine land
end module attrito_integrate_events
