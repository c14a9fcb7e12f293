!> Contact forces of a trigonometric motion with two tangents, by events: the deviation g = lambda - K_c d is
!>
!> $$ g_t = -k_t w = \begin{cases} -k_t w & \text{constant, in stick} \\ -k_t (u - r e(\phi)) & \text{in slip} \\
!>    -k_t u & \text{open} \end{cases}, \qquad g_n = N - k_n v $$
!>
!> and its Fourier integrals are closed form but for those of r e(phi), sums over the nodes of panels (`attrito_contact_slip_panel`).
!> Events are located, so the error is that of the panels, which falls with the power of their nodes. The Jacobian is the march's.
!>
!> A contact that opens has one loop, from each landing to the next opening. One that is closed all over the period rests where it
!> can. If there is no such place its slider either is the unknown start of one march, or is found here, w = P(w).
module attrito_contact_quadrature_disc
  use, intrinsic :: ieee_arithmetic, only: ieee_value, ieee_quiet_nan
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_lapack, only: multiply_by_transpose
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_loop, only: loop_type, march_closed_parts, march_passing, follow_motion, march_period, close_period, &
                                       holding_of
  use attrito_contact_disc_motion, only: disc_motion_type, new_disc_motion
  use attrito_contact_disc_record, only: disc_record_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_forces, only: contact_forces_type, hold_slider, stay_stuck, released
  use attrito_contact_moments, only: moments_type, new_moments, ends_type, new_ends
  use attrito_contact_resting_place, only: resting_place_type, find_resting_place, resting_gradient
  use attrito_contact_state, only: regime_stick, regime_slip, regime_open, state_stuck, state_shaken_down, state_slipping, &
                                   state_open
  use attrito_contact_stuck_bound, only: is_stuck_by_bound, is_stuck_by_samples
  implicit none
  private
  public :: evaluate_contact_by_disc_events, follow_period, find_cuts

