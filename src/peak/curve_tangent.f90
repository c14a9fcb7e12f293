!> Tangent of a curve of peaks, and how it turned over the last step: what the next peak is predicted by.
!>
!> $$ \psi'[t] \sigma + \psi'[d_p] \pi = 0, \qquad x(s) = x_0 + s t + s^2 t'/2 $$
!>
!> Lengths are relative changes of harmonics, frequency and parameter (`relative_size`).
module attrito_peak_curve_tangent
  use attrito_core_kinds, only: wp
  use attrito_newton_border, only: inner_product
  use attrito_solve_snapshot, only: snapshot_type
  use attrito_solve_solver, only: solver_type
  use attrito_peak_condition, only: problem_type, direction_type, linearisation_type, value_of, set_value, scale_of_motion
  use attrito_peak_corrector, only: plane_type, combine, scaled, height, relative_size, frequency_weight
  implicit none
  private
  public :: curve_tangent_type

  type :: curve_tangent_type
    !> Unit tangent of the curve, and the way it was followed last
    type(direction_type), private :: tangent
    !> How it changes from step to step, per length, once two are known
    type(direction_type), private :: bending
  contains
    procedure :: is_known
    procedure :: forget
    procedure :: find
    procedure :: turn_towards
    procedure :: length_to
    procedure :: predict
  end type curve_tangent_type

contains

  pure logical function is_known(self)
    class(curve_tangent_type), intent(in) :: self

    is_known = allocated(self%tangent%step%motion)
  end function is_known

  !> The next tangent goes any way.
  pure subroutine forget(self)
    class(curve_tangent_type), intent(inout) :: self

    if (allocated(self%tangent%step%motion)) deallocate (self%tangent%step%motion)
    if (allocated(self%bending%step%motion)) deallocate (self%bending%step%motion)
  end subroutine forget

  !> The tangent at a peak, the way the last one went.
  subroutine find(self, problem, solver, point, length)
    class(curve_tangent_type), intent(inout) :: self
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Condition of a peak and its derivatives
    type(linearisation_type), intent(in) :: point
    !> Of the step since the last one; 0 where there was none
    real(wp), intent(in) :: length
    type(direction_type) :: tangent
    real(wp), allocatable :: harmonics(:, :)
    real(wp) :: size_of_it

    tangent = combine(point, 0.0_wp, -point%slope_parameter, point%slope_along)
    harmonics = tangent%step%motion
    harmonics(1, :) = 0.0_wp
    size_of_it = relative_size(solver, harmonics, tangent%step%omega, tangent%parameter/value_of(problem, solver))
    tangent = scaled(tangent, 1.0_wp/size_of_it)
    associate (periodic => spread(solver%context%balance%periodic, 1, size(tangent%step%slider, 1)))
      tangent%step%slider = merge(tangent%step%slider, 0.0_wp, periodic)
    end associate
    if (self%is_known()) then
      if (along_last(self, problem, solver, tangent) < 0.0_wp) call reverse(tangent)
    end if
    if (allocated(self%bending%step%motion)) deallocate (self%bending%step%motion)
    if (length > 0.0_wp .and. self%is_known()) then
      self%bending%step%motion = (tangent%step%motion - self%tangent%step%motion)/length
      self%bending%step%slider = 0.0_wp*tangent%step%slider
      self%bending%step%omega = (tangent%step%omega - self%tangent%step%omega)/length
      self%bending%parameter = (tangent%parameter - self%tangent%parameter)/length
    end if
    self%tangent = tangent
  end subroutine find

  !> Inner product, as the size of steps is measured, of a tangent with the last one.
  real(wp) function along_last(self, problem, solver, tangent)
    class(curve_tangent_type), intent(in) :: self
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Change of the unknowns and of the response
    type(direction_type), intent(in) :: tangent

    along_last = inner_product(solver%context%balance, self%tangent%step%motion(2:, :), tangent%step%motion(2:, :)) &
                 /scale_of_motion(solver)**2 + self%tangent%step%omega*tangent%step%omega*(frequency_weight/solver%omega)**2 &
                 + self%tangent%parameter*tangent%parameter/value_of(problem, solver)**2
  end function along_last

  !> Go on towards a value of the parameter: the tangent points to greater or smaller ones.
  subroutine turn_towards(self, problem, solver, value)
    class(curve_tangent_type), intent(inout) :: self
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Value of the parameter
    real(wp), intent(in) :: value

    if (self%tangent%parameter*(value - value_of(problem, solver)) < 0.0_wp) call reverse(self%tangent)
  end subroutine turn_towards

  subroutine reverse(direction)
    !> Change of the unknowns and of the response
    type(direction_type), intent(inout) :: direction

    direction%step%motion = -direction%step%motion
    direction%step%slider = -direction%step%slider
    direction%step%omega = -direction%step%omega
    direction%parameter = -direction%parameter
  end subroutine reverse

  !> Along the tangent from one value of the parameter to another.
  pure real(wp) function length_to(self, from, to)
    class(curve_tangent_type), intent(in) :: self
    !> Values of the parameter
    real(wp), intent(in) :: from, to

    length_to = abs((to - from)/self%tangent%parameter)
  end function length_to

  !> Go along the tangent, and as it turned over the last step; the plane across it stands there.
  subroutine predict(self, problem, solver, start, parameter, length, plane)
    class(curve_tangent_type), intent(in) :: self
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Peak to go on from, and its value of the parameter
    class(snapshot_type), intent(in) :: start
    real(wp), intent(in) :: parameter
    !> Length of the step
    real(wp), intent(in) :: length
    !> Linear condition on motion, frequency and parameter
    type(plane_type), intent(out) :: plane
    real(wp) :: scale, value

    scale = scale_of_motion(solver)
    associate (step => self%tangent%step)
      solver%motion = start%motion + length*step%motion
      solver%omega = start%omega + length*step%omega
      value = parameter + length*self%tangent%parameter
      if (allocated(self%bending%step%motion)) then
        solver%motion = solver%motion + 0.5_wp*length**2*self%bending%step%motion
        solver%omega = solver%omega + 0.5_wp*length**2*self%bending%step%omega
        value = value + 0.5_wp*length**2*self%bending%parameter
      end if
      call solver%set_slider(start%slider + length*step%slider, start%periodic)
      call set_value(problem, solver, value)
      plane%motion = step%motion/scale**2
      plane%motion(1, :) = 0.0_wp
      plane%omega = step%omega*(frequency_weight/start%omega)**2
      plane%parameter = self%tangent%parameter/parameter**2
    end associate
    plane%value = height(problem, solver, plane)
  end subroutine predict
end module attrito_peak_curve_tangent
