!> One implicit step in time: the motion p under a load r and contact forces that depend on it,
!>
!> $$ p = S (r - c P g(d, w)), \quad d = B \Phi p \qquad \Rightarrow \qquad d + c R g(d, w) = d_r, \quad R = B \Phi S P $$
!>
!> solved for the contacts' displacements d alone by Newton's method with backtracking. g is piecewise linear for one tangent (Newton
!> ends exactly), smooth but for corners for two. Its derivative G has rows where contacts slip or open alone, and these are all that
!> a step eliminates: with a residual rho,
!>
!> $$ (1 + c R G) \delta d = -\rho \quad \Leftrightarrow \quad (1 + G c R) y = -G \rho, \quad \delta d = -\rho - c R y. $$
module attrito_integrate_equilibrium
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_integrate_return_map, only: return_contacts
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: operator_type, new_operator, solve_equilibrium, newton_step, apply

  type :: operator_type
    !> S as a diagonal [m], or if modes are coupled in full [m, m]
    real(wp), allocatable :: diagonal(:), matrix(:, :)
    !> c S P [m, rows] and c R [rows, rows]
    real(wp), allocatable :: input_map(:, :), compliance(:, :)
    !> Residual relative to the displacements that counts as an equilibrium: rounding
    real(wp) :: tolerance = 4.0_wp*epsilon(1.0_wp)
  end type operator_type

contains

  !> From the diagonal of 1/S and what is beside it.
  subroutine new_operator(system, inverse, coupling_factor, c, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Diagonal of 1/S [m]
    real(wp), intent(in) :: inverse(:)
    !> Times the system's damping coupling, added to it
    real(wp), intent(in) :: coupling_factor, c
    type(operator_type), intent(out) :: self
    real(wp), allocatable :: full(:, :)
    integer :: i, info

    self%diagonal = 1.0_wp/inverse
    if (allocated(system%coupling) .and. abs(coupling_factor) > 0.0_wp) then
      full = coupling_factor*system%coupling
      allocate (self%matrix, mold=full)
      self%matrix = 0.0_wp
      do i = 1, size(inverse)
        full(i, i) = full(i, i) + inverse(i)
        self%matrix(i, i) = 1.0_wp
      end do
      call solve_dense(full, self%matrix, info)
    end if
    allocate (self%input_map, mold=system%input_map)
    do i = 1, size(system%springs)
      self%input_map(:, i) = c*apply(self, system%input_map(:, i))
    end do
    self%compliance = matmul(transpose(system%rows), self%input_map)
  end subroutine new_operator

  !> S x.
  pure function apply(self, x) result(y)
    type(operator_type), intent(in) :: self
    !> Fraction of the interval
    real(wp), intent(in) :: x(:)
    real(wp) :: y(size(x))

    if (allocated(self%matrix)) then
      y = matmul(self%matrix, x)
    else
      y = self%diagonal*x
    end if
  end function apply

  !> Solve from the contacts' displacements that are given.
  subroutine solve_equilibrium(system, self, free, slider, direction, displacement, g, new_slider, regime, motion, converged)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    type(operator_type), intent(in) :: self
    !> S r, the motion without g [m]
    real(wp), intent(in) :: free(:)
    !> Sliders, and directions of slip, before the step [2, contacts]
    real(wp), intent(in) :: slider(:, :), direction(:, :)
    !> Of the rows, guess then solution [rows]
    real(wp), intent(inout) :: displacement(:)
    !> Forces less stuck springs [rows], sliders after the step [2, contacts], regimes [contacts]
    real(wp), intent(out) :: g(:), new_slider(:, :)
    !> Regime: stick, slip or open
    integer, intent(out) :: regime(:)
    !> [m]
    real(wp), intent(out) :: motion(:)
    !> Did the solve converge?
    logical, intent(out) :: converged
    real(wp) :: target(size(g)), residual(size(g)), trial(size(g)), step(size(g)), stiffness(3, size(g)), norm, length
    integer :: iteration, halving, info

    target = matmul(free, system%rows)
    call evaluate(displacement)
    converged = .false.
    do iteration = 1, 100
      norm = norm2(residual)
      converged = norm <= self%tolerance*(norm2(target) + norm2(displacement) + norm2(target - displacement))
      if (converged) exit
      call newton_step(system, self%compliance, stiffness, residual, step, info)
      if (info /= 0) exit
      length = 1.0_wp
      trial = displacement
      do halving = 1, 30
        displacement = trial + length*step
        call evaluate(displacement)
        if (norm2(residual) < norm) exit
        length = 0.5_wp*length
      end do
      if (norm2(residual) >= norm) then
        ! Nothing left to gain: rounding, or a corner without solution.
        converged = norm <= 1.0e-11_wp*(norm2(target) + norm2(trial))
        displacement = trial
        call evaluate(displacement)
        exit
      end if
    end do
    motion = free - matmul(self%input_map, g)

  contains

    subroutine evaluate(at)
      !> Displacements of the contacts
      real(wp), intent(in) :: at(:)

      call return_contacts(system, at, slider, direction, g, stiffness, new_slider, regime)
      residual = at + matmul(self%compliance, g) - target
    end subroutine evaluate
  end subroutine solve_equilibrium

  !> The step of Newton's method, by the forces that change with it.
  subroutine newton_step(system, compliance, stiffness, residual, step, info)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> c R [rows, rows]; G by the displacements of each row's own contact [3, rows]; rho [rows]
    real(wp), intent(in) :: compliance(:, :), stiffness(:, :), residual(:)
    !> Length of the step
    real(wp), intent(out) :: step(:)
    !> 0, or the matrix is singular
    integer, intent(out) :: info
    real(wp), allocatable :: matrix(:, :), forces(:, :)
    integer :: active(size(residual)), first(size(residual)), last(size(residual)), count, contact, row, i, j

    count = 0
    do contact = 1, size(system%law)
      associate (law => system%law(contact))
        do row = law%first_row, law%first_row + law%tangents
          if (all(abs(stiffness(:, row)) <= 0.0_wp)) cycle
          count = count + 1
          active(count) = row
          first(count) = law%first_row
          last(count) = law%first_row + law%tangents
        end do
      end associate
    end do
    allocate (matrix(count, count), forces(count, 1))
    do j = 1, count
      do i = 1, count
        matrix(i, j) = dot_product(stiffness(:last(i) - first(i) + 1, active(i)), compliance(first(i):last(i), active(j)))
      end do
      matrix(j, j) = matrix(j, j) + 1.0_wp
      forces(j, 1) = -dot_product(stiffness(:last(j) - first(j) + 1, active(j)), residual(first(j):last(j)))
    end do
    info = 0
    if (count > 0) call solve_dense(matrix, forces, info)
    step = -residual
    if (info == 0 .and. count > 0) step = step - matmul(compliance(:, active(:count)), forces(:, 1))
  end subroutine newton_step
end module attrito_integrate_equilibrium
