#include <petsc/finclude/petscvec.h>
#include "petsc_compatibility.h"
!> The unknowns as PETSc has them, scaled, one vector over all ranks:
!>
!> $$ x = (d/d_s, \; w/d_s, \; \omega/\omega_s) $$
!>
!> with each rank's contacts on that rank, motion before sliders, and omega last on the root. d_s is `motion_scale`, omega_s
!> `frequency_scale`. Residuals and steps are vectors of the same form.
module attrito_newton_scaled_vectors
  use petscvec
  use attrito_core_kinds, only: wp
  use attrito_newton_newton_context, only: newton_context_type
  use attrito_balance_unknowns, only: unknowns_type, new_unknowns
  implicit none
  private
  public :: zero_unknowns, load, store, size_on_rank

contains

  !> Entries of such a vector on this rank.
  integer function size_on_rank(context)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context

    associate (balance => context%balance)
      size_on_rank = balance%coefficients()*balance%rows() + size(balance%slider)
      if (balance%ranks%is_root()) size_on_rank = size_on_rank + 1
    end associate
  end function size_on_rank

  !> Unknowns of the balance's size, all 0.
  function zero_unknowns(context) result(unknowns)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    type(unknowns_type) :: unknowns

    associate (balance => context%balance)
      unknowns = new_unknowns([balance%coefficients(), balance%rows()], shape(balance%slider))
    end associate
  end function zero_unknowns

  !> Physical unknowns from a scaled vector; omega on every rank.
  subroutine load(context, x, unknowns, ierr)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Vector that is multiplied
    type(tVec) :: x
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(inout) :: unknowns
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    real(wp) :: last(1)
    integer :: i, k, n, width

    PetscCall(VecGetArrayRead(x, values, ierr))
    k = size(unknowns%motion, 1)
    n = size(unknowns%motion)
    width = size(unknowns%slider, 1)
    do i = 1, size(unknowns%motion, 2)
      unknowns%motion(:, i) = context%motion_scale*values((i - 1)*k + 1:i*k)
    end do
    do i = 1, size(unknowns%slider, 2)
      unknowns%slider(:, i) = context%motion_scale*values(n + width*(i - 1) + 1:n + width*i)
    end do
    last = 0.0_wp
    if (context%balance%ranks%is_root()) last = context%frequency_scale*values(size(values))
    PetscCall(VecRestoreArrayRead(x, values, ierr))
    call context%balance%ranks%broadcast(last)
    unknowns%omega = last(1)
  end subroutine load

  !> A scaled vector from physical unknowns.
  subroutine store(context, x, unknowns, ierr)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Vector that is multiplied
    type(tVec) :: x
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: unknowns
    !> PETSc's error code
    PetscErrorCode, intent(out) :: ierr
    PetscScalar, pointer :: values(:)
    integer :: i, k, n, width

    PetscCall(VecGetArray(x, values, ierr))
    k = size(unknowns%motion, 1)
    n = size(unknowns%motion)
    width = size(unknowns%slider, 1)
    do i = 1, size(unknowns%motion, 2)
      values((i - 1)*k + 1:i*k) = unknowns%motion(:, i)/context%motion_scale
    end do
    do i = 1, size(unknowns%slider, 2)
      values(n + width*(i - 1) + 1:n + width*i) = unknowns%slider(:, i)/context%motion_scale
    end do
    if (context%balance%ranks%is_root()) values(size(values)) = unknowns%omega/context%frequency_scale
    PetscCall(VecRestoreArray(x, values, ierr))
  end subroutine store
end module attrito_newton_scaled_vectors
