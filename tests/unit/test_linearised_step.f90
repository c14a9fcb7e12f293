!> The condensed bordered step against a dense solve with a differenced Jacobian, and Newton's quadratic convergence.
program test_linearised_step
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_model_structure, only: damping_viscous, damping_ratio
  use attrito_newton_border, only: constraint_type, new_border
  use attrito_newton_condensed_dense, only: elimination_type
  use attrito_newton_condensed_krylov, only: krylov_options_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: linear_options_type, solve_linearised, apply_linearised
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_newton_contact_blocks, only: contact_blocks_type
  use attrito_newton_condensed_operator, only: condensed_operator_type, new_condensed_operator
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_mean_response, only: mean_response_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_contact_state, only: state_stuck
  use random_steps, only: k, rows, contacts, n, omega, evaluate_at_random, random_constraint, random_right, packed, by_gmres
  use scenes, only: scene_type, rubbing_frame, rubbing_frame_with_high_modes, damp, restate
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  ! A difference over 1e-6 of residuals of order one: rounding 1e-10, curvature of two-tangent slip times the step squared below that;
  ! the condition of the system, some 1e2, is between this and the step.
  real(wp), parameter :: increment = 1.0e-6_wp, tolerance = 1.0e-7_wp

  call run_in_session('linearised step', [ &
                      test('the bordered step is that of a dense solve, contacts slipping and opening', lively), &
                      test('with sliders that are found with the motion it is that of a dense solve', periodic_sliders), &
                      test('the bordered step is that of a dense solve, the mean frozen', frozen), &
                      test('by GMRES the step is the same, modes uncoupled or not, the mean frozen or not', by_krylov), &
                      test('by GMRES, high modes summed, the step meets the equations to the tolerance, the mean frozen or not', &
                           high_modes), &
                      test('the preconditioner of one block is the inverse', exact_preconditioner), &
                      test('means of contacts are solved for exactly, and respond as they are', means_alone), &
                      test('a preconditioner kept from another motion leaves the step what it is', kept_preconditioner), &
                      test('a preconditioner that costs more iterations than to make it is made again', worn_preconditioner), &
                      test('factors kept serve another right-hand side, and count as less work', kept_factors), &
                      test('by GMRES the step takes the same iterations whatever the unit of force', any_unit), &
                      test('what GMRES does not finish makes its preconditioner void', unfinished), &
                      test('with every contact stuck the step is the residual itself', all_stuck), &
                      test('a constraint on omega alone keeps omega', fixed_frequency), &
                      test('the residual''s derivative by omega is that of differences', by_omega)])

