!> Large dense systems by factors in single precision: to the digits of double, and where single precision cannot.
program test_refined
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_refined, only: solve_refined
  use testing, only: test, run_suite, check, check_close
  implicit none

  !> Unknowns: few, and more than factors in single precision are made from
  integer, parameter :: few = 5, many = 260

  if (run_suite('refined', [ &
                test('the solution is that of double precision, of few unknowns and of many, small numbers included', well), &
                test('a matrix that is singular in single precision is solved in double', ill), &
                test('a singular matrix is said to be', singular)], quiet=.false.) > 0) error stop 1

contains

  !> A matrix with the numbers 2 on its diagonal and less than 1 / n beside: its condition is below 3.
  function dominant(n) result(matrix)
    integer, intent(in) :: n
    real(wp), allocatable :: matrix(:, :)
    integer :: i

    allocate (matrix(n, n))
    call random_number(matrix)
    matrix = matrix/n
    do i = 1, n
      matrix(i, i) = 2.0_wp
    end do
  end function dominant

  subroutine well(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: matrix(:, :), solution(:), values(:)
    ! A right-hand side of 1e-60 has no number in single precision.
    real(wp), parameter :: sizes(2) = [1.0_wp, 1.0e-60_wp]
    integer :: i, n, status

    do i = 1, 4
      n = merge(few, many, i <= 2)
      matrix = dominant(n)
      allocate (solution(n))
      call random_number(solution)
      solution = sizes(modulo(i, 2) + 1)*solution
      values = matmul(matrix, solution)
      call solve_refined(matrix, values, status)
      call check(error, status == 0, 'it is not solved')
      ! A residual of 1e-12, times the condition.
      call check_close(error, values/maxval(solution), solution/maxval(solution), 1.0e-11_wp, 'solution')
      deallocate (solution)
    end do
  end subroutine well

  !> The first two rows differ by 1e-10, of which single precision sees nothing: the condition is some 1e10.
  subroutine ill(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: matrix(:, :), values(:)
    real(wp) :: solution(many)
    integer :: status

    matrix = dominant(many)
    matrix(2, :) = matrix(1, :)
    matrix(2, 2) = matrix(2, 2) + 1.0e-10_wp
    call random_number(solution)
    values = matmul(matrix, solution)
    call solve_refined(matrix, values, status)
    call check(error, status == 0, 'it is not solved')
    ! Rounding of 1e-16 by the elimination's growth, n at most as a rule, times the condition.
    call check_close(error, values, solution, 1.0e-16_wp*many*1.0e10_wp, 'solution')
  end subroutine ill

  subroutine singular(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: matrix(:, :), values(:)
    integer :: status

    matrix = dominant(many)
    matrix(:, 3) = 0.0_wp
    allocate (values(many), source=1.0_wp)
    call solve_refined(matrix, values, status)
    call check(error, status /= 0, 'it is solved')
  end subroutine singular
end program test_refined
