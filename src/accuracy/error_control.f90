!> The relative error of the monitors' amplitude at every point, estimated, and a series just long enough for what is accepted.
!>
!> $$ e = \max_m |\tilde a_m - a_m| / \tilde a_m $$
!>
!> a: amplitudes of the point; ~a: those of a finer balance to first order (`attrito_accuracy_finer_balance`), with harmonics up to
!> 3 H and with twice the samples, whose error is a quarter: 4/3 of what they change is the error of the samples. The error is split
!> by the motion that either change of the forces makes by itself. Harmonics left out fade as those do that are there, so the tail of
!> the motion tells how many more, or fewer, are needed.
!>
!> The estimate is checked by a second step (`attrito_accuracy_second_step`). Where that does not agree with the first, or a harmonic
!> beyond has not settled, a longer series is solved, and the estimate is what the point changes by. So it goes on until two series
!> agree.
module attrito_accuracy_error_control
  use, intrinsic :: ieee_arithmetic, only: ieee_is_nan, ieee_quiet_nan, ieee_value
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: extrema, resized
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_report_type
  use attrito_linear_receptance, only: to_real
  use attrito_accuracy_finer_balance, only: finer_balance_type, new_finer_balance, finer_point_type
  use attrito_accuracy_resonances, only: resonances_type
  use attrito_accuracy_second_step, only: second_step_type, step_again
  use attrito_contact_evaluation, only: goes_by_events
  use attrito_contact_state, only: state_slipping
  use attrito_continuation_sweep, only: sweep_type
  use attrito_solve_strategies, only: solve_by_cascade
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: error_control_type, point_errors_type, no_tolerance

  !> Monitors below this part of the largest amplitude are measured against it: of what hardly moves no relative error is told
  real(wp), parameter :: least_share = 1.0e-3_wp
  !> Parts of the accepted error that harmonics and samples may take, and what a change of either aims at of its part: the estimate
  !> may be too small by a factor, and the next point is not this one
  real(wp), parameter :: harmonics_share = 0.5_wp, samples_share = 0.25_wp, aimed_part = 0.3_wp
  !> Part of the half-range of a change of the motion that the change of an amplitude, which it bounds, is estimated as at least
  real(wp), parameter :: share_of_motion = 0.2_wp
  !> A series is cut where so few harmonics would do
  real(wp), parameter :: worth_cutting = 0.75_wp
  !> The two steps of an estimate agree if they differ by no more than this part of it, or of what harmonics may take of the tolerance
  real(wp), parameter :: agreement = 0.5_wp, negligible = 0.2_wp
  !> Part of a series that had to be lengthened until its estimate was sure that the next point begins with at least
  real(wp), parameter :: shrinking = 0.8_wp
  !> Contacts so many times stiffer than the structure is at them may bounce at any frequency: series shorter than this are not sure
  real(wp), parameter :: stiff = 1.0e3_wp
  integer, parameter :: short_series = 5
  !> Part of the motion, in units of the tolerance, that a harmonic may lack
  real(wp), parameter :: unsettled_share = 0.1_wp
  !> The tolerance that estimates are made for where none is given
  real(wp), parameter :: nominal_tolerance = 0.01_wp
  !> A tolerance that no error exceeds, one that is not known included
  real(wp), parameter :: no_tolerance = huge(1.0_wp)
  !> Harmonics and samples between which they are chosen
  integer, parameter :: most_harmonics = 100, most_samples = 8192
  integer, parameter :: most_refinements = 8

  !> Relative errors of the amplitude; those by harmonics and samples are NaN where the linearised step that tells them is singular
  type :: point_errors_type
    real(wp) :: harmonics = 0.0_wp, samples = 0.0_wp, modes = 0.0_wp
  contains
    procedure :: all
    procedure :: are_known
    procedure :: are_within
  end type point_errors_type

  type :: error_control_type
    !> Relative error accepted in the amplitude
    real(wp) :: tolerance = no_tolerance
    !> Choose harmonics and samples by it?
    logical :: choose_harmonics = .false., choose_samples = .false.
    !> Fewest harmonics, those of the loads, and fewest samples
    integer :: fewest_harmonics = 1, fewest_samples = 32
    !> Of the present point; `modes` is the same for all points
    type(point_errors_type) :: errors
    type(finer_balance_type), private :: longer, denser
    type(resonances_type), private :: resonances
    !> Do the two steps of the last estimate agree? If not: harmonics that have not settled, up to this one
    logical, private :: is_sure = .true.
    integer, private :: unsettled = 0
    !> Greatest ratio of a contact's stiffness to that of the structure at it; negative: not known yet
    real(wp), private :: stiffness_ratio = -1.0_wp
    !> For the point that comes next
    integer, private :: next_harmonics = 0, next_samples = 0
  contains
    procedure :: estimate
    procedure :: advance
    procedure :: solve_at
    procedure :: keep
    procedure :: destroy
  end type error_control_type

