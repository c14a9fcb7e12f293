!> Work counted rather than timed: floating-point operations by formulas, the same on every machine. With k = 2 H + 1 coefficients a
!> row, m rows of contacts, n generalised coordinates, and a active unknowns:
!>
!>     contact by events            168 k^2                 (8 intervals of a period, Jacobian included; its forces alone a quarter)
!>     contact with two tangents by events
!>                                  n (12 k^2 + 48 k + 600), with n = 5 k nodes of slip; its forces alone, by rough
!>                                  rules, n (7 k + 600), with n = 2 k
!>     residual                     6 k m n
!>     linearised step              4 (a/k) a n + 2 a^3 / 3, with factors kept 2 a^2, by iterations 4 a n each
!>     factors of a block of u unknowns
!>                                  4 (u/k) u n + 2 u^3 / 3
!>
!> A contact that sticks all over the period counts nothing; one of several elements in parallel counts that much for each.
module attrito_balance_work
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: contact_work, residual_work, step_work

contains

  !> Forces of one contact that slips or opens, and their Jacobian.
  pure real(wp) function contact_work(law, coefficients, without_jacobian)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of a row of the motion
    integer, intent(in) :: coefficients
    logical, intent(in) :: without_jacobian
    real(wp) :: k

    k = coefficients
    if (law%tangents == 1) then
      contact_work = merge(42.0_wp, 168.0_wp, without_jacobian)*k**2
    else if (without_jacobian) then
      contact_work = 2.0_wp*k*(7.0_wp*k + 600.0_wp)
    else
      contact_work = 5.0_wp*k*(12.0_wp*k**2 + 48.0_wp*k + 600.0_wp)
    end if
    contact_work = law%elements()*contact_work
  end function contact_work

  !> From rows to generalised coordinates and back, the derivative by omega included.
  pure real(wp) function residual_work(coefficients, rows, coordinates)
    !> Number of them, over all ranks
    integer, intent(in) :: coefficients, rows, coordinates

    residual_work = 6.0_wp*coefficients*real(rows, wp)*coordinates
  end function residual_work

  !> One linearised step on so many active unknowns; `iterations`: of GMRES, 0 where the system is eliminated.
  pure real(wp) function step_work(unknowns, coefficients, coordinates, iterations, is_factored)
    !> Number of them, over all ranks
    integer, intent(in) :: unknowns, coefficients, coordinates, iterations
    !> Do factors of the elimination serve that were made before?
    logical, intent(in) :: is_factored
    real(wp) :: a

    a = unknowns
    if (iterations > 0) then
      step_work = 4.0_wp*a*coordinates*iterations
    else if (is_factored) then
      step_work = 2.0_wp*a**2
    else
      step_work = 4.0_wp*a**2/coefficients*coordinates + 2.0_wp/3.0_wp*a**3
    end if
  end function step_work
end module attrito_balance_work
