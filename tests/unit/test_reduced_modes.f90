!> The lowest modes of large dense pairs by block Lanczos against LAPACK.
program test_reduced_modes
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_reduce_reduced_modes, only: find_reduced_modes
  use session, only: run_in_session
  use testing, only: test, check, check_close
  implicit none

  !> More than LAPACK is given; masses that float apart, in chains
  integer, parameter :: n = 1200, chains = 3
  real(wp), parameter :: rigid = 1.0e-12_wp

  call run_in_session('reduced_modes', [ &
                      test('the modes up to an eigenvalue are those of LAPACK, rigid ones among them', agree), &
                      test('no more elastic modes are sought than asked for', are_limited), &
                      test('a mass that is not positive is an error', is_refused)])

contains

  !> Chains of equal length whose springs and masses differ, mixed among each other; chains float.
  subroutine make_chains(k, m)
    real(wp), allocatable, intent(out) :: k(:, :), m(:, :)
    integer :: i, a, b
    real(wp) :: spring

    allocate (k(n, n), m(n, n), source=0.0_wp)
    do i = 1, n
      m(i, i) = 1.0_wp + 0.5_wp*sin(real(i, wp))
      a = i
      b = i + chains
      if (b > n) cycle
      spring = 1.0e4_wp*(1.5_wp + cos(3.0_wp*i))
      k(a, a) = k(a, a) + spring
      k(b, b) = k(b, b) + spring
      k(a, b) = -spring
      k(b, a) = -spring
      m(a, b) = 0.1_wp
      m(b, a) = 0.1_wp
    end do
  end subroutine make_chains

  subroutine agree(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: k(:, :), m(:, :), all(:), vectors(:, :), found(:), shapes(:, :)
    real(wp) :: largest, top
    integer :: info, modes

    call make_chains(k, m)
    call symmetric_eigenpairs(k, m, all, vectors, info)
    modes = 40
    top = 0.5_wp*(all(modes) + all(modes + 1))
    call find_reduced_modes(k, m, top, n, rigid, found, shapes, largest, info)
    call check(error, info == 0, 'the search failed')
    if (allocated(error)) return
    call check(error, size(found) >= modes, 'too few modes')
    call check(error, count(found <= rigid*largest) == chains, 'rigid motions')
    call check(error, largest > 0.3_wp*all(n) .and. largest < all(n)*(1.0_wp + 1.0e-9_wp), 'order of the largest eigenvalue')
    if (allocated(error)) return
    ! LAPACK errs by rounding times the largest eigenvalue.
    call check_close(error, found(:modes), all(:modes), n*epsilon(1.0_wp)*all(n), 'eigenvalues')
    call check_close(error, matmul(transpose(shapes(:, :modes)), matmul(m, shapes(:, :modes))), identity(modes), 1.0e-9_wp, &
                     'shapes of unit modal mass')
    ! A residual 1e-12 of 1/(lambda + s), in the norm of M, times |K| + lambda |M|.
    call check(error, maxval(abs(matmul(k, shapes(:, :modes)) - matmul(m, shapes(:, :modes)*spread(found(:modes), 1, n)))) &
               < 1.0e-9_wp*maxval(abs(k)), 'residuals')
  end subroutine agree

  subroutine are_limited(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: k(:, :), m(:, :), found(:), shapes(:, :)
    real(wp) :: largest
    integer :: info, elastic

    call make_chains(k, m)
    call find_reduced_modes(k, m, 1.0e5_wp, 20, rigid, found, shapes, largest, info)
    elastic = count(found > rigid*largest)
    call check(error, info == 0 .and. elastic >= 20 .and. elastic < 2*20 + chains, 'modes that were found')
  end subroutine are_limited

  subroutine is_refused(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), allocatable :: k(:, :), m(:, :), found(:), shapes(:, :)
    real(wp) :: largest
    integer :: info

    call make_chains(k, m)
    m(7, 7) = -1.0_wp
    call find_reduced_modes(k, m, 1.0_wp, 5, rigid, found, shapes, largest, info)
    call check(error, info /= 0, 'an indefinite mass went through')
  end subroutine is_refused

  pure function identity(size) result(unit)
    integer, intent(in) :: size
    real(wp) :: unit(size, size)
    integer :: i

    unit = 0.0_wp
    do i = 1, size
      unit(i, i) = 1.0_wp
    end do
  end function identity
end program test_reduced_modes
