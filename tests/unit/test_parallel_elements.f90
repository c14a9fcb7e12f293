!> Contact laws of several elements in parallel: forces are those of as many contacts side by side, whichever the quadrature.
module laws_in_parallel
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_law_contact_law, only: element_type
  use attrito_contact_law_coulomb_spring, only: coulomb_spring_type
  implicit none
  private
  public :: parallel_type

  !> Any parts
  type, extends(coulomb_spring_type) :: parallel_type
    type(element_type), allocatable :: parts(:)
  contains
    procedure :: elements
    procedure :: element
  end type parallel_type

contains

  pure integer function elements(self)
    class(parallel_type), intent(in) :: self

    elements = size(self%parts)
  end function elements

  pure type(element_type) function element(self, number)
    class(parallel_type), intent(in) :: self
    !> From 1
    integer, intent(in) :: number

    element = self%parts(number)
  end function element
end module laws_in_parallel

program test_parallel_elements
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_disc_rules, only: new_disc_rules
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_instants, only: forces_at_instants
  use attrito_contact_law_contact_law, only: element_type
  use attrito_contact_parallel_elements, only: union_length
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_slipping, state_open
  use attrito_contact_stuck_bound, only: is_stuck_by_bound
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_model_contacts, only: contact_type, slider_width
  use laws_in_parallel, only: parallel_type
  use scenes, only: noise
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, elements = 3
  !> Parts of stiffness and slip force, which sum to one
  real(wp), parameter :: stiffness(elements) = [0.5_wp, 0.3_wp, 0.2_wp], slip_force(elements) = [0.2_wp, 0.35_wp, 0.45_wp]
  type(parallel_type), target :: law

  law%parts = [element_type(stiffness(1), slip_force(1)), element_type(stiffness(2), slip_force(2)), &
               element_type(stiffness(3), slip_force(3))]
  if (run_suite('parallel elements', [ &
                test('forces by events are those of contacts side by side that share the normal spring', by_events), &
                test('forces by events along two tangents are those of contacts side by side', two_tangents), &
                test('the Jacobian is that of differences, whatever the elements do', jacobian), &
                test('a contact slips while any of its elements does, and fractions add up', fractions), &
                test('a contact that bounds hold stuck is stuck, its elements preloaded against each other', bounds), &
                test('loops are those of contacts side by side', loops), &
                test('intervals that overlap count once', union), &
                test('sliders beyond a contact''s own stay as wide as given', width)], quiet=.false.) > 0) error stop 1

