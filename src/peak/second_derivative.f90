!> Second derivative of all contacts' forces: how the Jacobian D changes along a motion t, times motions x.
!>
!> It is exact where the limit of friction is proportional to N (attrito_contact_second_derivative). Elsewhere none is known: it is
!> the central difference of the exact Jacobian along t, whose error is of second order in the step and enters no solution, only
!> the rate of Newton's method.
module attrito_peak_second_derivative
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_contact_evaluation, only: evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_second_derivative, only: differentiate_element_twice
  use attrito_contact_second_derivative_disc, only: start_slider_type
  implicit none
  private
  public :: differentiate_twice

  !> Step of the difference, relative to the motion: its error, step^2, and that of rounding, 1e-16/step, are alike
  real(wp), parameter :: relative_step = 1.0e-5_wp ! derived

contains

  !> D'[t] x at the balance's last evaluation [2 H + 1, rows, ways].
  subroutine differentiate_twice(balance, motion, along, directions, deviation)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Where it was evaluated [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: along, directions(:)
    !> Deviation of contact forces from those of their springs
    real(wp), intent(out) :: deviation(:, :, :)
    real(wp), allocatable :: columns(:, :), product(:, :)
    logical :: done
    integer :: i, k, last, n

    k = size(deviation, 1)
    deviation = 0.0_wp
    do i = 1, size(balance%law)
      associate (law => balance%law(i), forces => balance%forces(i), first => balance%law(i)%first_row)
        if (.not. allocated(forces%jacobian)) cycle
        last = first + law%tangents
        columns = reshape([(directions(n)%motion(:, first:last), n=1, size(directions))], [k*(law%tangents + 1), size(directions)])
        allocate (product, mold=columns)
        done = law%is_proportional()
        if (done) call sum_elements(balance, motion(:, first:last), i, along, directions, columns, product, done)
        if (.not. done) product = difference(balance, motion, i, along, columns)
        do n = 1, size(directions)
          deviation(:, first:last, n) = reshape(product(:, n), [k, law%tangents + 1])
        end do
        deallocate (product)
      end associate
    end do
  end subroutine differentiate_twice

  !> Of one contact, all its elements together; what its normal spring adds is the same of each.
  subroutine sum_elements(balance, motion, contact, along, directions, columns, product, done)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Of its rows [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :)
    !> Number of the contact
    integer, intent(in) :: contact
    !> t and the x, and these of its rows alone [k (tangents + 1), ways]
    type(unknowns_type), intent(in) :: along, directions(:)
    real(wp), intent(in) :: columns(:, :)
    !> [k (tangents + 1), ways]
    real(wp), intent(out) :: product(:, :)
    !> Is it known?
    logical, intent(out) :: done
    type(start_slider_type) :: slider
    real(wp) :: own(size(product, 1), size(product, 2))
    integer :: i, n, tangential

    associate (law => balance%law(contact), forces => balance%forces(contact))
      tangential = size(motion, 1)*law%tangents
      do i = 1, law%elements()
        slider = start_slider_type(given=balance%slider(2*i - 1:2*i, contact), found=forces%slider(2*i - 1:2*i), &
                                   periodic=forces%follows())
        if (slider%periodic) then
          slider%along = along%slider(:2, contact)
          slider%columns = reshape([(directions(n)%slider(:2, contact), n=1, size(directions))], [2, size(directions)])
        end if
        call differentiate_element_twice(law%element(i), balance%quadrature, motion, slider, forces%active, &
                                         along%motion(:, law%first_row:law%first_row + law%tangents), columns, own, done)
        if (.not. done) return
        if (i == 1) then
          product = own
        else
          product(:tangential, :) = product(:tangential, :) + own(:tangential, :)
        end if
      end do
    end associate
  end subroutine sum_elements

  !> (D(d + e t) - D(d - e t)) x/(2 e) of one contact, its slider going with the motion.
  function difference(balance, motion, contact, along, columns) result(product)
    !> Harmonic balance: loads, contacts, receptance and its last residual
    type(balance_type), intent(in) :: balance
    !> Coefficients of relative displacement, by harmonic and row
    real(wp), intent(in) :: motion(:, :)
    !> Number of the contact
    integer, intent(in) :: contact
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: along
    real(wp), intent(in) :: columns(:, :)
    real(wp) :: product(size(columns, 1), size(columns, 2))
    type(contact_forces_type) :: forces
    real(wp), allocatable :: slider(:)
    real(wp) :: step
    integer :: side

    product = 0.0_wp
    associate (law => balance%law(contact), first => balance%law(contact)%first_row, &
               last => balance%law(contact)%first_row + balance%law(contact)%tangents)
      step = norm2(along%motion(:, first:last))
      if (step <= 0.0_wp) return
      step = relative_step*norm2(motion(2:, first:last))/step
      if (step <= 0.0_wp) return
      do side = -1, 1, 2
        slider = balance%slider(:, contact)
        if (balance%forces(contact)%follows()) slider = slider + side*step*along%slider(:, contact)
        forces = contact_forces_type()
        allocate (forces%deviation, mold=balance%forces(contact)%deviation)
        call evaluate_contact(law, balance%quadrature, motion(:, first:last) + side*step*along%motion(:, first:last), slider, &
                              balance%periodic(contact), forces)
        if (allocated(forces%jacobian)) product = product + side/(2.0_wp*step)*matmul(forces%jacobian, columns)
      end do
    end associate
  end function difference
end module attrito_peak_second_derivative
