!> Stability of a travelling wave, from one sector of the wheel: of all perturbations, whether they keep the wave or break it.
!>
!> The balance's own orbit is examined: by the wheel's flow over a part of the period (`attrito_stability_wheel_monodromy`), by Hill's
!> problem at every Bloch wavenumber (`attrito_stability_hill_sector`), or by both. A wave that is stable among waves of its own kind
!> may be unstable in the wheel.
module attrito_stability_examine_sector
  use attrito_core_kinds, only: wp, two_pi
  use attrito_solve_solver, only: solver_type
  use attrito_stability_assess, only: not_known_to_hill
  use attrito_stability_balance_motion, only: balance_motion_type, balance_motion_of
  use attrito_stability_examination, only: examination_type, examine_options_type, number, by_monodromy, by_hill
  use attrito_stability_hill, only: too_large
  use attrito_stability_hill_sector, only: wheel_multipliers
  use attrito_stability_wheel_modes, only: wheel_modes_type
  use attrito_stability_given_motion, only: segments_of_motion
  use attrito_stability_smooth_segments, only: orbit_segments_type
  use attrito_stability_multipliers, only: multiplier_type
  use attrito_stability_verdict, only: judge, largest_multiplier, unstable, indeterminate
  use attrito_stability_wheel_monodromy, only: wheel_type, wave_multipliers
  implicit none
  private
  public :: examine_sector

  !> Multipliers that the two engines may differ by and still agree
  real(wp), parameter :: agreement = 1.0e-3_wp ! guess

contains

  !> Examine the solver's present point, at the root; the verdict is known to all.
  subroutine examine_sector(solver, waves, wheel, options, self)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Modes of all nodal diameters, if Hill's problem is asked for; the whole wheel, if its flow is
    type(wheel_modes_type), allocatable, intent(in) :: waves
    type(wheel_type), allocatable, intent(in) :: wheel
    !> Engines
    type(examine_options_type), intent(in) :: options
    !> What is found of stability
    type(examination_type), intent(out) :: self
    type(balance_motion_type) :: balance
    real(wp) :: verdict

    self%reason = ''
    balance = balance_motion_of(solver)
    verdict = 0.0_wp
    associate (ranks => solver%context%balance%team)
      if (ranks%is_root()) then
        call examine_wave(solver, waves, wheel, options, balance, self)
        verdict = real(self%verdict, wp)
      end if
      call ranks%sum(verdict)
    end associate
    self%verdict = nint(verdict)
  end subroutine examine_sector

  !> The verdict of the wheel, at the root.
  subroutine examine_wave(solver, waves, wheel, options, balance, self)
    !> Solver of points: its angular frequency
    type(solver_type), intent(in) :: solver
    !> See `examine_sector`
    type(wheel_modes_type), allocatable, intent(in) :: waves
    type(wheel_type), allocatable, intent(in) :: wheel
    !> Engines
    type(examine_options_type), intent(in) :: options
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    character(:), allocatable :: breaks
    logical :: switches

    switches = .not. all(balance%holds)
    breaks = ''
    if (iand(options%methods, by_monodromy) /= 0) call flow_wheel(wheel, balance, solver%omega, self)
    if (iand(options%methods, by_hill) /= 0 .and. len(self%reason) == 0) then
      call solve_hill(waves, balance, solver, self, breaks)
      if (allocated(self%monodromy)) self%reason = ''
    end if
    if (allocated(self%monodromy)) then
      self%verdict = judge(self%monodromy, switches, self%change)
      if (allocated(self%hill)) call compare(self, switches)
    else if (allocated(self%hill)) then
      self%verdict = judge(self%hill, switches)
    end if
    if (self%verdict == indeterminate .and. len(self%reason) == 0) self%reason = 'a multiplier is 1 in modulus'
    if (self%verdict /= unstable) return
    if (allocated(self%monodromy)) self%reason = grows(self%monodromy(1))
    if (len(breaks) > 0) self%reason = breaks
  end subroutine examine_wave

  !> By the flow of the whole wheel.
  subroutine flow_wheel(wheel, balance, omega, self)
    !> The whole wheel
    type(wheel_type), intent(in) :: wheel
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    integer :: info

    call wave_multipliers(wheel, balance, omega, self%monodromy, info)
    if (info == 0) return
    if (allocated(self%monodromy)) deallocate (self%monodromy)
    self%reason = 'eigenvalues were not found'
    if (info < 0) then
      self%verdict = indeterminate
      self%reason = 'a slider does not come back within the periods it was followed'
    end if
  end subroutine flow_wheel

  !> By Hill's problem of every wavenumber.
  subroutine solve_hill(waves, balance, solver, self, breaks)
    !> Modes of all nodal diameters
    type(wheel_modes_type), intent(in) :: waves
    !> Motion and sliders of all contacts by the balance
    type(balance_motion_type), intent(in) :: balance
    !> Solver of points: its angular frequency
    type(solver_type), intent(in) :: solver
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    !> What the wave breaks into, in words, if it does
    character(:), allocatable, intent(inout) :: breaks
    type(orbit_segments_type) :: segments
    real(wp) :: frequency
    integer :: diameter, info
    logical :: periodic

    if (balance%turns) then
      self%reason = not_known_to_hill
      return
    end if
    call segments_of_motion(waves%contacts%law, balance, segments, periodic)
    call wheel_multipliers(waves, segments, solver%omega, self%hill, diameter, frequency, info)
    if (info == 0) then
      breaks = breaks_into(waves, self%hill(1)%wavenumber, diameter, frequency)
      return
    end if
    if (allocated(self%hill)) deallocate (self%hill)
    self%reason = 'eigenvalues were not found'
    if (info == too_large) self%reason = 'too many contacts slip or open for Hill''s problem'
  end subroutine solve_hill

  !> Both engines must agree.
  subroutine compare(self, switches)
    !> What is found of stability
    type(examination_type), intent(inout) :: self
    !> Does any contact slip or open?
    logical, intent(in) :: switches

    if (abs(largest_multiplier(self%monodromy) - largest_multiplier(self%hill)) <= agreement .and. &
        self%verdict == judge(self%hill, switches)) return
    self%verdict = indeterminate
    self%reason = 'monodromy and Hill''s problem differ'
  end subroutine compare

  !> What makes a wave unstable, in words.
  pure function grows(multiplier) result(text)
    !> The largest
    type(multiplier_type), intent(in) :: multiplier
    character(:), allocatable :: text

    text = 'a perturbation of wavenumber '//number(multiplier%wavenumber)//' grows'
    if (multiplier%wavenumber /= 0) text = text//' and breaks the wave'
  end function grows

  !> What an unstable wave becomes, in words.
  pure function breaks_into(wheel, wavenumber, diameter, frequency) result(text)
    !> Of all nodal diameters
    type(wheel_modes_type), intent(in) :: wheel
    !> Of the largest multiplier; nodal diameter of its perturbation's largest harmonic, 0 ... N - 1
    integer, intent(in) :: wavenumber, diameter
    !> That harmonic's angular frequency
    real(wp), intent(in) :: frequency
    character(:), allocatable :: text
    character(16) :: digits

    write (digits, '(es12.5)') frequency/two_pi
    text = 'a perturbation of nodal diameter '//number(min(diameter, wheel%sectors - diameter))
    if (2*diameter > wheel%sectors) text = text//', running backward,'
    text = text//' grows at '//trim(adjustl(digits))//' Hz'
    if (wavenumber /= 0) text = text//' and breaks the wave'
  end function breaks_into
end module attrito_stability_examine_sector
