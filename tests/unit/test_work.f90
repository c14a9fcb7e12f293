!> Operations counted by formulas, against what is computed.
program test_work
  use attrito_balance_work, only: contact_work
  use attrito_contact_evaluation, only: quadrature_type
  use attrito_core_errors, only: error_type
  use attrito_contact_fourier, only: new_fourier
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use testing, only: test, run_suite, check_close
  implicit none

  integer, parameter :: samples = 96

  if (run_suite('work', [ &
                test('forces alone by samples are two dense products a row', by_samples), &
                test('forces alone by events are a quarter of what the Jacobian comes to', by_events)], quiet=.false.) > 0) then
    error stop 1
  end if

contains

  !> Motion to samples and forces to coefficients, 2 k J operations each, of every row; the Jacobian has as many columns.
  subroutine by_samples(error)
    type(error_type), allocatable, intent(out) :: error
    type(quadrature_type) :: quadrature
    integer :: tangents, k

    do tangents = 1, 2
      do k = 3, 43, 20
        quadrature%fourier = new_fourier(k/2, samples)
        call check_close(error, work_of(tangents, k, quadrature, .true.), 4.0_wp*k*samples*(tangents + 1), 0.0_wp, 'forces')
        call quadrature%fourier%destroy()
      end do
    end do
  end subroutine by_samples

  subroutine by_events(error)
    type(error_type), allocatable, intent(out) :: error
    type(quadrature_type) :: quadrature

    quadrature%by_events = .true.
    call check_close(error, 4.0_wp*work_of(1, 15, quadrature, .true.), work_of(1, 15, quadrature, .false.), 0.0_wp, 'one tangent')
    ! Nodes of slip in proportion to k, and at each all coefficients: without Jacobian no k^3 is left.
    call check_close(error, work_of(2, 15, quadrature, .true.), 2.0_wp*15*(7*15 + 600), 0.0_wp, 'two tangents')
    call check_close(error, work_of(2, 15, quadrature, .false.), 5.0_wp*15*(12*15**2 + 48*15 + 600), 0.0_wp, 'two tangents')
  end subroutine by_events

  real(wp) function work_of(tangents, k, quadrature, without_jacobian)
    integer, intent(in) :: tangents, k
    type(quadrature_type), intent(in) :: quadrature
    logical, intent(in) :: without_jacobian

    work_of = contact_work(contact_type(tangents=tangents, tangential_stiffness=1.0_wp, normal_stiffness=1.0_wp, &
                                        friction_coefficient=0.5_wp), k, quadrature, without_jacobian)
  end function work_of
end program test_work
