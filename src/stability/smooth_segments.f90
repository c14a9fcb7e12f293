!> A period of an orbit as smooth segments: intervals of time in which no contact changes what it does, so that the linearised flow
!> has constant coefficients; and what becomes of a perturbed slider where a segment begins.
!>
!> Contact forces are continuous through every change, so the motion's perturbation is too, and of event times only that matters at
!> which a slider comes to rest: it keeps what it then had. Where slip ends (side = +-1), w = u - side r and w' = 0; where a contact
!> lands, w = u at the root of N, which moves with v:
!>
!> $$ \delta w = \delta u - \text{side} \, \frac{\mu k_n}{k_t} \delta v, \qquad \delta w = \delta u - \frac{u'}{v'} \delta v $$
module attrito_stability_smooth_segments
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_event_march, only: event_motion_type, interval_type, new_event_motion, march_events
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_contact_stuck_bound, only: is_stuck_by_bound
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type
  use attrito_integrate_recorder, only: trace_type
  implicit none
  private
  public :: smooth_segment_type, orbit_segments_type, segments_of_motion, segments_of_trace

  type :: smooth_segment_type
    !> Part of the period, of 2 pi: where it begins, how long it lasts
    real(wp) :: from = 0.0_wp, length = 0.0_wp
    !> What each contact does, and to which side it slips (+1, -1) [contacts]
    integer, allocatable :: regime(:), side(:)
    !> Does its slider come to rest where the segment begins, and how it did if it sticks: dw = du + by_normal dv [contacts];
    !> at the start of the period it does not count as coming to rest, but its slider as part of the state
    logical, allocatable :: rests(:)
    real(wp), allocatable :: by_normal(:)
  end type smooth_segment_type

  type :: orbit_segments_type
    type(smooth_segment_type), allocatable :: segment(:)
    !> Contacts that neither slip nor open during the period: their sliders are neutral [contacts]
    logical, allocatable :: stuck(:)
  end type orbit_segments_type

