!> Contacts that stay open taken out of the condensed system: the structure without their springs, and steps preconditioned by it.
program test_tangent_reference
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  use attrito_core_state_store, only: state_store_type, reading_store, writing_store
  use attrito_model_contacts, only: stuck_stiffness
  use attrito_model_structure, only: damping_viscous, damping_mass, damping_ratio
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: solve_linearised
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use attrito_balance_unknowns, only: unknowns_type
  use random_steps, only: harmonics, k, rows, omega, evaluate_at_random, random_constraint, random_right, packed, by_gmres, &
                          check_by_elimination
  use scenes, only: scene_type, rubbing_frame, damp
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  !> A gap that no motion here closes
  real(wp), parameter :: far = 100.0_wp
  !> Rows of the second contact and of the fourth
  integer, parameter :: opened(6) = [3, 4, 5, 8, 9, 10]

  call run_in_session('tangent reference', [ &
                      test('without springs the receptance is that of the structure without them', without_springs), &
                      test('a body that is free without springs has no receptance without them', free_body), &
                      test('where damping couples no modes one iteration solves what is not open', one_iteration), &
                      test('the step is that of elimination, modes uncoupled or not, the mean frozen or not', as_by_elimination), &
                      test('a contact that is open in the reference may touch or stick, and the step stays what it is', touching), &
                      test('where no contact is open there is no reference', nothing_open), &
                      test('springs kept in the step, or beside the structure''s own, are left to two levels', other_springs), &
                      test('a reference that was saved and loaded gives the same step bit for bit', saved)])

