!> Scenes that several suites use: the paper's wedge, a small structure with contacts of every kind, a one-sided oscillator.
module scenes
  use attrito_core_kinds, only: wp, pi, two_pi
  use attrito_core_lapack, only: symmetric_eigenpairs
  use attrito_model_contacts, only: contact_type, contacts_type, new_contacts, stuck_stiffness
  use attrito_model_structure, only: structure_type, damping_viscous, damping_ratio, damping_mass, damping_loss_factor
  implicit none
  private
  public :: scene_type, restate, wedge, wedge_preload, rubbing_frame, rubbing_frame_with_high_modes, one_sided_oscillator, &
            damp, damp_as_modes_ratio, noise

  !> The static load on the wedge along y
  real(wp), parameter :: wedge_preload = 420.0_wp

  type :: scene_type
    type(structure_type) :: structure
    type(contacts_type) :: contacts
  end type scene_type

contains

  !> The paper's wedge with its unrounded parameters, excited along the contact's tangent (cosine, level 1 = 1 N).
  function wedge(degrees) result(scene)
    !> Angle of the wall
    real(wp), intent(in) :: degrees
    type(scene_type) :: scene
    type(contact_type) :: law
    real(wp) :: c, s, eye(2, 2)

    c = cos(degrees*pi/180.0_wp)
    s = sin(degrees*pi/180.0_wp)
    eye = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    law = contact_type(tangents=1, tangential_stiffness=3.0e5_wp, normal_stiffness=3.0e5_wp, friction_coefficient=0.5_wp)
    scene%contacts = new_contacts([law], reshape([-c, s, s, c], [2, 2]))
    scene%structure%mass = eye
    scene%structure%stiffness = reshape([(two_pi*100.0_wp)**2, 0.0_wp, 0.0_wp, (two_pi*250.0_wp)**2], [2, 2])
    scene%structure%damping_kind = damping_viscous
    scene%structure%damping = 20.0_wp*pi*eye
    scene%structure%static_loads = reshape([0.0_wp, wedge_preload], [2, 1])
    scene%structure%harmonic_load = reshape([0.0_wp, 0.0_wp, -c, s, 0.0_wp, 0.0_wp], [2, 3])
    scene%structure%monitors = eye
  end function wedge

  !> Eight coordinates of order one and four contacts: one and two tangents, lightly and heavily pressed; kt and kn differ.
  function rubbing_frame() result(scene)
    type(scene_type) :: scene
    integer, parameter :: m = 8
    type(contact_type) :: law(4)
    real(wp) :: mixed(m, m), directions(m, 10)
    integer :: i

    law%tangents = [1, 2, 1, 2]
    law%tangential_stiffness = [0.7_wp, 0.9_wp, 0.8_wp, 0.6_wp]
    law%normal_stiffness = [1.3_wp, 1.1_wp, 1.7_wp, 1.4_wp]
    law%friction_coefficient = [0.3_wp, 0.4_wp, 0.5_wp, 0.35_wp]
    law%gap = [0.05_wp, 0.0_wp, 0.0_wp, -0.1_wp]
    law%preload = [1.5_wp, 2.0_wp, 20.0_wp, 1.0_wp]
    directions = reshape(noise(10*m, 3), [m, 10])
    ! The third is pressed so hard, hardly opening anything else, that it stays stuck.
    directions(:, 7) = 0.05_wp*directions(:, 7)
    scene%contacts = new_contacts(law, directions)
    associate (structure => scene%structure)
      mixed = reshape(noise(m*m, 1), [m, m])
      structure%mass = 0.05_wp*matmul(transpose(mixed), mixed)
      mixed = reshape(noise(m*m, 2), [m, m])
      structure%stiffness = 0.5_wp*matmul(transpose(mixed), mixed)
      do i = 1, m
        structure%mass(i, i) = structure%mass(i, i) + 1.0_wp
        structure%stiffness(i, i) = structure%stiffness(i, i) + 0.4_wp*i
      end do
      structure%static_loads = reshape(0.3_wp*noise(m, 4), [m, 1])
      structure%harmonic_load = reshape(noise(5*m, 5), [m, 5])
      structure%harmonic_load(:, 1) = 0.0_wp
      structure%harmonic_load(:, 4:5) = 0.2_wp*structure%harmonic_load(:, 4:5)
      allocate (structure%monitors(m, 0))
    end associate
  end function rubbing_frame

  !> The same with coordinates that the contacts move too, far above what moves the frame: angular frequencies from 32 up.
  function rubbing_frame_with_high_modes(high) result(scene)
    !> How many
    integer, intent(in) :: high
    type(scene_type) :: scene
    type(scene_type) :: frame
    integer :: i, m

    frame = rubbing_frame()
    m = size(frame%structure%mass, 1)
    scene%contacts = new_contacts(frame%contacts%law, reshape([transpose(frame%contacts%directions), noise(10*high, 7)], &
                                                              [m + high, 10], order=[2, 1]))
    associate (structure => scene%structure)
      allocate (structure%mass(m + high, m + high), structure%stiffness(m + high, m + high), source=0.0_wp)
      structure%mass(:m, :m) = frame%structure%mass
      structure%stiffness(:m, :m) = frame%structure%stiffness
      do i = 1, high
        structure%mass(m + i, m + i) = 1.0_wp
        structure%stiffness(m + i, m + i) = 1.0e3_wp*i
      end do
      allocate (structure%static_loads(m + high, 1), structure%harmonic_load(m + high, 5), source=0.0_wp)
      structure%static_loads(:m, :) = frame%structure%static_loads
      structure%harmonic_load(:m, :) = frame%structure%harmonic_load
      allocate (structure%monitors(m + high, 0))
    end associate
  end function rubbing_frame_with_high_modes

  !> The same scene, forces in another unit; damping has to be one of the ratios.
  subroutine restate(scene, unit)
    type(scene_type), intent(inout) :: scene
    real(wp), intent(in) :: unit

    associate (structure => scene%structure, law => scene%contacts%law)
      structure%mass = unit*structure%mass
      structure%stiffness = unit*structure%stiffness
      structure%static_loads = unit*structure%static_loads
      structure%harmonic_load = unit*structure%harmonic_load
      law%tangential_stiffness = unit*law%tangential_stiffness
      law%normal_stiffness = unit*law%normal_stiffness
      law%preload = unit*law%preload
    end associate
    scene%contacts = new_contacts(scene%contacts%law, scene%contacts%directions)
  end subroutine restate

  !> A mass on a spring (both 1) with a unilateral spring; nothing moves along its tangent. Level 1 is a unit cosine.
  function one_sided_oscillator(normal_stiffness, gap, preload, ratio) result(scene)
    real(wp), intent(in) :: normal_stiffness, gap, preload
    !> Damping ratio, of the mass on its own spring
    real(wp), intent(in) :: ratio
    type(scene_type) :: scene
    type(contact_type) :: law

    law = contact_type(tangents=1, tangential_stiffness=1.0_wp, normal_stiffness=normal_stiffness, friction_coefficient=0.5_wp, &
                       gap=gap, preload=preload)
    scene%contacts = new_contacts([law], reshape([0.0_wp, 1.0_wp], [1, 2]))
    scene%structure%mass = reshape([1.0_wp], [1, 1])
    scene%structure%stiffness = scene%structure%mass
    scene%structure%damping_kind = damping_viscous
    scene%structure%damping = 2.0_wp*ratio*scene%structure%mass
    ! The static load balances the preload, so that the mass rests at the preloaded contact's origin.
    scene%structure%static_loads = reshape([preload], [1, 1])
    scene%structure%harmonic_load = reshape([0.0_wp, 1.0_wp, 0.0_wp], [1, 3])
    allocate (scene%structure%monitors(1, 0))
  end function one_sided_oscillator

  !> Damp a scene in one of the ways that have a single number.
  pure subroutine damp(scene, kind, value)
    type(scene_type), intent(inout) :: scene
    !> One of `damping_...`; viscous: a non-proportional C of this size
    integer, intent(in) :: kind
    real(wp), intent(in) :: value
    real(wp), allocatable :: mixed(:, :)

    scene%structure%damping_kind = kind
    scene%structure%damping_value = value
    if (kind /= damping_viscous) return
    mixed = reshape(noise(size(scene%structure%mass), 6), shape(scene%structure%mass))
    scene%structure%damping = value*matmul(transpose(mixed), mixed)
  end subroutine damp

  !> The viscous matrix that gives every mode of the stuck system one damping ratio, C = M Phi diag(2 zeta omega_r) Phi^T M.
  function damp_as_modes_ratio(scene, ratio) result(viscous)
    type(scene_type), intent(in) :: scene
    real(wp), intent(in) :: ratio
    real(wp), allocatable :: viscous(:, :), eigenvalues(:), modes(:, :)
    integer :: info

    call symmetric_eigenpairs(stuck_stiffness(scene%contacts, scene%structure%stiffness, .true.), scene%structure%mass, &
                              eigenvalues, modes, info)
    modes = matmul(scene%structure%mass, modes)
    viscous = matmul(modes*spread(2.0_wp*ratio*sqrt(eigenvalues), 1, size(modes, 1)), transpose(modes))
  end function damp_as_modes_ratio

  !> Numbers between -1 and 1 without pattern, the same everywhere (Lehmer's generator).
  pure function noise(count, seed) result(x)
    integer, intent(in) :: count, seed
    real(wp) :: x(count)
    integer(8), parameter :: modulus = 2147483647_8
    integer(8) :: state
    integer :: i

    state = 48271_8*(seed + 12345)
    do i = 1, count
      state = modulo(48271_8*state, modulus)
      x(i) = 2.0_wp*real(state, wp)/real(modulus, wp) - 1.0_wp
    end do
  end function noise
end module scenes
