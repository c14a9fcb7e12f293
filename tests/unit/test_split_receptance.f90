!> The receptance with its high modes summed: what it leaves out, when it is taken, and what it keeps.
program test_split_receptance
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_trigonometric, only: to_complex, to_real
  use attrito_linear_receptance_modal, only: receptance_modal_type, new_receptance_modal
  use attrito_linear_split_receptance, only: split_receptance_type, rest_type, new_rest, flops
  use scenes, only: noise
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, modes = 200, rows = 24
  real(wp), parameter :: omega = 1.3_wp, tolerance = 1.0e-4_wp
  ! Sums of some hundred terms of one size, compared with the sum of their sizes.
  real(wp), parameter :: rounding = 1.0e-14_wp
  integer, parameter :: active(10) = [2, 3, 5, 6, 9, 12, 13, 20, 21, 24]

  call run_in_session('split receptance', [ &
                      test('what the series leaves out of a mode is known, and bounded with damping', one_mode), &
                      test('without damping what is left out grows with the power of frequency next to the last', next_power), &
                      test('products differ from those through all modes by no more than the bound', bounded), &
                      test('the tighter the tolerance, the closer the product, down to rounding', tighter), &
                      test('no power of the series needs fewer flops than the one that is taken', cheapest), &
                      test('high powers of high frequencies lose no digits', high_frequencies), &
                      test('a mean without support stays zero', no_mean), &
                      test('sums kept while rows come and go and the frequency rises are those made afresh', kept), &
                      test('modes that move freely are kept as they are', free_modes), &
                      test('it is taken where few rows meet many modes, and only there', choice)])

