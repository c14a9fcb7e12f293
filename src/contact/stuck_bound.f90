!> Contacts that surely stick, recognised by the amplitudes of the harmonics alone, before anything is marched.
!>
!> $$ |T| \le k_t (|u_0 - w| + |\hat u|), \qquad N \ge N_0 - k_n \hat v, \qquad
!> k_t |\hat u| + \mu k_n \hat v < \mu N_0 - k_t |u_0 - w| $$
!>
!> with a swing, the sum of the harmonics' amplitudes, for each hat, the force of the mean N_0 = N_p + k_n (v_0 - gap), and the least
!> friction coefficient that the contact's law has at any N for mu. Of several elements in parallel every one has to.
module attrito_contact_stuck_bound
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: is_stuck_by_bound, mean_capacities, sticks_within, oscillation_bound

contains

  !> Do bounds on the motion keep |T| below mu N for good, from a given slider?
  pure logical function is_stuck_by_bound(law, motion, slider)
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement [k, tangents + 1], and sliders [at least 2 elements, or tangents]
    real(wp), intent(in) :: motion(:, :), slider(:)
    real(wp) :: oscillation_bounds(law%tangents + 1)
    integer :: i

    oscillation_bounds = [(oscillation_bound(motion(:, i)), i=1, size(oscillation_bounds))]
    is_stuck_by_bound = sticks_within(law, oscillation_bounds, mean_capacities(law, motion(1, :size(oscillation_bounds)), slider))
  end function is_stuck_by_bound

  !> Friction that the mean leaves of each element for the harmonics, mu N_0 - k_t |u_0 - w| [elements].
  pure function mean_capacities(law, mean, slider) result(capacities)
    type(contact_type), intent(in) :: law
    !> Of relative displacement [tangents + 1], and sliders [at least 2 elements, or tangents]
    real(wp), intent(in) :: mean(:), slider(:)
    real(wp) :: capacities(law%elements())
    integer :: i

    do i = 1, size(capacities)
      associate (n => law%tangents, part => law%part(i))
        capacities(i) = part%slip_force*law%least_coefficient()*law%normal_force(mean(n + 1)) &
                        - part%stiffness*law%tangential_stiffness*norm2(mean(:n) - slider(2*i - 1:2*i - 2 + n))
      end associate
    end do
  end function mean_capacities

  !> Is the most friction that the harmonics may ask for of an element, k_t |swing of u| + mu k_n swing of v, less than what the mean
  !> leaves of it, for every element?
  pure logical function sticks_within(law, oscillation_bounds, capacities)
    type(contact_type), intent(in) :: law
    !> [tangents + 1], and of `mean_capacities` [at least elements]
    real(wp), intent(in) :: oscillation_bounds(:), capacities(:)
    real(wp) :: normal, tangential
    integer :: i

    normal = law%least_coefficient()*law%normal_stiffness*oscillation_bounds(law%tangents + 1)
    if (law%tangents == 1) then
      tangential = law%tangential_stiffness*oscillation_bounds(1)
    else
      tangential = law%tangential_stiffness*sqrt(oscillation_bounds(1)**2 + oscillation_bounds(2)**2)
    end if
    do i = 1, law%elements()
      associate (part => law%part(i))
        sticks_within = part%slip_force*normal + part%stiffness*tangential < capacities(i)
      end associate
      if (.not. sticks_within) return
    end do
  end function sticks_within

  !> Sum of the amplitudes of the harmonics [k].
  pure real(wp) function oscillation_bound(coefficients)
    real(wp), intent(in) :: coefficients(:)

    oscillation_bound = sum(sqrt(coefficients(2::2)**2 + coefficients(3::2)**2))
  end function oscillation_bound
end module attrito_contact_stuck_bound
