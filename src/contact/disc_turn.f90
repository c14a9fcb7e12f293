!> How the direction of slip turns in one step of a march, the displacement moving by d and the radius going linearly from a to b:
!>
!>   e' = (d - (d.e) e)/r,    e_b = e (1 + b conj e)/(1 + conj(b) e),    b = tanh(L/2) g/L,    g = d * int dt/r,    L = |g|,
!>
!> with directions as complex numbers: a tractrix, one step of a Riccati equation. (b = d/2r, its first term, is the return along the
!> mean of both directions.) Derivatives are made of what the turn itself was, for marches that ask for them.
!> Source: Moreau 1977, doi:10.1016/0022-0396(77)90085-7 (sweeping process); DESIGN: docs/explanation/load-path.md.
module attrito_contact_disc_turn
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: slip_type, turn_type, turn, turn_direction, differentiate_turn, across

  !> A step that ends on the rim, w = u - r e, and how the angle of e follows what the step is made of
  type :: slip_type
    real(wp) :: e(2) = 0.0_wp, radius = 0.0_wp
    !> By slider before, displacement at the start and end of the step, and radius at both
    real(wp) :: by_slider(2) = 0.0_wp, by_from(2) = 0.0_wp, by_to(2) = 0.0_wp, by_radii(2) = 0.0_wp
  end type slip_type

  !> A turn: e before and after it, g, L^2, tanh(L/2)/L, b, m = 1 + conj(b) e and 1/|m|^2; of the radii x = (b - a)/(b + a),
  !> artanh(x)/x, 1/(b + a) and int dt/r
  type :: turn_type
    complex(wp) :: before, after, g, b, m
    real(wp) :: square, scale, inverse_of_m, x, p, inverse_of_sum, rate
  end type turn_type

