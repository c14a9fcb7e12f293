!> How the forces along a motion t change with a parameter that moves the point by d' and contacts by their columns: the derivative of
!> J t, J = K_c + D the total Jacobian.
!>
!> $$ (J t)' = D'[t] (d' + s) + J \, s'[t] + \sum_p p' \frac{\partial J}{\partial p} t $$
!>
!> N_p + k_n (v - gap) holds k_n, gap and N_p, so they are a motion s of the normal, as sliders are one of the tangents. The sum is
!> over k_t, mu and what else a law is made of: central differences of the exact Jacobian.
module attrito_peak_jacobian_rates
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_contact_evaluation, only: evaluate_contact
  use attrito_contact_forces, only: contact_forces_type
  use attrito_model_contacts, only: contact_type
  use attrito_peak_second_derivative, only: differentiate_twice
  use attrito_sensitivity_law_derivatives, only: forces_by_motion, beside
  use attrito_sensitivity_parameters, only: by_parameters_type, recipe_type, law_numbers, by_tangential_stiffness, &
                                            by_normal_stiffness, by_friction, by_gap, by_preload
  use attrito_sensitivity_point_rates, only: inquiry_type
  implicit none
  private
  public :: jacobian_rate

  !> Part of a number that it is changed by for a central difference of a Jacobian, whose rounding is some 1e-13
  real(wp), parameter :: step = 1.0e-5_wp ! derived

contains

  !> (J t)' of this rank's rows [2 H + 1, rows].
  function jacobian_rate(balance, inquiry, parameter, along, moved) result(change)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(inout) :: balance
    !> What is asked for
    type(inquiry_type), intent(in) :: inquiry
    !> What the parameter changes
    type(by_parameters_type), intent(in) :: parameter
    !> t and d' [2 H + 1, rows]
    real(wp), intent(in) :: along(:, :), moved(:, :)
    real(wp) :: change(size(along, 1), size(along, 2))
    real(wp), allocatable :: motion(:, :)
    type(unknowns_type) :: way, direction
    real(wp) :: twice(size(along, 1), size(along, 2), 1)
    integer :: i

    motion = balance%recover(balance%response)
    way = new_unknowns(shape(along), shape(balance%slider))
    direction = way
    way%motion = along
    direction%motion = moved
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents, &
                 own => parameter%laws(:, balance%first_contact - 1 + i), &
                 recipe => inquiry%recipes(balance%first_contact - 1 + i))
        direction%motion(:, first:last) = direction%motion(:, first:last) &
                                          + shift_of(balance%law(i), own, inquiry%numbers, motion(:, first:last))
        change(:, first:last) = explicit_rate(balance, i, recipe, own, motion(:, first:last), along(:, first:last))
      end associate
    end do
    call differentiate_twice(balance, motion, way, [direction], twice)
    change = change + twice(:, :, 1)
  end function jacobian_rate

  !> s of one contact [2 H + 1, rows].
  pure function shift_of(law, rates, numbers, motion) result(shift)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of its columns; how many are further numbers
    real(wp), intent(in) :: rates(:)
    integer, intent(in) :: numbers
    !> [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: shift(size(motion, 1), size(motion, 2))
    integer :: t

    shift = 0.0_wp
    associate (normal => law%tangents + 1, kn => law%normal_stiffness)
      shift(:, normal) = rates(by_normal_stiffness)/kn*motion(:, normal)
      shift(1, normal) = shift(1, normal) - rates(by_normal_stiffness)/kn*law%gap - rates(by_gap) + rates(by_preload)/kn
    end associate
    if (size(rates) == law_numbers + numbers .or. law%elements() > 1) return
    do t = 1, law%tangents
      shift(1, t) = -rates(law_numbers + numbers + t)
    end do
  end function shift_of

  !> J s'[t] and the differences, of one contact [2 H + 1, rows].
  function explicit_rate(balance, contact, recipe, rates, motion, along) result(change)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    !> Number of the contact
    integer, intent(in) :: contact
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> Of its columns
    real(wp), intent(in) :: rates(:)
    !> d and t [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :), along(:, :)
    real(wp) :: change(size(motion, 1), size(motion, 2)), part(size(motion, 1), size(motion, 2)), reach
    type(contact_type) :: other
    integer :: column, side

    associate (law => balance%law(contact), forces => balance%forces(contact), normal => balance%law(contact)%tangents + 1)
      part = 0.0_wp
      part(:, normal) = rates(by_normal_stiffness)/law%normal_stiffness*along(:, normal)
      change = forces_by_motion(law, forces, part)
      if (.not. allocated(forces%jacobian)) then
        ! It holds its slider, at whose limit other numbers would make it slide: its springs alone change.
        change(:, :law%tangents) = change(:, :law%tangents) + rates(by_tangential_stiffness)*along(:, :law%tangents)
        return
      end if
      do column = 1, law_numbers + size(recipe%numbers)
        if (any(column == [by_normal_stiffness, by_gap, by_preload]) .or. .not. abs(rates(column)) > 0.0_wp) cycle
        reach = step*scale_of(law, recipe, column)
        do side = -1, 1, 2
          other = beside(law, recipe, column, side*reach)
          change = change + side*rates(column)/(2.0_wp*reach)*product_with(balance, contact, other, motion, along)
          if (column > law_numbers) deallocate (other%law)
        end do
      end do
    end associate
  end function explicit_rate

  !> What a number of a contact is changed in proportion to.
  pure real(wp) function scale_of(law, recipe, column)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> What its law is made of
    type(recipe_type), intent(in) :: recipe
    !> Number of its law, or beyond these one of its recipe
    integer, intent(in) :: column

    scale_of = law%tangential_stiffness
    if (column == by_friction) scale_of = law%friction_coefficient
    if (column > law_numbers) scale_of = abs(recipe%numbers(column - law_numbers))
    if (.not. scale_of > 0.0_wp) scale_of = 1.0_wp
  end function scale_of

  !> J x of a contact with other numbers at the same motion [2 H + 1, rows].
  function product_with(balance, contact, other, motion, direction) result(product)
    !> Harmonic balance, evaluated at the point
    type(balance_type), intent(in) :: balance
    !> Number of the contact
    integer, intent(in) :: contact
    !> The contact with other numbers
    type(contact_type), intent(in) :: other
    !> d and x [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :), direction(:, :)
    real(wp) :: product(size(direction, 1), size(direction, 2))
    type(contact_forces_type) :: forces

    allocate (forces%deviation, mold=balance%forces(contact)%deviation)
    call evaluate_contact(other, balance%quadrature, motion, balance%slider(:, contact), balance%forces(contact)%periodic, forces)
    product = forces_by_motion(other, forces, direction)
  end function product_with
end module attrito_peak_jacobian_rates
