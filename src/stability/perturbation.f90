!> Perturbations of an orbit, a column each: of its motion, its rate, and of what contacts remember.
!>
!> Where a period begins a contact that sticks remembers its slider, and one that slips along two tangents the direction in which it
!> slips, as an angle times the radius of its slider's disc. A contact that sticks throughout is left out: its slider is neutral.
module attrito_stability_perturbation
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: regime_stick, regime_slip
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: memory_type, perturbation_type, memory_of, same_memory, unit_perturbations, matrix_of

  !> A number that a contact remembers where the period begins: a component of its slider (1, 2), or its direction of slip (0)
  type :: memory_type
    integer :: contact = 0, component = 0
  end type memory_type

  type :: perturbation_type
    !> Of motion and rate by the clock [m, columns]
    real(wp), allocatable :: motion(:, :), rate(:, :)
    !> Of sliders [contacts, columns, 2], and of directions of slip, angles times the radius [contacts, columns]
    real(wp), allocatable :: slider(:, :, :), angle(:, :)
  end type perturbation_type

contains

  !> What contacts that slip or open in the period remember where it begins.
  pure function memory_of(law, stuck, regime) result(memory)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law(:)
    !> Contacts that stick throughout [contacts]
    logical, intent(in) :: stuck(:)
    !> What each does where the period begins [contacts]
    integer, intent(in) :: regime(:)
    type(memory_type), allocatable :: memory(:)
    integer :: i, a

    allocate (memory(0))
    do i = 1, size(law)
      if (stuck(i)) cycle
      if (regime(i) == regime_stick) memory = [memory, (memory_type(i, a), a=1, law(i)%tangents)]
      if (regime(i) == regime_slip .and. law(i)%has_direction()) memory = [memory, memory_type(i, 0)]
    end do
  end function memory_of

  !> Are the same numbers remembered?
  pure logical function same_memory(one, other)
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: one(:), other(:)

    same_memory = size(one) == size(other)
    if (same_memory) same_memory = all(one%contact == other%contact .and. one%component == other%component)
  end function same_memory

  !> A unit of each of (motion [m], rate [m], memory).
  pure function unit_perturbations(m, contacts, memory) result(self)
    !> Number of modes; number of contacts
    integer, intent(in) :: m, contacts
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: memory(:)
    type(perturbation_type) :: self
    integer :: n, i

    n = 2*m + size(memory)
    allocate (self%motion(m, n), self%rate(m, n), self%slider(contacts, n, 2), self%angle(contacts, n), source=0.0_wp)
    do i = 1, m
      self%motion(i, i) = 1.0_wp
      self%rate(i, m + i) = 1.0_wp
    end do
    do i = 1, size(memory)
      associate (contact => memory(i)%contact, component => memory(i)%component)
        if (component > 0) self%slider(contact, 2*m + i, component) = 1.0_wp
        if (component == 0) self%angle(contact, 2*m + i) = 1.0_wp
      end associate
    end do
  end function unit_perturbations

  !> Perturbations as columns of (motion [m], rate [m], memory).
  pure function matrix_of(self, memory) result(matrix)
    type(perturbation_type), intent(in) :: self
    !> Numbers that contacts remember from period to period
    type(memory_type), intent(in) :: memory(:)
    real(wp) :: matrix(2*size(self%motion, 1) + size(memory), size(self%motion, 2))
    integer :: m, i

    m = size(self%motion, 1)
    matrix(:m, :) = self%motion
    matrix(m + 1:2*m, :) = self%rate
    do i = 1, size(memory)
      associate (contact => memory(i)%contact, component => memory(i)%component)
        if (component > 0) matrix(2*m + i, :) = self%slider(contact, :, component)
        if (component == 0) matrix(2*m + i, :) = self%angle(contact, :)
      end associate
    end do
  end function matrix_of
end module attrito_stability_perturbation
