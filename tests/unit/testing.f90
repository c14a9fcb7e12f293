!> A small harness: a suite is a list of named tests; a test that fails says why in its `error`.
module testing
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: test_type, test, run_suite, check, check_close

  abstract interface
    subroutine test_procedure(error)
      import :: error_type
      !> Allocated: the test has failed
      type(error_type), allocatable, intent(out) :: error
    end subroutine test_procedure
  end interface

  type :: test_type
    !> A statement that holds if the test passes
    character(:), allocatable :: name
    procedure(test_procedure), pointer, nopass :: run => null()
  end type test_type

  !> |got - expected| <= tolerance, everywhere
  interface check_close
    procedure :: check_close_scalar, check_close_vector, check_close_matrix, check_close_complex
  end interface check_close

contains

  !> One entry of a suite.
  function test(name, run) result(self)
    character(*), intent(in) :: name
    procedure(test_procedure) :: run
    type(test_type) :: self

    self%name = name
    self%run => run
  end function test

  !> Run all tests of a suite and tell each; the number that failed.
  integer function run_suite(suite, tests, quiet) result(failed)
    character(*), intent(in) :: suite
    type(test_type), intent(in) :: tests(:)
    !> Tell failures only: for ranks other than the first
    logical, intent(in) :: quiet
    type(error_type), allocatable :: error
    integer :: i

    failed = 0
    do i = 1, size(tests)
      call tests(i)%run(error)
      if (allocated(error)) then
        failed = failed + 1
        print '(5a)', 'FAILED ', suite, ': ', tests(i)%name, new_line('a')//'       '//error%message
      else if (.not. quiet) then
        print '(4a)', 'ok     ', suite, ': ', tests(i)%name
      end if
    end do
    if (.not. quiet) print '(i0,a,i0,a)', size(tests) - failed, ' of ', size(tests), ' passed'
  end function run_suite

  !> A condition must hold. The first failure of a test is the one it tells.
  subroutine check(error, condition, message)
    type(error_type), allocatable, intent(inout) :: error
    logical, intent(in) :: condition
    !> What does not hold
    character(*), intent(in) :: message

    if (allocated(error) .or. condition) return
    call raise(error, message)
  end subroutine check

  subroutine check_close_scalar(error, got, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: got, expected, tolerance
    character(*), intent(in) :: what

    call check_close_vector(error, [got], [expected], tolerance, what)
  end subroutine check_close_scalar

  subroutine check_close_matrix(error, got, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: got(:, :), expected(:, :), tolerance
    character(*), intent(in) :: what

    call check(error, all(shape(got) == shape(expected)), what//': shapes differ')
    if (allocated(error)) return
    call check_close_vector(error, reshape(got, [size(got)]), reshape(expected, [size(expected)]), tolerance, what)
  end subroutine check_close_matrix

  subroutine check_close_complex(error, got, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error
    complex(wp), intent(in) :: got(:, :), expected(:, :)
    real(wp), intent(in) :: tolerance
    character(*), intent(in) :: what

    call check_close_matrix(error, real(got, wp), real(expected, wp), tolerance, what//', real part')
    call check_close_matrix(error, aimag(got), aimag(expected), tolerance, what//', imaginary part')
  end subroutine check_close_complex

  subroutine check_close_vector(error, got, expected, tolerance, what)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: got(:), expected(:), tolerance
    character(*), intent(in) :: what
    character(160) :: text
    integer :: worst

    call check(error, size(got) == size(expected), what//': sizes differ')
    if (allocated(error) .or. size(got) == 0) return
    ! Negated, so that NaN fails.
    if (.not. any(.not. abs(got - expected) <= tolerance)) return
    worst = maxloc(abs(got - expected), 1)
    if (any(got /= got)) worst = findloc(got /= got, .true., 1)
    write (text, '(a,i0,a,es22.14,a,es22.14,a,es8.1,a,es8.1)') ' [', worst, ']: got', got(worst), ', expected', expected(worst), &
      ', apart by', abs(got(worst) - expected(worst)), ', allowed', tolerance
    call raise(error, what//trim(text))
  end subroutine check_close_vector
end module testing
