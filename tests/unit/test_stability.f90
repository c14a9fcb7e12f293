!> Stability of orbits: multipliers of the paper's wedge and of closed forms, by both engines.
program test_stability
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: regime_slip
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type, new_system
  use attrito_stability_balance_motion, only: balance_motion_of
  use attrito_stability_distance, only: trajectory_of_balance, distance_between
  use attrito_stability_examine, only: by_monodromy, by_hill
  use attrito_stability_hill, only: hill_multipliers
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_multipliers, only: multiplier_type, kind_floquet, kind_stuck, multipliers_of, in_modes
  use attrito_stability_reduced, only: reduce_to
  use attrito_stability_shooting, only: shoot
  use attrito_stability_start, only: loading_of, start_of
  use attrito_stability_verdict, only: judge, largest_multiplier, between_folding, stable, unstable
  use attrito_model_contacts, only: new_contacts
  use scenes, only: scene_type, wedge
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  use wedge_orbits, only: stiff_wedge, find_orbit, balance_scene
  implicit none

  !> Of the wedge at 45 degrees, 132 Hz, 5 N, excited along x and along the contact's tangent, to four digits
  complex(wp), parameter :: along_x(5) = [(0.7899_wp, 0.0_wp), (0.6728_wp, 0.0402_wp), (0.6728_wp, -0.0402_wp), &
                                          (0.3453_wp, 0.0_wp), (0.0_wp, 0.0_wp)]
  complex(wp), parameter :: along_tangent(5) = [(0.7873_wp, 0.0_wp), (0.7643_wp, 0.0_wp), (0.7510_wp, 0.0_wp), &
                                                (0.2385_wp, 0.0_wp), (0.0_wp, 0.0_wp)]

  call run_in_session('stability', [ &
                      test('multipliers of the wedge by the monodromy are those that are known', by_flow), &
                      test('multipliers of the wedge by Hill''s problem are those that are known', by_harmonics), &
                      test('the monodromy is the derivative of the event-exact period map', derivative), &
                      test('contacts that change at one instant change nothing between', no_length), &
                      test('a stable orbit is come back to, an unstable one is left, at the rate of its multiplier', verdicts), &
                      test('motions are as far apart as they get within the period', distances), &
                      test('orbits of the balance come nearer to the event-exact one with more harmonics', approach), &
                      test('near a fold a balance may stand for either orbit unless its multiplier is near one''s', fold), &
                      test('damped modes that follow at rest err by the frequency over theirs', at_rest)])