contains

  !> Segments of contacts with one tangent along a trigonometric motion, switches located.
  !> Those with two tangents must stick throughout.
  subroutine segments_of_motion(law, grid, motion, slider, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> For the motion's harmonics
    type(trigonometric_grid_type), intent(in) :: grid
    !> Relative displacements of all rows [2 H + 1, rows]; sliders at the start of the period [contacts]
    real(wp), intent(in) :: motion(:, :), slider(:)
    type(orbit_segments_type), intent(out) :: self
    type(interval_type), allocatable :: intervals(:)
    real(wp), allocatable :: ends(:)
    integer, allocatable :: owner(:)
    integer :: i, count

    allocate (intervals(0), owner(0), self%stuck(size(law)))
    ends = [0.0_wp, two_pi]
    do i = 1, size(law)
      self%stuck(i) = law(i)%tangents > 1
      if (self%stuck(i)) cycle
      associate (row => law(i)%first_row)
        call append(i, motion(:, row:row + 1))
      end associate
      if (self%stuck(i)) cycle
      count = size(pack(owner, owner == i))
      ends = [ends, intervals(size(intervals) - count + 1:)%to]
    end do
    call cut(ends, owner, intervals, self)

  contains

    !> The intervals of one contact, in its steady loop.
    subroutine append(contact, own)
      !> Number of the contact
      integer, intent(in) :: contact
      !> Intervals of the contact
      real(wp), intent(in) :: own(:, :)
      type(event_motion_type) :: events
      type(interval_type), allocatable :: found(:)
      type(interval_type) :: state, lowest, highest
      integer :: number

      self%stuck(contact) = is_stuck_by_bound(law(contact), own, [slider(contact)])
      if (self%stuck(contact)) return
      events = new_event_motion(law(contact), grid, own)
      state = interval_type(slider=slider(contact))
      lowest = interval_type(slider=-huge(1.0_wp))
      highest = interval_type(slider=huge(1.0_wp))
      call march_events(events, state)
      call march_events(events, lowest)
      call march_events(events, highest)
      ! What a period does not forget neither slips nor opens in the steady loop.
      self%stuck(contact) = lowest%slider < highest%slider - 1.0e-13_wp*(abs(lowest%slider) + abs(highest%slider))
      if (self%stuck(contact)) return
      allocate (found(2*size(events%closed)))
      call march_events(events, state, found, number)
      intervals = [intervals, found(:number)]
      owner = [owner, spread(contact, 1, number)]
    end subroutine append
  end subroutine segments_of_motion

  !> Segments of an event-exact period.
  pure subroutine segments_of_trace(law, trace, period, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Stretches of the period
    type(trace_type), intent(in) :: trace(:)
    !> Units of the clock
    real(wp), intent(in) :: period
    type(orbit_segments_type), intent(out) :: self
    integer :: i, j, before

    allocate (self%segment(size(trace)), self%stuck(size(law)))
    do i = 1, size(law)
      self%stuck(i) = all([(trace(j)%regime(i) == regime_stick, j=1, size(trace))])
    end do
    do j = 1, size(trace)
      before = modulo(j - 2, size(trace)) + 1
      associate (segment => self%segment(j))
        segment%from = two_pi*sum(trace(:j - 1)%length)/period
        segment%length = two_pi*trace(j)%length/period
        segment%regime = trace(j)%regime
        segment%side = merge(trace(j)%side, 0, segment%regime == regime_slip)
        segment%rests = segment%regime == regime_stick .and. trace(before)%regime /= regime_stick .and. j > 1
        segment%by_normal = -trace(before)%side*law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness
        where (trace(before)%regime == regime_open) segment%by_normal = -trace(j)%landing_slope
      end associate
    end do
    ! A rest that several segments share is noted in each.
    do j = 2, size(trace)
      associate (segment => self%segment(j), before_it => self%segment(j - 1))
        where (segment%regime == regime_stick .and. .not. segment%rests) segment%by_normal = before_it%by_normal
      end associate
    end do
  end subroutine segments_of_trace

  !> One segment between neighbouring ends of any contact's intervals.
  subroutine cut(ends, owner, intervals, self)
    !> Ends of the contacts' intervals
    real(wp), intent(in) :: ends(:)
    !> Contact of each interval, ascending, each contact's in their order
    integer, intent(in) :: owner(:)
    !> Intervals of the period, each in one regime
    type(interval_type), intent(in) :: intervals(:)
    type(orbit_segments_type), intent(inout) :: self
    real(wp), allocatable :: times(:)
    integer :: contacts, i, j, current(size(self%stuck))

    contacts = size(self%stuck)
    times = distinct(ends)
    allocate (self%segment(size(times) - 1))
    current = [(findloc(owner, i, 1), i=1, contacts)]
    do j = 1, size(self%segment)
      associate (segment => self%segment(j))
        segment%from = times(j)
        segment%length = times(j + 1) - times(j)
        allocate (segment%regime(contacts), source=regime_stick)
        allocate (segment%side(contacts), source=0)
        allocate (segment%rests(contacts), source=.false.)
        allocate (segment%by_normal(contacts), source=0.0_wp)
        do i = 1, contacts
          if (self%stuck(i)) cycle
          call take(i, segment, j == 1)
        end do
      end associate
    end do

  contains

    !> What a contact does in a segment; its intervals follow each other.
    subroutine take(contact, segment, first)
      !> Number of the contact
      integer, intent(in) :: contact
      !> Segment of the orbit
      type(smooth_segment_type), intent(inout) :: segment
      !> First of the modes or segments
      logical, intent(in) :: first
      integer :: before

      before = current(contact)
      do while (intervals(current(contact))%to <= segment%from)
        current(contact) = current(contact) + 1
      end do
      associate (interval => intervals(current(contact)))
        segment%regime(contact) = interval%regime
        segment%side(contact) = merge(interval%side, 0, interval%regime == regime_slip)
        if (interval%regime /= regime_stick) return
        segment%by_normal(contact) = interval%by_normal
        if (first .or. current(contact) == before) return
        ! A rest that a cut between does not disturb goes on.
        segment%rests(contact) = intervals(before)%regime /= regime_stick .or. &
                                 abs(interval%origin - intervals(before)%origin) > 0.0_wp
      end associate
    end subroutine take
  end subroutine cut

  !> Ascending, without repetitions.
  pure function distinct(values) result(times)
    !> Angles
    real(wp), intent(in) :: values(:)
    real(wp), allocatable :: times(:)
    real(wp) :: sorted(size(values)), next
    integer :: count

    count = 1
    sorted(1) = minval(values)
    do
      next = minval(values, mask=values > sorted(count))
      if (next > maxval(values)) exit
      count = count + 1
      sorted(count) = next
    end do
    times = sorted(:count)
  end function distinct
end module attrito_stability_smooth_segments
