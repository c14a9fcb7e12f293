!> Points of branches that are stored: to return to, and to decide whether a solution lies on one of those branches.
!>
!> A solution x at omega lies on a stored branch if Newton's method converges to x from the arc between two neighbouring points of it
!> (`attrito_continuation_arc`; the straight line where tangents are not known), where that has the frequency omega. So steps may be
!> long, and members of one family count as one.
module attrito_continuation_stored_points
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_solve_rigid_drift, only: mean_share
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_arc, only: hermite
  use attrito_continuation_tangent, only: tangent_type
  implicit none
  private
  public :: stored_points_type

  !> Distance of two motions, relative to the larger, that is none
  real(wp), parameter :: same = 1.0e-6_wp ! derived
  !> Parts of an arc between which its frequency is taken to be linear
  integer, parameter :: parts = 16 ! guess
  !> Distance from the arc, in the distance of its ends and relative to the motion, beyond which a solution is not looked for there
  real(wp), parameter :: near_line = 1.0_wp, near_motion = 0.2_wp ! guess

  type :: stored_point_type
    real(wp) :: omega = 0.0_wp
    !> Of all rows [2 H + 1, rows] and contacts [2, contacts]; 1 where a slider is periodic, else 0 [1, contacts]
    real(wp), allocatable :: motion(:, :), slider(:, :), periodic(:, :)
    !> Does the branch go on from the point before?
    logical :: follows = .false.
    !> Change of motion and angular frequency along the branch, if known, and the length of the arc that ends here; 0: a straight line
    real(wp), allocatable :: rate(:, :)
    real(wp) :: omega_rate = 0.0_wp, length = 0.0_wp
  end type stored_point_type

  type :: stored_points_type
    type(stored_point_type), allocatable :: points(:)
    !> How many there are
    integer :: count = 0
  contains
    procedure :: add
    procedure :: drop_from
    procedure :: restore_point
    procedure :: contains_solution
    procedure :: own_motion
    procedure :: keep
  end type stored_points_type

