!> Members of the family that a point is one of, when some of its contacts never slip: what they are, and how they change with the
!> free sliders w.
!>
!> A free contact holds its slider, so its deviation is the constant g_t = -k_t w, and a change s of it changes the motion by
!>
!> $$ (I + R D) \, \delta d = -R s, \qquad \delta\lambda = K_c \delta d + D \delta d + s $$
!>
!> with D the Jacobian of the contacts that slip or open: exact at this member, and everywhere where there are none of those.
!> Sliders moved too far are taken back by the contact law itself: what a solve returns is a member, whatever was asked for.
module attrito_family_members
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: extrema
  use attrito_newton_border, only: constraint_type
  use attrito_newton_condensed_dense, only: elimination_type
  use attrito_newton_linearised_step, only: solve_linearised
  use attrito_newton_newton, only: newton_report_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_balance_work, only: residual_work
  use attrito_contact_state, only: state_stuck, state_shaken_down
  use attrito_solve_snapshot, only: snapshot_type, snapshot_of, restore
  use attrito_solve_solver, only: accepted_defect, solver_type
  implicit none
  private
  public :: family_type, member_type, description_type, take_sliders, enter_family, leave_family, keep_member, return_to_member, &
            solve_member, solve_member_at, describe_member, differentiate_member, work_of_visits

  !> A solved point, and the report of its solve
  type :: member_type
    type(snapshot_type) :: point
    type(newton_report_type) :: report
  end type member_type

  !> The point shown, to be restored; its contacts' sliders [width, contacts], states, and which sliders are periodic
  type :: family_type
    type(member_type) :: shown
    real(wp), allocatable :: slider(:, :)
    integer, allocatable :: state(:)
    logical, allocatable :: periodic(:)
    logical :: reset_slider = .false.
    !> Counted before other members were visited, which is no work of the point
    real(wp) :: work = 0.0_wp
    !> Of the member described last
    type(elimination_type) :: factors
  end type family_type

  !> A member, or how it changes, on every rank
  type :: description_type
    !> Coefficients of contact forces, rows t1, t2, n [2 H + 1, 3, contacts], and of the monitors [2 H + 1, monitors]
    real(wp), allocatable :: force(:, :, :), monitors(:, :)
    !> Sliders [2, contacts], and whether they are free (1) or not (0) [contacts]
    real(wp), allocatable :: slider(:, :), free(:)
    !> Half the monitors' ranges over the period [monitors]
    real(wp), allocatable :: amplitude(:)
  end type description_type

