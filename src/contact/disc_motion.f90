!> The motion of a contact with two tangents over a period, as its slider sees it: the centre u and the radius r of the friction disc.
!>
!> $$ u(\theta) = \sum_m \hat u_m e_m(\theta), \qquad r(\theta) = \mu N(\theta) / k_t = \sum_m \hat r_m e_m(\theta),
!>    \qquad |u - w| \le r $$
!>
!> A law whose limit F is no multiple of N bends the radius, r = F(N)/k_t: a quadratic of x = N/k_t between the instants at which N
!> passes from one of its pieces to the next, the kinks of r. In a period that passes, as of a joint that drifts, the means go on
!> from those of the period before at a constant rate,
!>
!> $$ u(\theta) = \sum_m \hat u_m e_m(\theta) + (\hat u_0 - \hat u_0^-) \frac{\theta - \pi}{2 \pi} $$
!>
!> By rough rules (`attrito_contact_disc_rules`) each of u and x is the cubic with their values and slopes between points of the grid
!> (Hermite), which costs the same for any number of harmonics.
module attrito_contact_disc_motion
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_trigonometric, only: periodic_basis_at => basis_at, value_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_rules, only: disc_rules_type, usual_nodes, grid_for
  use attrito_contact_law_contact_law, only: limit_type
  use attrito_contact_trigonometric_roots, only: differentiate
  implicit none
  private
  public :: disc_motion_type, new_disc_motion

  type :: disc_motion_type
    !> Highest harmonic
    integer :: harmonics = 0
    !> Coefficients of u_1, u_2, x and of their first and second derivatives [9, k]; x is r unless the law bends it
    real(wp), allocatable :: series(:, :)
    !> Values of u_1, u_2, x and of their first derivatives on the grid [points, 6], and its step; radii there [points]
    real(wp), allocatable :: sampled(:, :), radii(:)
    real(wp) :: step = 0.0_wp
    !> Is it cubic between the points of the grid?
    logical :: is_cubic = .false.
    !> dx/dv, and dr/dv where the contact lands
    real(wp) :: pressing = 0.0_wp, slope = 0.0_wp
    !> Allocated: r by x, a quadratic from each `from` on; which of them holds, 0: as x says; and where the next begins [kinks]
    type(limit_type), allocatable :: limits(:)
    integer :: piece = 0
    real(wp), allocatable :: kinks(:)
    !> A period that passes: change of u_1, u_2, x by the angle, and that of the function by which their means go on
    real(wp) :: rate(3) = 0.0_wp, passing = 0.0_wp
    !> Largest r on the grid; how far out of its disc a slider lies by rounding, and how far it may lie without slipping
    real(wp) :: largest = 0.0_wp, rounding = 0.0_wp, negligible = 0.0_wp
  contains
    procedure :: sample_slopes
    procedure :: find_kinks
    procedure :: segment
    procedure :: crossings
    procedure :: pressing_at
    procedure, private :: sample, piece_of, bend, root, turning_point
    procedure :: basis_at
    procedure :: slope_at
    procedure :: at
    procedure :: at_nodes
    procedure :: second_at
    procedure :: excess
    procedure :: excess_on_grid
  end type disc_motion_type

  !> Part of the largest r that is no slip: a slider that has come to the last place that holds it lies out of a disc by as much as
  !> residuals leave
  real(wp), parameter :: negligible_part = 1.0e-10_wp ! guess
  !> Friction that a contact has at least, a part of the normal force below the error of panels: its disc shows when it opens
  real(wp), parameter :: least_friction = 1.0e-9_wp ! derived

