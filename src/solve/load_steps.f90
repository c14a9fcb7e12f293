!> From one set of factors on the static loads to another, in increments as long as an estimate of their error lets them be.
!>
!> $$ K q_0 + B^T \lambda(B q_0, w) = \sum_i s_i f_i, \qquad e = \frac{\max_c k_t |w_c - w_c^{(1)}|}{3 \max N} $$
!>
!> Along an increment displacements go straight and sliders are exact (`attrito_contact_straight_increment`), which is of second
!> order. An increment that leaves every contact stuck or open is linear, and exact. Any other is solved as a whole, which leaves
!> sliders w^(1), and again in two halves, which are kept; a third of the difference is their error. Increments are halved until it
!> is accepted, and where one fails; the first half of what is rejected is the whole of the next.
module attrito_solve_load_steps
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: state_stuck, state_open
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: follow_loads, solve_increment

  !> Smallest increment, parts of the largest
  real(wp), parameter :: smallest = 1.0_wp/128.0_wp ! guess
  !> Error of an increment that is accepted, and the part of it below which the next is twice as long
  real(wp), parameter :: accepted_error = 1.0e-6_wp, short_of = 0.1_wp ! guess
  !> The share of a difference between one increment and two that is the error of the two, by their order
  real(wp), parameter :: share = 1.0_wp/3.0_wp ! derived

  !> The way from the factors `from` to the factors `to`
  type :: way_type
    real(wp), allocatable :: from(:), to(:)
    real(wp) :: omega = 0.0_wp
    !> How far the increments that were taken have come, and where the solver is; the motion's rate there, by the last of them [rows]
    real(wp) :: reached = 0.0_wp, place = 0.0_wp
    real(wp), allocatable :: rate_reached(:), rate(:)
    !> Iterations so far, and whether the last solve converged
    integer :: iterations = 0
    logical :: found = .false.
    !> Which of this rank's contacts were open where the last increment that was taken ended, and the largest normal force so far
    logical, allocatable :: was_open(:)
    real(wp) :: force = 0.0_wp
  end type way_type

