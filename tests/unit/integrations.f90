!> Short ways to integrate a scene, and an integration that shares nothing with the library's: central difference, tiny steps.
module integrations
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp, two_pi
  use attrito_core_lapack, only: solve_dense
  use attrito_integrate_loading, only: new_profile
  use attrito_integrate_run, only: run_options_type, orbit_type, integrate
  use attrito_integrate_static_path, only: start_at_end_of_path
  use attrito_integrate_system, only: system_type, new_system
  use scenes, only: scene_type
  implicit none
  private
  public :: choices, run_from, run_from_path, displacement_of, velocity_of, tiny_steps

contains

  !> Options at a frequency, with no profiles and static loads at full.
  function choices(scene, frequency_hz, level) result(options)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: frequency_hz, level
    type(run_options_type) :: options
    real(wp) :: none(2, 0)

    options%omega = two_pi*frequency_hz
    options%level = level
    allocate (options%static_factors(size(scene%structure%static_loads, 2)), source=1.0_wp)
    options%static_profile = new_profile(none)
    options%harmonic_profile = new_profile(none)
    options%samples = 64
  end function choices

  !> Integrate from a state in the scene's coordinates.
  subroutine run_from(scene, options, displacement, velocity, slider, system, orbit, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    real(wp), intent(in) :: displacement(:), velocity(:), slider(:, :)
    type(system_type), intent(out) :: system
    type(orbit_type), intent(out) :: orbit
    type(error_type), allocatable, intent(out) :: error

    call new_system(scene%structure, scene%contacts, system, error)
    if (allocated(error)) return
    call integrate(system, options, matmul(displacement, system%weighted), matmul(velocity, system%weighted)/system%clock, &
                   slider, orbit, error)
  end subroutine run_from

  !> Integrate from the end of a static load path of one load.
  subroutine run_from_path(scene, options, path, slider, system, orbit, error)
    type(scene_type), intent(in) :: scene
    type(run_options_type), intent(in) :: options
    real(wp), intent(in) :: path(:), slider(:, :)
    type(system_type), intent(out) :: system
    type(orbit_type), intent(out) :: orbit
    type(error_type), allocatable, intent(out) :: error
    real(wp) :: motion(size(scene%structure%mass, 1)), moved(2, size(scene%contacts%law))

    call new_system(scene%structure, scene%contacts, system, error)
    if (allocated(error)) return
    moved = slider
    call start_at_end_of_path(scene%structure, scene%contacts, system, reshape(path, [1, size(path)]), 20, motion, moved, error)
    if (allocated(error)) return
    call integrate(system, options, motion, 0.0_wp*motion, moved, orbit, error)
  end subroutine run_from_path

  function displacement_of(system, orbit) result(q)
    type(system_type), intent(in) :: system
    type(orbit_type), intent(in) :: orbit
    real(wp), allocatable :: q(:)

    q = matmul(system%modes, orbit%state%motion)
  end function displacement_of

  function velocity_of(system, orbit) result(v)
    type(system_type), intent(in) :: system
    type(orbit_type), intent(in) :: orbit
    real(wp), allocatable :: v(:)

    v = matmul(system%modes, orbit%state%rate)*system%clock
  end function velocity_of

  !> One-tangent contacts, viscous damping: march with the plain scheme q, v, a in the scene's own coordinates.
  subroutine tiny_steps(scene, omega, level, steps, periods, q, v, w)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: omega, level
    !> Steps per period, and how many periods
    integer, intent(in) :: steps, periods
    !> Displacement, velocity [m], sliders [contacts]: at the start, then at the end
    real(wp), intent(inout) :: q(:), v(:), w(:)
    real(wp) :: inverse(size(q), size(q)), damped(size(q), size(q)), mass(size(q), size(q)), a(size(q)), half(size(q)), h
    integer :: step, info, i

    h = two_pi/omega/steps
    inverse = 0.0_wp
    do i = 1, size(q)
      inverse(i, i) = 1.0_wp
    end do
    damped = inverse
    mass = scene%structure%mass
    call solve_dense(mass, inverse, info)
    mass = damped + 0.5_wp*h*matmul(inverse, scene%structure%damping)
    call solve_dense(mass, damped, info)
    a = force(0.0_wp) - matmul(inverse, matmul(scene%structure%damping, v))
    do step = 1, steps*periods
      half = v + 0.5_wp*h*a
      q = q + h*half
      a = force(step*h)
      v = matmul(damped, half + 0.5_wp*h*a)
      a = a - matmul(inverse, matmul(scene%structure%damping, v))
    end do

  contains

    !> Acceleration but for damping; moves the sliders.
    function force(time)
      real(wp), intent(in) :: time
      real(wp) :: force(size(q)), push(size(q)), u, n, r
      integer :: contact, order

      push = scene%structure%static_loads(:, 1) - matmul(scene%structure%stiffness, q)
      do order = 1, (size(scene%structure%harmonic_load, 2) - 1)/2
        push = push + level*(scene%structure%harmonic_load(:, 2*order)*cos(order*omega*time) &
                               + scene%structure%harmonic_load(:, 2*order + 1)*sin(order*omega*time))
      end do
      do contact = 1, size(w)
        associate (law => scene%contacts%law(contact), b => scene%contacts%directions)
          u = dot_product(b(:, 2*contact - 1), q)
          n = max(0.0_wp, law%preload + law%normal_stiffness*(dot_product(b(:, 2*contact), q) - law%gap))
          r = law%friction_coefficient*n/law%tangential_stiffness
          w(contact) = min(max(w(contact), u - r), u + r)
          push = push - n*b(:, 2*contact) - law%tangential_stiffness*(u - w(contact))*b(:, 2*contact - 1)
        end associate
      end do
      force = matmul(inverse, push)
    end function force
  end subroutine tiny_steps
end module integrations
