!> Increments along which a contact's displacements go straight: exact, with the derivatives of differences.
program test_straight_increment
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_contact_straight_increment, only: increment_type, follow_increment
  use attrito_model_contacts, only: contact_type
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  !> Tries of each kind, of places at random about a touching contact
  integer, parameter :: tries = 40

  if (run_suite('straight_increment', [ &
                test('one tangent: two halves of a line leave the slider where the whole does', line_in_halves), &
                test('two tangents: two halves of a line leave the slider where the whole does', plane_in_halves), &
                test('one tangent: derivatives are those of differences', line_derivatives), &
                test('two tangents: derivatives are those of differences', plane_derivatives), &
                test('a contact that just touches holds what has not moved yet', just_touching), &
                test('a contact lands where its motion before would have taken it', landing)], quiet=.false.) > 0) error stop 1

contains

  function rubbing(tangents) result(law)
    integer, intent(in) :: tangents
    type(contact_type) :: law

    law = contact_type(tangents=tangents, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=0.7_wp, &
                       gap=0.1_wp)
  end function rubbing

  subroutine line_in_halves(error)
    type(error_type), allocatable, intent(out) :: error

    call check_halves(1, error)
  end subroutine line_in_halves

  subroutine plane_in_halves(error)
    type(error_type), allocatable, intent(out) :: error

    call check_halves(2, error)
  end subroutine plane_in_halves

  subroutine check_halves(tangents, error)
    integer, intent(in) :: tangents
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(increment_type) :: first, second, whole
    real(wp) :: from(tangents + 1), to(tangents + 1), middle(tangents + 1), slider(2)
    integer :: i

    law = rubbing(tangents)
    do i = 1, tries
      from = noise(tangents + 1, i)
      to = noise(tangents + 1, tries + i)
      slider = 0.0_wp
      slider(:tangents) = from(:tangents)
      middle = 0.5_wp*(from + to)
      call follow_increment(law, from, to, to, slider, whole)
      call follow_increment(law, from, middle, middle, slider, first)
      call follow_increment(law, middle, to, to, first%slider, second)
      ! Both are exact but for rounding of numbers of order one.
      call check_close(error, second%slider, whole%slider, 1.0e-13_wp, 'slider')
      if (allocated(error)) return
      call check_close(error, second%force, whole%force, 1.0e-12_wp, 'forces')
      if (allocated(error)) return
    end do
  end subroutine check_halves

  subroutine line_derivatives(error)
    type(error_type), allocatable, intent(out) :: error

    call check_derivatives(1, error)
  end subroutine line_derivatives

  subroutine plane_derivatives(error)
    type(error_type), allocatable, intent(out) :: error

    call check_derivatives(2, error)
  end subroutine plane_derivatives

  subroutine check_derivatives(tangents, error)
    integer, intent(in) :: tangents
    type(error_type), allocatable, intent(out) :: error
    ! Third derivatives are of order (1/radius)^3 <= 1e3 where radii are 0.1 and more: 1e-10 times that; and rounding over the step.
    real(wp), parameter :: step = 1.0e-5_wp, allowed = 1.0e-6_wp
    type(contact_type) :: law
    type(increment_type) :: here, above, below
    real(wp), dimension(tangents + 1) :: from, to, change
    real(wp) :: slider(2)
    integer :: i, k

    law = rubbing(tangents)
    do i = 1, tries
      from = noise(tangents + 1, i)
      to = noise(tangents + 1, tries + i)
      slider = 0.0_wp
      slider(:tangents) = from(:tangents)
      call follow_increment(law, from, from, to, slider, here)
      if (here%closed .and. here%force(tangents + 1) < 0.5_wp) cycle
      do k = 1, tangents + 1
        change = 0.0_wp
        change(k) = step
        call follow_increment(law, from, from, to + change, slider, above)
        call follow_increment(law, from, from, to - change, slider, below)
        ! A corner between both is no derivative.
        if (above%closed .neqv. below%closed) cycle
        call check_close(error, here%stiffness(:, k), (above%force - below%force)/(2.0_wp*step), allowed, 'derivative')
        if (allocated(error)) return
      end do
    end do
  end subroutine check_derivatives

  subroutine just_touching(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(increment_type) :: increment
    real(wp) :: at(3)

    law = rubbing(2)
    at = [0.0_wp, 0.0_wp, law%gap]
    call follow_increment(law, at, at, at, [0.0_wp, 0.0_wp], increment)
    call check(error, increment%closed .and. .not. increment%moves, 'it sticks')
    if (allocated(error)) return
    call check_close(error, [increment%stiffness(1, 1), increment%stiffness(2, 2), increment%stiffness(3, 3)], &
                     [3.0_wp, 3.0_wp, 5.0_wp], 0.0_wp, 'springs')
  end subroutine just_touching

  subroutine landing(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: law
    type(increment_type) :: increment

    ! A third of the way it touches, at u = 0.1; then it is pressed on and sticks, whatever the line through both ends says.
    law = rubbing(1)
    call follow_increment(law, [0.0_wp, 0.0_wp], [0.3_wp, 0.3_wp], [0.15_wp, 0.2_wp], [0.0_wp, 0.0_wp], increment)
    call check_close(error, increment%slider(1), 0.1_wp, 1.0e-15_wp, 'slider')
  end subroutine landing
end program test_straight_increment
