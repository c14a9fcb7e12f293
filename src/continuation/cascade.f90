!> Getting to a point by trying, in order: the point before; motion in time; the stuck response; the frequency in smaller steps; the
!> force in steps.
!>
!> Newton's method is the hard part at the onset of gross slip. Motion in time that goes the same way every period says that there is
!> no orbit to look for; what has not settled after all of its starts says that it came to none. Nothing is dropped in silence: what
!> fails leaves the solver where it was, with a report that says so.
module attrito_continuation_cascade
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_continuation_solver, only: solver_type
  use attrito_continuation_start_in_time, only: has_time, solve_in_time
  implicit none
  private
  public :: solve_by_cascade, solve_by_attempt, march_along, way_type, place_type, place_of, return_to

  !> Smallest part of the way taken in one step
  real(wp), parameter :: smallest_step = 1.0_wp/128.0_wp

  ! The attempts, in their order
  integer, parameter :: from_here_briefly = 1, from_motion_in_time = 2, from_here = 3, from_stuck_response = 4, by_frequency = 5, &
                        by_level = 6
  integer, parameter :: attempts(6) = [from_here_briefly, from_motion_in_time, from_here, from_stuck_response, by_frequency, &
                                       by_level]

  !> Iterations after which a way of small steps is given up
  integer, parameter :: way_iterations = 200

  !> Motion, sliders and which of them are periodic, angular frequency, and whether every contact stuck there
  type :: place_type
    real(wp), allocatable :: motion(:, :), slider(:, :)
    logical, allocatable :: periodic(:)
    real(wp) :: omega = 0.0_wp
    logical :: all_stick = .false.
  contains
    procedure :: keep
  end type place_type

  !> A way from 0 to 1 along which some parameter goes from where it is to where it should be.
  type, abstract :: way_type
  contains
    procedure(solve_part), deferred :: solve
  end type way_type

  abstract interface
    !> Solve at a part t of the way, and say whether it converged.
    subroutine solve_part(self, solver, t, converged)
      import :: way_type, solver_type, wp
      class(way_type), intent(in) :: self
      type(solver_type), intent(inout) :: solver
      real(wp), intent(in) :: t
      logical, intent(out) :: converged
    end subroutine solve_part
  end interface

  !> From one angular frequency to another
  type, extends(way_type) :: frequency_way_type
    real(wp) :: from = 0.0_wp, to = 0.0_wp
  contains
    procedure :: solve => solve_frequency
  end type frequency_way_type

  !> From no harmonic load to its level, at one angular frequency
  type, extends(way_type) :: level_way_type
    real(wp) :: omega = 0.0_wp, level = 1.0_wp
  contains
    procedure :: solve => solve_level
  end type level_way_type

