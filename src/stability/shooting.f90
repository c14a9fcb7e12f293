!> The periodic motion in time near a state: Newton's method on the period map, its derivative the monodromy matrix,
!>
!> $$ z \leftarrow z - (M(z) - 1)^{-1} (P(z) - z), \qquad z = (p, p', \text{memory}). $$
!>
!> Unstable orbits are found like stable ones. M is kept while steps shrink to a part of the one before and contacts remember the
!> same.
!> Of many modes the lowest are in M, and the others go where the period leaves them. Sliders of contacts that stick throughout go
!> there, too; those of contacts that slip or are open where the period begins follow the motion.
module attrito_stability_shooting
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: regime_slip, regime_open
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type, place_on_law => settle
  use attrito_integrate_system, only: system_type
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_perturbation, only: memory_type, same_memory
  use attrito_stability_reduced, only: reduce_to
  implicit none
  private
  public :: shoot, march_until_settled

  !> Most Newton steps
  integer, parameter :: most_steps = 30 ! conventional
  !> Change of the state that counts as none, relative to the motion
  real(wp), parameter :: settled = 1.0e-12_wp ! derived
  !> Modes in the monodromy that Newton's method takes, at most
  integer, parameter :: most_modes = 100 ! conventional
  !> Part to which a step shrinks while the monodromy is not made again
  real(wp), parameter :: shrinks = 0.1_wp ! guess
  !> Part of its radius by which a slider that slips is put beyond it
  real(wp), parameter :: beyond = 1.0e-10_wp ! derived
  !> Periods after which motion in time is taken to have settled; change over a period, part of the motion, of one that has
  integer, parameter :: periods_to_settle = 100 ! guess
  real(wp), parameter :: settled_motion = 1.0e-6_wp ! guess

contains

  !> Find the orbit from a state near it.
  subroutine shoot(system, loading, start, orbit, found)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Where the search starts, then where the orbit's period starts
    type(state_type), intent(inout) :: start
    !> The orbit
    type(orbit_type), intent(inout) :: orbit
    !> Is there an orbit?
    logical, intent(out) :: found
    type(memory_type), allocatable :: memory(:)
    real(wp), allocatable :: inverse(:, :), step(:)
    integer, allocatable :: rows(:)
    type(state_type) :: end
    real(wp) :: range, change, before
    integer :: iteration, m, modes, i

    m = size(start%motion)
    modes = min(m, most_modes)
    allocate (memory(0))
    change = huge(1.0_wp)
    before = 0.0_wp
    do iteration = 1, most_steps
      end = start
      call orbit%march(system, loading, end, range, found)
      if (.not. found) return
      if (.not. change <= shrinks*before .or. .not. same_memory(memory, orbit%memory)) then
        memory = orbit%memory
        rows = [(i, i=1, modes), (m + i, i=1, modes), (2*m + i, i=1, size(memory))]
        call invert(orbit%monodromy(reduce_to(system, modes)), inverse, found)
        if (.not. found) return
      end if
      before = merge(change, 0.0_wp, iteration > 1)
      step = change_of_state(system, memory, start, end)
      step(rows) = -matmul(inverse, step(rows))
      change = norm2(step(:2*m))
      found = change <= settled*range
      if (found .or. .not. change <= 1.0e3_wp*range) return
      call move(system, orbit, step, end, start)
    end do
  end subroutine shoot

  !> (M - 1)^{-1}.
  subroutine invert(monodromy, inverse, found)
    !> M
    real(wp), intent(in) :: monodromy(:, :)
    !> Of M less the identity
    real(wp), allocatable, intent(out) :: inverse(:, :)
    !> Is there one?
    logical, intent(out) :: found
    real(wp), allocatable :: matrix(:, :)
    integer :: i, info

    matrix = monodromy
    allocate (inverse, source=0.0_wp*monodromy)
    do i = 1, size(matrix, 1)
      matrix(i, i) = matrix(i, i) - 1.0_wp
      inverse(i, i) = 1.0_wp
    end do
    call solve_dense(matrix, inverse, info)
    found = info == 0
  end subroutine invert

  !> What a period changes of motion, rate and memory.
  pure function change_of_state(system, memory, start, end) result(change)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: memory(:)
    !> Where the period starts; where it ends
    type(state_type), intent(in) :: start, end
    real(wp) :: change(2*size(start%motion) + size(memory)), from(2), to(2)
    integer :: i, m

    m = size(start%motion)
    change(:m) = end%motion - start%motion
    change(m + 1:2*m) = end%rate - start%rate
    do i = 1, size(memory)
      associate (contact => memory(i)%contact, component => memory(i)%component)
        if (component > 0) then
          change(2*m + i) = end%slider(component, contact) - start%slider(component, contact)
        else
          from = reach(system, start, contact)
          to = reach(system, end, contact)
          change(2*m + i) = (from(1)*to(2) - from(2)*to(1))/max(norm2(to), tiny(1.0_wp))
        end if
      end associate
    end do
  end function change_of_state

  !> u - w of a contact.
  pure function reach(system, state, contact) result(z)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Number of the contact
    integer, intent(in) :: contact
    real(wp) :: z(2)

    z = 0.0_wp
    associate (row => system%law(contact)%first_row, n => system%law(contact)%tangents)
      z(:n) = matmul(state%motion, system%rows(:, row:row + n - 1)) - state%slider(:n, contact)
    end associate
  end function reach

  !> The state moved by a step, contacts on their law: those that slip keep slipping, turned by what the step says.
  pure subroutine move(system, orbit, step, end, state)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> The period from the state
    type(orbit_type), intent(in) :: orbit
    !> Of motion, rate and memory
    real(wp), intent(in) :: step(:)
    !> Where the period ends
    type(state_type), intent(in) :: end
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    real(wp) :: z(2, size(system%law)), displacement(size(system%springs)), radius
    integer :: i, m, n

    m = size(state%motion)
    do i = 1, size(system%law)
      z(:, i) = reach(system, state, i)
      if (orbit%stuck(i)) state%slider(:, i) = end%slider(:, i)
    end do
    state%motion = state%motion + step(:m)
    state%rate = state%rate + step(m + 1:2*m)
    do i = 1, size(orbit%memory)
      associate (contact => orbit%memory(i)%contact, component => orbit%memory(i)%component, change => step(2*m + i))
        if (component > 0) then
          state%slider(component, contact) = state%slider(component, contact) + change
        else
          z(:, contact) = z(:, contact) + change/max(norm2(z(:, contact)), tiny(1.0_wp))*[-z(2, contact), z(1, contact)]
        end if
      end associate
    end do
    displacement = matmul(state%motion, system%rows)
    do i = 1, size(system%law)
      associate (law => system%law(i), row => system%law(i)%first_row)
        n = law%tangents
        if (orbit%regime(i) == regime_open) state%slider(:n, i) = displacement(row:row + n - 1)
        if (orbit%regime(i) /= regime_slip) cycle
        radius = law%friction_coefficient/law%tangential_stiffness*max(law%normal_force(displacement(row + n)), 0.0_wp)
        ! A little beyond the rim: the law puts it back and knows that it slips.
        state%slider(:n, i) = displacement(row:row + n - 1) - (1.0_wp + beyond)*radius*z(:n, i)/max(norm2(z(:, i)), tiny(1.0_wp))
      end associate
    end do
    call place_on_law(system, state)
  end subroutine move

  !> March until a period changes the motion by hardly anything, if it ever does.
  subroutine march_until_settled(system, loading, orbit, state)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> The last period
    type(orbit_type), intent(inout) :: orbit
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    type(state_type) :: before
    real(wp) :: range
    integer :: period
    logical :: converged

    do period = 1, periods_to_settle
      before = state
      call orbit%march(system, loading, state, range, converged)
      if (.not. converged) return
      if (hypot(norm2(state%motion - before%motion), norm2(state%rate - before%rate)) <= settled_motion*range) return
    end do
  end subroutine march_until_settled
end module attrito_stability_shooting