contains

  !> A balance evaluated at a random motion in which the second and the fourth contact stay open.
  subroutine prepare(kind, ratio, balance, motion)
    !> Of damping, and how much
    integer, intent(in) :: kind
    real(wp), intent(in) :: ratio
    type(balance_type), intent(out) :: balance
    real(wp), intent(out) :: motion(k, rows)
    type(scene_type) :: scene

    scene = rubbing_frame()
    scene%contacts%law([2, 4])%gap = far
    call damp(scene, kind, ratio)
    call evaluate_at_random(scene, balance, motion)
  end subroutine prepare

  !> Against the dense inverse of K~ - B^T k B - (h omega)^2 M + i h omega alpha M.
  subroutine without_springs(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(stuck_system_type) :: stuck
    class(receptance_type), allocatable :: receptance, less
    type(error_type), allocatable :: fault
    complex(wp) :: block(rows, rows)
    complex(wp), allocatable :: system(:, :), columns(:, :)
    real(wp), allocatable :: stiffness(:, :)
    integer, allocatable :: pivots(:)
    integer :: all_rows(rows), i, kind, h, status

    all_rows = [(i, i=1, rows)]
    do kind = 1, 2
      scene = rubbing_frame()
      ! The second kind is factored, harmonic by harmonic; its modes are coupled by no damping here.
      if (kind == 1) call damp(scene, damping_mass, 0.3_wp)
      if (kind == 2) call damp(scene, damping_viscous, 0.0_wp)
      call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
      call new_receptance(scene%structure, scene%contacts, stuck, harmonics, receptance)
      call receptance%without_springs(opened, scene%contacts%row_stiffness(opened), less)
      call less%set_frequency(omega, status)
      call check(error, status == 0, 'it is singular')
      stiffness = stuck_stiffness(scene%contacts, scene%structure%stiffness, .true.)
      associate (directions => scene%contacts%directions(:, opened))
        stiffness = stiffness - matmul(directions*spread(scene%contacts%row_stiffness(opened), 1, size(directions, 1)), &
                                       transpose(directions))
      end associate
      do h = 0, harmonics
        associate (mass => scene%structure%mass, alpha => merge(0.3_wp, 0.0_wp, kind == 1))
          system = cmplx(stiffness - (h*omega)**2*mass, alpha*h*omega*mass, wp)
        end associate
        columns = scene%contacts%directions
        if (allocated(pivots)) deallocate (pivots)
        allocate (pivots(size(system, 1)))
        call factor_complex(system, pivots, status)
        call solve_factored_complex(system, pivots, columns)
        columns = matmul(transpose(scene%contacts%directions), columns)
        call less%block_between(h, all_rows, all_rows, block)
        ! Condition of the system times rounding.
        call check_close(error, block, columns, 1.0e-11_wp*maxval(abs(columns)), 'receptance')
      end do
    end do
  end subroutine without_springs

  !> Twice the springs that there are leave no structure.
  subroutine free_body(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    class(receptance_type), allocatable :: less
    real(wp) :: motion(k, rows)
    integer :: i

    call prepare(damping_mass, 0.1_wp, balance, motion)
    call balance%receptance%without_springs([(i, i=1, rows)], [(1.0e3_wp, i=1, rows)], less)
    call check(error, .not. allocated(less), 'there is one')
    call balance%destroy()
  end subroutine free_body

  !> The rest are factors in single precision: 6e-8 times the condition, some 1e2.
  subroutine one_iteration(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, step
    real(wp) :: motion(k, rows)
    integer :: iterations, status

    call prepare(damping_mass, 0.1_wp, balance, motion)
    call check(error, all(balance%forces([2, 4])%open >= 1.0_wp) .and. any(balance%forces([1, 3])%open < 1.0_wp) .and. &
               any(balance%forces%slip > 0.1_wp), 'not all kinds of contact: the test is void')
    right = random_right(balance)
    step = right
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), step, iterations, status, kept)
    call check(error, allocated(kept%reference%receptance), 'it has no reference')
    call check(error, all(kept%reference%opened .eqv. [.false., .true., .false., .true.]), 'other contacts are open in it')
    call check(error, status == 0 .and. iterations == 1, 'it iterates')
    call balance%destroy()
  end subroutine one_iteration

  subroutine as_by_elimination(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    real(wp) :: motion(k, rows)
    integer :: i, status

    do i = 1, 4
      kept = preconditioners_type()
      call prepare(merge(damping_viscous, damping_ratio, i <= 2), 0.05_wp, balance, motion)
      if (modulo(i, 2) == 0) balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
      call balance%evaluate(motion, omega, status)
      call check_by_elimination(error, balance, kept)
      call check(error, allocated(kept%reference%receptance), 'it has no reference')
      call balance%destroy()
    end do
  end subroutine as_by_elimination

  !> The gap of one is closed afterwards, at first a little, then so far that it sticks.
  subroutine touching(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    real(wp) :: motion(k, rows)
    integer :: i, status

    call prepare(damping_mass, 0.1_wp, balance, motion)
    do i = 1, 3
      if (i == 2) balance%law(2)%gap = 0.0_wp
      if (i == 3) balance%law(2)%preload = far
      call balance%evaluate(motion, omega, status)
      call check_by_elimination(error, balance, kept)
      call check(error, all(kept%reference%opened .eqv. [.false., .true., .false., .true.]), &
                 'another reference was taken: the test is void')
      call check(error, i == 1 .or. balance%forces(2)%open < 1.0_wp, 'it does not touch: the test is void')
      call check(error, i < 3 .or. .not. allocated(balance%forces(2)%jacobian), 'it does not stick: the test is void')
    end do
    call balance%destroy()
  end subroutine touching

  subroutine nothing_open(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, step
    real(wp) :: motion(k, rows)
    integer :: i, iterations, status

    call prepare(damping_mass, 0.1_wp, balance, motion)
    balance%law([2, 4])%gap = 0.0_wp
    call balance%evaluate(motion, omega, status)
    right = random_right(balance)
    step = right
    do i = 1, 20
      call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), step, iterations, status, kept)
    end do
    call check(error, .not. allocated(kept%reference%receptance), 'there is one')
    call balance%destroy()
  end subroutine nothing_open

  subroutine other_springs(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    real(wp) :: motion(k, rows)
    logical :: serves

    call prepare(damping_mass, 0.1_wp, balance, motion)
    call kept%reference%prepare(balance, 0.0_wp, 60, serves)
    call check(error, serves, 'it does not serve at all: the test is void')
    call kept%reference%prepare(balance, 1.0e-7_wp, 60, serves)
    call check(error, serves, 'it does not serve where hardly anything of the springs is kept')
    call kept%reference%prepare(balance, 0.1_wp, 60, serves)
    call check(error, .not. serves, 'it serves where springs are kept')
    call balance%apply_mean_springs(0.5_wp)
    call kept%reference%prepare(balance, 0.0_wp, 60, serves)
    call check(error, .not. serves, 'it serves where springs hold the mean')
    call balance%destroy()
  end subroutine other_springs

  subroutine saved(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept, loaded
    type(unknowns_type) :: right, step, again
    type(state_store_type) :: store
    real(wp) :: motion(k, rows)
    integer :: iterations, status

    call prepare(damping_ratio, 0.1_wp, balance, motion)
    right = random_right(balance)
    step = right
    again = right
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), step, iterations, status, kept)
    store = writing_store()
    call kept%keep(store)
    store = reading_store(store%numbers(:store%position))
    call loaded%keep(store)
    call check(error, store%is_read(), 'not all of it is read')
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), step, iterations, status, kept)
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), again, iterations, status, loaded)
    call check(error, allocated(loaded%reference%receptance), 'it has no reference')
    call check_close(error, packed(again), packed(step), 0.0_wp, 'step')
    call balance%destroy()
  end subroutine saved
end program test_tangent_reference
