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
  use attrito_core_lapack, only: add_transposed_product
  use attrito_contact_disc_motion, only: disc_motion_type
  use attrito_contact_disc_rules, only: disc_rules_type, usual_nodes
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
    !> Its derivatives [k, 2 columns]
    real(wp), allocatable :: by_slip(:, :)
    !> Nodes of slip that are not in it yet: how many; 1, cos, sin, ... with their weights [room, k]; derivatives of r e
    !> [room, columns, 2]
    integer :: nodes = 0
    real(wp), allocatable :: basis(:, :), gradient(:, :, :)
    !> Allocated: panels of slip in their order, and how many there are
    type(slip_panel_type), allocatable :: panels(:)
    integer :: listed = 0
  contains
    procedure :: add_interval
    procedure :: add_nodes
    procedure :: flush_nodes
  end type disc_record_type

  !> Room for intervals at first; room for nodes, at most and in numbers: what is larger is given back to the system each time
  integer, parameter :: few_intervals = 16, most_nodes = 128, room = 8192 ! conventional

contains

  !> Nothing yet.
  function new_record(from, coefficients, extended, columns, by_motion, keeps, rules) result(self)
    !> Where the march begins
    real(wp), intent(in) :: from
    !> Of the motion a row; of forces; number of columns
    integer, intent(in) :: coefficients, extended, columns
    !> Are the first 3 k columns those of the motion? Is all to be kept?
    logical, intent(in) :: by_motion, keeps
    !> Of panels, if there are to be any
    type(disc_rules_type), intent(in), optional :: rules
    type(disc_record_type) :: self
    integer :: panels

    self%keeps = keeps
    self%by_motion = by_motion
    self%columns = columns
    if (.not. keeps) return
    allocate (self%ends(0:few_intervals), self%regimes(few_intervals), self%sliders(2, few_intervals))
    allocate (self%by_sliders(columns, 2, few_intervals), self%slip_force(extended, 2))
    self%ends(0) = from
    self%slip_force = 0.0_wp
    if (.not. present(rules)) return
    if (rules%lists_panels) allocate (self%panels(0))
    if (.not. by_motion) return
    associate (nodes => rules%radau%nodes)
      panels = max(min(most_nodes, room/(2*columns + coefficients))/nodes, 2)
      allocate (self%by_slip(coefficients, 2*columns), source=0.0_wp)
      allocate (self%basis(panels*nodes, coefficients), self%gradient(panels*nodes, columns, 2))
    end associate
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
    type(slip_panel_type), intent(inout) :: panel
    !> Derivatives of phi at the nodes [s, columns]
    real(wp), intent(in), contiguous :: by_phi(:, :)
    real(wp) :: part(size(panel%weight), 2)
    integer :: a, k, known, last, n, s

    if (allocated(self%panels)) call list_panel(self, panel)
    if (.not. self%keeps) return
    s = size(panel%weight)
    do a = 1, 2
      part(:, a) = panel%weight/pi*panel%jet(:, 3)*panel%e(:, a)
    end do
    known = merge(0, motion%harmonics, motion%is_cubic)
    last = size(self%slip_force, 1)/2
    if (s == usual_nodes) then
      call add_force(usual_nodes, known, last, panel%theta, part, panel%basis, self%slip_force)
    else
      call add_force(s, known, last, panel%theta, part, panel%basis, self%slip_force)
    end if
    if (.not. self%by_motion) return
    k = 2*motion%harmonics + 1
    if (self%nodes + s > size(self%basis, 1)) call self%flush_nodes()
    n = self%nodes + 1
    self%nodes = self%nodes + s
    part(:, 1) = -panel%jet(:, 3)*panel%e(:, 2)
    part(:, 2) = panel%jet(:, 3)*panel%e(:, 1)
    associate (weight => panel%weight/pi, room => size(self%basis, 1))
      if (s == usual_nodes) then
        call add_gradient(usual_nodes, k, self%columns, room, n, weight, part, panel%slope, panel%e, panel%basis, by_phi, &
                          self%basis, self%gradient)
      else
        call add_gradient(s, k, self%columns, room, n, weight, part, panel%slope, panel%e, panel%basis, by_phi, &
                          self%basis, self%gradient)
      end if
    end associate
  end subroutine add_nodes

  !> Nodes for the force's derivatives, on plain arrays, as below.
  pure subroutine add_gradient(n, k, columns, room, first, weight, across, slope, e, basis, by_phi, weighted, gradient)
    !> s; coefficients of the motion a row; columns of derivatives; room for nodes, and where these begin in it
    integer, value :: n, k, columns, room, first
    !> Weights over pi; r e_perp, dr/dv and e at the nodes
    real(wp), intent(in) :: weight(n), across(n, 2), slope(n), e(n, 2)
    !> 1, cos, sin, ...; derivatives of phi
    real(wp), intent(in) :: basis(n, k), by_phi(n, columns)
    !> Those with their weights; derivatives of r e
    real(wp), intent(inout) :: weighted(room, k), gradient(room, columns, 2)
    real(wp) :: along(n)
    integer :: a, c

    weighted(first:first + n - 1, 1) = 0.5_wp*weight
    do c = 2, k
      weighted(first:first + n - 1, c) = weight*basis(:, c)
    end do
    do a = 1, 2
      along = slope*e(:, a)
      do c = 1, columns
        if (c > 2*k .and. c <= 3*k) then
          gradient(first:first + n - 1, c, a) = across(:, a)*by_phi(:, c) + along*basis(:, c - 2*k)
        else
          gradient(first:first + n - 1, c, a) = across(:, a)*by_phi(:, c)
        end if
      end do
    end do
  end subroutine add_gradient

  !> Coefficients of the force at the nodes, on plain arrays, whose size is handed over by value: compilers then make code of its own
  !> for the usual one.
  pure subroutine add_force(n, known, last, theta, part, basis, force)
    !> s; harmonics that the basis has; highest harmonic of the force
    integer, value :: n, known, last
    !> The nodes, and the force there with their weights
    real(wp), intent(in) :: theta(n), part(n, 2)
    !> 1, cos, sin, ...; coefficients of the force
    real(wp), intent(inout) :: basis(n, 2*last + 1), force(2*last + 1, 2)
    real(wp) :: c(n), s(n), product(n)
    integer :: a, h, i, half

    do a = 1, 2
      force(1, a) = force(1, a) + 0.5_wp*sum(part(:, a))
    end do
    if (last == 0) return
    if (known == 0) then
      basis(:, 1) = 1.0_wp
      c = cos(theta)
      s = sin(theta)
    else
      c = basis(:, 2)
      s = basis(:, 3)
    end if
    half = n/2
    do h = 1, last
      if (h > max(known, 1)) then
        basis(:, 2*h) = basis(:, 2*h - 2)*c - basis(:, 2*h - 1)*s
        basis(:, 2*h + 1) = basis(:, 2*h - 1)*c + basis(:, 2*h - 2)*s
      else if (known == 0) then
        basis(:, 2) = c
        basis(:, 3) = s
      end if
      do a = 1, 2
        do i = 2*h, 2*h + 1
          product = part(:, a)*basis(:, i)
          force(i, a) = force(i, a) + sum(product(:half) + product(n - half + 1:))
          if (2*half < n) force(i, a) = force(i, a) + product(half + 1)
        end do
      end do
    end do
  end subroutine add_force

  !> One more panel of the list.
  subroutine list_panel(self, panel)
    type(disc_record_type), intent(inout) :: self
    !> The panel, solved
    type(slip_panel_type), intent(in) :: panel
    type(slip_panel_type), allocatable :: more(:)

    if (self%listed == size(self%panels)) then
      allocate (more(2*self%listed + few_intervals))
      more(:self%listed) = self%panels
      call move_alloc(more, self%panels)
    end if
    self%listed = self%listed + 1
    self%panels(self%listed) = panel
  end subroutine list_panel

  !> Add the nodes to the derivatives of the force.
  subroutine flush_nodes(self)
    class(disc_record_type), intent(inout) :: self

    if (self%nodes == 0) return
    associate (room => size(self%basis, 1), k => size(self%basis, 2))
      call add_transposed_product(k, 2*self%columns, self%nodes, self%basis, room, self%gradient, room, self%by_slip)
    end associate
    self%nodes = 0
  end subroutine flush_nodes

  !> Slip ends, or is looked at: the slider is at w = u - r e, dw = du - e dr - r e_perp dphi. If r' jumps there, so that r stays and
  !> the instant moves, dw = du - e (u'.e/v') dv - r e_perp dphi.
  pure subroutine leave_rim(motion, theta, by_motion, at_kink, state)
    !> Motion of the contact; the instant
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: theta
    !> Are the first 3 k columns those of the motion?
    logical, intent(in) :: by_motion
    !> Does slip end because r' jumps?
    logical, intent(in) :: at_kink
    !> Slips before, sticks after
    type(disc_state_type), intent(inout) :: state
    real(wp) :: basis(2*motion%harmonics + 1), jet(6), e(2), pressing(2), slope(2)
    integer :: k

    jet = motion%at(theta)
    e = [cos(state%phi), sin(state%phi)]
    state%slider = jet(1:2) - jet(3)*e
    state%slips = .false.
    state%on_rim = .true.
    state%by_slider(:, 1) = (jet(3)*e(2))*state%by_phi
    state%by_slider(:, 2) = -(jet(3)*e(1))*state%by_phi
    if (.not. by_motion) return
    k = 2*motion%harmonics + 1
    basis = motion%basis_at(theta)
    slope = motion%slope_at(theta)
    if (at_kink) then
      pressing = motion%pressing_at(theta)
      slope(1) = motion%pressing*dot_product(jet(4:5), e)/pressing(2)
    end if
    state%by_slider(:k, 1) = state%by_slider(:k, 1) + basis(:k)
    state%by_slider(k + 1:2*k, 2) = state%by_slider(k + 1:2*k, 2) + basis(:k)
    state%by_slider(2*k + 1:3*k, 1) = state%by_slider(2*k + 1:3*k, 1) - (slope(1)*e(1))*basis(:k)
    state%by_slider(2*k + 1:3*k, 2) = state%by_slider(2*k + 1:3*k, 2) - (slope(1)*e(2))*basis(:k)
  end subroutine leave_rim

  !> Slip begins: its direction is that of z = u - w, dphi = e_perp.(du - dw)/|z|. (At an onset both sides turn alike, so that its
  !> instant leaves no term.)
  pure subroutine enter_rim(motion, theta, by_motion, state)
    !> Motion of the contact; the instant
    type(disc_motion_type), intent(in) :: motion
    real(wp), intent(in) :: theta
    !> Are the first 3 k columns those of the motion?
    logical, intent(in) :: by_motion
    !> Sticks before, slips after
    type(disc_state_type), intent(inout) :: state
    real(wp) :: basis(2*motion%harmonics + 1), jet(6), z(2), aside(2)
    integer :: k

    jet = motion%at(theta)
    z = jet(1:2) - state%slider
    state%phi = atan2(z(2), z(1))
    state%slips = .true.
    aside = [-z(2), z(1)]/dot_product(z, z)
    state%by_phi = -aside(1)*state%by_slider(:, 1) - aside(2)*state%by_slider(:, 2)
    if (.not. by_motion) return
    k = 2*motion%harmonics + 1
    basis = motion%basis_at(theta)
    state%by_phi(:k) = state%by_phi(:k) + aside(1)*basis(:k)
    state%by_phi(k + 1:2*k) = state%by_phi(k + 1:2*k) + aside(2)*basis(:k)
  end subroutine enter_rim
end module attrito_contact_disc_record
