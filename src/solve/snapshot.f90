!> The point that a solver is at, as a copy: to restore it later, or as an end of a step.
module attrito_solve_snapshot
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: snapshot_type, snapshot_of, restore

  !> Motion, sliders and which of them are periodic, angular frequency, and whether every contact stuck there
  type :: snapshot_type
    real(wp), allocatable :: motion(:, :), slider(:, :)
    logical, allocatable :: periodic(:)
    real(wp) :: omega = 0.0_wp
    logical :: all_stick = .false.
  contains
    procedure :: take
    procedure :: exchange
    procedure :: keep
  end type snapshot_type

contains

  !> Of a solver's present point.
  function snapshot_of(solver) result(snapshot)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(snapshot_type) :: snapshot

    call snapshot%take(solver)
  end function snapshot_of

  !> Set a solver to a snapshot.
  subroutine restore(solver, snapshot)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(in) :: snapshot

    solver%motion = snapshot%motion
    solver%omega = snapshot%omega
    solver%all_stick = snapshot%all_stick
    call solver%set_slider(snapshot%slider, snapshot%periodic)
  end subroutine restore

  !> Take a solver's present point; one copy fewer than assigning `snapshot_of`.
  subroutine take(self, solver)
    class(snapshot_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver

    self%motion = solver%motion
    self%slider = solver%context%balance%slider
    self%periodic = solver%context%balance%periodic
    self%omega = solver%omega
    self%all_stick = solver%all_stick
  end subroutine take

  !> Swap with another, without a copy.
  subroutine exchange(self, other)
    class(snapshot_type), intent(inout) :: self
    !> Motion, sliders and frequency to return to
    type(snapshot_type), intent(inout) :: other
    type(snapshot_type) :: third

    call move(self, third)
    call move(other, self)
    call move(third, other)

  contains

    subroutine move(a, b)
      !> Motion, sliders and frequency to return to
      type(snapshot_type), intent(inout) :: a, b

      call move_alloc(a%motion, b%motion)
      call move_alloc(a%slider, b%slider)
      call move_alloc(a%periodic, b%periodic)
      b%omega = a%omega
      b%all_stick = a%all_stick
    end subroutine move
  end subroutine exchange

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(snapshot_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%motion)
    call store%keep(self%slider)
    call store%keep(self%periodic)
    call store%keep(self%omega)
    call store%keep(self%all_stick)
  end subroutine keep
end module attrito_solve_snapshot
