!> Response of contact rows to forces on them, contacts being as they are in the mean, in single precision: what preconditioners are
!> made with. Modes far above the harmonics respond as if at rest, all together,
!>
!> $$ R'_h \approx \sum_{r \le l} \frac{b_r b_r^T}{k_r - (h \omega)^2 m_r + i h \omega c_r} + S, \qquad
!>    S = \sum_{r > l} \frac{b_r b_r^T}{k_r}, $$
!>
!> if the product with S is cheaper than that through its modes.
module attrito_newton_modal_response
  use attrito_core_kinds, only: sp, wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: rest_type, modal_response_type, new_modal_response

  !> Parts of its stiffness that inertia and damping may have of a mode which counts as at rest: what is left out only preconditions
  real(wp), parameter :: negligible = 0.01_wp ! guess

  !> S between the rows of B of all ranks and those of this one [all, mine], if it is used, and the modes below, l
  type :: rest_type
    integer :: low = 0
    real(sp), allocatable :: flexibility(:, :)
    !> The receptance, and the balance's count of changes, that it was made for
    integer, private :: made_for(2) = -1
    !> Operations of the sums last asked for, of this rank
    real(wp) :: flops = 0.0_wp
  contains
    procedure :: prepare
  end type rest_type

  type :: modal_response_type
    !> Flexibility of the low modes [l, 0:H]
    real(sp), allocatable, private :: real_part(:, :), imaginary_part(:, :)
  contains
    procedure :: to_forces
  end type modal_response_type

contains

  !> Sum up the modes that are at rest at a receptance's frequency, unless that has been done.
  subroutine prepare(self, receptance, number, balance)
    class(rest_type), intent(inout) :: self
    !> R', set to a frequency
    class(receptance_type), intent(in) :: receptance
    !> Which one it is
    integer, intent(in) :: number
    !> Harmonic balance: rows of this rank, and of all
    type(balance_type), intent(in) :: balance
    real(wp), allocatable :: stiffness(:), mass(:), damping(:), shapes(:, :), mine(:, :)
    real(wp) :: rows
    integer :: low, modes, row

    self%flops = 0.0_wp
    modes = receptance%common_modes()
    call receptance%uncoupled_modes(stiffness, mass, damping)
    rows = real(balance%rows(), wp)
    call balance%ranks%sum(rows)
    ! At the next power of two, so that sums serve the points that follow, and are what they are alone.
    low = moving(stiffness, mass, damping, scale(1.0_wp, exponent(receptance%harmonics*receptance%omega)))
    if (size(stiffness) < modes .or. 2*low + rows >= 2*modes) then
      self%low = modes
      if (allocated(self%flexibility)) deallocate (self%flexibility)
      return
    end if
    if (allocated(self%flexibility) .and. low == self%low .and. all(self%made_for == [number, balance%changes])) return
    self%made_for = [number, balance%changes]
    self%low = low
    shapes = receptance%mode_shapes(low + 1, modes, [(row, row=1, nint(rows))])
    mine = shapes(:, balance%first_row:balance%first_row + balance%rows() - 1)/spread(stiffness(low + 1:), 2, balance%rows())
    self%flexibility = real(matmul(transpose(shapes), mine), sp)
    self%flops = 2.0_wp*size(shapes)*size(mine, 2)
  end subroutine prepare

  !> The last mode that is not at rest at a frequency.
  pure integer function moving(stiffness, mass, damping, frequency)
    !> Of each mode [n]
    real(wp), intent(in) :: stiffness(:), mass(:), damping(:)
    !> h omega
    real(wp), intent(in) :: frequency

    moving = findloc(frequency*max(frequency*mass, abs(damping)) > negligible*stiffness, .true., dim=1, back=.true.)
  end function moving

  !> Of the low modes of a receptance that is set to a frequency.
  function new_modal_response(receptance, low, balance) result(self)
    !> Diagonal in its modes
    class(receptance_type), intent(in) :: receptance
    !> Low modes
    integer, intent(in) :: low
    !> Harmonic balance: is its mean frozen?
    type(balance_type), intent(in) :: balance
    type(modal_response_type) :: self
    complex(wp), allocatable :: flexibility(:)
    integer :: h

    allocate (self%real_part(low, 0:receptance%harmonics), source=0.0_sp)
    self%imaginary_part = self%real_part
    ! A frozen mean does not respond.
    do h = merge(1, receptance%lowest, allocated(balance%frozen_mean)), receptance%harmonics
      flexibility = 1.0_wp/receptance%low_stiffness(h, low)
      self%real_part(:, h) = real(flexibility, sp)
      self%imaginary_part(:, h) = real(aimag(flexibility), sp)
    end do
  end function new_modal_response

  !> Of the low modes to forces on rows of all ranks [l, k].
  function to_forces(self, balance, shapes, forces) result(modal)
    class(modal_response_type), intent(in) :: self
    !> Harmonic balance: its ranks
    type(balance_type), intent(in) :: balance
    !> Modes at this rank's rows [l, rows]; forces on these [k, rows]
    real(sp), intent(in) :: shapes(:, :), forces(:, :)
    real(sp), allocatable :: modal(:, :)
    real(wp), allocatable :: together(:, :)
    real(sp) :: cosine(size(shapes, 1))
    integer :: h

    modal = matmul(shapes, transpose(forces))
    if (balance%ranks%ranks > 1) then
      together = real(modal, wp)
      call balance%ranks%sum(together)
      modal = real(together, sp)
    end if
    modal(:, 1) = self%real_part(:, 0)*modal(:, 1)
    do h = 1, ubound(self%real_part, 2)
      associate (c => modal(:, 2*h), s => modal(:, 2*h + 1), re => self%real_part(:, h), im => self%imaginary_part(:, h))
        ! (c - i s)(re + i im)
        cosine = re*c + im*s
        s = re*s - im*c
        c = cosine
      end associate
    end do
  end function to_forces
end module attrito_newton_modal_response