contains

  subroutine derivative(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_with_differences(wedge(45.0_wp), 132.0_wp, 5.0_wp, error)
    ! Here the contact lifts off and lands, too.
    call compare_with_differences(stiff_wedge(), 110.0_wp, 1.0_wp, error)
    call compare_with_differences(stiff_wedge(), 125.0_wp, 1.0_wp, error)
  end subroutine derivative

  !> Columns of the monodromy against central differences of the flow, within 1e-6 of the largest entry: steps of 1e-6 of the
  !> motion leave 1e-12 of it by curvature and 1e-9 by rounding.
  subroutine compare_with_differences(scene, frequency_hz, level, error)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: frequency_hz, level
    type(error_type), allocatable, intent(inout) :: error
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start, state
    type(orbit_type) :: orbit, other
    real(wp), allocatable :: matrix(:, :), differences(:, :), ends(:, :)
    real(wp) :: range, h
    integer :: column, way, m
    logical :: converged

    call find_orbit(scene, frequency_hz, level, system, loading, start, orbit, error)
    if (allocated(error)) return
    matrix = orbit%monodromy(reduce_to(system, size(system%eigenvalues)))
    allocate (differences, mold=matrix)
    allocate (ends(size(matrix, 1), 2))
    m = size(start%motion)
    h = 1.0e-6_wp*norm2(start%motion)
    do column = 1, size(matrix, 2)
      do way = 1, 2
        state = start
        if (column > 2*m) then
          state%slider(1, 1) = state%slider(1, 1) + (2*way - 3)*h
        else if (column <= m) then
          state%motion(column) = state%motion(column) + (2*way - 3)*h
        else
          state%rate(column - m) = state%rate(column - m) + (2*way - 3)*h
        end if
        ! Contacts that slip where the period starts take their sliders along.
        state = new_state(system, state%motion, state%rate, state%slider)
        if (start%regime(1) == regime_slip) then
          state%slider(1, 1) = -real(start%side(1), wp)
          state = new_state(system, state%motion, state%rate, state%slider)
        end if
        call other%march(system, loading, state, range, converged)
        ends(:, way) = [state%motion, state%rate, state%slider(1, orbit%memory%contact)]
      end do
      differences(:, column) = (ends(:, 2) - ends(:, 1))/(2.0_wp*h)
    end do
    call check_close(error, matrix, differences, 1.0e-6_wp*maxval(abs(matrix)), 'monodromy')
  end subroutine compare_with_differences

  !> Each segment parted from a part of itself that has no length.
  subroutine no_length(error)
    type(error_type), allocatable, intent(out) :: error
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start
    type(orbit_type) :: orbit, parted
    real(wp), allocatable :: whole(:, :)
    integer :: i

    call find_orbit(stiff_wedge(), 110.0_wp, 1.0_wp, system, loading, start, orbit, error)
    if (allocated(error)) return
    whole = orbit%monodromy(reduce_to(system, size(system%eigenvalues)))
    parted = orbit
    parted%segments%segment = [(orbit%segments%segment(i), orbit%segments%segment(i), i=1, size(orbit%segments%segment))]
    do i = 1, size(orbit%segments%segment)
      parted%segments%segment(2*i - 1)%length = 0.0_wp
      parted%segments%segment(2*i)%rests = .false.
    end do
    call check_close(error, parted%monodromy(reduce_to(system, size(system%eigenvalues))), whole, 0.0_wp, 'monodromy')
  end subroutine no_length

  subroutine verdicts(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: at(4) = [85.0_wp, 110.0_wp, 115.0_wp, 130.0_wp]
    integer :: i

    do i = 1, size(at)
      call follow_perturbed(stiff_wedge(), at(i), 1.0_wp, at(i) < 112.0_wp, error)
    end do
    call follow_perturbed(wedge(45.0_wp), 132.0_wp, 5.0_wp, .false., error)
  end subroutine verdicts

  !> Perturb an orbit by 1e-6 and march: the distance grows or falls with the largest multiplier, and what grows has left by far.
  subroutine follow_perturbed(scene, frequency_hz, level, leaves, error)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: frequency_hz, level
    logical, intent(in) :: leaves
    type(error_type), allocatable, intent(inout) :: error
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start, state
    type(orbit_type) :: orbit, other
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: range, change, distance(0:200)
    integer :: cycle, info, modes
    logical :: converged

    call find_orbit(scene, frequency_hz, level, system, loading, start, orbit, error)
    if (allocated(error)) return
    call multipliers_of(system, orbit, multipliers, modes, change, info)
    call check(error, judge(multipliers, .true.) == merge(unstable, stable, leaves), 'the verdict is another')
    state = new_state(system, (1.0_wp + 1.0e-6_wp)*start%motion, start%rate, start%slider)
    distance(0) = norm2(state%motion - start%motion)
    do cycle = 1, 200
      call other%march(system, loading, state, range, converged)
      distance(cycle) = hypot(norm2(state%motion - start%motion), norm2(state%rate - start%rate))
    end do
    if (leaves) then
      call check(error, minval(distance(150:)) > 1.0e3_wp*distance(0), 'it does not leave')
    else
      call check(error, distance(200) < 1.0e-2_wp*distance(0), 'it does not come back')
    end if
    ! Smaller multipliers and the phase of a pair are worth a factor, at most ten here, over ten or twenty periods.
    call check_close(error, log(distance(20)/distance(10))/10, log(largest_multiplier(multipliers)), log(10.0_wp)/10, 'rate at first')
    call check_close(error, log(distance(40)/distance(20))/20, log(largest_multiplier(multipliers)), log(10.0_wp)/20, 'rate later')
  end subroutine follow_perturbed

  !> They differ at one instant, by 0.6 of 3; or in harmonics that a balance has or has not.
  subroutine distances(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: count = 16
    real(wp) :: balance(2, count), motion(2, count)
    integer :: i

    balance(1, :) = [(2.0_wp + 3.0_wp*cos(two_pi*(i - 1)/count), i=1, count)]
    balance(2, :) = 1.0_wp
    motion = balance
    motion(:, 5) = motion(:, 5) + [0.36_wp, -0.48_wp]
    call check_close(error, distance_between(motion, balance, count/2), 0.2_wp, 1.0e-14_wp, 'distance')
    call check_close(error, distance_between(balance, balance, 3), 0.0_wp, 0.0_wp, 'distance from itself')
    ! Up to a balance of three harmonics the fifth does not count, and the second does.
    motion(1, :) = balance(1, :) + [(0.7_wp*sin(5*two_pi*(i - 1)/count), i=1, count)]
    motion(2, :) = balance(2, :) + [(0.6_wp*cos(2*two_pi*(i - 1)/count), i=1, count)]
    call check_close(error, distance_between(motion, balance, 3), 0.2_wp, 1.0e-14_wp, 'distance of the second harmonic')
  end subroutine distances

  subroutine approach(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: harmonics(2) = [5, 20], count = 64
    type(solver_type) :: solver
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start
    type(orbit_type) :: orbit
    real(wp) :: balance(2, count), motion(2, count), apart(2), range, at_start
    logical :: found
    integer :: i

    do i = 1, size(harmonics)
      call balance_scene(stiff_wedge(), 110.0_wp, 1.0_wp, harmonics(i), solver, error)
      if (allocated(error)) return
      call new_system(solver%structure, solver%contacts, system, error)
      loading = loading_of(solver, system)
      start = start_of(solver, system, solver%context%balance%slider)
      balance = trajectory_of_balance(solver, system, count)
      call check_close(error, balance(:, 1), start%motion, 1.0e-13_wp*norm2(start%motion), 'where the period starts')
      call shoot(system, loading, start, orbit, found)
      call check(error, found, 'no orbit is found')
      if (allocated(error)) return
      call orbit%march(system, loading, start, range, found, motion)
      apart(i) = distance_between(motion, balance, count/2)
      at_start = norm2(motion(:, 1) - balance(:, 1))/norm2(maxval(balance, 2) - minval(balance, 2))
      call check(error, apart(i) > at_start, 'it is nearer than where the period starts')
      call solver%destroy()
    end do
    ! Forces with kinks: harmonics of the motion fall like h^-4, what is left out like H^-3, 64 times from 5 to 20: a tenth at most.
    call check(error, apart(2) < 0.1_wp*apart(1), 'they do not come nearer')
  end subroutine approach

  !> The wedge with a high mode that its contact sees and moves, damped so that it does not ring after events: multipliers with it
  !> at rest against those with all modes, at two frequencies of it.
  subroutine at_rest(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: apart(2), change
    type(scene_type) :: scene
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start
    type(orbit_type) :: orbit
    type(multiplier_type), allocatable :: all_modes(:), low_modes(:)
    integer :: i, j, info, modes

    do i = 1, 2
      scene = wedge_with_high_mode(two_pi*i*8.0e3_wp)
      call find_orbit(scene, 132.0_wp, 5.0_wp, system, loading, start, orbit, error)
      if (allocated(error)) return
      call multipliers_of(system, orbit, all_modes, modes, change, info)
      call check_close(error, change, 0.0_wp, 0.0_wp, 'change')
      call in_modes(system, 2, orbit, low_modes, info)
      apart(i) = maxval([(minval(abs(all_modes%value - low_modes(j)%value)), j=1, 4)])
    end do
    ! Twice the damping ratio, 0.5, times 132 Hz over 8 kHz, in a multiplier's exponent: times 2 pi, is 0.1, of a compliance that is
    ! less than a tenth of the wedge's.
    call check_close(error, apart(1), 0.0_wp, 1.0e-2_wp, 'what the mode at rest errs')
    call check_close(error, log(apart(1)/apart(2))/log(2.0_wp), 1.0_wp, 0.2_wp, 'order')
  end subroutine at_rest

  !> The map x -> x + a - x^2 has fixed points +-sqrt(a) of multipliers 1 -+ 2 sqrt(a), which meet at a = 0; at x the multiplier is
  !> 1 - 2 x. Multipliers elsewhere, complex ones near 1 and those of sliders at rest say nothing of folds.
  subroutine fold(error)
    type(error_type), allocatable, intent(out) :: error
    type(multiplier_type) :: node(4), other(4)
    real(wp), parameter :: a = 1.0e-3_wp

    node%value = [cmplx(1.0_wp - 2.0_wp*sqrt(a), 0.0_wp, wp), (0.99_wp, 0.01_wp), (0.99_wp, -0.01_wp), (1.001_wp, 0.0_wp)]
    node(4)%kind = kind_stuck
    other = node
    call check(error, .not. between_folding(node, other), 'at the orbit')
    other(1)%value = 1.0_wp + 2.0_wp*sqrt(a)
    call check(error, between_folding(node, other), 'at the other orbit')
    call check(error, .not. between_folding(other, other), 'at the unstable orbit')
    other(1)%value = 1.0_wp - 0.6_wp*sqrt(a)
    call check(error, between_folding(node, other), 'at 0.65 and 1.35 of half the distance between both')
    other(4)%kind = kind_floquet
    other(4)%value = 1.0_wp
    call check(error, .not. between_folding(other, other), 'at the fold')
    other(4)%kind = kind_stuck
    ! A truncated series may leave multipliers that mean nothing.
    other(1)%value = 1.33_wp
    call check(error, .not. between_folding(node, other), 'far from a fold')
    other(1)%value = (1.06_wp, 0.1_wp)
    call check(error, .not. between_folding(node, other), 'complex')
  end subroutine fold

  !> A third coordinate of a frequency on a spring of 1e6, which adds to u and v.
  function wedge_with_high_mode(omega) result(scene)
    real(wp), intent(in) :: omega
    type(scene_type) :: scene
    type(scene_type) :: plain
    real(wp), parameter :: spring = 1.0e6_wp

    plain = wedge(45.0_wp)
    associate (structure => scene%structure)
      allocate (structure%mass(3, 3), structure%stiffness(3, 3), structure%damping(3, 3), structure%static_loads(3, 1), &
                structure%harmonic_load(3, 3), structure%monitors(3, 0), source=0.0_wp)
      structure%mass(:2, :2) = plain%structure%mass
      structure%stiffness(:2, :2) = plain%structure%stiffness
      structure%damping(:2, :2) = plain%structure%damping
      structure%static_loads(:2, :) = plain%structure%static_loads
      structure%harmonic_load(:2, :) = plain%structure%harmonic_load
      structure%mass(3, 3) = spring/omega**2
      structure%stiffness(3, 3) = spring
      structure%damping(3, 3) = 2.0_wp*0.5_wp*spring/omega
      structure%damping_kind = plain%structure%damping_kind
    end associate
    scene%contacts = new_contacts(plain%contacts%law, reshape([plain%contacts%directions(:, 1), 1.0_wp, &
                                                               plain%contacts%directions(:, 2), 0.5_wp], [3, 2]))
  end function wedge_with_high_mode

  !> The wedge at 45 degrees, balanced at 132 Hz and 5 N.
  subroutine balance_wedge(x, harmonics, solver, error)
    !> Excite along x rather than along the tangent
    logical, intent(in) :: x
    integer, intent(in) :: harmonics
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type) :: scene

    scene = wedge(45.0_wp)
    if (x) scene%structure%harmonic_load(:, 2) = [1.0_wp, 0.0_wp]
    call balance_scene(scene, 132.0_wp, 5.0_wp, harmonics, solver, error)
  end subroutine balance_wedge

  subroutine by_flow(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_wedge(by_monodromy, error)
  end subroutine by_flow

  subroutine by_harmonics(error)
    type(error_type), allocatable, intent(out) :: error

    call compare_wedge(by_hill, error)
  end subroutine by_harmonics

  subroutine compare_wedge(method, error)
    integer, intent(in) :: method
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type) :: solver
    type(system_type) :: system
    type(orbit_type) :: orbit
    type(multiplier_type), allocatable :: multipliers(:)
    real(wp) :: change
    integer :: info, modes, i

    do i = 1, 2
      call balance_wedge(i == 1, 40, solver, error)
      if (allocated(error)) return
      call new_system(solver%structure, solver%contacts, system, error)
      call orbit%take_balance(system, loading_of(solver, system), balance_motion_of(solver))
      if (method == by_monodromy) then
        call multipliers_of(system, orbit, multipliers, modes, change, info)
      else
        call hill_multipliers(system, orbit%segments, orbit%period, multipliers, info)
      end if
      call check(error, info == 0, 'no eigenvalues')
      call check_close(error, reshape(multipliers%value, [5, 1]), reshape(merge(along_x, along_tangent, i == 1), [5, 1]), &
                       1.0e-4_wp, 'multipliers')
      call solver%destroy()
    end do
  end subroutine compare_wedge
end program test_stability
