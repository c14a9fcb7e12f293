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
!> displacement. So is the derivative by it, -J e_t. Of elements in parallel some may rest and others slip: their derivatives by k_t
!> and by sliders are differences, and so are those by further numbers that a kind of law is made of.
module attrito_sensitivity_law_derivatives
  use attrito_core_kinds, only: wp
  use attrito_contact_law_laws, only: new_law
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type, released
  use attrito_sensitivity_parameters, only: recipe_type, law_numbers, by_tangential_stiffness, by_normal_stiffness, by_friction, &
                                            by_gap, by_preload
  use attrito_sensitivity_spring_forces, only: springs_of_contact
  implicit none
  private
  public :: differentiate_law, differentiate_by_sliders, forces_by_motion, beside

  !> Part of a number that it is changed by for a central difference: errors are near its square, of rounding near 1e-16 over it.
  !> By samples, and of elements in parallel, forces have a corner wherever a sample or an element changes its regime: few do so
  !> within so little.
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
        change(:, :, by_tangential_stiffness) = difference(law, beside(law, recipe, by_tangential_stiffness, step*kt), &
                                                           beside(law, recipe, by_tangential_stiffness, -step*kt), quadrature, &
                                                           motion, slider, slider, forces)/(2.0_wp*step*kt)
      else
        shift = 0.0_wp
        shift(:, :n) = motion(:, :n)
        do t = 1, n
          shift(1, t) = shift(1, t) - slider(t)
        end do
        change(:, :, by_tangential_stiffness) = forces_by_motion(law, forces, shift)/kt
      end if
      shift = 0.0_wp
      shift(:, n + 1) = motion(:, n + 1)
      shift(1, n + 1) = shift(1, n + 1) - law%gap
      change(:, :, by_normal_stiffness) = forces_by_motion(law, forces, shift)/kn
      shift = 0.0_wp
      shift(1, n + 1) = 1.0_wp
      change(:, :, by_preload) = forces_by_motion(law, forces, shift)/kn
      change(:, :, by_gap) = -kn*change(:, :, by_preload)
      if (mu > 0.0_wp) then
        change(:, :n, by_friction) = (tangential_forces(law, motion, forces%deviation(:size(motion, 1), :)) &
                                      - kt*change(:, :n, by_tangential_stiffness))/mu
      end if
    end associate
    do i = 1, size(recipe%numbers)
      call differentiate_by_number(law, recipe, i, quadrature, motion, slider, forces, change(:, :, law_numbers + i))
    end do
  end subroutine differentiate_law

  !> J of the last evaluation times a change of the motion [k, tangents + 1].
  pure function forces_by_motion(law, forces, motion) result(change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of the last evaluation
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of relative displacement
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: change(size(motion, 1), size(motion, 2))

    change = springs_of_contact(law, motion)
    if (.not. allocated(forces%jacobian)) return
    change = change + reshape(matmul(forces%jacobian, reshape(motion, [size(motion)])), shape(motion))
  end function forces_by_motion

  !> Coefficients of the tangential forces [k, tangents].
  pure function tangential_forces(law, motion, deviation) result(force)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement and of the forces' deviation from the springs' [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :), deviation(:, :)
    real(wp) :: force(size(motion, 1), law%tangents), springs(size(motion, 1), size(motion, 2))

    springs = springs_of_contact(law, motion)
    force = springs(:, :law%tangents) + deviation(:, :law%tangents)
  end function tangential_forces

  !> By a further number of its law: a central difference.
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
    more = beside(law, recipe, law_numbers + number, reach)
    less = beside(law, recipe, law_numbers + number, -reach)
    change = difference(law, more, less, quadrature, motion, slider, slider, forces)/(2.0_wp*reach)
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
    real(wp) :: moved(size(slider), 2), shift(size(motion, 1), size(motion, 2)), reach
    integer :: i

    change = 0.0_wp
    if (forces%unique) return
    if (law%elements() == 1) then
      do i = 1, law%tangents
        shift = 0.0_wp
        shift(1, i) = -1.0_wp
        change(:, :, i) = forces_by_motion(law, forces, shift)
      end do
      return
    end if
    reach = step*(maxval(abs(motion)) + maxval(abs(slider)))
    do i = 1, size(change, 3), 2
      moved = spread(slider, 2, 2)
      moved(i, :) = moved(i, :) + [reach, -reach]
      change(:, :, i) = difference(law, law, law, quadrature, motion, moved(:, 1), moved(:, 2), forces)/(2.0_wp*reach)
    end do
  end subroutine differentiate_by_sliders

  !> A contact with another value of one of its columns; a law that it is given is the caller's to deallocate.
  function beside(law, recipe, column, change) result(other)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> Number of its law, or beyond these one of its recipe
    integer, intent(in) :: column
    !> What it is more by
    real(wp), intent(in) :: change
    type(contact_type) :: other
    real(wp), allocatable :: numbers(:)

    other = law
    select case (column)
     case (by_tangential_stiffness)
      other%tangential_stiffness = law%tangential_stiffness + change
     case (by_normal_stiffness)
      other%normal_stiffness = law%normal_stiffness + change
     case (by_friction)
      other%friction_coefficient = law%friction_coefficient + change
     case (by_gap)
      other%gap = law%gap + change
     case (by_preload)
      other%preload = law%preload + change
     case default
      numbers = recipe%numbers
      numbers(column - law_numbers) = numbers(column - law_numbers) + change
      other%law => new_law(recipe%kind, numbers)
    end select
  end function beside

  !> Difference of the tangential forces of two contacts at one motion [k, tangents + 1].
  function difference(law, more, less, quadrature, motion, slider_more, slider_less, forces) result(change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> The two
    type(contact_type), intent(in) :: more, less
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders of both at the start [width]
    real(wp), intent(in) :: motion(:, :), slider_more(:), slider_less(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    real(wp) :: change(size(motion, 1), size(motion, 2))
    type(contact_forces_type) :: there
    real(wp) :: moved(2)

    change = 0.0_wp
    if (.not. allocated(forces%jacobian)) then
      ! It holds its sliders, at whose limit other numbers would make it slide.
      change(:, :law%tangents) = held_forces(more, motion, slider_more) - held_forces(less, motion, slider_less)
      return
    end if
    allocate (there%deviation(size(motion, 1), size(motion, 2)))
    there%without_jacobian = .true.
    call evaluate_contact(more, quadrature, motion, slider_more, forces%periodic, there)
    moved = there%moved(:2)
    change(:, :law%tangents) = tangential_forces(more, motion, there%deviation)
    call evaluate_contact(less, quadrature, motion, slider_less, forces%periodic, there)
    change(:, :law%tangents) = change(:, :law%tangents) - tangential_forces(less, motion, there%deviation)
    if (.not. forces%follows()) return
    ! A slider that is to return follows the numbers, w' = (I - P_w)^-1 P_p, and forces follow it.
    associate (follow => matmul(forces%link%force, released(forces%link%holding, reshape(moved - there%moved(:2), [2, 1]))))
      change(:, :2) = change(:, :2) + reshape(follow, [size(motion, 1), 2])
    end associate
  end function difference

  !> Coefficients of the tangential forces of a contact that holds its sliders [k, tangents].
  pure function held_forces(law, motion, slider) result(force)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement [k, tangents + 1]; sliders [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    real(wp) :: force(size(motion, 1), law%tangents)
    integer :: t

    force = tangential_forces(law, motion, 0.0_wp*motion)
    do t = 1, law%tangents
      force(1, t) = force(1, t) + law%slider_force(t, slider)
    end do
  end function held_forces
end module attrito_sensitivity_law_derivatives
