!> What happens over some periods, from the polynomials of each segment: integrals and located extrema, so that nothing depends on
!> how densely anything is sampled; and samples for pictures.
!>
!> $$ W = \int f \cdot \dot q\, dt, \qquad E_v = \int \dot q^T C \dot q\, dt, \qquad
!>    E_f = \int T \dot w\, dt = \int T \dot u\, dt - \Big[ \frac{T^2}{2 k_t} \Big] $$
module attrito_integrate_recorder
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_slip
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_polynomial, only: sign_changes, value, derivative, product_of, product_integral
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: recorder_type, trace_type, slip_series_type, new_recorder, record

  !> Slip along two tangents over a stretch, by powers of the part of it that has passed: coefficients of r, e, phi' and u'.e [0:n]
  type :: slip_series_type
    integer :: contact = 0
    !> Does the contact land where it begins, r = 0?
    logical :: lands = .false.
    !> Is the disc so small that the slider follows u' at once?
    logical :: small = .false.
    real(wp), allocatable :: radius(:), e(:, :), turn(:), along(:)
  end type slip_series_type

  !> A stretch of the period in which no contact changes what it does, as the linearised flow sees it
  type :: trace_type
    !> Units of the clock
    real(wp) :: length = 0.0_wp
    !> What contacts do and to which side they slip [contacts]; u'/v' at its beginning, for those that land there [2, contacts]
    integer, allocatable :: regime(:), side(:)
    real(wp), allocatable :: landing_slope(:, :)
    !> Directions of slip at its beginning and at its end [2, contacts], and their series for those that slip along two tangents
    real(wp), allocatable :: from(:, :), to(:, :)
    type(slip_series_type), allocatable :: slips(:)
  end type trace_type

  type :: recorder_type
    !> Integrals and extrema; samples
    logical :: measures = .false., samples = .false.
    !> Time recorded, units of the clock
    real(wp) :: time = 0.0_wp
    !> Lowest, highest value and integral of each monitor [monitors]
    real(wp), allocatable :: low(:), high(:), integral(:)
    !> Integral of each row's force [rows], smallest normal force [contacts]
    real(wp), allocatable :: force_integral(:), lowest_normal(:)
    !> Time spent in each regime [0:2, contacts]
    real(wp), allocatable :: time_in(:, :)
    !> Energy dissipated by friction [contacts]; by damping; work of the loads
    real(wp), allocatable :: friction(:)
    real(wp) :: damping = 0.0_wp, work = 0.0_wp
    !> Samples per period, and samples taken so far
    integer :: per_period = 0, taken = 0
    !> Seconds [room], monitors [monitors, room], displacement and force of rows [rows, room], regime [contacts, room]
    real(wp), allocatable :: time_of(:), monitor(:, :), displacement(:, :), force(:, :)
    integer, allocatable :: regime(:, :)
    !> Modal displacement at the samples [m, room]; not allocated unless wanted
    real(wp), allocatable :: trajectory(:, :)
    !> Event-exact integration: keep a trace of every stretch between events, so many so far [room]
    logical :: traces = .false.
    integer :: stretches = 0
    type(trace_type), allocatable :: trace(:)
  end type recorder_type

