!> How the forces along a motion t change with a parameter that moves the point by d' and contacts by their columns: the derivative of
!> J t, J = K_c + D the total Jacobian.
!>
!> $$ (J t)' = D'[t] (d' + s) + J \, s'[t] + \frac{\mu'}{\mu} (J t)_t, \qquad
!>    s = \left( \left( \frac{k_t'}{k_t} - \frac{\mu'}{\mu} \right) u, \;
!>               \frac{k_n'}{k_n} (v - \mathrm{gap}) - \mathrm{gap}' + \frac{N_p'}{k_n} \right) $$
!>
!> N_p + k_n (v - gap) holds k_n, gap and N_p, so they are a motion s of the normal. Tangential forces depend on k_t only by
!> k_t (u - w) and are homogeneous of the first degree in k_t and mu (attrito_sensitivity_law_derivatives): these are a motion of the
!> tangents, and what is left. D' does not feel a constant tangential displacement: w leaves no trace. By numbers that elements of a
!> law are made of each element has its own k_t and mu (attrito_sensitivity_element_derivatives).
module attrito_peak_jacobian_rates
  use attrito_core_kinds, only: wp
  use attrito_balance_harmonic_balance, only: balance_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_law_contact_law, only: element_type
  use attrito_contact_second_derivative, only: differentiate_element_twice
  use attrito_contact_second_derivative_disc, only: start_slider_type
  use attrito_model_contacts, only: contact_type
  use attrito_newton_linearised_step, only: follow_sliders
  use attrito_peak_second_derivative, only: differentiate_twice
  use attrito_sensitivity_element_derivatives, only: evaluate_one, part_rates
  use attrito_sensitivity_parameters, only: by_parameters_type, recipe_type, law_numbers, by_tangential_stiffness, &
                                            by_normal_stiffness, by_friction, by_gap, by_preload
  use attrito_sensitivity_point_rates, only: inquiry_type
  use attrito_sensitivity_spring_forces, only: forces_by_motion
  implicit none
  private
  public :: jacobian_rate

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
                 own => parameter%laws(:, balance%first_contact - 1 + i))
        direction%motion(:, first:last) = direction%motion(:, first:last) + shift_of(balance%law(i), own, motion(:, first:last))
        change(:, first:last) = explicit_rate(balance%law(i), balance%forces(i), own, along(:, first:last))
      end associate
    end do
    call follow_sliders(balance, 0.0_wp*balance%slider, way)
    call follow_sliders(balance, 0.0_wp*balance%slider, direction)
    call differentiate_twice(balance, motion, way, [direction], twice)
    change = change + twice(:, :, 1)
    do i = 1, size(balance%law)
      associate (first => balance%law(i)%first_row, last => balance%law(i)%first_row + balance%law(i)%tangents, &
                 own => parameter%laws(:, balance%first_contact - 1 + i), &
                 recipe => inquiry%recipes(balance%first_contact - 1 + i))
        if (balance%law(i)%elements() == 1 .or. .not. any(abs(own(law_numbers + 1:)) > 0.0_wp)) cycle
        change(:, first:last) = change(:, first:last) + rate_of_elements(balance, i, recipe, own, motion(:, first:last), &
                                                                         along(:, first:last))
      end associate
    end do
  end function jacobian_rate

  !> s of one contact [2 H + 1, rows].
  pure function shift_of(law, rates, motion) result(shift)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of its columns
    real(wp), intent(in) :: rates(:)
    !> d [2 H + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    real(wp) :: shift(size(motion, 1), size(motion, 2))

    shift = 0.0_wp
    associate (n => law%tangents, kn => law%normal_stiffness)
      shift(:, :n) = (rates(by_tangential_stiffness)/law%tangential_stiffness - of_friction(law, rates))*motion(:, :n)
      shift(:, n + 1) = rates(by_normal_stiffness)/kn*motion(:, n + 1)
      shift(1, n + 1) = shift(1, n + 1) - rates(by_normal_stiffness)/kn*law%gap - rates(by_gap) + rates(by_preload)/kn
    end associate
  end function shift_of

  !> mu'/mu.
  pure real(wp) function of_friction(law, rates) result(part)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of its columns
    real(wp), intent(in) :: rates(:)

    part = 0.0_wp
    if (abs(rates(by_friction)) > 0.0_wp) part = rates(by_friction)/law%friction_coefficient
  end function of_friction

  !> J s'[t] + mu'/mu (J t)_t, of one contact [2 H + 1, rows].
  pure function explicit_rate(law, forces, rates, along) result(change)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of its last evaluation
    type(contact_forces_type), intent(in) :: forces
    !> Of its columns
    real(wp), intent(in) :: rates(:)
    !> t [2 H + 1, rows]
    real(wp), intent(in) :: along(:, :)
    real(wp) :: change(size(along, 1), size(along, 2)), part(size(along, 1), size(along, 2))

    associate (n => law%tangents, friction => of_friction(law, rates))
      part(:, :n) = (rates(by_tangential_stiffness)/law%tangential_stiffness - friction)*along(:, :n)
      part(:, n + 1) = rates(by_normal_stiffness)/law%normal_stiffness*along(:, n + 1)
      change = forces_by_motion(law, forces, part)
      part = friction*forces_by_motion(law, forces, along)
      change(:, :n) = change(:, :n) + part(:, :n)
    end associate
  end function explicit_rate

  !> By numbers that the elements of a contact are made of [2 H + 1, rows].
  function rate_of_elements(balance, contact, recipe, rates, motion, along) result(change)
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
    real(wp) :: change(size(motion, 1), size(motion, 2))
    type(element_type), allocatable :: parts(:), one(:)
    type(contact_forces_type) :: own
    type(contact_type) :: element
    type(start_slider_type) :: slider
    real(wp), allocatable :: numbers(:)
    real(wp) :: twice(size(motion), 1), shift(size(motion, 1), size(motion, 2))
    integer :: e, i
    logical :: done

    change = 0.0_wp
    associate (law => balance%law(contact), n => balance%law(contact)%tangents)
      parts = spread(element_type(0.0_wp, 0.0_wp), 1, law%elements())
      do i = 1, size(recipe%numbers)
        if (.not. abs(rates(law_numbers + i)) > 0.0_wp) cycle
        one = part_rates(law, recipe, i)
        parts%stiffness = parts%stiffness + rates(law_numbers + i)*one%stiffness
        parts%slip_force = parts%slip_force + rates(law_numbers + i)*one%slip_force
      end do
      do e = 1, law%elements()
        element = law%element(e)
        numbers = spread(0.0_wp, 1, law_numbers)
        numbers(by_tangential_stiffness) = parts(e)%stiffness*element%tangential_stiffness
        numbers(by_friction) = parts(e)%slip_force*element%friction_coefficient
        call evaluate_one(law, e, balance%quadrature, motion, balance%slider(:, contact), balance%forces(contact), own)
        ! The normal spring is that of all elements together: it changes with none of these.
        change = change + explicit_rate(element, own, numbers, along)
        if (.not. allocated(own%jacobian)) cycle
        shift = shift_of(element, numbers, motion)
        slider = start_slider_type(given=balance%slider(2*e - 1:2*e, contact), found=own%slider(:2))
        call differentiate_element_twice(element, balance%quadrature, motion, slider, own%active, along, &
                                         reshape(shift, [size(shift), 1]), twice, done)
        change = change + reshape(twice, shape(change))
      end do
      change(:, n + 1) = 0.0_wp
    end associate
  end function rate_of_elements
end module attrito_peak_jacobian_rates
