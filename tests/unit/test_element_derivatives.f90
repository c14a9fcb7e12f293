!> Derivatives of the forces of elements in parallel by numbers of their law, Iwan's.
!>
!> Between changes of regime forces by events are smooth in these: central differences over 1e-4 and 2e-4, extrapolated, leave the
!> fourth power of the step times fifth derivatives, and 1e-16 of forces of order 1 over it: below 1e-10.
program test_element_derivatives
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_law_laws, only: new_law
  use attrito_contact_state, only: state_stuck, state_slipping
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_model_contacts, only: contact_type
  use attrito_sensitivity_law_derivatives, only: differentiate_law, differentiate_by_sliders
  use attrito_sensitivity_parameters, only: recipe_type, law_numbers, by_tangential_stiffness, by_friction
  use attrito_sensitivity_spring_forces, only: tangential_forces
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, elements = 5, columns = law_numbers + 3
  real(wp), parameter :: numbers(3) = [-0.4_wp, 0.6_wp, real(elements, wp)]
  real(wp), parameter :: step = 1.0e-4_wp, tolerance = 1.0e-9_wp

  if (run_suite('element derivatives', [ &
                test('where some elements slip and others rest they are those of differences', some_slip), &
                test('an element at the end of where it may rest holds its slider', at_an_end), &
                test('sliders of elements that rest are those of differences', by_sliders)], quiet=.false.) > 0) error stop 1

