!> Modes of the linear system with every contact stuck, (K~, M): the reference that all receptances are built on.
!>
!> $$ (M - \mu_r \tilde K) x_r = 0, \qquad x_r^T \tilde K x_s = \delta_{rs}, \qquad \omega_r^2 = 1 / \mu_r $$
!>
!> Solved for the largest mu rather than the smallest omega^2, and normalised by stiffness: rounding then is relative to the lowest
!> mode, not to the highest (1e6 times larger on a blade), and sum x_r x_r^T is the static flexibility to rounding. Where K~ is
!> singular, as for contacts without friction, the modes are those of (K~, M), normalised by mass.
!>
!> Of a sector of a cyclic structure these are the modes of its mean, with nodal diameter 0, and `diameters` has those of each
!> harmonic. There coordinates that do not move at a nodal diameter come last (`attrito_linear_diameter_modes`); no list has them.
module attrito_linear_stuck_system
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_model_contacts, only: contacts_type, stuck_stiffness, stuck_springs, spring_stiffness
  use attrito_model_sector, only: sector_type, first_alike, is_mirrored
  use attrito_model_structure, only: structure_type, damping_none, damping_ratio, damping_mass, ratios_of_modes
  use attrito_linear_diameter_modes, only: diameter_modes_type, new_diameter_modes, with_those_at_rest
  use attrito_linear_rigid_body_modes, only: rigid_body_modes
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_receptance_cyclic_direct, only: new_receptance_cyclic_direct
  use attrito_linear_receptance_cyclic_modal, only: new_receptance_cyclic_modal
  use attrito_linear_receptance_direct, only: new_receptance_direct
  use attrito_linear_receptance_modal, only: new_receptance_modal
  use attrito_linear_sector_mean, only: mean_of_sector
  implicit none
  private
  public :: stuck_system_type, new_stuck_system, new_spring_system, new_receptance

  character(*), parameter :: not_positive_mass = &
                             'mass: the (reduced) mass matrix is not positive definite: expected every dof to carry mass'// &
                             ' (elements of few points of integration, as C3D8R and C3D20R, do not give each node some)'

  !> Most negative square of a frequency, as a part of the highest square, that is rounding of a stiffness, not spin softening
  real(wp), parameter :: largest_rounding = 1.0e-10_wp ! guess
  !> How many times as large as that one rounding may be
  real(wp), parameter :: times_rounding = 4.0_wp ! guess

  type :: stuck_system_type
    !> How many of its modes, the first, have a frequency that is nothing but rounding
    integer :: resting = 0
    !> K~ [m, m]
    real(wp), allocatable :: stiffness(:, :)
    !> Modes [m, m] with their stiffness and mass, x^T K~ x and x^T M x [m]
    real(wp), allocatable :: modes(:, :), modal_stiffness(:), modal_mass(:)
    !> Angular frequencies [m], ascending
    real(wp), allocatable :: omega(:)
    !> Modal damping x^T C x = 2 zeta omega_r or alpha, times the modal mass [m]; 0 for other kinds
    real(wp), allocatable :: modal_damping(:)
    !> Do these modes stay uncoupled under the structure's damping and Coriolis forces?
    logical :: uncoupled = .true.
    !> Of a sector: modes at the nodal diameters of harmonics 0, 1, ... half of those after which they repeat; beyond they are
    !> conjugates, as N - n is of n
    type(diameter_modes_type), allocatable :: diameters(:)
    !> Of a sector: harmonics after which nodal diameters repeat
    integer :: period = 1
  contains
    procedure :: omega_at
    procedure :: modal_at
    procedure :: shape_at
    procedure :: coordinates_at
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
    type(structure_type) :: mean
    type(contacts_type) :: mean_contacts

    if (allocated(structure%sector)) then
      call mean_of_sector(structure, contacts, mean, mean_contacts)
      call modes_when_stuck(mean, mean_contacts, tangential, self, error)
      if (.not. allocated(error)) call find_diameters(structure, contacts, stuck_springs(contacts, tangential), .not. tangential, &
                                                      self, error)
    else
      call modes_when_stuck(structure, contacts, tangential, self, error)
    end if
  end subroutine new_stuck_system

  !> The same of a structure by itself.
  subroutine modes_when_stuck(structure, contacts, tangential, self, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> .false.: contacts closed without friction, which may leave directions free
    logical, intent(in) :: tangential
    type(stuck_system_type), intent(inout) :: self
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
  end subroutine modes_when_stuck

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

    type(structure_type) :: mean
    type(contacts_type) :: mean_contacts

    call mean_of_sector(structure, contacts, mean, mean_contacts)
    self%stiffness = spring_stiffness(mean_contacts, mean%stiffness, springs)
    call modes_by_mass(mean%mass, self, error)
    if (allocated(error)) return
    call set_damping(structure, self)
    if (allocated(structure%sector)) call find_diameters(structure, contacts, springs, .true., self, error)
  end subroutine new_spring_system

  !> Modes of a sector at the nodal diameters of its harmonics.
  subroutine find_diameters(structure, contacts, springs, may_be_free, self, error)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Stiffness of each row [rows]
    real(wp), intent(in) :: springs(:)
    !> May the springs leave motions free?
    logical, intent(in) :: may_be_free
    type(stuck_system_type), intent(inout) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    character(12) :: text
    integer :: h, status

    associate (sector => structure%sector)
      self%period = sector%period()
      allocate (self%diameters(0:self%period/2))
      self%diameters(0) = diameter_modes_type(cmplx(self%stiffness, kind=wp), cmplx(self%modes, kind=wp), self%modal_stiffness, &
                                              self%modal_mass, self%modal_damping, self%omega, size(self%omega))
      if (size(self%omega) < size(sector%kept)) call take_all_coordinates(sector, self)
      do h = 1, ubound(self%diameters, 1)
        call new_diameter_modes(structure, contacts%directions, springs, sector%diameter(h), may_be_free, self%diameters(h), status)
        if (status == 0) cycle
        write (text, '(i0)') sector%diameter(h)
        call raise(error, 'stiffness and mass: with every contact stuck, those of nodal diameter '//trim(text)//' are not'// &
                   ' positive definite: expected supports or contacts that hold every body', fault_of_input)
        return
      end do
    end associate
  end subroutine find_diameters

  !> The mean in all of a sector's coordinates, also those of nodes on the axis that do not move at nodal diameter 0.
  pure subroutine take_all_coordinates(sector, self)
    !> How sectors hang together
    type(sector_type), intent(in) :: sector
    type(stuck_system_type), intent(inout) :: self

    self%diameters(0) = with_those_at_rest(self%diameters(0), sector%moving(0), size(sector%kept))
    associate (all => self%diameters(0))
      self%stiffness = real(all%stiffness, wp)
      self%modes = real(all%modes, wp)
      self%modal_stiffness = all%modal_stiffness
      self%modal_mass = all%modal_mass
      self%modal_damping = all%modal_damping
      self%omega = all%omega
    end associate
  end subroutine take_all_coordinates

  !> Angular frequencies at a harmonic, ascending [modes].
  pure function omega_at(self, h) result(omega)
    class(stuck_system_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    real(wp), allocatable :: omega(:)

    if (allocated(self%diameters)) then
      associate (own => self%diameters(first_alike(h, self%period)))
        omega = own%omega(:own%count)
      end associate
    else
      omega = self%omega
    end if
  end function omega_at

  !> Stiffness, mass and damping of the modes at a harmonic, ascending.
  pure subroutine modal_at(self, h, stiffness, mass, damping)
    class(stuck_system_type), intent(in) :: self
    !> Number of the harmonic
    integer, intent(in) :: h
    !> [modes]
    real(wp), allocatable, intent(out) :: stiffness(:), mass(:), damping(:)

    if (allocated(self%diameters)) then
      associate (own => self%diameters(first_alike(h, self%period)))
        stiffness = own%modal_stiffness(:own%count)
        mass = own%modal_mass(:own%count)
        damping = own%modal_damping(:own%count)
      end associate
    else
      stiffness = self%modal_stiffness
      mass = self%modal_mass
      damping = self%modal_damping
    end if
  end subroutine modal_at

  !> A mode at a harmonic, in the model's coordinates [m].
  function shape_at(self, structure, h, mode) result(shape)
    class(stuck_system_type), intent(in) :: self
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Numbers of the harmonic and of the mode, from 1, ascending
    integer, intent(in) :: h, mode
    complex(wp), allocatable :: shape(:), columns(:, :)

    if (allocated(self%diameters)) then
      columns = self%diameters(first_alike(h, self%period))%modes(:, mode:mode)
      if (is_mirrored(h, self%period)) columns = conjg(columns)
      columns = structure%sector%expand(columns, structure%sector%diameter(h))
      shape = columns(:, 1)
    else
      shape = cmplx(self%modes(:, mode), kind=wp)
    end if
  end function shape_at

  !> A motion at a harmonic in its modes, x_r^H M q / x_r^H M x_r [modes].
  function coordinates_at(self, structure, h, displacement) result(coordinates)
    class(stuck_system_type), intent(in) :: self
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Number of the harmonic
    integer, intent(in) :: h
    !> q, of the model's coordinates [m]
    complex(wp), intent(in) :: displacement(:)
    complex(wp), allocatable :: coordinates(:), inertia(:, :)

    inertia = reshape(matmul(structure%mass, displacement), [size(displacement), 1])
    if (allocated(self%diameters)) then
      inertia = structure%sector%project(inertia, structure%sector%diameter(h))
      if (is_mirrored(h, self%period)) inertia = conjg(inertia)
      associate (own => self%diameters(first_alike(h, self%period)))
        coordinates = matmul(conjg(transpose(own%modes(:, :own%count))), inertia(:, 1))/own%modal_mass(:own%count)
      end associate
      if (is_mirrored(h, self%period)) coordinates = conjg(coordinates)
    else
      coordinates = matmul(transpose(self%modes), inertia(:, 1))/self%modal_mass
    end if
  end function coordinates_at

  !> Modal damping of the modes that were found.
  pure subroutine set_damping(structure, self)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    type(stuck_system_type), intent(inout) :: self

    allocate (self%modal_damping(size(self%omega)), source=0.0_wp)
    select case (structure%damping_kind)
     case (damping_none)
     case (damping_ratio)
      self%modal_damping = 2.0_wp*ratios_of_modes(structure, size(self%omega))*sqrt(self%modal_mass*self%modal_stiffness)
     case (damping_mass)
      self%modal_damping = structure%damping_value*self%modal_mass
     case default
      self%uncoupled = .false.
    end select
    if (allocated(structure%gyroscopic)) self%uncoupled = .false.
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

  !> Modes of K~ x = omega^2 M x; K~ may be singular, and then rounding of its entries leaves its rigid-body modes squares of
  !> frequencies of either sign. The most negative one says how large that rounding is: what is as small is nothing.
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
    associate (square => self%modal_stiffness)
      if (-square(1) <= largest_rounding*square(size(square))) then
        self%resting = count(square <= -times_rounding*square(1))
        square(:self%resting) = 0.0_wp
      end if
    end associate
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
               ' supports or contacts that hold every body (one-tangent contacts may leave a direction free),'// &
               ' or [model] suspension_hz of a structure that floats', fault_of_input)
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

    if (allocated(structure%sector) .and. stuck%uncoupled) then
      receptance = new_receptance_cyclic_modal(structure%sector, stuck%diameters, contacts%directions, harmonics)
    else if (allocated(structure%sector)) then
      receptance = new_receptance_cyclic_direct(structure, stuck%diameters, contacts%directions, harmonics)
    else if (stuck%uncoupled) then
      receptance = new_receptance_modal(stuck%modal_stiffness, stuck%modal_mass, stuck%modal_damping, stuck%modes, &
                                        contacts%directions, harmonics)
    else
      receptance = new_receptance_direct(structure, stuck%stiffness, stuck%modes, contacts%directions, harmonics, &
                                         stuck%modal_damping)
    end if
  end subroutine new_receptance
end module attrito_linear_stuck_system
