!> The oracle: the multi-harmonic balance of all coordinates, nothing condensed, no reference state, every force by its plain law.
!>
!> $$ [K - (h \omega)^2 M + i h \omega C + i \eta K \, [h > 0]] \, q_h + (B^T \lambda)_h = f_h, \qquad h = 0 \ldots H $$
!>
!> It shares nothing with the solver but the types that describe the scene: sines and cosines are summed one by one, the law is
!> written as stick, slip and lift-off, and the Jacobian is a difference.
module uncondensed
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: solve_dense
  use attrito_model_contacts, only: contact_type
  use attrito_model_structure, only: damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use scenes, only: scene_type, damp_as_modes_ratio
  implicit none
  private
  public :: residual_of, solve_uncondensed, periodic_forces

contains

  !> Residual [2 H + 1, m], force balance, at coordinates `q` [2 H + 1, m]; static loads at 1, harmonic ones at `level`.
  function residual_of(scene, q, omega, level, samples) result(residual)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: q(:, :), omega, level
    integer, intent(in) :: samples
    real(wp) :: residual(size(q, 1), size(q, 2)), viscous(size(q, 2), size(q, 2)), imaginary(size(q, 2), size(q, 2))
    real(wp) :: elastic(size(q, 2), size(q, 2))
    integer :: h, i, width

    associate (structure => scene%structure)
      viscous = 0.0_wp
      if (structure%damping_kind == damping_viscous) viscous = structure%damping
      if (structure%damping_kind == damping_mass) viscous = structure%damping_value*structure%mass
      if (structure%damping_kind == damping_ratio) viscous = damp_as_modes_ratio(scene, structure%damping_value)
      residual(1, :) = matmul(structure%stiffness, q(1, :)) - sum(structure%static_loads, 2)
      do h = 1, (size(q, 1) - 1)/2
        elastic = structure%stiffness - (h*omega)**2*structure%mass
        imaginary = h*omega*viscous
        if (structure%damping_kind == damping_loss_factor) imaginary = imaginary + structure%damping_value*structure%stiffness
        residual(2*h, :) = matmul(elastic, q(2*h, :)) + matmul(imaginary, q(2*h + 1, :))
        residual(2*h + 1, :) = matmul(elastic, q(2*h + 1, :)) - matmul(imaginary, q(2*h, :))
      end do
      width = min(size(q, 1), size(structure%harmonic_load, 2))
      residual(2:width, :) = residual(2:width, :) - level*transpose(structure%harmonic_load(:, 2:width))
    end associate
    do i = 1, size(scene%contacts%law)
      associate (law => scene%contacts%law(i), rows => scene%contacts%directions)
        associate (b => rows(:, law%first_row:law%first_row + law%tangents))
          residual = residual + matmul(periodic_forces(law, matmul(q, b), samples), transpose(b))
        end associate
      end associate
    end do
  end function residual_of

  !> Coefficients of a contact's forces [2 H + 1, tangents + 1] in its steady loop, from an unmoved slider: at rest at the
  !> nearest place where it can, else marched.
  function periodic_forces(law, motion, samples) result(coefficients)
    type(contact_type), intent(in) :: law
    real(wp), intent(in) :: motion(:, :)
    integer, intent(in) :: samples
    integer, parameter :: most_periods = 2000
    real(wp) :: coefficients(size(motion, 1), size(motion, 2))
    real(wp) :: x(samples, size(motion, 2)), force(samples, size(motion, 2)), basis(samples, size(motion, 1))
    real(wp) :: u(samples, 2), r(samples), w(2), before(2)
    integer :: h, i, j, period, n
    logical :: rests

    n = law%tangents + 1
    do j = 1, samples
      basis(j, 1) = 1.0_wp
      do h = 1, (size(motion, 1) - 1)/2
        basis(j, 2*h) = cos(h*two_pi*(j - 1)/samples)
        basis(j, 2*h + 1) = sin(h*two_pi*(j - 1)/samples)
      end do
    end do
    x = matmul(basis, motion)
    u = 0.0_wp
    u(:, :n - 1) = x(:, :n - 1)
    force(:, n) = law%preload + law%normal_stiffness*(x(:, n) - law%gap)
    r = law%friction_coefficient*force(:, n)/law%tangential_stiffness
    force(:, n) = max(force(:, n), 0.0_wp)
    w = 0.0_wp
    call settle(u, r, w, rests)
    if (rests) then
      force(:, :n - 1) = law%tangential_stiffness*(u(:, :n - 1) - spread(w(:n - 1), 1, samples))
    end if
    do period = 1, merge(0, most_periods, rests)
      before = w
      i = samples
      do j = 1, samples
        call step(u(i, :), u(j, :), r(i), r(j), w)
        force(j, :n - 1) = law%tangential_stiffness*(u(j, :n - 1) - w(:n - 1))
        i = j
      end do
      if (maxval(abs(w - before)) <= epsilon(1.0_wp)*maxval(abs(x))) exit
    end do
    coefficients = matmul(transpose(basis), force)*2.0_wp/samples
    coefficients(1, :) = 0.5_wp*coefficients(1, :)
  end function periodic_forces

  !> The place nearest to a slider that all discs hold, if there is any: of all that can be it, the slider itself, its projections
  !> onto each disc and the corners of each pair, the nearest that is in all discs.
  subroutine settle(u, r, slider, rests)
    real(wp), intent(in) :: u(:, :), r(:)
    real(wp), intent(inout) :: slider(2)
    logical, intent(out) :: rests
    real(wp) :: d(2), along, across, nearest, best(2)
    integer :: i, j, side

    rests = .false.
    if (any(r <= 0.0_wp)) return
    nearest = huge(1.0_wp)
    call consider(slider)
    do i = 1, size(r)
      d = slider - u(i, :)
      if (norm2(d) > r(i)) call consider(u(i, :) + r(i)*d/norm2(d))
      do j = 1, i - 1
        d = u(j, :) - u(i, :)
        if (norm2(d) > r(i) + r(j) .or. norm2(d) < abs(r(i) - r(j)) .or. norm2(d) <= 0.0_wp) cycle
        along = (sum(d**2) + r(i)**2 - r(j)**2)/(2.0_wp*norm2(d))
        across = sqrt(max(r(i)**2 - along**2, 0.0_wp))
        do side = -1, 1, 2
          call consider(u(i, :) + (along*d + side*across*[-d(2), d(1)])/norm2(d))
        end do
      end do
    end do
    if (rests) slider = best

  contains

    subroutine consider(w)
      real(wp), intent(in) :: w(2)
      integer :: k

      if (norm2(w - slider) >= nearest) return
      do k = 1, size(r)
        if (norm2(u(k, :) - w) > r(k) + 1.0e-12_wp) return
      end do
      rests = .true.
      nearest = norm2(w - slider)
      best = w
    end subroutine consider
  end subroutine settle

  !> The slider from one sample to the next, u and r linear in between. Events by bisection; in slip, e = (u - w)/r makes an angle phi
  !> with d = u_b - u_a that falls by r phi' = -|d| sin(phi): tan(phi/2) goes with exp(-|d| int dt/r).
  pure subroutine step(u_a, u_b, r_a, r_b, w)
    real(wp), intent(in) :: u_a(2), u_b(2), r_a, r_b
    real(wp), intent(inout) :: w(2)
    ! What the slider may lie outside by rounding
    real(wp), parameter :: rounding = 1.0e-14_wp
    real(wp) :: d(2), e(2), start, onset, beyond, middle, angle, exponent
    integer :: i

    d = u_b - u_a
    if (r_b <= 0.0_wp) then
      w = u_b
      return
    end if
    start = 0.0_wp
    if (r_a <= 0.0_wp) then
      start = r_a/(r_a - r_b)
      w = u_a + start*d
    else if (norm2(u_a - w) > r_a) then
      w = u_a - r_a*(u_a - w)/norm2(u_a - w)
    end if
    if (norm2(u_b - w) <= r_b + rounding) return
    onset = start
    beyond = 1.0_wp
    do i = 1, 60
      middle = 0.5_wp*(onset + beyond)
      if (norm2(u_a + middle*d - w) <= r_a + middle*(r_b - r_a) + rounding) then
        onset = middle
      else
        beyond = middle
      end if
    end do
    e = u_a + onset*d - w
    if (r_a <= 0.0_wp) e = d
    angle = atan2(d(1)*e(2) - d(2)*e(1), dot_product(d, e))
    exponent = 0.0_wp
    if (r_a > 0.0_wp) exponent = norm2(d)*time_over_radius(r_a + onset*(r_b - r_a), r_b, 1.0_wp - onset)
    angle = 2.0_wp*atan(tan(0.5_wp*angle)*exp(-exponent))
    e = d/norm2(d)
    w = u_b - r_b*[cos(angle)*e(1) - sin(angle)*e(2), sin(angle)*e(1) + cos(angle)*e(2)]
  end subroutine step

  !> Integral of dt/r where r goes linearly from a to b in a time.
  pure real(wp) function time_over_radius(a, b, time)
    real(wp), intent(in) :: a, b, time

    if (abs(b - a) > 1.0e-5_wp*a) then
      time_over_radius = time*log(b/a)/(b - a)
    else
      time_over_radius = time*(1.0_wp - 0.5_wp*(b - a)/a + (b - a)**2/(3.0_wp*a**2))/a
    end if
  end function time_over_radius

  !> Newton's method with a differenced Jacobian and backtracking, from `q` to the solution; harmonics' `level` raised in steps.
  subroutine solve_uncondensed(scene, omega, samples, steps, q, converged)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: omega
    !> A period; steps of the level
    integer, intent(in) :: samples, steps
    real(wp), intent(inout) :: q(:, :)
    logical, intent(out) :: converged
    integer :: step

    do step = 1, steps
      call newton(scene, omega, real(step, wp)/steps, samples, q, converged)
    end do
  end subroutine solve_uncondensed

  subroutine newton(scene, omega, level, samples, q, converged)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: omega, level
    integer, intent(in) :: samples
    real(wp), intent(inout) :: q(:, :)
    logical, intent(out) :: converged
    integer, parameter :: most_iterations = 40
    ! Forces are of order one; their rounding is some 1e-15 per term.
    real(wp), parameter :: tolerance = 1.0e-13_wp, increment = 1.0e-7_wp
    real(wp) :: jacobian(size(q), size(q)), step(size(q), 1), moved(size(q, 1), size(q, 2)), part
    real(wp), allocatable :: residual(:, :), trial(:, :)
    integer :: iteration, i, j, info

    residual = residual_of(scene, q, omega, level, samples)
    do iteration = 1, most_iterations
      converged = maxval(abs(residual)) <= tolerance
      if (converged) return
      do j = 1, size(q, 2)
        do i = 1, size(q, 1)
          moved = q
          moved(i, j) = moved(i, j) + increment
          jacobian(:, (j - 1)*size(q, 1) + i) = reshape((residual_of(scene, moved, omega, level, samples) - residual)/increment, &
                                                        [size(q)])
        end do
      end do
      step(:, 1) = -reshape(residual, [size(q)])
      call solve_dense(jacobian, step, info)
      if (info /= 0) return
      part = 1.0_wp
      do
        moved = q + part*reshape(step(:, 1), shape(q))
        trial = residual_of(scene, moved, omega, level, samples)
        if (norm2(trial) < norm2(residual) .or. part < 1.0e-3_wp) exit
        part = 0.5_wp*part
      end do
      q = moved
      residual = trial
    end do
  end subroutine newton
end module uncondensed
