!> What a balance's point says of the motion of all contacts, gathered from the ranks.
module attrito_stability_balance_motion
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: state_shaken_down
  use attrito_model_contacts, only: contact_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: balance_motion_type, balance_motion_of, oscillation_bounds

  type :: balance_motion_type
    !> Coefficients of relative displacement [2 H + 1, rows], sliders where the period starts [2, contacts]
    real(wp), allocatable :: motion(:, :), slider(:, :)
    !> Does a contact stick throughout? [contacts]
    logical, allocatable :: holds(:)
    !> Does a contact with two tangents slip or open?
    logical :: turns = .false.
  end type balance_motion_type

contains

  !> Of the solver's present point, on every rank.
  function balance_motion_of(solver) result(self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(balance_motion_type) :: self
    real(wp) :: holds(size(solver%contacts%law))
    integer :: i

    associate (balance => solver%context%balance)
      allocate (self%motion(balance%coefficients(), size(solver%contacts%row_stiffness)), &
                self%slider(size(balance%slider, 1), size(holds)), source=0.0_wp)
      holds = 0.0_wp
      self%motion(:, balance%first_row:balance%first_row + balance%rows() - 1) = solver%motion
      do i = 1, size(balance%law)
        self%slider(:, balance%first_contact - 1 + i) = balance%forces(i)%slider
        if (balance%forces(i)%state <= state_shaken_down) holds(balance%first_contact - 1 + i) = 1.0_wp
      end do
      call balance%ranks%sum(self%motion)
      call balance%ranks%sum(self%slider)
      call balance%ranks%sum(holds)
    end associate
    self%holds = holds > 0.0_wp
    self%turns = any(solver%contacts%law%tangents > 1 .and. .not. self%holds)
  end function balance_motion_of

  !> Size of each contact's normal displacement, without its mean.
  pure function oscillation_bounds(law, motion) result(bound)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Coefficients of relative displacement [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: bound(size(law))
    integer :: i

    bound = [(sum(abs(motion(2:, law(i)%first_row + law(i)%tangents))), i=1, size(law))]
  end function oscillation_bounds
end module attrito_stability_balance_motion
