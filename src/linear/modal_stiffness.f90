!> Dynamic stiffness of modes that damping leaves uncoupled, at one harmonic:
!>
!> $$ Z_{hr} = k_r - (h \omega)^2 m_r + i h \omega (c_r - \xi m_r), \qquad Z_{0r} = (1 + p) k_r, \qquad
!>    Z_{1s} \leftarrow Z_{1s} + l_s $$
!>
!> with what a receptance is set to: xi, the negative damping of autonomous motion; p, springs that hold the mean; l_s,
!> springs on some modes s.
module attrito_linear_modal_stiffness
  use attrito_core_kinds, only: wp
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: modal_stiffness, modal_stiffness_rate, finite_stiffness

contains

  !> Z_h; 1 throughout where any of it is 0, so that it has an inverse.
  pure subroutine modal_stiffness(receptance, h, omega, stiffness, mass, damping, dynamic, status)
    !> Has the negative damping and the springs
    class(receptance_type), intent(in) :: receptance
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Angular frequency, rad/s; of each mode [n]
    real(wp), intent(in) :: omega, stiffness(:), mass(:), damping(:)
    !> Z_h [n]
    complex(wp), intent(out) :: dynamic(:)
    !> 0, or not: an undamped mode is in resonance, or free
    integer, intent(out) :: status

    associate (elastic => stiffness - (h*omega)**2*mass)
      dynamic = cmplx(merge(1.0_wp + receptance%held, 1.0_wp, h == 0)*elastic, &
                      h*omega*(damping - receptance%excitation*mass), wp)
    end associate
    if (h == 1 .and. receptance%is_lifted()) then
      dynamic(receptance%lifted_modes) = dynamic(receptance%lifted_modes) + receptance%lifts
    end if
    status = merge(1, 0, any(abs(real(dynamic, wp)) + abs(aimag(dynamic)) <= 0.0_wp))
    if (status /= 0) dynamic = 1.0_wp
  end subroutine modal_stiffness

  !> dZ_h/domega = -2 h^2 omega m + i h (c - xi m) [n].
  pure function modal_stiffness_rate(receptance, h, mass, damping) result(rate)
    !> Has the negative damping, and is set to the frequency
    class(receptance_type), intent(in) :: receptance
    !> Number of the harmonic
    integer, intent(in) :: h
    !> Of each mode [n]
    real(wp), intent(in) :: mass(:), damping(:)
    complex(wp) :: rate(size(mass))

    rate = cmplx(-2.0_wp*h**2*receptance%omega*mass, h*(damping - receptance%excitation*mass), wp)
  end function modal_stiffness_rate

  !> That of the structure itself, k - w^2 m + i (w c + l), modes without any damping being given a ratio of it.
  pure elemental complex(wp) function finite_stiffness(frequency, stiffness, mass, damping, loss, least_ratio)
    !> h omega
    real(wp), intent(in) :: frequency
    !> Of the mode, the last eta times what structural damping acts on
    real(wp), intent(in) :: stiffness, mass, damping, loss
    !> Damping ratio of a mode without damping
    real(wp), intent(in) :: least_ratio
    real(wp) :: finite_damping

    finite_damping = damping
    if (damping + loss <= 0.0_wp) finite_damping = 2.0_wp*least_ratio*sqrt(abs(stiffness)*mass)
    finite_stiffness = cmplx(stiffness - frequency**2*mass, frequency*finite_damping + loss, wp)
  end function finite_stiffness
end module attrito_linear_modal_stiffness