contains

  !> Follow the loads from where the solver is, at the first of them.
  subroutine follow_loads(solver, from, to, omega, least, iterations, converged)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Factors on the static loads
    real(wp), intent(in) :: from(:), to(:)
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega
    !> Increments at least
    integer, intent(in) :: least
    !> Counts on
    integer, intent(inout) :: iterations
    !> Was the end reached?
    logical, intent(out) :: converged
    type(way_type) :: way
    type(snapshot_type) :: start
    type(snapshot_type), allocatable :: whole
    real(wp) :: step, largest, error, aim

    way = way_type(from, to, omega, rate_reached=0.0_wp*solver%motion(1, :), rate=0.0_wp*solver%motion(1, :))
    allocate (way%was_open(size(solver%context%balance%law)), source=.false.)
    largest = 1.0_wp/max(1, (least + 1)/2)
    step = largest
    do while (way%reached < 1.0_wp)
      ! Sums of steps come to the end but for rounding: it is where the loads are those asked for, to the last digit.
      aim = way%reached + step
      if (aim > 1.0_wp - 1.0e-9_wp) aim = 1.0_wp
      step = aim - way%reached
      start = snapshot_of(solver)
      call try_increment(way, solver, aim, start, whole, error)
      if (way%found .and. (error <= accepted_error .or. 0.5_wp*step < smallest*largest)) then
        call arrive(way, solver, aim)
        if (allocated(whole)) deallocate (whole)
        if (error <= short_of*accepted_error) step = min(2.0_wp*step, largest)
      else
        call go_back(way, solver, start)
        step = 0.5_wp*step
        if (step < smallest*largest) exit
      end if
    end do
    iterations = iterations + way%iterations
    converged = way%reached >= 1.0_wp
  end subroutine follow_loads

  !> An increment as a whole, and unless it is linear in two halves, at the end of which the solver is then.
  subroutine try_increment(way, solver, aim, start, whole, error)
    !> How far it has come, and the factors it goes between
    type(way_type), intent(inout) :: way
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Part of the way at which it ends
    real(wp), intent(in) :: aim
    !> Where the increment starts
    type(snapshot_type), intent(in) :: start
    !> Where it ends as a whole, if that has been solved; then where the whole of its first half ends, if that has
    type(snapshot_type), allocatable, intent(inout) :: whole
    !> Estimated error of the end
    real(wp), intent(out) :: error
    type(snapshot_type) :: half

    error = 0.0_wp
    if (.not. allocated(whole)) then
      call solve_part(way, solver, aim)
      if (.not. way%found) return
      if (is_linear(way, solver)) return
      allocate (whole, source=snapshot_of(solver))
      call go_back(way, solver, start)
    end if
    call solve_part(way, solver, 0.5_wp*(way%reached + aim))
    half = snapshot_of(solver)
    if (way%found) then
      call solve_part(way, solver, aim)
      if (way%found) error = share*difference(way, solver, whole)
      whole = half
    else
      deallocate (whole)
    end if
  end subroutine try_increment

  !> The equilibrium at the end of an increment from where the solver is; nothing changes if there is none.
  subroutine solve_part(way, solver, place)
    !> How far it has come, and the factors it goes between
    type(way_type), intent(inout) :: way
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Part of the way at which the increment ends
    real(wp), intent(in) :: place

    real(wp) :: start(size(solver%motion, 2))

    start = solver%motion(1, :)
    call solver%set_loads((1.0_wp - place)*way%from + place*way%to, 0.0_wp)
    call solve_increment(solver, start, start + (place - way%place)*way%rate, way%omega)
    way%iterations = way%iterations + solver%report%iterations
    way%found = solver%report%converged
    if (.not. way%found) return
    way%rate = (solver%motion(1, :) - start)/(place - way%place)
    way%place = place
  end subroutine solve_part

  !> Go back to where the increment starts.
  subroutine go_back(way, solver, start)
    !> How far it has come
    type(way_type), intent(inout) :: way
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Where the increment starts
    type(snapshot_type), intent(in) :: start

    call restore(solver, start)
    way%place = way%reached
    way%rate = way%rate_reached
  end subroutine go_back

  !> The equilibrium at the solver's loads, to which contacts come straight from another place; nothing changes if there is none.
  subroutine solve_increment(solver, from, as_before, omega)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Mean of this rank's rows where the increment starts, whose sliders the solver has, and where it would end if they went on as in
    !> the increment before [rows]
    real(wp), intent(in) :: from(:), as_before(:)
    !> Angular frequency, which matters to nothing but the scales
    real(wp), intent(in) :: omega

    solver%context%balance%increment = reshape([from, as_before], [size(from), 2])
    call solver%context%forget()
    call solver%solve_at(omega)
    deallocate (solver%context%balance%increment)
    call solver%context%forget()
  end subroutine solve_increment

  !> Has every contact stuck along the last increment, or been open?
  logical function is_linear(way, solver)
    !> Contacts that were open where it began
    type(way_type), intent(in) :: way
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver
    real(wp) :: moving

    associate (state => solver%context%balance%forces%state)
      moving = merge(0.0_wp, 1.0_wp, all(state == state_stuck .or. (state == state_open .and. way%was_open)))
    end associate
    is_linear = solver%context%balance%ranks%largest(moving) <= 0.0_wp
  end function is_linear

  !> Take the end of the last increment.
  subroutine arrive(way, solver, aim)
    !> How far it has come
    type(way_type), intent(inout) :: way
    !> Solver of points: its balance
    type(solver_type), intent(in) :: solver
    !> Part of the way at which it is
    real(wp), intent(in) :: aim

    way%reached = aim
    way%place = aim
    way%rate_reached = way%rate
    way%was_open = solver%context%balance%forces%state == state_open
  end subroutine arrive

  !> The largest difference of friction forces between where the solver is and another end of the same increment, by the largest
  !> normal force so far.
  real(wp) function difference(way, solver, other)
    !> Largest normal force, which this raises
    type(way_type), intent(inout) :: way
    !> Solver of points: its motion and balance
    type(solver_type), intent(in) :: solver
    !> The other end
    type(snapshot_type), intent(in) :: other
    real(wp) :: largest
    integer :: e, i

    largest = 0.0_wp
    associate (balance => solver%context%balance)
      do i = 1, size(balance%law)
        associate (law => balance%law(i), forces => balance%forces(i))
          if (forces%state == state_open) cycle
          way%force = max(way%force, law%normal_force(solver%motion(1, law%first_row + law%tangents)))
          do e = 1, law%elements()
            associate (own => balance%slider(2*e - 1:2*e, i), others => other%slider(2*e - 1:2*e, i), part => law%part(e))
              largest = max(largest, part%stiffness*law%tangential_stiffness*norm2(own - others))
            end associate
          end do
        end associate
      end do
      way%force = balance%ranks%largest(way%force)
      difference = balance%ranks%largest(largest)/max(way%force, tiny(1.0_wp))
    end associate
  end function difference
end module attrito_solve_load_steps
