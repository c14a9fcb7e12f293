!> A model made ready to be solved: stuck system, balance, Newton's method, and its present point.
module attrito_solve_solver
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_model_contacts, only: contact_type, contacts_type
  use attrito_model_structure, only: structure_type
  use attrito_newton_border, only: constraint_type
  use attrito_newton_newton, only: newton_type, newton_controls_type, newton_report_type, new_newton
  use attrito_newton_newton_context, only: newton_context_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_balance_set_up, only: new_balance, set_harmonics_of_balance, take_contacts
  use attrito_balance_stuck_response, only: evaluate_stuck
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_receptance
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_solve_newton_strategies, only: solve_briefly, solve_persistently
  use attrito_solve_strategy_outcome, only: evidence_type
  use attrito_solve_time_integrator, only: time_integrator_type
  use attrito_solve_scales, only: find_scales
  use attrito_solve_sliders, only: found_moving, keep_sliders, largest_defect, none_moves
  implicit none
  private
  public :: solver_type, solver_options_type, new_solver, accepted_defect

  !> Norm of the residual beyond which nothing counts as converged
  real(wp), parameter :: loosest_tolerance = 1.0e-6_wp ! guess
  !> Sliders that still move by more than this part of the motion a period are not settled: the point is indeterminate, and no member
  real(wp), parameter :: accepted_defect = 1.0e-6_wp ! guess

  type :: solver_options_type
    integer :: harmonics = 5
    !> Samples a period, of which results say: contacts go by events
    integer :: samples = 128
    !> Solves of a point while sliders of two tangents turn out to move on
    integer :: rounds = 20
    integer :: max_iterations = 30
    !> Norm of the residual, relative to the stuck response, that counts as converged
    real(wp) :: tolerance = 1.0e-10_wp
    !> Start the sliders of every point from the static solution, not from the point before
    logical :: reset_slider = .false.
    !> Freeze the mean at the static solution
    logical :: uncoupled = .false.
    !> Contacts up to which each rank holds all of them, and does all but their evaluation itself. Of more, linear algebra takes so
    !> much that ranks share it, and its sums round differently on each number of ranks
    integer :: most_whole = 300 ! guess
  end type solver_options_type

  type :: solver_type
    type(structure_type) :: structure
    type(contacts_type) :: contacts
    type(stuck_system_type) :: stuck
    type(solver_options_type) :: options
    type(newton_context_type), pointer :: context => null()
    type(newton_type) :: newton
    !> Relative displacements of this rank's rows [2 H + 1, rows] and angular frequency
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp
    !> The static solution: sliders [width, contacts], and relative displacements of this rank's rows [1, rows]
    real(wp), allocatable :: static_slider(:, :), static_motion(:, :)
    !> Sliders that the last solve began at [width, contacts]; not allocated: none was since contacts were shared out
    real(wp), allocatable :: slider_before(:, :)
    !> Which contacts, of all ranks, the last static path has left closed [contacts]
    logical, allocatable :: closed(:)
    !> How the last solve ended, with the iterations of all its tries
    type(newton_report_type) :: report
    !> Did every contact stick at the last point that converged?
    logical :: all_stick = .false.
    !> Of the last point, for the next: none where it was found
    type(evidence_type) :: evidence
    !> Source of starts that no earlier point leads to; not allocated: there is none
    class(time_integrator_type), allocatable :: time_integrator
    !> Fallback strategies that comparisons leave out: bit k for the k-th (`attrito_solve_strategies`)
    integer :: left_out = 0
  contains
    procedure :: solve_with
    procedure :: solve_at
    procedure :: solve_stuck_at
    procedure :: accept
    procedure :: rest
    procedure :: set_scales
    procedure :: set_motion_scale
    procedure :: set_loads
    procedure :: set_slider
    procedure :: hold_contacts
    procedure :: change_laws
    procedure :: mean_rows
    procedure :: relative_motion
    procedure :: keep
    procedure :: set_harmonics
    procedure :: destroy
  end type solver_type

