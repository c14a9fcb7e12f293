!> One tangent along a trigonometric motion, from event to event.
!>
!> The clamp of the slider is [L, U], L = u - r and U = u + r, with r = mu N / k_t a trigonometric polynomial while the contact is
!> closed. Cut the period at the roots of N, L' and U': on each segment L and U are monotone, so the slider sticks, or sticks until
!> L rises to it, or until U falls to it, and then follows: one event a segment at most, bracketed. Slip ends where L' or U'
!> vanishes.
!>
!> An event time moves with the motion, but forces are continuous across it and L' = 0 where slip ends, so only landing leaves a
!> term: w = u at the root of N, dw = du - (u'/v') dv.
module attrito_contact_event_march
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, roots_of, basis_at, slope_at, root_between, &
                                                 differentiated
  implicit none
  private
  public :: event_motion_type, interval_type, new_event_motion, march_events

  !> A stretch of the period with one regime
  type :: interval_type
    real(wp) :: from = 0.0_wp, to = 0.0_wp
    integer :: regime = regime_stick
    !> Slip: +1 along, -1 against the tangent
    integer :: side = 0
    !> Stick: the slider, and whether an event put it there: it moves with the motion at `origin`, dw = du + by_normal dv
    real(wp) :: slider = 0.0_wp
    logical :: has_origin = .false.
    real(wp) :: origin = 0.0_wp, by_normal = 0.0_wp
  end type interval_type

  type :: event_motion_type
    !> Coefficients [k]: u, N where closed, L, U
    real(wp), allocatable :: u(:), normal(:), lower(:), upper(:)
    !> dr/dv = mu k_n / k_t, and k_n
    real(wp) :: slope = 0.0_wp, normal_stiffness = 0.0_wp
    !> Ends of the segments, ascending, 0 and 2 pi included
    real(wp), allocatable :: cuts(:)
    !> By segment: does it touch; do L rise and U fall there?
    logical, allocatable :: closed(:), lower_rises(:), upper_falls(:)
  end type event_motion_type