contains

  !> The discs of a motion, without slopes on the grid yet: most contacts that stick are known without.
  function new_disc_motion(law, rules, motion, mean_before) result(self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    !> Coefficients of relative displacement u_1, u_2, v [k, 3]
    real(wp), intent(in) :: motion(:, :)
    !> Of a period that passes: means of the one before [3]
    real(wp), intent(in), optional :: mean_before(:)
    type(disc_motion_type) :: self
    real(wp) :: columns(size(motion, 1), 9), factor
    integer :: i

    factor = max(law%friction_coefficient, least_friction)
    if (.not. law%is_proportional()) then
      factor = 1.0_wp
      self%limits = limits_of(law)
    end if
    self%harmonics = (size(motion, 1) - 1)/2
    self%pressing = factor*law%normal_stiffness/law%tangential_stiffness
    self%slope = self%pressing
    if (allocated(self%limits)) self%slope = self%pressing*self%limits(count(self%limits%from <= 0.0_wp))%coefficients(1)
    columns(:, 1:2) = motion(:, 1:2)
    columns(:, 3) = factor/law%tangential_stiffness*law%normal_series(motion(:, 3))
    do i = 1, 6
      call differentiate(columns(:, i), columns(:, i + 3))
    end do
    self%series = transpose(columns)
    if (present(mean_before)) then
      self%passing = 1.0_wp/two_pi
      self%rate = self%passing*[1.0_wp, 1.0_wp, self%pressing]*(motion(1, :) - mean_before)
    end if
    associate (grid => rules%grids(grid_for(self%harmonics)))
      allocate (self%sampled(size(grid%theta), 6), self%radii(size(grid%theta)), self%kinks(0))
      self%step = grid%theta(2)
    end associate
    self%is_cubic = allocated(rules%transforms)
    call self%sample(rules, 1)
    self%radii = self%sampled(:, 3)
    if (allocated(self%limits)) then
      do i = 1, size(self%radii)
        self%radii(i) = radius_of(self%limits(self%piece_of(self%radii(i))), self%radii(i))
      end do
    end if
    self%largest = maxval(self%radii)
    self%rounding = 2.0e-12_wp*self%largest + 16.0_wp*epsilon(1.0_wp)*maxval(abs(self%sampled(:, 1:2)))
    self%negligible = self%rounding + negligible_part*self%largest
  end function new_disc_motion

  !> r by x = N/k_t: F/k_t = c_0/k_t + c_1 x + c_2 k_t x^2.
  function limits_of(law) result(limits)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    type(limit_type), allocatable :: limits(:)
    integer :: i

    limits = law%limits()
    do i = 1, size(limits)
      associate (c => limits(i)%coefficients, kt => law%tangential_stiffness)
        limits(i) = limit_type(limits(i)%from/kt, [c(0)/kt, c(1), c(2)*kt])
        if (law%least_coefficient() < least_friction) limits(i)%coefficients(1) = limits(i)%coefficients(1) + least_friction
      end associate
    end do
  end function limits_of

  !> Which piece of the law holds at some x?
  pure integer function piece_of(self, x)
    class(disc_motion_type), intent(in) :: self
    !> N/k_t
    real(wp), intent(in) :: x

    piece_of = self%piece
    if (piece_of == 0) piece_of = count(self%limits%from <= x)
  end function piece_of

  pure real(wp) function radius_of(limit, x) result(r)
    !> Piece of the law
    type(limit_type), intent(in) :: limit
    !> N/k_t
    real(wp), intent(in) :: x

    associate (c => limit%coefficients)
      r = c(0) + x*(c(1) + c(2)*x)
    end associate
  end function radius_of

  !> r and r' from x and x', and dr/dx.
  pure subroutine bend(self, x, rate, by_x)
    class(disc_motion_type), intent(in) :: self
    !> x, then r; x', then r'
    real(wp), intent(inout) :: x, rate
    !> dr/dx
    real(wp), intent(out) :: by_x

    by_x = 1.0_wp
    if (.not. allocated(self%limits)) return
    associate (limit => self%limits(self%piece_of(x)))
      by_x = limit%coefficients(1) + 2.0_wp*limit%coefficients(2)*x
      x = radius_of(limit, x)
      rate = by_x*rate
    end associate
  end subroutine bend

  !> dr/dv at an instant, and its derivative by the angle.
  pure function slope_at(self, theta) result(slope)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period
    real(wp), intent(in) :: theta
    real(wp) :: slope(2)
    real(wp) :: jet(2)

    slope = [self%pressing, 0.0_wp]
    if (.not. allocated(self%limits)) return
    jet = self%pressing_at(theta)
    associate (c => self%limits(self%piece_of(jet(1)))%coefficients)
      slope = self%pressing*[c(1) + 2.0_wp*c(2)*jet(1), 2.0_wp*c(2)*jet(2)]
    end associate
  end function slope_at

  !> The functions 1, cos, sin, ... at an instant; in a period that passes the first has what the means' going on adds.
  pure function basis_at(self, theta) result(basis)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period
    real(wp), intent(in) :: theta
    real(wp) :: basis(2*self%harmonics + 1)

    basis = periodic_basis_at(theta, self%harmonics)
    basis(1) = 1.0_wp + self%passing*(theta - pi)
  end function basis_at

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
    integer :: i, points

    columns = transpose(self%series(first:first + 2, :))
    associate (place => grid_for(self%harmonics))
      if (self%is_cubic) then
        points = rules%transforms(place)%samples
        call rules%transforms(place)%to_samples(columns, self%sampled(:points, first:first + 2))
        self%sampled(points + 1, first:first + 2) = self%sampled(1, first:first + 2)
      else
        self%sampled(:, first:first + 2) = matmul(rules%grids(place)%values(:, :size(columns, 1)), columns)
      end if
      if (.not. self%passing > 0.0_wp) return
      do i = 1, 3
        associate (values => self%sampled(:, first + i - 1), theta => rules%grids(place)%theta)
          values = values + self%rate(i)*merge(theta - pi, 1.0_wp, first == 1)
        end associate
      end do
    end associate
  end subroutine sample

  !> Where the law's pieces change.
  subroutine find_kinks(self, rules)
    class(disc_motion_type), intent(inout) :: self
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    integer :: i

    if (.not. allocated(self%limits)) return
    do i = 2, size(self%limits)
      if (self%limits(i)%from <= 0.0_wp) cycle
      self%kinks = [self%kinks, self%crossings(rules, self%limits(i)%from)]
    end do
  end subroutine find_kinks

  !> The end of the stretch of one piece of the law that begins at an instant, and that piece; a given end if that is nearer.
  subroutine segment(self, from, to, next)
    class(disc_motion_type), intent(inout) :: self
    !> Where it begins; where to end at the latest
    real(wp), intent(in) :: from, to
    !> Its end
    real(wp), intent(out) :: next
    !> A stretch that is rounding
    real(wp), parameter :: nothing = 1.0e-13_wp ! derived
    real(wp) :: kink, jet(2)
    integer :: i

    next = to
    if (.not. allocated(self%limits)) return
    do i = 1, size(self%kinks)
      kink = self%kinks(i)
      if (kink <= from + nothing) kink = kink + two_pi
      if (kink > from + nothing .and. kink < to - nothing) next = min(next, kink)
    end do
    jet = self%pressing_at(0.5_wp*(from + next))
    self%piece = 0
    self%piece = self%piece_of(jet(1))
  end subroutine segment

  !> Every instant at which x passes a level, unordered: between points of the grid where the sign of their difference changes, or
  !> where it turns back toward zero and its extremum lies beyond.
  function crossings(self, rules, level) result(roots)
    class(disc_motion_type), intent(in) :: self
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    !> Of x
    real(wp), intent(in) :: level
    real(wp), allocatable :: roots(:)
    real(wp) :: f(size(self%radii)), turn, there(2)
    integer :: j

    allocate (roots(0))
    associate (theta => rules%grids(grid_for(self%harmonics))%theta, slope => self%sampled(:, 6))
      f = self%sampled(:, 3) - level
      ! A root on a grid point belongs to the step before it: what counts there is the sign after it.
      where (abs(f) <= 0.0_wp) f = sign(tiny(1.0_wp), slope)
      do j = 1, size(f) - 1
        if (f(j)*f(j + 1) < 0.0_wp) then
          roots = [roots, self%root(level, theta(j), theta(j + 1), f(j), f(j + 1))]
        else if (f(j)*slope(j) < 0.0_wp .and. f(j + 1)*slope(j + 1) > 0.0_wp) then
          turn = self%turning_point(theta(j), theta(j + 1), slope(j), slope(j + 1))
          there = self%pressing_at(turn)
          there(1) = there(1) - level
          if (there(1)*f(j) >= 0.0_wp) cycle
          roots = [roots, self%root(level, theta(j), turn, f(j), there(1)), self%root(level, turn, theta(j + 1), there(1), f(j + 1))]
        end if
      end do
    end associate
  end function crossings

  !> Where x passes a level between two instants, by Newton's method kept between them.
  pure real(wp) function root(self, level, left, right, at_left, at_right)
    class(disc_motion_type), intent(in) :: self
    !> Of x; instants, and what x is above it there
    real(wp), intent(in) :: level, left, right, at_left, at_right
    !> Phase that is rounding: two units in the last place of a period
    real(wp), parameter :: resolution = 2.0_wp*epsilon(1.0_wp)*two_pi ! derived
    real(wp) :: low, high, jet(2), next
    integer :: iteration

    low = left
    high = right
    root = left + (right - left)*at_left/(at_left - at_right)
    do iteration = 1, 100
      jet = self%pressing_at(root)
      if ((jet(1) - level)*at_left > 0.0_wp) then
        low = root
      else
        high = root
      end if
      next = root - (jet(1) - level)/sign(max(abs(jet(2)), tiny(next)), jet(2))
      if (.not. (next > low .and. next < high)) next = 0.5_wp*(low + high)
      jet(1) = abs(next - root)
      root = next
      if (jet(1) <= resolution) exit
    end do
  end function root

  !> The extremum of x between two instants with slopes of two signs, by regula falsi that halves the end that stays.
  pure real(wp) function turning_point(self, left, right, at_left, at_right) result(turn)
    class(disc_motion_type), intent(in) :: self
    !> Instants, and slopes there
    real(wp), intent(in) :: left, right, at_left, at_right
    !> Length in which it counts as found: its square is rounding
    real(wp), parameter :: found_in = 1.0e-9_wp ! derived
    real(wp) :: low, high, f_low, f_high, jet(2)
    integer :: iteration, side

    low = left
    high = right
    f_low = at_left
    f_high = at_right
    side = 0
    do iteration = 1, 60
      turn = (f_low*high - f_high*low)/(f_low - f_high)
      if (.not. (turn > low .and. turn < high) .or. iteration > 25) turn = 0.5_wp*(low + high)
      jet = self%pressing_at(turn)
      if (min(turn - low, high - turn) < found_in) exit
      if (jet(2)*at_left > 0.0_wp) then
        low = turn
        f_low = jet(2)
        if (side == 1) f_high = 0.5_wp*f_high
        side = 1
      else
        high = turn
        f_high = jet(2)
        if (side == -1) f_low = 0.5_wp*f_low
        side = -1
      end if
    end do
  end function turning_point

  !> x and x' at an instant.
  pure function pressing_at(self, theta) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period
    real(wp), intent(in) :: theta
    real(wp) :: jet(2)
    real(wp) :: here(6), value(3)

    if (self%is_cubic) then
      call at_by_cubics(size(self%sampled, 1), self%sampled, self%step, theta, here)
      jet = here([3, 6])
    else
      value = value_at(self%series(3, :), theta)
      jet = value(:2) + self%rate(3)*[theta - pi, 1.0_wp]
    end if
  end function pressing_at

  !> u_1, u_2, r and their first derivatives at an instant.
  pure function at(self, theta) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    real(wp) :: jet(6)
    real(wp) :: cosine, sine, c, s, before, by_x
    integer :: h

    if (self%is_cubic) then
      call at_by_cubics(size(self%sampled, 1), self%sampled, self%step, theta, jet)
      call self%bend(jet(3), jet(6), by_x)
      return
    end if
    jet = self%series(:6, 1)
    jet(:3) = jet(:3) + self%rate*(theta - pi)
    jet(4:) = jet(4:) + self%rate
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
    call self%bend(jet(3), jet(6), by_x)
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

  !> r, u_1', u_2', r' at instants of a panel, dr/dv, and what they were made of.
  pure subroutine at_nodes(self, theta, basis, jet, slope)
    class(disc_motion_type), intent(in) :: self
    !> Angles of the period [s]
    real(wp), intent(in), contiguous :: theta(:)
    !> 1, cos, sin, ... up to the motion's harmonics; of a motion that is cubic, nothing [s, at least k]
    real(wp), intent(inout), contiguous :: basis(:, :)
    !> [s, 3:6], as `at` numbers them
    real(wp), intent(out), contiguous :: jet(:, 3:)
    !> dr/dv [s]
    real(wp), intent(out) :: slope(:)
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
    if (self%passing > 0.0_wp) then
      basis(:, 1) = 1.0_wp + self%passing*(theta - pi)
      jet(:, 3) = jet(:, 3) + self%rate(3)*(theta - pi)
      do i = 1, 3
        jet(:, 3 + i) = jet(:, 3 + i) + self%rate(i)
      end do
    end if
    slope = self%pressing
    if (.not. allocated(self%limits)) return
    do i = 1, size(theta)
      call self%bend(jet(i, 3), jet(i, 6), slope(i))
    end do
    slope = self%pressing*slope
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
    real(wp) :: second(3), jet(2)

    second = matmul(self%series(7:, :), periodic_basis_at(theta, self%harmonics))
    if (.not. allocated(self%limits)) return
    jet = self%pressing_at(theta)
    associate (c => self%limits(self%piece_of(jet(1)))%coefficients)
      second(3) = (c(1) + 2.0_wp*c(2)*jet(1))*second(3) + 2.0_wp*c(2)*jet(2)**2
    end associate
  end function second_at

  !> |u - w|^2 - r^2, negative where a slider at w sticks, and its derivative.
  pure function excess(self, theta, w) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period; slider
    real(wp), intent(in) :: theta, w(2)
    real(wp) :: jet(2)

    jet = excess_of(self%at(theta), w)
  end function excess

  !> The same at a point of the grid.
  pure function excess_on_grid(self, point, w) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Its number
    integer, intent(in) :: point
    !> Slider
    real(wp), intent(in) :: w(2)
    real(wp) :: jet(2)
    real(wp) :: here(6), by_x

    here = self%sampled(point, :)
    call self%bend(here(3), here(6), by_x)
    jet = excess_of(here, w)
  end function excess_on_grid

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
