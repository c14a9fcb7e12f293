!> What uses a receptance asks nothing of it but its answers at each harmonic: one sector of a wheel, whose coordinates, directions
!> and stiffness differ from harmonic to harmonic and are complex, is solved as any structure is, and moves as in the whole wheel.
program test_cyclic_sector
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_accuracy_resonances, only: resonances_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_set_up, only: new_balance
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_linear_projected_rows, only: projected_rows_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use attrito_model_structure, only: damping_viscous, damping_mass, damping_ratio, damping_loss_factor
  use attrito_model_contacts, only: new_contacts
  use attrito_newton_border, only: constraint_type
  use attrito_newton_condensed_krylov, only: krylov_options_type
  use attrito_newton_linearised_step, only: linear_options_type, solve_linearised, apply_linearised
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use cyclic_sector, only: one_sector, whole_wheel, of_sector
  use scenes, only: scene_type, noise
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: harmonics = 4, k = 2*harmonics + 1, rows = 5
  real(wp), parameter :: omega = 1.2_wp
  ! Both are solved to 1e-12 in motions of order one; the condition of the systems is below 1e2.
  ! Panels of slip lie elsewhere in a sector's period than in its neighbours', and leave up to 5e-9 in forces of 1, 4e-10 as a rule.
  real(wp), parameter :: tolerance = 1.0e-9_wp
  real(wp), parameter :: rounding = 1.0e-13_wp

  call run_in_session('cyclic sector', [ &
                      test('one sector moves as in the whole wheel, contacts slipping within it and across its boundary', wave), &
                      test('the bordered step of a sector meets the linearised equations, by elimination and by GMRES', bordered), &
                      test('the residual''s derivative by omega is that of differences', by_omega), &
                      test('forces along rows do on the coordinates the work that they do on the rows', work), &
                      test('harmonics that meet a mode of their own nodal diameter are known, others are not', resonance), &
                      test('the adjoint response is that of the conjugate transpose', adjoint), &
                      test('rows one by one, harmonic by harmonic, or some of them, are those of all', parts)])

