!> Contacts in the mean over the period: what their springs lose, and steps preconditioned by the structure without it.
program test_mean_contacts
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack_complex, only: factor_complex, solve_factored_complex
  use attrito_core_state_store, only: state_store_type, reading_store, writing_store
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use attrito_model_contacts, only: stuck_stiffness
  use attrito_model_structure, only: damping_viscous, damping_mass, damping_ratio
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: solve_linearised, stiffened
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_modal_response, only: rest_type
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_balance_unknowns, only: unknowns_type
  use random_steps, only: harmonics, k, rows, omega, evaluate_at_random, random_constraint, random_right, packed, by_gmres, &
                          check_by_elimination
  use scenes, only: scene_type, rubbing_frame, damp
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  !> Rows of the second contact and of the fourth
  integer, parameter :: opened(6) = [3, 4, 5, 8, 9, 10]
  !> A gap that no motion here closes
  real(wp), parameter :: far = 100.0_wp

  call run_in_session('mean contacts', [ &
                      test('an open contact has lost its springs, one that slips a part of the tangential one', springs), &
                      test('without springs the receptance is that of the structure without them', without_springs), &
                      test('a body that is free without springs has no receptance without them', free_body), &
                      test('modes at rest answer together as they do one by one', together), &
                      test('where damping couples no modes one iteration solves a step, springs kept in it or not', one_iteration), &
                      test('contacts that have changed leave the step what it is', touching), &
                      test('the step is that of elimination, modes uncoupled or not, the mean frozen or not', as_by_elimination), &
                      test('contacts that were saved and loaded give the same step bit for bit', saved)])

