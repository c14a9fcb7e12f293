!> Does the linearised step hold that a finer balance was estimated by? Contact forces are evaluated where it ended, and a second step
!> is made from there.
!>
!> $$ \rho_h = B \tilde Z_h^{-1} (f_h - B^T g_h(d)) - d_h, \qquad (I + R D) \, \delta^2 = \rho \quad (h \le H) $$
!>
!> Beyond H the contacts feel the motion that they cause there themselves: the first answer d^1_h is that to forces without it, the
!> second to forces with it once. If the second changes the first by lambda times that, all further answers together come to
!> lambda / (1 - lambda) times the change,
!>
!> $$ d_h \leftarrow d_h + \rho_h/(1 - \lambda_h), $$
!>
!> which holds where answers run away, too, as they do at a natural frequency of the stuck structure that slip damps. If that is too
!> much, it is tried: further answers are found from there, mixed as Anderson's method does, until the last change is small.
!> Source: Walker & Ni 2011, doi:10.1137/10078356X.
module attrito_accuracy_second_step
  use attrito_core_kinds, only: wp
  use attrito_accuracy_finer_balance, only: finer_balance_type, finer_point_type, solve_for_estimate
  use attrito_newton_linearised_step, only: change_of_deviation
  use attrito_core_anderson, only: anderson_type
  use attrito_core_communicator, only: communicator_type
  use attrito_core_trigonometric, only: to_complex
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: second_step_type, step_again

  !> Least |1 - lambda| that is believed: lambda is a mean over contacts and modes, and no more than one digit of it is sure
  real(wp), parameter :: least_distance = 0.02_wp ! guess
  !> Part of its first change that an answer's has to fall to for lambda to hold: then what is missing is what the motion is off by,
  !> not its answer
  real(wp), parameter :: tried = 0.5_wp ! guess

  type :: second_step_type
    !> Coefficients of the monitors after it [2 K + 1, monitors]; not allocated where the step is singular
    real(wp), allocatable :: monitors(:, :)
    !> Response that these belong to [n, 0:K]
    complex(wp), allocatable :: response(:, :)
    !> Its angular frequency, and what start sliders that are unknowns have moved by [width, contacts]
    real(wp) :: omega = 0.0_wp
    real(wp), allocatable :: slider(:, :)
    !> What answers beyond the second would add, all harmonics beyond H together: part of the motion, as `threshold` is
    real(wp) :: missing = 0.0_wp
    !> The harmonic beyond which that is no more than what may be missing; 0: all of it is not
    integer :: unsettled = 0
  end type second_step_type

  !> Of the harmonics 1 ... K: norms of the contacts' motion and of what its answer changes, and lambda [K]; the same norms of the
  !> monitors, mean included [monitors, 1 + K]; the first change of all [K]
  type :: answers_type
    real(wp), allocatable :: before(:), change(:), first_change(:), monitors(:, :), change_of_monitors(:, :)
    complex(wp), allocatable :: ratio(:)
  end type answers_type

