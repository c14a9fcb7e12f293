!> Coarse space of the two-level preconditioner: what forces of the contacts carry from one to another by few motions U, exactly,
!>
!> $$ R_h \approx L_h + U X_h U^T, \qquad L_h = own(R_h - U Y_h U^T), \qquad Y_h = Q^T R_h Q, \qquad X_h = Y_h - Q^T L_h Q, $$
!>
!> U the motions of `coupling_motions` on the active rows, made orthonormal by the contacts' springs, U^T K_c U = 1, Q = K_c U, and
!> own() what each contact feels of itself. Forces Q then move the coarse space as by R, whatever L has of them.
module attrito_newton_coarse_space
  use attrito_core_kinds, only: wp
  use attrito_newton_active_jacobian, only: places_of_rows
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_coupling_motions, only: orthonormal
  implicit none
  private
  public :: coarse_space_type, new_coarse_space

  type :: coarse_space_type
    !> U^T at all rows of this rank [m, rows]
    real(wp), allocatable :: shapes(:, :)
    !> Y, and, once L is known, X [m, m, 0:H]
    complex(wp), allocatable :: flexibility(:, :, :)
    !> Q^T at the active rows of this rank [m, rows]
    real(wp), allocatable, private :: forces(:, :)
  contains
    procedure :: number
    procedure :: find_local
  end type coarse_space_type

contains

  !> Of the balance's last evaluation, of so many motions at most.
  function new_coarse_space(balance, most) result(self)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(inout) :: balance
    !> Motions at most
    integer, intent(in) :: most
    type(coarse_space_type) :: self
    real(wp), allocatable :: rows(:, :), products(:, :), response(:, :), springs(:), turn(:, :), everywhere(:, :)
    complex(wp) :: flexibility(balance%receptance%common_modes())
    integer, allocatable :: active(:)
    integer :: h, i

    springs = springs_of(balance)
    call balance%coupling%prepare(balance%receptance, balance%ranks, springs)
    rows = balance%receptance%mode_shapes(1, size(flexibility), [(balance%first_row - 1 + i, i=1, size(springs))])
    associate (carriers => balance%coupling%carriers(:, :min(most, size(balance%coupling%carriers, 2))))
      self%shapes = matmul(transpose(carriers), rows)
    end associate
    active = places_of_rows(balance) - balance%first_row + 1
    self%forces = self%shapes(:, active)*spread(springs(active), 1, size(self%shapes, 1))
    products = matmul(self%forces, transpose(self%shapes(:, active)))
    call balance%ranks%sum(products)
    turn = orthonormal(products)
    self%shapes = matmul(transpose(turn), self%shapes)
    self%forces = matmul(transpose(turn), self%forces)
    allocate (everywhere(size(self%forces, 1), size(springs)), source=0.0_wp)
    everywhere(:, active) = self%forces
    response = matmul(rows, transpose(everywhere))
    call balance%ranks%sum(response)
    allocate (self%flexibility(size(self%forces, 1), size(self%forces, 1), 0:balance%receptance%harmonics), source=(0.0_wp, 0.0_wp))
    ! A mean that is frozen, or that nothing holds, does not respond.
    do h = merge(1, balance%receptance%lowest, allocated(balance%frozen_mean)), balance%receptance%harmonics
      flexibility = 1.0_wp/balance%receptance%low_stiffness(h, size(flexibility))
      self%flexibility(:, :, h) = cmplx(matmul(transpose(response), spread(real(flexibility, wp), 2, size(turn, 2))*response), &
                                        matmul(transpose(response), spread(aimag(flexibility), 2, size(turn, 2))*response), wp)
    end do
  end function new_coarse_space

  !> How many motions it has.
  pure integer function number(self)
    class(coarse_space_type), intent(in) :: self

    number = size(self%shapes, 1)
  end function number

  !> L of the active contacts of this rank [3, 3, 0:H, contacts]; the flexibility goes from Y to X.
  subroutine find_local(self, balance, local)
    class(coarse_space_type), intent(inout) :: self
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> What each contact feels of itself, beside the coarse space
    complex(wp), intent(out) :: local(:, :, 0:, :)
    real(wp) :: felt(self%number(), size(self%forces, 2), 2), correction(self%number(), self%number(), 2)
    integer :: contact, h

    local = 0.0_wp
    do contact = 1, size(balance%active%contacts)
      call find_own(contact, local(:, :, :, contact))
    end do
    do h = merge(1, balance%receptance%lowest, allocated(balance%frozen_mean)), balance%receptance%harmonics
      do contact = 1, size(balance%active%contacts)
        associate (first => balance%active%first(contact), n => balance%active%rows(contact))
          felt(:, first:first + n - 1, 1) = matmul(self%forces(:, first:first + n - 1), real(local(:n, :n, h, contact), wp))
          felt(:, first:first + n - 1, 2) = matmul(self%forces(:, first:first + n - 1), aimag(local(:n, :n, h, contact)))
        end associate
      end do
      correction(:, :, 1) = matmul(felt(:, :, 1), transpose(self%forces))
      correction(:, :, 2) = matmul(felt(:, :, 2), transpose(self%forces))
      call balance%ranks%sum(correction(:, :, 1))
      call balance%ranks%sum(correction(:, :, 2))
      self%flexibility(:, :, h) = self%flexibility(:, :, h) - cmplx(correction(:, :, 1), correction(:, :, 2), wp)
    end do

  contains

    !> Of one contact.
    subroutine find_own(contact, own)
      !> Its place among the active ones
      integer, intent(in) :: contact
      !> [3, 3, 0:H]
      complex(wp), intent(inout) :: own(:, :, 0:)
      integer :: h, row

      associate (first => balance%active%source(contact), n => balance%active%rows(contact))
        call balance%receptance%own_block([(balance%first_row - 1 + first + row, row=0, n - 1)], own(:n, :n, :))
        if (allocated(balance%frozen_mean)) own(:, :, 0) = 0.0_wp
        associate (shapes => self%shapes(:, first:first + n - 1))
          do h = 0, balance%receptance%harmonics
            own(:n, :n, h) = own(:n, :n, h) - matmul(transpose(shapes), matmul(self%flexibility(:, :, h), shapes))
          end do
        end associate
      end associate
    end subroutine find_own
  end subroutine find_local

  !> K_c of this rank's rows.
  pure function springs_of(balance) result(springs)
    !> Harmonic balance: its contacts
    type(balance_type), intent(in) :: balance
    real(wp) :: springs(balance%rows())
    integer :: i

    do i = 1, size(balance%law)
      associate (law => balance%law(i), normal => balance%law(i)%first_row + balance%law(i)%tangents)
        springs(law%first_row:normal - 1) = law%tangential_stiffness
        springs(normal) = law%normal_stiffness
      end associate
    end do
  end function springs_of
end module attrito_newton_coarse_space
