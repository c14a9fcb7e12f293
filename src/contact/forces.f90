!> Forces of one contact over one period, as every quadrature leaves them: the deviation g of lambda = K_c d + g, its Jacobian, and
!> what the contact does.
module attrito_contact_forces
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_state, only: state_stuck
  implicit none
  private
  public :: contact_forces_type, periodic_slider_type, stay_stuck, hold_slider, released

  !> Two tangents: the start slider w of a period that is to leave it where it was, w = P(w, d). A change of motion moves it by
  !> holding^-1 P_d delta d, holding = I - dP/dw, and the forces g by g_w times that.
  type :: periodic_slider_type
    !> I - dP/dw [2, 2], a little larger where a period keeps the slider (dP/dw = 1)
    real(wp) :: holding(2, 2) = 0.0_wp
    !> P_d [2, k rows] and g_w [k rows, 2]
    real(wp), allocatable :: by_motion(:, :), force(:, :)
  end type periodic_slider_type

  !> Forces of one contact over one period, with k coefficients of motion and e >= k of force
  type :: contact_forces_type
    !> Deviation g [e, rows]
    real(wp), allocatable :: deviation(:, :)
    !> d g / d d [k rows, k rows], if any entry is active, a periodic slider following the motion; a row of the contact has its k
    !> coefficients together
    real(wp), allocatable :: jacobian(:, :)
    !> Which rows of the Jacobian are not zero [k rows]
    logical, allocatable :: active(:)
    !> Are the deviation, state, fractions and sliders all that is wanted? Jacobian, `unique` and `may_stick` mean nothing then
    logical :: without_jacobian = .false.
    !> Sliders at the start of the period, and what the period moves them by, in pairs, one an element [as were given]
    real(wp), allocatable :: slider(:), moved(:)
    !> Two tangents, not a steady period: mean before, from which a period that is marched once goes on to its own [rows]
    real(wp), allocatable :: mean_before(:)
    !> Is the slider at the start of the period to be found with the motion, and how does it depend on it?
    logical :: periodic = .false.
    type(periodic_slider_type) :: link
    !> Two tangents: has the slider been found within the evaluation, by several marches? As an unknown it takes one
    logical :: closed_here = .false.
    !> Two tangents: is there a place where the slider would rest all over the period?
    logical :: may_stick = .false.
    !> One of `state_...`
    integer :: state = state_stuck
    !> Fractions of the period
    real(wp) :: stick = 1.0_wp, slip = 0.0_wp, open = 0.0_wp
    !> Are intervals of slip to be listed, and these, from and to [2, intervals]
    logical :: lists_slip = .false.
    real(wp), allocatable :: slips(:, :)
    !> Is the steady loop of this motion the same whatever the start slider?
    logical :: unique = .false.
  contains
    procedure :: follows
  end type contact_forces_type

contains

  !> Does a periodic slider move with the motion? At rest it does not.
  pure logical function follows(self)
    class(contact_forces_type), intent(in) :: self

    follows = self%periodic .and. allocated(self%jacobian)
  end function follows

  !> A contact that stays stuck: a constant deviation, no Jacobian, its slider where it was.
  pure subroutine stay_stuck(law, slider, coefficients, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> [at least 2 elements]
    real(wp), intent(in) :: slider(:)
    !> Of motion a row
    integer, intent(in) :: coefficients
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces

    call hold_slider(law, slider, forces)
    forces%moved = slider
    forces%moved(:) = 0.0_wp
    forces%may_stick = .true.
    forces%unique = .false.
    forces%closed_here = .false.
    forces%active = spread(.false., 1, coefficients*(law%tangents + 1))
    if (allocated(forces%jacobian)) deallocate (forces%jacobian)
  end subroutine stay_stuck

  !> What a stuck contact is, without the rounding of samples or events: one that is not evaluated again is then what it would be.
  pure subroutine hold_slider(law, slider, forces)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> [at least 2 elements]
    real(wp), intent(in) :: slider(:)
    !> Forces of one contact over the period, and their derivatives
    type(contact_forces_type), intent(inout) :: forces
    integer :: i

    associate (n => law%tangents)
      forces%deviation = 0.0_wp
      do i = 1, n
        forces%deviation(1, i) = law%slider_force(i, slider)
      end do
      forces%deviation(1, n + 1) = law%normal_force(0.0_wp)
    end associate
    forces%slider = slider
    forces%state = state_stuck
    forces%stick = 1.0_wp
    forces%slip = 0.0_wp
    forces%open = 0.0_wp
    if (forces%lists_slip) forces%slips = reshape([real(wp) ::], [2, 0])
  end subroutine hold_slider

  !> holding^-1 columns, of a 2 x 2 matrix.
  pure function released(holding, columns)
    !> Derivative of the slider's condition by the slider; right-hand sides
    real(wp), intent(in) :: holding(2, 2), columns(:, :)
    real(wp) :: released(2, size(columns, 2))
    real(wp) :: inverse(2, 2)

    inverse = reshape([holding(2, 2), -holding(2, 1), -holding(1, 2), holding(1, 1)], [2, 2])
    released = matmul(inverse, columns)/(holding(1, 1)*holding(2, 2) - holding(1, 2)*holding(2, 1))
  end function released
end module attrito_contact_forces
