#include <petsc/finclude/petscsnes.h>
#include "petsc_compatibility.h"
!> What SNES asks for in Newton's method on the bordered balance: the residual, its Jacobian times a vector, and the inverse of that,
!>
!> $$ r(x) = (r_d, \; w - P(w, d), \; p \cdot d + p_\omega \omega - c), \qquad y = J x, \qquad y = J^{-1} x $$
!>
!> The Jacobian is a shell: a product is a linearised evaluation, its inverse the condensed system. All three are about the motion that
!> the balance was evaluated at last, which SNES's line search and `differentiate` see to.
module attrito_newton_snes_callbacks
  use petscsnes
  use attrito_core_kinds, only: wp
  use attrito_balance_periodic_sliders, only: slider_defects, settle_sliders
  use attrito_newton_border, only: inner_product
  use attrito_newton_linearised_step, only: solve_linearised, apply_linearised, stiffened
  use attrito_newton_newton_context, only: context_handle_type, newton_context_type, least_stiffening
#if PETSC_VERSION_LT(3, 23, 0)
  use attrito_newton_newton_context, only: MatShellGetContext, PCShellGetContext
#endif
  use attrito_newton_scaled_vectors, only: zero_unknowns, load, store
  use attrito_balance_unknowns, only: unknowns_type
  implicit none
  private
  public :: evaluate, ensure_evaluated, differentiate, multiply, apply_inverse

  !> Relative to the scales, beyond which a step says that the Jacobian is singular
  real(wp), parameter :: longest_step = 1.0e6_wp ! guess
  !> Slip radii by which a step may slide bodies along all contacts, and the part of contacts' springs with which a longer one is solved
  !> again
  real(wp), parameter :: farthest_slide = 10.0_wp, slide_stiffening = 1.0e-3_wp ! guess
  !> Norm of the residual from which on it is decided which sliders rest
  real(wp), parameter :: settling_norm = 1.0e-3_wp ! guess
  !> Residual relative to the last from which on a step has hardly reduced it
  real(wp), parameter :: crawls = 0.9_wp ! guess

