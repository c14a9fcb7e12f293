!> The periodic orbit of motion in time near a balance's, of contacts with one or two tangents: Newton's method on the period map of
!> the exponential scheme,
!>
!> $$ z \leftarrow z - (M(z) - 1)^{-1} (P(z) - z), \qquad z = (p, p', \text{memory}), $$
!>
!> with the monodromy of the sampled motion for its derivative. The map of a scheme with steps of fixed length has a derivative that
!> differs from it by a part that shrinks with the steps, since its forces jump at steps and not where contacts switch; so Newton's
!> method gains a constant factor a step, and the orbit it comes to is of second order in the steps. Of many modes the lowest are in
!> M, and the others go where the period leaves them.
module attrito_stability_sampled_shooting
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_state, only: regime_slip, regime_open
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_schemes, only: scheme_type, new_scheme, start_scheme, step_scheme, scheme_exponential
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_reduced, only: reduce_to
  use attrito_stability_sampled_monodromy, only: sampled_monodromy, memory_type, memory_of
  use attrito_stability_sampled_motion, only: sampled_motion_type
  use attrito_stability_sampled_orbit, only: sampled_orbit_type, new_sampled_orbit
  implicit none
  private
  public :: shoot_sampled, settle_sampled, march_samples

  !> Most Newton steps, and the change that counts as none, relative to the motion
  integer, parameter :: most_steps = 30 ! conventional
  real(wp), parameter :: settled = 1.0e-9_wp ! derived
  !> Modes in the monodromy that Newton's method takes, at most
  integer, parameter :: most_modes = 100 ! conventional
  !> Periods after which motion in time is taken to have settled
  integer, parameter :: periods_to_settle = 100 ! guess
  !> Part of its radius by which a slider that slips is put beyond it
  real(wp), parameter :: beyond = 1.0e-10_wp ! derived

contains

  !> Find the orbit from a state near it, in so many steps a period.
  subroutine shoot_sampled(system, loading, steps, start, motion, moved, found)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Number of steps
    integer, intent(in) :: steps
    !> Where the search starts, then where the orbit's period starts
    type(state_type), intent(inout) :: start
    !> Of the contacts over the orbit's period
    type(sampled_motion_type), intent(out) :: motion
    !> How far from where it started, relative to the motion's half range over the period
    real(wp), intent(out) :: moved
    !> Is there an orbit?
    logical, intent(out) :: found
    type(state_type) :: first, end
    type(sampled_orbit_type) :: orbit
    real(wp), allocatable :: matrix(:, :), step(:, :), full(:)
    integer, allocatable :: rows(:)
    real(wp) :: range
    integer :: iteration, i, info, m, modes

    first = start
    m = size(start%motion)
    modes = min(m, most_modes)
    moved = 0.0_wp
    do iteration = 1, most_steps
      end = start
      call march_samples(system, loading, steps, end, motion, range, found)
      if (.not. found) return
      call new_sampled_orbit(system%law, motion, end%slider, orbit)
      matrix = sampled_monodromy(reduce_to(system, modes), orbit, loading%period)
      do i = 1, size(matrix, 1)
        matrix(i, i) = matrix(i, i) - 1.0_wp
      end do
      full = residual(system, memory_of(system, orbit), start, end)
      rows = [(i, i=1, modes), (m + i, i=1, modes), (2*m + i, i=1, size(full) - 2*m)]
      step = reshape(-full(rows), [size(rows), 1])
      call solve_dense(matrix, step, info)
      found = info == 0
      if (.not. found) return
      full(rows) = step(:, 1)
      found = norm2(full(:2*m)) <= settled*range
      moved = norm2(start%motion - first%motion)/range
      if (found .or. .not. norm2(full(:2*m)) <= 1.0e3_wp*range) return
      call move(system, orbit, memory_of(system, orbit), full, end, start)
    end do
  end subroutine shoot_sampled

  !> March until motion in time has settled, if it does.
  subroutine settle_sampled(system, loading, steps, state)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Number of steps
    integer, intent(in) :: steps
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    type(state_type) :: before
    type(sampled_motion_type) :: motion
    real(wp) :: range
    integer :: period
    logical :: converged

    do period = 1, periods_to_settle
      before = state
      call march_samples(system, loading, steps, state, motion, range, converged)
      if (.not. converged) return
      if (norm2(state%motion - before%motion) <= settled*range) return
    end do
  end subroutine settle_sampled

  !> March one period of exponential steps, and sample the contacts' motion at each.
  subroutine march_samples(system, loading, steps, state, motion, range, converged, trajectory)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Number of steps
    integer, intent(in) :: steps
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Motion of the contacts at the samples of a period
    type(sampled_motion_type), intent(out) :: motion
    !> Half range of the motion over the period, in the norm of the mass matrix
    real(wp), intent(out) :: range
    !> Did the solve converge?
    logical, intent(out) :: converged
    !> Modal displacement where steps begin [m, 0:steps - 1]
    real(wp), intent(out), optional :: trajectory(:, 0:)
    type(scheme_type) :: scheme
    real(wp) :: low(size(state%motion)), high(size(state%motion))
    integer :: step

    call new_scheme(system, scheme_exponential, steps, loading%period, -1.0_wp, scheme)
    call start_scheme(scheme, system, loading, state)
    allocate (motion%displacement(0:steps, size(system%springs)), motion%rate(0:steps, size(system%springs)))
    low = state%motion
    high = state%motion
    do step = 0, steps
      if (step > 0) call step_scheme(scheme, system, loading, state, step/steps, modulo(step, steps)*scheme%h, converged)
      converged = all(abs(state%motion) < huge(1.0_wp)) .and. (step == 0 .or. converged)
      if (.not. converged) return
      motion%displacement(step, :) = matmul(state%motion, system%rows)
      motion%rate(step, :) = matmul(state%rate, system%rows)*scheme%h
      low = min(low, state%motion)
      high = max(high, state%motion)
      if (present(trajectory) .and. step < steps) trajectory(:, step) = state%motion
    end do
    range = 0.5_wp*norm2(high - low)
  end subroutine march_samples

  !> What a period changes of motion, rate and memory.
  pure function residual(system, memory, start, end) result(change)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: memory(:)
    !> Displacement, velocity and sliders at the start; displacement, velocity and sliders at the end
    type(state_type), intent(in) :: start, end
    real(wp) :: change(2*size(start%motion) + size(memory)), from(2), to(2)
    integer :: i, m

    m = size(start%motion)
    change(:m) = end%motion - start%motion
    change(m + 1:2*m) = end%rate - start%rate
    do i = 1, size(memory)
      associate (contact => memory(i)%contact)
        if (memory(i)%component > 0) then
          change(2*m + i) = end%slider(memory(i)%component, contact) - start%slider(memory(i)%component, contact)
        else
          from = reach(system, start, contact)
          to = reach(system, end, contact)
          change(2*m + i) = (from(1)*to(2) - from(2)*to(1))/max(norm2(to), tiny(1.0_wp))
        end if
      end associate
    end do
  end function residual

  !> u - w of a contact [tangents].
  pure function reach(system, state, contact) result(z)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Number of the contact
    integer, intent(in) :: contact
    real(wp), allocatable :: z(:)

    associate (row => system%law(contact)%first_row, n => system%law(contact)%tangents)
      z = matmul(state%motion, system%rows(:, row:row + n - 1)) - state%slider(:n, contact)
    end associate
  end function reach

  !> The state moved by a step, contacts on their law: those that slip keep slipping, turned by what the step says.
  pure subroutine move(system, orbit, memory, step, end, state)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: memory(:)
    !> Of motion, rate and memory
    real(wp), intent(in) :: step(:)
    !> Where the period from the state ends
    type(state_type), intent(in) :: end
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    real(wp) :: z(2, size(system%law)), displacement(size(system%springs)), radius
    integer :: i, m, n

    m = size(state%motion)
    z = 0.0_wp
    do i = 1, size(system%law)
      n = system%law(i)%tangents
      z(:n, i) = reach(system, state, i)
      if (orbit%stuck(i)) state%slider(:, i) = end%slider(:, i)
    end do
    state%motion = state%motion + step(:m)
    state%rate = state%rate + step(m + 1:2*m)
    do i = 1, size(memory)
      associate (contact => memory(i)%contact, change => step(2*m + i))
        if (memory(i)%component > 0) then
          state%slider(memory(i)%component, contact) = state%slider(memory(i)%component, contact) + change
        else
          z(:, contact) = z(:, contact) + change/max(norm2(z(:, contact)), tiny(1.0_wp))*[-z(2, contact), z(1, contact)]
        end if
      end associate
    end do
    displacement = matmul(state%motion, system%rows)
    do i = 1, size(system%law)
      associate (law => system%law(i), row => system%law(i)%first_row)
        n = law%tangents
        if (orbit%regime(i, 1) == regime_open) state%slider(:n, i) = displacement(row:row + n - 1)
        if (orbit%regime(i, 1) /= regime_slip) cycle
        radius = law%friction_coefficient/law%tangential_stiffness &
                 *max(law%normal_force(displacement(row + n)), 0.0_wp)
        ! A little beyond the rim, from where the scheme puts it back and knows that it slips.
        state%slider(:n, i) = displacement(row:row + n - 1) - (1.0_wp + beyond)*radius*z(:n, i)/max(norm2(z(:, i)), tiny(1.0_wp))
      end associate
    end do
  end subroutine move
end module attrito_stability_sampled_shooting
