!> One implicit step, static or in time: the motion p under a load r and contact forces that depend on it,
!>
!> $$ p = S (r - c P g(d, w)), \quad d = B \Phi p \qquad \Rightarrow \qquad d + c R g(d, w) = d_r, \quad R = B \Phi S P $$
!>
!> solved for the contacts' displacements d alone by Newton's method with backtracking. g is piecewise linear for one tangent (Newton
!> ends exactly), smooth but for corners for two.
module attrito_integrate_equilibrium
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense
  use attrito_integrate_return_map, only: return_contacts
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: operator_type, new_operator, solve_equilibrium, apply

  type :: operator_type
    !> S as a diagonal [m], or if modes are coupled in full [m, m]
    real(wp), allocatable :: diagonal(:), matrix(:, :)
    !> c S P [m, rows] and c R [rows, rows]
    real(wp), allocatable :: pushes(:, :), compliance(:, :)
    !> Residual relative to the displacements that counts as an equilibrium: rounding
    real(wp) :: tolerance = 4.0_wp*epsilon(1.0_wp)
  end type operator_type

contains

  !> From the diagonal of 1/S and what is beside it.
  subroutine new_operator(system, inverse, coupling_factor, c, self)
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
    allocate (self%pushes, mold=system%pushes)
    do i = 1, size(system%springs)
      self%pushes(:, i) = c*apply(self, system%pushes(:, i))
    end do
    self%compliance = matmul(transpose(system%rows), self%pushes)
  end subroutine new_operator

  !> S x.
  pure function apply(self, x) result(y)
    type(operator_type), intent(in) :: self
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
    type(system_type), intent(in) :: system
    type(operator_type), intent(in) :: self
    !> S r, the motion without g [m]
    real(wp), intent(in) :: free(:)
    !> Sliders before the step [2, contacts]
    real(wp), intent(in) :: slider(:, :)
    !> Directions of slip before the step [2, contacts]
    real(wp), intent(in) :: direction(:, :)
    !> Of the rows, guess then solution [rows]
    real(wp), intent(inout) :: displacement(:)
    !> Forces less stuck springs [rows], sliders after the step [2, contacts], regimes [contacts]
    real(wp), intent(out) :: g(:), new_slider(:, :)
    integer, intent(out) :: regime(:)
    !> [m]
    real(wp), intent(out) :: motion(:)
    logical, intent(out) :: converged
    !> Displacement relative to that of the stuck contacts that is taken for an equilibrium
    real(wp), parameter :: farthest = 1.0e8_wp
    real(wp) :: target(size(g)), residual(size(g)), trial(size(g)), step(size(g), 1), jacobian(size(g), size(g)), &
                stiffness(3, size(g)), norm, length
    integer :: iteration, halving, info

    target = matmul(free, system%rows)
    call evaluate(displacement)
    converged = .false.
    do iteration = 1, 100
      norm = norm2(residual)
      converged = norm <= self%tolerance*(norm2(target) + norm2(displacement) + norm2(target - displacement))
      if (converged) exit
      call assemble()
      step(:, 1) = -residual
      call solve_dense(jacobian, step, info)
      if (info /= 0) exit
      length = 1.0_wp
      trial = displacement
      do halving = 1, 30
        displacement = trial + length*step(:, 1)
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
    ! A body that its contacts have left comes to rest nowhere, but for rounding of its stiffness.
    converged = converged .and. norm2(displacement) <= farthest*norm2(target)
    motion = free - matmul(self%pushes, g)

  contains

    subroutine evaluate(at)
      real(wp), intent(in) :: at(:)

      call return_contacts(system, at, slider, direction, g, stiffness, new_slider, regime)
      residual = at + matmul(self%compliance, g) - target
    end subroutine evaluate

    !> 1 + c R dg/dd; dg/dd couples the rows of a contact only
    subroutine assemble()
      integer :: i, row, b, column

      jacobian = 0.0_wp
      do i = 1, size(system%law)
        associate (first => system%law(i)%first_row, n => system%law(i)%tangents)
          do row = first, first + n
            do b = 1, n + 1
              column = first + b - 1
              if (abs(stiffness(b, row)) > 0.0_wp) jacobian(:, column) = jacobian(:, column) &
                + self%compliance(:, row)*stiffness(b, row)
            end do
          end do
        end associate
      end do
      do row = 1, size(g)
        jacobian(row, row) = jacobian(row, row) + 1.0_wp
      end do
    end subroutine assemble
  end subroutine solve_equilibrium
end module attrito_integrate_equilibrium
