!> A mode's frequency and damping by quasi-static loading: the static problem under the inertia forces of the tangent mode phi,
!>
!> $$ K x + B^T \lambda(B x, w) = f_0 + \alpha M \phi, \qquad q = \phi^T M (x - x_0), \qquad \phi^T M \phi = 1, $$
!>
!> alpha going from 0 to the load's amplitude A and then through whole cycles A cos(theta), loading, unloading and loading again,
!> until a cycle closes: the sliders come back, or only a few of them creep, ever slower, and the loop is the same from cycle to
!> cycle. The preload f_0 stays, and the sliders w go along. Nothing is assumed of the loop's shape.
!>
!> An oscillator of unit mass, q'' + 2 zeta omega q' + omega^2 q = 0, has the secant stiffness omega^2, and at the amplitude Q its
!> damper takes pi (2 zeta omega) omega Q^2 a period. With the loop's secant and the work W that its contacts do,
!>
!> $$ Q = \tfrac{1}{2} (q_{max} - q_{min}), \quad \omega^2 = A/Q, \quad \zeta = W/(2 \pi (\omega Q)^2), \quad W = \oint \alpha dq. $$
!>
!> Masing's rule makes the loop out of the first loading, twice as large, and is noted beside it:
!>
!> $$ \omega_M^2 = A/q(A), \quad W_M = 8 \int_0^{q(A)} \alpha dq - 4 A q(A), \quad \zeta_M = W_M/(2 \pi A q(A)). $$
!>
!> It takes for loss what contacts that open give back, and does not hold where normal forces vary.
!>
!> Sources: Festjens, Chevallier & Dion 2013, Int. J. Mech. Sci. 75, 170-177; Lacayo & Allen 2019, Mech. Syst. Signal Process. 118,
!> 133-157; Jewell, Allen, Zare & Wall 2020, J. Sound Vib. 479, 115376.
module attrito_peak_quasi_static
  use attrito_core_kinds, only: wp, two_pi
  use attrito_balance_harmonic_balance, only: balance_type, stuck_mean_type
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping, state_open
  use attrito_linear_damping, only: damping_form
  use attrito_linear_rigid_body_modes, only: new_rigid_body_modes
  use attrito_peak_loading_path, only: loading_path_type, new_loading_path
  use attrito_peak_slip_work, only: slip_work
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: quasi_static_type, begin_quasi_static

  !> Steps of the cycles that let the sliders settle
  integer, parameter :: settling_steps = 8 ! guess
  !> By how much sliders may miss where they began: parts of the motion, and multiples of the tolerance
  real(wp), parameter :: closed = 3.0e-7_wp, closed_tolerances = 10.0_wp ! guess
  !> By how much two cycles may differ whose sliders still creep: parts of Q and of the loop's area
  real(wp), parameter :: same_amplitude = 3.0e-7_wp, same_area = 3.0e-6_wp ! guess
  !> Creep that is extrapolated: largest part that a cycle leaves, and by what part two steps may differ in direction
  real(wp), parameter :: slowest_creep = 0.97_wp, alike = 0.2_wp ! guess

  !> The states of one cycle, and the first once more [..., 0:steps]
  type :: history_type
    !> Mean response [n], mean displacements and deviations of this rank's rows [rows], sliders [width, contacts], states [contacts]
    real(wp), allocatable :: response(:, :), motion(:, :), deviation(:, :), slider(:, :, :)
    integer, allocatable :: state(:, :)
  end type history_type

  type :: quasi_static_type
    !> Of the last cycle: amplitude A of the load, and Q
    real(wp) :: load = 0.0_wp, amplitude = 0.0_wp
    !> Damping ratio of the structure alone
    real(wp) :: structural_ratio = 0.0_wp
    !> Area of the loop of load and Q, by trapezoids; work of all contacts, and the same from every second state
    real(wp) :: area = 0.0_wp, work = 0.0_wp, coarse_work = 0.0_wp
    !> Work of this rank's contacts
    real(wp), allocatable :: contact_work(:)
    !> Half the range of each monitor over the cycle
    real(wp), allocatable :: monitored(:)
    !> By Masing's rule from the first loading: angular frequency and damping ratio
    real(wp) :: masing_omega = 0.0_wp, masing_ratio = 0.0_wp
    !> What the last cycle misses of closing: its sliders relative to the motion's scale, or, where they creep and the loop feels no
    !> more of it, Q relative to the cycle before
    real(wp) :: defect = 0.0_wp
    !> Have the sliders come back to where the last cycle of those that let them settle began?
    logical :: closed = .false.
    !> What that cycle misses otherwise, huge where the loop still changes
    real(wp), private :: loop_defect = huge(1.0_wp)
    !> M phi in generalised coordinates [n]; norm of the contacts' motion that a unit of load gives the mode
    real(wp), allocatable, private :: reader(:)
    real(wp), private :: motion_per_load = 0.0_wp
    !> Of the motion that is reported
    integer, private :: harmonics = 0
    !> The equilibria that it goes through
    type(loading_path_type) :: path
  contains
    procedure :: cycle_at
    procedure :: try_cycle
  end type quasi_static_type

