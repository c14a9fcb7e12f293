!> The linearised flow over a period of an orbit, segment by segment: what a small change of motion, rate and of what contacts
!> remember becomes.
!>
!> On a smooth segment it is a series in time (`attrito_stability_segment_flow`). Contact forces are continuous through every change
!> of regime, so between segments only contacts' memory changes: a slider that comes to rest keeps what it then has, and a direction
!> of slip begins as that of u - w (`attrito_stability_smooth_segments`). A perturbed slider acts only while its contact sticks: this
!> is the memory that a Jacobian frozen in time leaves out.
module attrito_stability_monodromy
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: regime_stick, regime_slip
  use attrito_stability_perturbation, only: memory_type, perturbation_type, memory_of, unit_perturbations, matrix_of
  use attrito_stability_reduced, only: reduced_type
  use attrito_stability_segment_flow, only: segment_flow_type, new_segment_flow, step_on, displacements_of
  use attrito_stability_smooth_segments, only: smooth_segment_type, orbit_segments_type
  implicit none
  private
  public :: monodromy

  !> Longest step of the series over the fastest mode: beyond, terms cancel to more than a digit
  real(wp), parameter :: longest = 2.0_wp ! derived
  !> Squares pay while their number times m is below so many steps: one takes 16 m^3 products, a step some 25 terms of 8 m^2 and more
  real(wp), parameter :: steps_per_square = 6.0_wp ! derived
  !> Angles that are rounding of the period's
  real(wp), parameter :: no_angle = 1.0e-12_wp ! derived

