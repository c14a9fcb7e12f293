!> rom.h5, the reduced model (docs/reference/files.md).
module attrito_reduce_write_rom
  use, intrinsic :: iso_fortran_env, only: int64, int8
  use attrito_core_errors, only: error_type
  use attrito_core_hdf5_array, only: write_array, write_block
  use attrito_core_hdf5_attribute, only: write_attribute
  use attrito_core_hdf5_dataset, only: create_array
  use attrito_core_hdf5_file, only: close_file, create_file, create_group, hdf5_file_type
  use attrito_core_kinds, only: wp
  use attrito_reduce_error_indicator, only: quality_type
  use attrito_reduce_fixed_interface_modes, only: fixed_interface_modes_type
  use attrito_reduce_column_store, only: block_type, column_store_type
  use attrito_reduce_report, only: reduction_report_type, step_names
  use attrito_reduce_split, only: split_type
  implicit none
  private
  public :: reduced_model_type, write_rom

  type :: reduced_model_type
    !> Reduced matrices [m, m]; damping and that of Coriolis forces at unit speed only where the model has them
    real(wp), allocatable :: mass(:, :), stiffness(:, :), damping(:, :), gyroscopic(:, :)
    !> Loads and monitors: this rank's rows [rows, vectors], and projected [m, vectors]
    real(wp), allocatable :: vectors(:, :), reduced_vectors(:, :)
    !> Where the boundary was condensed: the boundary's columns of the basis, rows of recovered dofs, transposed [nb, recovered]
    real(wp), allocatable :: boundary_rows(:, :)
  end type reduced_model_type

  !> Longest piece of a row of the basis that is stored in one chunk
  integer, parameter :: longest_chunk = 131072 ! conventional

