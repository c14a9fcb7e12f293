!> The loads of a time integration: piecewise linear profiles on the static and on the harmonic loads.
!>
!> $$ f(t) = p_s(t) f_s + p_h(t) \mathrm{Re} \sum_h f_h e^{i h \omega t} $$
!>
!> Between the knots of its profiles each load is analytic: its Taylor coefficients are in closed form,
!> b_0 A_k + b_1 A_{k-1}, with A_k = (h nu)^k / k! times cosine and sine of the phase.
!> Time is counted in whole periods and a rest in units of 1/clock, so that phases stay exact however long the run.
module attrito_integrate_loading
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_structure, only: cosine_of, sine_of
  implicit none
  private
  public :: profile_type, loading_type, new_profile, new_loading, expand_load, load_at, next_knot, last_knot

  !> A factor that is piecewise linear in time, constant before its first and after its last knot
  type :: profile_type
    !> Seconds, ascending [knots]
    real(wp), allocatable :: time(:)
    !> [knots]
    real(wp), allocatable :: factor(:)
  end type profile_type

  type :: loading_type
    !> Angular frequency over the clock's; length of a period in units of the clock
    real(wp) :: nu = 1.0_wp, period = two_pi
    !> Units of the clock per second
    real(wp) :: clock = 1.0_wp
    type(profile_type) :: static_profile, harmonic_profile
    !> Modal acceleration under the static loads [m] and the harmonic ones [m, coefficients]
    real(wp), allocatable :: static(:), harmonic(:, :)
  end type loading_type

contains

  !> A profile from its knots; no knots: constantly 1.
  pure function new_profile(knots) result(self)
    !> [2, knots]: time, factor
    real(wp), intent(in) :: knots(:, :)
    type(profile_type) :: self

    if (size(knots, 2) == 0) then
      self%time = [0.0_wp]
      self%factor = [1.0_wp]
    else
      self%time = knots(1, :)
      self%factor = knots(2, :)
    end if
  end function new_profile

  !> Loads in modal coordinates at an angular frequency.
  pure function new_loading(omega, clock, static, harmonic, static_profile, harmonic_profile) result(self)
    !> Angular frequency, rad/s; units of the clock per second
    real(wp), intent(in) :: omega, clock
    !> See `loading_type`
    real(wp), intent(in) :: static(:), harmonic(:, :)
    !> Factor over time
    type(profile_type), intent(in) :: static_profile, harmonic_profile
    type(loading_type) :: self

    self%nu = omega/clock
    self%period = two_pi/self%nu
    self%clock = clock
    self%static = static
    self%harmonic = harmonic
    self%static_profile = static_profile
    self%harmonic_profile = harmonic_profile
  end function new_loading

  !> Taylor coefficients of the modal acceleration by the loads at an instant [m, 0:degree].
  pure subroutine expand_load(self, cycle, theta, load)
    type(loading_type), intent(in) :: self
    !> Whole periods, and units of the clock since
    integer, intent(in) :: cycle
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> Load on the coordinates, or a force
    real(wp), intent(out) :: load(:, 0:)
    real(wp) :: line(2), turning(0:ubound(load, 2)), cosine, sine, x(2), now(2), before(2)
    integer :: h, k

    line = line_at(self%static_profile, self, cycle, theta)
    load(:, 0) = line(1)*self%static
    load(:, 1) = line(2)*self%static
    load(:, 2:) = 0.0_wp
    line = line_at(self%harmonic_profile, self, cycle, theta)
    do h = 1, (size(self%harmonic, 2) - 1)/2
      cosine = cos(h*self%nu*theta)
      sine = sin(h*self%nu*theta)
      turning(0) = 1.0_wp
      do k = 1, ubound(load, 2)
        turning(k) = turning(k - 1)*h*self%nu/k
      end do
      ! Derivatives of (cosine, sine) of the load's two parts, order k, over k!; the line's slope shifts them by one.
      before = 0.0_wp
      do k = 0, ubound(load, 2)
        now = turning(k)*turned(k)
        x = line(1)*now + line(2)*before
        load(:, k) = load(:, k) + x(1)*self%harmonic(:, cosine_of(h)) + x(2)*self%harmonic(:, sine_of(h))
        before = now
      end do
    end do

  contains

    pure function turned(order) result(pair)
      !> Order of the derivative
      integer, intent(in) :: order
      real(wp) :: pair(2)

      select case (modulo(order, 4))
       case (0)
        pair = [cosine, sine]
       case (1)
        pair = [-sine, cosine]
       case (2)
        pair = [-cosine, -sine]
       case default
        pair = [sine, -cosine]
      end select
    end function turned
  end subroutine expand_load

  !> The modal acceleration itself [m].
  pure function load_at(self, cycle, theta) result(load)
    type(loading_type), intent(in) :: self
    !> Number of the cycle
    integer, intent(in) :: cycle
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    real(wp) :: load(size(self%static)), line(2)
    integer :: h

    line = line_at(self%static_profile, self, cycle, theta)
    load = line(1)*self%static
    line = line_at(self%harmonic_profile, self, cycle, theta)
    do h = 1, (size(self%harmonic, 2) - 1)/2
      load = load + line(1)*(cos(h*self%nu*theta)*self%harmonic(:, cosine_of(h)) &
                             + sin(h*self%nu*theta)*self%harmonic(:, sine_of(h)))
    end do
  end function load_at

  !> Units of the clock from an instant to the next knot of a profile; huge if there is none.
  pure real(wp) function next_knot(self, cycle, theta)
    type(loading_type), intent(in) :: self
    !> Number of the cycle
    integer, intent(in) :: cycle
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    real(wp) :: ahead

    ahead = (cycle*self%period + theta + nearly(self))/self%clock
    next_knot = min(first_after(self%static_profile%time), first_after(self%harmonic_profile%time))
    if (next_knot < huge(1.0_wp)) next_knot = next_knot*self%clock - cycle*self%period - theta

  contains

    pure real(wp) function first_after(time)
      !> Knots of the profile, s
      real(wp), intent(in) :: time(:)

      first_after = minval(time, mask=time > ahead)
    end function first_after
  end function next_knot

  !> Seconds at which the profiles have come to rest.
  pure real(wp) function last_knot(self)
    type(loading_type), intent(in) :: self

    last_knot = max(maxval(self%static_profile%time), maxval(self%harmonic_profile%time))
  end function last_knot

  !> Value and slope (by units of the clock) of a profile just after an instant.
  pure function line_at(profile, self, cycle, theta) result(line)
    !> Factor over time
    type(profile_type), intent(in) :: profile
    type(loading_type), intent(in) :: self
    !> Number of the cycle
    integer, intent(in) :: cycle
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    real(wp) :: line(2), time
    integer :: i

    time = (cycle*self%period + theta)/self%clock
    associate (knots => profile%time, factor => profile%factor)
      i = count(knots <= time + nearly(self)/self%clock)
      if (i == 0) then
        line = [factor(1), 0.0_wp]
      else if (i == size(knots)) then
        line = [factor(i), 0.0_wp]
      else
        line(2) = (factor(i + 1) - factor(i))/(knots(i + 1) - knots(i))
        line(1) = factor(i) + line(2)*(time - knots(i))
        line(2) = line(2)/self%clock
      end if
    end associate
  end function line_at

  !> What counts as no time: a knot closer than this is here.
  pure real(wp) function nearly(self)
    type(loading_type), intent(in) :: self

    nearly = 1.0e-12_wp*self%period
  end function nearly
end module attrito_integrate_loading
