!> Response of uncoupled modes to forces on contact rows, in single precision: what preconditioners are made with.
!>
!> $$ q_h = (k - (h \omega)^2 m + i h \omega c)^{-1} \Phi f_h $$
module attrito_newton_modal_response
  use attrito_core_kinds, only: sp, wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_linear_receptance, only: receptance_type
  implicit none
  private
  public :: modal_response_type, new_modal_response

  type :: modal_response_type
    !> Flexibility of the modes [n, 0:H]
    real(sp), allocatable, private :: real_part(:, :), imaginary_part(:, :)
  contains
    procedure :: to_forces
  end type modal_response_type

contains

  !> Of a receptance that is set to a frequency.
  function new_modal_response(receptance, balance) result(self)
    !> Diagonal in its modes
    class(receptance_type), intent(in) :: receptance
    !> Harmonic balance: is its mean frozen?
    type(balance_type), intent(in) :: balance
    type(modal_response_type) :: self
    complex(wp), allocatable :: flexibility(:)
    integer :: h

    associate (modes => receptance%common_modes())
      allocate (self%real_part(modes, 0:receptance%harmonics), source=0.0_sp)
      self%imaginary_part = self%real_part
      ! A frozen mean does not respond.
      do h = merge(1, receptance%lowest, allocated(balance%frozen_mean)), receptance%harmonics
        flexibility = 1.0_wp/receptance%low_stiffness(h, modes)
        self%real_part(:, h) = real(flexibility, sp)
        self%imaginary_part(:, h) = real(aimag(flexibility), sp)
      end do
    end associate
  end function new_modal_response

  !> To forces on rows of all ranks [n, k].
  function to_forces(self, balance, shapes, forces) result(modal)
    class(modal_response_type), intent(in) :: self
    !> Harmonic balance: its ranks
    type(balance_type), intent(in) :: balance
    !> Modes at this rank's rows [n, rows]; forces on these [k, rows]
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
