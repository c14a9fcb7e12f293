!> All contact laws by name, and what makes one out of the numbers of a job. A new law has its file, and a line in each of both here.
module attrito_contact_law_laws
  use attrito_core_kinds, only: wp
  use attrito_contact_law_contact_law, only: contact_law_type
  use attrito_contact_law_iwan, only: new_iwan
  use attrito_contact_law_pressure_friction, only: new_pressure_friction
  implicit none
  private
  public :: law_names, new_law

  !> Counted from 0; a contact without a law is a Coulomb spring
  character(*), parameter :: law_names(3) = [character(8) :: 'coulomb', 'pressure', 'iwan']

contains

  !> A law, which the caller is to deallocate; none for a Coulomb spring.
  function new_law(law, numbers) result(made)
    !> Its place in `law_names`, from 0
    integer, intent(in) :: law
    !> What it is made of, in the order of its own constructor
    real(wp), intent(in) :: numbers(:)
    class(contact_law_type), pointer :: made

    made => null()
    select case (law_names(law + 1))
     case ('pressure')
      allocate (made, source=new_pressure_friction(numbers))
     case ('iwan')
      allocate (made, source=new_iwan(numbers))
     case default
      ! A Coulomb spring has none.
    end select
  end function new_law
end module attrito_contact_law_laws
