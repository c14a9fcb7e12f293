!> The equations of motion in the modes of the stuck system, in a time that the fastest mode sets.
!>
!> $$ p'' + D p' + \Lambda p = f(x) - \Phi^T B^T g, \qquad g = \lambda - K_c d, \quad d = B \Phi p, \quad x = c\, t $$
!>
!> with Phi^T M Phi = 1 and the clock c the highest angular frequency of the stuck system, so that Lambda <= 1. A stuck contact adds
!> constants only.
module attrito_integrate_system
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type, contacts_type
  use attrito_model_structure, only: structure_type, damping_viscous, damping_loss_factor
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system
  implicit none
  private
  public :: system_type, new_system

  type :: system_type
    !> Units of time per second
    real(wp) :: clock = 1.0_wp
    !> Squares of the stuck system's frequencies, and modal damping, over the clock's powers [m]
    real(wp), allocatable :: eigenvalues(:), damping(:)
    !> What damping and Coriolis forces couple of the modes, zero on its diagonal [m, m]; not allocated if nothing
    real(wp), allocatable :: coupling(:, :)
    !> Rows of B Phi in columns [m, rows], and the acceleration per unit of each row's force [m, rows]
    real(wp), allocatable :: rows(:, :), input_map(:, :)
    !> Stiffness of each row when stuck [rows]
    real(wp), allocatable :: springs(:)
    type(contact_type), allocatable :: law(:)
    !> Static loads [m, loads] and harmonic load [m, coefficients] as accelerations
    real(wp), allocatable :: static_loads(:, :), harmonic_load(:, :)
    !> Monitors [m, monitors]
    real(wp), allocatable :: monitors(:, :)
    !> Stiffness of the structure without its contacts, Phi^T K Phi over the clock's square [m, m], and its highest frequency at most;
    !> not allocated where a march of all contacts open gains nothing by it
    real(wp), allocatable :: flight(:, :)
    real(wp) :: flight_pace = 1.0_wp
    !> Modes Phi [m, m], and M Phi to turn coordinates into modes
    real(wp), allocatable :: modes(:, :), weighted(:, :)
  end type system_type

contains

  !> Transform structure and contacts; refuses structural damping, which has no twin in time, and contacts of several elements.
  subroutine new_system(structure, contacts, self, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    type(system_type), intent(out) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    !> Ratio of squared periods below which the shortest counts as none
    real(wp), parameter :: massless = 1.0e-18_wp ! derived
    type(stuck_system_type) :: stuck
    real(wp), allocatable :: modes(:, :)

    if (structure%damping_kind == damping_loss_factor) then
      call raise(error, '[damping] loss_factor: structural damping has no time-domain twin: expected ratio, rayleigh or a'// &
                 ' damping matrix, or [integrate] equivalent_viscous = true', fault_of_input)
      return
    end if
    if (any(contacts%law%elements() > 1)) then
      call raise(error, 'law: several elements in parallel: expected contacts of one element (integration in time, stability)', &
                 fault_of_input)
      return
    end if
    call new_stuck_system(structure, contacts, .true., stuck, error)
    if (allocated(error)) return
    if (minval(stuck%modal_mass/stuck%modal_stiffness) <= massless*maxval(stuck%modal_mass/stuck%modal_stiffness)) then
      call raise(error, 'mass: a motion carries no mass: expected every degree of freedom to carry some (integration in time,'// &
                 ' stability)', fault_of_input)
      return
    end if
    ! Normalised by mass here: a unit of modal velocity is the same energy in every mode.
    allocate (modes, source=stuck%modes/spread(sqrt(stuck%modal_mass), 1, size(stuck%modal_mass)))
    self%clock = maxval(stuck%omega)
    self%eigenvalues = (stuck%omega/self%clock)**2
    self%damping = stuck%modal_damping/stuck%modal_mass/self%clock
    if (structure%damping_kind == damping_viscous) call set_viscous(self, &
      matmul(transpose(modes), matmul(structure%damping, modes))/self%clock)
    if (allocated(structure%gyroscopic)) call add_gyroscopic(self, &
      matmul(transpose(modes), matmul(structure%gyroscopic, modes))/self%clock)
    self%rows = matmul(transpose(modes), contacts%directions)
    self%input_map = self%rows/self%clock**2
    self%springs = contacts%row_stiffness
    self%law = contacts%law
    self%static_loads = matmul(transpose(modes), structure%static_loads)/self%clock**2
    self%harmonic_load = matmul(transpose(modes), structure%harmonic_load)/self%clock**2
    self%monitors = matmul(transpose(modes), structure%monitors)
    call set_flight(self, matmul(transpose(modes), matmul(structure%stiffness, modes))/self%clock**2)
    self%modes = modes
    self%weighted = matmul(structure%mass, modes)
  end subroutine new_system

  !> Keep the stiffness of the open structure if steps are longer with it by more than its products cost.
  pure subroutine set_flight(self, stiffness)
    type(system_type), intent(inout) :: self
    !> [m, m]
    real(wp), intent(in) :: stiffness(:, :)

    self%flight_pace = sqrt(maxval(sum(abs(stiffness), 1)))
    if (self%flight_pace*size(stiffness, 1) < 1 + 2*size(self%springs)) self%flight = stiffness
  end subroutine set_flight

  !> Split modal damping into its diagonal and, unless that is rounding, the rest.
  pure subroutine set_viscous(self, damping)
    type(system_type), intent(inout) :: self
    !> Phi^T C Phi / clock [m, m]
    real(wp), intent(in) :: damping(:, :)
    real(wp), allocatable :: rest(:, :)
    integer :: i

    rest = damping
    do i = 1, size(damping, 1)
      self%damping(i) = damping(i, i)
      rest(i, i) = 0.0_wp
    end do
    if (maxval(abs(rest)) > 1.0e-14_wp*maxval(abs(damping))) self%coupling = rest
  end subroutine set_viscous

  !> Coriolis forces couple modes; being skew they have no diagonal, but for rounding.
  pure subroutine add_gyroscopic(self, gyroscopic)
    type(system_type), intent(inout) :: self
    !> Phi^T G Phi / clock [m, m]
    real(wp), intent(in) :: gyroscopic(:, :)

    if (.not. allocated(self%coupling)) allocate (self%coupling, source=0.0_wp*gyroscopic)
    self%coupling = self%coupling + 0.5_wp*(gyroscopic - transpose(gyroscopic))
  end subroutine add_gyroscopic
end module attrito_integrate_system
