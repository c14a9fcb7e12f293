!> Tangential force of one contact along a path that is given, as it was measured: displacement and normal force at samples.
!>
!> $$ T = k_t \sum_e p_e (u - w_e), \qquad w_e \leftarrow \min(\max(w_e, u - r_e), u + r_e), \qquad r_e = F_e(N)/(p_e k_t) $$
!>
!> Laws know no rate, so samples need no times. A path that is whole cycles of a steady loop is followed twice: sliders do not depend
!> on their start then, or no more than the path leaves open. Otherwise it begins without tangential force.
!> One tangent: along a straight line two tangents do the same.
module attrito_contact_given_path
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_friction_line, only: slide_along_line
  implicit none
  private
  public :: follow_path

contains

  !> March the law along the path.
  subroutine follow_path(law, displacement, normal, passes, force)
    !> Contact: its law and its tangential spring; its normal spring, gap and preload are not asked
    type(contact_type), intent(in) :: law
    !> Relative displacement [samples]; normal force, open where it is not above zero [samples]
    real(wp), intent(in) :: displacement(:), normal(:)
    !> 2: of a steady loop; 1: from the start, where there is no tangential force
    integer, intent(in) :: passes
    !> Tangential force [samples]
    real(wp), intent(out) :: force(:)
    type(contact_type) :: element
    real(wp), dimension(size(displacement)) :: radius, slope, slider
    integer, dimension(size(displacement)) :: origins, sides, regimes
    real(wp) :: w
    integer :: i, origin, pass, side

    force = 0.0_wp
    do i = 1, law%elements()
      element = law%element(i)
      call element%slip_force(normal, radius, slope)
      radius = radius/element%tangential_stiffness
      w = displacement(1)
      origin = 0
      side = 0
      do pass = 1, passes
        call slide_along_line(displacement, radius, w, origin, side, slider, origins, sides, regimes)
      end do
      force = force + element%tangential_stiffness*(displacement - slider)
    end do
  end subroutine follow_path
end module attrito_contact_given_path
