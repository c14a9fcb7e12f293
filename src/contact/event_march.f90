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
  use attrito_core_trigonometric, only: basis_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, roots_by_column, root_between, differentiate
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
    !> Coefficients [k]: L, U
    real(wp), allocatable :: lower(:), upper(:)
    !> dr/dv = mu k_n / k_t
    real(wp) :: slope = 0.0_wp
    !> Ends of the segments, ascending, 0 and 2 pi included; L and U there; u, and where N vanishes -u'/v'
    real(wp), allocatable :: cuts(:), lower_at(:), upper_at(:), u_at(:), landing_slope(:)
    !> By segment: does it touch; do L rise and U fall there?
    logical, allocatable :: closed(:), lower_rises(:), upper_falls(:)
  end type event_motion_type

contains

  !> Cut the period of a motion [k, 2] (u, v) into segments.
  function new_event_motion(law, grid, motion) result(self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grid on which roots are looked for
    type(trigonometric_grid_type), intent(in) :: grid
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)
    type(event_motion_type) :: self
    real(wp) :: radius(size(motion, 1)), normal(size(motion, 1)), slopes(size(motion, 1), 4), basis(size(motion, 1)), least
    integer :: i, harmonics, segments

    harmonics = (size(motion, 1) - 1)/2
    normal = law%normal_series(motion(:, 2))
    radius = law%friction_coefficient/law%tangential_stiffness*normal
    self%slope = law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness
    self%lower = motion(:, 1) - radius
    self%upper = motion(:, 1) + radius
    call differentiate(self%lower, slopes(:, 1))
    call differentiate(self%upper, slopes(:, 2))
    call differentiate(motion(:, 1), slopes(:, 3))
    call differentiate(motion(:, 2), slopes(:, 4))
    self%cuts = sorted([0.0_wp, two_pi, roots_by_column(reshape([normal, slopes(:, :2)], [size(normal), 3]), grid)])
    segments = size(self%cuts) - 1
    allocate (self%closed(segments), self%lower_rises(segments), self%upper_falls(segments))
    allocate (self%lower_at(segments + 1), self%upper_at(segments + 1), self%u_at(segments + 1))
    allocate (self%landing_slope(segments + 1), source=0.0_wp)
    least = law%touching_force(motion(:, 2))
    do i = 1, segments
      basis = basis_at(0.5_wp*(self%cuts(i) + self%cuts(i + 1)), harmonics)
      self%closed(i) = dot_product(normal, basis) >= least
      self%lower_rises(i) = dot_product(slopes(:, 1), basis) > 0.0_wp
      self%upper_falls(i) = dot_product(slopes(:, 2), basis) < 0.0_wp
    end do
    do i = 1, segments + 1
      basis = basis_at(self%cuts(i), harmonics)
      self%lower_at(i) = dot_product(self%lower, basis)
      self%upper_at(i) = dot_product(self%upper, basis)
      self%u_at(i) = dot_product(motion(:, 1), basis)
      if (self%closed(max(i - 1, 1))) cycle
      self%landing_slope(i) = dot_product(slopes(:, 4), basis)
      if (abs(self%landing_slope(i)) > 0.0_wp) self%landing_slope(i) = -dot_product(slopes(:, 3), basis)/self%landing_slope(i)
    end do
  end function new_event_motion

  !> March one period; `state` is the slider at the start, then at the end, with its origin.
  subroutine march_events(self, state, intervals, count)
    type(event_motion_type), intent(in) :: self
    !> Interval in which the contact is
    type(interval_type), intent(inout) :: state
    !> What happens, in order, if asked for; at most two a segment [>= 2 segments]
    type(interval_type), intent(inout), optional :: intervals(:)
    !> How many intervals there are
    integer, intent(out), optional :: count
    integer :: i

    if (present(count)) count = 0
    do i = 1, size(self%closed)
      if (.not. self%closed(i)) then
        call add(state, self%cuts(i), self%cuts(i + 1), regime_open, 0, intervals, count)
        call land(self, i + 1, state)
        cycle
      end if
      ! A start slider outside [L, U] at 0 is taken to the nearer end.
      if (i == 1 .and. state%slider < self%lower_at(1)) call follow(self, 1, 1, state)
      if (i == 1 .and. state%slider > self%upper_at(1)) call follow(self, 1, -1, state)
      if (self%lower_rises(i) .and. self%lower_at(i + 1) > state%slider) then
        call slip(self, i, 1, self%lower, self%lower_at(i) < state%slider, state, intervals, count)
      else if (self%upper_falls(i) .and. self%upper_at(i + 1) < state%slider) then
        call slip(self, i, -1, self%upper, self%upper_at(i) > state%slider, state, intervals, count)
      else
        call add(state, self%cuts(i), self%cuts(i + 1), regime_stick, 0, intervals, count)
      end if
    end do
  end subroutine march_events

  !> Stick until an end of the clamp meets the slider, and then slip with it.
  subroutine slip(self, segment, side, clamp_end, sticks_first, state, intervals, count)
    type(event_motion_type), intent(in) :: self
    !> Number of the segment between cuts; which end of the clamp: 1 or -1
    integer, intent(in) :: segment, side
    !> Coefficients of the clamp's end
    real(wp), intent(in) :: clamp_end(:)
    !> Does it stick before it slips?
    logical, intent(in) :: sticks_first
    !> Interval in which the contact is
    type(interval_type), intent(inout) :: state
    !> What happens, in order, and how many intervals there are, if asked for
    type(interval_type), intent(inout), optional :: intervals(:)
    integer, intent(inout), optional :: count
    real(wp) :: hit

    associate (from => self%cuts(segment), to => self%cuts(segment + 1))
      hit = from
      if (sticks_first .and. present(intervals)) hit = root_between(clamp_end, state%slider, from, to)
      call add(state, from, hit, regime_stick, 0, intervals, count)
      call add(state, hit, to, regime_slip, side, intervals, count)
    end associate
    call follow(self, segment + 1, side, state)
  end subroutine slip

  !> Put an interval behind the others, if they are asked for.
  pure subroutine add(state, from, to, regime, side, intervals, count)
    !> Interval in which the contact is
    type(interval_type), intent(in) :: state
    !> Angle at which the interval begins; angle at which the interval ends
    real(wp), intent(in) :: from, to
    !> Regime: stick, slip or open; which end of the clamp: 1 or -1
    integer, intent(in) :: regime, side
    !> What happens, in order, and how many intervals there are, if asked for
    type(interval_type), intent(inout), optional :: intervals(:)
    integer, intent(inout), optional :: count

    if (.not. present(intervals) .or. to <= from) return
    count = count + 1
    intervals(count) = state
    intervals(count)%from = from
    intervals(count)%to = to
    intervals(count)%regime = regime
    intervals(count)%side = side
  end subroutine add

  !> The slider stands on an end of the clamp, at a cut.
  pure subroutine follow(self, cut, side, state)
    type(event_motion_type), intent(in) :: self
    !> Number of the cut; which end of the clamp: 1 or -1
    integer, intent(in) :: cut, side
    !> Interval in which the contact is
    type(interval_type), intent(inout) :: state

    state%slider = merge(self%lower_at(cut), self%upper_at(cut), side > 0)
    state%has_origin = .true.
    state%origin = self%cuts(cut)
    state%by_normal = -side*self%slope
  end subroutine follow

  !> The slider stands where the contact lands, at a cut.
  pure subroutine land(self, cut, state)
    type(event_motion_type), intent(in) :: self
    !> Number of the cut
    integer, intent(in) :: cut
    !> Interval in which the contact is
    type(interval_type), intent(inout) :: state

    state%slider = self%u_at(cut)
    state%has_origin = .true.
    state%origin = self%cuts(cut)
    state%by_normal = self%landing_slope(cut)
  end subroutine land

  !> Ascending order, by insertion: a handful of numbers.
  pure function sorted(values)
    !> Numbers to sort
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
