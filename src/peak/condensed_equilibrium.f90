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
!> path is an increment from the one before (`attrito_contact_straight_increment`), as the balance's are. If the load goes on as
!> before it also begins on the line through the last two equilibria. Every rank holds all contacts and does the same.
module attrito_peak_condensed_equilibrium
  use attrito_core_kinds, only: wp
  use attrito_core_lapack, only: solve_dense, subtract_product, times_vector
  use attrito_core_refined, only: solve_refined
  use attrito_contact_straight_increment, only: increment_type, follow_increment
  use attrito_model_contacts, only: contact_type
  implicit none
  private
  public :: condensed_equilibrium_type, equilibrium_type, new_condensed_equilibrium, on_the_line

  !> Newton's iterations for a step, and the smallest part of a step that is tried
  integer, parameter :: most_iterations = 50 ! guess
  real(wp), parameter :: smallest_step = 1.0_wp/128.0_wp ! guess
  !> Smallest part of Newton's step, and by what part of it the residual is to fall at least
  real(wp), parameter :: smallest_part = 1.0_wp/512.0_wp, least_fall = 1.0e-4_wp ! conventional
  !> Part of a spring, or of the friction limit, below which a difference from it is rounding
  real(wp), parameter :: rounding = 1.0e-12_wp ! derived
  !> What rounding may leave of a residual that falls no more, in tolerances
  real(wp), parameter :: stalled = 100.0_wp ! guess

  !> Where a path has come to
  type :: equilibrium_type
    !> alpha
    real(wp) :: load = 0.0_wp
    !> d [rows]; sliders in pairs, one an element [width, contacts]
    real(wp), allocatable :: motion(:), slider(:, :)
    !> alpha and d of the equilibrium before, if there is one
    real(wp), private :: load_before = 0.0_wp
    real(wp), allocatable, private :: motion_before(:)
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

  !> What the equations are made of at a motion
  type :: iterate_type
    !> g, and R g [rows]
    real(wp), allocatable :: deviation(:), response(:)
    !> lambda [rows], and d lambda / d d of each contact by its rows [3, 3, contacts]
    real(wp), allocatable :: force(:), stiffness(:, :, :)
    !> Where it takes the sliders [width, contacts]
    real(wp), allocatable :: slider(:, :)
  end type iterate_type

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
    call evaluate(self, rest%motion, rest%motion, rest%motion, rest%slider, force, stiffness, slider)
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
    real(wp) :: reached, step, aim

    now = state
    reached = 0.0_wp
    step = 1.0_wp
    do while (reached < 1.0_wp)
      step = min(step, 1.0_wp - reached)
      aim = state%load + (reached + step)*(load - state%load)
      converged = .false.
      if (goes_on(now, aim)) call solve(self, aim, on_the_line(now, aim), now, iterations, converged)
      if (.not. converged) call solve(self, aim, now%motion, now, iterations, converged)
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

  !> Is a load beyond the last two?
  pure logical function goes_on(state, load)
    !> Where the path has come to
    type(equilibrium_type), intent(in) :: state
    !> alpha
    real(wp), intent(in) :: load

    goes_on = allocated(state%motion_before)
    if (goes_on) goes_on = (load - state%load)*(state%load - state%load_before) > 0.0_wp
  end function goes_on

  !> Motion on the line through the last two equilibria, or where it is if the load turns back [rows].
  pure function on_the_line(state, load) result(motion)
    !> Where the path has come to
    type(equilibrium_type), intent(in) :: state
    !> alpha
    real(wp), intent(in) :: load
    real(wp) :: motion(size(state%motion))

    motion = state%motion
    if (.not. goes_on(state, load)) return
    motion = motion + (load - state%load)/(state%load - state%load_before)*(state%motion - state%motion_before)
  end function on_the_line

  !> q = phi^T M x, less its value at rest but for a constant.
  real(wp) function coordinate(self, state)
    class(condensed_equilibrium_type), intent(in) :: self
    !> Where the path has come to
    type(equilibrium_type), intent(in) :: state
    real(wp) :: force(size(self%springs)), stiffness(3, 3, size(self%law)), slider(size(state%slider, 1), size(self%law))

    call evaluate(self, state%motion, state%motion, state%motion, state%slider, force, stiffness, slider)
    coordinate = state%load*self%coordinate_per_load - sum(self%per_load*(force - self%springs*state%motion))
  end function coordinate

  !> Newton's method from a guess, with backtracking.
  subroutine solve(self, load, guess, state, iterations, converged)
    class(condensed_equilibrium_type), intent(in) :: self
    !> alpha; motion to begin with [rows]
    real(wp), intent(in) :: load, guess(:)
    !> Where the path has come to
    type(equilibrium_type), intent(inout) :: state
    !> Counts on
    integer, intent(inout) :: iterations
    !> Was there an equilibrium?
    logical, intent(out) :: converged
    type(iterate_type) :: iterate
    real(wp), dimension(size(self%springs)) :: motion, trial, residual, trial_residual, step
    real(wp) :: norm, trial_norm, part
    integer :: iteration, status

    motion = guess
    iterate = new_iterate(self, state%slider)
    call find_residual(self, load, state, motion, iterate, residual)
    norm = norm2(residual)
    converged = norm <= self%tolerance
    do iteration = 1, most_iterations
      if (converged) exit
      iterations = iterations + 1
      call newton_step(self, residual, iterate%stiffness, step, status)
      if (status /= 0) return
      part = 1.0_wp
      do
        trial = motion + part*step
        call find_residual(self, load, state, trial, iterate, trial_residual)
        trial_norm = norm2(trial_residual)
        if (trial_norm <= (1.0_wp - least_fall*part)*norm .or. part <= smallest_part) exit
        part = 0.5_wp*part
      end do
      if (part <= smallest_part .and. norm <= stalled*self%tolerance) then
        call find_residual(self, load, state, motion, iterate, residual)
        converged = .true.
        exit
      end if
      motion = trial
      residual = trial_residual
      norm = trial_norm
      converged = norm <= self%tolerance
    end do
    if (.not. converged) return
    state%load_before = state%load
    state%motion_before = state%motion
    state%load = load
    state%motion = motion
    state%slider = iterate%slider
  end subroutine solve

  !> What the equations are made of where nothing has been evaluated yet.
  pure function new_iterate(self, slider) result(iterate)
    class(condensed_equilibrium_type), intent(in) :: self
    !> Sliders of the equilibrium before [width, contacts]
    real(wp), intent(in) :: slider(:, :)
    type(iterate_type) :: iterate

    associate (rows => size(self%springs))
      allocate (iterate%deviation(rows), iterate%response(rows), iterate%force(rows), source=0.0_wp)
      allocate (iterate%stiffness(3, 3, size(self%law)), source=0.0_wp)
    end associate
    iterate%slider = slider
  end function new_iterate

  !> The residual at a motion, with what the next step is made of; R g is brought up to date by the rows of g that have changed.
  subroutine find_residual(self, load, before, motion, iterate, residual)
    class(condensed_equilibrium_type), intent(in) :: self
    !> alpha; d [rows]
    real(wp), intent(in) :: load, motion(:)
    !> The equilibrium before
    type(equilibrium_type), intent(in) :: before
    !> What the equations are made of at the motion evaluated last, then at this one
    type(iterate_type), intent(inout) :: iterate
    !> [rows]
    real(wp), intent(out) :: residual(:)
    real(wp) :: change
    integer :: j

    call evaluate(self, before%motion, on_the_line(before, load), motion, before%slider, iterate%force, iterate%stiffness, &
                  iterate%slider)
    do j = 1, size(motion)
      change = iterate%force(j) - self%springs(j)*motion(j) - iterate%deviation(j)
      if (abs(change) <= 0.0_wp) cycle
      iterate%deviation(j) = iterate%deviation(j) + change
      iterate%response = iterate%response + change*self%flexibility(:, j)
    end do
    residual = self%unloaded + load*self%per_load - iterate%response - motion
  end subroutine find_residual

  !> delta d of the equation above.
  subroutine newton_step(self, residual, stiffness, step, status)
    class(condensed_equilibrium_type), intent(in) :: self
    !> r [rows]; d lambda / d d of each contact, by its rows [3, 3, contacts]
    real(wp), intent(in) :: residual(:), stiffness(:, :, :)
    !> delta d [rows]
    real(wp), intent(out) :: step(:)
    !> 0, or not: there is none
    integer, intent(out) :: status
    !> Rows of G that are not zero and how many; of each its three entries, and the rows of B that they multiply
    real(wp) :: left(3, size(residual)), block(3, 3)
    integer :: rows(size(residual)), carriers(3, size(residual)), count, i, j, k
    real(wp), allocatable :: matrix(:, :), right(:)

    count = 0
    do i = 1, size(self%law)
      associate (first => self%law(i)%first_row, tangents => self%law(i)%tangents)
        block = stiffness(:, :, i)
        do k = 1, tangents + 1
          associate (spring => self%springs(first + k - 1))
            block(k, k) = block(k, k) - spring
            if (all(abs(block(k, :)) <= rounding*spring)) cycle
          end associate
          count = count + 1
          rows(count) = first + k - 1
          left(:, count) = block(k, :)
          ! A contact of one tangent has no third row: its entry there is zero.
          carriers(:, count) = [first, first + 1, first + tangents]
        end do
      end associate
    end do
    allocate (matrix(count, count), right(count))
    do j = 1, count
      associate (column => self%flexibility(:, rows(j)))
        do i = 1, count
          matrix(i, j) = left(1, i)*column(carriers(1, i)) + left(2, i)*column(carriers(2, i)) + left(3, i)*column(carriers(3, i))
        end do
      end associate
      matrix(j, j) = matrix(j, j) + 1.0_wp
    end do
    do i = 1, count
      right(i) = dot_product(left(:, i), residual(carriers(:, i)))
    end do
    call solve_refined(matrix, right, status)
    step = residual
    do j = 1, count
      step = step - right(j)*self%flexibility(:, rows(j))
    end do
  end subroutine newton_step

  !> Forces of all contacts at a motion, which they come to straight from the equilibrium before, and from its sliders.
  subroutine evaluate(self, from, as_before, motion, before, force, stiffness, slider)
    class(condensed_equilibrium_type), intent(in) :: self
    !> d of the equilibrium before, where it would be if it went on as before, and d [rows]; sliders of the equilibrium before [width,
    !> contacts]
    real(wp), intent(in) :: from(:), as_before(:), motion(:), before(:, :)
    !> lambda [rows] and its derivative by the contact's own rows [3, 3, contacts]
    real(wp), intent(out) :: force(:), stiffness(:, :, :)
    !> Where it takes the sliders [width, contacts]
    real(wp), intent(out) :: slider(:, :)
    type(increment_type) :: increment
    integer :: i

    do i = 1, size(self%law)
      associate (law => self%law(i), first => self%law(i)%first_row, last => self%law(i)%first_row + self%law(i)%tangents)
        call follow_increment(law, from(first:last), as_before(first:last), motion(first:last), before(:, i), increment)
        force(first:last) = increment%force(:law%tangents + 1)
        stiffness(:, :, i) = increment%stiffness
        slider(:, i) = increment%slider
      end associate
    end do
  end subroutine evaluate

  !> Does a contact touch?
  pure logical function is_closed(law, closing)
    !> Contact: its springs and its law
    type(contact_type), intent(in) :: law
    !> v
    real(wp), intent(in) :: closing

    is_closed = law%normal_force(closing) >= law%touching_force([closing])
  end function is_closed
end module attrito_peak_condensed_equilibrium
