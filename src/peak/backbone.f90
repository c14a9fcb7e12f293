!> The backbone of a mode, begun and followed in its amplitude; its points are those of `attrito_peak_backbone_point`.
!>
!> Source: Krack 2015, doi:10.1016/j.compstruc.2015.02.037.
!>
!> A mode is begun at a given shape phi and frequency, those of the tangent system: contacts that are open at rest are free there. The
!> stuck mode that has most of phi serves as the coordinate that is held, a = x^T M phi / m times the shape's amplitude. Beside
!> other shapes of that frequency, a stuck mode is held for each, chosen by elimination so that they tell all mixtures apart.
!>
!> Where the curve folds in a no step along it is solved, however short. What leaps then find farther on lies on another part of it,
!> which a flag says.
module attrito_peak_backbone
  use attrito_core_kinds, only: wp
  use attrito_linear_damping, only: damping_of_harmonic
  use attrito_solve_snapshot, only: snapshot_of
  use attrito_solve_solver, only: solver_type
  use attrito_peak_backbone_point, only: backbone_type, base_point_type, base_point_of, start_from, correct
  use attrito_peak_structural_damping, only: kinetic_sum, structural_ratio
  use attrito_peak_slider_creep, only: creep
  implicit none
  private
  public :: prepare_mode, begin_mode, go_to

  !> Amplitudes to begin at, from one to the next; logarithms of the longest step and the least
  real(wp), parameter :: amplitude_ratio = 0.25_wp, longest_step = 0.4_wp, shortest_step = 1.0e-4_wp ! guess
  integer, parameter :: most_amplitudes = 7 ! conventional
  !> Leaps over a fold: logarithm of the first, from one to the next, how many; folds on the way to one amplitude, at most
  real(wp), parameter :: first_leap = 5.0e-3_wp, leap_ratio = 1.25_wp ! guess
  integer, parameter :: most_leaps = 24, most_folds = 3 ! guess
  !> How far beyond the last two points their line is followed, parts of their distance
  real(wp), parameter :: farthest_line = 3.0_wp ! guess