contains

  !> A recorder that has seen nothing.
  pure function new_recorder(system, per_period, room) result(self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Samples per period, and how many to make room for
    integer, intent(in) :: per_period, room
    type(recorder_type) :: self
    integer :: monitors, rows, contacts

    monitors = size(system%monitors, 2)
    rows = size(system%springs)
    contacts = size(system%law)
    allocate (self%low(monitors), source=huge(1.0_wp))
    allocate (self%high(monitors), source=-huge(1.0_wp))
    allocate (self%integral(monitors), self%force_integral(rows), self%friction(contacts), self%time_in(0:2, contacts), &
              source=0.0_wp)
    allocate (self%lowest_normal(contacts), source=huge(1.0_wp))
    self%per_period = per_period
    allocate (self%time_of(room), self%monitor(monitors, room), self%displacement(rows, room), self%force(rows, room), &
              source=0.0_wp)
    allocate (self%regime(contacts, room), source=0)
    allocate (self%trace(0))
  end function new_recorder

  !> Take one segment in.
  pure subroutine record(self, system, loading, segment)
    type(recorder_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment

    if (self%measures) then
      self%time = self%time + segment%length
      call measure_monitors(self, system, segment)
      call measure_contacts(self, system, segment)
      call measure_energies(self, system, segment)
    end if
    if (self%samples) call take_samples(self, system, loading, segment)
    if (self%traces) call keep_trace(self, system, segment)
  end subroutine record

  pure subroutine keep_trace(self, system, segment)
    type(recorder_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    type(trace_type) :: trace
    real(wp) :: dv
    integer :: i, last, n

    last = self%stretches
    trace%slips = slips_of(system, segment)
    if (last > 0 .and. size(trace%slips) == 0) then
      if (size(self%trace(last)%slips) == 0 .and. all(self%trace(last)%regime == segment%regime) .and. &
          all(self%trace(last)%side == segment%side)) then
        self%trace(last)%length = self%trace(last)%length + segment%length
        return
      end if
    end if
    trace%length = segment%length
    trace%regime = segment%regime
    trace%side = segment%side
    allocate (trace%landing_slope(2, size(system%law)), trace%from(2, size(system%law)), source=0.0_wp)
    trace%from(1, :) = segment%side
    trace%to = trace%from
    do i = 1, size(system%law)
      n = system%law(i)%tangents
      associate (d => segment%displacement, first => system%law(i)%first_row)
        dv = d(1, first + n)
        if (abs(dv) > 0.0_wp) trace%landing_slope(:n, i) = d(1, first:first + n - 1)/dv
        if (n == 1) cycle
        trace%from(:, i) = [cos(segment%angle(0, i)), sin(segment%angle(0, i))]
        trace%to(1, i) = value(segment%angle(:, i), segment%length)
        trace%to(:, i) = [cos(trace%to(1, i)), sin(trace%to(1, i))]
      end associate
    end do
    if (last == size(self%trace)) call make_room(self)
    self%stretches = last + 1
    self%trace(last + 1) = trace
  end subroutine keep_trace

  !> For twice as many stretches.
  pure subroutine make_room(self)
    type(recorder_type), intent(inout) :: self
    type(trace_type), allocatable :: larger(:)

    allocate (larger(2*size(self%trace) + 16))
    larger(:size(self%trace)) = self%trace
    call move_alloc(larger, self%trace)
  end subroutine make_room

  !> What the linearised flow needs of contacts that slip along two tangents.
  pure function slips_of(system, segment) result(slips)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    type(slip_series_type), allocatable :: slips(:)
    integer, allocatable :: contacts(:)
    real(wp) :: powers(0:ubound(segment%motion, 2))
    integer :: s, i, n

    contacts = pack([(i, i=1, size(system%law))], segment%regime == regime_slip .and. system%law%has_direction())
    allocate (slips(size(contacts)))
    n = ubound(powers, 1)
    powers(0) = 1.0_wp
    do i = 1, n
      powers(i) = powers(i - 1)*segment%length
    end do
    do s = 1, size(contacts)
      i = contacts(s)
      associate (law => system%law(i), first => system%law(i)%first_row, slip => slips(s), e => segment%direction)
        slip%contact = i
        slip%lands = segment%lands(i)
        slip%small = segment%small(i)
        allocate (slip%radius(0:n), slip%turn(0:n), slip%along(0:n), slip%e(0:n, 2))
        slip%radius = powers*segment%radius(:, i)
        if (slip%small) slip%radius = powers*law%friction_coefficient/law%tangential_stiffness*segment%force(:, first + 2)
        slip%e = spread(powers, 2, 2)*e(:, :, i)
        slip%turn = derivative(powers*segment%angle(:, i))
        slip%along = product_of(derivative(powers*segment%displacement(:, first)), slip%e(:, 1)) &
                     + product_of(derivative(powers*segment%displacement(:, first + 1)), slip%e(:, 2))
      end associate
    end do
  end function slips_of

  pure subroutine measure_monitors(self, system, segment)
    type(recorder_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    real(wp) :: polynomial(0:ubound(segment%motion, 2)), range(2)
    integer :: monitor

    do monitor = 1, size(self%low)
      polynomial = matmul(system%monitors(:, monitor), segment%motion)
      range = range_of(polynomial, segment)
      self%low(monitor) = min(self%low(monitor), range(1))
      self%high(monitor) = max(self%high(monitor), range(2))
      self%integral(monitor) = self%integral(monitor) + product_integral(polynomial, [1.0_wp], segment%length)
    end do
  end subroutine measure_monitors

  pure subroutine measure_contacts(self, system, segment)
    type(recorder_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    real(wp) :: range(2), h
    integer :: i, row

    h = segment%length
    do row = 1, size(self%force_integral)
      self%force_integral(row) = self%force_integral(row) + product_integral(segment%force(:, row), [1.0_wp], h)
    end do
    do i = 1, size(system%law)
      associate (law => system%law(i), spent => self%time_in(segment%regime(i), i))
        spent = spent + h
        range = range_of(segment%force(:, law%first_row + law%tangents), segment)
        self%lowest_normal(i) = min(self%lowest_normal(i), max(range(1), 0.0_wp))
        do row = law%first_row, law%first_row + law%tangents - 1
          self%friction(i) = self%friction(i) + work_of(segment%force(:, row), segment%displacement(:, row), h) &
                             - (value(segment%force(:, row), h)**2 - segment%force(0, row)**2)/(2.0_wp*law%tangential_stiffness)
        end do
      end associate
    end do
  end subroutine measure_contacts

  pure subroutine measure_energies(self, system, segment)
    type(recorder_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    real(wp) :: rate(size(segment%motion, 1), 0:ubound(segment%motion, 2)), damped(size(segment%motion, 1)), clock2
    real(wp), allocatable :: drag(:, :)
    integer :: r, k

    clock2 = system%clock**2
    rate = 0.0_wp
    do k = 0, ubound(rate, 2) - 1
      rate(:, k) = (k + 1)*segment%motion(:, k + 1)
    end do
    drag = rate*spread(system%damping, 2, size(rate, 2))
    if (allocated(system%coupling)) drag = drag + matmul(system%coupling, rate)
    do r = 1, size(damped)
      self%damping = self%damping + clock2*product_integral(drag(r, :), rate(r, :), segment%length)
      self%work = self%work + clock2*product_integral(segment%load(r, :), rate(r, :), segment%length)
    end do
  end subroutine measure_energies

  !> Integral of force times rate of displacement over [0, h].
  pure real(wp) function work_of(force, displacement, h)
    !> Load on the coordinates, or a force; displacement of the coordinates; length of the interval, s
    real(wp), intent(in) :: force(0:), displacement(0:), h

    work_of = product_integral(force, derivative(displacement), h)
  end function work_of

  !> Smallest and largest value of a polynomial on the segment, located.
  pure function range_of(polynomial, segment) result(range)
    !> Polynomial, coefficients from degree 0
    real(wp), intent(in) :: polynomial(0:)
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    real(wp) :: range(2), rate(0:ubound(polynomial, 1)), roots(ubound(polynomial, 1)), power, at
    integer :: k, count

    at = value(polynomial, segment%length)
    range = [min(polynomial(0), at), max(polynomial(0), at)]
    power = 1.0_wp
    rate = 0.0_wp
    do k = 0, ubound(rate, 1) - 1
      rate(k) = (k + 1)*polynomial(k + 1)*power
      power = power*segment%length
    end do
    call sign_changes(rate, segment%bernstein, roots, count)
    do k = 1, count
      at = value(polynomial, roots(k)*segment%length)
      range = [min(range(1), at), max(range(2), at)]
    end do
  end function range_of

  !> The samples that fall into the segment; a segment owns its beginning.
  pure subroutine take_samples(self, system, loading, segment)
    type(recorder_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    real(wp) :: spacing, x, nearly
    real(wp) :: motion(size(segment%motion, 1))
    integer :: j, row

    spacing = loading%period/self%per_period
    nearly = 1.0e-10_wp*spacing
    do j = ceiling((segment%theta - nearly)/spacing), self%per_period - 1
      x = j*spacing - segment%theta
      if (x >= segment%length - nearly .or. self%taken == size(self%time_of)) exit
      x = max(x, 0.0_wp)
      self%taken = self%taken + 1
      self%time_of(self%taken) = (segment%cycle + real(j, wp)/self%per_period)*loading%period/system%clock
      motion = value_of_motion(segment, x)
      self%monitor(:, self%taken) = matmul(transpose(system%monitors), motion)
      if (allocated(self%trajectory)) self%trajectory(:, self%taken) = motion
      do row = 1, size(self%force_integral)
        self%displacement(row, self%taken) = value(segment%displacement(:, row), x)
        self%force(row, self%taken) = value(segment%force(:, row), x)
      end do
      self%regime(:, self%taken) = segment%regime
    end do
  end subroutine take_samples

  pure function value_of_motion(segment, x) result(motion)
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    !> Fraction of the interval
    real(wp), intent(in) :: x
    real(wp) :: motion(size(segment%motion, 1))
    integer :: k

    motion = segment%motion(:, ubound(segment%motion, 2))
    do k = ubound(segment%motion, 2) - 1, 0, -1
      motion = motion*x + segment%motion(:, k)
    end do
  end function value_of_motion
end module attrito_integrate_recorder
