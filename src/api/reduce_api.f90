!> C interface of the reduction: plain arrays, a status (0 done, 1 the numerics, 2 the input, 3 a file) and a message, alike on every
!> rank.
module attrito_api_reduce
  use, intrinsic :: iso_c_binding, only: c_char, c_double, c_funptr, c_int
  use attrito_api_message, only: report_error, text_of
  use attrito_core_errors, only: error_type
  use attrito_reduce_progress, only: new_progress
  use attrito_reduce_reduction, only: reduce_model, reduction_options_type, reduction_report_type
  use attrito_reduce_report, only: step_names
  implicit none
  private
  public :: options_type, report_type

  !> See `reduction_options_type`
  type, bind(c) :: options_type
    integer(c_int) :: modes, block_size, block_vectors, check_inertia
    real(c_double) :: max_frequency_hz, error_target, top_frequency_hz, tolerance, memory_megabytes
    character(kind=c_char) :: ordering(8), out_of_core(4), eigensolver(16), condense(4)
  end type options_type

  !> See `reduction_report_type`
  type, bind(c) :: report_type
    integer(c_int) :: dofs, coordinates, boundary, modes, corrections, condensed, negative_pivots, modes_below_shift, mode_solves, &
                      factor_megabytes, factor_megabytes_out_of_core, out_of_core
    character(kind=c_char) :: ordering(8)
    real(c_double) :: factor_flops, analysis_seconds, shift_hz, mode_residual, constraint_residual, worst_error
    real(c_double) :: seconds(size(step_names)), megabytes(size(step_names))
  end type report_type

contains

  !> Reduce model.h5 to rom.h5; collective.
  integer(c_int) function attrito_reduce(comm, model_path, rom_path, folder, boundary_count, boundary, n, vector_count, vectors, &
                                         recovered_count, recovered, options, listener, report, length, message) &
    result(status) bind(c)
    !> Fortran handle of the communicator
    integer(c_int), value :: comm
    !> model.h5 and rom.h5; end with a null character
    character(kind=c_char), intent(in) :: model_path(*), rom_path(*)
    !> Folder where the steps leave what they did, of this reduction or empty; ends with a null character
    character(kind=c_char), intent(in) :: folder(*)
    !> Boundary dofs, from 0, ascending, the same on every rank
    integer(c_int), value :: boundary_count
    !> Boundary dofs, from 0
    integer(c_int), intent(in) :: boundary(boundary_count)
    !> Loads and monitors, C order [vector_count, n]; n is the number of dofs on rank 0 and may be 0 elsewhere
    integer(c_int), value :: n, vector_count
    !> Vectors to correct for, a column each
    real(c_double), intent(in) :: vectors(n, vector_count)
    !> Dofs, from 0, ascending, whose motion is to be recovered, the same on every rank; a negative count: all
    integer(c_int), value :: recovered_count
    !> Dofs to recover
    integer(c_int), intent(in) :: recovered(max(recovered_count, 0))
    !> How many modes, and how
    type(options_type), intent(in) :: options
    !> Called with progress: void f(const char *text, int done, int total), a sentence where total is 0; may be null
    type(c_funptr), value :: listener
    !> What was found
    type(report_type), intent(out) :: report
    !> Room for the message
    integer(c_int), value :: length
    !> Room for what is said
    character(kind=c_char), intent(out) :: message(length)
    type(reduction_options_type) :: how
    type(reduction_report_type) :: found
    type(error_type), allocatable :: error

    how = reduction_options_type( &
      modes=options%modes, max_frequency_hz=options%max_frequency_hz, error_target=options%error_target, &
      top_frequency_hz=options%top_frequency_hz, block_size=options%block_size, block_vectors=options%block_vectors, &
      tolerance=options%tolerance, check_inertia=options%check_inertia /= 0, ordering=joined(options%ordering), &
      out_of_core=joined(options%out_of_core), memory_megabytes=options%memory_megabytes, &
      eigensolver=joined(options%eigensolver), condense=joined(options%condense))
    if (recovered_count >= 0) how%recovered = recovered
    call reduce_model(comm, text_of(model_path), text_of(rom_path), text_of(folder), boundary, vectors, how, &
                      new_progress(listener), found, error)
    report = c_report(found)
    status = report_error(error, message)
  end function attrito_reduce

  pure function c_report(found) result(report)
    !> What the reduction found
    type(reduction_report_type), intent(in) :: found
    type(report_type) :: report
    integer :: i

    report = report_type( &
      dofs=found%dofs, coordinates=found%coordinates, boundary=found%boundary, modes=found%modes, &
      corrections=found%corrections, condensed=found%condensed, negative_pivots=found%negative_pivots, &
      modes_below_shift=found%modes_below_shift, mode_solves=found%mode_solves, factor_megabytes=found%factor_megabytes, &
      factor_megabytes_out_of_core=found%factor_megabytes_out_of_core, &
      out_of_core=found%out_of_core, ordering=[(found%ordering(i:i), i=1, 8)], factor_flops=found%factor_flops, &
      analysis_seconds=found%analysis_seconds, shift_hz=found%shift_hz, mode_residual=found%mode_residual, &
      constraint_residual=found%constraint_residual, &
      worst_error=found%worst_error, seconds=found%seconds, megabytes=found%megabytes)
  end function c_report

  !> Characters as one text; null characters end it.
  pure function joined(characters) result(text)
    !> Characters, ended by a null
    character(kind=c_char), intent(in) :: characters(:)
    character(size(characters)) :: text
    integer :: i

    text = ''
    do i = 1, size(characters)
      if (iachar(characters(i)) == 0) exit
      text(i:i) = characters(i)
    end do
  end function joined
end module attrito_api_reduce
