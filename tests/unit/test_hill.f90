!> Multipliers by Hill's problem: against the flow on event-exact orbits, and how they are refined with more harmonics.
program test_hill
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_integrate_loading, only: loading_type
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  use attrito_stability_contour, only: eigenvalues_within, polish
  use attrito_stability_orbit, only: orbit_type
  use attrito_stability_hill, only: hill_multipliers, half_strip, refined_heights
  use attrito_stability_hill_operator, only: hill_operator_type, new_hill_operator
  use attrito_stability_hill_problem, only: hill_problem_type, new_hill_problem
  use attrito_stability_hill_refinement, only: refine
  use attrito_stability_multipliers, only: multiplier_type, multipliers_of
  use scenes, only: wedge
  use session, only: run_in_session
  use testing, only: test, check, check_close
  use wedge_orbits, only: stiff_wedge, find_orbit
  implicit none

  call run_in_session('Hill''s problem', [ &
                      test('on the event-exact orbit both engines agree', exact_orbit), &
                      test('without its matrix it is the matrix times a vector', matrix_free), &
                      test('exponents are refined to those of the dense problem with as many harmonics', refinement)])

contains

  subroutine exact_orbit(error)
    type(error_type), allocatable, intent(out) :: error
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start
    type(orbit_type) :: orbit
    type(multiplier_type), allocatable :: flow(:), harmonics(:)
    real(wp) :: change
    integer :: info, modes, i

    do i = 1, 2
      if (i == 1) call find_orbit(wedge(45.0_wp), 132.0_wp, 5.0_wp, system, loading, start, orbit, error)
      if (i == 2) call find_orbit(stiff_wedge(), 110.0_wp, 1.0_wp, system, loading, start, orbit, error)
      if (allocated(error)) return
      call multipliers_of(system, orbit, flow, modes, change, info)
      call check(error, info == 0, 'no eigenvalues')
      call hill_multipliers(system, orbit%segments, loading%period, harmonics, info)
      call check(error, info == 0, 'no eigenvalues of Hill''s problem')
      if (allocated(error)) return
      ! Hill's problem leaves out what falls like the cube of its harmonics: 1e-3 (120/1023)^3 at most.
      call check_close(error, reshape(harmonics%value, [size(harmonics), 1]), reshape(flow%value, [size(flow), 1]), &
                       2.0e-6_wp, 'multipliers')
    end do
  end subroutine exact_orbit

  subroutine matrix_free(error)
    type(error_type), allocatable, intent(out) :: error
    complex(wp), parameter :: s = (-0.1_wp, 0.3_wp)
    type(hill_problem_type) :: problem
    type(hill_operator_type) :: operator
    complex(wp), allocatable :: g(:), matrix(:, :), without(:)
    integer :: i

    call hill_of_wedge(20, problem, error)
    if (allocated(error)) return
    g = [(cmplx(cos(0.7_wp*i), sin(1.3_wp*i**2), wp), i=1, problem%unknowns())]
    matrix = problem%at(s)
    call new_hill_operator(problem, operator)
    call operator%set_exponent(problem, s)
    without = operator%multiply(problem, g)
    ! Transforms of 128 terms of order one
    call check_close(error, reshape(without, [size(g), 1]), reshape(matmul(matrix, g), [size(g), 1]), 1.0e-12_wp, 'F g')
    call operator%destroy()
  end subroutine matrix_free

  subroutine refinement(error)
    type(error_type), allocatable, intent(out) :: error
    type(hill_problem_type) :: few, many
    complex(wp), allocatable :: exponents(:), dense(:), vectors(:, :), start(:, :), vector(:)
    integer, allocatable :: within(:)
    integer :: i, info
    logical :: good

    call hill_of_wedge(15, few, error)
    if (.not. allocated(error)) call hill_of_wedge(45, many, error)
    if (allocated(error)) return
    call eigenvalues_within(few, half_strip(), few%unknowns(), exponents, vectors, info)
    within = pack([(i, i=1, size(exponents))], aimag(exponents) > refined_heights(1) .and. aimag(exponents) < refined_heights(2))
    exponents = exponents(within)
    vectors = vectors(:, within)
    call check(error, info == 0 .and. size(within) > 1, 'the test is void')
    if (allocated(error)) return
    dense = exponents
    do i = 1, size(dense)
      allocate (start(-45:45, size(many%row)), source=(0.0_wp, 0.0_wp))
      start(-15:15, :) = reshape(vectors(:, i), [31, size(many%row)])
      vector = reshape(start, [size(start)])
      deallocate (start)
      call polish(many, exponents(i), vector, dense(i), good)
      call check(error, good .and. abs(dense(i) - exponents(i)) > 1.0e-7_wp, 'the test is void')
    end do
    call refine(few, many, refined_heights, vectors, exponents)
    ! Newton's last step is at most 1e-7, and a thousandth of it wrong.
    call check_close(error, reshape(exponents, [size(dense), 1]), reshape(dense, [size(dense), 1]), 1.0e-9_wp, 'exponents')
  end subroutine refinement

  !> Of the stiff wedge's orbit at 110 Hz.
  subroutine hill_of_wedge(harmonics, problem, error)
    integer, intent(in) :: harmonics
    type(hill_problem_type), intent(out) :: problem
    type(error_type), allocatable, intent(inout) :: error
    type(system_type) :: system
    type(loading_type) :: loading
    type(state_type) :: start
    type(orbit_type) :: orbit

    call find_orbit(stiff_wedge(), 110.0_wp, 1.0_wp, system, loading, start, orbit, error)
    if (allocated(error)) return
    call new_hill_problem(system, orbit%segments, two_pi/loading%period, problem, harmonics)
  end subroutine hill_of_wedge
end program test_hill
