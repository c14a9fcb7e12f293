!> Integrals of trigonometric functions over a set of intervals, and what they make of a series that acts on those only.
!>
!> With chi one on the set and zero elsewhere, e_m the functions 1, cos, sin, cos 2, sin 2, ..., the moments
!>
!> $$ c_p = \int \chi \cos p\theta \, d\theta, \qquad s_p = \int \chi \sin p\theta \, d\theta $$
!>
!> give the coefficients of chi x for a series x by products, cos m cos n = (cos(m - n) + cos(m + n))/2 and so on: a matrix whose
!> entries are moments of order m - n and m + n. Moments add up over intervals, so the matrix is written once a set.
module attrito_contact_moments
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_trigonometric, only: harmonics_at
  implicit none
  private
  public :: moments_type, new_moments, ends_type, new_ends

  !> Moments up to some order P
  type :: moments_type
    !> Of cosines, even in the order, and of sines, odd [-P:P]
    real(wp), allocatable :: c(:), s(:)
  contains
    procedure :: add
    procedure :: complete
    procedure :: add_column
    procedure :: add_product
    procedure :: weighted
    procedure :: write_matrix
  end type moments_type

  !> Antiderivatives sin(p theta)/p and -cos(p theta)/p at the ends of intervals that follow each other [0:P, 0:intervals]
  type :: ends_type
    real(wp), allocatable :: c(:, :), s(:, :)
  end type ends_type

