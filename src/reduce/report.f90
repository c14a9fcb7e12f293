!> What a reduction was asked for, and what it has to tell.
module attrito_reduce_report
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: reduction_options_type, reduction_report_type

  type :: reduction_options_type
    !> Number of fixed-interface modes; negative: all up to `max_frequency_hz`
    integer :: modes = 20
    !> Frequency up to which modes are kept
    real(wp) :: max_frequency_hz = 0.0_wp
    !> Columns treated at a time, which bounds the memory beside the basis
    integer :: block_size = 256
    !> Relative residual of the modes
    real(wp) :: tolerance = 1.0e-12_wp
    !> Prove by a second factorisation that no mode was missed
    logical :: check_inertia = .true.
  end type reduction_options_type

  type :: reduction_report_type
    !> Dofs of the full model; coordinates of the reduced one, and of which kind
    integer :: dofs = 0, coordinates = 0, boundary = 0, modes = 0, corrections = 0
    !> Negative pivots of K_ii, none in a sound model
    integer :: negative_pivots = 0
    !> Modes below the shift as counted by inertia; -1: not counted
    integer :: modes_below_shift = -1
    !> Frequency of that shift
    real(wp) :: shift_hz = 0.0_wp
    !> Largest relative residual of the modes, and of the constraint modes as solved
    real(wp) :: mode_residual = 0.0_wp, constraint_residual = 0.0_wp
    !> Memory of the factors of all ranks in megabytes
    integer :: factor_megabytes = 0
    !> Who ordered the rows for the factorisation
    character(8) :: ordering = ''
    !> Wall time of each step
    real(wp) :: read_seconds = 0.0_wp, factor_seconds = 0.0_wp, constraint_seconds = 0.0_wp, modes_seconds = 0.0_wp, &
                inertia_seconds = 0.0_wp, correction_seconds = 0.0_wp, project_seconds = 0.0_wp, write_seconds = 0.0_wp
  end type reduction_report_type
end module attrito_reduce_report
