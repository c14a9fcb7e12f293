!> The linearised flow over a smooth segment of an orbit, all columns at once, as a Taylor series in the part x that has passed:
!>
!> $$ \delta p'' + D \delta p' + \Lambda \delta p = - \Phi^T B^T \delta g, \qquad \delta g = \delta T - k_t \delta u, $$
!> $$ \delta T = 0, \quad \text{side}\, \mu k_n \delta v, \quad \mu k_n \delta v\, e + k_t \psi e_\perp, \quad
!>    k_t (\delta u - \delta w) $$
!>
!> of a contact that is open (and -k_n dv along its normal), slips along one tangent, slips along two
!> (`attrito_stability_slip_perturbation`), or sticks: a slider that rests is a constant force. Only slip along two tangents has
!> coefficients that vary in time.
!>
!> High modes may follow at rest (`attrito_stability_reduced`): d = B p - R g. With g_k = G d_k + what lower orders leave, the
!> displacements of each order solve (1 + R G) d_k = B p_k - R (...).
module attrito_stability_segment_flow
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_stability_perturbation, only: perturbation_type
  use attrito_stability_reduced, only: reduced_type
  use attrito_stability_slip_perturbation, only: slip_perturbation_type, new_slip_perturbation
  use attrito_stability_smooth_segments, only: smooth_segment_type
  implicit none
  private
  public :: segment_flow_type, new_segment_flow, step_on, displacements_of

  !> Most terms; with steps as short as they are rounding is reached well before
  integer, parameter :: most_terms = 60 ! conventional
  !> Part of a column that a term must be to matter
  real(wp), parameter :: rounding = 1.0e-2_wp*epsilon(1.0_wp) ! derived

  type :: segment_flow_type
    !> Rows of contacts that slip or open, where those of each begin among them (0: it sticks) [contacts], those that have a force
    integer, allocatable :: active(:), first(:), forced(:)
    !> Rows of tangents that stick, their contacts and which of the tangents
    integer, allocatable :: held(:), owner(:), component(:)
    !> B Phi of the active rows [m, active], accelerations by forces of rows that have one and by those of sliders [m, ...]
    real(wp), allocatable :: output_map(:, :), input_map(:, :), held_map(:, :)
    !> G of all but directions of slip [active, active]; (1 + R G)^{-1} [active, active] unless all modes are kept
    real(wp), allocatable :: stiffness(:, :), inverse(:, :)
  end type segment_flow_type

