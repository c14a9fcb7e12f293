!> Coupled static and dynamic multi-harmonic balance, condensed onto the contacts with the stuck system as reference.
!>
!> $$ r_h(d, \omega) = d_h - B \tilde Z_h^{-1} (f_h - B^T g_h(d)) = 0, \qquad h = 0 \ldots H $$
!>
!> d = B q are the relative displacements, lambda = K_c d + g(d) the contact forces. Harmonics 0 ... H are solved together
!> (coupled), or the mean of q is frozen at the static solution (uncoupled). Each rank holds the rows of its own contacts; what
!> crosses ranks is one block of generalised forces.
!> Source: Zucca & Firrone 2014, eqs. (9)-(10), doi:10.1016/j.jsv.2013.09.032.
module attrito_balance_harmonic_balance
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type, contacts_type
  use attrito_model_structure, only: structure_type
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_quadrature_event, only: evaluate_contact_by_events
  use attrito_contact_quadrature_sampled, only: contact_forces_type, evaluate_contact
  use attrito_contact_state, only: state_stuck
  use attrito_contact_trigonometric_roots, only: trigonometric_grid_type, new_grid
  use attrito_balance_receptance, only: receptance_type, to_complex, to_real
  use attrito_balance_split_receptance, only: split_receptance_type
  implicit none
  private
  public :: balance_type, new_balance

  type :: balance_type
    type(communicator_type) :: ranks
    type(fourier_type) :: fourier
    !> Where roots are looked for
    type(trigonometric_grid_type) :: grid
    !> Contacts with one tangent by events, exact, rather than by samples
    logical :: by_events = .false.
    class(receptance_type), allocatable :: receptance
    !> What iterative solves take in its place, and keep
    type(split_receptance_type) :: split
    !> Laws of this rank's contacts; the first of them and its first row among all
    type(contact_type), allocatable :: law(:)
    integer :: first_contact = 1, first_row = 1
    !> This rank's rows of B in generalised coordinates, in columns [n, rows]
    real(wp), allocatable :: directions(:, :)
    !> Loads in generalised coordinates: static ones [n, loads], harmonic ones at level 1 [n, 0:H]
    real(wp), allocatable :: static_loads(:, :)
    complex(wp), allocatable :: harmonic_load(:, :)
    !> Factors on them
    real(wp), allocatable :: static_factors(:)
    real(wp) :: level = 1.0_wp
    !> Part of their springs that contacts keep in the Newton step when they slip or open: 0 is Newton's method; more holds a motion
    !> that nothing but friction holds, at the price of a linear rate
    real(wp) :: stiffening = 0.0_wp
    !> Sliders at the start of the march [2, contacts]; contacts with two tangents whose slider is to be where a period leaves it
    real(wp), allocatable :: slider(:, :)
    logical, allocatable :: periodic(:)
    !> Uncoupled: mean of the generalised coordinates [n]
    complex(wp), allocatable :: frozen_mean(:)
    !> Of the last evaluation: contacts' forces, residual and its derivative by omega [2 H + 1, rows], response [n, 0:H]
    type(contact_forces_type), allocatable :: forces(:)
    real(wp), allocatable :: residual(:, :), residual_omega(:, :)
    complex(wp), allocatable :: response(:, :)
  contains
    procedure :: rows
    procedure :: coefficients
    procedure :: evaluate
    procedure :: evaluate_stuck
    procedure :: respond_to_deviation
    procedure :: recover
    procedure :: linear_motion
    procedure :: destroy
  end type balance_type

