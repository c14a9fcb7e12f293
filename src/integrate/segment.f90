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
    !> What each contact does meanwhile, and to which side it slips, +1 or -1 [contacts]
    integer, allocatable :: regime(:), side(:)
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
    allocate (self%regime(contacts), self%side(contacts), source=0)
    allocate (self%bernstein(0:degree, 0:degree), source=bernstein_matrix(degree))
  end function new_segment
end module attrito_integrate_segment
