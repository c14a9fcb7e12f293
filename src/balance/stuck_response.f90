!> The response while every contact sticks with its slider where it is: linear, its mean the same all along a sweep.
!>
!> $$ X_0 = \tilde Z_0^{-1} (f_0 - B^T g_0), \qquad X_h = \tilde Z_h^{-1} f_h \; [h > 0], \qquad d = B X $$
!>
!> Rows are recovered for the harmonics that are loaded, and contacts checked by bounds; only those that the bounds leave open are
!> evaluated.
module attrito_balance_stuck_response
  use attrito_core_kinds, only: wp
  use attrito_contact_state, only: state_stuck
  use attrito_contact_stuck_bound, only: mean_capacity, sticks_within
  use attrito_balance_harmonic_balance, only: balance_type, stuck_mean_type
  implicit none
  private
  public :: evaluate_stuck, find_loaded_response, linear_motion, recover_loaded

contains

  !> The linear response at a frequency, with sliders where they are: the solution if it leaves every contact stuck. Residual and
  !> derivative are not evaluated.
  subroutine evaluate_stuck(self, omega, motion, stuck)
    type(balance_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> [2 H + 1, rows], changed only if it does
    real(wp), intent(inout) :: motion(:, :)
    !> Does every contact stick?
    logical, intent(out) :: stuck
    real(wp), allocatable :: moving(:, :)
    integer :: top, status

    stuck = .false.
    self%evaluations = self%evaluations + 1
    top = self%highest_load()
    call self%receptance%set_frequency(omega, status, top)
    if (status /= 0) return
    call self%receptance%respond(self%level*self%harmonic_load(:, :top), self%response(:, :top))
    self%response(:, top + 1:) = 0.0_wp
    call update_mean(self)
    self%response(:, 0) = self%kept%response
    moving = recover_loaded(self, self%response)
    stuck = self%ranks%largest(merge(0.0_wp, 1.0_wp, stays_stuck(self, moving))) <= 0.0_wp
    if (.not. stuck) return
    self%kept%evaluation = self%evaluations
    call compose_motion(self, self%kept%motion, moving, motion)
  end subroutine evaluate_stuck

  !> Harmonics of the stuck response that are loaded, at a frequency, whether contacts stick or not.
  subroutine find_loaded_response(self, omega, response)
    type(balance_type), intent(inout) :: self
    !> Angular frequency, rad/s
    real(wp), intent(in) :: omega
    !> [n, loaded]; not allocated: the system is singular there
    complex(wp), allocatable, intent(out) :: response(:, :)
    complex(wp) :: all(size(self%harmonic_load, 1), 0:self%highest_load())
    integer :: status

    call self%receptance%set_frequency(omega, status, ubound(all, 2))
    if (status /= 0) return
    call self%receptance%respond(self%level*self%harmonic_load(:, :ubound(all, 2)), all)
    response = all(:, self%loaded)
  end subroutine find_loaded_response

  !> Mean of the response to the static loads and to what stuck contacts add to their springs: sliders, preloads, gaps [n]; or where
  !> it is frozen. Kept: it stays the same along a sweep.
  subroutine update_mean(self)
    type(balance_type), intent(inout) :: self
    integer :: e, i

    if (self%ranks%largest(merge(0.0_wp, 1.0_wp, is_kept(self))) <= 0.0_wp) return
    self%kept = stuck_mean_type(slider=self%slider, static_factors=self%static_factors, frozen=allocated(self%frozen_mean))
    if (self%kept%frozen) then
      self%kept%response = self%frozen_mean
    else
      self%kept%response = mean_response(self)
    end if
    self%kept%motion = self%contact_rows%mean_of(self%kept%response)
    allocate (self%kept%capacities(size(self%slider, 1)/2, size(self%law)))
    do i = 1, size(self%law)
      associate (law => self%law(i))
        do e = 1, law%elements()
          self%kept%capacities(e, i) = &
            mean_capacity(law, e, self%kept%motion(law%first_row:law%first_row + law%tangents), self%slider(:, i))
        end do
      end associate
    end do
  end subroutine update_mean

  !> Is what is kept the mean for these sliders and loads?
  pure logical function is_kept(self)
    type(balance_type), intent(in) :: self

    is_kept = allocated(self%kept%slider) .and. (self%kept%frozen .eqv. allocated(self%frozen_mean))
    if (is_kept) is_kept = all(abs(self%kept%slider - self%slider) <= 0.0_wp) &
                           .and. all(abs(self%kept%static_factors - self%static_factors) <= 0.0_wp)
    if (is_kept .and. self%kept%frozen) is_kept = all(abs(self%kept%response - self%frozen_mean) <= 0.0_wp)
  end function is_kept

  function mean_response(self) result(mean)
    type(balance_type), intent(in) :: self
    complex(wp), allocatable :: mean(:)
    real(wp) :: deviation(self%rows()), force(size(self%response, 1))
    complex(wp), dimension(size(force), 0:0) :: load, response
    integer :: i, t

    do i = 1, size(self%law)
      associate (law => self%law(i))
        deviation(law%first_row:law%first_row + law%tangents) = &
          [(law%slider_force(t, self%slider(:, i)), t=1, law%tangents), law%normal_force(0.0_wp)]
      end associate
    end do
    force = -self%contact_rows%mean_load_of(deviation)
    call self%ranks%sum(force)
    load(:, 0) = force + matmul(self%static_loads, self%static_factors)
    call self%receptance%respond(load, response)
    mean = response(:, 0)
  end function mean_response

  !> Does every contact of this rank stick, its rows moving so about the mean that is kept? Where they all did at the last
  !> evaluation, the forces of those that surely do again are what they were.
  logical function stays_stuck(self, moving)
    type(balance_type), intent(inout) :: self
    !> Their loaded harmonics [rows, 2 loaded]
    real(wp), intent(in) :: moving(:, :)
    real(wp) :: oscillation_bounds(size(moving, 1)), own(self%coefficients(), 3)
    logical :: as_before, changed
    integer :: i, h

    oscillation_bounds = 0.0_wp
    do h = 1, size(self%loaded)
      oscillation_bounds = oscillation_bounds + sqrt(moving(:, 2*h - 1)**2 + moving(:, 2*h)**2)
    end do
    as_before = self%kept%evaluation == self%evaluations - 1
    changed = .not. as_before
    stays_stuck = .true.
    do i = 1, size(self%law)
      associate (law => self%law(i))
        if (as_before .or. was_stuck(self, i)) then
          if (sticks_within(law, oscillation_bounds(law%first_row:law%first_row + law%tangents), self%kept%capacities(:, i))) cycle
        end if
        changed = .true.
        associate (first => law%first_row, last => law%first_row + law%tangents)
          call compose_motion(self, self%kept%motion(first:last), moving(first:last, :), own)
        end associate
        call self%evaluate_forces(i, own(:, :law%tangents + 1))
      end associate
      stays_stuck = self%forces(i)%state == state_stuck
      if (.not. stays_stuck) return
    end do
    if (changed) call self%active%find(self%law, self%forces, self%contact_rows)
  end function stays_stuck

  !> Was a contact stuck at its last evaluation, with its slider where it is?
  pure logical function was_stuck(self, contact)
    type(balance_type), intent(in) :: self
    !> Number of the contact
    integer, intent(in) :: contact

    associate (forces => self%forces(contact))
      was_stuck = forces%state == state_stuck .and. allocated(forces%active) &
                  .and. all(abs(forces%slider - self%slider(:, contact)) <= 0.0_wp)
    end associate
  end function was_stuck

  !> Motion of some rows by their mean and their loaded harmonics, all others being zero.
  pure subroutine compose_motion(self, mean, moving, motion)
    type(balance_type), intent(in) :: self
    !> [rows] and [rows, 2 loaded]
    real(wp), intent(in) :: mean(:), moving(:, :)
    !> [2 H + 1, at least rows]
    real(wp), intent(inout) :: motion(:, :)
    integer :: i, row

    motion = 0.0_wp
    do row = 1, size(mean)
      motion(1, row) = mean(row)
      do i = 1, size(self%loaded)
        motion(2*self%loaded(i), row) = moving(row, 2*i - 1)
        motion(2*self%loaded(i) + 1, row) = moving(row, 2*i)
      end do
    end do
  end subroutine compose_motion

  !> Loaded harmonics of this rank's rows from a response [rows, 2 loaded], cosine before sine.
  function recover_loaded(self, response) result(moving)
    type(balance_type), intent(in) :: self
    !> Coordinates of the response, by harmonic
    complex(wp), intent(in) :: response(:, 0:)
    real(wp), allocatable :: moving(:, :)

    moving = self%contact_rows%chosen_harmonics_of(self%loaded, response)
  end function recover_loaded

  !> Relative displacements of this rank's rows with every contact stuck, at the frequency last set [2 H + 1, rows].
  function linear_motion(self) result(motion)
    type(balance_type), intent(in) :: self
    real(wp), allocatable :: motion(:, :)
    complex(wp) :: response(size(self%response, 1), 0:self%receptance%harmonics)

    response = self%linear_response()
    allocate (motion(self%coefficients(), self%rows()))
    call compose_motion(self, self%contact_rows%mean_of(response(:, 0)), recover_loaded(self, response), motion)
  end function linear_motion
end module attrito_balance_stuck_response
