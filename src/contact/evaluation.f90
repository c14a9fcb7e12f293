!> Forces of one contact, by events or by samples: the one place that decides which.
!>
!> By events the quadrature is exact, but slip along two tangents has no closed form, nor have laws that are not proportional to N.
module attrito_contact_evaluation
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_fourier, only: fourier_type
  use attrito_contact_quadrature_event, only: evaluate_contact_by_events
  use attrito_contact_quadrature_sampled, only: evaluate_contact_by_samples
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type
  implicit none
  private
  public :: quadrature_type, evaluate_contact, goes_by_events

  !> What evaluations of all contacts share
  type :: quadrature_type
    !> Events, exact, rather than samples wherever a contact has them
    logical :: by_events = .false.
    !> Transforms between samples and coefficients
    type(fourier_type) :: fourier
    !> Where roots are looked for
    type(trigonometric_grid_type) :: grid
  end type quadrature_type

contains

  !> Does a contact go by events?
  elemental logical function goes_by_events(law, by_events)
    type(contact_type), intent(in) :: law
    !> Are events preferred to samples?
    logical, intent(in) :: by_events

    goes_by_events = by_events .and. law%tangents == 1 .and. law%has_events()
  end function goes_by_events

  !> Forces and Jacobian of one contact.
  subroutine evaluate_contact(law, quadrature, motion, slider, periodic, forces)
    type(contact_type), intent(in) :: law
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start of the first march [2]
    real(wp), intent(in) :: slider(:)
    !> Two tangents: is the slider the unknown start of one march?
    logical, intent(in) :: periodic
    !> Forces; `deviation` is allocated by the caller, for as many coefficients as it wants
    type(contact_forces_type), intent(inout) :: forces

    if (goes_by_events(law, quadrature%by_events)) then
      call evaluate_contact_by_events(law, quadrature%grid, motion, slider(1), forces)
    else
      call evaluate_contact_by_samples(law, quadrature%fourier, motion, slider, periodic, forces)
    end if
  end subroutine evaluate_contact
end module attrito_contact_evaluation
