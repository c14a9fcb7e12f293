!> Forces of a contact at the end of an increment of a quasi-static path, along which its displacements go straight:
!>
!> $$ u(s) = u_a + s (u_b - u_a), \qquad v(s) = v_a + s (v_b - v_a), \qquad 0 \le s \le 1 $$
!>
!> Sliders are where the law takes them along that line, exactly: landing, onset of slip and the turn of its direction included
!> (`attrito_contact_friction_disc`; one tangent: clamps at landing and at both ends). What an increment is off by is that the
!> path bends within it: the cube of its length, so a path is of second order.
!>
!> The path has a corner where an open contact lands, and the slider of one that sticks from then on stays where it has landed. On
!> the line through both ends that place is off by the first power of the length. So the contact lands where it would if its motion
!> went on as in the increment before, and goes straight from there.
!>
!> An increment of no length moves no slider, not even one whose contact just touches without force: Newton's method, which begins
!> there, first tries whether all contacts that touch stick.
module attrito_contact_straight_increment
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_friction_disc, only: differentiate_slide_on_disc, set_out_type
  use attrito_contact_state, only: state_stuck, state_shaken_down, state_open
  implicit none
  private
  public :: increment_type, follow_increment, evaluate_increment

  !> Part of displacements that is rounding
  real(wp), parameter :: rounding = 4.0_wp*epsilon(1.0_wp) ! derived

  !> What a contact comes to
  type :: increment_type
    logical :: closed = .false.
    !> T and N [tangents + 1], and their derivatives by the displacements at the end [3, 3]
    real(wp) :: force(3) = 0.0_wp, stiffness(3, 3) = 0.0_wp
    !> Derivatives by the displacements of the sum of all elements' k_t w [2, 3]
    real(wp) :: by_motion(2, 3) = 0.0_wp
    !> Sliders, in pairs, one an element [as were given]; has any of them moved, or is the contact open?
    real(wp), allocatable :: slider(:)
    logical :: moves = .false.
  end type increment_type

