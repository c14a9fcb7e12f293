!> An oracle for contact forces over a period: radial return in many equal steps, of first order, extrapolated.
!>
!> $$ w \leftarrow u - \min(1, r/|u - w|) (u - w), \qquad r = F(N)/k_t $$
module fine_march
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_trigonometric, only: basis_at
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: marched_deviation

contains

  !> Deviation [k, tangents + 1] of a motion, whose means go on by `step` in a period that passes; and the slider at the end.
  subroutine marched_deviation(law, motion, step, steps, periods, slider, deviation)
    type(contact_type), intent(in) :: law
    real(wp), intent(in) :: motion(:, :), step(:)
    !> Of the finer march; periods that are marched
    integer, intent(in) :: steps, periods
    !> At the start, then at the end
    real(wp), intent(inout) :: slider(:)
    real(wp), intent(out) :: deviation(:, :)
    real(wp) :: coarse(size(motion, 1), size(motion, 2)), first(size(slider))

    first = slider
    call march(law, motion, step, steps/2, periods, first, coarse)
    call march(law, motion, step, steps, periods, slider, deviation)
    slider = 2.0_wp*slider - first
    deviation = 2.0_wp*deviation - coarse
  end subroutine marched_deviation

  subroutine march(law, motion, step, steps, periods, w, deviation)
    type(contact_type), intent(in) :: law
    real(wp), intent(in) :: motion(:, :), step(:)
    integer, intent(in) :: steps, periods
    real(wp), intent(inout) :: w(:)
    real(wp), intent(out) :: deviation(:, :)
    real(wp) :: basis(size(motion, 1)), series(size(motion, 2)), d(size(motion, 2)), g(size(motion, 2))
    real(wp) :: theta, radius(1), slope(1), distance, share
    integer :: j, n, period

    n = law%tangents
    do period = 1, periods
      deviation = 0.0_wp
      do j = 0, steps
        theta = two_pi*j/steps
        basis = basis_at(theta, size(motion, 1)/2)
        series = matmul(basis, motion)
        d = series + step*(theta - pi)/two_pi
        associate (normal => law%normal_force(d(n + 1)))
          call law%slip_force([normal], radius, slope)
          radius = max(radius/law%tangential_stiffness, 0.0_wp)
          distance = norm2(d(:n) - w(:n))
          if (distance > radius(1)) w(:n) = d(:n) - radius(1)/distance*(d(:n) - w(:n))
          g(:n) = law%tangential_stiffness*(d(:n) - w(:n) - series(:n))
          g(n + 1) = max(normal, 0.0_wp) - law%normal_stiffness*series(n + 1)
        end associate
        ! Trapezoids
        share = merge(0.5_wp, 1.0_wp, j == 0 .or. j == steps)*2.0_wp/steps
        deviation = deviation + spread(share*basis, 2, n + 1)*spread(g, 1, size(basis))
      end do
      deviation(1, :) = 0.5_wp*deviation(1, :)
    end do
  end subroutine march
end module fine_march
