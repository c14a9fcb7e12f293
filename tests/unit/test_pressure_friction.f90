!> Friction that depends on the contact pressure: the slip force, forces against a fine march, their Jacobian against differences.
program test_pressure_friction
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_contact_disc_rules, only: new_disc_rules
  use attrito_contact_evaluation, only: evaluate_contact, quadrature_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_law_laws, only: new_law
  use attrito_contact_law_contact_law, only: limit_type
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping
  use attrito_contact_stuck_bound, only: is_stuck_by_bound
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_model_contacts, only: contact_type
  use fine_march, only: marched_deviation
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, pressure_law = 1
  real(wp), parameter :: area = 2.0_wp, pressures(3) = [0.0_wp, 1.0_wp, 4.0_wp], coefficients(3) = [0.6_wp, 0.4_wp, 0.1_wp]

  if (run_suite('pressure friction', [ &
                test('the slip force is mu(N/A) N, linear in the pressure between what is given and constant beyond', slip_force), &
                test('its slope is that of differences, where it is open too', slope), &
                test('between the pressures given it is a quadratic', pieces), &
                test('one coefficient for all pressures is Coulomb''s law', constant), &
                test('a contact that its bounds hold stuck does stick, at the least coefficient', bounds), &
                test('forces along one tangent are those of a fine march', march_one), &
                test('forces along two tangents are those of a fine march', march_two), &
                test('a slider rests where the discs of all instants hold it, at a kink of their radii, too', resting), &
                test('one tangent in slip and through landing has the Jacobian of differences', one_tangent), &
                test('two tangents in slip and through landing have the Jacobian of differences', two_tangents), &
                test('so have two tangents that all but follow a line, where slip ends at kinks as along one', all_but_a_line)], &
                quiet=.false.) > 0) error stop 1

