!> Forces of a contact with two tangents over one period of motion that passes and does not repeat, as of a joint that drifts.
!>
!> Displacements are a series, and go on from the mean d_0^- of the period before at a constant rate,
!>
!> $$ d_j = d(\theta_j) + \rho_j (d_0 - d_0^-), \qquad \rho_j = \frac{j - (J - 1)/2}{J}, \quad j = 0 \ldots J - 1 $$
!>
!> The period begins where the one before has ended if both have the same harmonics and rate. In steady drift sliders go on by the
!> step of the mean, and forces are periodic. Springs have the series alone, so the deviation has what the rate adds,
!> K_c rho_j (d_0 - d_0^-).
module attrito_contact_passing_period
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_fourier, only: fourier_type
  use attrito_contact_quadrature_sampled, only: contact_samples_type, sample_contact, deviation_at_samples, classify, differentiate
  implicit none
  private
  public :: evaluate_passing_period

contains

  !> Forces and Jacobian, the slider being marched once from where it is.
  subroutine evaluate_passing_period(law, fourier, motion, slider, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Transforms between coefficients and samples
    type(fourier_type), intent(in) :: fourier
    !> Coefficients of relative displacement [k, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start [2]
    real(wp), intent(in) :: slider(2)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    type(contact_samples_type) :: samples
    type(fourier_type) :: passing
    real(wp), allocatable :: deviation(:, :), ramp(:)
    real(wp) :: stiffness(3)
    integer :: i, j, k

    k = fourier%coefficients
    forces%periodic = .false.
    samples%without_gradients = forces%without_jacobian
    samples%ramp = [((j - 0.5_wp*(fourier%samples - 1))/fourier%samples, j=0, fourier%samples - 1)]
    samples%step = motion(1, :) - forces%mean_before
    passing = fourier
    passing%basis(1, :) = 1.0_wp + samples%ramp
    call sample_contact(law, passing, motion, slider, 1, samples)
    stiffness = [law%tangential_stiffness, law%tangential_stiffness, law%normal_stiffness]
    deviation = deviation_at_samples(law, samples)
    do i = 1, 3
      deviation(:, i) = deviation(:, i) + stiffness(i)*samples%step(i)*samples%ramp
    end do
    call fourier%to_coefficients(deviation, forces%deviation)
    call classify(samples, forces)
    if (forces%without_jacobian) return
    call differentiate(law, passing, samples, forces)
    if (.not. allocated(forces%jacobian)) allocate (forces%jacobian(3*k, 3*k), source=0.0_wp)
    forces%active = spread(.true., 1, 3*k)
    ramp = matmul(fourier%analysis, samples%ramp)
    do i = 1, 3
      associate (mean => forces%jacobian((i - 1)*k + 1:i*k, (i - 1)*k + 1))
        mean = mean + stiffness(i)*ramp
      end associate
    end do
  end subroutine evaluate_passing_period
end module attrito_contact_passing_period
