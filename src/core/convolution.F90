!> Products of periodic functions by their Fourier coefficients, by FFTW:
!>
!> $$ (f u)_k = \sum_{j = -K}^{K} f_{k - j} u_j, \qquad k = -K \ldots K $$
!>
!> exactly, with f's coefficients to 2 K: the transforms are long enough that nothing comes round.
!> Source: Frigo & Johnson 2005, doi:10.1109/JPROC.2004.840301.
module attrito_core_convolution
  use, intrinsic :: iso_c_binding
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: convolution_type, new_convolution

  include 'fftw3.f03'

  type :: convolution_type
    !> K, and the length of the transforms, the power of 2 from 4 K + 1
    integer :: harmonics = 0, length = 0
    type(c_ptr), private :: forward = c_null_ptr, back = c_null_ptr
  contains
    procedure :: transform
    procedure :: transform_back
    procedure :: destroy
  end type convolution_type

contains

  !> Of functions with harmonics to K.
  function new_convolution(harmonics) result(self)
    !> K
    integer, intent(in) :: harmonics
    type(convolution_type) :: self
    complex(c_double_complex), allocatable :: x(:), y(:)

    self%harmonics = harmonics
    self%length = 1
    do while (self%length < 4*harmonics + 1)
      self%length = 2*self%length
    end do
    allocate (x(self%length), y(self%length))
    self%forward = fftw_plan_dft_1d(self%length, x, y, FFTW_FORWARD, ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
    self%back = fftw_plan_dft_1d(self%length, x, y, FFTW_BACKWARD, ior(FFTW_ESTIMATE, FFTW_UNALIGNED))
  end function new_convolution

  !> Of coefficients -L ... L, L at most 2 K: a product of transforms is that of the functions.
  function transform(self, coefficients) result(transformed)
    class(convolution_type), intent(in) :: self
    !> [2 L + 1]
    complex(wp), intent(in) :: coefficients(:)
    complex(wp), allocatable :: transformed(:)
    complex(c_double_complex), allocatable :: around(:)
    integer :: l

    l = size(coefficients)/2
    allocate (around(self%length), source=(0.0_wp, 0.0_wp))
    around(:l + 1) = coefficients(l + 1:)
    around(self%length - l + 1:) = coefficients(:l)
    allocate (transformed(self%length))
    call fftw_execute_dft(self%forward, around, transformed)
  end function transform

  !> Coefficients -K ... K of a transform [2 K + 1].
  function transform_back(self, transformed) result(coefficients)
    class(convolution_type), intent(in) :: self
    !> [length]
    complex(wp), intent(in) :: transformed(:)
    complex(wp), allocatable :: coefficients(:)
    complex(c_double_complex), allocatable :: input(:), around(:)

    input = transformed
    allocate (around(self%length))
    call fftw_execute_dft(self%back, input, around)
    coefficients = [around(self%length - self%harmonics + 1:), around(:self%harmonics + 1)]/self%length
  end function transform_back

  !> Give FFTW's plans back.
  subroutine destroy(self)
    class(convolution_type), intent(inout) :: self

    if (c_associated(self%forward)) call fftw_destroy_plan(self%forward)
    if (c_associated(self%back)) call fftw_destroy_plan(self%back)
    self%forward = c_null_ptr
    self%back = c_null_ptr
  end subroutine destroy
end module attrito_core_convolution
