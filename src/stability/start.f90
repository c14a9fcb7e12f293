!> A balance's point as a state in time: where its period starts, and the loads that act.
module attrito_stability_start
  use attrito_core_kinds, only: wp
  use attrito_solve_solver, only: solver_type
  use attrito_integrate_loading, only: loading_type, new_loading, new_profile
  use attrito_integrate_state, only: state_type, new_state
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: loading_of, start_of, coordinates_of

contains

  !> The loads of a point.
  function loading_of(solver, system) result(loading)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    type(loading_type) :: loading
    real(wp) :: constant(2, 0)

    associate (balance => solver%context%balance)
      loading = new_loading(solver%omega, system%clock, matmul(system%static_loads, balance%static_factors), &
                            balance%level*system%harmonic_load, new_profile(constant), new_profile(constant))
    end associate
  end function loading_of

  !> Motion, rate and sliders at the start of the period; contacts are brought onto their law.
  function start_of(solver, system, slider) result(state)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Sliders, as the contacts have them [2, contacts]
    real(wp), intent(in) :: slider(:, :)
    type(state_type) :: state
    real(wp), allocatable :: q(:, :)
    real(wp) :: displacement(size(system%eigenvalues)), velocity(size(system%eigenvalues))
    integer :: h

    q = coordinates_of(solver)
    displacement = q(1, :)
    velocity = 0.0_wp
    do h = 1, size(q, 1)/2
      displacement = displacement + q(2*h, :)
      velocity = velocity + h*solver%omega*q(2*h + 1, :)
    end do
    state = new_state(system, matmul(displacement, system%weighted), matmul(velocity, system%weighted)/system%clock, &
                      slider)
  end function start_of

  !> Coefficients of the model's coordinates [2 H + 1, m].
  function coordinates_of(solver) result(q)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp), allocatable :: q(:, :)

    associate (balance => solver%context%balance)
      q = balance%receptance%displacements(balance%response)
    end associate
  end function coordinates_of
end module attrito_stability_start
