!> How a nonlinear mode changes with parameters at an amplitude Q that is held: the balance with negative damping
!> (`attrito_peak_backbone`) under
!>
!> $$ c(X_1) = a \text{ real}, \qquad Q = |w^T q_1|, \qquad w = M \bar\phi, $$
!>
!> phi being the tangent mode, which changes with the parameter as well. What a unit of omega, of xi and of a changes of the motion,
!> and what a parameter changes with these held, are linear systems of the point (`attrito_sensitivity_point_rates`); three real
!> equations then say how omega, xi and a follow the parameter:
!>
!> $$ c_\omega \omega' + c_\xi \xi' + c_a a' + c_p = a', \qquad Q_\omega \omega' + Q_\xi \xi' + Q_a a' + Q_p = 0. $$
!>
!> The structure's damping ratio S/(2 omega T) is one of quadratic forms: their derivatives along a change are differences, exact.
module attrito_peak_mode_slopes
  use attrito_core_kinds, only: wp
  use attrito_linear_damping, only: damping_of_harmonic
  use attrito_model_structure, only: damping_loss_factor
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_peak_backbone_point, only: backbone_type
  use attrito_peak_structural_damping, only: kinetic_sum
  use attrito_sensitivity_damping_derivatives, only: damping_numbers, damping_product
  use attrito_sensitivity_parameters, only: by_parameters_type
  use attrito_sensitivity_parameter_derivatives, only: derivative_along
  use attrito_sensitivity_point_rates, only: inquiry_type, rate_type, derivatives_of_laws, rate_of_parameter, rate_of_response
  use attrito_sensitivity_quantities, only: weights_type, weights_of
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: mode_slopes_type, mode_slopes

  !> Derivatives by parameters [parameters], and of quantities [quantities, parameters]
  type :: mode_slopes_type
    real(wp), allocatable :: omega(:), excitation(:), structural_ratio(:), quantities(:, :)
  end type mode_slopes_type

