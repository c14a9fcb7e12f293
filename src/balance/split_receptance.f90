!> Receptance between active rows with its high modes summed beforehand, for the many products of an iterative solve.
!>
!> $$ R_h \approx \sum_{r \le l} \frac{b_r b_r^T}{k_r - (h \omega)^2 m_r + i h \omega c_r}
!>              + S_0 + (h \omega)^2 S_1 - i h \omega S_d, $$
!> $$ S_0 = \sum_{r > l} \frac{b_r b_r^T}{k_r}, \qquad S_1 = \sum_{r > l} \frac{m_r b_r b_r^T}{k_r^2}, \qquad
!>    S_d = \sum_{r > l} \frac{c_r b_r b_r^T}{k_r^2} $$
!>
!> A mode answers as 1/(1 - z) = 1 + z + z^2/(1 - z), z = ((h omega)^2 m_r - i h omega c_r)/k_r: its static and first dynamic
!> correction leave out |z|^2 of it, no more and no less. That grows with h omega, so the highest harmonic tells how many modes, l,
!> are to stay as they are. The sums do not depend on frequency: they are kept from one linear system to the next, rows that become
!> active are added, and l only grows.
!> Source: Dickens, Nakagawa & Wittbrodt 1997 (mode acceleration), doi:10.1016/S0045-7949(96)00315-X.
module attrito_balance_split_receptance
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_balance_receptance, only: receptance_type, to_complex, to_real
  implicit none
  private
  public :: split_receptance_type, left_out, is_cheaper

  !> Products that a linear system is expected to need
  integer, parameter :: expected_products = 40

  type :: split_receptance_type
    !> Does it serve the rows that it was last prepared for? If not, the product through all modes is cheaper, or modes are coupled.
    logical :: in_use = .false.
    !> Modes that stay as they are
    integer :: low = 0
    !> The most that is left out of any mode, relative to it
    real(wp) :: bound = 0.0_wp
    !> Rows of B that the sums hold, of all ranks and of this one, ascending
    integer, allocatable, private :: rows(:), mine(:)
    !> S_0, S_1 and, with damping, S_d [rows, mine, 2 or 3]
    real(wp), allocatable, private :: sums(:, :, :)
    !> Low modes at this rank's rows [low, mine], and their flexibility [low, 0:H]
    real(wp), allocatable, private :: shapes(:, :)
    complex(wp), allocatable, private :: flexibility(:, :)
    !> h omega of every coefficient, and 1 where the receptance answers for it [2 H + 1]
    real(wp), allocatable, private :: frequency(:), support(:)
  contains
    procedure :: prepare
    procedure :: receive
  end type split_receptance_type

