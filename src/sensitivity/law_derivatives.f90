!> Derivatives of one contact's forces by the numbers of its law, at a given motion, a periodic slider following them:
!>
!> $$ \frac{\partial \lambda}{\partial k_t} = J \frac{u - w}{k_t}, \quad
!>    \frac{\partial \lambda}{\partial k_n} = J \frac{v - \mathrm{gap}}{k_n}, \quad
!>    \frac{\partial \lambda}{\partial N_p} = J \frac{e_0}{k_n}, \quad
!>    \frac{\partial \lambda}{\partial \mathrm{gap}} = -J e_0, \quad
!>    \mu \frac{\partial \lambda_t}{\partial \mu} = \lambda_t - k_t \frac{\partial \lambda_t}{\partial k_t} $$
!>
!> J = K_c + dg/dd is the Jacobian of the last evaluation, e_0 a constant displacement along the normal. Forces depend on k_t only by
!> k_t (u - w), on k_n, gap and N_p only by N_p + k_n (v - gap): their derivatives are those by the motion. Friction is homogeneous of
!> the first degree in k_t and mu, which Euler's theorem turns into the last.
!>
!> w: where a slider rests that never moves; that of one that slips leaves no trace, J being zero along a constant tangential
!> displacement. So is the derivative by it, -J e_t. Of elements in parallel some may rest and others slip: each has its own
!> (attrito_sensitivity_element_derivatives). Those by a table's coefficients are differences.
module attrito_sensitivity_law_derivatives
  use attrito_core_kinds, only: wp
  use attrito_contact_law_laws, only: new_law
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type, released
  use attrito_sensitivity_element_derivatives, only: differentiate_elements, differentiate_by_element_sliders
  use attrito_sensitivity_parameters, only: recipe_type, law_numbers, by_tangential_stiffness, by_normal_stiffness, by_friction, &
                                            by_gap, by_preload
  use attrito_sensitivity_spring_forces, only: forces_by_motion, tangential_forces
  implicit none
  private
  public :: differentiate_law, differentiate_by_sliders

  !> Part of a number that it is changed by for a central difference: errors are near its square, of rounding near 1e-16 over it.
  real(wp), parameter :: step = 1.0e-7_wp ! derived

contains

  !> By each of the numbers, then by those of its recipe.
  subroutine differentiate_law(law, recipe, quadrature, motion, slider, forces, change)
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
    !> Coefficients of the forces' derivatives [k, tangents + 1, columns]
    real(wp), intent(out) :: change(:, :, :)
    real(wp) :: shift(size(motion, 1), size(motion, 2))
    integer :: i, t

    change = 0.0_wp
    associate (n => law%tangents, kt => law%tangential_stiffness, kn => law%normal_stiffness, mu => law%friction_coefficient)
      if (law%elements() > 1) then
        call differentiate_elements(law, recipe, quadrature, motion, slider, forces, change)
      else
        shift = 0.0_wp
        shift(:, :n) = motion(:, :n)
        do t = 1, n
          shift(1, t) = shift(1, t) - slider(t)
        end do
        change(:, :, by_tangential_stiffness) = forces_by_motion(law, forces, shift)/kt
        if (mu > 0.0_wp) then
          change(:, :n, by_friction) = (tangential_forces(law, motion, forces%deviation(:size(motion, 1), :)) &
                                        - kt*change(:, :n, by_tangential_stiffness))/mu
        end if
      end if
      shift = 0.0_wp
      shift(:, n + 1) = motion(:, n + 1)
      shift(1, n + 1) = shift(1, n + 1) - law%gap
      change(:, :, by_normal_stiffness) = forces_by_motion(law, forces, shift)/kn
      shift = 0.0_wp
      shift(1, n + 1) = 1.0_wp
      change(:, :, by_preload) = forces_by_motion(law, forces, shift)/kn
      change(:, :, by_gap) = -kn*change(:, :, by_preload)
    end associate
    if (law%elements() > 1) return
    do i = 1, size(recipe%numbers)
      call differentiate_by_number(law, recipe, i, quadrature, motion, slider, forces, change(:, :, law_numbers + i))
    end do
  end subroutine differentiate_law

  !> By a further number of its law, of one element: a central difference.
  subroutine differentiate_by_number(law, recipe, number, quadrature, motion, slider, forces, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> Which of its numbers, from 1
    integer, intent(in) :: number
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' derivative [k, tangents + 1]
    real(wp), intent(out) :: change(:, :)
    type(contact_type) :: more, less
    real(wp) :: reach

    reach = step*abs(recipe%numbers(number))
    if (.not. reach > 0.0_wp) reach = step
    more = beside(law, recipe, number, reach)
    less = beside(law, recipe, number, -reach)
    change = difference(law, more, less, quadrature, motion, slider, forces)/(2.0_wp*reach)
    deallocate (more%law, less%law)
  end subroutine differentiate_by_number

  !> By the sliders at the start of the period, where they stay there.
  subroutine differentiate_by_sliders(law, quadrature, motion, slider, forces, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' derivatives [k, tangents + 1, width]
    real(wp), intent(out) :: change(:, :, :)
    real(wp) :: shift(size(motion, 1), size(motion, 2))
    integer :: i

    change = 0.0_wp
    if (forces%unique) return
    if (law%elements() > 1) then
      call differentiate_by_element_sliders(law, quadrature, motion, slider, forces, change)
      return
    end if
    do i = 1, law%tangents
      shift = 0.0_wp
      shift(1, i) = -1.0_wp
      change(:, :, i) = forces_by_motion(law, forces, shift)
    end do
  end subroutine differentiate_by_sliders

  !> A contact with another value of one of the numbers of its recipe; its law is the caller's to deallocate.
  function beside(law, recipe, number, change) result(other)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> Which of its numbers, from 1
    integer, intent(in) :: number
    !> What it is more by
    real(wp), intent(in) :: change
    type(contact_type) :: other
    real(wp), allocatable :: numbers(:)

    other = law
    numbers = recipe%numbers
    numbers(number) = numbers(number) + change
    other%law => new_law(recipe%kind, numbers)
  end function beside

  !> Difference of the tangential forces of two contacts at one motion [k, tangents + 1].
  function difference(law, more, less, quadrature, motion, slider, forces) result(change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> The two
    type(contact_type), intent(in) :: more, less
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    real(wp) :: change(size(motion, 1), size(motion, 2))
    type(contact_forces_type) :: there
    real(wp) :: moved(2)

    change = 0.0_wp
    ! One that holds its sliders, at whose limit other numbers would make it slide, is held by its spring alone.
    if (.not. allocated(forces%jacobian)) return
    allocate (there%deviation(size(motion, 1), size(motion, 2)))
    there%without_jacobian = .true.
    call evaluate_contact(more, quadrature, motion, slider, forces%periodic, there)
    moved = there%moved(:2)
    change(:, :law%tangents) = tangential_forces(more, motion, there%deviation)
    call evaluate_contact(less, quadrature, motion, slider, forces%periodic, there)
    change(:, :law%tangents) = change(:, :law%tangents) - tangential_forces(less, motion, there%deviation)
    if (.not. forces%follows()) return
    ! A slider that is to return follows the numbers, w' = (I - P_w)^-1 P_p, and forces follow it.
    associate (follow => matmul(forces%link%force, released(forces%link%holding, reshape(moved - there%moved(:2), [2, 1]))))
      change(:, :2) = change(:, :2) + reshape(follow, [size(motion, 1), 2])
    end associate
  end function difference
end module attrito_sensitivity_law_derivatives
