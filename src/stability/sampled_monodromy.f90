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
  use attrito_stability_perturbation, only: memory_type, perturbation_type, memory_of, unit_perturbations, matrix_of
  use attrito_stability_reduced, only: reduced_type
  use attrito_stability_sampled_steps, only: sampled_steps_type
  implicit none
  private
  public :: sampled_monodromy

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

  !> Part of the period that is rounding
  real(wp), parameter :: no_time = 1.0e-12_wp ! derived

contains

  !> What a unit change of each of (motion [m], rate by the clock [m], memory) becomes in a period, or in the first of several equal
  !> parts of it, which is to end with a step.
  function sampled_monodromy(reduced, steps, period, parts, kept) result(matrix)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
    !> In units of the clock
    real(wp), intent(in) :: period
    !> How many parts; what is remembered at the end of the first, as at the beginning unless given
    integer, intent(in), optional :: parts
    type(memory_type), intent(in), optional :: kept(:)
    real(wp), allocatable :: matrix(:, :)
    type(memory_type), allocatable :: memory(:)
    type(perturbation_type) :: now
    type(active_type) :: active
    real(wp), allocatable :: displacement(:, :)
    real(wp) :: weights(4, 2, size(reduced%system%eigenvalues)), h, h_of_weights
    integer :: step, last

    last = size(steps%regime, 2)
    if (present(parts)) last = count(steps%times(1:) <= 1.0_wp/parts + no_time)
    associate (system => reduced%system)
      memory = memory_of(system%law, steps%stuck, steps%regime(:, 1))
      now = unit_perturbations(size(system%eigenvalues), size(steps%stuck), memory)
      active = active_of(reduced, steps)
      h_of_weights = 0.0_wp
      do step = 1, last
        if (step > 1) call change_regimes(system, steps, step - 1, step, active, displacement, now)
        h = period*(steps%times(step) - steps%times(step - 1))
        if (abs(h - h_of_weights) > 1.0e-12_wp*h) then
          weights = exponential_weights(system%eigenvalues, system%damping, h)
          h_of_weights = h
        end if
        call step_on(system, steps, step, active, weights, now, displacement)
      end do
      call change_regimes(system, steps, last, modulo(last, size(steps%regime, 2)) + 1, active, displacement, now)
    end associate
    if (present(kept)) memory = kept
    matrix = matrix_of(now, memory)
  end function sampled_monodromy

  pure function active_of(reduced, steps) result(self)
    !> Modes on which stability is examined
    type(reduced_type), intent(in) :: reduced
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
    type(active_type) :: self
    integer, allocatable :: rows(:)
    integer :: i, a

    allocate (rows(0))
    allocate (self%first(size(steps%stuck)), source=0)
    do i = 1, size(steps%stuck)
      if (steps%stuck(i)) cycle
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
  subroutine change_regimes(system, steps, before, after, active, displacement, now)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
    !> Steps
    integer, intent(in) :: before, after
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Displacements of their rows at the present instant [rows, columns]
    real(wp), intent(in) :: displacement(:, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    real(wp) :: du(2, size(now%motion, 2)), dv(size(now%motion, 2)), direction(2), across(2)
    integer :: i, a, n

    do i = 1, size(steps%stuck)
      if (steps%regime(i, before) == steps%regime(i, after)) cycle
      associate (law => system%law(i), old => steps%regime(i, before), new => steps%regime(i, after))
        n = law%tangents
        du = 0.0_wp
        du(:n, :) = displacement(active%first(i):active%first(i) + n - 1, :)
        dv = displacement(active%first(i) + n, :)
        if (old == regime_stick .and. new == regime_slip) then
          direction = steps%direction(:, i, after)
          across = [-direction(2), direction(1)]
          now%angle(i, :) = matmul(across, du - transpose(now%slider(i, :, :)))
        else if (new == regime_stick .and. old == regime_slip) then
          direction = steps%turned(i, before)%e
          across = [-direction(2), direction(1)]
          do a = 1, n
            now%slider(i, :, a) = du(a, :) - law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness*direction(a)*dv &
                                  - across(a)*now%angle(i, :)
          end do
        else if (new == regime_stick) then
          do a = 1, n
            now%slider(i, :, a) = du(a, :) - steps%landing_slope(a, i, after)*dv
          end do
        else
          now%angle(i, :) = 0.0_wp
        end if
      end associate
    end do
  end subroutine change_regimes

  !> One step: forces at its beginning, the motion without those at its end, these, the motion.
  subroutine step_on(system, steps, step, active, weights, now, to)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
    !> Number of the step
    integer, intent(in) :: step
    !> Contacts that do not stick throughout
    type(active_type), intent(in) :: active
    !> Weights
    real(wp), intent(in) :: weights(:, :, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(inout) :: now
    !> Displacements of the active rows at the step's end [rows, columns]
    real(wp), allocatable, intent(out) :: to(:, :)
    type(forces_type) :: forces
    real(wp), dimension(size(now%motion, 1), size(now%motion, 2)) :: before, after, free, rate
    real(wp) :: from(size(active%output_map, 2), size(now%motion, 2))
    real(wp) :: compliance(size(active%output_map, 2), size(active%output_map, 2))
    integer :: pass

    forces = forces_before(system, steps, step, active, now)
    from = displacements(matmul(transpose(active%output_map), now%motion), active%residual, forces)
    before = -matmul(active%input_map, matmul(forces%stiffness, from) + forces%constant)
    if (allocated(system%coupling)) before = before - matmul(system%coupling, now%rate)
    forces = forces_after(system, steps, step, active, from, now)
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
    call turn_directions(system, steps, step, active, from, to, now)
    now%motion = free - matmul(spread(weights(4, 1, :), 2, size(from, 1))*active%input_map, &
                               matmul(forces%stiffness, to) + forces%constant)
    now%rate = rate
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
  pure function forces_before(system, steps, step, active, now) result(g)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
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
      associate (law => system%law(i), v => active%first(i) + system%law(i)%tangents, e => steps%direction(:, i, step))
        across = [-e(2), e(1)]
        if (steps%regime(i, step) == regime_open) g%stiffness(v, v) = -law%normal_stiffness
        do a = 1, law%tangents
          associate (row => active%first(i) + a - 1)
            if (steps%regime(i, step) == regime_stick) then
              g%constant(row, :) = -law%tangential_stiffness*now%slider(i, :, a)
            else
              g%stiffness(row, row) = -law%tangential_stiffness
            end if
            if (steps%regime(i, step) /= regime_slip) cycle
            g%stiffness(row, v) = law%friction_coefficient*law%normal_stiffness*e(a)
            g%constant(row, :) = law%tangential_stiffness*across(a)*now%angle(i, :)
          end associate
        end do
      end associate
    end do
  end function forces_before

  !> Where a step ends.
  pure function forces_after(system, steps, step, active, from, now) result(g)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
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
      associate (law => system%law(i), u => active%first(i), v => active%first(i) + n, turned => steps%turned(i, step))
        if (steps%regime(i, step) == regime_open) g%stiffness(v, v) = -law%normal_stiffness
        if (steps%regime(i, step) == regime_slip) across = law%tangential_stiffness*turned%radius*[-turned%e(2), turned%e(1)]
        slope = law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness
        do a = 1, n
          associate (row => u + a - 1)
            if (steps%regime(i, step) == regime_stick) then
              g%constant(row, :) = -law%tangential_stiffness*now%slider(i, :, a)
            else
              g%stiffness(row, row) = -law%tangential_stiffness
            end if
            if (steps%regime(i, step) /= regime_slip) cycle
            g%constant(row, :) = across(a)*kept_angle(system, steps, step, i, from(u:v, :), now)
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
  pure function kept_angle(system, steps, step, contact, from, now) result(angle)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
    !> Number of the step; number of the contact
    integer, intent(in) :: step, contact
    !> Of the contact's rows [rows, columns]
    real(wp), intent(in) :: from(:, :)
    !> Perturbations at the present instant
    type(perturbation_type), intent(in) :: now
    real(wp) :: angle(size(from, 2)), kept
    integer :: n

    associate (law => system%law(contact), turned => steps%turned(contact, step), e => steps%direction(:, contact, step), &
               radius => steps%radius(contact, step))
      n = law%tangents
      ! `by_slider` is by the angle at the beginning, against the turn.
      kept = -dot_product(turned%by_slider, [-e(2), e(1)])
      angle = matmul(turned%by_from(:n), from(:n, :)) + law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness &
              *turned%by_radii(1)*from(n + 1, :)
      if (abs(kept) > 0.0_wp) angle = angle + kept/radius*now%angle(contact, :)
    end associate
  end function kept_angle

  !> Directions of slip, as angles times radius, at the end of a step.
  pure subroutine turn_directions(system, steps, step, active, from, to, now)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> What contacts do on the steps of a period
    type(sampled_steps_type), intent(in) :: steps
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
      if (steps%regime(i, step) /= regime_slip) cycle
      n = system%law(i)%tangents
      associate (law => system%law(i), u => active%first(i), v => active%first(i) + n, turned => steps%turned(i, step))
        angle = kept_angle(system, steps, step, i, from(u:v, :), now) + matmul(turned%by_to(:n), to(u:v - 1, :)) &
                + law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness*turned%by_radii(2)*to(v, :)
        now%angle(i, :) = turned%radius*angle
      end associate
    end do
  end subroutine turn_directions
end module attrito_stability_sampled_monodromy
