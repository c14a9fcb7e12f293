!> The relative error of the monitors' amplitude at a point, estimated.
!>
!> The point is compared to first order with a balance of more harmonics (`attrito_accuracy_finer_balance`).
!>
!> The estimate is checked by a second step (`attrito_accuracy_second_step`). It is sure if that agrees with the first and all
!> harmonics beyond have settled; or if the error, the difference of both steps and what further answers would add are together no
!> more than harmonics may take at worst.
module attrito_accuracy_error_estimate
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  use attrito_solve_solver, only: solver_type
  use attrito_accuracy_amplitude_change, only: relative_change
  use attrito_accuracy_finer_balance, only: finer_balance_type, finer_point_type
  use attrito_accuracy_point_errors, only: point_errors_type
  use attrito_accuracy_resonances, only: resonances_type
  use attrito_accuracy_second_step, only: second_step_type, step_again
  use attrito_accuracy_work_error, only: estimate_work_errors
  implicit none
  private
  public :: error_estimate_type, harmonics_share, own_monitors, short_series, worst_share

  !> Part of the tolerance that harmonics may take by their estimate, and that they may take at worst: modes have the rest
  real(wp), parameter :: harmonics_share = 0.5_wp, worst_share = 0.75_wp ! conventional
  !> The two steps of an estimate agree if they differ by no more than this part of it, or of what harmonics may take of the tolerance
  real(wp), parameter :: agreement = 0.5_wp, negligible = 0.2_wp ! guess
  !> Contacts so many times stiffer than the structure is at them may bounce at any frequency, and their steps linearised on a short
  !> series are not those of a longer one. A contact r times as stiff moves with the structure at some sqrt(r) times the frequency
  !> below which the structure moves without it; a series that does not reach so far sees impacts.
  real(wp), parameter :: stiff = 1.0e3_wp ! guess
  !> Harmonics to try where a longer series has no solution
  integer, parameter :: short_series = 5 ! guess
  !> Fewest harmonics of the longer series, a guess: nine miss a mode at the 10th where blocks hardly slip
  integer, parameter :: least_longer = 15 ! guess
  !> Part of the tolerance that a harmonic of which only a bound is known may take, and what answers that were not asked for may
  real(wp), parameter :: unknown_share = 0.1_wp, unsettled_share = 0.25_wp ! guess
  !> Answers of harmonics that have not settled after the second. Modes that meet harmonics beyond take some twenty to settle
  integer, parameter :: most_answers = 40 ! guess
  !> The tolerance that estimates are made for where none is given
  real(wp), parameter :: nominal_tolerance = 0.01_wp ! conventional

  type :: error_estimate_type
    type(finer_balance_type), private :: longer
    type(resonances_type), private :: resonances
    !> Greatest ratio of a contact's stiffness to that of the structure at it; negative: not computed yet
    real(wp), private :: stiffness_ratio = -1.0_wp
  contains
    procedure :: estimate
    procedure :: look_finer
    procedure :: destroy
  end type error_estimate_type

