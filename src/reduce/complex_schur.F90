!> Schur complement of a sparse complex symmetric matrix onto some of its rows, by MUMPS. The factors are not kept.
!>
!> $$ S = A_{bb} - A_{bi} A_{ii}^{-1} A_{ib} $$
!>
!> Each rank gives entries of its own, of the lower triangle; those of one place are summed. Pivots are taken on the diagonal as they
!> come, which is stable where the real part of A_ii is positive definite and the imaginary part small.
!> Source: Amestoy, Duff, L'Excellent, Koster, SIAM J. Matrix Anal. Appl. 23 (2001) 15-41, doi:10.1137/S0895479899358194.
module attrito_reduce_complex_schur
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type, raise
  use attrito_core_exhausted, only: expect_exhaustion
  use attrito_core_kinds, only: wp
  implicit none
  include 'zmumps_struc.h'
  private
  public :: complex_schur_type, new_complex_schur

  type :: complex_schur_type
    !> Complex operations of the elimination, and memory of all ranks in megabytes, as foreseen
    real(wp) :: operations = 0.0_wp, megabytes = 0.0_wp
    type(communicator_type), private :: ranks
    type(zmumps_struc), private :: mumps
  contains
    procedure :: complement
    procedure :: destroy
  end type complex_schur_type

  !> MUMPS's numbers (users' guide 5.5): jobs, control and information by position
  integer, parameter :: job_begin = -1, job_end = -2, job_analyse = 1, job_factor = 2
  integer, parameter :: icntl_errors = 1, icntl_level = 4, icntl_scaling = 8, icntl_room = 14, icntl_entries = 18, &
                        icntl_schur = 19, icntl_discard = 31
  integer, parameter :: symmetric = 2, spread_entries = 3, on_the_root = 1, discard_factors = 1
  integer, parameter :: cntl_pivoting = 1, infog_status = 1, infog_detail = 2, infog_megabytes = 17, rinfog_operations = 1
  !> Room beyond what is foreseen, in percent
  integer, parameter :: room = 30 ! conventional

  character(*), parameter :: cannot = 'the boundary cannot be condensed '

  interface
    subroutine zmumps(id)
      import :: zmumps_struc
      !> State of MUMPS
      type(zmumps_struc) :: id
    end subroutine zmumps
  end interface

contains

  !> Order the rows, and foresee operations and memory.
  subroutine new_complex_schur(self, ranks, n, kept, rows, columns, values, error)
    !> The elimination, to be destroyed
    type(complex_schur_type), intent(inout) :: self
    !> Ranks that share the work
    type(communicator_type), intent(in) :: ranks
    !> Number of rows of the matrix
    integer, intent(in) :: n
    !> Rows that stay, from 1, the same on every rank
    integer, intent(in) :: kept(:)
    !> This rank's entries on and below the diagonal, from 1
    integer, intent(in) :: rows(:), columns(:)
    !> Their values
    complex(wp), intent(in) :: values(:)
    !> MUMPS failed
    type(error_type), allocatable, intent(out) :: error

    self%ranks = ranks
    associate (mumps => self%mumps)
      mumps%comm = ranks%handle
      mumps%sym = symmetric
      mumps%par = 1
      mumps%job = job_begin
      call zmumps(mumps)
      mumps%icntl(icntl_errors:icntl_level) = 0
      mumps%icntl(icntl_scaling) = 0
      mumps%icntl(icntl_room) = room
      mumps%icntl(icntl_entries) = spread_entries
      mumps%icntl(icntl_schur) = on_the_root
      mumps%icntl(icntl_discard) = discard_factors
      mumps%cntl(cntl_pivoting) = 0.0_wp
      mumps%n = n
      mumps%nnz_loc = size(rows)
      mumps%size_schur = size(kept)
      allocate (mumps%irn_loc, source=rows)
      allocate (mumps%jcn_loc, source=columns)
      allocate (mumps%a_loc, source=values)
      allocate (mumps%listvar_schur, source=kept)
      mumps%job = job_analyse
      call zmumps(mumps)
      self%operations = mumps%rinfog(rinfog_operations)
      self%megabytes = mumps%infog(infog_megabytes)
    end associate
    call check(self, error)
  end subroutine new_complex_schur

  !> Eliminate the other rows.
  subroutine complement(self, schur, error)
    class(complex_schur_type), intent(inout) :: self
    !> [kept, kept] on the root, else [0, 0]; its upper triangle
    complex(wp), allocatable, intent(out) :: schur(:, :)
    !> MUMPS failed, as where memory is short
    type(error_type), allocatable, intent(out) :: error
    integer :: kept, status

    kept = 0
    if (self%ranks%is_root()) kept = self%mumps%size_schur
    call expect_exhaustion(.true.)
    allocate (self%mumps%schur(kept*kept), schur(kept, kept), stat=status)
    call expect_exhaustion(.false.)
    if (self%ranks%largest(real(abs(status), wp)) > 0.0_wp) then
      call raise(error, cannot//'(no memory for the result)')
    else
      self%mumps%job = job_factor
      call zmumps(self%mumps)
      call check(self, error)
    end if
    if (allocated(error)) then
      if (allocated(schur)) deallocate (schur)
    else
      ! By rows the lower triangle, hence by columns the upper one.
      schur = reshape(self%mumps%schur, [kept, kept])
    end if
    if (associated(self%mumps%schur)) deallocate (self%mumps%schur)
  end subroutine complement

  !> What MUMPS complains of.
  subroutine check(self, error)
    class(complex_schur_type), intent(in) :: self
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    character(60) :: code

    associate (status => self%mumps%infog(infog_status), detail => self%mumps%infog(infog_detail))
      if (status >= 0) return
      write (code, '(a, i0, a, i0, a)') '(MUMPS error ', status, ', ', detail, ')'
    end associate
    call raise(error, cannot//trim(code))
  end subroutine check

  !> Release what MUMPS holds.
  subroutine destroy(self)
    class(complex_schur_type), intent(inout) :: self

    associate (mumps => self%mumps)
      if (associated(mumps%irn_loc)) deallocate (mumps%irn_loc, mumps%jcn_loc, mumps%a_loc, mumps%listvar_schur)
      mumps%job = job_end
      call zmumps(mumps)
    end associate
  end subroutine destroy
end module attrito_reduce_complex_schur
