!> The motion of a contact with two tangents over a period, as its slider sees it: the centre u and the radius r of the friction disc.
!>
!> $$ u(\theta) = \sum_m \hat u_m e_m(\theta), \qquad r(\theta) = \mu N(\theta) / k_t = \sum_m \hat r_m e_m(\theta),
!>    \qquad |u - w| \le r $$
!>
!> With them goes what evaluations of all contacts share: grids on which events are looked for, and rules of the panels of slip.
!>
!> Rough rules, those of estimates, leave the series: between points of the grid, where it comes by FFTW, each of u and r is the
!> cubic with their values and slopes (Hermite), which costs the same for any number of harmonics.
module attrito_contact_disc_motion
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: basis_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_panel_rule, only: panel_rule_type, new_radau_rule, new_gauss_rule
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, new_grid, differentiate, roots_from_samples, roots_of_cubics
  implicit none
  private
  public :: disc_rules_type, new_disc_rules, new_rough_rules, disc_motion_type, new_disc_motion, excess_of, usual_nodes, grid_for

  !> What evaluations of all contacts share
  type :: disc_rules_type
    !> Grids of a period for motions of 3, 5, 7, 11, ... harmonics, denser than those of one tangent's events: squares are looked at
    type(trigonometric_grid_type), allocatable :: grids(:)
    !> Rough rules: to the points of these grids, of which there are no values then
    type(fourier_type), allocatable :: transforms(:)
    !> Panels of slip, and the last one before a contact opens
    type(panel_rule_type) :: radau, gauss
    !> Error of r phi, relative to the largest r, that a panel may have, and the longest panel
    real(wp) :: tolerance = 0.0_wp, longest = 0.0_wp
    !> Part of the largest motion that harmonics may come to that are left out
    real(wp) :: faint = 0.0_wp
  contains
    procedure :: significant
    procedure :: destroy
  end type disc_rules_type

  type :: disc_motion_type
    !> Highest harmonic
    integer :: harmonics = 0
    !> Coefficients of u_1, u_2, r and of their first and second derivatives [9, k]
    real(wp), allocatable :: series(:, :)
    !> Values of u_1, u_2, r and of their first derivatives on the grid [points, 6], and its step
    real(wp), allocatable :: sampled(:, :)
    real(wp) :: step = 0.0_wp
    !> Is it cubic between the points of the grid?
    logical :: is_cubic = .false.
    !> dr/dv = mu k_n / k_t
    real(wp) :: slope = 0.0_wp
    !> Largest r on the grid; how far out of its disc a slider lies by rounding, and how far it may lie without slipping
    real(wp) :: largest = 0.0_wp, rounding = 0.0_wp, negligible = 0.0_wp
  contains
    procedure :: sample_slopes
    procedure :: roots_of_radius
    procedure, private :: sample
    procedure :: at
    procedure :: at_nodes
    procedure :: second_at
    procedure :: excess
  end type disc_motion_type

  !> Of a rule's nodes, and points of the grid in a period of the highest harmonic, of usual rules and of rough ones
  integer, parameter :: usual_nodes = 8, density = 12, rough_density = 16 ! guess
  !> Error of a panel, and the longest panel over the period of the highest harmonic, over 2 pi. In 95 % of 1500 random motions usual
  !> ones leave errors in forces of at most 5e-10, rough ones of 2e-5; in the worst 9e-9 and 7e-5
  real(wp), parameter :: usual_tolerance = 7.0e-7_wp, usual_longest = 4.5_wp ! measured
  real(wp), parameter :: rough_tolerance = 1.0e-4_wp, rough_longest = 12.0_wp, rough_faint = 1.0e-6_wp ! measured
  !> Part of the largest r that is no slip: a slider that has come to the last place that holds it lies out of a disc by as much as
  !> residuals leave
  real(wp), parameter :: negligible_part = 1.0e-10_wp ! guess
  !> Friction that a contact has at least, a part of the normal force below the error of panels: its disc shows when it opens
  real(wp), parameter :: least_friction = 1.0e-9_wp ! derived

