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
!> displacement. Of elements in parallel some may rest and others slip: their derivative by k_t is a difference.
module attrito_sensitivity_law_derivatives
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  implicit none
  private
  public :: differentiate_law, law_numbers

  !> Numbers of a law: k_t, k_n, mu, gap, N_p
  integer, parameter :: law_numbers = 5

  !> Part of k_t that it is changed by for a central difference: errors are near the square of it, of rounding near 1e-16 over it
  real(wp), parameter :: step = 1.0e-5_wp ! derived

contains

  !> By each of the numbers.
  subroutine differentiate_law(law, quadrature, motion, slider, forces, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' derivatives [k, tangents + 1, law_numbers]
    real(wp), intent(out) :: change(:, :, :)
    real(wp) :: shift(size(motion, 1), size(motion, 2))
    integer :: t

    change = 0.0_wp
    associate (n => law%tangents, kt => law%tangential_stiffness, kn => law%normal_stiffness, mu => law%friction_coefficient)
      if (law%elements() > 1) then
        call differentiate_by_tangential_stiffness(law, quadrature, motion, slider, forces, change(:, :, 1))
      else
        shift = 0.0_wp
        shift(:, :n) = motion(:, :n)
        do t = 1, n
          shift(1, t) = shift(1, t) - slider(t)
        end do
        change(:, :, 1) = forces_by_motion(law, forces, shift)/kt
      end if
      shift = 0.0_wp
      shift(:, n + 1) = motion(:, n + 1)
      shift(1, n + 1) = shift(1, n + 1) - law%gap
      change(:, :, 2) = forces_by_motion(law, forces, shift)/kn
      shift = 0.0_wp
      shift(1, n + 1) = 1.0_wp
      change(:, :, 5) = forces_by_motion(law, forces, shift)/kn
      change(:, :, 4) = -kn*change(:, :, 5)
      if (mu > 0.0_wp) then
        change(:, :n, 3) = (tangential_forces(law, motion, forces%deviation(:size(motion, 1), :)) - kt*change(:, :n, 1))/mu
      end if
    end associate
  end subroutine differentiate_law

  !> J times a change of the motion [k, tangents + 1].
  pure function forces_by_motion(law, forces, motion) result(change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of the last evaluation
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of relative displacement
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: change(size(motion, 1), size(motion, 2))

    associate (n => law%tangents)
      change(:, :n) = law%tangential_stiffness*motion(:, :n)
      change(:, n + 1) = law%normal_stiffness*motion(:, n + 1)
    end associate
    if (.not. allocated(forces%jacobian)) return
    change = change + reshape(matmul(forces%jacobian, reshape(motion, [size(motion)])), shape(motion))
  end function forces_by_motion

  !> Coefficients of the tangential forces [k, tangents].
  pure function tangential_forces(law, motion, deviation) result(force)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement and of the forces' deviation from the springs' [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :), deviation(:, :)
    real(wp) :: force(size(motion, 1), law%tangents)

    force = law%tangential_stiffness*motion(:, :law%tangents) + deviation(:, :law%tangents)
  end function tangential_forces

  !> Of several elements: a central difference, exact where all of them rest.
  subroutine differentiate_by_tangential_stiffness(law, quadrature, motion, slider, forces, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' change [k, tangents + 1]
    real(wp), intent(out) :: change(:, :)
    type(contact_forces_type) :: there
    type(contact_type) :: beside
    integer :: side

    change = 0.0_wp
    allocate (there%deviation(size(motion, 1), size(motion, 2)))
    there%without_jacobian = .true.
    do side = -1, 1, 2
      beside = law
      beside%tangential_stiffness = (1.0_wp + side*step)*law%tangential_stiffness
      call evaluate_contact(beside, quadrature, motion, slider, forces%periodic, there)
      change(:, :law%tangents) = change(:, :law%tangents) + side*tangential_forces(beside, motion, there%deviation)
    end do
    change = change/(2.0_wp*step*law%tangential_stiffness)
  end subroutine differentiate_by_tangential_stiffness
end module attrito_sensitivity_law_derivatives
