!> What a solved balance would change by if it were finer: harmonics up to K rather than H, to first order.
!>
!> $$ d_h = -R_h g_h \quad (h = H + 1 \ldots K), \qquad \delta g = g(d_0 \ldots d_K) - g(d_0 \ldots d_H), \qquad
!>    (I + R D) \, \delta d = -R \, \delta g $$
!>
!> The forces that the balance leaves out move the structure at harmonics beyond H, through the receptance of the stuck modes, which
!> is diagonal, or that of the structure with its contacts as in the mean (`attrito_newton_mean_contacts`); contacts that feel this
!> motion too give other forces at the harmonics that are kept, and these move the point by one linearised step, along the equation
!> that picked the point. Contacts that stick are linear.
module attrito_accuracy_finer_balance
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: resized, to_complex, to_real
  use attrito_newton_linearised_step, only: linear_options_type, solve_linearised, change_of_deviation
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_balance_work, only: contact_work, residual_work
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_disc_rules, only: new_rough_rules
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_state, only: state_slipping
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: finer_balance_type, finer_point_type, solve_for_estimate

  !> Damping ratio of modes beyond H that have none of their own: it keeps their resonances finite
  real(wp), parameter :: nominal_ratio = 0.01_wp ! guess

  !> Residual of GMRES relative to the first step's right-hand side: an error needs two digits. A second step is a part of the first,
  !> and is not solved in vain
  real(wp), parameter :: accepted_residual = 1.0e-2_wp, least_reduction = 0.3_wp ! guess

  type :: finer_balance_type
    !> K
    integer :: harmonics = 0
    !> What evaluations of all contacts share
    type(quadrature_type) :: quadrature
  contains
    procedure :: set
    procedure :: correct
    procedure :: respond_beyond
    procedure :: evaluate
    procedure :: destroy
  end type finer_balance_type

  !> The point as the finer balance would have it, to first order
  type :: finer_point_type
    !> Relative displacements of this rank's rows [2 K + 1, rows] and angular frequency
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp
    !> Coefficients of the monitors [2 K + 1, monitors]
    real(wp), allocatable :: monitors(:, :)
    !> Size of the right-hand side of the step that led here
    real(wp) :: asked = 0.0_wp
    !> Response that these belong to [n, 0:K], and what start sliders that are unknowns have moved by [width, contacts]
    complex(wp), allocatable :: response(:, :)
    real(wp), allocatable :: slider(:, :)
  end type finer_point_type

  !> What a change of the forces makes
  type :: force_change_type
    !> Change of the deviation [2 H + 1, rows], and of where periodic sliders go [width, contacts]
    real(wp), allocatable :: deviation(:, :), released(:, :)
    !> The motion that it makes of the contacts, these being stuck: response [n, 0:H] and rows [2 H + 1, rows]
    complex(wp), allocatable :: response(:, :)
    real(wp), allocatable :: motion(:, :)
  end type force_change_type

