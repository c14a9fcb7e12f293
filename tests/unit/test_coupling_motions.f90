!> Motions by which forces go from contact to contact, against the eigenvectors of a dense solution.
program test_coupling_motions
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_linear_coupling_motions, only: coupling_motions_type
  use attrito_linear_receptance_modal, only: receptance_modal_type, new_receptance_modal
  use scenes, only: noise
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: modes = 160

  call run_in_session('coupling motions', [ &
                      test('where all rows count they are all eigenvectors, of unit length by the springs', all_rows), &
                      test('of many rows they have the largest eigenvalues', largest)])

contains

  !> Random directions of modes whose stiffness grows by a tenth from one to the next.
  function random_receptance(rows) result(receptance)
    integer, intent(in) :: rows
    type(receptance_modal_type) :: receptance
    real(wp) :: identity(modes, modes)
    integer :: i

    identity = 0.0_wp
    do i = 1, modes
      identity(i, i) = 1.0_wp
    end do
    receptance = new_receptance_modal([(1.1_wp**(i - 1), i=1, modes)], spread(1.0_wp, 1, modes), spread(0.0_wp, 1, modes), identity, &
                                      reshape(noise(modes*rows, 21), [modes, rows]), 1)
  end function random_receptance

  !> Springs of rows, no two alike.
  function springs_of(rows) result(springs)
    integer, intent(in) :: rows
    real(wp) :: springs(rows)

    springs = 2.0_wp + noise(rows, 22)
  end function springs_of

  !> Eigenvalues of K_c^1/2 R K_c^1/2, ascending, and those of the motions, as they stand.
  subroutine compare(rows, motions, dense, found, length)
    integer, intent(in) :: rows
    type(coupling_motions_type), intent(out) :: motions
    real(wp), allocatable, intent(out) :: dense(:), found(:)
    !> Largest difference of their products by the springs from 0 and 1
    real(wp), intent(out) :: length
    type(receptance_modal_type) :: receptance
    real(wp) :: springs(rows), unit(rows, rows)
    real(wp), allocatable :: vectors(:, :), shapes(:, :), response(:, :), products(:, :)
    integer :: i, status

    receptance = random_receptance(rows)
    springs = springs_of(rows)
    unit = 0.0_wp
    do i = 1, rows
      unit(i, i) = 1.0_wp
    end do
    response = receptance%directions*spread(sqrt(springs), 1, modes)
    call symmetric_eigenpairs(matmul(transpose(response), response/spread(receptance%static_stiffness(), 2, rows)), unit, dense, &
                              vectors, status)
    call motions%prepare(receptance, only_me(), springs)
    shapes = matmul(transpose(motions%carriers), receptance%directions)
    products = matmul(shapes*spread(springs, 1, size(shapes, 1)), transpose(shapes))
    do i = 1, size(products, 1)
      products(i, i) = products(i, i) - 1.0_wp
    end do
    length = maxval(abs(products))
    response = matmul(receptance%directions, transpose(shapes*spread(springs, 1, size(shapes, 1))))
    found = sum(response**2/spread(receptance%static_stiffness(), 2, size(response, 2)), 1)
  end subroutine compare

  !> 24 rows, fewer than motions: their span is that of all rows, and Rayleigh's quotients are the eigenvalues to rounding, by the
  !> range of these, some 1e3.
  subroutine all_rows(error)
    type(error_type), allocatable, intent(out) :: error
    type(coupling_motions_type) :: motions
    real(wp), allocatable :: dense(:), found(:)
    real(wp) :: length

    call compare(24, motions, dense, found, length)
    call check(error, size(found) == 24, 'not all rows count')
    if (allocated(error)) return
    call check(error, maxval(dense) < 1.0e4_wp*minval(dense), 'the range is larger: the tolerance is void')
    call check(error, length < 1.0e-10_wp, 'they are not orthonormal by the springs')
    call check_close(error, found, dense(24:1:-1), 1.0e-10_wp*maxval(dense), 'eigenvalues')
  end subroutine all_rows

  !> Eight iterations of 32 vectors leave the eighth eigenvalue an error of (theta_33/theta_8)^16, 7e-14 at a ratio of 0.15, times the
  !> square of what the start misses of it by what it has of it: 1e-7 is for a thousand.
  subroutine largest(error)
    type(error_type), allocatable, intent(out) :: error
    type(coupling_motions_type) :: motions
    real(wp), allocatable :: dense(:), found(:)
    real(wp) :: length

    call compare(120, motions, dense, found, length)
    call check(error, size(found) == 32 .and. dense(120 - 32) < 0.15_wp*dense(120 - 7), 'they fall too slowly: the test is void')
    call check(error, length < 1.0e-10_wp, 'they are not orthonormal by the springs')
    call check_close(error, found(:8), dense(120:113:-1), 1.0e-7_wp*maxval(dense), 'eigenvalues')
  end subroutine largest
end program test_coupling_motions
