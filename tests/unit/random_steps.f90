!> The linearised equations of a balance that was evaluated at a random motion, with random constraints and right-hand sides: of the
!> frame of `scenes`.
module random_steps
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_set_up, only: new_balance
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use attrito_newton_border, only: constraint_type
  use attrito_newton_condensed_krylov, only: krylov_options_type
  use attrito_newton_linearised_step, only: linear_options_type, solve_linearised
  use attrito_newton_preconditioners, only: preconditioners_type
  use scenes, only: scene_type, noise
  use session, only: only_me
  use testing, only: check, check_close
  implicit none
  private
  public :: harmonics, k, rows, contacts, n, omega
  public :: evaluate_at_random, random_constraint, random_right, packed, by_gmres, check_by_elimination

  !> Of the frame; k coefficients of each row, n motions and sliders
  integer, parameter :: harmonics = 2, k = 2*harmonics + 1, rows = 10, contacts = 4, n = k*rows + 2*contacts
  real(wp), parameter :: omega = 1.3_wp

contains

  subroutine evaluate_at_random(scene, balance, motion)
    type(scene_type), intent(in) :: scene
    type(balance_type), intent(out) :: balance
    !> Of the contacts
    real(wp), intent(out) :: motion(k, rows)
    type(stuck_system_type) :: stuck
    class(receptance_type), allocatable :: receptance
    type(error_type), allocatable :: fault
    integer :: status

    call new_stuck_system(scene%structure, scene%contacts, .true., stuck, fault)
    call new_receptance(scene%structure, scene%contacts, stuck, harmonics, receptance)
    call new_balance(scene%structure, scene%contacts, receptance, only_me(), balance)
    motion = 0.7_wp*reshape(noise(k*rows, 11), [k, rows])
    balance%slider = 0.1_wp*reshape(noise(2*contacts, 14), [2, contacts])
    call balance%evaluate(motion, omega, status)
  end subroutine evaluate_at_random

  pure function random_constraint() result(constraint)
    type(constraint_type) :: constraint

    constraint%motion = reshape(noise(k*rows, 12), [k, rows])
    constraint%frequency = 0.8_wp
  end function random_constraint

  !> A right-hand side; only periodic sliders have one.
  function random_right(balance) result(right)
    type(balance_type), intent(in) :: balance
    type(unknowns_type) :: right
    integer :: i

    right%motion = reshape(noise(k*rows, 13), [k, rows])
    right%slider = reshape(noise(2*contacts, 15), [2, contacts])
    do i = 1, contacts
      if (.not. balance%periodic(i)) right%slider(:, i) = 0.0_wp
    end do
    right%omega = 0.4_wp
  end function random_right

  !> All unknowns in one column.
  pure function packed(unknowns)
    type(unknowns_type), intent(in) :: unknowns
    real(wp) :: packed(n + 1)

    packed = [unknowns%motion, unknowns%slider, unknowns%omega]
  end function packed

  !> Always by GMRES, to a tolerance, contacts in one block or each in its own.
  pure type(linear_options_type) function by_gmres(tolerance, in_one_block)
    real(wp), intent(in) :: tolerance
    logical, intent(in), optional :: in_one_block

    by_gmres = linear_options_type(dense_limit=0, krylov=krylov_options_type(tolerance=tolerance, largest_block=1))
    if (.not. present(in_one_block)) return
    if (in_one_block) by_gmres%krylov%largest_block = huge(1)
  end function by_gmres

  !> GMRES to a tight tolerance against elimination.
  subroutine check_by_elimination(error, balance, kept)
    type(error_type), allocatable, intent(inout) :: error
    type(balance_type), intent(inout) :: balance
    !> Of GMRES
    type(preconditioners_type), intent(inout) :: kept
    type(unknowns_type) :: right, eliminated, step
    integer :: iterations, status

    right = random_right(balance)
    eliminated = right
    step = right
    call solve_linearised(balance, random_constraint(), right, linear_options_type(), eliminated, iterations, status)
    call check(error, iterations == 0, 'elimination does not iterate')
    call solve_linearised(balance, random_constraint(), right, by_gmres(1.0e-13_wp), step, iterations, status, kept)
    call check(error, status == 0, 'it is singular')
    call check_close(error, packed(step), packed(eliminated), 1.0e-10_wp*maxval(abs(packed(eliminated))), 'step')
  end subroutine check_by_elimination
end module random_steps
