!> Hyper-dual numbers: a value with its derivatives along two directions, and the second one along both,
!>
!> $$ a = a_0 + a_t \epsilon_1 + a_x \epsilon_2 + a_{tx} \epsilon_1 \epsilon_2, \qquad \epsilon_1^2 = \epsilon_2^2 = 0 $$
!>
!> What is computed of them has derivatives that are exact. An equation is solved by Newton's method with the inverse of the value
!> alone: where that is solved, one step more gives first derivatives, another one the second.
!> Source: Fike & Alonso 2011, doi:10.2514/6.2011-886.
module attrito_core_hyperdual
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: hyperdual_type, function_of, angle_of, cosine_of, sine_of, newton_step, multiplied
  public :: operator(+), operator(-), operator(*)

  type :: hyperdual_type
    !> Value, derivatives along t and x, and along both
    real(wp) :: value = 0.0_wp, t = 0.0_wp, x = 0.0_wp, tx = 0.0_wp
  end type hyperdual_type

  interface operator(+)
    module procedure sum_of
  end interface

  interface operator(-)
    module procedure difference_of
  end interface

  interface operator(*)
    module procedure product_of, multiple_of
  end interface

contains

  elemental function sum_of(a, b) result(c)
    !> Terms
    type(hyperdual_type), intent(in) :: a, b
    type(hyperdual_type) :: c

    c = hyperdual_type(a%value + b%value, a%t + b%t, a%x + b%x, a%tx + b%tx)
  end function sum_of

  elemental function difference_of(a, b) result(c)
    !> Terms
    type(hyperdual_type), intent(in) :: a, b
    type(hyperdual_type) :: c

    c = hyperdual_type(a%value - b%value, a%t - b%t, a%x - b%x, a%tx - b%tx)
  end function difference_of

  elemental function product_of(a, b) result(c)
    !> Factors
    type(hyperdual_type), intent(in) :: a, b
    type(hyperdual_type) :: c

    c = hyperdual_type(a%value*b%value, a%value*b%t + a%t*b%value, a%value*b%x + a%x*b%value, &
                       a%value*b%tx + a%t*b%x + a%x*b%t + a%tx*b%value)
  end function product_of

  elemental function multiple_of(a, b) result(c)
    !> Factors
    real(wp), intent(in) :: a
    type(hyperdual_type), intent(in) :: b
    type(hyperdual_type) :: c

    c = hyperdual_type(a*b%value, a*b%t, a*b%x, a*b%tx)
  end function multiple_of

  !> f(a), given f and its first two derivatives at the value of a.
  elemental function function_of(a, f, first, second) result(c)
    !> Argument
    type(hyperdual_type), intent(in) :: a
    !> f, f' and f''
    real(wp), intent(in) :: f, first, second
    type(hyperdual_type) :: c

    c = hyperdual_type(f, first*a%t, first*a%x, first*a%tx + second*a%t*a%x)
  end function function_of

  !> Angle of a vector, up to whole turns that of its value.
  elemental function angle_of(a, b) result(angle)
    !> Components
    type(hyperdual_type), intent(in) :: a, b
    type(hyperdual_type) :: angle
    real(wp) :: square, along_t, along_x, across_t, across_x

    ! In logarithms, log(a + i b)' = z'/z, z'/z = along + i across: (log z)_tx = z_tx/z - z_t z_x/z^2.
    square = a%value**2 + b%value**2
    along_t = (a%value*a%t + b%value*b%t)/square
    along_x = (a%value*a%x + b%value*b%x)/square
    across_t = (a%value*b%t - b%value*a%t)/square
    across_x = (a%value*b%x - b%value*a%x)/square
    angle = hyperdual_type(atan2(b%value, a%value), across_t, across_x, &
                           (a%value*b%tx - b%value*a%tx)/square - along_t*across_x - across_t*along_x)
  end function angle_of

  elemental function cosine_of(a) result(cosine)
    !> Angle
    type(hyperdual_type), intent(in) :: a
    type(hyperdual_type) :: cosine

    cosine = function_of(a, cos(a%value), -sin(a%value), -cos(a%value))
  end function cosine_of

  elemental function sine_of(a) result(sine)
    !> Angle
    type(hyperdual_type), intent(in) :: a
    type(hyperdual_type) :: sine

    sine = function_of(a, sin(a%value), cos(a%value), -sin(a%value))
  end function sine_of

  !> Step -f/f' of Newton's method for what the value solves already; none where f' vanishes: the root does not move then.
  elemental function newton_step(f, rate) result(step)
    !> Of the equation; its derivative
    type(hyperdual_type), intent(in) :: f
    real(wp), intent(in) :: rate
    type(hyperdual_type) :: step

    step = hyperdual_type()
    if (abs(rate) > 0.0_wp) step = hyperdual_type(0.0_wp, -f%t/rate, -f%x/rate, -f%tx/rate)
  end function newton_step

  !> A x for a matrix of plain numbers.
  pure function multiplied(matrix, x) result(y)
    !> [m, n]
    real(wp), intent(in) :: matrix(:, :)
    !> [n]
    type(hyperdual_type), intent(in) :: x(:)
    type(hyperdual_type) :: y(size(matrix, 1))

    real(wp) :: parts(4, size(matrix, 2)), sums(4)
    integer :: i, j

    do j = 1, size(x)
      parts(:, j) = [x(j)%value, x(j)%t, x(j)%x, x(j)%tx]
    end do
    do i = 1, size(y)
      sums = 0.0_wp
      do j = 1, size(x)
        sums = sums + matrix(i, j)*parts(:, j)
      end do
      y(i) = hyperdual_type(sums(1), sums(2), sums(3), sums(4))
    end do
  end function multiplied
end module attrito_core_hyperdual