contains

  !> Random directions of modes with angular frequencies up from 1, each 5 % above the one before it.
  function random_receptance(ratio) result(receptance)
    !> Of damping
    real(wp), intent(in) :: ratio
    type(receptance_modal_type) :: receptance
    real(wp) :: frequencies(modes)
    real(wp), allocatable :: identity(:, :)
    integer :: i

    frequencies = [(1.05_wp**(i - 1), i=1, modes)]
    allocate (identity(modes, modes), source=0.0_wp)
    do i = 1, modes
      identity(i, i) = 1.0_wp
    end do
    receptance = new_receptance_modal(frequencies**2, spread(1.0_wp, 1, modes), 2.0_wp*ratio*frequencies, identity, &
                                      reshape(noise(modes*rows, 21), [modes, rows])*spread(frequencies, 2, rows), harmonics)
  end function random_receptance

  !> Through all modes: the product, or the sum of the sizes of its terms.
  function through_modes(receptance, chosen, y, sizes) result(motion)
    type(receptance_modal_type), intent(in) :: receptance
    integer, intent(in) :: chosen(:)
    real(wp), intent(in) :: y(:, :)
    logical, intent(in) :: sizes
    real(wp) :: motion(size(y, 1), size(y, 2))
    complex(wp) :: response(modes, 0:harmonics), one(modes, 0:harmonics), unit(modes, 0:harmonics)
    integer :: i

    if (.not. sizes) then
      call receptance%respond(to_complex(matmul(y, transpose(receptance%directions(:, chosen)))), response)
      motion = matmul(to_real(response), receptance%directions(:, chosen))
      return
    end if
    ! The size of each mode's term, the same for cosine and sine, with no sign to cancel another.
    unit = 1.0_wp
    call receptance%respond(unit, one)
    response = abs(to_complex(matmul(y, transpose(receptance%directions(:, chosen)))))*abs(one)
    motion(1, :) = matmul(real(response(:, 0), wp), abs(receptance%directions(:, chosen)))
    do i = 1, harmonics
      motion(2*i, :) = matmul(real(response(:, i), wp), abs(receptance%directions(:, chosen)))
      motion(2*i + 1, :) = motion(2*i, :)
    end do
  end function through_modes

  function random_forces(columns) result(y)
    integer, intent(in) :: columns
    real(wp) :: y(k, columns)

    y = reshape(noise(k*columns, 22), [k, columns])
  end function random_forces

  subroutine one_mode(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: stiffness = 3.0_wp, mass = 0.7_wp, damping = 0.2_wp
    type(rest_type) :: rest
    complex(wp) :: exact, corrected
    real(wp) :: difference, left_out(1), undamped(3)
    integer :: i

    exact = 1.0_wp/cmplx(stiffness - omega**2*mass, omega*damping, wp)
    ! Static, damping, and first dynamic correction.
    corrected = 1.0_wp/stiffness - (0.0_wp, 1.0_wp)*omega*damping/stiffness**2 &
                + omega**2*(mass - damping**2/stiffness)/stiffness**2
    difference = abs((exact - corrected)/exact)
    rest = new_rest([stiffness], [mass], [damping], omega)
    call rest%raise_to(2, left_out)
    call check(error, left_out(1) >= difference, 'the bound is below the difference')
    call check(error, left_out(1) <= 1.5_wp*difference, 'the bound is far above the difference')
    rest = new_rest([stiffness], [mass], [0.0_wp], omega)
    do i = 1, 3
      call rest%raise_to(2*i, undamped(i:i))
    end do
    call check_close(error, undamped, [((omega**2*mass/stiffness)**(i + 1), i=1, 3)], 1.0e-15_wp, 'left out without damping')
  end subroutine one_mode

  subroutine next_power(error)
    type(error_type), allocatable, intent(out) :: error
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: y(k, size(active)), differences(2)
    integer :: i, status

    receptance = random_receptance(0.0_wp)
    call receptance%set_frequency(omega, status)
    call split%prepare(receptance, only_me(), active, tolerance)
    call check(error, split%in_use, 'it is not taken: the test is void')
    do i = 1, 2
      ! The same forces at harmonics 2 and 1
      y = 0.0_wp
      y(6 - 2*i:7 - 2*i, :) = 1.0_wp
      differences(i) = norm2(split%receive(only_me(), y) - through_modes(receptance, active, y, .false.))
    end do
    ! Times the mode's own amplification 1/(1 - x^2), x being its power P + 2 root of the tolerance at most.
    call check_close(error, differences(1)/differences(2)/2.0_wp**(split%power + 2), 1.0_wp, &
                     1.1_wp*tolerance**(2.0_wp/(split%power + 2)), 'ratio of differences')
  end subroutine next_power

  subroutine bounded(error)
    type(error_type), allocatable, intent(out) :: error
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: y(k, size(active)), plain(k, size(active)), sizes(k, size(active)), difference(k, size(active))
    integer :: i, status

    y = random_forces(size(active))
    do i = 0, 2
      receptance = random_receptance(0.01_wp*i)
      split = split_receptance_type()
      call receptance%set_frequency(omega, status)
      call split%prepare(receptance, only_me(), active, tolerance)
      call check(error, split%in_use .and. split%low < modes/2, 'it is not taken: the test is void')
      call check(error, split%bound <= tolerance .and. split%bound > 0.3_wp*tolerance, 'the bound is not at the tolerance')
      plain = through_modes(receptance, active, y, .false.)
      sizes = through_modes(receptance, active, y, .true.)
      difference = abs(split%receive(only_me(), y) - plain)
      call check(error, all(difference <= split%bound*sizes + rounding*sizes), 'the difference is beyond the bound')
      call check(error, maxval(difference) > 1.0e3_wp*rounding*maxval(sizes), 'there is no difference: the test is void')
    end do
  end subroutine bounded

  subroutine tighter(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: tolerances(4) = [1.0e-2_wp, 1.0e-6_wp, 1.0e-10_wp, 1.0e-14_wp]
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: y(k, 1), plain(k, 1), sizes(k, 1), off(size(tolerances))
    integer :: i, status

    receptance = random_receptance(0.0_wp)
    call receptance%set_frequency(omega, status)
    y = random_forces(1)
    plain = through_modes(receptance, active(:1), y, .false.)
    sizes = through_modes(receptance, active(:1), y, .true.)
    do i = 1, size(tolerances)
      call split%prepare(receptance, only_me(), active(:1), tolerances(i))
      call check(error, split%in_use .and. split%bound <= tolerances(i), 'the split does not follow')
      off(i) = maxval(abs(split%receive(only_me(), y) - plain)/sizes)
      call check(error, off(i) <= split%bound + rounding, 'it is beyond the bound')
    end do
    call check(error, off(1) > tolerances(2) .and. off(2) > tolerances(3), 'it is as near from the start: the test is void')
  end subroutine tighter

  !> The way that is found needs no more flops than that of any power, up to ones whose sums alone need more than all modes do.
  subroutine cheapest(error)
    type(error_type), allocatable, intent(out) :: error
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    type(rest_type) :: rest
    real(wp) :: left_out(modes), best, found
    integer :: i, power, stride, low, first, status

    do i = 0, 3
      ! Without damping and with more and more; few rows, for which many powers pay.
      receptance = random_receptance(0.1_wp*i)
      stride = merge(1, 2, i > 0)
      split = split_receptance_type()
      call receptance%set_frequency(omega, status)
      call split%prepare(receptance, only_me(), active(:3), tolerance)
      call check(error, split%in_use .and. split%power > 6, 'hardly any powers: the test is void')
      ! From x^2 + 2 ratio x = 1 on, x being H omega over a mode's frequency, no series converges.
      first = 1 + count(harmonics*omega*(sqrt(1.0_wp + (0.1_wp*i)**2) + 0.1_wp*i) >= sqrt(receptance%modal_stiffness))
      rest = new_rest(receptance%modal_stiffness(first:), receptance%modal_mass(first:), receptance%modal_damping(first:), &
                      harmonics*omega)
      best = flops(k, 3, modes, 0, 0.0_wp)
      found = huge(best)
      do power = 2, 4*modes, stride
        call rest%raise_to(power, left_out(first:))
        low = first - 1 + findloc(left_out(first:) > tolerance, .true., dim=1, back=.true.)
        associate (sums => power/stride + 1)
          associate (all_told => flops(k, 3, low, sums, 2.0_wp*sums*(modes - low)*9.0_wp))
            best = min(best, all_told)
            if (power == split%power .and. low == split%low) found = all_told
          end associate
        end associate
      end do
      call check_close(error, found, best, 0.0_wp, 'flops')
    end do
  end subroutine cheapest

  !> Sums to a high power: products keep their digits where frequencies are far from one.
  subroutine high_frequencies(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: fast = 1.0e12_wp
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: y(k, 1), sizes(k, 1)
    integer :: status

    receptance = random_receptance(0.0_wp)
    receptance%modal_stiffness = fast**2*receptance%modal_stiffness
    call receptance%set_frequency(fast*omega, status)
    y = random_forces(1)
    call split%prepare(receptance, only_me(), active(:1), 1.0e-12_wp)
    ! The highest power of h omega is not a number, and that of the modes' frequencies is none either.
    call check(error, split%in_use .and. split%power*log10(fast) > range(fast), 'the power is too low: the test is void')
    sizes = through_modes(receptance, active(:1), y, .true.)
    call check(error, all(abs(split%receive(only_me(), y) - through_modes(receptance, active(:1), y, .false.)) &
                          <= (split%bound + rounding)*sizes), 'it is beyond the bound')
  end subroutine high_frequencies

  subroutine no_mean(error)
    type(error_type), allocatable, intent(out) :: error
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: motion(k, size(active))
    integer :: status

    receptance = random_receptance(0.0_wp)
    receptance%lowest = 1
    call receptance%set_frequency(omega, status)
    call split%prepare(receptance, only_me(), active, tolerance)
    call check(error, split%in_use, 'it is not taken: the test is void')
    motion = split%receive(only_me(), random_forces(size(active)))
    call check_close(error, motion(1, :), 0.0_wp*motion(1, :), 0.0_wp, 'mean')
    call check(error, maxval(abs(motion)) > 0.0_wp, 'nothing moves: the test is void')
  end subroutine no_mean

  subroutine kept(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: steps = 5
    real(wp), parameter :: factors(steps) = [0.5_wp, 0.5_wp, 0.8_wp, 0.8_wp, 1.0_wp]
    logical :: masks(size(active), steps)
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split, afresh
    integer, allocatable :: chosen(:)
    integer :: lows(steps), powers(steps)
    logical :: same
    real(wp), allocatable :: y(:, :)
    integer :: i, status

    receptance = random_receptance(0.02_wp)
    masks = .true.
    masks([1, 4, 10], 1) = .false.
    masks([5], 2) = .false.
    masks([2, 3, 9], 4) = .false.
    do i = 1, steps
      chosen = pack(active, masks(:, i))
      y = random_forces(size(chosen))
      call receptance%set_frequency(factors(i)*omega, status)
      call split%prepare(receptance, only_me(), chosen, tolerance)
      afresh = split_receptance_type()
      call afresh%prepare(receptance, only_me(), chosen, tolerance)
      lows(i) = split%low
      powers(i) = split%power
      call check(error, split%in_use .and. afresh%in_use, 'it is not taken: the test is void')
      ! Afresh, another power can be cheaper.
      same = split%low == afresh%low .and. split%power == afresh%power
      call check(error, same .or. i < steps, 'the last split is another: the test is void')
      call check_close(error, split%receive(only_me(), y), afresh%receive(only_me(), y), &
                       merge(rounding, 2.0_wp*tolerance, same)*maxval(through_modes(receptance, chosen, y, .true.)), 'product')
    end do
    call check(error, all(powers == powers(1)) .and. lows(steps) > lows(1), 'the split has not moved: the test is void')
  end subroutine kept

  subroutine free_modes(error)
    type(error_type), allocatable, intent(out) :: error
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: y(k, size(active)), plain(k, size(active)), sizes(k, size(active))
    integer :: status

    receptance = random_receptance(0.0_wp)
    receptance%modal_stiffness(:2) = 0.0_wp
    receptance%lowest = 1
    call receptance%set_frequency(omega, status)
    call split%prepare(receptance, only_me(), active, tolerance)
    call check(error, split%in_use, 'it is not taken: the test is void')
    y = random_forces(size(active))
    y(1, :) = 0.0_wp
    plain = through_modes(receptance, active, y, .false.)
    sizes = through_modes(receptance, active, y, .true.)
    call check(error, all(abs(split%receive(only_me(), y) - plain) <= (split%bound + rounding)*sizes), 'it is beyond the bound')
  end subroutine free_modes

  !> Flops by hand, and the cases that matter: H = 7, sums of masses and stiffnesses, made for one linear system.
  subroutine choice(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: sizes(5) = [30, 100, 300, 1000, 3000]
    type(receptance_modal_type) :: receptance
    type(split_receptance_type) :: split
    real(wp) :: summing
    integer :: i, status

    ! 3*10*4*5 + 3*10*2*2*10 = 1800 a product.
    call check_close(error, flops(3, 10, 5, 2, 7.0_wp), 40*1800.0_wp + 7.0_wp, 0.0_wp, 'flops')
    do i = 1, size(sizes)
      associate (r => sizes(i))
        summing = 4.0_wp*(3200 - 300)*real(r, wp)**2
        call check(error, (flops(15, r, 300, 2, summing) < flops(15, r, 3200, 0, 0.0_wp)) .eqv. r <= 300, '3200 modes')
        if (r >= 300) call check(error, flops(15, r, 0, 2, 0.0_wp) > flops(15, r, 200, 0, 0.0_wp), '200 modes')
      end associate
    end do
    call check(error, flops(15, 1000, 300, 2, 0.0_wp) < flops(15, 1000, 3200, 0, 0.0_wp), 'sums at hand are not used')
    receptance = random_receptance(0.0_wp)
    call receptance%set_frequency(omega, status)
    call split%prepare(receptance, only_me(), active, tolerance)
    call check(error, split%in_use .and. split%low < modes, 'few rows and many modes')
    receptance = random_receptance(0.0_wp)
    receptance%modal_mass = 1.0e12_wp
    call receptance%set_frequency(omega, status)
    call split%prepare(receptance, only_me(), active, tolerance)
    call check(error, .not. split%in_use, 'all modes are low, and yet summed')
  end subroutine choice
end program test_split_receptance
