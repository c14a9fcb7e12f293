!> `result.h5`: one entry a point, written as soon as it is solved, each rank its own contacts. The layout is in docs/files.md.
module attrito_output_result_file
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_array, only: write_block
  use attrito_core_hdf5_attribute, only: write_attribute
  use attrito_core_hdf5_dataset, only: create_series, extend_series, widen_series
  use attrito_core_hdf5_file, only: hdf5_file_type, append_file, close_file, flush_file
  use attrito_core_kinds, only: wp, pi
  use attrito_core_trigonometric, only: extrema
  use attrito_model_contacts, only: contact_type
  use attrito_continuation_solver, only: solver_type
  use attrito_balance_receptance, only: to_real
  use attrito_output_point_report, only: point_report_type, outcome_names
  implicit none
  private
  public :: result_file_type, open_result, write_point, close_result

  character(12), parameter :: state_names(0:3) = [character(12) :: 'stuck', 'shaken_down', 'slipping', 'open']
  !> Series of one number a contact, in the order of `contact_numbers`
  integer, parameter :: contact_columns = 14
  character(20), parameter :: contact_series(contact_columns) = [character(20) :: 'n_mean', 'n_min', 'n_low', 'n_high', 't1_mean', &
    't1_low', 't1_high', 't2_mean', 't2_low', 't2_high', 'stick', 'slip', 'open', 'dissipated_energy']
  character(64), parameter :: contact_descriptions(contact_columns) = [character(64) :: 'mean normal force', &
    'least normal force over the period', 'lower bound of the mean normal force', 'upper bound of the mean normal force', &
    'mean tangential force, first direction', 'its lower bound', 'its upper bound', 'mean tangential force, second direction', &
    'its lower bound', 'its upper bound', 'part of the period in stick', 'part of the period in slip', &
    'part of the period in lift-off', 'work done against friction per period']
  character(12), parameter :: contact_units(contact_columns) = [character(12) :: 'user force', 'user force', 'user force', &
    'user force', 'user force', 'user force', 'user force', 'user force', 'user force', 'user force', '1', '1', '1', 'user energy']

  type :: result_file_type
    type(hdf5_file_type) :: file
    integer :: points = 0
    !> Names of the monitors
    character(64), allocatable :: monitors(:)
  end type result_file_type

