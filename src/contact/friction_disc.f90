!> Elastic Coulomb slider in two directions under a varying normal force, exact for the polygon through the samples.
!>
!> $$ z = u - w, \qquad |z| \le r = \mu N / k_t, \qquad -\dot w \parallel z \text{ while } |z| = r, \qquad T = k_t z $$
!>
!> Between samples a and b, u and r are taken as linear, d = u_b - u_a. The slider sticks until |z| = r, a quadratic, and then
!> slips to the end of the step (d.e - r' only grows as the direction e = z/r turns towards d, `attrito_contact_disc_turn`).
!> A contact that lands at r = 0 slips along d at once, or sticks where it landed: w_b = u_b - r_b d/max(|d|, r_b - r_a).
!> The step is continuous in all of u, r and w, never parts two sliders (a sweeping process), and leaves O(J^-2) of the polygon.
!>
!> A place of slip's onset that moves changes nothing: direction turns alike before and after it. What the slider remembers of
!> its start shrinks across the direction of slip only by kappa r_b/|z| a step, so no finite number of periods is exact.
!> Source: Moreau 1977, doi:10.1016/0022-0396(77)90085-7 (sweeping process); DESIGN: docs/explanation/load-path.md.
module attrito_contact_friction_disc
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_turn, only: slip_type, turn_type, turn_direction, differentiate_turn, across
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  implicit none
  private
  public :: differentiate_slide_on_disc, set_out_type

  !> Where a period begins: displacement and radius, and their gradients, as at samples
  type :: set_out_type
    real(wp) :: u(2) = 0.0_wp, r = 0.0_wp, slope = 0.0_wp
    real(wp), allocatable :: basis(:)
  end type set_out_type

  !> A step that ends on the rim, as the next one and derivatives need it: is the slider on the rim, in the direction that is known,
  !> did it begin where the contact lands, at what part of it did slip begin, with which radius and how far from the slider, and how
  !> did it turn
  type :: step_type
    logical :: on_rim = .false., lands = .false.
    real(wp) :: onset = 0.0_wp, r_onset = 0.0_wp, distance = 0.0_wp
    type(turn_type) :: turned
  end type step_type

contains

  !> March one period, from the last sample, or from elsewhere, to the last sample. The slider's gradient d w / d p is carried with
  !> it, for parameters p: first those of the motion, then the start slider's.
  subroutine differentiate_slide_on_disc(u, r, basis, slope, w, gradient, slider, gradients, regimes, from)
    !> Relative displacement [J, 2] and slip radius [J], negative by mu / k_t times what is missing to contact where open
    real(wp), intent(in) :: u(:, :), r(:)
    !> Gradient of any displacement by its own parameters [k, J], and of the radius by the normal one [J]
    real(wp), intent(in), contiguous :: basis(:, :)
    !> Slope of the slip radius by the normal displacement
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
    !> Where the period begins; the last sample unless given
    type(set_out_type), intent(in), optional :: from
    type(set_out_type) :: first
    type(slip_type) :: slip
    type(step_type) :: step
    logical :: entered
    integer :: j, last

    last = size(r)
    if (present(from)) then
      first = from
    else
      first = set_out_type(u(last, :), r(last), slope(last), basis(:, last))
    end if
    call enter_disc(first%u, first%r, w, slip, entered)
    step%on_rim = entered
    if (entered) then
      gradients(:, :, last) = gradient
      call carry(slip, first%basis, first%basis, [first%slope, first%slope], gradients(:, :, last), gradient)
    end if
    call advance_with_gradient(first%u, first%r, first%slope, first%basis, 1, gradient)
    if (entered .and. regimes(1) == regime_stick) regimes(1) = regime_slip
    do j = 2, last
      call advance_with_gradient(u(j - 1, :), r(j - 1), slope(j - 1), basis(:, j - 1), j, gradients(:, :, j - 1))
    end do
    gradient = gradients(:, :, last)

  contains

    !> One step to sample b.
    subroutine advance_with_gradient(u_a, r_a, slope_a, basis_a, b, before)
      !> Where it begins: displacement, radius and its slope, and their gradient by coefficients
      real(wp), intent(in) :: u_a(2), r_a, slope_a
      real(wp), intent(in), contiguous :: basis_a(:)
      !> Number of the sample
      integer, intent(in) :: b
      !> Gradient at the beginning of the step
      real(wp), intent(in), contiguous :: before(:, :)

      call advance(u_a, u(b, :), r_a, r(b), w, slip, step, regimes(b))
      slider(b, :) = w
      select case (regimes(b))
       case (regime_open)
        call follow(basis(:, b), gradients(:, :, b))
       case (regime_slip)
        call differentiate_slide(r(b), step, slip)
        call carry(slip, basis_a, basis(:, b), [slope_a, slope(b)], before, gradients(:, :, b))
       case default
        if (r_a <= 0.0_wp) then
          call land(u(b, :) - u_a, r_a, r(b), basis_a, basis(:, b), [slope_a, slope(b)], gradients(:, :, b))
        else
          gradients(:, :, b) = before
        end if
      end select
    end subroutine advance_with_gradient
  end subroutine differentiate_slide_on_disc

  !> One step: open at its end, landed within it and stuck where that was, or stick and slip.
  pure subroutine advance(u_a, u_b, r_a, r_b, w, slip, step, regime)
    !> Displacement and radius at both ends
    real(wp), intent(in) :: u_a(2), u_b(2), r_a, r_b
    !> Slider
    real(wp), intent(inout) :: w(2)
    !> Step that ends on the rim of the friction disc, without derivatives, and what these are made of
    type(slip_type), intent(inout) :: slip
    type(step_type), intent(inout) :: step
    !> Regime at the end: stick, slip or open
    integer, intent(out) :: regime
    real(wp) :: d(2)

    if (r_b <= 0.0_wp) then
      regime = regime_open
      step%on_rim = .false.
      w = u_b
      return
    end if
    if (r_a <= 0.0_wp) then
      d = u_b - u_a
      if (length(d) <= r_b - r_a) then
        regime = regime_stick
        step%on_rim = .false.
        w = u_b - (r_b/(r_b - r_a))*d
        return
      end if
    end if
    call slide(u_a, u_b, r_a, r_b, w, slip, step, regime)
  end subroutine advance

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
  pure subroutine slide(u_a, u_b, r_a, r_b, w, slip, step, regime)
    !> Displacement and radius at both ends
    real(wp), intent(in) :: u_a(2), u_b(2), r_a, r_b
    !> Slider
    real(wp), intent(inout) :: w(2)
    !> Step that ends on the rim of the friction disc, without derivatives, and what these are made of
    type(slip_type), intent(inout) :: slip
    type(step_type), intent(inout) :: step
    !> Regime: stick, slip or open
    integer, intent(out) :: regime
    real(wp) :: d(2), z(2)

    d = u_b - u_a
    step%lands = r_a <= 0.0_wp
    if (step%lands) then
      step%distance = length(d)
      slip%e = d/step%distance
    else if (goes_on(d, u_b, r_a, r_b, slip, step)) then
      step%onset = 0.0_wp
      step%r_onset = r_a
      step%distance = r_a
      call turn_direction(slip%e, d, 1.0_wp, r_a, r_b, step%turned)
      slip%e = [step%turned%after%re, step%turned%after%im]
    else if (length(u_b - w) <= r_b + rounding(u_b, r_b)) then
      ! Inside at both ends: inside all the way, |z| - r being convex.
      regime = regime_stick
      step%on_rim = .false.
      return
    else
      step%onset = slip_onset(u_a - w, d, r_a, r_b - r_a)
      step%r_onset = r_a + step%onset*(r_b - r_a)
      z = u_a - w + step%onset*d
      step%distance = length(z)
      call turn_direction(z/step%distance, d, 1.0_wp - step%onset, step%r_onset, r_b, step%turned)
      slip%e = [step%turned%after%re, step%turned%after%im]
    end if
    regime = regime_slip
    step%on_rim = .true.
    slip%radius = r_b
    w = u_b - r_b*slip%e
  end subroutine slide

  !> Does slip go on from the step before? The slider is on the rim and |z| - r grows, from the first and for good, being convex. Most
  !> steps of a contact that slips are such: neither an onset nor a direction is to be found.
  pure logical function goes_on(d, u_b, r_a, r_b, slip, step)
    !> The step of the displacement, and where it ends; radii at both ends
    real(wp), intent(in) :: d(2), u_b(2), r_a, r_b
    !> The step before
    type(slip_type), intent(in) :: slip
    type(step_type), intent(in) :: step

    goes_on = .false.
    if (step%on_rim) goes_on = slip%e(1)*d(1) + slip%e(2)*d(2) - (r_b - r_a) > rounding(u_b, r_b)
  end function goes_on

  !> Derivatives of the direction in which a step ends on the rim.
  pure subroutine differentiate_slide(r_b, step, slip)
    !> Radius at its end
    real(wp), intent(in) :: r_b
    !> What it was
    type(step_type), intent(in) :: step
    !> Step that ends on the rim of the friction disc
    type(slip_type), intent(inout) :: slip

    if (step%lands) then
      slip%by_to = across(slip%e)/step%distance
      slip%by_from = -slip%by_to
      slip%by_slider = 0.0_wp
      slip%by_radii = 0.0_wp
      return
    end if
    call differentiate_turn(step%turned, step%r_onset, r_b, slip)
    slip%by_radii = [(1.0_wp - step%onset)*slip%by_radii(1), step%onset*slip%by_radii(1) + slip%by_radii(2)]
    slip%by_slider = slip%by_slider/step%distance
    slip%by_to = slip%by_to - step%onset*slip%by_slider
    slip%by_from = -slip%by_slider - slip%by_to
  end subroutine differentiate_slide

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
end module attrito_contact_friction_disc
