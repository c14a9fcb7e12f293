!> What a comparison of two series has shown of a point holds for the next points of the branch, while harmonics stay:
!>
!> $$ e \le 2 \, \frac{e_c}{o_c} \, o, $$
!>
!> e_c being the error that the longer series has shown, o_c and o what the estimate left open there and here.
module attrito_accuracy_series_comparison
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  implicit none
  private
  public :: caution, patience, series_comparison_type

  !> Points of a branch in a row that ask for fewer harmonics before these fall, and that a comparison of two series
  !> holds for
  integer, parameter :: patience = 5 ! guess
  !> So many times what a comparison found of what was open is the error of the points that it holds for
  real(wp), parameter :: caution = 2.0_wp ! guess

  type :: series_comparison_type
    !> Points of the branch that it still holds for; their harmonics
    integer, private :: left = 0, harmonics = 0
    !> The error that it found, in units of what was open
    real(wp), private :: change = 1.0_wp
  contains
    procedure :: take
    procedure :: forget
    procedure :: bound
    procedure :: keep
  end type series_comparison_type

contains

  !> Two series have been compared.
  pure subroutine take(self, harmonics, shown, left_open)
    class(series_comparison_type), intent(inout) :: self
    !> Harmonics of the shorter one
    integer, intent(in) :: harmonics
    !> Its error as shown by the longer one, and what its estimate leaves open
    real(wp), intent(in) :: shown, left_open

    self%left = patience
    self%harmonics = harmonics
    self%change = shown/max(left_open, tiny(1.0_wp))
  end subroutine take

  !> It holds no longer.
  pure subroutine forget(self)
    class(series_comparison_type), intent(inout) :: self

    self%left = 0
  end subroutine forget

  !> The error of a further point; not known if it holds for no more points, or on another series.
  pure subroutine bound(self, harmonics, left_open, error, is_known)
    class(series_comparison_type), intent(inout) :: self
    !> Of its series
    integer, intent(in) :: harmonics
    !> What its estimate leaves open
    real(wp), intent(in) :: left_open
    real(wp), intent(out) :: error
    logical, intent(out) :: is_known

    is_known = self%left > 0 .and. self%harmonics == harmonics
    error = caution*self%change*left_open
    if (is_known) self%left = self%left - 1
  end subroutine bound

  !> Save or load it.
  subroutine keep(self, store)
    class(series_comparison_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%left)
    call store%keep(self%harmonics)
    call store%keep(self%change)
  end subroutine keep
end module attrito_accuracy_series_comparison
