!> A balance made ready to be evaluated: loads and monitors in generalised coordinates, what belongs to a length of the series, and
!> the contacts of this rank,
!>
!> $$ f_h = \Phi^T F_h, \quad h = 0 \ldots H, \qquad B_{own} \Phi. $$
!>
!> Length and contacts may change later: with another length sliders stay, with other contacts they begin at zero.
module attrito_balance_set_up
  use attrito_core_communicator, only: communicator_type, own_communicator
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: resized
  use attrito_model_contacts, only: contacts_type, slider_width
  use attrito_model_structure, only: structure_type
  use attrito_contact_disc_rules, only: new_disc_rules
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_balance_active_rows, only: active_rows_type
  use attrito_linear_rigid_body_modes, only: new_rigid_body_modes
  use attrito_balance_harmonic_balance, only: balance_type, stuck_mean_type
  use attrito_linear_receptance, only: receptance_type
  use attrito_linear_split_receptance, only: split_receptance_type
  implicit none
  private
  public :: new_balance, set_harmonics_of_balance, take_contacts

contains

  !> Take contacts and make room. Of a joint of usual size each rank takes all: it does the linear algebra itself, so that sums are
  !> made in one order and results are the same bits on any number of ranks. Of a large one each takes a part.
  subroutine new_balance(structure, contacts, receptance, ranks, self, most_whole)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts
    !> Moved into the balance
    class(receptance_type), allocatable, intent(inout) :: receptance
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    type(balance_type), intent(out) :: self
    !> Contacts up to which each rank takes all; if not given, it takes all
    integer, intent(in), optional :: most_whole
    integer :: first, last

    call move_alloc(receptance, self%receptance)
    self%team = ranks
    self%ranks = own_communicator()
    if (present(most_whole)) then
      if (size(contacts%law) > most_whole) self%ranks = ranks
    end if
    call self%ranks%share(size(contacts%law), first, last)
    self%static_loads = self%receptance%project_mean_loads(structure%static_loads)
    self%monitors = self%receptance%project_rows(structure%monitors)
    self%free = new_rigid_body_modes(structure, contacts)
    allocate (self%static_factors(size(structure%static_loads, 2)), source=1.0_wp)
    self%quadrature%order = order_of(contacts)
    call set_series(self, structure, self%receptance%harmonics)
    if (any(contacts%law%tangents == 2)) self%quadrature%discs = new_disc_rules(self%receptance%harmonics)
    allocate (self%response(size(self%static_loads, 1), 0:self%receptance%harmonics))
    allocate (self%response_omega, mold=self%response)
    call take_contacts(self, contacts, first, last)
  end subroutine new_balance

  !> What belongs to a length of the series: the grid of roots, harmonics of the load.
  subroutine set_series(self, structure, harmonics)
    type(balance_type), intent(inout) :: self
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    integer :: given, h

    self%quadrature%grid = new_grid(self%quadrature%order*harmonics)
    if (allocated(self%quadrature%discs%grids)) self%quadrature%discs = new_disc_rules(harmonics)
    if (allocated(self%harmonic_load)) deallocate (self%harmonic_load)
    allocate (self%harmonic_load(size(self%static_loads, 1), 0:harmonics), source=(0.0_wp, 0.0_wp))
    given = min(size(structure%harmonic_load, 2), 2*harmonics + 1)
    self%harmonic_load(:, 0:given/2) = self%receptance%project_loads(structure%harmonic_load(:, :given))
    self%loaded = pack([(h, h=1, harmonics)], [(any(abs(self%harmonic_load(:, h)) > 0.0_wp), h=1, harmonics)])
  end subroutine set_series

  !> Order of the contacts' radii over that of their motion.
  pure integer function order_of(contacts)
    !> All contacts: laws and directions
    type(contacts_type), intent(in) :: contacts

    order_of = merge(1, 2, all(contacts%law%is_proportional()))
  end function order_of

  !> Go on with another length of the series. Sliders stay; response and deviation keep the harmonics that both
  !> lengths have; residual and Jacobian are to be evaluated again.
  subroutine set_harmonics_of_balance(self, structure, harmonics)
    type(balance_type), intent(inout) :: self
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> Highest harmonic, H
    integer, intent(in) :: harmonics
    complex(wp), allocatable :: response(:, :)
    integer :: i, common

    call self%receptance%set_harmonics(harmonics)
    call set_series(self, structure, harmonics)
    common = min(ubound(self%response, 2), harmonics)
    allocate (response(size(self%response, 1), 0:harmonics), source=(0.0_wp, 0.0_wp))
    response(:, :common) = self%response(:, :common)
    call move_alloc(response, self%response)
    do i = 1, size(self%law)
      self%forces(i)%deviation = resized(self%forces(i)%deviation, deviation_coefficients(self))
    end do
    self%residual = resized(self%residual, self%coefficients())
    deallocate (self%response_omega)
    allocate (self%response_omega, mold=self%response)
    self%changes = self%changes + 1
    self%split = split_receptance_type()
  end subroutine set_harmonics_of_balance

  !> Coefficients of the forces that are kept: those beyond the series show what it leaves out.
  pure integer function deviation_coefficients(self)
    type(balance_type), intent(in) :: self

    deviation_coefficients = 6*self%receptance%harmonics + 1
  end function deviation_coefficients

  !> Let this rank hold these contacts, with sliders at zero.
  subroutine take_contacts(self, contacts, first, last)
    type(balance_type), intent(inout) :: self
    !> Of all ranks
    type(contacts_type), intent(in) :: contacts
    !> The first and the last of this rank, from 1
    integer, intent(in) :: first, last
    integer :: i, last_row

    if (order_of(contacts) > self%quadrature%order) then
      self%quadrature%order = order_of(contacts)
      self%quadrature%grid = new_grid(self%quadrature%order*self%receptance%harmonics)
    end if
    self%first_contact = first
    self%law = contacts%law(first:last)
    self%first_row = 1 + sum(contacts%law(:first - 1)%tangents + 1)
    last_row = self%first_row - 1 + sum(self%law%tangents + 1)
    self%law%first_row = self%law%first_row - self%first_row + 1
    self%contact_rows = self%receptance%contact_rows(self%first_row, last_row)
    self%slider = reshape([(0.0_wp, i=1, slider_width(contacts%law)*size(self%law))], [slider_width(contacts%law), size(self%law)])
    self%periodic = spread(.false., 1, size(self%law))
    self%changes = self%changes + 1
    self%active = active_rows_type()
    self%kept = stuck_mean_type()
    if (allocated(self%resting%load)) deallocate (self%resting%load)
    if (allocated(self%forces)) deallocate (self%forces)
    allocate (self%forces(size(self%law)))
    do i = 1, size(self%law)
      allocate (self%forces(i)%deviation(deviation_coefficients(self), self%law(i)%tangents + 1))
      self%forces(i)%slider = self%slider(:, i)
      self%forces(i)%moved = self%slider(:, i)
    end do
    self%residual = reshape([(0.0_wp, i=1, self%coefficients()*self%rows())], [self%coefficients(), self%rows()])
  end subroutine take_contacts
end module attrito_balance_set_up