contains

  !> Diagonalise the stuck system and create balance and Newton's method.
  subroutine new_solver(structure, contacts, ranks, options, self, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> How to solve
    type(solver_options_type), intent(in) :: options
    type(solver_type), intent(out) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    class(receptance_type), allocatable :: receptance

    self%structure = structure
    self%contacts = contacts
    self%options = options
    call new_stuck_system(structure, contacts, .true., self%stuck, error)
    if (allocated(error)) return
    call new_receptance(structure, contacts, self%stuck, options%harmonics, receptance)
    allocate (self%context)
    call new_balance(structure, contacts, receptance, ranks, self%context%balance, options%most_whole)
    self%context%tolerance = options%tolerance
    call new_newton(self%context, self%newton)
    if (self%context%petsc_error /= 0) then
      call raise(error, 'PETSc could not create the nonlinear solver')
      return
    end if
    allocate (self%motion(self%context%balance%coefficients(), self%context%balance%rows()), source=0.0_wp)
    self%static_slider = self%context%balance%slider
    self%static_motion = self%motion(:1, :)
  end subroutine new_solver

  !> Solve from the present motion and frequency. Motion, frequency and sliders change only if it converges.
  !>
  !> A slider with two tangents is marched from its value at the point before. One that still moves after a period is an unknown of a
  !> repeated solve.
  subroutine solve_with(self, constraint, early_stop)
    class(solver_type), intent(inout) :: self
    !> The equation that picks the point
    type(constraint_type), intent(in) :: constraint
    !> Give up after a few iterations of Newton's method, since other starts follow; if not given, do not
    logical, intent(in), optional :: early_stop
    type(newton_controls_type) :: controls
    type(unknowns_type) :: unknowns
    real(wp), allocatable :: slider(:, :)
    logical, allocatable :: periodic(:)
    logical :: is_brief
    real(wp) :: tight
    integer :: round, iterations, linear_iterations

    is_brief = .false.
    if (present(early_stop)) is_brief = early_stop

    associate (balance => self%context%balance)
      slider = balance%slider
      periodic = balance%periodic
      unknowns = unknowns_type(self%motion, slider, self%omega)
      iterations = 0
      linear_iterations = 0
      tight = tight_tolerance(self)
      controls = newton_controls_type(loose_tolerance(self, tight), self%options%max_iterations)
      do round = 1, self%options%rounds
        if (is_brief) then
          call solve_briefly(self%newton, unknowns, constraint, controls, self%report)
        else
          call solve_persistently(self%newton, unknowns, constraint, controls, self%options%uncoupled, self%report)
        end if
        iterations = iterations + self%report%iterations
        linear_iterations = linear_iterations + self%report%linear_iterations
        ! A plane meets mirrored motions of negative frequency, too.
        self%report%converged = self%report%converged .and. unknowns%omega > 0.0_wp
        if (.not. self%report%converged) exit
        if (found_moving(balance, tight*self%context%motion_scale)) then
          unknowns%slider = balance%slider
          call self%context%forget()
        else
          if (controls%tolerance <= tight) exit
          controls%tolerance = tight
        end if
      end do
      self%report%iterations = iterations
      self%report%linear_iterations = linear_iterations
      self%report%defect = largest_defect(balance)/self%context%motion_scale
      if (self%report%converged) then
        call self%accept(unknowns%motion, unknowns%omega, slider)
      else
        balance%slider = slider
        balance%periodic = periodic
        if (self%options%reset_slider) call reset_slider(self)
      end if
    end associate
    call self%context%forget()
  end subroutine solve_with

  !> Take the point that the balance was last evaluated at; sliders go on from it.
  subroutine accept(self, motion, omega, slider_before)
    class(solver_type), intent(inout) :: self
    !> Coefficients of relative displacement, by harmonic and row; angular frequency, rad/s
    real(wp), intent(in) :: motion(:, :), omega
    !> Sliders at the point before [width, contacts]
    real(wp), intent(in) :: slider_before(:, :)

    self%motion = motion
    self%omega = omega
    self%slider_before = slider_before
    call keep_sliders(self%context%balance, slider_before, tight_tolerance(self)*self%context%motion_scale)
    self%all_stick = none_moves(self%context%balance)
    if (self%options%reset_slider) call reset_slider(self)
    call self%context%forget()
  end subroutine accept

  !> Go back to the static solution: no vibration, and sliders as the static loads left them.
  subroutine rest(self)
    class(solver_type), intent(inout) :: self

    self%motion(1:1, :) = self%static_motion
    self%motion(2:, :) = 0.0_wp
    self%all_stick = .false.
    call self%set_slider(self%static_slider)
  end subroutine rest

  !> Let the next point start from the sliders of the static solution.
  subroutine reset_slider(self)
    class(solver_type), intent(inout) :: self

    self%context%balance%slider = self%static_slider
    self%context%balance%periodic = .false.
  end subroutine reset_slider

  !> Norm of the scaled residual that counts as converged: relative to the alternating motion where that exceeds the stuck response.
  !> Contacts that slip may let it grow a hundredfold, and rounding of the residual grows with it.
  real(wp) function tight_tolerance(self) result(tight)
    class(solver_type), intent(in) :: self

    associate (context => self%context)
      tight = context%tolerance*max(1.0_wp, context%balance%norm(self%motion(2:, :))/context%motion_scale)
      tight = min(tight, loosest_tolerance)
    end associate
  end function tight_tolerance

  !> Tolerance of the solve that finds which sliders move over a period. With one tangent none does, and the first solve is the last.
  real(wp) function loose_tolerance(self, tight)
    class(solver_type), intent(in) :: self
    !> Tolerance that the last solve keeps
    real(wp), intent(in) :: tight
    !> Tolerance of that solve, part of the motion
    real(wp), parameter :: share = 1.0e-3_wp ! guess

    loose_tolerance = tight
    if (all(self%contacts%law%tangents == 1)) return
    loose_tolerance = max(tight, share*self%context%balance%norm(self%motion(2:, :))/self%context%motion_scale)
  end function loose_tolerance

  !> Solve at a given angular frequency.
  subroutine solve_at(self, omega, early_stop)
    class(solver_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> See `solve_with`
    logical, intent(in), optional :: early_stop
    type(constraint_type) :: constraint
    real(wp) :: before

    allocate (constraint%motion, mold=self%motion)
    constraint%motion = 0.0_wp
    ! In the frequency's scale, as along branches: rounding of omega then is no residual, whatever the unit of time.
    constraint%frequency = 1.0_wp/self%context%frequency_scale
    constraint%value = constraint%frequency*omega
    before = self%omega
    self%omega = omega
    call self%solve_with(constraint, early_stop)
    if (.not. self%report%converged) self%omega = before
  end subroutine solve_at

  !> At a given angular frequency, where every contact stuck at the point before, the linear response if it leaves them stuck with
  !> sliders where they are: no iteration is needed. Nothing changes if it does not.
  subroutine solve_stuck_at(self, omega, stuck)
    class(solver_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> Does every contact stick?
    logical, intent(out) :: stuck

    stuck = .false.
    if (.not. self%all_stick) return
    call evaluate_stuck(self%context%balance, omega, self%motion, stuck)
    call self%context%forget()
    if (.not. stuck) return
    self%omega = omega
    self%report = newton_report_type(converged=.true., residual=0.0_wp)
  end subroutine solve_stuck_at

  !> Rows of B that the mean moves along, in columns [n, rows]: those of the stuck system's modes.
  pure function mean_rows(self) result(rows)
    class(solver_type), intent(in) :: self
    real(wp), allocatable :: rows(:, :)

    if (allocated(self%structure%sector)) then
      rows = self%structure%sector%mean_rows(self%contacts%directions)
    else
      rows = self%contacts%directions
    end if
  end function mean_rows

  !> Relative displacements of this rank's rows by a motion of the model's coordinates [2 H + 1, rows].
  pure function relative_motion(self, displacements) result(motion)
    class(solver_type), intent(in) :: self
    !> Fourier coefficients of the model's coordinates [2 H + 1, m]
    real(wp), intent(in) :: displacements(:, :)
    real(wp), allocatable :: motion(:, :)

    associate (first => self%context%balance%first_row, rows => self%context%balance%rows())
      motion = self%contacts%relative_motion(displacements, first, rows)
      if (allocated(self%structure%sector)) motion = motion + self%structure%sector%next_motion(displacements, first, rows)
    end associate
  end function relative_motion

  !> Scales of residuals and steps between two angular frequencies, and the tolerance that rounding leaves.
  subroutine set_scales(self, omega_a, omega_b)
    class(solver_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega_a, omega_b
    real(wp) :: mean

    associate (context => self%context, low => min(omega_a, omega_b), high => max(omega_a, omega_b))
      call find_scales(context%balance, self%stuck%omega_at(1), low, high, context%motion_scale, mean)
      context%frequency_scale = merge(high - low, high, high > low)
      call self%set_motion_scale((context%motion_scale), mean)
    end associate
  end subroutine set_scales

  !> What residuals and steps are relative to, and the tolerance that rounding leaves.
  subroutine set_motion_scale(self, scale, mean)
    class(solver_type), intent(inout) :: self
    !> Norm of the contacts' motion about its mean; norm of the mean
    real(wp), intent(in) :: scale, mean

    associate (context => self%context)
      context%motion_scale = scale
      ! Rounding of the mean, which preloads and gaps move too, must stay below the tolerance on the harmonics; where it would hide
      ! them, points fail rather than pass.
      context%tolerance = min(max(self%options%tolerance, &
                                  1.0e-13_wp*max(mean, context%balance%norm(self%motion(1:1, :)))/scale), loosest_tolerance)
      call context%forget()
    end associate
  end subroutine set_motion_scale

  !> Factors on the static loads, and the level of the harmonic ones.
  subroutine set_loads(self, static_factors, level)
    class(solver_type), intent(inout) :: self
    !> Factors on the static loads; factor on the harmonic loads
    real(wp), intent(in) :: static_factors(:), level

    self%context%balance%static_factors = static_factors
    self%context%balance%level = level
    call self%context%forget()
  end subroutine set_loads

  !> Start the march of every contact from these sliders.
  subroutine set_slider(self, slider, periodic)
    class(solver_type), intent(inout) :: self
    !> [width, contacts of this rank]
    real(wp), intent(in) :: slider(:, :)
    !> Those to be found with the motion rather than marched from here; none unless given
    logical, intent(in), optional :: periodic(:)

    self%context%balance%slider = slider
    if (present(periodic)) then
      self%context%balance%periodic = periodic
    else
      self%context%balance%periodic = .false.
    end if
    call self%context%forget()
  end subroutine set_slider

  !> Go on with another length of the series; the motion keeps the harmonics that both lengths have.
  subroutine set_harmonics(self, harmonics)
    class(solver_type), intent(inout) :: self
    !> Highest harmonic, H
    integer, intent(in) :: harmonics

    if (harmonics == self%options%harmonics) return
    self%options%harmonics = harmonics
    call set_harmonics_of_balance(self%context%balance, self%structure, harmonics)
    self%motion = resized(self%motion, 2*harmonics + 1)
    associate (constraint => self%context%constraint)
      if (allocated(constraint%motion)) constraint%motion = resized(constraint%motion, 2*harmonics + 1)
    end associate
    call self%context%forget()
    call self%newton%take_length()
  end subroutine set_harmonics

  !> Give this rank these contacts. The caller sets motion and sliders afterwards.
  subroutine hold_contacts(self, first, last)
    class(solver_type), intent(inout) :: self
    !> The first and the last of this rank, from 1
    integer, intent(in) :: first, last

    call self%newton%destroy()
    call take_contacts(self%context%balance, self%contacts, first, last)
    if (allocated(self%slider_before)) deallocate (self%slider_before)
    call self%context%forget()
    call new_newton(self%context, self%newton)
  end subroutine hold_contacts

  !> Give the contacts other laws, friction coefficients, gaps and preloads. The caller sets motion and sliders afterwards.
  subroutine change_laws(self, law)
    class(solver_type), intent(inout) :: self
    !> Of all contacts
    type(contact_type), intent(in) :: law(:)
    integer :: i

    self%contacts%law%friction_coefficient = law%friction_coefficient
    self%contacts%law%gap = law%gap
    self%contacts%law%preload = law%preload
    do i = 1, size(law)
      self%contacts%law(i)%law => law(i)%law
    end do
    associate (balance => self%context%balance)
      call self%hold_contacts(balance%first_contact, balance%first_contact + size(balance%law) - 1)
      if (size(self%static_slider, 1) /= size(balance%slider, 1)) self%static_slider = balance%slider
    end associate
    self%all_stick = .false.
  end subroutine change_laws

  !> Save or load what the next point depends on.
  subroutine keep(self, store)
    class(solver_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store
    integer :: first, last, harmonics

    harmonics = self%options%harmonics
    call store%keep(harmonics)
    if (store%reading) call self%set_harmonics(harmonics)
    associate (balance => self%context%balance, context => self%context)
      first = balance%first_contact
      last = first + size(balance%law) - 1
      call store%keep(first)
      call store%keep(last)
      if (store%reading) call self%hold_contacts(max(first, 1), min(last, size(self%contacts%law)))
      call store%keep(self%motion)
      call store%keep(self%static_slider)
      call store%keep(self%static_motion)
      call store%keep(self%omega)
      call store%keep(self%all_stick)
      call store%keep(self%evidence%no_periodic_solution)
      call store%keep(self%evidence%is_drifting)
      call store%keep(context%motion_scale)
      call store%keep(context%frequency_scale)
      call store%keep(context%tolerance)
      call balance%keep(store)
      call context%preconditioner%keep(store)
      if (allocated(context%step%motion)) deallocate (context%step%motion)
      call context%forget()
    end associate
  end subroutine keep

  !> Give back what libraries hold.
  subroutine destroy(self)
    class(solver_type), intent(inout) :: self

    if (.not. associated(self%context)) return
    call self%newton%destroy()
    call self%context%balance%destroy()
    deallocate (self%context)
  end subroutine destroy
end module attrito_solve_solver