contains

  !> Add the solver's present point; with its tangent, and the length of the arc that ends there, if they are known.
  subroutine add(self, solver, follows, tangent, length)
    class(stored_points_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Does the branch go on from the point that was added last?
    logical, intent(in) :: follows
    !> Tangent of the branch; length of the arc
    type(tangent_type), intent(in), optional :: tangent
    real(wp), intent(in), optional :: length
    type(stored_point_type), allocatable :: more(:)
    integer :: i

    if (.not. allocated(self%points)) allocate (self%points(64))
    if (self%count == size(self%points)) then
      allocate (more(2*self%count))
      do i = 1, self%count
        call move_alloc(self%points(i)%motion, more(i)%motion)
        call move_alloc(self%points(i)%slider, more(i)%slider)
        call move_alloc(self%points(i)%periodic, more(i)%periodic)
        if (allocated(self%points(i)%rate)) call move_alloc(self%points(i)%rate, more(i)%rate)
        more(i)%omega_rate = self%points(i)%omega_rate
        more(i)%length = self%points(i)%length
        more(i)%omega = self%points(i)%omega
        more(i)%follows = self%points(i)%follows
      end do
      call move_alloc(more, self%points)
    end if
    self%count = self%count + 1
    associate (point => self%points(self%count), balance => solver%context%balance, contacts => size(solver%contacts%law))
      point%omega = solver%omega
      point%follows = follows
      allocate (point%motion(size(solver%motion, 1), size(solver%contacts%directions, 2)))
      allocate (point%slider(size(balance%slider, 1), contacts), point%periodic(1, contacts))
      call balance%ranks%gather_columns_everywhere(solver%motion, point%motion)
      call balance%ranks%gather_columns_everywhere(balance%slider, point%slider)
      call balance%ranks%gather_columns_everywhere(reshape(merge(1.0_wp, 0.0_wp, balance%periodic), [1, size(balance%periodic)]), &
                                                   point%periodic)
      if (.not. present(tangent)) return
      if (.not. allocated(tangent%motion) .or. tangent%share < mean_share) return
      allocate (point%rate, mold=point%motion)
      call balance%ranks%gather_columns_everywhere(solver%context%motion_scale/tangent%share*tangent%motion, point%rate)
      point%omega_rate = solver%context%frequency_scale/tangent%share*tangent%omega
      if (follows .and. present(length)) point%length = length
    end associate
  end subroutine add

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(stored_points_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store
    integer :: i

    call store%keep(self%count)
    if (store%reading) then
      if (allocated(self%points)) deallocate (self%points)
      if (self%count > 0) allocate (self%points(max(64, self%count)))
    end if
    do i = 1, self%count
      call store%keep(self%points(i)%omega)
      call store%keep(self%points(i)%motion)
      call store%keep(self%points(i)%slider)
      call store%keep(self%points(i)%periodic)
      call store%keep(self%points(i)%follows)
      call store%keep(self%points(i)%rate)
      call store%keep(self%points(i)%omega_rate)
      call store%keep(self%points(i)%length)
    end do
  end subroutine keep

  !> Forget a point and all after it.
  pure subroutine drop_from(self, number)
    class(stored_points_type), intent(inout) :: self
    !> Number of the stored point
    integer, intent(in) :: number
    integer :: i

    do i = number, self%count
      self%points(i) = stored_point_type()
    end do
    self%count = min(self%count, number - 1)
  end subroutine drop_from

  !> Set the solver to a stored point.
  subroutine restore_point(self, solver, number)
    class(stored_points_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Number of the stored point
    integer, intent(in) :: number

    associate (point => self%points(number), balance => solver%context%balance)
      associate (contacts => size(balance%law), contact => balance%first_contact)
        solver%motion = self%own_motion(solver, number)
        solver%omega = point%omega
        solver%all_stick = .false.
        call solver%set_slider(point%slider(:, contact:contact + contacts - 1), &
                               point%periodic(1, contact:contact + contacts - 1) > 0.5_wp)
      end associate
    end associate
  end subroutine restore_point

  !> Is the solver on a known branch? It is still there afterwards.
  logical function contains_solution(self, solver, up_to)
    class(stored_points_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Number of the last point that is looked at
    integer, intent(in) :: up_to
    type(snapshot_type) :: here
    real(wp), allocatable :: start(:, :)
    real(wp) :: omega(0:parts), width
    integer :: i, j, attempt

    contains_solution = .false.
    here = snapshot_of(solver)
    do i = 2, min(self%count, up_to)
      if (.not. self%points(i)%follows) cycle
      omega = [(omega_between(self, i, real(j, wp)/parts), j=0, parts)] - here%omega
      do j = 1, parts
        if (omega(j - 1)*omega(j) > 0.0_wp) cycle
        start = motion_between(self, solver, i, (j - 1 + zero_between(omega(j - 1), omega(j)))/parts)
        width = distance(solver, self%own_motion(solver, i - 1), self%own_motion(solver, i))
        if (distance(solver, start, here%motion) > near_line*width + near_motion*size_of(solver, here%motion)) cycle
        ! With the sliders of the solution, and with those of the branch: where all stick both give the same harmonics.
        do attempt = 1, 2
          if (attempt == 2) call self%restore_point(solver, i - 1)
          solver%motion = start
          call solver%solve_at(here%omega)
          if (solver%report%converged) then
            contains_solution = distance(solver, solver%motion, here%motion) <= same*size_of(solver, here%motion)
          end if
          call restore(solver, here)
          if (contains_solution) return
        end do
      end do
    end do
  end function contains_solution

  !> Where the straight line from a to b is zero, 0 to 1; a and b differ in sign, or one is zero.
  pure real(wp) function zero_between(a, b)
    !> Values at both ends
    real(wp), intent(in) :: a, b

    zero_between = 0.5_wp
    if (abs(a - b) > 0.0_wp) zero_between = a/(a - b)
  end function zero_between

  !> Angular frequency of the branch at a part of the way to a point.
  pure real(wp) function omega_between(self, number, part) result(omega)
    type(stored_points_type), intent(in) :: self
    !> Number of the stored point that the way leads to
    integer, intent(in) :: number
    !> 0 to 1
    real(wp), intent(in) :: part

    associate (a => self%points(number - 1), b => self%points(number))
      if (allocated(a%rate) .and. b%length > 0.0_wp) then
        omega = dot_product(hermite(part), [a%omega, b%length*a%omega_rate, b%omega, b%length*b%omega_rate])
      else
        omega = a%omega + part*(b%omega - a%omega)
      end if
    end associate
  end function omega_between

  !> Motion of this rank's rows there.
  function motion_between(self, solver, number, part) result(motion)
    type(stored_points_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Number of the stored point that the way leads to
    integer, intent(in) :: number
    !> 0 to 1
    real(wp), intent(in) :: part
    real(wp), allocatable :: motion(:, :)
    real(wp) :: weights(4)

    associate (a => self%points(number - 1), b => self%points(number))
      if (allocated(a%rate) .and. b%length > 0.0_wp) then
        weights = hermite(part)
        motion = own_rows(solver, weights(1)*resized(a%motion, size(b%motion, 1)) + weights(3)*b%motion &
                          + b%length*(weights(2)*resized(a%rate, size(b%motion, 1)) + weights(4)*b%rate))
      else
        motion = self%own_motion(solver, number - 1)
        motion = motion + part*(self%own_motion(solver, number) - motion)
      end if
    end associate
  end function motion_between

  !> A point's motion of this rank's rows, in as many harmonics as the solver has.
  function own_motion(self, solver, number) result(motion)
    class(stored_points_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Number of the stored point
    integer, intent(in) :: number
    real(wp), allocatable :: motion(:, :)

    motion = own_rows(solver, self%points(number)%motion)
  end function own_motion

  !> This rank's rows of a motion of all rows, in as many harmonics as the solver has.
  function own_rows(solver, all) result(motion)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> [2 H + 1, rows]
    real(wp), intent(in) :: all(:, :)
    real(wp), allocatable :: motion(:, :)

    associate (balance => solver%context%balance)
      motion = resized(all(:, balance%first_row:balance%first_row + balance%rows() - 1), size(solver%motion, 1))
    end associate
  end function own_rows

  !> Distance of two motions of this rank's rows, without their means: those of one family differ in them.
  real(wp) function distance(solver, a, b)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of a motion
    real(wp), intent(in) :: a(:, :), b(:, :)

    distance = size_of(solver, b - a)
  end function distance

  real(wp) function size_of(solver, motion)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)

    size_of = solver%context%balance%norm(motion(2:, :))
  end function size_of
end module attrito_continuation_stored_points
