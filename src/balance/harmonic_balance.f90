!> Coupled static and dynamic multi-harmonic balance, condensed onto the contacts with the stuck system as reference.
!>
!> $$ r_h(d, \omega) = d_h - B \tilde Z_h^{-1} (f_h - B^T g_h(d)) = 0, \qquad h = 0 \ldots H $$
!>
!> d = B q are the relative displacements, lambda = K_c d + g(d) the contact forces. Harmonics 0 ... H are solved together
!> (coupled), or the mean of q is frozen at the static solution (uncoupled). Each rank holds the rows of its own contacts, or, unless
!> there are many, all of them; what crosses ranks is one block of generalised forces, or the forces of contacts.
!> Source: Zucca & Firrone 2014, eqs. (9)-(10), doi:10.1016/j.jsv.2013.09.032.
module attrito_balance_harmonic_balance
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: to_complex
  use attrito_model_contacts, only: contact_type
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_state, only: state_open
  use attrito_contact_kept_forces, only: keep_forces
  use attrito_contact_straight_increment, only: evaluate_increment
  use attrito_balance_shared_evaluation, only: owners_of, exchange
  use attrito_balance_active_rows, only: active_rows_type
  use attrito_linear_rigid_body_modes, only: rigid_body_modes_type
  use attrito_linear_projected_rows, only: projected_rows_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_split_receptance, only: split_receptance_type
  use attrito_balance_work, only: contact_work, residual_work
  implicit none
  private
  public :: balance_type, stuck_mean_type

  !> Part of the forces that free motions bear which rounding of these motions and of the stuck modes leaves unbalanced: 3e-13 to
  !> 2e-11 on joints with 460 to 1600 coordinates; a body that drifts leaves the part of a force that nothing holds
  real(wp), parameter :: free_rounding = 1.0e-9_wp ! measured

  !> Mean response of the stuck system, and the sliders and static loads that it belongs to
  type :: stuck_mean_type
    real(wp), allocatable :: slider(:, :), static_factors(:)
    logical :: frozen = .false.
    complex(wp), allocatable :: response(:)
    !> Relative displacements [rows], and what they leave of friction for the harmonics of each contact's elements [elements,
    !> contacts]
    real(wp), allocatable :: motion(:), capacities(:, :)
    !> The evaluation, by its number, after which the forces of all contacts were those of sticking here
    integer :: evaluation = -1
  end type stuck_mean_type

  !> Mean deviation of the rows that are not active, and what it puts on the generalised coordinates of this rank [n]
  type :: resting_load_type
    real(wp), allocatable :: deviation(:), load(:)
  end type resting_load_type

  type :: balance_type
    !> Over which sums are made: those that hold a part of the contacts each, or this one alone, which holds all
    type(communicator_type) :: ranks
    !> All that work on this balance: if each holds all contacts they share the evaluation
    type(communicator_type) :: team
    !> How contacts are evaluated
    type(quadrature_type) :: quadrature
    class(receptance_type), allocatable :: receptance
    !> What iterative solves take in its place, and keep
    type(split_receptance_type) :: split
    !> Laws of this rank's contacts; the first of them and its first row among all
    type(contact_type), allocatable :: law(:)
    integer :: first_contact = 1, first_row = 1
    !> This rank's rows of B in generalised coordinates
    type(projected_rows_type) :: contact_rows
    !> What the structure alone does not hold
    type(rigid_body_modes_type) :: free
    !> Loads in generalised coordinates: static ones [n, loads], harmonic ones at level 1 [n, 0:H]
    real(wp), allocatable :: static_loads(:, :)
    complex(wp), allocatable :: harmonic_load(:, :)
    !> Harmonics that are loaded, ascending
    integer, allocatable :: loaded(:)
    !> Monitors in generalised coordinates
    type(projected_rows_type) :: monitors
    !> Factors on the loads
    real(wp), allocatable :: static_factors(:)
    real(wp) :: level = 1.0_wp
    !> Sliders at the start of the march, in pairs, one an element [width, contacts]; contacts with two tangents whose slider is to be
    !> where a period leaves it
    real(wp), allocatable :: slider(:, :)
    logical, allocatable :: periodic(:)
    !> Allocated: contacts with two tangents are marched a period from their sliders as these are, wherever it takes them, and from
    !> this mean of the period before [rows]
    real(wp), allocatable :: mean_before(:)
    !> Allocated: nothing moves about the mean, which goes straight from the first of these, sliders along with it; the second is
    !> where it would be if it went on as before [rows, 2]
    real(wp), allocatable :: increment(:, :)
    !> Uncoupled: mean of the generalised coordinates [n]
    complex(wp), allocatable :: frozen_mean(:)
    !> Where springs beside the structure's own, `receptance%held` of its stiffness, pull its mean to [n]
    complex(wp), allocatable :: spring_anchor(:)
    !> Of the last evaluation: contacts' forces and which of them depend on the motion, residual [2 H + 1, rows], response and its
    !> derivative by omega, forces held [n, 0:H]
    type(contact_forces_type), allocatable :: forces(:)
    type(active_rows_type) :: active
    real(wp), allocatable :: residual(:, :)
    complex(wp), allocatable :: response(:, :), response_omega(:, :)
    !> How often contacts have been shared out, or the series' length has changed
    integer :: changes = 0
    !> How often it was evaluated: what solving costs, whatever the machine
    integer :: evaluations = 0
    type(stuck_mean_type) :: kept
    !> Floating-point operations so far by the formulas of `attrito_balance_work`, this rank's share
    real(wp) :: work = 0.0_wp
    type(resting_load_type) :: resting
  contains
    procedure :: rows
    procedure :: coefficients
    procedure :: evaluate
    procedure :: evaluate_forces
    procedure :: respond_to_deviation
    procedure :: respond_to_active
    procedure :: residual_omega
    procedure :: imbalance
    procedure :: beside_slide
    procedure :: remove_drift
    procedure :: slip_radii, largest_slip_radius
    procedure :: recover
    procedure :: norm
    procedure :: linear_response
    procedure :: highest_load
    procedure :: keep
    procedure :: apply_mean_springs
    procedure :: remove_mean_springs
    procedure :: destroy
  end type balance_type

