!> The Jacobian of the contact forces against central differences.
!>
!> Within a pattern of switches the forces of one tangent are piecewise linear in the motion: central differences are exact but for
!> rounding, 1e-16 of forces of order 10 over a step of 1e-6. Two tangents add the step squared times third derivatives, which are of
!> order (1 / slip radius)^2, and up to some 1e4 where slip sets in while the slider hardly leaves its disc. Both stay below 1e-7.
program test_contact_jacobian
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_fourier, only: fourier_type, new_fourier
  use attrito_contact_forces, only: contact_forces_type, released
  use attrito_testing_sampled_contact, only: contact_samples_type, evaluate_contact_by_samples, sample_contact
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping, state_open
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, samples = 64
  real(wp), parameter :: step = 1.0e-6_wp, tolerance = 1.0e-7_wp

  if (run_suite('contact Jacobian', [ &
                test('one tangent in stick and slip has the Jacobian of differences', slip_of_one), &
                test('two tangents in stick and slip have the Jacobian of differences', slip_of_two), &
                test('one tangent that opens and lands has the Jacobian of differences', lift_off_of_one), &
                test('two tangents that open and land have the Jacobian of differences', lift_off_of_two), &
                test('a shaken-down contact of one tangent has the Jacobian of differences', shaken_down_of_one), &
                test('two tangents that have shaken down are not said to slip, and have the Jacobian of differences', &
                     shaken_down_of_two), &
                test('two tangents marched from where they are have the Jacobian of their two marches', two_marches), &
                test('an open contact has the Jacobian of minus its springs', open_contact), &
                test('rows that are not active are zero', inactive_rows)], quiet=.false.) > 0) error stop 1