contains

  !> Create the series in a file whose root the front has written.
  subroutine open_result(solver, comm, path, contacts, monitors, self, error)
    type(solver_type), intent(in) :: solver
    !> The ranks that write
    integer, intent(in) :: comm
    character(*), intent(in) :: path
    !> Contacts over all ranks
    integer, intent(in) :: contacts
    !> Names of the monitors
    character(*), intent(in) :: monitors(:)
    type(result_file_type), intent(out) :: self
    type(error_type), allocatable, intent(out) :: error
    integer :: i, k

    self%monitors = monitors
    k = solver%context%balance%coefficients()
    call append_file(self%file, comm, path, error)
    if (allocated(error)) return
    call point_series('frequency_hz', 'real64', 'frequency of the fundamental harmonic', 'Hz')
    call point_series('level', 'real64', 'factor on the harmonic loads', '1')
    call point_series('branch', 'int32', 'number of the connected run of points', '1')
    call point_series('iterations', 'int32', 'iterations of Newton''s method, all tries together', '1')
    call point_series('linear_iterations', 'int32', 'iterations of GMRES, where linear systems are large', '1')
    call point_series('period', 'int32', 'period of the solution in periods of the excitation', '1')
    call point_series('outcome', 'int32', 'how the point ended: index into the attribute names', '1')
    call point_series('unique', 'int32', '1 unique, 0 one of a family, -1 not examined', '1')
    call point_series('stable', 'int32', '1 stable, 0 unstable, -1 not examined', '1')
    call point_series('residual', 'real64', 'norm of the residual relative to the stuck response', '1')
    call point_series('estimate', 'real64', 'estimated relative error of the amplitude', '1')
    call point_series('error_harmonics', 'real64', 'part of the estimate: harmonics left out', '1')
    call point_series('error_samples', 'real64', 'part of the estimate: samples of contact forces', '1')
    call point_series('error_modes', 'real64', 'part of the estimate: modes that the reduction left out', '1')
    call point_series('harmonics', 'int32', 'harmonics of the balance; coefficients beyond are 0', '1')
    call point_series('samples', 'int32', 'samples a period of contacts that go by samples', '1')
    call point_series('work', 'real64', 'floating-point operations up to here, by formulas', '1')
    call wide_series('/points/coordinates', [size(solver%structure%mass, 1), k], &
                     'Fourier coefficients of the coordinates: mean, cosine 1, sine 1, ...', 'user length')
    do i = 1, size(monitors)
      call series(monitor_path(i)//'amplitude', 'real64', [integer ::], 'half the range over the period', 'user length')
      call series(monitor_path(i)//'mean', 'real64', [integer ::], 'mean over the period', 'user length')
      call series(monitor_path(i)//'low', 'real64', [integer ::], 'lower bound of the amplitude', 'user length')
      call series(monitor_path(i)//'high', 'real64', [integer ::], 'upper bound of the amplitude', 'user length')
      call wide_series(monitor_path(i)//'harmonics', [k], 'Fourier coefficients', 'user length')
    end do
    call series('/contacts/state', 'int32', [contacts], 'state over the period: index into the attribute names', '1')
    call series('/contacts/unique', 'int32', [contacts], '1: mean T and mean N are single-valued, 0 not, -1 not examined', '1')
    do i = 1, contact_columns
      call series('/contacts/'//trim(contact_series(i)), 'real64', [contacts], trim(contact_descriptions(i)), &
                  trim(contact_units(i)))
    end do
    call wide_series('/contacts/displacement', [contacts, 3, k], 'relative displacement t1, t2, n', 'user length')
    call wide_series('/contacts/force', [contacts, 3, k], 'contact force t1, t2, n', 'user force')
    call series('/contacts/slider', 'real64', [contacts, 2], 'slider at the start of the period', 'user length')
    if (allocated(error)) return
    call write_attribute(self%file, '/points/outcome', 'names', outcome_names, error)
    if (.not. allocated(error)) call write_attribute(self%file, '/contacts/state', 'names', state_names, error)

  contains

    subroutine point_series(name, kind, description, unit)
      character(*), intent(in) :: name, kind, description, unit

      call series('/points/'//name, kind, [integer ::], description, unit)
    end subroutine point_series

    subroutine series(name, kind, extent, description, unit)
      character(*), intent(in) :: name, kind, description, unit
      integer, intent(in) :: extent(:)

      if (allocated(error)) return
      call create_series(self%file, name, kind, extent, description, unit, error)
    end subroutine series

    !> Of series whose length may change from point to point.
    subroutine wide_series(name, extent, description, unit)
      character(*), intent(in) :: name, description, unit
      integer, intent(in) :: extent(:)

      if (allocated(error)) return
      call create_series(self%file, name, 'real64', extent, description, unit, error, widens=.true.)
    end subroutine wide_series

    function monitor_path(monitor) result(path)
      integer, intent(in) :: monitor
      character(:), allocatable :: path

      path = '/monitors/'//trim(monitors(monitor))//'/'
    end function monitor_path
  end subroutine open_result

  !> Append the solver's present point.
  subroutine write_point(solver, report, self, error)
    type(solver_type), intent(in) :: solver
    type(point_report_type), intent(in) :: report
    type(result_file_type), intent(inout) :: self
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: blank, bound
    integer :: i
    logical :: mine, solved

    self%points = self%points + 1
    mine = solver%context%balance%ranks%is_root()
    blank = ieee_value(blank, ieee_quiet_nan)
    solved = report%is_solved()
    call put_real('/points/frequency_hz', report%frequency_hz)
    call put_real('/points/level', report%level)
    call put_integer('/points/branch', report%branch)
    call put_integer('/points/iterations', report%iterations)
    call put_integer('/points/linear_iterations', report%linear_iterations)
    call put_integer('/points/period', merge(1, -1, solved))
    call put_integer('/points/outcome', report%outcome)
    call put_integer('/points/unique', merge(report%unique, -1, solved))
    call put_integer('/points/stable', report%stable)
    call put_real('/points/residual', report%residual)
    call put_real('/points/estimate', merge(report%errors%all(), blank, solved))
    call put_real('/points/error_harmonics', merge(report%errors%harmonics, blank, solved))
    call put_real('/points/error_samples', merge(report%errors%samples, blank, solved))
    call put_real('/points/error_modes', merge(report%errors%modes, blank, solved))
    call put_integer('/points/harmonics', report%series)
    call put_integer('/points/samples', report%samples)
    call put_real('/points/work', report%work)
    call put_rows('/points/coordinates', [self%points - 1], &
                  matmul(to_real(solver%context%balance%response), transpose(solver%context%balance%receptance%basis)), mine)
    do i = 1, size(self%monitors)
      associate (path => '/monitors/'//trim(self%monitors(i))//'/', amplitude => report%amplitude(i))
        bound = merge(amplitude, blank, report%unique == 1)
        call put_real(path//'amplitude', amplitude)
        call put_real(path//'mean', report%mean(i))
        call put_real(path//'low', bound)
        call put_real(path//'high', bound)
        call put_rows(path//'harmonics', [self%points - 1], report%harmonics(:, i:i), mine)
      end associate
    end do
    if (.not. allocated(error)) call write_contacts(solver, report, self, error)
    if (.not. allocated(error)) call flush_file(self%file, error)

  contains

    subroutine put_real(name, value)
      character(*), intent(in) :: name
      real(wp), intent(in) :: value
      real(wp) :: values(merge(1, 0, mine))

      values = value
      if (index(name, '/monitors/') == 1 .and. .not. solved) values = blank
      if (.not. allocated(error)) call extend_series(self%file, name, self%points, error)
      if (.not. allocated(error)) call write_block(self%file, name, [self%points - 1], values, error)
    end subroutine put_real

    subroutine put_integer(name, value)
      character(*), intent(in) :: name
      integer, intent(in) :: value
      integer :: values(merge(1, 0, mine))

      values = value
      if (.not. allocated(error)) call extend_series(self%file, name, self%points, error)
      if (.not. allocated(error)) call write_block(self%file, name, [self%points - 1], values, error)
    end subroutine put_integer

    subroutine put_rows(name, start, values, here)
      character(*), intent(in) :: name
      integer, intent(in) :: start(:)
      real(wp), intent(in) :: values(:, :)
      logical, intent(in) :: here
      real(wp), allocatable :: own(:, :)

      allocate (own(size(values, 1), merge(size(values, 2), 0, here)))
      own = values(:, :size(own, 2))
      if (.not. solved) own = blank
      if (.not. allocated(error)) call extend_series(self%file, name, self%points, error)
      if (.not. allocated(error)) call widen_series(self%file, name, size(values, 1), error)
      if (.not. allocated(error)) call write_block(self%file, name, start, own, error)
    end subroutine put_rows
  end subroutine write_point

  !> Each rank's contacts.
  subroutine write_contacts(solver, report, self, error)
    type(solver_type), intent(in) :: solver
    type(point_report_type), intent(in) :: report
    type(result_file_type), intent(in) :: self
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: numbers(:, :), motion(:, :, :), force(:, :, :), slider(:, :)
    integer, allocatable :: states(:), unique(:)
    real(wp) :: blank
    integer :: start(2), i

    blank = ieee_value(blank, ieee_quiet_nan)
    associate (balance => solver%context%balance)
      call gather_contacts(solver, report, numbers, motion, force)
      states = [(balance%forces(i)%state, i=1, size(balance%forces))]
      unique = [(merge(report%unique - 1, 0, balance%forces(i)%unique), i=1, size(balance%forces))]
      if (report%unique /= 0) unique = report%unique
      slider = reshape([(balance%forces(i)%slider, i=1, size(balance%forces))], [2, size(balance%forces)])
      start = [self%points - 1, balance%first_contact - 1]
    end associate
    if (.not. report%is_solved()) then
      ! The last iterate is no solution.
      states = -1
      unique = -1
      numbers = blank
      motion = blank
      force = blank
      slider = blank
    end if
    call extend_and('/contacts/state')
    if (.not. allocated(error)) call write_block(self%file, '/contacts/state', start, states, error)
    call extend_and('/contacts/unique')
    if (.not. allocated(error)) call write_block(self%file, '/contacts/unique', start, unique, error)
    do i = 1, contact_columns
      call extend_and('/contacts/'//trim(contact_series(i)))
      if (.not. allocated(error)) call write_block(self%file, '/contacts/'//trim(contact_series(i)), start, numbers(:, i), error)
    end do
    call extend_and('/contacts/displacement')
    if (.not. allocated(error)) call widen_series(self%file, '/contacts/displacement', size(motion, 1), error)
    if (.not. allocated(error)) call write_block(self%file, '/contacts/displacement', start, motion, error)
    call extend_and('/contacts/force')
    if (.not. allocated(error)) call widen_series(self%file, '/contacts/force', size(force, 1), error)
    if (.not. allocated(error)) call write_block(self%file, '/contacts/force', start, force, error)
    call extend_and('/contacts/slider')
    if (.not. allocated(error)) call write_block(self%file, '/contacts/slider', start, slider, error)

  contains

    subroutine extend_and(name)
      character(*), intent(in) :: name

      if (.not. allocated(error)) call extend_series(self%file, name, self%points, error)
    end subroutine extend_and
  end subroutine write_contacts

  !> Numbers, displacement and force of this rank's contacts.
  subroutine gather_contacts(solver, report, numbers, motion, force)
    type(solver_type), intent(in) :: solver
    type(point_report_type), intent(in) :: report
    !> [contacts, columns]
    real(wp), allocatable, intent(out) :: numbers(:, :)
    !> Coefficients, rows t1, t2, n [2 H + 1, 3, contacts]
    real(wp), allocatable, intent(out) :: motion(:, :, :), force(:, :, :)
    real(wp), allocatable :: recovered(:, :)
    real(wp) :: blank
    integer :: i, k, n, row, place

    blank = ieee_value(blank, ieee_quiet_nan)
    associate (balance => solver%context%balance)
      n = size(balance%law)
      k = balance%coefficients()
      allocate (numbers(n, contact_columns), source=blank)
      allocate (motion(k, 3, n), force(k, 3, n), source=0.0_wp)
      recovered = balance%recover(balance%response)
      do i = 1, n
        associate (law => balance%law(i), forces => balance%forces(i))
          do row = 1, law%tangents + 1
            place = merge(3, row, row > law%tangents)
            motion(:, place, i) = recovered(:, law%first_row + row - 1)
            force(:, place, i) = forces%deviation(:k, row) + motion(:, place, i) &
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
          numbers(i, 11:14) = [forces%stick, forces%slip, forces%open, &
                               work_per_period(force(:, 1, i), motion(:, 1, i)) + work_per_period(force(:, 2, i), motion(:, 2, i))]
        end associate
      end do
    end associate
  end subroutine gather_contacts

  !> Least normal force over the period, located.
  pure real(wp) function least_normal_force(law, closing)
    type(contact_type), intent(in) :: law
    !> Coefficients of v
    real(wp), intent(in) :: closing(:)
    real(wp) :: range(2)

    range = extrema(closing)
    least_normal_force = max(law%preload + law%normal_stiffness*(range(1) - law%gap), 0.0_wp)
  end function least_normal_force

  !> Work of a force on a displacement over a period, pi sum_h h (F_c u_s - F_s u_c).
  pure real(wp) function work_per_period(force, displacement)
    real(wp), intent(in) :: force(:), displacement(:)
    integer :: h

    work_per_period = 0.0_wp
    do h = 1, (size(force) - 1)/2
      work_per_period = work_per_period + pi*h*(force(2*h)*displacement(2*h + 1) - force(2*h + 1)*displacement(2*h))
    end do
  end function work_per_period

  !> Close the file.
  subroutine close_result(self)
    type(result_file_type), intent(inout) :: self

    call close_file(self%file)
  end subroutine close_result
end module attrito_output_result_file
