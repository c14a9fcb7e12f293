!> One tangent along a trigonometric motion, from event to event.
!>
!> The clamp of the slider is [L, U], L = u - r and U = u + r, with r = F(N)/k_t a trigonometric polynomial while the contact is
!> closed and F keeps to one of its pieces, of order H where that is linear and 2 H where it is quadratic. Cut the period at the roots
!> of N, of N - N_i, where the next piece begins, of L' and of U': on each segment L and U are monotone, so the slider sticks, or
!> sticks until L rises to it, or until U falls to it, and then follows: one event a segment at most, bracketed. Slip ends where L'
!> or U' vanishes.
!>
!> An event time moves with the motion, but forces are continuous across it and L' = 0 where slip ends, so only landing and slip that
!> ends as the next piece begins leave a term: r stays what it is there, dw = du - (u'/v') dv.
module attrito_contact_event_march
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: basis_at, product_of
  use attrito_contact_law_contact_law, only: limit_type
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
    !> Slip: +1 along, -1 against the tangent; piece of the law
    integer :: side = 0, piece = 1
    !> Stick: the slider, and whether an event put it there: it moves with the motion at `origin`, dw = du + by_normal dv
    real(wp) :: slider = 0.0_wp
    logical :: has_origin = .false.
    real(wp) :: origin = 0.0_wp, by_normal = 0.0_wp
  end type interval_type

  type :: event_motion_type
    !> Coefficients by piece of the law: L, U, r and dr/dv = F' k_n/k_t [any odd number, pieces]
    real(wp), allocatable :: lower(:, :), upper(:, :), radius(:, :), slope(:, :)
    !> Ends of the segments, ascending, 0 and 2 pi included; L and U there; u, and where the contact lands or the piece changes -u'/v'
    real(wp), allocatable :: cuts(:), lower_at(:), upper_at(:), u_at(:), fixed_slope(:)
    !> By segment: does it touch; do L rise and U fall there? Piece of the law
    logical, allocatable :: closed(:), lower_rises(:), upper_falls(:)
    integer, allocatable :: piece(:)
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
    type(limit_type), allocatable :: limits(:)
    real(wp), allocatable :: roots(:)
    !> N less what begins a piece, L' and U' of each piece [any odd number, 3, pieces]
    real(wp), allocatable :: changing(:, :, :)
    real(wp) :: normal(size(motion, 1)), slopes(size(motion, 1), 2), least
    real(wp) :: basis(merge(size(motion, 1), 2*size(motion, 1) - 1, law%is_proportional()))
    integer :: i, k, p, segments

    limits = law%limits()
    k = size(motion, 1)
    normal = law%normal_series(motion(:, 2))
    call set_clamps(law, limits, normal, motion(:, 1), self)
    call differentiate(motion(:, 1), slopes(:, 1))
    call differentiate(motion(:, 2), slopes(:, 2))
    allocate (changing(size(basis), 3, size(limits)))
    do p = 1, size(limits)
      changing(:k, 1, p) = normal
      changing(k + 1:, 1, p) = 0.0_wp
      if (p > 1) changing(1, 1, p) = normal(1) - limits(p)%from
      call differentiate(self%lower(:, p), changing(:, 2, p))
      call differentiate(self%upper(:, p), changing(:, 3, p))
    end do
    if (size(limits) == 1) then
      roots = roots_by_column(changing(:, :, 1), grid)
    else
      allocate (roots(0))
      do p = 1, size(limits)
        roots = [roots, roots_by_column(changing(:, :1, p), grid), within(roots_by_column(changing(:, 2:, p), grid), p)]
      end do
    end if
    self%cuts = sorted([0.0_wp, two_pi, roots])
    segments = size(self%cuts) - 1
    allocate (self%closed(segments), self%lower_rises(segments), self%upper_falls(segments), self%piece(segments))
    allocate (self%lower_at(segments + 1), self%upper_at(segments + 1), self%u_at(segments + 1))
    allocate (self%fixed_slope(segments + 1), source=0.0_wp)
    least = law%touching_force(motion(:, 2))
    do i = 1, segments
      basis = basis_at(0.5_wp*(self%cuts(i) + self%cuts(i + 1)), size(basis)/2)
      associate (force => dot_product(normal, basis(:k)))
        self%closed(i) = force >= least
        self%piece(i) = count(limits%from <= force)
      end associate
      self%lower_rises(i) = dot_product(changing(:, 2, self%piece(i)), basis) > 0.0_wp
      self%upper_falls(i) = dot_product(changing(:, 3, self%piece(i)), basis) < 0.0_wp
    end do
    do i = 1, segments + 1
      p = self%piece(min(i, segments))
      basis = basis_at(self%cuts(i), size(basis)/2)
      self%lower_at(i) = dot_product(self%lower(:, p), basis)
      self%upper_at(i) = dot_product(self%upper(:, p), basis)
      self%u_at(i) = dot_product(motion(:, 1), basis(:k))
      if (self%closed(max(i - 1, 1)) .and. self%piece(max(i - 1, 1)) == p) cycle
      self%fixed_slope(i) = dot_product(slopes(:, 2), basis(:k))
      if (abs(self%fixed_slope(i)) > 0.0_wp) self%fixed_slope(i) = -dot_product(slopes(:, 1), basis(:k))/self%fixed_slope(i)
    end do

  contains

    !> Instants at which N is of one piece.
    function within(instants, p)
      !> Angles of the period
      real(wp), intent(in) :: instants(:)
      !> The piece
      integer, intent(in) :: p
      real(wp), allocatable :: within(:)
      integer :: i

      within = pack(instants, [(count(limits%from <= dot_product(normal, basis_at(instants(i), k/2))) == p, i=1, size(instants))])
    end function within
  end function new_event_motion

  !> r = (c_0 + c_1 N + c_2 N^2)/k_t, and what it makes of u.
  subroutine set_clamps(law, limits, normal, u, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Pieces of the law
    type(limit_type), intent(in) :: limits(:)
    !> Coefficients of N and u
    real(wp), intent(in) :: normal(:), u(:)
    type(event_motion_type), intent(inout) :: self
    real(wp) :: square(2*size(u) - 1)
    integer :: k, order, p
    logical :: is_bent

    k = size(u)
    is_bent = .not. law%is_proportional()
    order = merge(2*k - 1, k, is_bent)
    if (is_bent) square = product_of(normal, normal)
    allocate (self%radius(order, size(limits)), self%lower(order, size(limits)), self%upper(order, size(limits)))
    allocate (self%slope(merge(k, 1, is_bent), size(limits)))
    do p = 1, size(limits)
      associate (c => limits(p)%coefficients, kt => law%tangential_stiffness, kn => law%normal_stiffness, r => self%radius(:, p))
        if (is_bent) then
          r = c(2)/kt*square
          self%slope(:, p) = 2.0_wp*c(2)*kn/kt*normal
        else
          r = 0.0_wp
          self%slope(:, p) = 0.0_wp
        end if
        r(:k) = r(:k) + c(1)/kt*normal
        r(1) = r(1) + c(0)/kt
        self%slope(1, p) = self%slope(1, p) + c(1)*kn/kt
        self%lower(:, p) = -r
        self%upper(:, p) = r
      end associate
      self%lower(:k, p) = self%lower(:k, p) + u
      self%upper(:k, p) = self%upper(:k, p) + u
    end do
  end subroutine set_clamps

  !> March one period; `state` is the slider at the start, then at the end, with its origin.
  subroutine march_events(self, state, intervals, count)
    type(event_motion_type), intent(in) :: self
    !> Interval in which the contact is
    type(interval_type), intent(inout) :: state
    !> What happens, in order, if asked for; at most two a segment [>= 2 segments]
    type(interval_type), intent(inout), optional :: intervals(:)
    !> How many intervals there are
    integer, intent(out), optional :: count
    integer :: i, side

    if (present(count)) count = 0
    do i = 1, size(self%closed)
      state%piece = self%piece(i)
      ! A start slider outside [L, U] at 0 is taken to the nearer end.
      if (i == 1 .and. self%closed(1) .and. state%slider < self%lower_at(1)) call follow(self, 1, 1, state)
      if (i == 1 .and. self%closed(1) .and. state%slider > self%upper_at(1)) call follow(self, 1, -1, state)
      side = 0
      if (self%lower_rises(i) .and. self%lower_at(i + 1) > state%slider) then
        side = 1
      else if (self%upper_falls(i) .and. self%upper_at(i + 1) < state%slider) then
        side = -1
      end if
      if (present(intervals)) call keep(self, i, side, state, intervals, count)
      if (.not. self%closed(i)) then
        call land(self, i + 1, state)
      else if (side /= 0) then
        call follow(self, i + 1, side, state)
      end if
    end do
  end subroutine march_events

  !> What happens in a segment: an open contact, stick, or stick until an end of the clamp meets the slider, and then slip with it.
  subroutine keep(self, segment, side, state, intervals, count)
    type(event_motion_type), intent(in) :: self
    !> Number of the segment between cuts; which end of the clamp meets the slider of a closed contact: 1 or -1, 0: none
    integer, intent(in) :: segment, side
    !> Interval in which the contact is
    type(interval_type), intent(in) :: state
    !> What happens, in order, and how many intervals there are
    type(interval_type), intent(inout) :: intervals(:)
    integer, intent(inout) :: count
    real(wp) :: hit

    associate (from => self%cuts(segment), to => self%cuts(segment + 1), piece => self%piece(segment))
      hit = from
      if (.not. self%closed(segment)) then
        call add(state, from, to, regime_open, 0, intervals, count)
        return
      else if (side == 0) then
        hit = to
      else if (side > 0 .and. self%lower_at(segment) < state%slider) then
        hit = root_between(self%lower(:, piece), state%slider, from, to)
      else if (side < 0 .and. self%upper_at(segment) > state%slider) then
        hit = root_between(self%upper(:, piece), state%slider, from, to)
      end if
      call add(state, from, hit, regime_stick, 0, intervals, count)
      call add(state, hit, to, regime_slip, side, intervals, count)
    end associate
  end subroutine keep

  !> Put an interval behind the others, unless it has no length.
  pure subroutine add(state, from, to, regime, side, intervals, count)
    !> Interval in which the contact is
    type(interval_type), intent(in) :: state
    !> Angle at which the interval begins; angle at which the interval ends
    real(wp), intent(in) :: from, to
    !> Regime: stick, slip or open; which end of the clamp: 1 or -1
    integer, intent(in) :: regime, side
    !> What happens, in order, and how many intervals there are
    type(interval_type), intent(inout) :: intervals(:)
    integer, intent(inout) :: count

    if (to <= from) return
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
    state%by_normal = self%fixed_slope(cut)
    associate (before => max(cut - 1, 1), after => min(cut, size(self%piece)))
      if (self%piece(before) /= self%piece(after)) return
      associate (slope => self%slope(:, self%piece(before)))
        state%by_normal = -side*slope(1)
        if (size(slope) > 1) state%by_normal = -side*dot_product(slope, basis_at(self%cuts(cut), size(slope)/2))
      end associate
    end associate
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
    state%by_normal = self%fixed_slope(cut)
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
