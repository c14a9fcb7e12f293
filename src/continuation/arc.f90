!> An arc of the drawn curve between two points of a branch: frequency and amplitudes are cubics of the length s along the branch
!> that take the values and the changes of both points (Hermite),
!>
!> $$ y(\tau) = (1 + 2 \tau) (1 - \tau)^2 y_a + \tau (1 - \tau)^2 \ell y_a' + \tau^2 (3 - 2 \tau) y_b - \tau^2 (1 - \tau) \ell y_b',
!>    \qquad \tau = s/\ell. $$
!>
!> The length of an arc with the chord c, whose tangents are at an angle theta to each other, is taken to be
!>
!> $$ \ell = c / \cos^2(\theta/4), $$
!>
!> by which the cubic is nearest to a circle: a resonance goes along one, its motion turning in the complex plane.
module attrito_continuation_arc
  use attrito_core_kinds, only: wp
  use attrito_continuation_curve_point, only: curve_point_type
  implicit none
  private
  public :: arc_type, arc_length, hermite, hermite_slope

  !> Unit of frequencies in distances, as a part of the frequency: a curve is as steep as that only where it turns back
  real(wp), parameter :: frequency_unit = 1.0e-3_wp ! guess
  !> Amplitudes below this part of the largest monitor's are measured against it: no more than rounding may be left of them
  real(wp), parameter :: least_share = 1.0e-6_wp ! guess
  !> Pieces of an arc that distances are measured from
  integer, parameter :: pieces = 64 ! guess
  !> Cosine of the largest angle between tangents that a circle is thought of: beyond, it is a kink
  real(wp), parameter :: least_cosine = -0.5_wp ! guess

  type :: arc_type
    type(curve_point_type) :: from, to
    real(wp) :: length = 0.0_wp
  contains
    procedure :: omega_at
    procedure :: distance_of
    procedure :: highest
    procedure :: reversal
    procedure :: turning
  end type arc_type

