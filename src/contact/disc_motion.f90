!> The motion of a contact with two tangents over a period, as its slider sees it: the centre u and the radius r of the friction disc.
!>
!> $$ u(\theta) = \sum_m \hat u_m e_m(\theta), \qquad r(\theta) = \mu N(\theta) / k_t = \sum_m \hat r_m e_m(\theta),
!>    \qquad |u - w| \le r $$
!>
!> With them goes what evaluations of all contacts share: grids on which events are looked for, and rules of the panels of slip.
module attrito_contact_disc_motion
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: basis_at
  use attrito_model_contacts, only: contact_type
  use attrito_contact_panel_rule, only: panel_rule_type, new_radau_rule, new_gauss_rule
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, new_grid, differentiate
  implicit none
  private
  public :: disc_rules_type, new_disc_rules, disc_motion_type, new_disc_motion, excess_of, usual_nodes

  !> What evaluations of all contacts share
  type :: disc_rules_type
    !> Grid of a period, denser than that of one tangent's events: squares of series are looked at
    type(trigonometric_grid_type) :: grid
    !> Panels of slip, and the last one before a contact opens
    type(panel_rule_type) :: radau, gauss
    !> Error of r phi, relative to the largest r, that a panel may have, and the longest panel
    real(wp) :: tolerance = 0.0_wp, longest = 0.0_wp
  end type disc_rules_type

  type :: disc_motion_type
    !> Highest harmonic
    integer :: harmonics = 0
    !> Coefficients of u_1, u_2, r and of their first and second derivatives [9, k]
    real(wp), allocatable :: series(:, :)
    !> Values of u_1, u_2, r and of their first derivatives on the grid [points, 6], and its step
    real(wp), allocatable :: sampled(:, :)
    real(wp) :: step = 0.0_wp
    !> dr/dv = mu k_n / k_t
    real(wp) :: slope = 0.0_wp
    !> Largest r on the grid; how far out of its disc a slider lies by rounding, and how far it may lie without slipping
    real(wp) :: largest = 0.0_wp, rounding = 0.0_wp, negligible = 0.0_wp
  contains
    procedure :: sample_slopes
    procedure :: at
    procedure :: second_at
    procedure :: excess
  end type disc_motion_type

  !> Of a rule's nodes, the error of a panel, the longest panel over the period of the highest harmonic, over 2 pi, and points of the
  !> grid in that period
  integer, parameter :: usual_nodes = 8, density = 12 ! guess
  real(wp), parameter :: usual_tolerance = 1.0e-6_wp, longest_panel = 4.0_wp ! guess
  !> Part of the largest r that is no slip: a slider that has come to the last place that holds it lies out of a disc by as much as
  !> residuals leave
  real(wp), parameter :: negligible_part = 1.0e-10_wp ! guess

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
    self%longest = longest_panel/max(harmonics, 1)
    self%grid = new_grid(harmonics, density)
    self%radau = new_radau_rule(s)
    self%gauss = new_gauss_rule(s)
  end function new_disc_rules

  !> The discs of a motion, without slopes on the grid yet: most contacts that stick are known without.
  function new_disc_motion(law, grid, motion) result(self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grid of a period, both ends included
    type(trigonometric_grid_type), intent(in) :: grid
    !> Coefficients of relative displacement u_1, u_2, v [k, 3]
    real(wp), intent(in) :: motion(:, :)
    type(disc_motion_type) :: self
    real(wp) :: columns(size(motion, 1), 9)
    integer :: i

    self%harmonics = (size(motion, 1) - 1)/2
    self%slope = law%friction_coefficient*law%normal_stiffness/law%tangential_stiffness
    columns(:, 1:2) = motion(:, 1:2)
    columns(:, 3) = law%friction_coefficient/law%tangential_stiffness*law%normal_series(motion(:, 3))
    do i = 1, 6
      call differentiate(columns(:, i), columns(:, i + 3))
    end do
    self%series = transpose(columns)
    allocate (self%sampled(size(grid%theta), 6))
    self%sampled(:, :3) = matmul(grid%values, columns(:, :3))
    self%step = grid%theta(2) - grid%theta(1)
    self%largest = maxval(self%sampled(:, 3))
    self%rounding = 2.0e-12_wp*self%largest + 16.0_wp*epsilon(1.0_wp)*maxval(abs(self%sampled(:, 1:2)))
    self%negligible = self%rounding + negligible_part*self%largest
  end function new_disc_motion

  !> First derivatives on the grid.
  subroutine sample_slopes(self, grid)
    class(disc_motion_type), intent(inout) :: self
    !> Grid of a period, both ends included
    type(trigonometric_grid_type), intent(in) :: grid

    self%sampled(:, 4:) = matmul(grid%values, transpose(self%series(4:6, :)))
  end subroutine sample_slopes

  !> u_1, u_2, r and their first derivatives at an instant.
  pure subroutine at(self, theta, basis, jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> 1, cos, sin, ...: as many as the series has, or more [at least k]
    real(wp), intent(out), contiguous :: basis(:)
    !> Values and derivatives
    real(wp), intent(out) :: jet(6)
    integer :: i

    basis = basis_at(theta, (size(basis) - 1)/2)
    jet = 0.0_wp
    do i = 1, size(self%series, 2)
      jet = jet + self%series(:6, i)*basis(i)
    end do
  end subroutine at

  !> Second derivatives of u_1, u_2, r at an instant.
  pure function second_at(self, basis) result(second)
    class(disc_motion_type), intent(in) :: self
    !> As `at` leaves it
    real(wp), intent(in) :: basis(:)
    real(wp) :: second(3)

    second = matmul(self%series(7:, :), basis(:size(self%series, 2)))
  end function second_at

  !> |u - w|^2 - r^2, negative where a slider at w sticks, and its derivative.
  pure function excess(self, theta, w) result(jet)
    class(disc_motion_type), intent(in) :: self
    !> Angle of the period; slider
    real(wp), intent(in) :: theta, w(2)
    real(wp) :: jet(2)
    real(wp) :: basis(2*self%harmonics + 1), here(6)

    call self%at(theta, basis, here)
    jet = excess_of(here, w)
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
