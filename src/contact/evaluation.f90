!> Forces of one contact: by events, exact along one tangent, and along two as exact as the panels of slip are. A law of several
!> elements in parallel is evaluated one element after another.
module attrito_contact_evaluation
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_forces, only: contact_forces_type, stay_stuck
  use attrito_contact_parallel_elements, only: begin_sum, add_element, complete_sum
  use attrito_contact_quadrature_disc, only: evaluate_contact_by_disc_events
  use attrito_contact_quadrature_event, only: evaluate_contact_by_events
  use attrito_contact_stuck_bound, only: is_stuck_by_bound
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type
  implicit none
  private
  public :: quadrature_type, evaluate_contact

  !> What evaluations of all contacts share
  type :: quadrature_type
    !> One tangent: where roots are looked for
    type(trigonometric_grid_type) :: grid
    !> Two tangents: the same, and panels of slip
    type(disc_rules_type) :: discs
    !> Order of radii over that of motions: 2 where a law bends them
    integer :: order = 1
  end type quadrature_type

contains

  !> Forces and Jacobian of one contact.
  subroutine evaluate_contact(law, quadrature, motion, slider, periodic, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :)
    !> Sliders at the start of the first march, in pairs, one an element [at least 2 elements]
    real(wp), intent(in) :: slider(:)
    !> Two tangents: is the slider the unknown start of one march?
    logical, intent(in) :: periodic
    !> Forces; `deviation` is allocated by the caller, for as many coefficients as it wants
    type(contact_forces_type), intent(inout) :: forces
    integer :: unused

    if (law%elements() == 1) then
      call evaluate_element(law, quadrature, motion, slider(:2), periodic, forces)
    else if (.not. allocated(forces%mean_before) .and. is_stuck_by_bound(law, motion, slider)) then
      call stay_stuck(law, slider, size(motion, 1), forces)
    else
      call evaluate_elements(law, quadrature, motion, slider, forces)
    end if
    unused = size(slider) - size(forces%slider)
    if (unused <= 0) return
    forces%slider = [forces%slider, spread(0.0_wp, 1, unused)]
    forces%moved = [forces%moved, spread(0.0_wp, 1, unused)]
  end subroutine evaluate_contact

  !> The same of several elements in parallel. Sliders along two tangents are found in the evaluation: they are no unknowns here.
  subroutine evaluate_elements(law, quadrature, motion, slider, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> As above
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    type(contact_forces_type) :: own
    integer :: i

    own%lists_slip = .true.
    own%without_jacobian = forces%without_jacobian
    if (allocated(forces%mean_before)) own%mean_before = forces%mean_before
    allocate (own%deviation, mold=forces%deviation)
    call begin_sum(law, size(motion, 1), forces)
    do i = 1, law%elements()
      call evaluate_element(law%element(i), quadrature, motion, slider(2*i - 1:2*i), .false., own)
      call add_element(law, i, own, forces)
    end do
    call complete_sum(law, forces)
  end subroutine evaluate_elements

  !> Forces and Jacobian of a contact of one element.
  subroutine evaluate_element(law, quadrature, motion, slider, periodic, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> [k, tangents + 1], and [2]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Is the slider to return after one period?
    logical, intent(in) :: periodic
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces

    forces%closed_here = .false.
    if (law%tangents == 1) then
      call evaluate_contact_by_events(law, quadrature%grid, motion, slider(1), forces)
    else
      call evaluate_contact_by_disc_events(law, quadrature%discs, motion, slider, periodic, forces)
    end if
  end subroutine evaluate_element
end module attrito_contact_evaluation
