!> When is it steady? States at starts of periods are compared, once the profiles of the loads have come to rest.
!>
!> $$ \delta_k = \max\Big( \frac{|p_n - p_{n-k}|}{A}, \frac{|\dot p_n - \dot p_{n-k}|}{\omega A}, \frac{|w_n - w_{n-k}|}{A_u} \Big) $$
!>
!> with A the half range of the motion over the last period in the norm of the mass matrix, A_u the largest half range of a contact's
!> displacement. Period one if delta_1 <= tolerance. Period k if delta_k <= tolerance while every smaller delta stays above 1e-6 and a
!> hundred tolerances (a mode that alternates while it dies out has a small delta_2 too, and is waited for). Neither within the
!> cycles: still settling if delta_1 has halved over the last half of them; diverging if A grows over all of that half, ever faster;
!> else not periodic.
module attrito_integrate_steady
  use attrito_core_kinds, only: wp
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: steady_type, new_steady, compare, is_settling, is_diverging

  type :: steady_type
    real(wp) :: tolerance = 1.0e-10_wp
    !> States at the starts of the last periods, newest last: motion and rate over omega [2 m, 0:multiples], sliders [2 nc, 0:...]
    real(wp), allocatable :: motion(:, :), slider(:, :)
    !> Periods compared so far
    integer :: periods = 0
    !> Period recognised, 0: none yet
    integer :: period = 0
    !> Defects of each multiple at the last comparison [multiples], delta_1 of every cycle [cycles]
    real(wp), allocatable :: defect(:), history(:)
    !> A of every cycle [cycles]
    real(wp), allocatable :: amplitudes(:)
    !> Half range of the motion
    real(wp) :: amplitude = 0.0_wp
  end type steady_type

contains

  pure function new_steady(system, multiples, cycles, tolerance) result(self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Longest period looked for; most cycles
    integer, intent(in) :: multiples, cycles
    !> Relative tolerance
    real(wp), intent(in) :: tolerance
    type(steady_type) :: self

    allocate (self%motion(2*size(system%eigenvalues), 0:multiples), self%slider(2*size(system%law), 0:multiples), source=0.0_wp)
    allocate (self%defect(multiples), source=huge(1.0_wp))
    allocate (self%history(0:cycles), source=huge(1.0_wp))
    allocate (self%amplitudes(0:cycles), source=0.0_wp)
    self%tolerance = tolerance
  end function new_steady

  !> Compare the state at the end of a period with those before it.
  subroutine compare(self, system, state, nu, low, high, driven)
    type(steady_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Displacement, velocity and sliders
    type(state_type), intent(in) :: state
    !> Excitation frequency over the clock's
    real(wp), intent(in) :: nu
    !> Range of the modal displacement over the period [m]
    real(wp), intent(in) :: low(:), high(:)
    !> .false.: no harmonic load acts, and what is compared with is the displacement itself
    logical, intent(in) :: driven
    real(wp) :: contact_amplitude
    integer :: k, m, last

    m = size(low)
    last = ubound(self%motion, 2)
    self%motion = eoshift(self%motion, 1, dim=2)
    self%slider = eoshift(self%slider, 1, dim=2)
    self%motion(:, last) = [state%motion, state%rate/nu]
    self%slider(:, last) = reshape(state%slider, [2*size(system%law)])
    self%amplitude = 0.5_wp*norm2(high - low)
    self%amplitudes(state%cycle) = self%amplitude
    contact_amplitude = amplitude_of_contacts(system, 0.5_wp*(high - low))
    if (.not. driven) then
      self%amplitude = max(self%amplitude, norm2(state%motion))
      contact_amplitude = max(contact_amplitude, maxval(abs(matmul(state%motion, system%rows))))
    end if
    self%periods = self%periods + 1
    do k = 1, min(last, self%periods - 1)
      self%defect(k) = max(norm2(self%motion(:m, last) - self%motion(:m, last - k)), &
                           norm2(self%motion(m + 1:, last) - self%motion(m + 1:, last - k)))
      self%defect(k) = relative(self%defect(k), self%amplitude)
      self%defect(k) = max(self%defect(k), relative(maxval(abs(self%slider(:, last) - self%slider(:, last - k))), &
                                                    contact_amplitude))
    end do
    if (self%periods > 1) self%history(state%cycle) = self%defect(1)
    call recognise(self)
  end subroutine compare

  pure subroutine recognise(self)
    type(steady_type), intent(inout) :: self
    real(wp) :: distinct
    integer :: k

    self%period = 0
    distinct = max(1.0e-6_wp, 100*self%tolerance)
    do k = 1, size(self%defect)
      if (self%defect(k) > self%tolerance) cycle
      if (all(self%defect(:k - 1) > distinct)) self%period = k
      return
    end do
  end subroutine recognise

  !> Is the defect still on its way down? A march that was too short, not one without a period.
  pure logical function is_settling(self, cycles)
    type(steady_type), intent(in) :: self
    !> How many cycles were marched
    integer, intent(in) :: cycles
    integer :: half, window

    half = max(1, (cycles + cycles - self%periods)/2)
    window = max(1, min(10, self%periods/4))
    is_settling = self%periods < 4
    if (.not. is_settling) is_settling = maxval(self%history(cycles - window + 1:cycles)) < &
      0.5_wp*maxval(self%history(half:min(half + window - 1, cycles)))
  end function is_settling

  !> Does the motion grow without bound? Its largest amplitude rises over the four quarters of the last half of the cycles, by more
  !> than a hundredth in all, and by ever more: a motion on its way to a steady one rises ever less, and one of several frequencies
  !> comes back.
  pure logical function is_diverging(self, cycles)
    type(steady_type), intent(in) :: self
    !> Cycles done
    integer, intent(in) :: cycles
    real(wp) :: largest(4), rise(3)
    integer :: part, quarter, first

    quarter = min(cycles/8, self%periods/4)
    is_diverging = .false.
    if (quarter < 1) return
    do part = 1, 4
      first = cycles - (5 - part)*quarter + 1
      largest(part) = maxval(self%amplitudes(first:first + quarter - 1))
    end do
    rise = largest(2:) - largest(:3)
    is_diverging = all(rise > 0.0_wp) .and. all(rise(2:) >= rise(:2)) .and. largest(4) > 1.01_wp*largest(1)
  end function is_diverging

  !> Largest half range of a contact's displacement, bounded from the modes' ranges.
  pure real(wp) function amplitude_of_contacts(system, range)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Half ranges of the modes
    real(wp), intent(in) :: range(:)
    integer :: row

    amplitude_of_contacts = 0.0_wp
    do row = 1, size(system%springs)
      amplitude_of_contacts = max(amplitude_of_contacts, norm2(system%rows(:, row)*range))
    end do
  end function amplitude_of_contacts

  pure real(wp) function relative(change, amplitude)
    !> Change over the period; amplitude that it is relative to
    real(wp), intent(in) :: change, amplitude

    relative = 0.0_wp
    ! A change that is not a number is one.
    if (.not. change <= huge(1.0_wp)) relative = huge(1.0_wp)
    if (change > 0.0_wp .and. change <= huge(1.0_wp)) relative = change/max(amplitude, tiny(1.0_wp)/epsilon(1.0_wp))
  end function relative
end module attrito_integrate_steady
