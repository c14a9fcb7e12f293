!> The exact motion between two events as a Taylor series: the model is linear there, so its coefficients obey a recursion,
!>
!> $$ (k+1)(k+2)\, p_{k+2} = f_k - \Lambda p_k - (k+1) D p_{k+1} - \Phi^T B^T g_k(p_k) $$
!>
!> with g_k the contact forces less their stuck springs: stick (-k_t w, N_p - k_n gap) at k = 0 and nothing after; slip
!> mu N_k side - k_t u_k, along two tangents mu (N e)_k - k_t u_k with the series of the direction, the only nonlinear ones
!> (`attrito_integrate_slip_direction`); open -k_t u_k, -k_n v_k. While all contacts are open Lambda p + Phi^T B^T g is
!> Phi^T K Phi p, which is small where contacts are stiff: computed as such it allows steps of the open structure's own time. A step
!> is as long as its last coefficients stay below rounding. Unlike modal exponentials it needs no eigenvectors for each combination
!> of contact states (unsymmetric, at times defective; four to the power of the contacts of them), no care at resonance, and costs the
!> same just after an event.
module attrito_integrate_taylor
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_loading, only: loading_type, expand_load
  use attrito_integrate_polynomial, only: value
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_slip_direction, only: has_just_landed, follows_at_once, extend_direction
  use attrito_integrate_state, only: state_type, normal_force
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: degree, expand, step_length, move_to

  !> Of the polynomials; with steps of 2 to 3 over the highest angular frequency, rounding is reached
  integer, parameter :: degree = 24 ! derived
  !> Longest step over the fastest mode that moves: beyond, terms of the series cancel to more than a digit
  real(wp), parameter :: longest = 4.0_wp ! derived

