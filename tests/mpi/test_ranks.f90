!> The same numbers on any number of ranks: each rank solves the scene alone, too, and compares. Bit for bit if each holds all
!> contacts; to rounding if contacts are split.
program test_ranks
  use attrito_core_communicator, only: communicator_type
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_balance_shared_evaluation, only: owners_of
  use attrito_contact_state, only: state_stuck, state_shaken_down
  use attrito_model_structure, only: damping_viscous, damping_ratio
  use attrito_continuation_sweep, only: sweep_type, new_sweep
  use attrito_solve_strategies, only: solve_by_strategies
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use attrito_solve_static_path, only: follow_static_path
  use attrito_accuracy_error_control, only: error_control_type
  use attrito_accuracy_point_errors, only: no_tolerance
  use attrito_accuracy_finer_balance, only: finer_point_type
  use attrito_output_point_report, only: point_report_type, report_point
  use scenes, only: scene_type, rubbing_frame, rubbing_frame_with_high_modes, wedge, damp
  use session, only: run_in_session, everyone, only_me, petsc_keeps_its_own_world
  use testing, only: test, check, check_close
  implicit none

  real(wp), parameter :: omega = 1.3_wp
  ! All by GMRES, one by elimination, or sums over ranks in another order, 1e-15: Newton's last step and the condition of the
  ! solution, some 1e2, lie between.
  real(wp), parameter :: of_solvers = 1.0e-10_wp
  !> Contacts up to which each rank holds all: none are split, or all
  integer, parameter :: most_whole(2) = [huge(1), 0]

  call run_in_session('ranks', [ &
                      test('the communicator that PETSc was started on can be freed', worlds), &
                      test('shares cover all items once, in order', shares), &
                      test('columns and integers are gathered in the order of ranks', gathering), &
                      test('a point with four contacts is the same on all ranks as on one', point_of_modes), &
                      test('a point by GMRES on all ranks, open contacts taken out, is that of elimination on one', point_of_open), &
                      test('a point with coupled damping is the same on all ranks as on one', point_of_factors), &
                      test('a point by GMRES on all ranks, high modes summed, is that of elimination on one', point_of_sums), &
                      test('ranks without a contact to evaluate take part and agree', idle_ranks), &
                      test('every point of a sweep is the same on all ranks as on one', sweep_points), &
                      test('each rank evaluates its part of the work, contacts that stick apart', shared_by_work), &
                      test('contacts are split by their work along a sweep, and every point is the same', split_by_work), &
                      test('what is reported of a point is the same on all ranks as on one', report)])

