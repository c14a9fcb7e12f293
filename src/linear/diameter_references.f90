!> Modes of a sector's reference systems at any nodal diameter, normalised by mass:
!>
!> $$ S_n^H (K + B^T K_c S B) S_n x_r = \omega_r^2 M_n x_r, \qquad x_r^H M_n x_s = \delta_{rs}, \qquad
!>    2 \zeta_r \omega_r = x_r^H C_n x_r $$
!>
!> What contacts do in them is said in `references`. The phase, which is free, makes the largest displacement real and positive. A
!> damping ratio is defined on the stuck system's modes of the same nodal diameter,
!>
!> $$ x^H C_n x = \sum_r c_r |x_r^H M_n x|^2 / m_r^2. $$
!>
!> With Coriolis forces modes of n and N - n differ, and to first order in C
!>
!> $$ (K_n - \omega_r^2 M_n + i \omega_r G_n) x_r = 0, \qquad
!>    2 \zeta_r \omega_r = x_r^H C_n x_r / (1 - i x_r^H G_n x_r / (2 \omega_r)). $$
module attrito_linear_diameter_references
  use attrito_core_errors, only: error_type, raise, fault_of_input
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contacts_type, stuck_springs
  use attrito_model_structure, only: structure_type, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  use attrito_linear_diameter_modes, only: diameter_modes_type, new_diameter_modes
  use attrito_linear_gyroscopic_modes, only: gyroscopic_modes_of_diameter, gyroscopic_form
  use attrito_linear_references, only: reference_springs, free_motions
  implicit none
  private
  public :: modes_of_diameter

contains

  !> The lowest modes of a reference system at a nodal diameter.
  subroutine modes_of_diameter(structure, contacts, kind, closed, diameter, omega, damping_ratios, shapes, rigid, error)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> One of `reference_...`; n
    integer, intent(in) :: kind, diameter
    !> Contacts that are closed at the static solution [contacts]; not allocated where there is none yet
    logical, allocatable, intent(in) :: closed(:)
    !> Angular frequencies, ascending, and damping ratios, 0 of rigid-body modes [count]
    real(wp), intent(out) :: omega(:), damping_ratios(:)
    !> S_n x_r in columns, the upper boundary along the next sector's axes [m, count]
    complex(wp), intent(out) :: shapes(:, :)
    !> Rigid-body modes among all of them; they come first
    integer, intent(out) :: rigid
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(diameter_modes_type) :: modes
    real(wp), allocatable :: springs(:), all_omega(:), inertia(:)
    complex(wp), allocatable :: vectors(:, :), gyroscopic(:, :)
    integer :: count, first, free, status

    rigid = 0
    call reference_springs(contacts, kind, closed, springs, error)
    if (.not. allocated(error)) call held_modes(structure, contacts%directions, springs, diameter, modes, error)
    if (allocated(error)) return
    count = size(omega)
    free = free_motions(modes%stiffness)
    rigid = free
    if (allocated(structure%gyroscopic)) then
      gyroscopic = structure%sector%couple(structure%gyroscopic, diameter)
      call gyroscopic_modes_of_diameter(structure, modes%stiffness, diameter, free, all_omega, vectors, rigid, status)
      if (status /= 0) then
        call raise(error, 'the modes with Coriolis forces were not found')
        return
      end if
      vectors = vectors(:, :count)
      omega = all_omega(:count)
    else
      vectors = modes%modes(:, :count)/spread(sqrt(modes%modal_mass(:count)), 1, size(modes%modes, 1))
      omega = modes%omega(:count)
    end if
    call set_phases(vectors)
    first = min(rigid, count) + 1
    inertia = 2.0_wp*omega(first:)
    if (allocated(gyroscopic)) inertia = inertia - gyroscopic_form(gyroscopic, vectors(:, first:))
    damping_ratios = 0.0_wp
    damping_ratios(first:) = damping_form(structure, contacts, diameter, vectors(:, first:), omega(first:))/inertia
    shapes = structure%sector%expand(vectors, diameter)
  end subroutine modes_of_diameter

  !> By stiffness where the springs hold every motion, else by mass.
  subroutine held_modes(structure, directions, springs, diameter, modes, error)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> Rows of B on the sector itself, in columns [m, rows], and their springs [rows]
    real(wp), intent(in) :: directions(:, :), springs(:)
    !> n
    integer, intent(in) :: diameter
    type(diameter_modes_type), intent(out) :: modes
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer :: status

    call new_diameter_modes(structure, directions, springs, diameter, .false., modes, status)
    if (status == 0) then
      if (free_motions(modes%stiffness) == 0) return
    end if
    call new_diameter_modes(structure, directions, springs, diameter, .true., modes, status)
    if (status /= 0) call raise(error, 'mass: the (reduced) mass matrix of the sector is not positive definite: expected every'// &
                                ' dof, or its partner on the other boundary, to carry mass', fault_of_input)
  end subroutine held_modes

  !> Turn each column so that its largest entry is real and positive.
  pure subroutine set_phases(vectors)
    !> [n, count]
    complex(wp), intent(inout) :: vectors(:, :)
    complex(wp) :: largest
    integer :: i

    do i = 1, size(vectors, 2)
      largest = vectors(maxloc(abs(vectors(:, i)), 1), i)
      vectors(:, i) = vectors(:, i)*(conjg(largest)/abs(largest))
    end do
  end subroutine set_phases

  !> x^H C_n x of each column.
  function damping_form(structure, contacts, diameter, vectors, omega) result(form)
    !> The sector: mass, stiffness, damping
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> n
    integer, intent(in) :: diameter
    !> x, of unit modal mass, in columns [n, count], and the angular frequency of each [count]
    complex(wp), intent(in) :: vectors(:, :)
    real(wp), intent(in) :: omega(:)
    real(wp) :: form(size(vectors, 2))
    type(diameter_modes_type) :: stuck
    complex(wp), allocatable :: coordinates(:, :)
    type(error_type), allocatable :: error

    associate (sector => structure%sector)
      select case (structure%damping_kind)
       case (damping_viscous)
        form = quadratic_form(sector%couple(structure%damping, diameter), vectors)
       case (damping_mass)
        form = structure%damping_value
       case (damping_loss_factor)
        form = structure%damping_value*quadratic_form(sector%couple(structure%stiffness, diameter), vectors)/omega
       case (damping_ratio)
        call held_modes(structure, contacts%directions, stuck_springs(contacts, .true.), diameter, stuck, error)
        form = 0.0_wp
        if (allocated(error)) return
        coordinates = matmul(sector%couple(structure%mass, diameter), vectors)
        coordinates = matmul(conjg(transpose(stuck%modes)), coordinates)
        form = matmul(stuck%modal_damping/stuck%modal_mass**2, abs(coordinates)**2)
       case default
        form = 0.0_wp
      end select
    end associate
  end function damping_form

  !> x^H A x of each column.
  pure function quadratic_form(matrix, vectors) result(form)
    !> A [n, n], Hermitian; x in columns [n, count]
    complex(wp), intent(in) :: matrix(:, :), vectors(:, :)
    real(wp) :: form(size(vectors, 2))

    form = real(sum(conjg(vectors)*matmul(matrix, vectors), 1), wp)
  end function quadratic_form
end module attrito_linear_diameter_references