contains

  !> Evaluate the contacts at the solver's point from the sliders at the start of its period: as its solution left them.
  subroutine take_sliders(solver, slider)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of all contacts [width, contacts]
    real(wp), intent(in) :: slider(:, :)
    integer :: status

    associate (balance => solver%context%balance)
      balance%slider = slider(:, balance%first_contact:balance%first_contact + size(balance%law) - 1)
      call balance%evaluate(solver%motion, solver%omega, status)
    end associate
    call solver%context%forget()
  end subroutine take_sliders

  !> Keep the point just solved, before other members are visited.
  subroutine enter_family(solver, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(family_type), intent(out) :: self
    integer :: i

    call keep_member(solver, self%shown)
    self%reset_slider = solver%options%reset_slider
    self%work = solver%context%balance%work
    solver%options%reset_slider = .false.
    ! The point's own sliders, not those that the next one is to start from; a periodic one that came to rest stays there.
    associate (balance => solver%context%balance)
      do i = 1, size(balance%forces)
        balance%slider(:, i) = balance%forces(i)%slider
      end do
      self%slider = balance%slider
      self%state = balance%forces%state
      self%periodic = balance%forces%periodic .and. self%state > state_shaken_down
      balance%periodic = self%periodic
    end associate
    call solver%context%forget()
  end subroutine enter_family

  !> Leave the solver as it was before.
  subroutine leave_family(solver, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(family_type), intent(in) :: self
    integer :: i

    solver%options%reset_slider = self%reset_slider
    call return_to_member(solver, self%shown)
    associate (balance => solver%context%balance)
      balance%work = self%work
      ! What the next visit begins at is the point's own, not that of the member seen last.
      balance%forces%state = self%state
      balance%forces%periodic = self%periodic
      do i = 1, size(balance%forces)
        balance%forces(i)%slider = self%slider(:, i)
      end do
    end associate
  end subroutine leave_family

  !> Floating-point operations of the visits so far, by the formulas of `attrito_balance_work`, over all ranks.
  real(wp) function work_of_visits(solver, self) result(work)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(family_type), intent(in) :: self

    work = solver%context%balance%work - self%work
    call solver%context%balance%ranks%sum(work)
  end function work_of_visits

  !> Keep the solver's present point.
  subroutine keep_member(solver, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(member_type), intent(out) :: self

    self = member_type(snapshot_of(solver), solver%report)
  end subroutine keep_member

  !> Restore a member.
  subroutine return_to_member(solver, self)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    type(member_type), intent(in) :: self

    call restore(solver, self%point)
    solver%report = self%report
  end subroutine return_to_member

  !> Move the start sliders, solve at the same frequency, and say whether that gave a member; if not, nothing has changed. First from
  !> the prediction of the linear model, which is exact where every contact sticks, then from the present motion.
  subroutine solve_member(solver, slider, most_work, found)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of all contacts [width, contacts]
    real(wp), intent(in) :: slider(:, :)
    !> Operations of all ranks after which it is given up
    real(wp), intent(in) :: most_work
    !> Is there such a member?
    logical, intent(out) :: found
    type(member_type) :: before
    real(wp), allocatable :: own(:, :)
    real(wp) :: work
    integer :: attempt, status

    call keep_member(solver, before)
    work = solver%context%balance%work
    call solver%context%balance%ranks%sum(work)
    solver%context%most_work = work + most_work
    associate (first => solver%context%balance%first_contact)
      own = slider(:, first:first + size(solver%context%balance%law) - 1)
    end associate
    do attempt = 1, 2
      call return_to_member(solver, before)
      status = 0
      if (attempt == 1) call predict(solver, own - before%point%slider, status)
      if (status /= 0) cycle
      call solver%set_slider(own, before%point%periodic)
      call solver%solve_at(solver%omega)
      found = solver%report%converged .and. solver%report%defect <= accepted_defect
      if (found .or. solver%context%gives_up()) exit
    end do
    solver%context%most_work = huge(1.0_wp)
    if (.not. found) call return_to_member(solver, before)
  end subroutine solve_member

  !> Solve at another frequency, from the present motion and sliders, and say whether that gave a point; if not, nothing has changed.
  subroutine solve_member_at(solver, omega, found)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Is there such a point?
    logical, intent(out) :: found
    type(member_type) :: before

    call keep_member(solver, before)
    call solver%solve_at(omega)
    found = solver%report%converged .and. solver%report%defect <= accepted_defect
    if (.not. found) call return_to_member(solver, before)
  end subroutine solve_member_at

  !> Move the motion as free sliders that are moved take it to first order.
  subroutine predict(solver, moved, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Change of this rank's sliders [width, contacts]
    real(wp), intent(in) :: moved(:, :)
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    type(elimination_type) :: factors
    type(unknowns_type) :: step
    real(wp), allocatable :: deviation(:, :)
    integer :: i, t

    call evaluate(solver, status)
    if (status /= 0) return
    associate (balance => solver%context%balance)
      allocate (deviation, mold=balance%residual)
      deviation = 0.0_wp
      do i = 1, size(balance%law)
        if (.not. is_free(solver, i)) cycle
        do t = 1, balance%law(i)%tangents
          deviation(1, balance%law(i)%first_row + t - 1) = -balance%law(i)%tangential_stiffness*moved(t, i)
        end do
      end do
    end associate
    call respond(solver, deviation, factors, step, status)
    if (status == 0) solver%motion = solver%motion + step%motion
  end subroutine predict

  !> Describe the solver's present member.
  subroutine describe_member(solver, family, self, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Family that is visited, whose factors are those of this member from now on
    type(family_type), intent(inout) :: family
    type(description_type), intent(out) :: self
    !> 0, or not: it cannot be evaluated
    integer, intent(out) :: status
    real(wp) :: range(2)
    integer :: i

    call evaluate(solver, status)
    family%factors%is_made = .false.
    if (status /= 0) return
    associate (balance => solver%context%balance, contacts => size(solver%contacts%law))
      allocate (self%slider(size(balance%slider, 1), contacts), self%free(contacts), source=0.0_wp)
      do i = 1, size(balance%law)
        self%slider(:, balance%first_contact - 1 + i) = balance%slider(:, i)
        self%free(balance%first_contact - 1 + i) = merge(1.0_wp, 0.0_wp, is_free(solver, i))
      end do
      call balance%ranks%sum(self%slider)
      call balance%ranks%sum(self%free)
      call gather(solver, balance%recover(balance%response), own_deviation(solver), balance%response, self)
    end associate
    allocate (self%amplitude(size(self%monitors, 2)))
    do i = 1, size(self%amplitude)
      range = extrema(self%monitors(:, i))
      self%amplitude(i) = 0.5_wp*(range(2) - range(1))
    end do
  end subroutine describe_member

  !> How forces and monitors change with one component of a free slider: by the force -k_t w, the member described before.
  subroutine differentiate_member(solver, family, contact, tangent, self, status)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Family that is visited, whose factors this makes or uses
    type(family_type), intent(inout) :: family
    !> Among all, from 1
    integer, intent(in) :: contact, tangent
    !> Only `force` and `monitors`
    type(description_type), intent(out) :: self
    !> 0, or not: another member has the same sliders
    integer, intent(out) :: status
    type(unknowns_type) :: step
    real(wp), allocatable :: deviation(:, :)
    complex(wp), allocatable :: response(:, :)
    integer :: own, i

    associate (balance => solver%context%balance)
      allocate (deviation, mold=balance%residual)
      deviation = 0.0_wp
      own = contact - balance%first_contact + 1
      if (own >= 1 .and. own <= size(balance%law)) deviation(1, balance%law(own)%first_row + tangent - 1) = 1.0_wp
      call respond(solver, deviation, family%factors, step, status)
      if (status /= 0) return
      do i = 1, size(balance%law)
        if (.not. allocated(balance%forces(i)%jacobian)) cycle
        associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents)
          deviation(:, first:last) = deviation(:, first:last) + &
            reshape(matmul(balance%forces(i)%jacobian, reshape(step%motion(:, first:last), [size(deviation(:, first:last))])), &
                    shape(deviation(:, first:last)))
        end associate
      end do
      allocate (response, mold=balance%response)
      call balance%respond_to_deviation(deviation, response)
      call gather(solver, step%motion, deviation, response, self)
    end associate
  end subroutine differentiate_member

  !> First-order change of the motion, at a frequency, with forces on the contacts, at the last evaluation.
  subroutine respond(solver, deviation, factors, step, status)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> On this rank's rows [2 H + 1, rows]
    real(wp), intent(in) :: deviation(:, :)
    !> Of that evaluation, made if they are not
    type(elimination_type), intent(inout) :: factors
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(out) :: step
    !> 0, or not: singular
    integer, intent(out) :: status
    type(constraint_type) :: constraint
    type(unknowns_type) :: right
    complex(wp), allocatable :: response(:, :)
    integer :: iterations

    associate (balance => solver%context%balance, context => solver%context)
      allocate (response, mold=balance%response)
      allocate (constraint%motion, mold=balance%residual)
      constraint%motion = 0.0_wp
      call balance%respond_to_deviation(deviation, response)
      right = unknowns_type(balance%recover(response), 0.0_wp*balance%slider, 0.0_wp)
      step = right
      balance%work = balance%work + residual_work(balance%coefficients(), balance%rows(), size(balance%response, 1))
      call solve_linearised(balance, constraint, right, context%linear, step, iterations, status, context%preconditioner, factors)
    end associate
  end subroutine respond

  !> Forces and Jacobian at the present motion and sliders. A free contact at its limit has been taken there: from now on it holds
  !> its slider.
  subroutine evaluate(solver, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    integer :: i

    associate (balance => solver%context%balance)
      call balance%evaluate(solver%motion, solver%omega, status)
      call solver%context%forget()
      do i = 1, size(balance%forces)
        if (.not. is_free(solver, i)) cycle
        balance%forces(i)%active = .false.
        if (allocated(balance%forces(i)%jacobian)) deallocate (balance%forces(i)%jacobian)
      end do
    end associate
  end subroutine evaluate

  !> Does this rank's contact hold its slider, whatever that is?
  pure logical function is_free(solver, contact)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Number of the contact
    integer, intent(in) :: contact

    associate (forces => solver%context%balance%forces(contact))
      is_free = .not. forces%unique .and. (forces%state == state_stuck .or. forces%state == state_shaken_down)
    end associate
  end function is_free

  !> Deviations of this rank's rows [2 H + 1, rows].
  pure function own_deviation(solver) result(deviation)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    real(wp), allocatable :: deviation(:, :)
    integer :: i

    associate (balance => solver%context%balance)
      allocate (deviation, mold=balance%residual)
      do i = 1, size(balance%law)
        associate (first => balance%law(i)%first_row)
          deviation(:, first:first + balance%law(i)%tangents) = balance%forces(i)%deviation(:size(deviation, 1), :)
        end associate
      end do
    end associate
  end function own_deviation

  !> Forces and monitors of all ranks from motion and deviation of this rank's rows and the structure's response.
  subroutine gather(solver, motion, deviation, response, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of relative displacement, by harmonic and row; deviation of contact forces from those of their springs
    real(wp), intent(in) :: motion(:, :), deviation(:, :)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, :)
    type(description_type), intent(inout) :: self
    real(wp) :: stiffness
    integer :: i, row, component

    associate (balance => solver%context%balance)
      allocate (self%force(balance%coefficients(), 3, size(solver%contacts%law)), source=0.0_wp)
      do i = 1, size(balance%law)
        associate (law => balance%law(i))
          do row = 1, law%tangents + 1
            component = merge(3, row, row > law%tangents)
            stiffness = merge(law%normal_stiffness, law%tangential_stiffness, row > law%tangents)
            self%force(:, component, balance%first_contact - 1 + i) = deviation(:, law%first_row + row - 1) &
                                                                  + stiffness*motion(:, law%first_row + row - 1)
          end do
        end associate
      end do
      do i = 1, size(self%force, 3)
        call balance%ranks%sum(self%force(:, :, i))
      end do
      self%monitors = balance%monitors%motion_of(response)
    end associate
  end subroutine gather
end module attrito_family_members
