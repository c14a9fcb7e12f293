!> The linearised flow over a period of an orbit, from leg to leg: what a small change of motion, rate and sliders becomes.
!>
!> $$ \delta p'' + D \delta p' + \Lambda \delta p = - \Phi^T B^T \delta g, \qquad
!>    \delta g = (-k_t \delta w,\, 0), \quad (\text{side}\, \mu k_n \delta v - k_t \delta u,\, 0), \quad (-k_t \delta u,\, -k_n \delta v) $$
!>
!> for a contact that sticks, slips, is open. On a leg the coefficients are constant, and the flow of all columns at once is a Taylor
!> series whose terms obey the recursion of `attrito_integrate_taylor`; between legs sliders that come to rest are reset
!> (`attrito_stability_leg`). A perturbed slider acts only while its contact sticks: this is the memory that a Jacobian frozen in time
!> leaves out.
module attrito_stability_monodromy
  use attrito_core_kinds, only: wp, two_pi
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open
  use attrito_integrate_system, only: system_type
  use attrito_stability_leg, only: leg_type, orbit_legs_type
  implicit none
  private
  public :: monodromy, perturbation_type

  !> Longest step of the series over the fastest mode: beyond, terms cancel to more than a digit
  real(wp), parameter :: longest = 2.0_wp
  !> Most terms; with steps as short as that rounding is reached well before
  integer, parameter :: most_terms = 60
  !> Part of a column that a term must be to matter
  real(wp), parameter :: rounding = 1.0e-2_wp*epsilon(1.0_wp)

  !> Changes of motion and rate [m, columns], and of sliders [contacts, columns]
  type :: perturbation_type
    real(wp), allocatable :: motion(:, :), rate(:, :), slider(:, :)
  end type perturbation_type

