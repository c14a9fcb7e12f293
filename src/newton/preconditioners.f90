!> What the preconditioners of GMRES are made of, kept from one linear system to the next.
module attrito_newton_preconditioners
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_newton_mean_contacts, only: mean_contacts_type
  use attrito_newton_tangent_factors, only: tangent_factors_type
  use attrito_newton_tangent_reference, only: tangent_reference_type
  use attrito_newton_two_level_factors, only: two_level_factors_type
  implicit none
  private
  public :: preconditioners_type

  !> Iterations of GMRES that a step preconditioned on two levels is expected to take until there is one
  real(wp), parameter :: two_level_iterations_at_first = 60.0_wp ! measured

  type :: preconditioners_type
    type(two_level_factors_type) :: two_level
    !> Where most of what moves is open
    type(tangent_reference_type) :: reference
    type(tangent_factors_type) :: left_over
    !> For contacts on which two levels take too many iterations
    type(mean_contacts_type) :: mean
    !> Of GMRES on two levels, the last time that their factors had just been made
    real(wp) :: two_level_iterations = two_level_iterations_at_first
  contains
    procedure :: keep
  end type preconditioners_type

contains

  !> Save or load what the next point depends on. Factors are made anew by it, whether this process solves it or another.
  subroutine keep(self, store)
    class(preconditioners_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    self%two_level = two_level_factors_type()
    self%left_over = tangent_factors_type()
    call self%reference%keep(store)
    call self%mean%keep(store)
    call store%keep(self%two_level_iterations)
  end subroutine keep
end module attrito_newton_preconditioners