contains

  !> What a unit change of each of (motion [m], rate by the clock [m], memory) becomes in a period, or in the first of several equal
  !> parts of it.
  function monodromy(reduced, orbit, period, parts, kept) result(matrix)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Orbit as segments between its events
    type(orbit_segments_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    !> How many parts; what is remembered at the end of the first, as at the beginning unless given
    integer, intent(in), optional :: parts
    type(memory_type), intent(in), optional :: kept(:)
    real(wp), allocatable :: matrix(:, :)
    type(perturbation_type) :: now
    type(segment_flow_type) :: flow
    type(memory_type), allocatable :: memory(:)
    real(wp) :: end, fraction
    integer :: i, last

    memory = memory_of(reduced%system%law, orbit%stuck, orbit%segment(1)%regime)
    now = unit_perturbations(size(reduced%system%eigenvalues), size(orbit%stuck), memory)
    last = size(orbit%segment)
    end = two_pi
    if (present(parts)) then
      end = two_pi/parts
      ! A switch at the end, where rounding has it on either side, belongs to the next part.
      last = count(orbit%segment%from < end - no_angle)
    end if
    do i = 1, last
      associate (segment => orbit%segment(i))
        if (i > 1) call change_regimes(reduced, orbit%segment(i - 1), segment, flow, now)
        flow = new_segment_flow(reduced, segment)
        fraction = 1.0_wp
        if (segment%length > end - segment%from) fraction = (end - segment%from)/segment%length
        call pass(reduced, flow, segment, fraction, segment%length/two_pi*period, now)
      end associate
    end do
    call follow_memory(reduced, orbit%segment(last), orbit%segment(modulo(last, size(orbit%segment)) + 1), flow, now)
    if (present(kept)) memory = kept
    matrix = matrix_of(now, memory)
  end function monodromy

  !> Sliders that come to rest at the beginning of a segment keep what they have there; directions of slip begin.
  subroutine change_regimes(reduced, before, segment, flow, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment before and segment of the orbit
    type(smooth_segment_type), intent(in) :: before, segment
    !> What contacts added on it
    type(segment_flow_type), intent(in) :: flow
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    integer :: i

    do i = 1, size(segment%regime)
      if (segment%rests(i)) call rest(reduced, before, i, segment%by_normal(:, i), flow, now)
      if (segment%regime(i) == regime_slip .and. before%regime(i) == regime_stick) then
        call begin_slip(reduced, before, i, segment%direction(:, i), flow, now)
      end if
      if (before%regime(i) == regime_slip .and. segment%regime(i) /= regime_slip) now%angle(i, :) = 0.0_wp
    end do
  end subroutine change_regimes

  !> At the end of the last segment: sliders that move, with slip or with an open contact, and directions of slip that are to begin.
  subroutine follow_memory(reduced, segment, next, flow, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit, and the one after it
    type(smooth_segment_type), intent(in) :: segment, next
    !> Of the segment
    type(segment_flow_type), intent(in) :: flow
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: by_normal(2)
    integer :: i

    do i = 1, size(segment%regime)
      if (segment%regime(i) == regime_stick) then
        if (next%regime(i) == regime_slip) call begin_slip(reduced, segment, i, next%direction(:, i), flow, now)
        cycle
      end if
      associate (law => reduced%system%law(i))
        by_normal = 0.0_wp
        if (next%regime(i) == regime_stick) by_normal = next%by_normal(:, i)
        if (segment%regime(i) == regime_slip) by_normal = -segment%to(:, i)*law%friction_coefficient*law%normal_stiffness/ &
          law%tangential_stiffness
      end associate
      call rest(reduced, segment, i, by_normal, flow, now)
    end do
  end subroutine follow_memory

  !> dw = du + by_normal dv - psi e_perp.
  subroutine rest(reduced, before, contact, by_normal, flow, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment that has passed
    type(smooth_segment_type), intent(in) :: before
    !> Number of the contact
    integer, intent(in) :: contact
    !> Slope by the normal displacement
    real(wp), intent(in) :: by_normal(2)
    !> What contacts added on it
    type(segment_flow_type), intent(in) :: flow
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: d(reduced%system%law(contact)%tangents + 1, size(now%motion, 2)), across(2)
    integer :: a, n

    n = reduced%system%law(contact)%tangents
    across = [-before%to(2, contact), before%to(1, contact)]
    d = displacements_of(flow, reduced, before, [(reduced%system%law(contact)%first_row + a, a=0, n)], now)
    do a = 1, n
      now%slider(contact, :, a) = d(a, :) + by_normal(a)*d(n + 1, :) - across(a)*now%angle(contact, :)
    end do
  end subroutine rest

  !> psi = e_perp.(du - dw), of two tangents.
  subroutine begin_slip(reduced, before, contact, e, flow, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment that has passed
    type(smooth_segment_type), intent(in) :: before
    !> Number of the contact
    integer, intent(in) :: contact
    !> Direction of slip
    real(wp), intent(in) :: e(2)
    !> What contacts added on it
    type(segment_flow_type), intent(in) :: flow
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: d(2, size(now%motion, 2))

    associate (law => reduced%system%law(contact))
      if (.not. law%has_direction()) return
      d = displacements_of(flow, reduced, before, [law%first_row, law%first_row + 1], now)
    end associate
    now%angle(contact, :) = e(1)*(d(2, :) - now%slider(contact, :, 2)) - e(2)*(d(1, :) - now%slider(contact, :, 1))
  end subroutine begin_slip

  !> The flow over a segment or its first part: in equal steps, or by squares of one unless directions of slip turn.
  subroutine pass(reduced, flow, segment, fraction, length, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> What contacts add on the segment
    type(segment_flow_type), intent(in) :: flow
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> Part of it; its length in units of the clock
    real(wp), intent(in) :: fraction, length
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    integer :: step, steps, doublings

    ! Contacts that change at one instant leave segments of no length between them.
    if (length <= 0.0_wp) return
    steps = max(1, ceiling(fraction*length*sqrt(maxval(reduced%system%eigenvalues))/longest))
    doublings = ceiling(log(real(steps, wp))/log(2.0_wp))
    if (size(segment%slips) == 0 .and. doublings*size(now%motion, 1) < steps_per_square*steps) then
      call pass_by_squares(reduced, flow, segment, fraction*length, doublings, now)
    else
      do step = 1, steps
        call step_on(flow, reduced, segment, fraction*[step - 1, step]/steps, fraction*length/steps, now)
      end do
    end if
  end subroutine pass

  !> The flow of one step, as a matrix, squared so many times.
  subroutine pass_by_squares(reduced, flow, segment, length, doublings, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> What contacts add on the segment
    type(segment_flow_type), intent(in) :: flow
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> In units of the clock
    real(wp), intent(in) :: length
    !> How often it is squared
    integer, intent(in) :: doublings
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    type(perturbation_type) :: unit
    real(wp), allocatable :: matrix(:, :), state(:, :)
    type(memory_type) :: sliders(size(flow%held))
    integer :: m, i

    m = size(now%motion, 1)
    sliders%contact = flow%owner
    sliders%component = flow%component
    unit = unit_perturbations(m, size(now%slider, 1), sliders)
    call step_on(flow, reduced, segment, [0.0_wp, 1.0_wp], length/2**doublings, unit)
    matrix = matrix_of(unit, sliders)
    do i = 1, doublings
      matrix = matmul(matrix, matrix)
    end do
    state = matmul(matrix, matrix_of(now, sliders))
    now%motion = state(:m, :)
    now%rate = state(m + 1:2*m, :)
  end subroutine pass_by_squares
end module attrito_stability_monodromy
