!> Periods of motion marched one after another from where each leaves sliders and mean, by how much they move them, and to where such
!> steps lead.
!>
!> A period marched once, from given sliders, is a continuous function of the motion, and so is where it takes them. Displacements go
!> on from the mean of the period before to that of the next at a constant rate (`attrito_contact_passing_period`), or else all that a
!> joint moves by would be a jump at one instant of the period. Steps s_n whose changes are each a part rho of the one before lead to
!> equal steps (none, where sliders settle); sliders, and the mean with them, are taken to where these begin,
!>
!> $$ s_n - s_{n-1} = \rho (s_{n-1} - s_{n-2}): \quad
!>    w + \sum_{k \ge 1} (s_{n+k} - s_\infty) = w - \left(\frac{\rho}{1 - \rho}\right)^2 (s_n - s_{n-1}). $$
module attrito_solve_slider_steps
  use attrito_core_kinds, only: wp
  use attrito_solve_sliders, only: end_period
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: slider_steps_type, begin_passing, end_passing, slowest_creep

  !> Sliders settle: largest part that a period leaves of the step before. One hundredth more or less changes nothing of a rocking
  !> block's mode
  real(wp), parameter :: slowest_creep = 0.97_wp ! guess
  !> Steps are extrapolated: largest part that a period leaves of what they change by, and by what part two such changes may differ in
  !> direction. There one hundredth more or less of the first changes nothing, half and twice the second 3e-9 of omega, 2e-6 of xi and
  !> 5e-5 of the drift of a rocking block's mode
  real(wp), parameter :: slowest_change = 0.997_wp, alike = 0.2_wp ! guess

  !> By how much periods move sliders [width, contacts] and the mean [rows], this rank's; no step: not allocated
  type :: slider_steps_type
    !> Of the last period, and of the two before
    real(wp), allocatable :: slider(:, :), slider_before(:, :), slider_earlier(:, :)
    real(wp), allocatable :: mean(:), mean_before(:)
    !> Mean from which the next is a step
    real(wp), allocatable :: base(:)
  contains
    procedure :: note
    procedure :: part_of_last
    procedure :: change_by
    procedure :: extrapolate
  end type slider_steps_type

contains

  !> Let what is solved next be one period from the sliders as they are, which need not come back, and from a mean.
  subroutine begin_passing(solver, mean)
    !> Solver of points, whose balance this changes
    type(solver_type), intent(inout) :: solver
    !> Of the period before [rows]
    real(wp), intent(in) :: mean(:)

    solver%context%balance%mean_before = mean
    call solver%context%forget()
  end subroutine begin_passing

  !> Let what is solved next be motion that repeats.
  subroutine end_passing(solver)
    !> Solver of points, whose balance this changes
    type(solver_type), intent(inout) :: solver

    deallocate (solver%context%balance%mean_before)
    call solver%context%forget()
  end subroutine end_passing

  !> Leave sliders where the period takes them, and note by how much it moved them and the mean.
  subroutine note(self, solver)
    class(slider_steps_type), intent(inout) :: self
    !> Solver of points, whose sliders this moves
    type(solver_type), intent(inout) :: solver

    call move_alloc(self%slider_before, self%slider_earlier)
    call move_alloc(self%slider, self%slider_before)
    call move_alloc(self%mean, self%mean_before)
    allocate (self%slider, mold=solver%context%balance%slider)
    call end_period(solver%context%balance, self%slider)
    self%mean = solver%motion(1, :) - self%base
    self%base = solver%motion(1, :)
  end subroutine note

  !> Length of the last step by that of the one before; huge where none was before.
  real(wp) function part_of_last(self, solver) result(part)
    class(slider_steps_type), intent(in) :: self
    !> Solver of points: its ranks
    type(solver_type), intent(in) :: solver

    part = huge(part)
    if (allocated(self%slider_before)) part = ratio_of_lengths(solver, self%slider, self%slider_before)
  end function part_of_last

  !> By what part the last step differs from the one before; huge where none was before.
  real(wp) function change_by(self, solver) result(part)
    class(slider_steps_type), intent(in) :: self
    !> Solver of points: its ranks
    type(solver_type), intent(in) :: solver

    part = huge(part)
    if (allocated(self%slider_before)) part = ratio_of_lengths(solver, self%slider - self%slider_before, self%slider)
  end function change_by

  !> Length of one step by that of another, of all ranks.
  real(wp) function ratio_of_lengths(solver, step, other) result(ratio)
    !> Solver of points: its ranks
    type(solver_type), intent(in) :: solver
    !> This rank's [width, contacts]
    real(wp), intent(in) :: step(:, :), other(:, :)
    real(wp) :: squares(2)

    squares = [sum(step**2), sum(other**2)]
    call solver%context%balance%ranks%sum(squares)
    ratio = sqrt(squares(1)/max(squares(2), tiny(1.0_wp)))
  end function ratio_of_lengths

  !> Take sliders and mean to where steps lead whose changes are each the same part of the one before; steps before are forgotten.
  subroutine extrapolate(self, solver)
    class(slider_steps_type), intent(inout) :: self
    !> Solver of points, whose sliders and mean this moves
    type(solver_type), intent(inout) :: solver
    real(wp), allocatable :: change(:, :), change_before(:, :)
    real(wp) :: products(3), ratio, factor

    if (.not. (allocated(self%slider_earlier) .and. allocated(self%mean_before))) return
    change = self%slider - self%slider_before
    change_before = self%slider_before - self%slider_earlier
    products = [sum(change**2), sum(change*change_before), sum(change_before**2)]
    call solver%context%balance%ranks%sum(products)
    if (products(1) <= 0.0_wp .or. products(3) <= 0.0_wp) return
    ratio = products(2)/products(3)
    if (ratio <= 0.0_wp .or. ratio > slowest_change) return
    ! |c - ratio b|^2 = |c|^2 - ratio c.b
    if (products(1) - ratio*products(2) > alike**2*products(1)) return
    factor = -(ratio/(1.0_wp - ratio))**2
    associate (slider => solver%context%balance%slider, mean_change => self%mean - self%mean_before)
      slider = slider + factor*change
      solver%motion(1, :) = solver%motion(1, :) + factor*mean_change
      self%base = self%base + factor*mean_change
    end associate
    deallocate (self%slider, self%slider_before, self%slider_earlier, self%mean, self%mean_before)
  end subroutine extrapolate
end module attrito_solve_slider_steps