contains

  !> Rows of B on this rank.
  pure integer function rows(self)
    class(balance_type), intent(in) :: self

    rows = self%contact_rows%number()
  end function rows

  !> Coefficients a row, 2 H + 1.
  pure integer function coefficients(self)
    class(balance_type), intent(in) :: self

    coefficients = 2*self%receptance%harmonics + 1
  end function coefficients

  !> The highest harmonic that is loaded; 0: none is.
  pure integer function highest_load(self)
    class(balance_type), intent(in) :: self

    highest_load = maxval([0, self%loaded])
  end function highest_load

  !> Contact forces, their Jacobian, residual and its derivative by omega at a motion of the contacts.
  subroutine evaluate(self, motion, omega, status)
    class(balance_type), intent(inout) :: self
    !> Relative displacements [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Angular frequency
    real(wp), intent(in) :: omega
    !> 0, or not: it cannot be evaluated here
    integer, intent(out) :: status
    integer :: owner(size(self%law)), i

    self%evaluations = self%evaluations + 1
    call self%receptance%set_frequency(omega, status)
    if (status /= 0) return
    owner = -1
    if (self%ranks%ranks == 1) owner = owners_of(self%team, self%forces)
    do i = 1, size(self%law)
      if (owner(i) >= 0 .and. owner(i) /= self%team%rank) cycle
      call self%evaluate_forces(i, motion(:, self%law(i)%first_row:self%law(i)%first_row + self%law(i)%tangents))
    end do
    call exchange(self%team, owner, motion, omega, self%forces)
    do i = 1, size(self%law)
      if (allocated(self%forces(i)%jacobian)) then
        self%work = self%work + contact_work(self%law(i), self%coefficients(), .false.)
      end if
    end do
    call self%active%find(self%law, self%forces, self%contact_rows)
    call respond_to_load(self, load_of_forces(self), self%response)
    self%response = self%response + linear_response(self)
    if (allocated(self%spring_anchor)) then
      associate (held => self%receptance%held)
        self%response(:, 0) = self%response(:, 0) + held/(1.0_wp + held)*self%spring_anchor
      end associate
    end if
    if (allocated(self%frozen_mean)) self%response(:, 0) = self%frozen_mean
    call self%receptance%respond_derivative(self%response, self%response_omega)
    self%work = self%work + residual_work(self%coefficients(), self%rows(), size(self%response, 1))
    self%residual = motion - self%recover(self%response)
  end subroutine evaluate

  !> What the contacts' deviations put on the generalised coordinates, -B^T g, of this rank [2 H + 1, n]: rows that are not active
  !> have a constant one, which mostly is that of the last evaluation.
  function load_of_forces(self) result(load)
    class(balance_type), intent(inout) :: self
    real(wp), allocatable :: load(:, :)
    real(wp) :: resting(self%rows()), moving(self%coefficients(), self%active%count)
    logical :: same
    integer :: i

    do i = 1, size(self%law)
      resting(self%law(i)%first_row:self%law(i)%first_row + self%law(i)%tangents) = self%forces(i)%deviation(1, :)
    end do
    associate (active => self%active)
      do i = 1, size(active%contacts)
        moving(:, active%first(i):active%first(i) + active%rows(i) - 1) = &
          self%forces(active%contacts(i))%deviation(:size(moving, 1), :)
        resting(active%source(i):active%source(i) + active%rows(i) - 1) = 0.0_wp
      end do
      load = -active%contact_rows%load_of(moving)
    end associate
    same = allocated(self%resting%load)
    if (same) same = all(abs(self%resting%deviation - resting) <= 0.0_wp)
    if (.not. same) self%resting = resting_load_type(resting, -self%contact_rows%mean_load_of(resting))
    load(1, :) = load(1, :) + self%resting%load
  end function load_of_forces

  !> Forces and Jacobian of one contact of this rank.
  subroutine evaluate_forces(self, contact, own)
    class(balance_type), intent(inout) :: self
    !> Number of the contact
    integer, intent(in) :: contact
    !> Motion of its rows [2 H + 1, tangents + 1]
    real(wp), intent(in) :: own(:, :)

    associate (forces => self%forces(contact), law => self%law(contact))
      if (allocated(self%increment)) then
        associate (start => self%increment(law%first_row:law%first_row + law%tangents, :))
          call evaluate_increment(law, start(:, 1), start(:, 2), own, self%slider(:, contact), forces)
        end associate
        return
      end if
      if (allocated(forces%mean_before)) deallocate (forces%mean_before)
      if (allocated(self%mean_before) .and. law%tangents == 2) then
        forces%mean_before = self%mean_before(law%first_row:law%first_row + 2)
      end if
    end associate
    call evaluate_contact(self%law(contact), self%quadrature, own, self%slider(:, contact), self%periodic(contact), &
                          self%forces(contact))
  end subroutine evaluate_forces

  !> Response to the loads alone, every contact stuck at zero slider [n, 0:H].
  function linear_response(self) result(response)
    class(balance_type), intent(in) :: self
    complex(wp), allocatable :: response(:, :)
    complex(wp) :: load(size(self%harmonic_load, 1), 0:self%highest_load())

    load = self%level*self%harmonic_load(:, :ubound(load, 2))
    load(:, 0) = load(:, 0) + matmul(self%static_loads, self%static_factors)
    allocate (response, mold=self%response)
    call self%receptance%respond(load, response(:, :ubound(load, 2)))
    response(:, ubound(load, 2) + 1:) = 0.0_wp
  end function linear_response

  !> Response -Z~^-1 B^T g to a deviation on every rank [n, 0:H]; the mean does not respond where it is frozen.
  subroutine respond_to_deviation(self, deviation, response)
    class(balance_type), intent(in) :: self
    !> g of this rank's rows [2 H + 1, rows]
    real(wp), intent(in) :: deviation(:, :)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    call respond_to_load(self, -self%contact_rows%load_of(deviation), response)
  end subroutine respond_to_deviation

  !> The same to a deviation of the active rows alone.
  subroutine respond_to_active(self, deviation, response)
    class(balance_type), intent(in) :: self
    !> g of this rank's active rows [2 H + 1, active%count]
    real(wp), intent(in) :: deviation(:, :)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)

    call respond_to_load(self, -self%active%contact_rows%load_of(deviation), response)
  end subroutine respond_to_active

  !> Response to loads on the generalised coordinates, summed over ranks.
  subroutine respond_to_load(self, load, response)
    class(balance_type), intent(in) :: self
    !> Of this rank [2 H + 1, n]
    real(wp), intent(in) :: load(:, :)
    !> Coordinates of the response, by harmonic
    complex(wp), intent(out) :: response(:, 0:)
    real(wp), allocatable :: together(:, :)

    together = load
    call self%ranks%sum(together)
    call self%receptance%respond(to_complex(together), response)
    if (allocated(self%frozen_mean)) response(:, 0) = 0.0_wp
  end subroutine respond_to_load

  !> Derivative of the residual by omega [2 H + 1, rows].
  function residual_omega(self) result(derivative)
    class(balance_type), intent(in) :: self
    real(wp), allocatable :: derivative(:, :)

    derivative = -self%recover(self%response_omega)
  end function residual_omega

  !> Mean forces at the last evaluation that nothing balances along the motions that the structure leaves free, as a displacement:
  !> no more than the norm of the residual (`attrito_linear_rigid_body_modes`), but for the rounding of free motions that bear the
  !> preload's forces, which is left out.
  real(wp) function imbalance(self, mean)
    class(balance_type), intent(in) :: self
    !> Of the relative displacements of the last evaluation [rows]
    real(wp), intent(in) :: mean(:)
    real(wp) :: force(size(mean)), along(self%free%count), carried(self%free%count)
    integer :: i

    imbalance = 0.0_wp
    if (self%free%count == 0 .or. allocated(self%frozen_mean) .or. allocated(self%spring_anchor)) return
    do i = 1, size(self%law)
      associate (law => self%law(i), first => self%law(i)%first_row, last => self%law(i)%first_row + self%law(i)%tangents)
        force(first:last) = self%forces(i)%deviation(1, :)
        force(first:last - 1) = force(first:last - 1) + law%tangential_stiffness*mean(first:last - 1)
        force(last) = force(last) + law%normal_stiffness*mean(last)
      end associate
    end do
    associate (free => self%free)
      along = matmul(force, free%rows(self%first_row:self%first_row + size(mean) - 1, :))
      call self%ranks%sum(along)
      carried = matmul(abs(force), abs(free%rows(self%first_row:self%first_row + size(mean) - 1, :)))
      call self%ranks%sum(carried)
      imbalance = norm2(matmul(free%static_loads, self%static_factors) + self%level*free%mean_load - along)
      if (imbalance <= free_rounding*norm2(carried)) imbalance = 0.0_wp
    end associate
  end function imbalance

  !> Along how many slip radii, of the contact that has the largest, does a step of the mean slide bodies on all their contacts?
  !> Friction is the same at any position: where contacts hardly hold, a Newton step goes anywhere along such a motion.
  real(wp) function slip_radii(self, mean, step)
    class(balance_type), intent(in) :: self
    !> Of the relative displacements of the last evaluation [rows]
    real(wp), intent(in) :: mean(:)
    !> Change of it [rows]
    real(wp), intent(in) :: step(:)
    real(wp) :: slide(size(step)), longest
    integer :: i

    slip_radii = 0.0_wp
    if (self%free%sliding == 0 .or. allocated(self%frozen_mean) .or. allocated(self%spring_anchor)) return
    slide = slide_in(self, step)
    longest = 0.0_wp
    do i = 1, size(self%law)
      associate (law => self%law(i))
        longest = max(longest, norm2(slide(law%first_row:law%first_row + law%tangents - 1)))
      end associate
    end do
    slip_radii = self%ranks%largest(longest)/max(tiny(1.0_wp), self%largest_slip_radius(mean))
  end function slip_radii

  !> How far contacts stick under the mean normal forces, at most; 0 where all are open in the mean.
  real(wp) function largest_slip_radius(self, mean)
    class(balance_type), intent(in) :: self
    !> Of the relative displacements [rows]
    real(wp), intent(in) :: mean(:)
    real(wp) :: limit(1), slope(1)
    integer :: i

    largest_slip_radius = 0.0_wp
    do i = 1, size(self%law)
      associate (law => self%law(i))
        call law%slip_force([law%normal_force(mean(law%first_row + law%tangents))], limit, slope)
        largest_slip_radius = max(largest_slip_radius, limit(1)/law%tangential_stiffness)
      end associate
    end do
    largest_slip_radius = self%ranks%largest(largest_slip_radius)
  end function largest_slip_radius

  !> The part of a change of the mean along which bodies slide on all contacts, as relative displacements of this rank's rows.
  function slide_in(self, change) result(slide)
    class(balance_type), intent(in) :: self
    !> Of mean relative displacements [rows]
    real(wp), intent(in) :: change(:)
    real(wp) :: slide(size(change)), held(self%free%sliding)

    associate (free => self%free, first_row => self%first_row, last_row => self%first_row + size(change) - 1)
      held = matmul(change, free%held_rows(first_row:last_row, :free%sliding))
      call self%ranks%sum(held)
      slide = matmul(free%rows(first_row:last_row, :free%sliding), free%slide_of(held))
    end associate
  end function slide_in

  !> A change of the mean less what of it slides bodies along all contacts that close in the period, at the rows of these; a contact
  !> that stays open neither holds a body nor says where it is.
  function beside_slide(self, change) result(held)
    class(balance_type), intent(in) :: self
    !> Of mean relative displacements [rows]
    real(wp), intent(in) :: change(:)
    !> [rows]
    real(wp) :: held(size(change)), sums(self%free%count, self%free%count, 3), right(self%free%count)
    real(wp) :: forced(size(change), self%free%count)
    logical :: closes(size(change))
    integer :: normal(size(self%law)), i

    do i = 1, size(self%law)
      normal(i) = self%law(i)%first_row + self%law(i)%tangents
      closes(self%law(i)%first_row:normal(i)) = self%forces(i)%state /= state_open
    end do
    held = merge(change, 0.0_wp, closes)
    associate (free => self%free, first_row => self%first_row, last_row => self%first_row + size(change) - 1)
      associate (motions => free%rows(first_row:last_row, :))
        forced = spread(merge(1.0_wp, 0.0_wp, closes), 2, free%count)*free%held_rows(first_row:last_row, :)
        sums(:, :, 1) = matmul(transpose(forced(normal, :)), forced(normal, :))
        sums(:, :, 2) = matmul(transpose(forced), forced)
        sums(:, :, 3) = matmul(transpose(motions), forced)
        right = matmul(held, forced)
        do i = 1, size(sums, 3)
          call self%ranks%sum(sums(:, :, i))
        end do
        call self%ranks%sum(right)
        held = held - merge(matmul(motions, free%slide_with(sums, right)), 0.0_wp, closes)
      end associate
    end associate
  end function beside_slide

  !> Slide a body back to where it was, as far as its structure and all contacts let it: where no contact holds, nothing else changes.
  subroutine remove_drift(self, before, mean, slider)
    class(balance_type), intent(in) :: self
    !> Mean relative displacements where it was, and of a motion [rows]
    real(wp), intent(in) :: before(:)
    !> Mean over the period
    real(wp), intent(inout) :: mean(:)
    !> Sliders of this rank, which go with it [width, contacts]
    real(wp), intent(inout) :: slider(:, :)
    real(wp) :: back(size(mean))
    integer :: e, i

    if (self%free%sliding == 0 .or. allocated(self%frozen_mean)) return
    back = slide_in(self, before - mean)
    do i = 1, size(self%law)
      associate (first => self%law(i)%first_row, tangents => self%law(i)%tangents)
        mean(first:first + tangents - 1) = mean(first:first + tangents - 1) + back(first:first + tangents - 1)
        do e = 1, self%law(i)%elements()
          slider(2*e - 1:2*e - 2 + tangents, i) = slider(2*e - 1:2*e - 2 + tangents, i) + back(first:first + tangents - 1)
        end do
      end associate
    end do
  end subroutine remove_drift

  !> Relative displacements of this rank's rows [2 H + 1, rows] from a response [n, 0:H].
  pure function recover(self, response) result(motion)
    class(balance_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: motion(:, :)

    motion = self%contact_rows%motion_of(response)
  end function recover

  !> Euclidean norm over the contact rows of all ranks; without the mean where that is left out of the field.
  real(wp) function norm(self, field)
    class(balance_type), intent(in) :: self
    !> On this rank's rows [any coefficients, rows]
    real(wp), intent(in) :: field(:, :)

    norm = sum(field**2)
    call self%ranks%sum(norm)
    norm = sqrt(norm)
  end function norm

  !> What the next point starts from, the contacts being this rank's. Sums that grow with the rows that were ever active are dropped:
  !> their rounding would tell how they grew.
  subroutine keep(self, store)
    class(balance_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store
    integer :: i

    call store%keep(self%static_factors)
    call store%keep(self%level)
    call store%keep(self%work)
    call store%keep(self%slider)
    call store%keep(self%periodic)
    call store%keep(self%frozen_mean)
    call store%keep(self%response)
    do i = 1, size(self%forces)
      call keep_forces(self%law(i), self%coefficients(), self%forces(i), store)
    end do
    self%split = split_receptance_type()
  end subroutine keep

  !> Springs to where the mean of the last evaluation is: `part` of the stuck system's stiffness, at harmonic 0 alone.
  subroutine apply_mean_springs(self, part)
    class(balance_type), intent(inout) :: self
    !> Part of the stiffness that is added
    real(wp), intent(in) :: part

    self%spring_anchor = self%response(:, lbound(self%response, 2))
    call self%receptance%apply_mean_springs(part)
  end subroutine apply_mean_springs

  !> Without such springs again.
  subroutine remove_mean_springs(self)
    class(balance_type), intent(inout) :: self

    if (allocated(self%spring_anchor)) deallocate (self%spring_anchor)
    call self%receptance%apply_mean_springs(0.0_wp)
  end subroutine remove_mean_springs

  !> Give the transforms back.
  subroutine destroy(self)
    class(balance_type), intent(inout) :: self

  end subroutine destroy
end module attrito_balance_harmonic_balance
