!> Where the next point of a branch is expected, and the plane that it is solved in.
!>
!> A point that was solved already and turned out to lie too far ahead comes first. Else the cubic of the last arc
!> (`attrito_continuation_arc`) is followed beyond its end, or the tangent where there is no such arc, or where the cubic bends too
!> much to be trusted. The plane lies across the way there from the present point, by which arcs of up to a half circle are crossed.
module attrito_continuation_predictor
  use attrito_core_kinds, only: wp
  use attrito_core_state_store, only: state_store_type
  use attrito_core_trigonometric, only: resized
  use attrito_newton_border, only: constraint_type, inner_product
  use attrito_solve_rebalancing, only: field_type
  use attrito_solve_rigid_drift, only: mean_share
  use attrito_solve_solver, only: solver_type
  use attrito_continuation_arc, only: hermite
  use attrito_continuation_step, only: step_type
  use attrito_continuation_tangent, only: tangent_type, share_of_harmonics
  implicit none
  private
  public :: predictor_type, prediction_type, middle_of

  !> Distance between the ends of cubic and tangent, as a part of the step, beyond which the cubic is not trusted
  real(wp), parameter :: most_bent = 0.7_wp ! guess
  !> Length of the last arc times which it is followed at most
  real(wp), parameter :: farthest = 3.0_wp ! guess

  !> A motion [2 H + 1, rows] and an angular frequency
  type :: place_type
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp
  end type place_type

  !> Where a point is expected, and the condition that it is to meet
  type :: prediction_type
    real(wp), allocatable :: motion(:, :)
    real(wp) :: omega = 0.0_wp
    type(constraint_type) :: constraint
    !> Straight way there, means left out
    real(wp) :: length = 0.0_wp
  contains
    procedure :: go_to_frequency
  end type prediction_type

  type :: predictor_type
    !> The last arc: its beginning, the tangent there and its length; 0: there is none
    type(place_type), private :: begin
    type(tangent_type), private :: tangent
    real(wp), private :: length = 0.0_wp
    !> Points ahead, the next one last
    type(place_type), allocatable, private :: ahead(:)
  contains
    procedure :: forget
    procedure :: take_arc
    procedure :: put_ahead
    procedure :: next_ahead
    procedure :: drop_ahead
    procedure :: predict
    procedure :: set_coefficients
    procedure :: give_fields
    procedure :: take_fields
    procedure :: keep
  end type predictor_type