contains

  !> No interval yet.
  pure function new_moments(order) result(self)
    !> Highest order, P
    integer, intent(in) :: order
    type(moments_type) :: self

    allocate (self%c(-order:order), self%s(-order:order), source=0.0_wp)
  end function new_moments

  !> Antiderivatives at the ends of intervals.
  pure function new_ends(theta, order) result(self)
    !> Ascending [0:intervals]
    real(wp), intent(in) :: theta(0:)
    !> Highest order, P
    integer, intent(in) :: order
    type(ends_type) :: self
    real(wp) :: cosines(order), sines(order), reciprocal(order)
    integer :: i, p

    reciprocal = [(1.0_wp/p, p=1, order)]
    allocate (self%c(0:order, 0:ubound(theta, 1)), self%s(0:order, 0:ubound(theta, 1)))
    do i = 0, ubound(theta, 1)
      call harmonics_at(theta(i), cosines, sines)
      self%c(0, i) = theta(i)
      self%s(0, i) = 0.0_wp
      self%c(1:, i) = reciprocal*sines
      self%s(1:, i) = -reciprocal*cosines
    end do
  end function new_ends

  !> One more interval, of orders 0 to P; `factor` -1 counts it negative.
  pure subroutine add(self, ends, interval, factor)
    class(moments_type), intent(inout) :: self
    !> Antiderivatives at the ends of intervals
    type(ends_type), intent(in) :: ends
    !> Number of the interval
    integer, intent(in) :: interval
    !> Factor on what is added
    real(wp), intent(in) :: factor
    integer :: p

    do p = 0, ubound(self%c, 1)
      self%c(p) = self%c(p) + factor*(ends%c(p, interval) - ends%c(p, interval - 1))
      self%s(p) = self%s(p) + factor*(ends%s(p, interval) - ends%s(p, interval - 1))
    end do
  end subroutine add

  !> Orders below zero, once all intervals are in.
  pure subroutine complete(self)
    class(moments_type), intent(inout) :: self
    integer :: p

    do p = 1, ubound(self%c, 1)
      self%c(-p) = self%c(p)
      self%s(-p) = -self%s(p)
    end do
  end subroutine complete

  !> y <- y + factor chi, in coefficients.
  pure subroutine add_column(self, factor, y)
    class(moments_type), intent(in) :: self
    !> Factor on what is added
    real(wp), intent(in) :: factor
    !> [any odd number up to 2 P + 1]
    real(wp), intent(inout) :: y(:)
    integer :: m

    y(1) = y(1) + factor/two_pi*self%c(0)
    do m = 1, (size(y) - 1)/2
      y(2*m) = y(2*m) + factor/pi*self%c(m)
      y(2*m + 1) = y(2*m + 1) + factor/pi*self%s(m)
    end do
  end subroutine add_column

  !> y <- y + factor chi x, in coefficients, of a completed set.
  pure subroutine add_product(self, x, factor, y)
    class(moments_type), intent(in) :: self
    !> [k], and [e]; (k + e)/2 <= P + 1
    real(wp), intent(in) :: x(:), factor
    !> Coefficients that are added to
    real(wp), intent(inout) :: y(:)
    real(wp) :: cosines(0:(size(y) - 1)/2), sines(0:(size(y) - 1)/2)
    integer :: m

    call weigh(self, x, cosines, sines)
    y(1) = y(1) + factor/two_pi*cosines(0)
    do m = 1, ubound(cosines, 1)
      y(2*m) = y(2*m) + factor/pi*cosines(m)
      y(2*m + 1) = y(2*m + 1) + factor/pi*sines(m)
    end do
  end subroutine add_product

  !> Moments of chi x, of a completed set, completed.
  pure function weighted(self, x, order) result(product)
    class(moments_type), intent(in) :: self
    !> Coefficients [k]
    real(wp), intent(in) :: x(:)
    !> Highest order, at most P - (k - 1)/2
    integer, intent(in) :: order
    type(moments_type) :: product

    product = new_moments(order)
    call weigh(self, x, product%c(0:), product%s(0:))
    call product%complete()
  end function weighted

  !> The same from order 0 on.
  pure subroutine weigh(self, x, cosines, sines)
    class(moments_type), intent(in) :: self
    !> Coefficients
    real(wp), intent(in) :: x(:)
    !> Moments
    real(wp), intent(out) :: cosines(0:), sines(0:)
    real(wp) :: a, b
    integer :: m, n

    do m = 0, ubound(cosines, 1)
      cosines(m) = x(1)*self%c(m)
      sines(m) = x(1)*self%s(m)
    end do
    do n = 1, (size(x) - 1)/2
      a = 0.5_wp*x(2*n)
      b = 0.5_wp*x(2*n + 1)
      do m = 0, ubound(cosines, 1)
        cosines(m) = cosines(m) + a*(self%c(m - n) + self%c(m + n)) + b*(self%s(m + n) - self%s(m - n))
        sines(m) = sines(m) + a*(self%s(m + n) + self%s(m - n)) + b*(self%c(m - n) - self%c(m + n))
      end do
    end do
  end subroutine weigh

  !> factor times the matrix that turns the coefficients of x into those of chi x, of a completed set.
  pure subroutine write_matrix(self, factor, matrix)
    class(moments_type), intent(in) :: self
    !> Factor on what is added
    real(wp), intent(in) :: factor
    !> [k, k], k <= P + 1
    real(wp), intent(out) :: matrix(:, :)
    real(wp) :: half
    integer :: m, n, last

    last = (size(matrix, 1) - 1)/2
    half = 0.5_wp*factor/pi
    matrix(:, 1) = 0.0_wp
    call self%add_column(factor, matrix(:, 1))
    do n = 1, last
      matrix(1, 2*n) = half*self%c(n)
      matrix(1, 2*n + 1) = half*self%s(n)
      do m = 1, last
        matrix(2*m, 2*n) = half*(self%c(m - n) + self%c(m + n))
        matrix(2*m + 1, 2*n) = half*(self%s(m + n) + self%s(m - n))
        matrix(2*m, 2*n + 1) = half*(self%s(m + n) - self%s(m - n))
        matrix(2*m + 1, 2*n + 1) = half*(self%c(m - n) - self%c(m + n))
      end do
    end do
  end subroutine write_matrix
end module attrito_contact_moments