contains

  !> Write the whole file.
  subroutine write_rom(path, split, model, blocks, store, modes, quality, report, recovered, error)
    !> Where
    character(*), intent(in) :: path
    !> Boundary, and the ranks
    type(split_type), intent(in) :: split
    !> Matrices and vectors
    type(reduced_model_type), intent(in) :: model
    !> All columns of the basis, in order, and where they are
    type(block_type), intent(in) :: blocks(:)
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    !> Frequencies and residuals
    type(fixed_interface_modes_type), intent(in) :: modes
    !> How good the reduced model is
    type(quality_type), intent(in) :: quality
    !> Counts and times
    type(reduction_report_type), intent(in) :: report
    !> Dofs, from 0, ascending, whose rows of the basis are kept; not allocated: all
    integer, allocatable, intent(in) :: recovered(:)
    !> The disk is full, or the path cannot be written
    type(error_type), allocatable, intent(out) :: error
    type(hdf5_file_type) :: file
    integer :: kept

    kept = split%n
    if (allocated(recovered)) kept = size(recovered)
    call create_file(file, split%ranks%handle, path, error, &
                     numbers=numbers_of(split%n, kept, size(model%mass, 1), size(model%vectors, 2), size(quality%receptance)))
    if (.not. allocated(error)) call write_root(file, error)
    if (.not. allocated(error)) call write_matrices(file, model, error)
    if (.not. allocated(error)) call write_coordinates(file, split, modes, report, error)
    if (.not. allocated(error)) call write_basis(file, split, model, blocks, store, recovered, error)
    if (.not. allocated(error)) call create_spread(file, split%n, '/vectors/full', size(model%vectors, 2), &
      'loads and monitors on the full model, one a row', 'as given', error)
    if (.not. allocated(error) .and. size(model%vectors, 2) > 0) &
      call write_block(file, '/vectors/full', [0, split%first - 1], model%vectors, error)
    if (.not. allocated(error)) call write_array(file, '/vectors/reduced', model%reduced_vectors, &
      'loads and monitors on the reduced model: basis f', 'as given', error)
    if (.not. allocated(error)) call write_quality(file, quality, error)
    if (.not. allocated(error)) call write_report(file, report, error)
    call close_file(file, error)
  end subroutine write_rom

  !> How many numbers the file holds: rows over all dofs, in whole chunks; reduced matrices; what is known of the quality.
  pure integer(int64) function numbers_of(n, kept, coordinates, vectors, receptances)
    !> Dofs of the full model, those in the basis, coordinates of the reduced model, loads and monitors
    integer, intent(in) :: n, kept, coordinates, vectors
    !> Numbers of the receptances, and as many of their errors
    integer, intent(in) :: receptances
    integer(int64) :: m

    m = coordinates
    numbers_of = m*in_chunks(kept) + vectors*in_chunks(n) + 4*m**2 + m*(vectors + 6) + 2*receptances
  contains
    !> A row of so many numbers, in whole chunks.
    pure integer(int64) function in_chunks(width)
      !> Numbers of the row
      integer, intent(in) :: width
      integer(int64) :: chunk

      chunk = max(1, min(width, longest_chunk))
      in_chunks = (width + chunk - 1)/chunk*chunk
    end function in_chunks
  end function numbers_of

  subroutine write_root(file, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    call write_attribute(file, '/', 'format', 'attrito rom', error)
    if (.not. allocated(error)) call write_attribute(file, '/', 'format_version', 1, error)
    if (.not. allocated(error)) call write_attribute(file, '/', 'description', &
      'Craig-Bampton model: boundary dofs, fixed-interface modes, static corrections', error)
  end subroutine write_root

  subroutine write_matrices(file, model, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Reduced model to write
    type(reduced_model_type), intent(in) :: model
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    call write_array(file, '/mass', model%mass, 'reduced mass matrix', 'user mass', error)
    if (.not. allocated(error)) call write_array(file, '/stiffness', model%stiffness, 'reduced stiffness matrix', &
                                                 'user force per length', error)
    if (allocated(model%damping) .and. .not. allocated(error)) &
      call write_array(file, '/damping', model%damping, 'reduced damping matrix', 'user force per velocity', error)
    if (.not. allocated(model%gyroscopic) .or. allocated(error)) return
    ! A column here is a row of the file.
    call write_array(file, '/gyroscopic', transpose(model%gyroscopic), &
                     'reduced matrix G of the Coriolis forces, skew, at a speed of rotation of 1 rad per unit of time', &
                     'user mass', error)
  end subroutine write_matrices

  subroutine write_coordinates(file, split, modes, report, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Fixed-interface modes and their frequencies
    type(fixed_interface_modes_type), intent(in) :: modes
    !> What the reduction found
    type(reduction_report_type), intent(in) :: report
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    call write_array(file, '/coordinates/kind', [(0_int8, i=1, report%boundary), (1_int8, i=1, report%modes), &
                                                 (2_int8, i=1, report%corrections)], &
                     'kind of coordinate: 0 boundary dof, 1 fixed-interface mode, 2 static correction', '1', error)
    if (.not. allocated(error)) call write_array(file, '/boundary/dof', int(split%boundary, int64), &
      'dof of the full model of each boundary coordinate, from 0', '1', error)
    if (.not. allocated(error)) call write_array(file, '/modes/frequency_hz', modes%frequency_hz, &
      'natural frequency with the boundary held', 'Hz', error)
    if (.not. allocated(error)) call write_array(file, '/modes/residual', modes%residual, &
      'norm of phi - lambda K_ii^-1 M_ii phi in M_ii, a bound on the relative error of lambda', '1', error)
  end subroutine write_coordinates

  subroutine write_quality(file, quality, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Errors estimated of the reduced model
    type(quality_type), intent(in) :: quality
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    call write_array(file, '/quality/frequency_hz', quality%frequency_hz, &
                     'natural frequencies of the reduced model, elastic ones, with the interface free', 'Hz', error)
    if (.not. allocated(error)) call write_array(file, '/quality/frequency_error', quality%error, &
      'estimated part of itself by which each of them is too high', '1', error)
    if (.not. allocated(error)) call write_array(file, '/quality/response_hz', quality%response_hz, &
      'frequencies at which responses were examined', 'Hz', error)
    if (.not. allocated(error)) call write_array(file, '/quality/receptance', quality%receptance, &
      'undamped receptances between loads and monitors of the reduced model', 'as given', error)
    if (.not. allocated(error)) call write_array(file, '/quality/receptance_error', quality%receptance_error, &
      'estimate of what they lack', 'as given', error)
  end subroutine write_quality

  !> The basis, block by block from where the steps left it: the columns, or those of their rows that are to be recovered; where the
  !> boundary was condensed its columns come first.
  subroutine write_basis(file, split, model, blocks, store, recovered, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Interior and boundary dofs, and this rank's share of them
    type(split_type), intent(in) :: split
    !> Reduced model to write
    type(reduced_model_type), intent(in) :: model
    !> Columns that are stored together
    type(block_type), intent(in) :: blocks(:)
    !> Store of columns, in memory or on disk
    type(column_store_type), intent(in) :: store
    !> Dofs, from 0, ascending, whose rows of the basis are kept; not allocated: all
    integer, allocatable, intent(in) :: recovered(:)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: columns(:, :)
    integer, allocatable :: own(:)
    integer :: i, row, kept, first

    kept = split%n
    first = split%first - 1
    if (allocated(recovered)) then
      kept = size(recovered)
      first = count(recovered < split%first - 1)
      own = pack(recovered, recovered >= split%first - 1 .and. recovered < split%first - 1 + split%rows()) - (split%first - 1) + 1
      call write_array(file, '/recovery/dof', int(recovered, int64), &
                       'dofs of the full model, from 0, that the basis gives the motion of', '1', error)
      if (allocated(error)) return
    end if
    call create_spread(file, kept, '/recovery/basis', size(model%mass, 1), &
                       'basis: one row a coordinate, q_full = basis^T q', 'user length per coordinate', error)
    if (kept == 0) return
    row = 0
    if (allocated(model%boundary_rows) .and. .not. allocated(error)) then
      columns = transpose(model%boundary_rows(:, first + 1:first + size(own)))
      call write_block(file, '/recovery/basis', [row, first], columns, error)
      row = size(model%boundary_rows, 1)
      deallocate (columns)
    end if
    do i = 1, size(blocks)
      if (allocated(error)) return
      allocate (columns(split%rows(), blocks(i)%columns()))
      call store%get(split, blocks(i), columns, error)
      if (allocated(own)) columns = columns(own, :)
      if (.not. allocated(error)) call write_block(file, '/recovery/basis', [row, first], columns, error)
      row = row + blocks(i)%columns()
      deallocate (columns)
    end do
  end subroutine write_basis

  !> A dataset of vectors over dofs, one vector a row.
  subroutine create_spread(file, width, name, count, description, unit, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> Number of dofs
    integer, intent(in) :: width
    !> Name of the dataset
    character(*), intent(in) :: name
    !> Number of vectors
    integer, intent(in) :: count
    !> What the dataset holds; columns of unit displacements
    character(*), intent(in) :: description, unit
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error

    if (min(count, width) == 0) then
      call create_array(file, name, 'real64', [count, width], description, unit, error)
    else
      call create_array(file, name, 'real64', [count, width], description, unit, error, chunk=[1, min(width, longest_chunk)])
    end if
  end subroutine create_spread

  subroutine write_report(file, report, error)
    !> HDF5 file that is open
    type(hdf5_file_type), intent(in) :: file
    !> What the reduction found
    type(reduction_report_type), intent(in) :: report
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    integer :: i

    call create_group(file, '/reduction', error)
    if (.not. allocated(error)) call whole('negative_pivots', report%negative_pivots)
    if (.not. allocated(error)) call whole('modes_below_shift', report%modes_below_shift)
    if (.not. allocated(error)) call whole('mode_solves', report%mode_solves)
    if (.not. allocated(error)) call whole('factor_megabytes', report%factor_megabytes)
    if (.not. allocated(error)) call whole('out_of_core', report%out_of_core)
    if (.not. allocated(error)) call whole('condensed', report%condensed)
    if (.not. allocated(error)) call number('shift_hz', report%shift_hz)
    if (.not. allocated(error)) call number('mode_residual', report%mode_residual)
    if (.not. allocated(error)) call number('constraint_residual', report%constraint_residual)
    if (.not. allocated(error)) call number('worst_error', report%worst_error)
    do i = 1, size(step_names) - 1
      if (.not. allocated(error)) call number(trim(step_names(i))//'_seconds', report%seconds(i))
      if (.not. allocated(error)) call number(trim(step_names(i))//'_peak_megabytes', report%megabytes(i))
    end do
    if (.not. allocated(error)) call write_attribute(file, '/reduction', 'ordering', trim(report%ordering), error)
    if (.not. allocated(error)) call write_attribute(file, '/reduction', 'eigensolver', trim(report%eigensolver), error)
  contains
    subroutine whole(name, value)
      !> Name of the dataset
      character(*), intent(in) :: name
      !> What the attribute is to hold
      integer, intent(in) :: value
      call write_attribute(file, '/reduction', name, value, error)
    end subroutine whole
    subroutine number(name, value)
      !> Name of the dataset
      character(*), intent(in) :: name
      !> What the attribute is to hold
      real(wp), intent(in) :: value
      call write_attribute(file, '/reduction', name, value, error)
    end subroutine number
  end subroutine write_report
end module attrito_reduce_write_rom