contains

  !> Weights of both values and of both changes, times the length, at a part of the arc.
  pure function hermite(part) result(weights)
    !> 0 to 1
    real(wp), intent(in) :: part
    !> Of y_a, l y_a', y_b, l y_b'
    real(wp) :: weights(4)

    associate (t => part)
      weights = [(1.0_wp + 2.0_wp*t)*(1.0_wp - t)**2, t*(1.0_wp - t)**2, t**2*(3.0_wp - 2.0_wp*t), -t**2*(1.0_wp - t)]
    end associate
  end function hermite

  !> Weights of the derivative by the part.
  pure function hermite_slope(part) result(weights)
    !> 0 to 1
    real(wp), intent(in) :: part
    !> Of y_a, l y_a', y_b, l y_b'
    real(wp) :: weights(4)

    associate (t => part)
      weights = [-6.0_wp*t*(1.0_wp - t), (1.0_wp - t)*(1.0_wp - 3.0_wp*t), 6.0_wp*t*(1.0_wp - t), t*(3.0_wp*t - 2.0_wp)]
    end associate
  end function hermite_slope

  !> Length of an arc by its chord and the cosine between its tangents.
  pure real(wp) function arc_length(chord, cosine)
    !> Distance between both points; cosine of the angle between their tangents
    real(wp), intent(in) :: chord, cosine
    real(wp) :: angle

    angle = acos(min(max(cosine, least_cosine), 1.0_wp))
    arc_length = chord/cos(0.25_wp*angle)**2
  end function arc_length

  !> Angular frequency at a part of the arc.
  pure real(wp) function omega_at(self, part)
    class(arc_type), intent(in) :: self
    !> 0 to 1
    real(wp), intent(in) :: part

    omega_at = dot_product(hermite(part), [self%from%omega, self%length*self%from%omega_rate, &
                                           self%to%omega, self%length*self%to%omega_rate])
  end function omega_at

  !> Amplitude of a monitor at a part of the arc.
  pure real(wp) function amplitude_at(self, monitor, part)
    type(arc_type), intent(in) :: self
    !> Number of the monitor
    integer, intent(in) :: monitor
    !> 0 to 1
    real(wp), intent(in) :: part

    associate (a => self%from, b => self%to, m => monitor)
      amplitude_at = dot_product(hermite(part), [a%amplitude(m), self%length*a%amplitude_rate(m), &
                                                 b%amplitude(m), self%length*b%amplitude_rate(m)])
    end associate
  end function amplitude_at

  !> Distance of a point from the arc, of all monitors the largest, as a part of the monitor's largest amplitude.
  pure real(wp) function distance_of(self, point, largest) result(distance)
    class(arc_type), intent(in) :: self
    !> Point of the true curve
    type(curve_point_type), intent(in) :: point
    !> Largest amplitudes [monitors]
    real(wp), intent(in) :: largest(:)
    real(wp) :: scale(size(largest)), before(2), here(2), nearest
    integer :: i, m

    distance = 0.0_wp
    if (size(largest) == 0) return
    if (maxval(largest) <= 0.0_wp) return
    scale = max(largest, least_share*maxval(largest))
    do m = 1, size(largest)
      nearest = huge(1.0_wp)
      do i = 0, pieces
        associate (part => real(i, wp)/pieces)
          here = [(omega_at(self, part) - point%omega)/(frequency_unit*point%omega), &
                  (amplitude_at(self, m, part) - point%amplitude(m))/scale(m)]
        end associate
        if (i > 0) nearest = min(nearest, distance_of_origin(before, here))
        before = here
      end do
      distance = max(distance, nearest)
    end do
  end function distance_of

  !> Of the origin from the straight line between two points.
  pure real(wp) function distance_of_origin(a, b) result(distance)
    !> Ends of the line
    real(wp), intent(in) :: a(2), b(2)
    real(wp) :: part

    part = -dot_product(a, b - a)/max(dot_product(b - a, b - a), tiny(1.0_wp))
    distance = norm2(a + min(max(part, 0.0_wp), 1.0_wp)*(b - a))
  end function distance_of_origin

  !> Where an amplitude has a maximum between the ends that exceeds both by more than `gain` of the monitor's largest: the part of the
  !> arc, of the monitor that gains most; negative: nowhere.
  pure real(wp) function highest(self, largest, gain) result(part)
    class(arc_type), intent(in) :: self
    !> Largest amplitudes [monitors]; part of them
    real(wp), intent(in) :: largest(:), gain
    real(wp) :: values(0:pieces), most
    integer :: i, m

    part = -1.0_wp
    most = gain
    do m = 1, size(largest)
      if (largest(m) <= least_share*maxval(largest)) cycle
      if (self%from%amplitude_rate(m) <= 0.0_wp .or. self%to%amplitude_rate(m) >= 0.0_wp) cycle
      values = [(amplitude_at(self, m, real(i, wp)/pieces), i=0, pieces)]
      if (maxval(values) - max(values(0), values(pieces)) <= most*largest(m)) cycle
      most = (maxval(values) - max(values(0), values(pieces)))/largest(m)
      part = real(maxloc(values, 1) - 1, wp)/pieces
    end do
  end function highest

  !> Where the frequency goes back between two turning points, although it goes the same way at both ends: the part of the arc in the
  !> middle of that; negative: nowhere.
  pure real(wp) function reversal(self) result(part)
    class(arc_type), intent(in) :: self
    real(wp) :: omega(0:pieces)
    logical :: back(pieces)
    integer :: i

    part = -1.0_wp
    if (self%from%omega_rate*self%to%omega_rate <= 0.0_wp) return
    omega = [(omega_at(self, real(i, wp)/pieces), i=0, pieces)]
    back = (omega(1:) - omega(:pieces - 1))*self%from%omega_rate < 0.0_wp
    if (.not. any(back)) return
    part = (findloc(back, .true., 1) + findloc(back, .true., 1, back=.true.) - 1)*0.5_wp/pieces
  end function reversal

  !> Where the frequency turns between the ends, farther than either of them by more than `gain` of the unit of frequencies: the part
  !> of the arc; negative: nowhere.
  pure real(wp) function turning(self, gain) result(part)
    class(arc_type), intent(in) :: self
    !> Part of the unit of frequencies
    real(wp), intent(in) :: gain
    real(wp) :: ahead(0:pieces)
    integer :: i

    part = -1.0_wp
    if (self%from%omega_rate*self%to%omega_rate >= 0.0_wp) return
    ahead = sign(1.0_wp, self%from%omega_rate)*[(omega_at(self, real(i, wp)/pieces), i=0, pieces)]
    if (maxval(ahead) - max(ahead(0), ahead(pieces)) <= gain*frequency_unit*self%from%omega) return
    part = real(maxloc(ahead, 1) - 1, wp)/pieces
  end function turning
end module attrito_continuation_arc
