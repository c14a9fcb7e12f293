!> Iwan's model: Segalman's four parameters are exact for any number of elements, and the energy converges to his closed form.
program test_iwan
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, pi
  use attrito_contact_evaluation, only: quadrature_type, evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_law_laws, only: new_law
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_model_contacts, only: contact_type
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: iwan_law = 2
  !> K_T, and a normal force of 2 that gives F_S = 0.8
  real(wp), parameter :: stiffness = 3.0_wp, friction = 0.4_wp, normal = 2.0_wp, macro_slip = friction*normal
  real(wp), parameter :: chis(3) = [-0.9_wp, -0.5_wp, -0.1_wp], betas(3) = [0.0_wp, 0.2_wp, 3.0_wp]

  if (run_suite('Iwan', [ &
                test('parts sum to one, breaks ascend to phi_max, whatever the parameters', parts), &
                test('the first loading begins with K_T, ends with F_S, and S gives way last', first_loading), &
                test('energy by events is that of each element in closed form', energy), &
                test('energy converges to Segalman''s power law at first order in the number of elements', convergence), &
                test('without cells it is a Coulomb spring', spring)], quiet=.false.) > 0) error stop 1

contains

  function joint(chi, beta, elements) result(contact)
    real(wp), intent(in) :: chi, beta
    integer, intent(in) :: elements
    type(contact_type) :: contact

    contact = contact_type(tangents=1, tangential_stiffness=stiffness, normal_stiffness=1.0_wp, friction_coefficient=friction)
    contact%law => new_law(iwan_law, [chi, beta, real(elements, wp)])
  end function joint

  !> phi_max = F_S/K_T (1 + beta)/(beta + (chi + 1)/(chi + 2))
  pure real(wp) function largest_break(chi, beta)
    real(wp), intent(in) :: chi, beta

    largest_break = macro_slip/stiffness*(1.0_wp + beta)/(beta + (chi + 1.0_wp)/(chi + 2.0_wp))
  end function largest_break

  !> Displacement at which an element slips.
  function break_of(contact, number) result(slips_at)
    type(contact_type), intent(in) :: contact
    integer, intent(in) :: number
    real(wp) :: slips_at
    type(contact_type) :: own

    own = contact%element(number)
    slips_at = own%friction_coefficient*normal/own%tangential_stiffness
  end function break_of

  !> Force of the first loading.
  function loaded(contact, u) result(force)
    type(contact_type), intent(in) :: contact
    real(wp), intent(in) :: u
    real(wp) :: force
    type(contact_type) :: own
    integer :: i

    force = 0.0_wp
    do i = 1, contact%elements()
      own = contact%element(i)
      force = force + own%tangential_stiffness*min(u, break_of(contact, i))
    end do
  end function loaded

  subroutine parts(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact, own
    real(wp) :: sums(2), before
    integer :: i, a, b, n

    do a = 1, size(chis)
      do b = 1, size(betas)
        do n = 2, 302, 100
          contact = joint(chis(a), betas(b), n)
          call check(error, contact%elements() == n .and. contact%is_proportional(), 'elements')
          sums = 0.0_wp
          before = 0.0_wp
          do i = 1, n
            own = contact%element(i)
            sums = sums + [own%tangential_stiffness/stiffness, own%friction_coefficient/friction]
            call check(error, own%elements() == 1 .and. own%tangential_stiffness > 0.0_wp .and. break_of(contact, i) > before, &
                       'breaks')
            before = break_of(contact, i)
          end do
          ! Rounding of 300 differences
          call check_close(error, sums, [1.0_wp, 1.0_wp], 1.0e-13_wp, 'sums')
          if (betas(b) > 0.0_wp) then
            call check_close(error, before/largest_break(chis(a), betas(b)), 1.0_wp, 1.0e-13_wp, 'phi_max')
          else
            call check(error, before < largest_break(chis(a), betas(b)), 'a centre of stiffness beyond phi_max')
          end if
          deallocate (contact%law)
        end do
      end do
    end do
  end subroutine parts

  subroutine first_loading(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact
    real(wp) :: last, step
    integer :: a, b

    do a = 1, size(chis)
      do b = 2, size(betas)
        contact = joint(chis(a), betas(b), 30)
        last = largest_break(chis(a), betas(b))
        step = 1.0e-3_wp*break_of(contact, 1)
        call check_close(error, loaded(contact, step)/step, stiffness, 1.0e-12_wp*stiffness, 'K_T')
        call check_close(error, [loaded(contact, last), loaded(contact, 2.0_wp*last)], [macro_slip, macro_slip], 1.0e-13_wp, 'F_S')
        ! Between the last cell's break and phi_max only the end of the distribution still sticks: S = K_T beta/(1 + beta).
        step = 0.5_wp*(last - break_of(contact, 29))
        call check_close(error, (loaded(contact, last) - loaded(contact, last - step))/step, stiffness*betas(b)/(1.0_wp + betas(b)), &
                         1.0e-10_wp, 'S')
        deallocate (contact%law)
      end do
    end do
  end subroutine first_loading

  !> Energy a period by elements, 4 k phi (a - phi) of each that slips.
  function energy_of_elements(contact, amplitude) result(total)
    type(contact_type), intent(in) :: contact
    real(wp), intent(in) :: amplitude
    real(wp) :: total
    type(contact_type) :: own
    integer :: i

    total = 0.0_wp
    do i = 1, contact%elements()
      own = contact%element(i)
      total = total + 4.0_wp*own%tangential_stiffness*break_of(contact, i)*max(amplitude - break_of(contact, i), 0.0_wp)
    end do
  end function energy_of_elements

  subroutine energy(error)
    type(error_type), allocatable, intent(out) :: error
    type(quadrature_type) :: quadrature
    type(contact_type) :: contact
    type(contact_forces_type) :: forces
    real(wp) :: motion(3, 2), amplitude, slider(80)
    integer :: a, b

    quadrature%grid = new_grid(1)
    do a = 1, size(chis)
      do b = 1, size(betas)
        contact = joint(chis(a), betas(b), 40)
        amplitude = (0.05_wp + 0.5_wp*a)*largest_break(chis(a), betas(b))
        motion = reshape([0.3_wp, amplitude, 0.0_wp, normal, 0.0_wp, 0.0_wp], [3, 2])
        slider = 0.0_wp
        allocate (forces%deviation(3, 2))
        call evaluate_contact(contact, quadrature, motion, slider, .false., forces)
        ! Work of T on u over the period, pi (T_c u_s - T_s u_c); the spring's own part does none.
        call check_close(error, -pi*forces%deviation(3, 1)*amplitude/energy_of_elements(contact, amplitude), 1.0_wp, 1.0e-12_wp, &
                         'energy')
        deallocate (contact%law, forces%deviation)
      end do
    end do
  end subroutine energy

  subroutine convergence(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: amplitudes = 200
    type(contact_type) :: contact
    real(wp) :: distance(3), amplitude, rate, last
    integer :: a, b, i, n

    do a = 1, size(chis)
      do b = 1, size(betas)
        last = largest_break(chis(a), betas(b))
        rate = stiffness*(chis(a) + 1.0_wp)/((1.0_wp + betas(b))*last**(chis(a) + 1.0_wp))
        distance = 0.0_wp
        do n = 1, 3
          contact = joint(chis(a), betas(b), 25*4**n)
          ! Amplitudes of three decades up to phi_max, all beyond the first cells.
          do i = 1, amplitudes
            amplitude = last*10.0_wp**(-3.0_wp*(i - 0.5_wp)/amplitudes)
            distance(n) = distance(n) + (energy_of_elements(contact, amplitude)*(chis(a) + 2.0_wp)*(chis(a) + 3.0_wp) &
                                         /(4.0_wp*rate*amplitude**(chis(a) + 3.0_wp)) - 1.0_wp)**2/amplitudes
          end do
          deallocate (contact%law)
        end do
        distance = sqrt(distance)
        ! Four times the elements: ln^2 alpha falls by four; half of that is left for where amplitudes fall within cells.
        call check(error, all(distance(2:) < distance(:2)/2.0_wp) .and. distance(3) < distance(1)/10.0_wp, 'the order')
        call check(error, distance(1) < 0.02_wp, 'far from the power law')
      end do
    end do
  end subroutine convergence

  subroutine spring(error)
    type(error_type), allocatable, intent(out) :: error
    type(contact_type) :: contact

    ! beta without end leaves nothing to the cells.
    contact = joint(-0.5_wp, 1.0e12_wp, 2)
    call check_close(error, break_of(contact, 2), macro_slip/stiffness, 1.0e-10_wp, 'break')
    call check_close(error, energy_of_elements(contact, 1.0_wp), 4.0_wp*macro_slip*(1.0_wp - macro_slip/stiffness), 1.0e-10_wp, &
                     'energy')
    deallocate (contact%law)
  end subroutine spring
end program test_iwan
