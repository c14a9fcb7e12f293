!> What a reduction was asked for, and what it reports.
module attrito_reduce_report
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: reduction_options_type, reduction_report_type, step_names
  public :: step_read, step_count, step_factor, step_constraint, step_modes, step_correction, step_indicator, step_inertia, &
            step_project, step_write

  !> Steps, in the order in which they are taken
  integer, parameter :: step_read = 1, step_count = 2, step_factor = 3, step_constraint = 4, step_modes = 5, &
                        step_correction = 6, step_indicator = 7, step_inertia = 8, step_project = 9, step_write = 10
  character(10), parameter :: step_names(10) = [character(10) :: 'read', 'count', 'factor', 'constraint', 'modes', 'correction', &
                                                'indicator', 'inertia', 'project', 'write']

  type :: reduction_options_type
    !> Number of fixed-interface modes; negative: all up to `max_frequency_hz`
    integer :: modes = 20
    !> Frequency up to which modes are kept
    real(wp) :: max_frequency_hz = 0.0_wp
    !> Instead of either, the relative error that natural frequencies and responses of the reduced model may have; 0: none
    real(wp) :: error_target = 0.0_wp
    !> Frequency up to which the error is looked at; 0: two thirds of the highest mode's
    real(wp) :: top_frequency_hz = 0.0_wp
    !> Columns treated at a time, which bounds the memory beside the factors; 0: by the size of the model
    integer :: block_size = 0
    !> Who finds the modes: `slepc` or `block_lanczos`
    character(16) :: eigensolver = 'slepc'
    !> Vectors solved for at once, where the eigensolver has blocks
    integer :: block_vectors = 16
    !> Relative residual of the modes
    real(wp) :: tolerance = 1.0e-12_wp
    !> Prove by a second factorisation that no mode was missed
    logical :: check_inertia = .true.
    !> Who orders the rows for the factorisation, and whether the factors go to disk (`attrito_reduce_interior_factor`)
    character(8) :: ordering = 'scotch'
    character(4) :: out_of_core = 'auto'
    !> Memory that the ranks of a machine may take together in megabytes; 0: what is free
    real(wp) :: memory_megabytes = 0.0_wp
    !> The boundary condensed, without constraint modes: `yes` or `no`, or `auto` where that takes fewer operations; only where
    !> the motion of some dofs is to be given back and there are neither damping nor Coriolis forces
    character(4) :: condense = 'auto'
    !> Dofs, from 0, ascending, whose motion the reduced model is to give back; not allocated: all
    integer, allocatable :: recovered(:)
  end type reduction_options_type

  type :: reduction_report_type
    !> Dofs of the full model; coordinates of the reduced one, and of which kind
    integer :: dofs = 0, coordinates = 0, boundary = 0, modes = 0, corrections = 0
    !> 1: the boundary was condensed, no constraint modes were computed
    integer :: condensed = 0
    !> Negative pivots of K_ii, none in a sound model
    integer :: negative_pivots = 0
    !> Modes below the shift as counted by inertia; -1: not counted
    integer :: modes_below_shift = -1
    !> Who found the modes, and the vectors it has solved for
    character(16) :: eigensolver = ''
    integer :: mode_solves = 0
    !> Memory of all ranks while factoring in megabytes, as foreseen: with the factors in core, and on disk
    integer :: factor_megabytes = 0, factor_megabytes_out_of_core = 0
    !> 1: the factors went to disk
    integer :: out_of_core = 0
    !> Who ordered the rows for the factorisation
    character(8) :: ordering = ''
    !> Operations of a factorisation, as foreseen; wall time of its analysis
    real(wp) :: factor_flops = 0.0_wp, analysis_seconds = 0.0_wp
    !> Frequency of that shift
    real(wp) :: shift_hz = 0.0_wp
    !> Largest relative residual of the modes, and of the constraint modes as solved
    real(wp) :: mode_residual = 0.0_wp, constraint_residual = 0.0_wp
    !> Largest estimated relative error of a frequency or a point receptance of the reduced model; -1: not examined
    real(wp) :: worst_error = -1.0_wp
    !> Wall time of each step, and the most memory that all ranks held during it, in megabytes
    real(wp) :: seconds(size(step_names)) = 0.0_wp, megabytes(size(step_names)) = 0.0_wp
  end type reduction_report_type
end module attrito_reduce_report
