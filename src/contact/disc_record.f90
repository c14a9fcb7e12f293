!> What a march of a contact with two tangents carries along, and what it leaves for Fourier integrals: intervals in their order, the
!> slider of each interval of stick, and the nodes of each interval of slip.
!>
!> $$ \int e_m T \, d\theta \approx \sum_i w_i \, e_m(\theta_i) \, k_t r_i e(\phi_i) \quad \text{(slip)}, \qquad
!>    -k_t w \int e_m \, d\theta \quad \text{(stick)} $$
!>
!> Derivatives are columns: first by the 3 k coefficients of the motion, if they are wanted, then by the start slider if there
!> is one.
module attrito_contact_disc_record
  use attrito_core_kinds, only: wp, pi
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_slip_panel, only: slip_panel_type
  implicit none
  private
  public :: disc_state_type, disc_record_type, new_record, leave_rim, enter_rim

  type :: disc_state_type
    !> Does it slip? If not, is its slider on the rim of the disc, where slip has just ended?
    logical :: slips = .false., on_rim = .false.
    !> Direction of slip; slider, and its derivative by columns [columns, 2], of phi [columns]
    real(wp) :: phi = 0.0_wp, slider(2) = 0.0_wp
    real(wp), allocatable :: by_phi(:), by_slider(:, :)
  end type disc_state_type

  type :: disc_record_type
    !> Is anything kept but where the march ends? Are derivatives by the motion carried? Has the march failed?
    logical :: keeps = .true., by_motion = .true., failed = .false.
    !> Number of columns
    integer :: columns = 0
    !> Intervals that follow each other: ends [0:intervals], and regimes [intervals]
    integer :: intervals = 0
    real(wp), allocatable :: ends(:)
    integer, allocatable :: regimes(:)
    !> Sliders of intervals of stick, and their derivatives [2, intervals], [columns, 2, intervals]; anything in the others
    real(wp), allocatable :: sliders(:, :), by_sliders(:, :, :)
    !> Fourier coefficients of the force over k_t in slip [e, 2]
    real(wp), allocatable :: slip_force(:, :)
    !> Nodes of slip: how many; 1, cos, sin, ... with their weights [k, nodes]; derivatives of r e [columns, 2, nodes]
    integer :: nodes = 0
    real(wp), allocatable :: basis(:, :), gradient(:, :, :)
  contains
    procedure :: add_interval
    procedure :: add_nodes
  end type disc_record_type

  !> Room for intervals and nodes at first
  integer, parameter :: few_intervals = 16, few_nodes = 128 ! conventional