contains

  !> SNES: residual of balance, sliders and constraint.
  subroutine evaluate(snes, x, f, handle, ierr)
    !> PETSc's nonlinear solver
    type(tSNES) :: snes
    !> Vector that is multiplied; PETSc vector
    type(tVec) :: x, f
    !> Handle of the context, as PETSc hands it back
    type(context_handle_type) :: handle
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: at, rest
    integer :: status

    context => handle%context
    at = zero_unknowns(context)
    rest = zero_unknowns(context)
    PetscCall(load(context, x, at, ierr))
    call ensure_evaluated(context, at, status)
    if (status /= 0) then
      PetscCall(SNESSetFunctionDomainError(snes, ierr))
      return
    end if
    associate (constraint => context%constraint, balance => context%balance)
      rest%motion = balance%residual
      rest%slider = -slider_defects(balance)
      rest%omega = context%frequency_scale &
                   *(inner_product(balance, constraint%motion, at%motion) + constraint%frequency*at%omega - constraint%value)
    end associate
    PetscCall(store(context, f, rest, ierr))
  end subroutine evaluate

  !> Evaluate the balance unless its last evaluation was here.
  subroutine ensure_evaluated(context, at, status)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: at
    !> 0: done; else it could not be evaluated
    integer, intent(out) :: status
    real(wp) :: difference
    integer :: i

    status = 0
    if (context%is_evaluated) then
      difference = 0.0_wp
      if (size(at%motion) > 0) difference = max(maxval(abs(at%motion - context%evaluated%motion)), &
                                                maxval(abs(at%slider - context%evaluated%slider)))
      difference = context%balance%ranks%largest(difference)
      if (difference <= 0.0_wp .and. abs(at%omega - context%evaluated%omega) <= 0.0_wp) return
    end if
    if (.not. abs(at%omega) < huge(at%omega)) then
      status = 1
      return
    end if
    do i = 1, size(at%slider, 2)
      if (context%balance%periodic(i)) context%balance%slider(:, i) = at%slider(:, i)
    end do
    call context%balance%evaluate(at%motion, at%omega, status)
    context%evaluated = at
    context%is_evaluated = status == 0
  end subroutine ensure_evaluated

  !> SNES: the Jacobian is that of the last evaluation; make sure that it was here.
  subroutine differentiate(snes, x, jacobian, preconditioner, handle, ierr)
    !> PETSc's nonlinear solver
    type(tSNES) :: snes
    !> Vector that is multiplied
    type(tVec) :: x
    !> Jacobian, applied without being formed; PETSc matrix
    type(tMat) :: jacobian, preconditioner
    !> Handle of the context, as PETSc hands it back
    type(context_handle_type) :: handle
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: at
    PetscReal :: norm
    integer :: status

    context => handle%context
    at = zero_unknowns(context)
    PetscCall(load(context, x, at, ierr))
    call ensure_evaluated(context, at, status)
    if (status /= 0) then
      PetscCall(SNESSetJacobianDomainError(snes, ierr))
    end if
    PetscCall(SNESGetFunctionNorm(snes, norm, ierr))
    context%stalled = merge(context%stalled + 1, 0, norm > crawls*context%last_norm)
    call adapt_stiffening(context, real(norm, wp))
    if (norm <= settling_norm) call settle_sliders(context%balance)
    PetscCall(MatAssemblyBegin(jacobian, MAT_FINAL_ASSEMBLY, ierr))
    PetscCall(MatAssemblyEnd(jacobian, MAT_FINAL_ASSEMBLY, ierr))
  end subroutine differentiate

  !> Springs that contacts keep in the step hold what nothing else does. Where the residual stalls they hinder: all contacts give way
  !> together until one of them sticks again, which fewer springs reach sooner. Where it grows that went too far.
  pure subroutine adapt_stiffening(context, norm)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(inout) :: context
    !> Of the residual
    real(wp), intent(in) :: norm
    !> Residual relative to the last from which on its fall counts as stalled, and as growth
    real(wp), parameter :: stalls = 0.5_wp, grows = 1.5_wp ! guess

    if (norm > grows*context%last_norm) then
      context%stiffening = context%first_stiffening
    else if (norm > stalls*context%last_norm) then
      context%stiffening = 0.1_wp*context%stiffening
    end if
    context%last_norm = norm
  end subroutine adapt_stiffening

  !> Shell Jacobian times a vector.
  subroutine multiply(jacobian, x, y, ierr)
    !> Jacobian, applied without being formed
    type(tMat) :: jacobian
    !> Vector that is multiplied; vector that takes the product
    type(tVec) :: x, y
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(context_handle_type), pointer :: handle
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: step, product

    PetscCall(MatShellGetContext(jacobian, handle, ierr))
    context => handle%context
    step = zero_unknowns(context)
    PetscCall(load(context, x, step, ierr))
    if (is_last_step(context, step)) then
      ! The line search asks for this product to learn how steep the descent is: it is known, to the tolerance of the linear solve.
      product = context%right
    else
      product = zero_unknowns(context)
      call apply_linearised(context%balance, context%constraint, step, product)
    end if
    product%omega = context%frequency_scale*product%omega
    PetscCall(store(context, y, product, ierr))
  end subroutine multiply

  !> Is a step the one last solved for? To rounding, since it was scaled in between.
  logical function is_last_step(context, step)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Coefficients of contact rows and the angular frequency
    type(unknowns_type), intent(in) :: step
    real(wp) :: differs

    is_last_step = allocated(context%step%motion)
    if (.not. is_last_step) return
    associate (last => context%step)
      differs = merge(0.0_wp, 1.0_wp, close_to(reshape(step%motion, [size(step%motion)]), &
                                               reshape(last%motion, [size(last%motion)])) &
                      .and. close_to(reshape(step%slider, [size(step%slider)]), reshape(last%slider, [size(last%slider)])) &
                      .and. close_to([step%omega], [last%omega]))
    end associate
    is_last_step = context%balance%ranks%largest(differs) <= 0.0_wp
  end function is_last_step

  pure logical function close_to(a, b)
    !> Numbers to compare
    real(wp), intent(in) :: a(:), b(:)

    close_to = size(a) == size(b)
    if (close_to) close_to = all(abs(a - b) <= 4.0_wp*epsilon(1.0_wp)*abs(b))
  end function close_to

  !> Shell preconditioner: the inverse. A solve that is given up gets no step, which ends its line search at once.
  subroutine apply_inverse(pc, x, y, ierr)
    !> Preconditioner
    type(tPC) :: pc
    !> Vector that is multiplied; vector that takes the product
    type(tVec) :: x, y
    !> PETSc's error code
    PetscErrorCode :: ierr
    type(context_handle_type), pointer :: handle
    type(newton_context_type), pointer :: context
    type(unknowns_type) :: right, step
    PetscReal :: longest
    PetscScalar, parameter :: zero = 0.0
    integer :: attempt, iterations, status

    PetscCall(PCShellGetContext(pc, handle, ierr))
    context => handle%context
    right = zero_unknowns(context)
    step = zero_unknowns(context)
    PetscCall(load(context, x, right, ierr))
    right%omega = right%omega/context%frequency_scale
    if (context%gives_up()) then
      PetscCall(VecSet(y, zero, ierr))
      if (allocated(context%step%motion)) deallocate (context%step%motion)
      return
    end if
    do attempt = 1, 2
      call solve_linearised(context%balance, context%constraint, right, stiffened(context%linear, context%stiffening), step, &
                            iterations, status, context%preconditioner)
      context%linear_iterations = context%linear_iterations + iterations
      if (status /= 0) step = zero_unknowns(context)
      PetscCall(store(context, y, step, ierr))
      PetscCall(VecNorm(y, NORM_INFINITY, longest, ierr))
      context%step = step
      context%right = right
      if (status == 0 .and. longest <= longest_step) then
        if (attempt == 2 .or. .not. slides_away(context, step)) exit
        context%stiffening = slide_stiffening
        cycle
      end if
      ! Nearly singular. If nothing helps, no part of this step leads anywhere, and none at all ends the line search at once.
      PetscCall(VecSet(y, zero, ierr))
      deallocate (context%step%motion)
      if (context%stiffening >= least_stiffening) exit
      context%stiffening = least_stiffening
    end do
  end subroutine apply_inverse

  !> Does a step slide a body far along all its contacts? Those that two discs hold give its mean no stiffness, and friction is the
  !> same anywhere along such a motion; but sliders are drawn behind all that way, and are no more where the next iterate needs them.
  logical function slides_away(context, step)
    !> What a Newton iteration works on: balance, constraint, linear solver
    type(newton_context_type), intent(in) :: context
    !> Step of all unknowns
    type(unknowns_type), intent(in) :: step

    slides_away = .false.
    if (allocated(context%balance%increment) .or. context%stiffening >= slide_stiffening) return
    slides_away = context%balance%slip_radii(context%evaluated%motion(1, :), step%motion(1, :)) > farthest_slide
  end function slides_away
end module attrito_newton_snes_callbacks