contains

  function several() result(contact)
    type(contact_type) :: contact

    contact = contact_type(tangents=1, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=0.4_wp, &
                           gap=0.02_wp, preload=0.1_wp)
    contact%law => law
  end function several

  !> The same physics without the seam: each element's own spring and limit, and a part of the normal spring that makes its N a part.
  function side_by_side(number) result(contact)
    integer, intent(in) :: number
    type(contact_type) :: contact

    contact = contact_type(tangents=1, tangential_stiffness=3.0_wp*stiffness(number), normal_stiffness=5.0_wp/elements, &
                           friction_coefficient=0.4_wp*slip_force(number)*elements, gap=0.02_wp, preload=0.1_wp/elements)
  end function side_by_side

  function quadrature_of() result(quadrature)
    type(quadrature_type) :: quadrature

    quadrature = quadrature_type(grid=new_grid(harmonics))
  end function quadrature_of

  !> Motion with a mean closing.
  pure function motion_of(seed, closing, amplitude) result(motion)
    integer, intent(in) :: seed
    real(wp), intent(in) :: closing, amplitude
    real(wp) :: motion(k, 2)

    motion = amplitude*reshape(noise(2*k, seed), [k, 2])
    motion(:, 2) = 0.4_wp*motion(:, 2)
    motion(1, 2) = closing
  end function motion_of

  function forces_of(contact, quadrature, motion, slider, periodic) result(forces)
    type(contact_type), intent(in) :: contact
    type(quadrature_type), intent(in) :: quadrature
    real(wp), intent(in) :: motion(:, :), slider(:)
    logical, intent(in), optional :: periodic
    type(contact_forces_type) :: forces
    logical :: as_unknown

    as_unknown = .false.
    if (present(periodic)) as_unknown = periodic
    allocate (forces%deviation(size(motion, 1), size(motion, 2)))
    call evaluate_contact(contact, quadrature, motion, slider, as_unknown, forces)
  end function forces_of

  subroutine by_events(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, quadrature_of())
  end subroutine by_events

  !> Motions of all sizes, closed and with lift-off, and sliders anywhere.
  subroutine compare(error, quadrature)
    type(error_type), allocatable, intent(inout) :: error
    type(quadrature_type), intent(in) :: quadrature
    ! Rounding of forces of order 1
    real(wp), parameter :: tolerance = 1.0e-13_wp
    type(contact_forces_type) :: together, own
    real(wp) :: motion(k, 2), slider(2*elements), deviation(k, 2)
    real(wp), allocatable :: by_motion(:, :)
    integer :: met(0:3), seed, i

    met = 0
    do seed = 1, 40
      motion = motion_of(seed, merge(0.08_wp, 1.0_wp, modulo(seed, 3) == 0), 0.004_wp*1.15_wp**seed)
      if (seed == 40) motion(1, 2) = -9.0_wp
      slider = 0.0_wp
      slider(1::2) = 0.02_wp*noise(elements, 90 + seed)
      together = forces_of(several(), quadrature, motion, slider)
      met(together%state) = met(together%state) + 1
      deviation = 0.0_wp
      by_motion = spread(spread(0.0_wp, 1, 2*k), 2, 2*k)
      do i = 1, elements
        own = forces_of(side_by_side(i), quadrature, motion, slider(2*i - 1:2*i))
        deviation = deviation + own%deviation
        if (allocated(own%jacobian)) by_motion = by_motion + own%jacobian
        call check_close(error, together%slider(2*i - 1:2*i), own%slider, tolerance, 'slider')
      end do
      call check_close(error, together%deviation, deviation, tolerance, 'deviation')
      if (allocated(together%jacobian)) then
        call check_close(error, together%jacobian, by_motion, 20.0_wp*tolerance, 'Jacobian')
      else
        call check_close(error, maxval(abs(by_motion)), 0.0_wp, 0.0_wp, 'no Jacobian')
      end if
      if (allocated(error)) return
    end do
    call check(error, met(state_stuck) > 1 .and. met(state_shaken_down) > 0 .and. met(state_slipping) > 10 &
               .and. met(state_open) == 1, 'not all states are met: the test is void')
  end subroutine compare

  !> Elements along two tangents, of which the first slip before the last do; no slider is an unknown.
  subroutine two_tangents(error)
    type(error_type), allocatable, intent(out) :: error
    ! Elements have the panels of their twins, but for the rounding of radii.
    real(wp), parameter :: tolerance = 1.0e-11_wp
    type(quadrature_type) :: quadrature
    type(contact_type) :: contact
    type(contact_forces_type) :: together, own
    real(wp) :: motion(k, 3), slider(2*elements), deviation(k, 3), by_motion(3*k, 3*k)
    integer :: met(0:3), seed, i

    quadrature = quadrature_of()
    quadrature%discs = new_disc_rules(harmonics)
    met = 0
    do seed = 1, 24
      motion(:, 1) = 0.004_wp*1.25_wp**seed*noise(k, seed)
      motion(:, 2:) = 0.004_wp*1.25_wp**seed*reshape(noise(2*k, 50 + seed), [k, 2])
      motion(:, 3) = 0.4_wp*motion(:, 3)
      motion(1, 3) = merge(0.08_wp, 1.0_wp, modulo(seed, 3) == 0)
      slider = 0.02_wp*noise(2*elements, 90 + seed)
      contact = several()
      contact%tangents = 2
      together = forces_of(contact, quadrature, motion, slider, .true.)
      met(together%state) = met(together%state) + 1
      call check(error, .not. together%periodic, 'its sliders are unknowns')
      deviation = 0.0_wp
      by_motion = 0.0_wp
      do i = 1, elements
        contact = side_by_side(i)
        contact%tangents = 2
        own = forces_of(contact, quadrature, motion, slider(2*i - 1:2*i), .false.)
        deviation = deviation + own%deviation
        if (allocated(own%jacobian)) by_motion = by_motion + own%jacobian
        call check_close(error, together%slider(2*i - 1:2*i), own%slider, tolerance, 'slider')
      end do
      call check_close(error, together%deviation, deviation, tolerance, 'deviation')
      if (allocated(together%jacobian)) then
        call check_close(error, together%jacobian, by_motion, 1.0e3_wp*tolerance, 'Jacobian')
      else
        call check_close(error, maxval(abs(by_motion)), 0.0_wp, 0.0_wp, 'no Jacobian')
      end if
    end do
    call check(error, met(state_shaken_down) > 0 .and. met(state_slipping) > 10, 'not all states are met: the test is void')
  end subroutine two_tangents

  subroutine jacobian(error)
    type(error_type), allocatable, intent(out) :: error
    ! Second order of the step times third derivatives of up to 1e4, and rounding of 1e-16 over the step
    real(wp), parameter :: step = 1.0e-6_wp, tolerance = 2.0e-7_wp
    type(quadrature_type) :: quadrature
    type(contact_forces_type) :: at, above, below
    real(wp) :: motion(k, 2), moved(k, 2), slider(2*elements)
    integer :: seed, i, j

    quadrature = quadrature_of()
    slider = 0.0_wp
    do seed = 1, 8
      motion = motion_of(seed, merge(0.15_wp, 0.7_wp, modulo(seed, 2) == 0), 0.4_wp)
      at = forces_of(several(), quadrature, motion, slider)
      call check(error, at%state == state_slipping, 'it does not slip: the test is void')
      if (allocated(error)) return
      do j = 1, 2
        do i = 1, k
          moved = motion
          moved(i, j) = motion(i, j) + step
          above = forces_of(several(), quadrature, moved, slider)
          moved(i, j) = motion(i, j) - step
          below = forces_of(several(), quadrature, moved, slider)
          call check_close(error, at%jacobian(:, (j - 1)*k + i), &
                           reshape((above%deviation - below%deviation)/(2.0_wp*step), [2*k]), tolerance, 'column')
        end do
      end do
    end do
  end subroutine jacobian

  subroutine fractions(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: instants = 16384
    type(quadrature_type) :: events
    type(contact_forces_type) :: exact, own
    real(wp) :: motion(k, 2), slider(2*elements), longest, total, instant
    logical :: slips(instants)
    integer :: seed, i, j, apart

    events = quadrature_of()
    slider = 0.0_wp
    apart = 0
    do seed = 1, 12
      motion = motion_of(seed, merge(0.15_wp, 0.7_wp, modulo(seed, 2) == 0), 0.25_wp)
      exact = forces_of(several(), events, motion, slider)
      call check_close(error, exact%stick + exact%slip + exact%open, 1.0_wp, 1.0e-14_wp, 'all of the period')
      slips = .false.
      longest = 0.0_wp
      total = 0.0_wp
      do i = 1, elements
        own = contact_forces_type(lists_slip=.true.)
        allocate (own%deviation(k, 2))
        call evaluate_contact(side_by_side(i), events, motion, slider(2*i - 1:2*i), .false., own)
        do j = 1, instants
          instant = two_pi*(j - 1)/instants
          slips(j) = slips(j) .or. any(own%slips(1, :) <= instant .and. instant < own%slips(2, :))
        end do
        call check_close(error, exact%open, own%open, 1.0e-14_wp, 'an element is open as long as the contact')
        longest = max(longest, own%slip)
        total = total + own%slip
      end do
      ! Each of up to some ten switches falls between instants.
      call check_close(error, exact%slip, count(slips)/real(instants, wp), 10.0_wp/instants, 'slip of any, by instants')
      call check(error, exact%slip >= longest - 1.0e-13_wp .and. exact%slip <= min(total, 1.0_wp) + 1.0e-13_wp, 'slip of any')
      if (exact%slip > longest + 1.0e-3_wp) apart = apart + 1
    end do
    call check(error, apart > 2, 'elements slip at the same instants: the test is void')
  end subroutine fractions

  subroutine bounds(error)
    type(error_type), allocatable, intent(out) :: error
    type(quadrature_type) :: quadrature
    type(contact_forces_type) :: forces
    real(wp) :: motion(k, 2), slider(2*elements)
    integer :: seed, held

    quadrature = quadrature_of()
    held = 0
    do seed = 1, 60
      motion = motion_of(seed, 1.0_wp, 0.002_wp*1.08_wp**seed)
      slider = 0.0_wp
      slider(1::2) = motion(1, 1) + [0.01_wp, -0.02_wp, 0.05_wp]*noise(elements, 90 + seed)
      if (.not. is_stuck_by_bound(several(), motion, slider)) cycle
      held = held + 1
      ! A little more mean pressure than the bound needs: the march itself, which a bound would skip, has to find it stuck.
      forces = forces_of(several(), quadrature, motion*reshape([1.0_wp, spread(0.999_wp, 1, k - 1), 1.0_wp, &
                                                               spread(0.999_wp, 1, k - 1)], [k, 2]), slider)
      call check(error, forces%state == state_stuck, 'it slips')
      call check_close(error, forces%deviation(1, 1), -3.0_wp*dot_product(stiffness, slider(1::2)), 1.0e-15_wp, 'deviation')
    end do
    call check(error, held > 5 .and. held < 55, 'bounds hold none or all: the test is void')
  end subroutine bounds

  subroutine loops(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: instants = 128
    real(wp), dimension(instants, 2) :: displacement, force, total, own
    real(wp) :: motion(k, 2), slider(2*elements)
    integer :: i

    motion = motion_of(5, 0.15_wp, 0.3_wp)
    slider = 0.0_wp
    call forces_at_instants(several(), motion, slider, displacement, force)
    total = 0.0_wp
    do i = 1, elements
      call forces_at_instants(side_by_side(i), motion, slider, displacement, own)
      total = total + own
    end do
    call check_close(error, force, total, 1.0e-14_wp, 'force')
    call check(error, minval(force(:, 2)) <= 0.0_wp .and. maxval(force(:, 2)) > 0.1_wp, 'no lift-off: the test is void')
  end subroutine loops

  subroutine union(error)
    type(error_type), allocatable, intent(out) :: error

    ! 0.5 ... 1 in 0 ... 2, then 1.5 ... 3, touching 3 ... 3.5, and 5 ... 6
    call check_close(error, union_length(reshape([5.0_wp, 6.0_wp, 0.5_wp, 1.0_wp, 0.0_wp, 2.0_wp, 3.0_wp, 3.5_wp, 1.5_wp, 3.0_wp], &
                                                 [2, 5])), 4.5_wp, 1.0e-15_wp, 'length')
    call check_close(error, union_length(reshape([real(wp) ::], [2, 0])), 0.0_wp, 0.0_wp, 'of none')
  end subroutine union

  subroutine width(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_forces_type) :: forces
    real(wp) :: slider(2*elements)

    slider = 0.0_wp
    forces = forces_of(side_by_side(1), quadrature_of(), motion_of(3, 0.7_wp, 0.4_wp), slider)
    call check(error, size(forces%slider) == 2*elements .and. size(forces%moved) == 2*elements, 'width')
    call check(error, slider_width([side_by_side(1), several()]) == 2*elements, 'of both')
    call check(error, slider_width([side_by_side(1)]) == 2, 'of one element')
  end subroutine width
end program test_parallel_elements
