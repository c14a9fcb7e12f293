!> Static equilibrium along a load path with slider memory, followed in steps: the start of a time integration.
!>
!> $$ \Lambda p + \Phi^T B^T g(B \Phi p, w) = f_s \sum_i s_i $$
module attrito_integrate_static_path
  use attrito_core_errors, only: error_type, raise
  use attrito_core_kinds, only: wp
  use attrito_integrate_equilibrium, only: operator_type, new_operator, solve_equilibrium
  use attrito_integrate_system, only: system_type
  implicit none
  private
  public :: follow_static_path

contains

  !> Follow the path from the unloaded state over its corners.
  subroutine follow_static_path(system, path, steps, motion, slider, error)
    !> Linear system in time: mass, damping, stiffness, contacts
    type(system_type), intent(in) :: system
    !> Factors on the static loads at the corners [loads, corners]
    real(wp), intent(in) :: path(:, :)
    !> Steps from corner to corner
    integer, intent(in) :: steps
    !> Modal displacement [m] and sliders [2, contacts], at the end; the sliders on entry are those at the start of the path
    real(wp), intent(out) :: motion(:)
    !> Sliders, as the contacts have them
    real(wp), intent(inout) :: slider(:, :)
    !> Allocated: what has failed
    type(error_type), allocatable, intent(out) :: error
    type(operator_type) :: static
    real(wp) :: from(size(path, 1)), displacement(size(system%springs)), g(size(system%springs)), &
                new_slider(2, size(system%law)), free(size(motion))
    integer :: corner, step, regime(size(system%law))
    logical :: converged
    character(120) :: text

    call new_operator(system, system%eigenvalues, 0.0_wp, 1.0_wp, static)
    from = 0.0_wp
    motion = 0.0_wp
    displacement = 0.0_wp
    do corner = 1, size(path, 2)
      if (corner == 1 .and. size(path, 2) > 1 .and. all(abs(path(:, 1)) <= 0.0_wp)) cycle
      do step = 1, steps
        free = matmul(system%static_loads, from + (path(:, corner) - from)*real(step, wp)/steps)/system%eigenvalues
        call solve_equilibrium(system, static, free, slider, 0.0_wp*slider, displacement, g, new_slider, regime, motion, &
                               converged)
        if (.not. converged) then
          write (text, '(a,i0,a,i0)') 'static load path, corner ', corner, ', step ', step
          call raise(error, trim(text)//': no equilibrium found '// &
                     '(do the loads open all contacts that hold a body, or exceed their friction?)')
          return
        end if
        slider = new_slider
      end do
      from = path(:, corner)
    end do
  end subroutine follow_static_path
end module attrito_integrate_static_path