contains

  !> For motions of so many harmonics.
  function new_disc_rules(harmonics, nodes, tolerance) result(self)
    !> Highest harmonic
    integer, intent(in) :: harmonics
    !> Of a panel, and the error it may have; the usual ones unless given
    integer, intent(in), optional :: nodes
    real(wp), intent(in), optional :: tolerance
    type(disc_rules_type) :: self
    integer :: s

    s = usual_nodes
    if (present(nodes)) s = nodes
    self%tolerance = usual_tolerance
    if (present(tolerance)) self%tolerance = tolerance
    self%longest = usual_longest/max(harmonics, 1)
    self%grids = new_grids(harmonics)
    self%radau = new_radau_rule(s)
    self%gauss = new_gauss_rule(s)
  end function new_disc_rules

  !> Rules for an estimate of so many harmonics of force, to three digits and more, without Jacobians: long panels, and harmonics of
  !> the motion that do not show are left out.
  function new_rough_rules(harmonics) result(self)
    !> Highest harmonic
    integer, intent(in) :: harmonics
    type(disc_rules_type) :: self
    integer :: i, j

    self = new_disc_rules(0, tolerance=rough_tolerance)
    deallocate (self%grids)
    allocate (self%grids(grid_for(harmonics)), self%transforms(grid_for(harmonics)))
    do i = 1, size(self%grids)
      self%transforms(i) = new_fourier(0, rough_density*length_of(i))
      associate (points => self%transforms(i)%samples)
        self%grids(i)%theta = [(two_pi*j/points, j=0, points)]
      end associate
    end do
    self%longest = rough_longest/max(harmonics, 1)
    self%faint = rough_faint
  end function new_rough_rules

  !> Grids for motions of so many harmonics and of fewer.
  function new_grids(harmonics) result(grids)
    !> Highest harmonic
    integer, intent(in) :: harmonics
    type(trigonometric_grid_type), allocatable :: grids(:)
    integer :: i

    allocate (grids(grid_for(harmonics)))
    do i = 1, size(grids)
      grids(i) = new_grid(length_of(i) - 1, density)
    end do
  end function new_grids

  !> Harmonics of a grid, and one: 4, 6, 8, 12, 16, 24, ...
  elemental integer function length_of(place)
    !> Number of the grid
    integer, intent(in) :: place

    length_of = merge(4, 6, modulo(place, 2) == 1)*2**((place - 1)/2)
  end function length_of

  !> Which of the grids serves so many harmonics?
  elemental integer function grid_for(harmonics) result(place)
    !> Highest harmonic of a motion
    integer, intent(in) :: harmonics

    place = 1
    do while (length_of(place) <= harmonics)
      place = place + 1
    end do
  end function grid_for

  !> Give the transforms back.
  subroutine destroy(self)
    class(disc_rules_type), intent(inout) :: self
    integer :: i

    if (.not. allocated(self%transforms)) return
    do i = 1, size(self%transforms)
      call self%transforms(i)%destroy()
    end do
    deallocate (self%transforms)
  end subroutine destroy

  !> How many coefficients of a motion show: all but those of the last harmonics that come to next to nothing together.
  pure integer function significant(self, motion) result(coefficients)
    class(disc_rules_type), intent(in) :: self
    !> Coefficients of relative displacement [k, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: left_out, limit

    coefficients = size(motion, 1)
    limit = self%faint*sum(abs(motion(2:, :)))
    left_out = 0.0_wp
    do while (coefficients > 3)
      left_out = left_out + sum(abs(motion(coefficients - 1:coefficients, :)))
      if (.not. left_out < limit) return
      coefficients = coefficients - 2
    end do
  end function significant

  !> The discs of a motion, without slopes on the grid yet: most contacts that stick are known without.
  function new_disc_motion(law, rules, motion) result(self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    !> Coefficients of relative displacement u_1, u_2, v [k, 3]
    real(wp), intent(in) :: motion(:, :)
    type(disc_motion_type) :: self
    real(wp) :: columns(size(motion, 1), 9), friction
    integer :: i

    friction = max(law%friction_coefficient, least_friction)
    self%harmonics = (size(motion, 1) - 1)/2
    self%slope = friction*law%normal_stiffness/law%tangential_stiffness
    columns(:, 1:2) = motion(:, 1:2)
    columns(:, 3) = friction/law%tangential_stiffness*law%normal_series(motion(:, 3))
    do i = 1, 6
      call differentiate(columns(:, i), columns(:, i + 3))
    end do
    self%series = transpose(columns)
    associate (grid => rules%grids(grid_for(self%harmonics)))
      allocate (self%sampled(size(grid%theta), 6))
      self%step = grid%theta(2)
    end associate
    self%is_cubic = allocated(rules%transforms)
    call self%sample(rules, 1)
    self%largest = maxval(self%sampled(:, 3))
    self%rounding = 2.0e-12_wp*self%largest + 16.0_wp*epsilon(1.0_wp)*maxval(abs(self%sampled(:, 1:2)))
    self%negligible = self%rounding + negligible_part*self%largest
  end function new_disc_motion

  !> First derivatives on the grid.
  subroutine sample_slopes(self, rules)
    class(disc_motion_type), intent(inout) :: self
    !> Grids
    type(disc_rules_type), intent(in) :: rules

    call self%sample(rules, 4)
  end subroutine sample_slopes

  !> Three of the series on the grid.
  subroutine sample(self, rules, first)
    class(disc_motion_type), intent(inout) :: self
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    !> Number of the first of them
    integer, intent(in) :: first
    real(wp) :: columns(size(self%series, 2), 3)
    integer :: points

    columns = transpose(self%series(first:first + 2, :))
    associate (place => grid_for(self%harmonics))
      if (self%is_cubic) then
        points = rules%transforms(place)%samples
        call rules%transforms(place)%to_samples(columns, self%sampled(:points, first:first + 2))
        self%sampled(points + 1, first:first + 2) = self%sampled(1, first:first + 2)
      else
        self%sampled(:, first:first + 2) = matmul(rules%grids(place)%values(:, :size(columns, 1)), columns)
      end if
    end associate
  end subroutine sample

  !> Where the contact lands and opens, unordered.
  function roots_of_radius(self, rules) result(roots)
    class(disc_motion_type), intent(in) :: self
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    real(wp), allocatable :: roots(:)

    associate (theta => rules%grids(grid_for(self%harmonics))%theta, r => self%sampled(:, 3), slope => self%sampled(:, 6))
      if (self%is_cubic) then
        roots = roots_of_cubics(theta, r, slope)
      else
        roots = roots_from_samples(self%series(3, :), theta, r, slope)
      end if
    end associate
  end function roots_of_radius

  !> u_1, u_2, r and their first derivatives at an instant.
  pure function at(self, theta) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    real(wp) :: jet(6)
    real(wp) :: cosine, sine, c, s, before
    integer :: h

    if (self%is_cubic) then
      call at_by_cubics(size(self%sampled, 1), self%sampled, self%step, theta, jet)
      return
    end if
    jet = self%series(:6, 1)
    c = cos(theta)
    s = sin(theta)
    cosine = c
    sine = s
    do h = 1, self%harmonics
      jet = jet + (self%series(:6, 2*h)*cosine + self%series(:6, 2*h + 1)*sine)
      before = cosine
      cosine = cosine*c - sine*s
      sine = sine*c + before*s
    end do
  end function at

  !> The same from the grid.
  pure subroutine at_by_cubics(points, sampled, step, theta, jet)
    !> Of the grid, both ends included
    integer, intent(in) :: points
    !> Values and slopes there; their distance; angle of the period
    real(wp), intent(in) :: sampled(points, 6), step, theta
    !> u_1, u_2, r and their first derivatives
    real(wp), intent(out) :: jet(6)
    real(wp) :: x, at_left, at_right, rise, square, cube
    integer :: cell, i

    x = theta/step
    cell = floor(x)
    x = x - cell
    cell = modulo(cell, points - 1) + 1
    do i = 1, 3
      at_left = step*sampled(cell, i + 3)
      at_right = step*sampled(cell + 1, i + 3)
      rise = sampled(cell + 1, i) - sampled(cell, i)
      square = 3.0_wp*rise - 2.0_wp*at_left - at_right
      cube = at_left + at_right - 2.0_wp*rise
      jet(i) = sampled(cell, i) + x*(at_left + x*(square + x*cube))
      jet(i + 3) = (at_left + x*(2.0_wp*square + 3.0_wp*x*cube))/step
    end do
  end subroutine at_by_cubics

  !> r, u_1', u_2', r' at instants of a panel, and what they were made of.
  pure subroutine at_nodes(self, theta, basis, jet)
    class(disc_motion_type), intent(in) :: self
    !> Angles of the period [s]
    real(wp), intent(in), contiguous :: theta(:)
    !> 1, cos, sin, ... up to the motion's harmonics; of a motion that is cubic, nothing [s, at least k]
    real(wp), intent(inout), contiguous :: basis(:, :)
    !> [s, 3:6], as `at` numbers them
    real(wp), intent(out), contiguous :: jet(:, 3:)
    real(wp) :: here(6)
    integer :: i

    if (self%is_cubic) then
      do i = 1, size(theta)
        call at_by_cubics(size(self%sampled, 1), self%sampled, self%step, theta(i), here)
        jet(i, :) = here(3:)
      end do
    else if (size(theta) == usual_nodes) then
      call add_harmonics(usual_nodes, self%harmonics, self%series, theta, basis, jet)
    else
      call add_harmonics(size(theta), self%harmonics, self%series, theta, basis, jet)
    end if
  end subroutine at_nodes

  !> The same on plain arrays, whose size is handed over by value: compilers then make code of its own for the usual one.
  pure subroutine add_harmonics(n, harmonics, series, theta, basis, jet)
    !> s; H
    integer, value :: n, harmonics
    !> As in the motion [9, k]; angles
    real(wp), intent(in) :: series(9, 2*harmonics + 1), theta(n)
    !> 1, cos, sin, ..., and values and derivatives
    real(wp), intent(out) :: basis(n, 2*harmonics + 1), jet(n, 3:6)
    real(wp) :: c(n), s(n)
    integer :: h, i

    basis(:, 1) = 1.0_wp
    do i = 3, 6
      jet(:, i) = series(i, 1)
    end do
    c = cos(theta)
    s = sin(theta)
    do h = 1, harmonics
      if (h == 1) then
        basis(:, 2) = c
        basis(:, 3) = s
      else
        basis(:, 2*h) = basis(:, 2*h - 2)*c - basis(:, 2*h - 1)*s
        basis(:, 2*h + 1) = basis(:, 2*h - 1)*c + basis(:, 2*h - 2)*s
      end if
      do i = 3, 6
        jet(:, i) = jet(:, i) + (series(i, 2*h)*basis(:, 2*h) + series(i, 2*h + 1)*basis(:, 2*h + 1))
      end do
    end do
  end subroutine add_harmonics

  !> Second derivatives of u_1, u_2, r at an instant.
  pure function second_at(self, theta) result(second)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period
    real(wp), intent(in) :: theta
    real(wp) :: second(3)

    second = matmul(self%series(7:, :), basis_at(theta, self%harmonics))
  end function second_at

  !> |u - w|^2 - r^2, negative where a slider at w sticks, and its derivative.
  pure function excess(self, theta, w) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period; slider
    real(wp), intent(in) :: theta, w(2)
    real(wp) :: jet(2)

    jet = excess_of(self%at(theta), w)
  end function excess

  !> The same of values that are known.
  pure function excess_of(here, w) result(jet)
    !> u_1, u_2, r and their derivatives; slider
    real(wp), intent(in) :: here(6), w(2)
    real(wp) :: jet(2)

    associate (z => here(1:2) - w)
      jet(1) = dot_product(z, z) - here(3)**2
      jet(2) = 2.0_wp*(dot_product(z, here(4:5)) - here(3)*here(6))
    end associate
  end function excess_of
end module attrito_contact_disc_motion
