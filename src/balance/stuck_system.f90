!> Modes of the linear system with every contact stuck, (K~, M): the reference that all receptances are built on.
!>
!> $$ (\tilde K - \omega_r^2 M) \phi_r = 0, \qquad \phi_r^T M \phi_s = \delta_{rs} $$
module attrito_balance_stuck_system
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_model_contacts, only: contacts_type, stuck_stiffness
  use attrito_model_structure, only: structure_type, damping_none, damping_ratio, damping_mass
  use attrito_balance_receptance, only: receptance_type
  use attrito_balance_receptance_direct, only: new_receptance_direct
  use attrito_balance_receptance_modal, only: new_receptance_modal
  implicit none
  private
  public :: stuck_system_type, new_stuck_system, new_receptance

  type :: stuck_system_type
    !> K~ [m, m]
    real(wp), allocatable :: stiffness(:, :)
    !> Squares of angular frequencies [m], mass-normalised modes [m, m]
    real(wp), allocatable :: eigenvalues(:), modes(:, :)
    !> Modal damping 2 zeta omega_r or alpha [m]; 0 for other kinds
    real(wp), allocatable :: modal_damping(:)
    !> Do these modes stay uncoupled under the structure's damping?
    logical :: uncoupled = .true.
  end type stuck_system_type

contains

  !> Assemble and diagonalise; says so when a direction is left free by structure and contacts together.
  subroutine new_stuck_system(structure, contacts, tangential, self, error)
    type(structure_type), intent(in) :: structure
    type(contacts_type), intent(in) :: contacts
    !> .false.: contacts closed without friction, which may leave directions free
    logical, intent(in) :: tangential
    type(stuck_system_type), intent(out) :: self
    type(error_type), allocatable, intent(out) :: error
    integer :: info

    self%stiffness = stuck_stiffness(contacts, structure%stiffness, tangential)
    call symmetric_eigenpairs(self%stiffness, structure%mass, self%eigenvalues, self%modes, info)
    if (info /= 0) then
      call raise(error, 'mass: the (reduced) mass matrix is not positive definite: expected every degree of freedom to carry mass', &
                 fault_of_input)
      return
    end if
    if (tangential) call check_nothing_is_free(self, error)
    self%eigenvalues = max(self%eigenvalues, 0.0_wp)
    allocate (self%modal_damping(size(self%eigenvalues)), source=0.0_wp)
    select case (structure%damping_kind)
    case (damping_none)
    case (damping_ratio)
      self%modal_damping = 2.0_wp*structure%damping_value*sqrt(self%eigenvalues)
    case (damping_mass)
      self%modal_damping = structure%damping_value
    case default
      self%uncoupled = .false.
    end select
  end subroutine new_stuck_system

  !> K~ must be regular, or there is no static equilibrium.
  subroutine check_nothing_is_free(self, error)
    type(stuck_system_type), intent(in) :: self
    type(error_type), allocatable, intent(out) :: error
    integer :: free
    character(12) :: text

    free = count(self%eigenvalues <= 1.0e-12_wp*maxval(self%eigenvalues))
    if (free == 0) return
    write (text, '(i0)') free
    call raise(error, 'stiffness: with every contact stuck, K + B^T K_c B leaves '//trim(text)//' motion(s) free: expected'// &
               ' supports or contacts that hold every body (one-tangent contacts may leave a direction free)', fault_of_input)
  end subroutine check_nothing_is_free

  !> The cheapest receptance that is exact for the structure's damping.
  subroutine new_receptance(structure, contacts, stuck, harmonics, receptance)
    type(structure_type), intent(in) :: structure
    type(contacts_type), intent(in) :: contacts
    type(stuck_system_type), intent(in) :: stuck
    integer, intent(in) :: harmonics
    class(receptance_type), allocatable, intent(out) :: receptance

    if (stuck%uncoupled) then
      receptance = new_receptance_modal(stuck%eigenvalues, stuck%modes, stuck%modal_damping, contacts%directions, harmonics)
    else
      receptance = new_receptance_direct(structure, stuck%stiffness, contacts%directions, harmonics)
    end if
  end subroutine new_receptance
end module attrito_balance_stuck_system
