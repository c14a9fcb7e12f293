!> Two tangents against one, and against themselves in another frame.
program test_contact_invariance
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_forces, only: contact_forces_type
  use attrito_testing_sampled_contact, only: contact_samples_type, evaluate_contact_by_samples, sample_contact
  use attrito_contact_state, only: state_slipping
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, samples = 64
  ! Forces of order 5, J = 64 additions and a contraction at every slip: 50 roundings.
  real(wp), parameter :: rounding = 5.0e-14_wp

  if (run_suite('contact invariance', [ &
                test('two tangents moved along one line give the force of one tangent', collinear), &
                test('two tangents moved along one line have the Jacobian of one tangent along it', collinear_jacobian), &
                test('turning the tangents turns T and leaves N', turned_force), &
                test('turning the tangents turns the Jacobian', turned_jacobian), &
                test('shifting motion and slider along the wall changes nothing', shifted), &
                test('a later start of the period turns the phases of the forces', later_start)], quiet=.false.) > 0) error stop 1

contains

  pure function lively_law(tangents) result(law)
    integer, intent(in) :: tangents
    type(contact_type) :: law

    law = contact_type(tangents=tangents, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=0.4_wp, &
                       preload=0.5_wp)
  end function lively_law

  !> Motion that sticks, slips and opens [k, 3]
  pure function lively_motion(seed) result(motion)
    integer, intent(in) :: seed
    real(wp) :: motion(k, 3)

    motion = 0.6_wp*reshape(noise(3*k, seed), [k, 3])
    motion(1, 3) = 0.6_wp
  end function lively_motion

  pure function turn(angle) result(rotation)
    real(wp), intent(in) :: angle
    real(wp) :: rotation(2, 2)

    rotation = reshape([cos(angle), -sin(angle), sin(angle), cos(angle)], [2, 2])
  end function turn

  function forces_of(motion, slider) result(forces)
    real(wp), intent(in) :: motion(:, :), slider(2)
    type(contact_forces_type) :: forces
    type(fourier_type) :: fourier

    fourier = new_fourier(harmonics, samples)
    allocate (forces%deviation(size(motion, 1), size(motion, 2)))
    call evaluate_contact_by_samples(lively_law(size(motion, 2) - 1), fourier, motion, slider, .false., forces)
    call fourier%destroy()
  end function forces_of

  subroutine collinear(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: along(2) = [0.6_wp, 0.8_wp]
    type(contact_forces_type) :: one, two
    real(wp) :: motion(k, 3), expected(k, 3)
    integer :: seed, i

    do seed = 1, 20
      motion = lively_motion(seed)
      one = forces_of(motion(:, 2:), [0.3_wp, 0.0_wp])
      motion(:, 1) = along(1)*motion(:, 2)
      motion(:, 2) = along(2)*motion(:, 2)
      two = forces_of(motion, 0.3_wp*along)
      do i = 1, 2
        expected(:, i) = along(i)*one%deviation(:, 1)
      end do
      expected(:, 3) = one%deviation(:, 2)
      call check(error, one%state == state_slipping, 'it does not slip: the test is void')
      call check_close(error, two%deviation, expected, rounding, 'deviation')
      call check_close(error, [two%slip, two%open], [one%slip, one%open], 0.0_wp, 'fractions of the period')
    end do
  end subroutine collinear

  subroutine collinear_jacobian(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: one, two
    real(wp) :: motion(k, 3)
    integer :: seed

    do seed = 1, 20
      motion = lively_motion(seed)
      motion(:, 1) = motion(:, 2)
      motion(:, 2) = 0.0_wp
      one = forces_of(motion(:, [1, 3]), [0.0_wp, 0.0_wp])
      two = forces_of(motion, [0.0_wp, 0.0_wp])
      call check_close(error, two%jacobian(:k, :k), one%jacobian(:k, :k), rounding, 'dT/du')
      call check_close(error, two%jacobian(:k, 2*k + 1:), one%jacobian(:k, k + 1:), rounding, 'dT/dv')
      call check_close(error, two%jacobian(2*k + 1:, 2*k + 1:), one%jacobian(k + 1:, k + 1:), rounding, 'dN/dv')
    end do
  end subroutine collinear_jacobian

  subroutine turned_force(error)
    type(error_type), allocatable, intent(out) :: error
    type(fourier_type) :: fourier
    type(contact_samples_type) :: plain, turned
    real(wp) :: motion(k, 3), rotation(2, 2), slider(2)
    integer :: seed

    fourier = new_fourier(harmonics, samples)
    do seed = 1, 20
      motion = lively_motion(seed)
      slider = noise(2, seed)
      rotation = turn(0.3_wp*seed)
      if (allocated(plain%displacement)) deallocate (plain%displacement, plain%slider, plain%regimes, plain%gradients)
      if (allocated(turned%displacement)) deallocate (turned%displacement, turned%slider, turned%regimes, turned%gradients)
      call sample_contact(lively_law(2), fourier, motion, slider, 3, plain)
      motion(:, :2) = matmul(motion(:, :2), transpose(rotation))
      call sample_contact(lively_law(2), fourier, motion, matmul(rotation, slider), 3, turned)
      call check_close(error, turned%force(:, :2), matmul(plain%force(:, :2), transpose(rotation)), rounding, 'T')
      call check_close(error, turned%force(:, 3), plain%force(:, 3), 0.0_wp, 'N')
    end do
    call fourier%destroy()
  end subroutine turned_force

  subroutine turned_jacobian(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: plain, turned
    real(wp) :: motion(k, 3), rotation(2, 2), frame(3*k, 3*k)
    integer :: i, j, row

    motion = lively_motion(3)
    rotation = turn(1.1_wp)
    plain = forces_of(motion, [0.0_wp, 0.0_wp])
    motion(:, :2) = matmul(motion(:, :2), transpose(rotation))
    turned = forces_of(motion, [0.0_wp, 0.0_wp])
    frame = 0.0_wp
    do row = 1, k
      do i = 1, 2
        do j = 1, 2
          frame((i - 1)*k + row, (j - 1)*k + row) = rotation(i, j)
        end do
      end do
      frame(2*k + row, 2*k + row) = 1.0_wp
    end do
    call check_close(error, turned%jacobian, matmul(frame, matmul(plain%jacobian, transpose(frame))), rounding, 'Jacobian')
  end subroutine turned_jacobian

  subroutine shifted(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: plain, moved
    real(wp), parameter :: shift(2) = [1.5_wp, -0.7_wp]
    real(wp) :: motion(k, 3), expected(k, 3)

    motion = lively_motion(4)
    plain = forces_of(motion, [0.1_wp, 0.2_wp])
    motion(1, :2) = motion(1, :2) + shift
    moved = forces_of(motion, [0.1_wp, 0.2_wp] + shift)
    ! T = kt u + g is the same, so g takes the shift back.
    expected = plain%deviation
    expected(1, :2) = expected(1, :2) - 3.0_wp*shift
    call check_close(error, moved%deviation, expected, rounding, 'deviation')
  end subroutine shifted

  subroutine later_start(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: plain, later
    real(wp) :: motion(k, 3)
    integer :: seed

    ! Forty-odd marches would be needed for two tangents to forget; one tangent forgets within one.
    do seed = 1, 10
      motion = lively_motion(seed)
      plain = forces_of(motion(:, 2:), [0.0_wp, 0.0_wp])
      later = forces_of(delayed(motion(:, 2:)), [0.0_wp, 0.0_wp])
      call check(error, plain%unique, 'the loop depends on its start: the test is void')
      call check_close(error, later%deviation, delayed(plain%deviation), rounding, 'deviation')
    end do
  end subroutine later_start

  !> The series that starts 13 samples later.
  pure function delayed(motion)
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: delayed(size(motion, 1), size(motion, 2))
    real(wp), parameter :: angle = 2.0_wp*acos(-1.0_wp)*13/samples
    integer :: h

    delayed = motion
    do h = 1, harmonics
      delayed(2*h, :) = cos(h*angle)*motion(2*h, :) + sin(h*angle)*motion(2*h + 1, :)
      delayed(2*h + 1, :) = cos(h*angle)*motion(2*h + 1, :) - sin(h*angle)*motion(2*h, :)
    end do
  end function delayed
end program test_contact_invariance
