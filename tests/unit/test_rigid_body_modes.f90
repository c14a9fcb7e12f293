!> Motions that the structure leaves free: which they are, what the condensed residual says of the forces along them, and sliding.
program test_rigid_body_modes
  use attrito_contact_state, only: state_open
  use attrito_continuation_tangent, only: share_beside_slide
  use attrito_core_errors, only: error_type
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: null_space, solve_dense
  use attrito_model_contacts, only: new_contacts
  use attrito_model_structure, only: damping_ratio
  use attrito_solve_solver, only: solver_type, solver_options_type, new_solver
  use scenes, only: scene_type, rubbing_frame, damp, noise
  use session, only: run_in_session, only_me
  use testing, only: test, check, check_close
  implicit none

  integer, parameter :: harmonics = 3, coordinates = 8, rows = 10
  real(wp), parameter :: omega = 1.2_wp
  !> Rounding of sums of some ten terms of order one, through stuck modes whose stiffness spans less than 1e3
  real(wp), parameter :: rounding = 1.0e-12_wp

  call run_in_session('rigid-body modes', [ &
                      test('a structure that stands by itself has none', held), &
                      test('of a structure that buckles they are told from what it does not resist', buckling), &
                      test('one in which all coordinates move alike is told by its stiffness, not by the last pivot', spread_out), &
                      test('they are those that its stiffness makes nothing of, the first of them those that slide', found), &
                      test('a motion that rounding alone holds counts as free, one that soft springs hold does not', softness), &
                      test('what mean forces lack along them is the residual''s part there, at any motion', balance_of_forces), &
                      test('of forces that balance but for rounding nothing is missing, but for a millionth something is', &
                           rounding_of_forces), &
                      test('a slide is measured in slip radii, and nothing else is a slide', slide_in_slip_radii), &
                      test('along a branch slides count apart, other means do not', shares), &
                      test('a body slides back by what it has slid, and by nothing else', sliding_back)])