contains

  subroutine prepare(scene, ranks, whole, solver, error)
    type(scene_type), intent(in) :: scene
    type(communicator_type), intent(in) :: ranks
    !> Contacts up to which each rank holds all
    integer, intent(in) :: whole
    type(solver_type), intent(out) :: solver
    type(error_type), allocatable, intent(inout) :: error
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, ranks, &
                    solver_options_type(harmonics=3, samples=64, tolerance=1.0e-12_wp, most_whole=whole), solver, fault)
    if (.not. allocated(fault)) call follow_static_path(solver, reshape([1.0_wp], [1, 1]), 2, omega, fault)
    if (allocated(fault)) call check(error, .false., fault%message)
    call solver%set_loads([1.0_wp], 1.0_wp)
    call solver%set_scales(omega, omega)
  end subroutine prepare

  !> The solve by all against the solve alone.
  subroutine compare(error, together, alone, tolerance)
    type(error_type), allocatable, intent(inout) :: error
    type(solver_type), intent(in) :: together, alone
    !> Relative; 0: bit for bit
    real(wp), intent(in) :: tolerance
    integer :: first, last

    first = together%context%balance%first_row
    last = first - 1 + together%context%balance%rows()
    call check(error, together%report%converged .and. alone%report%converged, 'it does not converge')
    call check_close(error, together%omega, alone%omega, tolerance, 'omega')
    call check_close(error, together%motion, alone%motion(:, first:last), tolerance*alone%context%motion_scale, 'motion')
    call check_close(error, together%context%balance%response, alone%context%balance%response, &
                     tolerance*maxval(abs(alone%context%balance%response)), 'response')
  end subroutine compare

  subroutine compare_point(error, scene, iterate)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    !> All ranks by GMRES, and one by elimination?
    logical, intent(in) :: iterate
    type(solver_type) :: together, alone
    integer :: i

    do i = 1, size(most_whole)
      call prepare(scene, everyone(), most_whole(i), together, error)
      call prepare(scene, only_me(), most_whole(i), alone, error)
      if (iterate) together%context%linear%dense_limit = 0
      call solve_by_strategies(together, omega)
      call check(error, together%context%balance%split%in_use .eqv. iterate, 'high modes are summed, or not: the test is void')
      call solve_by_strategies(alone, omega)
      call check(error, any(alone%context%balance%forces%slip > 0.1_wp), 'nothing slips: the test is void')
      call compare(error, together, alone, tolerance_of(i, iterate))
      call together%destroy()
      call alone%destroy()
    end do
  end subroutine compare_point

  !> None where each rank holds all contacts and all solve alike.
  pure real(wp) function tolerance_of(way, iterate) result(tolerance)
    !> Entry of `most_whole`
    integer, intent(in) :: way
    !> All ranks by GMRES, and one by elimination?
    logical, intent(in) :: iterate

    tolerance = merge(of_solvers, 0.0_wp, iterate .or. way == 2)
  end function tolerance_of

  subroutine worlds(error)
    type(error_type), allocatable, intent(out) :: error

    call check(error, petsc_keeps_its_own_world(), 'PETSc holds on to the communicator of the caller')
  end subroutine worlds

  subroutine shares(error)
    type(error_type), allocatable, intent(out) :: error
    type(communicator_type) :: ranks
    integer :: total, rank, first, last, next

    ranks%ranks = 4
    do total = 0, 9
      next = 1
      do rank = 0, 3
        ranks%rank = rank
        call ranks%share(total, first, last)
        call check(error, first == next .and. last >= first - 1 .and. last - first <= total/4, 'a share is out of order')
        next = last + 1
      end do
      call check(error, next == total + 1, 'items are left over')
    end do
  end subroutine shares

  subroutine gathering(error)
    type(error_type), allocatable, intent(out) :: error
    type(communicator_type) :: ranks
    real(wp), allocatable :: mine(:, :), all_columns(:, :)
    integer, allocatable :: all_integers(:), expected(:)
    integer :: i, rank

    ! Rank r brings r columns, the first none.
    ranks = everyone()
    expected = [((10*rank + i, i=1, rank), rank=0, ranks%ranks - 1)]
    mine = spread(real([(10*ranks%rank + i, i=1, ranks%rank)], wp), 1, 3)
    call ranks%gather_integers([(10*ranks%rank + i, i=1, ranks%rank)], all_integers)
    call check(error, size(all_integers) == size(expected), 'integers are missing')
    call check_close(error, real(all_integers, wp), real(expected, wp), 0.0_wp, 'integers')
    call ranks%gather_columns(mine, all_columns)
    if (.not. ranks%is_root()) return
    call check_close(error, all_columns, spread(real(expected, wp), 1, 3), 0.0_wp, 'columns')
  end subroutine gathering

  subroutine point_of_modes(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    call compare_point(error, scene, .false.)
  end subroutine point_of_modes

  subroutine point_of_sums(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame_with_high_modes(100)
    call damp(scene, damping_ratio, 0.04_wp)
    call compare_point(error, scene, .true.)
  end subroutine point_of_sums

  subroutine point_of_open(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: together, alone
    logical :: is_new
    integer :: i

    scene = rubbing_frame()
    scene%contacts%law([1, 4])%gap = 100.0_wp
    call damp(scene, damping_ratio, 0.04_wp)
    do i = 1, size(most_whole)
      call prepare(scene, everyone(), most_whole(i), together, error)
      call prepare(scene, only_me(), most_whole(i), alone, error)
      together%context%linear%dense_limit = 0
      call solve_by_strategies(together, omega)
      associate (mean => together%context%preconditioner%mean)
        call mean%take(together%context%balance, 0.0_wp, is_new)
        call check(error, allocated(mean%receptance), 'no contact has lost its springs: the test is void')
      end associate
      call solve_by_strategies(together, 1.02_wp*omega)
      call solve_by_strategies(alone, omega)
      call solve_by_strategies(alone, 1.02_wp*omega)
      call check(error, any(alone%context%balance%forces%slip > 0.1_wp), 'nothing slips: the test is void')
      call compare(error, together, alone, of_solvers)
      call together%destroy()
      call alone%destroy()
    end do
  end subroutine point_of_open

  subroutine point_of_factors(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    scene = rubbing_frame()
    call damp(scene, damping_viscous, 0.05_wp)
    call compare_point(error, scene, .false.)
  end subroutine point_of_factors

  subroutine idle_ranks(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene

    ! Two contacts on four ranks: two ranks have none.
    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    scene%contacts%law = scene%contacts%law(:2)
    scene%contacts%directions = scene%contacts%directions(:, :5)
    scene%contacts%row_stiffness = scene%contacts%row_stiffness(:5)
    call compare_point(error, scene, .false.)
  end subroutine idle_ranks

  !> A sweep by all against one alone, point by point; leaves the solvers at its end.
  subroutine compare_sweep(error, scene, way, together, alone)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    !> Entry of `most_whole`
    integer, intent(in) :: way
    type(solver_type), intent(out) :: together, alone
    type(sweep_type) :: sweep_together, sweep_alone

    call prepare(scene, everyone(), most_whole(way), together, error)
    call prepare(scene, only_me(), most_whole(way), alone, error)
    sweep_together = new_sweep(together, 1.0_wp, 1.6_wp, 1, 40)
    sweep_alone = new_sweep(alone, 1.0_wp, 1.6_wp, 1, 40)
    do while (.not. sweep_alone%finished)
      call sweep_together%advance(together)
      call sweep_alone%advance(alone)
      call compare(error, together, alone, tolerance_of(way, .false.))
    end do
    call check(error, sweep_together%finished .and. sweep_together%points > 5, 'the sweep is too short')
  end subroutine compare_sweep

  subroutine sweep_points(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: together, alone
    integer :: way

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    do way = 1, size(most_whole)
      call compare_sweep(error, scene, way, together, alone)
      call together%destroy()
      call alone%destroy()
    end do
  end subroutine sweep_points

  !> Contacts that stick are so light that, split, all of them go to the last rank.
  subroutine split_by_work(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: together, alone

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    scene%contacts%law(3:)%preload = 200.0_wp
    call compare_sweep(error, scene, 2, together, alone)
    associate (balance => together%context%balance)
      if (balance%ranks%ranks == 2) call check(error, size(balance%law) == merge(1, 3, balance%ranks%is_root()), &
                                               'contacts are split by number')
    end associate
    call together%destroy()
    call alone%destroy()
  end subroutine split_by_work

  !> Contacts that stick are evaluated by all, those that slip by one rank each.
  subroutine shared_by_work(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: together, alone
    integer, allocatable :: owner(:)

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    call prepare(scene, everyone(), most_whole(1), together, error)
    call prepare(scene, only_me(), most_whole(1), alone, error)
    call solve_by_strategies(together, omega)
    call solve_by_strategies(alone, omega)
    call compare(error, together, alone, 0.0_wp)
    associate (balance => together%context%balance)
      owner = owners_of(balance%team, balance%forces)
      call check(error, any(balance%forces%state == state_stuck) .and. any(balance%forces%state > state_shaken_down), &
                 'all slip, or none: the test is void')
      if (balance%team%ranks == 1) call check(error, all(owner == -1), 'one rank shares')
      if (balance%team%ranks == 2) then
        call check(error, all((owner == -1) .eqv. (balance%forces%state == state_stuck)), 'contacts that stick are sent')
        call check(error, all([0, 1] == [minval(owner, owner >= 0), maxval(owner)]), 'one rank has all the work')
      end if
    end associate
    call together%destroy()
    call alone%destroy()
  end subroutine shared_by_work

  subroutine report(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    integer :: way

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    scene%structure%monitors = scene%contacts%directions(:, :3)
    do way = 1, size(most_whole)
      call compare_report(error, scene, way)
    end do
  end subroutine report

  subroutine compare_report(error, scene, way)
    type(error_type), allocatable, intent(inout) :: error
    type(scene_type), intent(in) :: scene
    !> Entry of `most_whole`
    integer, intent(in) :: way
    type(solver_type) :: together, alone
    type(point_report_type) :: of_all, of_one
    type(error_control_type) :: errors_together, errors_alone
    type(finer_point_type) :: finer

    call prepare(scene, everyone(), most_whole(way), together, error)
    call prepare(scene, only_me(), most_whole(way), alone, error)
    call solve_by_strategies(together, omega)
    call solve_by_strategies(alone, omega)
    call errors_together%estimate(together, together%report%converged, finer)
    call errors_alone%estimate(alone, alone%report%converged, finer)
    call report_point(together, together%report, 1, errors_together%errors, no_tolerance, of_all)
    call report_point(alone, alone%report, 1, errors_alone%errors, no_tolerance, of_one)
    call check(error, all(of_all%states == of_one%states) .and. of_all%unique == of_one%unique .and. &
               of_all%findings%outcome() == of_one%findings%outcome(), 'states, uniqueness or outcome differ')
    call check_close(error, of_all%amplitude, of_one%amplitude, tolerance_of(way, .false.), 'amplitudes')
    call check_close(error, of_all%errors%harmonics, of_one%errors%harmonics, tolerance_of(way, .false.), 'estimate')
    call check(error, of_one%errors%harmonics > 0.0_wp, 'nothing is left out: the test is void')
    call errors_together%destroy()
    call errors_alone%destroy()
    call together%destroy()
    call alone%destroy()
  end subroutine compare_report
end program test_ranks
