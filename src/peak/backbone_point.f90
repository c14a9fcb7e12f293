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
!>
!> Of tangent modes with the same frequency every mixture is a mode while contacts stick, and Z~_1 stays singular. So springs hold a
!> coordinate c_k of each of these modes, and their loads s_k b_k are given back where c_k = b_k. The b_k are unknowns like omega and
!> xi, of which Newton's method takes the shortest step: while contacts stick any b_k will do, and the mixture stays the one that was
!> asked for; where they slip it is the one that slipping leaves a mode.
!> Source: Krack 2015, doi:10.1016/j.compstruc.2015.02.037.
module attrito_peak_backbone_point
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
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
  !> The largest change of equal modes' coordinates in one, parts of a; squares of singular values, parts of the largest, that are
  !> none: of what changes nothing
  real(wp), parameter :: longest_turn = 0.3_wp, least_square = 1.0e-14_wp ! guess

  !> Where the solver stands on a backbone
  type, extends(snapshot_type) :: base_point_type
    real(wp) :: amplitude = 0.0_wp, excitation = 0.0_wp
    !> Coordinates b_k that are held, by a: the first is 1
    complex(wp), allocatable :: mixture(:)
  end type base_point_type

  type :: backbone_type
    !> Of the stuck system, from 1: those whose coordinates are held, the first being a
    integer, allocatable :: modes(:)
    !> Its border holds the frequency in linearised solves
    type(problem_type) :: problem
    !> Coordinate a of the mode, and xi
    real(wp) :: amplitude = 0.0_wp, excitation = 0.0_wp
    !> sum_h h^2 X_h^H M X_h; damping ratio of the structure alone, its work a period by 2 pi omega^2 times that
    real(wp) :: kinetic = 0.0_wp, structural_ratio = 0.0_wp
    !> Was the last point found? Newton's iterations that it took
    logical :: found = .false.
    integer :: iterations = 0
    !> Does it repeat but for sliders that creep on (`attrito_peak_slider_creep`)? Does the curve fold in a between the last point and
    !> this one?
    logical :: creeps = .false., folded = .false.
    !> M phi/m of each mode that is held in generalised coordinates of harmonic 1 [n, modes]
    complex(wp), allocatable :: readers(:, :)
    !> Springs that hold these modes, and coordinates b_k by a
    real(wp), allocatable :: springs(:)
    complex(wp), allocatable :: mixture(:)
    !> Shape to begin at, in the model's coordinates, its coordinate being 1 [m]
    complex(wp), allocatable :: shape(:)
    !> Amplitude of the mode that is held, by that of the shape
    real(wp) :: part = 1.0_wp
    !> At rest; the last two points
    type(base_point_type) :: rest, last, before
  contains
    procedure :: is_prepared
    procedure :: keep
    procedure :: coordinates
    procedure :: missing_in
    procedure :: find_changes
  end type backbone_type

