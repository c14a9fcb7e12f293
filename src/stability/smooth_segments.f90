!> A period of an orbit as smooth segments: intervals of time in which no contact changes what it does, so that the linearised flow
!> is smooth; and what becomes of a perturbed slider where a segment begins.
!>
!> Contact forces are continuous through every change, so the motion's perturbation is too, and of event times only that matters at
!> which a slider comes to rest: it keeps what it then had. When slip ends, w = u - r e and w' = 0; when a contact lands, w = u at
!> the root of N, which moves with v:
!>
!> $$ \delta w = \delta u - \frac{\mu k_n}{k_t} \delta v\, e - r\, \delta\phi\, e_\perp, \qquad
!>    \delta w = \delta u - \frac{u'}{v'} \delta v $$
!>
!> with e = +-1 of one tangent. Of two, a segment in which a contact slips is one step of the motion's series, which it keeps.
module attrito_stability_smooth_segments
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_recorder, only: trace_type, slip_series_type
  implicit none
  private
  public :: smooth_segment_type, orbit_segments_type, segments_of_trace

  type :: smooth_segment_type
    !> Part of the period, of 2 pi: where it begins, how long it lasts
    real(wp) :: from = 0.0_wp, length = 0.0_wp
    !> What each contact does, and to which side it slips (+1, -1) [contacts]
    integer, allocatable :: regime(:), side(:)
    !> Directions of slip at its beginning and its end [2, contacts]
    real(wp), allocatable :: direction(:, :), to(:, :)
    !> Does its slider come to rest where the segment begins [contacts], and how it did if it sticks: dw = du + by_normal dv - ...
    !> [2, contacts]; at the start of the period it does not count as coming to rest, but its slider as part of the state
    logical, allocatable :: rests(:)
    real(wp), allocatable :: by_normal(:, :)
    !> Slip along two tangents
    type(slip_series_type), allocatable :: slips(:)
  end type smooth_segment_type

  type :: orbit_segments_type
    type(smooth_segment_type), allocatable :: segment(:)
    !> Contacts that neither slip nor open during the period: their sliders are neutral [contacts]
    logical, allocatable :: stuck(:)
  end type orbit_segments_type

contains

  !> Segments of an event-exact period.
  pure subroutine segments_of_trace(law, trace, period, self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Stretches of the period
    type(trace_type), intent(in) :: trace(:)
    !> Units of the clock
    real(wp), intent(in) :: period
    type(orbit_segments_type), intent(out) :: self
    real(wp) :: begun
    integer :: i, j, before

    begun = 0.0_wp
    allocate (self%segment(size(trace)), self%stuck(size(law)))
    do i = 1, size(law)
      self%stuck(i) = all([(trace(j)%regime(i) == regime_stick, j=1, size(trace))])
    end do
    do j = 1, size(trace)
      before = modulo(j - 2, size(trace)) + 1
      associate (segment => self%segment(j))
        segment%from = two_pi*begun/period
        segment%length = two_pi*trace(j)%length/period
        begun = begun + trace(j)%length
        segment%regime = trace(j)%regime
        segment%side = merge(trace(j)%side, 0, segment%regime == regime_slip)
        segment%direction = trace(j)%from
        segment%to = trace(j)%to
        segment%slips = trace(j)%slips
        segment%rests = segment%regime == regime_stick .and. trace(before)%regime /= regime_stick .and. j > 1
        allocate (segment%by_normal(2, size(law)))
        do i = 1, size(law)
          segment%by_normal(:, i) = -trace(before)%to(:, i)*law(i)%friction_coefficient*law(i)%normal_stiffness/ &
                                    law(i)%tangential_stiffness
          if (trace(before)%regime(i) == regime_open) segment%by_normal(:, i) = -trace(j)%landing_slope(:, i)
        end do
      end associate
    end do
    ! A rest that several segments share is noted in each.
    do j = 2, size(trace)
      associate (segment => self%segment(j), before_it => self%segment(j - 1))
        do i = 1, size(law)
          if (segment%regime(i) == regime_stick .and. .not. segment%rests(i)) segment%by_normal(:, i) = before_it%by_normal(:, i)
        end do
      end associate
    end do
  end subroutine segments_of_trace
end module attrito_stability_smooth_segments