contains

  !> Cut the period of a motion [k, 2] (u, v) into segments.
  function new_event_motion(law, grid, motion) result(self)
    type(contact_type), intent(in) :: law
    type(trigonometric_grid_type), intent(in) :: grid
    real(wp), intent(in) :: motion(:, :)
    type(event_motion_type) :: self
    real(wp) :: middle, slope(size(motion, 1)), least
    integer :: i, harmonics

    harmonics = (size(motion, 1) - 1)/2
    self%u = motion(:, 1)
    self%normal_stiffness = law%normal_stiffness
    self%normal = law%normal_stiffness*motion(:, 2)
    self%normal(1) = self%normal(1) + law%preload - law%normal_stiffness*law%gap
    self%slope = law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness
    self%lower = self%u - law%friction_coefficient/law%tangential_stiffness*self%normal
    self%upper = self%u + law%friction_coefficient/law%tangential_stiffness*self%normal
    self%cuts = sorted([0.0_wp, two_pi, roots_of(self%normal, grid), roots_of(differentiated(self%lower), grid), &
                        roots_of(differentiated(self%upper), grid)])
    allocate (self%closed(size(self%cuts) - 1), self%lower_rises(size(self%cuts) - 1), self%upper_falls(size(self%cuts) - 1))
    ! A contact that just touches counts as closed, as with samples.
    least = -1.0e-14_wp*sum(abs(self%normal))
    do i = 1, size(self%closed)
      middle = 0.5_wp*(self%cuts(i) + self%cuts(i + 1))
      slope = slope_at(middle, harmonics)
      self%closed(i) = dot_product(self%normal, basis_at(middle, harmonics)) >= least
      self%lower_rises(i) = dot_product(self%lower, slope) > 0.0_wp
      self%upper_falls(i) = dot_product(self%upper, slope) < 0.0_wp
    end do
  end function new_event_motion

  !> March one period; `state` is the slider at the start, then at the end, with its origin.
  subroutine march_events(self, state, intervals, count)
    type(event_motion_type), intent(in) :: self
    type(interval_type), intent(inout) :: state
    !> What happens, in order; at most two a segment [>= 2 segments]
    type(interval_type), intent(inout) :: intervals(:)
    integer, intent(out) :: count
    real(wp) :: lower, upper, hit
    integer :: i

    count = 0
    do i = 1, size(self%closed)
      associate (from => self%cuts(i), to => self%cuts(i + 1))
        if (.not. self%closed(i)) then
          call add(from, to, regime_open, 0)
          call land(self, to, state)
          cycle
        end if
        if (i == 1) call clamp_at_start()
        lower = value_of(self%lower, to)
        upper = value_of(self%upper, to)
        if (self%lower_rises(i) .and. lower > state%slider) then
          hit = from
          if (value_of(self%lower, from) < state%slider) hit = root_between(self%lower, state%slider, from, to)
          call add(from, hit, regime_stick, 0)
          call add(hit, to, regime_slip, 1)
          call follow(self, to, 1, lower, state)
        else if (self%upper_falls(i) .and. upper < state%slider) then
          hit = from
          if (value_of(self%upper, from) > state%slider) hit = root_between(self%upper, state%slider, from, to)
          call add(from, hit, regime_stick, 0)
          call add(hit, to, regime_slip, -1)
          call follow(self, to, -1, upper, state)
        else
          call add(from, to, regime_stick, 0)
        end if
      end associate
    end do

  contains

    subroutine add(from, to, regime, side)
      real(wp), intent(in) :: from, to
      integer, intent(in) :: regime, side

      if (to <= from) return
      count = count + 1
      intervals(count) = state
      intervals(count)%from = from
      intervals(count)%to = to
      intervals(count)%regime = regime
      intervals(count)%side = side
    end subroutine add

    !> A start slider outside [L, U] at 0 is taken to the nearer end.
    subroutine clamp_at_start()
      if (state%slider < value_of(self%lower, 0.0_wp)) call follow(self, 0.0_wp, 1, value_of(self%lower, 0.0_wp), state)
      if (state%slider > value_of(self%upper, 0.0_wp)) call follow(self, 0.0_wp, -1, value_of(self%upper, 0.0_wp), state)
    end subroutine clamp_at_start
  end subroutine march_events

  !> The slider stands on an end of the clamp.
  subroutine follow(self, theta, side, slider, state)
    type(event_motion_type), intent(in) :: self
    real(wp), intent(in) :: theta, slider
    integer, intent(in) :: side
    type(interval_type), intent(inout) :: state

    state%slider = slider
    state%has_origin = .true.
    state%origin = theta
    state%by_normal = -side*self%slope
  end subroutine follow

  !> The slider stands where the contact lands.
  subroutine land(self, theta, state)
    type(event_motion_type), intent(in) :: self
    real(wp), intent(in) :: theta
    type(interval_type), intent(inout) :: state
    real(wp) :: slope(size(self%u)), normal_slope
    integer :: harmonics

    harmonics = (size(self%u) - 1)/2
    slope = slope_at(theta, harmonics)
    state%slider = value_of(self%u, theta)
    state%has_origin = .true.
    state%origin = theta
    state%by_normal = 0.0_wp
    normal_slope = dot_product(self%normal, slope)
    if (abs(normal_slope) > 0.0_wp) state%by_normal = -self%normal_stiffness*dot_product(self%u, slope)/normal_slope
  end subroutine land

  !> Value of a polynomial.
  pure real(wp) function value_of(coefficients, theta)
    real(wp), intent(in) :: coefficients(:), theta

    value_of = dot_product(coefficients, basis_at(theta, (size(coefficients) - 1)/2))
  end function value_of

  !> Ascending order, by insertion: a handful of numbers.
  pure function sorted(values)
    real(wp), intent(in) :: values(:)
    real(wp) :: sorted(size(values))
    integer :: i, j

    do i = 1, size(values)
      j = i
      do while (j > 1)
        if (sorted(max(j - 1, 1)) <= values(i)) exit
        sorted(j) = sorted(j - 1)
        j = j - 1
      end do
      sorted(j) = values(i)
    end do
  end function sorted
end module attrito_contact_event_march
