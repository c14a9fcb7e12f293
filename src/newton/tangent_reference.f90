!> The linear system without the springs of contacts that stay open: the tangent reference of the condensed system.
!>
!> $$ D = D_0 + D', \qquad I + D R = (I + D' R') (I + D_0 R), \qquad R' = (I + R D_0)^{-1} R, \qquad (I + D_0 R)^{-1} = I - D_0 R' $$
!>
!> A contact that is open all over the period has D = -K_c, at every harmonic alike. D_0 is that of such contacts, R' the receptance
!> of the structure without their springs, in its own modes. What they add to a Newton step is then known, and the contacts of D',
!> which slip or open for a part of the period, or are open in the reference and touch now, are all there is to solve for: few, where
!> most of a joint is open. The modes cost as much as many steps. They are made anew when steps would have cost that much less with
!> the contacts that are open now, in counted operations: the cost of both together is at most twice the least one.
module attrito_newton_tangent_reference
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_model_contacts, only: contact_type
  use attrito_newton_active_jacobian, only: contact_jacobian_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_opened_modes, only: flops_of_modes
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: tangent_reference_type

  !> Iterations of GMRES that are counted for a step preconditioned by the tangent reference; steps that factors of the contacts left
  !> over serve
  integer, parameter :: tangent_iterations = 6, steps_served = 2 ! measured
  !> Part of their springs kept in the step that leaves open contacts as good as open
  real(wp), parameter :: hardly_kept = 1.0e-6_wp ! derived
  !> Part of the springs that counts as rounding of the Jacobian
  real(wp), parameter :: rounding = 1.0e-9_wp ! derived

  type :: tangent_reference_type
    !> R', of which modes are found when it is needed
    class(receptance_type), allocatable :: receptance
    !> Numbers of the rows of B that have lost their springs, of all ranks, ascending, and these springs
    real(wp), allocatable, private :: rows(:), springs(:)
    !> Which of this rank's contacts these are
    logical, allocatable :: opened(:)
    !> Flops that steps have cost in excess of those with the contacts open at them
    real(wp), private :: owed = 0.0_wp
  contains
    procedure :: prepare
    procedure :: jacobian_left
    procedure :: forget
    procedure :: keep
  end type tangent_reference_type

