!> The linear structure: what its matrices, loads and monitors are.
!>
!> $$ M \ddot q + (C + G) \dot q + K q = f_0 + \mathrm{Re} \sum_h f_h e^{i h \omega t} - B^T \lambda $$
!>
!> G, skew, is of the Coriolis forces in axes that turn: they do no work, and are no damping.
!>
!> A real Fourier series a_0 + sum (a_c cos + a_s sin) is stored as its coefficients [mean, cos 1, sin 1, cos 2, sin 2, ...].
module attrito_model_structure
  use attrito_core_kinds, only: wp
  use attrito_model_sector, only: sector_type
  implicit none
  private
  public :: structure_type, damping_none, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  public :: ratios_of_modes, coefficient_count, cosine_of, sine_of

  !> No damping
  integer, parameter :: damping_none = 0
  !> A viscous damping matrix (the model's own, or Rayleigh's alpha M + beta K)
  integer, parameter :: damping_viscous = 1
  !> Damping ratios of the modes of the stuck system
  integer, parameter :: damping_ratio = 2
  !> Mass-proportional: C = alpha M
  integer, parameter :: damping_mass = 3
  !> Structural: K (1 + i eta) for harmonics above 0; contact springs do not damp
  integer, parameter :: damping_loss_factor = 4

  type :: structure_type
    !> Mass and stiffness [m, m]
    real(wp), allocatable :: mass(:, :), stiffness(:, :)
    !> One of `damping_...`
    integer :: damping_kind = damping_none
    !> Ratio, alpha or loss factor
    real(wp) :: damping_value = 0.0_wp
    !> Ratio of each mode of the stuck system, ascending in frequency [m]; not allocated: that of all is `damping_value`
    real(wp), allocatable :: damping_ratios(:)
    !> Viscous damping [m, m], if of that kind
    real(wp), allocatable :: damping(:, :)
    !> Coriolis forces at the speed of rotation, -G^T = G [m, m]; not allocated: there are none
    real(wp), allocatable :: gyroscopic(:, :)
    !> Static loads in columns [m, loads]
    real(wp), allocatable :: static_loads(:, :)
    !> Harmonic load at level 1 [m, coefficients up to the highest loaded harmonic]; the mean is 0
    real(wp), allocatable :: harmonic_load(:, :)
    !> Monitors in columns [m, monitors]: monitor = column . q
    real(wp), allocatable :: monitors(:, :)
    !> Not allocated: a structure by itself. Else all of the above is that of one sector, with both of its boundaries
    type(sector_type), allocatable :: sector
  end type structure_type

contains

  !> Damping ratios of the first modes of the stuck system, or of one nodal diameter of it.
  pure function ratios_of_modes(structure, count) result(ratios)
    !> Mass, stiffness, damping, loads and monitors
    type(structure_type), intent(in) :: structure
    !> How many modes, at most m
    integer, intent(in) :: count
    real(wp) :: ratios(count)

    if (allocated(structure%damping_ratios)) then
      ratios = structure%damping_ratios(:count)
    else
      ratios = structure%damping_value
    end if
  end function ratios_of_modes

  !> Number of real coefficients of a series with `harmonics` harmonics.
  pure integer function coefficient_count(harmonics)
    !> Highest harmonic
    integer, intent(in) :: harmonics

    coefficient_count = 2*harmonics + 1
  end function coefficient_count

  !> Place of the cosine of harmonic h >= 1.
  pure integer function cosine_of(h)
    !> Harmonic
    integer, intent(in) :: h

    cosine_of = 2*h
  end function cosine_of

  !> Place of the sine of harmonic h >= 1.
  pure integer function sine_of(h)
    !> Harmonic
    integer, intent(in) :: h

    sine_of = 2*h + 1
  end function sine_of
end module attrito_model_structure
