!> One step of a contact's law at given displacement: predictor and corrector, with the derivative of the forces.
!>
!> Predictor T^P = k_t (u - w) with the slider of the step before; corrector |T| <= F(N), the slip force of the contact's law (mu N
!> unless another is given), by return along T^P (one tangent: a clamp; two: radial), lift-off T = 0 and w = u. Radial return is of
!> first order where the direction of slip turns; a contact with two tangents that slipped already is returned along the mean of its
!> old and new direction, e_n and e_{n+1},
!>   w_{n+1} = w_n + s (e_n + e_{n+1}), |z_{n+1}| = r:  s = (|z|^2 - r^2)/(2 (r + z.e_n)), z = u_{n+1} - w_n,
!> which is of second order and still in closed form.
!> Source: Zucca & Firrone 2014, eqs. (6)-(8), doi:10.1016/j.jsv.2013.09.032.
module attrito_integrate_return_map
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: return_contacts, slip_directions

contains

  !> Forces of all contacts less their stuck springs, g, and what else is asked for.
  subroutine return_contacts(system, displacement, slider, direction, g, stiffness, new_slider, regime)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Of every row [rows], and sliders before the step [2, contacts]
    real(wp), intent(in) :: displacement(:), slider(:, :)
    !> Direction of slip at the beginning of the step, zero where it did not slip [2, contacts]
    real(wp), intent(in) :: direction(:, :)
    !> [rows]
    real(wp), intent(out) :: g(:)
    !> Its derivative [3, rows]: by the displacements of the contact's own rows
    real(wp), intent(out) :: stiffness(:, :)
    !> Sliders after the step [2, contacts], and regimes [contacts]
    real(wp), intent(out) :: new_slider(:, :)
    !> Regime: stick, slip or open
    integer, intent(out) :: regime(:)
    integer :: i

    new_slider = 0.0_wp
    do i = 1, size(system%law)
      associate (first => system%law(i)%first_row, last => system%law(i)%first_row + system%law(i)%tangents)
        call return_one(system%law(i), displacement(first:last), slider(:, i), direction(:, i), g(first:last), &
                        stiffness(:, first:last), new_slider(:, i), regime(i))
      end associate
    end do
  end subroutine return_contacts

  !> Of one contact, whose rows are its tangents and its normal.
  subroutine return_one(law, displacement, slider, direction, g, stiffness, new_slider, regime)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Of its rows [tangents + 1]; slider before the step, and direction of slip at its beginning [2]
    real(wp), intent(in) :: displacement(:), slider(:), direction(:)
    !> Forces less those of stuck springs [tangents + 1], and their derivative by the displacements [3, tangents + 1]
    real(wp), intent(out) :: g(:), stiffness(:, :)
    !> Slider after the step [2]
    real(wp), intent(inout) :: new_slider(:)
    !> Regime: stick, slip or open
    integer, intent(out) :: regime
    real(wp) :: z(2), normal(1), force(1), slope(1), r
    integer :: a

    associate (n => law%tangents, last => law%tangents + 1)
      stiffness = 0.0_wp
      z(:n) = displacement(:n) - slider(:n)
      normal = law%normal_force(displacement(last:last))
      call law%slip_force(normal, force, slope)
      r = force(1)/law%tangential_stiffness
      g(last) = law%normal_force(0.0_wp)
      new_slider(:n) = slider(:n)
      if (normal(1) < law%touching_force(displacement(last:last))) then
        regime = regime_open
        new_slider(:n) = displacement(:n)
        g(:n) = -law%tangential_stiffness*displacement(:n)
        g(last) = -law%normal_stiffness*displacement(last)
        do a = 1, n
          stiffness(a, a) = -law%tangential_stiffness
        end do
        stiffness(last, last) = -law%normal_stiffness
      else if (norm2(z(:n)) <= r) then
        regime = regime_stick
        g(:n) = -law%tangential_stiffness*slider(:n)
      else
        regime = regime_slip
        call slip(law, displacement(:n), z, r, slope(1), direction, g, stiffness, new_slider)
      end if
    end associate
  end subroutine return_one

  !> A contact that slips: its tangential force is returned to the limit, and the slider follows.
  subroutine slip(law, u, z, r, slope, direction, g, stiffness, new_slider)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Tangential displacements [tangents]; these less the slider; slip radius, the limit over kt
    real(wp), intent(in) :: u(:), z(2), r
    !> Derivative of the limit by the normal force; direction of slip at the beginning of the step [2]
    real(wp), intent(in) :: slope, direction(:)
    !> Forces less those of stuck springs [tangents + 1], their derivative [3, tangents + 1], and the slider after the step [2]
    real(wp), intent(inout) :: g(:), stiffness(:, :), new_slider(:)
    real(wp) :: e(2), moved(2), by_z(2, 2), by_r(2)
    integer :: a

    e = direction
    associate (n => law%tangents)
      if (n == 1 .or. dot_product(e(:n), z(:n)) <= 0.0_wp) then
        call return_radially(z(:n), r, moved(:n), by_z(:n, :n), by_r(:n))
      else
        call return_along_the_way(z, r, e, moved, by_z, by_r)
      end if
      new_slider(:n) = u - moved(:n)
      g(:n) = law%tangential_stiffness*(moved(:n) - u)
      do a = 1, n
        stiffness(:n, a) = law%tangential_stiffness*by_z(a, :n)
        stiffness(a, a) = stiffness(a, a) - law%tangential_stiffness
        stiffness(n + 1, a) = slope*law%normal_stiffness*by_r(a)
      end do
    end associate
  end subroutine slip

  !> z <- r z/|z|, with its derivatives by z and r.
  pure subroutine return_radially(z, r, moved, by_z, by_r)
    !> Displacement less slider; slip radius, mu N / kt
    real(wp), intent(in) :: z(:), r
    !> Displacement less slider, returned; its derivatives by z; its derivatives by r
    real(wp), intent(out) :: moved(:), by_z(:, :), by_r(:)
    real(wp) :: distance
    integer :: a

    distance = norm2(z)
    by_r = z/distance
    moved = r*by_r
    do a = 1, size(z)
      by_z(:, a) = -(r/distance)*by_r(a)*by_r
      by_z(a, a) = by_z(a, a) + r/distance
    end do
  end subroutine return_radially

  !> z <- r (z - s e)/(r + s), s = (|z|^2 - r^2)/(2 (r + z.e)): slip along the mean of old and new direction.
  pure subroutine return_along_the_way(z, r, e, moved, by_z, by_r)
    !> Displacement less slider; slip radius, mu N / kt; direction of slip before
    real(wp), intent(in) :: z(2), r, e(2)
    !> Displacement less slider, returned; its derivatives by z; its derivatives by r
    real(wp), intent(out) :: moved(2), by_z(2, 2), by_r(2)
    real(wp) :: s, s_by_z(2), s_by_r, d, way(2)
    integer :: a

    d = r + dot_product(z, e)
    s = 0.5_wp*(dot_product(z, z) - r**2)/d
    s_by_z = (z - s*e)/d
    s_by_r = -(r + s)/d
    way = (z - s*e)/(r + s)
    moved = r*way
    by_r = way - r*(e*s_by_r + way*(1.0_wp + s_by_r))/(r + s)
    do a = 1, 2
      by_z(:, a) = -r*(e + way)*s_by_z(a)/(r + s)
      by_z(a, a) = by_z(a, a) + r/(r + s)
    end do
  end subroutine return_along_the_way

  !> Directions of slip as contacts stand, zero where they do not slip or have one tangent [2, contacts].
  pure function slip_directions(system, displacement, slider, regime) result(direction)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement of the coordinates; sliders, as the contacts have them
    real(wp), intent(in) :: displacement(:), slider(:, :)
    !> Regime: stick, slip or open
    integer, intent(in) :: regime(:)
    real(wp) :: direction(2, size(regime))
    integer :: i

    direction = 0.0_wp
    do i = 1, size(regime)
      if (system%law(i)%tangents == 1 .or. regime(i) /= regime_slip) cycle
      associate (first => system%law(i)%first_row)
        direction(:, i) = displacement(first:first + 1) - slider(:, i)
        direction(:, i) = direction(:, i)/max(norm2(direction(:, i)), tiny(1.0_wp))
      end associate
    end do
  end function slip_directions
end module attrito_integrate_return_map