contains

  !> Nothing yet.
  function new_record(from, coefficients, extended, columns, by_motion, keeps) result(self)
    !> Where the march begins
    real(wp), intent(in) :: from
    !> Of the motion a row; of forces; number of columns
    integer, intent(in) :: coefficients, extended, columns
    !> Are the first 3 k columns those of the motion? Is all to be kept?
    logical, intent(in) :: by_motion, keeps
    type(disc_record_type) :: self

    self%keeps = keeps
    self%by_motion = by_motion
    self%columns = columns
    if (.not. keeps) return
    allocate (self%ends(0:few_intervals), self%regimes(few_intervals), self%sliders(2, few_intervals))
    allocate (self%by_sliders(columns, 2, few_intervals), self%slip_force(extended, 2))
    allocate (self%basis(coefficients, few_nodes), self%gradient(columns, 2, few_nodes))
    self%ends(0) = from
    self%slip_force = 0.0_wp
  end function new_record

  !> One more interval, from the end of the last one.
  subroutine add_interval(self, to, regime, state)
    class(disc_record_type), intent(inout) :: self
    !> Its end
    real(wp), intent(in) :: to
    !> One of `regime_...`
    integer, intent(in) :: regime
    !> In stick: the slider
    type(disc_state_type), intent(in) :: state
    real(wp), allocatable :: ends(:), sliders(:, :), by_sliders(:, :, :)
    integer, allocatable :: regimes(:)
    integer :: n

    if (.not. self%keeps) return
    n = self%intervals
    if (to <= self%ends(n)) return
    if (n == size(self%regimes)) then
      allocate (ends(0:2*n), regimes(2*n), sliders(2, 2*n), by_sliders(self%columns, 2, 2*n))
      ends(:n) = self%ends
      regimes(:n) = self%regimes
      sliders(:, :n) = self%sliders
      by_sliders(:, :, :n) = self%by_sliders
      call move_alloc(ends, self%ends)
      call move_alloc(regimes, self%regimes)
      call move_alloc(sliders, self%sliders)
      call move_alloc(by_sliders, self%by_sliders)
    end if
    n = n + 1
    self%intervals = n
    self%ends(n) = to
    self%regimes(n) = regime
    self%sliders(:, n) = state%slider
    if (self%columns > 0) self%by_sliders(:, :, n) = state%by_slider
  end subroutine add_interval

  !> The nodes of a panel of slip: the force k_t r e, and its derivative r e_perp dphi + e dr.
  subroutine add_nodes(self, motion, panel, by_phi)
    class(disc_record_type), intent(inout) :: self
    !> Motion of the contact
    type(disc_motion_type), intent(in) :: motion
    !> The panel, solved
    type(slip_panel_type), intent(in) :: panel
    !> Derivatives of phi at the nodes [columns, s]
    real(wp), intent(in), contiguous :: by_phi(:, :)
    real(wp), allocatable :: basis(:, :), gradient(:, :, :)
    real(wp) :: weight
    integer :: a, i, k, n

    if (.not. self%keeps) return
    k = 2*motion%harmonics + 1
    n = self%nodes + size(panel%weight)
    if (n > size(self%basis, 2)) then
      allocate (basis(k, 2*n), gradient(self%columns, 2, 2*n))
      basis(:, :self%nodes) = self%basis(:, :self%nodes)
      gradient(:, :, :self%nodes) = self%gradient(:, :, :self%nodes)
      call move_alloc(basis, self%basis)
      call move_alloc(gradient, self%gradient)
    end if
    do i = 1, size(panel%weight)
      n = self%nodes + i
      weight = panel%weight(i)/pi
      associate (r => panel%jet(3, i), e => panel%e(:, i), at => panel%basis(:, i))
        do a = 1, 2
          self%slip_force(1, a) = self%slip_force(1, a) + 0.5_wp*weight*r*e(a)
          self%slip_force(2:, a) = self%slip_force(2:, a) + (weight*r*e(a))*at(2:)
        end do
        if (.not. self%by_motion) cycle
        self%basis(1, n) = 0.5_wp*weight
        self%basis(2:, n) = weight*at(2:k)
        self%gradient(:, 1, n) = -r*e(2)*by_phi(:, i)
        self%gradient(:, 2, n) = r*e(1)*by_phi(:, i)
        do a = 1, 2
          self%gradient(2*k + 1:3*k, a, n) = self%gradient(2*k + 1:3*k, a, n) + (motion%slope*e(a))*at(:k)
        end do
      end associate
    end do
    self%nodes = self%nodes + size(panel%weight)
  end subroutine add_nodes

  !> Slip ends, or is looked at: the slider is at w = u - r e, dw = du - e dr - r e_perp dphi.
  pure subroutine leave_rim(motion, basis, jet, by_motion, state)
    !> Motion of the contact, and its values at the instant
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: basis(:), jet(6)
    !> Are the first 3 k columns those of the motion?
    logical, intent(in) :: by_motion
    !> Slips before, sticks after
    type(disc_state_type), intent(inout) :: state
    real(wp) :: e(2)
    integer :: k

    e = [cos(state%phi), sin(state%phi)]
    state%slider = jet(1:2) - jet(3)*e
    state%slips = .false.
    state%on_rim = .true.
    state%by_slider(:, 1) = (jet(3)*e(2))*state%by_phi
    state%by_slider(:, 2) = -(jet(3)*e(1))*state%by_phi
    if (.not. by_motion) return
    k = 2*motion%harmonics + 1
    state%by_slider(:k, 1) = state%by_slider(:k, 1) + basis(:k)
    state%by_slider(k + 1:2*k, 2) = state%by_slider(k + 1:2*k, 2) + basis(:k)
    state%by_slider(2*k + 1:3*k, 1) = state%by_slider(2*k + 1:3*k, 1) - (motion%slope*e(1))*basis(:k)
    state%by_slider(2*k + 1:3*k, 2) = state%by_slider(2*k + 1:3*k, 2) - (motion%slope*e(2))*basis(:k)
  end subroutine leave_rim

  !> Slip begins: its direction is that of z = u - w, dphi = e_perp.(du - dw)/|z|. (At an onset both sides turn alike, so that its
  !> instant leaves no term.)
  pure subroutine enter_rim(motion, basis, jet, by_motion, state)
    !> Motion of the contact, and its values at the instant
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: basis(:), jet(6)
    !> Are the first 3 k columns those of the motion?
    logical, intent(in) :: by_motion
    !> Sticks before, slips after
    type(disc_state_type), intent(inout) :: state
    real(wp) :: z(2), aside(2)
    integer :: k

    z = jet(1:2) - state%slider
    state%phi = atan2(z(2), z(1))
    state%slips = .true.
    aside = [-z(2), z(1)]/dot_product(z, z)
    state%by_phi = -aside(1)*state%by_slider(:, 1) - aside(2)*state%by_slider(:, 2)
    if (.not. by_motion) return
    k = 2*motion%harmonics + 1
    state%by_phi(:k) = state%by_phi(:k) + aside(1)*basis(:k)
    state%by_phi(k + 1:2*k) = state%by_phi(k + 1:2*k) + aside(2)*basis(:k)
  end subroutine enter_rim
end module attrito_contact_disc_record