contains

  !> Errors of the solver's present point. None where every contact sticks: that is linear.
  subroutine estimate(self, solver, solved, tolerance, errors, finer)
    class(error_estimate_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Is its present point a solution?
    logical, intent(in) :: solved
    !> That is asked for; `no_tolerance` where none is
    real(wp), intent(in) :: tolerance
    !> By harmonics; that of the modes stays
    type(point_errors_type), intent(inout) :: errors
    !> The point on the longer series, to first order
    type(finer_point_type), intent(out) :: finer
    type(second_step_type) :: second
    real(wp) :: error, difference, asked
    real(wp), allocatable :: own(:, :)
    logical :: agrees
    integer :: status

    errors = point_errors_type(modes=errors%modes)
    if (.not. solved) return
    associate (balance => solver%context%balance)
      allocate (errors%work(size(balance%law)), source=0.0_wp)
      if (solver%all_stick .and. size(solver%structure%harmonic_load, 2) <= balance%coefficients()) return
      call self%look_finer(solver, tolerance, finer, second, status)
      if (status == 0) call estimate_work_errors(self%longer, solver, finer, second, errors%work)
      error = ieee_value(error, ieee_quiet_nan)
      if (status == 0) then
        own = own_monitors(solver)
        error = relative_change(own, finer%monitors)
        errors%of_motion = change_of_motion(solver, finer)
        errors%unsettled = second%unsettled
        errors%is_sure = .false.
        agrees = .false.
        if (allocated(second%monitors)) then
          difference = relative_change(finer%monitors, second%monitors)
          error = max(error, relative_change(own, second%monitors))
          asked = min(tolerance, nominal_tolerance)
          errors%at_most = error + difference + second%missing
          agrees = difference <= max(agreement*error, negligible*harmonics_share*asked)
          errors%is_sure = (second%unsettled == 0 .and. agrees) .or. errors%at_most <= worst_share*asked
        end if
      end if
      if (.not. solver%all_stick) then
        if (self%stiffness_ratio < 0.0_wp) self%stiffness_ratio = greatest_stiffness_ratio(solver)
        errors%is_stiff = errors%is_sure .and. self%stiffness_ratio > max(stiff, real(balance%receptance%harmonics, wp)**2)
        errors%is_sure = errors%is_sure .and. .not. errors%is_stiff
      end if
      errors%harmonics = error
      if (status == 0) then
        errors%harmonics = max(errors%harmonics, second%missing)
        errors%missing = second%missing
        errors%known_part = merge(errors%harmonics, second%missing, agrees)
      end if
    end associate
  end subroutine estimate

  !> The solver's present point as a longer series would have it: to first order, and after a second step. The
  !> equation that picked the point holds.
  subroutine look_finer(self, solver, tolerance, first, second, status)
    class(error_estimate_type), intent(inout) :: self
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> Relative error that is asked for; `no_tolerance` where none is
    real(wp), intent(in) :: tolerance
    !> The point, to first order
    type(finer_point_type), intent(out) :: first
    !> The point after a second step, if the first was solved
    type(second_step_type), intent(out) :: second
    !> 0, or not: the linearised step is singular
    integer, intent(out) :: status
    real(wp) :: asked
    integer :: harmonics
    logical :: is_new

    associate (balance => solver%context%balance)
      asked = min(tolerance, nominal_tolerance)
      harmonics = self%resonances%highest(solver, longer_series(balance%receptance%harmonics), unknown_share*asked)
      if (self%longer%harmonics /= harmonics) call self%longer%set(harmonics, balance%quadrature)
      call solver%context%preconditioner%mean%prepare(balance)
      call self%longer%correct(solver, first, status)
    end associate
    if (status == 0) call step_again(self%longer, solver, first, unsettled_share*asked, 0, second)
    if (second%unsettled == 0) return
    associate (balance => solver%context%balance, mean => solver%context%preconditioner%mean)
      call mean%take(balance, 0.0_wp, is_new)
      if (is_new) balance%work = balance%work + mean%flops/balance%ranks%ranks
    end associate
    if (is_new) call self%longer%correct(solver, first, status)
    if (status == 0) call step_again(self%longer, solver, first, unsettled_share*asked, most_answers, second)
  end subroutine look_finer

  !> The stiffness of a contact over that of the structure, all other contacts stuck, the greatest of all rows. With R the stuck
  !> system's flexibility at a row and k the row's spring, the structure alone has 1/R - k there, so the ratio is k R/(1 - k R).
  real(wp) function greatest_stiffness_ratio(solver) result(ratio)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Flexibility left to the structure that is rounding
    real(wp), parameter :: rounding = 1.0e-12_wp ! derived
    real(wp), allocatable :: modes(:, :)
    real(wp) :: share
    integer :: row

    ratio = 0.0_wp
    associate (contacts => solver%contacts, stuck => solver%stuck)
      modes = matmul(transpose(solver%mean_rows()), stuck%modes)
      do row = 1, size(modes, 1)
        share = contacts%row_stiffness(row)*sum(modes(row, :)**2/stuck%modal_stiffness)
        ratio = max(ratio, share/max(1.0_wp - share, rounding))
      end do
    end associate
  end function greatest_stiffness_ratio

  !> Harmonics of the longer series: three times as many, of long ones at most 20 or half as many more. Where forces fade like h^-2
  !> and motion like h^-4, what is beyond H falls like H^-3: two thirds of it are seen at least, 26 parts in 27 with a short series.
  !> The first harmonics beyond a very short series do not fade yet, so it has `least_longer` at least.
  pure integer function longer_series(harmonics)
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    longer_series = max(least_longer, min(3*harmonics, max(harmonics + 20, harmonics + harmonics/2)))
  end function longer_series

  !> Coefficients of the monitors at the solver's present point [2 H + 1, monitors].
  function own_monitors(solver) result(own)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp), allocatable :: own(:, :)

    own = solver%context%balance%monitors%motion_of(solver%context%balance%response)
  end function own_monitors

  !> |q' - q| over |q|, q' up to the harmonics of q and the mean left out of |q|: monitors may hardly see it.
  real(wp) function change_of_motion(solver, finer) result(change)
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver
    !> The point on the longer series
    type(finer_point_type), intent(in) :: finer
    complex(wp), allocatable :: alternating(:, :)

    associate (own => solver%context%balance%response)
      alternating = own
      alternating(:, lbound(own, 2)) = 0.0_wp
      change = mean_square(solver, finer%response(:, :solver%context%balance%receptance%harmonics) - own)
      change = sqrt(change/max(mean_square(solver, alternating), tiny(1.0_wp)))
    end associate
  end function change_of_motion

  !> X_0^T M X_0 + 1/2 sum_h X_h^H M X_h.
  real(wp) function mean_square(solver, response)
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver
    !> X, in generalised coordinates [n, 0:H]
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp), allocatable :: inertia(:, :)

    allocate (inertia(size(response, 1), 0:ubound(response, 2)))
    call solver%context%balance%receptance%inertia_of(response, inertia)
    mean_square = 0.5_wp*real(sum(conjg(response)*inertia) + sum(conjg(response(:, 0))*inertia(:, 0)), wp)
  end function mean_square

  !> Give the transforms back.
  subroutine destroy(self)
    class(error_estimate_type), intent(inout) :: self

    call self%longer%destroy()
  end subroutine destroy
end module attrito_accuracy_error_estimate