contains

  !> Add the inertia forces of a mode to the static loads of a solver that has followed its static path; it serves nothing else
  !> from then on.
  subroutine begin_quasi_static(solver, shape, omega, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The tangent mode in the model's coordinates, unit modal mass [m]
    real(wp), intent(in) :: shape(:)
    !> Its angular frequency, rad/s
    real(wp), intent(in) :: omega
    type(quasi_static_type), intent(out) :: self
    real(wp), allocatable :: loads(:, :)
    integer :: count

    associate (balance => solver%context%balance, structure => solver%structure)
      count = size(structure%static_loads, 2)
      allocate (loads(size(shape), count + 1))
      loads(:, :count) = structure%static_loads
      loads(:, count + 1) = matmul(structure%mass, shape)
      call move_alloc(loads, structure%static_loads)
      balance%static_loads = balance%receptance%project_mean_loads(structure%static_loads)
      balance%free = new_rigid_body_modes(structure, solver%contacts)
      balance%kept = stuck_mean_type()
      self%reader = balance%static_loads(:, count + 1)
      self%harmonics = solver%options%harmonics
      call solver%set_harmonics(0)
      call solver%set_loads([balance%static_factors, 0.0_wp], 0.0_wp)
      solver%options%reset_slider = .false.
      self%motion_per_load = norm2(matmul(shape, solver%contacts%directions))/omega**2
    end associate
    self%path = new_loading_path(solver, self%reader)
  end subroutine begin_quasi_static

  !> Load from the static solution and through cycles of an amplitude of the load; the solver's point is then the last cycle as a
  !> motion, its sliders' defect what that cycle misses.
  subroutine cycle_at(self, solver, load, steps, settling)
    class(quasi_static_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Amplitude A
    real(wp), intent(in) :: load
    !> Of a cycle, a multiple of 4
    integer, intent(in) :: steps
    !> Cycles of few steps before, until one closes, and as many of so many steps, at most
    integer, intent(in) :: settling
    type(history_type) :: history

    call load_up(self, solver, load, steps)
    if (self%path%found) call settle(self, solver, load, settling_steps, settling)
    if (self%path%found) call settle(self, solver, load, steps, settling)
    if (self%path%found) call record_cycle(self, solver, load, steps, history)
    if (self%path%found) call measure(self, solver, history)
    call solver%set_harmonics(self%harmonics)
    if (self%path%found) call make_motion(self, solver, history)
  end subroutine cycle_at

  !> The amplitude Q of a cycle that is not reported, from the static solution.
  subroutine try_cycle(self, solver, load, steps, settling)
    class(quasi_static_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Amplitude A
    real(wp), intent(in) :: load
    !> Of a cycle, a multiple of 4; cycles until one closes, at most, and at least one
    integer, intent(in) :: steps, settling

    call load_up(self, solver, load, steps/4)
    if (self%path%found) call settle(self, solver, load, steps, max(settling, 1))
    call solver%set_harmonics(self%harmonics)
  end subroutine try_cycle

  !> From the static solution to the load's amplitude.
  subroutine load_up(self, solver, load, steps)
    type(quasi_static_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Amplitude A
    real(wp), intent(in) :: load
    !> On the way
    integer, intent(in) :: steps
    real(wp) :: before, now, at_rest, area
    integer :: i

    self%load = load
    ! At rest there is nothing but the mean.
    call solver%set_harmonics(0)
    call self%path%start(solver, abs(load)*self%motion_per_load)
    at_rest = self%path%coordinate(solver)
    before = at_rest
    area = 0.0_wp
    do i = 1, steps
      call self%path%walk_to(solver, load*sin(0.25_wp*two_pi*i/steps))
      if (.not. self%path%found) return
      now = self%path%coordinate(solver)
      area = area + 0.5_wp*load*(sin(0.25_wp*two_pi*(i - 1)/steps) + sin(0.25_wp*two_pi*i/steps))*(now - before)
      before = now
    end do
    now = now - at_rest
    self%masing_omega = sqrt(max(load/now, 0.0_wp))
    self%masing_ratio = (8.0_wp*area - 4.0_wp*load*now)/(two_pi*load*now)
  end subroutine load_up

  !> Cycles until one closes, or until their loop is the same from cycle to cycle though sliders creep. None is recorded, but the
  !> range of q of the last is.
  !>
  !> Sliders under normal forces that vary creep, each cycle by a part rho of what the one before moved them by. Where two cycles say
  !> so they are taken to where that leads, w + rho/(1 - rho) delta w.
  subroutine settle(self, solver, load, steps, most)
    type(quasi_static_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Amplitude A
    real(wp), intent(in) :: load
    !> Of a cycle; cycles at most
    integer, intent(in) :: steps, most
    real(wp) :: coordinate(0:steps), amplitude_before, area_before, ratio
    real(wp), allocatable :: slider(:, :), creep(:, :), last(:, :)
    integer :: number, i

    self%loop_defect = huge(1.0_wp)
    do number = 1, most
      slider = self%path%state%slider
      amplitude_before = self%amplitude
      area_before = self%area
      coordinate(0) = self%path%coordinate(solver)
      do i = 1, steps
        call self%path%walk_to(solver, load*cos(two_pi*i/steps))
        if (.not. self%path%found) return
        coordinate(i) = self%path%coordinate(solver)
      end do
      call measure_loop(self, coordinate)
      self%defect = defect_of(solver, slider, self%path%state%slider)
      self%closed = self%defect <= accepted(solver)
      if (self%closed) exit
      creep = self%path%state%slider - slider
      if (allocated(last)) then
        ! What goes on by equal steps is no creep, whatever the loop.
        if (norm2(creep) <= slowest_creep*norm2(last) .and. abs(self%area - area_before) <= same_area*abs(self%area) &
            .and. abs(self%amplitude - amplitude_before) <= same_amplitude*self%amplitude) then
          self%loop_defect = abs(self%amplitude - amplitude_before)/self%amplitude
          exit
        end if
        ratio = sum(creep*last)/max(sum(last**2), tiny(1.0_wp))
        if (ratio > 0.0_wp .and. ratio <= slowest_creep .and. norm2(creep - ratio*last) <= alike*norm2(creep)) then
          self%path%state%slider = self%path%state%slider + ratio/(1.0_wp - ratio)*creep
          deallocate (last)
          cycle
        end if
      end if
      last = creep
    end do
  end subroutine settle

  !> What a cycle misses of closing: by how much sliders miss where they began, relative to the motion's scale.
  pure real(wp) function defect_of(solver, before, after) result(defect)
    !> Solver of points: its scale
    type(solver_type), intent(in) :: solver
    !> Sliders where the cycle begins and ends [width, contacts]
    real(wp), intent(in) :: before(:, :), after(:, :)

    defect = maxval(norm2(after - before, 1))/solver%context%motion_scale
  end function defect_of

  !> The defect of a cycle that is taken to close.
  pure real(wp) function accepted(solver)
    !> Solver of points: its tolerance
    type(solver_type), intent(in) :: solver

    accepted = max(closed, closed_tolerances*solver%context%tolerance)
  end function accepted

  !> One cycle, each of whose steps is the balance's.
  subroutine record_cycle(self, solver, load, steps, history)
    type(quasi_static_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Amplitude A
    real(wp), intent(in) :: load
    !> Of a cycle
    integer, intent(in) :: steps
    !> The cycle
    type(history_type), intent(out) :: history
    real(wp), allocatable :: slider(:, :)
    integer :: i

    associate (balance => solver%context%balance)
      allocate (history%response(size(self%reader), 0:steps), history%motion(balance%rows(), 0:steps), &
                history%deviation(balance%rows(), 0:steps), history%state(size(balance%forces), 0:steps), &
                history%slider(size(balance%slider, 1), size(balance%slider, 2), 0:steps))
    end associate
    slider = self%path%state%slider
    call self%path%visit(solver, load)
    do i = 0, steps
      if (i > 0) call self%path%visit(solver, load*cos(two_pi*i/steps))
      if (.not. self%path%found) return
      call record(solver, i, history)
    end do
    self%defect = min(defect_of(solver, slider, self%path%state%slider), self%loop_defect)
  end subroutine record_cycle

  !> Note the solver's equilibrium.
  subroutine record(solver, step, history)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Of the cycle, from 0
    integer, intent(in) :: step
    !> The cycle
    type(history_type), intent(inout) :: history
    integer :: i

    associate (balance => solver%context%balance)
      history%response(:, step) = real(balance%response(:, 0), wp)
      history%motion(:, step) = solver%motion(1, :)
      history%slider(:, :, step) = balance%slider
      do i = 1, size(balance%forces)
        associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
          history%deviation(first:last, step) = balance%forces(i)%deviation(1, :)
        end associate
        history%state(i, step) = balance%forces(i)%state
      end do
    end associate
  end subroutine record

  !> Q and the loop's area of a cycle.
  pure subroutine measure_loop(self, coordinate)
    type(quasi_static_type), intent(inout) :: self
    !> q at each step [0:steps]
    real(wp), intent(in) :: coordinate(0:)
    integer :: steps, j

    steps = ubound(coordinate, 1)
    self%amplitude = 0.5_wp*(maxval(coordinate) - minval(coordinate))
    ! The load at both ends of a step.
    self%area = sum([(0.5_wp*self%load*(cos(two_pi*(j - 1)/steps) + cos(two_pi*j/steps))*(coordinate(j) - coordinate(j - 1)), &
                      j=1, steps)])
  end subroutine measure_loop

  !> Amplitude and work of a cycle.
  subroutine measure(self, solver, history)
    type(quasi_static_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> The cycle
    type(history_type), intent(in) :: history
    real(wp) :: work(2)
    real(wp), allocatable :: coarse(:)

    call measure_loop(self, matmul(self%reader, history%response))
    self%monitored = half_ranges(solver%context%balance, history)
    self%contact_work = work_of_contacts(solver%context%balance, history, 1)
    coarse = work_of_contacts(solver%context%balance, history, 2)
    work = [sum(self%contact_work), sum(coarse)]
    call solver%context%balance%ranks%sum(work)
    self%work = work(1)
    self%coarse_work = work(2)
  end subroutine measure

  !> Half the range of each monitor over the cycle: harmonics of a loop with corners miss a little of it.
  function half_ranges(balance, history) result(half_range)
    !> Harmonic balance: its monitors
    type(balance_type), intent(in) :: balance
    !> The cycle
    type(history_type), intent(in) :: history
    real(wp) :: half_range(balance%monitors%number())
    real(wp) :: motion(0:ubound(history%response, 2))
    integer :: i, j

    do i = 1, size(half_range)
      motion = [(real(balance%monitors%row_at(i, 0, cmplx(history%response(:, j), kind=wp)), wp), j=0, ubound(motion, 1))]
      half_range(i) = 0.5_wp*(maxval(motion) - minval(motion))
    end do
  end function half_ranges

  !> Work of this rank's contacts, from state to state or from every second one.
  function work_of_contacts(balance, history, stride) result(work)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> The cycle
    type(history_type), intent(in) :: history
    !> 1 or 2
    integer, intent(in) :: stride
    real(wp) :: work(size(balance%law))
    integer :: i, j

    work = 0.0_wp
    do i = 1, size(balance%law)
      associate (law => balance%law(i), first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
        do j = stride, ubound(history%motion, 2), stride
          work(i) = work(i) + slip_work(law, history%motion(first:last, j - stride), history%motion(first:last, j), &
                                        history%slider(:, i, j - stride), history%slider(:, i, j))
        end do
      end associate
    end do
  end function work_of_contacts

  !> The cycle as a motion of the angular frequency that its secant stiffness has: what is reported of a point.
  subroutine make_motion(self, solver, history)
    type(quasi_static_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The cycle
    type(history_type), intent(in) :: history
    integer :: i, h

    associate (balance => solver%context%balance)
      do h = 0, ubound(balance%response, 2)
        balance%response(:, h) = harmonic(history%response, h)
      end do
      do i = 1, size(balance%forces)
        associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents, &
                   forces => balance%forces(i))
          call to_series(history%deviation(first:last, :), forces%deviation)
          call classify(history%state(i, 1:), forces%state, forces%stick, forces%slip, forces%open)
          forces%slider = history%slider(:size(forces%slider), i, 0)
          forces%unique = forces%state > state_shaken_down
        end associate
      end do
    end associate
    solver%omega = sqrt(self%load/self%amplitude)
    solver%all_stick = .false.
    self%structural_ratio = structural_ratio(self, solver, history)
  end subroutine make_motion

  !> Of the structure's own damping, were the motion the loop's secant D times a cosine: D^T C D/(2 omega Q^2).
  real(wp) function structural_ratio(self, solver, history) result(ratio)
    type(quasi_static_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> The cycle
    type(history_type), intent(in) :: history
    complex(wp), allocatable :: secant(:)

    associate (response => history%response, half => ubound(history%response, 2)/2)
      secant = solver%context%balance%receptance%recover(0, cmplx(0.5_wp*(response(:, 0) - response(:, half)), kind=wp))
    end associate
    ratio = sum(damping_form(solver%structure, solver%stuck, reshape(real(secant, wp), [size(secant), 1]), [solver%omega]))
    ratio = ratio/(2.0_wp*solver%omega*self%amplitude**2)
  end function structural_ratio

  !> Coefficients of the rows of a contact over a cycle; there are as many as fit.
  subroutine to_series(values, coefficients)
    !> [rows, 0:steps]
    real(wp), intent(in) :: values(:, 0:)
    !> [coefficients, rows]
    real(wp), intent(inout) :: coefficients(:, :)
    complex(wp) :: one(size(values, 1))
    integer :: h

    coefficients = 0.0_wp
    coefficients(1, :) = real(harmonic(values, 0), wp)
    do h = 1, min((size(coefficients, 1) - 1)/2, (ubound(values, 2) - 1)/2)
      one = harmonic(values, h)
      coefficients(2*h, :) = real(one, wp)
      coefficients(2*h + 1, :) = -aimag(one)
    end do
  end subroutine to_series

  !> X_h = x_c - i x_s of rows over a cycle.
  pure function harmonic(values, h)
    !> [rows, 0:steps], the last being the first again
    real(wp), intent(in) :: values(:, 0:)
    !> From 0
    integer, intent(in) :: h
    complex(wp) :: harmonic(size(values, 1))
    real(wp) :: angle(ubound(values, 2))
    integer :: steps, j

    steps = ubound(values, 2)
    angle = [(two_pi*modulo(h*j, steps)/steps, j=1, steps)]
    harmonic = merge(1.0_wp, 2.0_wp, h == 0)/steps*cmplx(matmul(values(:, 1:), cos(angle)), -matmul(values(:, 1:), sin(angle)), wp)
  end function harmonic

  !> State over the cycle, and its parts, from the states of its steps: of an equilibrium that a slider has moved to, it has slipped.
  pure subroutine classify(states, state, stick, slip, open)
    !> At the end of each step
    integer, intent(in) :: states(:)
    !> One of `state_...`
    integer, intent(out) :: state
    !> Parts of the steps
    real(wp), intent(out) :: stick, slip, open

    stick = count(states == state_stuck)/real(size(states), wp)
    open = count(states == state_open)/real(size(states), wp)
    slip = max(1.0_wp - stick - open, 0.0_wp)
    if (all(states == state_open)) then
      state = state_open
    else if (all(states == state_stuck)) then
      state = state_stuck
    else
      state = state_slipping
    end if
  end subroutine classify
end module attrito_peak_quasi_static
