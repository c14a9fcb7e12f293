!> Contacts that surely stick, recognised by the amplitudes of the harmonics alone or by a few samples, before anything is marched.
!>
!> $$ |T| \le k_t (|u_0 - w| + |\hat u|), \qquad N \ge N_0 - k_n \hat v, \qquad
!> k_t |\hat u| + \mu k_n \hat v < \mu N_0 - k_t |u_0 - w| $$
!>
!> with a swing, the sum of the harmonics' amplitudes, for each hat, the force of the mean N_0 = N_p + k_n (v_0 - gap), and the least
!> friction coefficient that the contact's law has at any N for mu. Of several elements in parallel every one has to.
!>
!> Between samples that are a step s apart a line is off by s^2/8 times the second derivative at most, so |u - w| - r is there at most
!>
!> $$ \max_j (|u_j - w| - r_j) + \frac{s^2}{8} \sum_h h^2 (|\hat u_h| + \hat r_h), \qquad s = 2 \pi / J $$
module attrito_contact_stuck_bound
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: is_stuck_by_bound, is_stuck_by_samples, mean_capacity, sticks_within, oscillation_bound

contains

  !> Do bounds on the motion keep |T| below mu N for good, from a given slider?
  pure logical function is_stuck_by_bound(law, motion, slider)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement [k, tangents + 1], and sliders [at least 2 elements, or tangents]
    real(wp), intent(in) :: motion(:, :), slider(:)
    real(wp) :: oscillation_bounds(law%tangents + 1)
    integer :: i

    oscillation_bounds = [(oscillation_bound(motion(:, i)), i=1, size(oscillation_bounds))]
    do i = 1, law%elements()
      is_stuck_by_bound = alternating_demand(law, i, oscillation_bounds) &
                          < mean_capacity(law, i, motion(1, :size(oscillation_bounds)), slider)
      if (.not. is_stuck_by_bound) return
    end do
  end function is_stuck_by_bound

  !> Does what is seen at some samples keep |T| below mu N for good, of a contact with two tangents? More contacts pass than by bounds
  !> on the amplitudes: these take all harmonics to swing together.
  pure logical function is_stuck_by_samples(law, displacement, motion, slider) result(sticks)
    !> Contact: its springs and its law, of one element
    type(contact_type), intent(in) :: law
    !> Relative displacement at equally spaced samples [J, 3], its coefficients [k, 3], and slider [2]
    real(wp), intent(in) :: displacement(:, :), motion(:, :), slider(:)
    real(wp) :: slope, between, radius(size(displacement, 1))
    integer :: h

    associate (n => size(displacement, 1), u => displacement)
      slope = law%least_coefficient()/law%tangential_stiffness
      radius = slope*law%normal_force(u(:, 3))
      between = 0.0_wp
      do h = 1, (size(motion, 1) - 1)/2
        between = between + h**2*(norm2(motion(2*h:2*h + 1, :2)) + slope*law%normal_stiffness*norm2(motion(2*h:2*h + 1, 3)))
      end do
      between = 0.125_wp*(two_pi/n)**2*between
      sticks = all(radius > between)
      if (sticks) sticks = all((u(:, 1) - slider(1))**2 + (u(:, 2) - slider(2))**2 < (radius - between)**2)
    end associate
  end function is_stuck_by_samples

  !> As by bounds, with what the mean leaves of each element given.
  pure logical function sticks_within(law, oscillation_bounds, capacities)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> [tangents + 1], and by `mean_capacity` [at least elements]
    real(wp), intent(in) :: oscillation_bounds(:), capacities(:)
    integer :: i

    do i = 1, law%elements()
      sticks_within = alternating_demand(law, i, oscillation_bounds) < capacities(i)
      if (.not. sticks_within) return
    end do
  end function sticks_within

  !> Friction that the mean leaves of an element for the harmonics, mu N_0 - k_t |u_0 - w|.
  pure real(wp) function mean_capacity(law, element, mean, slider) result(margin)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> From 1
    integer, intent(in) :: element
    !> Of relative displacement [tangents + 1], and sliders [at least 2 elements, or tangents]
    real(wp), intent(in) :: mean(:), slider(:)

    associate (n => law%tangents, part => law%part(element), first => 2*element - 1)
      margin = part%slip_force*law%least_coefficient()*law%normal_force(mean(n + 1)) &
               - part%stiffness*law%tangential_stiffness*norm2(mean(:n) - slider(first:first + n - 1))
    end associate
  end function mean_capacity

  !> The most friction that the harmonics may ask for of an element, k_t |swing of u| + mu k_n swing of v.
  pure real(wp) function alternating_demand(law, element, oscillation_bounds) result(demand)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> From 1
    integer, intent(in) :: element
    !> [tangents + 1]
    real(wp), intent(in) :: oscillation_bounds(:)

    associate (part => law%part(element))
      demand = part%slip_force*law%least_coefficient()*law%normal_stiffness*oscillation_bounds(law%tangents + 1)
      if (law%tangents == 1) then
        demand = demand + part%stiffness*law%tangential_stiffness*oscillation_bounds(1)
      else
        demand = demand + part%stiffness*law%tangential_stiffness*sqrt(oscillation_bounds(1)**2 + oscillation_bounds(2)**2)
      end if
    end associate
  end function alternating_demand

  !> Sum of the amplitudes of the harmonics [k].
  pure real(wp) function oscillation_bound(coefficients)
    !> Fourier coefficients
    real(wp), intent(in) :: coefficients(:)

    oscillation_bound = sum(sqrt(coefficients(2::2)**2 + coefficients(3::2)**2))
  end function oscillation_bound
end module attrito_contact_stuck_bound