contains

  !> What a unit change of each of (motion [m], rate by the clock [m], sliders [contacts]) becomes in a period [2 m + nc, 2 m + nc].
  !> Columns of sliders that no contact holds at the start are zero.
  function monodromy(system, orbit, period) result(matrix)
    type(system_type), intent(in) :: system
    type(orbit_legs_type), intent(in) :: orbit
    !> In units of the clock
    real(wp), intent(in) :: period
    real(wp), allocatable :: matrix(:, :)
    type(perturbation_type) :: now
    integer :: m, contacts, i

    m = size(system%eigenvalues)
    contacts = size(system%law)
    allocate (now%motion(m, 2*m + contacts), now%rate(m, 2*m + contacts), now%slider(contacts, 2*m + contacts), source=0.0_wp)
    do i = 1, m
      now%motion(i, i) = 1.0_wp
      now%rate(i, m + i) = 1.0_wp
    end do
    do i = 1, contacts
      if (orbit%legs(1)%regime(i) == regime_stick) now%slider(i, 2*m + i) = 1.0_wp
    end do
    do i = 1, size(orbit%legs)
      call reset_sliders(system, orbit%legs(i), now)
      call pass(system, orbit%legs(i), orbit%legs(i)%length/two_pi*period, now)
    end do
    call follow_sliders(system, orbit%legs(size(orbit%legs)), now)
    allocate (matrix(2*m + contacts, 2*m + contacts))
    matrix(:m, :) = now%motion
    matrix(m + 1:2*m, :) = now%rate
    matrix(2*m + 1:, :) = now%slider
  end function monodromy

  !> Sliders that come to rest at the beginning of a leg keep what they have there.
  subroutine reset_sliders(system, leg, now)
    type(system_type), intent(in) :: system
    type(leg_type), intent(in) :: leg
    type(perturbation_type), intent(inout) :: now
    integer :: i

    do i = 1, size(system%law)
      if (.not. leg%rests(i)) cycle
      associate (row => system%law(i)%first_row)
        now%slider(i, :) = matmul(system%rows(:, row) + leg%by_normal(i)*system%rows(:, row + 1), now%motion)
      end associate
    end do
  end subroutine reset_sliders

  !> Sliders that move at the end of a leg, with slip or with an open contact.
  subroutine follow_sliders(system, leg, now)
    type(system_type), intent(in) :: system
    type(leg_type), intent(in) :: leg
    type(perturbation_type), intent(inout) :: now
    integer :: i

    do i = 1, size(system%law)
      if (leg%regime(i) == regime_stick) cycle
      associate (law => system%law(i), row => system%law(i)%first_row)
        now%slider(i, :) = matmul(system%rows(:, row) - leg%side(i)*law%friction_coefficient*law%normal_stiffness &
                                  /law%tangential_stiffness*system%rows(:, row + 1), now%motion)
      end associate
    end do
  end subroutine follow_sliders

  !> The flow over a leg.
  subroutine pass(system, leg, length, now)
    type(system_type), intent(in) :: system
    type(leg_type), intent(in) :: leg
    !> In units of the clock
    real(wp), intent(in) :: length
    type(perturbation_type), intent(inout) :: now
    real(wp), allocatable :: seen(:, :), pushed(:, :), held(:, :)
    integer :: step, steps

    call couple(system, leg, seen, pushed)
    held = held_by_sliders(system, leg, now%slider)
    steps = max(1, ceiling(length/longest))
    do step = 1, steps
      call step_on(system, seen, pushed, held, length/steps, now)
    end do
  end subroutine pass

  !> What contacts that slip or open add: acceleration `pushed` times (`seen`^T motion).
  subroutine couple(system, leg, seen, pushed)
    type(system_type), intent(in) :: system
    type(leg_type), intent(in) :: leg
    !> [m, rows that do not just stick]
    real(wp), allocatable, intent(out) :: seen(:, :), pushed(:, :)
    integer :: i, n

    n = count(leg%regime == regime_slip) + 2*count(leg%regime == regime_open)
    allocate (seen(size(system%eigenvalues), n), pushed(size(system%eigenvalues), n))
    n = 0
    do i = 1, size(system%law)
      associate (law => system%law(i), row => system%law(i)%first_row)
        select case (leg%regime(i))
         case (regime_slip)
          n = n + 1
          seen(:, n) = law%tangential_stiffness*system%rows(:, row) &
                       - leg%side(i)*law%friction_coefficient*law%normal_stiffness*system%rows(:, row + 1)
          pushed(:, n) = system%pushes(:, row)
         case (regime_open)
          n = n + 2
          seen(:, n - 1) = law%tangential_stiffness*system%rows(:, row)
          pushed(:, n - 1) = system%pushes(:, row)
          seen(:, n) = law%normal_stiffness*system%rows(:, row + 1)
          pushed(:, n) = system%pushes(:, row + 1)
        end select
      end associate
    end do
  end subroutine couple

  !> Acceleration by the sliders of contacts that stick [m, columns].
  function held_by_sliders(system, leg, slider) result(held)
    type(system_type), intent(in) :: system
    type(leg_type), intent(in) :: leg
    real(wp), intent(in) :: slider(:, :)
    real(wp), allocatable :: held(:, :)
    real(wp) :: pushes(size(system%eigenvalues), size(system%law))
    integer :: i

    pushes = 0.0_wp
    do i = 1, size(system%law)
      if (leg%regime(i) == regime_stick) pushes(:, i) = system%law(i)%tangential_stiffness*system%pushes(:, system%law(i)%first_row)
    end do
    held = matmul(pushes, slider)
  end function held_by_sliders

  !> One step of the series, p_{k+2} = (held_k - Lambda p_k - (k + 1) D p_{k+1} + pushed seen^T p_k)/((k + 1)(k + 2)), until its terms
  !> are below rounding.
  subroutine step_on(system, seen, pushed, held, h, now)
    type(system_type), intent(in) :: system
    real(wp), intent(in) :: seen(:, :), pushed(:, :), held(:, :), h
    type(perturbation_type), intent(inout) :: now
    real(wp), dimension(size(held, 1), size(held, 2)) :: term, next, after
    real(wp) :: scale(size(held, 2)), last(size(held, 2))
    integer :: k

    ! Terms are those of powers of time over the step.
    term = now%motion
    next = h*now%rate
    now%motion = term + next
    now%rate = next
    scale = max(maxval(abs(term), 1), maxval(abs(next), 1))
    do k = 0, most_terms
      after = -spread(system%eigenvalues, 2, size(held, 2))*term + matmul(pushed, matmul(transpose(seen), term))
      if (k == 0) after = after + held
      after = h**2*after - (h*(k + 1))*spread(system%damping, 2, size(held, 2))*next
      if (allocated(system%coupling)) after = after - (h*(k + 1))*matmul(system%coupling, next)
      after = after/((k + 1)*(k + 2))
      term = next
      next = after
      now%motion = now%motion + next
      now%rate = now%rate + (k + 2)*next
      last = max(maxval(abs(term), 1), maxval(abs(next), 1))
      scale = max(scale, last)
      if (all(last <= rounding*scale)) exit
    end do
    now%rate = now%rate/h
  end subroutine step_on
end module attrito_stability_monodromy
