!> One period of a contact with two tangents, by events: of one that opens each closed part from its landing, of one that stays closed
!> a march from a start slider, P(w), once or until it closes, w = P(w), by Newton's method,
!>
!> $$ (I - P_w) \, \delta w = P(w) - w $$
!>
!> and of one that passes a march from a given slider.
!>
!> Sliders never part, so P_w has no singular value above one. Near the last place to rest one comes close to it.
module attrito_contact_disc_loop
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_march, only: start_at, land, march_disc, slider_at
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_disc_record, only: disc_state_type, disc_record_type, new_record
  use attrito_contact_forces, only: contact_forces_type, released
  use attrito_contact_slip_panel, only: slip_panel_type, new_slip_panel
  use attrito_contact_state, only: regime_slip, regime_open
  implicit none
  private
  public :: loop_type, march_closed_parts, march_passing, follow_motion, march_period, close_period, holding_of

  !> What a period keeps but for rounding stays where it is, rather than moving without limit
  real(wp), parameter :: kept = 1.0_wp - 1.0e-8_wp ! derived

  !> One period of a contact
  type :: loop_type
    type(disc_record_type) :: record
    !> Slider at the start, and at its end with the derivative [columns, 2]
    real(wp) :: start(2) = 0.0_wp, slider(2) = 0.0_wp
    real(wp), allocatable :: by_slider(:, :)
    !> Does it touch at some time? Has its start slider been outside its disc? Does it rest, so that nothing is marched?
    logical :: touches = .true., entered = .false., rests = .false.
  end type loop_type