contains

  !> A balance evaluated at a random motion.
  subroutine prepare(preload, balance, motion, kind, high, unit)
    !> Added to every contact
    real(wp), intent(in) :: preload
    type(balance_type), intent(out) :: balance
    real(wp), intent(out) :: motion(k, rows)
    !> Of damping; viscous, coupling the modes, unless given
    integer, intent(in), optional :: kind
    !> Coordinates with high frequencies, besides the frame's
    integer, intent(in), optional :: high
    !> Of force, in which all are stated: 1 unless given
    real(wp), intent(in), optional :: unit
    type(scene_type) :: scene

    if (present(high)) then
      scene = rubbing_frame_with_high_modes(high)
    else
      scene = rubbing_frame()
    end if
    scene%contacts%law%preload = scene%contacts%law%preload + preload
    if (present(kind)) then
      call damp(scene, kind, 0.05_wp)
    else
      call damp(scene, damping_viscous, 0.05_wp)
    end if
    if (present(unit)) call restate(scene, unit)
    call evaluate_at_random(scene, balance, motion)
  end subroutine prepare

  subroutine compare(error, balance, motion)
    type(error_type), allocatable, intent(inout) :: error
    type(balance_type), intent(inout) :: balance
    real(wp), intent(in) :: motion(k, rows)
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step, back
    real(wp) :: dense(n + 1, n + 1), solution(n + 1, 1)
    integer :: iterations, status

    constraint = random_constraint()
    right = random_right(balance)
    step = right
    back = right
    call solve_linearised(balance, constraint, right, linear_options_type(), step, iterations, status)
    call check(error, status == 0, 'the condensed system is singular')
    call apply_linearised(balance, constraint, step, back)
    ! The condition of the system, some 1e2, times rounding.
    call check_close(error, packed(back), packed(right), 1.0e-12_wp*maxval(abs(packed(step))), 'the step put back')
    call difference(balance, motion, dense(:n, :))
    dense(n + 1, :) = 0.0_wp
    dense(n + 1, :k*rows) = reshape(constraint%motion, [k*rows])
    dense(n + 1, n + 1) = constraint%frequency
    solution(:, 1) = packed(right)
    call solve_dense(dense, solution, status)
    call check_close(error, packed(step), solution(:, 1), tolerance*maxval(abs(solution)), 'step')
  end subroutine compare

  !> The residual's Jacobian by motion, sliders and, last, omega.
  subroutine difference(balance, motion, jacobian)
    type(balance_type), intent(inout) :: balance
    real(wp), intent(in) :: motion(k, rows)
    real(wp), intent(out) :: jacobian(:, :)
    real(wp) :: moved(n + 1), sides(n, 2), shift, sliders(2, contacts), rest(2, contacts)
    integer :: i, j, side, status

    sliders = balance%slider
    do i = 1, n + 1
      do side = 1, 2
        shift = (3 - 2*side)*increment
        moved = [motion, sliders, omega]
        moved(i) = moved(i) + shift
        rest = reshape(moved(k*rows + 1:n), [2, contacts])
        do j = 1, contacts
          balance%slider(:, j) = merge(rest(:, j), sliders(:, j), balance%periodic(j))
        end do
        call balance%evaluate(reshape(moved(:k*rows), [k, rows]), moved(n + 1), status)
        do j = 1, contacts
          if (balance%periodic(j)) rest(:, j) = -balance%forces(j)%moved
        end do
        sides(:, side) = [balance%residual, rest]
      end do
      jacobian(:, i) = (sides(:, 1) - sides(:, 2))/(2.0_wp*increment)
    end do
    balance%slider = sliders
    call balance%evaluate(motion, omega, status)
  end subroutine difference

  subroutine periodic_sliders(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows)
    integer :: i, status

    call prepare(0.0_wp, balance, motion)
    balance%periodic = balance%law%tangents == 2
    call balance%evaluate(motion, omega, status)
    call check(error, all([(balance%forces(i)%follows() .eqv. balance%periodic(i), i=1, contacts)]), &
               'not all follow: the test is void')
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine periodic_sliders

  !> The same elimination on the same numbers: only their order differs, within rounding times the condition, some 1e2.
  subroutine kept_factors(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(elimination_type) :: factors
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, fresh, step
    real(wp) :: motion(k, rows), work(0:2)
    integer :: i, iterations, status

    call prepare(0.0_wp, balance, motion)
    constraint = random_constraint()
    do i = 1, 2
      right = random_right(balance)
      fresh = right
      step = right
      call solve_linearised(balance, constraint, right, linear_options_type(), fresh, iterations, status)
      work(0) = balance%work
      call solve_linearised(balance, constraint, right, linear_options_type(), step, iterations, status, factors=factors)
      work(i) = balance%work - work(0)
      call check(error, status == 0 .and. factors%is_made, 'factors are made and kept')
      call check_close(error, packed(step), packed(fresh), 1.0e-12_wp*maxval(abs(packed(fresh))), 'step')
    end do
    call check(error, work(2) < 0.5_wp*work(1), 'factors that are there cost nothing')
    call balance%destroy()
  end subroutine kept_factors

  !> GMRES to a tight tolerance against elimination.
  subroutine by_krylov(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(unknowns_type) :: right, eliminated, step
    real(wp) :: motion(k, rows)
    integer :: kind, i, iterations, status

    do i = 1, 4
      kind = merge(damping_viscous, damping_ratio, i <= 2)
      call prepare(0.0_wp, balance, motion, kind)
      balance%periodic = balance%law%tangents == 2
      call balance%evaluate(motion, omega, status)
      if (modulo(i, 2) == 0) balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
      call balance%evaluate(motion, omega, status)
      right = random_right(balance)
      eliminated = right
      step = right
      call solve_linearised(balance, random_constraint(), right, linear_options_type(), eliminated, iterations, status)
      call check(error, iterations == 0, 'elimination does not iterate')
      call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-13_wp), step, iterations, status)
      call check(error, status == 0 .and. iterations > 3, 'GMRES was not needed: the test is void')
      call check_close(error, packed(step), packed(eliminated), 1.0e-10_wp*maxval(abs(packed(eliminated))), 'step')
      call balance%destroy()
    end do
  end subroutine by_krylov

  !> GMRES leaves its tolerance of the right-hand side, products leave the same of each mode's part in the step: both of the
  !> step's size.
  subroutine high_modes(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: krylov_tolerance = 1.0e-4_wp
    type(balance_type) :: balance
    type(unknowns_type) :: right, step, back
    real(wp) :: motion(k, rows)
    integer :: i, iterations, status

    do i = 1, 2
      call prepare(0.0_wp, balance, motion, damping_ratio, 100)
      if (i == 2) balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
      call balance%evaluate(motion, omega, status)
      right = random_right(balance)
      step = right
      back = right
      call solve_linearised(balance, random_constraint(), right, by_gmres(krylov_tolerance), step, iterations, status)
      call check(error, status == 0 .and. balance%split%in_use, 'no modes are summed: the test is void')
      call apply_linearised(balance, random_constraint(), step, back)
      call check_close(error, packed(back), packed(right), 2.0_wp*krylov_tolerance*norm2(packed(step)), 'the step put back')
      call balance%destroy()
    end do
  end subroutine high_modes

  !> With all contacts in one block nothing is left to iterate for but the rounding of its factors: 6e-8 times their condition, some
  !> 1e2.
  subroutine exact_preconditioner(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(unknowns_type) :: right, step
    real(wp) :: motion(k, rows)
    integer :: iterations, status

    call prepare(0.0_wp, balance, motion, damping_ratio)
    right = random_right(balance)
    step = right
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, in_one_block=.true.), step, iterations, status)
    call check(error, status == 0 .and. iterations == 1, 'it iterates')
    call balance%destroy()
  end subroutine exact_preconditioner

  !> Other contacts move and the frequency has changed: GMRES leaves its tolerance of the right-hand side all the same.
  subroutine kept_preconditioner(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: krylov_tolerance = 1.0e-4_wp
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, step, back
    real(wp) :: motion(k, rows)
    real(wp) :: flops
    integer :: i, active, iterations, status

    do i = 1, 2
      call prepare(0.0_wp, balance, motion, damping_ratio)
      balance%slider = 0.0_wp
      if (i == 2) motion = 0.3_wp*motion
      call balance%evaluate(motion, omega, status)
      call kept%blocks%discard()
      right = random_right(balance)
      step = right
      back = right
      call solve_linearised(balance, random_constraint(), right, by_gmres(krylov_tolerance), step, iterations, status, kept)
      flops = kept%blocks%flops
      ! They were given up at once: a few blocks are made in no time.
      call kept%blocks%set_worth(1000)
      active = balance%active%count
      motion = motion*merge(0.3_wp, 1.5_wp, i == 1)
      call balance%evaluate(motion, 1.02_wp*omega, status)
      call check(error, active /= balance%active%count, 'the same contacts move: the test is void')
      call solve_linearised(balance, random_constraint(), right, by_gmres(krylov_tolerance), step, iterations, status, kept)
      call check(error, status == 0 .and. abs(flops - kept%blocks%flops) <= 0.0_wp, 'it was made again: the test is void')
      call apply_linearised(balance, random_constraint(), step, back)
      call check_close(error, packed(back), packed(right), 2.0_wp*krylov_tolerance*norm2(packed(step)), 'the step put back')
      call balance%destroy()
    end do
  end subroutine kept_preconditioner

  !> Where nothing but means moves, X^-1 undoes the system at harmonic 0, and R'_0 f is the motion of what that gives.
  subroutine means_alone(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type), target :: balance
    type(condensed_operator_type) :: system
    type(mean_response_type) :: of_mean
    real(wp), allocatable :: y(:, :), product(:, :), z(:), moved(:)
    complex(wp), allocatable :: response(:, :)
    real(wp) :: motion(k, rows), last
    integer :: i, damping

    do i = 1, 2
      damping = merge(damping_viscous, damping_ratio, i == 1)
      call prepare(0.0_wp, balance, motion, damping)
      call of_mean%make(balance, 0.0_wp)
      system = new_condensed_operator(balance, new_border(balance, random_constraint()), 0.0_wp, 1.0e-4_wp)
      call check(error, of_mean%is_made .and. size(system%column, 2) > 1, 'nothing slips: the test is void')
      allocate (y, product, source=0.0_wp*system%column)
      allocate (response, mold=balance%response)
      z = system%column(2, :)
      y(1, :) = of_mean%solve(balance%ranks, of_mean%places_of(balance), z)
      call system%apply(y, 0.0_wp, product, last)
      ! The condition of the system, some 1e2, times rounding.
      call check_close(error, product(1, :), z, 1.0e-12_wp*maxval(abs(y)), 'the mean put back')
      call balance%respond_to_active(y, response)
      y = -balance%active%contact_rows%motion_of(response)
      moved = of_mean%motion_of(balance%ranks, of_mean%places_of(balance), z)
      call check_close(error, moved, y(1, :), 1.0e-12_wp*maxval(abs(moved)), 'mean motion')
      deallocate (y, product, response)
      call balance%destroy()
    end do
  end subroutine means_alone

  !> Iterations beyond those of the first solve add up; contacts shared out again, and springs kept, count at once.
  subroutine worn_preconditioner(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(contact_blocks_type) :: factors
    type(mean_contacts_type) :: stuck
    real(wp) :: motion(k, rows)
    integer :: i, status

    call prepare(0.0_wp, balance, motion)
    call check(error, .not. factors%serve(balance, 0.0_wp), 'nothing serves')
    call factors%make(balance, 0.0_wp, stuck, mean_response_type(), 1, status)
    do i = 1, 20
      call factors%count(10)
    end do
    call check(error, status == 0 .and. factors%serve(balance, 0.0_wp), 'what takes the usual iterations is given up')
    call factors%count(10 + (factors%patience() - 10)/2)
    call check(error, factors%serve(balance, 0.0_wp), 'it is given up too early')
    call factors%count(factors%patience())
    call check(error, .not. factors%serve(balance, 0.0_wp), 'it is not given up')
    call factors%make(balance, 0.0_wp, stuck, mean_response_type(), 1, status)
    call check(error, .not. factors%serve(balance, 0.1_wp), 'it serves other springs')
    balance%changes = balance%changes + 1
    call check(error, .not. factors%serve(balance, 0.0_wp), 'it serves other contacts')
    call balance%destroy()
  end subroutine worn_preconditioner

  !> Units that are powers of two and of four change no digit: GMRES is to see the same system.
  subroutine any_unit(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, step(3)
    real(wp) :: motion(k, rows)
    integer :: i, iterations(3), status

    do i = 1, 3
      call prepare(0.0_wp, balance, motion, damping_ratio, 30, 4.0_wp**(10*(i - 2)))
      right = random_right(balance)
      step(i) = right
      kept = preconditioners_type()
      call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-4_wp), step(i), iterations(i), status, kept)
      motion = 0.8_wp*motion
      call balance%evaluate(motion, omega, status)
      call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-4_wp), step(i), iterations(i), status, kept)
      call check(error, status == 0 .and. iterations(i) > 3, 'GMRES was not needed: the test is void')
      call balance%destroy()
    end do
    call check(error, all(iterations == iterations(2)), 'the number of iterations depends on the unit')
    ! Rounding of eigenvectors, whose scaled problem may be worked at in another order, times the condition of the system.
    call check_close(error, packed(step(1)), packed(step(2)), 1.0e-10_wp*maxval(abs(packed(step(2)))), 'step, small forces')
    call check_close(error, packed(step(3)), packed(step(2)), 1.0e-10_wp*maxval(abs(packed(step(2)))), 'step, large forces')
  end subroutine any_unit

  !> The step it has come to is handed out all the same.
  subroutine unfinished(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, step
    real(wp) :: motion(k, rows)
    integer :: iterations, status

    call prepare(0.0_wp, balance, motion)
    right = random_right(balance)
    step = right
    call solve_linearised(balance, random_constraint(), right, linear_options_type(dense_limit=0, krylov=krylov_options_type( &
                          tolerance=1.0e-13_wp, max_iterations=2)), step, iterations, status, kept)
    call check(error, status == 0 .and. iterations >= 2 .and. norm2(step%motion) > 0.0_wp, 'it is not handed out')
    call check(error, .not. kept%blocks%serve(balance, 0.0_wp), 'its preconditioner is kept')
    call balance%destroy()
  end subroutine unfinished

  subroutine lively(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows)

    call prepare(0.0_wp, balance, motion)
    call check(error, count(balance%forces%slip > 0.1_wp) >= 2 .and. any(balance%forces%open > 0.1_wp) .and. &
               any(balance%forces%state == state_stuck), 'not all kinds of contact: the test is void')
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine lively

  subroutine frozen(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows)
    integer :: status

    call prepare(0.0_wp, balance, motion)
    balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
    call balance%evaluate(motion, omega, status)
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine frozen

  subroutine all_stuck(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step
    real(wp) :: motion(k, rows)
    integer :: iterations, status

    call prepare(100.0_wp, balance, motion)
    call check(error, all(balance%forces%state == state_stuck), 'a contact moves: the test is void')
    constraint = random_constraint()
    constraint%motion = 0.0_wp
    right = random_right(balance)
    right%omega = 0.0_wp
    step = right
    call solve_linearised(balance, constraint, right, linear_options_type(), step, iterations, status)
    call check_close(error, packed(step), packed(right), 0.0_wp, 'step')
    call compare(error, balance, motion)
    call balance%destroy()
  end subroutine all_stuck

  subroutine fixed_frequency(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(constraint_type) :: constraint
    type(unknowns_type) :: right, step
    real(wp) :: motion(k, rows)
    integer :: iterations, status

    call prepare(0.0_wp, balance, motion)
    constraint = random_constraint()
    constraint%motion = 0.0_wp
    right = random_right(balance)
    right%omega = 0.0_wp
    step = right
    call solve_linearised(balance, constraint, right, linear_options_type(), step, iterations, status)
    call check_close(error, step%omega, 0.0_wp, 0.0_wp, 'step of omega')
    call balance%destroy()
  end subroutine fixed_frequency

  subroutine by_omega(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    real(wp) :: motion(k, rows), expected(k, rows), jacobian(n, n + 1)

    call prepare(0.0_wp, balance, motion)
    expected = balance%residual_omega()
    call difference(balance, motion, jacobian)
    call check_close(error, expected, reshape(jacobian(:k*rows, n + 1), [k, rows]), tolerance, 'derivative')
    call balance%destroy()
  end subroutine by_omega
end program test_linearised_step
