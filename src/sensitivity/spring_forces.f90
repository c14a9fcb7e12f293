!> Forces of the contacts' springs, K_c d, and of contacts by these: their Jacobian J = K_c + dg/dd along a motion.
module attrito_sensitivity_spring_forces
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: spring_forces, springs_of_contact, forces_by_motion, tangential_forces

contains

  !> Of this rank's rows [2 H + 1, rows].
  pure function spring_forces(balance, motion) result(forces)
    !> Harmonic balance
    type(balance_type), intent(in) :: balance
    !> d [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: forces(size(motion, 1), size(motion, 2))
    integer :: i

    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
        forces(:, first:last) = springs_of_contact(balance%law(i), motion(:, first:last))
      end associate
    end do
  end function spring_forces

  !> Of one contact [k, tangents + 1].
  pure function springs_of_contact(law, motion) result(forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: forces(size(motion, 1), size(motion, 2))

    forces(:, :law%tangents) = law%tangential_stiffness*motion(:, :law%tangents)
    forces(:, law%tangents + 1) = law%normal_stiffness*motion(:, law%tangents + 1)
  end function springs_of_contact

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
end module attrito_sensitivity_spring_forces