contains

  !> All together.
  pure real(wp) function all(self)
    class(point_errors_type), intent(in) :: self

    all = self%harmonics + self%samples + self%modes
  end function all

  pure logical function are_known(self)
    class(point_errors_type), intent(in) :: self

    are_known = .not. ieee_is_nan(self%harmonics)
  end function are_known

  !> Is the tolerance kept? Errors that are not known keep none.
  pure logical function are_within(self, tolerance)
    class(point_errors_type), intent(in) :: self
    real(wp), intent(in) :: tolerance

    are_within = tolerance >= no_tolerance
    if (self%are_known() .and. .not. are_within) are_within = self%all() <= tolerance
  end function are_within

  !> Save or load what the next point depends on.
  subroutine keep(self, store)
    class(error_control_type), intent(inout) :: self
    type(state_store_type), intent(inout) :: store

    call store%keep(self%errors%harmonics)
    call store%keep(self%errors%samples)
    call store%keep(self%next_harmonics)
    call store%keep(self%next_samples)
  end subroutine keep

  !> The sweep's next point, within the accepted error where harmonics or samples are to be chosen.
  subroutine advance(self, sweep, solver)
    class(error_control_type), intent(inout) :: self
    type(sweep_type), intent(inout) :: sweep
    type(solver_type), intent(inout) :: solver

    call take_resolution_chosen(self, solver)
    call sweep%set_harmonics(solver%options%harmonics)
    call sweep%advance(solver)
    call refine(self, solver)
    call sweep%set_harmonics(solver%options%harmonics)
  end subroutine advance

  !> The same at one angular frequency.
  subroutine solve_at(self, solver, omega)
    class(error_control_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega

    call take_resolution_chosen(self, solver)
    call solve_by_cascade(solver, omega)
    if (.not. solver%report%converged) call solve_on_short_series(self, solver, omega)
    call refine(self, solver)
  end subroutine solve_at

  !> Where a long series has no solution, or none was found: try a short one, from which `refine` goes on. Not where there is no
  !> periodic motion at all.
  subroutine solve_on_short_series(self, solver, omega)
    class(error_control_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    integer :: harmonics, iterations

    harmonics = max(self%fewest_harmonics, short_series)
    if (.not. self%choose_harmonics .or. solver%options%harmonics <= harmonics .or. solver%no_orbit) return
    iterations = solver%report%iterations
    call solver%set_resolution(harmonics, max(self%fewest_samples, 6*harmonics + 2))
    call solve_by_cascade(solver, omega)
    solver%report%iterations = solver%report%iterations + iterations
  end subroutine solve_on_short_series

  !> What the last point asked for the next one.
  subroutine take_resolution_chosen(self, solver)
    class(error_control_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver

    if (self%next_harmonics > 0) call solver%set_resolution(self%next_harmonics, self%next_samples)
  end subroutine take_resolution_chosen

  !> Estimate the errors of the point, and solve it again on a finer series or more samples until they are accepted, or as fine as it
  !> gets. A point that the finer balance does not reach stays, with its estimate if that is sure, and without if not.
  subroutine refine(self, solver)
    type(error_control_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(finer_point_type) :: finer
    real(wp), allocatable :: shorter(:, :)
    integer :: attempt, harmonics, samples, iterations
    logical :: better, was_sure

    was_sure = .true.
    iterations = solver%report%iterations
    self%next_harmonics = 0
    do attempt = 0, most_refinements
      call self%estimate(solver, finer)
      if (.not. (solver%report%converged .and. self%errors%are_known())) exit
      if (.not. (self%choose_harmonics .or. self%choose_samples)) exit
      if (allocated(shorter) .and. .not. self%is_sure) call compare(self, solver, shorter)
      harmonics = needed_harmonics(self, solver, finer)
      samples = needed_samples(self, solver, harmonics)
      ! A series on which estimates are not sure would be solved in vain.
      self%next_harmonics = max(harmonics, merge(0, nint(shrinking*solver%options%harmonics), was_sure))
      self%next_samples = samples
      if ((accepted(self) .and. self%is_sure) .or. attempt == most_refinements) exit
      harmonics = max(harmonics, solver%options%harmonics)
      samples = max(samples, solver%options%samples)
      if (self%choose_harmonics .and. .not. self%is_sure) then
        was_sure = .false.
        harmonics = min(max(harmonics, next_longer(solver%options%harmonics), self%unsettled), most_harmonics)
        samples = max(samples, 6*harmonics + 2)
      end if
      if (harmonics == solver%options%harmonics .and. samples == solver%options%samples) exit
      shorter = own_monitors(solver)
      call solve_finer(solver, finer, harmonics, samples, iterations, better)
      if (.not. better) then
        ! The next point had better begin with a series that has a solution.
        self%next_harmonics = solver%options%harmonics
        self%next_samples = solver%options%samples
        exit
      end if
    end do
    if (self%choose_harmonics .and. solver%report%converged .and. .not. self%is_sure) then
      self%errors%harmonics = ieee_value(self%errors%harmonics, ieee_quiet_nan)
    end if
    solver%report%iterations = iterations
  end subroutine refine

  !> Take what the point differs by from the same on a shorter series for its error; that is sure once it is accepted.
  subroutine compare(self, solver, shorter)
    type(error_control_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver
    !> Coefficients of the monitors [k, monitors]
    real(wp), intent(in) :: shorter(:, :)

    self%errors%harmonics = max(self%errors%harmonics, relative_change(shorter, own_monitors(solver)))
    self%is_sure = accepted(self)
  end subroutine compare

  !> Length of the series that an estimate which is not sure is held against.
  pure integer function next_longer(harmonics)
    integer, intent(in) :: harmonics

    next_longer = (5*harmonics)/4 + 2
  end function next_longer

  !> Does the point meet what is asked of harmonics and samples?
  pure logical function accepted(self)
    type(error_control_type), intent(in) :: self

    accepted = (.not. self%choose_harmonics .or. self%errors%harmonics <= harmonics_share*self%tolerance) .and. &
               (.not. self%choose_samples .or. self%errors%samples <= samples_share*self%tolerance)
  end function accepted

  !> Solve the point again, finer, from where it is expected; back to what it was if that fails.
  subroutine solve_finer(solver, finer, harmonics, samples, iterations, better)
    type(solver_type), intent(inout) :: solver
    type(finer_point_type), intent(in) :: finer
    integer, intent(in) :: harmonics, samples
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: better
    type(snapshot_type) :: before
    type(newton_report_type) :: report
    type(constraint_type) :: constraint
    integer :: resolution(2), status

    before = snapshot_of(solver)
    report = solver%report
    resolution = [solver%options%harmonics, solver%options%samples]
    call solver%set_resolution(harmonics, samples)
    solver%motion = resized(finer%motion, 2*harmonics + 1)
    constraint = solver%context%constraint
    call solver%solve_with(constraint)
    iterations = iterations + solver%report%iterations
    better = solver%report%converged
    if (better) return
    call solver%set_resolution(resolution(1), resolution(2))
    call restore(solver, before)
    call solver%context%balance%evaluate(solver%motion, solver%omega, status)
    solver%report = report
  end subroutine solve_finer

  !> Errors of the solver's present point, and the point on a longer series. None where every contact sticks: that is linear.
  subroutine estimate(self, solver, finer)
    class(error_control_type), intent(inout) :: self
    type(solver_type), intent(inout) :: solver
    type(finer_point_type), intent(out) :: finer
    type(second_step_type) :: second
    real(wp) :: sampled, error, difference, threshold
    real(wp), allocatable :: own(:, :)
    integer :: harmonics, samples, status

    self%errors%harmonics = 0.0_wp
    self%errors%samples = 0.0_wp
    self%is_sure = .true.
    self%unsettled = 0
    if (.not. solver%report%converged) return
    associate (balance => solver%context%balance)
      if (solver%all_stick .and. size(solver%structure%harmonic_load, 2) <= balance%coefficients()) return
      sampled = count(balance%forces%state >= state_slipping .and. .not. goes_by_events(balance%law, balance%quadrature%by_events))
      call balance%ranks%sum(sampled)
      threshold = unsettled_share*min(self%tolerance, nominal_tolerance)
      harmonics = self%resonances%highest(solver, longer_series(balance%receptance%harmonics), threshold)
      samples = balance%quadrature%fourier%samples
      if (any_sampled(solver)) samples = max(samples, 8*((2*harmonics + 9)/8))
      call prepare(self%longer, solver, harmonics, samples)
      if (sampled > 0.0_wp) then
        call prepare(self%denser, solver, balance%receptance%harmonics, 2*balance%quadrature%fourier%samples)
        call self%longer%correct(solver, finer, status, self%denser)
      else
        call self%longer%correct(solver, finer, status)
      end if
      error = ieee_value(error, ieee_quiet_nan)
      if (status == 0) then
        own = own_monitors(solver)
        error = relative_change(own, finer%monitors)
        call step_again(self%longer, solver, finer, threshold, second)
        self%unsettled = second%unsettled
        self%is_sure = allocated(second%monitors) .and. second%unsettled == 0
        if (allocated(second%monitors)) then
          difference = relative_change(finer%monitors, second%monitors)
          error = max(error, relative_change(own, second%monitors))
          self%is_sure = self%is_sure .and. &
                         difference <= max(agreement*error, negligible*harmonics_share*min(self%tolerance, nominal_tolerance))
        end if
      end if
      if (balance%receptance%harmonics < short_series .and. .not. solver%all_stick) then
        if (self%stiffness_ratio < 0.0_wp) self%stiffness_ratio = greatest_stiffness_ratio(solver)
        self%is_sure = self%is_sure .and. self%stiffness_ratio <= stiff
      end if
      self%errors%samples = finer%samples_share*error
      self%errors%harmonics = error - self%errors%samples
    end associate
  end subroutine estimate

  !> The stiffness of a contact over that of the structure, all other contacts stuck, the greatest of all rows. With R the stuck
  !> system's flexibility at a row and k the row's spring, the structure alone has 1/R - k there, so the ratio is k R/(1 - k R).
  real(wp) function greatest_stiffness_ratio(solver) result(ratio)
    type(solver_type), intent(in) :: solver
    real(wp), parameter :: rounding = 1.0e-12_wp
    real(wp), allocatable :: modes(:, :)
    real(wp) :: share
    integer :: row

    ratio = 0.0_wp
    associate (contacts => solver%contacts, stuck => solver%stuck)
      modes = matmul(transpose(contacts%directions), stuck%modes)
      do row = 1, size(modes, 1)
        share = contacts%row_stiffness(row)*sum(modes(row, :)**2/stuck%modal_stiffness)
        ratio = max(ratio, share/max(1.0_wp - share, rounding))
      end do
    end associate
  end function greatest_stiffness_ratio

  !> Harmonics of the longer series: three times as many, of long ones at most 20 or half as many more. Where forces fade like h^-2
  !> and motion like h^-4, what is beyond H falls like H^-3: two thirds of it are seen at least, 26 parts in 27 with a short series.
  pure integer function longer_series(harmonics)
    integer, intent(in) :: harmonics

    longer_series = min(3*harmonics, max(harmonics + 20, harmonics + harmonics/2))
  end function longer_series

  !> Make a finer balance anew where it is not the one that is asked for.
  subroutine prepare(finer, solver, harmonics, samples)
    type(finer_balance_type), intent(inout) :: finer
    type(solver_type), intent(in) :: solver
    integer, intent(in) :: harmonics, samples

    if (finer%harmonics == harmonics .and. finer%quadrature%fourier%samples == samples) return
    call finer%destroy()
    finer = new_finer_balance(solver%structure, solver%stuck, harmonics, samples, solver%context%balance%quadrature%by_events)
  end subroutine prepare

  !> Coefficients of the monitors at the solver's present point [2 H + 1, monitors].
  function own_monitors(solver) result(own)
    type(solver_type), intent(in) :: solver
    real(wp), allocatable :: own(:, :)

    associate (balance => solver%context%balance)
      own = matmul(to_real(balance%response), matmul(transpose(balance%receptance%basis), solver%structure%monitors))
    end associate
  end function own_monitors

  !> Largest change of an amplitude from one point to another, relative to the latter, and at least a part of the largest change that
  !> an equal change of the motion can make: at the extremes of the motion its parts may cancel by chance.
  pure real(wp) function relative_change(from, to)
    !> Coefficients of the monitors of both [k, monitors]
    real(wp), intent(in) :: from(:, :), to(:, :)
    real(wp) :: difference(max(size(from, 1), size(to, 1)), size(to, 2))
    real(wp), dimension(size(to, 2)) :: after, change

    relative_change = 0.0_wp
    if (size(to, 2) == 0) return
    difference = resized(to, size(difference, 1)) - resized(from, size(difference, 1))
    after = half_ranges(to)
    difference = without_shift(difference, resized(to, size(difference, 1)))
    change = max(abs(after - half_ranges(from)), share_of_motion*half_ranges(difference))
    if (maxval(after) > 0.0_wp) relative_change = maxval(change/max(after, least_share*maxval(after)))
  end function relative_change

  !> A change of series columnwise, less the shift in time that comes nearest to it: that changes no amplitude.
  pure function without_shift(change, series) result(rest)
    !> [k, columns] both
    real(wp), intent(in) :: change(:, :), series(:, :)
    real(wp) :: rest(size(change, 1), size(change, 2)), rate(size(change, 1))
    integer :: h, i

    do i = 1, size(change, 2)
      rate(1) = 0.0_wp
      do h = 1, size(rate)/2
        rate(2*h:2*h + 1) = h*[series(2*h + 1, i), -series(2*h, i)]
      end do
      rest(:, i) = change(:, i) - rate*(dot_product(rate, change(:, i))/max(dot_product(rate, rate), tiny(1.0_wp)))
    end do
  end function without_shift

  !> Half the range over the period of series columnwise.
  pure function half_ranges(series) result(ranges)
    real(wp), intent(in) :: series(:, :)
    real(wp) :: ranges(size(series, 2)), range(2)
    integer :: i

    do i = 1, size(series, 2)
      range = extrema(series(:, i))
      ranges(i) = 0.5_wp*(range(2) - range(1))
    end do
  end function half_ranges

  !> Harmonics that this point needs: the error shrinks with the part of the motion that is left out.
  integer function needed_harmonics(self, solver, finer) result(needed)
    type(error_control_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    type(finer_point_type), intent(in) :: finer
    real(wp), allocatable :: left_out(:)
    real(wp) :: accepted_error
    integer :: h, now

    now = solver%options%harmonics
    needed = now
    if (.not. self%choose_harmonics) return
    needed = self%fewest_harmonics
    if (.not. allocated(finer%motion)) return
    left_out = tails(solver, finer%motion)
    accepted_error = aimed_part*harmonics_share*self%tolerance
    do h = self%fewest_harmonics, size(left_out) - 1
      needed = h
      if (self%errors%harmonics*left_out(h) <= accepted_error*left_out(now)) exit
    end do
    if (needed > nint(worth_cutting*now) .and. needed < now .and. accepted(self)) needed = now
    needed = min(max(needed, now/2, self%fewest_harmonics), most_harmonics)
  end function needed_harmonics

  !> Norm of the contacts' motion beyond each harmonic [K].
  function tails(solver, motion) result(left_out)
    type(solver_type), intent(in) :: solver
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: left_out(size(motion, 1)/2)
    integer :: h

    left_out = 0.0_wp
    do h = size(left_out) - 1, 1, -1
      left_out(h) = left_out(h + 1) + sum(motion(2*h + 2:2*h + 3, :)**2)
    end do
    call solver%context%balance%ranks%sum(left_out)
    left_out = sqrt(left_out)
  end function tails

  !> Samples that this point needs: their error falls like the square, and what harmonics are left out is to be seen.
  integer function needed_samples(self, solver, harmonics) result(needed)
    type(error_control_type), intent(in) :: self
    type(solver_type), intent(in) :: solver
    integer, intent(in) :: harmonics
    real(wp) :: factor

    needed = solver%options%samples
    if (.not. any_sampled(solver)) then
      ! They serve nothing: enough once, they stay.
      needed = max(needed, 6*harmonics + 2)
      return
    end if
    if (self%choose_samples) then
      factor = sqrt(self%errors%samples/(aimed_part*samples_share*self%tolerance))
      if (factor > 1.0_wp .or. factor < worth_cutting) needed = 8*ceiling(min(max(factor, 0.5_wp), 8.0_wp)*needed/8.0_wp)
      needed = min(max(needed, self%fewest_samples), most_samples)
    end if
    if (self%choose_harmonics) needed = max(needed, 6*harmonics + 2)
  end function needed_samples

  !> Does any contact, of all ranks, go by samples?
  pure logical function any_sampled(solver)
    type(solver_type), intent(in) :: solver

    any_sampled = any(.not. goes_by_events(solver%contacts%law, solver%context%balance%quadrature%by_events))
  end function any_sampled

  !> Give the transforms back.
  subroutine destroy(self)
    class(error_control_type), intent(inout) :: self

    call self%longer%destroy()
    call self%denser%destroy()
  end subroutine destroy
end module attrito_accuracy_error_control
