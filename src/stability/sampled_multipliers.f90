!> Floquet multipliers of a sampled orbit, whose contacts may slip along two tangents.
!>
!> Beside two multipliers a mode, a contact that slips along two tangents and never opens has one of its own: it forgets its slider
!> but not from which side that came, a memory that fades as the direction turns towards the motion.
module attrito_stability_sampled_multipliers
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: eigenvalues_of
  use attrito_integrate_system, only: system_type
  use attrito_stability_multipliers, only: multiplier_type, sorted_multipliers, restrict_to_range, largest_change, first_modes, &
                                           accepted
  use attrito_stability_reduced, only: reduce_to
  use attrito_stability_sampled_monodromy, only: sampled_monodromy, memory_type, memory_of
  use attrito_stability_sampled_orbit, only: sampled_orbit_type
  implicit none
  private
  public :: sampled_multipliers, choose_modes

contains

  !> How many modes multipliers take: the lowest, twice as many again and again until those that matter no longer change.
  subroutine choose_modes(system, orbit, period, modes, change, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    !> Number of modes
    integer, intent(out) :: modes
    !> By the last doubling; zero if all are in
    real(wp), intent(out) :: change
    !> 0, or not: eigenvalues were not found
    integer, intent(out) :: info
    type(multiplier_type), allocatable :: before(:), now(:)

    modes = first_modes(system, period)
    change = 0.0_wp
    info = 0
    if (modes == size(system%eigenvalues)) return
    call sampled_multipliers(system, modes, orbit, period, now, info)
    do while (modes < size(system%eigenvalues) .and. info == 0)
      call move_alloc(now, before)
      modes = min(2*modes, size(system%eigenvalues))
      call sampled_multipliers(system, modes, orbit, period, now, info)
      if (info /= 0) return
      change = largest_change(before, now)
      if (change <= accepted) return
    end do
    change = 0.0_wp
  end subroutine choose_modes

  !> Multipliers of one sampled orbit in the lowest modes, the largest first within each kind.
  subroutine sampled_multipliers(system, modes, orbit, period, multipliers, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Number of modes
    integer, intent(in) :: modes
    !> Orbit whose contacts go by samples
    type(sampled_orbit_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    !> Floquet multipliers
    type(multiplier_type), allocatable, intent(out) :: multipliers(:)
    !> 0, or not: eigenvalues were not found
    integer, intent(out) :: info
    type(memory_type), allocatable :: memory(:)
    complex(wp), allocatable :: values(:)
    real(wp), allocatable :: matrix(:, :), scale(:)
    integer :: i, turning

    matrix = sampled_monodromy(reduce_to(system, modes), orbit, period)
    memory = memory_of(system, orbit)
    ! A unit of slider is one that a unit of motion brings about.
    scale = [spread(1.0_wp, 1, 2*modes), (norm2(system%rows(:, system%law(memory(i)%contact)%first_row)), i=1, size(memory))]
    where (scale <= 0.0_wp) scale = 1.0_wp
    matrix = matrix*spread(scale, 1, size(scale))/spread(scale, 2, size(scale))
    call restrict_to_range(matrix, info)
    if (info == 0) call eigenvalues_of(matrix, values, info)
    if (info /= 0) return
    associate (tangents => system%law%tangents)
      turning = count(tangents > 1 .and. orbit%closed .and. .not. orbit%stuck)
      multipliers = sorted_multipliers(values, 2*modes + turning, sum(tangents, mask=.not. orbit%stuck) - turning, &
                                       sum(tangents, mask=orbit%stuck))
    end associate
  end subroutine sampled_multipliers
end module attrito_stability_sampled_multipliers
