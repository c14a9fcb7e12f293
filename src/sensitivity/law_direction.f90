!> Change of one contact's forces, at a given motion and given start sliders, with the parameters p of its law:
!>
!> $$ \lambda' = \left. \frac{\partial \lambda}{\partial p} \right|_{d, w} \dot p, \qquad
!>    p = (k_t, k_n, \mu, \mathrm{gap}, N_p) $$
!>
!> A contact that never slips or opens is linear, T = k_t (u - w), N = N_p + k_n (v - gap), and so is its change. Of others the forces
!> are smooth in p between changes of their sequence of events; a central difference along p is used, whichever law it is. At such a
!> change of sequence it is the mean of both one-sided derivatives.
module attrito_sensitivity_law_direction
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  implicit none
  private
  public :: direction_type, force_change

  !> Step of the central difference, part of the scale of what is differentiated: its error is near the square of it, that of rounding
  !> near 1e-16 over it
  real(wp), parameter :: step = 1.0e-5_wp ! derived

  !> Rates of a contact's parameters
  type :: direction_type
    real(wp) :: tangential_stiffness = 0.0_wp, normal_stiffness = 0.0_wp, friction_coefficient = 0.0_wp, gap = 0.0_wp, &
                preload = 0.0_wp
  contains
    procedure :: is_zero
    procedure :: largest_step
    procedure :: moved
  end type direction_type

contains

  !> Does nothing change?
  elemental logical function is_zero(self)
    class(direction_type), intent(in) :: self

    is_zero = max(abs(self%tangential_stiffness), abs(self%normal_stiffness), abs(self%friction_coefficient), abs(self%gap), &
                  abs(self%preload)) <= 0.0_wp
  end function is_zero

  !> How far to go along the direction: `step` of what is there, of gap and preload beside how far the contact moves.
  pure real(wp) function largest_step(self, law, travel) result(far)
    class(direction_type), intent(in) :: self
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of the normal displacement, the sum of its coefficients' moduli
    real(wp), intent(in) :: travel
    real(wp) :: shares

    associate (force => abs(law%preload) + law%normal_stiffness*(travel + abs(law%gap)))
      shares = share(self%tangential_stiffness, law%tangential_stiffness) &
               + share(self%normal_stiffness, law%normal_stiffness) &
               + share(self%friction_coefficient, law%friction_coefficient) &
               + share(law%normal_stiffness*self%gap, force) + share(self%preload, force)
    end associate
    far = 0.0_wp
    if (shares > 0.0_wp) far = step/shares
  end function largest_step

  !> Part of what it is measured by that a rate is.
  pure real(wp) function share(rate, scale)
    !> Rate of a parameter, and what it is measured by
    real(wp), intent(in) :: rate, scale

    share = 0.0_wp
    if (abs(rate) > 0.0_wp) share = abs(rate)/max(abs(scale), tiny(1.0_wp)/step)
  end function share

  !> The contact a length along the direction.
  type(contact_type) function moved(self, law, length)
    class(direction_type), intent(in) :: self
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> How far
    real(wp), intent(in) :: length

    moved = law
    moved%tangential_stiffness = law%tangential_stiffness + length*self%tangential_stiffness
    moved%normal_stiffness = law%normal_stiffness + length*self%normal_stiffness
    moved%friction_coefficient = law%friction_coefficient + length*self%friction_coefficient
    moved%gap = law%gap + length*self%gap
    moved%preload = law%preload + length*self%preload
  end function moved

  !> Change of the forces along a direction, and of what a period moves a periodic slider by.
  subroutine force_change(direction, law, quadrature, motion, slider, forces, change, slip)
    !> Rates of the contact's parameters
    type(direction_type), intent(in) :: direction
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What evaluations of all contacts share
    type(quadrature_type), intent(in) :: quadrature
    !> Coefficients of relative displacement [k, tangents + 1]; sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Of the last evaluation there
    type(contact_forces_type), intent(in) :: forces
    !> Coefficients of the forces' change [k, tangents + 1]; change of what is left of a periodic slider's way [width]
    real(wp), intent(out) :: change(:, :), slip(:)
    type(contact_forces_type) :: there(2)
    type(contact_type) :: beside
    real(wp) :: far
    integer :: i, side

    change = 0.0_wp
    slip = 0.0_wp
    far = direction%largest_step(law, sum(abs(motion(:, law%tangents + 1))))
    if (far <= 0.0_wp) return
    if (.not. allocated(forces%jacobian)) then
      call spring_change(direction, law, motion, slider, change)
      return
    end if
    do i = 1, 2
      side = 2*i - 3
      beside = direction%moved(law, side*far)
      allocate (there(i)%deviation(size(motion, 1), size(motion, 2)))
      there(i)%without_jacobian = .not. forces%periodic
      call evaluate_contact(beside, quadrature, motion, slider, forces%periodic, there(i))
      call add_springs(beside, motion, side/(2.0_wp*far), there(i)%deviation, change)
      if (forces%periodic) slip = slip + side/(2.0_wp*far)*there(i)%moved
    end do
  end subroutine force_change

  !> change <- change + factor (K_c d + g).
  subroutine add_springs(law, motion, factor, deviation, change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement; factor on the forces; deviation of the forces from those of the springs
    real(wp), intent(in) :: motion(:, :), factor, deviation(:, :)
    !> What is added to
    real(wp), intent(inout) :: change(:, :)

    associate (n => law%tangents)
      change = change + factor*deviation
      change(:, :n) = change(:, :n) + factor*law%tangential_stiffness*motion(:, :n)
      change(:, n + 1) = change(:, n + 1) + factor*law%normal_stiffness*motion(:, n + 1)
    end associate
  end subroutine add_springs

  !> Of a contact that sticks all over the period.
  subroutine spring_change(direction, law, motion, slider, change)
    !> Rates of the contact's parameters
    type(direction_type), intent(in) :: direction
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Coefficients of relative displacement; sliders
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Coefficients of the forces' change
    real(wp), intent(out) :: change(:, :)
    real(wp) :: part
    integer :: t

    part = direction%tangential_stiffness/law%tangential_stiffness
    associate (n => law%tangents)
      change(:, :n) = direction%tangential_stiffness*motion(:, :n)
      do t = 1, n
        change(1, t) = change(1, t) + part*law%slider_force(t, slider)
      end do
      change(:, n + 1) = direction%normal_stiffness*motion(:, n + 1)
      change(1, n + 1) = change(1, n + 1) - direction%normal_stiffness*law%gap - law%normal_stiffness*direction%gap &
                         + direction%preload
    end associate
  end subroutine spring_change
end module attrito_sensitivity_law_direction