contains

  !> Numbers of columns of derivatives: the motion's, if they are wanted, and the start slider's, if there is one.
  pure integer function columns_of(motion, without_jacobian, with_start) result(columns)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> Is the Jacobian not wanted? Does the march depend on a start slider?
    logical, intent(in) :: without_jacobian, with_start

    columns = merge(0, 3*size(motion%series, 2), without_jacobian) + merge(2, 0, with_start)
  end function columns_of

  !> A contact that opens: each closed part from its landing. The period's end is looked at on the way.
  subroutine march_closed_parts(motion, rules, cuts, forces, loop)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(inout) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> Landings and openings in turn
    real(wp), intent(in) :: cuts(:)
    !> What is wanted
    type(contact_forces_type), intent(in) :: forces
    !> The period
    type(loop_type), intent(out) :: loop
    type(disc_state_type) :: state
    type(slip_panel_type) :: panel
    real(wp) :: next
    integer :: i, k, columns

    k = size(motion%series, 2)
    columns = columns_of(motion, forces%without_jacobian, .false.)
    loop%record = new_record(cuts(1), k, size(forces%deviation, 1), columns, columns > 0, .true., rules)
    panel = new_slip_panel(rules, max(k, size(forces%deviation, 1)))
    allocate (loop%by_slider(columns, 2), source=0.0_wp)
    call go_with_motion(motion, loop)
    do i = 1, size(cuts), 2
      call land(motion, cuts(i), loop%record, state)
      if (cuts(i) < two_pi .and. cuts(i + 1) > two_pi) then
        call march_disc(motion, rules, cuts(i), two_pi, .false., panel, state, loop%record)
        call slider_at(motion, two_pi, loop%record, state, loop%slider, loop%by_slider)
        if (.not. loop%record%failed) call march_disc(motion, rules, two_pi, cuts(i + 1), .true., panel, state, loop%record)
      else
        call march_disc(motion, rules, cuts(i), cuts(i + 1), .true., panel, state, loop%record)
      end if
      if (loop%record%failed) return
      next = cuts(1) + two_pi
      if (i + 1 < size(cuts)) next = cuts(i + 2)
      call loop%record%add_interval(next, regime_open, state)
    end do
    loop%start = loop%slider
  end subroutine march_closed_parts

  !> A period that passes, from a given slider: closed and open parts in turn.
  subroutine march_passing(motion, rules, cuts, forces, slider, loop)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(inout) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> Landings and openings in turn
    real(wp), intent(in) :: cuts(:)
    !> What is wanted
    type(contact_forces_type), intent(in) :: forces
    !> Slider at the start
    real(wp), intent(in) :: slider(2)
    !> The period
    type(loop_type), intent(out) :: loop
    type(disc_state_type) :: state
    type(slip_panel_type) :: panel
    real(wp) :: ends(0:size(cuts) + 1), jet(6)
    logical :: closed
    integer :: i, k, columns

    k = size(motion%series, 2)
    columns = columns_of(motion, forces%without_jacobian, .false.)
    loop%record = new_record(0.0_wp, k, size(forces%deviation, 1), columns, columns > 0, .true., rules)
    panel = new_slip_panel(rules, max(k, size(forces%deviation, 1)))
    allocate (loop%by_slider(columns, 2), source=0.0_wp)
    loop%start = slider
    ends = [0.0_wp, cuts, two_pi]
    jet = motion%at(0.5_wp*ends(1))
    closed = jet(3) > 0.0_wp
    loop%touches = closed .or. size(cuts) > 0
    state%slider = slider
    state%by_slider = loop%by_slider
    if (closed) call start_at(motion, 0.0_wp, slider, loop%by_slider, loop%record, state, loop%entered)
    do i = 1, size(cuts) + 1
      if (closed) then
        if (i > 1) call land(motion, ends(i - 1), loop%record, state)
        call march_disc(motion, rules, ends(i - 1), ends(i), i <= size(cuts), panel, state, loop%record)
        if (loop%record%failed) return
      else
        call loop%record%add_interval(ends(i), regime_open, state)
      end if
      if (i <= size(cuts)) closed = .not. closed
    end do
    if (closed) then
      call slider_at(motion, two_pi, loop%record, state, loop%slider, loop%by_slider)
    else
      call go_with_motion(motion, loop)
    end if
  end subroutine march_passing

  !> The slider at the end of the period of a contact that holds nothing there: it is where the contact is.
  subroutine go_with_motion(motion, loop)
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> The period
    type(loop_type), intent(inout) :: loop
    real(wp) :: basis(size(motion%series, 2)), jet(6)
    integer :: k

    jet = motion%at(two_pi)
    loop%slider = jet(1:2)
    if (size(loop%by_slider, 1) == 0) return
    k = size(basis)
    basis = motion%basis_at(two_pi)
    loop%by_slider(:k, 1) = basis
    loop%by_slider(k + 1:2*k, 2) = basis
  end subroutine go_with_motion

  !> A contact that does not touch, or is not pressed: no tangential force, the slider goes with the motion.
  subroutine follow_motion(law, motion, coefficients, forces, loop)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Motion of the contact, and its coefficients
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: coefficients(:, :)
    !> What is wanted
    type(contact_forces_type), intent(in) :: forces
    !> The period
    type(loop_type), intent(out) :: loop
    type(disc_state_type) :: state
    integer :: columns

    columns = columns_of(motion, forces%without_jacobian, .false.)
    loop%record = new_record(0.0_wp, size(motion%series, 2), size(forces%deviation, 1), columns, columns > 0, .true.)
    allocate (loop%by_slider(columns, 2), source=0.0_wp)
    call go_with_motion(motion, loop)
    loop%start = loop%slider
    state%slider = loop%slider
    state%by_slider = loop%by_slider
    loop%touches = law%normal_force(coefficients(1, 3)) >= law%touching_force(coefficients(:, 3))
    call loop%record%add_interval(two_pi, merge(regime_slip, regime_open, loop%touches), state)
  end subroutine follow_motion

  !> One march of a contact that stays closed, from a given slider.
  subroutine march_period(motion, rules, forces, slider, loop, only_end)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(inout) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> What is wanted
    type(contact_forces_type), intent(in) :: forces
    !> Slider at the start
    real(wp), intent(in) :: slider(2)
    !> The period
    type(loop_type), intent(out) :: loop
    !> Is only the slider at the end wanted, and how it follows the start?
    logical, intent(in), optional :: only_end
    type(disc_state_type) :: state
    type(slip_panel_type) :: panel
    real(wp), allocatable :: by_start(:, :)
    logical :: keeps
    integer :: columns

    keeps = .true.
    if (present(only_end)) keeps = .not. only_end
    columns = columns_of(motion, forces%without_jacobian .or. .not. keeps, .not. (forces%without_jacobian .and. keeps))
    loop%record = new_record(0.0_wp, size(motion%series, 2), size(forces%deviation, 1), columns, columns > 2, keeps, &
                             rules)
    panel = new_slip_panel(rules, merge(max(size(motion%series, 2), size(forces%deviation, 1)), size(motion%series, 2), keeps))
    allocate (by_start(columns, 2), loop%by_slider(columns, 2), source=0.0_wp)
    if (columns > 0) by_start(columns - 1:, :) = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    loop%start = slider
    call start_at(motion, 0.0_wp, slider, by_start, loop%record, state, loop%entered)
    call march_disc(motion, rules, 0.0_wp, two_pi, .false., panel, state, loop%record)
    if (.not. loop%record%failed) call slider_at(motion, two_pi, loop%record, state, loop%slider, loop%by_slider)
  end subroutine march_period

  !> The period that closes, P(w) = w, by Newton's method from a slider; where it does not converge, the march from where it came to.
  subroutine close_period(motion, rules, forces, slider, loop)
    !> Motion of the contact; rules of panels
    type(disc_motion_type), intent(inout) :: motion
    type(disc_rules_type), intent(in) :: rules
    !> What is wanted
    type(contact_forces_type), intent(in) :: forces
    !> Where it begins
    real(wp), intent(in) :: slider(2)
    !> The period
    type(loop_type), intent(out) :: loop
    !> Marches at most; a defect that is rounding, a last step, over the largest radius
    integer, parameter :: most_marches = 60 ! guess
    real(wp), parameter :: rounding = 2.0e-13_wp, last = 1.0e-9_wp ! derived
    real(wp) :: w(2), defect(2), step(2), before
    integer :: i

    w = slider
    before = huge(1.0_wp)
    do i = 1, most_marches
      call march_period(motion, rules, forces, w, loop, only_end=.true.)
      if (loop%record%failed) return
      defect = loop%slider - w
      if (norm2(defect) <= rounding*motion%largest) exit
      step = reshape(released(holding_of(loop%by_slider), reshape(defect, [2, 1])), [2])
      ! A period's own step, where Newton's leads away: sliders never part, so that it cannot.
      if (.not. norm2(step) < motion%largest .or. (norm2(defect) > 0.7_wp*before .and. modulo(i, 3) == 0)) step = defect
      before = norm2(defect)
      w = w + step
      if (max(norm2(step), norm2(defect)) <= last*motion%largest) exit
    end do
    call march_period(motion, rules, forces, w, loop)
  end subroutine close_period

  !> I - dP/dw.
  pure function holding_of(by_slider) result(holding)
    !> Derivative of the slider at the end, the start slider's columns last [columns, 2]
    real(wp), intent(in) :: by_slider(:, :)
    real(wp) :: holding(2, 2)
    integer :: i

    holding = -kept*transpose(by_slider(size(by_slider, 1) - 1:, :))
    do i = 1, 2
      holding(i, i) = holding(i, i) + 1.0_wp
    end do
  end function holding_of
end module attrito_contact_disc_loop