contains

  !> Forget all about the branch.
  pure subroutine forget(self)
    class(predictor_type), intent(inout) :: self

    self%length = 0.0_wp
    self%begin = place_type()
    self%tangent = tangent_type()
    if (allocated(self%ahead)) deallocate (self%ahead)
  end subroutine forget

  !> Remember the arc of the step just made.
  subroutine take_arc(self, step)
    class(predictor_type), intent(inout) :: self
    !> Step along the branch
    type(step_type), intent(in) :: step

    self%length = step%length
    if (self%length <= 0.0_wp) return
    self%begin = place_type(step%from%motion, step%from%omega)
    self%tangent = step%start
    if (allocated(self%tangent%slider)) deallocate (self%tangent%slider)
  end subroutine take_arc

  !> This point lies ahead of the one that is looked for next.
  subroutine put_ahead(self, motion, omega)
    class(predictor_type), intent(inout) :: self
    !> Coefficients of relative displacement, by harmonic and row; angular frequency, rad/s
    real(wp), intent(in) :: motion(:, :), omega

    if (.not. allocated(self%ahead)) allocate (self%ahead(0))
    self%ahead = [self%ahead, place_type(motion, omega)]
  end subroutine put_ahead

  !> The nearest point ahead, which is forgotten; not allocated: there is none.
  subroutine next_ahead(self, solver, prediction)
    class(predictor_type), intent(inout) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Where the point is expected
    type(prediction_type), intent(out) :: prediction

    if (.not. allocated(self%ahead)) return
    associate (last => self%ahead(size(self%ahead)))
      call across_way(solver, last%motion, last%omega, prediction)
    end associate
    self%ahead = self%ahead(:size(self%ahead) - 1)
    if (size(self%ahead) == 0) deallocate (self%ahead)
  end subroutine next_ahead

  !> Points ahead turned out not to be met.
  pure subroutine drop_ahead(self)
    class(predictor_type), intent(inout) :: self

    if (allocated(self%ahead)) deallocate (self%ahead)
  end subroutine drop_ahead

  !> A step of a length from the solver's present point.
  subroutine predict(self, solver, tangent, length, by_arc, prediction)
    class(predictor_type), intent(in) :: self
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Tangent of the branch there
    type(tangent_type), intent(in) :: tangent
    !> Length of the step, means left out
    real(wp), intent(in) :: length
    !> May the last arc be followed?
    logical, intent(in) :: by_arc
    !> Where the point is expected
    type(prediction_type), intent(out) :: prediction
    real(wp), allocatable :: motion(:, :), off(:, :)
    real(wp) :: omega, weights(4)

    associate (context => solver%context)
      prediction%motion = solver%motion + length*tangent%reach()*context%motion_scale*tangent%motion
      prediction%omega = solver%omega + length*tangent%reach()*context%frequency_scale*tangent%omega
      prediction%length = length
      if (by_arc .and. self%length > 0.0_wp .and. length <= farthest*self%length .and. tangent%share > mean_share) then
        weights = hermite(1.0_wp + length/self%length)
        weights([2, 4]) = self%length*weights([2, 4])/[self%tangent%share, tangent%share]
        motion = weights(1)*self%begin%motion + weights(3)*solver%motion &
                 + context%motion_scale*(weights(2)*self%tangent%motion + weights(4)*tangent%motion)
        omega = weights(1)*self%begin%omega + weights(3)*solver%omega &
                + context%frequency_scale*(weights(2)*self%tangent%omega + weights(4)*tangent%omega)
        off = (motion - prediction%motion)/context%motion_scale
        if (share_of_harmonics(solver, off, (omega - prediction%omega)/context%frequency_scale) < most_bent*length) then
          call across_way(solver, motion, omega, prediction)
          return
        end if
      end if
      prediction%constraint%motion = tangent%across()/context%motion_scale
      prediction%constraint%frequency = tangent%omega/context%frequency_scale
      prediction%constraint%value = inner_product(context%balance, prediction%constraint%motion, prediction%motion) &
                                    + prediction%constraint%frequency*prediction%omega
    end associate
  end subroutine predict

  !> Let the point be sought at the frequency at which it is expected, not in a plane across the branch.
  subroutine go_to_frequency(self, solver)
    class(prediction_type), intent(inout) :: self
    !> Solver of points: its scale of frequencies
    type(solver_type), intent(in) :: solver

    self%constraint%motion = 0.0_wp*self%motion
    self%constraint%frequency = 1.0_wp/solver%context%frequency_scale
    self%constraint%value = self%constraint%frequency*self%omega
  end subroutine go_to_frequency

  !> A point, and the plane there across the straight way to it, means left out.
  subroutine across_way(solver, motion, omega, prediction)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Coefficients of relative displacement, by harmonic and row; angular frequency, rad/s
    real(wp), intent(in) :: motion(:, :), omega
    !> Where the point is expected
    type(prediction_type), intent(inout) :: prediction

    prediction%motion = resized(motion, size(solver%motion, 1))
    prediction%omega = omega
    associate (context => solver%context, constraint => prediction%constraint, length => prediction%length)
      constraint%motion = (prediction%motion - solver%motion)/context%motion_scale
      constraint%motion(1, :) = 0.0_wp
      constraint%frequency = (omega - solver%omega)/context%frequency_scale
      length = share_of_harmonics(solver, constraint%motion, constraint%frequency)
      constraint%motion = constraint%motion/(length*context%motion_scale)
      constraint%frequency = constraint%frequency/(length*context%frequency_scale)
      constraint%value = inner_product(context%balance, constraint%motion, prediction%motion) + constraint%frequency*omega
    end associate
  end subroutine across_way

  !> A part of a step's arc.
  function middle_of(solver, step, part) result(prediction)
    !> Solver of points: its motion, sliders, angular frequency and balance
    type(solver_type), intent(in) :: solver
    !> Step along the branch
    type(step_type), intent(in) :: step
    !> 0 to 1
    real(wp), intent(in) :: part
    type(prediction_type) :: prediction

    call step%constraint_at(solver, part, prediction%motion, prediction%omega, prediction%constraint)
  end function middle_of

  !> Resize stored vectors to so many coefficients.
  pure subroutine set_coefficients(self, coefficients)
    class(predictor_type), intent(inout) :: self
    !> Coefficients of each row, 2 H + 1
    integer, intent(in) :: coefficients

    if (allocated(self%begin%motion)) self%begin%motion = resized(self%begin%motion, coefficients)
    if (allocated(self%tangent%motion)) self%tangent%motion = resized(self%tangent%motion, coefficients)
  end subroutine set_coefficients

  !> Hand stored vectors over, to move with the contacts.
  subroutine give_fields(self, fields)
    class(predictor_type), intent(inout) :: self
    !> Fields that move with the contacts
    type(field_type), allocatable, intent(out) :: fields(:)
    integer :: i, count

    count = 0
    if (allocated(self%ahead)) count = size(self%ahead)
    allocate (fields(2 + count))
    if (allocated(self%begin%motion)) call move_alloc(self%begin%motion, fields(1)%columns)
    if (allocated(self%tangent%motion)) call move_alloc(self%tangent%motion, fields(2)%columns)
    do i = 1, count
      call move_alloc(self%ahead(i)%motion, fields(2 + i)%columns)
    end do
  end subroutine give_fields

  !> Take them back.
  subroutine take_fields(self, fields)
    class(predictor_type), intent(inout) :: self
    !> Fields that move with the contacts
    type(field_type), intent(inout) :: fields(:)
    integer :: i

    if (allocated(fields(1)%columns)) call move_alloc(fields(1)%columns, self%begin%motion)
    if (allocated(fields(2)%columns)) call move_alloc(fields(2)%columns, self%tangent%motion)
    do i = 3, size(fields)
      call move_alloc(fields(i)%columns, self%ahead(i - 2)%motion)
    end do
  end subroutine take_fields

  !> Save to a store, or load from it.
  subroutine keep(self, store)
    class(predictor_type), intent(inout) :: self
    !> Numbers that a point leaves for the next, written or read in turn
    type(state_store_type), intent(inout) :: store
    integer :: i, count

    call store%keep(self%begin%motion)
    call store%keep(self%begin%omega)
    call self%tangent%keep(store)
    call store%keep(self%length)
    count = 0
    if (allocated(self%ahead)) count = size(self%ahead)
    call store%keep(count)
    if (store%reading) then
      call self%drop_ahead()
      if (count > 0) allocate (self%ahead(count))
    end if
    do i = 1, count
      call store%keep(self%ahead(i)%motion)
      call store%keep(self%ahead(i)%omega)
    end do
  end subroutine keep
end module attrito_continuation_predictor