contains

  !> What contacts add on a segment.
  function new_segment_flow(reduced, segment) result(self)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    type(segment_flow_type) :: self
    integer :: i, a, n

    allocate (self%active(0), self%forced(0), self%held(0), self%owner(0), self%component(0))
    allocate (self%first(size(segment%regime)), source=0)
    do i = 1, size(segment%regime)
      associate (law => reduced%system%law(i))
        n = law%tangents
        if (segment%regime(i) == regime_stick) then
          self%held = [self%held, (law%first_row + a, a=0, n - 1)]
          self%owner = [self%owner, spread(i, 1, n)]
          self%component = [self%component, (a, a=1, n)]
        else
          self%first(i) = size(self%active) + 1
          self%active = [self%active, (law%first_row + a, a=0, n)]
          self%forced = [self%forced, (self%first(i) + a, a=0, merge(n - 1, n, segment%regime(i) == regime_slip))]
        end if
      end associate
    end do
    associate (system => reduced%system)
      self%output_map = system%rows(:, self%active)
      self%input_map = system%input_map(:, self%active(self%forced))
      self%held_map = system%input_map(:, self%held)
    end associate
    self%stiffness = stiffness_of(self, reduced, segment, segment%direction)
    if (reduced%has_rest .and. size(segment%slips) == 0) self%inverse = inverse_of(self, reduced, self%stiffness)
  end function new_segment_flow

  !> G of all but changes of directions of slip [active, active].
  pure function stiffness_of(self, reduced, segment, directions) result(stiffness)
    type(segment_flow_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> Of slip [2, contacts]
    real(wp), intent(in) :: directions(:, :)
    real(wp) :: stiffness(size(self%active), size(self%active))
    integer :: i, a, v

    stiffness = 0.0_wp
    do i = 1, size(segment%regime)
      if (self%first(i) == 0) cycle
      associate (law => reduced%system%law(i))
        v = self%first(i) + law%tangents
        do a = 1, law%tangents
          associate (row => self%first(i) + a - 1)
            stiffness(row, row) = -law%tangential_stiffness
            if (segment%regime(i) == regime_slip) stiffness(row, v) = directions(a, i)*law%friction_coefficient*law%normal_stiffness
          end associate
        end do
        if (segment%regime(i) == regime_open) stiffness(v, v) = -law%normal_stiffness
      end associate
    end do
  end function stiffness_of

  !> (1 + R G)^{-1}.
  function inverse_of(self, reduced, stiffness) result(inverse)
    type(segment_flow_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> G
    real(wp), intent(in) :: stiffness(:, :)
    real(wp) :: inverse(size(self%active), size(self%active)), matrix(size(self%active), size(self%active))
    integer :: i, info

    matrix = matmul(reduced%residual(self%active, self%active), stiffness)
    inverse = 0.0_wp
    do i = 1, size(matrix, 1)
      matrix(i, i) = matrix(i, i) + 1.0_wp
      inverse(i, i) = 1.0_wp
    end do
    call solve_dense(matrix, inverse, info)
  end function inverse_of

  !> Forces of sliders that rest, -k_t dw [held, columns].
  pure function slider_forces(self, reduced, now) result(forces)
    type(segment_flow_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    real(wp) :: forces(size(self%held), size(now%motion, 2))
    integer :: i

    do i = 1, size(self%held)
      forces(i, :) = -reduced%system%law(self%owner(i))%tangential_stiffness*now%slider(self%owner(i), :, self%component(i))
    end do
  end function slider_forces

  !> One step of the series, p_{k+2} = (-Lambda p_k - (k + 1) D p_{k+1} - Phi^T B^T g_k)/((k + 1)(k + 2)) by powers of x, until its
  !> terms are below rounding.
  subroutine step_on(self, reduced, segment, part, h, now)
    type(segment_flow_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> Where the step begins and ends in the segment, of 1, if directions of slip turn; its length in units of the clock
    real(wp), intent(in) :: part(2), h
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    type(slip_perturbation_type) :: slips(size(segment%slips))
    real(wp), dimension(size(now%motion, 1), size(now%motion, 2)) :: term, next, after
    real(wp) :: displacement(size(self%active), size(now%motion, 2)), force(size(self%active), size(now%motion, 2))
    real(wp) :: scale(size(now%motion, 2)), last(size(now%motion, 2)), held(size(self%held), size(now%motion, 2))
    integer :: k, s

    do s = 1, size(slips)
      associate (contact => segment%slips(s)%contact)
        slips(s) = new_slip_perturbation(reduced%system%law(contact), segment%slips(s), part, now%angle(contact, :), most_terms)
      end associate
    end do
    held = slider_forces(self, reduced, now)
    associate (system => reduced%system)
      term = now%motion
      next = h*now%rate
      now%motion = term + next
      now%rate = next
      scale = max(maxval(abs(term), 1), maxval(abs(next), 1))
      do k = 0, most_terms
        displacement = matmul(transpose(self%output_map), term)
        if (k == 0 .and. reduced%has_rest) displacement = displacement - matmul(reduced%residual(self%active, self%held), held)
        do s = 1, size(slips)
          if (.not. slips(s)%small) cycle
          associate (rows => system%rows(:, self%active(self%first(slips(s)%contact)):self%active(self%first(slips(s)%contact)) + 2))
            call slips(s)%follow(k, matmul(transpose(rows), term), matmul(transpose(rows), next))
          end associate
        end do
        call respond(self, reduced, slips, k, displacement, force)
        after = -matmul(self%input_map, force(self%forced, :)) - spread(system%eigenvalues, 2, size(scale))*term
        if (k == 0) after = after - matmul(self%held_map, held)
        after = h**2*after - (h*(k + 1))*spread(system%damping, 2, size(scale))*next
        if (allocated(system%coupling)) after = after - (h*(k + 1))*matmul(system%coupling, next)
        after = after/((k + 1)*(k + 2))
        term = next
        next = after
        now%motion = now%motion + next
        now%rate = now%rate + (k + 2)*next
        last = max(maxval(abs(term), 1), maxval(abs(next), 1))
        scale = max(scale, last)
        if (all(last <= rounding*scale) .and. have_ended(slips, k)) exit
      end do
      now%rate = now%rate/h
    end associate
    do s = 1, size(slips)
      now%angle(slips(s)%contact, :) = sum(slips(s)%psi, 2)
    end do
  end subroutine step_on

  !> Displacements and forces of order k of the active rows; displacements come in as they are without forces.
  subroutine respond(self, reduced, slips, k, displacement, force)
    type(segment_flow_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Contacts that slip along two tangents
    type(slip_perturbation_type), intent(inout) :: slips(:)
    !> Order
    integer, intent(in) :: k
    !> [active, columns]
    real(wp), intent(inout) :: displacement(:, :)
    real(wp), intent(out) :: force(:, :)
    real(wp), allocatable :: stiffness(:, :)
    real(wp) :: known(size(displacement, 2), 2)
    integer :: s, a, b

    if (size(slips) == 0) then
      if (allocated(self%inverse)) displacement = matmul(self%inverse, displacement)
      force = matmul(self%stiffness, displacement)
      return
    end if
    stiffness = self%stiffness
    force = 0.0_wp
    do s = 1, size(slips)
      associate (slip => slips(s), first => self%first(slips(s)%contact))
        call slip%known_force(k, known)
        force(first:first + 1, :) = transpose(known)
        do a = 1, 2
          stiffness(first + a - 1, first + 2) = slip%friction*slip%e(0, a)
          do b = 1, 2
            associate (entry => stiffness(first + a - 1, first + b - 1))
              entry = entry + slip%stiffness*slip%coefficient(k)*slip%across(0, a)*slip%across(0, b)
            end associate
          end do
        end do
      end associate
    end do
    if (reduced%has_rest) displacement = matmul(inverse_of(self, reduced, stiffness), &
      displacement - matmul(reduced%residual(self%active, self%active), force))
    force = force + matmul(stiffness, displacement)
    do s = 1, size(slips)
      associate (first => self%first(slips(s)%contact))
        call slips(s)%add(k, displacement(first:first + 2, :))
      end associate
    end do
  end subroutine respond

  !> Are the last terms of all directions rounding?
  pure logical function have_ended(slips, k)
    !> Contacts that slip along two tangents
    type(slip_perturbation_type), intent(in) :: slips(:)
    !> Order
    integer, intent(in) :: k
    integer :: s

    have_ended = .true.
    do s = 1, size(slips)
      associate (psi => slips(s)%psi)
        have_ended = have_ended .and. k > 1 .and. all(abs(psi(:, k)) <= rounding*maxval(abs(psi), 2))
      end associate
    end do
  end function have_ended

  !> Displacements of some rows at the end of the segment [rows, columns].
  function displacements_of(self, reduced, segment, rows, now) result(d)
    type(segment_flow_type), intent(in) :: self
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Segment of the orbit
    type(smooth_segment_type), intent(in) :: segment
    !> Numbers of the rows
    integer, intent(in) :: rows(:)
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    real(wp) :: d(size(rows), size(now%motion, 2))
    real(wp), dimension(size(self%active), size(now%motion, 2)) :: displacement, force
    real(wp) :: stiffness(size(self%active), size(self%active)), held(size(self%held), size(now%motion, 2))
    integer :: s

    d = matmul(transpose(reduced%system%rows(:, rows)), now%motion)
    associate (r => reduced%residual)
      if (.not. reduced%has_rest) return
      held = slider_forces(self, reduced, now)
      stiffness = stiffness_of(self, reduced, segment, segment%to)
      force = 0.0_wp
      do s = 1, size(segment%slips)
        associate (i => segment%slips(s)%contact)
          force(self%first(i), :) = -reduced%system%law(i)%tangential_stiffness*segment%to(2, i)*now%angle(i, :)
          force(self%first(i) + 1, :) = reduced%system%law(i)%tangential_stiffness*segment%to(1, i)*now%angle(i, :)
        end associate
      end do
      displacement = matmul(transpose(self%output_map), now%motion) - matmul(r(self%active, self%held), held) &
                     - matmul(r(self%active, self%active), force)
      force = force + matmul(stiffness, matmul(inverse_of(self, reduced, stiffness), displacement))
      d = d - matmul(r(rows, self%active), force) - matmul(r(rows, self%held), held)
    end associate
  end function displacements_of
end module attrito_stability_segment_flow
