!> A contact with two tangents in random motion, for tests of what it does by events.
module random_discs
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_contact_disc_rules, only: disc_rules_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_contact_quadrature_disc, only: evaluate_contact_by_disc_events
  use scenes, only: noise
  implicit none
  private
  public :: law, many, tight, motion_of, forces_of

  type(contact_type), parameter :: law = contact_type(tangents=2, tangential_stiffness=3.0_wp, normal_stiffness=5.0_wp, &
                                                      friction_coefficient=0.4_wp)
  !> Nodes and error of fine panels, that usual ones are held against and differences are taken with
  integer, parameter :: many = 16
  real(wp), parameter :: tight = 1.0e-13_wp

contains

  !> Motion [2 H + 1, 3] with harmonics that fade; the mean of mu N/k_t is 0.2, `swing` scales N's, `reach` the tangents'.
  function motion_of(harmonics, seed, reach, swing) result(motion)
    integer, intent(in) :: harmonics, seed
    real(wp), intent(in) :: reach, swing
    real(wp) :: motion(2*harmonics + 1, 3)
    integer :: h

    motion = 1.7_wp*reshape(noise(size(motion), seed), shape(motion))
    do h = 1, harmonics
      motion(2*h:2*h + 1, :) = motion(2*h:2*h + 1, :)*0.6_wp**h
    end do
    motion(2:3, :2) = 3.0_wp*motion(2:3, :2)
    motion(:, :2) = 0.1_wp*reach*motion(:, :2)
    motion(:, 3) = 0.3_wp*swing*motion(:, 3)
    motion(1, 3) = 0.3_wp
  end function motion_of

  function forces_of(rules, motion, slider, periodic) result(forces)
    type(disc_rules_type), intent(in) :: rules
    real(wp), intent(in) :: motion(:, :), slider(2)
    logical, intent(in) :: periodic
    type(contact_forces_type) :: forces

    allocate (forces%deviation(size(motion, 1), 3))
    call evaluate_contact_by_disc_events(law, rules, motion, slider, periodic, forces)
  end function forces_of
end module random_discs
