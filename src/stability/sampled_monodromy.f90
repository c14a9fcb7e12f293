!> The linearised flow over a period of a sampled orbit, whose contacts may slip along two tangents.
!>
!> $$ \delta p'' + D \delta p' + \Lambda \delta p = - \Phi^T B^T \delta g, \qquad \delta T = \mu k_n \delta v\, e + k_t r\, \delta e
!>    \;\text{(slip)}, \quad k_t (\delta u - \delta w) \;\text{(stick)}, \quad 0 \;\text{(open)} $$
!>
!> e turns with u by e' = (u' - (e . u') e)/r; its perturbation, an angle, is carried by the exact derivative of the step that
!> carries e. Modes are carried exactly under forces that are linear over a step, the forces at its end by one linear solve for the
!> contacts that do not stick. Steps end at switches, for these forces jump there:
!>
!>   slip begins:  r d(angle) = e_across . (du - dw),     slip ends:  dw = du - (mu kn/kt) dv e - r d(angle) e_across,
!>   landing:      dw = du - (u'/v') dv, or, if it slips at once, along du' by the step itself.
!>
!> High modes may follow at rest (`attrito_stability_reduced`): displacements are then d = B p - R g, at both ends of a step.
!>
!> Of second order in the samples: polygons in e, and forces that are linear over steps; places of switches are better than that.
module attrito_stability_sampled_monodromy
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_exponential, only: exponential_weights
  use attrito_integrate_system, only: system_type
  use attrito_stability_reduced, only: reduced_type
  use attrito_stability_sampled_orbit, only: sampled_orbit_type
  implicit none
  private
  public :: sampled_monodromy, memory_type, memory_of

  !> Of motion and rate [m, columns], sliders that stick [2, contacts, columns], angles of slip times their radius [contacts,
  !> columns], and displacements of active rows at the end of the step before [rows, columns]
  type :: perturbation_type
    real(wp), allocatable :: motion(:, :), rate(:, :), slider(:, :, :), angle(:, :), displacement(:, :)
  end type perturbation_type

  !> A number that a contact remembers where the period begins: a component of its slider (1, 2), or its direction of slip (0)
  type :: memory_type
    integer :: contact = 0, component = 0
  end type memory_type

  !> Contacts that do not stick throughout: their rows, those of B Phi and the accelerations that their forces make [m, rows], the
  !> compliance of high modes R [rows, rows], and where each contact's begin among them, 0 where it sticks [contacts]
  type :: active_type
    real(wp), allocatable :: output_map(:, :), input_map(:, :), residual(:, :)
    integer, allocatable :: first(:)
  end type active_type

  !> g of the active rows, stiffness d + constant: [rows, rows], [rows, columns]
  type :: forces_type
    real(wp), allocatable :: stiffness(:, :), constant(:, :)
  end type forces_type

contains

  !> What contacts that slip or open in the period remember where it begins.
  pure function memory_of(system, orbit) result(memory)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    type(memory_type), allocatable :: memory(:)
    integer :: i, a

    allocate (memory(0))
    do i = 1, size(orbit%stuck)
      if (orbit%stuck(i)) cycle
      if (orbit%regime(i, 1) == regime_stick) memory = [memory, (memory_type(i, a), a=1, system%law(i)%tangents)]
      if (orbit%regime(i, 1) == regime_slip .and. system%law(i)%tangents > 1) memory = [memory, memory_type(i, 0)]
    end do
  end function memory_of

  !> What a unit change of each of (motion [m], rate by the clock [m], memory) becomes in a period.
  function sampled_monodromy(reduced, orbit, period) result(matrix)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    real(wp), allocatable :: matrix(:, :)
    type(memory_type), allocatable :: memory(:)
    type(perturbation_type) :: now
    type(active_type) :: active
    real(wp) :: weights(4, 2, size(reduced%system%eigenvalues)), h, h_of_weights
    integer :: m, n, i, step

    associate (system => reduced%system)
      memory = memory_of(system, orbit)
      m = size(system%eigenvalues)
      n = 2*m + size(memory)
      now = unit_perturbations(m, size(orbit%stuck), memory)
      active = active_of(reduced, orbit)
      h_of_weights = 0.0_wp
      do step = 1, size(orbit%regime, 2)
        if (step > 1) call change_regimes(system, orbit, step - 1, step, active, now)
        h = period*(orbit%times(step) - orbit%times(step - 1))
        if (abs(h - h_of_weights) > 1.0e-12_wp*h) then
          weights = exponential_weights(system%eigenvalues, system%damping, h)
          h_of_weights = h
        end if
        call step_on(system, orbit, step, active, weights, now)
      end do
      call change_regimes(system, orbit, size(orbit%regime, 2), 1, active, now)
    end associate
    allocate (matrix(n, n))
    matrix(:m, :) = now%motion
    matrix(m + 1:2*m, :) = now%rate
    do i = 1, size(memory)
      if (memory(i)%component > 0) matrix(2*m + i, :) = now%slider(memory(i)%component, memory(i)%contact, :)
      if (memory(i)%component == 0) matrix(2*m + i, :) = now%angle(memory(i)%contact, :)
    end do
  end function sampled_monodromy

  pure function unit_perturbations(m, contacts, memory) result(now)
    !> Number of coordinates; number of contacts
    integer, intent(in) :: m, contacts
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: memory(:)
    type(perturbation_type) :: now
    integer :: n, i

    n = 2*m + size(memory)
    allocate (now%motion(m, n), now%rate(m, n), now%slider(2, contacts, n), now%angle(contacts, n), source=0.0_wp)
    do i = 1, m
      now%motion(i, i) = 1.0_wp
      now%rate(i, m + i) = 1.0_wp
    end do
    do i = 1, size(memory)
      if (memory(i)%component > 0) now%slider(memory(i)%component, memory(i)%contact, 2*m + i) = 1.0_wp
      if (memory(i)%component == 0) now%angle(memory(i)%contact, 2*m + i) = 1.0_wp
    end do
  end function unit_perturbations

  pure function active_of(reduced, orbit) result(self)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    type(active_type) :: self
    integer, allocatable :: rows(:)
    integer :: i, a

    allocate (rows(0))
    allocate (self%first(size(orbit%stuck)), source=0)
    do i = 1, size(orbit%stuck)
      if (orbit%stuck(i)) cycle
      self%first(i) = size(rows) + 1
      associate (law => reduced%system%law(i))
        rows = [rows, (law%first_row + a, a=0, law%tangents)]
      end associate
    end do
    self%output_map = reduced%system%rows(:, rows)
    self%input_map = reduced%system%input_map(:, rows)
    self%residual = reduced%residual(rows, rows)
  end function active_of

  !> What contacts remember where they begin to do something else.
  subroutine change_regimes(system, orbit, before, after, active, now)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Steps
    integer, intent(in) :: before, after
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: du(2, size(now%motion, 2)), dv(size(now%motion, 2)), direction(2), across(2)
    integer :: i, a, n

    do i = 1, size(orbit%stuck)
      if (orbit%regime(i, before) == orbit%regime(i, after)) cycle
      associate (law => system%law(i), old => orbit%regime(i, before), new => orbit%regime(i, after))
        n = law%tangents
        du = 0.0_wp
        du(:n, :) = now%displacement(active%first(i):active%first(i) + n - 1, :)
        dv = now%displacement(active%first(i) + n, :)
        if (old == regime_stick .and. new == regime_slip) then
          direction = orbit%direction(:, i, after)
          across = [-direction(2), direction(1)]
          now%angle(i, :) = matmul(across, du - now%slider(:, i, :))
        else if (new == regime_stick .and. old == regime_slip) then
          direction = orbit%turned(i, before)%e
          across = [-direction(2), direction(1)]
          do a = 1, n
            now%slider(a, i, :) = du(a, :) - law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness*direction(a)*dv &
                                  - across(a)*now%angle(i, :)
          end do
        else if (new == regime_stick) then
          do a = 1, n
            now%slider(a, i, :) = du(a, :) - orbit%landing_slope(a, i, after)*dv
          end do
        else
          now%angle(i, :) = 0.0_wp
        end if
      end associate
    end do
  end subroutine change_regimes

  !> One step: forces at its beginning, the motion without those at its end, these, the motion.
  subroutine step_on(system, orbit, step, active, weights, now)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Number of the step
    integer, intent(in) :: step
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Weights
    real(wp), intent(in) :: weights(:, :, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    type(forces_type) :: forces
    real(wp), dimension(size(now%motion, 1), size(now%motion, 2)) :: before, after, free, rate
    real(wp), dimension(size(active%output_map, 2), size(now%motion, 2)) :: from, to
    real(wp) :: compliance(size(active%output_map, 2), size(active%output_map, 2))
    integer :: pass

    forces = forces_before(system, orbit, step, active, now)
    from = displacements(matmul(transpose(active%output_map), now%motion), active%residual, forces)
    before = -matmul(active%input_map, matmul(forces%stiffness, from) + forces%constant)
    if (allocated(system%coupling)) before = before - matmul(system%coupling, now%rate)
    forces = forces_after(system, orbit, step, active, from, now)
    compliance = matmul(transpose(active%output_map), spread(weights(4, 1, :), 2, size(from, 1))*active%input_map) + active%residual
    rate = now%rate
    do pass = 1, merge(3, 1, allocated(system%coupling))
      after = 0.0_wp
      if (allocated(system%coupling)) after = -matmul(system%coupling, rate)
      free = times(weights(1, 1, :), now%motion) + times(weights(2, 1, :), now%rate) + times(weights(3, 1, :), before) &
             + times(weights(4, 1, :), after)
      to = displacements(matmul(transpose(active%output_map), free), compliance, forces)
      after = after - matmul(active%input_map, matmul(forces%stiffness, to) + forces%constant)
      rate = times(weights(1, 2, :), now%motion) + times(weights(2, 2, :), now%rate) + times(weights(3, 2, :), before) &
             + times(weights(4, 2, :), after)
    end do
    call turn_directions(system, orbit, step, active, from, to, now)
    now%motion = free - matmul(spread(weights(4, 1, :), 2, size(from, 1))*active%input_map, &
                               matmul(forces%stiffness, to) + forces%constant)
    now%rate = rate
    now%displacement = to
  end subroutine step_on

  !> Of active rows, d = free - compliance g(d) [rows, columns].
  function displacements(free, compliance, forces) result(d)
    !> Displacements without forces; displacements by unit forces
    real(wp), intent(in) :: free(:, :), compliance(:, :)
    !> Forces of the active rows
    type(forces_type), intent(in) :: forces
    real(wp) :: d(size(free, 1), size(free, 2)), matrix(size(free, 1), size(free, 1))
    integer :: i, info

    matrix = matmul(compliance, forces%stiffness)
    do i = 1, size(matrix, 1)
      matrix(i, i) = matrix(i, i) + 1.0_wp
    end do
    d = free - matmul(compliance, forces%constant)
    call solve_dense(matrix, d, info)
  end function displacements

  !> Each row times its weight.
  pure function times(weight, matrix) result(product)
    !> Weight of each row; matrix that is weighted
    real(wp), intent(in) :: weight(:), matrix(:, :)
    real(wp) :: product(size(matrix, 1), size(matrix, 2))

    product = spread(weight, 2, size(matrix, 2))*matrix
  end function times

  !> Where a step begins.
  pure function forces_before(system, orbit, step, active, now) result(g)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Number of the step
    integer, intent(in) :: step
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    type(forces_type) :: g
    real(wp) :: across(2)
    integer :: i, a

    g = no_forces(active, now)
    do i = 1, size(active%first)
      if (active%first(i) == 0) cycle
      associate (law => system%law(i), v => active%first(i) + system%law(i)%tangents, e => orbit%direction(:, i, step))
        across = [-e(2), e(1)]
        if (orbit%regime(i, step) == regime_open) g%stiffness(v, v) = -law%normal_stiffness
        do a = 1, law%tangents
          associate (row => active%first(i) + a - 1)
            if (orbit%regime(i, step) == regime_stick) then
              g%constant(row, :) = -law%tangential_stiffness*now%slider(a, i, :)
            else
              g%stiffness(row, row) = -law%tangential_stiffness
            end if
            if (orbit%regime(i, step) /= regime_slip) cycle
            g%stiffness(row, v) = law%friction_coefficient*law%normal_stiffness*e(a)
            g%constant(row, :) = law%tangential_stiffness*across(a)*now%angle(i, :)
          end associate
        end do
      end associate
    end do
  end function forces_before

  !> Where a step ends.
  pure function forces_after(system, orbit, step, active, from, now) result(g)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Number of the step
    integer, intent(in) :: step
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Displacements of the active rows where it begins [rows, columns]
    real(wp), intent(in) :: from(:, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    type(forces_type) :: g
    real(wp) :: across(2), slope
    integer :: i, a, n

    g = no_forces(active, now)
    do i = 1, size(active%first)
      if (active%first(i) == 0) cycle
      n = system%law(i)%tangents
      associate (law => system%law(i), u => active%first(i), v => active%first(i) + n, turned => orbit%turned(i, step))
        if (orbit%regime(i, step) == regime_open) g%stiffness(v, v) = -law%normal_stiffness
        if (orbit%regime(i, step) == regime_slip) across = law%tangential_stiffness*turned%radius*[-turned%e(2), turned%e(1)]
        slope = law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness
        do a = 1, n
          associate (row => u + a - 1)
            if (orbit%regime(i, step) == regime_stick) then
              g%constant(row, :) = -law%tangential_stiffness*now%slider(a, i, :)
            else
              g%stiffness(row, row) = -law%tangential_stiffness
            end if
            if (orbit%regime(i, step) /= regime_slip) cycle
            g%constant(row, :) = across(a)*kept_angle(system, orbit, step, i, from(u:v, :), now)
            g%stiffness(row, u:v - 1) = g%stiffness(row, u:v - 1) + across(a)*turned%by_to(:n)
            g%stiffness(row, v) = law%tangential_stiffness*slope*turned%e(a) + across(a)*slope*turned%by_radii(2)
          end associate
        end do
      end associate
    end do
  end function forces_after

  pure function no_forces(active, now) result(g)
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    type(forces_type) :: g

    associate (rows => size(active%output_map, 2))
      allocate (g%stiffness(rows, rows), g%constant(rows, size(now%motion, 2)), source=0.0_wp)
    end associate
  end function no_forces

  !> What the direction at a step's end has of what was at its beginning: of the direction, displacements and radius [columns].
  pure function kept_angle(system, orbit, step, contact, from, now) result(angle)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Number of the step; number of the contact
    integer, intent(in) :: step, contact
    !> Of the contact's rows [rows, columns]
    real(wp), intent(in) :: from(:, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    real(wp) :: angle(size(from, 2)), kept
    integer :: n

    associate (law => system%law(contact), turned => orbit%turned(contact, step), e => orbit%direction(:, contact, step), &
               radius => orbit%radius(contact, step))
      n = law%tangents
      ! `by_slider` is by the angle at the beginning, against the turn.
      kept = -dot_product(turned%by_slider, [-e(2), e(1)])
      angle = matmul(turned%by_from(:n), from(:n, :)) + law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness &
              *turned%by_radii(1)*from(n + 1, :)
      if (abs(kept) > 0.0_wp) angle = angle + kept/radius*now%angle(contact, :)
    end associate
  end function kept_angle

  !> Directions of slip, as angles times radius, at the end of a step.
  pure subroutine turn_directions(system, orbit, step, active, from, to, now)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Number of the step
    integer, intent(in) :: step
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Displacements of the active rows at both ends [rows, columns]
    real(wp), intent(in) :: from(:, :), to(:, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: angle(size(from, 2))
    integer :: i, n

    do i = 1, size(active%first)
      if (active%first(i) == 0) cycle
      if (orbit%regime(i, step) /= regime_slip) cycle
      n = system%law(i)%tangents
      associate (law => system%law(i), u => active%first(i), v => active%first(i) + n, turned => orbit%turned(i, step))
        angle = kept_angle(system, orbit, step, i, from(u:v, :), now) + matmul(turned%by_to(:n), to(u:v - 1, :)) &
                + law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness*turned%by_radii(2)*to(v, :)
        now%angle(i, :) = turned%radius*angle
      end associate
    end do
  end subroutine turn_directions
end module attrito_stability_sampled_monodromy
