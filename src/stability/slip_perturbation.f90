!> A small change of slip along two tangents over a segment, as a series in x, the part of the segment that has passed.
!>
!> $$ \psi = r \, \delta\phi, \qquad r \, \delta\phi' + (u' \cdot e)\, \delta\phi = \delta u' \cdot e_\perp - \delta r \, \phi',
!>    \qquad \delta T = \mu k_n \, \delta v \, e + k_t \, \psi \, e_\perp $$
!>
!> Coefficient k of psi is what follows from all before it and c_k e_perp.du_k: c = 1, and where the contact lands, r_0 = 0, the
!> equation of order k - 1 gives dphi_{k-1}, and c_k = k r_1/((k - 1) r_1 + u_0'.e_0). A slider that follows u' at once has no term
!> r dphi', and psi, next to nothing, from displacements without what high modes at rest add.
module attrito_stability_slip_perturbation
  use attrito_core_kinds, only: wp
  use attrito_integrate_recorder, only: slip_series_type
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: slip_perturbation_type, new_slip_perturbation

  type :: slip_perturbation_type
    !> Number of the contact
    integer :: contact = 0
    logical :: lands = .false., small = .false.
    !> k_t, mu k_n and dr/dv
    real(wp) :: stiffness = 0.0_wp, friction = 0.0_wp, slope = 0.0_wp
    !> Coefficients of r, e, e_perp, phi' and u'.e [0:n]
    real(wp), allocatable :: radius(:), e(:, :), across(:, :), turn(:), along(:)
    !> Those of du, dv, dphi and psi found so far [columns, 0:terms], [columns, 0:terms, 2]
    real(wp), allocatable :: du(:, :, :), dv(:, :), dphi(:, :), psi(:, :)
    !> What is known of psi_k before du_k [columns]
    real(wp), allocatable :: known(:)
  contains
    procedure :: coefficient
    procedure :: follow
    procedure :: known_force
    procedure :: add
  end type slip_perturbation_type

contains

  !> From psi at the beginning of a part of a segment.
  pure function new_slip_perturbation(law, slip, part, psi, terms) result(self)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Slip over the segment
    type(slip_series_type), intent(in) :: slip
    !> Where the series begins and ends in the segment, of 1
    real(wp), intent(in) :: part(2)
    !> Direction of slip times the radius, where the contact does not land [columns]
    real(wp), intent(in) :: psi(:)
    !> Highest order
    integer, intent(in) :: terms
    type(slip_perturbation_type) :: self
    integer :: n, a

    n = ubound(slip%radius, 1)
    self%contact = slip%contact
    self%lands = slip%lands .and. (slip%small .or. part(1) <= 0.0_wp)
    self%small = slip%small
    self%stiffness = law%tangential_stiffness
    self%friction = law%friction_coefficient*law%normal_stiffness
    self%slope = self%friction/self%stiffness
    allocate (self%radius(0:n), source=of_part(slip%radius, part))
    allocate (self%turn(0:n), source=(part(2) - part(1))*of_part(slip%turn, part))
    allocate (self%along(0:n), source=(part(2) - part(1))*of_part(slip%along, part))
    allocate (self%e(0:n, 2), self%across(0:n, 2))
    do a = 1, 2
      self%e(:, a) = of_part(slip%e(:, a), part)
    end do
    self%across(:, 1) = -self%e(:, 2)
    self%across(:, 2) = self%e(:, 1)
    allocate (self%du(size(psi), 0:terms + 1, 2), self%dv(size(psi), 0:terms), self%dphi(size(psi), 0:terms), &
              self%psi(size(psi), 0:terms), source=0.0_wp)
    self%known = psi
    if (self%lands .or. self%radius(0) <= 0.0_wp) self%known = 0.0_wp
  end function new_slip_perturbation

  !> A polynomial on a part of [0, 1], by powers of what has passed of that part.
  pure function of_part(a, part) result(b)
    !> Coefficients from degree 0; where the part begins and ends
    real(wp), intent(in) :: a(0:), part(2)
    real(wp) :: b(0:ubound(a, 1))
    integer :: k, j

    b = a
    ! Horner's rule, once for each derivative.
    if (part(1) > 0.0_wp) then
      do k = 0, ubound(a, 1) - 1
        do j = ubound(a, 1) - 1, k, -1
          b(j) = b(j) + part(1)*b(j + 1)
        end do
      end do
    end if
    do k = 1, ubound(a, 1)
      b(k) = b(k)*(part(2) - part(1))**k
    end do
  end function of_part

  !> c_k.
  pure real(wp) function coefficient(self, k)
    class(slip_perturbation_type), intent(in) :: self
    !> Order
    integer, intent(in) :: k

    coefficient = merge(1.0_wp, 0.0_wp, k > 0 .and. self%radius(0) > 0.0_wp .and. .not. self%small)
    if (k > 0 .and. self%lands .and. .not. self%small) coefficient = k*self%radius(1)/((k - 1)*self%radius(1) + self%along(0))
  end function coefficient

  !> Coefficient k of dphi and psi if the slider follows at once.
  pure subroutine follow(self, k, displacement, ahead)
    class(slip_perturbation_type), intent(inout) :: self
    !> Order
    integer, intent(in) :: k
    !> Coefficients k and k + 1 of the displacements of both tangents and the normal [3, columns]
    real(wp), intent(in) :: displacement(:, :), ahead(:, :)
    integer :: j, n

    n = ubound(self%radius, 1)
    self%du(:, k, :) = transpose(displacement(:2, :))
    self%du(:, k + 1, :) = transpose(ahead(:2, :))
    self%dv(:, k) = displacement(3, :)
    self%dphi(:, k) = 0.0_wp
    do j = max(0, k - n), k
      self%dphi(:, k) = self%dphi(:, k) - self%slope*self%turn(k - j)*self%dv(:, j) &
                        + (j + 1)*(self%across(k - j, 1)*self%du(:, j + 1, 1) + self%across(k - j, 2)*self%du(:, j + 1, 2))
      if (j < k) self%dphi(:, k) = self%dphi(:, k) - self%along(k - j)*self%dphi(:, j)
    end do
    self%dphi(:, k) = self%dphi(:, k)/self%along(0)
    self%known = 0.0_wp
    do j = max(0, k - n), k
      self%known = self%known + self%radius(k - j)*self%dphi(:, j)
    end do
  end subroutine follow

  !> Force of order k but for the parts of du_k and dv_k [columns, 2]; finds psi_k as far as it is known.
  pure subroutine known_force(self, k, force)
    class(slip_perturbation_type), intent(inout) :: self
    !> Order
    integer, intent(in) :: k
    !> dT without its present parts
    real(wp), intent(out) :: force(:, :)
    integer :: a, j

    if (k > 0 .and. .not. self%small) call find_known(self, k)
    do a = 1, 2
      force(:, a) = self%stiffness*self%across(0, a)*self%known
      do j = max(0, k - ubound(self%radius, 1)), k - 1
        force(:, a) = force(:, a) + self%friction*self%e(k - j, a)*self%dv(:, j) + self%stiffness*self%across(k - j, a)*self%psi(:, j)
      end do
    end do
  end subroutine known_force

  !> The equation of order k - 1 without du_k.
  pure subroutine find_known(self, k)
    type(slip_perturbation_type), intent(inout) :: self
    !> Order, 1 or more
    integer, intent(in) :: k
    integer :: j, l, n

    l = k - 1
    n = ubound(self%radius, 1)
    self%known = 0.0_wp
    if (self%radius(0) <= 0.0_wp .and. .not. self%lands) return
    do j = max(0, l - n), l
      self%known = self%known - self%slope*self%turn(l - j)*self%dv(:, j)
      if (j < l) self%known = self%known + (j + 1)*(self%across(l - j, 1)*self%du(:, j + 1, 1) &
                                                    + self%across(l - j, 2)*self%du(:, j + 1, 2))
      ! Of a contact that lands dphi_l is what is looked for.
      if (j < l .or. .not. self%lands) self%known = self%known - self%along(l - j)*self%dphi(:, j)
      if (j < merge(l - 1, l, self%lands)) self%known = self%known - (j + 1)*self%radius(l - j)*self%dphi(:, j + 1)
    end do
    if (self%lands) then
      self%dphi(:, l) = self%known/(l*self%radius(1) + self%along(0))
      self%known = 0.0_wp
    else
      self%dphi(:, k) = self%known/(k*self%radius(0))
      self%known = self%radius(0)*self%dphi(:, k)
    end if
    do j = max(0, k - n), l
      self%known = self%known + self%radius(k - j)*self%dphi(:, j)
    end do
  end subroutine find_known

  !> Displacements of order k, now that they are known [3, columns].
  pure subroutine add(self, k, displacement)
    class(slip_perturbation_type), intent(inout) :: self
    !> Order
    integer, intent(in) :: k
    !> Of both tangents and the normal
    real(wp), intent(in) :: displacement(:, :)
    real(wp) :: part(size(displacement, 2))

    self%du(:, k, 1) = displacement(1, :)
    self%du(:, k, 2) = displacement(2, :)
    self%dv(:, k) = displacement(3, :)
    part = self%coefficient(k)*(self%across(0, 1)*displacement(1, :) + self%across(0, 2)*displacement(2, :))
    self%psi(:, k) = self%known + part
    if (self%small) return
    if (self%lands) then
      if (k > 0) self%dphi(:, k - 1) = self%dphi(:, k - 1) + k/((k - 1)*self%radius(1) + self%along(0))* &
        (self%across(0, 1)*displacement(1, :) + self%across(0, 2)*displacement(2, :))
    else if (self%radius(0) > 0.0_wp) then
      self%dphi(:, k) = self%dphi(:, k) + part/self%radius(0)
      if (k == 0) self%dphi(:, 0) = self%known/self%radius(0)
    end if
  end subroutine add
end module attrito_stability_slip_perturbation