contains

  !> The direction after a turn, and its derivatives: of the derivatives of its angle, `by_slider` is left per angle of e, across it;
  !> `by_to` holds that by d, `by_radii` those by the radii at the onset and at the end.
  pure subroutine turn(e, d, part, r_onset, r_end, slip)
    !> Direction at the onset; change of the displacement in the whole step, and the part of it that turns e; radii
    real(wp), intent(in) :: e(2), d(2), part, r_onset, r_end
    !> Step that ends on the rim of the friction disc
    type(slip_type), intent(inout) :: slip
    type(turn_type) :: turned

    call turn_direction(e, d, part, r_onset, r_end, turned)
    slip%e = [turned%after%re, turned%after%im]
    call differentiate_turn(turned, r_onset, r_end, slip)
  end subroutine turn

  !> The direction of slip turns from e while u moves by part*d and the radius changes linearly.
  pure subroutine turn_direction(e, d, part, r_onset, r_end, turned)
    !> Direction at the onset; change of the displacement in the whole step, and the part of it that turns e; radii
    real(wp), intent(in) :: e(2), d(2), part, r_onset, r_end
    !> The turn
    type(turn_type), intent(out) :: turned

    associate (t => turned)
      t%inverse_of_sum = 1.0_wp/(r_onset + r_end)
      t%x = (r_end - r_onset)*t%inverse_of_sum
      t%p = artanh_ratio(t%x, r_onset, r_end)
      ! 1/r has the mean 2 p/(b + a).
      t%rate = (2.0_wp*part*t%inverse_of_sum)*t%p
      t%before = cmplx(e(1), e(2), wp)
      t%g = t%rate*cmplx(d(1), d(2), wp)
      t%square = t%g%re**2 + t%g%im**2
      t%scale = half_turn(t%square)
      t%b = t%scale*t%g
      t%m = 1.0_wp + conjg(t%b)*t%before
      t%inverse_of_m = 1.0_wp/max(t%m%re**2 + t%m%im**2, tiny(1.0_wp))
      t%after = (t%before*conjg(t%m)**2)*t%inverse_of_m
    end associate
  end subroutine turn_direction

  !> Derivatives of a turn, as `turn` says.
  pure subroutine differentiate_turn(turned, r_onset, r_end, slip)
    !> The turn, and its radii
    type(turn_type), intent(in) :: turned
    real(wp), intent(in) :: r_onset, r_end
    !> Step that ends on the rim of the friction disc, whose direction is known
    type(slip_type), intent(inout) :: slip
    complex(wp) :: by_b, by_g
    real(wp) :: p_slope

    associate (t => turned)
      ! d angle = kappa d angle_before + by_b.db, db = scale dg + scale_slope g (g.dg)
      by_b = cmplx(0.0_wp, 2.0_wp, wp)*t%before*conjg(t%m)*t%inverse_of_m
      by_g = t%scale*by_b + half_turn_slope(t%square, t%scale)*dot(by_b, t%g)*t%g
      slip%by_slider = -((1.0_wp - t%b%re**2 - t%b%im**2)*t%inverse_of_m)*across([t%before%re, t%before%im])
      slip%by_to = t%rate*[by_g%re, by_g%im]
      ! d log(p/(b + a)), p a function of x
      p_slope = artanh_ratio_slope(t%x, t%p, r_onset, r_end)/t%p
      slip%by_radii = -(dot(by_g, t%g)*t%inverse_of_sum)*[1.0_wp + p_slope*(1.0_wp + t%x), 1.0_wp - p_slope*(1.0_wp - t%x)]
    end associate
  end subroutine differentiate_turn

  !> artanh(x)/x, x = (b - a)/(b + a): (b - a)/log(b/a), one over the mean of 1/r where r goes linearly from a to b, is the
  !> arithmetic mean over this.
  pure real(wp) function artanh_ratio(x, a, b) result(p)
    !> x, and the numbers that it is made of
    real(wp), intent(in) :: x, a, b
    !> Series in x^2: below 0.01 the term after the last is 5e-20, below 1e-4 that after the first four 1e-17.
    real(wp), parameter :: c(0:8) = [1.0_wp, 1.0_wp/3.0_wp, 1.0_wp/5.0_wp, 1.0_wp/7.0_wp, 1.0_wp/9.0_wp, 1.0_wp/11.0_wp, & ! derived
                                     1.0_wp/13.0_wp, 1.0_wp/15.0_wp, 1.0_wp/17.0_wp]
    real(wp) :: y

    y = x**2
    if (y < 1.0e-4_wp) then
      p = c(0) + y*(c(1) + y*(c(2) + y*c(3)))
    else if (y < 0.01_wp) then
      p = c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*(c(4) + y*(c(5) + y*(c(6) + y*(c(7) + y*c(8))))))))
    else
      p = 0.5_wp*(log(b) - log(a))/x
    end if
  end function artanh_ratio

  !> Its derivative by x.
  pure real(wp) function artanh_ratio_slope(x, p, a, b) result(slope)
    !> x and the ratio, and the numbers that x is made of
    real(wp), intent(in) :: x, p, a, b
    !> Series in x^2: below 0.01 the term after the last is 1e-16, below 1e-4 that after the first five 1e-20.
    real(wp), parameter :: c(0:7) = [2.0_wp/3.0_wp, 4.0_wp/5.0_wp, 6.0_wp/7.0_wp, 8.0_wp/9.0_wp, 10.0_wp/11.0_wp, & ! derived
                                     12.0_wp/13.0_wp, 14.0_wp/15.0_wp, 16.0_wp/17.0_wp]
    real(wp) :: y

    y = x**2
    if (y < 1.0e-4_wp) then
      slope = x*(c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*c(4)))))
    else if (y < 0.01_wp) then
      slope = x*(c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*(c(4) + y*(c(5) + y*(c(6) + y*c(7))))))))
    else
      slope = (0.25_wp*(a + b)*(a + b)/(a*b) - p)/x
    end if
  end function artanh_ratio_slope

  !> tanh(L/2)/L from L^2.
  pure real(wp) function half_turn(square) result(scale)
    !> L squared
    real(wp), intent(in) :: square
    !> Series of tanh(x)/x in x^2: below x = 1/4 the term after the last is 1e-17, below x^2 = 5e-4 that after the first five 3e-19.
    real(wp), parameter :: c(0:9) = [1.0_wp, -1.0_wp/3.0_wp, 2.0_wp/15.0_wp, -17.0_wp/315.0_wp, 62.0_wp/2835.0_wp, & ! derived
                                     -1382.0_wp/155925.0_wp, 21844.0_wp/6081075.0_wp, -929569.0_wp/638512875.0_wp, &
                                     6404582.0_wp/10854718875.0_wp, -443861162.0_wp/1856156927625.0_wp]
    real(wp) :: y, x

    y = 0.25_wp*square
    if (y < 5.0e-4_wp) then
      scale = 0.5_wp*(c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*c(4)))))
    else if (y < 0.0625_wp) then
      scale = 0.5_wp*(c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*(c(4) + y*(c(5) + y*(c(6) + y*(c(7) + y*(c(8) + y*c(9))))))))))
    else
      x = sqrt(y)
      scale = 0.5_wp*tanh(x)/x
    end if
  end function half_turn

  !> Its derivative by L, divided by L.
  pure real(wp) function half_turn_slope(square, scale) result(slope)
    !> L squared, and tanh(L/2)/L
    real(wp), intent(in) :: square, scale
    !> Of the series: below x = 1/4 the term after the last is 1e-14, below x^2 = 5e-4 that after the first five 7e-19.
    real(wp), parameter :: c(0:8) = [-1.0_wp/3.0_wp, 4.0_wp/15.0_wp, -17.0_wp/105.0_wp, 248.0_wp/2835.0_wp, & ! derived
                                     -1382.0_wp/31185.0_wp, 43688.0_wp/2027025.0_wp, -929569.0_wp/91216125.0_wp, &
                                     51236656.0_wp/10854718875.0_wp, -443861162.0_wp/206239658625.0_wp]
    real(wp) :: y, ratio

    y = 0.25_wp*square
    if (y < 5.0e-4_wp) then
      slope = c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*c(4))))
    else if (y < 0.0625_wp) then
      slope = c(0) + y*(c(1) + y*(c(2) + y*(c(3) + y*(c(4) + y*(c(5) + y*(c(6) + y*(c(7) + y*c(8))))))))
    else
      ratio = 2.0_wp*scale
      slope = 0.5_wp*((1.0_wp - y*ratio**2) - ratio)/y
    end if
    slope = 0.25_wp*slope
  end function half_turn_slope

  !> A direction turned by a right angle.
  pure function across(e)
    !> Direction of slip at the beginning
    real(wp), intent(in) :: e(2)
    real(wp) :: across(2)

    across = [-e(2), e(1)]
  end function across

  !> Scalar product of plane vectors written as complex numbers.
  pure real(wp) function dot(a, b)
    !> Both vectors
    complex(wp), intent(in) :: a, b

    dot = a%re*b%re + a%im*b%im
  end function dot
end module attrito_contact_disc_turn
