!> Contacts that surely stick, told from the amplitudes of the harmonics alone, before anything is marched.
module attrito_contact_stuck
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: surely_stuck

contains

  !> Do bounds on the motion keep |T| below mu N for good, from a given slider?
  !>
  !> |T| <= k_t (|u_0 - w| + swing of u), N >= N_0 - k_n swing of v; a swing is the sum of the harmonics' amplitudes.
  pure logical function surely_stuck(law, motion, slider)
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement [k, tangents + 1], and slider [at least tangents]
    real(wp), intent(in) :: motion(:, :), slider(:)
    real(wp) :: least_normal, swings(law%tangents)
    integer :: i, n

    n = law%tangents
    least_normal = law%preload + law%normal_stiffness*(motion(1, n + 1) - law%gap - swing(motion(:, n + 1)))
    swings = [(swing(motion(:, i)), i=1, n)]
    surely_stuck = law%tangential_stiffness*(norm2(motion(1, :n) - slider(:n)) + norm2(swings)) &
                   < law%friction_coefficient*least_normal
  end function surely_stuck

  !> Sum of the amplitudes of the harmonics.
  pure real(wp) function swing(coefficients)
    real(wp), intent(in) :: coefficients(:)

    swing = sum(sqrt(coefficients(2::2)**2 + coefficients(3::2)**2))
  end function swing
end module attrito_contact_stuck
