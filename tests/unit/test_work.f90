!> Operations counted by formulas, against what is computed.
program test_work
  use attrito_balance_work, only: contact_work
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use testing, only: test, run_suite, check_close
  implicit none

  if (run_suite('work', [ &
                test('forces alone by events are a quarter of what the Jacobian comes to', by_events)], quiet=.false.) > 0) then
    error stop 1
  end if

contains

  subroutine by_events(error)
    type(error_type), allocatable, intent(out) :: error

    call check_close(error, 4.0_wp*work_of(1, 15, .true.), work_of(1, 15, .false.), 0.0_wp, 'one tangent')
    ! Nodes of slip in proportion to k, and at each all coefficients: without Jacobian no k^3 is left.
    call check_close(error, work_of(2, 15, .true.), 2.0_wp*15*(7*15 + 600), 0.0_wp, 'two tangents')
    call check_close(error, work_of(2, 15, .false.), 5.0_wp*15*(12*15**2 + 48*15 + 600), 0.0_wp, 'two tangents')
  end subroutine by_events

  real(wp) function work_of(tangents, k, without_jacobian)
    integer, intent(in) :: tangents, k
    logical, intent(in) :: without_jacobian

    work_of = contact_work(contact_type(tangents=tangents, tangential_stiffness=1.0_wp, normal_stiffness=1.0_wp, &
                                        friction_coefficient=0.5_wp), k, without_jacobian)
  end function work_of
end program test_work