contains

  !> A contact whose law is the table above.
  function rubbing(tangents) result(contact)
    integer, intent(in) :: tangents
    type(contact_type) :: contact
    integer :: i

    contact = contact_type(tangents=tangents, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=9.0_wp)
    contact%law => new_law(pressure_law, [area, (pressures(i), coefficients(i), i=1, 3)])
  end function rubbing

  subroutine slip_force(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact
    real(wp) :: force(6), slope(6)

    contact = rubbing(1)
    ! Pressures -0.5, 0, 0.5, 1, 2.5, 10
    call contact%slip_force([-1.0_wp, 0.0_wp, 1.0_wp, 2.0_wp, 5.0_wp, 20.0_wp], force, slope)
    call check_close(error, force, [-0.6_wp, 0.0_wp, 0.5_wp, 0.8_wp, 1.25_wp, 2.0_wp], 1.0e-15_wp, 'slip force')
    call check_close(error, contact%least_coefficient(), 0.1_wp, 0.0_wp, 'least coefficient')
    deallocate (contact%law)
  end subroutine slip_force

  subroutine slope(error)
    type(error_type), allocatable, intent(out) :: error
    ! F is quadratic between the pressures given: central differences are exact but for rounding, 1e-16 over the step.
    real(wp), parameter :: step = 1.0e-5_wp, normal(5) = [-1.0_wp, 0.5_wp, 1.7_wp, 5.0_wp, 11.0_wp]
    type(contact_type) :: contact
    real(wp), dimension(size(normal)) :: force, above, below, here, ignored

    contact = rubbing(1)
    call contact%slip_force(normal, force, here)
    call contact%slip_force(normal + step, above, ignored)
    call contact%slip_force(normal - step, below, ignored)
    call check_close(error, here, (above - below)/(2.0_wp*step), 1.0e-9_wp, 'slope')
    deallocate (contact%law)
  end subroutine slope

  subroutine constant(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact, plain
    type(contact_forces_type) :: by_law, by_coefficient
    integer :: tangents

    do tangents = 1, 2
      contact = rubbing(tangents)
      deallocate (contact%law)
      contact%law => new_law(pressure_law, [area, 1.0_wp, 0.4_wp])
      plain = contact_type(tangents=tangents, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=0.4_wp)
      by_law = forces_of(contact, motion_of(tangents, 3, 0.1_wp))
      by_coefficient = forces_of(plain, motion_of(tangents, 3, 0.1_wp))
      call check(error, by_law%state == state_slipping .and. by_law%open > 0.0_wp, 'it does not slip and open: the test is void')
      ! Panels are cut at the one pressure.
      call check_close(error, by_law%deviation, by_coefficient%deviation, 1.0e-9_wp, 'deviation')
      call check_close(error, by_law%jacobian, by_coefficient%jacobian, 1.0e-7_wp, 'Jacobian')
      deallocate (contact%law)
    end do
  end subroutine constant

  subroutine bounds(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact
    type(contact_forces_type) :: forces
    integer :: seed, held

    held = 0
    contact = rubbing(2)
    do seed = 1, 40
      if (.not. is_stuck_by_bound(contact, motion_of(2, seed, 1.0_wp + 0.4_wp*seed), [0.0_wp, 0.0_wp])) cycle
      held = held + 1
      ! A little less than a bound allows: the march itself, which a bound would skip, has to find the contact stuck.
      forces = forces_of(contact, motion_of(2, seed, 0.999_wp*(1.0_wp + 0.4_wp*seed)))
      call check(error, forces%state == state_stuck, 'it slips')
    end do
    call check(error, held > 2 .and. held < 38, 'bounds hold none or all: the test is void')
    deallocate (contact%law)
  end subroutine bounds

  subroutine pieces(error)
    type(error_type), allocatable, intent(out) :: error
    real(wp), parameter :: normal(6) = [-1.0_wp, 0.3_wp, 2.0_wp, 3.0_wp, 7.9_wp, 20.0_wp]
    type(contact_type) :: contact
    type(limit_type), allocatable :: limits(:)
    real(wp) :: force(size(normal)), slope(size(normal))
    integer :: i

    contact = rubbing(1)
    limits = contact%limits()
    call contact%slip_force(normal, force, slope)
    do i = 1, size(normal)
      associate (c => limits(count(limits%from <= normal(i)))%coefficients)
        call check_close(error, c(0) + normal(i)*(c(1) + c(2)*normal(i)), force(i), 1.0e-14_wp, 'slip force')
      end associate
    end do
    deallocate (contact%law)
  end subroutine pieces

  subroutine march_one(error)
    type(error_type), allocatable, intent(out) :: error

    call hold_against_march(error, 1)
  end subroutine march_one

  subroutine march_two(error)
    type(error_type), allocatable, intent(out) :: error

    call hold_against_march(error, 2)
  end subroutine march_two

  !> Motions that stay closed and that open, over all pieces of the table.
  subroutine hold_against_march(error, tangents)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: tangents
    type(contact_type) :: contact
    type(contact_forces_type) :: at
    real(wp) :: motion(k, tangents + 1), deviation(k, tangents + 1), slider(tangents)
    integer :: seed, opened

    contact = rubbing(tangents)
    opened = 0
    do seed = 1, 12
      motion = motion_of(tangents, seed, merge(0.7_wp, 0.15_wp, modulo(seed, 2) == 0))
      at = forces_of(contact, motion)
      call check(error, at%state == state_slipping, 'it does not slip: the test is void')
      if (allocated(error)) return
      if (at%open > 0.0_wp) opened = opened + 1
      slider = at%slider(:tangents)
      call marched_deviation(contact, motion, spread(0.0_wp, 1, tangents + 1), 2**17, 2, slider, deviation)
      call check_close(error, at%deviation, deviation, 2.0e-6_wp, 'deviation')
    end do
    call check(error, opened > 2, 'few of them open: the test is void')
    deallocate (contact%law)
  end subroutine hold_against_march

  subroutine resting(error)
    type(error_type), allocatable, intent(out) :: error
    ! Second order of the step, and instants known to 1e-9 over it
    real(wp), parameter :: step = 1.0e-5_wp, tolerance = 1.0e-5_wp
    type(contact_type) :: contact
    type(contact_forces_type) :: at, above, below
    real(wp) :: motion(k, 3), moved(k, 3)
    integer :: a, i, seed, rests

    contact = rubbing(2)
    rests = 0
    do seed = 1, 60
      motion = motion_of(2, seed, 1.0_wp)
      ! Radii are least where N passes 8, the last pressure; sliders begin out of reach of some.
      motion(:, 3) = motion(:, 3)*2.0_wp
      motion(1, 3) = 1.6_wp
      motion(:, :2) = motion(:, :2)*0.12_wp
      motion(1, :2) = motion(1, :2) + [0.3_wp, 0.2_wp]*noise(2, 200 + seed)
      at = forces_of(contact, motion)
      if (at%state /= state_shaken_down) cycle
      rests = rests + 1
      do a = 1, 3
        do i = 1, k
          moved = motion
          moved(i, a) = motion(i, a) + step
          above = forces_of(contact, moved)
          moved(i, a) = motion(i, a) - step
          below = forces_of(contact, moved)
          call check_close(error, at%jacobian(:, (a - 1)*k + i), &
                           reshape((above%deviation - below%deviation)/(2.0_wp*step), [3*k]), tolerance, 'column')
        end do
      end do
    end do
    call check(error, rests > 5, 'hardly any rests: the test is void')
    deallocate (contact%law)
  end subroutine resting

  subroutine one_tangent(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, 1)
  end subroutine one_tangent

  subroutine two_tangents(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, 2)
  end subroutine two_tangents

  subroutine all_but_a_line(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, 2, 0.01_wp)
  end subroutine all_but_a_line

  !> Motions that stay closed and that open, over both slopes of the table.
  subroutine compare(error, tangents, aside)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: tangents
    !> The motion of one tangent, and this part of another across it
    real(wp), intent(in), optional :: aside
    ! Second order of the step times third derivatives of up to 1e4, and rounding of 1e-16 over the step
    real(wp), parameter :: step = 1.0e-6_wp, tolerance = 2.0e-7_wp
    type(contact_type) :: contact
    type(contact_forces_type) :: at, above, below
    real(wp) :: motion(k, tangents + 1), moved(k, tangents + 1)
    integer :: i, j, seed, opened

    contact = rubbing(tangents)
    opened = 0
    do seed = 1, 10
      motion = motion_of(tangents, seed, merge(0.7_wp, 0.15_wp, modulo(seed, 2) == 0))
      if (present(aside)) then
        motion(:, 2) = aside*motion(:, 2)
        motion(:, 1:3:2) = motion_of(1, seed, merge(0.7_wp, 0.15_wp, modulo(seed, 2) == 0))
      end if
      at = forces_of(contact, motion)
      call check(error, at%state == state_slipping, 'it does not slip: the test is void')
      if (allocated(error)) return
      if (at%open > 0.0_wp) opened = opened + 1
      do j = 1, tangents + 1
        do i = 1, k
          moved = motion
          moved(i, j) = motion(i, j) + step
          above = forces_of(contact, moved)
          moved(i, j) = motion(i, j) - step
          below = forces_of(contact, moved)
          call check_close(error, at%jacobian(:, (j - 1)*k + i), &
                           reshape((above%deviation - below%deviation)/(2.0_wp*step), [k*(tangents + 1)]), tolerance, 'column')
        end do
      end do
    end do
    call check(error, opened > 2, 'few of them open: the test is void')
    deallocate (contact%law)
  end subroutine compare

  !> Forces by events, on fine panels.
  function forces_of(contact, motion) result(forces)
    type(contact_type), intent(in) :: contact
    real(wp), intent(in) :: motion(:, :)
    type(contact_forces_type) :: forces
    type(quadrature_type) :: quadrature

    allocate (forces%deviation(size(motion, 1), size(motion, 2)))
    quadrature = quadrature_type(order=2, grid=new_grid(2*harmonics), discs=new_disc_rules(harmonics, 14, 1.0e-12_wp))
    call evaluate_contact(contact, quadrature, motion, [0.0_wp, 0.0_wp], .false., forces)
  end function forces_of

  !> Motion with a mean closing.
  pure function motion_of(tangents, seed, closing) result(motion)
    integer, intent(in) :: tangents, seed
    real(wp), intent(in) :: closing
    real(wp) :: motion(k, tangents + 1)

    motion = 0.5_wp*reshape(noise(size(motion), seed), shape(motion))
    motion(:, tangents + 1) = 0.4_wp*motion(:, tangents + 1)
    motion(1, tangents + 1) = closing
  end function motion_of
end program test_pressure_friction
