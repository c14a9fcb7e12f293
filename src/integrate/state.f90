!> The state of an integration: motion, sliders, and what each contact is doing.
!>
!> Where a contact stands exactly at the edge of what it does (it has just begun to stick, slip, open or touch), the guard of that
!> edge vanishes with some of its derivatives: `zeros` counts how many of its Taylor coefficients are exactly zero, so that rounding
!> does not decide.
module attrito_integrate_state
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: state_type, new_state, settle, normal_force, guard_of_limit, unit

  type :: state_type
    !> Whole periods since the start, and units of the clock since
    integer :: cycle = 0
    real(wp) :: theta = 0.0_wp
    !> Modal displacement and its rate by the clock [m]
    real(wp), allocatable :: motion(:), rate(:)
    !> Sliders [2, contacts]
    real(wp), allocatable :: slider(:, :)
    !> One of `regime_...`, and the direction of slip: +1 or -1, or along two tangents its angle [contacts]
    integer, allocatable :: regime(:), side(:)
    real(wp), allocatable :: angle(:)
    !> Leading coefficients of both guards that are exactly zero [2, contacts]
    integer, allocatable :: zeros(:, :)
    !> Events since the start, and instants at which they had to be cut short (see `attrito_integrate_flow`)
    integer :: events = 0, chatter = 0
  end type state_type

contains

  !> A state from motion and sliders; contacts outside the law are brought onto it.
  pure function new_state(system, motion, rate, slider) result(self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Modal displacement and rate by the clock [m]
    real(wp), intent(in) :: motion(:), rate(:)
    !> [2, contacts]
    real(wp), intent(in) :: slider(:, :)
    type(state_type) :: self
    integer :: contacts

    contacts = size(system%law)
    self%motion = motion
    self%rate = rate
    self%slider = slider
    allocate (self%regime(contacts), self%side(contacts), self%zeros(2, contacts), source=0)
    allocate (self%angle(contacts), source=0.0_wp)
    call settle(system, self)
  end function new_state

  !> Bring each contact onto its law: its slider to the nearest place in the friction disc, and say what it does.
  pure subroutine settle(system, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    type(state_type), intent(inout) :: self
    integer :: i

    self%zeros = 0
    do i = 1, size(system%law)
      call settle_one(system, self, i)
    end do
  end subroutine settle

  pure subroutine settle_one(system, self, i)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    type(state_type), intent(inout) :: self
    !> Number of the contact
    integer, intent(in) :: i
    !> Part of the terms of a displacement or velocity that is rounding
    real(wp), parameter :: rounding = 1.0e-13_wp ! derived
    real(wp) :: u(2), v, du(2), dv, n, r, z(2), e(2), slip_rate, force(1), slope(1)
    integer :: tangents

    tangents = system%law(i)%tangents
    u = 0.0_wp
    du = 0.0_wp
    associate (law => system%law(i), w => self%slider(:tangents, i), t => system%law(i)%first_row, &
               nu => system%law(i)%first_row + tangents)
      u(:tangents) = matmul(self%motion, system%rows(:, t:nu - 1))
      du(:tangents) = matmul(self%rate, system%rows(:, t:nu - 1))
      v = dot_product(system%rows(:, nu), self%motion)
      dv = dot_product(system%rows(:, nu), self%rate)
      n = law%normal_force(v)
      ! In time one that just touches begins open: if it closes the guard of open contacts ends that at once.
      if (n <= 0.0_wp) then
        self%regime(i) = regime_open
        w = u(:tangents)
        return
      end if
      call law%slip_force([n], force, slope)
      r = force(1)/law%tangential_stiffness
      z = 0.0_wp
      z(:tangents) = u(:tangents) - w
      self%side(i) = merge(1, -1, tangents > 1 .or. z(1) >= 0.0_wp)
      self%regime(i) = regime_stick
      if (norm2(z) < r - rounding*(r + norm2(u) + norm2(w)) .and. r > 0.0_wp) return
      ! On the rim, or outside: the slider goes onto it, and slips unless it is moving back.
      e = unit(z, du)
      if (tangents == 1) e = [real(self%side(i), wp), 0.0_wp]
      self%angle(i) = atan2(e(2), e(1))
      w = u(:tangents) - r*e(:tangents)
      slip_rate = dot_product(e, du) - slope(1)*law%normal_stiffness*dv/law%tangential_stiffness
      if (slip_rate > rounding*(norm2(du) + abs(dv)) .or. r <= 0.0_wp) then
        self%regime(i) = regime_slip
      else
        self%zeros(guard_of_limit(tangents, self%side(i)), i) = merge(1, 2, slip_rate < -rounding*(norm2(du) + abs(dv)))
      end if
    end associate
  end subroutine settle_one

  !> Which of a sticking contact's guards is that of the limit which it reaches on a side: of two tangents the first.
  elemental integer function guard_of_limit(tangents, side)
    !> One or two; +1 or -1
    integer, intent(in) :: tangents, side

    guard_of_limit = merge(1, 2, tangents > 1 .or. side > 0)
  end function guard_of_limit

  !> Unit vector along the first of some vectors that is not zero, or along the first axis.
  pure function unit(first, second) result(e)
    !> Vectors
    real(wp), intent(in) :: first(2), second(2)
    real(wp) :: e(2)

    e = [1.0_wp, 0.0_wp]
    if (norm2(second) > 0.0_wp) e = second/norm2(second)
    if (norm2(first) > 0.0_wp) e = first/norm2(first)
  end function unit

  !> Normal force of a contact as it stands.
  pure real(wp) function normal_force(system, self, contact)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    type(state_type), intent(in) :: self
    !> Number of the contact
    integer, intent(in) :: contact

    associate (law => system%law(contact))
      normal_force = max(0.0_wp, law%normal_force(dot_product(system%rows(:, law%first_row + law%tangents), self%motion)))
    end associate
  end function normal_force
end module attrito_integrate_state
