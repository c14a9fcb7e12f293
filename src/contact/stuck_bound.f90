!> Contacts that surely stick, told from the amplitudes of the harmonics alone, before anything is marched.
!>
!> $$ |T| \le k_t (|u_0 - w| + |\hat u|), \qquad N \ge N_0 - k_n \hat v, \qquad
!> k_t |\hat u| + \mu k_n \hat v < \mu N_0 - k_t |u_0 - w| $$
!>
!> with a swing, the sum of the harmonics' amplitudes, for each hat, the force of the mean N_0 = N_p + k_n (v_0 - gap), and the least
!> friction coefficient that the contact's law has at any N for mu.
module attrito_contact_stuck_bound
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: surely_stuck, margin_of_mean, demand_of_swings, swing

contains

  !> Do bounds on the motion keep |T| below mu N for good, from a given slider?
  pure logical function surely_stuck(law, motion, slider)
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement [k, tangents + 1], and slider [at least tangents]
    real(wp), intent(in) :: motion(:, :), slider(:)
    real(wp) :: swings(law%tangents + 1)
    integer :: i

    swings = [(swing(motion(:, i)), i=1, size(swings))]
    surely_stuck = demand_of_swings(law, swings) < margin_of_mean(law, motion(1, :size(swings)), slider)
  end function surely_stuck

  !> Friction that the mean leaves for the harmonics, mu N_0 - k_t |u_0 - w|.
  pure real(wp) function margin_of_mean(law, mean, slider) result(margin)
    type(contact_type), intent(in) :: law
    !> Of relative displacement [tangents + 1], and slider [at least tangents]
    real(wp), intent(in) :: mean(:), slider(:)

    associate (n => law%tangents)
      margin = law%least_coefficient()*law%normal_force(mean(n + 1)) &
               - law%tangential_stiffness*norm2(mean(:n) - slider(:n))
    end associate
  end function margin_of_mean

  !> The most friction that the harmonics may ask for, k_t |swing of u| + mu k_n swing of v.
  pure real(wp) function demand_of_swings(law, swings) result(demand)
    type(contact_type), intent(in) :: law
    !> [tangents + 1]
    real(wp), intent(in) :: swings(:)

    demand = law%least_coefficient()*law%normal_stiffness*swings(law%tangents + 1)
    if (law%tangents == 1) then
      demand = demand + law%tangential_stiffness*swings(1)
    else
      demand = demand + law%tangential_stiffness*sqrt(swings(1)**2 + swings(2)**2)
    end if
  end function demand_of_swings

  !> Sum of the amplitudes of the harmonics [k].
  pure real(wp) function swing(coefficients)
    real(wp), intent(in) :: coefficients(:)

    swing = sum(sqrt(coefficients(2::2)**2 + coefficients(3::2)**2))
  end function swing
end module attrito_contact_stuck_bound
