!> Contacts in the mean over the period: what their springs lose, and steps preconditioned by the structure without it.
program test_mean_contacts
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type, reading_store, writing_store
  use attrito_model_structure, only: damping_viscous, damping_mass, damping_ratio
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_linearised_step, only: solve_linearised
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_balance_unknowns, only: unknowns_type
  use random_steps, only: k, rows, omega, evaluate_at_random, random_constraint, random_right, packed, by_gmres, check_by_elimination
  use scenes, only: scene_type, rubbing_frame, damp
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  !> Iterations on two levels that are too many
  real(wp), parameter :: many = 1000.0_wp
  !> A gap that no motion here closes
  real(wp), parameter :: far = 100.0_wp

  call run_in_session('mean contacts', [ &
                      test('an open contact has lost its springs, one that slips a part of the tangential one', springs), &
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
    call mean%take(balance, is_new)
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
    call mean%take(balance, is_new)
    call check(error, .not. is_new, 'the same contacts are taken twice')
    call balance%destroy()
  end subroutine springs

  subroutine as_by_elimination(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept
    real(wp) :: motion(k, rows)
    integer :: i, status

    do i = 1, 4
      kept = preconditioners_type(two_level_iterations=many)
      call prepare(merge(damping_viscous, damping_ratio, i <= 2), 0.0_wp, balance)
      motion = balance%recover(balance%response)
      if (modulo(i, 2) == 0) balance%frozen_mean = balance%response(:, lbound(balance%response, 2))
      call balance%evaluate(motion, omega, status)
      call check_by_elimination(error, balance, kept)
      call check(error, allocated(kept%mean%receptance), 'contacts in the mean do not serve')
      call balance%destroy()
    end do
  end subroutine as_by_elimination

  subroutine saved(error)
    type(error_type), allocatable, intent(out) :: error
    type(balance_type) :: balance
    type(preconditioners_type) :: kept, loaded
    type(unknowns_type) :: right, step, again
    type(state_store_type) :: store
    integer :: iterations, status

    call prepare(damping_ratio, 0.0_wp, balance)
    right = random_right(balance)
    step = right
    again = right
    kept%two_level_iterations = many
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), step, iterations, status, kept)
    store = writing_store()
    call kept%keep(store)
    store = reading_store(store%numbers(:store%position))
    call loaded%keep(store)
    call check(error, store%is_read(), 'not all of it is read')
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), step, iterations, status, kept)
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-5_wp, 2), again, iterations, status, loaded)
    call check(error, allocated(loaded%mean%receptance), 'contacts in the mean do not serve')
    call check_close(error, packed(again), packed(step), 0.0_wp, 'step')
    call balance%destroy()
  end subroutine saved
end program test_mean_contacts
