!> The highest of maxima that stand close beside each other.
!>
!> If contacts with two tangents are sampled the slope of the response jumps whenever one of the samples begins to slip. A peak
!> then has several maxima, parts of a thousand apart in height and in frequency, and to climb ends at any of them. From one of them
!> the response is followed to either side, by relative changes of the motion up to the last of `distances`, or until it has fallen.
!> An arc whose amplitude rises at its beginning and falls at its end stays below where the tangents at both meet: of arcs that may
!> lead above the maximum those that may lead highest are tried first.
module attrito_peak_highest_maximum
  use attrito_core_kinds, only: wp
  use attrito_solve_snapshot, only: restore
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_tangent, only: frequency_tangent, reverse
  use attrito_peak_climb, only: branch_seed_type, climb, close_in, look_around, take_step
  use attrito_peak_condition, only: problem_type
  implicit none
  private
  public :: climb_to_highest

  !> Relative changes of the motion, angles on the circle of a single mode, from the maximum to where the response is looked at
  real(wp), parameter :: distances(8) = [0.004_wp, 0.008_wp, 0.015_wp, 0.03_wp, 0.05_wp, 0.08_wp, 0.12_wp, 0.17_wp] ! guess
  !> What a maximum must be higher by, relative; what the response falls by where no other maximum of the peak is
  real(wp), parameter :: higher_by = 1.0e-5_wp, fallen = 0.02_wp ! guess
  !> From prediction to correction, relative to the motion
  real(wp), parameter :: accepted_error = 0.3_wp ! guess
  integer, parameter :: most_climbs = 4, most_arcs = 3 ! conventional

  !> A piece of the response, and its length along the tangent at its beginning
  type :: arc_type
    type(branch_seed_type) :: begin, end
    real(wp) :: length = 0.0_wp
  contains
    procedure :: encloses_maximum
    procedure :: reach
  end type arc_type