contains

  !> Does the solver serve this backbone?
  pure logical function is_prepared(self)
    class(backbone_type), intent(in) :: self

    is_prepared = allocated(self%readers)
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
    call store%keep(base_point%mixture)
  end subroutine keep_base_point

  !> Newton's method on omega and xi from where the solver stands; sliders that are not found with the motion go on from a point.
  subroutine correct(self, solver, from)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the backbone from which the next is sought
    type(base_point_type), intent(in) :: from
    complex(wp), allocatable :: missing(:)
    integer :: iteration, status

    self%found = .false.
    self%iterations = 0
    do iteration = 1, most_iterations
      call solver%context%balance%receptance%excite(self%excitation)
      call solver%solve_at(solver%omega, early_stop=.not. allocated(solver%context%balance%mean_before))
      self%iterations = self%iterations + solver%report%iterations
      if (.not. solver%report%converged) exit
      missing = self%missing_in(solver%context%balance%response)
      self%found = all(abs(missing) <= solver%context%tolerance*self%amplitude)
      if (self%found) exit
      call step_towards(self, solver, missing, from, status)
      if (status /= 0) exit
    end do
  end subroutine correct

  !> What coordinates that are held miss of b_k [modes].
  pure function missing_in(self, response) result(missing)
    class(backbone_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp) :: missing(size(self%modes))

    missing = self%amplitude*self%mixture - self%coordinates(response)
  end function missing_in

  !> c_k(X_1) [modes].
  pure function coordinates(self, response)
    class(backbone_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    complex(wp) :: coordinates(size(self%modes))
    integer :: k

    coordinates = [(sum(conjg(self%readers(:, k))*response(:, 1)), k=1, size(self%modes))]
  end function coordinates

  !> Change omega and xi, the mixture of equal modes, and the motion with them, so that c grows by what is missing.
  subroutine step_towards(self, solver, missing, from, status)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> What is missing of the coordinates [modes]
    complex(wp), intent(in) :: missing(:)
    !> Point of the backbone from which the next is sought
    type(base_point_type), intent(in) :: from
    !> 0, or not: singular, or too far
    integer, intent(out) :: status
    type(direction_type) :: ways(2*size(missing))
    real(wp) :: change(2*size(missing))
    real(wp), allocatable :: slider(:, :)
    integer :: i

    call self%find_changes(solver, missing, ways, change, status)
    if (status /= 0) return
    status = merge(0, 1, abs(change(1)) <= longest_change*solver%omega)
    if (status /= 0) return
    associate (balance => solver%context%balance)
      slider = balance%slider
      do i = 1, size(change)
        solver%motion = solver%motion + change(i)*ways(i)%step%motion
        slider = slider + change(i)*ways(i)%step%slider
      end do
      solver%omega = solver%omega + change(1)
      self%excitation = self%excitation + change(2)
      self%mixture(2:) = self%mixture(2:) + cmplx(change(3::2), change(4::2), wp)/self%amplitude
      call solver%set_slider(merge(slider, from%slider, spread(balance%periodic, 1, size(balance%slider, 1))), balance%periodic)
      call load_springs(self, solver)
    end associate
  end subroutine step_towards

  !> Let springs give back what they take where coordinates are b_k; the level of that load is a.
  subroutine load_springs(self, solver)
    type(backbone_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver

    solver%context%balance%harmonic_load(:, 1) = matmul(self%readers, self%springs*self%mixture)
    call solver%context%forget()
  end subroutine load_springs

  !> Changes of omega and xi, and of b_k from the second on, real and imaginary part, after which nothing is missing of the
  !> coordinates, to first order; of several the shortest.
  subroutine find_changes(self, solver, missing, ways, change, status)
    class(backbone_type), intent(in) :: self
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> What is missing of the coordinates [modes]
    complex(wp), intent(in) :: missing(:)
    !> What a unit of each changes of the solution [2 modes]
    type(direction_type), intent(out) :: ways(:)
    !> Of each [2 modes]
    real(wp), intent(out) :: change(:)
    !> 0, or not: singular
    integer, intent(out) :: status
    complex(wp) :: slopes(size(missing), size(change))
    real(wp) :: determinant
    integer :: i, k

    change = 0.0_wp
    call find_directions(self, solver, ways, status)
    if (status /= 0) return
    do i = 1, size(ways)
      slopes(:, i) = self%coordinates(ways(i)%response)
    end do
    if (size(missing) == 1) then
      determinant = aimag(conjg(slopes(1, 1))*slopes(1, 2))
      status = merge(0, 1, abs(determinant) > 0.0_wp)
      if (status /= 0) return
      change = [aimag(conjg(missing(1))*slopes(1, 2)), aimag(conjg(slopes(1, 1))*missing(1))]/determinant
      return
    end if
    do k = 2, size(missing)
      slopes(k, 2*k - 1) = slopes(k, 2*k - 1) - 1.0_wp
      slopes(k, 2*k) = slopes(k, 2*k) - (0.0_wp, 1.0_wp)
    end do
    call shortest_change(self, solver%omega, slopes, missing, change, status)
  end subroutine find_changes

  !> The shortest x that brings A x nearest to b, omega and xi measured by omega and coordinates by a; cut short where it would turn
  !> the mixture far.
  subroutine shortest_change(self, omega, slopes, missing, change, status)
    class(backbone_type), intent(in) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> A [modes, 2 modes]; b [modes]
    complex(wp), intent(in) :: slopes(:, :), missing(:)
    !> x [2 modes]
    real(wp), intent(out) :: change(:)
    !> 0, or not: no eigenvalues were found
    integer, intent(out) :: status
    real(wp) :: scales(size(change)), matrix(size(change), size(change)), right(size(change))
    real(wp) :: unit(size(change), size(change)), turn
    real(wp), allocatable :: squares(:), vectors(:, :)
    integer :: i

    scales = [omega, omega, (self%amplitude, i=3, size(change))]
    associate (n => size(missing))
      do i = 1, size(change)
        matrix(:n, i) = scales(i)/self%amplitude*real(slopes(:, i), wp)
        matrix(n + 1:, i) = scales(i)/self%amplitude*aimag(slopes(:, i))
      end do
      right = [real(missing, wp), aimag(missing)]/self%amplitude
    end associate
    unit = 0.0_wp
    do i = 1, size(change)
      unit(i, i) = 1.0_wp
    end do
    call symmetric_eigenpairs(matmul(transpose(matrix), matrix), unit, squares, vectors, status)
    change = 0.0_wp
    if (status /= 0) return
    right = matmul(right, matrix)
    do i = 1, size(change)
      if (squares(i) <= least_square*maxval(squares)) cycle
      change = change + dot_product(vectors(:, i), right)/squares(i)*vectors(:, i)
    end do
    turn = maxval(abs(change(3:)))
    if (turn > longest_turn) change = longest_turn/turn*change
    change = scales*change
  end subroutine shortest_change

  !> What a unit of omega, one of xi, and one of the others' coordinates b_k, real and imaginary, change of the solution, of which the
  !> balance holds the Jacobian.
  subroutine find_directions(self, solver, ways, status)
    class(backbone_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Changes of the unknowns and of the response [2 modes]
    type(direction_type), intent(out) :: ways(:)
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(unknowns_type) :: right
    complex(wp), allocatable :: driven(:, :), load(:, :)
    integer :: i

    associate (balance => solver%context%balance)
      right = new_unknowns(shape(solver%motion), shape(balance%slider))
      right%omega = 1.0_wp
      call solve(self%problem, solver, right, ways(1)%step, status)
      if (status /= 0) return
      call respond(balance, ways(1))
      right%omega = 0.0_wp
      allocate (driven, load, mold=balance%response)
      do i = 2, size(ways)
        if (i == 2) then
          call balance%receptance%respond_excitation(balance%response, driven)
        else
          load = 0.0_wp
          associate (k => (i + 1)/2)
            load(:, 1) = merge((1.0_wp, 0.0_wp), (0.0_wp, 1.0_wp), i == 2*k - 1)*self%springs(k)*self%readers(:, k)
          end associate
          call balance%receptance%respond(load, driven)
        end if
        if (allocated(balance%frozen_mean)) driven(:, lbound(driven, 2)) = 0.0_wp
        right%motion = balance%recover(driven)
        call solve(self%problem, solver, right, ways(i)%step, status)
        if (status /= 0) return
        call respond(balance, ways(i))
        ways(i)%response = ways(i)%response + driven
      end do
    end associate
  end subroutine find_directions

  function base_point_of(self, solver) result(base_point)
    type(backbone_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(base_point_type) :: base_point

    base_point = base_point_type(snapshot_type=snapshot_of(solver), amplitude=self%amplitude, excitation=self%excitation, &
                                 mixture=self%mixture)
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
    self%mixture = base%mixture
    call load_springs(self, solver)
    call restore(solver, base%snapshot_type)
    call solver%set_loads(solver%context%balance%static_factors, base%amplitude)
    call solver%context%balance%receptance%excite(base%excitation)
    call solver%set_scales(base%omega, base%omega)
  end subroutine start_from
end module attrito_peak_backbone_point
