!> The backbone of a mode: periodic motion without excitation, kept up by as much negative damping as it takes.
!>
!> $$ M q'' + (C - \xi M) q' + K q = f_0 - B^T \lambda(B q) $$
!>
!> The mode's coordinate at harmonic 1 is prescribed, real and positive, which picks amplitude and phase; omega and xi are found.
!> At a linear mode the balance itself is singular, so a spring s holds that coordinate x and its load s a is given back,
!>
!> $$ \tilde Z_1 + s \, M \phi \phi^T M / m^2, \quad \text{load } s a \, M \phi / m, \qquad c(X_1) = \phi^T M X_1 / m = a, $$
!>
!> which changes nothing where c = a. For omega and xi held the balance is solved as any other; two linearised solves say how c
!> changes with them, and Newton's method on the complex equation c = a finds both.
!>
!> Where loads would keep the motion up in place of -xi M q' the backbone expects a resonance peak, at omega
!> (`attrito_peak_resonant_level`). Source: Krack 2015, doi:10.1016/j.compstruc.2015.02.037.
!>
!> A mode may also be begun at a given shape phi and frequency, those of the tangent system where contacts are open at rest: the
!> stuck mode that has most of phi then serves as the coordinate that is held, a = x^T M phi / m times the shape's amplitude.
module attrito_peak_backbone
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_linear_damping, only: damping_of_harmonic
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_peak_amplitude, only: amplitude_type, amplitude_of
  use attrito_peak_condition, only: problem_type, direction_type, solve, respond
  use attrito_peak_resonant_level, only: kinetic_sum, resonant_level, structural_ratio
  implicit none
  private
  public :: backbone_type, begin_backbone, prepare_mode, begin_mode, leading_mode

  !> Newton's steps on omega and xi; the largest relative change of the frequency in one
  integer, parameter :: most_iterations = 12 ! conventional
  real(wp), parameter :: longest_change = 0.1_wp ! guess
  !> Amplitudes to begin at, from one to the next; logarithms of the longest step and the least
  real(wp), parameter :: amplitude_ratio = 0.25_wp, longest_step = 0.4_wp, shortest_step = 1.0e-4_wp ! guess
  integer, parameter :: most_amplitudes = 7 ! conventional
  !> How far beyond the last two points their line is followed, parts of their distance
  real(wp), parameter :: farthest_line = 3.0_wp ! guess

  !> Where the solver stands on a backbone
  type, extends(snapshot_type) :: base_point_type
    real(wp) :: amplitude = 0.0_wp, excitation = 0.0_wp
  end type base_point_type

  type :: backbone_type
    !> Of the stuck system, from 1, ascending
    integer :: mode = 1
    !> Whose amplitude is reported
    type(problem_type) :: problem
    !> Coordinate a of the mode, and xi
    real(wp) :: amplitude = 0.0_wp, excitation = 0.0_wp
    !> Of the loads that would keep the motion up; of the monitor
    real(wp) :: level = 0.0_wp, height = 0.0_wp
    !> sum_h h^2 X_h^H M X_h; damping ratio of the structure alone, its work a period by 2 pi omega^2 times that
    real(wp) :: kinetic = 0.0_wp, structural_ratio = 0.0_wp
    !> Was the last point found? Newton's iterations that it took
    logical :: found = .false.
    integer :: iterations = 0
    !> M phi/m in generalised coordinates of harmonic 1 [n], and F_1
    complex(wp), allocatable, private :: reader(:), force(:)
    !> Shape to begin at, in the model's coordinates, its coordinate being 1 [m]; not allocated: the stuck mode
    complex(wp), allocatable, private :: shape(:)
    !> Amplitude of the mode that is held, by that of the shape
    real(wp), private :: part = 1.0_wp
    !> At rest; the last two points
    type(base_point_type), private :: rest, last, before
  contains
    procedure :: begin_at
    procedure :: go_to
    procedure :: is_prepared
    procedure :: keep
    procedure :: coordinate
    procedure :: find_changes
  end type backbone_type

