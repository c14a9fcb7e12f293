!> One linearised step of the balance, bordered by the constraint that picks the point:
!>
!> $$ (I + R D) \delta d + b \, \delta\omega = \rho - R g_w (I - P_w)^{-1} \rho_w, $$
!> $$ p^T \delta d + q \, \delta\omega = \sigma, \qquad \delta w = (I - P_w)^{-1} (P_d \, \delta d + \rho_w) $$
!>
!> D = dg/dd is block-diagonal over contacts, zero for one that stays stuck, and holds that periodic sliders w = P(w, d) follow the
!> motion; only contacts of one element have such a slider, the first pair of their column. With y = D delta d a small system on the
!> rows of contacts that slip or open is left, solved by elimination or, when large, by GMRES; then
!> delta d = rho - R y - b delta omega, all rows of which are recovered from the generalised coordinates at once.
module attrito_newton_linearised_step
  use attrito_core_kinds, only: wp
  use attrito_contact_forces, only: released
  use attrito_newton_active_jacobian, only: unknowns_of
  use attrito_newton_border, only: constraint_type, border_type, new_border, inner_product
  use attrito_newton_condensed_dense, only: elimination_type, solve_by_elimination
  use attrito_newton_condensed_krylov, only: krylov_options_type, solve_by_krylov
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_newton_preconditioners, only: preconditioners_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_balance_work, only: step_work
  implicit none
  private
  public :: linear_options_type, stiffened, solve_linearised, apply_linearised, change_of_deviation, follow_sliders

  type :: linear_options_type
    !> Active unknowns up to which the system is formed and eliminated
    integer :: dense_limit = 400
    type(krylov_options_type) :: krylov
    !> Part of their springs that contacts keep in the step (`attrito_newton_active_jacobian`)
    real(wp) :: stiffening = 0.0_wp
  end type linear_options_type

