!> Elastic Coulomb slider in two directions under a varying normal force, exact for the polygon through the samples.
!>
!> $$ z = u - w, \qquad |z| \le r = \mu N / k_t, \qquad -\dot w \parallel z \text{ while } |z| = r, \qquad T = k_t z $$
!>
!> Between samples a and b, u and r are taken as linear, d = u_b - u_a. The slider sticks until |z| = r, a quadratic, and then
!> slips to the end of the step (d.e - r' only grows as the direction e = z/r turns towards d). Directions as complex numbers,
!>   e' = (d - (d.e) e)/r,    e_b = e (1 + b conj e)/(1 + conj(b) e),    b = tanh(L/2) g/L,    g = d * int dt/r,    L = |g|,
!> a tractrix: one step of a Riccati equation. (b = d/2r, its first term, is the return along the mean of both directions.)
!> A contact that lands at r = 0 slips along d at once, or sticks where it landed: w_b = u_b - r_b d/max(|d|, r_b - r_a).
!> The step is continuous in all of u, r and w, never parts two sliders (a sweeping process), and leaves O(J^-2) of the polygon.
!>
!> A place of slip's onset that moves changes nothing: direction turns alike before and after it. What the slider remembers of
!> its start shrinks across the direction of slip only by kappa r_b/|z| a step, so no finite number of periods is exact.
!> Source: Moreau 1977, doi:10.1016/0022-0396(77)90085-7 (sweeping process); DESIGN: docs/method.md.
module attrito_contact_friction_disc
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  implicit none
  private
  public :: slide_on_disc, slip_type, turn

  !> A step that ends on the rim, w = u - r e, and how the angle of e follows what the step is made of
  type :: slip_type
    real(wp) :: e(2) = 0.0_wp, radius = 0.0_wp
    !> By slider before, displacement at the start and end of the step, and radius at both
    real(wp) :: by_slider(2) = 0.0_wp, by_from(2) = 0.0_wp, by_to(2) = 0.0_wp, by_radii(2) = 0.0_wp
  end type slip_type

contains

  !> March one period, from the last sample to the last sample, and carry the slider's gradient with it.
  !>
  !> `gradient` holds d w / d p for parameters p: first those of the motion, then the two of the start slider.
  subroutine slide_on_disc(u, r, basis, slope, w, gradient, slider, gradients, regimes)
    !> Relative displacement [J, 2] and slip radius [J], negative by mu / k_t times what is missing to contact where open
    real(wp), intent(in) :: u(:, :), r(:)
    !> Gradient of any displacement by its own parameters [k, J], and of the radius by the normal one [J]
    real(wp), intent(in), contiguous :: basis(:, :)
    !> Slope of the slip radius by the normal force, or of a function
    real(wp), intent(in) :: slope(:)
    !> Slider at the start, then at the end [2]
    real(wp), intent(inout) :: w(2)
    !> Gradient of the slider [3 k + 2, 2] by (u1, u2, normal, start slider), at the start, then at the end
    real(wp), intent(inout), contiguous :: gradient(:, :)
    !> Slider after each sample [J, 2]
    real(wp), intent(out) :: slider(:, :)
    !> Its gradient [3 k + 2, 2, J]
    real(wp), intent(out), contiguous :: gradients(:, :, :)
    !> Regime at each sample [J]
    integer, intent(out) :: regimes(:)
    type(slip_type) :: slip
    logical :: entered
    integer :: j, last

    last = size(r)
    call enter_disc(u(last, :), r(last), w, slip, entered)
    if (entered) then
      gradients(:, :, last) = gradient
      call carry(slip, basis(:, last), basis(:, last), [slope(last), slope(last)], gradients(:, :, last), gradient)
    end if
    call advance(last, 1, gradient)
    if (entered .and. regimes(1) == regime_stick) regimes(1) = regime_slip
    do j = 2, last
      call advance(j - 1, j, gradients(:, :, j - 1))
    end do
    gradient = gradients(:, :, last)

  contains

    !> One step from sample a to sample b.
    subroutine advance(a, b, before)
      !> Number of the sample before, or a vector or end; number of the sample after, or a vector or end
      integer, intent(in) :: a, b
      !> Gradient at the beginning of the step
      real(wp), intent(in), contiguous :: before(:, :)
      real(wp) :: d(2)

      d = u(b, :) - u(a, :)
      if (r(b) <= 0.0_wp) then
        regimes(b) = regime_open
        w = u(b, :)
        call follow(basis(:, b), gradients(:, :, b))
      else if (r(a) <= 0.0_wp .and. length(d) <= r(b) - r(a)) then
        regimes(b) = regime_stick
        w = u(b, :) - (r(b)/(r(b) - r(a)))*d
        call land(d, r(a), r(b), basis(:, a), basis(:, b), [slope(a), slope(b)], gradients(:, :, b))
      else
        call slide(u(a, :), u(b, :), r(a), r(b), w, slip, regimes(b))
        if (regimes(b) == regime_slip) then
          call carry(slip, basis(:, a), basis(:, b), [slope(a), slope(b)], before, gradients(:, :, b))
        else
          gradients(:, :, b) = before
        end if
      end if
      slider(b, :) = w
    end subroutine advance
  end subroutine slide_on_disc

  !> How far outside its disc a slider lies by rounding: that is no slip.
  pure real(wp) function rounding(u, r)
    !> Tangential displacement; slip radius at the beginning
    real(wp), intent(in) :: u(2), r

    rounding = 4.0_wp*epsilon(1.0_wp)*(abs(u(1)) + abs(u(2)) + r)
  end function rounding

  !> A slider that starts outside its disc is taken to the nearest place in it.
  pure subroutine enter_disc(u, r, w, slip, entered)
    !> Tangential displacement; slip radius at the beginning
    real(wp), intent(in) :: u(2), r
    !> Slider
    real(wp), intent(inout) :: w(2)
    !> Step that ends on the rim of the friction disc
    type(slip_type), intent(out) :: slip
    !> Was the slider outside its disc?
    logical, intent(out) :: entered
    real(wp) :: distance

    distance = length(u - w)
    entered = r > 0.0_wp .and. distance > r + rounding(u, r)
    if (.not. entered) return
    slip%e = (u - w)/distance
    slip%radius = r
    slip%by_to = across(slip%e)/distance
    slip%by_slider = -slip%by_to
    w = u - r*slip%e
  end subroutine enter_disc

  !> Stick, then slip, from u_a to u_b while r goes from r_a to r_b > 0; r_a <= 0 lands, and fast enough to slip at once.
  pure subroutine slide(u_a, u_b, r_a, r_b, w, slip, regime)
    real(wp), intent(in) :: u_a(2), u_b(2), r_a, r_b
    !> Slider
    real(wp), intent(inout) :: w(2)
    !> Step that ends on the rim of the friction disc
    type(slip_type), intent(out) :: slip
    !> Regime: stick, slip or open
    integer, intent(out) :: regime
    real(wp) :: d(2), z(2), onset, distance, r_onset, part

    regime = regime_slip
    d = u_b - u_a
    slip%radius = r_b
    if (r_a <= 0.0_wp) then
      distance = length(d)
      slip%e = d/distance
      slip%by_to = across(slip%e)/distance
      slip%by_from = -slip%by_to
    else if (length(u_b - w) <= r_b + rounding(u_b, r_b)) then
      ! Inside at both ends: inside all the way, |z| - r being convex.
      regime = regime_stick
      return
    else
      onset = slip_onset(u_a - w, d, r_a, r_b - r_a)
      part = 1.0_wp - onset
      r_onset = r_a + onset*(r_b - r_a)
      z = u_a - w + onset*d
      distance = length(z)
      call turn(z/distance, d, part, r_onset, r_b, slip)
      slip%by_radii = [part*slip%by_radii(1), onset*slip%by_radii(1) + slip%by_radii(2)]
      slip%by_slider = slip%by_slider/distance
      slip%by_to = slip%by_to - onset*slip%by_slider
      slip%by_from = -slip%by_slider - slip%by_to
    end if
    w = u_b - r_b*slip%e
  end subroutine slide

  !> Part of the step, from 0 to 1, after which |z + t d| = r + t dr: from inside (or on the rim) to outside.
  pure real(wp) function slip_onset(z, d, r, dr)
    real(wp), intent(in) :: z(2), d(2), r, dr
    real(wp) :: a, b, c, root

    a = dot_product(d, d) - dr**2
    b = dot_product(z, d) - r*dr
    c = min(dot_product(z, z) - r**2, 0.0_wp)
    root = sqrt(max(b**2 - a*c, 0.0_wp))
    if (b >= 0.0_wp) then
      slip_onset = -c/max(b + root, tiny(b))
    else
      slip_onset = (root - b)/max(a, tiny(a))
    end if
    slip_onset = min(max(slip_onset, 0.0_wp), 1.0_wp)
  end function slip_onset

  !> The direction of slip turns from e while u moves by part*d and the radius changes linearly.
  !>
  !> Of the derivatives of its angle, `by_slider` is left per angle of e, across it; `by_to` holds that by d, `by_radii` those by the
  !> radii at the onset and at the end.
  pure subroutine turn(e, d, part, r_onset, r_end, slip)
    real(wp), intent(in) :: e(2), d(2), part, r_onset, r_end
    !> Step that ends on the rim of the friction disc
    type(slip_type), intent(inout) :: slip
    complex(wp) :: before, g, b, m, after, by_b, by_g
    real(wp) :: mean, by_radii(2), scale, scale_slope, square, rate

    call logarithmic_mean(r_onset, r_end, mean, by_radii)
    rate = part/mean
    before = cmplx(e(1), e(2), wp)
    g = rate*cmplx(d(1), d(2), wp)
    call half_turn(g%re**2 + g%im**2, scale, scale_slope)
    b = scale*g
    m = 1.0_wp + conjg(b)*before
    square = max(m%re**2 + m%im**2, tiny(square))
    after = before*conjg(m)**2/square
    ! d angle = kappa d angle_before + by_b.db, db = scale dg + scale_slope g (g.dg)
    by_b = cmplx(0.0_wp, 2.0_wp, wp)*before*conjg(m)/square
    by_g = scale*by_b + scale_slope*dot(by_b, g)*g
    slip%e = [after%re, after%im]
    slip%by_slider = -((1.0_wp - b%re**2 - b%im**2)/square)*across(e)
    slip%by_to = rate*[by_g%re, by_g%im]
    slip%by_radii = -(dot(by_g, g)/mean)*by_radii
  end subroutine turn

  !> tanh(L/2)/L, and its derivative by L divided by L, from L^2.
  pure subroutine half_turn(square, scale, slope)
    !> L squared
    real(wp), intent(in) :: square
    !> tanh(L/2)/L; slope of the slip radius by the normal force, or of a function
    real(wp), intent(out) :: scale, slope
    !> Series of tanh(x)/x in x^2: below x = 1/4 the term after the last is 1e-17.
    real(wp), parameter :: c(0:9) = [1.0_wp, -1.0_wp/3.0_wp, 2.0_wp/15.0_wp, -17.0_wp/315.0_wp, 62.0_wp/2835.0_wp, & ! derived
                                     -1382.0_wp/155925.0_wp, 21844.0_wp/6081075.0_wp, -929569.0_wp/638512875.0_wp, &
                                     6404582.0_wp/10854718875.0_wp, -443861162.0_wp/1856156927625.0_wp]
    real(wp) :: y, s, s_slope, x
    integer :: i

    y = 0.25_wp*square
    if (y < 0.0625_wp) then
      s = c(9)
      s_slope = 0.0_wp
      do i = 8, 0, -1
        s_slope = s_slope*y + s
        s = s*y + c(i)
      end do
    else
      x = sqrt(y)
      s = tanh(x)
      s_slope = 0.5_wp*((1.0_wp - s**2) - s/x)/y
      s = s/x
    end if
    scale = 0.5_wp*s
    slope = 0.25_wp*s_slope
  end subroutine half_turn

  !> (b - a)/log(b/a), one over the mean of 1/r where r goes linearly from a to b, with its derivatives by both.
  pure subroutine logarithmic_mean(a, b, mean, by)
    !> Number of the sample before, or a vector or end; number of the sample after, or a vector or end
    real(wp), intent(in) :: a, b
    !> Logarithmic mean; its derivatives by both
    real(wp), intent(out) :: mean, by(2)
    real(wp) :: x, y, p, p_slope
    integer :: i

    ! p = artanh(x)/x, a series in x^2 where it is below 0.01
    x = (b - a)/(b + a)
    y = x**2
    if (y < 0.01_wp) then
      p = 1.0_wp/17.0_wp
      p_slope = 16.0_wp/17.0_wp
      do i = 7, 1, -1
        p = p*y + 1.0_wp/(2*i + 1)
        p_slope = p_slope*y + 2.0_wp*i/(2*i + 1)
      end do
      p = p*y + 1.0_wp
      p_slope = p_slope*x
    else
      p = 0.5_wp*(log(b) - log(a))/x
      p_slope = (0.25_wp*(a + b)*(a + b)/(a*b) - p)/x
    end if
    mean = 0.5_wp*(a + b)/p
    by = 0.5_wp*[1.0_wp + p_slope*(1.0_wp + x)/p, 1.0_wp - p_slope*(1.0_wp - x)/p]/p
  end subroutine logarithmic_mean

  !> Gradient where the slider lies on the rim: dw = du - e dr - r d angle across e.
  pure subroutine carry(slip, from, to, slope, before, after)
    !> Step that ends on the rim of the friction disc
    type(slip_type), intent(in) :: slip
    !> Gradients of displacement at both ends of the step [k]
    real(wp), intent(in), contiguous :: from(:), to(:)
    !> Gradient of the radius by the normal displacement at both ends
    real(wp), intent(in) :: slope(2)
    !> Gradients of the slider [3 k + 2, 2]
    real(wp), intent(in), contiguous :: before(:, :)
    !> Gradient at the end of the step
    real(wp), intent(out), contiguous :: after(:, :)
    real(wp) :: angle, p(2), s(2), c(2), e(2)
    integer :: i, k

    k = size(from)
    p = slip%by_slider
    c = -slip%radius*across(slip%e)
    ! One pass a block of parameters: how the angle follows each, then the slider.
    do i = 1, k
      angle = p(1)*before(i, 1) + p(2)*before(i, 2) + slip%by_from(1)*from(i) + slip%by_to(1)*to(i)
      after(i, 1) = c(1)*angle + to(i)
      after(i, 2) = c(2)*angle
    end do
    do i = 1, k
      angle = p(1)*before(k + i, 1) + p(2)*before(k + i, 2) + slip%by_from(2)*from(i) + slip%by_to(2)*to(i)
      after(k + i, 1) = c(1)*angle
      after(k + i, 2) = c(2)*angle + to(i)
    end do
    s = slope*slip%by_radii
    e = slope(2)*slip%e
    do i = 1, k
      angle = p(1)*before(2*k + i, 1) + p(2)*before(2*k + i, 2) + s(1)*from(i) + s(2)*to(i)
      after(2*k + i, 1) = c(1)*angle - e(1)*to(i)
      after(2*k + i, 2) = c(2)*angle - e(2)*to(i)
    end do
    do i = 3*k + 1, size(before, 1)
      angle = p(1)*before(i, 1) + p(2)*before(i, 2)
      after(i, 1) = c(1)*angle
      after(i, 2) = c(2)*angle
    end do
  end subroutine carry

  !> Gradient where the slider is where the contact landed, t = -r_a/(r_b - r_a): dw = du(t) - d dr(t)/(r_b - r_a). Where the slope is
  !> the same at both ends its difference adds zeros.
  pure subroutine land(d, r_a, r_b, from, to, slope, gradient)
    !> The step of the displacement, radii and their gradients by the normal displacement at both ends
    real(wp), intent(in) :: d(2), r_a, r_b, slope(2)
    !> Gradient of the displacement at the beginning of the step; gradient of the displacement at the end of the step
    real(wp), intent(in), contiguous :: from(:), to(:)
    !> Gradient of the slider
    real(wp), intent(out), contiguous :: gradient(:, :)
    real(wp) :: there(size(from))
    integer :: i, k

    k = size(from)
    there = (r_b*from - r_a*to)/(r_b - r_a)
    call follow(there, gradient)
    do i = 1, 2
      gradient(2*k + 1:3*k, i) = -(slope(2)*d(i)/(r_b - r_a))*there - ((slope(1) - slope(2))*d(i)*r_b/(r_b - r_a)**2)*from
    end do
  end subroutine land

  !> Gradient where the slider goes with the displacement.
  pure subroutine follow(displacement, gradient)
    !> Gradient of the displacement
    real(wp), intent(in), contiguous :: displacement(:)
    !> Gradient of the slider
    real(wp), intent(out), contiguous :: gradient(:, :)
    integer :: k

    k = size(displacement)
    gradient = 0.0_wp
    gradient(1:k, 1) = displacement
    gradient(k + 1:2*k, 2) = displacement
  end subroutine follow

  !> Of a plane vector.
  pure real(wp) function length(a)
    !> Number of the sample before, or a vector or end
    real(wp), intent(in) :: a(2)

    length = sqrt(a(1)**2 + a(2)**2)
  end function length

  !> A direction turned by a right angle.
  pure function across(e)
    !> Direction of slip at the beginning
    real(wp), intent(in) :: e(2)
    real(wp) :: across(2)

    across = [-e(2), e(1)]
  end function across

  !> Scalar product of plane vectors written as complex numbers.
  pure real(wp) function dot(a, b)
    !> Number of the sample before, or a vector or end; number of the sample after, or a vector or end
    complex(wp), intent(in) :: a, b

    dot = a%re*b%re + a%im*b%im
  end function dot
end module attrito_contact_friction_disc
