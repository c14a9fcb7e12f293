!> A path of one load from the static solution, of which each equilibrium begins with the sliders of the one before.
!>
!> $$ K x + B^T \lambda(B x, w) = f_0 + \alpha f $$
!>
!> Most steps are those of the condensed equations (`attrito_peak_condensed_equilibrium`), on every rank alike: a step takes
!> milliseconds where one of the balance takes seconds. What is reported is visited with the balance, which starts there and judges it
!> by its own residual. Where the condensed equations have no answer the balance looks for one with all its strategies.
module attrito_peak_loading_path
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: stuck_springs
  use attrito_peak_condensed_equilibrium, only: condensed_equilibrium_type, equilibrium_type, new_condensed_equilibrium, &
                                             on_the_line
  use attrito_solve_load_steps, only: follow_loads, solve_increment
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: loading_path_type, new_loading_path

  type :: loading_path_type
    !> Where it is
    type(equilibrium_type) :: state
    !> Was there an equilibrium at the last load? Newton's iterations since the start
    logical :: found = .false.
    integer :: iterations = 0
    !> Factors on the static loads of the job; the static solution
    real(wp), allocatable, private :: factors(:)
    type(snapshot_type), private :: rest
    type(equilibrium_type), private :: at_rest
    !> The condensed equations, and whether there are any
    type(condensed_equilibrium_type), private :: condensed
    logical, private :: is_condensed = .false.
    !> f in generalised coordinates [n]
    real(wp), allocatable, private :: load(:)
  contains
    procedure :: start
    procedure :: walk_to
    procedure :: visit
    procedure :: coordinate
  end type loading_path_type

