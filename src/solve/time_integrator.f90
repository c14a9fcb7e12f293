!> Motion in time as a source of starts for Newton's method: what continuation asks of it, whoever integrates.
module attrito_solve_time_integrator
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: motion_in_time_type, excitation_type, periods_type

  !> Loads under which it moves
  type :: excitation_type
    !> Angular frequency, rad/s
    real(wp) :: omega = 0.0_wp
    !> Factors on the static loads [loads], and level of the harmonic ones
    real(wp), allocatable :: static_factors(:)
    real(wp) :: level = 1.0_wp
  end type excitation_type

  !> What some periods of it were like
  type :: periods_type
    !> .false.: a step found no solution, and nothing else holds
    logical :: moved = .false.
    !> Mean of the periods: coefficients of the relative displacements of all rows [2 H + 1, rows]
    real(wp), allocatable :: motion(:, :)
    !> Of all contacts at the starts of periods, in the mean [2, contacts]
    real(wp), allocatable :: slider(:, :)
    !> Change of the displacements over the last period, relative to their first harmonic
    real(wp) :: change = huge(1.0_wp)
    !> Did every one of the last periods change them the same way?
    logical :: walks = .false.
  end type periods_type

  type, abstract :: motion_in_time_type
  contains
    procedure(stand), deferred :: stand
    procedure(run_on), deferred :: run_on
  end type motion_in_time_type

  abstract interface
    !> Stand at a state, at the start of a period of the excitation.
    subroutine stand(self, displacement, velocity, slider, stands)
      import :: motion_in_time_type, wp
      class(motion_in_time_type), intent(inout) :: self
      !> Of the model's coordinates [m]
      real(wp), intent(in) :: displacement(:), velocity(:)
      !> Of all contacts [2, contacts]
      real(wp), intent(in) :: slider(:, :)
      !> .false.: this structure has no motion in time
      logical, intent(out) :: stands
    end subroutine stand

    !> Move on for some periods until the start is forgotten, and for some more that are told of.
    subroutine run_on(self, excitation, harmonics, count, periods)
      import :: motion_in_time_type, excitation_type, periods_type
      class(motion_in_time_type), intent(inout) :: self
      type(excitation_type), intent(in) :: excitation
      !> Of the coefficients
      integer, intent(in) :: harmonics
      !> How many more, 3 at least
      integer, intent(in) :: count
      type(periods_type), intent(out) :: periods
    end subroutine run_on
  end interface
end module attrito_solve_time_integrator
