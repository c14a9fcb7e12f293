!> Equilibria along a path of one load, condensed onto the contacts: the mean of the balance alone, for paths of thousands of steps.
!>
!> $$ d = d_0 + \alpha d_1 - R g(d, w), \qquad R = B K_r^{-1} B^T, \qquad g = \lambda(d, w) - S d $$
!>
!> The reference K_r = K + B^T S B has the springs S of the contacts that are closed at rest: one that sticks, or stays open, leaves
!> nothing to solve for. R is formed once. A step of Newton's method solves for what the others change,
!>
!> $$ (I + G R) y = G r, \qquad \delta d = r - R y, \qquad G = d\lambda/dd - S, \qquad r = d_0 + \alpha d_1 - R g - d, $$
!>
!> y on the rows of G that are not zero: two of a contact that slips, three of one that has opened or closed since. A step along the
!> path begins with the sliders of the one before and moves them by return to the friction limit, as the balance's mean does.
!> Every rank holds all contacts and does the same.
module attrito_peak_condensed_equilibrium
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense, subtract_product, times_vector
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: condensed_equilibrium_type, equilibrium_type, new_condensed_equilibrium

  !> Newton's iterations for a step, and the smallest part of a step that is tried
  integer, parameter :: most_iterations = 50 ! guess
  real(wp), parameter :: smallest_step = 1.0_wp/128.0_wp ! guess
  !> Smallest part of Newton's step, and by what part of it the residual is to fall at least
  real(wp), parameter :: smallest_part = 1.0_wp/512.0_wp, least_fall = 1.0e-4_wp ! conventional
  !> Part of a spring below which what a contact's stiffness differs from it is rounding
  real(wp), parameter :: rounding = 1.0e-12_wp ! derived
  !> What rounding may leave of a residual that falls no more, in tolerances
  real(wp), parameter :: stalled = 100.0_wp ! guess

  !> Where a path has come to
  type :: equilibrium_type
    !> alpha
    real(wp) :: load = 0.0_wp
    !> d [rows]; sliders in pairs, one an element [width, contacts]
    real(wp), allocatable :: motion(:), slider(:, :)
  end type equilibrium_type

  type :: condensed_equilibrium_type
    !> Of all contacts
    type(contact_type), allocatable, private :: law(:)
    !> R [rows, rows]; S and d_0 [rows]
    real(wp), allocatable, private :: flexibility(:, :), springs(:), unloaded(:)
    !> d_1 [rows]; q by alpha, of the reference
    real(wp), allocatable, private :: per_load(:)
    real(wp), private :: coordinate_per_load = 0.0_wp
    !> Norm of the residual that counts as converged
    real(wp) :: tolerance = 0.0_wp
  contains
    procedure :: advance
    procedure :: coordinate
  end type condensed_equilibrium_type

