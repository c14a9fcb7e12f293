!> The linear system with every contact stuck: modal against direct, derivatives, blocks, and where a loss factor acts.
program test_receptance
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_model_contacts, only: stuck_stiffness
  use attrito_model_structure, only: damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_linear_projected_rows, only: new_projected_rows, projected_rows_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_receptance_direct, only: receptance_direct_type, new_receptance_direct
  use attrito_linear_receptance_modal, only: receptance_modal_type
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use scenes, only: scene_type, rubbing_frame, one_sided_oscillator, damp, damp_as_modes_ratio, noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3
  real(wp), parameter :: omega = 1.3_wp
  ! Dynamic stiffnesses of order one to thirty, a condition number below 1e3: 1e3 roundings.
  real(wp), parameter :: rounding = 1.0e-12_wp

  if (run_suite('receptance', [ &
                test('modes and factorisation agree without damping', undamped), &
                test('modes and factorisation agree under mass-proportional damping', mass_damped), &
                test('a modal damping ratio is the viscous matrix with that ratio in every stuck mode', ratio), &
                test('each kind of damping gets the receptance that is exact for it', choice), &
                test('the derivative by omega is that of differences, for every kind of damping', derivative), &
                test('the adjoint response is that of the conjugate transpose, for every kind of damping', adjoint), &
                test('with negative damping and a mode held, derivatives are those of differences too', excited), &
                test('the spring that holds a mode moves that mode alone, for every kind of damping', lifted), &
                test('a block between rows is the response of one row to forces on another', block), &
                test('receptances are symmetric between rows', symmetric), &
                test('a loss factor acts on K, not on the contact springs, and not on the mean', loss_factor), &
                test('a receptance set back to an earlier frequency responds as it did', set_back), &
                test('a singular frequency is refused every time, and the one before still responds', singular), &
                test('complex columns and real coefficients carry the same series', columns), &
                test('loads and motions of many rows are those of the matrix, whichever way it is multiplied', many_rows), &
                test('a direction that nothing holds is refused before anything is solved', free_direction)], &
                quiet=.false.) > 0) error stop 1

