!> What Newton's method solves for, and right-hand sides and steps of the same shape: motion of the contacts, start sliders, omega.
module attrito_balance_unknowns
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: unknowns_type, new_unknowns

  type :: unknowns_type
    !> Relative displacements of this rank's rows [2 H + 1, rows]
    real(wp), allocatable :: motion(:, :)
    !> Start sliders of its contacts [2, contacts]; only periodic ones (two tangents) are unknown, the rest stay
    real(wp), allocatable :: slider(:, :)
    !> Angular frequency
    real(wp) :: omega = 0.0_wp
  end type unknowns_type

contains

  !> Zeros for so many coefficients, rows and contacts.
  pure function new_unknowns(coefficients, rows, contacts) result(self)
    integer, intent(in) :: coefficients, rows, contacts
    type(unknowns_type) :: self

    allocate (self%motion(coefficients, rows), self%slider(2, contacts), source=0.0_wp)
  end function new_unknowns
end module attrito_balance_unknowns
