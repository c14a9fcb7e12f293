!> A place where a solver stands: to be remembered and come back to, or to be an end of a step.
module attrito_solve_snapshot
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: place_type, place_of, return_to

  !> Motion, sliders and which of them are periodic, angular frequency, and whether every contact stuck there
  type :: place_type
    real(wp), allocatable :: motion(:, :), slider(:, :)
    logical, allocatable :: periodic(:)
    real(wp) :: omega = 0.0_wp
    logical :: all_stick = .false.
  contains
    procedure :: mark
    procedure :: exchange
    procedure :: keep
  end type place_type

contains

  !> Where a solver stands.
  function place_of(solver) result(place)
    type(solver_type), intent(in) :: solver
    type(place_type) :: place

    call place%mark(solver)
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

  !> Be where a solver stands: a copy less than by assigning `place_of`.
  subroutine mark(self, solver)
    class(place_type), intent(inout) :: self
    type(solver_type), intent(in) :: solver

    self%motion = solver%motion
    self%slider = solver%context%balance%slider
    self%periodic = solver%context%balance%periodic
    self%omega = solver%omega
    self%all_stick = solver%all_stick
  end subroutine mark

  !> Change places with another.
  subroutine exchange(self, other)
    class(place_type), intent(inout) :: self
    type(place_type), intent(inout) :: other
    type(place_type) :: third

    call move(self, third)
    call move(other, self)
    call move(third, other)

  contains

    subroutine move(a, b)
      type(place_type), intent(inout) :: a, b

      call move_alloc(a%motion, b%motion)
      call move_alloc(a%slider, b%slider)
      call move_alloc(a%periodic, b%periodic)
      b%omega = a%omega
      b%all_stick = a%all_stick
    end subroutine move
  end subroutine exchange

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
end module attrito_solve_snapshot
