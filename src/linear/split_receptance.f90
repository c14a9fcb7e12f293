!> Receptance between active rows with its high modes summed beforehand, for the many products of an iterative solve.
!>
!> $$ R_h \approx \sum_{r \le l} \frac{b_r b_r^T}{k_r - (h \omega)^2 m_r + i h \omega c_r} + \sum_{j = 0}^P (i h \omega)^j S_j, \qquad
!>    S_j = \sum_{r > l} b_r b_r^T t_{rj}, $$
!> $$ t_{r0} = 1/k_r, \qquad k_r t_{rj} = -c_r t_{r, j - 1} - m_r t_{r, j - 2} $$
!>
!> the power series of a mode about rest: S_0 is the static correction, S_1 that of damping (odd ones vanish without it), S_2 the
!> first dynamic correction. Put into the mode's equation it leaves out s^{P+1} k t_{P+1} - s^{P+2} m t_P of the mode, s = i h omega;
!> undamped, the fourth power of h omega over the mode's frequency for P = 2, the sixth for P = 4. That grows with h omega, so a
!> tolerance on it at the highest harmonic gives l for each P, and flops decide on P. With a = h omega c/k, b = (h omega)^2 m/k and
!> tau_j = a tau_{j-1} + b tau_{j-2} >= |s^j k t_j| a series leaves out at most
!>
!> $$ \tau_{P+1} + b \tau_P = (a + b) \tau_P + b \tau_{P-1}, $$
!>
!> less than up to P - 1 where a + b < 1, and no less than the whole mode elsewhere: l falls with P, though never below the last mode
!> with a + b >= 1. Powers are tried while their sums, with so many modes, are fewer flops than the best way so far. The sums do not
!> depend on frequency: they are kept from one linear system to the next, rows that become active are added, modes that do not meet
!> the tolerance any more taken out.
!> Source: Dickens, Nakagawa & Wittbrodt 1997 (mode acceleration).
module attrito_linear_split_receptance
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: split_receptance_type, rest_type, new_rest, flops

  !> Products that a linear system is expected to need
  integer, parameter :: expected_products = 40 ! guess

  type :: split_receptance_type
    !> Does it serve the rows that it was last prepared for? If not, the product through all modes is cheaper, or modes are coupled.
    logical :: in_use = .false.
    !> Modes that stay as they are; the highest power of the series for the others, and from one power to the next
    integer :: low = 0, power = 0, stride = 1
    !> The most that is left out of any mode, relative to it
    real(wp) :: bound = 0.0_wp
    !> Rows of B that the sums hold, of all ranks and of this one, ascending
    integer, allocatable, private :: rows(:), mine(:)
    !> S_j unit^j, j = 0 ... P, without damping every other one [rows, mine, sums]; unit: the highest h omega when they were begun,
    !> so that no power of a frequency is too large a number
    real(wp), allocatable, private :: sums(:, :, :)
    real(wp), private :: unit = 1.0_wp
    !> Low modes at this rank's rows [low, mine], and their flexibility [low, 0:H]
    real(wp), allocatable, private :: shapes(:, :)
    complex(wp), allocatable, private :: flexibility(:, :)
    !> h omega / unit of every coefficient, and 1 where the receptance answers for it [2 H + 1]
    real(wp), allocatable, private :: frequency(:), support(:)
  contains
    procedure :: prepare
    procedure :: receive
  end type split_receptance_type

  !> A way to serve some rows
  type :: plan_type
    integer :: power = 0, stride = 1, low = 0
    !> Without what is held
    logical :: afresh = .true.
    real(wp) :: bound = 0.0_wp, summing = 0.0_wp, flops = 0.0_wp
  end type plan_type

  !> What the series of modes leave out at a frequency, one power after the other
  type :: rest_type
    !> The last j for which tau_j is known; b and a of each mode
    integer, private :: power = 0
    real(wp), allocatable, private :: inertia(:), friction(:)
    !> tau_j for j = power - 1 and power
    real(wp), allocatable, private :: before(:), last(:)
  contains
    procedure :: raise_to
  end type rest_type

