!> Contacts that graze: what they do in a period changes with a change of their law that is smaller than what a solution leaves
!> open.
!>
!> There the linearised flow jumps (a slider that only just slips forgets, one that only just does not remembers), and multipliers
!> on one side say nothing of the other. Friction and gap are moved by a little both ways, and the motion is asked again. A contact
!> that sticks throughout may well touch its limit, to which shaking took it: beyond it the slider follows and stays, so that is no
!> graze.
module attrito_stability_graze
  use attrito_core_kinds, only: wp
  use attrito_model_contacts, only: contact_type
  use attrito_stability_orbit, only: orbit_type
  implicit none
  private
  public :: perturbed_law, grazing_contact

  !> Part by which friction and gap are moved
  real(wp), parameter :: touch = 1.0e-8_wp ! derived

contains

  !> Contacts with a little more or less friction and gap.
  function perturbed_law(law, oscillation_bound, way) result(changed)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Size of each contact's normal displacement
    real(wp), intent(in) :: oscillation_bound(:)
    !> +1 or -1
    integer, intent(in) :: way
    type(contact_type) :: changed(size(law))

    changed = law
    changed%friction_coefficient = (1.0_wp + way*touch)*law%friction_coefficient
    changed%gap = law%gap + way*touch*oscillation_bound
  end function perturbed_law

  !> The first contact that does something else once perturbed, 0: none.
  pure integer function grazing_contact(orbit, moved) result(contact)
    !> Orbit; the same under laws that are slightly changed
    type(orbit_type), intent(in) :: orbit, moved

    do contact = 1, size(orbit%stuck)
      if (orbit%stuck(contact)) cycle
      if (.not. same_sequence(orbit, moved, contact)) return
    end do
    contact = 0
  end function grazing_contact

  !> Does a contact do the same things in the same order in two orbits, wherever the period is cut?
  pure logical function same_sequence(one, other, contact)
    !> Orbit
    type(orbit_type), intent(in) :: one, other
    !> Number of the contact
    integer, intent(in) :: contact
    integer, allocatable :: a(:), b(:)
    integer :: turn

    a = sequence_of(one, contact)
    b = sequence_of(other, contact)
    same_sequence = size(a) == size(b)
    if (.not. same_sequence) return
    do turn = 0, max(0, size(a) - 1)
      same_sequence = all(cshift(a, turn) == b)
      if (same_sequence) return
    end do
  end function same_sequence

  !> What a contact does in a period, in order, repetitions left out: 0 stick, +-1 slip, 2 open.
  pure function sequence_of(orbit, contact) result(list)
    !> Orbit
    type(orbit_type), intent(in) :: orbit
    !> Number of the contact
    integer, intent(in) :: contact
    integer, allocatable :: list(:), regimes(:)
    integer :: i

    allocate (list(0))
    if (orbit%stuck(contact)) return
    regimes = orbit%regimes(contact)
    list = pack(regimes, [(regimes(i) /= regimes(modulo(i - 2, size(regimes)) + 1), i=1, size(regimes))])
  end function sequence_of
end module attrito_stability_graze