contains

  !> From where the first step has ended; `first` stays.
  subroutine step_again(finer, solver, first, threshold, most_answers, second)
    !> Balance with more harmonics
    type(finer_balance_type), intent(in) :: finer
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(in) :: first
    !> Part of the monitors' motion, and ten times that of the contacts', that may be missing
    real(wp), intent(in) :: threshold
    !> Answers beyond the second at most
    integer, intent(in) :: most_answers
    !> The second step
    type(second_step_type), intent(out) :: second
    type(unknowns_type) :: right, moved
    type(answers_type) :: answers
    type(anderson_type) :: mixing
    complex(wp), allocatable :: response(:, :), added(:, :), beyond(:, :)
    real(wp), allocatable :: deviation(:, :), change(:, :), released(:, :)
    real(wp), allocatable :: motion(:, :), answer(:, :), monitors(:, :), of_motion(:, :)
    integer :: i, k, status

    associate (balance => solver%context%balance, harmonics => solver%context%balance%receptance%harmonics)
      k = balance%coefficients()
      allocate (response, mold=first%response)
      allocate (added, mold=balance%response)
      motion = first%motion
      of_motion = first%monitors
      beyond = first%response(:, harmonics + 1:)
      do i = 0, most_answers
        call evaluate_all(finer, solver, first, motion, deviation, change, released)
        response(:, harmonics + 1:) = 0.0_wp
        call balance%respond_to_deviation(change, added)
        response(:, :harmonics) = balance%response + added
        call finer%respond_beyond(solver, motion, deviation, response)
        call add_frequency(response, first%omega - solver%omega)
        answer = balance%contact_rows%motion_of(response)
        monitors = balance%monitors%motion_of(response)
        call compare(answers, solver, motion, answer, of_motion, monitors)
        call sum_further(answers, (k + 1)/2, threshold, second)
        call go_on(balance%ranks, mixing, answers%ratio(harmonics + 1:), second%unsettled > 0, answer(k + 1:, :), &
                   response(:, harmonics + 1:), motion(k + 1:, :), beyond)
        response(:, harmonics + 1:) = beyond
        if (second%unsettled == 0) exit
        of_motion = balance%monitors%motion_of(response)
      end do
      right = unknowns_type(answer(:k, :) - first%motion(:k, :), released)
      call solve_for_estimate(solver, right, moved, status, first%asked)
      if (status /= 0) return
      call balance%respond_to_deviation(change_of_deviation(balance, right, moved), added)
      response(:, :harmonics) = response(:, :harmonics) + added
      call add_frequency(response, moved%omega)
      second%monitors = balance%monitors%motion_of(response)
      second%response = response
      second%omega = first%omega + moved%omega
      second%slider = first%slider + moved%slider
    end associate

  contains

    !> What a change of the frequency adds to the response at the balance's own harmonics, to first order.
    subroutine add_frequency(response, change)
      !> Coordinates of the response, by harmonic
      complex(wp), intent(inout) :: response(:, 0:)
      !> Change of the forces or of the frequency
      real(wp), intent(in) :: change
      complex(wp), allocatable :: by_omega(:, :)

      associate (balance => solver%context%balance, harmonics => solver%context%balance%receptance%harmonics)
        allocate (by_omega, mold=balance%response)
        call balance%receptance%respond_derivative(response(:, :harmonics), by_omega)
        response(:, :harmonics) = response(:, :harmonics) + change*by_omega
      end associate
    end subroutine add_frequency
  end subroutine step_again

  !> The motion beyond H that its answer leads to: as if all further answers changed it by lambda more, and mixed with those before.
  subroutine go_on(ranks, mixing, ratio, mixes, answer, response, motion, beyond)
    !> That share the contacts
    type(communicator_type), intent(in) :: ranks
    !> Answers before
    type(anderson_type), intent(inout) :: mixing
    !> lambda of the harmonics beyond H
    complex(wp), intent(in) :: ratio(:)
    !> Mixed, or as they are?
    logical, intent(in) :: mixes
    !> Answer to the motion on this rank's rows [2 (K - H), rows], and the response that it belongs to [n, K - H]
    real(wp), intent(in) :: answer(:, :)
    complex(wp), intent(in) :: response(:, :)
    !> Motion and the response that it belongs to
    real(wp), intent(inout) :: motion(:, :)
    complex(wp), intent(inout) :: beyond(:, :)
    complex(wp) :: change(size(motion, 2)), factor
    real(wp) :: residual(size(motion, 1), size(motion, 2)), next(size(motion) + 2*size(beyond))
    integer :: h

    do h = 1, size(ratio)
      factor = conjg(1.0_wp - ratio(h))/max(abs(1.0_wp - ratio(h)), least_distance)**2
      change = factor*cmplx(answer(2*h - 1, :) - motion(2*h - 1, :), motion(2*h, :) - answer(2*h, :), wp)
      residual(2*h - 1, :) = change%re
      residual(2*h, :) = -change%im
      beyond(:, h) = beyond(:, h) + factor*(response(:, h) - beyond(:, h))
    end do
    motion = motion + residual
    if (.not. mixes) return
    next = mixing%next(ranks, reshape(residual, [size(residual)]), &
                       [reshape(motion, [size(motion)]), reshape(beyond%re, [size(beyond)]), reshape(beyond%im, [size(beyond)])])
    motion = reshape(next(:size(motion)), shape(motion))
    beyond = reshape(cmplx(next(size(motion) + 1:size(motion) + size(beyond)), next(size(motion) + size(beyond) + 1:), wp), &
                     shape(beyond))
  end subroutine go_on

  !> Forces of all contacts of this rank at a motion, those included that stuck before it.
  subroutine evaluate_all(finer, solver, first, motion, deviation, change, released)
    !> Balance with more harmonics
    type(finer_balance_type), intent(in) :: finer
    !> Solver of points, which this moves
    type(solver_type), intent(inout) :: solver
    !> Point by the finer balance, to first order
    type(finer_point_type), intent(in) :: first
    !> Of this rank's rows [2 K + 1, rows]
    real(wp), intent(in) :: motion(:, :)
    !> Deviation [2 K + 1, rows], what it is changed by up to H [2 H + 1, rows], where periodic sliders have yet to go [2, contacts]
    real(wp), allocatable, intent(out) :: deviation(:, :), change(:, :), released(:, :)
    type(contact_forces_type) :: forces
    integer :: i, k

    associate (balance => solver%context%balance)
      k = balance%coefficients()
      allocate (deviation(size(motion, 1), balance%rows()), change(k, balance%rows()), &
                released(size(balance%slider, 1), size(balance%law)), source=0.0_wp)
      do i = 1, size(balance%law)
        associate (law => balance%law(i), before => balance%forces(i), row => balance%law(i)%first_row, &
                   last => balance%law(i)%first_row + balance%law(i)%tangents)
          if (allocated(forces%deviation)) deallocate (forces%deviation)
          allocate (forces%deviation(size(deviation, 1), law%tangents + 1))
          call finer%evaluate(solver, i, motion(:, row:last), before%slider + first%slider(:, i), forces)
          deviation(:, row:last) = forces%deviation
          change(:, row:last) = forces%deviation(:k, :) - before%deviation(:k, :)
          if (before%periodic) released(:, i) = forces%moved - before%moved
        end associate
      end do
    end associate
  end subroutine evaluate_all

  !> What a motion and its answer are, harmonic by harmonic. Their ratio is that of the first two answers.
  subroutine compare(answers, solver, motion, answer, of_motion, of_answer)
    !> Takes it
    type(answers_type), intent(inout) :: answers
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion of this rank's rows [2 K + 1, rows], and monitors [2 K + 1, monitors]
    real(wp), intent(in) :: motion(:, :), answer(:, :), of_motion(:, :), of_answer(:, :)
    complex(wp), allocatable :: before(:, :), change(:, :)
    real(wp) :: sums(size(motion, 1)/2, 4)
    complex(wp) :: product
    integer :: h

    before = to_complex(motion)
    change = to_complex(answer) - before
    do h = 1, size(sums, 1)
      product = sum(conjg(before(:, h + 1))*change(:, h + 1))
      sums(h, :) = [sum(before(:, h + 1)%re**2 + before(:, h + 1)%im**2), sum(change(:, h + 1)%re**2 + change(:, h + 1)%im**2), &
                    product%re, product%im]
    end do
    call solver%context%balance%ranks%sum(sums)
    answers%before = sqrt(sums(:, 1))
    answers%change = sqrt(sums(:, 2))
    if (.not. allocated(answers%ratio)) then
      answers%ratio = cmplx(sums(:, 3), sums(:, 4), wp)/max(sums(:, 1), tiny(1.0_wp))
      answers%first_change = answers%change
    end if
    answers%monitors = abs(to_complex(of_motion))
    answers%change_of_monitors = abs(to_complex(of_answer - of_motion))
  end subroutine compare

  !> What answers beyond the second would add at harmonics from one on, and the harmonic beyond which that is no more than may be
  !> missing.
  pure subroutine sum_further(answers, lowest, threshold, second)
    !> Norms of the contacts' answers by harmonic
    type(answers_type), intent(in) :: answers
    !> Harmonic to begin at
    integer, intent(in) :: lowest
    !> Part of the motion that may be missing
    real(wp), intent(in) :: threshold
    !> Its `missing` and `unsettled`
    type(second_step_type), intent(inout) :: second
    !> Parts of the contacts' motion count this much less than those of the monitors'
    real(wp), parameter :: weight = 0.1_wp ! guess
    real(wp) :: swing, swings(size(answers%monitors, 1)), further, part
    integer :: h

    second%missing = 0.0_wp
    second%unsettled = 0
    swing = max(norm2(answers%before), tiny(1.0_wp))
    swings = max(sqrt(sum(answers%monitors(:, 2:)**2, 2)), tiny(1.0_wp))
    do h = size(answers%before), lowest, -1
      further = abs(answers%ratio(h))
      if (answers%change(h) <= tried*answers%first_change(h)) further = min(further, 1.0_wp)
      further = further/max(abs(1.0_wp - answers%ratio(h)), least_distance)
      part = further*max(weight*answers%change(h)/swing, maxval(answers%change_of_monitors(:, h + 1)/swings))
      second%missing = hypot(second%missing, part)
      if (second%unsettled == 0 .and. second%missing > threshold) second%unsettled = h
    end do
  end subroutine sum_further
end module attrito_accuracy_second_step
