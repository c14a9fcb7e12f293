!> The oracle: the multi-harmonic balance of all coordinates, nothing condensed, no reference state.
!>
!> $$ [K - (h \omega)^2 M + i h \omega C + i \eta K \, [h > 0]] \, q_h + (B^T \lambda)_h = f_h, \qquad h = 0 \ldots H $$
!>
!> It shares the forces of a contact in a motion with the solver, which other tests hold against marches, and the types that describe
!> the scene. Sliders are no unknowns, and the Jacobian is a difference.
module uncondensed
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_contact_disc_rules, only: new_disc_rules
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_model_contacts, only: contact_type
  use attrito_model_structure, only: damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use scenes, only: scene_type, damp_as_modes_ratio
  implicit none
  private
  public :: residual_of, solve_uncondensed

contains

  !> Residual [2 H + 1, m], force balance, at coordinates `q` [2 H + 1, m]; static loads at 1, harmonic ones at `level`.
  function residual_of(scene, q, omega, level) result(residual)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: q(:, :), omega, level
    real(wp) :: residual(size(q, 1), size(q, 2)), viscous(size(q, 2), size(q, 2)), imaginary(size(q, 2), size(q, 2))
    real(wp) :: elastic(size(q, 2), size(q, 2))
    type(quadrature_type) :: quadrature
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
    h = (size(q, 1) - 1)/2
    quadrature = quadrature_type(grid=new_grid(h), discs=new_disc_rules(h))
    do i = 1, size(scene%contacts%law)
      associate (law => scene%contacts%law(i), rows => scene%contacts%directions)
        associate (b => rows(:, law%first_row:law%first_row + law%tangents))
          residual = residual + matmul(periodic_forces(law, quadrature, matmul(q, b)), transpose(b))
        end associate
      end associate
    end do
  end function residual_of

  !> Coefficients of a contact's forces [2 H + 1, tangents + 1] in its steady loop, from an unmoved slider: lambda = K_c d + g.
  function periodic_forces(law, quadrature, motion) result(coefficients)
    type(contact_type), intent(in) :: law
    type(quadrature_type), intent(in) :: quadrature
    real(wp), intent(in) :: motion(:, :)
    real(wp), parameter :: unmoved(2) = 0.0_wp
    real(wp) :: coefficients(size(motion, 1), size(motion, 2))
    type(contact_forces_type) :: forces

    forces%without_jacobian = .true.
    allocate (forces%deviation, mold=motion)
    call evaluate_contact(law, quadrature, motion, unmoved, .false., forces)
    associate (t => law%tangents)
      coefficients(:, :t) = law%tangential_stiffness*motion(:, :t)
      coefficients(:, t + 1) = law%normal_stiffness*motion(:, t + 1)
    end associate
    coefficients = coefficients + forces%deviation
  end function periodic_forces

  !> Newton's method with a differenced Jacobian and backtracking, from `q` to the solution; harmonics' `level` raised in steps.
  subroutine solve_uncondensed(scene, omega, steps, q, converged)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: omega
    !> Of the level
    integer, intent(in) :: steps
    real(wp), intent(inout) :: q(:, :)
    logical, intent(out) :: converged
    integer :: step

    do step = 1, steps
      call newton(scene, omega, real(step, wp)/steps, q, converged)
    end do
  end subroutine solve_uncondensed

  subroutine newton(scene, omega, level, q, converged)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: omega, level
    real(wp), intent(inout) :: q(:, :)
    logical, intent(out) :: converged
    integer, parameter :: most_iterations = 40
    ! Forces are of order one; their rounding is some 1e-15 per term.
    real(wp), parameter :: tolerance = 1.0e-13_wp, increment = 1.0e-7_wp
    real(wp) :: jacobian(size(q), size(q)), step(size(q), 1), moved(size(q, 1), size(q, 2)), part
    real(wp), allocatable :: residual(:, :), trial(:, :)
    integer :: iteration, i, j, info

    residual = residual_of(scene, q, omega, level)
    do iteration = 1, most_iterations
      converged = maxval(abs(residual)) <= tolerance
      if (converged) return
      do j = 1, size(q, 2)
        do i = 1, size(q, 1)
          moved = q
          moved(i, j) = moved(i, j) + increment
          jacobian(:, (j - 1)*size(q, 1) + i) = reshape((residual_of(scene, moved, omega, level) - residual)/increment, [size(q)])
        end do
      end do
      step(:, 1) = -reshape(residual, [size(q)])
      call solve_dense(jacobian, step, info)
      if (info /= 0) return
      part = 1.0_wp
      do
        moved = q + part*reshape(step(:, 1), shape(q))
        trial = residual_of(scene, moved, omega, level)
        if (norm2(trial) < norm2(residual) .or. part < 1.0e-3_wp) exit
        part = 0.5_wp*part
      end do
      q = moved
      residual = trial
    end do
  end subroutine newton
end module uncondensed
