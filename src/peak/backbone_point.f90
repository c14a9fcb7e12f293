!> A point of the backbone of a mode: periodic motion without excitation, kept up by as much negative damping as it takes.
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
!> Source: Krack 2015, doi:10.1016/j.compstruc.2015.02.037.
module attrito_peak_backbone_point
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_peak_condition, only: problem_type, direction_type, solve, respond
  implicit none
  private
  public :: backbone_type, base_point_type, base_point_of, start_from, correct

  !> Newton's steps on omega and xi; the largest relative change of the frequency in one
  integer, parameter :: most_iterations = 12 ! conventional
  real(wp), parameter :: longest_change = 0.1_wp ! guess

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
    !> Does it repeat but for sliders that creep on (`attrito_peak_slider_creep`)?
    logical :: creeps = .false.
    !> M phi/m in generalised coordinates of harmonic 1 [n], and F_1
    complex(wp), allocatable :: reader(:), force(:)
    !> Shape to begin at, in the model's coordinates, its coordinate being 1 [m]; not allocated: the stuck mode
    complex(wp), allocatable :: shape(:)
    !> Amplitude of the mode that is held, by that of the shape
    real(wp) :: part = 1.0_wp
    !> At rest; the last two points
    type(base_point_type) :: rest, last, before
  contains
    procedure :: is_prepared
    procedure :: keep
    procedure :: coordinate
    procedure :: find_changes
  end type backbone_type

contains

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
    call store%keep(self%creeps)
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
      call solver%solve_at(solver%omega, early_stop=.not. allocated(solver%context%balance%mean_before))
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
end module attrito_peak_backbone_point