contains

  !> Solve at an angular frequency, the harmonic load at its level. Newton's method from the point before is given up early where
  !> motion in time has other starts, and tried to its end when these have failed.
  subroutine solve_by_cascade(solver, omega)
    type(solver_type), intent(inout) :: solver
    !> Target
    real(wp), intent(in) :: omega
    type(place_type) :: before
    integer :: iterations, attempt
    logical :: converged

    solver%no_orbit_in_time = .false.
    solver%walks = .false.
    call solver%solve_stuck_at(omega, converged)
    if (converged) return
    before = place_of(solver)
    iterations = 0
    do attempt = 1, size(attempts)
      if (.not. has_time(solver) .and. any(attempts(attempt) == [from_here_briefly, from_motion_in_time])) cycle
      call try(solver, attempts(attempt), omega, before, iterations, converged)
      if (converged) exit
      call return_to(solver, before)
      if (solver%walks) exit
    end do
    if (converged) solver%no_orbit_in_time = .false.
    ! The last step of a way that was given up may have converged, elsewhere.
    solver%report%converged = converged
    solver%report%iterations = iterations
  end subroutine solve_by_cascade

  !> Solve at an angular frequency by one attempt alone, for methods to be compared; the solver stays where it gets to, or returns.
  subroutine solve_by_attempt(solver, attempt, omega)
    type(solver_type), intent(inout) :: solver
    !> Place in the order above, from 1
    integer, intent(in) :: attempt
    real(wp), intent(in) :: omega
    type(place_type) :: before
    integer :: iterations
    logical :: converged

    solver%no_orbit_in_time = .false.
    solver%walks = .false.
    before = place_of(solver)
    iterations = 0
    call try(solver, attempt, omega, before, iterations, converged)
    if (converged) solver%no_orbit_in_time = .false.
    if (.not. converged) call return_to(solver, before)
    solver%report%converged = converged
    solver%report%iterations = iterations
  end subroutine solve_by_attempt

  !> One attempt from a place at which the solver stands.
  subroutine try(solver, attempt, omega, before, iterations, converged)
    type(solver_type), intent(inout) :: solver
    integer, intent(in) :: attempt
    real(wp), intent(in) :: omega
    type(place_type), intent(in) :: before
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    real(wp) :: level

    converged = .false.
    select case (attempt)
     case (from_here_briefly)
      solver%brief = .true.
      call solve_here(solver, omega, iterations, converged)
      solver%brief = .false.
     case (from_motion_in_time)
      if (has_time(solver)) call solve_in_time(solver, omega, iterations, converged)
     case (from_here)
      call solve_here(solver, omega, iterations, converged)
     case (from_stuck_response)
      call solve_from_stuck(solver, omega, iterations, converged)
     case (by_frequency)
      call march_along(frequency_way_type(before%omega, omega), solver, iterations, converged, most_iterations=way_iterations)
     case default  ! by_level
      level = solver%context%balance%level
      solver%motion(2:, :) = 0.0_wp
      call march_along(level_way_type(omega, level), solver, iterations, converged, most_iterations=way_iterations)
      call solver%set_loads(solver%context%balance%static_factors, level)
    end select
  end subroutine try

  !> From the motion that the solver stands at.
  subroutine solve_here(solver, omega, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged

    call solver%solve_at(omega)
    iterations = iterations + solver%report%iterations
    converged = solver%report%converged
  end subroutine solve_here

  !> From the response with every contact stuck.
  subroutine solve_from_stuck(solver, omega, iterations, converged)
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: omega
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    integer :: status

    call solver%context%balance%receptance%set_frequency(omega, status)
    converged = .false.
    if (status /= 0) return
    solver%motion = solver%context%balance%linear_motion()
    call solve_here(solver, omega, iterations, converged)
  end subroutine solve_from_stuck

  !> Put down in a store, or taken up from it.
  subroutine keep(self, store)
    class(place_type), intent(inout) :: self
    type(state_store_type), intent(inout) :: store

    call store%keep(self%motion)
    call store%keep(self%slider)
    call store%keep(self%periodic)
    call store%keep(self%omega)
    call store%keep(self%all_stick)
  end subroutine keep

  !> Where a solver stands.
  function place_of(solver) result(place)
    type(solver_type), intent(in) :: solver
    type(place_type) :: place

    place%motion = solver%motion
    place%slider = solver%context%balance%slider
    place%periodic = solver%context%balance%periodic
    place%omega = solver%omega
    place%all_stick = solver%all_stick
  end function place_of

  !> Let a solver stand at a place.
  subroutine return_to(solver, place)
    type(solver_type), intent(inout) :: solver
    type(place_type), intent(in) :: place

    solver%motion = place%motion
    solver%omega = place%omega
    solver%all_stick = place%all_stick
    call solver%set_slider(place%slider, place%periodic)
  end subroutine return_to

  subroutine solve_frequency(self, solver, t, converged)
    class(frequency_way_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: t
    logical, intent(out) :: converged

    call solver%solve_at(self%from + t*(self%to - self%from))
    converged = solver%report%converged
  end subroutine solve_frequency

  subroutine solve_level(self, solver, t, converged)
    class(level_way_type), intent(in) :: self
    type(solver_type), intent(inout) :: solver
    real(wp), intent(in) :: t
    logical, intent(out) :: converged

    call solver%set_loads(solver%context%balance%static_factors, t*self%level)
    call solver%solve_at(self%omega)
    converged = solver%report%converged
  end subroutine solve_level

  !> March a way from 0 to 1, halving the step where it fails.
  subroutine march_along(way, solver, iterations, converged, first_step, most_iterations)
    class(way_type), intent(in) :: way
    type(solver_type), intent(inout) :: solver
    !> Counts on
    integer, intent(inout) :: iterations
    logical, intent(out) :: converged
    !> A quarter unless given
    real(wp), intent(in), optional :: first_step
    !> After which it is given up; never unless given
    integer, intent(in), optional :: most_iterations
    real(wp) :: reached, step, largest_step
    logical :: done
    integer :: budget

    budget = huge(1)
    if (present(most_iterations)) budget = iterations + most_iterations
    reached = 0.0_wp
    largest_step = 0.25_wp
    if (present(first_step)) largest_step = first_step
    step = largest_step
    do while (reached < 1.0_wp .and. iterations < budget)
      step = min(step, 1.0_wp - reached)
      call way%solve(solver, reached + step, done)
      iterations = iterations + solver%report%iterations
      if (done) then
        reached = merge(1.0_wp, reached + step, reached + step > 1.0_wp - 1.0e-9_wp)
        step = min(2.0_wp*step, largest_step)
      else
        step = 0.5_wp*step
        if (step < min(smallest_step, 0.1_wp*largest_step)) exit
      end if
    end do
    converged = reached >= 1.0_wp
  end subroutine march_along
end module attrito_continuation_cascade