contains

  !> All polynomials of a segment from a state on.
  pure subroutine expand(system, loading, state, segment)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment
    logical :: flies
    integer :: k

    flies = allocated(system%flight) .and. all(state%regime == regime_open)
    segment%pace = merge(system%flight_pace, 1.0_wp, flies)
    segment%cycle = state%cycle
    segment%theta = state%theta
    segment%regime = state%regime
    segment%side = state%side
    call begin_directions(system, state, segment)
    call expand_load(loading, state%cycle, state%theta, segment%load)
    associate (p => segment%motion)
      p(:, 0) = state%motion
      p(:, 1) = state%rate
      do k = 0, degree - 2
        p(:, k + 2) = segment%load(:, k) - (k + 1)*system%damping*p(:, k + 1)
        if (allocated(system%coupling)) p(:, k + 2) = p(:, k + 2) - (k + 1)*matmul(system%coupling, p(:, k + 1))
        call find_forces(system, state, segment, k)
        if (flies) then
          p(:, k + 2) = p(:, k + 2) - matmul(system%flight, p(:, k))
        else
          p(:, k + 2) = p(:, k + 2) - system%eigenvalues*p(:, k)
          call push(system, state, segment, k)
        end if
        p(:, k + 2) = p(:, k + 2)/((k + 1)*(k + 2))
      end do
    end associate
    call find_forces(system, state, segment, degree - 1)
    call find_forces(system, state, segment, degree)
  end subroutine expand

  !> How directions of slip along two tangents begin.
  pure subroutine begin_directions(system, state, segment)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment
    real(wp) :: rate(2), radius, growth
    integer :: i

    segment%angle(0, :) = state%angle
    segment%lands = .false.
    segment%small = .false.
    segment%angle(degree, :) = 0.0_wp
    segment%direction(degree, :, :) = 0.0_wp
    do i = 1, size(system%law)
      associate (law => system%law(i))
        if (state%regime(i) /= regime_slip .or. law%tangents == 1) cycle
        rate = matmul(state%rate, system%rows(:, law%first_row:law%first_row + 1))
        radius = law%friction_coefficient/law%tangential_stiffness*normal_force(system, state, i)
        growth = law%friction_coefficient/law%tangential_stiffness*law%normal_stiffness* &
                 dot_product(state%rate, system%rows(:, law%first_row + 2))
        segment%lands(i) = state%zeros(2, i) > 0 .or. has_just_landed(radius, growth, rate)
        segment%small(i) = .not. segment%lands(i) .and. follows_at_once(radius, growth, rate, state%angle(i))
        if (.not. segment%small(i)) cycle
        segment%lands(i) = .true.
        segment%angle(0, i) = atan2(rate(2), rate(1))
      end associate
    end do
  end subroutine begin_directions

  !> Add the acceleration of order k by the contacts' forces to coefficient k + 2.
  pure subroutine push(system, state, segment, k)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment
    !> Order of the coefficient
    integer, intent(in) :: k
    real(wp) :: g(3)
    integer :: i, a, n

    do i = 1, size(system%law)
      associate (law => system%law(i), first => system%law(i)%first_row)
        n = law%tangents
        g(:n) = segment%force(k, first:first + n - 1)
        g(n + 1) = merge(law%normal_force(0.0_wp), 0.0_wp, k == 0)
        select case (state%regime(i))
         case (regime_stick)
          if (k > 0) cycle
          g(:n) = -law%tangential_stiffness*state%slider(:n, i)
         case (regime_slip)
          g(:n) = g(:n) - law%tangential_stiffness*segment%displacement(k, first:first + n - 1)
         case default
          g(:n) = -law%tangential_stiffness*segment%displacement(k, first:first + n - 1)
          g(n + 1) = -law%normal_stiffness*segment%displacement(k, first + n)
        end select
        do a = 1, n + 1
          segment%motion(:, k + 2) = segment%motion(:, k + 2) - g(a)*system%input_map(:, first + a - 1)
        end do
      end associate
    end do
  end subroutine push

  !> Displacements and forces of the contacts of order k.
  pure subroutine find_forces(system, state, segment, k)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Motion between two events, closed form
    type(segment_type), intent(inout) :: segment
    !> Order of the coefficient
    integer, intent(in) :: k
    real(wp) :: once
    integer :: i, row, order, tangents

    once = merge(1.0_wp, 0.0_wp, k == 0)
    ! One order ahead, as far as the motion is known.
    do order = merge(0, k + 1, k == 0), min(k + 1, degree)
      do row = 1, size(system%springs)
        segment%displacement(order, row) = dot_product(system%rows(:, row), segment%motion(:, order))
      end do
    end do
    do i = 1, size(system%law)
      tangents = system%law(i)%tangents
      associate (law => system%law(i), first => system%law(i)%first_row, last => system%law(i)%first_row + tangents - 1)
        associate (t => segment%force(k, first:last), u => segment%displacement(k, first:last), n => segment%force(k, last + 1))
          n = law%normal_stiffness*segment%displacement(k, last + 1) + once*law%normal_force(0.0_wp)
          select case (state%regime(i))
           case (regime_stick)
            t = law%tangential_stiffness*(u - once*state%slider(:tangents, i))
           case (regime_slip)
            if (tangents == 1) then
              t = state%side(i)*law%friction_coefficient*n
            else
              segment%radius(k, i) = merge(0.0_wp, law%friction_coefficient/law%tangential_stiffness*n, &
                                           segment%small(i) .or. (segment%lands(i) .and. k == 0))
              if (k < degree) call extend_direction(k, segment%lands(i), segment%displacement(:, first:last), &
                                                    segment%radius(:, i), segment%angle(:, i), segment%direction(:, :, i))
              t = law%friction_coefficient*matmul(segment%force(k:0:-1, last + 1), segment%direction(:k, :, i))
            end if
           case default
            t = 0.0_wp
            n = 0.0_wp
          end select
        end associate
      end associate
    end do
  end subroutine find_forces

  !> How far the polynomials hold to rounding.
  pure real(wp) function step_length(system, segment)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    !> Part of the largest term that the last one may be, and of a contact's displacement that its friction may be wrong by
    real(wp), parameter :: rounding = 0.1_wp*epsilon(1.0_wp), of_friction = 1.0e-14_wp ! derived
    !> Part of the way back to where the contact landed that a step takes: its power of the highest order is rounding
    real(wp), parameter :: of_distance = 0.6_wp ! derived
    real(wp) :: scale, last
    integer :: k, i

    ! Of what moves from rest, too: loads that begin are in the third coefficient, or in the fourth.
    scale = norm2(segment%motion(:, :3))
    step_length = longest/segment%pace
    do k = degree - 1, degree
      last = norm2(segment%motion(:, k))
      if (last > 0.0_wp) step_length = min(step_length, (rounding*merge(scale, last, scale > 0.0_wp)/last)**(1.0_wp/k))
    end do
    ! The direction of slip has singular points of its own: where the contact opens, and at complex times.
    do i = 1, size(system%law)
      if (segment%regime(i) /= regime_slip .or. system%law(i)%tangents == 1) cycle
      associate (law => system%law(i), t => system%law(i)%first_row)
        scale = norm2(segment%displacement(0, t:t + 1)) + norm2(segment%displacement(1, t:t + 1)) &
                + norm2(segment%force(0, t:t + 1))/law%tangential_stiffness
        do k = degree - 1, degree
          last = norm2(segment%force(k, t:t + 1))/law%tangential_stiffness
          if (last > 0.0_wp) step_length = min(step_length, (of_friction*scale/last)**(1.0_wp/k))
        end do
        ! Neighbours of a motion that has landed do not share the instant: their series end there.
        if (segment%lands(i) .or. segment%radius(1, i) <= 0.0_wp) cycle
        step_length = min(step_length, of_distance*segment%radius(0, i)/segment%radius(1, i))
      end associate
    end do
  end function step_length

  !> Put the state at the end of a segment; sliders follow where they slip or float.
  pure subroutine move_to(system, segment, state)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    integer :: k, i, n

    associate (p => segment%motion, h => segment%length)
      state%motion = p(:, degree)
      state%rate = degree*p(:, degree)
      do k = degree - 1, 1, -1
        state%motion = state%motion*h + p(:, k)
        state%rate = state%rate*h + k*p(:, k)
      end do
      state%motion = state%motion*h + p(:, 0)
    end associate
    state%theta = segment%theta + segment%length
    do i = 1, size(system%law)
      if (state%regime(i) == regime_stick) cycle
      n = system%law(i)%tangents
      associate (law => system%law(i), first => system%law(i)%first_row)
        state%slider(:n, i) = matmul(state%motion, system%rows(:, first:first + n - 1))
        if (state%regime(i) == regime_open) cycle
        if (n > 1) state%angle(i) = value(segment%angle(:, i), segment%length)
        state%slider(:n, i) = state%slider(:n, i) - direction_of(state, i, n)*law%friction_coefficient/law%tangential_stiffness* &
          law%normal_force(dot_product(system%rows(:, first + n), state%motion))
      end associate
    end do
  end subroutine move_to

  !> In which a contact slips [n].
  pure function direction_of(state, contact, n) result(e)
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Number of the contact; of its tangents
    integer, intent(in) :: contact, n
    real(wp) :: e(n)

    if (n == 1) then
      e = state%side(contact)
    else
      e = [cos(state%angle(contact)), sin(state%angle(contact))]
    end if
  end function direction_of
end module attrito_integrate_taylor
