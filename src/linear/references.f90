!> The linear systems that a nonlinear response is compared with, by what contacts do in them:
!>
!> $$ K_{ref} = K + B^T K_c S B, \qquad K_{ref} x_r = \omega_r^2 M x_r, \qquad x_r^T M x_s = \delta_{rs} $$
!>
!> Stuck: every contact is closed and sticks, S = I. Frictionless: every contact is closed and slides, S keeps the normals. Tangent:
!> the contacts that are open at the static solution are open, the others stick. What a system does not hold moves as a rigid body:
!> such modes come first, at a frequency of zero but for rounding, and are counted apart.
!>
!> A damping ratio is defined on the modes of the stuck system; modes of the tangent system take x^T C x of that damping. Of a sector
!> rigid-body modes are those of the nodal diameter of the first harmonic.
module attrito_linear_references
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contacts_type, stuck_springs
  use attrito_model_sector, only: first_alike
  use attrito_model_structure, only: structure_type, damping_ratio
  use attrito_linear_damping, only: damping_form
  use attrito_linear_gyroscopic_modes, only: gyroscopic_modes, gyroscopic_modes_of_diameter
  use attrito_linear_rigid_body_modes, only: rigid_body_modes
  use attrito_linear_stuck_system, only: stuck_system_type, new_stuck_system, new_spring_system
  implicit none
  private
  public :: reference_type, new_reference, reference_springs, free_motions
  public :: reference_stuck, reference_frictionless, reference_tangent

  integer, parameter :: reference_stuck = 0, reference_frictionless = 1, reference_tangent = 2

  type :: reference_type
    type(stuck_system_type) :: system
    !> How many of its modes, the first ones, are rigid-body modes
    integer :: rigid = 0
  contains
    procedure :: shapes
    procedure :: natural
  end type reference_type

