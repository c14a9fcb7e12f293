!> Derivatives of one contact's forces by the numbers of its law, where that has elements in parallel,
!>
!> $$ \lambda_t = \sum_e \lambda_e(d; s_e k_t, f_e \mu), \qquad
!>    s_e k_t \frac{\partial \lambda_e}{\partial (s_e k_t)} = J_e (u - w_e), \qquad
!>    f_e \mu \frac{\partial \lambda_e}{\partial (f_e \mu)} = \lambda_e - J_e (u - w_e) $$
!>
!> (attrito_sensitivity_law_derivatives), so those by k_t and mu are sums over elements, and those by a number p that the law is made
!> of are sums weighted by s_e'/s_e and f_e'/f_e. An element that rests holds its slider, at whose limit other numbers would make it
!> slide: J_e is that of its spring.
module attrito_sensitivity_element_derivatives
  use attrito_core_kinds, only: wp
  use attrito_contact_law_contact_law, only: contact_law_type, element_type
  use attrito_contact_law_laws, only: new_law
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type, stay_stuck
  use attrito_model_contacts, only: contact_type
  use attrito_sensitivity_parameters, only: recipe_type, law_numbers, by_tangential_stiffness, by_friction
  use attrito_sensitivity_spring_forces, only: forces_by_motion, tangential_forces
  implicit none
  private
  public :: differentiate_elements, differentiate_by_element_sliders, evaluate_one, part_rates

  !> Part of a number that it is changed by for a central difference of s_e and f_e, powers with exponents near 1: errors are near its
  !> square times ln^3 of the least break, of rounding near 1e-16 over it, both some 1e-10
  real(wp), parameter :: step = 1.0e-6_wp ! derived

contains

  !> By k_t, mu and each of the numbers of its recipe.
  subroutine differentiate_elements(law, recipe, quadrature, motion, slider, forces, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' derivatives [k, tangents + 1, columns]; others are left as they are
    real(wp), intent(inout) :: change(:, :, :)
    type(contact_forces_type) :: own
    type(element_type), allocatable :: rates(:, :)
    real(wp) :: by_stiffness(size(motion, 1), law%tangents), by_slip(size(motion, 1), law%tangents)
    real(wp) :: shift(size(motion, 1), size(motion, 2)), whole(size(motion, 1), size(motion, 2))
    integer :: e, i

    allocate (rates(law%elements(), size(recipe%numbers)))
    do i = 1, size(recipe%numbers)
      rates(:, i) = part_rates(law, recipe, i)
    end do
    do e = 1, law%elements()
      call evaluate_one(law, e, quadrature, motion, slider, forces, own)
      shift = motion
      shift(:, law%tangents + 1) = 0.0_wp
      do i = 1, law%tangents
        shift(1, i) = shift(1, i) - own%slider(i)
      end do
      associate (element => law%element(e), n => law%tangents)
        whole = forces_by_motion(element, own, shift)
        by_stiffness = whole(:, :n)
        by_slip = tangential_forces(element, motion, own%deviation) - by_stiffness
        change(:, :n, by_tangential_stiffness) = change(:, :n, by_tangential_stiffness) + by_stiffness/law%tangential_stiffness
        if (law%friction_coefficient > 0.0_wp) then
          change(:, :n, by_friction) = change(:, :n, by_friction) + by_slip/law%friction_coefficient
        end if
        do i = 1, size(recipe%numbers)
          change(:, :n, law_numbers + i) = change(:, :n, law_numbers + i) + rates(e, i)%stiffness*by_stiffness &
                                           + rates(e, i)%slip_force*by_slip
        end do
      end associate
    end do
  end subroutine differentiate_elements

  !> By the sliders at the start of the period, of elements that stay there: -J_e e_t.
  subroutine differentiate_by_element_sliders(law, quadrature, motion, slider, forces, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' derivatives [k, tangents + 1, width]; others are left as they are
    real(wp), intent(inout) :: change(:, :, :)
    type(contact_forces_type) :: own
    real(wp) :: shift(size(motion, 1), size(motion, 2))
    integer :: e, i

    do e = 1, law%elements()
      call evaluate_one(law, e, quadrature, motion, slider, forces, own)
      if (own%unique) cycle
      do i = 1, law%tangents
        shift = 0.0_wp
        shift(1, i) = -1.0_wp
        change(:, :, 2*e - 2 + i) = forces_by_motion(law%element(e), own, shift)
      end do
    end do
  end subroutine differentiate_by_element_sliders

  !> One element as the contact's last evaluation had it.
  subroutine evaluate_one(law, number, quadrature, motion, slider, forces, own)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of the element, from 1
    integer, intent(in) :: number
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation of the contact there
    type(contact_forces_type), intent(in) :: forces
    !> Of the element
    type(contact_forces_type), intent(out) :: own

    allocate (own%deviation(size(motion, 1), size(motion, 2)))
    associate (start => slider(2*number - 1:2*number))
      if (allocated(forces%jacobian)) then
        call evaluate_contact(law%element(number), quadrature, motion, start, .false., own)
      else
        call stay_stuck(law%element(number), start, size(motion, 1), own)
      end if
    end associate
  end subroutine evaluate_one

  !> s_e'/s_e and f_e'/f_e by one of the numbers that a law is made of [elements].
  function part_rates(law, recipe, number) result(rates)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> Which of its numbers, from 1
    integer, intent(in) :: number
    type(element_type) :: rates(law%elements())
    class(contact_law_type), pointer :: laws
    real(wp), allocatable :: numbers(:)
    real(wp) :: reach
    integer :: e, side

    rates = element_type(0.0_wp, 0.0_wp)
    reach = step*abs(recipe%numbers(number))
    if (.not. reach > 0.0_wp) reach = step
    do side = -1, 1, 2
      numbers = recipe%numbers
      numbers(number) = numbers(number) + side*reach
      laws => new_law(recipe%kind, numbers)
      do e = 1, law%elements()
        associate (there => laws%element(e), here => law%part(e))
          rates(e)%stiffness = rates(e)%stiffness + side/(2.0_wp*reach)*there%stiffness/here%stiffness
          rates(e)%slip_force = rates(e)%slip_force + side/(2.0_wp*reach)*there%slip_force/here%slip_force
        end associate
      end do
      deallocate (laws)
    end do
  end function part_rates
end module attrito_sensitivity_element_derivatives
