!> K and M of an eigenproblem as operators on blocks of vectors, each rank its rows.
module attrito_reduce_pencil
  use attrito_core_communicator, only: communicator_type
  use attrito_core_kinds, only: wp
  implicit none
  private
  public :: pencil_type

  type, abstract :: pencil_type
    !> The ranks that share the rows
    type(communicator_type) :: ranks
  contains
    procedure(apply), deferred :: solve
    procedure(apply), deferred :: mass
    procedure(report_converged), deferred :: report
  end type pencil_type

  abstract interface
    !> y = K^-1 x, or y = M x; status is not 0 on failure.
    subroutine apply(self, x, y, status)
      import :: pencil_type, wp
      class(pencil_type), intent(in) :: self
      !> Columns, this rank's rows
      real(wp), intent(in), contiguous :: x(:, :)
      !> Coefficients in the reduced coordinates
      real(wp), intent(out), contiguous :: y(:, :)
      !> 0: done, else the solver's code
      integer, intent(out) :: status
    end subroutine apply
    !> So many modes have converged.
    subroutine report_converged(self, converged)
      import :: pencil_type
      class(pencil_type), intent(in) :: self
      !> How many have converged
      integer, intent(in) :: converged
    end subroutine report_converged
  end interface
end module attrito_reduce_pencil