contains

  !> Forces and Jacobian of one contact with two tangents. A march that does not come through leaves forces that are not numbers, so
  !> that no point is said to be solved with it.
  subroutine evaluate_contact_by_disc_events(law, rules, motion, slider, periodic, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids and rules of panels, for the motion's harmonics
    type(disc_rules_type), intent(in) :: rules
    !> Coefficients of relative displacement u_1, u_2, v [k, 3]
    real(wp), intent(in) :: motion(:, :)
    !> Slider at the start [2]
    real(wp), intent(in) :: slider(2)
    !> Is the slider to return after one period, as an unknown?
    logical, intent(in) :: periodic
    !> Forces; `deviation` is allocated by the caller, for as many coefficients as it wants
    type(contact_forces_type), intent(inout) :: forces
    integer :: shown

    forces%periodic = periodic .and. .not. allocated(forces%mean_before)
    forces%closed_here = .false.
    if (.not. allocated(forces%mean_before) .and. is_stuck_by_bound(law, motion, slider)) then
      call stay_stuck(law, slider, size(motion, 1), forces)
      return
    end if
    shown = size(motion, 1)
    if (forces%without_jacobian) shown = rules%significant(motion)
    call evaluate_motion(law, rules, motion(:shown, :), slider, forces)
  end subroutine evaluate_contact_by_disc_events

  !> The same of all harmonics that show.
  subroutine evaluate_motion(law, rules, coefficients, slider, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids and rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> Coefficients of relative displacement; slider at the start
    real(wp), intent(in) :: coefficients(:, :), slider(2)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    type(disc_motion_type) :: motion
    type(resting_place_type) :: place
    type(loop_type) :: loop

    motion = new_disc_motion(law, rules, coefficients, forces%mean_before)
    if (.not. motion%passing > 0.0_wp .and. is_stuck_on_grid(law, motion, coefficients, slider)) then
      call stay_stuck(law, slider, size(coefficients, 1), forces)
      return
    end if
    call follow_period(law, rules, coefficients, slider, motion, forces, place, loop)
    if (loop%rests) then
      call rest(law, motion, place, forces)
      return
    end if
    if (loop%record%failed) then
      call stay_stuck(law, slider, size(coefficients, 1), forces)
      forces%deviation = ieee_value(1.0_wp, ieee_quiet_nan)
      return
    end if
    call classify(loop, slider, forces)
    forces%may_stick = place%exists
    call integrate(law, motion, loop, coefficients, forces)
    if (motion%passing > 0.0_wp) then
      call add_passing(law, motion, loop%record, forces)
    else if (forces%state == state_stuck) then
      call hold_slider(law, (forces%slider), forces)
    end if
  end subroutine evaluate_motion

  !> What the contact does over the period.
  subroutine follow_period(law, rules, coefficients, slider, motion, forces, place, loop)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids and rules of panels
    type(disc_rules_type), intent(in) :: rules
    !> Coefficients of relative displacement; slider at the start
    real(wp), intent(in) :: coefficients(:, :), slider(2)
    !> Motion of the contact
    type(disc_motion_type), intent(inout) :: motion
    !> What is wanted; says whether the period was closed here
    type(contact_forces_type), intent(inout) :: forces
    !> Where it can rest, if that was looked for, and what it does unless it rests there
    type(resting_place_type), intent(out) :: place
    type(loop_type), intent(out) :: loop
    real(wp), allocatable :: cuts(:)

    call motion%sample_slopes(rules)
    call motion%find_kinks(rules)
    call find_cuts(law, rules, motion, coefficients, cuts)
    if (size(cuts) == 0 .and. motion%largest <= -law%touching_force(coefficients(:, 3))*motion%slope/law%normal_stiffness) then
      call follow_motion(law, motion, coefficients, forces, loop)
      if (motion%passing > 0.0_wp) loop%start = slider
    else if (motion%passing > 0.0_wp) then
      call march_passing(motion, rules, cuts, forces, slider, loop)
    else if (size(cuts) > 0) then
      call march_closed_parts(motion, rules, cuts, forces, loop)
    else if (forces%periodic) then
      call march_period(motion, rules, forces, slider, loop)
      if (.not. forces%without_jacobian) place = find_resting_place(motion, slider)
    else
      place = find_resting_place(motion, slider)
      loop%rests = place%exists
      if (loop%rests) return
      call close_period(motion, rules, forces, place%slider, loop)
      forces%closed_here = .true.
      ! It has moved, even if it all but rests where it has come to.
      loop%entered = .true.
    end if
  end subroutine follow_period

  !> Does what is seen on the grid show that the contact sticks?
  logical function is_stuck_on_grid(law, motion, coefficients, slider) result(sticks)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contact, and its coefficients
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: coefficients(:, :)
    !> Slider at the start
    real(wp), intent(in) :: slider(2)
    real(wp) :: displacement(size(motion%sampled, 1) - 1, 3)

    associate (points => size(displacement, 1))
      displacement(:, :2) = motion%sampled(:points, :2)
      displacement(:, 3) = (motion%sampled(:points, 3) - motion%series(3, 1))/motion%pressing + coefficients(1, 3)
    end associate
    sticks = is_stuck_by_samples(law, displacement, coefficients, slider)
  end function is_stuck_on_grid

  !> Where the contact lands and opens, ascending from a landing, or of a period that passes from its start; none if it is closed, or
  !> open, all over the period.
  subroutine find_cuts(law, rules, motion, coefficients, cuts)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Grids
    type(disc_rules_type), intent(in) :: rules
    !> Motion of the contact, and its coefficients
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: coefficients(:, :)
    !> The first is a landing, unless the period passes
    real(wp), allocatable, intent(out) :: cuts(:)
    real(wp), allocatable :: roots(:)
    real(wp) :: jet(6)
    integer :: i, n

    allocate (cuts(0))
    if (motion%largest <= -law%touching_force(coefficients(:, 3))*motion%slope/law%normal_stiffness) return
    roots = motion%crossings(rules, 0.0_wp)
    n = size(roots)
    if (n < 2 .and. .not. motion%passing > 0.0_wp) return
    do i = 1, n
      cuts = [cuts, minval(roots)]
      roots(minloc(roots, 1)) = huge(1.0_wp)
    end do
    if (motion%passing > 0.0_wp) return
    jet = motion%at(0.5_wp*(cuts(1) + cuts(2)))
    if (jet(3) < 0.0_wp) cuts = [cuts(2:), cuts(1) + two_pi]
  end subroutine find_cuts

  !> The slider rests all over the period.
  subroutine rest(law, motion, place, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Where
    type(resting_place_type), intent(in) :: place
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    integer :: k

    k = size(motion%series, 2)
    call stay_stuck(law, place%slider, k, forces)
    if (place%count == 0) return
    forces%state = state_shaken_down
    if (forces%without_jacobian) return
    forces%active([1, k + 1]) = .true.
    allocate (forces%jacobian(3*k, 3*k), source=0.0_wp)
    forces%jacobian([1, k + 1], :) = -law%tangential_stiffness*transpose(resting_gradient(motion, place))
  end subroutine rest

  !> State and fractions.
  subroutine classify(loop, slider, forces)
    !> The period
    type(loop_type), intent(in) :: loop
    !> Slider that was given
    real(wp), intent(in) :: slider(2)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    real(wp) :: length(regime_stick:regime_open)
    integer :: i

    associate (ends => loop%record%ends, regimes => loop%record%regimes, n => loop%record%intervals)
      length = 0.0_wp
      do i = 1, n
        length(regimes(i)) = length(regimes(i)) + (ends(i) - ends(i - 1))
      end do
      if (forces%lists_slip) then
        associate (slips => regimes(:n) == regime_slip)
          forces%slips = transpose(reshape([pack(ends(:n - 1), slips), pack(ends(1:n), slips)], [count(slips), 2]))
        end associate
      end if
    end associate
    forces%stick = length(regime_stick)/two_pi
    forces%slip = length(regime_slip)/two_pi
    forces%open = length(regime_open)/two_pi
    ! One loop whatever the start: an unknown start slider has to come to be where it is.
    forces%slider = merge(slider, loop%start, forces%periodic)
    forces%moved = loop%slider - forces%slider
    if (.not. loop%touches) then
      forces%state = state_open
    else if (forces%slip + forces%open > 0.0_wp .or. loop%entered) then
      forces%state = state_slipping
    else
      forces%state = state_stuck
    end if
    forces%unique = forgets(loop)
  end subroutine classify

  !> Does a period bring sliders closer? One that opens has no start slider among its columns, which are 3 k or none then.
  logical function forgets(loop)
    !> The period
    type(loop_type), intent(in) :: loop

    forgets = .true.
    if (modulo(size(loop%by_slider, 1), 3) == 0) return
    associate (a => loop%by_slider(size(loop%by_slider, 1) - 1:, :))
      associate (squares => sum(a**2), determinant => a(1, 1)*a(2, 2) - a(1, 2)*a(2, 1))
        forgets = sqrt(0.5_wp*(squares + sqrt(max(squares**2 - 4.0_wp*determinant**2, 0.0_wp)))) < 1.0_wp - 1.0e-9_wp
      end associate
    end associate
  end function forgets

  !> Coefficients of the deviation and its Jacobian.
  subroutine integrate(law, motion, loop, coefficients, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> The period
    type(loop_type), intent(inout) :: loop
    !> Coefficients of relative displacement
    real(wp), intent(in) :: coefficients(:, :)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    !> Where the slider goes with the motion; where open, and where closed; one interval of stick
    type(moments_type) :: moving, opened, closed, resting
    type(ends_type) :: ends
    real(wp) :: closed_normal, force(max(size(forces%deviation, 1), size(coefficients, 1)))
    real(wp), allocatable :: basis(:, :), gradient(:, :, :), product(:, :)
    integer :: i, k, n, order, a

    k = size(coefficients, 1)
    order = (size(forces%deviation, 1) + k)/2 - 1
    associate (record => loop%record, kt => law%tangential_stiffness, kn => law%normal_stiffness, g => forces%deviation)
      ends = new_ends(record%ends(0:record%intervals), order)
      moving = new_moments(order)
      opened = new_moments(order)
      closed = new_moments(order)
      do i = 1, record%intervals
        if (record%regimes(i) /= regime_stick) call moving%add(ends, i, 1.0_wp)
        if (record%regimes(i) == regime_open) call opened%add(ends, i, 1.0_wp)
        if (record%regimes(i) /= regime_open) call closed%add(ends, i, 1.0_wp)
      end do
      call moving%complete()
      call opened%complete()
      call closed%complete()
      closed_normal = law%normal_force(0.0_wp)
      g(:, :2) = kt*record%slip_force
      g(:, 3) = 0.0_wp
      ! Nothing of a contact that never closes: of a large gap 1 less the open part would leave its rounding.
      call closed%add_column(closed_normal, g(:, 3))
      call opened%add_product(coefficients(:, 3), -kn, g(:, 3))
      do a = 1, 2
        call moving%add_product(coefficients(:, a), -kt, g(:, a))
      end do
      n = 0
      allocate (basis(k, record%intervals), gradient(record%columns, 2, record%intervals))
      do i = 1, record%intervals
        if (record%regimes(i) /= regime_stick) cycle
        resting = new_moments(order)
        call resting%add(ends, i, 1.0_wp)
        force = 0.0_wp
        call resting%add_column(-kt, force)
        do a = 1, 2
          g(:, a) = g(:, a) + record%sliders(a, i)*force(:size(g, 1))
        end do
        n = n + 1
        basis(:, n) = force(:k)
        gradient(:, :, n) = record%by_sliders(:, :, i)
      end do
      if (allocated(forces%jacobian)) deallocate (forces%jacobian)
      forces%active = spread(.false., 1, 3*k)
      if (forces%without_jacobian .or. (forces%state == state_stuck .and. .not. motion%passing > 0.0_wp)) return
      allocate (product(k, 2*record%columns), source=0.0_wp)
      if (n > 0) call multiply_by_transpose(k, 2*record%columns, n, basis, gradient, product)
      if (allocated(record%by_slip)) then
        call record%flush_nodes()
        product = product + kt*record%by_slip
      end if
      allocate (forces%jacobian(3*k, 3*k), source=0.0_wp)
      forces%active(:2*k) = .true.
      forces%active(2*k + 1:) = forces%open > 0.0_wp
      do a = 1, 2
        associate (block => forces%jacobian((a - 1)*k + 1:a*k, :))
          block = product(:, (a - 1)*record%columns + 1:(a - 1)*record%columns + 3*k)
          call add_matrix(moving, -kt, block(:, (a - 1)*k + 1:a*k))
        end associate
      end do
      call add_matrix(opened, -kn, forces%jacobian(2*k + 1:, 2*k + 1:))
    end associate
    call let_slider_follow(loop, product, forces)
  end subroutine integrate

  !> What a period that passes adds, where the slider does not go with the means: K_c times their going on.
  subroutine add_passing(law, motion, record, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> What it does
    type(disc_record_type), intent(in) :: record
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    type(ends_type) :: ends
    real(wp) :: column(size(forces%deviation, 1), 3)
    integer :: a, i, k

    k = size(motion%series, 2)
    ends = new_ends(record%ends(0:record%intervals), size(column, 1)/2)
    column = 0.0_wp
    do i = 1, record%intervals
      if (record%regimes(i) == regime_stick) call add_ramp(ends, i, law%tangential_stiffness, column(:, 1))
      if (record%regimes(i) /= regime_open) call add_ramp(ends, i, law%normal_stiffness, column(:, 3))
    end do
    column(:, 2) = column(:, 1)
    do a = 1, 3
      forces%deviation(:, a) = forces%deviation(:, a) + motion%rate(a)*merge(1.0_wp, 1.0_wp/motion%pressing, a < 3)*column(:, a)
      if (forces%without_jacobian) cycle
      associate (mean => forces%jacobian((a - 1)*k + 1:a*k, (a - 1)*k + 1))
        mean = mean + motion%passing*column(:k, a)
      end associate
    end do
    forces%active = spread(.true., 1, 3*k)
  end subroutine add_passing

  !> y <- y + factor (theta - pi) chi, in coefficients, by parts.
  subroutine add_ramp(ends, interval, factor, y)
    !> Antiderivatives at the ends of intervals
    type(ends_type), intent(in) :: ends
    !> Number of the interval
    integer, intent(in) :: interval
    !> Factor on what is added
    real(wp), intent(in) :: factor
    !> Coefficients that are added to
    real(wp), intent(inout) :: y(:)
    real(wp) :: x
    integer :: m, side

    do side = 0, 1
      x = ends%c(0, interval - side) - pi
      y(1) = y(1) + (1 - 2*side)*factor/two_pi*0.5_wp*x**2
      do m = 1, size(y)/2
        associate (c => ends%c(m, interval - side), s => ends%s(m, interval - side))
          y(2*m) = y(2*m) + (1 - 2*side)*factor/pi*(x*c - s/m)
          y(2*m + 1) = y(2*m + 1) + (1 - 2*side)*factor/pi*(x*s + c/m)
        end associate
      end do
    end do
  end subroutine add_ramp

  !> y <- y + factor chi.
  subroutine add_matrix(moments, factor, y)
    !> Moments of chi
    type(moments_type), intent(in) :: moments
    !> Factor on what is added
    real(wp), intent(in) :: factor
    !> [k, k]
    real(wp), intent(inout) :: y(:, :)
    real(wp) :: matrix(size(y, 1), size(y, 2))

    call moments%write_matrix(factor, matrix)
    y = y + matrix
  end subroutine add_matrix

  !> The start slider follows the motion, (I - dP/dw) dw = P_d dd, and forces follow it.
  subroutine let_slider_follow(loop, product, forces)
    !> The period
    type(loop_type), intent(in) :: loop
    !> Derivatives of the tangential deviation [k, columns of both]
    real(wp), intent(in) :: product(:, :)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    real(wp) :: holding(2, 2), by_motion(2, 3*size(product, 1)), force(2*size(product, 1), 2)
    integer :: columns, k

    k = size(product, 1)
    columns = size(product, 2)/2
    by_motion = transpose(loop%by_slider(:3*k, :))
    if (columns > 3*k) then
      holding = holding_of(loop%by_slider)
      force(:k, :) = product(:, 3*k + 1:columns)
      force(k + 1:, :) = product(:, columns + 3*k + 1:)
      forces%jacobian(:2*k, :) = forces%jacobian(:2*k, :) + matmul(force, released(holding, by_motion))
    else
      ! The loop does not depend on its start, which has to come to be where the period ends.
      holding = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
      force = 0.0_wp
    end if
    if (.not. forces%periodic) return
    forces%link%holding = holding
    forces%link%by_motion = by_motion
    forces%link%force = force
  end subroutine let_slider_follow
end module attrito_contact_quadrature_disc
