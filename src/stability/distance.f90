!> How far a motion in time lies from a balance's, wherever in the period that is farthest:
!>
!> $$ \max_t |p(t) - \hat p(t)| \, / \, \max_t |\hat p(t) - \hat p_0| $$
!>
!> with p the motion of the modes, normalised by mass, up to the balance's highest harmonic, and \hat p_0 the balance's mean. What
!> moves beyond that harmonic is not of another orbit: the balance leaves it out. They may agree at the period's start and
!> part when contacts hit.
module attrito_stability_distance
  use attrito_core_kinds, only: wp, two_pi
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_start, only: coordinates_of
  implicit none
  private
  public :: trajectory_of_balance, distance_between, instants

  !> At which motions are held against each other
  integer, parameter :: instants = 128 ! conventional

contains

  !> A balance's motion at equal instants of its period [m, 0:count - 1].
  function trajectory_of_balance(solver, system, count) result(trajectory)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Number of instants
    integer, intent(in) :: count
    real(wp), allocatable :: trajectory(:, :)
    real(wp), allocatable :: harmonics(:, :)

    harmonics = matmul(coordinates_of(solver), system%weighted)
    allocate (trajectory(size(harmonics, 2), 0:count - 1))
    trajectory = matmul(transpose(harmonics), basis_at(size(harmonics, 1), count))
  end function trajectory_of_balance

  !> Of a motion from a balance's, at the same instants [m, instants], part of the latter's amplitude.
  pure real(wp) function distance_between(motion, balance, harmonics) result(distance)
    !> Motion at the instants; motion of the balance at the instants
    real(wp), intent(in) :: motion(:, :), balance(:, :)
    !> The balance's highest harmonic
    integer, intent(in) :: harmonics
    real(wp) :: mean(size(balance, 1)), apart(size(balance, 1), size(balance, 2)), amplitude
    real(wp) :: basis(2*harmonics + 1, size(balance, 2))
    integer :: i

    mean = sum(balance, 2)/size(balance, 2)
    amplitude = maxval([(norm2(balance(:, i) - mean), i=1, size(balance, 2))])
    apart = motion - balance
    if (2*harmonics + 1 < size(balance, 2)) then
      basis = basis_at(2*harmonics + 1, size(balance, 2))
      basis(2:, :) = sqrt(2.0_wp)*basis(2:, :)
      apart = matmul(matmul(apart, transpose(basis)), basis)/size(balance, 2)
    end if
    distance = maxval([(norm2(apart(:, i)), i=1, size(balance, 2))])/max(amplitude, tiny(1.0_wp))
  end function distance_between

  !> 1, cosines and sines at equal instants of a period [coefficients, count].
  pure function basis_at(coefficients, count) result(basis)
    !> 2 H + 1; number of instants
    integer, intent(in) :: coefficients, count
    real(wp) :: basis(coefficients, 0:count - 1)
    integer :: i, h

    basis(1, :) = 1.0_wp
    do i = 0, count - 1
      basis(2::2, i) = [(cos(two_pi*modulo(h*i, count)/count), h=1, coefficients/2)]
      basis(3::2, i) = [(sin(two_pi*modulo(h*i, count)/count), h=1, coefficients/2)]
    end do
  end function basis_at
end module attrito_stability_distance
