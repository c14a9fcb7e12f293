!> Does the linearised step hold that a finer balance was estimated by? Contact forces are evaluated where it ended, and a second step
!> is made from there.
!>
!> $$ \rho_h = B \tilde Z_h^{-1} (f_h - B^T g_h(d)) - d_h, \qquad (I + R D) \, \delta^2 = \rho \quad (h \le H), \qquad
!>    d_h \leftarrow d_h + \rho_h \quad (h > H) $$
!>
!> Beyond H the contacts feel the motion that they cause there themselves: the first answer d^1_h is that to forces without it, the
!> second to forces with it once. If the second changes the first by lambda times that, all further answers together come to
!> lambda / (1 - lambda) times the change. If that is too much, further answers are found, mixed as Anderson's method does, until the
!> last change is small.
!> Source: Walker & Ni 2011, doi:10.1137/10078356X.
module attrito_accuracy_second_step
  use attrito_core_kinds, only: wp
  use attrito_accuracy_finer_balance, only: finer_balance_type, finer_point_type, solve_for_estimate
  use attrito_newton_linearised_step, only: change_of_deviation
  use attrito_core_anderson, only: anderson_type
  use attrito_core_trigonometric, only: to_complex
  use attrito_balance_unknowns, only: unknowns_type
  use attrito_contact_forces, only: contact_forces_type
  use attrito_solve_solver, only: solver_type
  implicit none
  private
  public :: second_step_type, step_again

  !> Least |1 - lambda| that is believed: lambda is a mean over contacts and modes, and no more than one digit of it is sure
  real(wp), parameter :: least_distance = 0.02_wp ! guess

  type :: second_step_type
    !> Coefficients of the monitors after it [2 K + 1, monitors]; not allocated where the step is singular
    real(wp), allocatable :: monitors(:, :)
    !> Response that these belong to [n, 0:K]
    complex(wp), allocatable :: response(:, :)
    !> What answers beyond the second would add, all harmonics beyond H together: part of the motion, as `threshold` is
    real(wp) :: missing = 0.0_wp
    !> The harmonic beyond which that is no more than what may be missing; 0: all of it is not
    integer :: unsettled = 0
  end type second_step_type

  !> Of the harmonics 1 ... K: norms of the contacts' first answer and of what the second changes, and lambda [K]; the same norms of
  !> the monitors, mean included [monitors, 1 + K]
  type :: answers_type
    real(wp), allocatable :: before(:), change(:), monitors(:, :), change_of_monitors(:, :)
    complex(wp), allocatable :: ratio(:)
  end type answers_type

contains

  !> From where the first step has ended; `first` stays.
  subroutine step_again(finer, solver, first, threshold, most_answers, second)
    !> Balance with more harmonics or samples
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
    complex(wp), allocatable :: response(:, :), added(:, :)
    real(wp), allocatable :: deviation(:, :), change(:, :), released(:, :)
    real(wp), allocatable :: motion(:, :), answer(:, :), monitors(:, :), of_motion(:, :)
    integer :: i, k, status

    associate (balance => solver%context%balance, harmonics => solver%context%balance%receptance%harmonics)
      k = balance%coefficients()
      allocate (response, mold=first%response)
      allocate (added, mold=balance%response)
      motion = first%motion
      of_motion = first%monitors
      do i = 0, most_answers
        call evaluate_all(finer, solver, first, motion, deviation, change, released)
        response(:, harmonics + 1:) = 0.0_wp
        call balance%respond_to_deviation(change, added)
        response(:, :harmonics) = balance%response + added
        call finer%respond_beyond(solver, motion, deviation, response)
        call add_frequency(response, first%omega - solver%omega)
        answer = balance%contact_rows%motion_of(response)
        monitors = balance%monitors%motion_of(response)
        call compare(answers, solver, motion, answer, of_motion, monitors, are_first=i == 0)
        call sum_further(answers, (k + 1)/2, threshold, second)
        if (second%unsettled == 0) exit
        of_motion = monitors
        motion(k + 1:, :) = mixing%next(balance%ranks, motion(k + 1:, :), answer(k + 1:, :))
      end do
      right = unknowns_type(answer(:k, :) - first%motion(:k, :), released)
      call solve_for_estimate(solver, right, moved, status, first%asked)
      if (status /= 0) return
      call balance%respond_to_deviation(change_of_deviation(balance, right, moved), added)
      response(:, :harmonics) = response(:, :harmonics) + added
      call add_frequency(response, moved%omega)
      second%monitors = balance%monitors%motion_of(response)
      second%response = response
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

  !> Forces of all contacts of this rank at a motion, those included that stuck before it.
  subroutine evaluate_all(finer, solver, first, motion, deviation, change, released)
    !> Balance with more harmonics or samples
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

  !> What two answers are, harmonic by harmonic. Their ratio is that of the first two.
  subroutine compare(answers, solver, first, second, first_monitors, second_monitors, are_first)
    !> Takes it
    type(answers_type), intent(inout) :: answers
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Motion of this rank's rows [2 K + 1, rows], and monitors [2 K + 1, monitors]
    real(wp), intent(in) :: first(:, :), second(:, :), first_monitors(:, :), second_monitors(:, :)
    !> Are these the first two?
    logical, intent(in) :: are_first
    complex(wp), allocatable :: before(:, :), change(:, :)
    real(wp) :: sums(size(first, 1)/2, 4)
    complex(wp) :: product
    integer :: h

    before = to_complex(first)
    change = to_complex(second) - before
    do h = 1, size(sums, 1)
      product = sum(conjg(before(:, h + 1))*change(:, h + 1))
      sums(h, :) = [sum(before(:, h + 1)%re**2 + before(:, h + 1)%im**2), sum(change(:, h + 1)%re**2 + change(:, h + 1)%im**2), &
                    product%re, product%im]
    end do
    call solver%context%balance%ranks%sum(sums)
    answers%before = sqrt(sums(:, 1))
    answers%change = sqrt(sums(:, 2))
    if (are_first) answers%ratio = cmplx(sums(:, 3), sums(:, 4), wp)/max(sums(:, 1), tiny(1.0_wp))
    answers%monitors = abs(to_complex(first_monitors))
    answers%change_of_monitors = abs(to_complex(second_monitors - first_monitors))
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
      further = abs(answers%ratio(h))/max(abs(1.0_wp - answers%ratio(h)), least_distance)
      part = further*max(weight*answers%change(h)/swing, maxval(answers%change_of_monitors(:, h + 1)/swings))
      second%missing = hypot(second%missing, part)
      if (second%unsettled == 0 .and. second%missing > threshold) second%unsettled = h
    end do
  end subroutine sum_further
end module attrito_accuracy_second_step
