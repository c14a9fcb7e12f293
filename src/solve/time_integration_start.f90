!> Newton's method from starts by time integration, for points that no earlier point leads to. Integration begins at the solver's
!> present motion, at the start of a period,
!>
!> $$ q = \mathrm{Re} \sum_h X_h, \qquad \dot q = \mathrm{Re} \sum_h i h \omega X_h, $$
!>
!> and goes on under the loads of the point that is looked for until Newton's method converges from its averages. X_h is what the
!> loads make of the structure under the contact forces of that motion. Then, since the point before may lead to another motion, once
!> more from rest, q = X_0 and q' = 0. The static solution is at rest, but for rounding: from there rest comes first, and the
!> linear response X_h after it.
module attrito_solve_time_integration_start
  use attrito_core_kinds, only: wp
  use attrito_solve_mean_regularisation, only: find_drift
  use attrito_solve_rigid_drift, only: windows_in_a_row
  use attrito_solve_time_integrator, only: excitation_type, periods_type
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_solve_strategy_outcome, only: evidence_type, strategy_outcome_type
  implicit none
  private
  public :: has_time_integrator, solve_from_time_integration

  !> Averaging windows that Newton's method starts from, all but every third briefly; how many where the point before had no periodic
  !> solution; and how many from rest after motion
  integer, parameter :: attempts_in_motion = 12, full_attempt = 3, attempts_lost = 3, attempts_from_rest = 4 ! guess
  !> Periods averaged at first, and after how many windows they double: the mean of an irregular motion needs longer windows
  integer, parameter :: periods_averaged = 5, attempts_alike = 4 ! guess
  !> Change over a period of a motion that has settled
  real(wp), parameter :: settled = 1.0e-3_wp ! guess
  !> Binary digits of the largest number of a state that time integration starts from
  integer, parameter :: digits_at_start = 34 ! derived

