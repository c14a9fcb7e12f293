!> Second derivative of the forces of one contact by events, of one tangent or two: how the Jacobian D changes along a motion t, times
!> motions x.
module attrito_contact_second_derivative
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type
  use attrito_contact_second_derivative_disc, only: start_slider_type, differentiate_twice_by_disc_events
  use attrito_contact_second_derivative_event, only: differentiate_twice_by_events
  implicit none
  private
  public :: differentiate_element_twice

contains

  !> D'[t] x of a contact of one element for several x.
  subroutine differentiate_element_twice(law, quadrature, motion, slider, active, along, columns, product, done)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :)
    !> The slider
    type(start_slider_type), intent(in) :: slider
    !> Rows of the Jacobian that are not zero
    logical, intent(in) :: active(:)
    !> t [k, tangents + 1] and the x [k (tangents + 1), n]
    real(wp), intent(in) :: along(:, :), columns(:, :)
    !> [k (tangents + 1), n]
    real(wp), intent(out) :: product(:, :)
    !> Is it known?
    logical, intent(out) :: done

    if (law%tangents == 2) then
      call differentiate_twice_by_disc_events(law, quadrature%discs, motion, slider, along, columns, product, done)
    else
      call differentiate_twice_by_events(law, quadrature%grid, motion, slider%given(1), active, along, columns, product)
      done = .true.
    end if
  end subroutine differentiate_element_twice
end module attrito_contact_second_derivative
