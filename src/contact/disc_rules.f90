!> What evaluations of contacts with two tangents share: grids on which events are looked for, and rules of the panels of slip.
!>
!> Rough rules, those of estimates, leave the series: motions come to the points of a grid by FFTW, and are cubics between them.
module attrito_contact_disc_rules
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_panel_rule, only: panel_rule_type, new_radau_rule, new_gauss_rule
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, new_grid
  implicit none
  private
  public :: disc_rules_type, new_disc_rules, new_rough_rules, usual_nodes, grid_for

  type :: disc_rules_type
    !> Grids of a period for motions of 3, 5, 7, 11, ... harmonics, denser than those of one tangent's events: squares are looked at
    type(trigonometric_grid_type), allocatable :: grids(:)
    !> Rough rules: to the points of these grids, of which there are no values then
    type(fourier_type), allocatable :: transforms(:)
    !> Panels of slip, and the last one before a contact opens
    type(panel_rule_type) :: radau, gauss
    !> Error of r phi, relative to the largest r, that a panel may have, and the longest panel
    real(wp) :: tolerance = 0.0_wp, longest = 0.0_wp
    !> Are panels of slip to be listed?
    logical :: lists_panels = .false.
    !> Part of the largest motion that harmonics may come to that are left out
    real(wp) :: faint = 0.0_wp
  contains
    procedure :: significant
    procedure :: destroy
  end type disc_rules_type

  !> Of a rule's nodes, and points of the grid in a period of the highest harmonic, of usual rules and of rough ones
  integer, parameter :: usual_nodes = 10, density = 12, rough_density = 16 ! guess
  !> Error of a panel, and the longest panel over the period of the highest harmonic, over 2 pi. In 95 % of 1000 random motions usual
  !> ones leave errors in forces of at most 4e-10, rough ones of 8e-6; in the worst 5e-9 and 5e-5
  real(wp), parameter :: usual_tolerance = 1.0e-6_wp, usual_longest = 6.0_wp ! measured
  real(wp), parameter :: rough_tolerance = 1.0e-4_wp, rough_longest = 12.0_wp, rough_faint = 1.0e-6_wp ! measured
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
end module attrito_contact_disc_rules