contains

  !> From the stuck system, about an equilibrium at alpha = 0.
  subroutine new_condensed_equilibrium(law, springs, flexibility, per_load, coordinate_per_load, rest, self, status)
    !> Of all contacts
    type(contact_type), intent(in) :: law(:)
    !> Of the rows of contacts that stick [rows]; receptance B K~^-1 B^T of the stuck system [rows, rows], which is taken
    real(wp), intent(in) :: springs(:)
    real(wp), allocatable, intent(inout) :: flexibility(:, :)
    !> Motion of the rows by a unit of the load, contacts stuck [rows]; the load's own coordinate q by it
    real(wp), intent(in) :: per_load(:), coordinate_per_load
    !> The equilibrium
    type(equilibrium_type), intent(in) :: rest
    type(condensed_equilibrium_type), intent(out) :: self
    !> 0, or not: contacts that are open at rest leave a motion free
    integer, intent(out) :: status
    real(wp), allocatable :: bridge(:, :), answer(:, :)
    integer, allocatable :: opened(:)
    real(wp) :: force(size(springs)), stiffness(3, 3, size(law)), slider(size(rest%slider, 1), size(law))
    integer :: i, j

    self%law = law
    self%springs = springs
    do i = 1, size(law)
      associate (first => law(i)%first_row, last => law(i)%first_row + law(i)%tangents)
        if (.not. is_closed(law(i), rest%motion(last))) self%springs(first:last) = 0.0_wp
      end associate
    end do
    ! K_r = K~ - B_o^T S_o B_o: R_r = R + R_o (S_o^-1 - R_oo)^-1 R_o^T, and d_1 likewise (Woodbury).
    opened = pack([(i, i=1, size(springs))], abs(self%springs - springs) > 0.0_wp)
    allocate (bridge(size(opened), size(opened)), answer(size(opened), size(springs) + 1))
    bridge = -flexibility(opened, opened)
    do j = 1, size(opened)
      bridge(j, j) = bridge(j, j) + 1.0_wp/springs(opened(j))
    end do
    answer(:, :size(springs)) = flexibility(opened, :)
    answer(:, size(springs) + 1) = per_load(opened)
    call solve_dense(bridge, answer, status)
    if (status /= 0) return
    self%per_load = per_load + matmul(flexibility(:, opened), answer(:, size(springs) + 1))
    self%coordinate_per_load = coordinate_per_load + sum(per_load(opened)*answer(:, size(springs) + 1))
    answer = -answer
    call subtract_product(flexibility(:, opened), answer(:, :size(springs)), flexibility)
    call move_alloc(flexibility, self%flexibility)
    call evaluate(self, rest%motion, rest%slider, force, stiffness, slider)
    allocate (self%unloaded(size(springs)))
    call times_vector(self%flexibility, force - self%springs*rest%motion, self%unloaded)
    self%unloaded = self%unloaded + rest%motion
  end subroutine new_condensed_equilibrium

  !> The equilibrium at another load, in as many steps as it takes; nothing changes if there is none.
  subroutine advance(self, load, state, iterations, converged)
    class(condensed_equilibrium_type), intent(in) :: self
    !> alpha
    real(wp), intent(in) :: load
    !> Where the path has come to
    type(equilibrium_type), intent(inout) :: state
    !> Newton's iterations, counts on
    integer, intent(inout) :: iterations
    !> Was there an equilibrium?
    logical, intent(out) :: converged
    type(equilibrium_type) :: now
    real(wp) :: reached, step

    now = state
    reached = 0.0_wp
    step = 1.0_wp
    do while (reached < 1.0_wp)
      step = min(step, 1.0_wp - reached)
      call solve(self, state%load + (reached + step)*(load - state%load), now, iterations, converged)
      if (converged) then
        reached = merge(1.0_wp, reached + step, reached + step > 1.0_wp - 1.0e-9_wp)
        step = 2.0_wp*step
      else
        step = 0.5_wp*step
        if (step < smallest_step) return
      end if
    end do
    now%load = load
    state = now
  end subroutine advance

  !> q = phi^T M x, less its value at rest but for a constant.
  real(wp) function coordinate(self, state)
    class(condensed_equilibrium_type), intent(in) :: self
    !> Where the path has come to
    type(equilibrium_type), intent(in) :: state
    real(wp) :: force(size(self%springs)), stiffness(3, 3, size(self%law)), slider(size(state%slider, 1), size(self%law))

    call evaluate(self, state%motion, state%slider, force, stiffness, slider)
    coordinate = state%load*self%coordinate_per_load - sum(self%per_load*(force - self%springs*state%motion))
  end function coordinate

  !> Newton's method from the equilibrium before, with backtracking.
  subroutine solve(self, load, state, iterations, converged)
    class(condensed_equilibrium_type), intent(in) :: self
    !> alpha
    real(wp), intent(in) :: load
    !> Where the path has come to
    type(equilibrium_type), intent(inout) :: state
    !> Counts on
    integer, intent(inout) :: iterations
    !> Was there an equilibrium?
    logical, intent(out) :: converged
    real(wp), dimension(size(self%springs)) :: motion, trial, residual, trial_residual, step, deviation, response, force
    real(wp) :: stiffness(3, 3, size(self%law)), slider(size(state%slider, 1), size(self%law))
    real(wp) :: norm, trial_norm, part
    integer :: iteration, status

    motion = state%motion
    deviation = 0.0_wp
    response = 0.0_wp
    call find_residual(motion, residual)
    norm = norm2(residual)
    converged = norm <= self%tolerance
    do iteration = 1, most_iterations
      if (converged) exit
      iterations = iterations + 1
      call newton_step(self, residual, stiffness, step, status)
      if (status /= 0) return
      part = 1.0_wp
      do
        trial = motion + part*step
        call find_residual(trial, trial_residual)
        trial_norm = norm2(trial_residual)
        if (trial_norm <= (1.0_wp - least_fall*part)*norm .or. part <= smallest_part) exit
        part = 0.5_wp*part
      end do
      if (part <= smallest_part .and. norm <= stalled*self%tolerance) then
        call find_residual(motion, residual)
        converged = .true.
        exit
      end if
      motion = trial
      residual = trial_residual
      norm = trial_norm
      converged = norm <= self%tolerance
    end do
    if (.not. converged) return
    state%load = load
    state%motion = motion
    state%slider = slider

  contains

    !> The residual at a motion, with what the next step is made of; R g is brought up to date by the rows of g that have changed.
    subroutine find_residual(at, residual)
      !> d, and the residual there [rows]
      real(wp), intent(in) :: at(:)
      real(wp), intent(out) :: residual(:)
      real(wp) :: change
      integer :: j

      call evaluate(self, at, state%slider, force, stiffness, slider)
      do j = 1, size(at)
        change = force(j) - self%springs(j)*at(j) - deviation(j)
        if (abs(change) <= 0.0_wp) cycle
        deviation(j) = deviation(j) + change
        response = response + change*self%flexibility(:, j)
      end do
      residual = self%unloaded + load*self%per_load - response - at
    end subroutine find_residual
  end subroutine solve

  !> delta d of the equation above.
  subroutine newton_step(self, residual, stiffness, step, status)
    class(condensed_equilibrium_type), intent(in) :: self
    !> r [rows]; d lambda / d d of each contact, by its rows [3, 3, contacts]
    real(wp), intent(in) :: residual(:), stiffness(:, :, :)
    !> delta d [rows]
    real(wp), intent(out) :: step(:)
    !> 0, or not: there is none
    integer, intent(out) :: status
    !> G of each contact; the rows of it that are not zero, and how many
    real(wp) :: left(3, 3, size(self%law))
    integer :: rows(size(residual)), owner(size(residual)), count, i, j, k
    real(wp), allocatable :: matrix(:, :), right(:, :)

    left = stiffness
    count = 0
    do i = 1, size(self%law)
      associate (first => self%law(i)%first_row)
        do k = 1, self%law(i)%tangents + 1
          associate (spring => self%springs(first + k - 1))
            left(k, k, i) = left(k, k, i) - spring
            if (all(abs(left(k, :, i)) <= rounding*spring)) cycle
          end associate
          count = count + 1
          rows(count) = first + k - 1
          owner(count) = i
        end do
      end associate
    end do
    allocate (matrix(count, count), right(count, 1), source=0.0_wp)
    do j = 1, count
      do i = 1, count
        associate (first => self%law(owner(i))%first_row, last => self%law(owner(i))%first_row + self%law(owner(i))%tangents)
          matrix(i, j) = dot_product(left(rows(i) - first + 1, :last - first + 1, owner(i)), self%flexibility(first:last, rows(j)))
        end associate
      end do
      matrix(j, j) = matrix(j, j) + 1.0_wp
    end do
    do i = 1, count
      associate (first => self%law(owner(i))%first_row, last => self%law(owner(i))%first_row + self%law(owner(i))%tangents)
        right(i, 1) = dot_product(left(rows(i) - first + 1, :last - first + 1, owner(i)), residual(first:last))
      end associate
    end do
    call solve_dense(matrix, right, status)
    step = residual
    do j = 1, count
      step = step - right(j, 1)*self%flexibility(:, rows(j))
    end do
  end subroutine newton_step

  !> Forces of all contacts at a motion, from the sliders of the equilibrium before.
  subroutine evaluate(self, motion, before, force, stiffness, slider)
    class(condensed_equilibrium_type), intent(in) :: self
    !> d [rows]; sliders of the equilibrium before [width, contacts]
    real(wp), intent(in) :: motion(:), before(:, :)
    !> lambda [rows] and its derivative by the contact's own rows [3, 3, contacts]
    real(wp), intent(out) :: force(:), stiffness(:, :, :)
    !> Where it takes the sliders [width, contacts]
    real(wp), intent(out) :: slider(:, :)
    integer :: i

    do i = 1, size(self%law)
      associate (first => self%law(i)%first_row, last => self%law(i)%first_row + self%law(i)%tangents)
        call evaluate_step(self%law(i), motion(first:last), before(:, i), force(first:last), stiffness(:, :, i), slider(:, i))
      end associate
    end do
  end subroutine evaluate

  !> The force of one contact where a step has taken it, by return to the friction limit.
  subroutine evaluate_step(law, motion, before, force, stiffness, slider)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> Relative displacements [tangents + 1]; sliders before, in pairs, one an element
    real(wp), intent(in) :: motion(:), before(:)
    !> T and N [tangents + 1], and their derivatives [3, 3]
    real(wp), intent(out) :: force(:), stiffness(:, :)
    !> Sliders after
    real(wp), intent(out) :: slider(:)
    type(contact_type) :: element
    real(wp) :: normal, limit(1), slope(1), pull(law%tangents), direction(law%tangents), size_of_pull
    integer :: i, k

    force = 0.0_wp
    stiffness = 0.0_wp
    slider = before
    associate (n => law%tangents)
      if (.not. is_closed(law, motion(n + 1))) then
        do i = 1, law%elements()
          slider(2*i - 1:2*i - 2 + n) = motion(:n)
        end do
        return
      end if
      normal = max(law%normal_force(motion(n + 1)), 0.0_wp)
      force(n + 1) = normal
      stiffness(n + 1, n + 1) = law%normal_stiffness
      do i = 1, law%elements()
        element = law%element(i)
        associate (kt => element%tangential_stiffness, w => slider(2*i - 1:2*i - 2 + n))
          call element%slip_force([normal], limit, slope)
          pull = kt*(motion(:n) - w)
          size_of_pull = norm2(pull)
          if (size_of_pull <= limit(1)) then
            force(:n) = force(:n) + pull
            do k = 1, n
              stiffness(k, k) = stiffness(k, k) + kt
            end do
          else
            direction = pull/size_of_pull
            force(:n) = force(:n) + limit(1)*direction
            w = motion(:n) - limit(1)/kt*direction
            do k = 1, n
              stiffness(:n, k) = stiffness(:n, k) - limit(1)*kt/size_of_pull*direction*direction(k)
              stiffness(k, k) = stiffness(k, k) + limit(1)*kt/size_of_pull
            end do
            stiffness(:n, n + 1) = stiffness(:n, n + 1) + slope(1)*law%normal_stiffness*direction
          end if
        end associate
      end do
    end associate
  end subroutine evaluate_step

  !> Does a contact touch?
  pure logical function is_closed(law, closing)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> v
    real(wp), intent(in) :: closing

    is_closed = law%normal_force(closing) >= law%touching_force([closing])
  end function is_closed
end module attrito_peak_condensed_equilibrium
