!> Forces of the contacts' springs, K_c d.
module attrito_sensitivity_spring_forces
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: spring_forces, springs_of_contact

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
end module attrito_sensitivity_spring_forces
