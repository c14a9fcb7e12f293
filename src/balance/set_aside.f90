!> The last evaluation of a balance, set aside while the balance is evaluated elsewhere.
module attrito_balance_set_aside
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_contact_forces, only: contact_forces_type
  implicit none
  private
  public :: evaluation_type, set_aside, take_up

  type :: evaluation_type
    private
    type(contact_forces_type), allocatable :: forces(:)
    real(wp), allocatable :: residual(:, :), slider(:, :)
    logical, allocatable :: periodic(:)
    complex(wp), allocatable :: response(:, :), response_omega(:, :)
    !> Angular frequency of the receptance, and the highest harmonic that it was set for
    real(wp) :: omega = 0.0_wp
    integer :: highest = 0
  end type evaluation_type

contains

  !> Keep what the last evaluation found, and the sliders.
  subroutine set_aside(balance, kept)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Its last evaluation
    type(evaluation_type), intent(out) :: kept

    kept%forces = balance%forces
    if (allocated(balance%residual)) kept%residual = balance%residual
    kept%slider = balance%slider
    kept%periodic = balance%periodic
    kept%response = balance%response
    kept%response_omega = balance%response_omega
    kept%omega = balance%receptance%omega
    kept%highest = balance%receptance%highest
  end subroutine set_aside

  !> Go back to it.
  subroutine take_up(balance, kept)
    !> Harmonic balance, whose last evaluation this changes
    type(balance_type), intent(inout) :: balance
    !> Its last evaluation, empty afterwards
    type(evaluation_type), intent(inout) :: kept
    integer :: status

    call move_alloc(kept%forces, balance%forces)
    call balance%active%find(balance%law, balance%forces, balance%contact_rows)
    if (allocated(kept%residual)) call move_alloc(kept%residual, balance%residual)
    call move_alloc(kept%slider, balance%slider)
    call move_alloc(kept%periodic, balance%periodic)
    call move_alloc(kept%response, balance%response)
    call move_alloc(kept%response_omega, balance%response_omega)
    call balance%receptance%set_frequency(kept%omega, status, kept%highest)
  end subroutine take_up
end module attrito_balance_set_aside
