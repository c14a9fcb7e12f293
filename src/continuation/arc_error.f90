!> How far the drawn arc lies from the branch, by points of the branch between its ends.
!>
!> Where every contact sticks these are points of the linear response, resonances among them; else points that a few steps of Newton's
!> method lead to (`attrito_continuation_between`).
module attrito_continuation_arc_error
  use attrito_core_kinds, only: wp
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_arc, only: arc_type
  use attrito_continuation_between, only: estimate_between, stuck_point
  use attrito_continuation_curve_point, only: curve_point_type
  use attrito_continuation_step, only: step_type
  implicit none
  private
  public :: arc_error_type, error_of_arc

  !> Parts of an arc at which it is held against the branch: a contact that begins to slip or to open may leave the middle as it is
  real(wp), parameter :: looked_at(2) = [1.0_wp/3.0_wp, 2.0_wp/3.0_wp] ! guess
  !> Distance of a point of the branch from the arc, relative to the motion, beyond which the ends are not of one branch
  real(wp), parameter :: most_off = 0.5_wp ! guess

  type :: arc_error_type
    !> Distance of the drawn arc from the branch, part of the largest amplitudes
    real(wp) :: distance = 0.0_wp
    !> Distance of the branch's motion from the arc's, relative to what is another branch's
    real(wp) :: off = 0.0_wp
  end type arc_error_type

contains

  !> How far the drawn arc that ends at a point is from the branch.
  type(arc_error_type) function error_of_arc(solver, step, arc, largest, enough) result(error)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Step along the branch, whose arc is known
    type(step_type), intent(in) :: step
    !> The same, drawn
    type(arc_type), intent(in) :: arc
    !> Largest amplitudes [monitors]
    real(wp), intent(in) :: largest(:)
    !> Error that is accepted; beyond it the arc is looked at no further
    real(wp), intent(in) :: enough
    !> Parts of the frequency at which a linear response is looked at, and most of its resonances
    integer, parameter :: parts = 4, most_resonances = 20 ! guess
    type(curve_point_type) :: between
    real(wp) :: off
    real(wp), allocatable :: omega(:)
    integer :: i, status

    if (step%from%all_stick .and. step%to%all_stick) then
      omega = [(arc%from%omega + real(i, wp)/parts*(arc%to%omega - arc%from%omega), i=1, parts - 1), &
               resonances_between(solver, arc%from%omega, arc%to%omega)]
      do i = 1, min(size(omega), parts - 1 + most_resonances)
        call stuck_point(solver, omega(i), between, status)
        if (status == 0) error%distance = max(error%distance, arc%distance_of(between, max(largest, between%amplitude)))
      end do
    else
      do i = 1, size(looked_at)
        call estimate_between(solver, step, looked_at(i), enough, between, off, status)
        if (status /= 0) cycle
        error%distance = max(error%distance, arc%distance_of(between, max(largest, between%amplitude)))
        error%off = max(error%off, off/most_off)
        if (error%distance > enough .or. error%off > 1.0_wp) exit
      end do
    end if
  end function error_of_arc

  !> Angular frequencies between two at which a loaded harmonic excites a mode of the stuck system.
  pure function resonances_between(solver, a, b) result(omega)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: a, b
    real(wp), allocatable :: omega(:), at(:)
    integer :: i

    allocate (omega(0))
    do i = 1, size(solver%context%balance%loaded)
      associate (harmonic => solver%context%balance%loaded(i))
        at = solver%stuck%omega_at(harmonic)/harmonic
        omega = [omega, pack(at, (at - a)*(at - b) < 0.0_wp)]
      end associate
    end do
  end function resonances_between
end module attrito_continuation_arc_error