contains

  !> At a mode's point where the solver stands, which was evaluated last.
  subroutine mode_slopes(solver, backbone, inquiry, parameters, reader, own, slopes, status)
    !> Solver of points
    type(solver_type), target, intent(inout) :: solver
    !> The mode that it is at
    type(backbone_type), intent(in) :: backbone
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> What each changes
    type(by_parameters_type), intent(in) :: parameters(:)
    !> w [m]
    complex(wp), intent(in) :: reader(:)
    !> What each changes of Q by the tangent mode alone [parameters]
    real(wp), intent(in) :: own(:)
    !> Derivatives
    type(mode_slopes_type), intent(out) :: slopes
    !> 0, or not: the linearised equations are singular there
    integer, intent(out) :: status
    type(preconditioners_type) :: kept
    type(weights_type) :: weights(size(inquiry%quantities))
    type(rate_type) :: ways(3), rate
    real(wp), allocatable :: laws(:, :, :)
    real(wp) :: equations(3, 3), change(3)
    integer :: i, j

    associate (balance => solver%context%balance)
      laws = derivatives_of_laws(balance, inquiry)
      weights = [(weights_of(inquiry%quantities(i), balance), i=1, size(weights))]
      call find_ways(solver, inquiry, laws, kept, ways, status)
      if (status /= 0) return
      do i = 1, 3
        equations(:, i) = conditions(solver, backbone, reader, ways(i))
      end do
      ! The coordinate that is held is a itself.
      equations(1, 3) = equations(1, 3) - 1.0_wp
      allocate (slopes%omega(size(parameters)), slopes%excitation(size(parameters)), slopes%structural_ratio(size(parameters)), &
                slopes%quantities(size(weights), size(parameters)))
      do j = 1, size(parameters)
        call rate_of_parameter(solver, laws, parameters(j), kept, rate, status)
        if (status /= 0) return
        change = solution(equations, -conditions(solver, backbone, reader, rate) - [0.0_wp, 0.0_wp, own(j)])
        do i = 1, 3
          rate%motion = rate%motion + change(i)*ways(i)%motion
          rate%deviation = rate%deviation + change(i)*ways(i)%deviation
          rate%response = rate%response + change(i)*ways(i)%response
        end do
        slopes%omega(j) = change(1)
        slopes%excitation(j) = change(2)
        slopes%structural_ratio(j) = ratio_along(solver, rate, change(1), parameters(j)%damping)
        slopes%quantities(:, j) = [(derivative_along(balance, weights(i), rate), i=1, size(weights))]
      end do
    end associate
  end subroutine mode_slopes

  !> What units of omega, xi and a change.
  subroutine find_ways(solver, inquiry, laws, kept, ways, status)
    !> Solver of points
    type(solver_type), target, intent(inout) :: solver
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> Derivatives of forces by the columns of contacts
    real(wp), intent(in) :: laws(:, :, :)
    !> Preconditioners that serve more than one step
    type(preconditioners_type), intent(inout) :: kept
    !> How the point changes
    type(rate_type), intent(out) :: ways(3)
    !> 0, or not
    integer, intent(out) :: status
    complex(wp), allocatable :: source(:, :)
    type(by_parameters_type) :: level
    integer :: i

    associate (balance => solver%context%balance)
      allocate (source, mold=balance%response)
      call balance%receptance%respond_derivative(balance%response, source)
      call rate_of_response(solver, source, kept, ways(1), status)
      if (status /= 0) return
      call balance%receptance%respond_excitation(balance%response, source)
      call rate_of_response(solver, source, kept, ways(2), status)
      if (status /= 0) return
      ! The load of the spring that holds the mode is the level's.
      allocate (level%laws(size(laws, 3), size(inquiry%recipes)), source=0.0_wp)
      allocate (level%static_factors(size(balance%static_loads, 2)), level%harmonic_factors(0), source=0.0_wp)
      level%damping = [(0.0_wp, i=1, damping_numbers)]
      level%level = 1.0_wp
      call rate_of_parameter(solver, laws, level, kept, ways(3), status)
    end associate
  end subroutine find_ways

  !> Changes of the real and the imaginary part of c, and of Q.
  function conditions(solver, backbone, reader, rate) result(change)
    !> Solver of points
    type(solver_type), intent(in) :: solver
    !> The mode that it is at
    type(backbone_type), intent(in) :: backbone
    !> w [m]
    complex(wp), intent(in) :: reader(:)
    !> How the point changes
    type(rate_type), intent(in) :: rate
    real(wp) :: change(3)
    complex(wp) :: held(size(backbone%modes)), there, moved

    associate (balance => solver%context%balance)
      held = backbone%coordinates(rate%response)
      there = sum(reader*balance%receptance%recover(1, balance%response(:, 1)))
      moved = sum(reader*balance%receptance%recover(1, rate%response(:, 1)))
      change = [real(held(1), wp), aimag(held(1)), real(conjg(there)*moved, wp)/abs(there)]
    end associate
  end function conditions

  !> x of A x = b, by Cramer's rule.
  pure function solution(a, b) result(x)
    !> [3, 3]; [3]
    real(wp), intent(in) :: a(3, 3), b(3)
    real(wp) :: x(3), determinant

    determinant = triple(a(:, 1), a(:, 2), a(:, 3))
    x = [triple(b, a(:, 2), a(:, 3)), triple(a(:, 1), b, a(:, 3)), triple(a(:, 1), a(:, 2), b)]/determinant
  end function solution

  !> Determinant of three columns.
  pure real(wp) function triple(a, b, c)
    !> Columns
    real(wp), intent(in) :: a(3), b(3), c(3)

    triple = a(1)*(b(2)*c(3) - b(3)*c(2)) - a(2)*(b(1)*c(3) - b(3)*c(1)) + a(3)*(b(1)*c(2) - b(2)*c(1))
  end function triple

  !> Change of S/(2 omega T).
  real(wp) function ratio_along(solver, rate, by_omega, by_damping) result(change)
    !> Solver of points
    type(solver_type), intent(in) :: solver
    !> How the point changes
    type(rate_type), intent(in) :: rate
    !> Change of omega; of the numbers of damping [damping_numbers]
    real(wp), intent(in) :: by_omega, by_damping(:)
    complex(wp), allocatable :: inertia(:, :), moved(:, :)
    real(wp) :: work, work_change, kinetic, kinetic_change, part
    integer :: h

    associate (balance => solver%context%balance, omega => solver%omega)
      kinetic = kinetic_sum(solver)
      work = work_of(solver, balance%response)
      allocate (inertia, moved, mold=balance%response)
      call balance%receptance%inertia_of(balance%response, inertia)
      kinetic_change = 2.0_wp*sum([(h**2*real(sum(conjg(rate%response(:, h))*inertia(:, h)), wp), h=1, ubound(inertia, 2))])
      ! A change as large as the motion loses least to rounding.
      part = 1.0_wp
      if (any(abs(rate%response(:, 1:)) > 0.0_wp)) then
        part = sqrt(sum(abs(balance%response(:, 1:))**2)/sum(abs(rate%response(:, 1:))**2))
      end if
      moved = part*rate%response
      work_change = (work_of(solver, balance%response + moved) - work_of(solver, balance%response - moved))/(2.0_wp*part)
      if (solver%structure%damping_kind == damping_loss_factor) work_change = work_change - work*by_omega/omega
      if (any(abs(by_damping) > 0.0_wp)) then
        do h = 1, ubound(inertia, 2)
          associate (own => balance%receptance%recover(h, balance%response(:, h)))
            work_change = work_change + h**2*real(sum(conjg(own)*damping_product(solver%structure, solver%stuck, by_damping, own, &
                                                                                 h*omega)), wp)
          end associate
        end do
      end if
      change = work/(2.0_wp*omega*kinetic)*(-by_omega/omega - kinetic_change/kinetic) + work_change/(2.0_wp*omega*kinetic)
    end associate
  end function ratio_along

  !> S = sum_h h^2 q_h^H C q_h of a response [n, 0:H].
  real(wp) function work_of(solver, response) result(work)
    !> Solver of points
    type(solver_type), intent(in) :: solver
    !> Coordinates, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    integer :: h

    work = 0.0_wp
    do h = 1, ubound(response, 2)
      work = work + h**2*damping_of_harmonic(solver%structure, solver%stuck, h, &
                                             solver%context%balance%receptance%recover(h, response(:, h)), h*solver%omega)
    end do
  end function work_of
end module attrito_peak_mode_slopes