contains

  !> For so many harmonics.
  subroutine set(self, harmonics, quadrature)
    class(finer_balance_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    !> What evaluations of the balance share
    type(quadrature_type), intent(in) :: quadrature

    call self%destroy()
    self%harmonics = harmonics
    self%quadrature = quadrature_type(order=quadrature%order, grid=new_grid(quadrature%order*harmonics))
    if (allocated(quadrature%discs%grids)) self%quadrature%discs = new_rough_rules(harmonics)
  end subroutine set

  !> The solver's present point, corrected.
  subroutine correct(self, solver, point, status)
    class(finer_balance_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Without monitors where the linearised step is singular
    type(finer_point_type), intent(out) :: point
    !> 0, or not: singular
    integer, intent(out) :: status
    complex(wp), allocatable :: response(:, :)
    real(wp), allocatable :: deviation(:, :)
    type(force_change_type) :: change

    associate (balance => solver%context%balance)
      allocate (response(size(balance%response, 1), 0:self%harmonics), source=(0.0_wp, 0.0_wp))
      response(:, :balance%receptance%harmonics) = balance%response
      call forces_at_own_motion(self, solver, deviation)
      call self%respond_beyond(solver, resized(solver%motion, 2*self%harmonics + 1), deviation, response)
      point%motion = resized(solver%motion, 2*self%harmonics + 1)
      if (self%harmonics > balance%receptance%harmonics) then
        associate (beyond => balance%receptance%harmonics + 1)
          point%motion(2*beyond:, :) = balance%contact_rows%motion_from(beyond, response(:, beyond:))
        end associate
      end if
      call change_forces(self, solver, point%motion, change)
      call step(solver, change, response, point, status)
      if (status == 0) point%monitors = balance%monitors%motion_of(response)
      point%response = response
      balance%work = balance%work + residual_work(2*self%harmonics + 1, balance%rows(), size(response, 1))
    end associate
  end subroutine correct

  !> Deviation at the balance's own motion, of which it has mostly kept as many harmonics.
  subroutine forces_at_own_motion(self, solver, deviation)
    class(finer_balance_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Of this rank's rows [2 K + 1, rows]
    real(wp), allocatable, intent(out) :: deviation(:, :)
    type(contact_forces_type) :: forces
    integer :: i

    associate (balance => solver%context%balance)
      allocate (deviation(2*self%harmonics + 1, balance%rows()), source=0.0_wp)
      do i = 1, size(balance%law)
        if (balance%forces(i)%state < state_slipping) cycle
        associate (before => balance%forces(i), first => balance%law(i)%first_row, &
                   last => balance%law(i)%first_row + balance%law(i)%tangents)
          if (size(before%deviation, 1) >= size(deviation, 1)) then
            deviation(:, first:last) = before%deviation(:size(deviation, 1), :)
            cycle
          end if
          forces%deviation = deviation(:, first:last)
          call self%evaluate(solver, i, resized(solver%motion(:, first:last), size(deviation, 1)), before%slider, forces)
          deviation(:, first:last) = forces%deviation
        end associate
      end do
    end associate
  end subroutine forces_at_own_motion

  !> A change by which nothing changes.
  function no_change(solver) result(change)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    type(force_change_type) :: change

    associate (balance => solver%context%balance)
      allocate (change%deviation(balance%coefficients(), balance%rows()), source=0.0_wp)
      allocate (change%released(size(balance%slider, 1), size(balance%slider, 2)), source=0.0_wp)
    end associate
  end function no_change

  !> The motion that a change of forces makes of the contacts, these being stuck.
  subroutine respond_to_change(solver, change)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Change of the forces
    type(force_change_type), intent(inout) :: change
    real(wp) :: largest

    associate (balance => solver%context%balance)
      allocate (change%response, source=0.0_wp*balance%response)
      allocate (change%motion, source=0.0_wp*change%deviation)
      largest = 0.0_wp
      if (size(change%deviation) > 0) largest = maxval(abs(change%deviation))
      if (.not. balance%ranks%largest(largest) > 0.0_wp) return
      call balance%respond_to_deviation(change%deviation, change%response)
      change%motion = balance%recover(change%response)
    end associate
  end subroutine respond_to_change

  !> Response at the harmonics beyond H to the contact forces at a motion and to the loads there.
  subroutine respond_beyond(self, solver, motion, deviation, response)
    class(finer_balance_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Of this rank's rows, and the deviation there [2 K + 1, rows]
    real(wp), intent(in) :: motion(:, :), deviation(:, :)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(inout) :: response(:, 0:)
    real(wp) :: forces(2*self%harmonics + 1, size(response, 1)), beyond(2*self%harmonics + 1, size(deviation, 2))
    complex(wp), allocatable :: columns(:, :), answers(:, :)
    integer :: k, loaded
    logical :: in_the_mean

    associate (balance => solver%context%balance, lowest => solver%context%balance%receptance%harmonics + 1, &
               mean => solver%context%preconditioner%mean)
      if (self%harmonics < lowest) return
      k = 2*self%harmonics + 1
      in_the_mean = allocated(mean%receptance)
      beyond = deviation
      if (in_the_mean) call mean%release(balance, motion, beyond)
      ! Most contacts stick, and have no force there.
      beyond(:2*lowest - 1, :) = 0.0_wp
      forces = -balance%contact_rows%load_of(beyond)
      call balance%ranks%sum(forces)
      loaded = min(size(solver%structure%harmonic_load, 2), k)
      forces(:loaded, :) = forces(:loaded, :) &
                           + balance%level*to_real(balance%receptance%project_loads(solver%structure%harmonic_load(:, :loaded)))
      if (in_the_mean) then
        columns = mean%receptance%project_loads(transpose(forces))
        allocate (answers, mold=columns)
        answers(:, :lowest) = 0.0_wp
        call mean%receptance%respond_beyond(lowest, solver%omega, nominal_ratio, columns(:, lowest + 1:), &
                                                 answers(:, lowest + 1:))
        columns = to_complex(mean%receptance%displacements(answers))
        response(:, lowest:) = columns(:, lowest + 1:)
      else
        columns = to_complex(forces)
        call balance%receptance%respond_beyond(lowest, solver%omega, nominal_ratio, columns(:, lowest + 1:), response(:, lowest:))
      end if
    end associate
  end subroutine respond_beyond

  !> Forces of one contact of this rank, as many coefficients as their deviation has room for; no Jacobian.
  subroutine evaluate(self, solver, contact, motion, slider, forces)
    class(finer_balance_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Number of the contact
    integer, intent(in) :: contact
    !> Of its rows [2 K + 1, tangents + 1], and sliders at the start [width]
    real(wp), intent(in) :: motion(:, :), slider(:)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces

    associate (balance => solver%context%balance, law => solver%context%balance%law(contact))
      forces%without_jacobian = .true.
      call evaluate_contact(law, self%quadrature, motion, slider, balance%forces(contact)%periodic, forces)
      balance%work = balance%work + contact_work(law, size(motion, 1), .true.)
    end associate
  end subroutine evaluate

  !> What the finer balance's forces differ by at the harmonics up to H, and where its periodic sliders would go.
  subroutine change_forces(self, solver, motion, change)
    class(finer_balance_type), intent(in) :: self
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> [2 K + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> The change
    type(force_change_type), intent(out) :: change
    type(contact_forces_type) :: forces
    integer :: i, k

    associate (balance => solver%context%balance)
      k = balance%coefficients()
      change = no_change(solver)
      do i = 1, size(balance%law)
        if (balance%forces(i)%state < state_slipping) cycle
        associate (law => balance%law(i), before => balance%forces(i), first => balance%law(i)%first_row, &
                   last => balance%law(i)%first_row + balance%law(i)%tangents)
          if (allocated(forces%deviation)) deallocate (forces%deviation)
          allocate (forces%deviation(k, law%tangents + 1))
          call self%evaluate(solver, i, motion(:, first:last), before%slider, forces)
          change%deviation(:, first:last) = forces%deviation - before%deviation(:k, :)
          if (before%periodic) change%released(:, i) = forces%moved - before%moved
        end associate
      end do
    end associate
    call respond_to_change(solver, change)
  end subroutine change_forces

  !> One linearised step at the equation that picked the point, for a change of the forces.
  subroutine step(solver, change, response, point, status)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Change of the forces
    type(force_change_type), intent(in) :: change
    !> [n, 0:K]
    complex(wp), intent(inout) :: response(:, 0:)
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(inout) :: point
    !> 0, or not: singular
    integer, intent(out) :: status
    type(unknowns_type) :: right, moved
    complex(wp), allocatable :: added(:, :)
    integer :: k

    point%omega = solver%omega
    associate (balance => solver%context%balance, harmonics => solver%context%balance%receptance%harmonics)
      k = balance%coefficients()
      right = unknowns_type(change%motion, change%released)
      point%asked = size_of(solver, right)
      call solve_for_estimate(solver, right, moved, status)
      if (status /= 0) return
      allocate (added, mold=balance%response)
      call balance%respond_to_deviation(change_of_deviation(balance, right, moved), added)
      response(:, :harmonics) = response(:, :harmonics) + change%response + added
      call balance%receptance%respond_derivative(balance%response, added)
      response(:, :harmonics) = response(:, :harmonics) + moved%omega*added
      point%motion(:k, :) = point%motion(:k, :) + moved%motion
      point%omega = solver%omega + moved%omega
      point%slider = moved%slider
    end associate
  end subroutine step

  !> A linearised step at the solver's point, as exact as an error needs.
  subroutine solve_for_estimate(solver, right, step, status, asked)
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Right-hand sides of balance and sliders
    type(unknowns_type), intent(in) :: right
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(out) :: step
    !> 0, or not: singular
    integer, intent(out) :: status
    !> Size of the right-hand sides of the first step, if this is not it
    real(wp), optional, intent(in) :: asked
    type(linear_options_type) :: options
    integer :: iterations

    step = new_unknowns(shape(right%motion), shape(right%slider))
    options = solver%context%linear
    options%krylov%tolerance = accepted_residual
    if (present(asked)) then
      options%krylov%tolerance = accepted_residual*max(1.0_wp, asked/max(size_of(solver, right), tiny(1.0_wp)))
      options%krylov%tolerance = min(options%krylov%tolerance, least_reduction)
    end if
    call solve_linearised(solver%context%balance, solver%context%constraint, right, options, step, iterations, status, &
                          solver%context%preconditioner)
  end subroutine solve_for_estimate

  !> Euclidean norm of right-hand sides, those of the balance and of sliders being displacements.
  real(wp) function size_of(solver, right)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Right-hand sides of balance and sliders
    type(unknowns_type), intent(in) :: right

    associate (balance => solver%context%balance)
      size_of = sqrt(balance%norm(right%motion)**2 + balance%norm(right%slider)**2)
    end associate
  end function size_of

  !> Give the transforms back.
  subroutine destroy(self)
    class(finer_balance_type), intent(inout) :: self

    call self%quadrature%discs%destroy()
  end subroutine destroy
end module attrito_accuracy_finer_balance
