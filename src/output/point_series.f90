!> What `result.h5` holds of a point, series by series (docs/reference/files.md). The root, to whom the contacts of all ranks are
!> gathered, hands them to its listener.
module attrito_output_point_series
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: extrema, work_per_period
  use attrito_model_contacts, only: contact_type
  use attrito_solve_solver, only: solver_type
  use attrito_output_listener, only: listener_type
  use attrito_output_point_report, only: point_report_type
  use attrito_solve_outcomes, only: outcome_names
  implicit none
  private
  public :: report_point, state_names

  character(12), parameter :: state_names(0:3) = [character(12) :: 'stuck', 'shaken_down', 'slipping', 'open']
  !> Series of one number a contact, in the order of `numbers_of`
  integer, parameter :: contact_columns = 15
  character(23), parameter :: contact_series(contact_columns) = [character(23) :: 'n_mean', 'n_min', 'n_low', 'n_high', 't1_mean', &
    't1_low', 't1_high', 't2_mean', 't2_low', 't2_high', 'stick', 'slip', 'open', 'dissipated_energy', &
    'dissipated_energy_error']
  character(64), parameter :: contact_descriptions(contact_columns) = [character(64) :: 'mean normal force', &
    'least normal force over the period', 'lower bound of the mean normal force', 'upper bound of the mean normal force', &
    'mean tangential force, first direction', 'its lower bound', 'its upper bound', 'mean tangential force, second direction', &
    'its lower bound', 'its upper bound', 'part of the period in stick', 'part of the period in slip', &
    'part of the period in lift-off', 'work done against friction per period', &
    'estimated error of that work; NaN: not known']
  character(12), parameter :: contact_units(contact_columns) = [character(12) :: 'user force', 'user force', 'user force', &
    'user force', 'user force', 'user force', 'user force', 'user force', 'user force', 'user force', '1', '1', '1', 'user energy', &
    'user energy']

  !> Rows of what a rank reports of a contact before its series: state, unique
  integer, parameter :: first_rows = 2

