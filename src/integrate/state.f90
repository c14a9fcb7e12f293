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
  public :: state_type, new_state, settle, normal_force

  type :: state_type
    !> Whole periods since the start, and units of the clock since
    integer :: cycle = 0
    real(wp) :: theta = 0.0_wp
    !> Modal displacement and its rate by the clock [m]
    real(wp), allocatable :: motion(:), rate(:)
    !> Sliders [2, contacts]
    real(wp), allocatable :: slider(:, :)
    !> One of `regime_...`, and the direction of slip, +1 or -1 [contacts]
    integer, allocatable :: regime(:), side(:)
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
    call settle(system, self)
  end function new_state

  !> Bring each contact onto its law: clamp the slider, and say what it does (one tangent; with two only the regime).
  pure subroutine settle(system, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    type(state_type), intent(inout) :: self
    integer :: i

    self%zeros = 0
    do i = 1, size(system%law)
      if (system%law(i)%tangents == 1) call settle_one(system, self, i)
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
    real(wp) :: u, v, du, dv, n, r, slip_rate, scale, force(1), slope(1)

    associate (law => system%law(i), rows => system%rows, w => self%slider(1, i))
      u = dot_product(rows(:, law%first_row), self%motion)
      v = dot_product(rows(:, law%first_row + 1), self%motion)
      du = dot_product(rows(:, law%first_row), self%rate)
      dv = dot_product(rows(:, law%first_row + 1), self%rate)
      n = law%normal_force(v)
      ! In time one that just touches begins open: if it closes the guard of open contacts ends that at once.
      if (n <= 0.0_wp) then
        self%regime(i) = regime_open
        w = u
        return
      end if
      call law%slip_force([n], force, slope)
      r = force(1)/law%tangential_stiffness
      self%side(i) = merge(1, -1, u >= w)
      self%regime(i) = regime_stick
      scale = rounding*(r + abs(u) + abs(w))
      if (abs(u - w) < r - scale .and. r > 0.0_wp) return
      ! On the rim, or outside: the slider goes onto it, and slips unless it is moving back.
      w = u - self%side(i)*r
      slip_rate = self%side(i)*du - slope(1)*law%normal_stiffness*dv/law%tangential_stiffness
      if (slip_rate > rounding*(abs(du) + abs(dv)) .or. r <= 0.0_wp) then
        self%regime(i) = regime_slip
      else
        self%zeros(merge(1, 2, self%side(i) > 0), i) = merge(1, 2, slip_rate < -rounding*(abs(du) + abs(dv)))
      end if
    end associate
  end subroutine settle_one

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
