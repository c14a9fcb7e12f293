!> Motions that the structure leaves free: along them the contacts' mean forces have to balance the static loads by themselves,
!>
!> $$ s = Z^T (f_0 - B^T \lambda_0) = 0 \quad \text{where} \quad K Z = 0, \qquad (K_c B Z)^T K_c B Z = I. $$
!>
!> The residual r_0 of the condensed balance shows that but for rounding: s = -(K_c B Z)^T r_0, so |s| <= |r_0| at every motion.
!> Rounding of the stuck modes, though, is a spring (1e-12 of the contacts' with 100 of them), and far enough away it holds a body
!> that drifts. There r_0 vanishes and s does not.
!>
!> A structure put together of parts leaves motions free but for rounding of its stiffest part, which is a spring too, or one less
!> than nothing. Along such a motion it holds no body either:
!>
!> $$ x^T K x < \epsilon \max_i K_{ii} \, x^T x. $$
module attrito_linear_rigid_body_modes
  use attrito_core_cholesky, only: factor_positive
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: null_space, solve_dense, symmetric_eigenpairs
  use attrito_model_contacts, only: contacts_type
  use attrito_model_structure, only: structure_type
  use attrito_linear_sector_mean, only: mean_of_sector
  implicit none
  private
  public :: rigid_body_modes_type, new_rigid_body_modes, rigid_body_modes

  !> Square of the part of a motion's forces that is normal, up to which it is rounding
  real(wp), parameter :: no_part = 1.0e-12_wp ! derived
  !> epsilon: products with a basis round each entry to a few digits of the largest
  real(wp), parameter :: rounding = 64.0_wp*epsilon(1.0_wp) ! guess

  type :: rigid_body_modes_type
    !> How many, and how many of these, the first, slide along all contacts
    integer :: count = 0, sliding = 0
    !> Is a motion free, or held by nothing but rounding? Else the structure holds every body by itself
    logical :: leaves_motion = .false.
    !> B Z of all rows, and the same times the rows' stiffness [rows, count]
    real(wp), allocatable :: rows(:, :), held_rows(:, :)
    !> Static loads in columns [count, loads], and the constant part of the harmonic load at level 1 [count]
    real(wp), allocatable :: static_loads(:, :), mean_load(:)
  contains
    procedure :: slide_of
    procedure :: slide_with
  end type rigid_body_modes_type

contains

  !> Of a structure that contacts hold, or of the mean of a sector.
  function new_rigid_body_modes(structure, contacts) result(self)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    type(rigid_body_modes_type) :: self
    type(structure_type) :: mean
    type(contacts_type) :: mean_contacts

    if (allocated(structure%sector)) then
      call mean_of_sector(structure, contacts, mean, mean_contacts)
      self = free_motions_of(mean, mean_contacts)
    else
      self = free_motions_of(structure, contacts)
    end if
  end function new_rigid_body_modes

  !> Of a structure by itself.
  function free_motions_of(structure, contacts) result(self)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    type(rigid_body_modes_type) :: self
    real(wp), allocatable :: motions(:, :), normal_part(:), turned(:, :), normal(:, :)
    integer :: info

    motions = rigid_body_modes(structure%stiffness)
    self%leaves_motion = size(motions, 2) > 0
    if (.not. self%leaves_motion) then
      self%leaves_motion = rounding_holds(structure%stiffness)
      return
    end if
    self%rows = matmul(transpose(contacts%directions), motions)
    self%held_rows = spread(contacts%row_stiffness, 2, size(motions, 2))*self%rows
    normal = self%held_rows(contacts%law%first_row + contacts%law%tangents, :)
    call symmetric_eigenpairs(matmul(transpose(normal), normal), matmul(transpose(self%held_rows), self%held_rows), &
                              normal_part, turned, info)
    if (info /= 0) return
    self%count = size(motions, 2)
    self%sliding = count(normal_part <= no_part)
    self%rows = matmul(self%rows, turned)
    self%held_rows = matmul(self%held_rows, turned)
    motions = matmul(motions, turned)
    self%static_loads = matmul(transpose(motions), structure%static_loads)
    self%mean_load = matmul(structure%harmonic_load(:, 1), motions)
  end function free_motions_of

  !> Is any motion held by nothing but rounding? Then K - epsilon max K_ii is not positive.
  logical function rounding_holds(stiffness)
    !> K
    real(wp), intent(in) :: stiffness(:, :)
    real(wp) :: less(size(stiffness, 1), size(stiffness, 1)), largest
    integer :: i, info

    less = stiffness
    largest = maxval([(stiffness(i, i), i=1, size(less, 1))])
    do i = 1, size(less, 1)
      less(i, i) = less(i, i) - rounding*largest
    end do
    call factor_positive(less, info)
    rounding_holds = info /= 0
  end function rounding_holds

  !> Motions that a stiffness makes nothing of but rounding [m, count]: scaled to a unit diagonal, so that stiff and soft parts count
  !> alike and stiff contacts beside soft parts do not look like free motions.
  function rigid_body_modes(stiffness) result(motions)
    !> Stiffness, of each mode or as a matrix
    real(wp), intent(in) :: stiffness(:, :)
    real(wp), allocatable :: motions(:, :)
    real(wp) :: scale(size(stiffness, 1))
    integer :: i

    scale = [(stiffness(i, i), i=1, size(scale))]
    where (scale > 0.0_wp)
      scale = 1.0_wp/sqrt(scale)
    else where
      scale = 1.0_wp
    end where
    call null_space(stiffness*spread(scale, 1, size(scale))*spread(scale, 2, size(scale)), &
                    10.0_wp*epsilon(1.0_wp)*size(scale), motions)
    motions = motions*spread(scale, 2, size(motions, 2))
  end function rigid_body_modes

  !> Of mean displacements d the part that slides along all contacts, (B Z)_i c with the c that leave least of d in their springs,
  !>
  !> $$ (B Z)^T K_c B Z \, c = (B Z)^T K_c d. $$
  function slide_of(self, held) result(slide)
    class(rigid_body_modes_type), intent(in) :: self
    !> (K_c B Z)^T d of the motions that slide, summed over all rows [sliding]
    real(wp), intent(in) :: held(:)
    !> c [sliding]
    real(wp) :: slide(size(held)), matrix(size(held), size(held)), right(size(held), 1)
    integer :: info

    matrix = matmul(transpose(self%rows(:, :size(held))), self%held_rows(:, :size(held)))
    right(:, 1) = held
    call solve_dense(matrix, right, info)
    slide = merge(right(:, 1), 0.0_wp, info == 0)
  end function slide_of

  !> The motion c of those that slide along some contacts which is nearest to a change, in the norm of the springs; sums are over the
  !> rows of these contacts.
  function slide_with(self, sums, right) result(motion)
    class(rigid_body_modes_type), intent(in) :: self
    !> (K_c B Z)^T K_c B Z of normal rows and of all, and (B Z)^T K_c B Z [count, count, 3]
    real(wp), intent(in) :: sums(:, :, :)
    !> (K_c B Z)^T d [count]
    real(wp), intent(in) :: right(:)
    !> [count]
    real(wp) :: motion(size(right))
    real(wp), allocatable :: normal_part(:), motions(:, :), matrix(:, :), answer(:, :)
    integer :: slides, info

    motion = 0.0_wp
    if (maxval(abs(sums(:, :, 2))) <= 0.0_wp) return
    ! Motions that no contact feels slide, too: a rounding of the rest holds them.
    call symmetric_eigenpairs(sums(:, :, 1), held_by_rounding(sums(:, :, 2)), normal_part, motions, info)
    if (info /= 0) return
    slides = count(normal_part <= no_part)
    if (slides == 0) return
    motions = motions(:, :slides)
    matrix = matmul(transpose(motions), matmul(held_by_rounding(sums(:, :, 3)), motions))
    answer = reshape(matmul(right, motions), [slides, 1])
    call solve_dense(matrix, answer, info)
    if (info == 0) motion = matmul(motions, answer(:, 1))
  end function slide_with

  !> A matrix with a spring of its largest entry's rounding along every motion.
  pure function held_by_rounding(matrix) result(held)
    !> Symmetric [n, n]
    real(wp), intent(in) :: matrix(:, :)
    !> [n, n]
    real(wp) :: held(size(matrix, 1), size(matrix, 2))
    integer :: i

    held = matrix
    do i = 1, size(matrix, 1)
      held(i, i) = held(i, i) + no_part*maxval(abs(matrix))
    end do
  end function held_by_rounding
end module attrito_linear_rigid_body_modes
