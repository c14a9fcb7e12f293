!> Forces of a contact at instants of a period: their Fourier coefficients are those of the contact's forces over the period.
program test_instants
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_trigonometric, only: basis_at
  use attrito_contact_disc_rules, only: new_disc_rules
  use attrito_contact_evaluation, only: evaluate_contact, quadrature_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_instants, only: forces_at_instants
  use attrito_contact_law_laws, only: new_law
  use attrito_contact_state, only: state_shaken_down, state_slipping, state_open
  use attrito_contact_trigonometric_roots, only: new_grid
  use attrito_model_contacts, only: contact_type
  use random_discs, only: motion_of
  use testing, only: test, run_suite, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, k = 2*harmonics + 1, instants = 2**14

  if (run_suite('instants', [ &
                test('forces along one tangent at instants add up to those of the period', along_one), &
                test('forces along two tangents at instants add up to those of the period', along_two)], &
                quiet=.false.) > 0) error stop 1

contains

  subroutine along_one(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, 1)
  end subroutine along_one

  subroutine along_two(error)
    type(error_type), allocatable, intent(out) :: error

    call compare(error, 2)
  end subroutine along_two

  !> In contact, through landing, at rest and open; by Coulomb's law and by pressure.
  subroutine compare(error, tangents)
    type(error_type), allocatable, intent(inout) :: error
    integer, intent(in) :: tangents
    ! Sums of a function with kinks at as many instants: (2 pi/J)^2/12 of their size, and jumps of landing less than that
    real(wp), parameter :: tolerance = 2.0e-7_wp
    type(contact_type) :: law
    type(contact_forces_type) :: forces
    type(quadrature_type) :: quadrature
    real(wp), dimension(instants, tangents + 1) :: displacement, force
    real(wp) :: motion(k, 3), own(k, tangents + 1), summed(k, tangents + 1), basis(k), slider(2)
    integer :: j, seed, met(0:3)

    quadrature = quadrature_type(grid=new_grid(2*harmonics), discs=new_disc_rules(harmonics), order=2)
    law = contact_type(tangents=tangents, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, friction_coefficient=0.4_wp)
    slider = merge([0.3_wp, -0.2_wp], [0.3_wp, 0.0_wp], tangents == 2)
    met = 0
    do seed = 1, 24
      motion = motion_of(harmonics, seed, merge(0.3_wp, 2.0_wp, seed > 20), merge(1.6_wp, 0.3_wp, modulo(seed, 2) == 0))
      if (seed == 24) motion(1, 3) = -9.0_wp
      if (seed == 13) law%law => new_law(1, [2.0_wp, 0.0_wp, 0.6_wp, 0.5_wp, 0.4_wp, 1.0_wp, 0.3_wp])
      own = motion(:, 3 - tangents:)
      if (allocated(forces%deviation)) deallocate (forces%deviation)
      allocate (forces%deviation(k, tangents + 1))
      call evaluate_contact(law, quadrature, own, slider, .false., forces)
      met(forces%state) = met(forces%state) + 1
      call forces_at_instants(law, own, slider, displacement, force)
      summed = 0.0_wp
      do j = 1, instants
        basis = basis_at(two_pi*(j - 1)/instants, harmonics)
        summed = summed + spread(2.0_wp/instants*basis, 2, tangents + 1)*spread(force(j, :), 1, k)
      end do
      summed(1, :) = 0.5_wp*summed(1, :)
      own(:, :tangents) = 3.0_wp*own(:, :tangents)
      own(:, tangents + 1) = 5.0_wp*own(:, tangents + 1)
      call check_close(error, summed, forces%deviation + own, tolerance, 'forces')
    end do
    call check(error, met(state_slipping) > 10 .and. met(state_shaken_down) > 0 .and. met(state_open) == 1, 'the test is void')
    deallocate (law%law)
  end subroutine compare
end program test_instants
