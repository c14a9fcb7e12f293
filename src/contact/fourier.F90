!> Between Fourier coefficients and samples over one period, by FFTW.
!>
!> $$ x_j = a_0 + \sum_h a_{ch} \cos(2\pi h j / J) + a_{sh} \sin(2\pi h j / J), \qquad j = 0 \ldots J-1 $$
!>
!> Source: Frigo & Johnson 2005, doi:10.1109/JPROC.2004.840301.
module attrito_contact_fourier
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: multiply_by_transpose
  implicit none
  private
  public :: fourier_type, new_fourier

  include 'fftw3.f03'

  type :: fourier_type
    !> Samples a period, J
    integer :: samples = 0
    !> A quarter of them, at which what a contact does is looked at beforehand
    integer :: coarse_samples = 0
    !> Coefficients of the motion, 2 H + 1
    integer :: coefficients = 0
    !> Motion at the samples per unit coefficient [coefficients, J]
    real(wp), allocatable :: basis(:, :)
    !> Coefficients per unit sample [coefficients, J]
    real(wp), allocatable :: analysis(:, :)
    type(c_ptr), private :: to_samples_plan = c_null_ptr, to_coarse_plan = c_null_ptr, to_coefficients_plan = c_null_ptr
  contains
    procedure :: to_samples
    procedure :: to_coarse_samples
    procedure :: to_coefficients
    procedure :: analyse_gradients
    procedure :: destroy
  end type fourier_type

contains

  !> Transforms for `harmonics` harmonics and `samples` samples (at least 2 harmonics + 1).
  function new_fourier(harmonics, samples) result(self)
    !> Highest harmonic, H; samples a period, J
    integer, intent(in) :: harmonics, samples
    type(fourier_type) :: self
    real(c_double) :: x(samples)
    complex(c_double_complex) :: z(samples/2 + 1)
    integer :: h, j

    self%samples = samples
    self%coefficients = 2*harmonics + 1
    self%to_samples_plan = fftw_plan_dft_c2r_1d(samples, z, x, ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
    self%coarse_samples = max(samples/4, 1)
    self%to_coarse_plan = fftw_plan_dft_c2r_1d(self%coarse_samples, z, x, ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
    self%to_coefficients_plan = fftw_plan_dft_r2c_1d(samples, x, z, ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
    allocate (self%basis(self%coefficients, samples))
    self%basis(1, :) = 1.0_wp
    do h = 1, harmonics
      self%basis(2*h, :) = [(cos(two_pi*modulo(h*j, samples)/samples), j=0, samples - 1)]
      self%basis(2*h + 1, :) = [(sin(two_pi*modulo(h*j, samples)/samples), j=0, samples - 1)]
    end do
    self%analysis = self%basis*2.0_wp/samples
    self%analysis(1, :) = 1.0_wp/samples
  end function new_fourier

  !> Samples of a series, columnwise.
  subroutine to_samples(self, coefficients, x)
    class(fourier_type), intent(in) :: self
    !> Coefficients [any odd number up to J, columns]
    real(wp), intent(in) :: coefficients(:, :)
    !> Samples [J, columns]
    real(wp), intent(out), contiguous :: x(:, :)

    call execute(self%to_samples_plan, self%samples, coefficients, x)
  end subroutine to_samples

  !> The same at a quarter of the samples.
  subroutine to_coarse_samples(self, coefficients, x)
    class(fourier_type), intent(in) :: self
    !> Coefficients [any odd number up to J/4, columns]
    real(wp), intent(in) :: coefficients(:, :)
    !> Samples [J/4, columns]
    real(wp), intent(out), contiguous :: x(:, :)

    call execute(self%to_coarse_plan, self%coarse_samples, coefficients, x)
  end subroutine to_coarse_samples

  !> Samples of a series by one of the plans.
  subroutine execute(plan, samples, coefficients, x)
    !> FFTW's plan
    type(c_ptr), intent(in) :: plan
    !> Samples a period that it is made for
    integer, intent(in) :: samples
    !> Coefficients [any odd number up to that, columns]
    real(wp), intent(in) :: coefficients(:, :)
    !> Samples [samples, columns]
    real(wp), intent(out), contiguous :: x(:, :)
    complex(c_double_complex) :: z(samples/2 + 1)
    integer :: column, h

    do column = 1, size(coefficients, 2)
      z = 0.0_wp
      z(1) = coefficients(1, column)
      do h = 1, (size(coefficients, 1) - 1)/2
        z(h + 1) = 0.5_wp*cmplx(coefficients(2*h, column), -coefficients(2*h + 1, column), wp)
      end do
      call fftw_execute_dft_c2r(plan, z, x(:, column))
    end do
  end subroutine execute

  !> The first coefficients of samples, columnwise.
  subroutine to_coefficients(self, x, coefficients)
    class(fourier_type), intent(in) :: self
    !> Samples [J, columns]
    real(wp), intent(in) :: x(:, :)
    !> Coefficients [any odd number below J, columns]
    real(wp), intent(out) :: coefficients(:, :)
    real(c_double) :: work(self%samples)
    complex(c_double_complex) :: z(self%samples/2 + 1)
    integer :: column, h

    do column = 1, size(x, 2)
      work = x(:, column)
      call fftw_execute_dft_r2c(self%to_coefficients_plan, work, z)
      coefficients(1, column) = real(z(1), wp)/self%samples
      do h = 1, (size(coefficients, 1) - 1)/2
        coefficients(2*h, column) = 2.0_wp*real(z(h + 1), wp)/self%samples
        coefficients(2*h + 1, column) = -2.0_wp*aimag(z(h + 1))/self%samples
      end do
    end do
  end subroutine to_coefficients

  !> The coefficients' gradients from those of the samples, all at once.
  subroutine analyse_gradients(self, samples, coefficients)
    class(fourier_type), intent(in) :: self
    !> Gradients by p parameters of c columns of samples [p, c, J]
    real(wp), intent(in), contiguous :: samples(:, :, :)
    !> [coefficients, p, c]
    real(wp), intent(out), contiguous :: coefficients(:, :, :)

    call multiply_by_transpose(self%coefficients, size(samples, 1)*size(samples, 2), self%samples, self%analysis, samples, &
                               coefficients)
  end subroutine analyse_gradients

  !> Give FFTW's plans back.
  subroutine destroy(self)
    class(fourier_type), intent(inout) :: self

    if (c_associated(self%to_samples_plan)) call fftw_destroy_plan(self%to_samples_plan)
    if (c_associated(self%to_coarse_plan)) call fftw_destroy_plan(self%to_coarse_plan)
    if (c_associated(self%to_coefficients_plan)) call fftw_destroy_plan(self%to_coefficients_plan)
    self%to_samples_plan = c_null_ptr
    self%to_coarse_plan = c_null_ptr
    self%to_coefficients_plan = c_null_ptr
  end subroutine destroy
end module attrito_contact_fourier
