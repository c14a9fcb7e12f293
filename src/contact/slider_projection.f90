!> Where a slider with two tangents comes to rest: the point nearest to where it was that every instant of the period holds,
!>
!> $$ w = \mathrm{proj}_C (w_0), \qquad C = \bigcap_j \{ w : |u_j - w| \le r_j \} $$
!>
!> With a motion that grows slowly from period to period C shrinks, and a slider on its rim is pushed along C's normal: Moreau's
!> sweeping process, of which this is the catching-up step. An empty C is a slider that slips for good. At most two discs hold the
!> answer; the most violated one enters until none is, the distance growing each time.
!> Source: Moreau 1977, doi:10.1016/0022-0396(77)90085-7.
module attrito_contact_slider_projection
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: slider_projection_type, project_slider, projection_gradient

  type :: slider_projection_type
    !> Is there any?
    logical :: exists = .false.
    !> The point, or if there is none the nearest in those discs that were taken in before one could not be
    real(wp) :: slider(2) = 0.0_wp
    !> Samples whose discs hold it there, and how many there are (0: it stays)
    integer :: holds(2) = 0, count = 0
  end type slider_projection_type

contains

  !> The nearest point to a slider in the discs of all samples.
  function project_slider(u, r, slider) result(nearest)
    !> Centres [J, 2] and radii [J]
    real(wp), intent(in) :: u(:, :), r(:), slider(2)
    type(slider_projection_type) :: nearest
    real(wp) :: rounding, beyond
    integer :: j, round
    logical :: held

    nearest%slider = slider
    if (any(r <= 0.0_wp)) return
    rounding = 1.0e-12_wp*maxval(r) + 8.0_wp*epsilon(1.0_wp)*maxval(abs(u))
    do round = 1, 4*size(r)
      call most_violated(u, r, nearest%slider, j, beyond)
      nearest%exists = beyond <= rounding
      if (nearest%exists) return
      call take_in(u, r, slider, j, rounding, nearest, held)
      if (.not. held) return
    end do
  end function project_slider

  !> The disc that a slider is farthest out of, and by how much.
  pure subroutine most_violated(u, r, w, j, beyond)
    !> Centres of the discs; radii of the discs; slider
    real(wp), intent(in) :: u(:, :), r(:), w(2)
    !> Number of the sample whose disc it is
    integer, intent(out) :: j
    !> How far the slider lies out of it
    real(wp), intent(out) :: beyond
    real(wp) :: out_of(size(r))

    out_of = sqrt((u(:, 1) - w(1))**2 + (u(:, 2) - w(2))**2) - r
    j = maxloc(out_of, 1)
    beyond = out_of(j)
  end subroutine most_violated

  !> The nearest point in the discs so far and another one, which holds it, if there is any.
  subroutine take_in(u, r, slider, j, rounding, nearest, held)
    !> Centres of the discs; radii of the discs; slider that is projected; distance that counts as none
    real(wp), intent(in) :: u(:, :), r(:), slider(2), rounding
    !> Number of the sample whose disc it is
    integer, intent(in) :: j
    !> Projection of the slider onto what all discs admit
    type(slider_projection_type), intent(inout) :: nearest
    !> Is the structure held?
    logical, intent(out) :: held
    type(slider_projection_type) :: best, trial
    real(wp) :: distance, least, corners(2, 2)
    integer :: i, side, known(3)
    logical :: meet

    known = [nearest%holds, j]
    least = huge(1.0_wp)
    best = nearest
    trial%holds = [j, 0]
    trial%count = 1
    trial%slider = pull(u(j, :), r(j), slider)
    call consider()
    do i = 1, nearest%count
      trial%holds = [nearest%holds(i), j]
      trial%count = 2
      call intersect(u(nearest%holds(i), :), r(nearest%holds(i)), u(j, :), r(j), corners, meet)
      if (.not. meet) cycle
      do side = 1, 2
        trial%slider = corners(:, side)
        call consider()
      end do
    end do
    held = least < huge(1.0_wp)
    nearest = best

  contains

    !> Keep the trial if all discs so far hold it and it is nearer than the best.
    subroutine consider()
      integer :: k

      do k = 1, 3
        if (known(k) == 0) cycle
        if (norm2(u(known(k), :) - trial%slider) > r(known(k)) + rounding) return
      end do
      distance = norm2(trial%slider - slider)
      if (distance >= least) return
      least = distance
      best = trial
    end subroutine consider
  end subroutine take_in

  !> The nearest point in one disc.
  pure function pull(centre, radius, slider) result(w)
    !> Centre of the disc; radius of the disc; slider that is projected
    real(wp), intent(in) :: centre(2), radius, slider(2)
    real(wp) :: w(2), distance

    distance = norm2(centre - slider)
    w = slider
    if (distance > radius) w = centre - radius*(centre - slider)/distance
  end function pull

  !> Where two circles meet, in columns.
  pure subroutine intersect(a, radius_a, b, radius_b, corners, meet)
    !> Centre of a circle; radius of the disc
    real(wp), intent(in) :: a(2), radius_a, b(2), radius_b
    !> Where the circles meet
    real(wp), intent(out) :: corners(2, 2)
    !> Do they meet?
    logical, intent(out) :: meet
    real(wp) :: along(2), distance, foot, half_chord

    corners = 0.0_wp
    distance = norm2(b - a)
    meet = distance <= radius_a + radius_b .and. distance >= abs(radius_a - radius_b) .and. distance > 0.0_wp
    if (.not. meet) return
    along = (b - a)/distance
    foot = 0.5_wp*(distance + (radius_a - radius_b)*(radius_a + radius_b)/distance)
    half_chord = sqrt(max((radius_a - foot)*(radius_a + foot), 0.0_wp))
    corners(:, 1) = a + foot*along + half_chord*[-along(2), along(1)]
    corners(:, 2) = a + foot*along - half_chord*[-along(2), along(1)]
  end subroutine intersect

  !> Its derivative by the coefficients of (u1, u2, v) [2, 3 k]:
  !> held by one disc, e from w to its centre, dw = (I - (r/|u - w_0|)(I - e e^T)) du - e dr; by two, e_i . dw = e_i . du_i - dr_i.
  function projection_gradient(nearest, u, r, basis, slope, slider) result(gradient)
    !> Projection of the slider onto what all discs admit
    type(slider_projection_type), intent(in) :: nearest
    !> Centres of the discs; radii of the discs
    real(wp), intent(in) :: u(:, :), r(:)
    !> Motion at the samples per unit coefficient [k, J], and dr/dv [J]
    real(wp), intent(in) :: basis(:, :), slope(:)
    !> Where it was
    real(wp), intent(in) :: slider(2)
    real(wp) :: gradient(2, 3*size(basis, 1))
    !> Sine of the angle between two discs' normals below which one of them holds it alone.
    real(wp), parameter :: parallel = 1.0e-6_wp ! derived
    real(wp) :: e(2, 2), columns(2, 2), across(2), determinant
    integer :: i, k

    k = size(basis, 1)
    gradient = 0.0_wp
    do i = 1, nearest%count
      e(:, i) = u(nearest%holds(i), :) - nearest%slider
      e(:, i) = e(:, i)/norm2(e(:, i))
    end do
    determinant = 0.0_wp
    if (nearest%count == 2) determinant = e(1, 1)*e(2, 2) - e(2, 1)*e(1, 2)
    if (abs(determinant) > parallel) then
      ! Columns of the inverse of the matrix with rows e_1, e_2.
      columns = reshape([e(2, 2), -e(1, 2), -e(2, 1), e(1, 1)], [2, 2])/determinant
      do i = 1, 2
        call add(columns(:, i), e(:, i), slope(nearest%holds(i)), basis(:, nearest%holds(i)))
      end do
    else if (nearest%count > 0) then
      i = nearest%count
      across = [-e(2, i), e(1, i)]
      call add(e(:, i), e(:, i), slope(nearest%holds(i)), basis(:, nearest%holds(i)))
      call add((1.0_wp - r(nearest%holds(i))/norm2(u(nearest%holds(i), :) - slider))*across, across, 0.0_wp, &
               basis(:, nearest%holds(i)))
    end if

  contains

    !> dw = column (row . du - slope dv) at one sample
    subroutine add(column, row, by_normal, at)
      !> Column of the product; row of the product; slope by the normal displacement; basis functions at the sample
      real(wp), intent(in) :: column(2), row(2), by_normal, at(:)
      integer :: a

      do a = 1, 2
        gradient(a, :k) = gradient(a, :k) + column(a)*row(1)*at
        gradient(a, k + 1:2*k) = gradient(a, k + 1:2*k) + column(a)*row(2)*at
        gradient(a, 2*k + 1:) = gradient(a, 2*k + 1:) - column(a)*by_normal*at
      end do
    end subroutine add
  end function projection_gradient
end module attrito_contact_slider_projection
