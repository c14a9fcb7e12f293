!> Modes of the linear system with every contact stuck, (K~, M): the reference that all receptances are built on.
!>
!> $$ (M - \mu_r \tilde K) x_r = 0, \qquad x_r^T \tilde K x_s = \delta_{rs}, \qquad \omega_r^2 = 1 / \mu_r $$
!>
!> Solved for the largest mu rather than the smallest omega^2, and normalised by stiffness: rounding then is relative to the lowest
!> mode, not to the highest (1e6 times larger on a blade), and sum x_r x_r^T is the static flexibility to rounding. Where K~ is
!> singular, as for contacts without friction, the modes are those of (K~, M), normalised by mass.
module attrito_linear_stuck_system
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_model_contacts, only: contacts_type, stuck_stiffness, spring_stiffness
  use attrito_model_structure, only: structure_type, damping_none, damping_ratio, damping_mass
  use attrito_linear_rigid_body_modes, only: rigid_body_modes
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_receptance_direct, only: new_receptance_direct
  use attrito_linear_receptance_modal, only: new_receptance_modal
  implicit none
  private
  public :: stuck_system_type, new_stuck_system, new_spring_system, new_receptance

  character(*), parameter :: not_positive_mass = &
                             'mass: the (reduced) mass matrix is not positive definite: expected every dof to carry mass'

  type :: stuck_system_type
    !> K~ [m, m]
    real(wp), allocatable :: stiffness(:, :)
    !> Modes [m, m] with their stiffness and mass, x^T K~ x and x^T M x [m]
    real(wp), allocatable :: modes(:, :), modal_stiffness(:), modal_mass(:)
    !> Angular frequencies [m], ascending
    real(wp), allocatable :: omega(:)
    !> Modal damping x^T C x = 2 zeta omega_r or alpha, times the modal mass [m]; 0 for other kinds
    real(wp), allocatable :: modal_damping(:)
    !> Do these modes stay uncoupled under the structure's damping?
    logical :: uncoupled = .true.
  end type stuck_system_type

contains

  !> Assemble and diagonalise; with stuck contacts, says so when structure and contacts together leave a direction free.
  subroutine new_stuck_system(structure, contacts, tangential, self, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> .false.: contacts closed without friction, which may leave directions free
    logical, intent(in) :: tangential
    type(stuck_system_type), intent(out) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    self%stiffness = stuck_stiffness(contacts, structure%stiffness, tangential)
    if (tangential) then
      call modes_by_stiffness(structure%mass, self, error)
    else
      call modes_by_mass(structure%mass, self, error)
    end if
    if (allocated(error)) return
    call set_damping(structure, self)
  end subroutine new_stuck_system

  !> The same of a system whose rows have springs of their own, which may leave directions free.
  subroutine new_spring_system(structure, contacts, springs, self, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Stiffness of each row [rows]
    real(wp), intent(in) :: springs(:)
    type(stuck_system_type), intent(out) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    self%stiffness = spring_stiffness(contacts, structure%stiffness, springs)
    call modes_by_mass(structure%mass, self, error)
    if (.not. allocated(error)) call set_damping(structure, self)
  end subroutine new_spring_system

  !> Modal damping of the modes that were found.
  pure subroutine set_damping(structure, self)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    type(stuck_system_type), intent(inout) :: self

    allocate (self%modal_damping(size(self%omega)), source=0.0_wp)
    select case (structure%damping_kind)
     case (damping_none)
     case (damping_ratio)
      self%modal_damping = 2.0_wp*structure%damping_value*sqrt(self%modal_mass*self%modal_stiffness)
     case (damping_mass)
      self%modal_damping = structure%damping_value*self%modal_mass
     case default
      self%uncoupled = .false.
    end select
  end subroutine set_damping

  !> Modes of M x = mu K~ x: K~ must be positive definite, or there is no static equilibrium.
  subroutine modes_by_stiffness(mass, self, error)
    !> Mass, of each mode or as a matrix
    real(wp), intent(in) :: mass(:, :)
    type(stuck_system_type), intent(inout) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: eigenvalues(:), modes(:, :)
    integer :: info, m

    m = size(mass, 1)
    call check_nothing_is_free(self%stiffness, error)
    if (allocated(error)) return
    call symmetric_eigenpairs(mass, self%stiffness, eigenvalues, modes, info)
    if (info /= 0) then
      call raise(error, 'stiffness: with every contact stuck, K + B^T K_c B is not positive definite: expected a structure that'// &
                 ' is stable when its contacts stick', fault_of_input)
      return
    end if
    if (eigenvalues(1) < -1.0e-12_wp*eigenvalues(m)) then
      call raise(error, not_positive_mass, fault_of_input)
      return
    end if
    self%modes = modes(:, m:1:-1)
    self%modal_mass = max(eigenvalues(m:1:-1), tiny(1.0_wp))
    allocate (self%modal_stiffness(m), source=1.0_wp)
    self%omega = 1.0_wp/sqrt(self%modal_mass)
  end subroutine modes_by_stiffness

  !> Modes of K~ x = omega^2 M x; K~ may be singular.
  subroutine modes_by_mass(mass, self, error)
    !> Mass, of each mode or as a matrix
    real(wp), intent(in) :: mass(:, :)
    type(stuck_system_type), intent(inout) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer :: info

    call symmetric_eigenpairs(self%stiffness, mass, self%modal_stiffness, self%modes, info)
    if (info /= 0) then
      call raise(error, not_positive_mass, fault_of_input)
      return
    end if
    self%modal_stiffness = max(self%modal_stiffness, 0.0_wp)
    allocate (self%modal_mass(size(self%modal_stiffness)), source=1.0_wp)
    self%omega = sqrt(self%modal_stiffness)
  end subroutine modes_by_mass

  !> No motion may be left that neither structure nor stuck contacts hold.
  subroutine check_nothing_is_free(stiffness, error)
    !> Stiffness, of each mode or as a matrix
    real(wp), intent(in) :: stiffness(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer :: free
    character(12) :: text

    free = size(rigid_body_modes(stiffness), 2)
    if (free == 0) return
    write (text, '(i0)') free
    call raise(error, 'stiffness: with every contact stuck, K + B^T K_c B leaves '//trim(text)//' motion(s) free: expected'// &
               ' supports or contacts that hold every body (one-tangent contacts may leave a direction free)', fault_of_input)
  end subroutine check_nothing_is_free

  !> The cheapest receptance that is exact for the structure's damping.
  subroutine new_receptance(structure, contacts, stuck, harmonics, receptance)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    !> Receptance of the stuck system between contact rows
    class(receptance_type), allocatable, intent(out) :: receptance

    if (stuck%uncoupled) then
      receptance = new_receptance_modal(stuck%modal_stiffness, stuck%modal_mass, stuck%modal_damping, stuck%modes, &
                                        contacts%directions, harmonics)
    else
      receptance = new_receptance_direct(structure, stuck%stiffness, stuck%modes, contacts%directions, harmonics)
    end if
  end subroutine new_receptance
end module attrito_linear_stuck_system