contains

  !> From the static solution, where the solver is; its last static load is f, with the factor 0.
  function new_loading_path(solver, load) result(self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> f in generalised coordinates [n]
    real(wp), intent(in) :: load(:)
    type(loading_path_type) :: self
    complex(wp), allocatable :: answer(:, :), block(:, :)
    real(wp), allocatable :: flexibility(:, :), per_load(:, :)
    integer, allocatable :: rows(:)
    integer :: i, status

    self%load = load
    associate (balance => solver%context%balance, contacts => solver%contacts)
      self%factors = balance%static_factors(:size(balance%static_factors) - 1)
      self%rest = snapshot_of(solver)
      self%at_rest = state_of(solver, 0.0_wp)
      call balance%receptance%set_frequency(solver%omega, status)
      if (status /= 0) return
      rows = [(i, i=1, size(contacts%row_stiffness))]
      allocate (block(size(rows), size(rows)))
      call balance%receptance%block_between(0, rows, rows, block)
      flexibility = real(block, wp)
      answer = reshape(cmplx(load, kind=wp), [size(load), 1])
      call balance%receptance%solve(0, answer)
      per_load = contacts%relative_motion(balance%receptance%displacements(answer), 1, size(rows))
      call new_condensed_equilibrium(contacts%law, stuck_springs(contacts, .true.), flexibility, per_load(1, :), &
                                     sum(load*real(answer(:, 1), wp)), self%at_rest, self%condensed, status)
      self%is_condensed = status == 0
    end associate
  end function new_loading_path

  !> Go back to the static solution.
  subroutine start(self, solver, motion_scale)
    class(loading_path_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Norm of the contacts' motion that residuals are relative to
    real(wp), intent(in) :: motion_scale

    call restore(solver, self%rest)
    call solver%set_loads([self%factors, 0.0_wp], 0.0_wp)
    call solver%set_motion_scale(motion_scale, 0.0_wp)
    self%condensed%tolerance = solver%context%tolerance*solver%context%motion_scale
    self%state = self%at_rest
    self%iterations = 0
    self%found = .true.
  end subroutine start

  !> The equilibrium at another load, by the condensed equations; where these fail, by the balance.
  subroutine walk_to(self, solver, load)
    class(loading_path_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> alpha
    real(wp), intent(in) :: load

    call step_to(self, solver, load)
    if (.not. self%found) call walk_by_balance(self, solver, load)
  end subroutine walk_to

  !> The same with the solver there, too.
  subroutine visit(self, solver, load)
    class(loading_path_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> alpha
    real(wp), intent(in) :: load
    type(equilibrium_type) :: before

    before = self%state
    call step_to(self, solver, load)
    if (self%found) then
      call put_solver(self, solver, self%state%motion, before%slider, load)
      call solve_increment(solver, own_rows(solver, before%motion), own_rows(solver, on_the_line(before, load)), (solver%omega))
      self%iterations = self%iterations + solver%report%iterations
      self%found = solver%report%converged
      if (self%found) return
      self%state = before
    end if
    call walk_by_balance(self, solver, load)
  end subroutine visit

  !> q = f^T x where the path is, but for a constant.
  real(wp) function coordinate(self, solver)
    class(loading_path_type), intent(in) :: self
    !> Solver of points, which is there where there are no condensed equations
    type(solver_type), intent(in) :: solver

    if (self%is_condensed) then
      coordinate = self%condensed%coordinate(self%state)
    else
      coordinate = sum(self%load*real(solver%context%balance%response(:, 0), wp))
    end if
  end function coordinate

  !> A step of the condensed equations, which every rank has to have taken.
  subroutine step_to(self, solver, load)
    class(loading_path_type), intent(inout) :: self
    !> Solver of points: its ranks
    type(solver_type), intent(in) :: solver
    !> alpha
    real(wp), intent(in) :: load
    type(equilibrium_type) :: before

    self%found = .false.
    if (.not. self%is_condensed) return
    before = self%state
    call self%condensed%advance(load, self%state, self%iterations, self%found)
    self%found = solver%context%balance%ranks%largest(merge(0.0_wp, 1.0_wp, self%found)) <= 0.0_wp
    if (.not. self%found) self%state = before
  end subroutine step_to

  !> The equilibrium at another load by the balance and all its strategies, in as many steps as it takes.
  subroutine walk_by_balance(self, solver, load)
    class(loading_path_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> alpha
    real(wp), intent(in) :: load

    call put_solver(self, solver, self%state%motion, self%state%slider, self%state%load)
    call follow_loads(solver, (solver%context%balance%static_factors), [self%factors, load], (solver%omega), 1, self%iterations, &
                      self%found)
    if (self%found) self%state = state_of(solver, load)
  end subroutine walk_by_balance

  !> Give the solver a motion to start from, sliders and a load.
  subroutine put_solver(self, solver, motion, slider, load)
    class(loading_path_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of all rows; of all contacts [width, contacts]; alpha
    real(wp), intent(in) :: motion(:), slider(:, :), load

    associate (balance => solver%context%balance)
      solver%motion(1, :) = own_rows(solver, motion)
      call solver%set_slider(slider(:, balance%first_contact:balance%first_contact + size(balance%law) - 1))
      call solver%set_loads([self%factors, load], 0.0_wp)
    end associate
  end subroutine put_solver

  !> This rank's part of what all rows have [rows].
  pure function own_rows(solver, all) result(own)
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver
    !> Of all rows
    real(wp), intent(in) :: all(:)
    real(wp), allocatable :: own(:)

    associate (balance => solver%context%balance)
      own = all(balance%first_row:balance%first_row + balance%rows() - 1)
    end associate
  end function own_rows

  !> Where the solver is, on every rank.
  type(equilibrium_type) function state_of(solver, load) result(state)
    !> Solver of points: its motion, sliders and balance
    type(solver_type), intent(in) :: solver
    !> alpha
    real(wp), intent(in) :: load
    real(wp) :: motion(1, size(solver%contacts%row_stiffness))

    associate (balance => solver%context%balance)
      allocate (state%slider(size(balance%slider, 1), size(solver%contacts%law)))
      call balance%ranks%gather_columns_everywhere(solver%motion(1:1, :), motion)
      call balance%ranks%gather_columns_everywhere(balance%slider, state%slider)
    end associate
    state%motion = motion(1, :)
    state%load = load
  end function state_of
end module attrito_peak_loading_path