contains

  !> The same for a step in which contacts keep a part of their springs.
  pure type(linear_options_type) function stiffened(options, part)
    !> How to solve
    type(linear_options_type), intent(in) :: options
    !> Part of their springs
    real(wp), intent(in) :: part

    stiffened = options
    stiffened%stiffening = part
  end function stiffened

  !> Solve for the step; the balance holds the Jacobian of its last evaluation.
  subroutine solve_linearised(balance, constraint, right, options, step, iterations, status, kept, factors)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    !> Right-hand sides of balance and sliders; `omega` is the constraint's
    type(unknowns_type), intent(in) :: right
    !> How to solve
    type(linear_options_type), intent(in) :: options
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: step
    !> Of GMRES
    integer, intent(out) :: iterations
    !> 0, or not: singular
    integer, intent(out) :: status
    !> Of GMRES, if they are to serve more than one step
    type(preconditioners_type), optional, intent(inout) :: kept
    !> Of elimination, if they are to serve more than one step of this evaluation and constraint
    type(elimination_type), optional, intent(inout) :: factors
    type(border_type) :: border
    type(preconditioners_type) :: own
    type(elimination_type) :: own_factors
    real(wp), allocatable :: rho(:, :), y(:, :)
    complex(wp), allocatable :: response(:, :), to_y(:, :)
    real(wp) :: last
    logical :: is_factored
    integer :: active

    iterations = 0
    allocate (response, to_y, mold=balance%response)
    call respond_to_sliders(balance, right%slider, response)
    rho = balance%active%gather(right%motion) + balance%active%contact_rows%motion_of(response)
    border = new_border(balance, constraint)
    last = right%omega - border%product_with(response)
    if (border%has_motion) last = last - inner_product(balance, constraint%motion, right%motion)
    allocate (y, mold=rho)
    active = active_unknowns(balance)
    is_factored = .false.
    if (active <= options%dense_limit .and. present(factors)) then
      is_factored = factors%is_made
      call solve_by_elimination(balance, border, options%stiffening, rho, last, factors, y, step%omega, status)
    else if (active <= options%dense_limit) then
      call solve_by_elimination(balance, border, options%stiffening, rho, last, own_factors, y, step%omega, status)
    else if (present(kept)) then
      call solve_by_krylov(balance, border, options%stiffening, rho, last, options%krylov, kept, y, step%omega, iterations, status)
    else
      call solve_by_krylov(balance, border, options%stiffening, rho, last, options%krylov, own, y, step%omega, iterations, status)
    end if
    balance%work = balance%work &
                   + step_work(active, size(rho, 1), size(response, 1), iterations, is_factored)/balance%ranks%ranks
    if (status /= 0) return
    call balance%respond_to_active(y, to_y)
    step%motion = right%motion + balance%recover(response + to_y + step%omega*balance%response_omega)
    call follow_sliders(balance, right%slider, step)
  end subroutine solve_linearised

  !> Response to the change of the forces by what sliders have yet to go [n, 0:H].
  subroutine respond_to_sliders(balance, rho_slider, response)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> [width, contacts]
    real(wp), intent(in) :: rho_slider(:, :)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)
    real(wp) :: deviation(balance%coefficients(), balance%active%count), largest

    response = 0.0_wp
    deviation = release_sliders(balance, rho_slider)
    largest = 0.0_wp
    if (size(deviation) > 0) largest = maxval(abs(deviation))
    if (balance%ranks%largest(largest) > 0.0_wp) call balance%respond_to_active(deviation, response)
  end subroutine respond_to_sliders

  !> Change g_w (I - P_w)^-1 rho_w of the forces by what sliders have yet to go [2 H + 1, active rows].
  pure function release_sliders(balance, rho_slider) result(deviation)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> [width, contacts]
    real(wp), intent(in) :: rho_slider(:, :)
    real(wp) :: deviation(balance%coefficients(), balance%active%count), moved(2, 1)
    integer :: i

    deviation = 0.0_wp
    associate (active => balance%active)
      do i = 1, size(active%contacts)
        associate (forces => balance%forces(active%contacts(i)), first => active%first(i))
          if (.not. forces%follows()) cycle
          moved = released(forces%link%holding, rho_slider(:2, active%contacts(i):active%contacts(i)))
          deviation(:, first:first + 1) = reshape(matmul(forces%link%force, moved), [size(deviation, 1), 2])
        end associate
      end do
    end associate
  end function release_sliders

  !> The linearised equations times a step: what `solve_linearised` inverts.
  subroutine apply_linearised(balance, constraint, step, product)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Linear condition on motion and frequency that closes the system
    type(constraint_type), intent(in) :: constraint
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: step
    !> Takes the product
    type(unknowns_type), intent(inout) :: product
    real(wp) :: deviation(size(step%motion, 1), size(step%motion, 2)), motion(3*size(step%motion, 1), 1), followed(2, 1)
    complex(wp), allocatable :: response(:, :)
    integer :: i, k

    k = size(step%motion, 1)
    deviation = 0.0_wp
    product%slider = step%slider
    do i = 1, size(balance%law)
      associate (forces => balance%forces(i), first => balance%law(i)%first_row, rows => balance%law(i)%tangents + 1)
        if (.not. allocated(forces%jacobian)) cycle
        motion(:k*rows, 1) = reshape(step%motion(:, first:first + rows - 1), [k*rows])
        deviation(:, first:first + rows - 1) = reshape(matmul(forces%jacobian, motion(:k*rows, 1)), [k, rows])
        if (.not. forces%follows()) cycle
        followed = matmul(forces%link%by_motion, motion)
        product%slider(:2, i) = matmul(forces%link%holding, step%slider(:2, i)) - followed(:, 1)
        followed = step%slider(:2, i:i) - released(forces%link%holding, followed)
        deviation(:, first:first + 1) = deviation(:, first:first + 1) + reshape(matmul(forces%link%force, followed), [k, 2])
      end associate
    end do
    allocate (response, mold=balance%response)
    call balance%respond_to_deviation(deviation, response)
    product%motion = step%motion - balance%recover(response) + balance%residual_omega()*step%omega
    product%omega = inner_product(balance, constraint%motion, step%motion) + constraint%frequency*step%omega
  end subroutine apply_linearised

  !> D delta d + g_w delta w: what a step from `solve_linearised` changes of the contacts' deviation [2 H + 1, rows].
  function change_of_deviation(balance, right, step) result(change)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> The right-hand sides that the step was solved for
    type(unknowns_type), intent(in) :: right
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: step
    real(wp) :: change(size(step%motion, 1), size(step%motion, 2))
    integer :: i, k

    change = 0.0_wp
    k = size(step%motion, 1)
    associate (active => balance%active, by_sliders => release_sliders(balance, right%slider))
      do i = 1, size(active%contacts)
        associate (forces => balance%forces(active%contacts(i)), first => active%first(i), source => active%source(i), &
                   rows => active%rows(i))
          change(:, source:source + rows - 1) = &
            by_sliders(:, first:first + rows - 1) &
            + reshape(matmul(forces%jacobian, reshape(step%motion(:, source:source + rows - 1), [k*rows])), [k, rows])
        end associate
      end do
    end associate
  end function change_of_deviation

  !> Rows of D that are not zero, over all ranks.
  integer function active_unknowns(balance)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp) :: total

    total = real(unknowns_of(balance), wp)
    call balance%ranks%sum(total)
    active_unknowns = nint(total)
  end function active_unknowns

  !> Step of the sliders; those that are no unknowns take their right-hand side.
  pure subroutine follow_sliders(balance, rho_slider, step)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Right-hand side of the sliders
    real(wp), intent(in) :: rho_slider(:, :)
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: step
    real(wp) :: motion(3*size(step%motion, 1), 1)
    integer :: i

    step%slider = rho_slider
    do i = 1, size(balance%law)
      associate (forces => balance%forces(i), first => balance%law(i)%first_row)
        if (.not. forces%follows()) cycle
        motion(:, 1) = reshape(step%motion(:, first:first + 2), [size(motion)])
        step%slider(:2, i:i) = released(forces%link%holding, rho_slider(:2, i:i) + matmul(forces%link%by_motion, motion))
      end associate
    end do
  end subroutine follow_sliders
end module attrito_newton_linearised_step
