!> Scenes whose contacts slip along two tangents: a body carried round a circle, and the wedge in space.
module disc_scenes
  use attrito_core_kinds, only: wp, two_pi
  use attrito_model_contacts, only: contact_type, new_contacts
  use attrito_model_structure, only: structure_type, damping_viscous
  use scenes, only: scene_type, wedge, noise
  implicit none
  private
  public :: rotating_scene, spatial_wedge, stiffen, spread_out, add_high_modes

contains

  !> Two equal oscillators under a rotating load, and a contact too soft to move them.
  function rotating_scene(ratio) result(scene)
    !> Radius of the circle over that of the disc
    real(wp), intent(in) :: ratio
    type(scene_type) :: scene
    type(contact_type) :: law
    real(wp) :: eye(2, 2)

    eye = reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2])
    law = contact_type(tangents=2, tangential_stiffness=1.0e-9_wp, normal_stiffness=1.0e-9_wp, friction_coefficient=0.5_wp, &
                       preload=2.0e-9_wp/ratio)
    scene%contacts = new_contacts([law], reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp], [2, 3]))
    scene%structure%mass = eye
    scene%structure%stiffness = eye
    scene%structure%damping_kind = damping_viscous
    scene%structure%damping = 0.02_wp*eye
    scene%structure%static_loads = reshape([0.0_wp, 0.0_wp], [2, 1])
    scene%structure%harmonic_load = reshape([0.0_wp, 0.0_wp, 1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 3])
    allocate (scene%structure%monitors(2, 0))
  end function rotating_scene

  !> The wedge at 45 degrees with stiff contacts, in space, also shaken across its plane.
  function spatial_wedge(across) result(scene)
    !> Cosine of the load across, N
    real(wp), intent(in) :: across
    type(scene_type) :: scene

    scene = wedge(45.0_wp)
    call stiffen(scene)
    call spread_out(scene)
    scene%structure%harmonic_load(3, 3) = across
  end function spatial_wedge

  !> Stiff contacts, 20 N of preload, 60 N along x.
  subroutine stiffen(scene)
    type(scene_type), intent(inout) :: scene

    scene%contacts%law%tangential_stiffness = 3.0e6_wp
    scene%contacts%law%normal_stiffness = 3.0e6_wp
    scene%contacts = new_contacts(scene%contacts%law, scene%contacts%directions)
    scene%structure%static_loads = reshape([0.0_wp, 20.0_wp], [2, 1])
    scene%structure%harmonic_load(:, 2) = [60.0_wp, 0.0_wp]
  end subroutine stiffen

  !> A third coordinate across the plane, its own spring and damper, and a second tangent along it.
  subroutine spread_out(scene)
    type(scene_type), intent(inout) :: scene
    type(contact_type) :: law

    law = scene%contacts%law(1)
    law%tangents = 2
    associate (b => scene%contacts%directions)
      scene%contacts = new_contacts([law], reshape([b(:, 1), 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp, b(:, 2), 0.0_wp], [3, 3]))
    end associate
    call enlarge(scene%structure, 1)
    scene%structure%mass(3, 3) = 1.0_wp
    scene%structure%stiffness(3, 3) = (two_pi*180.0_wp)**2
    scene%structure%damping(3, 3) = 60.0_wp
  end subroutine spread_out

  !> Coordinates on springs of 2e8, from 1.5 kHz up, that add to all rows, each damped by a ratio of 0.3.
  subroutine add_high_modes(scene, high)
    type(scene_type), intent(inout) :: scene
    !> How many
    integer, intent(in) :: high
    real(wp), parameter :: spring = 2.0e8_wp, ratio = 0.3_wp
    real(wp) :: omega
    integer :: i, m

    m = size(scene%structure%mass, 1)
    associate (contacts => scene%contacts)
      contacts = new_contacts(contacts%law, reshape([transpose(contacts%directions), noise(3*high, 9)], [m + high, 3], order=[2, 1]))
    end associate
    call enlarge(scene%structure, high)
    do i = 1, high
      omega = two_pi*(1.0e3_wp + 5.0e2_wp*i)
      scene%structure%mass(m + i, m + i) = spring/omega**2
      scene%structure%stiffness(m + i, m + i) = spring
      scene%structure%damping(m + i, m + i) = 2.0_wp*ratio*spring/omega
    end do
  end subroutine add_high_modes

  !> Room for further coordinates, without mass, stiffness, damping and loads yet, and without monitors.
  subroutine enlarge(structure, more)
    type(structure_type), intent(inout) :: structure
    !> How many
    integer, intent(in) :: more
    type(structure_type) :: small
    integer :: m, n

    small = structure
    m = size(small%mass, 1)
    n = m + more
    deallocate (structure%mass, structure%stiffness, structure%damping, structure%static_loads, structure%harmonic_load, &
                structure%monitors)
    allocate (structure%mass(n, n), structure%stiffness(n, n), structure%damping(n, n), structure%static_loads(n, 1), &
              structure%harmonic_load(n, 3), structure%monitors(n, 0), source=0.0_wp)
    structure%mass(:m, :m) = small%mass
    structure%stiffness(:m, :m) = small%stiffness
    structure%damping(:m, :m) = small%damping
    structure%static_loads(:m, :) = small%static_loads
    structure%harmonic_load(:m, :) = small%harmonic_load
  end subroutine enlarge
end module disc_scenes