contains

  !> Turn the solver, at its static solution, to a mode's backbone, and find the point of an amplitude, or a smaller one and follow to
  !> it. The mode is given by a shape and an angular frequency, those of small motion; contacts need not stick. The solver serves
  !> nothing else from then on.
  subroutine begin_mode(solver, shapes, omega, amplitude, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The mode and others of its frequency, in the model's coordinates, with unit modal mass [m, shapes]; of a sector at the nodal
    !> diameter of harmonic 1
    complex(wp), intent(in) :: shapes(:, :)
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Of the shape
    real(wp), intent(in) :: amplitude
    type(backbone_type), intent(out) :: self

    call prepare_mode(solver, shapes, omega, self)
    call begin_at(self, solver, self%part*amplitude)
  end subroutine begin_mode

  !> Ready for a mode's first point, or to go on from points that were saved.
  subroutine prepare_mode(solver, shapes, omega, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The mode and others of its frequency, in the model's coordinates, with unit modal mass [m, shapes]; of a sector at the nodal
    !> diameter of harmonic 1
    complex(wp), intent(in) :: shapes(:, :)
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    type(backbone_type), intent(out) :: self
    complex(wp), allocatable :: parts(:, :)
    real(wp), allocatable :: stiffness(:), mass(:), damping(:)
    integer :: i

    call solver%stuck%modal_at(1, stiffness, mass, damping)
    allocate (parts(size(mass), size(shapes, 2)))
    do i = 1, size(shapes, 2)
      parts(:, i) = solver%stuck%coordinates_at(solver%structure, 1, shapes(:, i))
    end do
    self%modes = independent_coordinates(parts, mass)
    associate (held => parts(self%modes(1), 1))
      self%mixture = parts(self%modes, 1)/held
      self%shape = shapes(:, 1)/held
      self%part = abs(held)
    end associate
    allocate (self%problem%border%motion(size(solver%motion, 1), size(solver%motion, 2)), source=0.0_wp)
    call hold_modes(self, solver)
    self%rest = base_point_type(snapshot_type=snapshot_of(solver))
    self%rest%omega = omega
    self%rest%excitation = damping_of_harmonic(solver%structure, solver%stuck, 1, shapes(:, 1), omega)
    self%rest%mixture = self%mixture
  end subroutine prepare_mode

  !> As many stuck modes as there are shapes, whose coordinates tell mixtures of the shapes apart: the first has most of the first
  !> shape, the next most of what elimination leaves of the next.
  pure function independent_coordinates(parts, mass) result(modes)
    !> Coordinates of the shapes [stuck modes, shapes]
    complex(wp), intent(in) :: parts(:, :)
    !> Of stuck modes
    real(wp), intent(in) :: mass(:)
    integer :: modes(size(parts, 2))
    complex(wp) :: left(size(parts, 1), size(parts, 2))
    integer :: i, j

    left = parts
    do i = 1, size(modes)
      modes(i) = maxloc(abs(left(:, i))**2*mass, 1)
      do j = i + 1, size(modes)
        left(:, j) = left(:, j) - left(modes(i), j)/left(modes(i), i)*left(:, i)
      end do
    end do
  end function independent_coordinates

  !> The point of an amplitude from the linear mode, the structure at rest before; where none is found there, from a smaller one.
  subroutine begin_at(self, solver, amplitude)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Modulus of the mode's coordinate
    real(wp), intent(in) :: amplitude
    integer :: i

    if (allocated(self%before%motion)) deallocate (self%before%motion)
    self%creeps = .false.
    self%rest%amplitude = amplitude
    do i = 1, most_amplitudes
      call start_from(self, solver, linear(self, solver))
      call correct(self, solver, self%rest)
      if (self%found) exit
      if (i < most_amplitudes) self%rest%amplitude = amplitude_ratio*self%rest%amplitude
    end do
    if (.not. self%found) return
    self%last = base_point_of(self, solver)
    call go_to(self, solver, amplitude)
  end subroutine begin_at

  !> Springs on the modes, and their load in place of all harmonic ones.
  subroutine hold_modes(self, solver)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    complex(wp), allocatable :: inertia(:)
    real(wp), allocatable :: stiffness(:), mass(:), damping(:)
    integer :: k

    call solver%stuck%modal_at(1, stiffness, mass, damping)
    associate (balance => solver%context%balance, stuck => solver%stuck)
      allocate (self%readers(size(balance%harmonic_load, 1), size(self%modes)))
      do k = 1, size(self%modes)
        inertia = matmul(solver%structure%mass, stuck%shape_at(solver%structure, 1, self%modes(k)))
        self%readers(:, k) = balance%receptance%project_load(1, inertia)/mass(self%modes(k))
      end do
      self%springs = stiffness(self%modes)
      balance%harmonic_load = 0.0_wp
      balance%loaded = [1]
      balance%harmonic_load(:, 1) = matmul(self%readers, self%springs*self%mixture)
      call balance%receptance%lift_modes(self%modes, self%springs)
    end associate
  end subroutine hold_modes

  !> The linear mode about where the structure is at rest, at the amplitude given there.
  function linear(self, solver) result(base)
    type(backbone_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(base_point_type) :: base
    real(wp), allocatable :: coordinates(:, :), motion(:, :)

    base = self%rest
    allocate (coordinates(3, size(self%shape)), source=0.0_wp)
    coordinates(2, :) = real(self%shape, wp)
    coordinates(3, :) = -aimag(self%shape)
    motion = solver%relative_motion(coordinates)
    base%motion(2:, :) = 0.0_wp
    base%motion(2:3, :) = base%amplitude*motion(2:, :)
  end function linear

  !> Follow to an amplitude, in as many steps as it takes, over folds by leaps; the solver stays at the last point found.
  subroutine go_to(self, solver, amplitude)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Modulus of the mode's coordinate
    real(wp), intent(in) :: amplitude
    type(base_point_type) :: start, from, next
    real(wp) :: step, left
    integer :: iterations, folds

    start = self%last
    iterations = 0
    folds = 0
    self%folded = .false.
    step = longest_step
    do
      from = self%last
      left = log(amplitude/from%amplitude)
      self%found = abs(left) <= 0.0_wp
      if (self%found) exit
      next = predicted(self, merge(amplitude, from%amplitude*exp(sign(step, left)), abs(left) <= step))
      call find_point(self, solver, from, next)
      iterations = iterations + self%iterations
      if (self%found) then
        self%before = from
        self%last = base_point_of(self, solver)
        step = min(2.0_wp*step, longest_step)
      else
        call start_from(self, solver, from)
        step = 0.5_wp*min(step, abs(left))
        if (step >= shortest_step) cycle
        if (folds == most_folds) exit
        call leap(self, solver, start, sign(1.0_wp, left), iterations)
        if (.not. self%found) exit
        folds = folds + 1
        step = longest_step
      end if
    end do
    self%iterations = iterations
    if (self%found) call measure(self, solver)
  end subroutine go_to

  !> Over a fold: a point farther on than the last one, which it takes the place of, from that or from where the way began. The line
  !> through the last two says nothing there, and whether Newton's method comes to the other part varies with the distance.
  subroutine leap(self, solver, start, direction, iterations)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Where the way began
    type(base_point_type), intent(in) :: start
    !> 1: to larger amplitudes, -1: to smaller ones
    real(wp), intent(in) :: direction
    !> Counts on
    integer, intent(inout) :: iterations
    type(base_point_type) :: lost, from
    integer :: base, i

    lost = self%last
    if (allocated(self%before%motion)) deallocate (self%before%motion)
    do base = 1, 2
      from = lost
      if (base == 2) from = start
      self%last = from
      do i = 1, most_leaps
        call find_point(self, solver, from, predicted(self, lost%amplitude*exp(direction*first_leap*leap_ratio**(i - 1))))
        iterations = iterations + self%iterations
        if (self%found) then
          self%folded = .true.
          self%last = base_point_of(self, solver)
          return
        end if
      end do
    end do
    self%last = lost
    call start_from(self, solver, lost)
  end subroutine leap

  !> The next point: of motion that repeats, or where none is found from the prediction after periods of creep.
  subroutine find_point(self, solver, from, next)
    type(backbone_type), intent(inout) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the backbone from which the next is sought; where that is expected
    type(base_point_type), intent(in) :: from, next
    integer :: iterations

    iterations = 0
    if (.not. self%creeps) then
      call start_from(self, solver, next)
      call correct(self, solver, from)
      if (self%found) return
      iterations = self%iterations
    end if
    call creep(self, solver, next)
    self%iterations = self%iterations + iterations
  end subroutine find_point

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

  !> Energy, and the part of the damping that is the structure's, where the solver stands.
  subroutine measure(self, solver)
    type(backbone_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    self%kinetic = kinetic_sum(solver)
    self%structural_ratio = structural_ratio(solver, self%kinetic)
  end subroutine measure
end module attrito_peak_backbone
