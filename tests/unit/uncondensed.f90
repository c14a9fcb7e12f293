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

  !> Coefficients of a contact's forces [2 H + 1, tangents + 1] in its steady loop, marched from an unmoved slider.
  function periodic_forces(law, motion, samples) result(coefficients)
    type(contact_type), intent(in) :: law
    real(wp), intent(in) :: motion(:, :)
    integer, intent(in) :: samples
    integer, parameter :: most_periods = 2000
    real(wp) :: coefficients(size(motion, 1), size(motion, 2))
    real(wp) :: x(samples, size(motion, 2)), force(samples, size(motion, 2)), basis(samples, size(motion, 1))
    real(wp) :: w(law%tangents), before(law%tangents), elastic(law%tangents), limit
    integer :: h, j, period, n

    n = law%tangents + 1
    do j = 1, samples
      basis(j, 1) = 1.0_wp
      do h = 1, (size(motion, 1) - 1)/2
        basis(j, 2*h) = cos(h*two_pi*(j - 1)/samples)
        basis(j, 2*h + 1) = sin(h*two_pi*(j - 1)/samples)
      end do
    end do
    x = matmul(basis, motion)
    w = 0.0_wp
    do period = 1, most_periods
      before = w
      do j = 1, samples
        force(j, n) = law%preload + law%normal_stiffness*(x(j, n) - law%gap)
        if (force(j, n) <= 0.0_wp) then
          force(j, :) = 0.0_wp
          w = x(j, :n - 1)
          cycle
        end if
        limit = law%friction_coefficient*force(j, n)
        elastic = law%tangential_stiffness*(x(j, :n - 1) - w)
        if (norm2(elastic) > limit) then
          elastic = limit*elastic/norm2(elastic)
          w = x(j, :n - 1) - elastic/law%tangential_stiffness
        end if
        force(j, :n - 1) = elastic
      end do
      if (maxval(abs(w - before)) <= epsilon(1.0_wp)*maxval(abs(x))) exit
    end do
    coefficients = matmul(transpose(basis), force)*2.0_wp/samples
    coefficients(1, :) = 0.5_wp*coefficients(1, :)
  end function periodic_forces

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