contains

  !> A solver of the wheel, or of one sector of it.
  function solver_of(scene) result(solver)
    type(scene_type), intent(in) :: scene
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), &
                    solver_options_type(harmonics=harmonics, max_iterations=60, tolerance=1.0e-12_wp), solver, fault)
    if (allocated(fault)) error stop 'the scene is refused'
  end function solver_of

  subroutine wave(error)
    type(error_type), allocatable, intent(out) :: error
    ! Forward, backward, standing, more nodal diameters than a wheel has, all sectors alike, a single sector
    integer, parameter :: sectors(6) = [3, 6, 4, 4, 3, 1], orders(6) = [1, -2, 2, 7, 3, 0]
    integer, parameter :: kinds(4) = [damping_viscous, damping_mass, damping_ratio, damping_loss_factor]
    integer :: i

    do i = 1, size(sectors)
      call compare(error, sectors(i), orders(i), kinds(1 + modulo(i - 1, size(kinds))))
      if (allocated(error)) return
    end do
  end subroutine wave

  !> The motion of one sector with that of the whole wheel.
  subroutine compare(error, sectors, engine_order, damping_kind)
    type(error_type), allocatable, intent(out) :: error
    integer, intent(in) :: sectors, engine_order, damping_kind
    type(solver_type) :: wheel, sector
    real(wp), allocatable :: q(:, :)

    wheel = solver_of(whole_wheel(sectors, engine_order, damping_kind))
    call wheel%solve_at(omega)
    sector = solver_of(one_sector(sectors, engine_order, damping_kind))
    call sector%solve_at(omega)
    call check(error, wheel%report%converged .and. sector%report%converged, 'one of them does not converge')
    if (allocated(error)) return
    associate (one => sector%context%balance, full => wheel%context%balance)
      call check(error, all(one%forces%slip > 0.1_wp .and. one%forces%unique), 'contacts do not slip and forget: the test is void')
      q = full%receptance%displacements(full%response)
      call check_close(error, one%receptance%displacements(one%response), matmul(q, of_sector(0, sectors)), tolerance, &
                       'motion of the sector')
      call check_close(error, sector%motion, wheel%motion(:, :rows), tolerance, 'motion of the contacts')
      call check_close(error, one%monitors%motion_of(one%response), full%monitors%motion_of(full%response), tolerance, 'monitors')
      call check(error, maxval(abs(q(4:5, :))) > 0.01_wp, 'the second harmonic is small: the test is void')
    end associate
    call wheel%destroy()
    call sector%destroy()
  end subroutine compare

  !> At frequencies at which a harmonic meets a mode, be it of its own nodal diameter or of another's.
  subroutine resonance(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: known = 8
    type(solver_type) :: solver
    type(scene_type) :: scene
    type(resonances_type) :: resonances
    integer :: h, diameter, met

    scene = one_sector(3, 1, damping_mass)
    ! Contacts so soft that natural frequencies are the same without them
    scene%contacts%law%tangential_stiffness = 1.0e-3_wp
    scene%contacts%law%normal_stiffness = 1.0e-3_wp
    scene%contacts%law%preload = 1.0e-4_wp
    scene%contacts = new_contacts(scene%contacts%law, scene%contacts%directions)
    solver = solver_of(scene)
    met = 0
    do h = known + 1, known + 4
      do diameter = 0, 1
        associate (omega => solver%stuck%diameters(diameter)%omega)
          call solver%solve_at(omega(size(omega))/h)
        end associate
        call check(error, any(solver%context%balance%forces%slip > 0.0_wp), 'no contact slips: the test is void')
        if (allocated(error)) return
        call check(error, resonances%highest(solver, known, 1.0e-12_wp) == highest_met(solver, known), 'another harmonic')
        if (allocated(error)) return
        if (highest_met(solver, known) == known) met = met + 1
      end do
    end do
    call check(error, met > 0, 'every harmonic meets its own nodal diameter: the test is void')
    call solver%destroy()
  end subroutine resonance

  !> The highest harmonic within 2 % of a natural frequency of its own nodal diameter.
  integer function highest_met(solver, known) result(highest)
    type(solver_type), intent(in) :: solver
    integer, intent(in) :: known
    integer :: h

    highest = known
    do h = known + 1, 40
      ! Of three sectors nodal diameters 1 and 2 are one another's image.
      associate (omega => solver%stuck%diameters(merge(0, 1, modulo(h, 3) == 0))%omega)
        if (any(abs(h*solver%omega/omega - 1.0_wp) < 0.02_wp)) highest = h
      end associate
    end do
  end function highest_met

  !> A sector evaluated at a random motion.
  subroutine prepare(balance, motion, damping_kind)
    type(balance_type), intent(out) :: balance
    real(wp), intent(out) :: motion(k, rows)
    !> One of `damping_...`
    integer, intent(in) :: damping_kind
    type(scene_type) :: scene
    type(stuck_system_type) :: stuck
    class(receptance_type), allocatable :: receptance
    type(error_type), allocatable :: fault
    integer :: status

    scene = one_sector(3, 1, damping_kind)
    call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
    if (allocated(fault)) error stop 'the scene is refused'
    call new_receptance(scene%structure, scene%contacts, stuck, harmonics, receptance)
    call new_balance(scene%structure, scene%contacts, receptance, only_me(), balance)
    motion = 0.7_wp*reshape(noise(k*rows, 11), [k, rows])
    call balance%evaluate(motion, omega, status)
    if (status /= 0) error stop 'the balance is not evaluated'
  end subroutine prepare

  subroutine bordered(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step, product
    type(linear_options_type) :: options
    real(wp) :: motion(k, rows)
    integer :: i, iterations, status

    call prepare(balance, motion, damping_mass)
    constraint%motion = reshape(noise(k*rows, 12), [k, rows])
    constraint%frequency = 0.8_wp
    do i = 1, 2
      if (i == 2) options = linear_options_type(dense_limit=0, krylov=krylov_options_type(tolerance=1.0e-12_wp))
      right = new_unknowns([k, rows], shape(balance%slider))
      right%motion = reshape(noise(k*rows, 13), [k, rows])
      right%omega = 0.4_wp
      step = right
      product = right
      call solve_linearised(balance, constraint, right, options, step, iterations, status)
      call check(error, status == 0, 'the step is singular')
      call check(error, (iterations > 0) .eqv. (i == 2), 'GMRES is taken where it should not be, or not where it should')
      call apply_linearised(balance, constraint, step, product)
      call check_close(error, product%motion, right%motion, 1.0e-9_wp, 'linearised balance')
      call check_close(error, product%omega, right%omega, 1.0e-9_wp, 'constraint')
    end do
    call balance%destroy()
  end subroutine bordered

  subroutine by_omega(error)
    type(error_type), allocatable, intent(out) :: error
    ! Rounding 1e-16 over the increment, and its square times a third derivative below 1e5, as a mode of two per cent damping has.
    real(wp), parameter :: increment = 1.0e-6_wp
    type(balance_type) :: balance
    real(wp) :: motion(k, rows), derivative(k, rows), difference(k, rows)
    integer :: status

    call prepare(balance, motion, damping_viscous)
    derivative = balance%residual_omega()
    call balance%evaluate(motion, omega + increment, status)
    difference = balance%residual
    call balance%evaluate(motion, omega - increment, status)
    difference = (difference - balance%residual)/(2.0_wp*increment)
    call check_close(error, derivative, difference, 1.0e-7_wp, 'derivative')
    call balance%destroy()
  end subroutine by_omega

  subroutine work(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows), forces(k, rows), along_mean(rows)
    complex(wp), allocatable :: response(:, :)

    call prepare(balance, motion, damping_viscous)
    forces = reshape(noise(k*rows, 21), [k, rows])
    response = random_response(balance)
    associate (own => balance%contact_rows)
      call check_close(error, sum(own%load_of(forces)*to_real(response)), sum(forces*own%motion_of(response)), rounding*k*rows, &
                       'work')
      along_mean = own%mean_of(response(:, 1))
      call check_close(error, dot_product(own%mean_load_of(forces(1, :)), real(response(:, 1), wp)), &
                       dot_product(forces(1, :), along_mean), rounding*rows, 'work of the mean')
    end associate
    call balance%destroy()
  end subroutine work

  !> Coordinates by harmonic [n, H + 1], the mean real.
  function random_response(balance) result(response)
    type(balance_type), intent(in) :: balance
    complex(wp), allocatable :: response(:, :)

    response = to_complex(reshape(noise(k*size(balance%response, 1), 22), [k, size(balance%response, 1)]))
  end function random_response

  !> y^H x at each harmonic [1, harmonics].
  pure function inner(y, x) result(products)
    complex(wp), intent(in) :: y(:, :), x(:, :)
    complex(wp) :: products(1, size(x, 2))

    products(1, :) = sum(conjg(y)*x, 1)
  end function inner

  !> y^H (Z^-1 f) = (Z^-H y)^H f at each harmonic, in the modes of nodal diameters and by factors.
  subroutine adjoint(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: kinds(3) = [damping_mass, damping_viscous, damping_loss_factor]
    type(balance_type) :: balance
    real(wp) :: motion(k, rows)
    complex(wp), allocatable :: force(:, :), other(:, :), response(:, :), back(:, :)
    integer :: i

    do i = 1, size(kinds)
      call prepare(balance, motion, kinds(i))
      force = random_response(balance)
      other = cmplx(aimag(force), 2.0_wp - real(force, wp), wp)
      allocate (response, back, source=force)
      call balance%receptance%respond(force, response)
      call balance%receptance%respond_adjoint(other, back)
      call check_close(error, inner(back, force), inner(other, response), tolerance, 'work')
      deallocate (response, back)
    end do
  end subroutine adjoint

  subroutine parts(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: chosen(2) = [4, 2]
    type(balance_type) :: balance
    type(projected_rows_type) :: some
    real(wp) :: motion(k, rows), all(k, rows), moving(rows, 4)
    complex(wp), allocatable :: response(:, :)
    complex(wp) :: columns(rows, 0:harmonics)
    integer :: h, row

    call prepare(balance, motion, damping_viscous)
    response = random_response(balance)
    associate (own => balance%contact_rows)
      all = own%motion_of(response)
      columns = to_complex(all)
      do row = 1, rows
        call check_close(error, own%row_of(row, response), all(:, row), rounding, 'a row')
        do h = 0, harmonics
          call check_close(error, reshape([own%row_at(row, h, response(:, h + 1))], [1, 1]), columns(row:row, h:h), rounding, &
                           'a row at a harmonic')
        end do
      end do
      call check_close(error, own%mean_of(response(:, 1)), all(1, :), rounding, 'means')
      call check_close(error, own%motion_from(3, response(:, 4:)), all(6:, :), rounding, 'the last harmonics')
      call check_close(error, own%harmonics_of(3, response(:, 4:)), columns(:, 3:), rounding, 'the last harmonics, complex')
      moving = own%chosen_harmonics_of(chosen, response)
      call check_close(error, moving(:, 1), all(8, :), rounding, 'a chosen cosine')
      call check_close(error, moving(:, 4), all(5, :), rounding, 'a chosen sine')
      some = own%part([5, 2])
      call check(error, some%number() == 2, 'a part has other rows')
      call check_close(error, some%motion_of(response), all(:, [5, 2]), rounding, 'some rows')
    end associate
    call balance%destroy()
  end subroutine parts
end program test_cyclic_sector