contains

  !> Make ready for a step at the balance's last evaluation. Does the reference serve it?
  subroutine prepare(self, balance, stiffening, two_level_iterations, serves)
    class(tangent_reference_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Of GMRES that a step preconditioned on two levels is expected to take
    integer, intent(in) :: two_level_iterations
    !> Is it there, and cheaper than two levels?
    logical, intent(out) :: serves
    real(wp) :: counts(3), two_level
    integer :: status

    serves = .false.
    if (stiffening > hardly_kept .or. balance%receptance%held > 0.0_wp .or. balance%receptance%is_lifted()) return
    if (.not. allocated(self%rows)) call self%forget()
    call find_opened(self, balance)
    if (.not. allocated(self%receptance)) call find_modes(self, balance)
    counts = count_unknowns(self, balance)
    two_level = two_level_iterations*flops_of_product(balance, counts(1))
    serves = allocated(self%receptance) .and. flops_of_step(balance, counts(1), counts(2)) < two_level
    self%owed = self%owed - min(two_level, flops_of_step(balance, counts(1), counts(3))) &
                + merge(flops_of_step(balance, counts(1), counts(2)), two_level, serves)
    if (self%owed > flops_of_modes*real(size(balance%response, 1), wp)**3) then
      call renew(self, balance)
      counts = count_unknowns(self, balance)
      serves = allocated(self%receptance) .and. flops_of_step(balance, counts(1), counts(2)) < two_level
    end if
    if (.not. serves) return
    call self%receptance%set_like(balance%receptance, status)
    serves = status == 0
  end subroutine prepare

  !> Which of this rank's contacts have lost their springs: they may be others than of the last time.
  subroutine find_opened(self, balance)
    type(tangent_reference_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    integer :: i

    self%opened = [(any(nint(self%rows) == balance%first_row - 1 + balance%law(i)%first_row), i=1, size(balance%law))]
  end subroutine find_opened

  !> Unknowns of all ranks: of the step as it is; of the contacts left over; and were all open contacts in the reference.
  function count_unknowns(self, balance) result(counts)
    type(tangent_reference_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp) :: counts(3)
    type(contact_jacobian_type) :: left
    integer :: i, own

    counts = 0.0_wp
    do i = 1, size(balance%law)
      own = 0
      if (allocated(balance%forces(i)%jacobian)) own = count(balance%forces(i)%active)
      left = self%jacobian_left(balance, i)
      counts = counts + [own, size(left%rows), merge(0, own, is_open(balance, i))]
    end do
    call balance%ranks%sum(counts)
  end function count_unknowns

  !> Flops of a product with R and one with what preconditions it.
  pure real(wp) function flops_of_product(balance, unknowns)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Unknowns of the step
    real(wp), intent(in) :: unknowns

    flops_of_product = 8.0_wp*unknowns*size(balance%response, 1)
  end function flops_of_product

  !> Flops of a step of so many unknowns of which so many are left over.
  pure real(wp) function flops_of_step(balance, unknowns, left)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Unknowns of the step; unknowns left over
    real(wp), intent(in) :: unknowns, left

    flops_of_step = tangent_iterations*flops_of_product(balance, unknowns) &
                    + (2.0_wp/3.0_wp*left**3 + 2.0_wp*left**2*size(balance%response, 1)/balance%coefficients())/steps_served
  end function flops_of_step

  !> Is a contact of this rank open all over the period, D = -K_c?
  pure logical function is_open(balance, contact)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Number of the contact
    integer, intent(in) :: contact

    is_open = allocated(balance%forces(contact)%jacobian)
    if (is_open) is_open = balance%forces(contact)%open >= 1.0_wp
  end function is_open

  !> Take the contacts that are open now.
  subroutine renew(self, balance)
    type(tangent_reference_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp), allocatable :: springs(:), together(:, :)
    integer, allocatable :: mine(:), all(:)
    integer :: i, row

    mine = [integer ::]
    springs = [real(wp) ::]
    do i = 1, size(balance%law)
      if (.not. is_open(balance, i)) cycle
      associate (law => balance%law(i))
        mine = [mine, [(balance%first_row - 1 + law%first_row + row, row=0, law%tangents)]]
        springs = [springs, springs_of(law)]
      end associate
    end do
    call balance%ranks%gather_integers(mine, all)
    allocate (together(1, size(all)))
    call balance%ranks%gather_columns_everywhere(reshape(springs, [1, size(springs)]), together)
    call self%forget()
    self%rows = real(all, wp)
    self%springs = together(1, :)
    call find_modes(self, balance)
  end subroutine renew

  !> R' of the rows at hand, if there are any; where it does not exist there is no reference.
  subroutine find_modes(self, balance)
    type(tangent_reference_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance

    if (size(self%rows) == 0) return
    call balance%receptance%without_springs(nint(self%rows), self%springs, self%receptance)
    if (.not. allocated(self%receptance)) call self%forget()
    call find_opened(self, balance)
  end subroutine find_modes

  !> D' of a contact of this rank: its rows that are not zero.
  pure function jacobian_left(self, balance, contact) result(left)
    class(tangent_reference_type), intent(in) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Number of the contact
    integer, intent(in) :: contact
    type(contact_jacobian_type) :: left
    real(wp), allocatable :: springs(:), values(:, :)
    integer :: i, k

    associate (forces => balance%forces(contact))
      if (.not. self%opened(contact)) then
        allocate (left%rows(0))
        if (allocated(forces%jacobian)) left%rows = pack([(i, i=1, size(forces%active))], forces%active)
        if (allocated(forces%jacobian)) left%values = forces%jacobian(left%rows, :)
        return
      end if
      k = balance%coefficients()
      springs = springs_of(balance%law(contact))
      allocate (values(k*size(springs), k*size(springs)), source=0.0_wp)
      if (allocated(forces%jacobian)) values = forces%jacobian
      do i = 1, size(values, 1)
        values(i, i) = values(i, i) + springs((i - 1)/k + 1)
      end do
      left%rows = pack([(i, i=1, size(values, 1))], maxval(abs(values), 2) > rounding*maxval(springs))
      left%values = values(left%rows, :)
    end associate
  end function jacobian_left

  !> Springs of a contact's rows.
  pure function springs_of(law) result(springs)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    real(wp) :: springs(law%tangents + 1)

    springs(:law%tangents) = law%tangential_stiffness
    springs(law%tangents + 1) = law%normal_stiffness
  end function springs_of

  !> Have no reference; what steps then cost in excess is counted from nothing.
  subroutine forget(self)
    class(tangent_reference_type), intent(inout) :: self

    self%rows = [real(wp) ::]
    self%springs = [real(wp) ::]
    self%owed = 0.0_wp
    if (allocated(self%receptance)) deallocate (self%receptance)
  end subroutine forget

  !> Save or load what the next point depends on: modes follow from the rows.
  subroutine keep(self, store)
    class(tangent_reference_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    if (store%reading) call self%forget()
    call store%keep(self%rows)
    call store%keep(self%springs)
    call store%keep(self%owed)
  end subroutine keep
end module attrito_newton_tangent_reference