contains

  pure function law_of(tangents) result(law)
    integer, intent(in) :: tangents
    type(contact_type) :: law

    law = contact_type(tangents=tangents, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=0.4_wp)
  end function law_of

  !> Forces of a contact; a periodic slider is found from the one given.
  function forces_of(motion, slider, periodic) result(forces)
    real(wp), intent(in) :: motion(:, :), slider(2)
    logical, intent(in) :: periodic
    type(contact_forces_type) :: forces
    type(fourier_type) :: fourier
    real(wp) :: start(2), step(2, 1)
    integer :: i

    fourier = new_fourier(harmonics, samples)
    allocate (forces%deviation(size(motion, 1), size(motion, 2)))
    start = slider
    do i = 1, 50
      call evaluate_contact_by_samples(law_of(size(motion, 2) - 1), fourier, motion, start, periodic, forces)
      if (.not. forces%follows()) exit
      if (norm2(forces%moved) <= 1.0e-15_wp) exit
      step = released(forces%link%holding, reshape(forces%moved, [2, 1]))
      start = start + step(:, 1)
    end do
    call fourier%destroy()
  end function forces_of

  !> Motion with a mean closing: about 1 stays closed, about 0.3 opens.
  pure function motion_of(tangents, seed, closing) result(motion)
    integer, intent(in) :: tangents, seed
    real(wp), intent(in) :: closing
    real(wp) :: motion(k, tangents + 1)

    motion = 0.5_wp*reshape(noise(size(motion), seed), shape(motion))
    motion(:, tangents + 1) = 0.4_wp*motion(:, tangents + 1)
    motion(1, tangents + 1) = closing
  end function motion_of

  !> Compare, and check that the contact is in the state that the test is about.
  subroutine compare(error, motion, slider, periodic, state)
    type(error_type), allocatable, intent(inout) :: error
    real(wp), intent(in) :: motion(:, :), slider(2)
    logical, intent(in) :: periodic
    integer, intent(in) :: state
    type(contact_forces_type) :: at, above, below
    real(wp) :: moved(size(motion, 1), size(motion, 2)), difference(size(motion))
    integer :: i, j

    at = forces_of(motion, slider, periodic)
    call check(error, at%state == state, 'the contact is in another state: the test is void')
    if (allocated(error)) return
    do j = 1, size(motion, 2)
      do i = 1, k
        moved = motion
        moved(i, j) = motion(i, j) + step
        above = forces_of(moved, slider, periodic)
        moved(i, j) = motion(i, j) - step
        below = forces_of(moved, slider, periodic)
        difference = reshape((above%deviation - below%deviation)/(2.0_wp*step), [size(motion)])
        call check_close(error, at%jacobian(:, (j - 1)*k + i), difference, tolerance, 'column')
      end do
    end do
  end subroutine compare

  subroutine slip_of_one(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed

    do seed = 1, 10
      call compare(error, motion_of(1, seed, 0.7_wp), [0.0_wp, 0.0_wp], .false., state_slipping)
    end do
  end subroutine slip_of_one

  subroutine slip_of_two(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed

    do seed = 1, 10
      call compare(error, motion_of(2, seed, 1.0_wp), [0.1_wp, 0.2_wp], .true., state_slipping)
    end do
  end subroutine slip_of_two

  subroutine lift_off_of_one(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    integer :: seed

    do seed = 1, 10
      forces = forces_of(motion_of(1, seed, 0.1_wp), [0.0_wp, 0.0_wp], .false.)
      call check(error, forces%open > 0.05_wp .and. forces%open < 0.95_wp, 'it does not open and land: the test is void')
      call compare(error, motion_of(1, seed, 0.1_wp), [0.0_wp, 0.0_wp], .false., state_slipping)
    end do
  end subroutine lift_off_of_one

  subroutine lift_off_of_two(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    integer :: seed

    do seed = 1, 10
      forces = forces_of(motion_of(2, seed, 0.1_wp), [0.0_wp, 0.0_wp], .true.)
      call check(error, forces%open > 0.05_wp .and. forces%open < 0.95_wp, 'it does not open and land: the test is void')
      call compare(error, motion_of(2, seed, 0.1_wp), [0.0_wp, 0.0_wp], .true., state_slipping)
    end do
  end subroutine lift_off_of_two

  subroutine shaken_down_of_one(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: motion(k, 2)
    integer :: seed

    do seed = 1, 10
      motion = motion_of(1, seed, 1.0_wp)
      motion(2:, :) = 0.1_wp*motion(2:, :)
      call compare(error, motion, [merge(3.0_wp, -3.0_wp, modulo(seed, 2) == 0), 0.0_wp], .false., state_shaken_down)
    end do
  end subroutine shaken_down_of_one

  subroutine shaken_down_of_two(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: motion(k, 3)
    integer :: seed

    do seed = 1, 20
      motion = motion_of(2, seed, 1.0_wp)
      motion(2:, :) = 0.1_wp*motion(2:, :)
      call compare(error, motion, [3.0_wp, -2.0_wp], .false., state_shaken_down)
    end do
  end subroutine shaken_down_of_two

  subroutine two_marches(error)
    type(error_type), allocatable, intent(out) :: error
    integer :: seed
    type(contact_forces_type) :: forces

    do seed = 1, 10
      forces = forces_of(motion_of(2, seed, 1.5_wp), [1.0_wp, -2.0_wp], .false.)
      call compare(error, motion_of(2, seed, 1.5_wp), [1.0_wp, -2.0_wp], .false., forces%state)
    end do
  end subroutine two_marches

  subroutine open_contact(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: expected(3*k, 3*k)
    integer :: i

    forces = forces_of(motion_of(2, 1, -3.0_wp), [0.0_wp, 0.0_wp], .false.)
    expected = 0.0_wp
    do i = 1, 3*k
      expected(i, i) = merge(-3.0_wp, -5.0_wp, i <= 2*k)
    end do
    call check(error, forces%state == state_open, 'it is not open')
    call check_close(error, forces%jacobian, expected, 1.0e-13_wp, 'Jacobian')
  end subroutine open_contact

  subroutine inactive_rows(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    integer :: seed, tangents, row

    do seed = 1, 20
      tangents = 1 + modulo(seed, 2)
      forces = forces_of(motion_of(tangents, seed, 0.12_wp*seed), [1.0_wp, 1.0_wp], .false.)
      if (forces%state == state_stuck) cycle
      do row = 1, size(forces%active)
        if (forces%active(row)) cycle
        call check(error, all(abs(forces%jacobian(row, :)) <= 0.0_wp), 'an inactive row is not zero')
      end do
    end do
  end subroutine inactive_rows
end program test_contact_jacobian
