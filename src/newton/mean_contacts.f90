!> The structure with its contacts as they are in the mean over the period:
!>
!> $$ D_0 = -\mathrm{diag}(\theta_i k_i), \qquad R' = (I + R D_0)^{-1} R $$
!>
!> D_0 is what the Jacobian of the forces has on its diagonal at the highest harmonic of the series: a contact that is open has lost
!> its springs k, one that slips for half the period half of its tangential spring. R' is the receptance of the structure without what
!> is lost, in its own modes. It answers forces at the harmonics beyond a series,
!>
!> $$ (I + R_h D_0) \, d_h = -R_h (g_h - D_0 d_h) \quad \Leftrightarrow \quad d_h = -R'_h (g_h - D_0 d_h), $$
!>
!> and preconditions Newton's steps (`preconditioner`): with R, answers hardly converge where a natural frequency of that
!> structure lies near h omega, the less the more contacts are open, and GMRES takes the more iterations.
!>
!> The modes cost as much as many steps. Until they are found no contact has lost anything; they are found, and found again, when
!> iterations of GMRES in excess have cost as much, if contacts have changed.
module attrito_newton_mean_contacts
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_newton_kept_factors, only: flops_of_iteration, kept_factors_type
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_opened_modes, only: flops_of_modes
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: mean_contacts_type

  !> Part of its spring that a row keeps at least, which holds bodies that are free without
  real(wp), parameter :: least_kept = 1.0e-8_wp ! guess
  !> Iterations of GMRES that steps are expected to take with all contacts stuck: more of them are held against what modes cost
  integer, parameter :: expected = 15 ! guess
  !> Parts of springs lost that count as none, and by which they change until modes are found again, relative to what is lost
  real(wp), parameter :: negligible = 0.01_wp, changed = 0.1_wp ! guess

  type, extends(kept_factors_type) :: mean_contacts_type
    !> R'; not allocated where nothing is known to be lost, or damping couples the modes
    class(receptance_type), allocatable :: receptance
    !> How many have been made
    integer :: made = 0
    !> Numbers of the rows of B, of all ranks, that have lost something of their springs, ascending, and theta k
    real(wp), allocatable, private :: rows(:), lost(:)
    !> Of the modes last found
    real(wp) :: flops = 0.0_wp
    !> Has what is lost been loaded, and R' yet to be found?
    logical, private :: is_loaded = .false.
  contains
    procedure :: prepare
    procedure :: take
    procedure :: serve
    procedure :: lost_of
    procedure :: release
    procedure :: keep
  end type mean_contacts_type

