!> The range of frequencies that a sweep stays in, from its start towards its stop, whichever is higher.
module attrito_continuation_range
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  implicit none
  private
  public :: range_type

  type :: range_type
    !> Angular frequencies
    real(wp) :: start = 0.0_wp, stop = 0.0_wp
  contains
    procedure :: width
    procedure :: passes_stop
    procedure :: is_left
    procedure :: has
    procedure :: clipped
    procedure :: keep
  end type range_type

contains

  !> Negative where the sweep goes down.
  pure real(wp) function width(self)
    class(range_type), intent(in) :: self

    width = self%stop - self%start
  end function width

  !> Is an angular frequency at the stop or beyond?
  pure logical function passes_stop(self, omega)
    class(range_type), intent(in) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega

    passes_stop = (omega - self%stop)*(self%stop - self%start) >= 0.0_wp
  end function passes_stop

  !> Is an angular frequency at the stop, or beyond either end?
  pure logical function is_left(self, omega)
    class(range_type), intent(in) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega

    is_left = self%passes_stop(omega) .or. (omega - self%start)*(self%stop - self%start) < 0.0_wp
  end function is_left

  !> Does an angular frequency lie within, ends and their rounding included?
  pure logical function has(self, omega)
    class(range_type), intent(in) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Of a frequency, as part of itself, that an equation gave back
    real(wp), parameter :: rounding = 1.0e-12_wp ! derived

    has = abs(omega - 0.5_wp*(self%start + self%stop)) <= 0.5_wp*abs(self%width()) + rounding*max(self%start, self%stop)
  end function has

  !> The angular frequency itself, or the end that it has left the range by.
  pure real(wp) function clipped(self, omega)
    class(range_type), intent(in) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega

    clipped = omega
    if (self%is_left(omega)) clipped = merge(self%stop, self%start, self%passes_stop(omega))
  end function clipped

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(range_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%start)
    call store%keep(self%stop)
  end subroutine keep
end module attrito_continuation_range