contains

  !> Spread the contacts over ranks and make room.
  subroutine new_balance(structure, contacts, receptance, ranks, samples, self)
    type(structure_type), intent(in) :: structure
    type(contacts_type), intent(in) :: contacts
    !> Moved into the balance
    class(receptance_type), allocatable, intent(inout) :: receptance
    type(communicator_type), intent(in) :: ranks
    !> Samples a period
    integer, intent(in) :: samples
    type(balance_type), intent(out) :: self
    integer :: last, last_row, i, extended, n

    call move_alloc(receptance, self%receptance)
    self%ranks = ranks
    self%fourier = new_fourier(self%receptance%harmonics, samples)
    self%grid = new_grid(self%receptance%harmonics)
    call ranks%share(size(contacts%law), self%first_contact, last)
    self%law = contacts%law(self%first_contact:last)
    self%first_row = 1
    if (self%first_contact > 1) then
      associate (before => contacts%law(self%first_contact - 1))
        self%first_row = before%first_row + before%tangents + 1
      end associate
    end if
    last_row = self%first_row - 1 + sum([(self%law(i)%tangents + 1, i=1, size(self%law))])
    do i = 1, size(self%law)
      self%law(i)%first_row = self%law(i)%first_row - self%first_row + 1
    end do
    self%directions = self%receptance%directions(:, self%first_row:last_row)
    n = size(self%receptance%basis, 2)
    self%static_loads = matmul(transpose(self%receptance%basis), structure%static_loads)
    allocate (self%static_factors(size(structure%static_loads, 2)), source=1.0_wp)
    allocate (self%harmonic_load(n, 0:self%receptance%harmonics), source=(0.0_wp, 0.0_wp))
    i = min(size(structure%harmonic_load, 2), self%coefficients())
    self%harmonic_load(:, 0:i/2) = to_complex(matmul(transpose(structure%harmonic_load(:, :i)), self%receptance%basis))
    allocate (self%slider(2, size(self%law)), source=0.0_wp)
    allocate (self%periodic(size(self%law)), source=.false.)
    allocate (self%forces(size(self%law)))
    extended = min(3*self%receptance%harmonics, (samples - 1)/2)
    do i = 1, size(self%law)
      allocate (self%forces(i)%deviation(2*extended + 1, self%law(i)%tangents + 1))
    end do
    allocate (self%residual(self%coefficients(), self%rows()), self%residual_omega(self%coefficients(), self%rows()))
    allocate (self%response(n, 0:self%receptance%harmonics))
  end subroutine new_balance

  !> Rows of B on this rank.
  pure integer function rows(self)
    class(balance_type), intent(in) :: self

    rows = size(self%directions, 2)
  end function rows

  !> Coefficients a row, 2 H + 1.
  pure integer function coefficients(self)
    class(balance_type), intent(in) :: self

    coefficients = 2*self%receptance%harmonics + 1
  end function coefficients

  !> Contact forces, their Jacobian, residual and its derivative by omega at a motion of the contacts.
  subroutine evaluate(self, motion, omega, status)
    class(balance_type), intent(inout) :: self
    !> Relative displacements [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Angular frequency
    real(wp), intent(in) :: omega
    !> 0, or not: it cannot be evaluated here
    integer, intent(out) :: status
    complex(wp), allocatable :: derivative(:, :)
    integer :: i, k

    k = self%coefficients()
    call self%receptance%set_frequency(omega, status)
    if (status /= 0) return
    allocate (derivative, mold=self%response)
    do i = 1, size(self%law)
      call evaluate_forces(self, i, motion)
      associate (law => self%law(i))
        self%residual(:, law%first_row:law%first_row + law%tangents) = self%forces(i)%deviation(:k, :)
      end associate
    end do
    call self%respond_to_deviation(self%residual, self%response)
    self%response = self%response + linear_response(self)
    if (allocated(self%frozen_mean)) self%response(:, 0) = self%frozen_mean
    call self%receptance%respond_derivative(self%response, derivative)
    self%residual = motion - self%recover(self%response)
    self%residual_omega = -self%recover(derivative)
  end subroutine evaluate

  !> Forces and Jacobian of one contact of this rank.
  subroutine evaluate_forces(self, contact, motion)
    type(balance_type), intent(inout) :: self
    integer, intent(in) :: contact
    !> Of all rows [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)

    associate (law => self%law(contact), forces => self%forces(contact))
      associate (own => motion(:, law%first_row:law%first_row + law%tangents))
        if (self%by_events .and. law%tangents == 1) then
          call evaluate_contact_by_events(law, self%grid, own, self%slider(1, contact), forces)
        else
          call evaluate_contact(law, self%fourier, own, self%slider(:, contact), self%periodic(contact), forces)
        end if
      end associate
    end associate
  end subroutine evaluate_forces

  !> The linear response at a frequency, with sliders where they are: the solution if it leaves every contact stuck. Residual and
  !> derivative are not evaluated.
  subroutine evaluate_stuck(self, omega, motion, stuck)
    class(balance_type), intent(inout) :: self
    real(wp), intent(in) :: omega
    !> [2 H + 1, rows]
    real(wp), intent(out) :: motion(:, :)
    logical, intent(out) :: stuck
    real(wp) :: moving
    integer :: i, h, status

    stuck = .false.
    motion = 0.0_wp
    call self%receptance%set_frequency(omega, status)
    if (status /= 0) return
    self%response = linear_response(self)
    if (allocated(self%frozen_mean)) then
      self%response(:, 0) = self%frozen_mean
    else
      self%response(:, 0) = self%response(:, 0) + mean_response(self)
    end if
    motion(1, :) = matmul(real(self%response(:, 0), wp), self%directions)
    do h = 1, self%receptance%harmonics
      ! Where no load acts nothing moves.
      if (all(abs(self%harmonic_load(:, h)) <= 0.0_wp)) cycle
      motion(2*h:2*h + 1, :) = matmul(transpose(reshape([real(self%response(:, h), wp), -aimag(self%response(:, h))], &
                                                        [size(self%response, 1), 2])), self%directions)
    end do
    moving = 0.0_wp
    do i = 1, size(self%law)
      call evaluate_forces(self, i, motion)
      if (self%forces(i)%state /= state_stuck) moving = 1.0_wp
      if (moving > 0.0_wp) exit
    end do
    stuck = self%ranks%largest(moving) <= 0.0_wp
  end subroutine evaluate_stuck

  !> Mean of the response to what stuck contacts add to their springs: sliders, preloads, gaps [n].
  function mean_response(self) result(mean)
    type(balance_type), intent(in) :: self
    real(wp), allocatable :: mean(:)
    real(wp) :: deviation(1, size(self%directions, 2))
    complex(wp) :: force(size(self%directions, 1), 0:self%receptance%harmonics), response(size(force, 1), size(force, 2))
    integer :: i

    do i = 1, size(self%law)
      associate (law => self%law(i))
        deviation(1, law%first_row:law%first_row + law%tangents) = &
          [-law%tangential_stiffness*self%slider(:law%tangents, i), law%preload - law%normal_stiffness*law%gap]
      end associate
    end do
    mean = -matmul(self%directions, deviation(1, :))
    call self%ranks%sum(mean)
    force = 0.0_wp
    force(:, 0) = mean
    call self%receptance%respond(force, response)
    mean = real(response(:, 1), wp)
  end function mean_response

  !> Response to the loads alone, every contact stuck at zero slider [n, 0:H].
  function linear_response(self) result(response)
    class(balance_type), intent(in) :: self
    complex(wp), allocatable :: response(:, :)
    complex(wp), allocatable :: load(:, :)

    load = self%level*self%harmonic_load
    load(:, lbound(load, 2)) = load(:, lbound(load, 2)) + matmul(self%static_loads, self%static_factors)
    allocate (response, mold=self%response)
    call self%receptance%respond(load, response)
  end function linear_response

  !> Response -Z~^-1 B^T g to a deviation on every rank [n, 0:H]; the mean does not respond where it is frozen.
  subroutine respond_to_deviation(self, deviation, response)
    class(balance_type), intent(in) :: self
    !> g of this rank's rows [2 H + 1, rows]
    real(wp), intent(in) :: deviation(:, :)
    complex(wp), intent(out) :: response(:, 0:)
    real(wp), allocatable :: generalised(:, :)

    generalised = -matmul(deviation, transpose(self%directions))
    call self%ranks%sum(generalised)
    call self%receptance%respond(to_complex(generalised), response)
    if (allocated(self%frozen_mean)) response(:, 0) = 0.0_wp
  end subroutine respond_to_deviation

  !> Relative displacements of this rank's rows [2 H + 1, rows] from a response [n, 0:H].
  pure function recover(self, response) result(motion)
    class(balance_type), intent(in) :: self
    complex(wp), intent(in) :: response(:, 0:)
    real(wp) :: motion(2*ubound(response, 2) + 1, size(self%directions, 2))

    motion = matmul(to_real(response), self%directions)
  end function recover

  !> Relative displacements of this rank's rows with every contact stuck, at the frequency last set [2 H + 1, rows].
  function linear_motion(self) result(motion)
    class(balance_type), intent(in) :: self
    real(wp), allocatable :: motion(:, :)

    motion = self%recover(linear_response(self))
  end function linear_motion

  !> Give the transforms back.
  subroutine destroy(self)
    class(balance_type), intent(inout) :: self

    call self%fourier%destroy()
  end subroutine destroy
end module attrito_balance_harmonic_balance
