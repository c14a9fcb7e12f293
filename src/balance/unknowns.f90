!> What Newton's method solves for, and right-hand sides and steps of the same shape: motion of the contacts, start sliders, omega.
module attrito_balance_unknowns
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: unknowns_type, new_unknowns

  type :: unknowns_type
    !> Relative displacements of this rank's rows [2 H + 1, rows]
    real(wp), allocatable :: motion(:, :)
    !> Start sliders of its contacts [width, contacts]; only periodic ones (two tangents) are unknown, the rest stay
    real(wp), allocatable :: slider(:, :)
    !> Angular frequency
    real(wp) :: omega = 0.0_wp
  end type unknowns_type

contains

  !> Zeros.
  pure function new_unknowns(motion_shape, slider_shape) result(self)
    !> Of the motion and of the sliders
    integer, intent(in) :: motion_shape(2), slider_shape(2)
    type(unknowns_type) :: self

    allocate (self%motion(motion_shape(1), motion_shape(2)), self%slider(slider_shape(1), slider_shape(2)), source=0.0_wp)
  end function new_unknowns
end module attrito_balance_unknowns