contains

  !> Tell of the solver's present point. Collective; `listener` listens at the root.
  subroutine report_point(solver, report, monitors, listener)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    !> Names of the monitors
    character(*), intent(in) :: monitors(:)
    !> Receives the series
    type(listener_type), intent(in) :: listener
    integer :: i

    call tell_numbers(report, listener)
    associate (balance => solver%context%balance)
      call tell_rows(listener, '/points/coordinates', balance%receptance%displacements(balance%response), report%findings%solved, &
                     'Fourier coefficients of the coordinates: mean, cosine 1, sine 1, ...')
    end associate
    do i = 1, size(monitors)
      call tell_monitor(report, i, '/monitors/'//trim(monitors(i))//'/', listener)
    end do
    call tell_contacts(solver, report, listener)
  end subroutine report_point

  !> What is reported of a monitor.
  subroutine tell_monitor(report, monitor, path, listener)
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    !> Number of the monitor
    integer, intent(in) :: monitor
    !> Path of its datasets
    character(*), intent(in) :: path
    !> Receives the series
    type(listener_type), intent(in) :: listener
    real(wp) :: bound, tangent

    bound = merge(report%amplitude(monitor), blank(), report%unique == 1)
    tangent = blank()
    if (report%curve%is_known()) tangent = report%curve%amplitude_rate(monitor)
    call report_length('amplitude', report%amplitude(monitor), 'half the range over the period')
    call report_length('mean', report%mean(monitor), 'mean over the period')
    call report_length('tangent', tangent, 'change of the amplitude along the curve')
    call report_length('low', bound, 'lower bound of the amplitude')
    call report_length('high', bound, 'upper bound of the amplitude')
    call tell_rows(listener, path//'harmonics', report%harmonics(:, monitor:monitor), report%findings%solved, &
                   'Fourier coefficients')

  contains

    subroutine report_length(name, value, description)
      !> Name of the dataset; what the dataset holds
      character(*), intent(in) :: name, description
      !> Numbers of the series
      real(wp), intent(in) :: value

      call listener%report(path//name, 'real64', [integer ::], [merge(value, blank(), report%findings%solved)], description, &
                           'user length')
    end subroutine report_length
  end subroutine tell_monitor

  !> Series [2 H + 1, n], blank where there is no solution; of a monitor its coefficients are the only dimension.
  subroutine tell_rows(listener, path, values, solved, description)
    !> Receives the series
    type(listener_type), intent(in) :: listener
    !> Path of the dataset; what the dataset holds
    character(*), intent(in) :: path, description
    !> Numbers of the series
    real(wp), intent(in) :: values(:, :)
    !> Is there a solution?
    logical, intent(in) :: solved
    real(wp) :: shown(size(values))
    logical :: listed

    shown = reshape(values, [size(values)])
    if (.not. solved) shown = blank()
    listed = path == '/points/coordinates'
    call listener%report(path, 'real64', pack([size(values, 2), size(values, 1)], [listed, .true.]), shown, description, &
                         'user length')
  end subroutine tell_rows

  !> What is one number a point.
  subroutine tell_numbers(report, listener)
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    !> Receives the series
    type(listener_type), intent(in) :: listener
    logical :: solved

    solved = report%findings%solved
    call report_real('frequency_hz', report%frequency_hz, 'frequency of the fundamental harmonic', 'Hz')
    call report_real('level', report%level, 'factor on the harmonic loads', '1')
    call report_integer('branch', report%branch, 'number of the connected run of points')
    call report_integer('iterations', report%iterations, 'iterations of Newton''s method, all tries together')
    call report_integer('linear_iterations', report%linear_iterations, 'iterations of GMRES, where linear systems are large')
    call report_integer('period', report%findings%period(), 'period of the solution in periods of the excitation')
    call listener%report('/points/outcome', 'int32', [integer ::], [real(report%findings%outcome(), wp)], &
                       'how the point ended: index into the attribute names', '1', outcome_names)
    call report_integer('unique', merge(report%unique, -1, solved), '1 unique, 0 one of a family, -1 not examined')
    call report_integer('stable', report%findings%stability(), '1 stable, 0 unstable, -1 not examined or indeterminate')
    call report_real('residual', report%residual, 'norm of the residual relative to the stuck response', '1')
    call report_real('estimate', merge(report%errors%all(), blank(), solved), &
                   'estimated relative error of the amplitude; NaN: not known', '1')
    call report_real('error_harmonics', merge(report%errors%harmonics, blank(), solved), 'part of the estimate: harmonics left out', &
                   '1')
    call report_real('error_samples', merge(0.0_wp, blank(), solved), &
                   'part of the estimate: samples of contact forces', '1')
    call report_real('error_modes', merge(report%errors%modes, blank(), solved), &
                   'part of the estimate: modes that the reduction left out', '1')
    call report_integer('harmonics', report%series, 'harmonics of the balance; coefficients beyond are 0')
    call report_integer('samples', report%samples, 'samples a period of contacts that go by samples')
    call report_real('path', merge(report%path, blank(), solved .and. report%curve%is_known()), &
                   'length along the drawn curve from the first point of the branch', '1')
    call report_real('tangent_hz', merge(report%curve%omega_rate/two_pi, blank(), solved .and. report%curve%is_known()), &
                   'change of the frequency along the drawn curve', 'Hz')
    call report_real('work', report%work, 'floating-point operations up to here, by formulas', '1')

  contains

    subroutine report_real(name, value, description, unit)
      !> Name of the dataset; what the dataset holds; unit of the dataset
      character(*), intent(in) :: name, description, unit
      !> Numbers of the series
      real(wp), intent(in) :: value

      call listener%report('/points/'//name, 'real64', [integer ::], [value], description, unit)
    end subroutine report_real

    subroutine report_integer(name, value, description)
      !> Name of the dataset; what the dataset holds
      character(*), intent(in) :: name, description
      !> Numbers of the series
      integer, intent(in) :: value

      call listener%report('/points/'//name, 'int32', [integer ::], [real(value, wp)], description, '1')
    end subroutine report_integer
  end subroutine tell_numbers

  !> Contacts of all ranks, gathered in one go.
  subroutine tell_contacts(solver, report, listener)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    !> Receives the series
    type(listener_type), intent(in) :: listener
    real(wp), allocatable :: rows(:, :)
    integer :: k, n, i, sliders, motion, force

    call solver%context%balance%ranks%gather_columns(numbers_of(solver, report), rows)
    if (.not. listener%listens()) return
    k = solver%context%balance%coefficients()
    n = size(rows, 2)
    call listener%report('/contacts/state', 'int32', [n], rows(1, :), 'state over the period: index into the attribute names', &
                       '1', state_names)
    call listener%report('/contacts/unique', 'int32', [n], rows(2, :), &
                       '1: mean T and mean N are single-valued, 0 not, -1 not examined', '1')
    do i = 1, contact_columns
      call listener%report('/contacts/'//trim(contact_series(i)), 'real64', [n], rows(first_rows + i, :), &
                         trim(contact_descriptions(i)), trim(contact_units(i)))
    end do
    motion = first_rows + contact_columns
    force = motion + 3*k
    sliders = force + 3*k
    call listener%report('/contacts/displacement', 'real64', [n, 3, k], flat(rows(motion + 1:force, :)), &
                       'relative displacement t1, t2, n', 'user length')
    call listener%report('/contacts/force', 'real64', [n, 3, k], flat(rows(force + 1:sliders, :)), &
                       'contact force t1, t2, n', 'user force')
    call listener%report('/contacts/slider', 'real64', [n, size(rows, 1) - sliders], flat(rows(sliders + 1:, :)), &
                       'slider at the start of the period, along t1 and t2, of each element', 'user length')
  end subroutine tell_contacts

  !> Of each of this rank's contacts: state, unique, numbers, displacement, force and sliders [rows, contacts]. The last iterate of
  !> a point that was not found is no solution: blank.
  function numbers_of(solver, report) result(rows)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    real(wp), allocatable :: rows(:, :)
    real(wp), allocatable :: numbers(:, :), motion(:, :, :), force(:, :, :)
    integer :: k, i, unique

    associate (balance => solver%context%balance)
      k = balance%coefficients()
      call describe_contacts(solver, report, numbers, motion, force)
      allocate (rows(first_rows + contact_columns + 6*k + size(balance%slider, 1), size(balance%forces)))
      do i = 1, size(balance%forces)
        associate (forces => balance%forces(i))
          unique = merge(report%unique - 1, 0, forces%unique)
          if (report%unique /= 0) unique = report%unique
          rows(:, i) = [real(forces%state, wp), real(unique, wp), numbers(i, :), flat(motion(:, :, i)), flat(force(:, :, i)), &
                        forces%slider]
        end associate
      end do
    end associate
    if (report%findings%solved) return
    rows = blank()
    rows(1:2, :) = -1.0_wp
  end function numbers_of

  !> Numbers, displacement and force of this rank's contacts.
  subroutine describe_contacts(solver, report, numbers, motion, force)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> What is reported of a point
    type(point_report_type), intent(in) :: report
    !> [contacts, columns]
    real(wp), allocatable, intent(out) :: numbers(:, :)
    !> Coefficients, rows t1, t2, n [2 H + 1, 3, contacts]
    real(wp), allocatable, intent(out) :: motion(:, :, :), force(:, :, :)
    real(wp), allocatable :: recovered(:, :)
    real(wp) :: work
    integer :: i, k, n, row, component

    associate (balance => solver%context%balance)
      n = size(balance%law)
      k = balance%coefficients()
      allocate (numbers(n, contact_columns), source=blank())
      allocate (motion(k, 3, n), force(k, 3, n), source=0.0_wp)
      recovered = balance%recover(balance%response)
      do i = 1, n
        associate (law => balance%law(i), forces => balance%forces(i))
          do row = 1, law%tangents + 1
            component = merge(3, row, row > law%tangents)
            motion(:, component, i) = recovered(:, law%first_row + row - 1)
            force(:, component, i) = forces%deviation(:k, row) + motion(:, component, i) &
                                 *merge(law%normal_stiffness, law%tangential_stiffness, row > law%tangents)
          end do
          numbers(i, 1:2) = [force(1, 3, i), least_normal_force(law, motion(:, 3, i))]
          numbers(i, 5) = force(1, 1, i)
          if (law%tangents == 2) numbers(i, 8) = force(1, 2, i)
          if (report%unique == 1) then
            numbers(i, 3:4) = numbers(i, 1)
            numbers(i, 6:7) = numbers(i, 5)
            numbers(i, 9:10) = numbers(i, 8)
          end if
          work = work_per_period(force(:, 1, i), motion(:, 1, i)) + work_per_period(force(:, 2, i), motion(:, 2, i))
          numbers(i, 11:15) = [forces%stick, forces%slip, forces%open, work, report%errors%of_work(i, work)]
        end associate
      end do
    end associate
  end subroutine describe_contacts

  !> Least normal force over the period, located.
  pure real(wp) function least_normal_force(law, closing)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of v
    real(wp), intent(in) :: closing(:)
    real(wp) :: range(2)

    range = extrema(closing)
    least_normal_force = max(law%normal_force(range(1)), 0.0_wp)
  end function least_normal_force

  pure function flat(values)
    !> Numbers of the series
    real(wp), intent(in) :: values(:, :)
    real(wp) :: flat(size(values))

    flat = reshape(values, [size(values)])
  end function flat

  !> Where there is nothing to report
  pure real(wp) function blank()
    blank = ieee_value(blank, ieee_quiet_nan)
  end function blank
end module attrito_output_point_series