contains

  !> A contact under Iwan's law with changed k_t, mu, chi and beta, whose law the caller deallocates.
  function contact_with(changes) result(contact)
    real(wp), intent(in) :: changes(4)
    type(contact_type) :: contact

    contact = contact_type(tangents=1, tangential_stiffness=3.0_wp + changes(1), normal_stiffness=5.0_wp, &
                           friction_coefficient=0.4_wp + changes(2), preload=1.5_wp)
    contact%law => new_law(2, numbers + [changes(3), changes(4), 0.0_wp])
  end function contact_with

  !> u swings by so much about 0.02, v by 0.05 at twice its frequency.
  pure function motion_of(swing) result(motion)
    real(wp), intent(in) :: swing
    real(wp) :: motion(k, 2)

    motion = 0.0_wp
    motion(1:2, 1) = [0.02_wp, swing]
    motion(5, 2) = 0.05_wp
  end function motion_of

  function quadrature_by_events() result(quadrature)
    type(quadrature_type) :: quadrature

    quadrature%grid = new_grid(harmonics)
  end function quadrature_by_events

  !> Forces and derivatives of the contact as it is.
  subroutine differentiate(motion, slider, forces, change)
    real(wp), intent(in) :: motion(:, :), slider(:)
    type(contact_forces_type), intent(out) :: forces
    real(wp), intent(out) :: change(k, 2, columns)
    type(contact_type) :: contact
    type(quadrature_type) :: quadrature

    contact = contact_with(spread(0.0_wp, 1, 4))
    quadrature = quadrature_by_events()
    allocate (forces%deviation(k, 2))
    call evaluate_contact(contact, quadrature, motion, slider, .false., forces)
    call differentiate_law(contact, recipe_type(2, numbers), quadrature, motion, slider, forces, change)
    deallocate (contact%law)
  end subroutine differentiate

  !> Tangential forces with changed numbers.
  function forces_with(changes, motion, slider) result(force)
    real(wp), intent(in) :: changes(4), motion(:, :), slider(:)
    real(wp) :: force(k, 1)
    type(contact_type) :: contact
    type(contact_forces_type) :: forces

    contact = contact_with(changes)
    allocate (forces%deviation(k, 2))
    call evaluate_contact(contact, quadrature_by_events(), motion, slider, .false., forces)
    force = tangential_forces(contact, motion, forces%deviation)
    deallocate (contact%law)
  end function forces_with

  !> How many elements do not slip?
  integer function resting(swing, slider)
    real(wp), intent(in) :: swing, slider(:)
    type(contact_type) :: contact
    type(contact_forces_type) :: own
    integer :: e

    contact = contact_with(spread(0.0_wp, 1, 4))
    resting = 0
    allocate (own%deviation(k, 2))
    do e = 1, elements
      call evaluate_contact(contact%element(e), quadrature_by_events(), motion_of(swing), slider(2*e - 1:2*e), .false., own)
      if (own%state == state_stuck) resting = resting + 1
    end do
    deallocate (contact%law)
  end function resting

  subroutine some_slip(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: places(4) = [by_tangential_stiffness, by_friction, law_numbers + 1, law_numbers + 2]
    type(contact_forces_type) :: forces
    real(wp) :: change(k, 2, columns), slider(2*elements), slopes(k, 2), changes(4)
    integer :: i, j

    ! The middle of where it may rest, for an element that does
    slider = 0.02_wp
    call differentiate(motion_of(0.12_wp), slider, forces, change)
    call check(error, forces%state == state_slipping, 'nothing slips: the test is void')
    if (allocated(error)) return
    call check(error, resting(0.12_wp, slider) > 0, 'every element slips: the test is void')
    if (allocated(error)) return
    do i = 1, 4
      do j = 1, 2
        changes = 0.0_wp
        changes(i) = j*step
        slopes(:, j:j) = (forces_with(changes, motion_of(0.12_wp), slider) - forces_with(-changes, motion_of(0.12_wp), slider)) &
                         /(2.0_wp*j*step)
      end do
      call check_close(error, change(:, 1, places(i)), (4.0_wp*slopes(:, 1) - slopes(:, 2))/3.0_wp, tolerance, 'derivative')
    end do
    ! The number of elements changes nothing.
    call check_close(error, change(:, 1, law_numbers + 3), spread(0.0_wp, 1, k), tolerance, 'by the number of elements')
  end subroutine some_slip

  !> The slider of the last element is at the upper end of where it may rest, the least of u + r: with less friction it would be
  !> pushed. It is held, so its part of the derivatives is s_e'(u - w_e) k_t.
  subroutine at_an_end(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: instants = 100000
    type(contact_forces_type) :: forces
    type(contact_type) :: contact, element
    real(wp) :: change(k, 2, columns), inside(k, 2, columns), slider(2*elements), motion(k, 2), end_of_rest, phase
    real(wp), parameter :: way = 0.03_wp
    integer :: i

    motion = motion_of(0.12_wp)
    contact = contact_with(spread(0.0_wp, 1, 4))
    element = contact%element(elements)
    end_of_rest = huge(1.0_wp)
    do i = 1, instants
      phase = 2.0_wp*acos(-1.0_wp)*i/instants
      end_of_rest = min(end_of_rest, 0.02_wp + 0.12_wp*cos(phase) + element%friction_coefficient/element%tangential_stiffness &
                        *(1.5_wp + 5.0_wp*0.05_wp*sin(2.0_wp*phase)))
    end do
    slider = 0.02_wp
    ! A little inside, so that rounding does not push it, and less than differences would take
    slider(2*elements - 1) = end_of_rest - 1.0e-9_wp
    call differentiate(motion, slider, forces, change)
    slider(2*elements - 1) = end_of_rest - 1.0e-9_wp - way
    call differentiate(motion, slider, forces, inside)
    associate (share => element%tangential_stiffness/contact%tangential_stiffness)
      ! The mean of the force: a slider that is held farther on pulls in proportion.
      call check_close(error, change(1, 1, by_tangential_stiffness) - inside(1, 1, by_tangential_stiffness), -share*way, tolerance, &
                       'by the stiffness')
      ! s = beta/(1 + beta) of the last element
      call check_close(error, change(1, 1, law_numbers + 2) - inside(1, 1, law_numbers + 2), &
                       -contact%tangential_stiffness*way/(1.0_wp + numbers(2))**2, tolerance, 'by beta')
    end associate
    call check_close(error, change(:, 1, by_friction), inside(:, 1, by_friction), tolerance, 'by friction')
    call check_close(error, change(:, 1, law_numbers + 1), inside(:, 1, law_numbers + 1), tolerance, 'by chi')
    deallocate (contact%law)
  end subroutine at_an_end

  subroutine by_sliders(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact
    type(contact_forces_type) :: forces
    real(wp) :: change(k, 2, 2*elements), moved(2*elements), slider(2*elements), difference(k, 1)
    real(wp) :: unused(k, 2, columns)
    integer :: e

    slider = 0.02_wp
    call differentiate(motion_of(0.12_wp), slider, forces, unused)
    contact = contact_with(spread(0.0_wp, 1, 4))
    call differentiate_by_sliders(contact, quadrature_by_events(), motion_of(0.12_wp), slider, forces, change)
    do e = 1, elements
      moved = 0.0_wp
      moved(2*e - 1) = step
      difference = (forces_with(spread(0.0_wp, 1, 4), motion_of(0.12_wp), slider + moved) &
                    - forces_with(spread(0.0_wp, 1, 4), motion_of(0.12_wp), slider - moved))/(2.0_wp*step)
      call check_close(error, change(:, 1, 2*e - 1), difference(:, 1), tolerance, 'by a slider')
    end do
    deallocate (contact%law)
  end subroutine by_sliders
end program test_element_derivatives