contains

  !> What static and first dynamic correction leave out of a mode, relative to it: |z|^2.
  pure elemental real(wp) function left_out(stiffness, mass, damping, frequency)
    real(wp), intent(in) :: stiffness, mass, damping
    !> h omega
    real(wp), intent(in) :: frequency
    real(wp) :: dynamic

    dynamic = hypot(frequency**2*mass, frequency*damping)
    if (stiffness > epsilon(1.0_wp)*dynamic) then
      left_out = (dynamic/stiffness)**2
    else
      left_out = huge(1.0_wp)
    end if
  end function left_out

  !> Do the products of one linear system take fewer flops with the sums, what it takes to sum included?
  pure logical function is_cheaper(coefficients, rows, modes, low, terms, summing)
    !> 2 H + 1; active rows; all modes, and those that stay; sums (S_d is not always there)
    integer, intent(in) :: coefficients, rows, modes, low, terms
    !> Flops to bring the sums up to date
    real(wp), intent(in) :: summing
    real(wp) :: plain, split

    plain = 4.0_wp*coefficients*rows*modes
    split = 4.0_wp*coefficients*rows*low + 2.0_wp*terms*coefficients*real(rows, wp)**2
    is_cheaper = summing + expected_products*split < expected_products*plain
  end function is_cheaper

  !> Make ready for these rows at the receptance's frequency, if products are then cheaper. Ranks agree, since all count the same.
  subroutine prepare(self, receptance, ranks, mine, tolerance)
    class(split_receptance_type), intent(inout) :: self
    class(receptance_type), intent(in) :: receptance
    type(communicator_type), intent(in) :: ranks
    !> This rank's active rows of B, by their place among those of all ranks, ascending
    integer, intent(in) :: mine(:)
    !> What may be left out of a mode, relative to it
    real(wp), intent(in) :: tolerance
    real(wp), allocatable :: stiffness(:), mass(:), damping(:), missing(:), weights(:, :)
    integer, allocatable :: rows(:)
    real(wp) :: summing, held
    integer :: low, modes, r

    self%in_use = .false.
    call receptance%uncoupled_modes(stiffness, mass, damping)
    modes = size(stiffness)
    if (modes == 0) return
    if (.not. allocated(self%rows)) call start(self, any(abs(damping) > 0.0_wp))
    call ranks%gather_integers(mine, rows)
    missing = left_out(stiffness, mass, damping, receptance%harmonics*receptance%omega)
    low = max(self%low, maxval([0, pack([(r, r=1, modes)], missing > tolerance)]))
    held = real(count(places(rows, self%rows) > 0), wp)
    summing = 2.0_wp*size(self%sums, 3)*((modes - low)*(real(size(rows), wp)**2 - held**2) + (low - self%low)*held**2)
    if (.not. is_cheaper(receptance%harmonics*2 + 1, size(rows), modes, low, size(self%sums, 3), summing)) return
    self%in_use = .true.
    self%bound = maxval([0.0_wp, missing(low + 1:)])
    allocate (weights(modes, size(self%sums, 3)), source=0.0_wp)
    ! Those that are high now, and those that were when what is held was summed.
    associate (high => merge(self%low, low, size(self%rows) > 0) + 1)
      weights(high:, 1) = 1.0_wp/stiffness(high:)
      weights(high:, 2) = mass(high:)/stiffness(high:)**2
      if (size(weights, 2) > 2) weights(high:, 3) = damping(high:)/stiffness(high:)**2
    end associate
    if (summing > 0.0_wp .or. size(rows) < size(self%rows)) call sum_modes(self, receptance%directions, weights, low, rows, mine)
    self%low = low
    self%shapes = receptance%directions(:low, mine)
    call set_frequency(self, receptance)
  end subroutine prepare

  !> Hold no rows.
  subroutine start(self, damped)
    type(split_receptance_type), intent(inout) :: self
    logical, intent(in) :: damped

    allocate (self%rows(0), self%mine(0))
    allocate (self%sums(0, 0, merge(3, 2, damped)))
  end subroutine start

  !> Sum over the modes above `low` for these rows; what is held of them is taken over, less the modes that are no longer high.
  subroutine sum_modes(self, directions, weights, low, rows, mine)
    type(split_receptance_type), intent(inout) :: self
    !> Rows of B in modes, in columns [n, all rows]; weights of modes in each sum [n, 2 or 3]
    real(wp), intent(in) :: directions(:, :), weights(:, :)
    integer, intent(in) :: low, rows(:), mine(:)
    integer, allocatable :: held(:), held_mine(:), fresh(:), fresh_mine(:), from(:), from_mine(:)
    real(wp), allocatable :: sums(:, :, :)
    integer :: i, term

    from = places(rows, self%rows)
    from_mine = places(mine, self%mine)
    held = pack([(i, i=1, size(rows))], from > 0)
    held_mine = pack([(i, i=1, size(mine))], from_mine > 0)
    fresh = pack([(i, i=1, size(rows))], from == 0)
    fresh_mine = pack([(i, i=1, size(mine))], from_mine == 0)
    allocate (sums(size(rows), size(mine), size(weights, 2)))
    do term = 1, size(weights, 2)
      sums(held, held_mine, term) = self%sums(from(held), from_mine(held_mine), term) &
                                    - between(rows(held), mine(held_mine), self%low + 1, low)
      sums(fresh, held_mine, term) = between(rows(fresh), mine(held_mine), low + 1, size(weights, 1))
      sums(:, fresh_mine, term) = between(rows, mine(fresh_mine), low + 1, size(weights, 1))
    end do
    call move_alloc(sums, self%sums)
    self%rows = rows
    self%mine = mine

  contains

    !> Sum of the modes first ... last between some rows.
    function between(a, b, first, last) result(block)
      integer, intent(in) :: a(:), b(:), first, last
      real(wp) :: block(size(a), size(b))

      block = 0.0_wp
      if (first > last .or. size(block) == 0) return
      block = matmul(transpose(directions(first:last, a)), spread(weights(first:last, term), 2, size(b))*directions(first:last, b))
    end function between
  end subroutine sum_modes

  !> Places in one ascending list of the members of another, 0 where it is not there.
  pure function places(members, list)
    integer, intent(in) :: members(:), list(:)
    integer :: places(size(members))
    integer :: i, place

    places = 0
    place = 1
    do i = 1, size(members)
      do while (place < size(list))
        if (list(place) >= members(i)) exit
        place = place + 1
      end do
      if (place > size(list)) exit
      if (list(place) == members(i)) places(i) = place
    end do
  end function places

  !> Flexibility of the low modes, and factors of the sums.
  subroutine set_frequency(self, receptance)
    type(split_receptance_type), intent(inout) :: self
    class(receptance_type), intent(in) :: receptance
    integer :: h, i

    self%frequency = [0.0_wp, ((h*receptance%omega, i=1, 2), h=1, receptance%harmonics)]
    self%support = 0.0_wp*self%frequency + 1.0_wp
    if (receptance%lowest > 0) self%support(1) = 0.0_wp
    if (allocated(self%flexibility)) deallocate (self%flexibility)
    allocate (self%flexibility(self%low, 0:receptance%harmonics), source=(0.0_wp, 0.0_wp))
    do h = receptance%lowest, receptance%harmonics
      self%flexibility(:, h) = 1.0_wp/receptance%low_stiffness(h, self%low)
    end do
  end subroutine set_frequency

  !> R_AA y: what this rank's rows receive from forces y on those of all ranks.
  function receive(self, ranks, y) result(motion)
    class(split_receptance_type), intent(in) :: self
    type(communicator_type), intent(in) :: ranks
    !> [2 H + 1, mine]
    real(wp), intent(in), contiguous :: y(:, :)
    real(wp) :: motion(size(y, 1), size(y, 2))
    real(wp) :: modal(size(y, 1), self%low), forces(size(y, 1), size(self%rows)), scaled(size(y, 1), size(self%rows))
    integer :: i

    modal = matmul(y, transpose(self%shapes))
    call ranks%sum(modal)
    modal = to_real(self%flexibility*to_complex(modal))
    call ranks%gather_columns_everywhere(y, forces)
    do i = 1, size(forces, 2)
      scaled(:, i) = self%support*forces(:, i)
    end do
    motion = matmul(modal, self%shapes) + matmul(scaled, self%sums(:, :, 1))
    do i = 1, size(forces, 2)
      scaled(:, i) = self%frequency**2*forces(:, i)
    end do
    motion = motion + matmul(scaled, self%sums(:, :, 2))
    if (size(self%sums, 3) == 2) return
    ! -i h omega (c - i s) = -h omega s - i h omega c
    do i = 1, size(forces, 2)
      scaled(1, i) = 0.0_wp
      scaled(2::2, i) = -self%frequency(2::2)*forces(3::2, i)
      scaled(3::2, i) = self%frequency(3::2)*forces(2::2, i)
    end do
    motion = motion + matmul(scaled, self%sums(:, :, 3))
  end function receive
end module attrito_balance_split_receptance
