!> The contacts at a motion that is given, not solved for: what every contact does where a coarser model of them moves the structure.
!>
!> $$ d = B q, \qquad \lambda = K_c d + g(d, w) $$
!>
!> Each contact is marched until its sliders w come back after a period to where they began, w = P(w, d): the first period from
!> where they are, then by Newton's method, (I - P_w) delta w = P - w.
module attrito_solve_given_motion
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex
  use attrito_contact_evaluation, only: evaluate_contact
  use attrito_contact_forces, only: released
  use attrito_contact_state, only: state_stuck, state_shaken_down
  use attrito_newton_newton, only: newton_report_type
  use attrito_solve_sliders, only: largest_defect, none_moves
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: evaluate_motion

  !> Rounds until a contact's sliders return after a period
  integer, parameter :: most_rounds = 40 ! guess

contains

  !> Evaluate all contacts at a motion and make it the solver's point. The loads' factors stay.
  subroutine evaluate_motion(solver, coordinates, slider, omega)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(inout) :: solver
    !> Motion of the model's coordinates [2 H + 1, m]
    real(wp), intent(in) :: coordinates(:, :)
    !> Sliders of this rank's contacts before [width, contacts]
    real(wp), intent(in) :: slider(:, :)
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    real(wp) :: least, moved(2, 1)
    integer :: i, round
    logical :: periodic

    associate (balance => solver%context%balance)
      solver%motion = solver%relative_motion(coordinates)
      solver%omega = omega
      balance%response = generalised(solver, coordinates)
      call solver%set_slider(slider)
      least = solver%options%tolerance*balance%norm(solver%motion(2:, :))
      do i = 1, size(balance%law)
        associate (forces => balance%forces(i), first => balance%law(i)%first_row, &
                   last => balance%law(i)%first_row + balance%law(i)%tangents)
          periodic = .false.
          do round = 1, most_rounds
            call evaluate_contact(balance%law(i), balance%quadrature, solver%motion(:, first:last), balance%slider(:, i), periodic, &
                                  forces)
            if (norm2(forces%moved) <= least) exit
            balance%slider(:, i) = forces%slider + forces%moved
            if (periodic .and. allocated(forces%jacobian)) then
              moved = released(forces%link%holding, reshape(forces%moved(:2), [2, 1]))
              balance%slider(:2, i) = forces%slider(:2) + moved(:, 1)
            end if
            periodic = balance%law(i)%tangents == 2 .and. balance%law(i)%elements() == 1
          end do
          if (forces%state == state_stuck .and. norm2(forces%slider - slider(:, i)) > least) forces%state = state_shaken_down
          balance%slider(:, i) = forces%slider
        end associate
      end do
      call balance%active%find(balance%law, balance%forces, balance%contact_rows)
      solver%all_stick = none_moves(balance)
      solver%report = newton_report_type(converged=.true., residual=0.0_wp)
      solver%report%defect = largest_defect(balance)/max(balance%norm(solver%motion(2:, :)), tiny(1.0_wp))
    end associate
    call solver%context%forget()
  end subroutine evaluate_motion

  !> Generalised coordinates of a motion [n, 0:H]: of modes by their stiffness, x^T K~ q / x^T K~ x.
  function generalised(solver, coordinates) result(response)
    !> Solver of points: its stuck system
    type(solver_type), intent(in) :: solver
    !> Motion of the model's coordinates [2 H + 1, m]
    real(wp), intent(in) :: coordinates(:, :)
    complex(wp), allocatable :: response(:, :)
    real(wp), allocatable :: columns(:, :)

    columns = coordinates
    if (solver%stuck%uncoupled) then
      columns = matmul(matmul(coordinates, solver%stuck%stiffness), solver%stuck%modes) &
                /spread(solver%stuck%modal_stiffness, 1, size(coordinates, 1))
    end if
    allocate (response(size(columns, 2), 0:(size(columns, 1) - 1)/2))
    response = to_complex(columns)
  end function generalised
end module attrito_solve_given_motion
