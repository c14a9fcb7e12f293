!> Time integration as a source of starts for Newton's method: what a solver asks of an integrator.
module attrito_solve_time_integrator
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: time_integrator_type, excitation_type, periods_type

  !> Loads under which it moves
  type :: excitation_type
    !> Angular frequency, rad/s
    real(wp) :: omega = 0.0_wp
    !> Factors on the static loads [loads], and level of the harmonic ones
    real(wp), allocatable :: static_factors(:)
    real(wp) :: level = 1.0_wp
  end type excitation_type

  !> Average over some periods
  type :: periods_type
    !> .false.: a step found no solution, and nothing else is set
    logical :: moved = .false.
    !> Mean of the periods: coefficients of the relative displacements of all rows [2 H + 1, rows]
    real(wp), allocatable :: motion(:, :)
    !> Of all contacts at the starts of periods, in the mean [2, contacts]
    real(wp), allocatable :: slider(:, :)
    !> Change of the displacements over the last period, relative to their first harmonic
    real(wp) :: change = huge(1.0_wp)
    !> Did each of the last periods change the displacements by the same amount?
    logical :: is_drifting = .false.
    !> Largest contact force, and what errors of the displacements are in it at most
    real(wp) :: force = 0.0_wp, force_error = 0.0_wp
  end type periods_type

  type, abstract :: time_integrator_type
  contains
    procedure(set_state), deferred :: set_state
    procedure(average_over), deferred :: average_over
  end type time_integrator_type

  abstract interface
    !> Set the state, at the start of a period of the excitation.
    subroutine set_state(self, displacement, velocity, slider, is_set)
      import :: time_integrator_type, wp
      class(time_integrator_type), intent(inout) :: self
      !> Of the model's coordinates [m]
      real(wp), intent(in) :: displacement(:), velocity(:)
      !> Of all contacts [2, contacts]
      real(wp), intent(in) :: slider(:, :)
      !> .false.: this structure has no motion in time
      logical, intent(out) :: is_set
    end subroutine set_state

    !> Integrate over some periods in which transients fade, and average over some more.
    subroutine average_over(self, excitation, harmonics, count, periods)
      import :: time_integrator_type, excitation_type, periods_type
      class(time_integrator_type), intent(inout) :: self
      !> Loads of the motion in time
      type(excitation_type), intent(in) :: excitation
      !> Of the coefficients
      integer, intent(in) :: harmonics
      !> Periods to average over, 3 at least
      integer, intent(in) :: count
      !> Averages over periods of the motion in time
      type(periods_type), intent(out) :: periods
    end subroutine average_over
  end interface
end module attrito_solve_time_integrator