contains

  !> Small matrices are multiplied from the right, those of more than 1e5 numbers from the left.
  subroutine many_rows(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: sizes(2) = [30, 400], few = 2*harmonics + 1
    type(projected_rows_type) :: rows
    real(wp), allocatable :: matrix(:, :), forces(:, :), load(:, :), motion(:, :), response(:, :)
    integer :: i, j, k, n

    do i = 1, 2
      n = sizes(i)
      matrix = reshape(noise(n*n, 3), [n, n])
      forces = reshape(noise(few*n, 5), [few, n])
      response = reshape(noise(few*n, 9), [few, n])
      rows = new_projected_rows(matrix)
      allocate (load(few, n), motion(few, n))
      do j = 1, n
        load(:, j) = [(dot_product(forces(k, :), matrix(j, :)), k=1, few)]
        motion(:, j) = [(dot_product(response(k, :), matrix(:, j)), k=1, few)]
      end do
      call check_close(error, rows%load_of(forces), load, rounding, 'load')
      call check_close(error, rows%motion_of(to_complex(response)), motion, rounding, 'motion')
      ! Rows without a force are left out.
      forces(:, n/3:) = 0.0_wp
      do j = 1, n
        load(:, j) = [(dot_product(forces(k, :), matrix(j, :)), k=1, few)]
      end do
      call check_close(error, rows%load_of(forces), load, rounding, 'load of a few')
      deallocate (load, motion)
    end do
  end subroutine many_rows

  !> A scene with its receptance at omega, and random forces on its coordinates.
  subroutine prepare(kind, value, scene, receptance, force)
    integer, intent(in) :: kind
    real(wp), intent(in) :: value
    type(scene_type), intent(out) :: scene
    class(receptance_type), allocatable, intent(out) :: receptance
    complex(wp), allocatable, intent(out) :: force(:, :)
    type(stuck_system_type) :: stuck
    type(error_type), allocatable :: fault
    integer :: status, m

    scene = rubbing_frame()
    call damp(scene, kind, value)
    call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
    call new_receptance(scene%structure, scene%contacts, stuck, harmonics, receptance)
    call receptance%set_frequency(omega, status)
    m = size(scene%structure%mass, 1)
    allocate (force(m, 0:harmonics))
    force = to_complex(reshape(noise(m*(2*harmonics + 1), 7), [2*harmonics + 1, m]))
  end subroutine prepare

  !> Response of the model's coordinates [m, 0:H] to forces on them.
  function response_of(receptance, force) result(response)
    class(receptance_type), intent(in) :: receptance
    complex(wp), intent(in) :: force(:, 0:)
    complex(wp) :: response(size(force, 1), 0:harmonics)
    complex(wp), allocatable :: load(:, :), generalised(:, :)
    integer :: h

    load = receptance%project_loads(transpose(to_real(force)))
    allocate (generalised, mold=load)
    call receptance%respond(load, generalised)
    do h = 0, harmonics
      response(:, h) = receptance%recover(h, generalised(:, h + 1))
    end do
  end function response_of

  !> The response by a dense solve, as oracle.
  function dense_response(scene, force) result(response)
    type(scene_type), intent(in) :: scene
    complex(wp), intent(in) :: force(:, 0:)
    complex(wp) :: response(size(force, 1), 0:harmonics)
    type(receptance_direct_type) :: direct
    integer :: status

    direct = new_receptance_direct(scene%structure, stuck_stiffness(scene%contacts, scene%structure%stiffness, .true.), &
                                   scene%structure%mass(:, :0), scene%contacts%directions, harmonics, [real(wp) ::])
    call direct%set_frequency(omega, status)
    response = response_of(direct, force)
  end function dense_response

  subroutine undamped(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, damping_none, 0.0_wp)
  end subroutine undamped

  subroutine mass_damped(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, damping_mass, 0.2_wp)
  end subroutine mass_damped

  subroutine compare(error, kind, value)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: kind
    real(wp), intent(in) :: value
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :)

    call prepare(kind, value, scene, receptance, force)
    call check_close(error, response_of(receptance, force), dense_response(scene, force), rounding, 'response')
  end subroutine compare

  subroutine ratio(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :)

    call prepare(damping_ratio, 0.03_wp, scene, receptance, force)
    scene%structure%damping_kind = damping_viscous
    scene%structure%damping = damp_as_modes_ratio(scene, 0.03_wp)
    call check_close(error, response_of(receptance, force), dense_response(scene, force), rounding, 'response')
  end subroutine ratio

  subroutine choice(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(5) = [damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor]
    logical, parameter :: modal(5) = [.true., .false., .true., .true., .false.]
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :)
    integer :: i

    do i = 1, size(kinds)
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      select type (receptance)
       type is (receptance_modal_type)
        call check(error, modal(i), 'modes are used where they are coupled')
       class default
        call check(error, .not. modal(i), 'a factorisation is used where modes are exact')
      end select
    end do
  end subroutine choice

  !> y^H x at each harmonic [1, harmonics].
  pure function inner(y, x) result(products)
    complex(wp), intent(in) :: y(:, :), x(:, :)
    complex(wp) :: products(1, size(x, 2))

    products(1, :) = sum(conjg(y)*x, 1)
  end function inner

  !> y^H (Z^-1 f) = (Z^-H y)^H f at each harmonic.
  subroutine adjoint(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(5) = [damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor]
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :), other(:, :), response(:, :), back(:, :)
    integer :: i

    do i = 1, size(kinds)
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      other = cmplx(aimag(force), 2.0_wp - real(force, wp), wp)
      allocate (response, back, mold=force)
      call receptance%respond(force, response)
      call receptance%respond_adjoint(other, back)
      call check_close(error, inner(back, force), inner(other, response), rounding, 'work')
      deallocate (response, back)
    end do
  end subroutine adjoint

  subroutine derivative(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(5) = [damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor]
    ! Responses of order one with resonances wider than 0.01: the step squared over width squared, 1e-8, times slopes to 1e2.
    real(wp), parameter :: step = 1.0e-6_wp, tolerance = 1.0e-6_wp
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :), at(:, :), above(:, :), below(:, :), slope(:, :)
    integer :: i, status

    do i = 1, size(kinds)
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      allocate (at, above, below, slope, mold=force)
      call receptance%respond(force, at)
      call receptance%respond_derivative(at, slope)
      call receptance%set_frequency(omega + step, status)
      call receptance%respond(force, above)
      call receptance%set_frequency(omega - step, status)
      call receptance%respond(force, below)
      call check_close(error, slope, (above - below)/(2.0_wp*step), tolerance, 'derivative')
      deallocate (at, above, below, slope)
    end do
  end subroutine derivative

  !> By omega and by the excitation, of receptances made for autonomous motion.
  subroutine excited(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(2) = [damping_ratio, damping_viscous]
    ! As above.
    real(wp), parameter :: step = 1.0e-6_wp, tolerance = 1.0e-6_wp, excitation = 0.04_wp
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :), at(:, :), slope(:, :)
    integer :: i

    do i = 1, size(kinds)
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      call receptance%lift_modes([2], [0.7_wp])
      allocate (slope, mold=force)
      at = excited_response(receptance, omega, excitation, force)
      call receptance%respond_derivative(at, slope)
      call check_close(error, slope, (excited_response(receptance, omega + step, excitation, force) &
                                      - excited_response(receptance, omega - step, excitation, force))/(2.0_wp*step), &
                       tolerance, 'by omega')
      at = excited_response(receptance, omega, excitation, force)
      call receptance%respond_excitation(at, slope)
      call check_close(error, slope, (excited_response(receptance, omega, excitation + step, force) &
                                      - excited_response(receptance, omega, excitation - step, force))/(2.0_wp*step), &
                       tolerance, 'by excitation')
      deallocate (slope)
    end do
  end subroutine excited

  !> Response to forces at a frequency, an excitation given [n, 0:H].
  function excited_response(receptance, frequency, excitation, force) result(response)
    class(receptance_type), intent(inout) :: receptance
    real(wp), intent(in) :: frequency, excitation
    complex(wp), intent(in) :: force(:, 0:)
    complex(wp) :: response(size(force, 1), 0:harmonics)
    integer :: status

    call receptance%excite(excitation)
    call receptance%set_frequency(frequency, status)
    call receptance%respond(force, response)
  end function excited_response

  !> Held by a spring as stiff as itself a mode answers harmonic 1 of forces on it alone by 1/(2 k - omega^2 m + i omega c).
  subroutine lifted(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(3) = [damping_none, damping_mass, damping_viscous], mode = 2
    real(wp), parameter :: damping = 0.2_wp
    type(scene_type) :: scene
    type(stuck_system_type) :: stuck
    class(receptance_type), allocatable :: receptance
    type(error_type), allocatable :: fault
    complex(wp), allocatable :: force(:, :), response(:, :), expected(:, :)
    complex(wp) :: stiffness
    integer :: i, status

    do i = 1, size(kinds)
      call prepare(kinds(i), damping, scene, receptance, force)
      call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
      if (kinds(i) == damping_viscous) then
        ! Mass-proportional, though the receptance does not know.
        scene%structure%damping = damping*scene%structure%mass
        call new_receptance(scene%structure, scene%contacts, stuck, harmonics, receptance)
      end if
      call receptance%lift_modes([mode], stuck%modal_stiffness(mode:mode))
      call receptance%set_frequency(omega, status)
      force = (0.0_wp, 0.0_wp)
      force(:, 1) = matmul(scene%structure%mass, stuck%modes(:, mode))
      response = response_of(receptance, force)
      stiffness = cmplx(2.0_wp*stuck%modal_stiffness(mode)/stuck%modal_mass(mode) - omega**2, &
                        merge(0.0_wp, omega*damping, kinds(i) == damping_none), wp)
      expected = 0.0_wp*response
      expected(:, 2) = stuck%modes(:, mode)/stiffness
      call check_close(error, response, expected, rounding, 'response')
    end do
  end subroutine lifted

  subroutine block(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(3) = [damping_ratio, damping_viscous, damping_loss_factor]
    integer, parameter :: rows_a(4) = [1, 5, 3, 10], rows_b(2) = [7, 3]
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :), response(:, :), entries(:, :), expected(:, :)
    integer :: i, h, column

    do i = 1, size(kinds)
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      allocate (entries(4, 2), expected(4, 2))
      do h = 0, harmonics
        call receptance%block_between(h, rows_a, rows_b, entries)
        do column = 1, 2
          force = (0.0_wp, 0.0_wp)
          force(:, h) = scene%contacts%directions(:, rows_b(column))
          response = response_of(receptance, force)
          expected(:, column) = matmul(transpose(scene%contacts%directions(:, rows_a)), response(:, h + 1))
        end do
        call check_close(error, entries, expected, rounding, 'receptance between rows')
      end do
      deallocate (entries, expected)
    end do
  end subroutine block

  subroutine symmetric(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(3) = [damping_ratio, damping_viscous, damping_loss_factor]
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :)
    complex(wp) :: entries(10, 10)
    integer :: i, j, h

    do i = 1, size(kinds)
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      do h = 0, harmonics
        call receptance%block_between(h, [(j, j=1, 10)], [(j, j=1, 10)], entries)
        call check_close(error, entries, transpose(entries), rounding, 'receptance between rows')
      end do
    end do
  end subroutine symmetric

  subroutine loss_factor(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: eta = 0.3_wp
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :), response(:, :), returned(:, :)
    real(wp), allocatable :: stuck(:, :)
    integer :: h

    call prepare(damping_loss_factor, eta, scene, receptance, force)
    response = response_of(receptance, force)
    allocate (returned, mold=force)
    stuck = stuck_stiffness(scene%contacts, scene%structure%stiffness, .true.)
    associate (structure => scene%structure)
      do h = 0, harmonics
        returned(:, h) = matmul(stuck - (h*omega)**2*structure%mass, response(:, h + 1))
        if (h > 0) returned(:, h) = returned(:, h) + (0.0_wp, 1.0_wp)*eta*matmul(structure%stiffness, response(:, h + 1))
      end do
    end associate
    call check_close(error, returned, force, rounding, 'force given back by the dynamic stiffness')
  end subroutine loss_factor

  subroutine set_back(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(2) = [damping_ratio, damping_viscous]
    type(scene_type) :: scene
    class(receptance_type), allocatable :: receptance
    complex(wp), allocatable :: force(:, :), before(:, :)
    integer :: i, status

    do i = 1, 2
      call prepare(kinds(i), 0.1_wp, scene, receptance, force)
      before = response_of(receptance, force)
      call receptance%set_frequency(2.0_wp*omega, status)
      call receptance%set_frequency(omega, status)
      call check_close(error, response_of(receptance, force), before, 0.0_wp, 'response')
    end do
  end subroutine set_back

  subroutine singular(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(stuck_system_type) :: stuck
    type(error_type), allocatable :: fault
    class(receptance_type), allocatable :: receptance
    complex(wp) :: response(1, 0:1)
    real(wp) :: displacements(3, 1)
    integer :: i, attempt, status

    ! A mass of 1 on 1 + 3: undamped, it resonates at 2 exactly.
    do i = 1, 2
      scene = one_sided_oscillator(normal_stiffness=3.0_wp, gap=0.0_wp, preload=0.0_wp, ratio=0.0_wp)
      if (i == 1) scene%structure%damping_kind = damping_none
      call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
      call new_receptance(scene%structure, scene%contacts, stuck, 1, receptance)
      call receptance%set_frequency(1.0_wp, status)
      call check(error, status == 0, 'a regular frequency is refused')
      do attempt = 1, 2
        call receptance%set_frequency(2.0_wp, status)
        call check(error, status /= 0, 'a singular frequency is accepted')
      end do
      call receptance%set_frequency(1.0_wp, status)
      call receptance%respond(receptance%project_loads(reshape([1.0_wp, 1.0_wp, 0.0_wp], [1, 3])), response)
      displacements = receptance%displacements(response)
      call check_close(error, displacements(:2, 1), [1.0_wp/4.0_wp, 1.0_wp/3.0_wp], 1.0e-15_wp, 'response')
    end do
  end subroutine singular

  subroutine columns(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: theta = 0.4_wp
    real(wp) :: coefficients(5, 2), value
    complex(wp) :: z(2, 0:2)

    coefficients = reshape(noise(10, 1), [5, 2])
    z = to_complex(coefficients)
    call check_close(error, to_real(z), coefficients, 0.0_wp, 'coefficients')
    value = real(sum(z(2, :)*exp((0.0_wp, 1.0_wp)*theta*[0, 1, 2])), wp)
    call check_close(error, value, sum(coefficients(:, 2)*[1.0_wp, cos(theta), sin(theta), cos(2*theta), sin(2*theta)]), &
                     1.0e-15_wp, 'Re sum X_h exp(i h theta)')
  end subroutine columns

  subroutine free_direction(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(stuck_system_type) :: stuck
    type(error_type), allocatable :: fault

    scene = rubbing_frame()
    scene%structure%stiffness(8, :) = 0.0_wp
    scene%structure%stiffness(:, 8) = 0.0_wp
    scene%contacts%directions(8, :) = 0.0_wp
    call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
    call check(error, allocated(fault), 'it is accepted')
    if (allocated(error)) return
    call check(error, index(fault%message, '1 motion(s) free') > 0, 'the message does not count the free motions')
  end subroutine free_direction
end program test_receptance
