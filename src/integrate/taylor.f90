!> The exact motion between two events as a Taylor series: the model is linear there, so its coefficients obey a recursion,
!>
!> $$ (k+1)(k+2)\, p_{k+2} = f_k - \Lambda p_k - (k+1) D p_{k+1} - \Phi^T B^T g_k(p_k) $$
!>
!> with g_k the contact forces less their stuck springs: stick (-k_t w, N_p - k_n gap) at k = 0 and nothing after; slip
!> mu N_k side - k_t u_k; open -k_t u_k, -k_n v_k. While all contacts are open Lambda p + Phi^T B^T g is Phi^T K Phi p, which is small
!> where contacts are stiff: computed as such it allows steps of the open structure's own time. The series converges everywhere; a
!> step is as long as its last coefficients stay below rounding. Unlike modal exponentials it needs no eigenvectors for each
!> combination of contact states (unsymmetric, at times defective; four to the power of the contacts of them), no care at resonance,
!> and costs the same just after an event.
module attrito_integrate_taylor
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_loading, only: loading_type, expand_load
  use attrito_integrate_segment, only: segment_type
  use attrito_integrate_state, only: state_type
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
    real(wp) :: g(2)
    integer :: i, row

    do i = 1, size(system%law)
      row = system%law(i)%first_row
      g = segment%force(k, row:row + 1)
      if (state%regime(i) == regime_stick) then
        g = [-system%law(i)%tangential_stiffness*state%slider(1, i), system%law(i)%normal_force(0.0_wp)]
        if (k > 0) cycle
      else
        g(1) = g(1) - system%springs(row)*segment%displacement(k, row)
        if (state%regime(i) == regime_slip) then
          g(2) = merge(system%law(i)%normal_force(0.0_wp), 0.0_wp, k == 0)
        else
          g(2) = -system%springs(row + 1)*segment%displacement(k, row + 1)
        end if
      end if
      segment%motion(:, k + 2) = segment%motion(:, k + 2) - g(1)*system%input_map(:, row) - g(2)*system%input_map(:, row + 1)
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
    integer :: i, row

    once = merge(1.0_wp, 0.0_wp, k == 0)
    do row = 1, size(system%springs)
      segment%displacement(k, row) = dot_product(system%rows(:, row), segment%motion(:, k))
    end do
    do i = 1, size(system%law)
      associate (law => system%law(i), t => segment%force(k, system%law(i)%first_row), u => &
                 segment%displacement(k, system%law(i)%first_row), n => segment%force(k, system%law(i)%first_row + 1), v => &
                 segment%displacement(k, system%law(i)%first_row + 1))
        n = law%normal_stiffness*v + once*system%law(i)%normal_force(0.0_wp)
        select case (state%regime(i))
         case (regime_stick)
          t = law%tangential_stiffness*(u - once*state%slider(1, i))
         case (regime_slip)
          t = state%side(i)*law%friction_coefficient*n
         case default
          t = 0.0_wp
          n = 0.0_wp
        end select
      end associate
    end do
  end subroutine find_forces

  !> How far the polynomials hold to rounding.
  pure real(wp) function step_length(segment)
    !> Motion between two events, closed form
    type(segment_type), intent(in) :: segment
    !> Part of the largest term that the last one may be
    real(wp), parameter :: rounding = 0.1_wp*epsilon(1.0_wp) ! derived
    real(wp) :: scale, last
    integer :: k

    scale = norm2(segment%motion(:, 0)) + norm2(segment%motion(:, 1))
    step_length = longest/segment%pace
    do k = degree - 1, degree
      last = norm2(segment%motion(:, k))
      if (last > 0.0_wp) step_length = min(step_length, (rounding*max(scale, last)/last)**(1.0_wp/k))
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
    integer :: k, i
    real(wp) :: u, v

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
      associate (law => system%law(i))
        u = dot_product(system%rows(:, law%first_row), state%motion)
        v = dot_product(system%rows(:, law%first_row + 1), state%motion)
        state%slider(1, i) = u
        if (state%regime(i) == regime_slip) state%slider(1, i) = u - state%side(i)*law%friction_coefficient* &
          law%normal_force(v)/law%tangential_stiffness
      end associate
    end do
  end subroutine move_to
end module attrito_integrate_taylor