contains

  !> Can time integration give starts? A frozen mean has no motion in time, and an integrator has one slider a contact.
  pure logical function has_time_integrator(solver)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    has_time_integrator = allocated(solver%time_integrator) .and. .not. solver%options%uncoupled &
                          .and. all(solver%contacts%law%elements() == 1)
  end function has_time_integrator

  !> Newton's method from the averages of motion in time, until it converges or the body is found to drift. Few windows are tried
  !> where the point before had no periodic solution. Where the body drifted there, springs on the mean show after every window
  !> whether it still does.
  subroutine solve_from_time_integration(solver, omega, previous, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Of the point before
    type(evidence_type), intent(in) :: previous
    !> What was found at this point so far, and by this
    type(strategy_outcome_type), intent(inout) :: outcome
    type(snapshot_type) :: before
    logical :: few, at_rest

    before = snapshot_of(solver)
    few = previous%no_periodic_solution .or. outcome%evidence%is_drifting
    associate (context => solver%context)
      at_rest = context%balance%norm(solver%motion(2:, :)) <= context%tolerance*context%motion_scale
    end associate
    call run_and_solve(solver, omega, merge(attempts_lost, attempts_in_motion, few), at_rest, previous%is_drifting, outcome)
    if (outcome%converged .or. previous%no_periodic_solution .or. previous%is_drifting .or. outcome%evidence%is_drifting) return
    call restore(solver, before)
    solver%motion(2:, :) = 0.0_wp
    call run_and_solve(solver, omega, merge(attempts_in_motion, attempts_from_rest, at_rest), .not. at_rest, previous%is_drifting, &
                       outcome)
  end subroutine solve_from_time_integration

  !> So many averaging windows from the present point.
  subroutine run_and_solve(solver, omega, attempts, from_rest, was_drifting, outcome)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> How many averaging windows
    integer, intent(in) :: attempts
    !> Does nothing move at first? Did the body drift at the point before?
    logical, intent(in) :: from_rest, was_drifting
    !> What was found at this point so far, and by this
    type(strategy_outcome_type), intent(inout) :: outcome
    type(periods_type) :: periods
    logical :: early_stop, is_resolved, drifts_in_mean
    real(wp) :: change
    integer :: attempt, drifting

    call start_integrator(solver, from_rest, outcome%converged)
    if (.not. outcome%converged) return
    drifting = 0
    change = 0.0_wp
    is_resolved = .false.
    drifts_in_mean = .false.
    do attempt = 1, attempts
      call move_on(solver, omega, periods_averaged*2**((attempt - 1)/attempts_alike), periods)
      outcome%converged = .false.
      if (.not. periods%moved) exit
      ! Displacements whose errors are more than a thousandth of the contact forces show nothing of the motion, but that of a body
      ! which flies has none.
      is_resolved = periods%force <= 0.0_wp .or. periods%force_error <= settled*periods%force
      change = merge(periods%change, 0.0_wp, is_resolved)
      early_stop = modulo(attempt, full_attempt) /= 0 .or. outcome%evidence%is_drifting
      call solver%solve_at(omega, early_stop)
      outcome%iterations = outcome%iterations + solver%report%iterations
      outcome%converged = solver%report%converged
      if (.not. outcome%converged .and. (was_drifting .or. .not. early_stop)) then
        call find_drift(solver, omega, early_stop, outcome)
        drifts_in_mean = outcome%evidence%is_drifting
      end if
      if (outcome%converged .or. (was_drifting .and. outcome%evidence%is_drifting)) exit
      drifting = merge(drifting + 1, 0, periods%is_drifting)
      if (drifting == windows_in_a_row) outcome%evidence%is_drifting = .true.
      if ((outcome%evidence%is_drifting .or. .not. is_resolved) .and. attempt >= attempts_lost) exit
    end do
    outcome%evidence%is_drifting = outcome%evidence%is_drifting .and. (is_resolved .or. drifts_in_mean)
    ! If the steps of a window fail, those before it have shown whether the motion settles.
    outcome%evidence%no_periodic_solution = outcome%evidence%is_drifting .or. (.not. outcome%converged .and. change > settled)
  end subroutine run_and_solve

  !> Numbers without the digits that depend on the order of sums over ranks: these would grow in motion that is unstable.
  pure function rounded(numbers)
    !> Numbers to round
    real(wp), intent(in) :: numbers(:)
    real(wp) :: rounded(size(numbers)), unit

    unit = scale(1.0_wp, exponent(maxval([0.0_wp, abs(numbers)])) - digits_at_start)
    rounded = unit*anint(numbers/unit)
  end function rounded

  !> Integrate over one averaging window, and set the solver to the average.
  subroutine move_on(solver, omega, count, periods)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Periods averaged
    integer, intent(in) :: count
    !> Averages over periods of the motion in time
    type(periods_type), intent(out) :: periods

    associate (balance => solver%context%balance)
      call solver%time_integrator%average_over(excitation_type(omega, balance%static_factors, balance%level), &
                                               balance%receptance%harmonics, count, periods)
      if (.not. periods%moved) return
      solver%motion = periods%motion(:, balance%first_row:balance%first_row + balance%rows() - 1)
      call solver%set_slider(periods%slider(:, balance%first_contact:balance%first_contact + size(balance%law) - 1))
    end associate
  end subroutine move_on

  !> Start the time integration at the solver's motion, at the start of a period.
  subroutine start_integrator(solver, from_rest, is_started)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Does nothing move at first, whatever the loads would do?
    logical, intent(in) :: from_rest
    !> .false.: the balance cannot be evaluated here
    logical, intent(out) :: is_started
    real(wp), allocatable :: displacement(:), rate(:)
    real(wp) :: slider(2, size(solver%contacts%law))
    integer :: status

    associate (balance => solver%context%balance)
      call balance%evaluate(solver%motion, solver%omega, status)
      call solver%context%forget()
      is_started = status == 0
      if (.not. is_started) return
      if (from_rest) balance%response(:, 1:) = 0.0_wp
      call balance%receptance%state_at_start(balance%response, solver%omega, displacement, rate)
      call balance%ranks%gather_columns_everywhere(balance%slider, slider)
      call solver%time_integrator%set_state(rounded(displacement), rounded(rate), reshape(rounded([slider]), shape(slider)), &
                                            is_started)
    end associate
  end subroutine start_integrator
end module attrito_solve_time_integration_start
