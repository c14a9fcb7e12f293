!> Factors that precondition one linear system after another, and are kept while that pays: until iterations of GMRES in excess of
!> those of their first solve add up to what making them again is worth, contacts have moved to other ranks, or the series' length has
!> changed.
module attrito_newton_kept_factors
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  implicit none
  private
  public :: flops_of_iteration, kept_factors_type

  !> Flops of an iteration of GMRES by unknowns and coordinates: a product, and its preconditioning. Factors are in single precision,
  !> twice as fast
  real(wp), parameter :: flops_of_iteration = 16.0_wp ! derived

  type, abstract :: kept_factors_type
    !> Contacts and series they were made for; iterations in excess after which to make them again
    integer, private :: changes = 0, worth = 0
    !> Iterations of GMRES with them: at first, and beyond that since
    integer, private :: usual = -1, excess = 0
  contains
    procedure :: begin
    procedure :: pays
    procedure :: patience
    procedure :: count
    procedure :: discard
    procedure :: keep_counts
    procedure :: set_worth
    procedure :: expect
  end type kept_factors_type

contains

  !> They are made again.
  pure subroutine begin(self, changes, worth)
    class(kept_factors_type), intent(inout) :: self
    !> The balance's count of changes; iterations in excess after which to make them again
    integer, intent(in) :: changes, worth

    self%changes = changes
    self%worth = worth
    self%usual = -1
    self%excess = 0
  end subroutine begin

  !> Does it pay to keep them?
  pure logical function pays(self, changes)
    class(kept_factors_type), intent(in) :: self
    !> The balance's count of changes
    integer, intent(in) :: changes

    pays = self%changes == changes .and. self%excess < self%worth
  end function pays

  !> Iterations after which it is better to make them again; no limit to those just made.
  pure integer function patience(self)
    class(kept_factors_type), intent(in) :: self

    patience = huge(patience)
    if (self%usual >= 0) patience = self%usual + self%worth
  end function patience

  !> Take note of the iterations of a solve.
  pure subroutine count(self, iterations)
    class(kept_factors_type), intent(inout) :: self
    !> Of GMRES
    integer, intent(in) :: iterations

    if (self%usual < 0) self%usual = iterations
    self%excess = self%excess + max(iterations - self%usual, 0)
  end subroutine count

  !> Never to be used again.
  pure subroutine discard(self)
    class(kept_factors_type), intent(inout) :: self

    self%excess = self%worth
  end subroutine discard

  !> Making them again is worth another number of iterations.
  pure subroutine set_worth(self, worth)
    class(kept_factors_type), intent(inout) :: self
    !> Iterations in excess after which to make them again
    integer, intent(in) :: worth

    self%worth = worth
  end subroutine set_worth

  !> Iterations that count as those at first, if there have been none.
  pure subroutine expect(self, iterations)
    class(kept_factors_type), intent(inout) :: self
    !> Of GMRES
    integer, intent(in) :: iterations

    if (self%usual < 0) self%usual = iterations
  end subroutine expect

  !> Save or load what decides how long they are kept.
  subroutine keep_counts(self, store)
    class(kept_factors_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    call store%keep(self%worth)
    call store%keep(self%usual)
    call store%keep(self%excess)
  end subroutine keep_counts
end module attrito_newton_kept_factors