contains

  !> Mode of the stuck system that carries most of the first harmonic where the solver stands, and its coordinate there.
  subroutine leading_mode(solver, mode, amplitude)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Number of the mode
    integer, intent(out) :: mode
    !> Modulus of the mode's coordinate
    real(wp), intent(out) :: amplitude
    complex(wp), allocatable :: coordinates(:)
    real(wp), allocatable :: stiffness(:), mass(:), damping(:)

    associate (stuck => solver%stuck, balance => solver%context%balance)
      coordinates = stuck%coordinates_at(solver%structure, 1, balance%receptance%recover(1, balance%response(:, 1)))
      call stuck%modal_at(1, stiffness, mass, damping)
      mode = maxloc(stiffness*abs(coordinates)**2, 1)
      amplitude = abs(coordinates(mode))
    end associate
  end subroutine leading_mode

  !> Turn the solver, at its static solution, to a mode's backbone, and find the point of an amplitude: from where contacts still
  !> stick, or a small one. The solver serves nothing else from then on.
  subroutine begin_backbone(solver, mode, problem, amplitude, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Number of the mode
    integer, intent(in) :: mode
    !> Its monitor and measure; the border is made here
    type(problem_type), intent(in) :: problem
    !> Modulus of the mode's coordinate
    real(wp), intent(in) :: amplitude
    type(backbone_type), intent(out) :: self
    real(wp), allocatable :: stiffness(:), mass(:), damping(:), omega(:)

    self%mode = mode
    self%problem = problem
    allocate (self%problem%border%motion(size(solver%motion, 1), size(solver%motion, 2)), source=0.0_wp)
    call hold_mode(self, solver)
    call solver%stuck%modal_at(1, stiffness, mass, damping)
    self%rest = base_point_type(snapshot_type=snapshot_of(solver), amplitude=amplitude, excitation=damping(mode)/mass(mode))
    omega = solver%stuck%omega_at(1)
    self%rest%omega = omega(mode)
    self%rest%all_stick = .true.
    call self%begin_at(solver, amplitude)
  end subroutine begin_backbone

  !> The same from a shape and an angular frequency, about which the structure's small motion is; contacts need not stick.
  subroutine begin_mode(solver, shape, omega, problem, amplitude, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> In the model's coordinates, with unit modal mass [m]; of a sector at the nodal diameter of harmonic 1
    complex(wp), intent(in) :: shape(:)
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Its monitor, 0: none, and measure; the border is made here
    type(problem_type), intent(in) :: problem
    !> Of the shape
    real(wp), intent(in) :: amplitude
    type(backbone_type), intent(out) :: self

    call prepare_mode(solver, shape, omega, problem, self)
    call self%begin_at(solver, self%part*amplitude)
  end subroutine begin_mode

  !> Ready for a mode's first point, or to go on from points that were saved.
  subroutine prepare_mode(solver, shape, omega, problem, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> In the model's coordinates, with unit modal mass [m]; of a sector at the nodal diameter of harmonic 1
    complex(wp), intent(in) :: shape(:)
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Its monitor, 0: none, and measure; the border is made here
    type(problem_type), intent(in) :: problem
    type(backbone_type), intent(out) :: self
    complex(wp), allocatable :: parts(:)
    real(wp), allocatable :: stiffness(:), mass(:), damping(:)

    parts = solver%stuck%coordinates_at(solver%structure, 1, shape)
    call solver%stuck%modal_at(1, stiffness, mass, damping)
    self%mode = maxloc(abs(parts)**2*mass, 1)
    self%shape = shape/parts(self%mode)
    self%part = abs(parts(self%mode))
    self%problem = problem
    allocate (self%problem%border%motion(size(solver%motion, 1), size(solver%motion, 2)), source=0.0_wp)
    call hold_mode(self, solver)
    self%rest = base_point_type(snapshot_type=snapshot_of(solver))
    self%rest%omega = omega
    self%rest%excitation = damping_of_harmonic(solver%structure, solver%stuck, 1, shape, omega)
  end subroutine prepare_mode

  !> Does the solver serve this backbone?
  pure logical function is_prepared(self)
    class(backbone_type), intent(in) :: self

    is_prepared = allocated(self%reader)
  end function is_prepared

  !> What the next point starts from, beside the solver's own state.
  subroutine keep(self, store)
    class(backbone_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%amplitude)
    call store%keep(self%excitation)
    call keep_base_point(self%last, store)
    call keep_base_point(self%before, store)
  end subroutine keep

  subroutine keep_base_point(base_point, store)
    !> Point of the backbone
    type(base_point_type), intent(inout) :: base_point
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call base_point%keep(store)
    call store%keep(base_point%amplitude)
    call store%keep(base_point%excitation)
  end subroutine keep_base_point

  !> The point of an amplitude by long steps from one at which contacts still stick, the structure at rest before: what short steps do
  !> not pass, these may.
  subroutine begin_at(self, solver, amplitude)
    class(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Modulus of the mode's coordinate
    real(wp), intent(in) :: amplitude
    integer :: i

    if (allocated(self%before%motion)) deallocate (self%before%motion)
    self%rest%amplitude = amplitude
    do i = 1, most_amplitudes
      call start_from(self, solver, linear(self, solver))
      call correct(self, solver, self%rest)
      if (self%found .and. (solver%all_stick .or. allocated(self%shape))) exit
      if (i < most_amplitudes) self%rest%amplitude = amplitude_ratio*self%rest%amplitude
    end do
    if (.not. self%found) return
    self%last = base_point_of(self, solver)
    call self%go_to(solver, amplitude)
  end subroutine begin_at

  !> The spring on the mode, and its load in place of all harmonic ones.
  subroutine hold_mode(self, solver)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    complex(wp), allocatable :: inertia(:)
    real(wp), allocatable :: stiffness(:), mass(:), damping(:)

    call solver%stuck%modal_at(1, stiffness, mass, damping)
    associate (balance => solver%context%balance, stuck => solver%stuck, mode => self%mode)
      inertia = matmul(solver%structure%mass, stuck%shape_at(solver%structure, 1, mode))
      self%reader = balance%receptance%project_load(1, inertia)/mass(mode)
      self%force = balance%harmonic_load(:, 1)
      balance%harmonic_load = 0.0_wp
      balance%loaded = [1]
      balance%harmonic_load(:, 1) = stiffness(mode)*self%reader
      call balance%receptance%lift_mode(mode, stiffness(mode))
    end associate
  end subroutine hold_mode

  !> The linear mode about where the structure is at rest, at the amplitude given there.
  function linear(self, solver) result(base)
    type(backbone_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(base_point_type) :: base
    complex(wp), allocatable :: shape(:)
    real(wp), allocatable :: coordinates(:, :), motion(:, :)

    base = self%rest
    if (allocated(self%shape)) then
      shape = self%shape
    else
      shape = solver%stuck%shape_at(solver%structure, 1, self%mode)
    end if
    allocate (coordinates(3, size(shape)), source=0.0_wp)
    coordinates(2, :) = real(shape, wp)
    coordinates(3, :) = -aimag(shape)
    motion = solver%relative_motion(coordinates)
    base%motion(2:, :) = 0.0_wp
    base%motion(2:3, :) = base%amplitude*motion(2:, :)
  end function linear

  !> Follow to an amplitude, in as many steps as it takes; the solver stays at the last point found.
  subroutine go_to(self, solver, amplitude)
    class(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Modulus of the mode's coordinate
    real(wp), intent(in) :: amplitude
    type(base_point_type) :: from
    real(wp) :: step, left
    integer :: iterations

    iterations = 0
    step = longest_step
    do
      from = self%last
      left = log(amplitude/from%amplitude)
      self%found = abs(left) <= 0.0_wp
      if (self%found) exit
      call start_from(self, solver, predicted(self, merge(amplitude, from%amplitude*exp(sign(step, left)), abs(left) <= step)))
      call correct(self, solver, from)
      iterations = iterations + self%iterations
      if (self%found) then
        self%before = from
        self%last = base_point_of(self, solver)
        step = min(2.0_wp*step, longest_step)
      else
        call start_from(self, solver, from)
        step = 0.5_wp*min(step, abs(left))
        if (step < shortest_step) exit
      end if
    end do
    self%iterations = iterations
    if (self%found) call measure(self, solver)
  end subroutine go_to

  !> On the line through the last two points, harmonics taken by amplitude; along the last one where that line would be long.
  function predicted(self, amplitude) result(base)
    type(backbone_type), intent(in) :: self
    !> Modulus of the mode's coordinate
    real(wp), intent(in) :: amplitude
    type(base_point_type) :: base
    real(wp) :: part

    base = self%last
    base%amplitude = amplitude
    base%motion(2:, :) = amplitude/self%last%amplitude*self%last%motion(2:, :)
    if (.not. allocated(self%before%motion)) return
    associate (a => self%last%amplitude, b => self%before%amplitude)
      part = log(amplitude/a)
      if (abs(part) > farthest_line*abs(log(a/b))) return
      part = part/log(a/b)
      base%motion = base%motion + part*(self%last%motion - self%before%motion)
      base%motion(2:, :) = (1.0_wp + part)*amplitude/a*self%last%motion(2:, :) - part*amplitude/b*self%before%motion(2:, :)
      base%omega = base%omega + part*(self%last%omega - self%before%omega)
      base%excitation = base%excitation + part*(self%last%excitation - self%before%excitation)
    end associate
  end function predicted

  !> Newton's method on omega and xi from where the solver stands; sliders that are not found with the motion go on from a point.
  subroutine correct(self, solver, from)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the backbone from which the next is sought
    type(base_point_type), intent(in) :: from
    complex(wp) :: missing
    integer :: iteration, status

    self%found = .false.
    self%iterations = 0
    do iteration = 1, most_iterations
      call solver%context%balance%receptance%excite(self%excitation)
      call solver%solve_at(solver%omega, early_stop=.true.)
      self%iterations = self%iterations + solver%report%iterations
      if (.not. solver%report%converged) exit
      missing = self%amplitude - self%coordinate(solver%context%balance%response)
      self%found = abs(missing) <= solver%context%tolerance*self%amplitude
      if (self%found) exit
      call step_towards(self, solver, missing, from, status)
      if (status /= 0) exit
    end do
  end subroutine correct

  !> c(X_1).
  pure complex(wp) function coordinate(self, response)
    class(backbone_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)

    coordinate = sum(conjg(self%reader)*response(:, 1))
  end function coordinate

  !> Change omega and xi, and the motion with them, so that c grows by what is missing.
  subroutine step_towards(self, solver, missing, from, status)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is missing of the coordinate
    complex(wp), intent(in) :: missing
    !> Point of the backbone from which the next is sought
    type(base_point_type), intent(in) :: from
    !> 0, or not: singular, or too far
    integer, intent(out) :: status
    type(direction_type) :: by_omega, by_excitation
    real(wp) :: change(2)

    call self%find_changes(solver, missing, by_omega, by_excitation, change, status)
    if (status /= 0) return
    status = merge(0, 1, abs(change(1)) <= longest_change*solver%omega)
    if (status /= 0) return
    solver%motion = solver%motion + change(1)*by_omega%step%motion + change(2)*by_excitation%step%motion
    solver%omega = solver%omega + change(1)
    self%excitation = self%excitation + change(2)
    associate (balance => solver%context%balance)
      call solver%set_slider(merge(balance%slider + change(1)*by_omega%step%slider + change(2)*by_excitation%step%slider, &
                                   from%slider, spread(balance%periodic, 1, size(balance%slider, 1))), balance%periodic)
    end associate
  end subroutine step_towards

  !> Changes of omega and xi after which c has what is missing of it, to first order.
  subroutine find_changes(self, solver, missing, by_omega, by_excitation, change, status)
    class(backbone_type), intent(in) :: self
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> What is missing of the coordinate
    complex(wp), intent(in) :: missing
    !> What a unit of omega, and one of xi, change of the solution
    type(direction_type), intent(out) :: by_omega, by_excitation
    !> Of omega and xi
    real(wp), intent(out) :: change(2)
    !> 0, or not: singular
    integer, intent(out) :: status
    complex(wp) :: slopes(2)
    real(wp) :: determinant

    change = 0.0_wp
    call find_directions(self, solver, by_omega, by_excitation, status)
    if (status /= 0) return
    slopes = [self%coordinate(by_omega%response), self%coordinate(by_excitation%response)]
    determinant = aimag(conjg(slopes(1))*slopes(2))
    status = merge(0, 1, abs(determinant) > 0.0_wp)
    if (status /= 0) return
    change = [aimag(conjg(missing)*slopes(2)), aimag(conjg(slopes(1))*missing)]/determinant
  end subroutine find_changes

  !> What a unit of omega, and one of xi, change of the solution, of which the balance holds the Jacobian.
  subroutine find_directions(self, solver, by_omega, by_excitation, status)
    class(backbone_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Change of the unknowns and of the response
    type(direction_type), intent(out) :: by_omega, by_excitation
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(unknowns_type) :: right
    complex(wp), allocatable :: excited(:, :)

    associate (balance => solver%context%balance)
      right = new_unknowns(shape(solver%motion), shape(balance%slider))
      right%omega = 1.0_wp
      call solve(self%problem, solver, right, by_omega%step, status)
      if (status /= 0) return
      call respond(balance, by_omega)
      allocate (excited, mold=balance%response)
      call balance%receptance%respond_excitation(balance%response, excited)
      if (allocated(balance%frozen_mean)) excited(:, lbound(excited, 2)) = 0.0_wp
      right%omega = 0.0_wp
      right%motion = balance%recover(excited)
      call solve(self%problem, solver, right, by_excitation%step, status)
      if (status /= 0) return
      call respond(balance, by_excitation)
      by_excitation%response = by_excitation%response + excited
    end associate
  end subroutine find_directions

  !> Level and the monitor's amplitude where the solver stands.
  subroutine measure(self, solver)
    type(backbone_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(amplitude_type) :: amplitude

    if (self%problem%monitor > 0) then
      associate (balance => solver%context%balance)
        amplitude = amplitude_of(balance%monitors%row_of(self%problem%monitor, balance%response), self%problem%measure)
      end associate
      self%height = amplitude%value
    end if
    self%kinetic = kinetic_sum(solver)
    self%level = resonant_level(solver, self%excitation, self%kinetic, self%force)
    self%structural_ratio = structural_ratio(solver, self%kinetic)
  end subroutine measure

  function base_point_of(self, solver) result(base_point)
    type(backbone_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(base_point_type) :: base_point

    base_point = base_point_type(snapshot_type=snapshot_of(solver), amplitude=self%amplitude, excitation=self%excitation)
  end function base_point_of

  !> Put the solver there, with residuals relative to the linear mode of that amplitude.
  subroutine start_from(self, solver, base)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the backbone from which the next is sought
    type(base_point_type), intent(in) :: base

    self%amplitude = base%amplitude
    self%excitation = base%excitation
    call restore(solver, base%snapshot_type)
    call solver%set_loads(solver%context%balance%static_factors, base%amplitude)
    call solver%context%balance%receptance%excite(base%excitation)
    call solver%set_scales(base%omega, base%omega)
  end subroutine start_from
end module attrito_peak_backbone
