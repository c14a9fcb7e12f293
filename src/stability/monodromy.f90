!> The linearised flow over a period of an orbit, segment by segment: what a small change of motion, rate and sliders becomes.
!>
!> $$ \delta p'' + D \delta p' + \Lambda \delta p = - \Phi^T B^T \delta g, \qquad
!>    \delta g = (-k_t \delta w,\, 0), \quad (\text{side}\, \mu k_n \delta v - k_t \delta u,\, 0), \quad (-k_t \delta u,\, -k_n
!> \delta v) $$
!>
!> for a contact that sticks, slips, is open. On a smooth segment the coefficients are constant, and the flow of all columns at once
!> is a Taylor series whose terms obey the recursion of `attrito_integrate_taylor`; between segments sliders that come to rest are
!> reset (`attrito_stability_smooth_segments`). A perturbed slider acts only while its contact sticks: this is the memory that a
!> Jacobian frozen in time leaves out.
!>
!> High modes may follow at rest (`attrito_stability_reduced`). With g = G d in rows that slip or open, h = -k_t dw in those that
!> stick, their displacements are d = B p - R (g + h), so that g = S (B p - R h), S = (1 + G R)^-1 G.
module attrito_stability_monodromy
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_stability_smooth_segments, only: smooth_segment_type, orbit_segments_type
  use attrito_stability_perturbation, only: memory_type, perturbation_type, memory_of, unit_perturbations, matrix_of
  use attrito_stability_reduced, only: reduced_type
  implicit none
  private
  public :: monodromy

  !> Longest step of the series over the fastest mode: beyond, terms cancel to more than a digit
  real(wp), parameter :: longest = 2.0_wp ! derived
  !> Most terms; with steps as short as that rounding is reached well before
  integer, parameter :: most_terms = 60 ! conventional
  !> Squares pay while their number times m is below so many steps: one takes 16 m^3 products, a step some 25 terms of 8 m^2 and more
  real(wp), parameter :: steps_per_square = 6.0_wp ! derived
  !> Part of a column that a term must be to matter
  real(wp), parameter :: rounding = 1.0e-2_wp*epsilon(1.0_wp) ! derived

  !> Angles that are rounding of the period's
  real(wp), parameter :: no_angle = 1.0e-12_wp ! derived

  !> What contacts add on a segment: acceleration `input_map` (`output_map`^T p) + `held` w, and displacements of rows d = B p -
  !> `by_motion` p - `by_slider` w
  type :: coupling_type
    !> [m, rows that do not just stick] each
    real(wp), allocatable :: output_map(:, :), input_map(:, :)
    !> [m, contacts]
    real(wp), allocatable :: held(:, :)
    !> [rows, m] and [rows, contacts]: high modes' part, zero if all are kept
    real(wp), allocatable :: by_motion(:, :), by_slider(:, :)
  end type coupling_type

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
    type(coupling_type) :: coupling
    type(memory_type), allocatable :: memory(:)
    real(wp) :: end
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
      if (i > 1) call reset_sliders(reduced, orbit%segment(i), coupling, now)
      coupling = couple(reduced, orbit%segment(i))
      call pass(reduced, coupling, min(orbit%segment(i)%length, end - orbit%segment(i)%from)/two_pi*period, now)
    end do
    call follow_sliders(reduced, orbit%segment(last), coupling, now)
    if (present(kept)) memory = kept
    matrix = matrix_of(now, memory)
  end function monodromy

  !> Sliders that come to rest at the beginning of a segment keep what they have there.
  subroutine reset_sliders(reduced, segment, before, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> Of the segment before
    type(coupling_type), intent(in) :: before
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: kept(size(now%slider, 1), size(now%slider, 2))
    integer :: i

    kept = now%slider(:, :, 1)
    do i = 1, size(segment%rests)
      if (segment%rests(i)) kept(i, :) = combined(reduced, i, segment%by_normal(i), before, now)
    end do
    now%slider(:, :, 1) = kept
  end subroutine reset_sliders

  !> Sliders that move at the end of a segment, with slip or with an open contact.
  subroutine follow_sliders(reduced, segment, coupling, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> Accelerations and displacements that contacts add on a segment
    type(coupling_type), intent(in) :: coupling
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: kept(size(now%slider, 1), size(now%slider, 2))
    integer :: i

    kept = now%slider(:, :, 1)
    do i = 1, size(segment%rests)
      if (segment%regime(i) == regime_stick) cycle
      associate (law => reduced%system%law(i))
        kept(i, :) = combined(reduced, i, -segment%side(i)*law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness, &
                              coupling, now)
      end associate
    end do
    now%slider(:, :, 1) = kept
  end subroutine follow_sliders

  !> du + by_normal dv of a contact [columns].
  function combined(reduced, contact, by_normal, coupling, now) result(change)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Number of the contact
    integer, intent(in) :: contact
    !> Slope by the normal displacement
    real(wp), intent(in) :: by_normal
    !> Accelerations and displacements that contacts add on a segment
    type(coupling_type), intent(in) :: coupling
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    real(wp) :: change(size(now%motion, 2))

    associate (u => reduced%system%law(contact)%first_row, v => reduced%system%law(contact)%first_row + 1, &
               rows => reduced%system%rows)
      change = matmul(rows(:, u) - coupling%by_motion(u, :) + by_normal*(rows(:, v) - coupling%by_motion(v, :)), now%motion) &
               - matmul(coupling%by_slider(u, :) + by_normal*coupling%by_slider(v, :), now%slider(:, :, 1))
    end associate
  end function combined

  !> What contacts add on a segment.
  function couple(reduced, segment) result(self)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    type(coupling_type) :: self
    !> G [rows that slip or open, rows], then S
    real(wp), allocatable :: stiffness(:, :), matrix(:, :)
    real(wp) :: springs(size(segment%regime))
    integer, allocatable :: active(:), tangents(:)
    integer :: i, n, info

    associate (system => reduced%system)
      n = count(segment%regime == regime_slip) + 2*count(segment%regime == regime_open)
      allocate (active(n))
      allocate (stiffness(n, size(system%springs)), source=0.0_wp)
      n = 0
      do i = 1, size(system%law)
        associate (law => system%law(i), row => system%law(i)%first_row)
          if (segment%regime(i) == regime_stick) cycle
          n = n + 1
          active(n) = row
          stiffness(n, row) = -law%tangential_stiffness
          stiffness(n, row + 1) = segment%side(i)*law%friction_coefficient*law%normal_stiffness
          if (segment%regime(i) == regime_slip) cycle
          n = n + 1
          active(n) = row + 1
          stiffness(n, row + 1) = -law%normal_stiffness
        end associate
      end do
      matrix = matmul(stiffness, reduced%residual(:, active))
      do i = 1, n
        matrix(i, i) = matrix(i, i) + 1.0_wp
      end do
      call solve_dense(matrix, stiffness, info)
      ! Forces of sliders, h = -k_t w where they rest.
      tangents = system%law%first_row
      springs = merge(-system%law%tangential_stiffness, 0.0_wp, segment%regime == regime_stick)
      self%by_slider = reduced%residual(:, tangents)*spread(springs, 1, size(system%springs))
      self%input_map = -system%input_map(:, active)
      self%output_map = matmul(system%rows, transpose(stiffness))
      self%held = -system%input_map(:, tangents)*spread(springs, 1, size(system%eigenvalues)) &
                  - matmul(self%input_map, matmul(stiffness, self%by_slider))
      self%by_motion = matmul(reduced%residual(:, active), transpose(self%output_map))
      self%by_slider = self%by_slider - matmul(reduced%residual(:, active), matmul(stiffness, self%by_slider))
    end associate
  end function couple

  !> The flow over a segment, in equal steps or by squares of one.
  subroutine pass(reduced, coupling, length, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Accelerations and displacements that contacts add on a segment
    type(coupling_type), intent(in) :: coupling
    !> In units of the clock
    real(wp), intent(in) :: length
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp), allocatable :: held(:, :)
    integer :: step, steps, doublings

    ! Contacts that change at one instant leave segments of no length between them.
    if (length <= 0.0_wp) return
    steps = max(1, ceiling(length*sqrt(maxval(reduced%system%eigenvalues))/longest))
    doublings = ceiling(log(real(steps, wp))/log(2.0_wp))
    if (doublings*size(now%motion, 1) < steps_per_square*steps) then
      call pass_by_squares(reduced, coupling, length, doublings, now)
      return
    end if
    held = matmul(coupling%held, now%slider(:, :, 1))
    do step = 1, steps
      call step_on(reduced, coupling, held, length/steps, now)
    end do
  end subroutine pass

  !> The flow of one step, as a matrix, squared so many times.
  subroutine pass_by_squares(reduced, coupling, length, doublings, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Accelerations and displacements that contacts add on a segment
    type(coupling_type), intent(in) :: coupling
    !> Length of the step
    real(wp), intent(in) :: length
    !> How often it is squared
    integer, intent(in) :: doublings
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    type(perturbation_type) :: unit
    real(wp), allocatable :: flow(:, :), state(:, :)
    type(memory_type) :: sliders(size(now%slider, 1))
    integer :: m, i

    m = size(now%motion, 1)
    sliders = [(memory_type(i, 1), i=1, size(sliders))]
    unit = unit_perturbations(m, size(sliders), sliders)
    call step_on(reduced, coupling, matmul(coupling%held, unit%slider(:, :, 1)), length/2**doublings, unit)
    flow = matrix_of(unit, sliders)
    do i = 1, doublings
      flow = matmul(flow, flow)
    end do
    state = matmul(flow, matrix_of(now, sliders))
    now%motion = state(:m, :)
    now%rate = state(m + 1:2*m, :)
  end subroutine pass_by_squares

  !> One step of the series, p_{k+2} = (held_k - Lambda p_k - (k + 1) D p_{k+1} + pushed seen^T p_k)/((k + 1)(k + 2)), until its
  !> terms are below rounding.
  subroutine step_on(reduced, coupling, held, h, now)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Accelerations and displacements that contacts add on a segment
    type(coupling_type), intent(in) :: coupling
    !> Accelerations by sliders that stick; length of the step, s
    real(wp), intent(in) :: held(:, :), h
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp), dimension(size(held, 1), size(held, 2)) :: term, next, after
    real(wp) :: scale(size(held, 2)), last(size(held, 2))
    integer :: k

    associate (system => reduced%system)
      ! Terms are those of powers of time over the step.
      term = now%motion
      next = h*now%rate
      now%motion = term + next
      now%rate = next
      scale = max(maxval(abs(term), 1), maxval(abs(next), 1))
      do k = 0, most_terms
        after = matmul(coupling%input_map, matmul(transpose(coupling%output_map), term)) &
                - spread(system%eigenvalues, 2, size(scale))*term
        if (k == 0) after = after + held
        after = h**2*after - (h*(k + 1))*spread(system%damping, 2, size(scale))*next
        if (allocated(system%coupling)) after = after - (h*(k + 1))*matmul(system%coupling, next)
        after = after/((k + 1)*(k + 2))
        term = next
        next = after
        now%motion = now%motion + next
        now%rate = now%rate + (k + 2)*next
        last = max(maxval(abs(term), 1), maxval(abs(next), 1))
        scale = max(scale, last)
        if (all(last <= rounding*scale)) exit
      end do
      now%rate = now%rate/h
    end associate
  end subroutine step_on
end module attrito_stability_monodromy