contains

  !> From the maximum where the solver is to the highest about it.
  subroutine climb_to_highest(problem, solver, iterations, moved, at_corner)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Newton's iterations, counts on
    integer, intent(inout) :: iterations
    !> Is it another maximum than before?
    logical, intent(out) :: moved
    !> Is it a corner? As it was where it is the same
    logical, intent(inout) :: at_corner
    type(branch_seed_type) :: here, next
    type(arc_type) :: arcs(2*size(distances))
    integer :: i, j, order(size(arcs)), count
    logical :: looked, found, corner

    moved = .false.
    call look_here(problem, solver, here, looked)
    if (.not. looked) return
    do i = 1, most_climbs
      call look_beside(problem, solver, here, arcs, count, iterations)
      order(:count) = by_reach(arcs(:count))
      found = .false.
      do j = 1, min(count, most_arcs)
        call climb_on(problem, solver, arcs(order(j)), iterations, found, corner)
        if (found) call look_here(problem, solver, next, found)
        if (found) found = next%amplitude > here%amplitude
        if (found) exit
      end do
      if (.not. found) then
        call restore(solver, here%snapshot)
        exit
      end if
      moved = .true.
      at_corner = corner
      here = next
    end do
  end subroutine climb_to_highest

  !> Tangent and slope where the solver is, its balance having been evaluated elsewhere.
  subroutine look_here(problem, solver, here, looked)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(out) :: here
    !> Could they be found?
    logical, intent(out) :: looked
    integer :: status

    call solver%context%balance%evaluate(solver%motion, solver%omega, status)
    call solver%context%forget()
    looked = status == 0
    if (looked) call look_around(problem, solver, frequency_tangent(solver, 1.0_wp), here, looked)
  end subroutine look_here

  !> To the maximum within an arc, or uphill of its higher end.
  subroutine climb_on(problem, solver, arc, iterations, found, at_corner)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Where to look
    type(arc_type), intent(in) :: arc
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is there a maximum? Is it a corner?
    logical, intent(out) :: found, at_corner
    integer :: used

    if (arc%encloses_maximum()) then
      call restore(solver, arc%begin%snapshot)
      call close_in(problem, solver, arc%begin, arc%end, arc%length, iterations, found, at_corner)
      if (found) return
    end if
    if (arc%begin%amplitude > arc%end%amplitude) then
      call restore(solver, arc%begin%snapshot)
    else
      call restore(solver, arc%end%snapshot)
    end if
    call climb(problem, solver, used, found, at_corner)
    iterations = iterations + used
  end subroutine climb_on

  !> The arcs on either side that may lead above the maximum.
  subroutine look_beside(problem, solver, here, arcs, count, iterations)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> The maximum
    type(branch_seed_type), intent(in) :: here
    !> The arcs; how many there are
    type(arc_type), intent(inout) :: arcs(:)
    integer, intent(out) :: count
    !> Counts on
    integer, intent(inout) :: iterations
    type(branch_seed_type) :: at, next
    type(arc_type) :: arc
    real(wp) :: way, length
    integer :: side, i
    logical :: looked

    count = 0
    do side = 1, 2
      call restore(solver, here%snapshot)
      at = here
      if (side == 2) then
        call reverse(at%tangent)
        at%slope = -at%slope
      end if
      way = 0.0_wp
      do i = 1, size(distances)
        length = (distances(i) - way)*at%unit
        way = distances(i)
        call step_aside(problem, solver, at, length, next, iterations, looked)
        if (.not. looked) exit
        arc = arc_type(at, next, length)
        if (arc%reach() > log(here%amplitude) + higher_by) then
          count = count + 1
          arcs(count) = arc
        end if
        if (next%amplitude < (1.0_wp - fallen)*here%amplitude) exit
        at = next
      end do
    end do
  end subroutine look_beside

  !> A step along the response; by its frequency where Newton's method does not solve it across the tangent, as beyond a corner.
  subroutine step_aside(problem, solver, at, length, next, iterations, solved)
    !> Whose peak it is, and in what it is followed
    type(problem_type), intent(in) :: problem
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point of the response with its tangent and slope
    type(branch_seed_type), intent(in) :: at
    !> Length of the step
    real(wp), intent(in) :: length
    !> Where it leads
    type(branch_seed_type), intent(out) :: next
    !> Counts on
    integer, intent(inout) :: iterations
    !> Is the point solved?
    logical, intent(out) :: solved
    real(wp) :: error

    call take_step(solver, at, length, error)
    iterations = iterations + solver%report%iterations
    solved = solver%report%converged .and. error <= accepted_error
    if (.not. solved) then
      call restore(solver, at%snapshot)
      call solver%solve_at(at%snapshot%omega + length*solver%context%frequency_scale*at%tangent%omega)
      iterations = iterations + solver%report%iterations
      solved = solver%report%converged
    end if
    if (solved) call look_around(problem, solver, at%tangent, next, solved)
  end subroutine step_aside

  !> Arcs in the order of how high they may lead, the highest first.
  pure function by_reach(arcs) result(order)
    !> Some arcs
    type(arc_type), intent(in) :: arcs(:)
    integer :: order(size(arcs))
    real(wp) :: height(size(arcs))
    integer :: i

    do i = 1, size(arcs)
      height(i) = arcs(i)%reach()
    end do
    do i = 1, size(arcs)
      order(i) = maxloc(height, 1)
      height(order(i)) = -huge(1.0_wp)
    end do
  end function by_reach

  !> Does the amplitude rise at the beginning of an arc, and fall at its end?
  pure logical function encloses_maximum(self)
    class(arc_type), intent(in) :: self

    encloses_maximum = self%begin%slope > 0.0_wp .and. self%end%slope < 0.0_wp
  end function encloses_maximum

  !> How far log A may reach on an arc.
  pure real(wp) function reach(self)
    class(arc_type), intent(in) :: self
    real(wp) :: rise, part

    reach = log(max(self%begin%amplitude, self%end%amplitude))
    if (.not. self%encloses_maximum()) return
    rise = log(self%end%amplitude/self%begin%amplitude)
    part = (rise - self%length*self%end%slope)/(self%begin%slope - self%end%slope)
    reach = log(self%begin%amplitude) + self%begin%slope*min(max(part, 0.0_wp), self%length)
  end function reach
end module attrito_peak_highest_maximum
