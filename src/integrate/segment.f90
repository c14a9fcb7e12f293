!> A piece of the solution as polynomials in time: what integrators make and recorders read.
module attrito_integrate_segment
  use attrito_core_kinds, only: wp
  use attrito_integrate_polynomial, only: bernstein_matrix
  implicit none
  private
  public :: segment_type, new_segment

  type :: segment_type
    !> When it begins: whole periods, units of the clock since; and how long it lasts
    integer :: cycle = 0
    real(wp) :: theta = 0.0_wp, length = 0.0_wp
    !> Highest angular frequency of what moves meanwhile, over the clock's
    real(wp) :: pace = 1.0_wp
    !> Coefficients of powers of the time since: modal displacement [m, 0:n] and acceleration by the loads [m, 0:n]
    real(wp), allocatable :: motion(:, :), load(:, :)
    !> Of displacement and force of each row of B [0:n, rows]
    real(wp), allocatable :: displacement(:, :), force(:, :)
    !> Of the direction of slip along two tangents, as an angle and a unit vector [0:n, contacts], [0:n, 2, contacts], and of the
    !> radius with which it turns, r or zero [0:n, contacts]
    real(wp), allocatable :: angle(:, :), direction(:, :, :), radius(:, :)
    !> What each contact does meanwhile, and to which side it slips, +1 or -1 [contacts]
    integer, allocatable :: regime(:), side(:)
    !> Does the direction begin along u', where the contact lands or all along? [contacts]
    logical, allocatable :: lands(:)
    !> Is the disc so small that it does so all along? [contacts]
    logical, allocatable :: small(:)
    !> From powers to Bernstein coefficients [0:n, 0:n]
    real(wp), allocatable :: bernstein(:, :)
  end type segment_type

contains

  !> Room for polynomials of a degree.
  pure function new_segment(m, rows, contacts, degree) result(self)
    !> Number of coordinates; number of contact rows; number of contacts; degree of the polynomial
    integer, intent(in) :: m, rows, contacts, degree
    type(segment_type) :: self

    allocate (self%motion(m, 0:degree), self%load(m, 0:degree), self%displacement(0:degree, rows), self%force(0:degree, rows), &
              source=0.0_wp)
    allocate (self%angle(0:degree, contacts), self%direction(0:degree, 2, contacts), self%radius(0:degree, contacts), &
              source=0.0_wp)
    allocate (self%regime(contacts), self%side(contacts), source=0)
    allocate (self%lands(contacts), self%small(contacts), source=.false.)
    allocate (self%bernstein(0:degree, 0:degree), source=bernstein_matrix(degree))
  end function new_segment
end module attrito_integrate_segment