contains

  !> Find the modes of what was loaded.
  subroutine prepare(self, balance)
    class(mean_contacts_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance

    if (.not. self%is_loaded) return
    self%is_loaded = .false.
    self%made = self%made + 1
    if (size(self%rows) > 0) call balance%receptance%without_springs(nint(self%rows), self%lost, self%receptance)
  end subroutine prepare

  !> Take the contacts as they are at the balance's last evaluation, unless they hardly differ from those at hand.
  subroutine take(self, balance, stiffening, is_new)
    class(mean_contacts_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Is there another R'?
    logical, intent(out) :: is_new
    real(wp) :: springs(balance%rows()), lost(balance%rows()), sums(2)
    real(wp), allocatable :: together(:, :)
    integer, allocatable :: mine(:), all(:)
    integer :: i

    call find_lost(balance, springs, lost)
    lost = (1.0_wp - stiffening)*lost
    sums = [sum(((lost - self%lost_of(balance))/springs)**2), sum((lost/springs)**2)]
    call balance%ranks%sum(sums)
    is_new = sums(1) > changed**2*sums(2)
    self%flops = 0.0_wp
    if (.not. is_new) return
    mine = pack([(i, i=1, size(lost))], lost > 0.0_wp)
    call balance%ranks%gather_integers(balance%first_row - 1 + mine, all)
    allocate (together(1, size(all)))
    call balance%ranks%gather_columns_everywhere(reshape(lost(mine), [1, size(mine)]), together)
    self%rows = real(all, wp)
    self%lost = together(1, :)
    if (allocated(self%receptance)) deallocate (self%receptance)
    self%made = self%made + 1
    if (size(all) > 0) call balance%receptance%without_springs(all, self%lost, self%receptance)
    is_new = allocated(self%receptance)
    if (is_new) self%flops = flops_of_modes*real(size(balance%response, 1), wp)**3
    call self%begin(0, worth_of_modes(balance))
  end subroutine take

  !> Make ready for a step at the balance's last evaluation: with other modes if iterations in excess have cost as much as these, and
  !> if contacts differ from those at hand.
  subroutine serve(self, balance, stiffening, is_new, is_latest)
    class(mean_contacts_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Part of their springs that contacts keep
    real(wp), intent(in) :: stiffening
    !> Is there another R'?
    logical, intent(out) :: is_new
    !> Is it of this evaluation, or nearly so?
    logical, intent(out) :: is_latest
    integer :: status

    is_new = .false.
    call self%prepare(balance)
    call self%set_worth(worth_of_modes(balance))
    if (.not. allocated(self%receptance)) call self%expect(expected)
    is_latest = .not. self%pays(0)
    self%flops = 0.0_wp
    if (is_latest) then
      call self%take(balance, stiffening, is_new)
      if (.not. is_new) call self%begin(0, worth_of_modes(balance))
    end if
    if (.not. allocated(self%receptance)) return
    call self%receptance%set_like(balance%receptance, status)
    if (status /= 0) deallocate (self%receptance)
  end subroutine serve

  !> Iterations of GMRES that cost as much as modes, at least one.
  integer function worth_of_modes(balance) result(worth)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    real(wp) :: rows

    rows = balance%active%count
    call balance%ranks%sum(rows)
    worth = max(1, nint(flops_of_modes*real(size(balance%response, 1), wp)**2 &
                        /(flops_of_iteration*max(rows, 1.0_wp)*balance%coefficients())))
  end function worth_of_modes

  !> Springs of this rank's rows, and what they lose in the mean.
  pure subroutine find_lost(balance, springs, lost)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Above zero; theta k [rows]
    real(wp), intent(out) :: springs(:), lost(:)
    real(wp) :: part
    integer :: i, j, k, last

    k = balance%coefficients()
    lost = 0.0_wp
    do i = 1, size(balance%law)
      associate (law => balance%law(i), forces => balance%forces(i), first => balance%law(i)%first_row - 1)
        springs(first + 1:first + law%tangents) = max(law%tangential_stiffness, tiny(1.0_wp))
        springs(first + law%tangents + 1) = max(law%normal_stiffness, tiny(1.0_wp))
        if (.not. allocated(forces%jacobian) .or. k == 1) cycle
        do j = 1, law%tangents + 1
          last = j*k
          part = -0.5_wp*(forces%jacobian(last - 1, last - 1) + forces%jacobian(last, last))/springs(first + j)
          if (part > negligible) lost(first + j) = min(part, 1.0_wp - least_kept)*springs(first + j)
        end do
      end associate
    end do
  end subroutine find_lost

  !> What is known to be lost of this rank's rows [rows].
  pure function lost_of(self, balance) result(lost)
    class(mean_contacts_type), intent(in) :: self
    !> Harmonic balance: the first of this rank's rows
    type(balance_type), intent(in) :: balance
    real(wp) :: lost(balance%rows())
    integer :: i

    lost = 0.0_wp
    if (.not. allocated(self%receptance)) return
    do i = 1, size(self%rows)
      associate (own => nint(self%rows(i)) - balance%first_row + 1)
        if (own >= 1 .and. own <= size(lost)) lost(own) = self%lost(i)
      end associate
    end do
  end function lost_of

  !> Leave D_0 d out of a deviation: g - D_0 d.
  pure subroutine release(self, balance, motion, deviation)
    class(mean_contacts_type), intent(in) :: self
    !> Harmonic balance: the first of this rank's rows
    type(balance_type), intent(in) :: balance
    !> Of this rank's rows [coefficients, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp), intent(inout) :: deviation(:, :)

    deviation = deviation + spread(self%lost_of(balance), 1, size(motion, 1))*motion
  end subroutine release

  !> Save or load what the next point depends on: modes follow from what is lost.
  subroutine keep(self, store)
    class(mean_contacts_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store

    if (store%reading .and. allocated(self%receptance)) deallocate (self%receptance)
    self%is_loaded = self%is_loaded .or. store%reading
    call self%keep_counts(store)
    if (.not. allocated(self%rows)) self%rows = [real(wp) ::]
    if (.not. allocated(self%lost)) self%lost = [real(wp) ::]
    call store%keep(self%rows)
    call store%keep(self%lost)
  end subroutine keep
end module attrito_newton_mean_contacts
