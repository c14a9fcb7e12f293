!> Newton's method from motion in time, for points that no point before leads to: it begins where the solver stands, at the start of a
!> period,
!>
!> $$ q = \mathrm{Re} \sum_h X_h, \qquad \dot q = \mathrm{Re} \sum_h i h \omega X_h, $$
!>
!> and runs on under the loads of the point that is looked for until Newton's method converges from what it has come to; then, since
!> the point before may lead to another motion, once more from rest, q = X_0 and q' = 0.
module attrito_solve_time_integration_start
  use attrito_core_kinds, only: wp
  use attrito_solve_mean_regularisation, only: let_walk
  use attrito_solve_time_integrator, only: excitation_type, periods_type
  use attrito_solve_snapshot, only: place_type, place_of, return_to
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: has_time, solve_in_time

  !> Stretches of motion in time that Newton's method starts from, all but every third briefly; how many where hardly anything is
  !> hoped for
  integer, parameter :: attempts_in_time = 12, full_attempt = 3, attempts_lost = 3, attempts_from_rest = 4
  !> Periods averaged at first, and after how many attempts they double: the longer a motion wanders, the longer its mean takes
  integer, parameter :: periods_averaged = 5, attempts_alike = 4
  !> Stretches one after another that walk, and are then known to; change over a period of a motion that has settled
  integer, parameter :: attempts_walking = 3
  real(wp), parameter :: settled = 1.0e-3_wp
  !> Binary digits of the largest number of a state that motion in time starts from
  integer, parameter :: digits_at_start = 34

contains

  !> Can motion in time give starts? A mean that is frozen has none.
  pure logical function has_time(solver)
    type(solver_type), intent(in) :: solver

    has_time = allocated(solver%in_time) .and. .not. solver%options%uncoupled
  end function has_time

  !> Newton's method from motion in time, which begins where the solver stands and runs on until that converges, or is seen to walk.
  subroutine solve_in_time(solver, omega, walked, lost, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Did the point before walk? Then springs on the mean tell after every stretch whether this one does.
    logical, intent(in) :: walked
    !> Is hardly anything hoped for? Then it does not go on for long.
    logical, intent(in) :: lost
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    type(place_type) :: before

    before = place_of(solver)
    call run_and_solve(solver, omega, merge(attempts_lost, attempts_in_time, lost .or. solver%walks), walked, iterations, converged)
    if (converged .or. lost .or. walked .or. solver%walks) return
    call return_to(solver, before)
    solver%motion(2:, :) = 0.0_wp
    call run_and_solve(solver, omega, attempts_from_rest, walked, iterations, converged)
  end subroutine solve_in_time

  !> So many stretches from where the solver stands.
  subroutine run_and_solve(solver, omega, attempts, walked, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    integer, intent(in) :: attempts
    logical, intent(in) :: walked
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    type(periods_type) :: periods
    integer :: attempt, walking

    call stand_in_time(solver, converged)
    if (.not. converged) return
    walking = 0
    do attempt = 1, attempts
      call move_on(solver, omega, periods_averaged*2**((attempt - 1)/attempts_alike), periods)
      converged = .false.
      if (.not. periods%moved) exit
      solver%brief = modulo(attempt, full_attempt) /= 0 .or. solver%walks
      call solver%solve_at(omega)
      iterations = iterations + solver%report%iterations
      converged = solver%report%converged
      if (.not. converged .and. (walked .or. .not. solver%brief)) call let_walk(solver, omega, iterations, converged)
      solver%brief = .false.
      if (converged .or. (walked .and. solver%walks)) exit
      walking = merge(walking + 1, 0, periods%walks)
      if (walking == attempts_walking) solver%walks = .true.
      if (solver%walks .and. attempt >= attempts_lost) exit
    end do
    solver%no_orbit = solver%walks .or. (.not. converged .and. periods%moved .and. periods%change > settled)
  end subroutine run_and_solve

  !> Numbers without the digits that depend on the order of sums over ranks: these would grow in motion that is unstable.
  pure function rounded(numbers)
    real(wp), intent(in) :: numbers(:)
    real(wp) :: rounded(size(numbers)), unit

    unit = scale(1.0_wp, exponent(maxval([0.0_wp, abs(numbers)])) - digits_at_start)
    rounded = unit*anint(numbers/unit)
  end function rounded

  !> A stretch of motion in time; the solver stands at its mean.
  subroutine move_on(solver, omega, count, periods)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Periods averaged
    integer, intent(in) :: count
    type(periods_type), intent(out) :: periods

    associate (balance => solver%context%balance)
      call solver%in_time%run_on(excitation_type(omega, balance%static_factors, balance%level), balance%receptance%harmonics, &
                                 count, periods)
      if (.not. periods%moved) return
      solver%motion = periods%motion(:, balance%first_row:balance%first_row + balance%rows() - 1)
      call solver%set_slider(periods%slider(:, balance%first_contact:balance%first_contact + size(balance%law) - 1))
    end associate
  end subroutine move_on

  !> Let motion in time stand where the solver does, at the start of a period.
  subroutine stand_in_time(solver, stands)
    type(solver_type), intent(inout) :: solver
    !> .false.: the balance cannot be evaluated here
    logical, intent(out) :: stands
    real(wp), allocatable :: displacement(:), rate(:)
    real(wp) :: slider(2, size(solver%contacts%law)), moving
    integer :: h, status

    associate (balance => solver%context%balance)
      call balance%evaluate(solver%motion, solver%omega, status)
      call solver%context%forget()
      stands = status == 0
      if (.not. stands) return
      ! After the static solution it stands still, whatever the loads would do.
      moving = balance%ranks%largest(maxval([0.0_wp, abs(solver%motion(2:, :))]))
      if (moving <= 0.0_wp) balance%response(:, 1:) = 0.0_wp
      displacement = real(balance%response(:, 0), wp)
      rate = 0.0_wp*displacement
      do h = 1, ubound(balance%response, 2)
        displacement = displacement + real(balance%response(:, h), wp)
        rate = rate - h*solver%omega*aimag(balance%response(:, h))
      end do
      call balance%ranks%gather_columns_everywhere(balance%slider, slider)
      call solver%in_time%stand(rounded(matmul(balance%receptance%basis, displacement)), &
                                rounded(matmul(balance%receptance%basis, rate)), &
                                reshape(rounded([slider]), shape(slider)), stands)
    end associate
  end subroutine stand_in_time
end module attrito_solve_time_integration_start