contains

  !> A balance evaluated at a random motion.
  subroutine prepare(kind, gap, balance)
    !> Of damping
    integer, intent(in) :: kind
    !> Of the second contact
    real(wp), intent(in) :: gap
    type(balance_type), intent(out) :: balance
    type(scene_type) :: scene
    real(wp) :: motion(k, rows)

    scene = rubbing_frame()
    scene%contacts%law(2)%gap = gap
    call damp(scene, kind, 0.05_wp)
    call evaluate_at_random(scene, balance, motion)
  end subroutine prepare

  subroutine springs(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(mean_contacts_type) :: mean
    real(wp) :: part(rows)
    logical :: is_new
    integer :: i

    call prepare(damping_mass, far, balance)
    call mean%take(balance, 0.0_wp, is_new)
    call check(error, is_new .and. allocated(mean%receptance), 'nothing is lost')
    if (allocated(error)) return
    part = mean%lost_of(balance)
    do i = 1, size(balance%law)
      associate (law => balance%law(i), forces => balance%forces(i), own => part(balance%law(i)%first_row:))
        associate (tangential => own(:law%tangents)/law%tangential_stiffness, normal => own(law%tangents + 1)/law%normal_stiffness)
          if (forces%open >= 1.0_wp) then
            ! Hardly anything is kept.
            call check_close(error, [tangential, normal], spread(1.0_wp, 1, law%tangents + 1), 1.0e-7_wp, 'open')
          else
            call check(error, all(tangential >= 0.0_wp .and. tangential < 1.0_wp - 1.0e-7_wp), 'a part of a spring')
          end if
        end associate
      end associate
    end do
    call mean%take(balance, 0.0_wp, is_new)
    call check(error, .not. is_new, 'the same contacts are taken twice')
    call balance%destroy()
  end subroutine springs

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
    integer :: i

    call prepare(damping_mass, far, balance)
    call balance%receptance%without_springs([(i, i=1, rows)], [(1.0e3_wp, i=1, rows)], less)
    call check(error, .not. allocated(less), 'there is one')
    call balance%destroy()
  end subroutine free_body

  !> The lower the frequency, the more modes are at rest: together with those that move they are the receptance at rest.
  subroutine together(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(mean_contacts_type) :: mean
    type(rest_type) :: rest
    real(wp), allocatable :: shapes(:, :), stiffness(:), mass(:), damping(:)
    complex(wp) :: block(rows, rows)
    logical :: is_new, have_some, have_none
    integer :: i, status, all_rows(rows)

    all_rows = [(i, i=1, rows)]
    have_some = .false.
    have_none = .false.
    call prepare(damping_mass, far, balance)
    call mean%take(balance, 0.0_wp, is_new)
    do i = 1, 12
      call mean%receptance%set_frequency(0.5_wp**i*omega, status)
      call rest%prepare(mean%receptance, mean%made, balance)
      if (.not. allocated(rest%flexibility)) cycle
      have_some = have_some .or. rest%low > 0
      have_none = have_none .or. rest%low == 0
      shapes = mean%receptance%mode_shapes(1, rest%low, all_rows)
      call mean%receptance%uncoupled_modes(stiffness, mass, damping)
      call mean%receptance%block_between(0, all_rows, all_rows, block)
      ! Single precision.
      call check_close(error, rest%flexibility + matmul(transpose(shapes), shapes/spread(stiffness(:rest%low), 2, rows)), &
                       real(block, wp), 1.0e-6_wp*maxval(abs(block)), 'receptance at rest')
    end do
    if (.not. allocated(error)) call check(error, have_some .and. have_none, 'all modes move, or none: the test is void')
    call balance%destroy()
  end subroutine together

  !> Contacts in the mean and one block of all of them are the whole system, in single precision: 6e-8 times its condition, some 1e2.
  subroutine one_iteration(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    type(unknowns_type) :: right, step
    real(wp) :: stiffening
    logical :: is_new
    integer :: i, iterations, status

    do i = 1, 3
      stiffening = merge(0.2_wp, 0.0_wp, i == 3)
      kept = preconditioners_type()
      call prepare(damping_mass, far, balance)
      if (i > 1) call kept%mean%take(balance, stiffening, is_new)
      right = random_right(balance)
      step = right
      call solve_linearised(balance, random_constraint(), right, stiffened(by_gmres(1.0e-4_wp, in_one_block=.true.), stiffening), &
                            step, iterations, status, kept)
      call check(error, allocated(kept%mean%receptance) .eqv. i > 1, 'contacts in the mean do not serve')
      call check(error, status == 0 .and. iterations == 1, 'it iterates')
      call balance%destroy()
    end do
  end subroutine one_iteration

  subroutine as_by_elimination(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    real(wp) :: motion(k, rows)
    logical :: is_new
    integer :: i, status

    do i = 1, 4
      kept = preconditioners_type()
      call prepare(merge(damping_viscous, damping_ratio, i <= 2), 0.0_wp, balance)
      motion = balance%recover(balance%response)
      if (modulo(i, 2) == 0) balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
      call balance%evaluate(motion, omega, status)
      call kept%mean%take(balance, 0.0_wp, is_new)
      call check_by_elimination(error, balance, kept)
      call check(error, allocated(kept%mean%receptance), 'contacts in the mean do not serve')
      call balance%destroy()
    end do
  end subroutine as_by_elimination

  !> The second contact was open, then its gap is closed: at first it touches for a part of the period, then it sticks.
  subroutine touching(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    real(wp) :: motion(k, rows), before(rows)
    logical :: is_new
    integer :: i, status

    do i = 1, 3
      kept = preconditioners_type()
      call prepare(damping_mass, far, balance)
      motion = balance%recover(balance%response)
      call balance%evaluate(motion, omega, status)
      call kept%mean%take(balance, 0.0_wp, is_new)
      before = kept%mean%lost_of(balance)
      if (i == 2) balance%law(2)%gap = 0.0_wp
      if (i == 3) balance%law(2)%preload = 2.0_wp*far*balance%law(2)%normal_stiffness
      call balance%evaluate(motion, omega, status)
      call check_by_elimination(error, balance, kept)
      call check_close(error, kept%mean%lost_of(balance), before, 0.0_wp, 'springs lost, others: the test is void')
      call check(error, i == 1 .or. balance%forces(2)%open < 1.0_wp, 'it does not touch: the test is void')
      call check(error, i < 3 .or. .not. allocated(balance%forces(2)%jacobian), 'it does not stick: the test is void')
      call balance%destroy()
    end do
  end subroutine touching

  subroutine saved(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept, loaded
    type(unknowns_type) :: right, step, again
    type(state_store_type) :: store
    logical :: is_new
    integer :: iterations, status

    call prepare(damping_ratio, 0.0_wp, balance)
    right = random_right(balance)
    step = right
    again = right
    call kept%mean%take(balance, 0.0_wp, is_new)
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp), step, iterations, status, kept)
    store = writing_store()
    call kept%keep(store)
    store = reading_store(store%numbers(:store%position))
    call loaded%keep(store)
    call check(error, store%is_read(), 'not all of it is read')
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp), step, iterations, status, kept)
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp), again, iterations, status, loaded)
    call check(error, allocated(loaded%mean%receptance), 'contacts in the mean do not serve')
    call check_close(error, packed(again), packed(step), 0.0_wp, 'step')
    call balance%destroy()
  end subroutine saved
end program test_mean_contacts
