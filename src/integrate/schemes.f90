!> The usual schemes with a fixed step h, and the predictor-corrector of the contact law once a step.
!>
!> Generalised alpha (Newmark's average acceleration and HHT are members of it), unknown p_{n+1}:
!>   (1-a_m) p''_{n+1} + a_m p''_n + [D p' + Lambda p + P g - f] weighted (1-a_f) at n+1, a_f at n = 0
!>   p_{n+1} = p + h p' + h^2 ((1/2 - beta) p''_n + beta p''_{n+1}),  p'_{n+1} = p' + h ((1-gamma) p''_n + gamma p''_{n+1})
!> Central difference, as kick, drift, kick:
!>   p_{n+1} = p + h (p' + h/2 p''_n),  (1 + h D/2) p'_{n+1} = p' + h/2 (p''_n + f - Lambda p - P g at n+1)
!> Exponential: modes that a step resolves exactly under forces that are linear over it, others by Newmark's method with little
!> dissipation (`attrito_integrate_exponential`), which is of first order; all others are of second order. Sources: Newmark 1959;
!> Hilber, Hughes & Taylor 1977, doi:10.1002/eqe.4290050306; Chung & Hulbert 1993, doi:10.1115/1.2900803.
module attrito_integrate_schemes
  use attrito_core_kinds, only: wp
  use attrito_integrate_equilibrium, only: operator_type, new_operator, solve_equilibrium, apply
  use attrito_integrate_exponential, only: exponential_weights
  use attrito_integrate_loading, only: loading_type, load_at
  use attrito_integrate_return_map, only: return_contacts, slip_directions
  use attrito_integrate_state, only: state_type
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: scheme_type, new_scheme, start_scheme, step_scheme
  public :: scheme_event, scheme_central_difference, scheme_newmark, scheme_hht, scheme_generalised_alpha, scheme_exponential

  integer, parameter :: scheme_event = 0, scheme_central_difference = 1, scheme_newmark = 2, scheme_hht = 3, &
                        scheme_generalised_alpha = 4, scheme_exponential = 5

  type :: scheme_type
    integer :: kind = scheme_newmark
    !> Steps per period, and their length in units of the clock
    integer :: steps = 0
    real(wp) :: h = 0.0_wp
    real(wp) :: alpha_m = 0.0_wp, alpha_f = 0.0_wp, beta = 0.25_wp, gamma = 0.5_wp
    type(operator_type) :: implicit
    !> Exponential: what motion and rate take from (motion, rate, force before, force after) [4, 2, m]
    real(wp), allocatable :: weights(:, :, :)
    !> Memory: acceleration [m], load less contact forces [m], displacement and g of the rows [rows]
    real(wp), allocatable :: acceleration(:), load(:), displacement(:), g(:)
  end type scheme_type

contains

  !> Set a scheme up for a step. HHT with alpha = -0.1, generalised alpha with spectral radius 0.8, unless said otherwise.
  subroutine new_scheme(system, kind, steps, period, dissipation, self)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> One of `scheme_...` but the event-exact one; steps per period
    integer, intent(in) :: kind, steps
    !> Length of a period in units of the clock
    real(wp), intent(in) :: period
    !> HHT: -alpha (0 to 1/3); generalised alpha: spectral radius at infinity (0 to 1); negative: as above
    real(wp), intent(in) :: dissipation
    type(scheme_type), intent(out) :: self
    real(wp) :: rho

    self%kind = kind
    self%steps = steps
    self%h = period/steps
    select case (kind)
     case (scheme_hht)
      self%alpha_f = merge(dissipation, 0.1_wp, dissipation >= 0.0_wp)
     case (scheme_generalised_alpha)
      rho = merge(dissipation, 0.8_wp, dissipation >= 0.0_wp)
      self%alpha_m = (2.0_wp*rho - 1.0_wp)/(rho + 1.0_wp)
      self%alpha_f = rho/(rho + 1.0_wp)
     case default
      ! The average acceleration.
    end select
    self%gamma = 0.5_wp - self%alpha_m + self%alpha_f
    self%beta = 0.25_wp*(1.0_wp - self%alpha_m + self%alpha_f)**2
    select case (kind)
     case (scheme_central_difference)
      call new_operator(system, 1.0_wp + 0.5_wp*self%h*system%damping, 0.5_wp*self%h, 1.0_wp, self%implicit)
     case (scheme_exponential)
      self%weights = exponential_weights(system%eigenvalues, system%damping, self%h)
      call new_operator(system, 1.0_wp/self%weights(4, 1, :), 0.0_wp, 1.0_wp, self%implicit)
     case default
      associate (c => 1.0_wp - self%alpha_f, h => self%h)
        call new_operator(system, (1.0_wp - self%alpha_m)/(self%beta*h**2) + c*(self%gamma/(self%beta*h)*system%damping + &
                                                               system%eigenvalues), c*self%gamma/(self%beta*h), c, self%implicit)
      end associate
    end select
  end subroutine new_scheme

  !> Accelerations of the first instant.
  subroutine start_scheme(self, system, loading, state)
    type(scheme_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    real(wp) :: stiffness(3, size(system%springs)), new_slider(2, size(system%law))

    self%displacement = matmul(state%motion, system%rows)
    allocate (self%g(size(system%springs)), source=0.0_wp)
    call return_contacts(system, self%displacement, state%slider, 0.0_wp*state%slider, self%g, stiffness, new_slider, &
                         state%regime)
    state%slider = new_slider
    self%load = load_at(loading, state%cycle, state%theta)
    self%acceleration = self%load - matmul(system%input_map, self%g) - system%eigenvalues*state%motion - drag(system, state%rate)
  end subroutine start_scheme

  !> D p'.
  pure function drag(system, rate)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Rates of the coordinates
    real(wp), intent(in) :: rate(:)
    real(wp) :: drag(size(rate))

    drag = system%damping*rate
    if (allocated(system%coupling)) drag = drag + matmul(system%coupling, rate)
  end function drag

  !> One step; the state's time is left to the caller.
  subroutine step_scheme(self, system, loading, state, cycle, theta, converged)
    type(scheme_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Static and harmonic loads over time
    type(loading_type), intent(in) :: loading
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> The instant that the step leads to
    integer, intent(in) :: cycle
    !> Angle of the period, omega t
    real(wp), intent(in) :: theta
    !> Did the solve converge?
    logical, intent(out) :: converged
    real(wp) :: load(size(state%motion))

    load = load_at(loading, cycle, theta)
    select case (self%kind)
     case (scheme_central_difference)
      call step_central(self, system, load, state)
      converged = .true.
     case (scheme_exponential)
      call step_exponential(self, system, load, state, converged)
     case default
      call step_alpha(self, system, load, state, converged)
    end select
    self%load = load
  end subroutine step_scheme

  subroutine step_central(self, system, load, state)
    type(scheme_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Load on the coordinates, or a force
    real(wp), intent(in) :: load(:)
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    real(wp) :: stiffness(3, size(system%springs)), new_slider(2, size(system%law)), half(size(load)), force(size(load)), &
                direction(2, size(system%law))

    direction = slip_directions(system, self%displacement, state%slider, state%regime)
    half = state%rate + 0.5_wp*self%h*self%acceleration
    state%motion = state%motion + self%h*half
    self%displacement = matmul(state%motion, system%rows)
    call return_contacts(system, self%displacement, state%slider, direction, self%g, stiffness, new_slider, state%regime)
    state%slider = new_slider
    force = load - system%eigenvalues*state%motion - matmul(system%input_map, self%g)
    state%rate = apply(self%implicit, half + 0.5_wp*self%h*force)
    self%acceleration = force - drag(system, state%rate)
  end subroutine step_central

  subroutine step_alpha(self, system, load, state, converged)
    type(scheme_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Load on the coordinates, or a force
    real(wp), intent(in) :: load(:)
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Did the solve converge?
    logical, intent(out) :: converged
    real(wp) :: before(size(load)), rate_before(size(load)), right(size(load)), motion(size(load)), &
                new_slider(2, size(system%law)), acceleration(size(load)), scale

    associate (h => self%h, am => self%alpha_m, af => self%alpha_f, old => self%acceleration)
      scale = 1.0_wp/(self%beta*h**2)
      ! Motion and rate if the new acceleration were 0.
      before = state%motion + h*state%rate + h**2*(0.5_wp - self%beta)*old
      rate_before = state%rate + h*(1.0_wp - self%gamma)*old
      right = (1.0_wp - af)*load + af*(self%load - system%eigenvalues*state%motion - drag(system, state%rate) - &
                                       matmul(system%input_map, self%g)) - am*old + (1.0_wp - am)*scale*before - &
              (1.0_wp - af)*drag(system, rate_before - self%gamma*h*scale*before)
      call solve_equilibrium(system, self%implicit, apply(self%implicit, right), state%slider, &
                             slip_directions(system, self%displacement, state%slider, state%regime), self%displacement, self%g, &
                             new_slider, state%regime, motion, converged)
      acceleration = scale*(motion - before)
      state%rate = rate_before + self%gamma*h*acceleration
      state%motion = motion
      state%slider = new_slider
      self%acceleration = acceleration
    end associate
  end subroutine step_alpha

  !> Damping that couples modes counts as a force, found in two passes.
  subroutine step_exponential(self, system, load, state, converged)
    type(scheme_type), intent(inout) :: self
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Load on the coordinates, or a force
    real(wp), intent(in) :: load(:)
    !> Displacement, velocity and sliders
    type(state_type), intent(inout) :: state
    !> Did the solve converge?
    logical, intent(out) :: converged
    real(wp), dimension(size(load)) :: before, after, motion, rate, free
    real(wp) :: new_slider(2, size(system%law)), direction(2, size(system%law)), g(size(system%springs))
    integer :: pass

    direction = slip_directions(system, self%displacement, state%slider, state%regime)
    before = self%load - matmul(system%input_map, self%g)
    if (allocated(system%coupling)) before = before - matmul(system%coupling, state%rate)
    rate = state%rate
    associate (w => self%weights)
      do pass = 1, merge(3, 1, allocated(system%coupling))
        after = load
        if (allocated(system%coupling)) after = after - matmul(system%coupling, rate)
        free = w(1, 1, :)*state%motion + w(2, 1, :)*state%rate + w(3, 1, :)*before + w(4, 1, :)*after
        call solve_equilibrium(system, self%implicit, free, state%slider, direction, self%displacement, g, new_slider, &
                               state%regime, motion, converged)
        rate = w(1, 2, :)*state%motion + w(2, 2, :)*state%rate + w(3, 2, :)*before + w(4, 2, :)*(after - matmul(system%input_map, g))
      end do
    end associate
    self%g = g
    state%motion = motion
    state%rate = rate
    state%slider = new_slider
  end subroutine step_exponential
end module attrito_integrate_schemes
