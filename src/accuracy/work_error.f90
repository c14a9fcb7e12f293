!> The error of the work that contacts do a period,
!>
!> $$ W = \oint T \cdot du = \pi \sum_h h \, (g_{hc} \cdot u_{hs} - g_{hs} \cdot u_{hc}), \qquad T = k_t u + g, $$
!>
!> estimated as what it changes by where a finer balance moves the point to: the spring does no work over a period, so the deviation g
!> does it all. W is taken at the finer balance's motion with its forces there, so that it is of second order in what that motion is
!> still off by.
module attrito_accuracy_work_error
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: work_per_period
  use attrito_accuracy_finer_balance, only: finer_balance_type, finer_point_type
  use attrito_accuracy_second_step, only: second_step_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: estimate_work_errors

contains

  !> The larger of the changes to where either step of the estimate leads, of each of this rank's contacts.
  subroutine estimate_work_errors(finer, solver, first, second, errors)
    !> Balance with more harmonics
    type(finer_balance_type), intent(in) :: finer
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> Point by the finer balance, to first order; and after a second step, if there is one
    type(finer_point_type), intent(in) :: first
    type(second_step_type), intent(in) :: second
    !> [contacts]
    real(wp), intent(out) :: errors(:)
    real(wp) :: own(size(errors))
    integer :: i

    associate (balance => solver%context%balance)
      do i = 1, size(errors)
        own(i) = work_of(balance%forces(i)%deviation, solver%motion(:, balance%law(i)%first_row:), balance%law(i)%tangents)
      end do
      errors = abs(finer_work(finer, solver, first%motion, first%slider) - own)
      if (.not. allocated(second%response)) return
      errors = max(errors, abs(finer_work(finer, solver, balance%contact_rows%motion_of(second%response), second%slider) - own))
    end associate
  end subroutine estimate_work_errors

  !> Work of each of this rank's contacts by the finer balance at a motion.
  function finer_work(finer, solver, motion, moved) result(work)
    !> Balance with more harmonics
    type(finer_balance_type), intent(in) :: finer
    !> Solver of points, at a solution
    type(solver_type), intent(inout) :: solver
    !> Of this rank's rows [2 K + 1, rows], and what start sliders have moved by [width, contacts]
    real(wp), intent(in) :: motion(:, :), moved(:, :)
    real(wp) :: work(size(moved, 2))
    type(contact_forces_type) :: forces
    integer :: i

    associate (balance => solver%context%balance)
      do i = 1, size(work)
        associate (law => balance%law(i), first => balance%law(i)%first_row, &
                   last => balance%law(i)%first_row + balance%law(i)%tangents)
          if (allocated(forces%deviation)) deallocate (forces%deviation)
          allocate (forces%deviation(size(motion, 1), law%tangents + 1))
          call finer%evaluate(solver, i, motion(:, first:last), balance%forces(i)%slider + moved(:, i), forces)
          work(i) = work_of(forces%deviation, motion(:, first:last), law%tangents)
        end associate
      end do
    end associate
  end function finer_work

  !> Work of one contact.
  pure real(wp) function work_of(deviation, motion, tangents)
    !> Of its rows [2 H + 1, tangents + 1]
    real(wp), intent(in) :: deviation(:, :), motion(:, :)
    !> One or two
    integer, intent(in) :: tangents
    integer :: row

    work_of = 0.0_wp
    do row = 1, tangents
      work_of = work_of + work_per_period(deviation(:, row), motion(:, row))
    end do
  end function work_of
end module attrito_accuracy_work_error