contains

  !> The frame, of whose motions two are made free: the first moves no contact along its normal.
  function free_frame() result(scene)
    type(scene_type) :: scene
    real(wp) :: free(coordinates, 2), kept(coordinates, coordinates), directions(coordinates, rows)
    integer :: i

    scene = rubbing_frame()
    call damp(scene, damping_ratio, 0.04_wp)
    free = reshape(noise(2*coordinates, 11), [coordinates, 2])
    free(:, 1) = free(:, 1)/norm2(free(:, 1))
    free(:, 2) = free(:, 2) - dot_product(free(:, 1), free(:, 2))*free(:, 1)
    free(:, 2) = free(:, 2)/norm2(free(:, 2))
    kept = -matmul(free, transpose(free))
    do i = 1, coordinates
      kept(i, i) = kept(i, i) + 1.0_wp
    end do
    scene%structure%stiffness = matmul(kept, matmul(scene%structure%stiffness, kept))
    directions = scene%contacts%directions
    do i = 1, size(scene%contacts%law)
      associate (normal => scene%contacts%law(i)%first_row + scene%contacts%law(i)%tangents)
        directions(:, normal) = directions(:, normal) - dot_product(directions(:, normal), free(:, 1))*free(:, 1)
      end associate
    end do
    scene%contacts = new_contacts(scene%contacts%law, directions)
  end function free_frame

  function solver_of(scene) result(solver)
    type(scene_type), intent(in) :: scene
    type(solver_type) :: solver
    type(error_type), allocatable :: fault

    call new_solver(scene%structure, scene%contacts, only_me(), solver_options_type(harmonics=harmonics, samples=32), solver, fault)
    if (allocated(fault)) error stop 'the scene is refused'
  end function solver_of

  subroutine held(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver

    solver = solver_of(rubbing_frame())
    call check(error, solver%context%balance%free%count == 0, 'a motion counts as free')
    call check(error, .not. solver%context%balance%free%leaves_motion, 'the structure does not hold')
    call check_close(error, solver%context%balance%imbalance(solver%motion(1, :)), 0.0_wp, 0.0_wp, 'imbalance')
    call solver%destroy()
  end subroutine held

  subroutine found(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    integer :: i, normal

    scene = free_frame()
    solver = solver_of(scene)
    associate (free => solver%context%balance%free)
      call check(error, free%count == 2 .and. free%sliding == 1, 'not two of them, or not one that slides')
      if (allocated(error)) return
      do i = 1, size(scene%contacts%law)
        normal = scene%contacts%law(i)%first_row + scene%contacts%law(i)%tangents
        call check_close(error, free%rows(normal, 1), 0.0_wp, rounding, 'normal displacement of what slides')
      end do
      call check_close(error, matmul(transpose(free%held_rows), free%held_rows), &
                       reshape([1.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [2, 2]), rounding, 'products of their forces')
    end associate
    call solver%destroy()
  end subroutine found

  !> Of a direction that is harmonics to 0.6: a mean that slides leaves that, one that does not leaves all; and where the structure
  !> holds every body no mean counts.
  subroutine shares(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp) :: motion(2*harmonics + 1, rows), means(rows, 2)
    integer :: i

    solver = solver_of(free_frame())
    motion = 0.0_wp
    motion(2, 1) = 0.48_wp
    associate (slide => solver%context%balance%free%rows(:, 1), held => solver%context%balance%free%held_rows(:, 1), &
               other => solver%context%balance%free%rows(:, 2))
      means(:, 1) = slide
      means(:, 2) = other - dot_product(held, other)/dot_product(held, slide)*slide
    end associate
    do i = 1, 2
      motion(1, :) = 0.8_wp*means(:, i)/norm2(means(:, i))
      call check_close(error, share_beside_slide(solver, motion, 0.36_wp), merge(0.6_wp, 1.0_wp, i == 1), rounding, 'share')
    end do
    ! Nor do means at contacts that stay open.
    solver%context%balance%forces%state = state_open
    call check_close(error, share_beside_slide(solver, motion, 0.36_wp), 0.6_wp, rounding, 'share of open contacts')
    call solver%destroy()
    solver = solver_of(rubbing_frame())
    call check_close(error, share_beside_slide(solver, motion, 0.36_wp), 0.6_wp, rounding, 'share of a structure that holds')
    call solver%destroy()
  end subroutine shares

  !> What is free is given springs, or less than nothing: parts of the largest stiffness that rounding hides, or does not.
  subroutine softness(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene, softer
    type(solver_type) :: solver
    real(wp), parameter :: parts(4) = [1.0e-11_wp, 1.0e-12_wp, 1.0e-15_wp, -1.0e-15_wp]
    integer :: i, j

    scene = free_frame()
    associate (largest => maxval(abs(scene%structure%stiffness)))
      do i = 1, size(parts)
        softer = scene
        do j = 1, coordinates
          softer%structure%stiffness(j, j) = softer%structure%stiffness(j, j) + parts(i)*largest
        end do
        solver = solver_of(softer)
        call check(error, solver%context%balance%free%leaves_motion .eqv. parts(i) < 1.0e-13_wp, &
                   'rounding is taken for a spring, or a spring for rounding')
        call solver%destroy()
      end do
    end associate
  end subroutine softness

  !> A negative stiffness, as spin softening makes it, along a motion that the frame resists
  subroutine buckling(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    real(wp), allocatable :: motions(:, :)
    real(wp) :: along(coordinates, 1)
    real(wp), parameter :: tolerance = 10.0_wp*epsilon(1.0_wp)*coordinates

    scene = free_frame()
    along = matmul(scene%structure%stiffness, reshape(noise(coordinates, 41), [coordinates, 1]))
    associate (softened => scene%structure%stiffness - 30.0_wp*matmul(along, transpose(along))/norm2(along)**2)
      call check(error, dot_product(along(:, 1), matmul(softened, along(:, 1))) < 0.0_wp, 'it does not buckle: the test is void')
      call null_space(softened, tolerance, motions)
      call check(error, size(motions, 2) == 2, 'not two rigid-body modes')
      call check_close(error, matmul(softened, motions), 0.0_wp*motions, rounding, 'forces along them')
    end associate
  end subroutine buckling

  !> a = 1 - (1 - delta) e e^T, e of unit length with all entries alike: delta is an eigenvalue, and the last pivot n delta.
  subroutine spread_out(error)
    type(error_type), allocatable, intent(out) :: error
    integer, parameter :: n = 40
    real(wp), parameter :: tolerance = 1.0e-10_wp, parts(2) = [0.5_wp, 2.0_wp]
    real(wp), allocatable :: motions(:, :)
    real(wp) :: matrix(n, n)
    integer :: i, j

    do j = 1, size(parts)
      matrix = (parts(j)*tolerance - 1.0_wp)/n
      do i = 1, n
        matrix(i, i) = matrix(i, i) + 1.0_wp
      end do
      call null_space(matrix, tolerance, motions)
      call check(error, size(motions, 2) == merge(1, 0, parts(j) < 1.0_wp), 'not the motions up to the tolerance')
      if (allocated(error)) return
    end do
  end subroutine spread_out

  !> s = -(K_c B Z)^T r_0
  subroutine balance_of_forces(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    integer :: status, seed

    solver = solver_of(free_frame())
    associate (balance => solver%context%balance)
      call solver%set_loads([1.5_wp], 0.7_wp)
      do seed = 21, 23
        solver%motion = reshape(noise(size(solver%motion), seed), shape(solver%motion))
        call balance%evaluate(solver%motion, omega, status)
        call check(error, norm2(balance%residual(1, :)) > 0.1_wp, 'the residual is small: the test is void')
        call check_close(error, balance%imbalance(solver%motion(1, :)), &
                         norm2(matmul(balance%residual(1, :), balance%free%held_rows)), rounding, 'forces that nothing balances')
      end do
    end associate
    call solver%destroy()
  end subroutine balance_of_forces

  !> Two static loads are chosen such that nothing is missing at some motion; then a part of them is.
  subroutine rounding_of_forces(error)
    type(error_type), allocatable, intent(out) :: error
    type(scene_type) :: scene
    type(solver_type) :: solver
    real(wp) :: matrix(2, 2), factors(2, 1), missing(3)
    real(wp), parameter :: parts(3) = [0.0_wp, 1.0e-10_wp, 1.0e-6_wp]
    integer :: i, status, info

    scene = free_frame()
    scene%structure%static_loads = reshape(noise(2*coordinates, 31), [coordinates, 2])
    solver = solver_of(scene)
    associate (balance => solver%context%balance)
      solver%motion = reshape(noise(size(solver%motion), 21), shape(solver%motion))
      call solver%set_loads([0.0_wp, 0.0_wp], 0.0_wp)
      call balance%evaluate(solver%motion, omega, status)
      ! Without loads s = -(contacts' forces along the free motions) = -(K_c B Z)^T r_0.
      factors(:, 1) = matmul(balance%residual(1, :), balance%free%held_rows)
      matrix = balance%free%static_loads
      call solve_dense(matrix, factors, info)
      call check(error, info == 0 .and. all(abs(factors) > 0.01_wp), 'the loads do not span the motions: the test is void')
      if (allocated(error)) return
      do i = 1, size(parts)
        call solver%set_loads((1.0_wp + parts(i))*factors(:, 1), 0.0_wp)
        call balance%evaluate(solver%motion, omega, status)
        missing(i) = balance%imbalance(solver%motion(1, :))
      end do
      call check_close(error, missing, [0.0_wp, 0.0_wp, parts(3)*norm2(matmul(balance%free%static_loads, factors(:, 1)))], &
                       rounding, 'what is missing')
      call check(error, missing(3) > 1.0e3_wp*rounding .and. all(missing(:2) <= 0.0_wp), 'rounding counts, or nothing does')
    end associate
    call solver%destroy()
  end subroutine rounding_of_forces

  subroutine slide_in_slip_radii(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp) :: mean(rows), step(rows), longest, reach
    integer :: i

    solver = solver_of(free_frame())
    associate (balance => solver%context%balance)
      mean = 1.0_wp + abs(noise(rows, 33))
      step = 300.0_wp*balance%free%rows(:, 1)
      longest = 0.0_wp
      reach = 0.0_wp
      do i = 1, size(balance%law)
        associate (law => balance%law(i), last => balance%law(i)%first_row + balance%law(i)%tangents)
          reach = max(reach, law%friction_coefficient*(law%preload + law%normal_stiffness*(mean(last) - law%gap)) &
                      /law%tangential_stiffness)
          longest = max(longest, norm2(step(law%first_row:last - 1)))
        end associate
      end do
      call check(error, reach > 0.0_wp, 'no contact touches')
      call check_close(error, balance%slip_radii(mean, step), longest/reach, rounding*longest/reach, 'a slide')
      ! What the springs of the first contact's normal hold is no slide.
      step = 0.0_wp
      step(2) = 300.0_wp
      call check_close(error, balance%slip_radii(mean, step), 0.0_wp, rounding*longest/reach, 'a normal displacement')
    end associate
    call solver%destroy()
  end subroutine slide_in_slip_radii

  subroutine sliding_back(error)
    type(error_type), allocatable, intent(out) :: error
    type(solver_type) :: solver
    real(wp) :: before(rows), mean(rows), slider(2, 4)
    real(wp), parameter :: slid = 300.0_wp
    integer :: i

    solver = solver_of(free_frame())
    associate (balance => solver%context%balance)
      before = noise(rows, 31)
      slider = reshape(noise(size(slider), 32), shape(slider))
      mean = before + slid*balance%free%rows(:, 1)
      do i = 1, size(balance%law)
        associate (first => balance%law(i)%first_row, tangents => balance%law(i)%tangents)
          slider(:tangents, i) = slider(:tangents, i) + slid*balance%free%rows(first:first + tangents - 1, 1)
        end associate
      end do
      call balance%remove_drift(before, mean, slider)
      call check_close(error, mean, before, slid*rounding, 'means of a body that has slid')
      do i = 1, size(balance%law)
        associate (tangents => balance%law(i)%tangents, first => noise(size(slider), 32))
          call check_close(error, slider(:tangents, i), first(2*i - 1:2*i - 2 + tangents), slid*rounding, 'its sliders')
        end associate
      end do
      ! What the springs of the first contact's normal hold is no slide.
      mean = before
      mean(2) = mean(2) + 1.0_wp
      call balance%remove_drift(before, mean, slider)
      call check_close(error, mean(2), before(2) + 1.0_wp, 0.0_wp, 'a normal displacement')
    end associate
    call solver%destroy()
  end subroutine sliding_back
end program test_rigid_body_modes