contains

  !> From one place to another.
  subroutine follow_increment(law, from, as_before, to, slider, increment)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Relative displacements at the start, at the end if they went on as in the increment before, and at the end [tangents + 1];
    !> sliders at the start [at least 2 elements]
    real(wp), intent(in) :: from(:), as_before(:), to(:), slider(:)
    !> What it comes to
    type(increment_type), intent(out) :: increment
    type(contact_type) :: element
    real(wp) :: by_motion(2, 3)
    logical :: moves
    integer :: i, k

    increment%slider = slider
    associate (n => law%tangents, normal => law%normal_force(to(law%tangents + 1)))
      increment%closed = normal >= law%touching_force(to(n + 1:n + 1))
      increment%moves = .not. increment%closed
      if (increment%closed) then
        increment%force(n + 1) = max(normal, 0.0_wp)
        increment%stiffness(n + 1, n + 1) = law%normal_stiffness
      end if
      do i = 1, law%elements()
        element = law%element(i)
        associate (w => increment%slider(2*i - 1:2*i), kt => element%tangential_stiffness)
          call move_slider(element, from, as_before, to, increment%closed, w, by_motion, moves)
          increment%moves = increment%moves .or. moves
          increment%force(:n) = increment%force(:n) + kt*(to(:n) - w(:n))
          increment%by_motion = increment%by_motion + kt*by_motion
          do k = 1, n
            increment%stiffness(k, k) = increment%stiffness(k, k) + kt
          end do
        end associate
      end do
      increment%stiffness(:n, :) = increment%stiffness(:n, :) - increment%by_motion(:n, :)
    end associate
  end subroutine follow_increment

  !> The slider of one element.
  subroutine move_slider(law, from, as_before, to, closed, w, by_motion, moves)
    !> Contact of one element
    type(contact_type), intent(in) :: law
    !> Relative displacements as above [tangents + 1]
    real(wp), intent(in) :: from(:), as_before(:), to(:)
    !> Does it touch at the end?
    logical, intent(in) :: closed
    !> Slider, in one tangent the first number of it
    real(wp), intent(inout) :: w(2)
    !> Its derivative by the displacements at the end [2, 3]
    real(wp), intent(out) :: by_motion(2, 3)
    !> Has it moved?
    logical, intent(out) :: moves
    real(wp) :: radius(3), slope(3), start(law%tangents)

    by_motion = 0.0_wp
    associate (n => law%tangents)
      moves = .not. (closed .and. rests(from, to) .and. norm2(to(:n) - w(:n)) <= rounding*norm2(to(:n)))
      if (.not. moves) return
      call law%slip_force(law%normal_force([from(n + 1), as_before(n + 1), to(n + 1)]), radius, slope)
      radius = radius/law%tangential_stiffness
      slope = slope*law%normal_stiffness/law%tangential_stiffness
      start = from(:n)
      if (radius(1) <= 0.0_wp .and. radius(2) > 0.0_wp) then
        start = start - radius(1)/(radius(2) - radius(1))*(as_before(:n) - start)
        radius(1) = 0.0_wp
      end if
      if (n == 1) then
        call slide_straight(start(1), to(1), radius([1, 3]), slope(3), w(1), by_motion(1, :), moves)
      else
        call slide_in_plane(start, to(:2), radius([1, 3]), slope(3), w, by_motion)
        moves = any(abs(by_motion) > 0.0_wp) .or. radius(1) <= 0.0_wp
      end if
    end associate
  end subroutine move_slider

  !> Is there no increment, but for rounding?
  pure logical function rests(from, to)
    !> Relative displacements at the start and the end [tangents + 1]
    real(wp), intent(in) :: from(:), to(:)

    rests = all(abs(to - from) <= rounding*(abs(to) + abs(from)))
  end function rests

  !> One tangent: u - r and u + r are linear, so the slider is out of what is between them at an end or nowhere.
  pure subroutine slide_straight(u_a, u_b, r, slope, w, by_motion, moves)
    !> Displacement at the start and the end; slip radius there, where open less than zero by what is missing, and its derivative by v
    !> at the end
    real(wp), intent(in) :: u_a, u_b, r(2), slope
    !> Slider, and its derivative by (u, v) at the end
    real(wp), intent(inout) :: w, by_motion(:)
    !> Has it moved?
    logical, intent(out) :: moves
    real(wp) :: time

    if (r(2) <= 0.0_wp) then
      w = u_b
      by_motion(1) = 1.0_wp
      moves = .true.
      return
    end if
    moves = r(1) <= 0.0_wp
    if (moves) then
      time = -r(1)/(r(2) - r(1))
      w = u_a + time*(u_b - u_a)
      by_motion(:2) = [time, -time*slope/(r(2) - r(1))*(u_b - u_a)]
    else
      w = min(max(w, u_a - r(1)), u_a + r(1))
    end if
    if (abs(u_b - w) <= r(2) + rounding*(abs(u_b) + r(2))) return
    moves = .true.
    by_motion(:2) = [1.0_wp, sign(1.0_wp, w - u_b)*slope]
    w = u_b + sign(r(2), w - u_b)
  end subroutine slide_straight

  !> Two tangents.
  subroutine slide_in_plane(u_a, u_b, r, slope, w, by_motion)
    !> Displacement at the start and the end; slip radius there, where open less than zero by what is missing, and its derivative by v
    !> at the end
    real(wp), intent(in) :: u_a(2), u_b(2), r(2), slope
    !> Slider, and its derivative by (u1, u2, v) at the end [2, 3]
    real(wp), intent(inout) :: w(2), by_motion(2, 3)
    real(wp) :: gradient(5, 2), gradients(5, 2, 1), slider(1, 2)
    integer :: regimes(1)

    gradient = 0.0_wp
    call differentiate_slide_on_disc(reshape(u_b, [1, 2]), r(2:2), reshape([1.0_wp], [1, 1]), [slope], w, gradient, slider, &
                                     gradients, regimes, set_out_type(u_a, r(1), 0.0_wp, [0.0_wp]))
    by_motion = transpose(gradients(:3, :, 1))
  end subroutine slide_in_plane

  !> The same as the forces of a period in which nothing moves about the mean.
  subroutine evaluate_increment(law, from, as_before, motion, slider, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Relative displacements at the start, and at the end if they went on as in the increment before [tangents + 1]
    real(wp), intent(in) :: from(:), as_before(:)
    !> Coefficients of relative displacement, only the mean of which is not zero [k, tangents + 1]
    real(wp), intent(in) :: motion(:, :)
    !> Sliders at the start, in pairs, one an element [at least 2 elements]
    real(wp), intent(in) :: slider(:)
    !> Forces; `deviation` is allocated by the caller, for as many coefficients as it wants; sliders are those at the end
    type(contact_forces_type), intent(inout) :: forces
    type(increment_type) :: increment
    integer :: i, j, k

    call follow_increment(law, from, as_before, motion(1, :), slider, increment)
    k = size(motion, 1)
    forces%periodic = .false.
    forces%slider = increment%slider
    forces%moved = 0.0_wp*slider
    forces%may_stick = increment%closed
    forces%unique = .not. increment%closed
    forces%slip = 0.0_wp
    forces%stick = merge(1.0_wp, 0.0_wp, increment%closed)
    forces%open = 1.0_wp - forces%stick
    if (forces%lists_slip) forces%slips = reshape([real(wp) ::], [2, 0])
    forces%state = merge(merge(state_shaken_down, state_stuck, increment%moves), state_open, increment%closed)
    associate (n => law%tangents, g => forces%deviation)
      g = 0.0_wp
      do i = 1, n
        g(1, i) = law%slider_force(i, increment%slider)
      end do
      g(1, n + 1) = merge(law%normal_force(0.0_wp), -law%normal_stiffness*motion(1, n + 1), increment%closed)
      forces%active = [((j == 1 .and. increment%moves .and. (i <= n .or. .not. increment%closed), j=1, k), i=1, n + 1)]
      if (allocated(forces%jacobian)) deallocate (forces%jacobian)
      if (.not. increment%moves) return
      allocate (forces%jacobian(k*(n + 1), k*(n + 1)), source=0.0_wp)
      do i = 1, n + 1
        forces%jacobian(1:k*n:k, k*(i - 1) + 1) = -increment%by_motion(:n, i)
      end do
      if (.not. increment%closed) forces%jacobian(k*n + 1, k*n + 1) = -law%normal_stiffness
    end associate
  end subroutine evaluate_increment
end module attrito_contact_straight_increment