contains

  !> At a frequency h omega.
  pure function new_rest(stiffness, mass, damping, frequency) result(self)
    !> Stiffness, above zero, mass and damping of each mode [n]
    real(wp), intent(in) :: stiffness(:), mass(:), damping(:)
    !> h omega
    real(wp), intent(in) :: frequency
    type(rest_type) :: self

    self%inertia = frequency**2*mass/stiffness
    self%friction = frequency*damping/stiffness
    self%before = 0.0_wp*self%inertia
    self%last = self%before + 1.0_wp
  end function new_rest

  !> Bound on what the series up to a power leaves out of each mode, relative to it; sharp without damping. It grows with frequency.
  pure subroutine raise_to(self, power, left_out)
    class(rest_type), intent(inout) :: self
    !> Power of i omega h, no less than the last one asked for
    integer, intent(in) :: power
    !> Left out of each mode [n]
    real(wp), intent(out) :: left_out(:)
    real(wp) :: next(size(self%last))

    do while (self%power <= power)
      next = self%friction*self%last + self%inertia*self%before
      self%before = self%last
      self%last = next
      self%power = self%power + 1
    end do
    left_out = self%last + self%inertia*self%before
  end subroutine raise_to

  !> The last mode whose series does not converge at a frequency, a + b >= 1; 0: all do.
  pure integer function last_diverging(stiffness, mass, damping, frequency)
    !> Stiffness, mass and damping of each mode [n]
    real(wp), intent(in) :: stiffness(:), mass(:), damping(:)
    !> h omega
    real(wp), intent(in) :: frequency

    last_diverging = findloc(frequency*damping + frequency**2*mass >= stiffness, .true., dim=1, back=.true.)
  end function last_diverging

  !> Flops of the products of one linear system: some modes one by one, sums over the others, and to bring these up to date.
  pure real(wp) function flops(coefficients, rows, low, sums, summing)
    !> 2 H + 1; active rows; modes that stay; sums
    integer, intent(in) :: coefficients, rows, low, sums
    !> Flops of the sums over modes
    real(wp), intent(in) :: summing

    flops = summing + expected_products*real(coefficients, wp)*rows*(4.0_wp*low + 2.0_wp*sums*rows)
  end function flops

  !> Make ready for these rows at the receptance's frequency, if products are then cheaper. Ranks agree, since all count the same.
  subroutine prepare(self, receptance, ranks, mine, tolerance)
    class(split_receptance_type), intent(inout) :: self
    !> Receptance of the stuck system between contact rows
    class(receptance_type), intent(in) :: receptance
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> This rank's active rows of B, by their place among those of all ranks, ascending
    integer, intent(in) :: mine(:)
    !> What may be left out of a mode, relative to it
    real(wp), intent(in) :: tolerance
    real(wp), allocatable :: stiffness(:), mass(:), damping(:), weights(:, :)
    integer, allocatable :: rows(:)
    type(plan_type) :: plan
    integer :: modes

    self%in_use = .false.
    call receptance%uncoupled_modes(stiffness, mass, damping)
    modes = size(stiffness)
    if (modes == 0) return
    call ranks%gather_integers(mine, rows)
    if (.not. allocated(self%rows)) call start(self, 0, 0, 1.0_wp)
    plan = new_plan(self, receptance, rows, tolerance)
    if (plan%power == 0) return
    self%in_use = .true.
    self%bound = plan%bound
    if (plan%afresh) call start(self, plan%power, plan%stride, unit_of(receptance))
    weights = series(stiffness, mass*self%unit**2, damping*self%unit, merge(plan%low, self%low, plan%afresh), plan%power)
    if (plan%summing > 0.0_wp .or. size(rows) < size(self%rows)) then
      call sum_modes(self, receptance, weights(:, ::plan%stride), plan%low, rows, mine)
    end if
    self%low = plan%low
    self%shapes = receptance%mode_shapes(1, plan%low, mine)
    call set_frequency(self, receptance)
  end subroutine prepare

  !> The highest h omega, in units of which powers are taken: 1 at rest.
  pure real(wp) function unit_of(receptance)
    !> Receptance of the stuck system between contact rows
    class(receptance_type), intent(in) :: receptance

    unit_of = receptance%harmonics*receptance%omega
    if (unit_of <= 0.0_wp) unit_of = 1.0_wp
  end function unit_of

  !> The cheapest way to serve these rows: with what is held, afresh to any power, or, power 0, through all modes.
  function new_plan(self, receptance, rows, tolerance) result(best)
    type(split_receptance_type), intent(in) :: self
    !> Receptance of the stuck system between contact rows
    class(receptance_type), intent(in) :: receptance
    !> Numbers of contact rows
    integer, intent(in) :: rows(:)
    !> Relative tolerance
    real(wp), intent(in) :: tolerance
    type(plan_type) :: best, plan
    type(rest_type) :: rest
    real(wp), allocatable :: stiffness(:), mass(:), damping(:), missing(:)
    real(wp) :: held, frequency
    integer :: coefficients, modes, r, power, low, diverging

    call receptance%uncoupled_modes(stiffness, mass, damping)
    modes = size(stiffness)
    coefficients = 2*receptance%harmonics + 1
    best%flops = flops(coefficients, size(rows), modes, 0, 0.0_wp)
    plan%stride = merge(1, 2, any(abs(damping) > 0.0_wp))
    held = real(count(places(rows, self%rows) > 0), wp)
    frequency = receptance%harmonics*receptance%omega
    diverging = last_diverging(stiffness, mass, damping, frequency)
    rest = new_rest(stiffness(diverging + 1:), mass(diverging + 1:), damping(diverging + 1:), frequency)
    allocate (missing(diverging + 1:modes))
    power = 2
    do while (flops(coefficients, size(rows), diverging, power/plan%stride + 1, 0.0_wp) < best%flops)
      call rest%raise_to(power, missing)
      low = maxval([diverging, pack([(r, r=diverging + 1, modes)], missing > tolerance)])
      plan%power = power
      call consider(low, 0.0_wp, .true.)
      if (power == self%power) call consider(max(low, self%low), held, .false.)
      power = power + plan%stride
    end do

  contains

    !> Take it if it is cheaper.
    subroutine consider(low, held, afresh)
      !> Modes that are summed one by one
      integer, intent(in) :: low
      !> Rows whose sums are held
      real(wp), intent(in) :: held
      !> Are the sums to be made again?
      logical, intent(in) :: afresh

      plan%low = low
      plan%afresh = afresh
      plan%bound = maxval([0.0_wp, missing(low + 1:)])
      associate (sums => plan%power/plan%stride + 1)
        plan%summing = 2.0_wp*sums*((modes - low)*(real(size(rows), wp)**2 - held**2))
        if (.not. afresh) plan%summing = plan%summing + 2.0_wp*sums*(low - self%low)*held**2
        plan%flops = flops(coefficients, size(rows), low, sums, plan%summing)
      end associate
      if (plan%flops < best%flops) best = plan
    end subroutine consider
  end function new_plan

  !> Coefficients t of the modes above `low` [n, 0:power], with mass and damping in units of frequency t_j unit^j.
  pure function series(stiffness, mass, damping, low, power) result(t)
    !> Stiffness, of each mode or as a matrix; mass, of each mode or as a matrix; damping of each mode
    real(wp), intent(in) :: stiffness(:), mass(:), damping(:)
    !> Modes that are summed one by one; power of i omega h
    integer, intent(in) :: low, power
    real(wp) :: t(size(stiffness), 0:power)
    integer :: j

    t = 0.0_wp
    t(low + 1:, 0) = 1.0_wp/stiffness(low + 1:)
    do j = 1, power
      t(low + 1:, j) = -damping(low + 1:)*t(low + 1:, j - 1)/stiffness(low + 1:)
      if (j > 1) t(low + 1:, j) = t(low + 1:, j) - mass(low + 1:)*t(low + 1:, j - 2)/stiffness(low + 1:)
    end do
  end function series

  !> Hold no rows yet, of the series to a power.
  subroutine start(self, power, stride, unit)
    type(split_receptance_type), intent(inout) :: self
    !> Power of i omega h; powers from one to the next
    integer, intent(in) :: power, stride
    !> Frequency in units of which powers are taken, rad/s
    real(wp), intent(in) :: unit

    self%rows = [integer ::]
    self%mine = [integer ::]
    self%power = power
    self%stride = stride
    self%unit = unit
    self%low = 0
    if (allocated(self%sums)) deallocate (self%sums)
    allocate (self%sums(0, 0, power/max(stride, 1) + 1))
  end subroutine start

  !> Sum over the modes above `low` for these rows; what is held of them is taken over, less the modes that are no longer high.
  subroutine sum_modes(self, receptance, weights, low, rows, mine)
    type(split_receptance_type), intent(inout) :: self
    !> Receptance of the stuck system between contact rows
    class(receptance_type), intent(in) :: receptance
    !> Weights of modes in each sum [n, sums]
    real(wp), intent(in) :: weights(:, :)
    !> Modes that are summed one by one; numbers of contact rows; places of this rank's rows
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
      !> Places of contact rows; first of the modes; last of the modes
      integer, intent(in) :: a(:), b(:), first, last
      real(wp) :: block(size(a), size(b))

      block = 0.0_wp
      if (first > last .or. size(block) == 0) return
      block = matmul(transpose(receptance%mode_shapes(first, last, a)), &
                     spread(weights(first:last, term), 2, size(b))*receptance%mode_shapes(first, last, b))
    end function between
  end subroutine sum_modes

  !> Places in one ascending list of the members of another, 0 where it is not there.
  pure function places(members, list)
    !> Numbers to look for; ascending list of numbers
    integer, intent(in) :: members(:), list(:)
    integer :: places(size(members))
    integer :: i, position

    places = 0
    position = 1
    do i = 1, size(members)
      do while (position < size(list))
        if (list(position) >= members(i)) exit
        position = position + 1
      end do
      if (position > size(list)) exit
      if (list(position) == members(i)) places(i) = position
    end do
  end function places

  !> Flexibility of the low modes, and factors of the sums.
  subroutine set_frequency(self, receptance)
    type(split_receptance_type), intent(inout) :: self
    !> Receptance of the stuck system between contact rows
    class(receptance_type), intent(in) :: receptance
    integer :: h, i

    self%frequency = [0.0_wp, ((h*receptance%omega/self%unit, i=1, 2), h=1, receptance%harmonics)]
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
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> [2 H + 1, mine]
    real(wp), intent(in), contiguous :: y(:, :)
    real(wp) :: motion(size(y, 1), size(y, 2))
    real(wp) :: modal(size(y, 1), self%low), forces(size(y, 1), size(self%rows))
    integer :: i, turn

    modal = matmul(y, transpose(self%shapes))
    call ranks%sum(modal)
    modal = to_real(self%flexibility*to_complex(modal))
    call ranks%gather_columns_everywhere(y, forces)
    do i = 1, size(forces, 2)
      forces(:, i) = self%support*forces(:, i)
    end do
    motion = matmul(modal, self%shapes) + matmul(forces, self%sums(:, :, 1))
    do i = 2, size(self%sums, 3)
      do turn = 1, self%stride
        forces = times_frequency(self%frequency, forces)
      end do
      motion = motion + matmul(forces, self%sums(:, :, i))
    end do
  end function receive

  !> i h omega (c - i s) = h omega s + i h omega c of every harmonic, h omega in units of frequency.
  pure function times_frequency(frequency, field) result(turned)
    !> Frequency of each coefficient, in the unit; vector over the rows of contacts
    real(wp), intent(in) :: frequency(:), field(:, :)
    real(wp) :: turned(size(field, 1), size(field, 2))
    integer :: i

    do i = 1, size(field, 2)
      turned(1, i) = 0.0_wp
      turned(2::2, i) = frequency(2::2)*field(3::2, i)
      turned(3::2, i) = -frequency(3::2)*field(2::2, i)
    end do
  end function times_frequency
end module attrito_linear_split_receptance