contains

  !> Assemble and diagonalise one of them.
  subroutine new_reference(structure, contacts, stuck, kind, closed, self, error)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    !> One of `reference_...`
    integer, intent(in) :: kind
    !> Contacts that are closed at the static solution [contacts]; not allocated where there is none yet
    logical, allocatable, intent(in) :: closed(:)
    type(reference_type), intent(out) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: springs(:)

    select case (kind)
     case (reference_stuck)
      self%system = stuck
      return
     case (reference_frictionless)
      call new_stuck_system(structure, contacts, .false., self%system, error)
     case default
      call reference_springs(contacts, kind, closed, springs, error)
      if (.not. allocated(error)) call new_spring_system(structure, contacts, springs, self%system, error)
    end select
    if (allocated(error)) return
    if (allocated(structure%sector)) then
      if (kind == reference_tangent .and. structure%damping_kind == damping_ratio) call project_damping(structure, stuck, self%system)
      self%rigid = free_motions(self%system%diameters(first_alike(1, stuck%period))%stiffness)
      return
    end if
    if (kind == reference_tangent .and. structure%damping_kind == damping_ratio) self%system%modal_damping = &
      damping_form(structure, stuck, self%system%modes, self%system%omega)
    self%rigid = max(size(rigid_body_modes(self%system%stiffness), 2), self%system%resting)
  end subroutine new_reference

  !> Natural angular frequencies of a structure, or of a sector in the wave of its first harmonic, with Coriolis forces.
  subroutine natural(self, structure, omega, rigid)
    class(reference_type), intent(in) :: self
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Ascending [n]
    real(wp), allocatable, intent(out) :: omega(:)
    !> How many of them, the first, are of rigid-body modes
    integer, intent(out) :: rigid
    complex(wp), allocatable :: shapes(:, :)
    integer :: status

    rigid = self%rigid
    omega = self%system%omega_at(1)
    if (.not. allocated(structure%gyroscopic)) return
    if (allocated(structure%sector)) then
      call gyroscopic_modes_of_diameter(structure, self%system%diameters(first_alike(1, self%system%period))%stiffness, &
                                        structure%sector%diameter(1), self%rigid, omega, shapes, rigid, status)
    else
      call gyroscopic_modes(cmplx(self%system%stiffness, kind=wp), cmplx(structure%mass, kind=wp), &
                            cmplx(structure%gyroscopic, kind=wp), self%rigid, omega, shapes, rigid, status)
    end if
    if (status /= 0) omega = 0.0_wp*self%system%omega_at(1)
  end subroutine natural

  !> Stiffness of each row in one of them.
  subroutine reference_springs(contacts, kind, closed, springs, error)
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> One of `reference_...`
    integer, intent(in) :: kind
    !> Contacts that are closed at the static solution [contacts]; not allocated where there is none yet
    logical, allocatable, intent(in) :: closed(:)
    !> [rows]
    real(wp), allocatable, intent(out) :: springs(:)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    if (kind /= reference_tangent) then
      springs = stuck_springs(contacts, kind == reference_stuck)
    else if (allocated(closed)) then
      springs = closed_springs(contacts, closed)
    else
      call raise(error, 'the tangent system needs the static solution: expected the static load path to be followed first')
    end if
  end subroutine reference_springs

  !> Motions that a Hermitian stiffness leaves free.
  integer function free_motions(stiffness)
    !> [n, n]
    complex(wp), intent(in) :: stiffness(:, :)

    free_motions = size(rigid_body_modes(in_real_form(stiffness)), 2)/2
  end function free_motions

  !> The stuck modes' damping in the modes of another system of the same sector, at all nodal diameters,
  !>
  !> $$ c_s = \sum_r c_r |x_r^H M_n y_s|^2 / m_r^2. $$
  pure subroutine project_damping(structure, stuck, system)
    !> The sector
    type(structure_type), intent(in) :: structure
    !> Linear system with every contact stuck
    type(stuck_system_type), intent(in) :: stuck
    !> Whose modes y take the damping
    type(stuck_system_type), intent(inout) :: system
    complex(wp), allocatable :: coordinates(:, :)
    integer :: h

    do h = 0, ubound(stuck%diameters, 1)
      associate (from => stuck%diameters(h), to => system%diameters(h))
        coordinates = matmul(structure%sector%couple(structure%mass, structure%sector%diameter(h)), to%modes)
        coordinates = matmul(conjg(transpose(from%modes)), coordinates)
        to%modal_damping = matmul(from%modal_damping/from%modal_mass**2, abs(coordinates)**2)
      end associate
    end do
  end subroutine project_damping

  !> A Hermitian matrix as a symmetric one of twice the size: each of its null vectors counts twice.
  pure function in_real_form(matrix) result(doubled)
    !> [n, n]
    complex(wp), intent(in) :: matrix(:, :)
    real(wp) :: doubled(2*size(matrix, 1), 2*size(matrix, 1))

    associate (n => size(matrix, 1))
      doubled(:n, :n) = real(matrix, wp)
      doubled(n + 1:, :n) = aimag(matrix)
      doubled(:n, n + 1:) = -aimag(matrix)
      doubled(n + 1:, n + 1:) = real(matrix, wp)
    end associate
  end function in_real_form

  !> Stiffness of each row where only some contacts are closed, and stick [rows].
  pure function closed_springs(contacts, closed) result(springs)
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> [contacts]
    logical, intent(in) :: closed(:)
    real(wp) :: springs(size(contacts%row_stiffness))
    integer :: i

    springs = contacts%row_stiffness
    do i = 1, size(closed)
      associate (law => contacts%law(i))
        if (.not. closed(i)) springs(law%first_row:law%first_row + law%tangents) = 0.0_wp
      end associate
    end do
  end function closed_springs

  !> The first modes, normalised by mass [m, count].
  pure function shapes(self, count)
    class(reference_type), intent(in) :: self
    !> At most as many as there are
    integer, intent(in) :: count
    real(wp) :: shapes(size(self%system%modes, 1), count)

    shapes = self%system%modes(:, :count)/spread(sqrt(self%system%modal_mass(:count)), 1, size(shapes, 1))
  end function shapes
end module attrito_linear_references
